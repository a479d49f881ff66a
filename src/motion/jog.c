/* SPDX-License-Identifier: MIT
 * jog.c - motion led by hand; see heave/jog.h.
 * A jog is an S-curve to the end of its way that is stopped where the hand lets go: the same path and the same stop as everywhere
 * else, with limits of its own. Its limiter has the last word, so that no cylinder is ever faster, whatever leads it.
 */
#include "jog.h"

#include "assembly.h"
#include "path_check.h"

#define REACH_PIECES 64
#define REACH_HALVES 16

ramp_t *jog_own_ramp(motion_t *self, unsigned axis)
{
    return axis == AXIS_ANGLE ? &self->axis[AXIS_ANGLE] : &self->cylinder[axis];
}

static bool is_led(const motion_t *self, unsigned axis)
{
    return (self->jog.led >> axis & 1u) != 0;
}

/* --- Begin and end --- */

void motion_serve(motion_t *self)
{
    self->jog.is_serving = true;
    self->jog.is_posed = false;
    self->jog.led = 0;
}

void motion_place_axis(motion_t *self, unsigned axis, q32_t position_q32)
{
    ramp_t *ramp = jog_own_ramp(self, axis);
    self->is_pose_stale = self->is_pose_stale || ramp->state.pos_q32 != position_q32;
    ramp->state = (ramp_state_t){.pos_q32 = position_q32};
    self->jog.led &= ~(1u << axis);
    self->plan.straight.to_q32[axis] = position_q32;
    if (axis == AXIS_ANGLE) {
        self->angle_target_deg_q32 = position_q32;
    } else {
        self->reference[axis] = ramp->state;
    }
}

/* As gentle as a jog, as fast as is asked for, and as wide as to where the axis is. */
static hv_status_t shape_axis(motion_t *self, unsigned axis, q32_t vel_q32)
{
    const ramp_t *own = jog_own_ramp(self, axis);
    ramp_limits_t limits = axis == AXIS_ANGLE ? own->limits : self->jog_limits.cylinder;
    const q32_t here_q32 = own->state.pos_q32;
    const q32_t most_q32 = axis == AXIS_ANGLE ? self->jog_limits.deg_per_cycle_q32 : limits.vel_per_cycle_q32;
    limits.vel_per_cycle_q32 = fx_clamp(vel_q32, 0, most_q32 < limits.vel_per_cycle_q32 ? most_q32 : limits.vel_per_cycle_q32);
    limits.pos_min_q32 = here_q32 < own->limits.pos_min_q32 ? here_q32 : own->limits.pos_min_q32;
    limits.pos_max_q32 = here_q32 > own->limits.pos_max_q32 ? here_q32 : own->limits.pos_max_q32;
    return ramp_init(&self->jog.ramp[axis], &limits, here_q32);
}

static q32_t vel_of(const motion_t *self, q16_t speed_q16)
{
    return fx_mul_div(fx_abs(q32_from_q16(speed_q16)), self->cycle_us, 1000000);
}

void jog_begin(motion_t *self, uint32_t led, bool is_posed, const path_limits_t *limits)
{
    motion_straight_t *way = &self->plan.straight;
    for (unsigned i = 0; i < AXES_MAX; i++) {
        way->history[i] = jog_own_ramp(self, i < CYLINDERS_MAX ? i : AXIS_ANGLE)->state;
    }
    scurve_plan(&way->path, limits, 1);
    self->jog.led = led;
    self->jog.is_posed = is_posed;
    self->jog.is_excited = false;
    self->source = MOTION_JOGGED;
}

bool jog_is_ready(const motion_t *self)
{
    return self->jog.is_serving && self->source == MOTION_RESTING && motion_is_at_rest(self);
}

/* The end of a jog: that of the axis, or before it. */
static q32_t end_of(q32_t here_q32, const ramp_limits_t *limits, q16_t speed_q16, q16_t way_q16)
{
    const q32_t way_q32 = q32_from_q16(way_q16);
    const q32_t most_q32 = way_q16 > 0 ? fx_add_sat(here_q32, way_q32) : INT64_MAX;
    const q32_t least_q32 = way_q16 > 0 ? fx_sub_sat(here_q32, way_q32) : INT64_MIN;
    return speed_q16 > 0 ? (most_q32 < limits->pos_max_q32 ? most_q32 : limits->pos_max_q32)
                         : (least_q32 > limits->pos_min_q32 ? least_q32 : limits->pos_min_q32);
}

hv_status_t motion_jog_axis(motion_t *self, unsigned axis, q16_t speed_q16, q16_t way_q16)
{
    motion_straight_t *way = &self->plan.straight;
    const ramp_t *own = jog_own_ramp(self, axis);
    path_limits_t limits = path_limits_none();
    if (!jog_is_ready(self)) {
        return HV_ERR_STATE;
    }
    const q32_t to_q32 = end_of(own->state.pos_q32, &own->limits, speed_q16, way_q16);
    const q32_t left_q32 = fx_sub_sat(to_q32, own->state.pos_q32);
    const bool is_there = speed_q16 > 0 ? left_q32 <= 0 : left_q32 >= 0;
    const hv_status_t status = is_there ? HV_ERR_RANGE : shape_axis(self, axis, vel_of(self, speed_q16));
    if (status != HV_OK) {
        return status;
    }
    for (unsigned i = 0; i < AXES_MAX; i++) {
        way->from_q32[i] = jog_own_ramp(self, i < CYLINDERS_MAX ? i : AXIS_ANGLE)->state.pos_q32;
        way->to_q32[i] = way->from_q32[i];
    }
    way->to_q32[axis] = to_q32;
    path_limits_narrow(&limits, left_q32, &self->jog.ramp[axis].limits);
    jog_begin(self, 1u << axis, false, &limits);
    return HV_OK;
}

/* --- Poses --- */

/* The pose between two, with what the mechanism imposes. */
static pose_t between(const motion_t *self, const q32_t *from_q32, const q32_t *to_q32, int64_t part, int64_t whole)
{
    pose_t pose;
    for (unsigned i = 0; i < POSE_AXES; i++) {
        pose.axis_q32[i] = from_q32[i] + fx_mul_div(to_q32[i] - from_q32[i], part, whole);
    }
    kin_constrain(&self->kin, &pose);
    return pose;
}

bool jog_is_reached(const motion_t *self, const pose_t *pose)
{
    q32_t extension_mm_q32[CYLINDERS_MAX];
    if (kin_inverse(&self->kin, pose, extension_mm_q32) != HV_OK || !kin_has_margin(&self->kin, pose, KIN_MARGIN_LEAST_Q32)) {
        return false;
    }
    for (unsigned i = 0; i < self->cylinders; i++) {
        const ramp_t *own = &self->cylinder[i];
        const q32_t least_q32 = own->state.pos_q32 < own->limits.pos_min_q32 ? own->state.pos_q32 : own->limits.pos_min_q32;
        const q32_t most_q32 = own->state.pos_q32 > own->limits.pos_max_q32 ? own->state.pos_q32 : own->limits.pos_max_q32;
        if (extension_mm_q32[i] < least_q32 || extension_mm_q32[i] > most_q32) {
            return false;
        }
    }
    return true;
}

/* Takes the end of the way back to where everything before it is in reach.
 * Returns false where nothing is. */
static bool shorten(const motion_t *self, const q32_t *from_q32, q32_t *to_q32, unsigned axis)
{
    const int64_t whole = (int64_t)REACH_PIECES << REACH_HALVES;
    int64_t good = 0;
    int64_t step = (int64_t)1 << REACH_HALVES;
    while (good < whole) {
        const pose_t pose = between(self, from_q32, to_q32, good + step, whole);
        if (!jog_is_reached(self, &pose)) {
            break;
        }
        good += step;
    }
    for (step /= 2; good < whole && step > 0; step /= 2) {
        const pose_t pose = between(self, from_q32, to_q32, good + step, whole);
        good += jog_is_reached(self, &pose) ? step : 0;
    }
    const q32_t left_q32 = fx_mul_div(to_q32[axis] - from_q32[axis], good, whole);
    to_q32[axis] = from_q32[axis] + left_q32;
    return left_q32 != 0;
}

bool jog_find_here(const motion_t *self, q32_t from_q32[POSE_AXES])
{
    q32_t extension_mm_q32[CYLINDERS_MAX];
    pose_t pose;
    for (unsigned i = 0; i < CYLINDERS_MAX; i++) {
        extension_mm_q32[i] = self->cylinder[i].state.pos_q32;
    }
    if (kin_forward(&self->kin, extension_mm_q32, &self->pose, &pose, NULL) != HV_OK) {
        return false;
    }
    for (unsigned i = 0; i < POSE_AXES; i++) {
        from_q32[i] = pose.axis_q32[i];
    }
    return true;
}

static hv_status_t shape_all(motion_t *self)
{
    hv_status_t status = HV_OK;
    for (unsigned i = 0; i < self->cylinders && status == HV_OK; i++) {
        status = shape_axis(self, i, self->jog_limits.cylinder.vel_per_cycle_q32);
    }
    return status;
}

hv_status_t motion_jog_pose(motion_t *self, unsigned axis, q16_t speed_q16, q16_t way_q16)
{
    motion_straight_t *way = &self->plan.straight;
    path_limits_t limits = path_limits_none();
    ramp_limits_t asked = self->axis[axis].limits;
    q32_t from_q32[POSE_AXES];
    q32_t to_q32[POSE_AXES];
    if (!jog_is_ready(self)) {
        return HV_ERR_STATE;
    }
    if (!self->is_axis_moved[axis]) {
        return HV_ERR_NOSUP;
    }
    if (!jog_find_here(self, from_q32)) {
        return HV_ERR_ARG;
    }
    for (unsigned i = 0; i < POSE_AXES; i++) {
        to_q32[i] = from_q32[i];
    }
    to_q32[axis] = end_of(from_q32[axis], &asked, speed_q16, way_q16);
    const bool is_there = speed_q16 > 0 ? to_q32[axis] <= from_q32[axis] : to_q32[axis] >= from_q32[axis];
    const bool is_rotation = axis < AXIS_X;
    const q32_t most_q32 = is_rotation ? self->jog_limits.deg_per_cycle_q32 : self->jog_limits.cylinder.vel_per_cycle_q32;
    const q32_t vel_q32 = fx_clamp(vel_of(self, speed_q16), 0, most_q32);
    asked.vel_per_cycle_q32 = vel_q32 < asked.vel_per_cycle_q32 ? vel_q32 : asked.vel_per_cycle_q32;
    if (is_there || asked.vel_per_cycle_q32 <= 0 || !shorten(self, from_q32, to_q32, axis) || shape_all(self) != HV_OK) {
        return HV_ERR_RANGE;
    }
    self->jog.led = (1u << self->cylinders) - 1u; /* their limits are those of the way */
    path_limits_narrow(&limits, to_q32[axis] - from_q32[axis], &asked);
    path_check_narrow(self, from_q32, to_q32, &limits);
    for (unsigned i = 0; i < POSE_AXES; i++) {
        way->from_q32[i] = from_q32[i];
        way->to_q32[i] = to_q32[i];
    }
    way->from_q32[AXIS_ANGLE] = way->to_q32[AXIS_ANGLE] = self->axis[AXIS_ANGLE].state.pos_q32;
    jog_begin(self, (1u << self->cylinders) - 1u, true, &limits);
    return HV_OK;
}

/* --- The cycle --- */

/* On the way of a jog, or of a test signal, whose way ends at its amplitude. */
static q32_t at_share(const motion_t *self, unsigned axis, q62_t share_q62)
{
    const motion_straight_t *way = &self->plan.straight;
    const q32_t from_q32 = way->from_q32[axis];
    return self->jog.is_excited ? from_q32 + fx_mul_shift(way->to_q32[axis] - from_q32, share_q62, 62)
                                : scurve_between(&way->path, from_q32, way->to_q32[axis]);
}

HV_OWN_FRAME static void refer_to_pose(motion_t *self, q62_t share_q62, ramp_ref_t ref[AXES_MAX])
{
    motion_straight_t *way = &self->plan.straight;
    q32_t extension_mm_q32[CYLINDERS_MAX] = {0};
    pose_t pose;
    for (unsigned i = 0; i < POSE_AXES; i++) {
        pose.axis_q32[i] = at_share(self, i, share_q62);
    }
    kin_constrain(&self->kin, &pose);
    const bool is_solved = kin_inverse(&self->kin, &pose, extension_mm_q32) == HV_OK;
    for (unsigned i = 0; i < self->cylinders; i++) { /* the way was looked at before: there is no such pose on it */
        ref[i] = history_advance(&way->history[i], is_solved ? extension_mm_q32[i] : way->history[i].pos_q32);
    }
    ref[AXIS_ANGLE] = (ramp_ref_t){.pos_q32 = way->from_q32[AXIS_ANGLE]};
}

void jog_refer(motion_t *self, ramp_ref_t ref[AXES_MAX])
{
    motion_straight_t *way = &self->plan.straight;
    const q62_t share_q62 = self->jog.is_excited ? excitation_step(&self->jog.signal) : 0;
    scurve_step(&way->path);
    if (self->jog.is_posed) {
        refer_to_pose(self, share_q62, ref);
        return;
    }
    for (unsigned i = 0; i < AXES_MAX; i++) {
        ref[i] = history_advance(&way->history[i], at_share(self, i, share_q62));
    }
}

/* An axis that is not led stays as it is; one that has come to rest after its stop is led no more. */
static unsigned limit_axis(motion_t *self, unsigned axis, const ramp_ref_t *ref)
{
    ramp_t *own = jog_own_ramp(self, axis);
    ramp_t *ramp = &self->jog.ramp[axis];
    if (!is_led(self, axis)) {
        return 0;
    }
    (void)ramp_step(ramp, ref, RAMP_FIRM);
    own->state = ramp->state;
    if (self->source == MOTION_RESTING && ramp_is_at_rest(ramp)) {
        self->jog.led &= ~(1u << axis);
    }
    return ramp->flags;
}

unsigned jog_limit(motion_t *self, const ramp_ref_t ref[AXES_MAX], q32_t extension_mm_q32[CYLINDERS_MAX])
{
    unsigned flags = 0;
    for (unsigned i = 0; i < self->cylinders; i++) {
        flags |= limit_axis(self, i, &ref[i]);
        extension_mm_q32[i] = self->cylinder[i].state.pos_q32;
    }
    return flags;
}

q32_t jog_limit_angle(motion_t *self, const ramp_ref_t *ref)
{
    (void)limit_axis(self, AXIS_ANGLE, ref);
    return self->axis[AXIS_ANGLE].state.pos_q32;
}

/* Where no pose is known, as before homing, there is nothing to go by. */
bool jog_is_beyond_stroke(const motion_t *self)
{
    const uint32_t cylinders = (1u << CYLINDERS_MAX) - 1u;
    return self->source == MOTION_JOGGED && !self->jog.is_posed && (self->jog.led & cylinders) != 0 && !self->is_pose_stale &&
           !motion_is_at_rest(self) && !assembly_can_stop(self);
}

bool jog_is_done(const motion_t *self)
{
    const bool is_made = self->jog.is_excited ? excitation_is_done(&self->jog.signal) : scurve_is_done(&self->plan.straight.path);
    return self->source == MOTION_JOGGED && is_made && motion_is_at_rest(self);
}
