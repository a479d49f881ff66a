/* SPDX-License-Identifier: MIT
 * healthy_section.h - the healthy pulse of a configuration: what can be said of its line without looking at a chip.
 */
#ifndef HEAVE_PLATFORM_HEALTHY_SECTION_H
#define HEAVE_PLATFORM_HEALTHY_SECTION_H

#include "config/source.h"

/** Refuses a line that no chip can be found by, one that is used already, and a relay that does something else; reports into
 *  self. */
void config_healthy_check(config_source_t *self);

#endif
