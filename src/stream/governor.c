/* SPDX-License-Identifier: MIT
 * governor.c - makes what a stream asks for beyond the limits slower and smoother; see governor.h.
 * Differences of means are means of differences, so a point between two levels needs at most what the needs of both mix to: the
 * strength follows from the needs in closed form. It rises as quickly as the output itself can bear, and falls slowly.
 */
#include "governor_speed.h"

#define SPAN_US       150000u             /* needs within such a time are one event, ... */
#define MEMORY_US     1500000u            /* ... which counts for so long: a shake of 0.4 Hz turns twice meanwhile */
#define REST_SHARE    128                 /* where no more than such a share of the goal is needed, it rests, ... */
#define REST_TIMES    2                   /* ... and half a second of that makes a beginning of what comes next */
#define QUIET_SHARE   4                   /* while no more than such a share of the goal is needed ... */
#define QUIET_TIMES   4u                  /* ... it is forgotten so much sooner */
#define RISE_Q32      (Q32_ONE * 3 / 8)   /* share of a low-pass through which the strength rises */
#define RELEASE_US    300000u             /* time constant with which the strength falls ... */
#define SOFT_US       100000u             /* ... which that rate comes to */
#define RELEASE_DIV   4                   /* ... and at least by a level in so many seconds, ... */
#define CATCH_DIV     6                   /* ... but not so fast that the output gains more than a sixth of the time, ... */
#define CATCH_SPEED   12                  /* ... or a twelfth of the largest speed, whichever is more */
#define PERIOD_MAX_US 2000000u            /* see governor_pace() */
#define LOOK_US       6000u               /* needs are those of differences over so long */
#define NEED_GOAL     (Q16_ONE * 19 / 20) /* of the limits */
#define PACE_SAME     64                  /* a period that differs by less than this share is the same */
#define NEAR_Q32      (Q32_ONE / 1000000) /* a low-pass so near to its input has arrived */

static const uint32_t k_time_constant_us[GOVERNOR_LEVELS] = {6000, 12000, 25000, 50000, 100000, 200000, 400000};

void governor_set_limits(governor_t *self, unsigned channel, const governor_limits_t *limits)
{
    HV_ASSERT(channel < GOVERNOR_CHANNELS);
    self->limits[channel] = *limits;
    self->period_us = 0;
}

/* 1 / (value per cycle * cycles^power), 0 for no limit. */
static int64_t reciprocal(q32_t per_cycle_q32, int64_t cycles_q16, unsigned power)
{
    q32_t per_period_q32 = per_cycle_q32;
    for (unsigned i = 0; i < power; i++) {
        per_period_q32 = fx_mul_shift(per_period_q32, cycles_q16, 16);
    }
    return per_period_q32 > 0 ? Q62_ONE / per_period_q32 : 0;
}

/* A^2 / (2 J V): what the speed still gains while an acceleration is taken back. */
static int32_t brake_share(const governor_limits_t *limits)
{
    if (limits->jerk_per_cycle3_q32 <= 0) {
        return 0;
    }
    const q32_t gained_q32 = fx_mul_div(limits->acc_per_cycle2_q32, limits->acc_per_cycle2_q32, 2 * limits->jerk_per_cycle3_q32);
    return (int32_t)fx_clamp(fx_mul_div(gained_q32, Q16_ONE, limits->vel_per_cycle_q32), 0, Q16_ONE);
}

/* Periods between two looks at the needs, and the cycles of so long. */
static uint32_t periods_of_look(uint32_t period_us)
{
    const uint32_t each = period_us > 0 ? (LOOK_US + period_us / 2) / period_us : 0;
    return each > 0 ? each : 1;
}

static int64_t cycles_of_look(uint32_t period_us, uint32_t each, uint32_t cycle_us)
{
    return (int64_t)period_us * each * Q16_ONE / cycle_us;
}

static unsigned channels_with_limits(const governor_t *self)
{
    unsigned channels = 0;
    for (unsigned i = 0; i < GOVERNOR_CHANNELS; i++) {
        channels = self->limits[i].jerk_per_cycle3_q32 > 0 ? i + 1 : channels;
    }
    return channels;
}

static void stretch(governor_track_t *track, int64_t by_q32)
{
    track->vel_q32 = fx_mul_shift(track->vel_q32, by_q32, 32);
    track->acc_q32 = fx_mul_shift(fx_mul_shift(track->acc_q32, by_q32, 32), by_q32, 32);
}

/* Differences are over so much longer a time now. */
static void stretch_all(governor_t *self, int64_t by_q32)
{
    for (unsigned i = 0; i < GOVERNOR_CHANNELS; i++) {
        stretch(&self->out[i], by_q32);
        for (unsigned level = 0; level <= GOVERNOR_LEVELS; level++) {
            stretch(&self->track[level][i], by_q32);
        }
    }
}

void governor_pace(governor_t *self, uint32_t period_us, uint32_t cycle_us)
{
    const uint32_t off_us = period_us > self->period_us ? period_us - self->period_us : self->period_us - period_us;
    if (self->period_us != 0 && off_us * PACE_SAME < period_us) {
        return;
    }
    const uint32_t was_us = self->period_us * self->each;
    self->each = periods_of_look(period_us);
    if (was_us > 0) {
        stretch_all(self, Q32_ONE * (int64_t)(period_us * self->each) / was_us);
    }
    self->since = 0;
    self->glide_q32 = 0;
    const int64_t cycles_q16 = cycles_of_look(period_us, self->each, cycle_us);
    self->period_us = period_us;
    self->channels = channels_with_limits(self);
    for (unsigned i = 0; i < GOVERNOR_CHANNELS; i++) {
        const governor_limits_t *limits = &self->limits[i];
        self->per_limit_q62[i][0] = reciprocal(limits->vel_per_cycle_q32, cycles_q16, 1);
        self->per_limit_q62[i][1] = reciprocal(limits->acc_per_cycle2_q32, cycles_q16, 2);
        self->per_limit_q62[i][2] = reciprocal(limits->jerk_per_cycle3_q32, cycles_q16, 3);
        self->brake_q16[i] = brake_share(limits);
    }
    for (unsigned level = 0; level < GOVERNOR_LEVELS; level++) {
        self->share_q32[level] = governor_share_of_period(period_us, k_time_constant_us[level]);
    }
}

/* The strength comes from there. */
static void place_strength(governor_t *self, q32_t strength_q32)
{
    self->target_q32 = strength_q32;
    self->fall_q32 = 0;
    for (unsigned pole = 0; pole < GOVERNOR_POLES; pole++) {
        self->pole_q32[pole] = strength_q32;
    }
}

void governor_start(governor_t *self)
{
    for (unsigned event = 0; event < GOVERNOR_EVENTS; event++) {
        self->event[event] = (governor_event_t){.age_us = MEMORY_US};
    }
    self->single_us = GOVERNOR_BEGIN_US;
    self->is_slowed = false;
    self->strength_q32 = 0;
    self->glide_q32 = 0;
    place_strength(self, 0);
}

void governor_place(governor_t *self, unsigned channel, bool is_steady, const q32_t value_q32[3])
{
    const int64_t each = self->each > 0 ? self->each : 1;
    const q32_t vel_q32 = value_q32[2] - value_q32[1];
    const q32_t before_q32 = value_q32[1] - value_q32[0];
    governor_track_t track = {value_q32[2], vel_q32 * each, (vel_q32 - before_q32) * each * each};
    self->out[channel] = track;
    self->asked_q32[channel] = track.pos_q32;
    self->behind_q32[channel] = 0;
    self->track[0][channel] = track;
    self->level_q32[0][channel] = track.pos_q32;
    for (unsigned level = 0; level < GOVERNOR_LEVELS; level++) { /* as far behind as a low-pass is in even motion */
        if (is_steady && self->share_q32[level] > 0) {           /* 0: no period is known, and nothing moves */
            track.pos_q32 -= fx_mul_div(vel_q32, Q32_ONE - self->share_q32[level], self->share_q32[level]);
        } else {
            track = (governor_track_t){value_q32[2], 0, 0}; /* behind where it has never been it would lead there */
        }
        self->track[level + 1][channel] = track;
        self->level_q32[level + 1][channel] = track.pos_q32;
    }
}

/* What a value needs of the limits of a channel if it comes after a track. */
static int32_t need_of(const governor_t *self, unsigned channel, const governor_track_t *track, q32_t pos_q32)
{
    const int64_t *per_limit_q62 = self->per_limit_q62[channel];
    const q32_t vel_q32 = pos_q32 - track->pos_q32;
    const q32_t acc_q32 = vel_q32 - track->vel_q32;
    const int32_t by_jerk = governor_share_of(acc_q32 - track->acc_q32, per_limit_q62[2]);
    const int32_t by_acc = governor_share_of(acc_q32, per_limit_q62[1]);
    const int64_t square = (int64_t)by_acc * by_acc / Q16_ONE;
    const int64_t by_vel = governor_share_of(vel_q32, per_limit_q62[0]) + square * self->brake_q16[channel] / Q16_ONE;
    return governor_larger(by_jerk, governor_larger((int32_t)fx_clamp(by_vel, 0, GOVERNOR_NEED_MAX), by_acc));
}

static void go_on(governor_track_t *track, q32_t pos_q32)
{
    const q32_t vel_q32 = pos_q32 - track->pos_q32;
    *track = (governor_track_t){pos_q32, vel_q32, vel_q32 - track->vel_q32};
}

/* One period of a low-pass: always between where it was and its input. */
static q32_t low_pass(q32_t at_q32, q32_t input_q32, q32_t share_q32)
{
    const q32_t travel_q32 = input_q32 - at_q32;
    return fx_abs(travel_q32) < NEAR_Q32 ? input_q32 : at_q32 + fx_mul_shift_fit(travel_q32, share_q32, 32);
}

/* Events become older, and more quickly while little moves. Where more is needed than there is, and the newest event is over,
 * another one begins. A rest brings the levels together: to change the strength then moves nothing, so one event is enough. */
static void pass_time(governor_t *self, int32_t need_q16)
{
    const uint32_t look_us = self->period_us * self->each;
    const uint32_t passed_us = need_q16 < NEED_GOAL / QUIET_SHARE ? QUIET_TIMES * look_us : look_us;
    const int64_t rest_us = need_q16 < NEED_GOAL / REST_SHARE ? REST_TIMES * (int64_t)look_us : -(int64_t)look_us;
    self->single_us = (uint32_t)fx_clamp(self->single_us + rest_us, 0, GOVERNOR_BEGIN_US);
    for (unsigned i = 0; i < GOVERNOR_EVENTS; i++) {
        self->event[i].age_us += self->event[i].age_us < MEMORY_US ? passed_us : 0;
    }
    if (need_q16 > NEED_GOAL && self->event[0].age_us >= SPAN_US) {
        for (unsigned i = GOVERNOR_EVENTS - 1; i > 0; i--) {
            self->event[i] = self->event[i - 1];
        }
        self->event[0] = (governor_event_t){0};
    }
}

/* Takes what is asked to every level. */
static void step_levels(governor_t *self, const q32_t *asked_q32)
{
    for (unsigned i = 0; i < self->channels; i++) {
        self->level_q32[0][i] = asked_q32[i];
        for (unsigned level = 1; level <= GOVERNOR_LEVELS; level++) {
            self->level_q32[level][i] =
                low_pass(self->level_q32[level][i], self->level_q32[level - 1][i], self->share_q32[level - 1]);
        }
    }
}

/* What each level needs, and in which event. */
static void note_needs(governor_t *self, int32_t scale_q16)
{
    int32_t need_q16[GOVERNOR_LEVELS + 1] = {0};
    for (unsigned level = 0; level <= GOVERNOR_LEVELS; level++) {
        for (unsigned i = 0; i < self->channels; i++) {
            need_q16[level] =
                governor_larger(need_q16[level], need_of(self, i, &self->track[level][i], self->level_q32[level][i]));
            go_on(&self->track[level][i], self->level_q32[level][i]);
        }
        need_q16[level] = (int32_t)fx_mul_shift(need_q16[level], scale_q16, 16);
    }
    pass_time(self, need_q16[0]);
    for (unsigned level = 0; level <= GOVERNOR_LEVELS && self->event[0].age_us < SPAN_US; level++) {
        self->event[0].need_q16[level] = governor_larger(self->event[0].need_q16[level], need_q16[level]);
    }
}

/* What a level needs again and again: the second largest of the events. One alone is brief, as a jump is: to smooth it would take
 * longer than to be late once. But where a motion begins, one alone is its beginning. */
static int32_t lasting_need(const governor_t *self, unsigned level)
{
    int32_t largest_q16 = 0;
    int32_t second_q16 = 0;
    for (unsigned i = 0; i < GOVERNOR_EVENTS; i++) {
        const int32_t need_q16 = self->event[i].age_us < MEMORY_US ? self->event[i].need_q16[level] : 0;
        second_q16 = governor_larger(second_q16, need_q16 < largest_q16 ? need_q16 : largest_q16);
        largest_q16 = governor_larger(largest_q16, need_q16);
    }
    return self->single_us > 0 ? largest_q16 : second_q16;
}

/* How far the output is on its way from a level to the next one: 3 u^2 - 2 u^3 of the strength between them. Ways between levels
 * are of different lengths, and a strength that passes a level evenly would change the speed of the output at once. */
static q32_t way_share(q32_t u_q32)
{
    const q32_t square_q32 = fx_mul_shift(u_q32, u_q32, 32);
    return 3 * square_q32 - 2 * fx_mul_shift(square_q32, u_q32, 32);
}

/* The least u that is so far on its way. */
static q32_t strength_for(q32_t share_q32)
{
    q32_t low_q32 = 0;
    q32_t high_q32 = Q32_ONE;
    while (high_q32 - low_q32 > Q32_ONE / 65536) {
        const q32_t middle_q32 = (low_q32 + high_q32) / 2;
        if (way_share(middle_q32) < share_q32) {
            low_q32 = middle_q32;
        } else {
            high_q32 = middle_q32;
        }
    }
    return high_q32;
}

/* The least strength with which the limits are kept. */
static q32_t needed_strength(const governor_t *self)
{
    int32_t before_q16 = lasting_need(self, 0);
    if (before_q16 <= NEED_GOAL) {
        return 0;
    }
    for (unsigned level = 1; level <= GOVERNOR_LEVELS; level++) {
        const int32_t need_q16 = lasting_need(self, level);
        if (need_q16 <= NEED_GOAL) {
            return (level - 1) * Q32_ONE + strength_for(Q32_ONE * (int64_t)(before_q16 - NEED_GOAL) / (before_q16 - need_q16));
        }
        before_q16 = need_q16;
    }
    return GOVERNOR_LEVELS * Q32_ONE;
}

/* The value of a channel at a strength. */
static q32_t value_at(const governor_t *self, unsigned channel, q32_t strength_q32)
{
    const unsigned level = (unsigned)(strength_q32 / Q32_ONE);
    const q32_t here_q32 = self->level_q32[level][channel];
    if (level == GOVERNOR_LEVELS) {
        return here_q32;
    }
    const q32_t travel_q32 = self->level_q32[level + 1][channel] - here_q32;
    return here_q32 + fx_mul_shift_fit(travel_q32, way_share(strength_q32 % Q32_ONE), 32);
}

q32_t governor_lag(const governor_t *self, unsigned channel)
{
    return self->asked_q32[channel] - value_at(self, channel, self->strength_q32);
}

void governor_shift(governor_t *self, unsigned channel, q32_t asked_q32)
{
    const q32_t by_q32 = asked_q32 - self->asked_q32[channel];
    self->asked_q32[channel] = asked_q32;
    self->out[channel].pos_q32 += by_q32;
    for (unsigned level = 0; level <= GOVERNOR_LEVELS; level++) {
        self->level_q32[level][channel] += by_q32;
        self->track[level][channel].pos_q32 += by_q32;
    }
}

/* Goes there in the periods until needs are looked at again: a staircase would be one in the output. */
static void set_strength(governor_t *self, q32_t strength_q32)
{
    const q32_t travel_q32 = strength_q32 - self->strength_q32;
    self->glide_q32 = travel_q32 / (int64_t)self->each;
    self->strength_q32 += travel_q32 % (int64_t)self->each;
}

static int32_t need_at(const governor_t *self, q32_t strength_q32)
{
    int32_t need_q16 = 0;
    for (unsigned i = 0; i < self->channels; i++) {
        need_q16 = governor_larger(need_q16, need_of(self, i, &self->out[i], value_at(self, i, strength_q32)));
    }
    return need_q16;
}

/* How far it may fall until needs are looked at again. A fall takes the output from one level to the one before: what a motion is
 * behind is caught up. */
static q32_t largest_fall(const governor_t *self, uint32_t since_us)
{
    const unsigned level = (unsigned)fx_clamp(self->strength_q32 / Q32_ONE, 0, GOVERNOR_LEVELS - 1);
    int32_t way_q16 = 1; /* in what the largest speed goes meanwhile */
    for (unsigned i = 0; i < self->channels; i++) {
        way_q16 = governor_larger(
            way_q16, governor_share_of(self->level_q32[level + 1][i] - self->level_q32[level][i], self->per_limit_q62[i][0]));
    }
    const q32_t by_time_q32 = Q32_ONE * (int64_t)since_us / (CATCH_DIV * (int64_t)k_time_constant_us[level]);
    const q32_t by_speed_q32 = Q32_ONE / CATCH_SPEED * Q16_ONE / way_q16;
    return by_time_q32 > by_speed_q32 ? by_time_q32 : by_speed_q32;
}

/* Falls slowly: what the output gains is a speed of its own. */
static q32_t fall_of(const governor_t *self, q32_t wanted_q32)
{
    const q32_t over_q32 = self->target_q32 - wanted_q32;
    const int64_t since_us = self->period_us * self->each;
    const q32_t by_share_q32 = over_q32 * since_us / (RELEASE_US + since_us) + since_us * Q32_ONE / (RELEASE_DIV * 1000000);
    const q32_t most_q32 = largest_fall(self, (uint32_t)since_us);
    const q32_t fall_q32 = by_share_q32 < most_q32 ? by_share_q32 : most_q32;
    return fall_q32 < over_q32 ? fall_q32 : over_q32;
}

/* The levels are apart where the motion is quick, so that every change of the strength is a motion of its own: it goes through
 * low-passes. Where not even so much is bearable, as after a jump or a rest, a rise comes at once, if that asks for less. */
static void follow_need(governor_t *self, q32_t wanted_q32)
{
    const q32_t fall_q32 = wanted_q32 < self->target_q32 ? fall_of(self, wanted_q32) : 0;
    self->fall_q32 +=
        (fall_q32 - self->fall_q32) * (int64_t)(self->period_us * self->each) / (SOFT_US + self->period_us * self->each);
    const q32_t fallen_q32 = self->target_q32 - self->fall_q32;
    self->target_q32 = wanted_q32 > fallen_q32 ? wanted_q32 : fallen_q32;
    q32_t next_q32 = self->target_q32;
    for (unsigned pole = 0; pole < GOVERNOR_POLES; pole++) {
        self->pole_q32[pole] = low_pass(self->pole_q32[pole], next_q32, RISE_Q32);
        next_q32 = self->pole_q32[pole];
    }
    const int32_t soft_q16 = wanted_q32 > next_q32 ? need_at(self, next_q32) : 0;
    if (soft_q16 > 2 * NEED_GOAL && need_at(self, wanted_q32) < soft_q16) {
        place_strength(self, wanted_q32);
        next_q32 = wanted_q32;
    }
    set_strength(self, next_q32);
}

void governor_step(governor_t *self, const q32_t *asked_q32, int32_t scale_q16, q32_t *out_q32)
{
    q32_t kept_q32[GOVERNOR_CHANNELS];
    governor_limit_speed(self, asked_q32, scale_q16, kept_q32);
    step_levels(self, kept_q32);
    const bool is_looked_at = ++self->since >= self->each;
    if (is_looked_at) {
        self->since = 0;
        note_needs(self, scale_q16);
        follow_need(self, needed_strength(self));
    }
    self->strength_q32 += self->glide_q32;
    for (unsigned i = 0; i < self->channels; i++) {
        out_q32[i] = value_at(self, i, self->strength_q32);
        if (is_looked_at) {
            go_on(&self->out[i], out_q32[i]);
        }
    }
}

uint32_t governor_delay_us(const governor_t *self)
{
    uint32_t delay_us = 0;
    for (unsigned level = 0; level * Q32_ONE < self->strength_q32; level++) {
        const q32_t beyond_q32 = self->strength_q32 - level * Q32_ONE;
        delay_us += (uint32_t)fx_mul_shift(k_time_constant_us[level], beyond_q32 < Q32_ONE ? way_share(beyond_q32) : Q32_ONE, 32);
    }
    return delay_us;
}
