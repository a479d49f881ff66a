/* SPDX-License-Identifier: MIT
 * control_selftest.h - self-tests as others see and report them: requests of the control socket, and when one is due.
 */
#ifndef HEAVE_SERVICE_CONTROL_SELFTEST_H
#define HEAVE_SERVICE_CONTROL_SELFTEST_H

#include "service/control.h"
#include "service/lifetime.h"

/** Answers `selftest`: what there is to look at, what is allowed, and what is known of the newest one. */
void control_selftest_answer(control_t *self, control_client_t *client);

/** What came of a self-test. Who said it is in the operator log. */
void control_selftest_pass(control_t *self, control_client_t *client);
void control_selftest_fail(control_t *self, control_client_t *client);

/** Keeps what somebody has said of a self-test, and finds whether one is due on this day of the local calendar, whichever way the
 * clock went. The service thread, often.
 *  @param said out: who said what, for the log
 *  @return true where there is something for the log */
bool control_selftest_watch(control_t *self, lifetime_t *life, const config_t *config, char said[128]);

#endif
