/* SPDX-License-Identifier: MIT
 * value_canopen.h - values that only CANopen drives have: nodes with their axes, modes of operation, maps of PDOs. Text to value
 * and back. Called by value.c and value_text.c for the types CONFIG_NODES to CONFIG_MAPS.
 */
#ifndef HEAVE_CONFIG_VALUE_CANOPEN_H
#define HEAVE_CONFIG_VALUE_CANOPEN_H

#include "config/keys.h"
#include "config/text.h"

/** As config_value_parse(), into the field itself. */
bool config_value_canopen_parse(const config_key_t *key, const char *text, void *field, config_text_t *why);

/** As config_value_format(), from the field itself. */
void config_value_canopen_format(const config_key_t *key, const void *field, config_text_t *text);

/** As config_value_allowed(). */
void config_value_canopen_allowed(const config_key_t *key, config_text_t *text);

#endif
