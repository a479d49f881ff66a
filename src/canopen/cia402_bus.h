/* SPDX-License-Identifier: MIT
 * cia402_bus.h - the bus of CANopen drives: identifiers of its frames, whether it works, and its restart. Private to src/canopen.
 */
#ifndef CIA402_BUS_H
#define CIA402_BUS_H

#include "heave/cia402.h"

/* Function codes of identifiers (CiA 301, pre-defined connection set); those of PDOs are in cia402_map.h. */
#define CIA402_COB_NMT         0x000u
#define CIA402_COB_SYNC        0x080u /* and emergencies */
#define CIA402_COB_SDO_ANSWER  0x580u
#define CIA402_COB_SDO_REQUEST 0x600u
#define CIA402_COB_HEARTBEAT   0x700u

#define CIA402_SYNC_FIRST 1u /* of its counter */

/** Loses every drive. */
void cia402_bus_lose(cia402_t *self);

/** Whether the bus works: up, and not long ago there was room and what was sent has been seen on the wire. Where it does not, all
 * drives are lost, and it is restarted once their watch over the master has run out. */
void cia402_bus_watch(cia402_t *self, bool is_up);

#endif
