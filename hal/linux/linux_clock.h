/* SPDX-License-Identifier: MIT
 * linux_clock.h - CLOCK_MONOTONIC. Keeps no state; any thread.
 */
#ifndef LINUX_CLOCK_H
#define LINUX_CLOCK_H

#include "heave/hal/clock.h"

/** The clock as hal/clock.h wants it. */
hal_clock_t linux_clock_hal(void);

#endif
