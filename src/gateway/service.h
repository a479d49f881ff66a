/* SPDX-License-Identifier: MIT
 * service.h - the state SERVICE in deeds; see heave/service.h. Private to src/gateway.
 */
#ifndef GATEWAY_SERVICE_H
#define GATEWAY_SERVICE_H

#include "cycle.h"

/** On entering SERVICE.
 *  @param has_torque the drives are up */
void service_begin(service_t *self, const cycle_t *cycle, bool has_torque);

/** Once per cycle in SERVICE, before the motion: what the hand holds, and drives on their way up, down, or to their zero.
 *  @return a fault of a drive that took too long; FAULT_NONE */
fault_code_t service_step(service_t *self, const cycle_t *cycle);

/** Stops whatever the hand holds. */
void service_let_go(service_t *self, motion_t *motion);

/** In SERVICE, see gateway_service(). */
service_answer_t service_request(service_t *self, const cycle_t *cycle, const service_request_t *request);

/** Drives that are meant to hold their position: bit i for axis i + 1. */
uint32_t service_up(const service_t *self);

/** The relays that are asked for in SERVICE. */
uint16_t service_relays(const service_t *self, uint16_t safe_mask);

/** For the snapshot. */
void service_publish(const service_t *self, const cycle_t *cycle, service_view_t *view);

#endif
