/* SPDX-License-Identifier: MIT
 * frames.h - a file of frames for an offline run: datagrams and operator's requests with their times.
 * A line is `<t_ms> <text>`, `<t_ms> !request`, empty, or a comment that starts with `;`. Text has C escapes. Times have up to
 * three decimals and never decrease, those of datagrams and those of all else each for themselves: a recording tells when a
 * datagram came, and of all else the cycle that it was for. Datagrams come from 127.0.0.1 until a line `<t_ms> !from ADDRESS`
 * says otherwise. Used before and during offline runs only; loading allocates.
 */
#ifndef HEAVE_RECORD_FRAMES_H
#define HEAVE_RECORD_FRAMES_H

#include <stdio.h>

#include "record/frames_line.h"

/** A file in memory. */
typedef struct {
    frames_line_t *line; /**< without empty lines, comments and FRAMES_FROM */
    size_t count;
    size_t capacity;
    frames_line_t newest[2]; /**< of datagrams, [1], and of all else: a recording has each of these two sorts in order */
    hal_udp_peer_t from;     /**< of the datagrams of the lines to come */
    char *bytes;             /**< the file; texts point into it */
} frames_t;

/** Loads a file, "-" being standard input.
 *  @param errors takes one line for each bad one: `FILE:LINE: what; what is allowed`
 *  @return the number of bad lines; -1: cannot be read, errno says why: EFBIG, EMSGSIZE: more bytes in
 *          all, or in a line, than frames can be. frames_free() in every case. */
int frames_load(frames_t *self, const char *path, FILE *errors);

/** Gives the memory back. */
void frames_free(frames_t *self);

#endif
