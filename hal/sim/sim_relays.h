/* SPDX-License-Identifier: MIT
 * sim_relays.h - simulated bank of relays.
 * The caller owns sim_relays_t; one thread.
 */
#ifndef SIM_RELAYS_H
#define SIM_RELAYS_H

#include "heave/hal/relays.h"
#include "sim_fail.h"

/** A bank. */
typedef struct {
    uint8_t count;
    uint16_t mask;   /**< relays as they are: 1 = closed */
    uint32_t writes; /**< successful ones */
    sim_fail_t fail; /**< write calls that return HV_ERR_IO and leave mask as it is */
} sim_relays_t;

/** Starts with every relay open, without plan.
 *  @param count [0, HAL_RELAYS_MAX], more is cut */
void sim_relays_init(sim_relays_t *self, uint8_t count);

/** The bank as hal/relays.h wants it. */
hal_relays_t sim_relays_hal(sim_relays_t *self);

#endif
