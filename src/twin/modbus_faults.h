/* SPDX-License-Identifier: MIT
 * modbus_faults.h - what faults mean on Modbus drives and boards, by the names of faults.h.
 */
#ifndef HEAVE_TWIN_MODBUS_FAULTS_H
#define HEAVE_TWIN_MODBUS_FAULTS_H

#include "twin/faults.h"

/** What a name does to a drive; NULL: these drives have no such fault.
 *  @param is_shared out: it is one of the motor, the same on every bus */
fault_act_t modbus_fault_find(const char *name, bool *is_shared);

#endif
