/* SPDX-License-Identifier: MIT
 * frame_quick.h - the short way through a frame as nearly all senders write it. Private to src/protocol.
 */
#ifndef FRAME_QUICK_H
#define FRAME_QUICK_H

#include "heave/frame.h"

/** Reads a frame from its `@` on if it is a plain one: capital letters, no blanks, values of up to 13 digits
 * without exponents, a mask of hex digits or a time of digits. Says nothing about any other: that is for the scanner.
 * Plain ones are short (125 bytes at most), far below FRAME_LENGTH_MAX.
 *  @param text   begins with `@`
 *  @param end   of what can be read, never read itself
 *  @param frame out, unchanged if this is no plain frame
 *  @return bytes of the frame up to and with its `#`; 0: no plain frame */
/*@ requires text < end && \valid_read(text) && \valid_read(end - 1) && \valid(frame);
    assigns *frame, \result \from text[..]; */
size_t frame_quick(const uint8_t *text, const uint8_t *end, frame_t *frame);

#endif
