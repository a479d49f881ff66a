/* SPDX-License-Identifier: MIT
 * inputs.h - contract of the operator's switches: e-stop monitor, enable key, reset button, failing supply.
 * One thread calls the ops. Polarity is the backend's business: a set bit always means "active". Not a safety function: the
 * e-stop chain removes the drives' power by itself, and this only informs the program.
 */
#ifndef HEAVE_HAL_INPUTS_H
#define HEAVE_HAL_INPUTS_H

#include "heave/status.h"

/** Bits of the levels. */
enum {
    INPUT_ESTOP = 1u,  /**< e-stop active: its normally closed contact is open, or its wire is broken */
    INPUT_ENABLE = 2u, /**< enable key turned on */
    INPUT_RESET = 4u,  /**< reset button pressed */
    INPUT_ESTOP2 = 8u, /**< second channel of the e-stop, as the first */
    INPUT_POWER = 16u, /**< the supply is failing: the contact of a UPS is open, or its wire is broken */
    INPUT_APART = 32u  /**< of no line: the channels of the e-stop have disagreed for too long (see switches.h) */
};

/** Every op is mandatory. */
typedef struct {
    hv_status_t (*read)(void *ctx, uint32_t *levels);
    uint32_t (*present)(void *ctx);
} hal_inputs_ops_t;

/** Passed by value; ctx belongs to the backend and lives until its close. */
typedef struct {
    const hal_inputs_ops_t *ops;
    void *ctx;
} hal_inputs_t;

/** True if every mandatory op is set. If not, refuse to start. */
static inline bool hal_inputs_valid(hal_inputs_t inputs)
{
    return inputs.ops != NULL && inputs.ops->read != NULL && inputs.ops->present != NULL;
}

/** Inputs that are wired, INPUT_ESTOP | ...; constant from the open on. */
static inline uint32_t hal_inputs_present(hal_inputs_t inputs)
{
    return inputs.ops->present(inputs.ctx);
}

/** Present levels, not debounced. An e-stop channel that was active at any time since the last read is returned as active once.
 * <= 100 us.
 *  @param levels out: INPUT_ESTOP | ...; the bit of an absent input is 0; unchanged on error
 *  @return HV_OK; HV_ERR_IO: the levels are not known (line gone, or the last reading is stale): treat it as an active
 *          e-stop. */
static inline HV_MUST_CHECK hv_status_t hal_inputs_read(hal_inputs_t inputs, uint32_t *levels)
{
    return inputs.ops->read(inputs.ctx, levels);
}

#endif
