/* SPDX-License-Identifier: MIT
 * operate.h - states in deeds: events to the supervisor, its actions on motion, drives and relays. Private to src/gateway.
 */
#ifndef OPERATE_H
#define OPERATE_H

#include "heave/gateway.h"

/** Offers an event and carries out the action of the transition. Logs every change of state. */
void operate_event(gateway_t *self, event_t event, uint64_t now_us);

/** Follows a sender from now on: its first pose at engage speed, relays safe until it says otherwise. */
void operate_follow(gateway_t *self, uint64_t now_us);

/** Drives and inputs to events, before the frames of the cycle are read. */
void operate_before_frames(gateway_t *self, uint64_t now_us);

/** Silence of the sender to events, after them. */
void operate_after_frames(gateway_t *self, uint64_t now_us);

/** An operator's request (see gateway_request). */
hv_status_t operate_request(gateway_t *self, event_t request, uint64_t now_us);

/** After the motion of the cycle: drives that are to be disabled once at rest. */
void operate_after_motion(gateway_t *self);

/** A shutdown that has come to its end waits for drives that have not confirmed yet that their torque is off, but not for ever.
 */
void operate_watch_end(gateway_t *self, uint64_t now_us);

/** As gateway_energized().
 *  @param is_answering only drives that answer */
uint32_t operate_energized(const gateway_t *self, bool is_answering);

/** True where the bus has taken no set of set-points for so long that none can be expected to get through. */
bool operate_is_bus_stalled(const gateway_t *self);

/** True where states, deadlines, bus and drives are as they should be in this cycle: what the healthy pulse says. */
bool operate_is_well(const gateway_t *self);

#endif
