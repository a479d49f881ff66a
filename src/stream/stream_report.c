/* SPDX-License-Identifier: MIT
 * stream_report.c - data of a stream for display: its period, its delay and the parts of the delay.
 */
#include "heave/stream.h"

#include "stream_clock.h"

uint32_t stream_period_us(const stream_t *self)
{
    return self->phase == STREAM_RUNNING ? (uint32_t)(self->clock.period_us_q16 / STREAM_US_Q16) : 0;
}

uint32_t stream_frame_us(const stream_t *self)
{
    return self->phase == STREAM_RUNNING && self->repeat.each > 1 ? self->repeat.span_us / self->repeat.frames
                                                                  : stream_period_us(self);
}

/* Of a running one. */
static uint32_t delay_us(const stream_t *self, uint32_t smoothing_us)
{
    const int64_t period = self->clock.period_us_q16;
    const stream_curve_t *curve = &self->curve;
    const q32_t led_q32 = fx_mul_shift(curve->lead_q32, curve->led_q32, 32);
    const q32_t mean_q32 = curve->mean_q32 / 2 * ((int64_t)curve->mean_points - 1);
    const int64_t spline = 2 * period - fx_mul_shift(period, led_q32 - mean_q32, 32) + (curve->window - 1) * period * 3 / 2;
    const int64_t smoothing = (int64_t)smoothing_us * STREAM_US_Q16;
    const int64_t behind = fx_mul_shift(period, self->error_q32, 32);
    return (uint32_t)(fx_clamp(spline + smoothing + self->clock.margin_us_q16 + behind, 0, INT64_MAX) / STREAM_US_Q16);
}

uint32_t stream_delay_us(const stream_t *self)
{
    return self->phase == STREAM_RUNNING ? delay_us(self, governor_delay_us(&self->curve.governor)) : 0;
}

static uint32_t us_of(int64_t us_q16)
{
    return (uint32_t)(fx_clamp(us_q16, 0, (int64_t)UINT32_MAX * STREAM_US_Q16) / STREAM_US_Q16);
}

stream_phase_t stream_phase(const stream_t *self)
{
    return self->phase;
}

q32_t stream_quantum_q32(const stream_t *self, unsigned axis)
{
    return self->curve.quantum[axis].quantum_q32;
}

bool stream_is_smoothed(const stream_t *self)
{
    return self->curve.governor.strength_q32 >= 2 * Q32_ONE;
}

bool stream_is_slowed(const stream_t *self)
{
    return self->curve.governor.is_slowed;
}

stream_report_t stream_report(const stream_t *self)
{
    const stream_clock_t *clock = &self->clock;
    if (self->phase != STREAM_RUNNING) {
        return (stream_report_t){.sender = STREAM_SENDER_UNKNOWN};
    }
    const uint32_t smoothing_us = governor_delay_us(&self->curve.governor);
    const bool is_arrived = self->evidence.weight_q32 > Q32_ONE / 2;
    return (stream_report_t){.sender = is_arrived                      ? STREAM_SENDER_ARRIVALS
                                       : stream_clock_is_bursty(clock) ? STREAM_SENDER_BURSTS
                                                                       : STREAM_SENDER_EVEN,
                             .period_us = stream_period_us(self) * clock->each,
                             .jitter_us = us_of(clock->jitter_us_q16),
                             .lost_permille = stream_clock_lost_permille(clock),
                             .delay_us = delay_us(self, smoothing_us),
                             .wait_us = us_of(clock->margin_us_q16),
                             .smoothing_us = smoothing_us};
}
