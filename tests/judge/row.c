/* SPDX-License-Identifier: MIT
 * row.c - reads a trace row by row; see row.h.
 */
#include "row.h"

#include <string.h>

const char row_header[] = "t_ms,state,roll_deg,pitch_deg,yaw_deg,x_mm,y_mm,z_mm,angle_deg,c1_mm,c2_mm,c3_mm,c4_mm,c5_mm,c6_mm,"
                          "relays,flags";

static const char *const k_places[PLACES] = {"OFF",  "HOMING",   "SETTLED", "RISING", "NEUTRAL", "ENGAGED",
                                             "HOLD", "SETTLING", "SERVICE", "FAULT",  "ESTOP"};
static const char *const k_flags[FLAG_COUNT] = {"clamped", "speed", "accel", "stretched", "takeover", "cylinders", "off-path",
                                                "no-pose", "late",  "fault", "estop",     "silent",   "loose"};
static const char *const k_columns[COLUMNS] = {"roll_deg", "pitch_deg", "yaw_deg", "x_mm",  "y_mm",  "z_mm", "angle_deg",
                                               "c1_mm",    "c2_mm",     "c3_mm",   "c4_mm", "c5_mm", "c6_mm"};

const char *row_place_name(place_t place)
{
    return k_places[place];
}

const char *row_flag_name(unsigned bit)
{
    return k_flags[bit];
}

const char *row_column_name(unsigned column)
{
    return k_columns[column];
}

static bool is_digit(char c)
{
    return c >= '0' && c <= '9';
}

/* Digits up to something else; at least one, at most 18.
 * Returns how many. */
static unsigned take_digits(const char **at, const char *end, int64_t *value)
{
    unsigned count = 0;
    for (; *at < end && is_digit(**at) && count < 18; (*at)++, count++) {
        *value = *value * 10 + (**at - '0');
    }
    return count;
}

static bool take_char(const char **at, const char *end, char c)
{
    if (*at < end && **at == c) {
        (*at)++;
        return true;
    }
    return false;
}

/* ms with up to three decimals, as us. */
static bool take_time(const char **at, const char *end, uint64_t *t_us)
{
    int64_t value = 0;
    if (take_digits(at, end, &value) == 0) {
        return false;
    }
    unsigned decimals = 0;
    if (take_char(at, end, '.')) {
        decimals = take_digits(at, end, &value);
        if (decimals == 0 || decimals > 3) {
            return false;
        }
    }
    for (; decimals < 3; decimals++) {
        value *= 10;
    }
    *t_us = (uint64_t)value;
    return take_char(at, end, ',');
}

/* Nine decimals, neither more nor fewer; no zero has a sign. */
static bool take_number(const char **at, const char *end, int64_t *out)
{
    int64_t value = 0;
    const bool is_negative = take_char(at, end, '-');
    const unsigned whole = take_digits(at, end, &value);
    if (whole == 0 || whole > 9 || !take_char(at, end, '.') || take_digits(at, end, &value) != 9) {
        return false;
    }
    *out = is_negative ? -value : value;
    return take_char(at, end, ',') && !(is_negative && value == 0);
}

/* One of several words up to a separator or the end of the line. */
static bool take_word(const char **at, const char *end, const char *separators, const char *const *words, unsigned count,
                      unsigned *which)
{
    const char *stop = *at;
    while (stop < end && strchr(separators, *stop) == NULL) {
        stop++;
    }
    for (*which = 0; *which < count; (*which)++) {
        const size_t length = strlen(words[*which]);
        if ((size_t)(stop - *at) == length && memcmp(*at, words[*which], length) == 0) {
            *at = stop;
            return true;
        }
    }
    return false;
}

static bool take_relays(const char **at, const char *end)
{
    for (unsigned i = 0; i < 4; i++, (*at)++) {
        if (*at >= end || !(is_digit(**at) || (**at >= 'A' && **at <= 'F') || (**at >= 'a' && **at <= 'f'))) {
            return false;
        }
    }
    return take_char(at, end, ',');
}

static bool take_flags(const char **at, const char *end, unsigned *flags)
{
    *flags = 0;
    while (*at < end) {
        unsigned bit;
        if (!take_word(at, end, "|", k_flags, FLAG_COUNT, &bit) || (*flags & (1u << bit)) != 0) {
            return false;
        }
        *flags |= 1u << bit;
        if (take_char(at, end, '|') && *at == end) {
            return false;
        }
    }
    return true;
}

bool row_read(row_t *self, const char *line, size_t length)
{
    const char *at = line, *end = line + length;
    unsigned place;
    if (!take_time(&at, end, &self->t_us) || !take_word(&at, end, ",", k_places, PLACES, &place) || !take_char(&at, end, ',')) {
        return false;
    }
    self->place = (place_t)place;
    for (unsigned i = 0; i < COLUMNS; i++) {
        if (!take_number(&at, end, &self->value[i])) {
            return false;
        }
    }
    return take_relays(&at, end) && take_flags(&at, end, &self->flags);
}
