/* SPDX-License-Identifier: MIT
 * value_modbus.h - values that only Modbus drives have: hosts, blocks of registers, start-up lists. Text to value and
 * back. Called by value.c and value_text.c for the types CONFIG_HOSTS to CONFIG_ITEMS.
 */
#ifndef HEAVE_CONFIG_VALUE_MODBUS_H
#define HEAVE_CONFIG_VALUE_MODBUS_H

#include "config/keys.h"
#include "config/text.h"

/** As config_value_parse(), into the field itself. */
bool config_value_modbus_parse(const config_key_t *key, const char *text, void *field, config_text_t *why);

/** As config_value_format(), from the field itself. */
void config_value_modbus_format(const config_key_t *key, const void *field, config_text_t *text);

/** As config_value_allowed(). */
void config_value_modbus_allowed(const config_key_t *key, config_text_t *text);

#endif
