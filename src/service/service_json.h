/* SPDX-License-Identifier: MIT
 * service_json.h - SERVICE as JSON: what a hand needs to know, and what the drives count. Pure.
 */
#ifndef HEAVE_SERVICE_JSON_H
#define HEAVE_SERVICE_JSON_H

#include "service/status_json.h"
#include "common/json.h"
#include "heave/telemetry.h"

/** Members of an open object: the tick to echo, and what is held. */
void service_json_hand(json_t *json, const snapshot_t *snapshot);

/** A member of an open object, an array: each drive's own count, before there is torque too. */
void service_json_drives(json_t *json, const snapshot_t *snapshot);

/** When a self-test is asked for, whether one is due, and what came of the newest: member `selftest`. */
void service_json_selftest(json_t *json, const status_lost_t *lost, const config_t *config);

#endif
