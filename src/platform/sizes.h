/* SPDX-License-Identifier: MIT
 * sizes.h - a platform by what people measure: radii, spread and turn of the joints, in place of joints one by one. What follows
 * is computed with the fixed-point functions of the core, so that every CPU comes to the same joints.
 */
#ifndef HEAVE_PLATFORM_SIZES_H
#define HEAVE_PLATFORM_SIZES_H

#include "config/source.h"

/** Radii, spreads and turns become joints; from then on there are joints alone. Reports into self. Before anything asks for
 * joints. */
void config_sizes_resolve(config_source_t *self);

/** A height at pose zero that the file leaves to the cylinders, half way out. The rest of the mechanism has to be right.
 *  Reports into self. */
void config_sizes_resolve_height(config_source_t *self);

#endif
