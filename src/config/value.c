/* SPDX-License-Identifier: MIT
 * value.c - one value of the configuration file; see value.h. How it is written is its type's.
 */
#include "config/value.h"

#include "common/translate.h"
#include "config/slip.h"

#include <string.h>

static bool parse(const config_key_t *key, const char *text, void *field, config_text_t *why)
{
    if (key->type->has_none && strcmp(text, "none") == 0) {
        memset(field, 0, key->size);
        return true;
    }
    return key->type->parse(key, text, field, why);
}

bool config_value_parse(const config_key_t *key, const char *text, config_t *config, unsigned *count, config_text_t *why)
{
    config_text_t slip;
    *count = span_count_items(text);
    if (parse(key, text, (char *)config + key->offset, why)) {
        return true;
    }
    config_text_clear(&slip);
    if (config_slip_find(key, text, &slip)) {
        config_text_add(&slip, _("; allowed: "));
        config_value_allowed(key, &slip);
        *why = slip;
    }
    return false;
}

void config_value_format(const config_key_t *key, const config_t *config, config_text_t *text)
{
    const size_t length = text->length;
    key->type->format(key, config, (const char *)config + key->offset, text);
    if (text->length == length) {
        config_text_add(text, "none");
    }
}

void config_value_allowed(const config_key_t *key, config_text_t *text)
{
    key->type->allowed(key, text);
}

bool config_value_reject(const config_key_t *key, span_t item, const char *what, config_text_t *why)
{
    config_text_add_quoted(why, item.at, item.length);
    config_text_add(why, _(" %s; allowed: "), what);
    config_value_allowed(key, why);
    return false;
}

bool config_value_reject_text(const config_key_t *key, const char *item, const char *what, config_text_t *why)
{
    return config_value_reject(key, (span_t){item, strlen(item)}, what, why);
}

bool config_value_reject_count(const config_key_t *key, unsigned count, config_text_t *why)
{
    config_text_add(why, translate_count("has %u value; allowed: ", "has %u values; allowed: ", count), count);
    config_value_allowed(key, why);
    return false;
}

void config_value_add_range(const config_key_t *key, config_text_t *text)
{
    config_text_add(text, _(" from "));
    config_text_add_milli(text, key->low_milli);
    config_text_add(text, _(" to "));
    config_text_add_milli(text, key->high_milli);
    config_text_add(text, "%s%s", key->unit[0] == '\0' ? "" : " ", translate(key->unit));
}

void config_value_store(void *field, size_t size, int64_t value)
{
    if (size == 1u) {
        *(uint8_t *)field = (uint8_t)value;
    } else if (size == 2u) {
        *(uint16_t *)field = (uint16_t)value;
    } else {
        *(uint32_t *)field = (uint32_t)value;
    }
}

int64_t config_value_load(const void *field, size_t size)
{
    if (size == 1u) {
        return *(const uint8_t *)field;
    }
    if (size == 2u) {
        return *(const uint16_t *)field;
    }
    return *(const int32_t *)field; /* no range goes above that of int32_t */
}
