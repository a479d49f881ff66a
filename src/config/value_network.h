/* SPDX-License-Identifier: MIT
 * value_network.h - values that are addresses: of this machine, of a multicast group, of networks. Called by value.c for the
 * types CONFIG_ADDRESS, CONFIG_GROUP and CONFIG_NETWORKS. Each is as config_value_parse(), into the field itself.
 */
#ifndef HEAVE_CONFIG_VALUE_NETWORK_H
#define HEAVE_CONFIG_VALUE_NETWORK_H

#include "config/keys.h"
#include "config/span.h"
#include "config/text.h"

bool config_value_network_parse_address(const config_key_t *key, span_t item, char *field, config_text_t *why);
bool config_value_network_parse_group(const config_key_t *key, span_t item, char *field, config_text_t *why);
bool config_value_network_parse_list(const config_key_t *key, const char *text, hal_udp_networks_t *networks, config_text_t *why);

#endif
