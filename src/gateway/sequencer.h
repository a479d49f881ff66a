/* SPDX-License-Identifier: MIT
 * sequencer.h - what leads from one state to another: inputs, drives, time, silence of the sender, requests of operators, and
 * what takes more than a cycle: bringing the drives up, resets, a shutdown. Turns them into events. Knows nothing of frames and
 * relays. Private to src/gateway.
 */
#ifndef GATEWAY_SEQUENCER_H
#define GATEWAY_SEQUENCER_H

#include "cycle.h"

/** In OFF, with drives that are off. */
void sequencer_init(sequencer_t *self, const settings_t *settings);

/** In SETTLED, with drives that are enabled and there; after sequencer_init(). */
void sequencer_start_settled(sequencer_t *self);

/** The auto policy is as at the start. */
void sequencer_restart_auto(sequencer_t *self, const settings_t *settings);

/** First in each cycle, before the drives are polled. */
void sequencer_begin(sequencer_t *self, const cycle_t *cycle);

/** Drives and inputs to events, before the frames of the cycle are read.
 *  @param is_bus_heard the drives could be polled */
void sequencer_before_frames(sequencer_t *self, const cycle_t *cycle, hal_inputs_t inputs, bool is_bus_heard);

/** Silence of the sender to events, after them. */
void sequencer_after_frames(sequencer_t *self, const cycle_t *cycle);

/** After the motion: drives that are to be disabled once at rest, and the end of a shutdown. */
void sequencer_after_motion(sequencer_t *self, const cycle_t *cycle);

/** An operator's request (see gateway_request). */
hv_status_t sequencer_request(sequencer_t *self, event_t request, const cycle_t *cycle);

/** True if states, deadlines, bus and drives are as they should be in this cycle. The healthy pulse depends on it. */
bool sequencer_is_well(const sequencer_t *self, const cycle_t *cycle);

#endif
