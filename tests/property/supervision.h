/* SPDX-License-Identifier: MIT
 * supervision.h - judges what a gateway does about faults, e-stops, silent senders and two of them, cycle by cycle and from
 * outside: from what was sent and asked, from the simulated drives and relays themselves, and from the states it shows.
 */
#ifndef SUPERVISION_H
#define SUPERVISION_H

#include "rig.h"

#define SUPERVISION_HOSTS 2u

/** Members are private but for the counts. */
typedef struct {
    const rig_t *rig;
    const char *wrong; /**< the first thing that was, NULL = nothing */
    uint64_t wrong_us;
    uint64_t now_us;
    state_t state, before_hold;
    uint64_t hold_us;
    uint64_t bad_us, busy_us, moved_us, frame_us, engaged_us, timed_until_us, reset_us, asked_us;
    uint64_t heard_us[SUPERVISION_HOSTS]; /* last frame of each that was taken */
    bool has_sent[SUPERVISION_HOSTS];     /* in the coming cycle */
    bool is_next_timed, has_next;
    uint64_t next_until_us;
    bool is_up_asked, is_off_due;
    uint32_t accepted;
    uint8_t owner;
    q32_t sent_q32[DRIVES_MAX];
    long faults, estops, holds, owners; /**< judged: stops together, e-stops, silences, changes of owner */
} supervision_t;

/** Of 10.0.0.1, 10.0.0.2, ... */
hal_udp_peer_t supervision_peer(unsigned host);

/** Before the first cycle. */
void supervision_init(supervision_t *self, const rig_t *rig);

/** A datagram is about to be sent, with a timed move of so many ms (0: none). */
void supervision_sent(supervision_t *self, unsigned host, uint64_t timed_ms);

/** An operator's request is about to be made. */
void supervision_asked(supervision_t *self, event_t request);

/** After every cycle. */
void supervision_judge(supervision_t *self);

#endif
