/* SPDX-License-Identifier: MIT
 * selftest_seen.h - what an answer of heaved shows of switches and drives while a self-test waits for it.
 */
#ifndef HEAVE_HEAVECTL_SELFTEST_SEEN_H
#define HEAVE_HEAVECTL_SELFTEST_SEEN_H

#include <cjson/cJSON.h>
#include <stdbool.h>

/** Of a status: the e-stop is pressed, or released. */
bool selftest_is_estop(const cJSON *status);
bool selftest_is_no_estop(const cJSON *status);

/** The supply is failing, or well again. */
bool selftest_is_failing(const cJSON *status);
bool selftest_is_supplied(const cJSON *status);

/** The platform is not in SERVICE. */
bool selftest_is_out(const cJSON *status);

/** Of counts: every drive has torque, or its zero. */
bool selftest_has_torque(const cJSON *counts);
bool selftest_is_homed(const cJSON *counts);

#endif
