/* SPDX-License-Identifier: MIT
 * sender.h - which frames are followed: the sender that drives, its relay mask, far jumps, turns. Passes targets to motion.
 * Knows nothing of drives. Private to src/gateway.
 */
#ifndef GATEWAY_SENDER_H
#define GATEWAY_SENDER_H

#include "heave/gateway.h"
#include "frame_receiver.h"

/** What a frame meets. */
typedef struct {
    const settings_t *settings;
    frame_receiver_io_t io;
    frame_receiver_t *receiver; /**< of the frame: its sender, and how long it has waited */
    motion_t *motion;
    const motion_output_t *output; /**< of the last cycle */
    state_t state;
    uint64_t now_us;
} sender_in_t;

typedef enum {
    SENDER_REFUSED, /**< counted and logged; nothing follows */
    SENDER_DRIVES,
    SENDER_NEW /**< it drives from now on: an engaged platform stops, and goes to its first pose at engage speed */
} sender_verdict_t;

/** Before the first frame of a cycle. */
void sender_begin(sender_t *self, uint64_t now_us);

/** Whether a valid frame is of the sender that drives, and in its form. */
sender_verdict_t sender_judge(sender_t *self, const sender_in_t *in, const frame_t *frame);

/** The target of a frame that was not refused. */
motion_target_t sender_target(sender_t *self, const sender_in_t *in, const frame_t *frame);

/** Passes it to motion and keeps the relay mask, in the state that the frame has led to.
 *  @return false: it is impossible, and was counted and logged */
bool sender_follow(sender_t *self, const sender_in_t *in, const frame_t *frame, const motion_target_t *target);

/** After the last frame of a cycle: motion gets the newest target if it has not got it yet. */
void sender_end(sender_t *self, const sender_in_t *in);

/** The platform begins to follow: silence counts from now on, and relays are safe until the sender says otherwise. */
void sender_restart(sender_t *self, uint16_t safe_mask, uint64_t now_us);

#endif
