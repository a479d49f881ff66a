/* SPDX-License-Identifier: MIT
 * actions.h - offers events to the supervisor and carries out its actions on motion, drives and relays. Private to src/gateway.
 */
#ifndef ACTIONS_H
#define ACTIONS_H

#include "cycle.h"

/** Offers an event and carries out the action of the transition. Logs every change of state. */
void actions_event(sequencer_t *self, event_t event, const cycle_t *cycle);

/** What the supervisor sees now. */
supervisor_view_t actions_view(const sequencer_t *self, const cycle_t *cycle);

/** Follows a sender from now on: its first pose at engage speed, relays safe until it says otherwise. */
void actions_follow(const cycle_t *cycle);

/** A fault begins: it is counted and logged, and the worst reaction wins, also over one that is under way. */
void actions_raise(sequencer_t *self, const fault_t *fault, const cycle_t *cycle);

#endif
