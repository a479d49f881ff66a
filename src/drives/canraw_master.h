/* SPDX-License-Identifier: MIT
 * canraw_master.h - another master on the bus of drives with frames of their own. Private to canraw.c.
 */
#ifndef CANRAW_MASTER_H
#define CANRAW_MASTER_H

#include "heave/canraw.h"

/** Listens, if that is configured. */
void canraw_master_begin(canraw_t *self);

/** @return true: it is of another master */
bool canraw_master_receive(canraw_t *self, const can_frame_t *frame);

/** Once per poll, behind what was received and what has become of the bus. */
void canraw_master_step(canraw_t *self);

#endif
