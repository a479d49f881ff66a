/* SPDX-License-Identifier: MIT
 * frame_receiver.h - from datagrams to frames: receives, parses, counts and logs what is no frame. Knows nothing of states and
 * motion. Private to src/gateway.
 */
#ifndef FRAME_RECEIVER_H
#define FRAME_RECEIVER_H

#include "heave/gateway.h"

/** What the intake reads and writes besides its own state. */
typedef struct {
    hal_udp_t udp;
    hal_log_t log;
    counters_t *counters;
} frame_receiver_io_t;

/** Begins a cycle. */
void frame_receiver_begin(frame_receiver_t *self);

/** The next valid frame of this cycle, out of at most GATEWAY_DATAGRAMS_PER_CYCLE datagrams. self->from is its sender and
 *  self->waited_us the time that it waited for the cycle.
 *  @return false: there is none */
bool frame_receiver_next(frame_receiver_t *self, const settings_t *settings, const frame_receiver_io_t *io, uint64_t now_us,
                         frame_t *frame);

/** Counts and logs a valid frame that is not followed.
 *  @param error FRAME_ERR_PLATFORM or FRAME_ERR_MASK_FORM
 *  @param why   in words */
void frame_receiver_reject(frame_receiver_t *self, const frame_receiver_io_t *io, frame_command_t command, frame_error_t error,
                           const char *why, const hal_udp_peer_t *from, uint64_t now_us);

#endif
