/* SPDX-License-Identifier: MIT
 * canpassive.c - how long a controller has been error-passive; see canpassive.h.
 */
#include "heave/canpassive.h"

static bool is_reported(hal_can_t can)
{
    hal_can_state_t state = HAL_CAN_ACTIVE;
    return hal_can_bus_state(can, &state) == HV_OK && state == HAL_CAN_PASSIVE;
}

static bool is_confirmed(hal_can_t can)
{
    hal_can_state_t state = HAL_CAN_PASSIVE; /* no answer: the report stands */
    return hal_can_ask_state(can, &state) != HV_OK || state == HAL_CAN_PASSIVE;
}

void canpassive_step(canpassive_t *self, hal_can_t can, uint64_t now_us, uint32_t limit_ms)
{
    if (limit_ms == 0 || !is_reported(can)) {
        *self = (canpassive_t){.is_failing = false};
        return;
    }
    if (!self->is_passive) {
        self->is_passive = true;
        self->since_us = now_us;
    }
    if (now_us - self->since_us >= (uint64_t)limit_ms * 1000) {
        self->is_failing = is_confirmed(can);
        self->since_us = now_us;
    }
}
