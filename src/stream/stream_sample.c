/* SPDX-License-Identifier: MIT
 * stream_sample.c - what a frame of a stream is; see stream_sample.h.
 */
#include "stream_sample.h"

#include "stream_clock.h"
#include "stream_curve.h"
#include "stream_evidence.h"
#include "stream_points.h"
#include "stream_predictor.h"
#include "stream_quantum.h"
#include "stream_repeat.h"

enum {
    SIGNIFICANT = 4,      /* a value tells if it is off by less than such a share of what there is to tell, ... */
    SIGNIFICANT_OPEN = 2, /* ... of such a one where the time leaves it open */
    MISFIT_MEMORY = 16,
    JUDGED_MAX = 4,               /* periods that values are weighed for */
    STOOD_MAX = STREAM_STOOD_MAX, /* frames that a value may stand of a sender that freezes */
    LOST_MAX = 2,                 /* samples that may be missing before one that is no old one */
    SOON_PARTS = 4,
    OLD_US = 100000, /* so old a frame may be, ... */
    OLD_LEAST = 4,   /* ... or so many samples ... */
    OLD_MOST = 16,   /* ... at most */
    HALVES = 4       /* samples half-way between two of the line that tell twice its rate */
};

#define SAME_US          2000u              /* the same values again within that are no sample, while the period is not known */
#define SAME_Q32         (Q32_ONE * 3 / 4)  /* ... later, on the line */
#define CLEAR_Q32        (Q32_ONE * 3 / 10) /* a sample so near to its time is the one of that time */
#define BESIDE_Q32       (Q32_ONE / 8)      /* one further from its time than by jitter and so much is beside it */
#define CAUGHT_LEAST_Q32 (Q32_ONE * 3 / 5)  /* of its way a value that stood has caught up at least ... */
#define CAUGHT_MOST_Q32  (Q32_ONE * 3 / 2)  /* ... and at most */
#define BACK_AGAIN_Q32   (Q32_ONE * 3 / 4)  /* the sample after an old one takes back so much of its step */
#define BACK_Q32         (Q32_ONE / 4)      /* an old value is further back than so many steps */

/* How a motion goes on while too few samples tell it. */
static const stream_predictor_t k_parabola = {2 * Q32_ONE, -Q32_ONE};

void stream_sample_reset(stream_sample_t *self, bool is_known)
{
    *self = (stream_sample_t){.caught = is_known ? self->caught : 0};
}

/** A frame, held against the samples so far. */
typedef struct {
    const q32_t *value_q32;
    unsigned by_time;  /* periods after the newest sample, by its time */
    q32_t ahead_q32;   /* of the newest sample's time on the line */
    q32_t late_q32;    /* how late it may be */
    uint32_t since_us; /* the newest sample */
    bool is_soon;      /* sooner than five eighths of a period after it */
    q32_t advance_q32; /* steps of the motion so far that lead to it */
} frame_t;

static frame_t look_at(const stream_t *stream, uint64_t now_us, const q32_t *value_q32)
{
    const stream_clock_t *clock = &stream->clock;
    frame_t frame = {.value_q32 = value_q32, .since_us = stream_clock_elapsed_us(clock, now_us)};
    frame.by_time = stream_clock_expect(clock, now_us, &frame.ahead_q32, &frame.late_q32);
    frame.is_soon = (int64_t)frame.since_us * STREAM_US_Q16 * 8 < clock->period_us_q16 * 5;
    frame.advance_q32 = stream_evidence_advance(&stream->evidence, &stream->curve.governor, value_q32);
    return frame;
}

/* A value has moved on after some frames in which it stood. Where it is as far as if it had not stood, the frames between said
 * nothing. A game that is slower than the loop that sends its values makes one step in the time of several frames, and never two
 * in a row.
 * @return true where it has caught up */
static bool note_caught_up(stream_t *stream, uint64_t now_us, const frame_t *frame)
{
    stream_sample_t *const self = &stream->sample;
    const bool has_stood = self->stood > 0 && self->stood <= STOOD_MAX && self->moved == STREAM_MOVED_MAX;
    self->moved = self->stood > 0 ? 1 : self->moved < STREAM_MOVED_MAX ? self->moved + 1 : STREAM_MOVED_MAX;
    self->stood = 0;
    if (!has_stood || !stream_quantum_is_significant(&stream->curve, stream->curve.newest_q32, frame->value_q32)) {
        return false;
    }
    const uint64_t since_us = now_us - stream->repeat.began_us;
    const q32_t periods_q32 = stream_clock_span(&stream->clock, since_us < UINT32_MAX ? (uint32_t)since_us : UINT32_MAX);
    const bool is_caught_up = frame->advance_q32 > fx_mul_shift(periods_q32, CAUGHT_LEAST_Q32, 32) &&
                              frame->advance_q32 < fx_mul_shift(periods_q32, CAUGHT_MOST_Q32, 32);
    if (is_caught_up) {
        self->caught += self->caught < STREAM_CAUGHT_MAX ? 1u : 0u;
    } else {
        self->caught -= self->caught > 0 ? 1u : 0u;
    }
    return is_caught_up;
}

/* The newest values again. */
static stream_sample_kind_t kind_of_same(stream_sample_t *self, const frame_t *frame)
{
    if (frame->is_soon && frame->ahead_q32 < SAME_Q32) {
        return STREAM_SAMPLE_NONE;
    }
    if (self->stood == STOOD_MAX && self->caught > 0) {
        self->caught--; /* it stands */
    }
    self->stood += self->stood <= STOOD_MAX ? 1u : 0u;
    return self->caught > 0 && self->stood <= STOOD_MAX ? STREAM_SAMPLE_NONE : STREAM_SAMPLE_NEXT;
}

/* How far values are from the nearest point before the newest one; of a frame that came too soon, from the way between them. */
HV_WRAPS static q32_t off_past(const stream_t *stream, const frame_t *frame)
{
    const stream_curve_t *curve = &stream->curve;
    const uint32_t newest = stream_points_newest(curve);
    const uint32_t parts = frame->is_soon ? SOON_PARTS : 1;
    const uint32_t points = (uint32_t)fx_clamp(OLD_US * STREAM_US_Q16 / stream->clock.period_us_q16, OLD_LEAST, OLD_MOST);
    q32_t least_q32 = INT64_MAX;
    for (uint32_t part = 0; part < points * parts; part++) {
        const q32_t *const from_q32 = curve->point_q32[stream_points_place(newest - part / parts)];
        const q32_t *const to_q32 = curve->point_q32[stream_points_place(newest - part / parts - 1)];
        q32_t off_q32 = 0;
        for (unsigned axis = 0; axis < curve->axes && axis < POSE_AXES; axis++) {
            const q32_t way_q32 = (to_q32[axis] - from_q32[axis]) * (part % parts + 1) / (q32_t)parts;
            off_q32 += stream_evidence_in_speed_limits(&curve->governor, axis, from_q32[axis] + way_q32 - frame->value_q32[axis]);
        }
        least_q32 = off_q32 < least_q32 ? off_q32 : least_q32;
    }
    return least_q32;
}

/* Whether values fit one of the last samples, or a lost one between them, much better than what comes next. */
static bool is_old(const stream_t *stream, const frame_t *frame)
{
    const stream_evidence_t *seen = &stream->evidence;
    const stream_curve_t *curve = &stream->curve;
    if (frame->advance_q32 > -BACK_Q32 || seen->count < 3) {
        return false;
    }
    const stream_predictor_t predictor = stream_predictor_fit(curve, k_parabola);
    q32_t misfit_q32 = INT64_MAX;
    for (unsigned lost = 0; lost <= LOST_MAX; lost++) {
        const q32_t off_q32 = stream_evidence_misfit(seen, &curve->governor, &predictor, frame->by_time + lost, frame->value_q32);
        misfit_q32 = off_q32 < misfit_q32 ? off_q32 : misfit_q32;
    }
    return (off_past(stream, frame) + stream_evidence_rounding(seen, curve)) * SIGNIFICANT < misfit_q32 &&
           stream_evidence_is_beyond_noise(seen, misfit_q32 / SIGNIFICANT);
}

static bool is_about_half(q32_t periods_q32)
{
    return periods_q32 > Q32_ONE * 3 / 10 && periods_q32 < Q32_ONE * 7 / 10;
}

/* Whether a frame lies half-way between two samples of an even line, in time and in value. */
static bool is_half(const stream_clock_t *clock, const frame_t *frame)
{
    return stream_clock_is_even(clock) && is_about_half(frame->ahead_q32) && is_about_half(frame->advance_q32) &&
           clock->period_us_q16 >= 2 * STREAM_PERIOD_MIN_US * STREAM_US_Q16;
}

/* Values that are not the newest ones. */
static stream_sample_kind_t kind_of_other(stream_t *stream, const frame_t *frame)
{
    stream_sample_t *const self = &stream->sample;
    const uint32_t doubt_us = self->doubt_us;
    self->doubt_us = 0;
    if (frame->advance_q32 < -BACK_AGAIN_Q32 && frame->since_us < doubt_us) {
        return STREAM_SAMPLE_INSTEAD;
    }
    if (is_old(stream, frame)) {
        if (frame->is_soon) {
            return STREAM_SAMPLE_NONE;
        }
        const q32_t wait_q32 = fx_clamp(Q32_ONE + frame->late_q32 - frame->ahead_q32, Q32_ONE / 4, Q32_ONE);
        self->doubt_us = (uint32_t)(fx_mul_shift(stream->clock.period_us_q16, wait_q32, 32) / STREAM_US_Q16);
        return STREAM_SAMPLE_DOUBTFUL;
    }
    if (!is_half(&stream->clock, frame)) {
        self->halves = frame->ahead_q32 > Q32_ONE * 5 / 4 ? 0 : self->halves;
        return STREAM_SAMPLE_NEXT;
    }
    self->halves = self->halves < HALVES ? self->halves + 1 : 1;
    return self->halves < HALVES ? STREAM_SAMPLE_NONE : STREAM_SAMPLE_OTHER_RATE;
}

stream_sample_kind_t stream_sample_kind(stream_t *stream, uint64_t now_us, const q32_t *sample_q32)
{
    const frame_t frame = look_at(stream, now_us, sample_q32);
    const bool is_same = stream_evidence_is_newest(&stream->evidence, stream->curve.axes, sample_q32);
    const bool is_running = stream->phase == STREAM_RUNNING;
    if (stream->clock.period_us_q16 == 0) {
        return is_same && frame.since_us < SAME_US ? STREAM_SAMPLE_NONE : STREAM_SAMPLE_NEXT;
    }
    const bool is_caught_up = is_running && !is_same && note_caught_up(stream, now_us, &frame);
    if (is_running && stream_repeat_watch(stream, now_us, is_caught_up, sample_q32)) {
        return STREAM_SAMPLE_NONE;
    }
    if (is_same) {
        return kind_of_same(&stream->sample, &frame);
    }
    return is_running ? kind_of_other(stream, &frame) : STREAM_SAMPLE_NEXT;
}

/* How much better than by the time the value has to tell a number of periods. Where the time leaves it open, a little; else more,
 * and much more the more often an interval of an even sender that was too long has been told to be a loss. */
static int32_t significance(const stream_t *stream, unsigned periods, q32_t ahead_q32)
{
    const q32_t off_q32 = fx_abs(ahead_q32 - periods * Q32_ONE);
    if (off_q32 <= stream_clock_jitter(&stream->clock) + CLEAR_Q32) {
        return SIGNIFICANT_OPEN;
    }
    return SIGNIFICANT << (stream_clock_is_even(&stream->clock) ? stream->sample.losses : 0);
}

/* What a long interval was: a loss where time and value agree, else a pause of the sender. */
static void note_loss(stream_t *stream, const stream_predictor_t *predictor, unsigned by_time, unsigned periods, q32_t misfit_q32)
{
    const q32_t apart_q32 = stream_evidence_apart(&stream->evidence, &stream->curve.governor, predictor, by_time, by_time - 1);
    if (by_time < 2 || (misfit_q32 + stream->sample.misfit_q32) * SIGNIFICANT >= apart_q32) {
        return;
    }
    if (periods != by_time) {
        stream->sample.losses = 0;
    } else if (stream->sample.losses < (unsigned)STREAM_LOSSES_MAX) {
        stream->sample.losses++;
    }
}

/* The sample is clearly of this arrival, and its value lies where the line was at another time: by so much is it shifted. */
static bool is_shifted(const stream_t *stream, const frame_t *frame, unsigned best, q32_t expected_q32, q32_t apart_q32)
{
    return expected_q32 * SIGNIFICANT > apart_q32 &&
           fx_abs(frame->ahead_q32 - best * Q32_ONE) > stream_clock_jitter(&stream->clock) + BESIDE_Q32 &&
           fx_abs(frame->advance_q32 - frame->ahead_q32) < CLEAR_Q32;
}

unsigned stream_sample_periods(stream_t *stream, uint64_t now_us, const q32_t *sample_q32, q32_t *shift_q32)
{
    const stream_evidence_t *seen = &stream->evidence;
    const governor_t *scale = &stream->curve.governor;
    const frame_t frame = look_at(stream, now_us, sample_q32);
    const unsigned by_time = frame.by_time;
    const q32_t ahead_q32 = frame.ahead_q32;
    const q32_t early_q32 = frame.late_q32 < Q32_ONE / 2 ? Q32_ONE / 2 : frame.late_q32;
    const bool is_even = stream_clock_is_even(&stream->clock);
    *shift_q32 = 0;
    const bool is_arrived = seen->weight_q32 > Q32_ONE / 2; /* the value is that of the arrival, whatever the number */
    if (seen->count < 3 || is_arrived || (is_even && by_time == 1 && fx_abs(ahead_q32 - Q32_ONE) < CLEAR_Q32)) {
        return by_time;
    }
    unsigned best = by_time;
    const stream_predictor_t predictor = stream_predictor_fit(&stream->curve, k_parabola);
    const q32_t expected_q32 = stream_evidence_misfit(seen, scale, &predictor, by_time, sample_q32);
    q32_t least_q32 = expected_q32;
    for (unsigned periods = 1; periods <= JUDGED_MAX && periods * Q32_ONE <= ahead_q32 + early_q32; periods++) {
        const q32_t misfit_q32 = stream_evidence_misfit(seen, scale, &predictor, periods, sample_q32);
        const q32_t apart_q32 = stream_evidence_apart(seen, scale, &predictor, periods, by_time);
        const q32_t doubt_q32 = misfit_q32 + stream->sample.misfit_q32;
        if (doubt_q32 * significance(stream, periods, ahead_q32) < apart_q32 && misfit_q32 < least_q32) {
            least_q32 = misfit_q32;
            best = periods;
        }
    }
    note_loss(stream, &predictor, by_time, best, least_q32);
    stream->sample.misfit_q32 += (least_q32 - stream->sample.misfit_q32) / MISFIT_MEMORY;
    if (is_even && best == by_time &&
        is_shifted(stream, &frame, best, expected_q32, stream_evidence_apart(seen, scale, &predictor, by_time, by_time + 1))) {
        *shift_q32 = frame.advance_q32 - best * Q32_ONE;
    }
    return best;
}
