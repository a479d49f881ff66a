/* SPDX-License-Identifier: MIT
 * output_file.h - a file that is only written, through one large buffer given by its owner. No stdio, no allocation.
 * One thread. A file on a disk blocks as long as the disk does; pipes and terminals can be opened so that they never block.
 */
#ifndef HEAVE_COMMON_OUTPUT_FILE_H
#define HEAVE_COMMON_OUTPUT_FILE_H

#include "heave/status.h"

#define OUTPUT_FILE_BYTES 65536u

/** What to do when the other end of a pipe does not read. */
typedef enum {
    OUTPUT_FILE_WAITS,  /**< for it */
    OUTPUT_FILE_IS_NEW, /**< for it; the file must not exist, not even as a link */
    OUTPUT_FILE_GOES_ON /**< keep what waits in the buffer, as far as it has room */
} output_file_patience_t;

/** An open file. */
typedef struct {
    int fd; /**< -1: closed */
    output_file_patience_t patience;
    int error; /**< errno of the first failed write, 0 = none; from then on everything is thrown away */
    size_t length;
    char bytes[OUTPUT_FILE_BYTES];
} output_file_t;

/** Creates or empties a file, "-" being standard output.
 *  @return false: error says why */
bool output_file_open(output_file_t *self, const char *path, output_file_patience_t patience);

/** Whether the buffer takes so many bytes now. Always true after a flush that waits. */
bool output_file_has_room(const output_file_t *self, size_t length);

/** Adds bytes, at most OUTPUT_FILE_BYTES; there has to be room, or the file has to be one that waits. */
void output_file_write(output_file_t *self, const char *bytes, size_t length);

/** Writes what waits, as far as the file takes it. */
void output_file_flush(output_file_t *self);

/** Writes what waits and closes; harmless on a closed one. An end of a pipe that does not read is waited for, for a second.
 *  @return false: something was lost, error says why */
bool output_file_close(output_file_t *self);

/** A descriptor of the same pipe or terminal that blocks, or does not, because the flag of a shared one would be everybody's;
 *  fd itself where there is no such thing: files do not block, sockets cannot be opened anew. */
int output_file_reopened(int fd, bool is_waiting);

#endif
