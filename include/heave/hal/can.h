/* SPDX-License-Identifier: MIT
 * can.h - contract of one classic CAN bus: send, receive, and the state of the controller.
 * One thread calls the ops; for restart see below. Bit rate and receive filters are given to the backend's open.
 */
#ifndef HEAVE_HAL_CAN_H
#define HEAVE_HAL_CAN_H

#include "heave/status.h"

/** Highest identifiers. */
#define CAN_ID_MAX          0x7FFu
#define CAN_ID_EXTENDED_MAX 0x1FFFFFFFu

/** A frame, or a report of the controller (is_error). */
typedef struct {
    uint32_t id; /**< [0, CAN_ID_MAX] or [0, CAN_ID_EXTENDED_MAX]; with is_error: CAN_ERROR_* */
    bool is_extended;
    bool is_rtr;
    bool is_error;  /**< received only */
    uint8_t length; /**< [0, 8] bytes of data; bytes beyond it are 0 when received and ignored when sent */
    uint8_t data[8];
} can_frame_t;

/** Contents of a report, in can_frame_t.id; bits may be combined. Reports keep their order among the frames. */
enum {
    CAN_ERROR_WARNING = 1u,
    CAN_ERROR_PASSIVE = 2u,
    CAN_ERROR_BUS_OFF = 4u,
    CAN_ERROR_RESTARTED = 8u, /**< the controller returned from bus-off: treat everything on the bus as lost */
    CAN_ERROR_NO_ACK = 16u,   /**< nobody acknowledged a frame */
    CAN_ERROR_OVERRUN = 32u,  /**< received frames were lost */
    CAN_ERROR_OTHER = 64u
};

/** State of the controller. */
typedef enum {
    HAL_CAN_ACTIVE,
    HAL_CAN_WARNING,
    HAL_CAN_PASSIVE,
    HAL_CAN_BUS_OFF,
    HAL_CAN_DOWN, /**< the interface is there but switched off */
    HAL_CAN_GONE  /**< there is no such interface: unplugged, or not there yet */
} hal_can_state_t;

/** A receive filter: a frame passes where (id ^ filter.id) & mask is 0 and its width is the filter's. A backend takes a list
 *  of these when it is opened; a frame that passes no filter is never received, and an empty list passes everything. Reports
 * always pass. */
typedef struct {
    uint32_t id;
    uint32_t mask;
    bool is_extended;
} hal_can_filter_t;

/** send and recv are mandatory, the rest optional. */
typedef struct {
    hv_status_t (*send)(void *ctx, const can_frame_t *frame);
    hv_status_t (*recv)(void *ctx, can_frame_t *out, uint64_t *rx_time_us);
    hv_status_t (*bus_state)(void *ctx, hal_can_state_t *out); /* optional: always active */
    hv_status_t (*unconfirmed)(void *ctx, uint32_t *frames);   /* optional */
    hv_status_t (*restart)(void *ctx);                         /* optional */
    hv_status_t (*ask_state)(void *ctx, hal_can_state_t *out); /* optional: bus_state */
} hal_can_ops_t;

/** Passed by value; ctx belongs to the backend and lives until its close. */
typedef struct {
    const hal_can_ops_t *ops;
    void *ctx;
} hal_can_t;

/** True if every mandatory op is set. If not, refuse to start. */
static inline bool hal_can_valid(hal_can_t can)
{
    return can.ops != NULL && can.ops->send != NULL && can.ops->recv != NULL;
}

/** Queues a frame; frames leave in the order of their sending. <= 50 us. Call recv until HV_ERR_AGAIN before each
 *  burst: only then is it known which frames have left the queue. HV_OK means queued, not sent: without a partner, and with some
 *  controllers in bus-off, frames accumulate and would be sent much later. Check unconfirmed() before sending set-points.
 *  @param frame the caller's, copied
 *  @return HV_OK; HV_ERR_AGAIN: the queue is full, the frame is not taken (drop a set-point then, do not retry in a loop);
 * HV_ERR_ARG: id, length or is_error out of range; HV_ERR_IO: bus-off, interface down or gone, the frame is not taken, and none
 * will be until restart. */
static inline HV_MUST_CHECK hv_status_t hal_can_send(hal_can_t can, const can_frame_t *frame)
{
    return can.ops->send(can.ctx, frame);
}

/** Takes the oldest received frame or report. Own frames are never returned: the backend counts their echo,
 *  see hal_can_unconfirmed(). Never blocks (<= 50 us).
 *  @param rx_time_us out: when it was received, on the time line of hal_clock_now_us()
 *  @return HV_OK; HV_ERR_AGAIN: none waiting; HV_ERR_IO: interface down or gone: go on calling once a cycle. Outputs
 *          unchanged on error. */
static inline HV_MUST_CHECK hv_status_t hal_can_recv(hal_can_t can, can_frame_t *out, uint64_t *rx_time_us)
{
    return can.ops->recv(can.ctx, out, rx_time_us);
}

/** State of the controller as last reported. Never blocks. Up to date once recv has returned HV_ERR_AGAIN or HV_ERR_IO.
 *  @return HV_OK. A backend without the op is always HAL_CAN_ACTIVE. */
static inline HV_MUST_CHECK hv_status_t hal_can_bus_state(hal_can_t can, hal_can_state_t *out)
{
    if (can.ops->bus_state != NULL) {
        return can.ops->bus_state(can.ctx, out);
    }
    *out = HAL_CAN_ACTIVE;
    return HV_OK;
}

/** Queries the state of the controller. Some controllers report error-passive, but never that they have recovered. May take some
 * ms if the system is busy with its interfaces, so do not call it every cycle. Also updates bus_state.
 *  @return HV_OK; HV_ERR_IO: no answer, out is unchanged. A backend without the op has nothing newer than bus_state. */
static inline HV_MUST_CHECK hv_status_t hal_can_ask_state(hal_can_t can, hal_can_state_t *out)
{
    return can.ops->ask_state != NULL ? can.ops->ask_state(can.ctx, out) : hal_can_bus_state(can, out);
}

/** Number of frames that were queued and whose echo is still missing: not seen on the wire. Up to date when recv has returned
 *  HV_ERR_AGAIN. Queue the next set of set-points only if this is 0, so that no old set can wait in a queue. Never blocks.
 *  After bus-off or a pulled cable it stays above 0 until restart.
 *  @return HV_OK; HV_ERR_NOSUP: the backend gets no echo. */
static inline HV_MUST_CHECK hv_status_t hal_can_unconfirmed(hal_can_t can, uint32_t *frames)
{
    return can.ops->unconfirmed != NULL ? can.ops->unconfirmed(can.ctx, frames) : HV_ERR_NOSUP;
}

/** Restarts after bus-off, stall or unplugging: opens the interface again by name, discards received frames, drops the frames
 * that wait to be sent, and forgets unconfirmed ones. Call only while no drive is enabled: a frame in the controller itself may
 * still go out. May block for some ms, unlike the other ops, and may run in another thread while no other op does.
 *  @return HV_OK; HV_ERR_AGAIN: the interface is not there yet, try later; HV_ERR_IO: it is there but refuses, is still down
 *          or bus-off, or frames wait in it that are not known to be old, or that this program has no right to drop; try later;
 *          HV_ERR_NOSUP. */
static inline HV_MUST_CHECK hv_status_t hal_can_restart(hal_can_t can)
{
    return can.ops->restart != NULL ? can.ops->restart(can.ctx) : HV_ERR_NOSUP;
}

#endif
