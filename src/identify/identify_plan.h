/* SPDX-License-Identifier: MIT
 * identify_plan.h - the signal that finds a response: its amplitude, band and time; and what cylinders make of a pose axis. Pure.
 */
#ifndef HEAVE_IDENTIFY_IDENTIFY_PLAN_H
#define HEAVE_IDENTIFY_IDENTIFY_PLAN_H

#include <stddef.h>

#include "identify/identify_report.h"

#define IDENTIFY_WHY_BYTES 192u
#define IDENTIFY_AFTER_MS  1000 /**< record so much longer than the signal: what lags comes to rest */

/** Whether an axis of the pose is in degrees. */
bool identify_is_rotation(const char *axis);

/** Fills in what is not wished for.
 *  @param report unit given; amplitude, from_hz, to_hz and seconds as wished, 0: as usual
 *  @param why out: why they do not go together, where it returns false */
bool identify_plan(identify_report_t *report, double cycle_s, char *why, size_t size);

/** What the cylinders make of a pose axis: their ways, each weighted by what the axis asks of it, as least squares have it. The
 *  samples' own pose is looked up every few cycles only, which would count as lag.
 *  @param sent,actual of each channel so many values; channel 0 is the pose, whose actual ones are written, the rest cylinders */
void identify_pose(double *const *sent, double *const *actual, unsigned channels, size_t count);

#endif
