/* SPDX-License-Identifier: MIT
 * frame_reject.h - what is wrong with a frame: recorded where it is found, reported where the frame ends. Private to
 * src/protocol.
 */
#ifndef FRAME_REJECT_H
#define FRAME_REJECT_H

#include "heave/frame.h"

/** Where the scanner is in a frame. */
typedef enum {
    FRAME_PHASE_IDLE,
    FRAME_PHASE_LETTER,
    FRAME_PHASE_DIGIT,
    FRAME_PHASE_SUFFIX, /* T or colon */
    FRAME_PHASE_COLON,
    FRAME_PHASE_VALUE,
    FRAME_PHASE_MASK,
    FRAME_PHASE_TIME,
    FRAME_PHASE_REJECTED
} frame_phase_t;

/** Records an error at an offset that no single byte explains. */
void frame_reject_at(frame_scanner_t *self, frame_error_t error, uint32_t offset, uint8_t field);

/** Records an error at the byte that is being read. */
void frame_reject_byte(frame_scanner_t *self, frame_error_t error, uint8_t byte, uint8_t field);

/** Records a wrong number of values. */
void frame_reject_count(frame_scanner_t *self, uint8_t byte, unsigned found);

/** Takes a further byte of the offending character, where it is one of UTF-8. */
void frame_reject_add_byte(frame_scanner_t *self, uint8_t byte);

/** Hands out the recorded error. The rejected text ends before `end`. */
frame_event_t frame_reject_report(frame_scanner_t *self, uint32_t end, frame_reject_t *reject);

/** Reports what is pending as unfinished, unless it had an error before. */
frame_event_t frame_reject_unfinished(frame_scanner_t *self, uint32_t end, frame_reject_t *reject);

#endif
