/* SPDX-License-Identifier: MIT
 * frame_faults.h - what faults mean on drives with CAN frames of their own, by the names of twin_faults.h.
 */
#ifndef HEAVE_TWIN_FRAME_FAULTS_H
#define HEAVE_TWIN_FRAME_FAULTS_H

#include "twin/twin_faults.h"

/** What a name does to a drive; NULL: these drives have no such fault.
 *  @param is_shared out: it is one of the motor, the same on every bus */
fault_act_t frame_fault_find(const char *name, bool *is_shared);

#endif
