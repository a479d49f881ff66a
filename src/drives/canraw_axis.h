/* SPDX-License-Identifier: MIT
 * canraw_axis.h - one drive of a raw CAN map: its state, judged from what it says and what it was told. Private to canraw.c.
 * Sends nothing: what has to go out stands in `pending`, and canraw.c says when it went.
 */
#ifndef CANRAW_AXIS_H
#define CANRAW_AXIS_H

#include "heave/canraw.h"
#include "heave/guard.h"

/** A drive of which nothing has been heard (any more). It is stopped if it has torque. */
void canraw_axis_lose(canraw_axis_t *self, const canraw_map_t *map, uint64_t now_us);

/** Takes a frame on its reply_id in.
 *  @return false where it means nothing here */
bool canraw_axis_receive(canraw_axis_t *self, const canraw_map_t *map, const canraw_axis_map_t *axis, const can_frame_t *frame,
                         uint64_t now_us);

/** What follows from the time and all that has been received. Once per poll. */
void canraw_axis_step(canraw_axis_t *self, const canraw_map_t *map, uint64_t now_us);

/** All that was sent is on the wire: a drive that has answered since, and does not say otherwise, has taken it that its torque is
 *  to be off. Once per poll, where it is so. */
void canraw_axis_note_off(canraw_axis_t *self, const canraw_map_t *map);

/** Carries out a request that is allowed. */
void canraw_axis_request(canraw_axis_t *self, const canraw_map_t *map, drives_request_t request, uint64_t now_us);

/** Whether what stops it has not gone out yet, or its torque is still to be taken after that. */
bool canraw_axis_is_stopping(const canraw_axis_t *self);

/** Whether set-points go out. */
bool canraw_axis_is_streaming(const canraw_axis_t *self, const canraw_map_t *map);

/** Counts that leave it where it is, in a frame for others that follow. One that may have torque keeps its last set-point: led to
 *  where it is, it would creep under load. */
int64_t canraw_axis_held(const canraw_axis_t *self, const canraw_map_t *map);

/** Stops following where a set-point is too far away. */
void canraw_axis_watch(canraw_axis_t *self, const canraw_map_t *map, const canraw_axis_map_t *axis, q32_t setpoint_q32,
                       uint64_t now_us);

/** The drive stops in DRIVE_FAULT, by the map's stop frame and its disable frame at rest, or the one that it has, else by hearing
 *  nothing more. */
void canraw_axis_fault(canraw_axis_t *self, const canraw_map_t *map, uint32_t code, uint64_t now_us);

/** Fails for its set-points. */
void canraw_axis_fault_of_guard(canraw_axis_t *self, const canraw_map_t *map, const drive_guard_t *guard, uint64_t now_us);

/** What a set-point of it is measured against. */
guard_limits_t canraw_axis_limits(const canraw_axis_t *self, const canraw_axis_map_t *axis);

/** What to ask it in this round; notes it as asked. */
canraw_asked_t canraw_axis_next_query(canraw_axis_t *self, const canraw_map_t *map);

void canraw_axis_report(const canraw_axis_t *self, drive_feedback_t *feedback);

/** A fault that this driver has found. */
const char *canraw_fault_text(uint32_t code);

/** A drive while nothing may be sent.
 *  @param is_led another master leads it */
void canraw_listening_words(bool is_led, drive_report_t *out);

/** Drive k in words. */
void canraw_axis_words(const canraw_axis_t *self, const canraw_map_t *map, unsigned k, uint64_t now_us, drive_report_t *out);

#endif
