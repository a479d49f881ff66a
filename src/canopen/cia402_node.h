/* SPDX-License-Identifier: MIT
 * cia402_node.h - axes that are channels of one node: they share its NMT state, its boot-up messages and its SDO server, come up
 * together, and are lost together.
 */
#ifndef CIA402_NODE_H
#define CIA402_NODE_H

#include "cia402_axis.h"

/** One of the drives, for cia402_axis.h. */
static inline cia402_drive_t cia402_drive(cia402_t *self, unsigned axis)
{
    return (cia402_drive_t){&self->axis[axis], self->axis, self->config, &self->config->axis[axis], self->now_us};
}

/** Another one of the platform, from one of them. */
static inline cia402_drive_t cia402_node_drive(cia402_drive_t drive, unsigned axis)
{
    return (cia402_drive_t){&drive.all[axis], drive.all, drive.config, &drive.config->axis[axis], drive.now_us};
}

/** True where the node has other axes. */
bool cia402_node_has_mates(cia402_drive_t drive);

/** The axis that leads the node: its channel 0. */
cia402_axis_t *cia402_node_first(cia402_drive_t drive);

/** True where all axes of the node are in this phase. */
bool cia402_node_are_all(cia402_drive_t drive, cia402_phase_t phase);

/** True where an axis of the node is lost or refused. */
bool cia402_node_is_short(cia402_drive_t drive);
bool cia402_node_is_refused(cia402_drive_t drive);

/** True where all axes of the node have answered since they were started. */
bool cia402_node_is_answering(cia402_drive_t drive);

/** True where the drive may use the SDO server of its node: one transfer at a time. */
bool cia402_node_may_ask(cia402_drive_t drive);

/** True where no axis of the node has torque. */
bool cia402_node_is_off(cia402_drive_t drive);

#endif
