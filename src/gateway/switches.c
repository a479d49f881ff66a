/* SPDX-License-Identifier: MIT
 * switches.c - the operator's switches without their bouncing; see heave/switches.h.
 */
#include "heave/switches.h"

#define CHANNELS (INPUT_ESTOP | INPUT_ESTOP2)

void switches_init(switches_t *self, hal_inputs_t behind, uint32_t discrepancy_us)
{
    *self = (switches_t){.behind = behind, .discrepancy_us = discrepancy_us};
}

/* True where a level that differs from the one that counts is to count now. */
static bool is_settled(const switches_t *self, unsigned i, uint64_t now_us)
{
    const bool is_estop_pressed = (1u << i & CHANNELS & self->seen) != 0;
    return is_estop_pressed || now_us - self->since_us[i] >= SWITCHES_SETTLE_US;
}

static void look(switches_t *self, uint32_t seen, uint64_t now_us)
{
    const uint32_t moved = seen ^ self->seen;
    self->seen = seen;
    for (unsigned i = 0; i < SWITCHES_INPUTS; i++) {
        const uint32_t bit = 1u << i;
        if ((moved & bit) != 0) {
            self->since_us[i] = now_us;
        }
        if (((seen ^ self->levels) & bit) != 0 && is_settled(self, i, now_us)) {
            self->levels ^= bit;
        }
    }
}

/* What was not seen may have moved: nothing counts as standing still. An e-stop that is wired has to be released anew. */
static void lose(switches_t *self, uint64_t now_us)
{
    self->levels |= hal_inputs_present(self->behind) & CHANNELS;
    for (unsigned i = 0; i < SWITCHES_INPUTS; i++) {
        self->since_us[i] = now_us;
    }
}

/* Two channels that do not follow each other: one contact or one wire has failed. */
static void compare_channels(switches_t *self, uint64_t now_us)
{
    const uint32_t open = self->levels & CHANNELS;
    if (self->discrepancy_us == 0) {
        return;
    }
    if (open == 0 || open == CHANNELS) {
        self->agreed_us = now_us;
        self->is_proven |= open == CHANNELS;
        self->is_apart = self->is_apart && !(self->is_proven && open == 0);
    } else if (now_us - self->agreed_us >= self->discrepancy_us) {
        self->is_apart = true;
        self->is_proven = false;
    }
}

switches_change_t switches_step(switches_t *self, uint64_t now_us)
{
    const uint32_t before = self->levels;
    uint32_t seen = 0;
    self->is_lost = hal_inputs_read(self->behind, &seen) != HV_OK;
    if (self->is_lost) {
        lose(self, now_us);
    } else if (self->is_started) {
        look(self, seen, now_us);
    } else {
        self->is_started = true;
        self->seen = seen;
        self->levels |= seen;
        self->agreed_us = now_us;
        return (switches_change_t){0, 0};
    }
    compare_channels(self, now_us);
    const uint32_t changed = (before ^ self->levels) & (INPUT_ENABLE | INPUT_RESET | INPUT_POWER);
    return (switches_change_t){changed & self->levels, changed & before};
}

bool switches_is_lost(const switches_t *self)
{
    return self->is_lost;
}

bool switches_is_key_off(const switches_t *self)
{
    return (hal_inputs_present(self->behind) & ~self->levels & INPUT_ENABLE) != 0;
}

bool switches_is_power_failing(const switches_t *self)
{
    return (self->levels & INPUT_POWER) != 0;
}

static hv_status_t switches_read(void *ctx, uint32_t *levels)
{
    const switches_t *self = ctx;
    if (self->is_lost) {
        return HV_ERR_IO;
    }
    *levels = self->levels & ~(uint32_t)INPUT_ESTOP2;
    *levels |= (self->levels & CHANNELS) != 0 || self->is_apart ? INPUT_ESTOP : 0u;
    *levels |= self->is_apart ? INPUT_APART : 0u;
    return HV_OK;
}

static uint32_t switches_present(void *ctx)
{
    const switches_t *self = ctx;
    return hal_inputs_present(self->behind);
}

hal_inputs_t switches_hal(switches_t *self)
{
    static const hal_inputs_ops_t k_ops = {switches_read, switches_present};
    return (hal_inputs_t){&k_ops, self};
}
