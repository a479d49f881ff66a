/* SPDX-License-Identifier: MIT
 * faults.h - what is kept of faults: all are counted, the first one since the last reset is shown, the worst reaction wins.
 * Private to src/gateway.
 */
#ifndef GATEWAY_FAULTS_H
#define GATEWAY_FAULTS_H

#include "heave/gateway.h"

/** No fault has been. */
void faults_init(faults_t *self);

/** Counts and logs a fault that begins.
 *  @return true: its reaction is worse than any since the last reset */
bool faults_note(faults_t *self, const fault_t *fault, drives_t drives, unsigned cylinders, hal_log_t log);

/** A reset: none is shown any more. */
void faults_clear(faults_t *self);

/** The report of the drive that a fault is about; empty texts if the fault is about no drive. */
drive_report_t faults_report_of(drives_t drives, const fault_t *fault);

#endif
