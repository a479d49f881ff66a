/* SPDX-License-Identifier: MIT
 * frame_print.h - frames as text that means exactly the same values.
 */
#ifndef FRAME_PRINT_H
#define FRAME_PRINT_H

#include "heave/frame.h"

#define FRAME_PRINT_MAX 256u

/** Writes a frame in the V3.0 form, every value with the sixteen decimals it takes.
 *  @param text FRAME_PRINT_MAX bytes
 *  @return length without NUL */
size_t frame_print(const frame_t *frame, char *text);

/** True where both mean the same. */
bool frame_print_is_same(const frame_t *a, const frame_t *b);

#endif
