/* SPDX-License-Identifier: MIT
 * fault_watch.h - finds faults of bus, drives, e-stop channels and supply, and raises each one once.
 * Private to src/gateway.
 */
#ifndef GATEWAY_FAULT_WATCH_H
#define GATEWAY_FAULT_WATCH_H

#include "heave/gateway.h"

/** Raises a fault: counts and logs it, keeps the first one, and carries out the worst reaction so far. */
void fault_watch_raise(gateway_t *self, const fault_t *fault);

/** Ends a reset that still waits for the drives: its operator did not know of the newer fault. */
void fault_watch_give_up_reset(gateway_t *self);

/** The report of the drive that a fault is about; empty texts if the fault is about no drive. */
drive_report_t fault_watch_report_of(const gateway_t *self, const fault_t *fault);

/** The bus is lost: the drives no longer get set-points. */
void fault_watch_bus(gateway_t *self, bool is_lost, uint64_t now_us);

/** The bus is about to be lost; the drives still get set-points. */
void fault_watch_bus_failing(gateway_t *self, uint64_t now_us);

/** Judges every drive. */
void fault_watch_drives(gateway_t *self, uint64_t now_us);

/** Raises what gateway_tell_fault() was told and this cycle has not found by itself. */
void fault_watch_told(gateway_t *self, uint64_t now_us);

/** The two channels of the e-stop disagree. */
void fault_watch_channels(gateway_t *self, bool is_apart, uint64_t now_us);

/** The supply fails; a fault if the platform is not down in time. */
void fault_watch_power(gateway_t *self, bool is_failing, uint64_t now_us);

/** True if the bus has taken no set-points for so long that none can be expected to get through. */
bool fault_watch_is_bus_stalled(const gateway_t *self);

#endif
