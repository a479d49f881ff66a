/* SPDX-License-Identifier: MIT
 * text.c - lines of text in buffers of fixed size.
 */
#include "heave/text.h"

text_t text_start(char *buffer, size_t capacity)
{
    buffer[0] = '\0';
    return (text_t){.at = buffer, .capacity = capacity};
}

void text_put_char(text_t *self, char c)
{
    if (self->length + 1 < self->capacity) {
        self->at[self->length++] = c;
        self->at[self->length] = '\0';
    }
}

void text_put(text_t *self, const char *string)
{
    while (*string != '\0') {
        text_put_char(self, *string++);
    }
}

void text_put_u32(text_t *self, uint32_t number)
{
    char digits[10];
    unsigned count = 0;
    //@ loop unroll 10;
    do {
        digits[count++] = (char)('0' + number % 10);
        number /= 10;
    } while (number != 0);
    while (count > 0) {
        text_put_char(self, digits[--count]);
    }
}

void text_put_hex(text_t *self, uint32_t number, unsigned digits_min)
{
    static const char k_digits[] = "0123456789ABCDEF";
    for (unsigned digit = 8; digit > 0;) {
        digit--;
        if (digit < digits_min || number >> (4 * digit) != 0) {
            text_put_char(self, k_digits[(number >> (4 * digit)) & 0xFu]);
        }
    }
}

void text_put_escaped(text_t *self, const uint8_t *bytes, size_t length)
{
    for (size_t i = 0; i < length; i++) {
        const uint8_t byte = bytes[i];
        if (byte == '\\') {
            text_put(self, "\\\\");
        } else if (byte >= ' ' && byte <= '~') {
            text_put_char(self, (char)byte);
        } else if (byte == '\r' || byte == '\n') {
            text_put(self, byte == '\r' ? "\\r" : "\\n");
        } else {
            text_put(self, "\\x");
            text_put_hex(self, byte, 2);
        }
    }
}

void text_put_q32(text_t *self, q32_t value_q32, unsigned decimals)
{
    uint32_t unit = 1;
    for (unsigned i = 0; i < decimals; i++) {
        unit *= 10u;
    }
    const q32_t parts = fx_mul_shift(fx_abs(value_q32), unit, 32);
    text_put(self, value_q32 < 0 ? "-" : "");
    text_put_u32(self, (uint32_t)(parts / unit));
    if (decimals > 0) {
        text_put(self, ".");
    }
    for (uint32_t below = unit / 10u; below > 0; below /= 10u) {
        text_put_u32(self, (uint32_t)(parts / below % 10));
    }
}
