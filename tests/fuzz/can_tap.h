/* SPDX-License-Identifier: MIT
 * can_tap.h - between a driver and its simulated bus: frames that nobody sent are slipped in, and what the driver sends and
 * receives is shown.
 */
#ifndef CAN_TAP_H
#define CAN_TAP_H

#include "heave/hal/can.h"

#define CAN_TAP_FRAMES 8u

/** A tap. */
typedef struct {
    hal_can_t inner;
    can_frame_t frame[CAN_TAP_FRAMES]; /**< the driver receives these first */
    unsigned first;
    unsigned count;
    void *watcher;
    void (*sent)(void *watcher, const can_frame_t *frame);     /**< told of each frame that the bus took */
    void (*received)(void *watcher, const can_frame_t *frame); /**< told of each frame that the driver gets; may be NULL */
} can_tap_t;

/** Slips a frame in; one more than fit is left out. */
void can_tap_slip_in(can_tap_t *self, const can_frame_t *frame);

/** The bus as the driver sees it. */
hal_can_t can_tap_hal(can_tap_t *self);

#endif
