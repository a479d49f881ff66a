/* SPDX-License-Identifier: MIT
 * sequencer.h - what takes more than a cycle: bringing the drives up, resets, an engage by itself, silence, requests of
 * operators. Turns inputs, drives and time into events. Private to src/gateway.
 */
#ifndef GATEWAY_SEQUENCER_H
#define GATEWAY_SEQUENCER_H

#include "heave/gateway.h"

/** Drives and inputs to events, before the frames of the cycle are read. */
void sequencer_before_frames(gateway_t *self, uint64_t now_us);

/** Silence of the sender to events, after them. */
void sequencer_after_frames(gateway_t *self, uint64_t now_us);

/** An operator's request (see gateway_request). */
hv_status_t sequencer_request(gateway_t *self, event_t request, uint64_t now_us);

/** True if states, deadlines, bus and drives are as they should be in this cycle. The healthy pulse depends on it. */
bool sequencer_is_well(const gateway_t *self);

#endif
