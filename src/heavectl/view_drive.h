/* SPDX-License-Identifier: MIT
 * view_drive.h - what a drive is at, in the table of a status.
 */
#ifndef HEAVE_HEAVECTL_VIEW_DRIVE_H
#define HEAVE_HEAVECTL_VIEW_DRIVE_H

#include "heavectl/view_lines.h"

/** Its state, which ends the line of its cylinder, and a line for each thing more that it tells. */
void view_drive(view_t *self, const cJSON *axis);

/** Adds the object or register that a report is about, and what was found there. */
void view_drive_object(view_t *self, const cJSON *report);
void view_drive_detail(view_t *self, const cJSON *report);

#endif
