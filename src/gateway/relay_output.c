/* SPDX-License-Identifier: MIT
 * relay_output.c - see relay_output.h.
 */
#include "relay_output.h"

/* The relay that carries the healthy pulse, as a mask. */
static uint16_t pulse_bit(const healthy_settings_t *settings)
{
    return (uint16_t)(1u << settings->relay >> 1);
}

/* Returns the pulse as a relay mask. A line of its own that cannot be written is logged: the watchdog behind it will trip. */
static uint16_t pulse(relay_output_t *self, const healthy_settings_t *settings, const gateway_io_t *io, bool is_well,
                      uint64_t now_us)
{
    const bool level = healthy_step(&self->healthy, settings, is_well, now_us);
    const bool was_lost = self->is_pulse_lost;
    uint16_t seen = 0;
    self->is_pulse_lost = io->healthy.ops != NULL && (hal_relays_write(io->healthy, level ? 1 : 0) != HV_OK ||
                                                      hal_relays_read_back(io->healthy, &seen) == HV_ERR_IO);
    if (self->is_pulse_lost != was_lost) {
        hal_log_write(io->log, was_lost ? HAL_LOG_NOTICE : HAL_LOG_ERROR,
                      was_lost ? "healthy pulse: its line is written again" : "healthy pulse: its line cannot be written");
    }
    return (uint16_t)(level ? pulse_bit(settings) : 0);
}

/* Relays that cannot be written or read back are written again in every cycle. One line of the log says so. */
static void verify(relay_output_t *self, const gateway_io_t *io)
{
    uint16_t mask = 0;
    const bool is_answered = hal_relays_read_back(io->relays, &mask) != HV_ERR_IO; /* slow banks continue in this call */
    self->is_mask_written = self->is_mask_written && is_answered;
    const bool was_unknown = self->is_unknown;
    self->is_unknown = !self->is_mask_written;
    if (self->is_unknown != was_unknown) {
        hal_log_write(io->log, was_unknown ? HAL_LOG_NOTICE : HAL_LOG_ERROR,
                      was_unknown ? "relays: switched again" : "relays: cannot be switched, their state is not known");
    }
}

bool relay_output_step(relay_output_t *self, const settings_t *settings, const gateway_io_t *io, const relay_output_in_t *in,
                       uint64_t now_us)
{
    bool is_taken = true;
    const uint16_t asked = (uint16_t)(in->wanted_mask & ~pulse_bit(&settings->healthy)); /* its pace is not limited */
    self->effects_mask = relay_policy_step(&self->policy, &settings->relays, asked, in->is_safe, now_us);
    const uint16_t mask = (uint16_t)(self->effects_mask | pulse(self, &settings->healthy, io, in->is_well, now_us));
    if (!self->is_mask_written || mask != self->written_mask) {
        self->is_mask_written = hal_relays_write(io->relays, mask) == HV_OK;
        is_taken = self->is_mask_written;
        self->written_mask = mask;
    }
    verify(self, io);
    self->is_healthy = healthy_is_running(&self->healthy, &settings->healthy, now_us);
    return is_taken;
}
