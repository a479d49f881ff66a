/* SPDX-License-Identifier: MIT
 * scaling.h - from mm to counts, whichever driver is in use: counts_per_mm as the file gives it, or what follows from the screw,
 * the gear and the encoder.
 */
#ifndef HEAVE_PLATFORM_SCALING_H
#define HEAVE_PLATFORM_SCALING_H

#include "config/source.h"
#include "heave/counts.h"

/** Turns lead_mm, counts_per_turn and gear of [drives] into counts_per_mm of the driver in use, and takes lead and gear out: from
 *  then on there is one scaling, however it was written. Reports into self. */
void config_scaling_resolve(config_source_t *self);

/** Refuses a stroke of next to no counts. */
void config_scaling_check(config_source_t *self);

/** The scale of a cylinder.
 *  @return false: simulated drives, which have none */
bool config_scaling_of(const config_t *config, unsigned cylinder, counts_scale_t *scale);

/** Writes what the scaling comes to, a line for all cylinders, or for each where they differ. */
void config_scaling_report(const config_t *config, FILE *out);

#endif
