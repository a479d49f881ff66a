/* SPDX-License-Identifier: MIT
 * stop.h - the stop before every change of purpose. Private to src/motion.
 */
#ifndef STOP_H
#define STOP_H

#include "heave/motion.h"

/** Slows all cylinders and the rotation motor down, unless they do already, and says what comes after that. */
void stop_begin(motion_t *self, motion_next_t next);

#endif
