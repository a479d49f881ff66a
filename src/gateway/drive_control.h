/* SPDX-License-Identifier: MIT
 * drive_control.h - torque of all drives together: brings them up (enable, home, to the settled extension), leads them off, and
 * keeps the set-points on the actual positions while no set-point leads them. Knows nothing of states. Private to src/gateway.
 */
#ifndef GATEWAY_DRIVE_CONTROL_H
#define GATEWAY_DRIVE_CONTROL_H

#include "cycle.h"

/** True if every cylinder stands at its settled extension. */
bool drive_control_is_at_settled(const cycle_t *cycle);

/** True if a drive or the bus has a fault that a reset would come too early for. */
bool drive_control_has_fault(const cycle_t *cycle);

/** Puts the set-points on the actual positions. */
void drive_control_track(const cycle_t *cycle);

/** Begins to bring the drives up. */
void drive_control_begin(drive_control_t *self, uint64_t now_us);

/** True while the drives are being enabled or home by themselves: no set-point leads them. */
bool drive_control_is_coming_up(const drive_control_t *self);

/** True if the set-points lead the drives, which have torque then. */
bool drive_control_is_leading(const drive_control_t *self);

/** Stops where it is; drives that are coming up or home by themselves are told so. */
void drive_control_hold(drive_control_t *self, const cycle_t *cycle);

/** Stops; the torque goes off at rest. */
void drive_control_stop(drive_control_t *self, const cycle_t *cycle);

/** The torque goes off at once. */
void drive_control_drop(drive_control_t *self, const cycle_t *cycle);

/** The next step of bringing up, once the last one is complete.
 *  @return FAULT_DRIVE_TIMEOUT: it takes too long; else FAULT_NONE */
fault_code_t drive_control_bring_up(drive_control_t *self, const cycle_t *cycle);

/** True when a platform that was brought up has arrived at the settled extension. */
bool drive_control_has_arrived(const drive_control_t *self, const cycle_t *cycle);

/** Before and after the motion of the cycle: what is due, and set-points that follow the drives.
 *  @param off how the torque goes off: DRIVES_DISABLE or DRIVES_QUICK_STOP */
void drive_control_before_motion(drive_control_t *self, const cycle_t *cycle, drives_request_t off);
void drive_control_after_motion(drive_control_t *self, const cycle_t *cycle, drives_request_t off);

/** Motion waits for a bus that has not taken the last set: what the drives get next then follows on what they got last. Where the
 * set-points follow the drives there is nothing to wait for. */
bool drive_control_accepts_motion(const drive_control_t *self);

/** Sends the set-points of the cycle. */
void drive_control_send(drive_control_t *self, const cycle_t *cycle, const motion_output_t *output);

/** True if the bus has taken no set-points for so long that none can be expected to get through. */
bool drive_control_is_bus_stalled(const drive_control_t *self, uint32_t cycle_us);

#endif
