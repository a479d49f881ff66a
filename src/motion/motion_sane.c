/* SPDX-License-Identifier: MIT
 * motion_sane.c - whether a motion that was loaded may go on; see motion_sane.h.
 * What motion_init() has made of the settings is not believed: it has to be what it makes of them here.
 */
#include "heave/motion_sane.h"

#include "heave/sane.h"
#include "follow.h"
#include "jog.h"
#include "plan_sane.h"
#include "stream_sane.h"

#define CYCLES_MAX ((int64_t)1 << 40)
#define SLOT_Q32   ((q32_t)1 << 48) /* from end to end of what a slot may be asked for, see axis_targets.c */

static bool is_same_q32(const q32_t *a, const q32_t *b, unsigned count)
{
    bool is_same = true;
    for (unsigned i = 0; i < count; i++) {
        is_same = is_same && a[i] == b[i];
    }
    return is_same;
}

static bool are_limits_same(const ramp_limits_t *a, const ramp_limits_t *b)
{
    return a->pos_min_q32 == b->pos_min_q32 && a->pos_max_q32 == b->pos_max_q32 && a->vel_per_cycle_q32 == b->vel_per_cycle_q32 &&
           a->acc_per_cycle2_q32 == b->acc_per_cycle2_q32 && a->jerk_per_cycle3_q32 == b->jerk_per_cycle3_q32;
}

static bool is_state_sane(const ramp_state_t *state)
{
    return sane_q32(state->pos_q32) && sane_q32(state->vel_per_cycle_q32) && sane_q32(state->acc_per_cycle2_q32);
}

/* The divisors of a ramp follow from its limits; its speed and acceleration never leave them, though its position may. */
static bool is_ramp_sane(const ramp_t *saved, const ramp_t *prepared)
{
    return are_limits_same(&saved->limits, &prepared->limits) && saved->acc_safe_q32 == prepared->acc_safe_q32 &&
           saved->acc_cycles == prepared->acc_cycles && saved->per_jerk_q62 == prepared->per_jerk_q62 &&
           saved->per_acc_q62 == prepared->per_acc_q62 && saved->brake_reach_q32 == prepared->brake_reach_q32 &&
           saved->brake_cycles == prepared->brake_cycles && sane_q32(saved->state.pos_q32) &&
           fx_abs(saved->state.vel_per_cycle_q32) <= saved->limits.vel_per_cycle_q32 &&
           fx_abs(saved->state.acc_per_cycle2_q32) <= saved->acc_safe_q32 && saved->ref_jerk_q32 >= 0 &&
           sane_q32(saved->ref_jerk_q32);
}

/* The shares of the last cycles are those of the ramp: they change as slowly as it does. */
static bool is_intensity_sane(const intensity_t *saved, const intensity_t *prepared)
{
    const ramp_limits_t *limits = &prepared->ramp.limits;
    const int64_t *share_q46 = saved->share_q46;
    const unsigned shares = sizeof saved->share_q46 / sizeof saved->share_q46[0];
    bool is_sane = saved->max_percent == prepared->max_percent && saved->percent <= saved->max_percent &&
                   is_ramp_sane(&saved->ramp, &prepared->ramp) && share_q46[0] == saved->ramp.state.pos_q32;
    for (unsigned i = 0; i < shares; i++) {
        is_sane = is_sane && share_q46[i] >= 0 && share_q46[i] <= INTENSITY_FULL;
    }
    for (unsigned i = 0; is_sane && i + 1 < shares; i++) {
        is_sane = fx_abs(share_q46[i] - share_q46[i + 1]) <= limits->vel_per_cycle_q32 + 1;
    }
    for (unsigned i = 0; is_sane && i + 2 < shares; i++) {
        is_sane = fx_abs(share_q46[i] - 2 * share_q46[i + 1] + share_q46[i + 2]) <= limits->acc_per_cycle2_q32 + 1;
    }
    return is_sane;
}

static bool are_ramps_sane(const motion_t *saved, const motion_t *prepared)
{
    bool is_sane = is_intensity_sane(&saved->intensity, &prepared->intensity);
    for (unsigned i = 0; i < AXES_MAX; i++) {
        is_sane = is_sane && sane_bool(&saved->is_axis_moved[i]) && saved->is_axis_moved[i] == prepared->is_axis_moved[i] &&
                  is_ramp_sane(&saved->axis[i], &prepared->axis[i]) && is_state_sane(&saved->led[i]);
    }
    for (unsigned i = 0; i < CYLINDERS_MAX; i++) { /* those that are not there as well: they are all 0 */
        is_sane = is_sane && is_ramp_sane(&saved->cylinder[i], &prepared->cylinder[i]) && is_state_sane(&saved->reference[i]);
    }
    return is_sane;
}

static bool are_kinds_sane(const motion_t *saved)
{
    return (unsigned)saved->source <= MOTION_STRAIGHT && (unsigned)saved->next <= MOTION_THEN_FOLLOW &&
           (unsigned)saved->space <= MOTION_CYLINDERS && (unsigned)saved->due <= DUE_TIMED && saved->planned_slots <= AXES_MAX &&
           saved->limiting_cylinder <= CYLINDERS_MAX;
}

static bool are_bools_sane(const motion_t *saved)
{
    return sane_bool(&saved->is_pose_stale) && sane_bool(&saved->is_space_new) && sane_bool(&saved->is_following) &&
           sane_bool(&saved->is_taking_over) && sane_bool(&saved->is_fading) && sane_bool(&saved->has_pending) &&
           sane_bool(&saved->is_stretched) && sane_bool(&saved->is_clamped) && sane_bool(&saved->is_time_idle) &&
           sane_bool(&saved->is_return) && (!saved->is_fading || saved->fade.least_cycles > 0);
}

static bool are_numbers_sane(const motion_t *saved)
{
    return sane_all_q32(saved->pose.axis_q32, POSE_AXES) && stream_sane_all(saved->slot_q32, AXES_MAX, SLOT_Q32) &&
           stream_sane_all(saved->goal_q32, AXES_MAX, SLOT_Q32) && stream_sane_all(saved->timed_way_q32, AXES_MAX, SLOT_Q32) &&
           stream_sane_all(saved->slot_extension_mm_q32, CYLINDERS_MAX, SLOT_Q32) &&

           sane_q32(saved->angle_target_deg_q32) && saved->asked_cycles >= 0 && saved->asked_cycles <= CYCLES_MAX &&
           saved->straight_after >= 0 && saved->straight_after <= CYCLES_MAX && saved->timed_share_q46 >= 0 &&
           saved->timed_share_q46 <= INTENSITY_FULL && sane_time(saved->last_us) && sane_time(saved->timed_end_us);
}

static bool are_governor_limits(const governor_limits_t *saved, governor_limits_t wanted)
{
    return saved->vel_per_cycle_q32 == wanted.vel_per_cycle_q32 && saved->acc_per_cycle2_q32 == wanted.acc_per_cycle2_q32 &&
           saved->jerk_per_cycle3_q32 == wanted.jerk_per_cycle3_q32;
}

/* A stream has the limits of the space that is followed in; before anything was followed it has none. */
static bool are_stream_limits_sane(const motion_t *saved, bool has_followed)
{
    const governor_limits_t none = {0};
    const stream_curve_t *curve = &saved->stream.curve;
    bool is_sane = has_followed || saved->stream.phase == STREAM_EMPTY;
    for (unsigned i = 0; i < AXES_MAX; i++) {
        const governor_limits_t wanted = has_followed ? follow_axis_limits(saved, i) : none;
        is_sane = is_sane && are_governor_limits(&curve->limits[i], wanted) &&
                  (i >= POSE_AXES || are_governor_limits(&curve->governor.limits[i], wanted));
    }
    for (unsigned i = 0; i < CYLINDERS_MAX; i++) {
        const governor_limits_t wanted = has_followed ? follow_cylinder_limits(saved, i) : none;
        is_sane = is_sane && are_governor_limits(&curve->governor.limits[POSE_AXES + i], wanted);
    }
    return is_sane;
}

static bool are_fade_limits_same(const fade_limits_t *a, const fade_limits_t *b)
{
    return a->vel_q32 == b->vel_q32 && a->acc_q32 == b->acc_q32 && a->jerk_q32 == b->jerk_q32;
}

static bool is_jump_sane(const motion_t *saved)
{
    bool is_sane = sane_bool(&saved->is_jumping);
    for (unsigned i = 0; i < POSE_AXES && is_sane && saved->is_jumping && saved->source == MOTION_STREAMED; i++) {
        const ramp_t *ramp = &saved->plan.jump.off[i];
        const bool is_there = ramp->state.pos_q32 != 0 || !ramp_is_at_rest(ramp);
        is_sane = is_sane &&
                  (!is_there || (sane_q32(ramp->limits.vel_per_cycle_q32) && ramp_is_prepared(ramp) && is_ramp_sane(ramp, ramp)));
    }
    return is_sane;
}

static bool is_what_leads_sane(const motion_t *saved, const motion_t *prepared)
{
    return stream_is_sane(&saved->stream, &prepared->stream) && is_jump_sane(saved) &&
           (are_stream_limits_sane(saved, true) || are_stream_limits_sane(saved, false)) &&
           spike_filter_is_sane(&saved->gate, &prepared->gate) && plan_is_sane(saved) && fade_is_sane(&saved->fade) &&
           are_fade_limits_same(&saved->fade_limits, &prepared->fade_limits) && saved->blend_cycles == prepared->blend_cycles;
}

bool motion_state_is_sane(const motion_t *saved, const motion_t *prepared)
{
    return kin_is_same(&saved->kin, &prepared->kin) && saved->cylinders == prepared->cylinders &&
           saved->cycle_us == prepared->cycle_us && are_limits_same(&saved->engage_limits, &prepared->engage_limits) &&
           is_same_q32(saved->neutral.axis_q32, prepared->neutral.axis_q32, POSE_AXES) &&
           is_same_q32(saved->settled_pose.axis_q32, prepared->settled_pose.axis_q32, POSE_AXES) &&
           is_same_q32(saved->neutral_mm_q32, prepared->neutral_mm_q32, saved->cylinders) &&
           is_same_q32(saved->settled_mm_q32, prepared->settled_mm_q32, saved->cylinders) && are_ramps_sane(saved, prepared) &&
           are_kinds_sane(saved) && jog_is_sane(saved, prepared) && is_what_leads_sane(saved, prepared) &&
           are_bools_sane(saved) && are_numbers_sane(saved) && motion_target_is_sane(&saved->pending) &&
           motion_target_is_sane(&saved->withheld);
}
