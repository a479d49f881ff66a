/* SPDX-License-Identifier: MIT
 * value_can.h - values that only CAN drives have: identifiers, ratios, frames, conditions. Text to value and back.
 * Called by value.c and value_text.c for the types CONFIG_NAME to CONFIG_WHEN.
 */
#ifndef HEAVE_CONFIG_VALUE_CAN_H
#define HEAVE_CONFIG_VALUE_CAN_H

#include "config/keys.h"
#include "config/text.h"

/** As config_value_parse(), into the field itself. */
bool config_value_can_parse(const config_key_t *key, const char *text, void *field, config_text_t *why);

/** As config_value_format(), from the field itself. */
void config_value_can_format(const config_key_t *key, const void *field, config_text_t *text);

/** As config_value_allowed(). */
void config_value_can_allowed(const config_key_t *key, config_text_t *text);

#endif
