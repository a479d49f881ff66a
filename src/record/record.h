/* SPDX-License-Identifier: MIT
 * record.h - what happened from outside while running live: as records of the motion thread, then as lines of a frames file.
 * The lines play back to the same set-points (frames.h reads them). Time zero is the cycle that first shows SETTLED; what came
 * before it becomes comments.
 */
#ifndef HEAVE_RECORD_RECORD_H
#define HEAVE_RECORD_RECORD_H

#include "common/ring.h"
#include "heave/gateway.h"

/** What happened. */
typedef enum {
    RECORD_DATAGRAM,
    RECORD_OVERSIZE,  /**< a datagram longer than the gateway takes; value: its length */
    RECORD_REQUEST,   /**< value: event_t */
    RECORD_ESTOP,     /**< value: 1 on, 0 off */
    RECORD_INTENSITY, /**< value: percent */
    RECORD_RISE,      /**< value: percent of engage speed */
    RECORD_LATE,      /**< value: cycles */
    RECORD_DRIVE,     /**< a drive went into DRIVE_FAULT, went DRIVE_OFFLINE or came back; detail: number, from 1, << 8 |
                         drive_state_t;     value: its code */
    RECORD_FAULT,     /**< a fault began; value: fault_code_t, detail: its axis as in fault_t */
    RECORD_SERVICE,   /**< by hand, and taken; bytes: service_request_t */
    RECORD_RELOAD,    /**< the configuration was read again */
    RECORD_ZERO       /**< time zero; value: record_zero() */
} record_kind_t;

/** What stands before the bytes of a datagram or of a request. */
typedef struct {
    hal_udp_peer_t from; /**< of a datagram */
    uint64_t t_us;       /**< of the cycle, since the start of the program */
    uint32_t value;
    uint32_t kind;
    uint32_t detail;
} record_head_t;

/** A record as it comes out of the ring. */
typedef struct {
    record_head_t head;
    uint8_t bytes[GATEWAY_DATAGRAM_MAX];
} record_t;

/** Bytes that hold what one record becomes. */
#define RECORD_LINE_MAX (4u * GATEWAY_DATAGRAM_MAX + 128u + HAL_UDP_PEER_TEXT_MAX)

/** Turns records into lines. */
typedef struct {
    uint32_t cycle_us;
    state_t goal;     /**< that an offline run has at time zero */
    uint32_t percent; /**< and its intensity; it rises at engage speed */
    bool has_zero;
    uint64_t zero_us;
    hal_udp_peer_t from; /**< as the lines so far say */
} record_writer_t;

/** Hands a record over that is no datagram. */
void record_push(ring_t *ring, record_kind_t kind, uint64_t t_us, uint32_t value);

/** Hands a datagram over: RECORD_DATAGRAM, or RECORD_OVERSIZE whose bytes are not kept. */
void record_push_datagram(ring_t *ring, record_kind_t kind, uint64_t t_us, const hal_udp_peer_t *from, const uint8_t *bytes,
                          size_t length);

/** Hands a request of SERVICE over. */
void record_push_service(ring_t *ring, uint64_t t_us, const service_request_t *request);

/** Hands over what has become of the drives in a cycle, where that is to be played back: faults, and drives that are gone or
 * back.
 *  @param was of the cycle before */
void record_push_drives(ring_t *ring, uint64_t t_us, const drive_feedback_t was[DRIVES_MAX],
                        const drive_feedback_t is[DRIVES_MAX]);

/** Hands over the faults that began in a cycle: drives that only a replay has do not bring them about. */
void record_push_faults(ring_t *ring, const snapshot_t *snapshot);

/** What the platform is to be at time zero: the value of a RECORD_ZERO. */
static inline uint32_t record_zero(state_t goal, uint32_t intensity_percent, uint32_t rise_percent)
{
    return (uint32_t)goal | intensity_percent << 8 | rise_percent << 16;
}

/** @param engages_alone an offline run engages at time zero by itself */
void record_writer_init(record_writer_t *self, const settings_t *settings, bool engages_alone);

/** Turns the next record into a line, and one before it where the sender is another one.
 *  @param length of the bytes
 *  @return bytes written, with the newline; 0: nothing to write */
size_t record_writer_line(record_writer_t *self, const record_t *record, size_t length, char to[RECORD_LINE_MAX]);

#endif
