/* SPDX-License-Identifier: MIT
 * view_trouble.h - what is wrong, in the table of a status.
 */
#ifndef HEAVE_HEAVECTL_VIEW_TROUBLE_H
#define HEAVE_HEAVECTL_VIEW_TROUBLE_H

#include "heavectl/view_lines.h"

/** The fault, with what led to it and what to do. */
void view_fault(view_t *self, const cJSON *status);

/** What the machine was never seen to do, and why the configuration that was applied last is not in force. */
void view_configuration(view_t *self, const cJSON *status);

#endif
