/* SPDX-License-Identifier: MIT
 * limits.h - limits of axes that the file does not give: those that --check suggests take their place, what each axis alone can
 * do with these cylinders.
 */
#ifndef HEAVE_PLATFORM_LIMITS_H
#define HEAVE_PLATFORM_LIMITS_H

#include "config/source.h"

/** True where a limit of the axis was left out and is not filled in yet. */
bool config_limits_is_open(const axis_settings_t *axis);

/** Axes that the platform does not have are all 0, as nothing reads them. */
void config_limits_clear_absent(config_t *config);

/** Fills in every limit that was left out; everything else has to be right.
 *  @return true where there was one */
bool config_limits_fill(config_t *config);

#endif
