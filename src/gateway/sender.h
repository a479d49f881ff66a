/* SPDX-License-Identifier: MIT
 * sender.h - decides which frames are followed: the sender in control, far jumps, gaps of a stream. Passes targets to motion and
 * keeps the relay mask. Here frames meet states and motion, so these functions take the whole gateway. Private to src/gateway.
 */
#ifndef GATEWAY_SENDER_H
#define GATEWAY_SENDER_H

#include "heave/gateway.h"
#include "frame_receiver.h"

/** Before the first frame of a cycle. */
void sender_begin(gateway_t *self, uint64_t now_us);

/** Takes a valid frame of frame_receiver_next(), from self->receiver.from. */
void sender_take(gateway_t *self, const frame_t *frame, uint64_t now_us);

/** After the last frame of a cycle: motion gets the newest target if it has not got it yet. */
void sender_end(gateway_t *self, uint64_t now_us);

#endif
