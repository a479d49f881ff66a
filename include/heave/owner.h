/* SPDX-License-Identifier: MIT
 * owner.h - one driver at a time: which sender's frames the platform follows.
 * The protocol has no log-in, so the address tells senders apart (not the port: a program that starts again has another one).
 * The first sender of a valid frame drives. Another one takes over when that one has been silent for long enough, or at once
 * where a list of priorities puts it in front. Pure: time and settings are arguments; one caller at a time.
 */
#ifndef HEAVE_OWNER_H
#define HEAVE_OWNER_H

#include "heave/hal/udp.h"

/** Who drives. Zeroed: nobody yet. */
typedef struct {
    bool is_taken;
    hal_udp_peer_t peer; /**< the last port it used */
    uint64_t last_us;    /**< its last valid frame */
} owner_t;

/** What becomes of a frame. */
typedef enum {
    OWNER_DRIVES, /**< of the sender that drives, or the first one */
    OWNER_NEW,    /**< of one that takes over now: go to its pose at engage speed */
    OWNER_OTHER   /**< of one that does not drive: count it, follow it in nothing */
} owner_verdict_t;

/** Judges a valid frame and keeps who drives.
 *  @param silence_us after which another sender may take over; 0: nobody owns the platform, every frame is followed
 *  @param priority   senders that need not wait for those behind them, or not in it
 *  @param busy_until_us end of the timed move that was asked for: its sender is not silent before that */
owner_verdict_t owner_judge(owner_t *self, const hal_udp_peer_t *from, uint64_t silence_us, const hal_udp_networks_t *priority,
                            uint64_t busy_until_us, uint64_t now_us);

/** True for one that may be used, whatever file it comes from; see sane.h. */
bool owner_is_sane(const owner_t *self);

#endif
