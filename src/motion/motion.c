/* SPDX-License-Identifier: MIT
 * motion.c - the sources of motion and their changes: resting, stopping, paths, following; one step per cycle.
 * Stops and paths run in cylinder space, where the limiter's own state is where the platform is; following is in follow.c, manual
 * operation in manual_motion.c, the stop before a change in stop.c.
 *
 * Changes of source ("stop" is any of motion_stop, _settle, _rise and _follow; what comes after the stop is `next`):
 *
 *   event                          RESTING    STOPPING   ON_PATH    JOGGED     STREAMED, PLANNED
 *   stop                           STOPPING   new next   STOPPING   STOPPING   STOPPING
 *   at rest at the end             -          next       RESTING    RESTING    stays
 *   target, while following        STREAMED   waits      waits      -          STREAMED or PLANNED
 *   near a singularity             -          -          -          STOPPING   STOPPING, then follow
 *
 * next is RESTING, ON_PATH (settle, rise, or to neutral where a sender is to be followed and no pose is known), or RESTING where
 * a sender's first target is awaited.
 */
#include "heave/motion.h"

#include "axis_targets.h"
#include "fade_in.h"
#include "follow.h"
#include "followed.h"
#include "jog.h"
#include "platform.h"

static hv_status_t init_gate(spike_filter_t *self, const settings_t *s)
{
    q16_t accel_q16[POSE_AXES];
    for (unsigned i = 0; i < POSE_AXES; i++) {
        accel_q16[i] = s->axis[i].accel_q16;
    }
    return spike_filter_init(self, accel_q16, s->spike_gate);
}

hv_status_t motion_init(motion_t *self, const settings_t *settings)
{
    *self = (motion_t){.source = MOTION_RESTING, .rise_percent = MOTION_RISE_PERCENT_MAX};
    hv_status_t status = platform_init(&self->platform, settings);
    status = status == HV_OK ? jog_init(&self->jog, settings) : status;
    status = status == HV_OK ? init_gate(&self->gate, settings) : status;
    status = status == HV_OK ? intensity_init(&self->intensity, (unsigned)settings->intensity_start_percent,
                                              settings->intensity_max_percent, settings->intensity_ramp_ms, settings->cycle_us)
                             : status;
    if (status != HV_OK) {
        return status;
    }
    fade_in_init(&self->fade_in, settings, &self->platform.engage_limits);
    stream_init(&self->stream, settings->cycle_us, AXES_MAX, settings->stream_style);
    stream_set_delay_max(&self->stream, settings->delay_max_ms * 1000);
    motion_place(self, self->platform.settled_mm_q32, 0);
    return HV_OK;
}

/* --- Changes of source --- */

/* Everything stays where it is. */
static void rest_here(motion_t *self)
{
    path_t *path = &self->plan.path;
    self->source = MOTION_RESTING;
    path->kind = PATH_STRAIGHT;
    path->axes = AXES_MAX;
    path->way.straight.curve = (scurve_t){0}; /* which is done */
    for (unsigned i = 0; i < AXES_MAX; i++) {
        path->way.straight.to_q32[i] = platform_limiter(&self->platform, i)->state.pos_q32;
    }
}

void motion_place(motion_t *self, const q32_t extension_mm_q32[CYLINDERS_MAX], q32_t angle_deg_q32)
{
    platform_place(&self->platform, extension_mm_q32, angle_deg_q32);
    self->targets.angle_deg_q32 = angle_deg_q32;
    self->followed.phase = FOLLOW_NOBODY;
    self->has_pending = false;
    self->jog.is_serving = false;
    self->jog.moved = 0;
    rest_here(self);
}

/* All cylinders along a straight line, at so much of engage speed for the one with the longest way. */
static void start_path(motion_t *self, const q32_t *extension_mm_q32, q32_t angle_deg_q32, int64_t percent)
{
    path_t *path = &self->plan.path;
    straight_t *line = &path->way.straight;
    path_limits_t limits = path_limits_none();
    for (unsigned i = 0; i < AXES_MAX; i++) {
        const ramp_t *ramp = platform_limiter(&self->platform, i);
        const q32_t here_q32 = ramp->state.pos_q32;
        line->from_q32[i] = here_q32;
        line->to_q32[i] = i == AXIS_ANGLE ? angle_deg_q32 : i < self->platform.cylinders ? extension_mm_q32[i] : here_q32;
        line->history[i] = ramp->state;
        path_limits_narrow(&limits, line->to_q32[i] - here_q32, i == AXIS_ANGLE ? &ramp->limits : &self->platform.engage_limits);
    }
    limits.vel_q62 -= limits.vel_q62 / MOTION_RISE_PERCENT_MAX * (MOTION_RISE_PERCENT_MAX - percent);
    scurve_plan(&line->curve, &limits, 1);
    path->kind = PATH_STRAIGHT;
    path->axes = AXES_MAX;
    self->source = MOTION_ON_PATH;
}

/* Whether the platform can be where a target leads. */
static bool is_possible(const motion_t *self, const motion_target_t *target)
{
    const axis_scale_t scale = {&self->platform, &self->intensity, target->space};
    return target->space == MOTION_POSE || axis_targets_can_assemble(&scale, followed_is_beginning(&self->followed), target);
}

static void begin_following(motion_t *self, uint64_t now_us)
{
    self->has_pending = self->has_pending && is_possible(self, &self->pending);
    follow_begin(self, now_us);
}

/* A sender is followed from a pose only. */
HV_OWN_FRAME static bool has_pose(const motion_t *self)
{
    pose_t pose;
    return platform_find_pose(&self->platform, &pose);
}

/* What was to come after the stop. */
HV_OWN_FRAME static void go_on_after_stop(motion_t *self, uint64_t now_us)
{
    const platform_t *platform = &self->platform;
    const q32_t stopped_deg_q32 = self->plan.path.stop.rest_q32[AXIS_ANGLE];
    switch (self->next) {
    case MOTION_THEN_SETTLE:
        start_path(self, platform->settled_mm_q32, stopped_deg_q32, MOTION_RISE_PERCENT_MAX);
        break;
    case MOTION_THEN_RISE:
        start_path(self, platform->neutral_mm_q32, stopped_deg_q32, self->rise_percent);
        break;
    case MOTION_THEN_REST:
        rest_here(self);
        break;
    case MOTION_THEN_FOLLOW:
        if (has_pose(self)) {
            rest_here(self);
            begin_following(self, now_us);
        } else {
            start_path(self, platform->neutral_mm_q32, platform->axis[AXIS_ANGLE].state.pos_q32, self->rise_percent);
        }
        break;
    }
}

hv_status_t motion_target(motion_t *self, const motion_target_t *target, uint64_t now_us)
{
    if (!motion_is_following(self)) {
        return HV_OK;
    }
    if (!is_possible(self, target)) {
        return HV_ERR_RANGE;
    }
    if (self->followed.phase == FOLLOW_FADING_IN && target->space != self->followed.space) {
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

/* Whether extensions given one by one lead to where the cylinders would not hold the plate. */
static bool is_near_singularity(const motion_t *self)
{
    return follow_is_moving(self) && self->followed.space == MOTION_CYLINDERS && platform_are_cylinders_moving(&self->platform) &&
           !jog_can_stop(&self->jog, &self->platform);
}

/* Changes of source that become due at the end of a cycle. */
static void end_cycle(motion_t *self, uint64_t now_us)
{
    const path_t *path = &self->plan.path;
    const bool is_jogged = self->source == MOTION_JOGGED;
    if (self->source == MOTION_STOPPING && path_is_done(path) && motion_is_at_rest(self)) {
        go_on_after_stop(self, now_us);
    } else if (self->source == MOTION_ON_PATH && path_is_done(path) && motion_is_at_rest(self)) {
        self->source = MOTION_RESTING;
        platform_note_known_pose(&self->platform, path_end(path));
        if (motion_is_following(self)) {
            begin_following(self, now_us);
        }
    } else if (is_jogged && jog_is_done(&self->jog, &path->way.straight) && motion_is_at_rest(self)) {
        rest_here(self);
    } else if (is_jogged && jog_is_near_singularity(&self->jog, &self->platform)) {
        self->singular_stops++;
        motion_stop(self);
    } else if (is_near_singularity(self)) {
        self->singular_stops++;
        motion_follow(self);
    }
}

/* --- The cycle --- */

/* References of the sources in cylinder space. */
HV_OWN_FRAME static void step_in_cylinders(motion_t *self, ramp_ref_t ref[AXES_MAX])
{
    path_t *path = &self->plan.path;
    if (self->source == MOTION_JOGGED) {
        jog_step(&self->jog, &self->platform, &path->way.straight, ref);
    } else {
        path_step(path, ref);
    }
}

/* The limiter, which comes last: every cylinder through its ramp.
 * @return the flags of the ramps */
static unsigned limit_cylinders(motion_t *self, const ramp_ref_t ref[AXES_MAX], motion_output_t *out)
{
    platform_t *platform = &self->platform;
    unsigned flags = 0;
    if (!self->jog.is_serving) {
        flags = ramp_step_all(platform->cylinder, platform->cylinders, ref, RAMP_FIRM, out->extension_mm_q32);
        for (unsigned i = 0; i < platform->cylinders; i++) {
            const ramp_t *ramp = &platform->cylinder[i];
            HV_ASSERT(fx_abs(ramp->state.vel_per_cycle_q32) <= ramp->limits.vel_per_cycle_q32);
            out->flags |= out->extension_mm_q32[i] != ref[i].pos_q32 ? MOTION_OFF_PATH : 0;
        }
        return flags;
    }
    for (unsigned i = 0; i < platform->cylinders; i++) {
        flags |= jog_limit(&self->jog, platform, i, &ref[i], self->source == MOTION_RESTING);
        out->extension_mm_q32[i] = platform->cylinder[i].state.pos_q32;
    }
    return flags;
}

/* The limiter of the rotation motor, except where a sender is followed. */
static q32_t limit_angle(motion_t *self, const ramp_ref_t *ref)
{
    ramp_t *angle = &self->platform.axis[AXIS_ANGLE];
    if (self->jog.is_serving) {
        (void)jog_limit(&self->jog, &self->platform, AXIS_ANGLE, ref, self->source == MOTION_RESTING);
        return angle->state.pos_q32;
    }
    return ramp_step(angle, ref, RAMP_FIRM);
}

/* The pose of the extensions sent.
 * @param is_planned it is out->sent, if they are what was planned */
HV_OWN_FRAME static void find_pose(platform_t *self, bool is_planned, motion_output_t *out)
{
    if (is_planned && (out->flags & MOTION_OFF_PATH) == 0) {
        self->pose = out->sent;
    } else if (!self->is_pose_stale && !platform_are_cylinders_moving(self)) {
        /* the pose found last is still the pose */
    } else if (kin_forward(&self->kin, out->extension_mm_q32, &self->pose, &self->pose, NULL) != HV_OK) {
        out->flags |= MOTION_NO_POSE;
    }
    self->is_pose_stale = (out->flags & MOTION_NO_POSE) != 0;
    out->sent = self->pose;
}

/* What holds between two cycles. A state that breaks it moves nothing: the program ends, and the drives' watchdogs stop them. */
static void assert_state(const motion_t *self)
{
    const bool is_followed = motion_is_following(self);
    HV_ASSERT((unsigned)self->source <= MOTION_PLANNED && (unsigned)self->next <= MOTION_THEN_FOLLOW &&
              (unsigned)self->followed.phase <= FOLLOW_FULLY && (unsigned)self->due <= DUE_TIMED);
    HV_ASSERT(is_followed || !follow_is_moving(self));
    HV_ASSERT(self->jog.is_serving ? !is_followed : self->source != MOTION_JOGGED);
    HV_ASSERT(self->platform.cylinders >= 3 && self->platform.cylinders <= CYLINDERS_MAX);
}

static void begin_cycle(motion_t *self, uint64_t now_us)
{
    assert_state(self);
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
    const bool is_posed = follow_is_moving(self) && self->followed.space == MOTION_POSE;
    if (follow_is_moving(self)) {
        follow_step(self, now_us, ref, out);
    } else {
        step_in_cylinders(self, ref);
        out->flags |= motion_is_following(self) && self->source == MOTION_ON_PATH ? MOTION_TAKEOVER : 0;
        out->flags |= MOTION_IN_CYLINDERS;
        out->angle_deg_q32 = limit_angle(self, &ref[AXIS_ANGLE]);
    }
    const unsigned flags = limit_cylinders(self, ref, out);
    out->flags |= ((flags & RAMP_CLAMPED) ? MOTION_CLAMPED : 0) | ((flags & RAMP_SPEED) ? MOTION_SPEED : 0) |
                  ((flags & RAMP_ACCEL) ? MOTION_ACCEL : 0);
    find_pose(&self->platform, is_posed, out);
    if (!is_posed) {
        out->asked = out->sent;
    }
    end_cycle(self, now_us);
}

/* --- What others read --- */

bool motion_is_at_rest(const motion_t *self)
{
    return platform_is_at_rest(&self->platform);
}

bool motion_is_following(const motion_t *self)
{
    return self->followed.phase != FOLLOW_NOBODY;
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
    return self->targets.angle_deg_q32;
}

const pose_t *motion_pose(const motion_t *self)
{
    return &self->platform.pose;
}

hv_status_t motion_set_intensity(motion_t *self, unsigned percent)
{
    return intensity_set(&self->intensity, percent);
}

hv_status_t motion_set_rise_percent(motion_t *self, unsigned percent)
{
    if (percent == 0 || percent > MOTION_RISE_PERCENT_MAX) {
        return HV_ERR_RANGE;
    }
    self->rise_percent = percent;
    return HV_OK;
}

const intensity_t *motion_intensity(const motion_t *self)
{
    return &self->intensity;
}

uint64_t motion_timed_end_us(const motion_t *self)
{
    return self->timed.end_us;
}

uint32_t motion_stretched_count(const motion_t *self)
{
    return self->timed.stretched_count;
}

uint32_t motion_singular_stops(const motion_t *self)
{
    return self->singular_stops;
}

const q32_t *motion_settled_extension(const motion_t *self)
{
    return self->platform.settled_mm_q32;
}

const kin_t *motion_kin(const motion_t *self)
{
    return &self->platform.kin;
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
