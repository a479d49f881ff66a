/* SPDX-License-Identifier: MIT
 * target_times.h - what the times between a sender's targets, and the times that it states, say: whether a target is a sample of
 * a stream, or a move of its own. Private to src/motion.
 */
#ifndef TARGET_TIMES_H
#define TARGET_TIMES_H

#include "heave/motion.h"

/** Forgets the sender's intervals, not when its newest target came. */
void target_times_reset(target_times_t *self);

/** True if a target is a sample of a stream: it has no time, or its time is about the period of the stream that runs, or it comes
 *  at that one's pace and its time is some periods, or not meant; or targets follow each other in the time that both state, or
 *  three evenly. */
bool target_times_is_sample(const target_times_t *self, const stream_t *stream, const motion_target_t *target, uint64_t now_us);

/** The period that a target states, us; 0: none, or it is not meant as one. */
uint32_t target_times_hint_us(const target_times_t *self, const stream_t *stream, const motion_target_t *target, uint64_t now_us);

/** Notes a target; call it after the others. */
void target_times_note(target_times_t *self, const motion_target_t *target, uint64_t now_us);

#endif
