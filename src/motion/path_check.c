/* SPDX-License-Identifier: MIT
 * path_check.c - cylinder speeds, accelerations and jerks along a planned way, from differences of a few sampled extensions.
 * On a straight way with parameter s a cylinder's acceleration is c' s'' + c'' s'^2. The bend takes a quarter of the limit at
 * most, what it does not take is left for s''. The limiter stays the last word; this makes moves that it need not touch.
 */
#include "path_check.h"

#include "followed.h"

#define QUINTIC_SHIFT   5 /* a division for each limit of each piece took a sixth of the time of a plan */
#define QUINTIC_PIECES  (1 << QUINTIC_SHIFT)
#define STRAIGHT_PIECES 16
#define BLEND_PIECES    32

/* The last differences of one cylinder's extensions. */
typedef struct {
    q32_t pos_q32, first_q32, second_q32;
} differences_t;

/* @param samples added before
 * @return the third difference */
static q32_t add_sample(differences_t *d, int64_t samples, q32_t pos_q32)
{
    const q32_t first_q32 = pos_q32 - d->pos_q32;
    const q32_t second_q32 = first_q32 - d->first_q32;
    const q32_t third_q32 = samples >= 3 ? second_q32 - d->second_q32 : 0;
    d->second_q32 = samples >= 2 ? second_q32 : 0;
    d->first_q32 = samples >= 1 ? first_q32 : 0;
    d->pos_q32 = pos_q32;
    return third_q32;
}

/* limit * (cycles per piece)^power, with 1/16 to spare. */
static q32_t limit_per_piece(q32_t limit_q32, int64_t cycles, unsigned power)
{
    q32_t result_q32 = limit_q32 - limit_q32 / 16;
    for (unsigned i = 0; i < power; i++) {
        result_q32 = fx_mul_shift(result_q32, cycles, QUINTIC_SHIFT);
    }
    return result_q32;
}

static bool is_within(const differences_t *d, q32_t third_q32, const ramp_limits_t *limits, int64_t cycles)
{
    return fx_abs(d->first_q32) <= limit_per_piece(limits->vel_per_cycle_q32, cycles, 1) &&
           fx_abs(d->second_q32) <= limit_per_piece(limits->acc_per_cycle2_q32, cycles, 2) &&
           fx_abs(third_q32) <= limit_per_piece(limits->jerk_per_cycle3_q32, cycles, 3);
}

bool path_check_is_feasible(const platform_t *platform, const quintic_t *quintic)
{
    differences_t d[CYLINDERS_MAX] = {{0}};
    for (int64_t piece = 0; piece <= QUINTIC_PIECES; piece++) {
        pose_t pose;
        q32_t extension_mm_q32[CYLINDERS_MAX];
        for (unsigned i = 0; i < POSE_AXES; i++) {
            pose.axis_q32[i] = quintic_position(quintic, i, piece * (Q62_ONE / QUINTIC_PIECES));
        }
        if (kin_inverse(&platform->kin, &pose, extension_mm_q32) != HV_OK) {
            return false;
        }
        for (unsigned i = 0; i < platform->cylinders; i++) {
            const q32_t third_q32 = add_sample(&d[i], piece, extension_mm_q32[i]);
            if (!is_within(&d[i], third_q32, &platform->cylinder[i].limits, quintic->cycles)) {
                return false;
            }
        }
    }
    return true;
}

/* Speed at which the bend of the way takes a quarter of the acceleration limit. */
static void narrow_by_bend(path_limits_t *limits, q32_t bend_q32, q32_t acc_limit_q32)
{
    if (bend_q32 == 0) {
        return;
    }
    const int64_t square_q62 = fx_clamp(fx_mul_div(acc_limit_q32 / 4, Q62_ONE, bend_q32), 1, Q62_ONE);
    const int64_t vel_q62 = (int64_t)fx_sqrt_u64((uint64_t)square_q62) * ((int64_t)1 << 31);
    limits->vel_q62 = vel_q62 < limits->vel_q62 ? vel_q62 : limits->vel_q62;
}

static void narrow_by_speed(path_limits_t *limits, q32_t slope_q32, q32_t vel_limit_q32)
{
    const int64_t vel_q62 = slope_q32 > 0 ? fx_mul_div(vel_limit_q32 - vel_limit_q32 / 64, Q62_ONE, slope_q32) : Q62_ONE;
    limits->vel_q62 = vel_q62 < limits->vel_q62 ? vel_q62 : limits->vel_q62;
}

/* What the bend leaves of a cylinder's acceleration, c'' s'^2, and jerk, 3 c'' s' s'', at the most that the path allows. */
static ramp_limits_t less_bend(const ramp_limits_t *own, q32_t bend_q32, const path_limits_t *limits)
{
    const q32_t by_vel_q32 = fx_mul_shift(bend_q32, limits->vel_q62, 62);
    ramp_limits_t left = *own;
    left.acc_per_cycle2_q32 -= fx_clamp(fx_mul_shift(by_vel_q32, limits->vel_q62, 62), 0, own->acc_per_cycle2_q32 / 4);
    left.jerk_per_cycle3_q32 -= fx_clamp(3 * fx_mul_shift(by_vel_q32, limits->acc_q62, 62), 0, own->jerk_per_cycle3_q32 / 4);
    return left;
}

void path_check_narrow(const platform_t *platform, const ramp_t *limiter, const q32_t *from_q32, const q32_t *to_q32,
                       path_limits_t *limits)
{
    differences_t d[CYLINDERS_MAX] = {{0}};
    q32_t slope_q32[CYLINDERS_MAX] = {0};
    q32_t bend_q32[CYLINDERS_MAX] = {0};
    for (int64_t piece = 0; piece <= STRAIGHT_PIECES; piece++) {
        pose_t pose;
        q32_t extension_mm_q32[CYLINDERS_MAX];
        for (unsigned i = 0; i < POSE_AXES; i++) {
            pose.axis_q32[i] = from_q32[i] + fx_mul_div(to_q32[i] - from_q32[i], piece, STRAIGHT_PIECES);
        }
        if (kin_inverse(&platform->kin, &pose, extension_mm_q32) != HV_OK) {
            return;
        }
        for (unsigned i = 0; i < platform->cylinders; i++) {
            (void)add_sample(&d[i], piece, extension_mm_q32[i]);
            slope_q32[i] = fx_abs(d[i].first_q32) > slope_q32[i] ? fx_abs(d[i].first_q32) : slope_q32[i];
            bend_q32[i] = fx_abs(d[i].second_q32) > bend_q32[i] ? fx_abs(d[i].second_q32) : bend_q32[i];
        }
    }
    for (unsigned i = 0; i < platform->cylinders; i++) {
        const ramp_limits_t *own = &limiter[i].limits;
        slope_q32[i] *= STRAIGHT_PIECES;
        bend_q32[i] *= STRAIGHT_PIECES * STRAIGHT_PIECES;
        narrow_by_speed(limits, slope_q32[i], own->vel_per_cycle_q32);
        narrow_by_bend(limits, bend_q32[i], own->acc_per_cycle2_q32);
    }
    for (unsigned i = 0; i < platform->cylinders; i++) {
        const ramp_limits_t left = less_bend(&limiter[i].limits, bend_q32[i], limits);
        path_limits_narrow(limits, slope_q32[i], &left);
    }
}

/* The positions of a stop n cycles later, by the trapezoidal rule. */
static void advance_stop(const sync_stop_t *stop, int64_t cycle, int64_t n, q32_t *vel_q32, q32_t *pos_q32)
{
    for (unsigned i = 0; i < stop->axes; i++) {
        const q32_t next_q32 = sync_stop_velocity(stop, i, cycle);
        pos_q32[i] += (vel_q32[i] + next_q32) * n / 2;
        vel_q32[i] = next_q32;
    }
}

/* A sample of several axes: whether each is within. */
static bool are_within(differences_t *d, int64_t sample, const q32_t *pos_q32, unsigned count, const ramp_limits_t *const *limits,
                       int64_t n)
{
    bool are = true;
    for (unsigned i = 0; i < count; i++) {
        const q32_t third_q32 = add_sample(&d[i], sample, pos_q32[i]);
        are = are && fx_abs(d[i].first_q32) <= limits[i]->vel_per_cycle_q32 * n + n &&
              fx_abs(d[i].second_q32) <= (limits[i]->acc_per_cycle2_q32 * n + n) * n &&
              fx_abs(third_q32) <= (limits[i]->jerk_per_cycle3_q32 * n + n) * n * n;
    }
    return are;
}

HV_OWN_FRAME bool path_check_blend_is_feasible(const platform_t *platform, const followed_t *followed, const path_t *path,
                                               int64_t after)
{
    const straight_t *line = &path->way.straight;
    const sync_stop_t *stop = &path->stop;
    const int64_t n = 1 + stop->cycles / BLEND_PIECES;
    scurve_t curve = line->curve;
    differences_t axis[AXES_MAX] = {{0}};
    differences_t cylinder[CYLINDERS_MAX] = {{0}};
    const ramp_limits_t *axis_list[AXES_MAX];
    const ramp_limits_t *cylinder_list[CYLINDERS_MAX];
    q32_t vel_q32[AXES_MAX];
    q32_t stopped_q32[AXES_MAX];
    for (unsigned i = 0; i < path->axes; i++) {
        axis_list[i] = followed_limits(followed, platform, i);
        vel_q32[i] = stop->start[i].vel_per_cycle_q32;
        stopped_q32[i] = stop->start[i].pos_q32;
    }
    for (unsigned i = 0; i < CYLINDERS_MAX; i++) {
        cylinder_list[i] = &platform->cylinder[i].limits;
    }
    for (int64_t cycle = n, sample = 0; cycle <= stop->cycles + n; cycle += n, sample++) {
        q32_t pos_q32[AXES_MAX] = {0};
        q32_t extension_mm_q32[CYLINDERS_MAX];
        pose_t pose = {{0}};
        advance_stop(stop, cycle, n, vel_q32, stopped_q32);
        for (int64_t k = cycle - n; k < cycle; k++) {
            if (k >= after) {
                scurve_step(&curve);
            }
        }
        for (unsigned i = 0; i < path->axes; i++) {
            pos_q32[i] = stopped_q32[i] + scurve_between(&curve, line->from_q32[i], line->to_q32[i]) - line->from_q32[i];
        }
        if (!are_within(axis, sample, pos_q32, path->axes, axis_list, n)) {
            return false;
        }
        for (unsigned i = 0; i < POSE_AXES; i++) {
            pose.axis_q32[i] = pos_q32[i];
        }
        if (followed->space == MOTION_POSE &&
            (kin_inverse(&platform->kin, &pose, extension_mm_q32) != HV_OK ||
             !are_within(cylinder, sample, extension_mm_q32, platform->cylinders, cylinder_list, n))) {
            return false;
        }
    }
    return true;
}
