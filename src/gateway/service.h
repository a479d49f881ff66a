/* SPDX-License-Identifier: MIT
 * service.h - the state SERVICE in deeds; see heave/service.h. Private to src/gateway.
 */
#ifndef GATEWAY_SERVICE_H
#define GATEWAY_SERVICE_H

#include "heave/gateway.h"

/** On entering SERVICE.
 *  @param has_torque the drives are up */
void service_begin(gateway_t *self, bool has_torque);

/** Once per cycle in SERVICE, before the motion: what the hand holds, and drives on their way up, down, or to their zero.
 *  @return a fault of a drive that took too long; FAULT_NONE */
fault_code_t service_step(gateway_t *self, uint64_t now_us);

/** Stops whatever the hand holds. */
void service_let_go(gateway_t *self);

/** True where drive i is meant to hold its position. */
bool service_is_up(const gateway_t *self, unsigned i);

/** The relays that are asked for in SERVICE. */
uint16_t service_relays(const gateway_t *self);

/** For the snapshot. */
void service_publish(gateway_t *self);

#endif
