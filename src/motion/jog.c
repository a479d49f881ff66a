/* SPDX-License-Identifier: MIT
 * jog.c - manual motion; see heave/jog.h.
 * A jog is an S-curve to the end of its way that is stopped where the hand lets go: the same path and the same stop as everywhere
 * else, with limits of its own. Its limiter comes last, so that no cylinder is ever faster, whatever its reference.
 */
#include "jog.h"

#include "assembly.h"
#include "path_check.h"

#define REACH_PIECES 64
#define REACH_HALVES 16

hv_status_t jog_init(jog_t *self, const settings_t *settings)
{
    jog_limits_t *limits = &self->limits;
    *limits = (jog_limits_t){.deg_per_cycle_q32 = 0};
    if (settings->jog_mm_s_q16 == 0) {
        return HV_OK; /* no limiter can be made of it: nothing is moved */
    }
    const q16_t own_q16 = settings->cylinder_speed_mm_s_q16;
    const q16_t speed_q16 = settings->jog_mm_s_q16 < own_q16 ? settings->jog_mm_s_q16 : own_q16;
    limits->deg_per_cycle_q32 = fx_mul_div(q32_from_q16(settings->jog_deg_s_q16), settings->cycle_us, 1000000);
    limits->signal_mm_q32 = q32_from_q16(settings->signal_mm_q16);
    limits->signal_deg_q32 = q32_from_q16(settings->signal_deg_q16);
    limits->signal_mm_per_cycle_q32 = fx_mul_div(q32_from_q16(settings->signal_mm_s_q16), settings->cycle_us, 1000000);
    return ramp_limits_from_units(0, settings->stroke_mm_q16[0], speed_q16, settings->engage_accel_mm_s2_q16,
                                  settings->cylinder_jerk_mm_s3, settings->cycle_us, &limits->cylinder);
}

const ramp_t *jog_limiter(const jog_t *self, const platform_t *platform, unsigned axis)
{
    const ramp_t *own = axis == AXIS_ANGLE ? &platform->axis[AXIS_ANGLE] : &platform->cylinder[axis];
    return self->is_serving && jog_is_moved(self, axis) ? &self->ramp[axis] : own;
}

/* The axis of a reference: a cylinder, or the rotation motor. */
static unsigned axis_of(unsigned i)
{
    return i < CYLINDERS_MAX ? i : AXIS_ANGLE;
}

/* As gentle as a jog, as fast as is asked for, and as wide as to where the axis is. */
static hv_status_t shape_axis(jog_t *self, const platform_t *platform, unsigned axis, q32_t vel_q32)
{
    const ramp_t *own = platform_limiter(platform, axis);
    ramp_limits_t limits = axis == AXIS_ANGLE ? own->limits : self->limits.cylinder;
    const q32_t here_q32 = own->state.pos_q32;
    const q32_t most_q32 = axis == AXIS_ANGLE ? self->limits.deg_per_cycle_q32 : limits.vel_per_cycle_q32;
    limits.vel_per_cycle_q32 = fx_clamp(vel_q32, 0, most_q32 < limits.vel_per_cycle_q32 ? most_q32 : limits.vel_per_cycle_q32);
    limits.pos_min_q32 = here_q32 < own->limits.pos_min_q32 ? here_q32 : own->limits.pos_min_q32;
    limits.pos_max_q32 = here_q32 > own->limits.pos_max_q32 ? here_q32 : own->limits.pos_max_q32;
    return ramp_init(&self->ramp[axis], &limits, here_q32);
}

static q32_t vel_of(const platform_t *platform, q16_t speed_q16)
{
    return fx_mul_div(fx_abs(q32_from_q16(speed_q16)), platform->cycle_us, 1000000);
}

void jog_plan(jog_t *self, const platform_t *platform, straight_t *line, uint32_t moved, bool is_posed,
              const path_limits_t *limits)
{
    for (unsigned i = 0; i < AXES_MAX; i++) {
        line->history[i] = platform_limiter(platform, axis_of(i))->state;
    }
    scurve_plan(&line->curve, limits, 1);
    self->moved = moved;
    self->is_posed = is_posed;
    self->is_excited = false;
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

hv_status_t jog_begin_axis(jog_t *self, const platform_t *platform, straight_t *line, unsigned axis, q16_t speed_q16,
                           q16_t way_q16)
{
    const ramp_t *own = platform_limiter(platform, axis);
    path_limits_t limits = path_limits_none();
    const q32_t to_q32 = end_of(own->state.pos_q32, &own->limits, speed_q16, way_q16);
    const q32_t left_q32 = fx_sub_sat(to_q32, own->state.pos_q32);
    const bool is_there = speed_q16 > 0 ? left_q32 <= 0 : left_q32 >= 0;
    const hv_status_t status = is_there ? HV_ERR_RANGE : shape_axis(self, platform, axis, vel_of(platform, speed_q16));
    if (status != HV_OK) {
        return status;
    }
    for (unsigned i = 0; i < AXES_MAX; i++) {
        line->from_q32[i] = platform_limiter(platform, axis_of(i))->state.pos_q32;
        line->to_q32[i] = line->from_q32[i];
    }
    line->to_q32[axis] = to_q32;
    path_limits_narrow(&limits, left_q32, &self->ramp[axis].limits);
    jog_plan(self, platform, line, 1u << axis, false, &limits);
    return HV_OK;
}

/* --- Poses --- */

/* The pose between two, with what the mechanism imposes. */
static pose_t between(const platform_t *platform, const q32_t *from_q32, const q32_t *to_q32, int64_t part, int64_t whole)
{
    pose_t pose;
    for (unsigned i = 0; i < POSE_AXES; i++) {
        pose.axis_q32[i] = from_q32[i] + fx_mul_div(to_q32[i] - from_q32[i], part, whole);
    }
    kin_constrain(&platform->kin, &pose);
    return pose;
}

bool jog_is_reached(const platform_t *platform, const pose_t *pose)
{
    q32_t extension_mm_q32[CYLINDERS_MAX];
    if (kin_inverse(&platform->kin, pose, extension_mm_q32) != HV_OK ||
        !kin_has_margin(&platform->kin, pose, KIN_MARGIN_LEAST_Q32)) {
        return false;
    }
    for (unsigned i = 0; i < platform->cylinders; i++) {
        const ramp_t *own = &platform->cylinder[i];
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
static bool shorten(const platform_t *platform, const q32_t *from_q32, q32_t *to_q32, unsigned axis)
{
    const int64_t whole = (int64_t)REACH_PIECES << REACH_HALVES;
    int64_t good = 0;
    int64_t step = (int64_t)1 << REACH_HALVES;
    while (good < whole) {
        const pose_t pose = between(platform, from_q32, to_q32, good + step, whole);
        if (!jog_is_reached(platform, &pose)) {
            break;
        }
        good += step;
    }
    for (step /= 2; good < whole && step > 0; step /= 2) {
        const pose_t pose = between(platform, from_q32, to_q32, good + step, whole);
        good += jog_is_reached(platform, &pose) ? step : 0;
    }
    const q32_t left_q32 = fx_mul_div(to_q32[axis] - from_q32[axis], good, whole);
    to_q32[axis] = from_q32[axis] + left_q32;
    return left_q32 != 0;
}

static hv_status_t shape_all(jog_t *self, const platform_t *platform)
{
    hv_status_t status = HV_OK;
    for (unsigned i = 0; i < platform->cylinders && status == HV_OK; i++) {
        status = shape_axis(self, platform, i, self->limits.cylinder.vel_per_cycle_q32);
    }
    return status;
}

hv_status_t jog_begin_pose(jog_t *self, const platform_t *platform, straight_t *line, unsigned axis, q16_t speed_q16,
                           q16_t way_q16)
{
    path_limits_t limits = path_limits_none();
    ramp_limits_t asked = platform->axis[axis].limits;
    pose_t here;
    q32_t to_q32[POSE_AXES];
    if (!platform->is_axis_moved[axis]) {
        return HV_ERR_NOSUP;
    }
    if (!platform_find_pose(platform, &here)) {
        return HV_ERR_ARG;
    }
    const q32_t *from_q32 = here.axis_q32;
    for (unsigned i = 0; i < POSE_AXES; i++) {
        to_q32[i] = from_q32[i];
    }
    to_q32[axis] = end_of(from_q32[axis], &asked, speed_q16, way_q16);
    const bool is_there = speed_q16 > 0 ? to_q32[axis] <= from_q32[axis] : to_q32[axis] >= from_q32[axis];
    const bool is_rotation = axis < AXIS_X;
    const q32_t most_q32 = is_rotation ? self->limits.deg_per_cycle_q32 : self->limits.cylinder.vel_per_cycle_q32;
    const q32_t vel_q32 = fx_clamp(vel_of(platform, speed_q16), 0, most_q32);
    asked.vel_per_cycle_q32 = vel_q32 < asked.vel_per_cycle_q32 ? vel_q32 : asked.vel_per_cycle_q32;
    if (is_there || asked.vel_per_cycle_q32 <= 0 || !shorten(platform, from_q32, to_q32, axis) ||
        shape_all(self, platform) != HV_OK) {
        return HV_ERR_RANGE;
    }
    path_limits_narrow(&limits, to_q32[axis] - from_q32[axis], &asked);
    path_check_narrow(platform, self->ramp, from_q32, to_q32, &limits);
    for (unsigned i = 0; i < POSE_AXES; i++) {
        line->from_q32[i] = from_q32[i];
        line->to_q32[i] = to_q32[i];
    }
    line->from_q32[AXIS_ANGLE] = line->to_q32[AXIS_ANGLE] = platform->axis[AXIS_ANGLE].state.pos_q32;
    jog_plan(self, platform, line, (1u << platform->cylinders) - 1u, true, &limits);
    return HV_OK;
}

/* --- The cycle --- */

/* On the line of a jog, or of a test signal, which ends at its amplitude. */
static q32_t at_share(const jog_t *self, const straight_t *line, unsigned axis, q62_t share_q62)
{
    const q32_t from_q32 = line->from_q32[axis];
    return self->is_excited ? from_q32 + fx_mul_shift(line->to_q32[axis] - from_q32, share_q62, 62)
                            : scurve_between(&line->curve, from_q32, line->to_q32[axis]);
}

HV_OWN_FRAME static void refer_to_pose(const jog_t *self, const platform_t *platform, straight_t *line, q62_t share_q62,
                                       ramp_ref_t ref[AXES_MAX])
{
    q32_t extension_mm_q32[CYLINDERS_MAX] = {0};
    pose_t pose;
    for (unsigned i = 0; i < POSE_AXES; i++) {
        pose.axis_q32[i] = at_share(self, line, i, share_q62);
    }
    kin_constrain(&platform->kin, &pose);
    const bool is_solved = kin_inverse(&platform->kin, &pose, extension_mm_q32) == HV_OK;
    for (unsigned i = 0; i < platform->cylinders; i++) { /* the line was looked at before: there is no such pose on it */
        ref[i] = history_advance(&line->history[i], is_solved ? extension_mm_q32[i] : line->history[i].pos_q32);
    }
    ref[AXIS_ANGLE] = (ramp_ref_t){.pos_q32 = line->from_q32[AXIS_ANGLE]};
}

void jog_step(jog_t *self, const platform_t *platform, straight_t *line, ramp_ref_t ref[AXES_MAX])
{
    const q62_t share_q62 = self->is_excited ? excitation_step(&self->signal) : 0;
    scurve_step(&line->curve);
    if (self->is_posed) {
        refer_to_pose(self, platform, line, share_q62, ref);
        return;
    }
    for (unsigned i = 0; i < AXES_MAX; i++) {
        ref[i] = history_advance(&line->history[i], at_share(self, line, i, share_q62));
    }
}

unsigned jog_limit(jog_t *self, platform_t *platform, unsigned axis, const ramp_ref_t *ref, bool is_ended)
{
    ramp_t *own = axis == AXIS_ANGLE ? &platform->axis[AXIS_ANGLE] : &platform->cylinder[axis];
    ramp_t *ramp = &self->ramp[axis];
    if (!jog_is_moved(self, axis)) {
        return 0;
    }
    (void)ramp_step(ramp, ref, RAMP_FIRM);
    own->state = ramp->state;
    if (is_ended && ramp_is_at_rest(ramp)) {
        self->moved &= ~(1u << axis);
    }
    return ramp->flags;
}

bool jog_can_stop(const jog_t *self, const platform_t *platform)
{
    const ramp_t *by[CYLINDERS_MAX];
    for (unsigned i = 0; i < CYLINDERS_MAX; i++) {
        by[i] = jog_limiter(self, platform, i);
    }
    return assembly_can_stop(platform, by);
}

/* Where no pose is known, as before homing, there is nothing to go by. */
bool jog_is_near_singularity(const jog_t *self, const platform_t *platform)
{
    const uint32_t cylinders = (1u << CYLINDERS_MAX) - 1u;
    return !self->is_posed && (self->moved & cylinders) != 0 && !platform->is_pose_stale && !platform_is_at_rest(platform) &&
           !jog_can_stop(self, platform);
}

bool jog_is_done(const jog_t *self, const straight_t *line)
{
    return self->is_excited ? excitation_is_done(&self->signal) : scurve_is_done(&line->curve);
}
