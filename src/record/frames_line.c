/* SPDX-License-Identifier: MIT
 * frames_line.c - reads one line of a file of frames; see frames_line.h.
 */
#include "record/frames_line.h"

#include <arpa/inet.h>
#include <string.h>

#include "record/service_words.h"

#define ACTUAL_MAX_Q32 ((q32_t)1 << 52) /* 2^20 mm: further than any drive tells, and differences of two keep to 64 bits */
#define PERCENT_MAX    999u             /* as a recording may have it: what is too much is refused as it was then */

static const char k_bad_time[] =
    "no time at the start; a line is `<t_ms> <text>`, `<t_ms> !request`, or a comment that starts with `;`";
static const char k_bad_decimals[] =
    "the time has more than three decimals, or none after its point; milliseconds have up to three";
static const char k_time_range[] = "the time is out of range; 0 to 4294967295 ms is allowed";
static const char k_no_text[] = "nothing after the time; `<t_ms> <text>` or `<t_ms> !request` is allowed";
static const char k_bad_escape[] = "unknown escape; \\n \\r \\t \\0 \\xNN \\\\ and \\\" are allowed";
static const char k_bad_octal[] = "\\0 with a digit after it could be octal; write \\x00, or \\xNN";
static const char k_too_long[] = "the text is longer than 65507 bytes, more than a datagram holds";
static const char k_words_behind[] = "there is more on the line than the request takes; a comment has a line of its own";
static const char k_bad_estop[] = "!estop without its word; on and off are allowed";
static const char k_bad_intensity[] = "!intensity without its percent; whole numbers from 0 to 100 are allowed";
static const char k_bad_rise[] = "!rise without its percent; whole numbers from 1 to 100 are allowed";
static const char k_bad_late[] = "!late without its number of cycles; 0 to 4294967295 is allowed";
static const char k_bad_from[] = "!from without a numeric address; 192.168.1.20, ::1 and fe80::1%2 show what is allowed";
static const char k_bad_drive[] =
    "!drive without its number from 1 to 7 and what it did; N fault CODE (hexadecimal), N offline and N back are allowed";
static const char k_bad_fault[] = "!fault without its code; drive-fault N, drive-offline N, drive-dropped N, following-error N "
                                  "and setpoint-jump N (N from 1 to 7), drive-timeout, "
                                  "bus-lost and bus-failing are allowed";
static const char k_bad_service[] =
    "not as a recording has it; !torque N on, !torque N off, !jog N SPEED SERIES AGE_US, !home N SERIES AGE_US, !relay N SERIES "
    "AGE_US, !beat SERIES COUNTER AGE_US and !release SERIES are allowed (N may be all of torque and home, an axis of jog)";
static const char k_bad_feedback[] = "!feedback is not as a black box writes it; it has to be left as it is";
static const char k_bad_request[] =
    "unknown request; !engage !hold !resume !park !reset !shutdown !service !service-off, !intensity N (0 to 100), !rise N (1 to "
    "100), !estop on, "
    "!estop off, "
    "!torque, !jog, !home, !relay, !beat and !release as a recording has them, !late N, !drive N fault CODE, !drive N offline, "
    "!drive N back, !fault CODE, !fault CODE N, !end and !from ADDRESS are "
    "allowed (a "
    "datagram that starts with ! "
    "is written \\x21)";

static const struct {
    const char *word;
    event_t event;
} k_requests[] = {
    {"engage", EVENT_ENGAGE}, {"hold", EVENT_HOLD},         {"resume", EVENT_RESUME},   {"park", EVENT_PARK},
    {"reset", EVENT_RESET},   {"shutdown", EVENT_SHUTDOWN}, {"service", EVENT_SERVICE}, {"service-off", EVENT_SERVICE_OFF}};

/** Words with a number behind them. */
static const struct {
    const char *word;
    frames_kind_t kind;
    uint32_t most;
    const char *why;
} k_counts[] = {{"intensity", FRAMES_INTENSITY, PERCENT_MAX, k_bad_intensity},
                {"rise", FRAMES_RISE, PERCENT_MAX, k_bad_rise},
                {"late", FRAMES_LATE, UINT32_MAX, k_bad_late}};

/** A line being read. */
typedef struct {
    char *at;
    const char *end;
} cursor_t;

static bool is_digit(char c)
{
    return c >= '0' && c <= '9';
}

static bool is_blank(char c)
{
    return c == ' ' || c == '\t';
}

static void skip_blanks(cursor_t *self)
{
    while (self->at < self->end && is_blank(*self->at)) {
        self->at++;
    }
}

static bool is_digit_next(const cursor_t *self)
{
    return self->at < self->end && is_digit(*self->at);
}

/* Whole number; false above limit. */
static bool read_number(cursor_t *self, uint64_t limit, uint64_t *out)
{
    uint64_t value = 0;
    for (; is_digit_next(self); self->at++) {
        value = value * 10 + (uint64_t)(*self->at - '0');
        if (value > limit) {
            return false;
        }
    }
    *out = value;
    return true;
}

/* Up to three decimals behind the point, as microseconds. */
static bool read_decimals(cursor_t *self, uint64_t *us)
{
    uint64_t weight = 100;
    if (!is_digit_next(self)) {
        return false;
    }
    for (; is_digit_next(self); self->at++, weight /= 10) {
        if (weight == 0) {
            return false;
        }
        *us += (uint64_t)(*self->at - '0') * weight;
    }
    return true;
}

static const char *read_time(cursor_t *self, uint64_t *us)
{
    uint64_t whole_ms = 0;
    if (!is_digit_next(self)) {
        return k_bad_time;
    }
    if (!read_number(self, FRAMES_TIME_MAX_MS, &whole_ms)) {
        return k_time_range;
    }
    *us = whole_ms * 1000;
    if (self->at < self->end && *self->at == '.') {
        self->at++;
        if (!read_decimals(self, us)) {
            return k_bad_decimals;
        }
    }
    if (self->at < self->end && !is_blank(*self->at)) {
        return k_bad_time;
    }
    skip_blanks(self);
    return self->at == self->end ? k_no_text : NULL;
}

static int hex_value(char c)
{
    if (is_digit(c)) {
        return c - '0';
    }
    const char lower = (char)(c | 0x20);
    return lower >= 'a' && lower <= 'f' ? lower - 'a' + 10 : -1;
}

/* The byte of an escape, behind its backslash; -1: unknown. */
static int read_escape(cursor_t *self)
{
    static const char k_letters[] = "nrt0\\\"";
    static const char k_bytes[] = "\n\r\t\0\\\"";
    if (self->at == self->end) {
        return -1;
    }
    const char letter = *self->at++;
    if (letter == 'x' && self->end - self->at >= 2) {
        const int high = hex_value(self->at[0]);
        const int low = hex_value(self->at[1]);
        self->at += 2;
        return high < 0 || low < 0 ? -1 : high * 16 + low;
    }
    const char *known = letter == '\0' ? NULL : strchr(k_letters, letter);
    return known == NULL ? -1 : (uint8_t)k_bytes[known - k_letters];
}

/* Resolves the escapes in place: the text only shrinks. */
static const char *read_text(cursor_t *self, frames_line_t *out)
{
    char *to = self->at;
    out->kind = FRAMES_DATAGRAM;
    out->text = (const uint8_t *)to;
    while (self->at < self->end) {
        char c = *self->at++;
        if (c == '\\') {
            const bool is_zero = self->at < self->end && *self->at == '0';
            const int byte = read_escape(self);
            if (byte < 0) {
                return k_bad_escape;
            }
            if (is_zero && is_digit_next(self)) {
                return k_bad_octal;
            }
            c = (char)byte;
        }
        *to++ = c;
    }
    out->length = (uint32_t)(to - (const char *)out->text);
    return to - (const char *)out->text > (ptrdiff_t)FRAMES_TEXT_MAX ? k_too_long : NULL;
}

/* Takes a word if it stands next, with a blank or the end behind it. */
static bool parse_word(cursor_t *self, const char *word)
{
    const size_t length = strlen(word);
    const size_t left = (size_t)(self->end - self->at);
    if (left < length || memcmp(self->at, word, length) != 0 || (left > length && !is_blank(self->at[length]))) {
        return false;
    }
    self->at += length;
    skip_blanks(self);
    return true;
}

/* An address as a recording has it: IPv4, or IPv6 with `%` and an interface's number where it is link-local. */
static bool read_address(cursor_t *self, frames_line_t *out)
{
    char text[INET6_ADDRSTRLEN] = "";
    uint64_t scope = 0;
    out->kind = FRAMES_FROM;
    out->from = (hal_udp_peer_t){.port = 9};
    for (size_t i = 0; self->at < self->end && !is_blank(*self->at) && *self->at != '%'; i++) {
        if (i + 1 >= sizeof text) {
            return false;
        }
        text[i] = *self->at++;
    }
    if (inet_pton(AF_INET, text, out->from.address) == 1) {
        return true;
    }
    out->from.is_ipv6 = inet_pton(AF_INET6, text, out->from.address) == 1;
    if (self->at < self->end && *self->at == '%') {
        self->at++;
        if (!is_digit_next(self) || !read_number(self, UINT32_MAX, &scope)) {
            return false;
        }
    }
    out->from.scope_id = (uint32_t)scope;
    return out->from.is_ipv6;
}

static bool read_count(cursor_t *self, uint32_t limit, uint32_t *out)
{
    uint64_t value = 0;
    const bool is_read = is_digit_next(self) && read_number(self, limit, &value);
    *out = (uint32_t)value;
    return is_read;
}

/* `N fault CODE`, `N offline`, `N back`. */
static bool read_drive(cursor_t *self, frames_line_t *out)
{
    uint32_t drive = 0;
    if (!read_count(self, DRIVES_MAX, &drive) || drive == 0) {
        return false;
    }
    skip_blanks(self);
    out->kind = FRAMES_DRIVE;
    out->drive = (uint8_t)drive;
    if (!parse_word(self, "fault")) {
        const bool is_offline = parse_word(self, "offline");
        out->state = is_offline ? DRIVE_OFFLINE : DRIVE_DISABLED;
        return is_offline || parse_word(self, "back");
    }
    out->state = DRIVE_FAULT;
    out->number = 0;
    unsigned digits = 0;
    for (; digits < 8 && self->at < self->end && hex_value(*self->at) >= 0; digits++) {
        out->number = out->number << 4 | (uint32_t)hex_value(*self->at++);
    }
    return digits > 0;
}

/* So many hexadecimal digits, at most eight. */
static bool read_digits(cursor_t *self, unsigned digits, uint32_t *out)
{
    *out = 0;
    for (unsigned i = 0; i < digits; i++) {
        if (self->at == self->end || hex_value(*self->at) < 0) {
            return false;
        }
        *out = *out << 4 | (uint32_t)hex_value(*self->at++);
    }
    return true;
}

/* `N HEX`: state, what is known, actual, its age, code. Only as a black box writes it. */
static bool read_feedback(cursor_t *self, frames_line_t *out)
{
    uint32_t drive = 0;
    uint32_t state = 0;
    uint32_t high = 0;
    uint32_t low = 0;
    uint32_t age_us = 0;
    if (!read_count(self, DRIVES_MAX, &drive) || drive == 0) {
        return false;
    }
    skip_blanks(self);
    out->kind = FRAMES_FEEDBACK;
    out->drive = (uint8_t)drive;
    if (!read_digits(self, 2, &state) || !read_digits(self, 8, &high) || !read_digits(self, 8, &low) ||
        !read_digits(self, 8, &age_us) || !read_digits(self, 8, &out->number) || state >> 4 > DRIVE_FAULT) {
        return false;
    }
    const int64_t actual_q32 = (int64_t)((uint64_t)high << 32 | low);
    out->feedback = (drive_feedback_t){.state = (drive_state_t)(state >> 4),
                                       .is_homed = (state & 1u) != 0,
                                       .has_actual = (state & 2u) != 0,
                                       .is_energized = (state & 4u) != 0,
                                       .actual_mm_q32 = actual_q32,
                                       .actual_us = age_us,
                                       .fault_code = out->number};
    return actual_q32 >= -ACTUAL_MAX_Q32 && actual_q32 <= ACTUAL_MAX_Q32;
}

/* `CODE N` where the fault is of an axis, else `CODE`. */
static bool read_fault(cursor_t *self, frames_line_t *out)
{
    uint32_t axis = 0;
    out->kind = FRAMES_FAULT;
    for (unsigned i = FAULT_NONE + 1u; i < FAULT_CODES; i++) {
        if (parse_word(self, fault_help((fault_code_t)i)->name)) {
            out->fault = (fault_code_t)i;
            const bool is_good = !fault_is_of_axis(out->fault) || (read_count(self, DRIVES_MAX, &axis) && axis != 0);
            out->drive = (uint8_t)axis;
            return is_good;
        }
    }
    return false;
}

/* What a recording tells of drives and senders.
 * Returns what is wrong with the words, NULL = nothing. */
static const char *parse_recorded(cursor_t *self, frames_line_t *out)
{
    static const struct {
        const char *word;
        const char *bad;
        bool (*read)(cursor_t *self, frames_line_t *out);
    } k_recorded[] = {{"drive", k_bad_drive, read_drive},
                      {"fault", k_bad_fault, read_fault},
                      {"feedback", k_bad_feedback, read_feedback},
                      {"from", k_bad_from, read_address}};
    for (size_t i = 0; i < sizeof k_recorded / sizeof k_recorded[0]; i++) {
        if (parse_word(self, k_recorded[i].word)) {
            return k_recorded[i].read(self, out) ? NULL : k_recorded[i].bad;
        }
    }
    return k_bad_request;
}

/* Reads the words behind the exclamation mark.
 * Returns what is wrong with them, NULL = nothing. */
static const char *read_request_words(cursor_t *self, frames_line_t *out)
{
    for (size_t i = 0; i < sizeof k_requests / sizeof k_requests[0]; i++) {
        if (parse_word(self, k_requests[i].word)) {
            out->kind = FRAMES_REQUEST;
            out->request = k_requests[i].event;
            return NULL;
        }
    }
    if (parse_word(self, "estop")) {
        out->kind = FRAMES_ESTOP;
        out->number = parse_word(self, "on");
        return out->number == 1 || parse_word(self, "off") ? NULL : k_bad_estop;
    }
    for (size_t i = 0; i < sizeof k_counts / sizeof k_counts[0]; i++) {
        if (parse_word(self, k_counts[i].word)) {
            out->kind = k_counts[i].kind;
            return read_count(self, k_counts[i].most, &out->number) ? NULL : k_counts[i].why;
        }
    }
    if (service_words_are(self->at, (size_t)(self->end - self->at))) {
        uint64_t none = 0;
        const char *why = service_words_read(self->at, (size_t)(self->end - self->at), true, &out->service, &none);
        out->kind = FRAMES_SERVICE;
        self->at += self->end - self->at;
        return why == NULL ? NULL : k_bad_service;
    }
    if (parse_word(self, "end")) {
        out->kind = FRAMES_END;
        return NULL;
    }
    if (parse_word(self, "state")) {
        out->kind = FRAMES_STATE;
        out->text = (const uint8_t *)self->at;
        out->length = (uint32_t)(self->end - self->at);
        self->at += out->length;
        return NULL;
    }
    return parse_recorded(self, out);
}

static const char *read_request(cursor_t *self, frames_line_t *out)
{
    self->at++;
    const char *why = read_request_words(self, out);
    skip_blanks(self);
    return why == NULL && self->at < self->end ? k_words_behind : why;
}

bool frames_parse_line(char *text, size_t length, frames_line_t *out, bool *is_empty, const char **why)
{
    cursor_t cursor = {.end = text + length};
    cursor.at = text;
    if (length > 0 && text[length - 1] == '\r') {
        cursor.end--;
    }
    skip_blanks(&cursor);
    *is_empty = cursor.at == cursor.end || *cursor.at == ';';
    if (*is_empty) {
        return true;
    }
    *why = read_time(&cursor, &out->t_us);
    if (*why == NULL) {
        *why = *cursor.at == '!' ? read_request(&cursor, out) : read_text(&cursor, out);
    }
    return *why == NULL;
}
