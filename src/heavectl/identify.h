/* SPDX-License-Identifier: MIT
 * identify.h - `heavectl identify`: a chirp on one axis while a key is held, and what the feedback says of the drives.
 */
#ifndef HEAVE_HEAVECTL_IDENTIFY_H
#define HEAVE_HEAVECTL_IDENTIFY_H

#include <signal.h>
#include <stdbool.h>

typedef struct {
    const char *axis;      /**< a drive's number, or an axis of the pose */
    const char *file;      /**< CSV; NULL: none */
    double amplitude;      /**< mm, deg; 0: as it suits the axis */
    double from_hz, to_hz; /**< 0: as usual, and as the cycle allows */
    double seconds;        /**< 0: as usual */
    bool is_json;
    const volatile sig_atomic_t *is_interrupted;
} identify_t;

/** Takes a band as in "0.2-20".
 *  @return false: it is none */
bool identify_read_band(const char *text, double *from_hz, double *to_hz);

/** Asks over the socket of that path, in the terminal of standard input. Blocks.
 *  @return exit code; what is wrong was said */
int identify_run(const char *path, const identify_t *what);

#endif
