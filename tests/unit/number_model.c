/* SPDX-License-Identifier: MIT
 * number_model.c - decimal text by schoolbook arithmetic on digit arrays, for tests.
 * Shares nothing with the parser: it checks the grammar on the whole text and doubles the decimals digit by digit, so it is exact
 * for every text of up to MODEL_DIGITS digits.
 */
#include "number_model.h"

#include <string.h>

#define MODEL_DIGITS 1200

typedef struct {
    bool is_negative;
    long exponent;
    char digits[MODEL_DIGITS]; /* all digits of the mantissa */
    long integer_digits;
    long count;
} model_t;

static const char *skip_blanks(const char *text)
{
    while (*text == ' ' || *text == '\t' || *text == '\r' || *text == '\n') {
        text++;
    }
    return text;
}

static const char *model_mantissa(model_t *self, const char *text)
{
    for (bool is_behind_point = false; (*text >= '0' && *text <= '9') || (*text == '.' && !is_behind_point); text++) {
        if (*text == '.') {
            is_behind_point = true;
        } else {
            self->digits[self->count++] = (char)(*text - '0');
            self->integer_digits += !is_behind_point;
        }
    }
    return text;
}

/* NULL where there is no exponent behind the E. */
static const char *model_exponent(model_t *self, const char *text)
{
    if (*text != 'e' && *text != 'E') {
        return text;
    }
    text++;
    const bool is_negative = *text == '-';
    text += *text == '-' || *text == '+';
    if (*text < '0' || *text > '9') {
        return NULL;
    }
    for (; *text >= '0' && *text <= '9'; text++) {
        self->exponent = self->exponent > 1000000 ? self->exponent : self->exponent * 10 + (*text - '0');
    }
    self->exponent = is_negative ? -self->exponent : self->exponent;
    return text;
}

/* Doubles a decimal fraction in place; returns what moves before the point. */
static unsigned model_double(char *fraction, long count)
{
    unsigned carry = 0;
    for (long i = count - 1; i >= 0; i--) {
        const unsigned doubled = 2u * (unsigned)fraction[i] + carry;
        fraction[i] = (char)(doubled % 10);
        carry = doubled / 10;
    }
    return carry;
}

/* -1, 0, 1: below, at, above a half. */
static int model_half(const char *fraction, long count)
{
    if (count == 0 || fraction[0] != 5) {
        return count > 0 && fraction[0] > 5 ? 1 : -1;
    }
    for (long i = 1; i < count; i++) {
        if (fraction[i] != 0) {
            return 1;
        }
    }
    return 0;
}

static bool model_is_zero(const model_t *self)
{
    for (long i = 0; i < self->count; i++) {
        if (self->digits[i] != 0) {
            return false;
        }
    }
    return true;
}

/* The magnitude times 2^bits, rounded; saturates at 1e15. */
static uint64_t model_magnitude(const model_t *self, unsigned bits)
{
    static char fraction[2 * MODEL_DIGITS];
    const long point = self->integer_digits + self->exponent;
    uint64_t value = 0;
    long count = 0;
    if (model_is_zero(self) || point < -MODEL_DIGITS) {
        return 0;
    }
    for (long i = 0; i < point; i++) {
        value = value > UINT64_C(1000000000000000) ? value : value * 10 + (i < self->count ? (uint64_t)self->digits[i] : 0u);
        if (i > 2 * MODEL_DIGITS) {
            break;
        }
    }
    for (long i = point; i < self->count; i++) {
        fraction[count++] = i < 0 ? 0 : self->digits[i];
    }
    for (unsigned bit = 0; bit < bits && value < UINT64_C(1000000000000000); bit++) {
        value = 2 * value + model_double(fraction, count);
    }
    const int half = model_half(fraction, count);
    return value + (half > 0 || (half == 0 && value % 2 == 1));
}

static number_error_t model_read(model_t *self, const char *text)
{
    memset(self, 0, sizeof *self);
    text = skip_blanks(text);
    if (*text == '\0') {
        return NUMBER_EMPTY;
    }
    self->is_negative = *text == '-';
    text += *text == '-' || *text == '+';
    text = model_mantissa(self, text);
    text = self->count == 0 ? NULL : model_exponent(self, text);
    return text == NULL || *skip_blanks(text) != '\0' ? NUMBER_SYNTAX : NUMBER_OK;
}

number_error_t model_q16(const char *text, q16_t *value)
{
    static model_t model;
    const number_error_t error = model_read(&model, text);
    if (error != NUMBER_OK) {
        return error;
    }
    const uint64_t magnitude = model_magnitude(&model, 16);
    if (magnitude > UINT64_C(2147483647) + model.is_negative) {
        return NUMBER_OVERFLOW;
    }
    *value = (q16_t)(model.is_negative ? -(int64_t)magnitude : (int64_t)magnitude);
    return NUMBER_OK;
}

number_error_t model_natural(const char *text, uint32_t *value)
{
    static model_t model;
    const number_error_t error = model_read(&model, text);
    if (error != NUMBER_OK) {
        return error;
    }
    const uint64_t rounded = model_magnitude(&model, 0);
    if (rounded > NUMBER_NATURAL_MAX || (model.is_negative && !model_is_zero(&model))) {
        return NUMBER_OVERFLOW;
    }
    *value = (uint32_t)rounded;
    return NUMBER_OK;
}
