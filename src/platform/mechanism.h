/* SPDX-License-Identifier: MIT
 * mechanism.h - a pose against the usable stroke of every cylinder: what both the checks and the report ask.
 */
#ifndef HEAVE_PLATFORM_MECHANISM_H
#define HEAVE_PLATFORM_MECHANISM_H

#include "config/source.h"
#include "heave/kin.h"
#include "heave/settings.h"

/** First cylinder that a pose takes out of [margin, stroke - margin]; the number of cylinders where it takes none.
 *  @param extension_mm_q32 out: the extension of that cylinder */
unsigned config_mechanism_find_outside(const settings_t *settings, const kin_t *kin, const pose_t *pose, q16_t margin_mm_q16,
                                       q32_t *extension_mm_q32);

/** Checks the mechanism; everything else has to be right. */
void config_check_mechanism(config_source_t *self);

#endif
