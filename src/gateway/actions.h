/* SPDX-License-Identifier: MIT
 * actions.h - offers events to the supervisor and carries out its actions on motion, drives and relays. Private to src/gateway.
 */
#ifndef ACTIONS_H
#define ACTIONS_H

#include "heave/gateway.h"
#include "feedback.h"
#include "service.h"

/** Offers an event and carries out the action of the transition. Logs every change of state. */
void actions_event(gateway_t *self, event_t event, uint64_t now_us);

/** Follows a sender from now on: its first pose at engage speed, relays safe until it says otherwise. */
void actions_follow(gateway_t *self, uint64_t now_us);

/** After the motion of the cycle: drives that are to be disabled once at rest. */
void actions_after_motion(gateway_t *self);

/** True while the drives are being enabled or home by themselves: no set-point leads them. */
bool actions_is_coming_up(const gateway_t *self);

/** True if a drive or the bus has a fault that a reset would come too early for. */
bool actions_is_drive_fault_present(const gateway_t *self);

/** A fault begins: it is counted and logged, and the worst reaction wins, also over one that is under way. */
void actions_raise(gateway_t *self, const fault_t *fault);

/** Puts the set-points on the actual positions. */
void actions_track_actual(gateway_t *self);

/** What the drives said in this cycle. */
feedback_t actions_feedback(const gateway_t *self);

/** What manual operation gets. */
service_in_t actions_service_in(gateway_t *self, uint64_t now_us);

/** Asks the drives to go off; is_disable_due stays true if they cannot be asked now. */
void actions_disable_drives(gateway_t *self);

#endif
