/* SPDX-License-Identifier: MIT
 * stream_sane.c - whether a stream that was loaded may go on: time line, evidence, thinning, repeats; see stream_sane.h.
 */
#include "stream_sane.h"

#include "heave/sane.h"
#include "stream_clock.h"
#include "stream_repeat.h"

#define LATE_MAX_Q16   ((int64_t)8000000 * STREAM_US_Q16)              /* longer than any stream may be away */
#define PERIOD_MIN_Q16 ((int64_t)STREAM_PERIOD_MIN_US * STREAM_US_Q16) /* stream_clock.c holds it in these bounds */
#define PERIOD_MAX_Q16 ((int64_t)STREAM_PERIOD_MAX_US * STREAM_US_Q16 / 3 * 4)
#define SAMPLE_MAX_Q32 ((q32_t)1 << 47) /* see SLOT_MAX_Q32 of axis_targets.c */
#define SUM_MAX_Q32    ((int64_t)1 << 53)
#define MISFIT_MAX_Q32 ((q32_t)1 << 44)
#define ERROR_MAX_Q32  ((q32_t)1 << 45)
#define RATE_MAX_Q32   (16 * Q32_ONE) /* periods in a cycle */
#define INDEX_MAX      4096           /* periods between the newest samples */
#define GAP_MAX_US     ((uint32_t)1 << 31)
#define COUNT_MAX      ((uint32_t)1 << 20)

/* The newest intervals are divided by their periods. */
static bool are_gaps_sane(const stream_clock_t *clock)
{
    bool is_sane =
        clock->gaps == STREAM_GAPS ? clock->gap_next < STREAM_GAPS : clock->gaps < STREAM_GAPS && clock->gap_next == clock->gaps;
    for (unsigned i = 0; i < STREAM_GAPS; i++) {
        is_sane = is_sane && clock->gap_us[i] <= GAP_MAX_US && (i >= clock->gaps || clock->gap_periods[i] > 0);
    }
    return is_sane;
}

static bool is_period_sane(const stream_clock_t *clock, bool is_running)
{
    if (clock->period_us_q16 == 0) {
        return !is_running && stream_sane_within(clock->per_us_q46, 0, Q62_ONE / PERIOD_MIN_Q16);
    }
    return stream_sane_within(clock->period_us_q16, PERIOD_MIN_Q16, PERIOD_MAX_Q16) &&
           clock->per_us_q46 == Q62_ONE / clock->period_us_q16;
}

static bool are_times_sane(const stream_clock_t *clock)
{
    return sane_time(clock->last_us) && stream_sane_within(clock->late_us_q16, -LATE_MAX_Q16, LATE_MAX_Q16) &&
           stream_sane_within(clock->jitter_us_q16, 0, LATE_MAX_Q16) &&
           stream_sane_within(clock->margin_us_q16, 0, LATE_MAX_Q16) &&
           stream_sane_within(clock->drift_us_q16, -LATE_MAX_Q16, LATE_MAX_Q16) &&
           stream_sane_within(clock->rough_us_q16, 0, LATE_MAX_Q16);
}

static bool are_counts_sane(const stream_clock_t *clock, bool is_empty)
{
    return clock->settled <= STREAM_CLOCK_MEMORY_MAX && clock->memory <= STREAM_CLOCK_MEMORY_MAX &&
           clock->counted <= STREAM_CLOCK_LOST_MEMORY && stream_sane_within(clock->lost_q16, 0, 8 * Q16_ONE) &&
           clock->each <= UINT16_MAX && (clock->each > 0 || is_empty) && clock->stalled < STREAM_CLOCK_STALLED &&
           sane_bool(&clock->is_sparse);
}

static bool is_clock_sane(const stream_t *saved, const stream_t *prepared)
{
    const stream_clock_t *clock = &saved->clock;
    return are_gaps_sane(clock) && is_period_sane(clock, saved->phase == STREAM_RUNNING) && are_times_sane(clock) &&
           are_counts_sane(clock, saved->phase == STREAM_EMPTY) && clock->hint_us <= STREAM_HINT_MAX_US &&
           clock->delay_max_us == prepared->clock.delay_max_us;
}

static bool is_evidence_sane(const stream_evidence_t *evidence)
{
    bool is_sane = evidence->count <= STREAM_EVIDENCE && evidence->axes <= AXES_MAX &&
                   stream_sane_within(evidence->told_q32, -SUM_MAX_Q32, SUM_MAX_Q32) &&
                   stream_sane_within(evidence->off_q32, 0, SUM_MAX_Q32) &&
                   stream_sane_within(evidence->moved_q32, 0, SUM_MAX_Q32) &&
                   stream_sane_within(evidence->weight_q32, 0, Q32_ONE);
    for (unsigned i = 0; i < STREAM_EVIDENCE; i++) {
        is_sane = is_sane && stream_sane_all(evidence->value_q32[i], AXES_MAX, SAMPLE_MAX_Q32) &&
                  stream_sane_within(evidence->late_q32[i], -Q32_ONE, Q32_ONE) &&
                  stream_sane_within(evidence->shift_q32[i], -Q32_ONE, Q32_ONE) &&
                  stream_sane_within(evidence->index[i], 0, INDEX_MAX);
    }
    return is_sane;
}

static bool is_thin_sane(const stream_thin_t *thin)
{
    return sane_time(thin->last_us) && thin->gaps_us <= GAP_MAX_US && stream_sane_within(thin->each, 1, COUNT_MAX) &&
           stream_sane_within(thin->each_taken, 1, COUNT_MAX) && thin->passed <= COUNT_MAX && sane_bool(&thin->has_spare) &&
           stream_sane_all(thin->spare_q32, AXES_MAX, SAMPLE_MAX_Q32);
}

static bool is_sample_sane(const stream_sample_t *sample)
{
    return stream_sane_within(sample->misfit_q32, 0, MISFIT_MAX_Q32) && sample->losses <= STREAM_LOSSES_MAX &&
           sample->stood <= STREAM_STOOD_MAX + 1 && sample->moved <= STREAM_MOVED_MAX && sample->caught <= STREAM_CAUGHT_MAX &&
           sample->halves <= COUNT_MAX && sample->doubt_us <= GAP_MAX_US;
}

/* A stream that has not begun has seen no run. */
static bool is_repeat_sane(const stream_repeat_t *repeat, bool is_empty)
{
    return sane_time(repeat->began_us) && repeat->run <= STREAM_REPEAT_RUN_MAX + 1 && (repeat->run > 0 || is_empty) &&
           repeat->each <= COUNT_MAX && (repeat->each > 0 || is_empty) && repeat->frames <= COUNT_MAX &&
           (repeat->frames > 0 || repeat->each <= 1) && repeat->span_us <= GAP_MAX_US && repeat->runs < STREAM_REPEAT_RUNS_MOST &&
           repeat->telling <= repeat->runs && repeat->longest <= COUNT_MAX;
}

bool stream_is_sane(const stream_t *saved, const stream_t *prepared)
{
    if (saved->cycle_us != prepared->cycle_us || saved->style != prepared->style || (unsigned)saved->phase > STREAM_RUNNING) {
        return false;
    }
    const bool is_empty = saved->phase == STREAM_EMPTY;
    bool is_sane = is_clock_sane(saved, prepared) && is_evidence_sane(&saved->evidence) && is_thin_sane(&saved->thin) &&
                   is_repeat_sane(&saved->repeat, is_empty) && sane_bool(&saved->is_fresh) && sane_bool(&saved->is_hidden) &&
                   saved->pair <= COUNT_MAX && (saved->pair > 0 || is_empty) && sane_time(saved->began_us) &&
                   sane_time(saved->back_us) && sane_all_q32(saved->left_q32, POSE_AXES) && is_sample_sane(&saved->sample) &&
                   stream_sane_within(saved->between_q32, 0, Q32_ONE - 1) &&
                   stream_sane_within(saved->error_q32, -ERROR_MAX_Q32, ERROR_MAX_Q32) &&
                   stream_curve_is_sane(&saved->curve, &prepared->curve, saved->style, saved->phase == STREAM_RUNNING) &&
                   governor_is_sane(&saved->curve.governor, saved->cycle_us, saved->phase == STREAM_RUNNING);
    for (unsigned i = 0; i < 2; i++) {
        is_sane = is_sane && stream_sane_within(saved->rate_q32[i], 0, RATE_MAX_Q32);
    }
    for (unsigned i = 0; i < AXES_MAX; i++) {
        const history_t *at = &saved->previous[i];
        is_sane = is_sane && sane_q32(at->pos_q32) && sane_q32(at->vel_per_cycle_q32) && sane_q32(at->acc_per_cycle2_q32);
    }
    return is_sane;
}
