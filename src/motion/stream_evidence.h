/* SPDX-License-Identifier: MIT
 * stream_evidence.h - to which time a sender's samples belong: to their place on the time line (even values, made late by a
 * network or a timer), to the time when they came (a program that takes them when it sends), or to a time between. Private to
 * src/motion.
 */
#ifndef STREAM_EVIDENCE_H
#define STREAM_EVIDENCE_H

#include "heave/stream.h"

/** Forgets the samples; keep_weight: the sender is the same. */
void stream_evidence_reset(stream_evidence_t *self, bool keep_weight);

/** Takes the newest sample.
 *  @param periods after the one before   @param late_q32 its lateness against the line, in periods
 *  @param shift_q32 from here on samples are that much later than the line, which follows
 *  @param is_coarse values are rounded so much that they tell no time
 *  @param governor knows what a motion is measured by: the speed limits of the axes */
void stream_evidence_take(stream_evidence_t *self, const governor_t *governor, unsigned axes, unsigned periods, q32_t late_q32,
                          q32_t shift_q32, bool is_coarse, const q32_t *sample_q32);

/** What the newest sample is at its place on the line. */
q32_t stream_evidence_on_line(const stream_evidence_t *self, unsigned axis);

/** How far a sample is from where the motion of the last three leads in so many periods, in shares of the axes' speed limits. */
q32_t stream_evidence_misfit(const stream_evidence_t *self, const governor_t *governor, const stream_predictor_t *predictor,
                             unsigned periods, const q32_t *sample_q32);

/** How far apart are where it leads in so many periods, and in so many. */
q32_t stream_evidence_apart(const stream_evidence_t *self, const governor_t *governor, const stream_predictor_t *predictor,
                            unsigned a, unsigned b);

/** True if a sample equals the newest one in all axes. */
bool stream_evidence_is_newest(const stream_evidence_t *self, unsigned axes, const q32_t *sample_q32);

#endif
