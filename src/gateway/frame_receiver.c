/* SPDX-License-Identifier: MIT
 * frame_receiver.c - see frame_receiver.h.
 */
#include "frame_receiver.h"

#include "log_limit.h"

#define REJECT_TEXT_BYTES 60u

/* One line for the first reject of a burst, with what was left out since the last one. */
static void log_reject(frame_receiver_t *self, hal_log_t log, const char *reason, frame_error_t error, const uint8_t *bytes,
                       size_t length, const hal_udp_peer_t *from, uint64_t now_us)
{
    const uint32_t count = log_limit_event(&self->reject_log[error], now_us);
    if (count == 0) {
        return;
    }
    char line[HAL_LOG_TEXT_MAX + 1];
    char peer[HAL_UDP_PEER_TEXT_MAX];
    text_t text = text_start(line, sizeof line);
    (void)hal_udp_peer_text(from, peer, sizeof peer);
    text_put(&text, "frame from ");
    text_put(&text, peer);
    text_put(&text, " rejected: ");
    text_put(&text, reason);
    text_put(&text, ": \"");
    text_put_escaped(&text, bytes, length < REJECT_TEXT_BYTES ? length : REJECT_TEXT_BYTES);
    text_put(&text, "\"");
    log_limit_put(&text, count);
    hal_log_write(log, HAL_LOG_WARNING, line);
}

HV_OWN_FRAME static void reject(frame_receiver_t *self, const frame_receiver_io_t *io, const frame_reject_t *why, uint64_t now_us)
{
    char reason[HAL_LOG_TEXT_MAX + 1];
    io->counters->rejected[why->error]++;
    (void)frame_reject_describe(why, reason, sizeof reason);
    log_reject(self, io->log, reason, why->error, &self->datagram[why->start], why->end - why->start, &self->from, now_us);
}

HV_OWN_FRAME void frame_receiver_reject(frame_receiver_t *self, const frame_receiver_io_t *io, frame_command_t command,
                                        frame_error_t error, const char *why, const hal_udp_peer_t *from, uint64_t now_us)
{
    char reason[HAL_LOG_TEXT_MAX + 1];
    text_t text = text_start(reason, sizeof reason);
    text_put(&text, frame_command_name(command));
    text_put(&text, ": ");
    text_put(&text, why);
    io->counters->rejected[error]++;
    log_reject(self, io->log, reason, error, (const uint8_t *)frame_command_name(command), 2, from, now_us);
}

/* How long the datagram has waited for its cycle: a sender's time line is finer than cycles. A longer wait means a late cycle,
 * which a replay does not have. */
static void note_arrival(frame_receiver_t *self, hal_udp_t udp, uint32_t cycle_us)
{
    uint32_t waited_us = 0;
    const bool is_known = hal_udp_waited(udp, &waited_us) == HV_OK;
    self->waited_us = !is_known ? 0 : waited_us < cycle_us ? waited_us : cycle_us - 1;
}

/* Receives the next datagram that is not too long.
 * Returns false where none has arrived, or the cycle has had its share. */
static bool receive(frame_receiver_t *self, const settings_t *settings, const frame_receiver_io_t *io, uint64_t now_us)
{
    while (self->datagrams < GATEWAY_DATAGRAMS_PER_CYCLE) {
        self->position = 0;
        const hv_status_t status = hal_udp_recv(io->udp, self->datagram, sizeof self->datagram, &self->length, &self->from);
        if (status == HV_ERR_AGAIN) {
            return false;
        }
        if (status == HV_ERR_IO) {
            io->counters->receive_errors++;
            return false;
        }
        self->datagrams++;
        io->counters->datagrams++;
        note_arrival(self, io->udp, settings->cycle_us);
        if (status != HV_ERR_RANGE) {
            frame_scanner_init(&self->scanner, settings->dialect);
            return true;
        }
        io->counters->oversize++;
        log_reject(self, io->log, "datagram longer than 512 bytes, send one frame per datagram", FRAME_ERR_UNFINISHED,
                   self->datagram, 0, &self->from, now_us);
    }
    return false;
}

void frame_receiver_begin(frame_receiver_t *self)
{
    self->datagrams = 0;
    self->is_open = false;
}

bool frame_receiver_next(frame_receiver_t *self, const settings_t *settings, const frame_receiver_io_t *io, uint64_t now_us,
                         frame_t *frame)
{
    for (;;) {
        self->is_open = self->is_open || receive(self, settings, io, now_us);
        if (!self->is_open) {
            return false;
        }
        frame_reject_t why;
        const frame_event_t event = frame_next(&self->scanner, self->datagram, self->length, &self->position, frame, &why);
        if (event == FRAME_EVENT_FRAME) {
            return true;
        }
        self->is_open = event != FRAME_EVENT_NONE;
        if (self->is_open) {
            reject(self, io, &why, now_us);
        }
    }
}
