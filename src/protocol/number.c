/* SPDX-License-Identifier: MIT
 * number.c - decimal text to Q16.16 and to whole numbers, correctly rounded whatever the digit count.
 * A tie of Q16.16 has at most 5 digits before the point and 17 after it, so 22 significant digits decide every rounding together
 * with one bit that says whether anything but zeros follows. Both results come from the floor of value * 2^bits: the integer part
 * and the first `bits` decimals suffice for it, since 10^bits = 2^bits * 5^bits.
 */
#include "heave/number.h"

enum { LEAD_DIGITS = 19, TAIL_DIGITS = 3 };

#define EXPONENT_SATURATED INT64_C(100000000000000000)
#define POINT_SATURATED    INT64_C(1000000000000000000) /* more digits than any text has */
#define SHORT_LEAD_END     ((uint64_t)1 << 46)          /* times 2^17 stays below 2^63 */

/* What number_feed can meet, and where the text stands. */
enum { CLASS_DIGIT, CLASS_POINT, CLASS_EXPONENT, CLASS_SIGN, CLASS_BLANK, CLASSES };

typedef enum {
    PHASE_DEAD,
    PHASE_START,      /* blanks so far */
    PHASE_SIGN,       /* after the sign */
    PHASE_INTEGER,    /* after a digit, before any point */
    PHASE_BARE_POINT, /* after a point that has no digit before it */
    PHASE_FRACTION,   /* after the point and a digit on either side of it */
    PHASE_EXPONENT,   /* after the E */
    PHASE_EXPONENT_SIGN,
    PHASE_EXPONENT_DIGITS,
    PHASE_END, /* blanks after the number */
    PHASES
} phase_t;

/* What is not listed is PHASE_DEAD. */
static const uint8_t k_next[PHASES][CLASSES] = {
    [PHASE_START] =
        {[CLASS_DIGIT] = PHASE_INTEGER, [CLASS_POINT] = PHASE_BARE_POINT, [CLASS_SIGN] = PHASE_SIGN, [CLASS_BLANK] = PHASE_START},
    [PHASE_SIGN] = {[CLASS_DIGIT] = PHASE_INTEGER, [CLASS_POINT] = PHASE_BARE_POINT},
    [PHASE_INTEGER] = {[CLASS_DIGIT] = PHASE_INTEGER,
                       [CLASS_POINT] = PHASE_FRACTION,
                       [CLASS_EXPONENT] = PHASE_EXPONENT,
                       [CLASS_BLANK] = PHASE_END},
    [PHASE_BARE_POINT] = {[CLASS_DIGIT] = PHASE_FRACTION},
    [PHASE_FRACTION] = {[CLASS_DIGIT] = PHASE_FRACTION, [CLASS_EXPONENT] = PHASE_EXPONENT, [CLASS_BLANK] = PHASE_END},
    [PHASE_EXPONENT] = {[CLASS_DIGIT] = PHASE_EXPONENT_DIGITS, [CLASS_SIGN] = PHASE_EXPONENT_SIGN},
    [PHASE_EXPONENT_SIGN] = {[CLASS_DIGIT] = PHASE_EXPONENT_DIGITS},
    [PHASE_EXPONENT_DIGITS] = {[CLASS_DIGIT] = PHASE_EXPONENT_DIGITS, [CLASS_BLANK] = PHASE_END},
    [PHASE_END] = {[CLASS_BLANK] = PHASE_END},
};

/* What a text that ends in a phase is. */
static const number_error_t k_finish[PHASES] = {
    [PHASE_DEAD] = NUMBER_SYNTAX,     [PHASE_START] = NUMBER_EMPTY,
    [PHASE_SIGN] = NUMBER_SYNTAX,     [PHASE_BARE_POINT] = NUMBER_SYNTAX,
    [PHASE_EXPONENT] = NUMBER_SYNTAX, [PHASE_EXPONENT_SIGN] = NUMBER_SYNTAX, /* NUMBER_OK elsewhere */
};

static const uint64_t k_pow10[] = {1u,
                                   10u,
                                   100u,
                                   1000u,
                                   10000u,
                                   100000u,
                                   1000000u,
                                   10000000u,
                                   100000000u,
                                   1000000000u,
                                   UINT64_C(10000000000),
                                   UINT64_C(100000000000),
                                   UINT64_C(1000000000000),
                                   UINT64_C(10000000000000),
                                   UINT64_C(100000000000000),
                                   UINT64_C(1000000000000000),
                                   UINT64_C(10000000000000000),
                                   UINT64_C(100000000000000000),
                                   UINT64_C(1000000000000000000),
                                   UINT64_C(10000000000000000000)};

/* One result to round: its last bit is worth a half, and has_rest says whether the exact value is above floor_halves. */
typedef struct {
    uint64_t floor_halves;
    bool has_rest;
} halves_t;

/* How many digits of a result there are: before the point at most, and binary ones after it. */
typedef struct {
    uint8_t integer_digits;
    uint8_t bits;        /* one more than the result has, for the half */
    uint64_t five_power; /* 5^bits */
} format_t;

static const format_t k_q16 = {5, 17, UINT64_C(762939453125)};
static const format_t k_natural = {9, 1, 5};

void number_init(number_t *self)
{
    *self = (number_t){.phase = PHASE_START};
}

/* Keeps a digit from the first significant one on. */
static void keep_digit(number_t *self, uint8_t digit)
{
    if (self->lead_count < LEAD_DIGITS) {
        self->lead = self->lead * 10u + digit;
        self->lead_count++;
    } else if (self->tail_count < TAIL_DIGITS) {
        self->tail = (uint16_t)(self->tail * 10u + digit);
        self->tail_count++;
    } else {
        self->has_more_digits = self->has_more_digits || digit != 0;
    }
}

/* A digit before or behind the point. */
static void add_digit(number_t *self, uint8_t digit, bool is_integer)
{
    if (self->lead != 0 || digit != 0) {
        keep_digit(self, digit);
        self->point += is_integer && self->point < POINT_SATURATED;
    } else {
        self->point -= !is_integer && self->point > -POINT_SATURATED;
    }
}

static void add_exponent_digit(number_t *self, uint8_t digit)
{
    if (self->exponent < EXPONENT_SATURATED) {
        self->exponent = self->exponent * 10 + digit;
    }
}

/* CLASSES where the byte has no place in any number. */
static unsigned class_of(uint8_t byte)
{
    switch (byte) {
    case '.':
        return CLASS_POINT;
    case 'e':
    case 'E':
        return CLASS_EXPONENT;
    case '+':
    case '-':
        return CLASS_SIGN;
    case ' ':
    case '\t':
    case '\r':
    case '\n':
        return CLASS_BLANK;
    default:
        return CLASSES;
    }
}

/* A byte that is no digit. */
static number_error_t parse_mark(number_t *self, uint8_t byte)
{
    const unsigned class = class_of(byte);
    self->phase = class < CLASSES ? k_next[self->phase][class] : (uint8_t)PHASE_DEAD;
    self->is_negative = self->is_negative || (self->phase == PHASE_SIGN && byte == '-');
    self->is_exponent_negative = self->is_exponent_negative || (self->phase == PHASE_EXPONENT_SIGN && byte == '-');
    return self->phase == PHASE_DEAD ? NUMBER_SYNTAX : NUMBER_OK;
}

number_error_t number_feed(number_t *self, uint8_t byte)
{
    const uint8_t digit = (uint8_t)(byte - '0');
    if (digit > 9) {
        return parse_mark(self, byte);
    }
    self->phase = k_next[self->phase][CLASS_DIGIT];
    if (self->phase == PHASE_INTEGER || self->phase == PHASE_FRACTION) {
        add_digit(self, digit, self->phase == PHASE_INTEGER);
    } else if (self->phase == PHASE_EXPONENT_DIGITS) {
        add_exponent_digit(self, digit);
    }
    return self->phase == PHASE_DEAD ? NUMBER_SYNTAX : NUMBER_OK;
}

/* The decimal point with the exponent applied: the value is 0.lead tail * 10^point. */
static int64_t effective_point(const number_t *self)
{
    return self->is_exponent_negative ? self->point - self->exponent : self->point + self->exponent;
}

/* By a constant where that can be: a multiplication instead. */
static uint64_t divided_by_pow10(uint64_t value, unsigned power)
{
    switch (power) {
    case 1:
        return value / 10u;
    case 2:
        return value / 100u;
    case 3:
        return value / 1000u;
    case 4:
        return value / 10000u;
    case 5:
        return value / 100000u;
    case 6:
        return value / 1000000u;
    default:
        return value / k_pow10[power];
    }
}

/* Up to 13 digits, as nearly all numbers have: one division at most. fraction_digits is in [-9, 19]. */
static halves_t short_halves(uint64_t lead, int64_t fraction_digits, format_t format)
{
    const uint64_t scaled = lead << format.bits;
    if (fraction_digits <= 0) {
        return (halves_t){scaled * k_pow10[-fraction_digits], false};
    }
    const uint64_t divisor = k_pow10[fraction_digits];
    const uint64_t floor = divided_by_pow10(scaled, (unsigned)fraction_digits);
    return (halves_t){floor, floor * divisor != scaled};
}

/* Any digits: the integer part, then exactly format.bits decimals, then whether there is a rest. point <= format.integer_digits.
 */
static halves_t long_halves(const number_t *self, int64_t point, format_t format)
{
    const uint64_t lead = self->lead * k_pow10[LEAD_DIGITS - self->lead_count];
    const uint32_t tail = self->tail * (uint32_t)k_pow10[TAIL_DIGITS - self->tail_count];
    const uint64_t unit = point > 0 ? k_pow10[LEAD_DIGITS - point] : 0; /* 0: all of lead is behind the point */
    const uint64_t integer = unit != 0 ? lead / unit : 0;
    const uint64_t low = unit != 0 ? lead % unit : lead;
    const int64_t surplus = LEAD_DIGITS - point - format.bits; /* decimals in low beyond those wanted */
    if (surplus > LEAD_DIGITS) {
        return (halves_t){0, true};
    }
    uint64_t decimals = 0;
    bool has_rest = self->has_more_digits;
    if (surplus >= 0) {
        decimals = low / k_pow10[surplus];
        has_rest = has_rest || low % k_pow10[surplus] != 0 || tail != 0;
    } else {
        const uint64_t cut = k_pow10[TAIL_DIGITS + surplus];
        decimals = low * k_pow10[-surplus] + tail / cut;
        has_rest = has_rest || tail % cut != 0;
    }
    return (halves_t){(integer << format.bits) + decimals / format.five_power, has_rest || decimals % format.five_power != 0};
}

/* Nearest, ties to even. */
static uint64_t round_halves(halves_t halves)
{
    const uint64_t floor = halves.floor_halves >> 1;
    const bool is_half_or_more = (halves.floor_halves & 1u) != 0;
    return floor + (is_half_or_more && (halves.has_rest || (floor & 1u) != 0));
}

/* The magnitude in a format, rounded; UINT64_MAX where it has more digits before the point than the format. */
static uint64_t magnitude(const number_t *self, format_t format)
{
    if (self->lead == 0) {
        return 0;
    }
    const int64_t point = effective_point(self);
    const int64_t fraction_digits = self->lead_count - point;
    if (point > format.integer_digits) {
        return UINT64_MAX;
    }
    if (self->lead < SHORT_LEAD_END && fraction_digits <= LEAD_DIGITS) {
        return round_halves(short_halves(self->lead, fraction_digits, format));
    }
    return round_halves(long_halves(self, point, format));
}

/* The result with its sign, if it has room. */
static number_error_t put_q16(uint64_t value, bool is_negative, q16_t *value_q16)
{
    if (value > (uint64_t)INT32_MAX + is_negative) {
        return NUMBER_OVERFLOW;
    }
    *value_q16 = (q16_t)(is_negative ? -(int64_t)value : (int64_t)value);
    return NUMBER_OK;
}

number_error_t number_finish(const number_t *self, q16_t *value_q16)
{
    if (k_finish[self->phase] != NUMBER_OK) {
        return k_finish[self->phase];
    }
    return put_q16(magnitude(self, k_q16), self->is_negative, value_q16);
}

number_error_t number_finish_natural(const number_t *self, uint32_t *value)
{
    if (k_finish[self->phase] != NUMBER_OK) {
        return k_finish[self->phase];
    }
    const uint64_t rounded = magnitude(self, k_natural);
    if (rounded > NUMBER_NATURAL_MAX || (self->is_negative && self->lead != 0)) {
        return NUMBER_OVERFLOW;
    }
    *value = (uint32_t)rounded;
    return NUMBER_OK;
}

bool number_is_one_and_point(const number_t *self)
{
    return self->phase == PHASE_FRACTION && self->lead == 1 && self->lead_count == 1 && self->point == 1;
}

number_error_t number_parse(const char *text, size_t length, q16_t *value_q16)
{
    number_t number;
    number_init(&number);
    for (size_t i = 0; i < length; i++) {
        if (number_feed(&number, (uint8_t)text[i]) != NUMBER_OK) {
            return NUMBER_SYNTAX;
        }
    }
    return number_finish(&number, value_q16);
}
