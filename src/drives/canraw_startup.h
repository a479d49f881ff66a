/* SPDX-License-Identifier: MIT
 * canraw_startup.h - what a drive of a raw CAN map gets before it is used: frames one after the other, with waits and answers.
 * They begin when the first frame comes from it, and meanwhile every second, since it may say nothing before. Private to canraw.c
 * and canraw_axis.c.
 */
#ifndef CANRAW_STARTUP_H
#define CANRAW_STARTUP_H

#include "heave/canraw.h"

/** Every step was taken, or there is none. */
bool canraw_startup_is_over(const canraw_axis_t *self, const canraw_map_t *map);

/** A frame on one of its identifiers.
 *  @return true for the answer to a step */
bool canraw_startup_receive(canraw_axis_t *self, const canraw_map_t *map, const canraw_axis_map_t *axis, const can_frame_t *frame,
                            uint64_t now_us);

/** The frame that is due, or NULL. */
const canraw_frame_t *canraw_startup_next(canraw_axis_t *self, const canraw_map_t *map, uint64_t now_us);

/** That frame went out. */
void canraw_startup_sent(canraw_axis_t *self, const canraw_map_t *map, uint64_t now_us);

#endif
