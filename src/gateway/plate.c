/* SPDX-License-Identifier: MIT
 * plate.c - the plate from feedback; see plate.h.
 *
 * Speed and acceleration of each axis come from a fading-memory filter of second order: of all quadratic courses it holds the one
 * that fits the samples best when every sample counts half as much as the next one. It takes the true times of the feedback,
 * which buses deliver at their own period, is exact for a constant acceleration, and costs a few products. With the fading factor
 * f = 1/2 its gains are 1 - f^3 = 7/8, 3/2 (1 - f)^2 (1 + f) = 9/16 and (1 - f)^3 = 1/8 (of the second derivative: twice that).
 */
#include "heave/plate.h"

#define US_PER_S INT64_C(1000000)

/* No platform moves further from its course between two samples; feedback does when homing ends. deg or mm. */
#define JUMP_Q32 (20 * Q32_ONE)

void plate_init(plate_t *self)
{
    *self = (plate_t){.has_pose = false};
}

/* Extensions and the time of the oldest; false where a cylinder has not told its own yet. */
static bool read_feedback(const kin_t *kin, const drive_feedback_t feedback[], q32_t extension_mm_q32[], uint64_t *at_us)
{
    *at_us = feedback[0].actual_us;
    for (unsigned i = 0; i < kin_cylinders(kin); i++) {
        if (!feedback[i].has_actual) {
            return false;
        }
        extension_mm_q32[i] = feedback[i].actual_mm_q32;
        *at_us = feedback[i].actual_us < *at_us ? feedback[i].actual_us : *at_us;
    }
    return true;
}

/* Starts at rest at the pose. */
static void start_filter(plate_t *self)
{
    const pose_t rest = {{0}};
    self->filtered = self->pose;
    self->speed_per_s = rest;
    self->accel_per_s2 = rest;
    self->samples = 0;
}

/* Takes a sample of an axis in; false where it is a jump. */
static bool filter_axis(plate_t *self, unsigned axis, int64_t step_us)
{
    q32_t *speed = &self->speed_per_s.axis_q32[axis], *accel = &self->accel_per_s2.axis_q32[axis];
    const int64_t square_us2 = step_us * step_us;
    const q32_t by_speed_q32 = fx_mul_div(*speed, step_us, US_PER_S);
    const q32_t by_accel_q32 = fx_mul_div(*accel, square_us2, 2 * US_PER_S * US_PER_S);
    const q32_t ahead_q32 = fx_add_sat(self->filtered.axis_q32[axis], fx_add_sat(by_speed_q32, by_accel_q32));
    const q32_t off_q32 = fx_sub_sat(self->pose.axis_q32[axis], ahead_q32);
    self->filtered.axis_q32[axis] = fx_add_sat(ahead_q32, fx_mul_div(off_q32, 7, 8));
    *speed =
        fx_add_sat(fx_add_sat(*speed, fx_mul_div(*accel, step_us, US_PER_S)), fx_mul_div(off_q32, 9 * US_PER_S, 16 * step_us));
    *accel = fx_add_sat(*accel, fx_mul_div(off_q32, US_PER_S * US_PER_S, 4 * square_us2));
    return fx_abs(off_q32) <= JUMP_Q32;
}

/* A time that goes back is a gap. */
static void filter(plate_t *self, uint64_t at_us)
{
    const int64_t step_us = (int64_t)at_us - (int64_t)self->at_us;
    bool is_smooth = self->has_pose && step_us > 0 && step_us <= PLATE_GAP_US;
    for (unsigned axis = 0; axis < POSE_AXES && is_smooth; axis++) {
        is_smooth = filter_axis(self, axis, step_us);
    }
    if (!is_smooth) {
        start_filter(self);
    }
    self->samples += self->samples < PLATE_SAMPLES;
}

void plate_step(plate_t *self, const kin_t *kin, const drive_feedback_t feedback[], const pose_t *guess, uint64_t now_us)
{
    q32_t extension_mm_q32[CYLINDERS_MAX] = {0};
    uint64_t at_us = 0;
    if (!read_feedback(kin, feedback, extension_mm_q32, &at_us)) {
        plate_init(self);
        return;
    }
    const bool is_new = !self->was_sought || at_us < self->at_us || at_us - self->at_us >= PLATE_PERIOD_US;
    if (is_new) {
        pose_t pose;
        const bool is_found = (self->has_pose && kin_forward(kin, extension_mm_q32, &self->pose, &pose, NULL) == HV_OK) ||
                              kin_forward(kin, extension_mm_q32, guess, &pose, NULL) == HV_OK;
        if (!is_found) { /* a search that finds nothing takes longest: not in every cycle */
            *self = (plate_t){.at_us = at_us, .was_sought = true};
            return;
        }
        self->pose = pose;
        filter(self, at_us);
        self->at_us = at_us;
        self->has_pose = true;
        self->was_sought = true;
    }
    self->has_rates = self->samples >= PLATE_SAMPLES && now_us - self->at_us <= PLATE_GAP_US;
}
