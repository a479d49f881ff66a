/* SPDX-License-Identifier: MIT
 * service_json.h - the state SERVICE as JSON: what a client that holds a motion needs to know, and the counts of the drives.
 * Pure.
 */
#ifndef HEAVE_SERVICE_JSON_H
#define HEAVE_SERVICE_JSON_H

#include "service/status_json.h"
#include "common/json.h"
#include "heave/telemetry.h"

/** Adds to an open object: the tick to send back, and what is held. */
void service_json_hand(json_t *json, const snapshot_t *snapshot);

/** Adds the array `drives` to an open object: state and raw count of each drive, also while it has no torque. */
void service_json_drives(json_t *json, const snapshot_t *snapshot);

/** Adds the object `selftest`: when a self-test is required, whether one is due, and the result of the newest one. */
void service_json_selftest(json_t *json, const status_lost_t *lost, const config_t *config);

#endif
