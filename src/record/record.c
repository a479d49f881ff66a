/* SPDX-License-Identifier: MIT
 * record.c - recordings; see record.h.
 */
#include "record/record.h"

#include <string.h>

#include "common/decimal.h"
#include "record/service_words.h"

void record_push(ring_t *ring, record_kind_t kind, uint64_t t_us, uint32_t value)
{
    const record_head_t head = {.t_us = t_us, .value = value, .kind = (uint32_t)kind};
    (void)ring_push(ring, &head, sizeof head, NULL, 0);
}

void record_push_datagram(ring_t *ring, record_kind_t kind, uint64_t t_us, const hal_udp_peer_t *from, const uint8_t *bytes,
                          size_t length)
{
    const record_head_t head = {.from = *from, .t_us = t_us, .value = (uint32_t)length, .kind = (uint32_t)kind};
    (void)ring_push(ring, &head, sizeof head, bytes, kind == RECORD_DATAGRAM ? length : 0);
}

void record_push_service(ring_t *ring, uint64_t t_us, const service_request_t *request)
{
    const record_head_t head = {.t_us = t_us, .kind = RECORD_SERVICE};
    (void)ring_push(ring, &head, sizeof head, request, sizeof *request);
}

void record_push_drives(ring_t *ring, uint64_t t_us, const drive_feedback_t was[DRIVES_MAX],
                        const drive_feedback_t is[DRIVES_MAX])
{
    for (uint32_t i = 0; i < DRIVES_MAX; i++) {
        const bool is_news = is[i].state == DRIVE_FAULT || is[i].state == DRIVE_OFFLINE || was[i].state == DRIVE_OFFLINE;
        if (is[i].state != was[i].state && is_news) {
            const record_head_t head = {
                .t_us = t_us, .value = is[i].fault_code, .kind = RECORD_DRIVE, .detail = (i + 1) << 8 | (uint32_t)is[i].state};
            (void)ring_push(ring, &head, sizeof head, NULL, 0);
        }
    }
}

void record_push_faults(ring_t *ring, const snapshot_t *snapshot)
{
    for (uint32_t axis = 0; axis <= DRIVES_MAX; axis++) {
        for (uint32_t code = FAULT_NONE + 1u; snapshot->begun[axis] >> code != 0; code++) {
            if ((snapshot->begun[axis] >> code & 1u) != 0) {
                const record_head_t head = {.t_us = snapshot->now_us, .value = code, .kind = RECORD_FAULT, .detail = axis};
                (void)ring_push(ring, &head, sizeof head, NULL, 0);
            }
        }
    }
}

void record_writer_init(record_writer_t *self, const settings_t *settings, bool engages_alone)
{
    *self = (record_writer_t){.cycle_us = settings->cycle_us,
                              .goal = engages_alone ? STATE_ENGAGED : STATE_SETTLED,
                              .percent = (uint32_t)settings->intensity_start_percent,
                              .from = {.address = {127, 0, 0, 1}}};
}

/* Bytes that would be read as something else, or not at all: a `!` in front, blanks at both ends. */
static bool is_plain(const uint8_t *bytes, size_t length, size_t i)
{
    const uint8_t byte = bytes[i];
    const bool is_end = i == 0 || i + 1 == length;
    return byte > ' ' && byte <= '~' ? byte != '\\' && !(i == 0 && byte == '!') : byte == ' ' && !is_end;
}

static size_t put_byte(char *to, const uint8_t *bytes, size_t length, size_t i)
{
    if (is_plain(bytes, length, i)) {
        to[0] = (char)bytes[i];
        return 1;
    }
    switch (bytes[i]) {
    case '\n':
        return decimal_put_text(to, "\\n");
    case '\r':
        return decimal_put_text(to, "\\r");
    case '\\':
        return decimal_put_text(to, "\\\\");
    default: /* a byte, not an enum */
        to[0] = '\\';
        to[1] = 'x';
        return 2 + decimal_put_hex(&to[2], bytes[i], 2);
    }
}

static size_t put_datagram(char *to, const uint8_t *bytes, size_t length)
{
    size_t at = 0;
    for (size_t i = 0; i < length; i++) {
        at += put_byte(&to[at], bytes, length, i);
    }
    return at;
}

static size_t put_number(char *to, const char *before, uint32_t number, const char *after)
{
    size_t at = decimal_put_text(to, before);
    at += decimal_put_u64(&to[at], number);
    return at + decimal_put_text(&to[at], after);
}

static size_t put_request(char *to, event_t request)
{
    const size_t at = decimal_put_text(to, "!");
    return at + decimal_put_text(&to[at], event_name(request));
}

static size_t put_drive(char *to, uint32_t detail, uint32_t code)
{
    const drive_state_t state = (drive_state_t)(detail & 0xFFu);
    size_t at = put_number(to, "!drive ", detail >> 8, "");
    if (state == DRIVE_FAULT) {
        at += decimal_put_text(&to[at], " fault ");
        return at + decimal_put_hex(&to[at], code, 8);
    }
    return at + decimal_put_text(&to[at], state == DRIVE_OFFLINE ? " offline" : " back");
}

static size_t put_fault(char *to, fault_code_t code, uint32_t axis)
{
    size_t at = decimal_put_text(to, "!fault ");
    at += decimal_put_text(&to[at], fault_help(code)->name);
    return at + (axis != 0 ? put_number(&to[at], " ", axis, "") : 0);
}

static size_t put_service(char *to, const uint8_t *bytes)
{
    service_request_t request;
    memcpy(&request, bytes, sizeof request);
    const size_t at = decimal_put_text(to, "!");
    return at + service_words_put(&to[at], &request);
}

/* What a record says, behind its time. */
static size_t put_content(char *to, const record_t *record, size_t length)
{
    switch ((record_kind_t)record->head.kind) {
    case RECORD_DATAGRAM:
        return length > 0 ? put_datagram(to, record->bytes, length) : decimal_put_text(to, "empty datagram");
    case RECORD_OVERSIZE:
        return put_number(to, "datagram of ", record->head.value, " bytes, too long");
    case RECORD_REQUEST:
        return put_request(to, (event_t)record->head.value);
    case RECORD_ESTOP:
        return decimal_put_text(to, record->head.value != 0 ? "!estop on" : "!estop off");
    case RECORD_INTENSITY:
        return put_number(to, "!intensity ", record->head.value, "");
    case RECORD_RISE:
        return put_number(to, "!rise ", record->head.value, "");
    case RECORD_LATE:
        return put_number(to, "!late ", record->head.value, "");
    case RECORD_DRIVE:
        return put_drive(to, record->head.detail, record->head.value);
    case RECORD_FAULT:
        return put_fault(to, (fault_code_t)record->head.value, record->head.detail);
    case RECORD_SERVICE:
        return put_service(to, record->bytes);
    case RECORD_RELOAD:
        return decimal_put_text(to, "the configuration was read again: what changed with it does not replay, but for faults");
    case RECORD_ZERO:
        break;
    }
    return 0;
}

/* What brings an offline run, which starts with its own goal, intensity and speed, to those of this one. */
static size_t put_zero(const record_writer_t *self, uint32_t value, char *to)
{
    const state_t goal = (state_t)(value & 0xFFu);
    const uint32_t percent = value >> 8 & 0xFFu, rise_percent = value >> 16;
    size_t at = decimal_put_text(to, "; time zero: SETTLED\n");
    if (percent != self->percent) {
        at += decimal_put_ms(&to[at], self->cycle_us);
        at += put_number(&to[at], " !intensity ", percent, "\n");
    }
    if (rise_percent != MOTION_RISE_PERCENT_MAX) {
        at += decimal_put_ms(&to[at], self->cycle_us);
        at += put_number(&to[at], " !rise ", rise_percent, "\n");
    }
    if (goal == self->goal) {
        return at;
    }
    at += decimal_put_ms(&to[at], self->cycle_us);
    at += decimal_put_text(&to[at], " ");
    at += put_request(&to[at], goal == STATE_OFF ? EVENT_SHUTDOWN : goal == STATE_SETTLED ? EVENT_PARK : EVENT_ENGAGE);
    return at + decimal_put_text(&to[at], "\n");
}

/* Records that frames files have no line for. */
static bool is_comment(const record_t *record, size_t length)
{
    return record->head.kind == RECORD_OVERSIZE || record->head.kind == RECORD_RELOAD ||
           (record->head.kind == RECORD_DATAGRAM && length == 0);
}

/* The line that tells of another sender, if this datagram is of one. */
static size_t put_from(record_writer_t *self, const record_t *record, char *to)
{
    const hal_udp_peer_t *from = &record->head.from;
    if (record->head.kind != RECORD_DATAGRAM || hal_udp_is_same_host(from, &self->from)) {
        return 0;
    }
    self->from = *from;
    size_t at = decimal_put_ms(to, record->head.t_us - self->zero_us);
    at += decimal_put_text(&to[at], " !from ");
    at += hal_udp_host_text(from, &to[at], HAL_UDP_PEER_TEXT_MAX);
    return at + decimal_put_text(&to[at], "\n");
}

size_t record_writer_line(record_writer_t *self, const record_t *record, size_t length, char to[RECORD_LINE_MAX])
{
    if (record->head.kind == RECORD_ZERO) {
        self->has_zero = true;
        self->zero_us = record->head.t_us;
        return put_zero(self, record->head.value, to);
    }
    const bool is_line = self->has_zero && !is_comment(record, length);
    size_t at = is_line ? put_from(self, record, to) : decimal_put_text(to, "; ");
    at += decimal_put_ms(&to[at], record->head.t_us - self->zero_us);
    at += decimal_put_text(&to[at], " ");
    at += put_content(&to[at], record, length);
    return at + decimal_put_text(&to[at], "\n");
}
