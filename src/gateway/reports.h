/* SPDX-License-Identifier: MIT
 * reports.h - what the drives are at, in words: into the snapshot, and into the log when a drive gets into trouble or out of it.
 */
#ifndef GATEWAY_REPORTS_H
#define GATEWAY_REPORTS_H

#include "heave/gateway.h"

/** Once per cycle. Drivers that tell nothing leave the texts empty.
 *  @param shown in: the reports of the last cycle; out: the present ones */
void reports_step(reports_t *self, drives_t drives, hal_log_t log, uint64_t now_us, drive_report_t shown[DRIVES_MAX]);

#endif
