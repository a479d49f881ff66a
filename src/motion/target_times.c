/* SPDX-License-Identifier: MIT
 * target_times.c - see target_times.h.
 */
#include "target_times.h"

#define INSTANT_MS     5     /* no move is this short: frames with such a T ... */
#define INSTANT_GAP_US 20000 /* ... that follow each other so closely are a stream like frames without T */
#define PERIODS_STATED 5     /* so many periods a streaming sender may write as T, and more if it does not mean T */

void target_times_reset(target_times_t *self)
{
    self->stated_us = 0;
    self->gap_us = 0;
    self->is_not_awaited = false;
}

/* The time of a target that could be a stream's period, else 0. */
static uint32_t period_stated(const motion_target_t *target)
{
    return target->is_timed && target->time_ms <= STREAM_HINT_MAX_US / 1000 ? target->time_ms * 1000 : 0;
}

/* Two times are about the same if neither is more than 2.5 times the other. */
static bool is_about(uint64_t time_us, uint64_t other_us)
{
    return time_us * 2 <= other_us * 5 && other_us * 2 <= time_us * 5;
}

/* A target without a time, or with one too short for a move, after so short a gap that it is none, or where a stream runs that is
 * so quick: a frame of it may be late or lost. */
static bool is_instant(const target_times_t *self, const stream_t *stream, const motion_target_t *target, uint64_t now_us)
{
    const uint64_t period_us = stream_goes_on(stream, now_us) ? stream_frame_us(stream) : now_us - self->last_us;
    return !target->is_timed ||
           (target->time_ms <= INSTANT_MS && (now_us - self->last_us <= INSTANT_GAP_US || period_us <= INSTANT_GAP_US));
}

/* Targets that follow each other as quickly and as evenly as those of a stream, whatever time they state. */
static bool is_in_a_row(const target_times_t *self, uint64_t gap_us)
{
    return self->gap_us > 0 && gap_us <= STREAM_QUIET_US && is_about(gap_us, self->gap_us);
}

bool target_times_is_sample(const target_times_t *self, const stream_t *stream, const motion_target_t *target, uint64_t now_us)
{
    const uint32_t stated_us = period_stated(target);
    const uint64_t gap_us = now_us - self->last_us;
    if (is_instant(self, stream, target, now_us)) {
        return true;
    }
    if (stated_us == 0) {
        return false;
    }
    if (stream_goes_on(stream, now_us)) {
        const uint32_t period_us = stream_period_us(stream);
        const uint32_t interval_us = stream_frame_us(stream);
        return is_about(stated_us, period_us) || is_about(stated_us, interval_us) ||
               (gap_us * 2 <= interval_us * 5 && (stated_us <= PERIODS_STATED * period_us || self->is_not_awaited));
    }
    return is_in_a_row(self, gap_us) || (is_about(gap_us, stated_us) && is_about(gap_us, self->stated_us));
}

/* A time that is not about the interval is a wish of another kind. The first interval may be that of a late frame. */
uint32_t target_times_hint_us(const target_times_t *self, const stream_t *stream, const motion_target_t *target, uint64_t now_us)
{
    const uint32_t stated_us = period_stated(target);
    const uint64_t period_us = stream_period_us(stream);
    if (stream_phase(stream) == STREAM_EMPTY || self->stated_us == 0) {
        return stated_us;
    }
    if (stream_phase(stream) == STREAM_LONE) {
        return is_about(stated_us, now_us - self->last_us) ? stated_us : 0;
    }
    return stated_us * 2 <= period_us * 3 && period_us * 2 <= stated_us * 3 ? stated_us : 0;
}

void target_times_note(target_times_t *self, const motion_target_t *target, uint64_t now_us)
{
    const uint64_t gap_us = now_us - self->last_us;
    /* a sender that does not wait for the time it states does not mean it */
    self->is_not_awaited = gap_us <= STREAM_HINT_MAX_US && (self->is_not_awaited || gap_us * 5 < self->stated_us * UINT64_C(2));
    const bool is_short = target->is_timed && target->time_ms <= STREAM_HINT_MAX_US / 1000;
    self->gap_us = is_short && gap_us <= STREAM_QUIET_US ? (uint32_t)gap_us : 0;
    self->last_us = now_us;
    self->stated_us = period_stated(target);
}
