/* SPDX-License-Identifier: MIT
 * scan.h - heaved --scan: who is on a bus that no configuration describes yet. Reads only; blocks for some seconds.
 */
#ifndef HEAVE_INSPECT_SCAN_H
#define HEAVE_INSPECT_SCAN_H

#include <stdbool.h>
#include <stdio.h>

/** Asks every node of a CAN bus what it is (1000h, 1018h), or every unit of a serial line for a register.
 *  @param bus a CAN interface; or DEVICE[,BAUD[,PARITY[,STOP]]], a path
 *  @param out takes a line for each that answers: `node 3: ...`, `unit 3: ...`; and one that begins with `FAIL` where the bus
 * cannot be asked, or has a master
 *  @return false: such a line was written */
bool scan_run(const char *bus, FILE *out);

#endif
