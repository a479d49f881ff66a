/* SPDX-License-Identifier: MIT
 * envelope.c - the workspace by walking it; see envelope.h.
 * Reach: in small steps from neutral until a cylinder leaves its stroke or the platform comes near a singularity, then halving.
 * The worst cases of a box: over a grid of it, then climbing from the worst points of the grid. Poses out of reach are pulled in
 * on the way from neutral as motion does it, so that the edge of the workspace is looked at, where the worst cases are.
 */
#include "platform/envelope.h"

#include <math.h>

#include "platform/mechanism.h"
#include "heave/ramp.h"

#define HALVINGS       24
#define PULL_HALVINGS  12
#define SHARE_MAX      4.0 /* of a pair: reaches may be longer together where one axis takes back what the other asks */
#define GRID_POINTS_6  3u  /* per axis, of six: low, neutral, high */
#define GRID_POINTS_3  9u  /* of three axes: as many poses in all */
#define CLIMB_ROUNDS   8   /* steps from half of the box down to 1/256 of it */
#define CLIMBS         2u
#define STENCIL_STEP   0.25 /* u */
#define STENCIL_POINTS 5u
#define RESERVE        0.96 /* of a cylinder's limit that is given away: somewhere it may be a little worse than found */
#define SLOPE_MIN      1e-6 /* of an axis that moves no cylinder */
#define SPEED_MAX      10000.0
#define ACCEL_MAX      32767.0
#define JERK_MAX       2147483647.0

static const double k_range[POSE_AXES] = {90, 90, 180, 4000, 4000, 4000};
static const double k_step[POSE_AXES] = {0.25, 0.25, 0.25, 1, 1, 1}; /* of a walk */

static double from_q32(q32_t value_q32)
{
    return (double)value_q32 / (double)Q32_ONE;
}

static q32_t to_q32(double value)
{
    return (q32_t)llround(value * (double)Q32_ONE);
}

static double from_q16(q16_t value_q16)
{
    return (double)value_q16 / (double)Q16_ONE;
}

static q16_t to_q16(double value)
{
    return (q16_t)lround(value * (double)Q16_ONE);
}

/* ---- Reach ---- */

/* First cylinder out of its stroke, or ENVELOPE_OPEN. */
static unsigned find_outside(const envelope_t *self, const pose_t *pose)
{
    q32_t extension_q32;
    const unsigned found =
        config_mechanism_find_outside(self->settings, &self->kin, pose, self->settings->margin_mm_q16, &extension_q32);
    return found < self->cylinders ? found : ENVELOPE_OPEN;
}

/* What forbids a pose. */
static unsigned find_cause(const envelope_t *self, const pose_t *pose)
{
    const unsigned found = find_outside(self, pose);
    if (found == ENVELOPE_OPEN && !kin_has_margin(&self->kin, pose, KIN_MARGIN_LEAST_Q32)) {
        return ENVELOPE_SINGULAR;
    }
    return found;
}

/* The pose at a share of a way from neutral. */
static pose_t pose_at(const envelope_t *self, const double way[POSE_AXES], double share)
{
    pose_t pose = self->neutral;
    for (unsigned axis = 0; axis < POSE_AXES; axis++) {
        pose.axis_q32[axis] += to_q32(way[axis] * share);
    }
    return pose;
}

/* Steps of a walk along a way, up to a share of it. */
static int count_steps(const double way[POSE_AXES], double share)
{
    double steps = 0;
    for (unsigned axis = 0; axis < POSE_AXES; axis++) {
        steps = fmax(steps, fabs(way[axis]) * share / k_step[axis]);
    }
    return (int)ceil(steps);
}

/* Goes from neutral along a way until something ends it; the share of the way that is left. */
static double walk(const envelope_t *self, const double way[POSE_AXES], double share_max, unsigned *cause)
{
    const int steps = count_steps(way, share_max);
    double inside = 0, outside = share_max;
    pose_t pose = self->neutral;
    *cause = ENVELOPE_RANGE;
    for (int i = 1; i <= steps && *cause == ENVELOPE_RANGE; i++) {
        pose = pose_at(self, way, share_max * i / steps);
        const unsigned found = find_cause(self, &pose);
        *cause = found == ENVELOPE_OPEN ? ENVELOPE_RANGE : found;
        outside = share_max * i / steps;
        inside = found == ENVELOPE_OPEN ? outside : inside;
    }
    for (int i = 0; i < HALVINGS && *cause != ENVELOPE_RANGE; i++) {
        const double middle = (inside + outside) / 2;
        pose = pose_at(self, way, middle);
        const unsigned found = find_cause(self, &pose);
        inside = found == ENVELOPE_OPEN ? middle : inside;
        outside = found == ENVELOPE_OPEN ? outside : middle;
        *cause = found == ENVELOPE_OPEN ? *cause : found;
    }
    return inside;
}

static envelope_end_t find_end(const envelope_t *self, unsigned axis, double sign)
{
    const double neutral = from_q32(self->neutral.axis_q32[axis]);
    double way[POSE_AXES] = {0};
    envelope_end_t end = {0, ENVELOPE_OPEN};
    way[axis] = sign * k_range[axis] - neutral;
    end.value = neutral + way[axis] * walk(self, way, 1.0, &end.cause);
    return end;
}

envelope_pair_t envelope_pair(const envelope_t *self, unsigned axis, unsigned other, unsigned direction)
{
    const double angle = 2 * acos(-1.0) * direction / ENVELOPE_DIRECTIONS;
    const unsigned axes[2] = {axis, other};
    const double parts[2] = {cos(angle), sin(angle)};
    double way[POSE_AXES] = {0}, share_max = SHARE_MAX;
    envelope_pair_t pair = {0, ENVELOPE_OPEN, self->neutral};
    for (unsigned i = 0; i < 2; i++) {
        const double neutral = from_q32(self->neutral.axis_q32[axes[i]]);
        const double end = parts[i] >= 0 ? self->high[axes[i]].value : self->low[axes[i]].value;
        way[axes[i]] = fabs(parts[i]) < 1e-9 ? 0 : fabs(parts[i]) * (end - neutral);
        if (way[axes[i]] != 0) {
            const double room = k_range[axes[i]] - (way[axes[i]] > 0 ? neutral : -neutral);
            share_max = fmin(share_max, room / fabs(way[axes[i]]));
        }
    }
    pair.share = walk(self, way, share_max, &pair.cause);
    pair.pose = pose_at(self, way, pair.share);
    return pair;
}

/* ---- Worst cases of a box ---- */

/* Extensions on both sides of a pose along one axis. */
static bool find_stencil(const envelope_t *self, const pose_t *pose, unsigned axis, double mm[STENCIL_POINTS][CYLINDERS_MAX])
{
    for (unsigned point = 0; point < STENCIL_POINTS; point++) {
        q32_t extension_q32[CYLINDERS_MAX];
        pose_t moved = *pose;
        moved.axis_q32[axis] += to_q32(((double)point - 2) * STENCIL_STEP);
        if (kin_inverse(&self->kin, &moved, extension_q32) != HV_OK) {
            return false;
        }
        for (unsigned i = 0; i < self->cylinders; i++) {
            mm[point][i] = from_q32(extension_q32[i]);
        }
    }
    return true;
}

/* Takes a pose into the worst of one axis; adds what each cylinder does at the axis' speed limit. */
static void add_axis(const envelope_t *self, const pose_t *pose, unsigned axis, envelope_rate_t *worst, double speed_mm_s[])
{
    const double speed = from_q16(self->settings->axis[axis].speed_q16), h = STENCIL_STEP;
    double mm[STENCIL_POINTS][CYLINDERS_MAX];
    if (!find_stencil(self, pose, axis, mm)) {
        return;
    }
    for (unsigned i = 0; i < self->cylinders; i++) {
        const double near_mm = mm[3][i] - mm[1][i], far_mm = mm[4][i] - mm[0][i];
        const double slope = fabs(8 * near_mm - far_mm) / (12 * h);
        const double bend = fabs(16 * (mm[3][i] + mm[1][i]) - mm[4][i] - mm[0][i] - 30 * mm[2][i]) / (12 * h * h);
        const double twist = fabs(far_mm - 2 * near_mm) / (2 * h * h * h);
        speed_mm_s[i] += slope * speed;
        worst->bend = fmax(worst->bend, bend);
        worst->twist = fmax(worst->twist, twist);
        if (slope > worst->slope) {
            worst->slope = slope;
            worst->cylinder = i;
            worst->pose = *pose;
        }
    }
}

static void add_pose(const envelope_t *self, const pose_t *pose, envelope_box_t *box)
{
    double speed_mm_s[CYLINDERS_MAX] = {0};
    for (unsigned axis = 0; axis < POSE_AXES; axis++) {
        if (self->has_axis[axis]) {
            add_axis(self, pose, axis, &box->rate[axis], speed_mm_s);
        }
    }
    for (unsigned i = 0; i < self->cylinders; i++) {
        box->all_pose = speed_mm_s[i] > box->all_mm_s ? *pose : box->all_pose;
        box->all_mm_s = fmax(box->all_mm_s, speed_mm_s[i]);
    }
    if (!kin_has_margin(&self->kin, pose, to_q32(box->margin))) {
        box->margin = from_q32(kin_margin(&self->kin, pose));
        box->margin_pose = *pose;
    }
    box->poses++;
}

/* Brings a way that leads out of the stroke back into it. */
static pose_t pull_in(const envelope_t *self, const double way[POSE_AXES])
{
    double inside = 0, outside = 1;
    pose_t pose = pose_at(self, way, 1);
    if (find_outside(self, &pose) == ENVELOPE_OPEN) {
        return pose;
    }
    for (int i = 0; i < PULL_HALVINGS; i++) {
        const double middle = (inside + outside) / 2;
        pose = pose_at(self, way, middle);
        const bool is_inside = find_outside(self, &pose) == ENVELOPE_OPEN;
        inside = is_inside ? middle : inside;
        outside = is_inside ? outside : middle;
    }
    return pose_at(self, way, inside);
}

/* What is looked for in a box: the worst slope of each axis, and these. */
enum { WORST_ALL = POSE_AXES, WORST_MARGIN, WORSTS };

static double worst_value(const envelope_box_t *box, unsigned what)
{
    return what == WORST_MARGIN ? -box->margin : what == WORST_ALL ? box->all_mm_s : box->rate[what].slope;
}

static const pose_t *worst_pose(const envelope_box_t *box, unsigned what)
{
    return what == WORST_MARGIN ? &box->margin_pose : what == WORST_ALL ? &box->all_pose : &box->rate[what].pose;
}

/* Goes on from the worst pose so far along one axis; whether that is worse still. */
static bool climb_along(const envelope_t *self, envelope_box_t *box, unsigned what, unsigned axis, double step)
{
    const double before = worst_value(box, what);
    double way[POSE_AXES];
    for (unsigned i = 0; i < POSE_AXES; i++) {
        way[i] = from_q32(worst_pose(box, what)->axis_q32[i] - self->neutral.axis_q32[i]);
    }
    const double neutral = from_q32(self->neutral.axis_q32[axis]);
    way[axis] = fmin(fmax(way[axis] + step, box->low[axis] - neutral), box->high[axis] - neutral);
    const pose_t pose = pull_in(self, way);
    add_pose(self, &pose, box);
    return worst_value(box, what) > before;
}

static void climb(const envelope_t *self, envelope_box_t *box, unsigned what)
{
    double share = 0.5;
    for (int round = 0; round < CLIMB_ROUNDS; round++) {
        for (unsigned axis = 0; axis < POSE_AXES; axis++) {
            const double step = share * (box->high[axis] - box->low[axis]);
            if (self->has_axis[axis] && !climb_along(self, box, what, axis, step)) {
                (void)climb_along(self, box, what, axis, -step);
            }
        }
        share /= 2;
    }
}

/* From neutral to the value of an axis at a point of the grid: equal steps to either end. */
static double grid_way(const envelope_t *self, const envelope_box_t *box, unsigned axis, int point, int middle)
{
    const double end = point < middle ? box->low[axis] : box->high[axis];
    return fabs((double)(point - middle)) / middle * (end - from_q32(self->neutral.axis_q32[axis]));
}

static void find_box(const envelope_t *self, envelope_box_t *box)
{
    const unsigned points = self->settings->geometry.kind == KIN_HEXAPOD ? GRID_POINTS_6 : GRID_POINTS_3;
    unsigned count = 1;
    box->margin = 1;
    for (unsigned axis = 0; axis < POSE_AXES; axis++) {
        count *= self->has_axis[axis] ? points : 1u;
    }
    for (unsigned index = 0; index < count; index++) {
        double way[POSE_AXES] = {0};
        unsigned rest = index;
        for (unsigned axis = 0; axis < POSE_AXES; axis++) {
            if (self->has_axis[axis]) {
                way[axis] = grid_way(self, box, axis, (int)(rest % points), (int)(points / 2));
                rest /= points;
            }
        }
        const pose_t pose = pull_in(self, way);
        add_pose(self, &pose, box);
    }
    for (unsigned i = 0; i < CLIMBS * WORSTS; i++) { /* one climb may find a better start for another */
        if (i % WORSTS >= POSE_AXES || self->has_axis[i % WORSTS]) {
            climb(self, box, i % WORSTS);
        }
    }
}

/* What was found in a part of a box holds for the box. */
static void add_part(envelope_box_t *box, const envelope_box_t *part)
{
    for (unsigned axis = 0; axis < POSE_AXES; axis++) {
        const envelope_rate_t *rate = &part->rate[axis];
        box->rate[axis].bend = fmax(box->rate[axis].bend, rate->bend);
        box->rate[axis].twist = fmax(box->rate[axis].twist, rate->twist);
        if (rate->slope > box->rate[axis].slope) {
            box->rate[axis].slope = rate->slope;
            box->rate[axis].cylinder = rate->cylinder;
            box->rate[axis].pose = rate->pose;
        }
    }
    if (part->margin < box->margin) {
        box->margin = part->margin;
        box->margin_pose = part->margin_pose;
    }
}

/* ---- Limits ---- */

/* Down to three digits. */
static double round_down(double value)
{
    const double unit = value > 0 ? pow(10, floor(log10(value)) - 2) : 1;
    return floor(value / unit) * unit;
}

envelope_demand_t envelope_demand(const envelope_rate_t *rate, const envelope_limits_t *limits)
{
    const double v = limits->speed, a = limits->accel;
    return (envelope_demand_t){
        .speed_mm_s = rate->slope * v,
        .accel_mm_s2 = rate->slope * a + rate->bend * v * v,
        .jerk_mm_s3 = rate->slope * limits->jerk + 3 * rate->bend * v * a + rate->twist * v * v * v,
    };
}

/* The least of what there is and what is asked for; what has to be given up is given up in round numbers. */
static double lower(double limit, double most)
{
    return most < limit ? round_down(most) : limit;
}

/* The acceleration that a ramp with these limits comes to. */
static double reached(const settings_t *settings, const envelope_limits_t *limits)
{
    ramp_limits_t ramp;
    if (ramp_limits_from_units(to_q16(limits->min), to_q16(limits->max), to_q16(limits->speed), to_q16(limits->accel),
                               (int32_t)limits->jerk, settings->cycle_us, &ramp) != HV_OK) {
        return limits->accel;
    }
    return limits->accel * fmin((double)ramp_safe_acceleration(&ramp) / (double)ramp.acc_per_cycle2_q32, 1);
}

/* Half of the cylinders' acceleration and jerk at most go into what is left over at constant speed and acceleration of the axis:
 * where that is more, it is the speed that is too high. */
void envelope_suggest(const settings_t *settings, const envelope_rate_t *rate, envelope_limits_t *limits)
{
    const double speed_mm_s = RESERVE * from_q16(settings->cylinder_speed_mm_s_q16);
    const double accel_mm_s2 = RESERVE * from_q16(settings->cylinder_accel_mm_s2_q16);
    const double jerk_mm_s3 = RESERVE * (double)settings->cylinder_jerk_mm_s3;
    const double slope = fmax(rate->slope, SLOPE_MIN);
    envelope_limits_t steady = {.speed = fmin(speed_mm_s / slope, limits->speed)};
    double curve_mm_s2, curve_mm_s3;
    for (;;) {
        curve_mm_s2 = rate->bend * steady.speed * steady.speed;
        steady.accel = fmin(fmax(accel_mm_s2 - curve_mm_s2, 0) / slope, limits->accel);
        steady.accel = fmin(steady.accel, sqrt(steady.speed * jerk_mm_s3 / slope)); /* more is never reached */
        curve_mm_s3 = envelope_demand(rate, &steady).jerk_mm_s3;
        if (curve_mm_s2 <= accel_mm_s2 / 2 && curve_mm_s3 <= jerk_mm_s3 / 2) {
            break;
        }
        steady.speed *= 0.95;
    }
    limits->speed = lower(limits->speed, steady.speed);
    limits->jerk = lower(limits->jerk, (jerk_mm_s3 - curve_mm_s3) / slope);
    limits->accel = lower(limits->accel, steady.accel);
    limits->accel = lower(limits->accel, reached(settings, limits));
}

/* Towards neutral, to a tenth where there is so much. */
static double round_end(double end, double neutral)
{
    const double unit = fabs(end - neutral) > 1 ? 10 : 1000;
    return end > neutral ? floor(end * unit) / unit : ceil(end * unit) / unit;
}

/* ---- All of it ---- */

static void find_axis(envelope_t *self, unsigned axis)
{
    const axis_settings_t *configured = &self->settings->axis[axis];
    double ignored[CYLINDERS_MAX] = {0};
    self->low[axis] = find_end(self, axis, -1);
    self->high[axis] = find_end(self, axis, 1);
    add_axis(self, &self->neutral, axis, &self->at_neutral[axis], ignored);
    self->reach.low[axis] = self->low[axis].value;
    self->reach.high[axis] = self->high[axis].value;
    self->limits.low[axis] = fmax(self->low[axis].value, from_q16(configured->min_q16));
    self->limits.high[axis] = fmin(self->high[axis].value, from_q16(configured->max_q16));
}

bool envelope_find(envelope_t *self, const settings_t *settings)
{
    *self = (envelope_t){.settings = settings};
    if (kin_init(&self->kin, &settings->geometry) != HV_OK) {
        return false;
    }
    self->cylinders = kin_cylinders(&self->kin);
    for (unsigned axis = 0; axis < POSE_AXES; axis++) {
        self->neutral.axis_q32[axis] = q32_from_q16(settings->neutral_q16[axis]);
        self->has_axis[axis] =
            settings->geometry.kind == KIN_HEXAPOD || axis == AXIS_ROLL || axis == AXIS_PITCH || axis == AXIS_Z;
    }
    self->margin_at_neutral = from_q32(kin_margin(&self->kin, &self->neutral));
    for (unsigned axis = 0; axis < POSE_AXES; axis++) {
        if (self->has_axis[axis]) {
            find_axis(self, axis);
        }
    }
    find_box(self, &self->limits);
    find_box(self, &self->reach);
    add_part(&self->reach, &self->limits);
    for (unsigned axis = 0; axis < POSE_AXES; axis++) {
        const double neutral = from_q32(self->neutral.axis_q32[axis]);
        if (self->has_axis[axis]) {
            self->suggested[axis].min = round_end(self->low[axis].value, neutral);
            self->suggested[axis].max = round_end(self->high[axis].value, neutral);
            self->suggested[axis].speed = SPEED_MAX;
            self->suggested[axis].accel = ACCEL_MAX;
            self->suggested[axis].jerk = JERK_MAX;
            envelope_suggest(settings, &self->reach.rate[axis], &self->suggested[axis]);
        }
    }
    return true;
}
