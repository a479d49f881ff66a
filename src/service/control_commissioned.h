/* SPDX-License-Identifier: MIT
 * control_commissioned.h - whether somebody has seen this machine rise as it should. What a file and the drives do not show
 * (exchanged cables, a wrong lead, an encoder that is off) shows when the platform rises. Until somebody has looked, and after
 * every change of the keys that describe the machine, it rises slowly.
 */
#ifndef HEAVE_SERVICE_CONTROL_COMMISSIONED_H
#define HEAVE_SERVICE_CONTROL_COMMISSIONED_H

#include "service/control.h"
#include "service/lifetime.h"

#define CONTROL_COMMISSIONED_SAID_MAX 800u

/** Answers `commissioned`: refused where nothing waits for it, and before the platform has risen since the start of heaved. */
void control_commissioned_accept(control_t *self, control_client_t *client);

/** Keeps what somebody has said, and finds whether the platform is to rise slowly. Drives that are simulated are never waited
 * for, nor is anything where nothing is kept ([platform] life_file). The service thread, often; for the first time before the
 * motion thread starts.
 *  @param said out: what is new, for the log
 *  @return true where something is */
bool control_commissioned_watch(control_t *self, lifetime_t *life, const config_t *config,
                                char said[CONTROL_COMMISSIONED_SAID_MAX]);

#endif
