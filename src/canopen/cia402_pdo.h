/* SPDX-License-Identifier: MIT
 * cia402_pdo.h - commands and answers as frames: how a command is put together, and how an answer is read.
 */
#ifndef CIA402_PDO_H
#define CIA402_PDO_H

#include "cia402_axis.h"

/** Finds the PDOs of all axes, once. */
void cia402_pdo_init(cia402_t *self);

/** The frame of a command of an axis, and where the PDO is one of its node, of the others there.
 *  @return false where there is no such PDO */
bool cia402_pdo_command(const cia402_t *self, unsigned axis, unsigned which, can_frame_t *out);

/** A TPDO was received: reads what is in it. Another length than is mapped counts for nothing. */
void cia402_pdo_receive(cia402_t *self, const can_frame_t *frame);

#endif
