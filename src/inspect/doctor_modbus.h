/* SPDX-License-Identifier: MIT
 * doctor_modbus.h - asks drives on Modbus for what heaved asks them all the time. Reads only; blocks; each answer has its
 * time-out.
 */
#ifndef HEAVE_INSPECT_DOCTOR_MODBUS_H
#define HEAVE_INSPECT_DOCTOR_MODBUS_H

#include "config/config.h"
#include "inspect/doctor_report.h"

/** Says of each drive whether it answers, and of each line that cannot be used what is wrong with it. */
void doctor_modbus_check(doctor_report_t *report, const config_t *config);

#endif
