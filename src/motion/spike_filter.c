/* SPDX-License-Identifier: MIT
 * spike_filter.c - keeps single wild samples out of a stream of poses; see spike_filter.h.
 * Arrivals jitter and samples are lost, so how far along its course a sender has come is hardly known. The course is therefore a
 * stretch: from the last sample as far as the larger of the last two steps leads in one period (and 10 ms) more than seem to have
 * passed. What a sample lacks to that stretch is motion that only an acceleration can have made: a over h periods of T makes
 * a T^2 h (h + 1) / 2 of difference to the step before.
 */
#include "heave/spike_filter.h"

enum {
    SETTLED = 8,        /* samples before the first judgement: until then the period may be far off */
    GAP_MAX = 4,        /* periods after which the course is not known any more */
    JITTER_US = 10000,  /* within which samples of a fast sender may hide losses */
    OVERDUE_PERIODS = 4 /* a spike and three losses in a row are rarer than a last frame that is a step */
};

hv_status_t spike_filter_init(spike_filter_t *self, const q16_t accel_q16[POSE_AXES], uint32_t factor)
{
    if (factor > SPIKE_FILTER_FACTOR_MAX) {
        return HV_ERR_RANGE;
    }
    *self = (spike_filter_t){.factor = factor};
    for (unsigned i = 0; i < POSE_AXES; i++) {
        self->accel_q32[i] = q32_from_q16(accel_q16[i]);
    }
    return HV_OK;
}

void spike_filter_set_factor(spike_filter_t *self, uint32_t factor)
{
    self->factor = factor;
}

void spike_filter_reset(spike_filter_t *self)
{
    self->settled = 0;
    self->is_withholding = false;
}

static bool is_equal(const q32_t a_q32[POSE_AXES], const q32_t b_q32[POSE_AXES])
{
    unsigned i = 0;
    while (i < POSE_AXES && a_q32[i] == b_q32[i]) {
        i++;
    }
    return i == POSE_AXES;
}

static void note(spike_filter_t *self, const q32_t value_q32[POSE_AXES])
{
    for (unsigned i = 0; i < POSE_AXES; i++) {
        self->past_q32[2][i] = self->past_q32[1][i];
        self->past_q32[1][i] = self->past_q32[0][i];
        self->past_q32[0][i] = value_q32[i];
    }
}

/* The course begins anew after a jump: with the steps of what came before, it would lead on. */
static void note_jump(spike_filter_t *self, const q32_t to_q32[POSE_AXES])
{
    for (unsigned age = 0; age < SPIKE_FILTER_HISTORY; age++) {
        note(self, to_q32);
    }
}

/* How far a value is from where the course can have led in so many periods. */
static q32_t off_course(const spike_filter_t *self, unsigned axis, int64_t periods, q32_t value_q32)
{
    const int64_t most = (periods > 1 ? periods : 1) + 1 + JITTER_US / self->period_us;
    q32_t low_q32 = 0;
    q32_t high_q32 = 0;
    for (unsigned age = 0; age + 1 < SPIKE_FILTER_HISTORY; age++) {
        const q32_t travel_q32 = (self->past_q32[age][axis] - self->past_q32[age + 1][axis]) * most;
        low_q32 = travel_q32 < low_q32 ? travel_q32 : low_q32;
        high_q32 = travel_q32 > high_q32 ? travel_q32 : high_q32;
    }
    const q32_t moved_q32 = value_q32 - self->past_q32[0][axis];
    return fx_abs(moved_q32 - fx_clamp(moved_q32, low_q32, high_q32));
}

/* How far off its course the gate lets an axis be. */
static q32_t allowance(const spike_filter_t *self, unsigned axis, int64_t periods)
{
    const int64_t h = periods > 1 ? periods : 1;
    const q32_t speed_q32 = fx_mul_div(self->accel_q32[axis] * self->factor, self->period_us, 1000000);
    return fx_mul_div(speed_q32, self->period_us, 1000000) * (h * (h + 1) / 2);
}

/* The axis furthest beyond its allowance, POSE_AXES where none is. */
static unsigned beyond_axis(const spike_filter_t *self, int64_t periods, const q32_t value_q32[POSE_AXES])
{
    unsigned worst = POSE_AXES;
    int64_t worst_share = 0;
    for (unsigned i = 0; i < POSE_AXES; i++) {
        const q32_t allowed_q32 = allowance(self, i, periods) + self->quantum_q32[i];
        const q32_t off_q32 = off_course(self, i, periods, value_q32[i]);
        const int64_t share = off_q32 / (allowed_q32 / 256 + 1);
        if (off_q32 > allowed_q32 && share >= worst_share) {
            worst = i;
            worst_share = share;
        }
    }
    return worst;
}

static void withhold(spike_filter_t *self, uint64_t now_us, int64_t periods, unsigned axis, const q32_t value_q32[POSE_AXES])
{
    self->is_withholding = true;
    self->withheld_us = now_us;
    self->withheld_periods = periods;
    self->withheld = (spike_t){(uint8_t)axis, value_q32[axis], self->past_q32[0][axis]};
    for (unsigned i = 0; i < POSE_AXES; i++) {
        self->withheld_q32[i] = value_q32[i];
    }
}

/* What the withheld sample was, by whether the one after it goes on from there or from the sample before: judged on the axis for
 * which it was withheld. */
static void settle_withheld(spike_filter_t *self, int64_t periods, const q32_t value_q32[POSE_AXES])
{
    const unsigned axis = self->withheld.axis;
    const q32_t step_q32 = self->past_q32[0][axis] - self->past_q32[1][axis];
    const q32_t course_q32 = self->past_q32[0][axis] + step_q32 * periods;
    const q32_t onward_q32 = self->withheld_q32[axis] + step_q32 * (periods - self->withheld_periods);
    self->is_withholding = false;
    self->is_step = fx_abs(value_q32[axis] - onward_q32) <= fx_abs(value_q32[axis] - course_q32);
    if (self->is_step) {
        note_jump(self, self->withheld_q32);
    } else {
        self->spikes++;
        self->spike = self->withheld;
    }
}

void spike_filter_set_quantum(spike_filter_t *self, unsigned axis, q32_t quantum_q32)
{
    HV_ASSERT(axis < POSE_AXES);
    self->quantum_q32[axis] = quantum_q32;
}

bool spike_filter_passes(spike_filter_t *self, uint64_t now_us, uint32_t period_us, const q32_t value_q32[POSE_AXES])
{
    self->is_step = false;
    if (self->factor == 0 || period_us == 0) {
        spike_filter_reset(self);
        return true;
    }
    self->period_us = period_us;
    const int64_t gap_us = (int64_t)(now_us - self->last_us);
    const int64_t periods = fx_clamp((gap_us + period_us / 2) / period_us, 0, GAP_MAX + 1);
    if (self->is_withholding && is_equal(value_q32, self->withheld_q32) && (now_us - self->withheld_us) * 4 < period_us) {
        return false; /* the same datagram twice confirms nothing */
    }
    if (self->is_withholding) {
        settle_withheld(self, periods, value_q32);
    } else if (self->settled == 0) {
        note_jump(self, value_q32);
    } else if (periods > GAP_MAX) {
        self->settled = 0;
    } else if (self->settled == SETTLED) {
        const unsigned axis = beyond_axis(self, periods, value_q32);
        if (axis != POSE_AXES) {
            withhold(self, now_us, periods, axis, value_q32);
            return false;
        }
    }
    self->settled += self->settled < SETTLED ? 1u : 0u;
    self->last_us = now_us;
    note(self, value_q32);
    return true;
}

bool spike_filter_is_overdue(const spike_filter_t *self, uint64_t now_us)
{
    return self->is_withholding && now_us - self->withheld_us > (uint64_t)self->period_us * OVERDUE_PERIODS;
}

uint32_t spike_filter_spikes(const spike_filter_t *self)
{
    return self->spikes;
}

const spike_t *spike_filter_last_spike(const spike_filter_t *self)
{
    return &self->spike;
}
