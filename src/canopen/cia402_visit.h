/* SPDX-License-Identifier: MIT
 * cia402_visit.h - the access of a person to objects of the drives, by one SDO client for all drives. Each drive has one SDO
 * server only. Therefore this client waits while the driver itself uses the server, and ends when the driver needs it. Private
 * to src/canopen.
 */
#ifndef CIA402_VISIT_H
#define CIA402_VISIT_H

#include "heave/cia402.h"

/** The SDO client that talks to drive k now: that of the person, else that of the driver. */
sdo_t *cia402_sdo_of(cia402_t *self, unsigned k);

/** Call it once per poll, after the steps of the drives. Takes the result of a transfer that has ended, or cancels the transfer
 * if the driver needs the drive. */
void cia402_visit_step(cia402_t *self);

/** The functions of the contract drives.h. */
hv_status_t cia402_visit_begin(void *ctx, uint8_t axis, const drive_object_t *object);
drive_object_state_t cia402_visit_end(void *ctx, drive_object_t *out, uint32_t *code);

#endif
