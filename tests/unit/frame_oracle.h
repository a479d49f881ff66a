/* SPDX-License-Identifier: MIT
 * frame_oracle.h - what frames a datagram holds: an independent second reader for tests, and the text form they are compared in.
 */
#ifndef FRAME_ORACLE_H
#define FRAME_ORACLE_H

#include "heave/frame.h"

#define ORACLE_DATAGRAM_MAX 4096

/** Text that grows; a test fails where it is full. */
typedef struct {
    char text[16384];
    size_t length;
} line_t;

void line_add(line_t *line, const char *format, ...);

/** All right frames of a datagram, in order: `A3 65536 0 -65536 mask=15; C3T 0 0 0 time=7; A3 0 0 0 nomask`. */
void frame_oracle(line_t *line, frame_dialect_t dialect, const char *bytes, size_t length);

#endif
