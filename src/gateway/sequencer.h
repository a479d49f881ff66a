/* SPDX-License-Identifier: MIT
 * sequencer.h - what takes more than a cycle: bringing the drives up, resets, an engage by itself, silence, requests of
 * operators. Turns inputs, drives and time into events. Private to src/gateway.
 */
#ifndef GATEWAY_SEQUENCER_H
#define GATEWAY_SEQUENCER_H

#include "cycle.h"

/** Drives and inputs to events, before the frames of the cycle are read. */
void sequencer_before_frames(gateway_t *self, const cycle_t *cycle);

/** Silence of the sender to events, after them. */
void sequencer_after_frames(gateway_t *self, const cycle_t *cycle);

/** After the motion: drives that are to be disabled once at rest. */
void sequencer_after_motion(gateway_t *self, const cycle_t *cycle);

/** An operator's request (see gateway_request). */
hv_status_t sequencer_request(gateway_t *self, event_t request, const cycle_t *cycle);

/** True if states, deadlines, bus and drives are as they should be in this cycle. The healthy pulse depends on it. */
bool sequencer_is_well(const gateway_t *self, const cycle_t *cycle);

#endif
