/* SPDX-License-Identifier: MIT
 * config_text.c - bounded text building. Numbers are written from integers: no rounding by the library, no locale.
 */
#include "config/config_text.h"

#include <stdarg.h>
#include <stdio.h>

#define ESCAPED_MAX 40u
#define DIGITS_MAX  6u /* five decimals tell any two Q16.16 values apart */

void config_text_clear(config_text_t *self)
{
    self->length = 0;
    self->data[0] = '\0';
}

void config_text_add(config_text_t *self, const char *format, ...)
{
    const size_t room = sizeof self->data - self->length;
    va_list arguments;
    va_start(arguments, format);
    const int written = vsnprintf(self->data + self->length, room, format, arguments);
    va_end(arguments);
    if (written > 0) {
        self->length += (size_t)written < room ? (size_t)written : room - 1u;
    }
}

/* Bytes of a sign that nobody takes for another one: a degree sign, Chinese and Japanese writing and its punctuation. Letters of
 * other alphabets may look like ours, and stay \xNN. Returns 0 where there is none. */
static size_t legible(const char *text, size_t length)
{
    const unsigned char *byte = (const unsigned char *)text;
    if (length >= 2u && byte[0] == 0xC2u && byte[1] == 0xB0u) {
        return 2;
    }
    const bool is_lead = length >= 3u && ((byte[0] >= 0xE3u && byte[0] <= 0xE9u) || (byte[0] == 0xEFu && byte[1] == 0xBCu));
    return is_lead && (byte[1] & 0xC0u) == 0x80u && (byte[2] & 0xC0u) == 0x80u ? 3 : 0;
}

void config_text_add_escaped(config_text_t *self, const char *text, size_t length)
{
    const size_t shown = length < ESCAPED_MAX ? length : ESCAPED_MAX;
    for (size_t i = 0; i < shown; i++) {
        const unsigned char byte = (unsigned char)text[i];
        const size_t sign = legible(&text[i], length - i);
        if (sign > 0) {
            config_text_add(self, "%.*s", (int)sign, &text[i]);
            i += sign - 1u;
            continue;
        }
        const bool is_plain = byte >= 0x20u && byte < 0x7Fu && byte != '"' && byte != '\\';
        config_text_add(self, is_plain ? "%c" : "\\x%02X", byte);
    }
    config_text_add(self, "%s", length > shown ? "..." : "");
}

void config_text_add_quoted(config_text_t *self, const char *text, size_t length)
{
    config_text_add(self, "\"");
    config_text_add_escaped(self, text, length);
    config_text_add(self, "\"");
}

/* Appends value / 10^digits, without the zeros at its end. */
static void add_scaled(config_text_t *self, int64_t value, unsigned digits)
{
    int64_t unit = 1;
    while (digits > 0 && value % 10 == 0) {
        value /= 10;
        digits--;
    }
    for (unsigned i = 0; i < digits; i++) {
        unit *= 10;
    }
    const int64_t magnitude = value < 0 ? -value : value;
    config_text_add(self, "%s%lld", value < 0 ? "-" : "", (long long)(magnitude / unit));
    if (digits > 0) {
        config_text_add(self, ".%0*lld", (int)digits, (long long)(magnitude % unit));
    }
}

void config_text_add_milli(config_text_t *self, int64_t value_milli)
{
    add_scaled(self, value_milli, 3);
}

/* value * numerator / denominator to the nearest, halves away from zero; small enough values only. */
static int64_t rescale(int64_t value, int64_t numerator, int64_t denominator)
{
    const int64_t product = value * numerator;
    const int64_t half = product < 0 ? -(denominator / 2) : denominator / 2;
    return (product + half) / denominator;
}

void config_text_add_q16(config_text_t *self, q16_t value_q16)
{
    int64_t unit = 1;
    for (unsigned digits = 0; digits <= DIGITS_MAX; digits++, unit *= 10) {
        const int64_t scaled = rescale(value_q16, unit, Q16_ONE);
        if (rescale(scaled, Q16_ONE, unit) == value_q16) {
            add_scaled(self, scaled, digits);
            return;
        }
    }
}
