/* SPDX-License-Identifier: MIT
 * canraw_setpoint.h - what a frame of set-points of a raw CAN map carries. Private to canraw.c.
 */
#ifndef CANRAW_SETPOINT_H
#define CANRAW_SETPOINT_H

#include "heave/canraw.h"

/** Values of a frame, of all drives that share it. */
typedef struct {
    int64_t value[DRIVES_MAX * CANRAW_VALUES];
    int64_t counts[DRIVES_MAX];
    bool is_following[DRIVES_MAX];
    bool is_any;     /**< a drive follows, */
    bool is_news;    /**< and something differs from the last frame */
    bool is_unknown; /**< the position of a drive that shares the frame is not known */
} canraw_setpoints_t;

/** Adds the values of drive k. A drive whose set-point is too far away, or does not fit its field, fails and does not follow. */
void canraw_setpoint_add(canraw_t *self, canraw_setpoints_t *set, unsigned k, q32_t setpoint_q32);

#endif
