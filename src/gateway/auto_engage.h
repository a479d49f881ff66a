/* SPDX-License-Identifier: MIT
 * auto_engage.h - the auto policy: once per start the platform engages by itself, at once or when a sender streams. Private to
 * src/gateway. Whatever an operator asks for, a fault or an e-stop ends it.
 */
#ifndef AUTO_ENGAGE_H
#define AUTO_ENGAGE_H

#include "heave/gateway.h"

/** @param cycle_us frames come at multiples of it
 *  @param frames valid frames within a second that it waits for, [0, AUTO_ENGAGE_FRAMES_MAX]; 0: none */
void auto_engage_init(auto_engage_t *self, bool is_due, uint32_t cycle_us, uint32_t frames);

/** A valid frame of the sender that drives. */
void auto_engage_frame(auto_engage_t *self, uint64_t now_us);

/** True where the platform may engage by itself now. */
bool auto_engage_is_ready(const auto_engage_t *self, uint64_t now_us);

/** It has been used, or somebody else decides from now on. */
void auto_engage_end(auto_engage_t *self);

#endif
