/* SPDX-License-Identifier: MIT
 * canraw.h - the section [can-raw] as the driver wants it, and what is checked of it.
 */
#ifndef HEAVE_CONFIG_CANRAW_H
#define HEAVE_CONFIG_CANRAW_H

#include "config/source.h"

/** Drives of the platform: its cylinders, then the rotation motor. */
uint8_t config_canraw_axes(const config_t *config);

/** Identifier of a drive.
 *  @param ids count 1 or that of the drives */
uint32_t config_canraw_id(const config_ids_t *ids, unsigned axis);

/** Counts of a drive per mm (deg), as the section has them; usable only where the lists have the right lengths. */
counts_scale_t config_canraw_scale(const config_t *config, unsigned axis);

/** The map of a configuration whose drives are CONFIG_DRIVES_CAN_RAW and that config_load() accepted. */
void config_canraw_map(const config_t *config, canraw_map_t *map);

/** Checks the section, where it is in use; reports into self. */
void config_canraw_check(config_source_t *self);

#endif
