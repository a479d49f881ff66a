/* SPDX-License-Identifier: MIT
 * modbus_faults.h - what faults mean on Modbus drives and boards, by the names of twin_faults.h.
 */
#ifndef HEAVE_TWIN_MODBUS_FAULTS_H
#define HEAVE_TWIN_MODBUS_FAULTS_H

#include "twin/twin_faults.h"

/** What a name does to a drive; NULL: these drives have no such fault.
 *  @param is_shared out: it is one of the motor, the same on every bus */
fault_act_t modbus_fault_find(const char *name, bool *is_shared);

/** Whether it is one of a board of relays, of lines and hosts. */
bool modbus_fault_is_board(bus_fault_t fault);
bool modbus_fault_is_lines(bus_fault_t fault);

/** Makes it so. False: it is one of the CAN bus. */
bool modbus_fault_do(modbus_side_t *side, bus_fault_t fault);

#endif
