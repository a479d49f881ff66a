/* SPDX-License-Identifier: MIT
 * value.h - one value of the configuration file: text to config_t and back, by the type its key has.
 */
#ifndef HEAVE_CONFIG_VALUE_H
#define HEAVE_CONFIG_VALUE_H

#include "config/keys.h"
#include "config/span.h"

/** Stores a value.
 *  @param text   without blanks around it
 *  @param count  out: how many values a list had
 *  @param why    takes what is wrong and what is allowed, where the text is refused
 *  @return false where it is refused (config unchanged but for values of the same key) */
bool config_value_parse(const config_key_t *key, const char *text, config_t *config, unsigned *count, config_text_t *why);

/** Appends a value as it stands in a file. */
void config_value_format(const config_key_t *key, const config_t *config, config_text_t *text);

/** Appends what the key takes: "a number from -90 to 90 deg". */
void config_value_allowed(const config_key_t *key, config_text_t *text);

/* --- For the types --- */

/** Says what is wrong with an item, or with the number of items of a list, then what is allowed.
 *  @return false */
bool config_value_reject(const config_key_t *key, span_t item, const char *what, config_text_t *why);
bool config_value_reject_text(const config_key_t *key, const char *item, const char *what, config_text_t *why);
bool config_value_reject_count(const config_key_t *key, unsigned count, config_text_t *why);

/** Appends the range of numbers: " from -90 to 90 deg". */
void config_value_add_range(const config_key_t *key, config_text_t *text);

/** Stores a whole number in a field of 1, 2 or 4 bytes, and reads it back; 4 bytes are signed. */
void config_value_store(void *field, size_t size, int64_t value);
int64_t config_value_load(const void *field, size_t size);

#endif
