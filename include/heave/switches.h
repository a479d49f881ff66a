/* SPDX-License-Identifier: MIT
 * switches.h - debounces the operator's switches. An e-stop acts at once, by either of its channels. Its release, and all changes
 * of the other switches, count after they have been stable for SWITCHES_SETTLE_US. Runs in front of a gateway, so that recordings
 * hold the debounced result and replay without switches. The caller owns switches_t, which must not move; one thread; time is an
 * argument.
 */
#ifndef HEAVE_SWITCHES_H
#define HEAVE_SWITCHES_H

#include <stdbool.h>
#include <stdint.h>

#include "heave/hal/inputs.h"

/** Contacts bounce for less than 10 ms; a finger presses for more than 80 ms. */
#define SWITCHES_SETTLE_US 50000u

#define SWITCHES_INPUTS 5u

/** The switches; private. */
typedef struct {
    hal_inputs_t behind;
    uint32_t seen;   /**< levels last read */
    uint32_t levels; /**< debounced levels */
    uint64_t since_us[SWITCHES_INPUTS];
    uint32_t discrepancy_us; /**< 0: there is no second channel */
    uint64_t agreed_us;      /**< last time at which the channels of the e-stop agreed */
    bool is_apart;           /**< they have disagreed for too long */
    bool is_proven;          /**< both were open at the same time since then */
    bool is_started;
    bool is_lost;
} switches_t;

/** Inputs that have just changed, INPUT_ENABLE | INPUT_RESET | INPUT_POWER; never both bits of one. */
typedef struct {
    uint32_t on;
    uint32_t off;
} switches_change_t;

/** Starts. The first levels count at once and are not reported as a change.
 *  @param behind         valid
 *  @param discrepancy_us how long two channels of the e-stop may disagree; 0 where there is one */
void switches_init(switches_t *self, hal_inputs_t behind, uint32_t discrepancy_us);

/** Reads the inputs. Call once per cycle, before gateway_cycle().
 *  @param now_us never less than the last time */
switches_change_t switches_step(switches_t *self, uint64_t now_us);

/** True while the inputs cannot be read. */
bool switches_is_lost(const switches_t *self);

/** True where there is an enable key and it is off. */
bool switches_is_key_off(const switches_t *self);

/** True while the supply is failing. */
bool switches_is_power_failing(const switches_t *self);

/** The debounced levels of the last step. INPUT_ESTOP is set by either channel. If the channels have disagreed for too long, it
 * stays set together with INPUT_APART until both channels were open at the same time and are closed again; otherwise a welded
 * contact would not be noticed. read returns HV_ERR_IO while the inputs cannot be read. */
hal_inputs_t switches_hal(switches_t *self);

#endif
