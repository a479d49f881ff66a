/* SPDX-License-Identifier: MIT
 * modbus_faults.h - what faults mean on Modbus drives and boards, by the names of faults.h.
 */
#ifndef HEAVE_TWIN_MODBUS_FAULTS_H
#define HEAVE_TWIN_MODBUS_FAULTS_H

#include "twin/faults.h"

/** What a name does to a drive; NULL: these drives have no such fault.
 *  @param is_shared out: it is one of the motor, the same on every bus */
typedef void (*modbus_act_t)(twin_t *twin, unsigned k, const fault_t *fault, uint64_t now_us);
modbus_act_t modbus_fault_find(const char *name, bool *is_shared);

/** Whether a name is for Modbus only. */
bool modbus_fault_is_own(const char *name);

#endif
