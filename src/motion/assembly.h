/* SPDX-License-Identifier: MIT
 * assembly.h - whether extensions that a sender gives one by one leave the platform an assembly that its cylinders hold: a pose
 * exists and has the least singularity margin (KIN_MARGIN_LEAST_Q32). Private to src/motion.
 */
#ifndef ASSEMBLY_H
#define ASSEMBLY_H

#include "heave/motion.h"

/** Whether a pose with the margin belongs to the extensions.
 *  @param is_beginning at the first target of a sender, as after a stop before a singularity, the first 5 mm of the straight way
 *  there have to be held too, so that a sender that insists does not make the platform try again */
bool assembly_is_held(const platform_t *self, bool is_beginning, const q32_t extension_mm_q32[CYLINDERS_MAX]);

/** Whether a stop begun a cycle from now would end in such an assembly, or in a better one than this where this is none already.
 *  On the way between two targets nothing else asks: cylinders that go straight in their own space may lead the plate anywhere.
 *  @param by what limits each cylinder now, and in its stop */
bool assembly_can_stop(const platform_t *self, const ramp_t *const by[CYLINDERS_MAX]);

#endif
