/* SPDX-License-Identifier: MIT
 * reports.h - what the drives are at, in words: into the snapshot, and into the log when a drive gets into trouble or out of it.
 */
#ifndef GATEWAY_REPORTS_H
#define GATEWAY_REPORTS_H

#include "heave/gateway.h"

/** Once per cycle. Drivers that tell nothing leave the texts empty. */
void reports_take(gateway_t *self);

#endif
