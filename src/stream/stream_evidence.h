/* SPDX-License-Identifier: MIT
 * stream_evidence.h - to which time a sender's samples belong: to their place on the time line (even values, made late by a
 * network or a timer), to the time when they came (a program that takes them when it sends), or to a time between. Private to
 * src/stream.
 */
#ifndef STREAM_EVIDENCE_H
#define STREAM_EVIDENCE_H

#include "heave/stream.h"

/** Forgets the samples; keep_weight: the sender is the same. */
void stream_evidence_reset(stream_evidence_t *self, bool keep_weight);

/** Takes the newest sample.
 *  @param periods after the one before; 0: in its place   @param late_q32 its lateness against the line, in periods
 *  @param shift_q32 from here on samples are that much later than the line, which follows
 *  @param is_coarse values are rounded so much that they tell no time, or this one is in doubt
 *  @param governor knows what a motion is measured by: the speed limits of the axes */
void stream_evidence_add(stream_evidence_t *self, const governor_t *governor, unsigned axes, unsigned periods, q32_t late_q32,
                         q32_t shift_q32, bool is_coarse, const q32_t *sample_q32);

/** What the newest sample is at its place on the line. */
q32_t stream_evidence_on_line(const stream_evidence_t *self, unsigned axis);

/** How far a sample is from where the motion of the last three leads in so many periods, in shares of the axes' speed limits. */
q32_t stream_evidence_misfit(const stream_evidence_t *self, const governor_t *governor, const stream_predictor_t *predictor,
                             unsigned periods, const q32_t *sample_q32);

/** How far apart are where it leads in so many periods, and in so many. */
q32_t stream_evidence_apart(const stream_evidence_t *self, const governor_t *governor, const stream_predictor_t *predictor,
                            unsigned a, unsigned b);

/** How many periods the motion so far would take to a sample: its way along the newest step, in steps. 0 where nothing has moved.
 *  Samples that stand still are no step: the one before them counts. */
q32_t stream_evidence_advance(const stream_evidence_t *self, const governor_t *governor, const q32_t *sample_q32);

/** A distance in shares of the axis' speed limit, at most 256. */
q32_t stream_evidence_in_speed_limits(const governor_t *governor, unsigned axis, q32_t travel_q32);

/** What the rounding of the values may make of a distance, in shares of the axes' speed limits. */
q32_t stream_evidence_rounding(const stream_evidence_t *self, const stream_curve_t *curve);

/** True if a distance, in shares of the axes' speed limits, is larger than what values are off their neighbours on average. */
bool stream_evidence_is_beyond_noise(const stream_evidence_t *self, q32_t misfit_q32);

/** True if a sample equals the newest one in all axes. */
bool stream_evidence_is_newest(const stream_evidence_t *self, unsigned axes, const q32_t *sample_q32);

#endif
