/* SPDX-License-Identifier: MIT
 * sim_clock.h - simulated clock: time passes by sleeping, as fast as the CPU goes.
 * The caller owns sim_clock_t; one thread.
 */
#ifndef SIM_CLOCK_H
#define SIM_CLOCK_H

#include "heave/hal/clock.h"

/** A clock. */
typedef struct {
    uint64_t now_us;
    uint32_t sleeps;  /**< out: sleeps made so far */
    uint32_t late_at; /**< number of the sleep, from 1, that ends late; 0 = none */
    uint32_t late_us; /**< how late it ends */
} sim_clock_t;

/** Starts at start_us, without plan. */
void sim_clock_init(sim_clock_t *self, uint64_t start_us);

/** Lets time pass without a sleep (a cycle that takes long). */
void sim_clock_advance(sim_clock_t *self, uint64_t by_us);

/** The clock as hal/clock.h wants it. */
hal_clock_t sim_clock_hal(sim_clock_t *self);

#endif
