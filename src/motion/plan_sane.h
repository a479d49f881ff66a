/* SPDX-License-Identifier: MIT
 * plan_sane.h - whether plans that were loaded from a file may go on: moves, stops, fading, the spike filter; see sane.h. Pure;
 * private to src/motion.
 */
#ifndef PLAN_SANE_H
#define PLAN_SANE_H

#include "heave/motion.h"

/** The plan of the present source, and the stop if one is in progress; others are planned anew before they are used. */
bool plan_is_sane(const motion_t *saved);

/** A move of a path. */
bool plan_scurve_is_sane(const scurve_t *path);

/** A straight move. */
bool plan_straight_is_sane(const motion_straight_t *way);

/** Fading in. */
bool fade_is_sane(const fade_t *fade);

/** The spike filter. @param prepared after spike_filter_init() with the same settings */
bool spike_filter_is_sane(const spike_filter_t *saved, const spike_filter_t *prepared);

#endif
