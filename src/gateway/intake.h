/* SPDX-License-Identifier: MIT
 * intake.h - datagrams to targets and relay masks: what the platform accepts, counters, and what is logged of the rest.
 * Private to src/gateway.
 */
#ifndef INTAKE_H
#define INTAKE_H

#include "heave/gateway.h"

/** Reads what has arrived (at most GATEWAY_DATAGRAMS_PER_CYCLE) and carries out every good frame. */
void intake_receive(gateway_t *self, uint64_t now_us);

#endif
