/* SPDX-License-Identifier: MIT
 * report_json.h - what a drive tells of itself, as members of the status.
 */
#ifndef HEAVE_SERVICE_REPORT_JSON_H
#define HEAVE_SERVICE_REPORT_JSON_H

#include "common/json.h"
#include "heave/drives.h"

/** A time that something has passed since; null where it has not happened. */
void report_json_age(json_t *json, const char *key, uint64_t at_us, uint64_t now_us);

/** Member `report`: what the drive is at, in words; null where its driver has none.
 *  @param is_angle the rotation motor, in deg */
void report_json(json_t *json, const drive_report_t *report, bool is_angle, uint64_t now_us);

#endif
