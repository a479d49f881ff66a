/* SPDX-License-Identifier: MIT
 * sim_inputs.h - simulated switches.
 * The caller owns sim_inputs_t; one thread.
 */
#ifndef SIM_INPUTS_H
#define SIM_INPUTS_H

#include "heave/hal/inputs.h"
#include "sim_fail.h"

/** The switches. */
typedef struct {
    uint32_t present; /**< INPUT_ESTOP | ... */
    uint32_t levels;
    bool is_broken;  /**< every read returns HV_ERR_IO */
    sim_fail_t fail; /**< read calls that return HV_ERR_IO */
} sim_inputs_t;

/** Starts with every present input inactive, without plan. */
void sim_inputs_init(sim_inputs_t *self, uint32_t present);

/** Someone moves a switch; an absent one does nothing. */
void sim_inputs_set(sim_inputs_t *self, uint32_t input, bool is_active);

/** The switches as hal/inputs.h wants them. */
hal_inputs_t sim_inputs_hal(sim_inputs_t *self);

#endif
