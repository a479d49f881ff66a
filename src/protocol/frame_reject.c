/* SPDX-License-Identifier: MIT
 * frame_reject.c - what is wrong with a frame: recorded where it is found, reported where the frame ends.
 */
#include "frame_reject.h"

/* First byte of an offending character: how many bytes of UTF-8 follow it. */
static void look_alike_begin(frame_scanner_t *self, uint8_t byte)
{
    self->utf8_left = byte < 0xC2 || byte > 0xF4 ? 0 : byte < 0xE0 ? 1 : byte < 0xF0 ? 2 : 3;
    self->reject.look_alike = self->utf8_left == 0 ? 0 : byte & (0x3Fu >> self->utf8_left);
}

void frame_reject_add_byte(frame_scanner_t *self, uint8_t byte)
{
    const bool is_continuation = (byte & 0xC0u) == 0x80u;
    self->reject.look_alike = is_continuation ? self->reject.look_alike << 6 | (byte & 0x3Fu) : 0;
    self->utf8_left = is_continuation ? (uint8_t)(self->utf8_left - 1) : 0;
}

void frame_reject_at(frame_scanner_t *self, frame_error_t error, uint32_t offset, uint8_t field)
{
    self->reject = (frame_reject_t){.error = error,
                                    .offset = offset,
                                    .start = self->start,
                                    .field = field,
                                    .command = self->frame.command,
                                    .is_timed = self->frame.is_timed};
    self->utf8_left = 0;
    self->phase = FRAME_PHASE_REJECTED;
}

void frame_reject_byte(frame_scanner_t *self, frame_error_t error, uint8_t byte, uint8_t field)
{
    frame_reject_at(self, error, self->offset, field);
    self->reject.byte = byte;
    look_alike_begin(self, byte);
}

void frame_reject_count(frame_scanner_t *self, uint8_t byte, unsigned found)
{
    frame_reject_byte(self, FRAME_ERR_COUNT, byte, 0);
    self->reject.expected = self->frame.count;
    self->reject.found = (uint8_t)found;
}

static bool is_unicode(uint32_t code_point, uint8_t first_byte)
{
    const uint32_t least = first_byte < 0xE0 ? 0x80u : first_byte < 0xF0 ? 0x800u : 0x10000u;
    return code_point >= least && code_point <= 0x10FFFFu && (code_point < 0xD800u || code_point > 0xDFFFu);
}

frame_event_t frame_reject_report(frame_scanner_t *self, uint32_t end, frame_reject_t *reject)
{
    if (self->utf8_left > 0 || !is_unicode(self->reject.look_alike, self->reject.byte)) {
        self->reject.look_alike = 0;
    }
    self->reject.end = end;
    *reject = self->reject;
    self->phase = FRAME_PHASE_IDLE;
    self->has_event = true;
    return FRAME_EVENT_REJECT;
}

frame_event_t frame_reject_unfinished(frame_scanner_t *self, uint32_t end, frame_reject_t *reject)
{
    if (self->phase != FRAME_PHASE_REJECTED) {
        frame_reject_at(self, FRAME_ERR_UNFINISHED, self->offset, 0);
    }
    return frame_reject_report(self, end, reject);
}
