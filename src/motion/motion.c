/* SPDX-License-Identifier: MIT
 * motion.c - the sources of motion and their changes: resting, stopping, paths, following; one step per cycle.
 * Stops and paths run in cylinder space, where the limiter's own state is where the platform is; following is in follow.c.
 */
#include "heave/motion.h"

#include "assembly.h"
#include "follow.h"
#include "jog.h"
#include "jog_limits.h"
#include "workspace.h"
#include "axis_targets.h"
#include "stop.h"

#define FADE_RISE_US 64000 /* in which fading reaches the acceleration of [engage]: nobody is to feel it begin */

/* Extensions of a pose, inside the stroke with its margins. */
static bool reaches(const motion_t *self, const pose_t *pose, q32_t extension_mm_q32[CYLINDERS_MAX])
{
    pose_t kept = *pose;
    return workspace_pull_in(self, &kept, extension_mm_q32, NULL) == 0;
}

static hv_status_t init_cylinders(motion_t *self, const settings_t *s)
{
    for (unsigned i = 0; i < CYLINDERS_MAX; i++) {
        const unsigned source = i < self->cylinders ? i : 0;
        ramp_limits_t limits;
        hv_status_t status =
            ramp_limits_from_units(s->margin_mm_q16, s->stroke_mm_q16[source] - s->margin_mm_q16, s->cylinder_speed_mm_s_q16,
                                   s->cylinder_accel_mm_s2_q16, s->cylinder_jerk_mm_s3, s->cycle_us, &limits);
        self->settled_mm_q32[i] = q32_from_q16(s->settled_extension_mm_q16);
        status = status == HV_OK ? ramp_init(&self->cylinder[i], &limits, self->settled_mm_q32[i]) : status;
        if (status != HV_OK) {
            return status;
        }
    }
    const hv_status_t status = ramp_limits_from_units(0, s->stroke_mm_q16[0], s->engage_speed_mm_s_q16, s->engage_accel_mm_s2_q16,
                                                      s->cylinder_jerk_mm_s3, s->cycle_us, &self->engage_limits);
    const q32_t acc_q32 = self->engage_limits.acc_per_cycle2_q32;
    self->blend_cycles = s->blend_ms * 1000 / s->cycle_us;
    self->fade_limits = (fade_limits_t){self->engage_limits.vel_per_cycle_q32, acc_q32, acc_q32 * s->cycle_us / FADE_RISE_US};
    return status;
}

/* What an axis has that the platform does not move: nothing limits it, and nothing is ever asked of it. */
static const axis_settings_t k_absent_axis = {
    .min_q16 = -INT16_MAX * Q16_ONE, .max_q16 = INT16_MAX * Q16_ONE, .speed_q16 = Q16_ONE, .accel_q16 = Q16_ONE, .jerk = 1000000};

static bool is_axis_moved(const motion_t *self, const settings_t *s, unsigned axis)
{
    if (axis == AXIS_ANGLE) {
        return s->has_angle;
    }
    return self->cylinders == CYLINDERS_MAX || axis == AXIS_ROLL || axis == AXIS_PITCH || axis == AXIS_Z;
}

static hv_status_t init_axes(motion_t *self, const settings_t *s)
{
    for (unsigned i = 0; i < AXES_MAX; i++) {
        self->is_axis_moved[i] = is_axis_moved(self, s, i);
        const axis_settings_t *a = self->is_axis_moved[i] ? &s->axis[i] : &k_absent_axis;
        ramp_limits_t limits;
        hv_status_t status =
            ramp_limits_from_units(a->min_q16, a->max_q16, a->speed_q16, a->accel_q16, a->jerk, s->cycle_us, &limits);
        const q32_t start_q32 = i < POSE_AXES ? q32_from_q16(s->neutral_q16[i]) : 0;
        status = status == HV_OK ? ramp_init(&self->axis[i], &limits, start_q32) : status;
        if (status != HV_OK) {
            return status;
        }
    }
    return HV_OK;
}

/* At the two places every ride comes back to the pose is known exactly, however the platform got there: forward kinematics from
 * another start may end an LSB away, and a recording would not replay to the same bytes. */
static void note_known_pose(motion_t *self, const q32_t *extension_mm_q32)
{
    bool is_settled = true;
    bool is_neutral = true;
    for (unsigned i = 0; i < self->cylinders; i++) {
        is_settled &= extension_mm_q32[i] == self->settled_mm_q32[i];
        is_neutral &= extension_mm_q32[i] == self->neutral_mm_q32[i];
    }
    if (is_settled || is_neutral) {
        self->pose = is_settled ? self->settled_pose : self->neutral;
        self->is_pose_stale = false;
    }
}

static hv_status_t init_gate(motion_t *self, const settings_t *s)
{
    q16_t accel_q16[POSE_AXES];
    for (unsigned i = 0; i < POSE_AXES; i++) {
        accel_q16[i] = s->axis[i].accel_q16;
    }
    return spike_filter_init(&self->gate, accel_q16, s->spike_gate);
}

hv_status_t motion_init(motion_t *self, const settings_t *settings)
{
    *self = (motion_t){.cycle_us = settings->cycle_us};
    hv_status_t status = kin_init(&self->kin, &settings->geometry);
    self->cylinders = status == HV_OK ? kin_cylinders(&self->kin) : 0;
    status = status == HV_OK ? init_cylinders(self, settings) : status;
    status = status == HV_OK ? init_axes(self, settings) : status;
    status = status == HV_OK ? jog_limits_init(&self->jog_limits, settings) : status;
    status = status == HV_OK ? init_gate(self, settings) : status;
    if (status != HV_OK) {
        return status;
    }
    for (unsigned i = 0; i < POSE_AXES; i++) {
        self->neutral.axis_q32[i] = q32_from_q16(settings->neutral_q16[i]);
    }
    kin_constrain(&self->kin, &self->neutral);
    if (!reaches(self, &self->neutral, self->neutral_mm_q32)) {
        return HV_ERR_RANGE;
    }
    status = intensity_init(&self->intensity, (unsigned)settings->intensity_start_percent, settings->intensity_max_percent,
                            settings->intensity_ramp_ms, settings->cycle_us);
    if (status != HV_OK) {
        return status;
    }
    stream_init(&self->stream, settings->cycle_us, AXES_MAX, settings->stream_style);
    stream_set_delay_max(&self->stream, settings->delay_max_ms * 1000);
    motion_place(self, self->settled_mm_q32, 0);
    status = kin_forward(&self->kin, self->settled_mm_q32, &self->neutral, &self->settled_pose, NULL);
    note_known_pose(self, self->settled_mm_q32);
    return status;
}

/* Everything stays where it is. */
static void rest_here(motion_t *self)
{
    self->source = MOTION_RESTING;
    for (unsigned i = 0; i < CYLINDERS_MAX; i++) {
        self->plan.straight.to_q32[i] = self->cylinder[i].state.pos_q32;
    }
    self->plan.straight.to_q32[AXIS_ANGLE] = self->axis[AXIS_ANGLE].state.pos_q32;
}

void motion_place(motion_t *self, const q32_t extension_mm_q32[CYLINDERS_MAX], q32_t angle_deg_q32)
{
    for (unsigned i = 0; i < self->cylinders; i++) {
        self->cylinder[i].state = (ramp_state_t){.pos_q32 = extension_mm_q32[i]};
        self->reference[i] = self->cylinder[i].state;
    }
    self->axis[AXIS_ANGLE].state = (ramp_state_t){.pos_q32 = angle_deg_q32};
    self->angle_target_deg_q32 = angle_deg_q32;
    self->is_following = false;
    self->is_taking_over = false;
    self->is_fading = false;
    self->has_pending = false;
    self->is_pose_stale = true;
    self->jog.is_serving = false;
    self->jog.led = 0;
    note_known_pose(self, extension_mm_q32);
    rest_here(self);
}

/* All cylinders along a straight line, at engage speed for the one with the longest way. */
static void start_path(motion_t *self)
{
    motion_straight_t *way = &self->plan.straight;
    path_limits_t limits = path_limits_none();
    for (unsigned i = 0; i < AXES_MAX; i++) {
        const ramp_t *ramp = i == AXIS_ANGLE ? &self->axis[AXIS_ANGLE] : &self->cylinder[i];
        way->from_q32[i] = ramp->state.pos_q32;
        way->history[i] = ramp->state;
        path_limits_narrow(&limits, way->to_q32[i] - ramp->state.pos_q32, i == AXIS_ANGLE ? &ramp->limits : &self->engage_limits);
    }
    scurve_plan(&way->path, &limits, 1);
    self->source = MOTION_ON_PATH;
}

/* Whether the platform can be where a target leads. */
static bool is_possible(const motion_t *self, const motion_target_t *target)
{
    return target->space == MOTION_POSE || axis_targets_can_assemble(self, target);
}

static void begin_following(motion_t *self, uint64_t now_us)
{
    self->has_pending = self->has_pending && is_possible(self, &self->pending);
    follow_begin(self, now_us);
}

/* Whether a pose belongs to where the cylinders are. */
HV_OWN_FRAME static bool has_pose(const motion_t *self)
{
    q32_t extension_mm_q32[CYLINDERS_MAX];
    pose_t pose;
    for (unsigned i = 0; i < CYLINDERS_MAX; i++) {
        extension_mm_q32[i] = self->cylinder[i].state.pos_q32;
    }
    return kin_forward(&self->kin, extension_mm_q32, &self->pose, &pose, NULL) == HV_OK;
}

/* Where the cylinders are to go together, at engage speed. */
static void set_way(motion_t *self, const q32_t *extension_mm_q32)
{
    for (unsigned i = 0; i < CYLINDERS_MAX; i++) {
        self->plan.straight.to_q32[i] = i < self->cylinders ? extension_mm_q32[i] : self->cylinder[i].state.pos_q32;
    }
    self->plan.straight.to_q32[AXIS_ANGLE] = self->axis[AXIS_ANGLE].state.pos_q32;
}

/* What was to come after the stop. */
HV_OWN_FRAME static void go_on_after_stop(motion_t *self, uint64_t now_us)
{
    if (self->next == MOTION_THEN_PATH) {
        start_path(self);
        return;
    }
    rest_here(self);
    if (self->next == MOTION_THEN_FOLLOW && !has_pose(self)) { /* a sender is followed from a pose only */
        set_way(self, self->neutral_mm_q32);
        start_path(self);
    } else if (self->next == MOTION_THEN_FOLLOW) {
        begin_following(self, now_us);
    }
}

static void move_to(motion_t *self, const q32_t *extension_mm_q32)
{
    self->is_following = false;
    set_way(self, extension_mm_q32);
    stop_begin(self, MOTION_THEN_PATH);
    self->plan.straight.to_q32[AXIS_ANGLE] = self->halt.rest_q32[AXIS_ANGLE];
}

void motion_settle(motion_t *self)
{
    move_to(self, self->settled_mm_q32);
}

void motion_rise(motion_t *self)
{
    move_to(self, self->neutral_mm_q32);
}

hv_status_t motion_target(motion_t *self, const motion_target_t *target, uint64_t now_us)
{
    if (!self->is_following) {
        return HV_OK;
    }
    if (!is_possible(self, target)) {
        return HV_ERR_RANGE;
    }
    if (self->is_fading && target->space != self->space) {
        motion_follow(self); /* a sender is faded in in the space it began with, or not at all */
    }
    if (self->source == MOTION_STOPPING || self->source == MOTION_ON_PATH) {
        self->pending = *target;
        self->has_pending = true;
        return HV_OK;
    }
    follow_target(self, target, now_us);
    return HV_OK;
}

/* References of the cylinder-space sources. */
HV_OWN_FRAME static void step_in_cylinders(motion_t *self, ramp_ref_t ref[AXES_MAX])
{
    motion_straight_t *way = &self->plan.straight;
    if (self->source == MOTION_STOPPING) {
        sync_stop_step(&self->halt, ref);
        return;
    }
    if (self->source == MOTION_JOGGED) {
        jog_refer(self, ref);
        return;
    }
    if (self->source == MOTION_ON_PATH) {
        scurve_step(&way->path);
        for (unsigned i = 0; i < AXES_MAX; i++) {
            ref[i] = history_advance(&way->history[i], scurve_between(&way->path, way->from_q32[i], way->to_q32[i]));
        }
        return;
    }
    for (unsigned i = 0; i < AXES_MAX; i++) {
        ref[i] = (ramp_ref_t){.pos_q32 = way->to_q32[i]};
    }
}

/* The last word: every cylinder and the rotation motor through its ramp. */
static void limit(motion_t *self, const ramp_ref_t ref[AXES_MAX], motion_output_t *out)
{
    const bool is_serving = self->jog.is_serving;
    const unsigned flags = is_serving ? jog_limit(self, ref, out->extension_mm_q32)
                                      : ramp_step_all(self->cylinder, self->cylinders, ref, RAMP_FIRM, out->extension_mm_q32);
    for (unsigned i = 0; i < self->cylinders && !is_serving; i++) {
        out->flags |= out->extension_mm_q32[i] != ref[i].pos_q32 ? MOTION_OFF_PATH : 0;
    }
    out->flags |= ((flags & RAMP_CLAMPED) ? MOTION_CLAMPED : 0) | ((flags & RAMP_SPEED) ? MOTION_SPEED : 0) |
                  ((flags & RAMP_ACCEL) ? MOTION_ACCEL : 0);
}

static bool are_cylinders_moving(const motion_t *self)
{
    for (unsigned i = 0; i < self->cylinders; i++) {
        if (self->cylinder[i].state.vel_per_cycle_q32 != 0) {
            return true;
        }
    }
    return false;
}

/* The pose of the extensions sent.
 * @param is_planned it is out->sent, if they are what was planned */
HV_OWN_FRAME static void find_pose(motion_t *self, bool is_planned, motion_output_t *out)
{
    if (is_planned && (out->flags & MOTION_OFF_PATH) == 0) {
        self->pose = out->sent;
    } else if (!self->is_pose_stale && !are_cylinders_moving(self)) {
        /* the pose found last is still the pose */
    } else if (kin_forward(&self->kin, out->extension_mm_q32, &self->pose, &self->pose, NULL) != HV_OK) {
        out->flags |= MOTION_NO_POSE;
    }
    self->is_pose_stale = (out->flags & MOTION_NO_POSE) != 0;
    out->sent = self->pose;
}

/* Whether extensions given one by one lead to where the cylinders would not hold the plate. */
static bool is_near_singularity(const motion_t *self)
{
    return follow_is_moving(self) && self->space == MOTION_CYLINDERS && are_cylinders_moving(self) && !assembly_can_stop(self);
}

/* Changes of source that become due at the end of a cycle. */
static void end_cycle(motion_t *self, uint64_t now_us)
{
    if (self->source == MOTION_STOPPING && sync_stop_is_done(&self->halt) && motion_is_at_rest(self)) {
        go_on_after_stop(self, now_us);
    } else if (self->source == MOTION_ON_PATH && scurve_is_done(&self->plan.straight.path) && motion_is_at_rest(self)) {
        self->source = MOTION_RESTING;
        note_known_pose(self, self->plan.straight.to_q32);
        if (self->is_following) {
            begin_following(self, now_us);
        }
    } else if (jog_is_done(self)) {
        rest_here(self);
    } else if (jog_is_beyond_stroke(self)) {
        self->singular_stops++;
        motion_stop(self);
    } else if (is_near_singularity(self)) {
        self->singular_stops++;
        motion_follow(self);
    }
}

static void begin_cycle(motion_t *self, uint64_t now_us)
{
    if (follow_is_moving(self)) {
        intensity_step(&self->intensity);
        follow_plan(self, now_us);
    } else {
        intensity_place(&self->intensity);
    }
}

void motion_step(motion_t *self, uint64_t now_us, motion_output_t *out)
{
    ramp_ref_t ref[AXES_MAX];
    *out = (motion_output_t){0};
    begin_cycle(self, now_us);
    const bool is_posed = follow_is_moving(self) && self->space == MOTION_POSE;
    if (follow_is_moving(self)) {
        follow_step(self, now_us, ref, out);
    } else {
        step_in_cylinders(self, ref);
        out->flags |= self->is_following && self->source == MOTION_ON_PATH ? MOTION_TAKEOVER : 0;
        out->angle_deg_q32 = self->jog.is_serving ? jog_limit_angle(self, &ref[AXIS_ANGLE])
                                                  : ramp_step(&self->axis[AXIS_ANGLE], &ref[AXIS_ANGLE], RAMP_FIRM);
        out->flags |= MOTION_IN_CYLINDERS;
    }
    limit(self, ref, out);
    find_pose(self, is_posed, out);
    if (!is_posed) {
        out->asked = out->sent;
    }
    end_cycle(self, now_us);
}

bool motion_is_done(const motion_t *self)
{
    return self->source == MOTION_RESTING && motion_is_at_rest(self);
}

bool motion_is_stopping(const motion_t *self)
{
    return self->source == MOTION_STOPPING;
}

q32_t motion_angle_target(const motion_t *self)
{
    return self->angle_target_deg_q32;
}

hv_status_t motion_set_intensity(motion_t *self, unsigned percent)
{
    return intensity_set(&self->intensity, percent);
}

const intensity_t *motion_intensity(const motion_t *self)
{
    return &self->intensity;
}

uint64_t motion_timed_end_us(const motion_t *self)
{
    return self->timed_end_us;
}

uint32_t motion_stretched_count(const motion_t *self)
{
    return self->stretched_count;
}

uint32_t motion_singular_stops(const motion_t *self)
{
    return self->singular_stops;
}

const q32_t *motion_settled_extension(const motion_t *self)
{
    return self->settled_mm_q32;
}

const kin_t *motion_kin(const motion_t *self)
{
    return &self->kin;
}

void motion_set_spike_gate(motion_t *self, uint32_t factor)
{
    spike_filter_set_factor(&self->gate, factor);
}

const spike_filter_t *motion_spike_filter(const motion_t *self)
{
    return &self->gate;
}

const stream_t *motion_stream(const motion_t *self)
{
    return &self->stream;
}
