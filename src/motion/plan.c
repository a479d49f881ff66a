/* SPDX-License-Identifier: MIT
 * plan.c - see plan.h. Where a plan starts and what limits it are calculated where they are needed: they would lie on the stack
 * under everything that an attempt calls.
 */
#include "plan.h"

#include "ref_history.h"
#include "followed.h"
#include "path_check.h"

#define BLEND_PARTS     8 /* of a stop, after which the straight line behind it may begin */
#define SMALL_WAY_Q32   (Q32_ONE / 16)
#define START_SLACK_Q32 (Q32_ONE / 1000) /* rounding of a quintic's first points */

/* Where an axis starts. The intensity moves axes by itself, which is not for the plan to do: this is less by what it adds. */
static ramp_state_t start_of(const plan_in_t *in, unsigned i)
{
    const ramp_state_t *at = followed_state(in->followed, in->platform, i);
    const ramp_ref_t shift = intensity_shift(in->intensity, in->targets->planned_share_q46, in->targets->planned_way_q32[i]);
    const ramp_state_t base = ref_history_state(&shift); /* the shift is that of this cycle, the state that of the one before */
    return (ramp_state_t){at->pos_q32 - base.pos_q32, at->vel_per_cycle_q32 - base.vel_per_cycle_q32,
                          at->acc_per_cycle2_q32 - base.acc_per_cycle2_q32};
}

/* The limits of an axis. Where cylinders moved it beyond its range, the way back begins there. */
static ramp_limits_t limits_of(const plan_in_t *in, unsigned i)
{
    ramp_limits_t limits = *followed_limits(in->followed, in->platform, i);
    const q32_t start_q32 = start_of(in, i).pos_q32;
    limits.pos_min_q32 = fx_clamp(start_q32 - START_SLACK_Q32, INT64_MIN, limits.pos_min_q32);
    limits.pos_max_q32 = fx_clamp(start_q32 + START_SLACK_Q32, limits.pos_max_q32, INT64_MAX);
    return limits;
}

HV_OWN_FRAME static bool plan_quintic(const plan_in_t *in, int64_t cycles, quintic_t *quintic)
{
    ramp_state_t start[AXES_MAX];
    for (unsigned i = 0; i < AXES_MAX; i++) {
        start[i] = start_of(in, i);
    }
    return quintic_plan(quintic, AXES_MAX, start, in->targets->goal_q32, cycles) == HV_OK;
}

/* Whether every axis keeps its limits. */
HV_OWN_FRAME static bool keeps_limits(const plan_in_t *in, const quintic_t *quintic)
{
    ramp_limits_t own[AXES_MAX];
    const ramp_limits_t *list[AXES_MAX];
    for (unsigned i = 0; i < AXES_MAX; i++) {
        own[i] = limits_of(in, i);
        list[i] = &own[i];
    }
    return quintic_is_feasible(quintic, list);
}

/* Plans a quintic; false where an axis or a cylinder would break its limits. */
static bool try_quintic(const plan_in_t *in, int64_t cycles, path_t *path)
{
    quintic_t *quintic = &path->way.quintic;
    path->kind = PATH_QUINTIC;
    if (!plan_quintic(in, cycles, quintic)) {
        return false;
    }
    return keeps_limits(in, quintic) && (in->followed->space != MOTION_POSE || path_check_is_feasible(in->platform, quintic));
}

/* A stop of all axes together, which the cylinders can go along with. */
HV_OWN_FRAME static void plan_stop(const plan_in_t *in, unsigned axes, sync_stop_t *stop)
{
    const platform_t *platform = in->platform;
    HV_ASSERT(axes <= AXES_MAX);
    const ramp_limits_t *limits[AXES_MAX];
    sync_stop_riders_t riders = {.count = in->followed->space == MOTION_POSE ? platform->cylinders : 0};
    for (unsigned i = 0; i < riders.count; i++) {
        riders.state[i] = &platform->cylinder[i].state;
        riders.limits[i] = &platform->cylinder[i].limits;
    }
    for (unsigned i = 0; i < axes; i++) {
        limits[i] = followed_limits(in->followed, platform, i);
        stop->start[i] = start_of(in, i);
    }
    sync_stop_plan(stop, axes, POSE_AXES, stop->start, limits, &riders);
}

path_limits_t plan_limits_of_straight(const platform_t *platform, const followed_t *followed, unsigned axes,
                                      const q32_t *from_q32, const q32_t *to_q32)
{
    path_limits_t limits = path_limits_none();
    for (unsigned i = 0; i < axes; i++) {
        path_limits_narrow(&limits, to_q32[i] - from_q32[i], followed_limits(followed, platform, i));
    }
    if (followed->space == MOTION_POSE) {
        path_check_narrow(platform, platform->cylinder, from_q32, to_q32, &limits);
    }
    return limits;
}

/* From rest: the straight line. */
static void plan_straight(const plan_in_t *in, unsigned axes, int64_t least_cycles, path_t *path)
{
    straight_t *line = &path->way.straight;
    path->kind = PATH_STRAIGHT;
    for (unsigned i = 0; i < AXES_MAX; i++) {
        line->history[i] = *followed_state(in->followed, in->platform, i);
        line->from_q32[i] = line->history[i].pos_q32;
        line->to_q32[i] = in->targets->goal_q32[i];
    }
    const path_limits_t limits = plan_limits_of_straight(in->platform, in->followed, axes, line->from_q32, line->to_q32);
    scurve_plan(&line->curve, &limits, least_cycles);
}

/* In motion: a stop, and the straight line from where it ends, of so many cycles at least; the cycles of both. The line begins as
 * early in the stop as the limits allow. Each part goes one way only, so that the sum goes no further than the stop or the
 * target. */
static int64_t plan_stop_and_straight(const plan_in_t *in, unsigned axes, int64_t least_cycles, path_t *path)
{
    straight_t *line = &path->way.straight;
    sync_stop_t *stop = &path->stop;
    path->kind = PATH_STOP_AND_STRAIGHT;
    plan_stop(in, axes, stop);
    for (unsigned i = 0; i < axes; i++) {
        line->history[i] = stop->start[i];
        line->from_q32[i] = stop->rest_q32[i];
        line->to_q32[i] = in->targets->goal_q32[i];
    }
    const path_limits_t limits = plan_limits_of_straight(in->platform, in->followed, axes, line->from_q32, line->to_q32);
    scurve_plan(&line->curve, &limits, 1);
    int64_t part = 0;
    while (part < BLEND_PARTS &&
           !path_check_blend_is_feasible(in->platform, in->followed, path, stop->cycles * part / BLEND_PARTS)) {
        part++;
    }
    path->straight_after = stop->cycles * part / BLEND_PARTS;
    scurve_plan(&line->curve, &limits, least_cycles - path->straight_after);
    const int64_t cycles = path->straight_after + scurve_cycles(&line->curve);
    return cycles > stop->cycles ? cycles : stop->cycles;
}

int64_t plan_timed(const plan_in_t *in, int64_t cycles, path_t *path)
{
    HV_ASSERT(cycles >= 1);
    path->axes = AXES_MAX;
    if (try_quintic(in, cycles, path)) {
        return cycles;
    }
    if (followed_are_at_rest(in->followed, in->platform, AXES_MAX)) {
        plan_straight(in, AXES_MAX, cycles, path);
        return scurve_cycles(&path->way.straight.curve);
    }
    return plan_stop_and_straight(in, AXES_MAX, cycles, path);
}

/* Whether no cylinder could be asked for more than it can do while each of these axes moves as quickly as it may: by what a small
 * way of each axis is for the cylinders at the goal. */
static bool can_axes_go_alone(const plan_in_t *in)
{
    const platform_t *platform = in->platform;
    const q32_t *goal_q32 = in->targets->goal_q32;
    pose_t pose;
    q32_t at_mm_q32[CYLINDERS_MAX];
    int64_t need_q16[CYLINDERS_MAX][3] = {{0}};
    for (unsigned i = 0; i < POSE_AXES; i++) {
        pose.axis_q32[i] = goal_q32[i];
    }
    bool is_reached = kin_inverse(&platform->kin, &pose, at_mm_q32) == HV_OK;
    for (unsigned i = 0; i < POSE_AXES; i++) {
        const ramp_state_t *state = followed_state(in->followed, platform, i);
        const ramp_limits_t *axis = followed_limits(in->followed, platform, i);
        if (!platform->is_axis_moved[i] || (state->pos_q32 == goal_q32[i] && ramp_is_at_rest(&platform->axis[i]))) {
            continue;
        }
        q32_t there_mm_q32[CYLINDERS_MAX] = {0};
        pose.axis_q32[i] += SMALL_WAY_Q32;
        is_reached = is_reached && kin_inverse(&platform->kin, &pose, there_mm_q32) == HV_OK;
        pose.axis_q32[i] -= SMALL_WAY_Q32;
        for (unsigned c = 0; c < platform->cylinders && is_reached; c++) {
            const ramp_limits_t *cylinder = &platform->cylinder[c].limits;
            const q32_t travel_q32 = fx_abs(there_mm_q32[c] - at_mm_q32[c]) * (Q32_ONE / SMALL_WAY_Q32);
            need_q16[c][0] +=
                fx_mul_div(fx_mul_shift(axis->vel_per_cycle_q32, travel_q32, 32), Q16_ONE, cylinder->vel_per_cycle_q32);
            need_q16[c][1] +=
                fx_mul_div(fx_mul_shift(axis->acc_per_cycle2_q32, travel_q32, 32), Q16_ONE, cylinder->acc_per_cycle2_q32);
            need_q16[c][2] +=
                fx_mul_div(fx_mul_shift(axis->jerk_per_cycle3_q32, travel_q32, 32), Q16_ONE, cylinder->jerk_per_cycle3_q32);
        }
    }
    for (unsigned c = 0; c < platform->cylinders; c++) {
        is_reached = is_reached && need_q16[c][0] < Q16_ONE && need_q16[c][1] < Q16_ONE && need_q16[c][2] < Q16_ONE;
    }
    return is_reached;
}

bool plan_step(const plan_in_t *in, path_t *path)
{
    const bool is_resting = followed_are_at_rest(in->followed, in->platform, POSE_AXES);
    if (!is_resting && in->followed->phase != FOLLOW_FADING_IN &&
        (in->followed->space == MOTION_CYLINDERS || can_axes_go_alone(in))) {
        return false;
    }
    path->axes = POSE_AXES;
    if (is_resting) {
        plan_straight(in, POSE_AXES, 1, path);
    } else {
        (void)plan_stop_and_straight(in, POSE_AXES, 1, path);
    }
    return true;
}
