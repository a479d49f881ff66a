/* SPDX-License-Identifier: MIT
 * json.c - JSON writer; see json.h.
 */
#include "common/json.h"

#include <string.h>

#include "common/decimal.h"

#define PLACES 6u

void json_start(json_t *self, char *buffer, size_t capacity)
{
    *self = (json_t){.capacity = capacity};
    self->at = buffer;
}

static void put_bytes(json_t *self, const char *bytes, size_t length)
{
    if (self->is_cut || self->capacity - self->length < length) {
        self->is_cut = true;
        return;
    }
    memcpy(&self->at[self->length], bytes, length);
    self->length += length;
}

static void put_char(json_t *self, char c)
{
    put_bytes(self, &c, 1);
}

static void put_escaped(json_t *self, char c)
{
    if (c == '"' || c == '\\') {
        put_char(self, '\\');
        put_char(self, c);
    } else if (c >= ' ' && c <= '~') {
        put_char(self, c);
    } else {
        char code[6] = {'\\', 'u', '0', '0'};
        (void)decimal_put_hex(&code[4], (uint8_t)c, 2);
        put_bytes(self, code, sizeof code);
    }
}

/* Bytes of the character of more than one byte that begins here, as RFC 3629 has them; 0 where none does. */
static size_t utf8_bytes(const char *text)
{
    const unsigned char lead = (unsigned char)text[0], second = (unsigned char)text[1];
    const size_t bytes = lead >= 0xf5 || lead < 0xc2 ? 0 : lead >= 0xf0 ? 4 : lead >= 0xe0 ? 3 : 2;
    const bool is_beyond = (lead == 0xe0 && second < 0xa0) || (lead == 0xed && second > 0x9f) ||
                           (lead == 0xf0 && second < 0x90) ||
                           (lead == 0xf4 && second > 0x8f); /* too long a form, half a pair of UTF-16, more than U+10FFFF */
    for (size_t i = 1; i < bytes; i++) {
        if (((unsigned char)text[i] & 0xc0u) != 0x80) {
            return 0;
        }
    }
    return is_beyond ? 0 : bytes;
}

static void put_quoted(json_t *self, const char *text)
{
    put_char(self, '"');
    while (*text != '\0') {
        const size_t bytes = utf8_bytes(text);
        if (bytes == 0) {
            put_escaped(self, *text++);
        } else {
            put_bytes(self, text, bytes);
            text += bytes;
        }
    }
    put_char(self, '"');
}

/* What stands before a value: the comma after the last one, and the key. */
static void begin_value(json_t *self, const char *key)
{
    if (self->is_comma_due) {
        put_char(self, ',');
    }
    if (key != NULL) {
        put_quoted(self, key);
        put_char(self, ':');
    }
    self->is_comma_due = true;
}

void json_open(json_t *self, const char *key, char bracket)
{
    begin_value(self, key);
    put_char(self, bracket);
    self->is_comma_due = false;
}

void json_close(json_t *self, char bracket)
{
    put_char(self, bracket);
    self->is_comma_due = true;
}

void json_text(json_t *self, const char *key, const char *text)
{
    begin_value(self, key);
    put_quoted(self, text);
}

void json_number(json_t *self, const char *key, uint64_t number)
{
    char digits[DECIMAL_U64_MAX];
    begin_value(self, key);
    put_bytes(self, digits, decimal_put_u64(digits, number));
}

void json_integer(json_t *self, const char *key, int64_t number)
{
    char digits[DECIMAL_U64_MAX];
    begin_value(self, key);
    if (number < 0) {
        put_bytes(self, "-", 1);
    }
    put_bytes(self, digits, decimal_put_u64(digits, number < 0 ? 0u - (uint64_t)number : (uint64_t)number));
}

void json_q32(json_t *self, const char *key, q32_t value_q32)
{
    char digits[DECIMAL_Q32_MAX];
    begin_value(self, key);
    put_bytes(self, digits, decimal_put_q32(digits, value_q32, PLACES));
}

void json_ms(json_t *self, const char *key, uint64_t value_us)
{
    char digits[DECIMAL_MS_MAX];
    begin_value(self, key);
    put_bytes(self, digits, decimal_put_ms(digits, value_us));
}

void json_bool(json_t *self, const char *key, bool value)
{
    begin_value(self, key);
    put_bytes(self, value ? "true" : "false", value ? 4 : 5);
}

void json_null(json_t *self, const char *key)
{
    begin_value(self, key);
    put_bytes(self, "null", 4);
}

void json_newline(json_t *self)
{
    put_char(self, '\n');
    self->is_comma_due = false;
}
