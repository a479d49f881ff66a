/* SPDX-License-Identifier: MIT
 * canraw_section.h - the section [can-raw] as the driver wants it, and what is checked of it.
 */
#ifndef HEAVE_PLATFORM_CANRAW_SECTION_H
#define HEAVE_PLATFORM_CANRAW_SECTION_H

#include "config/source.h"

/** Drives of the platform: its cylinders, then the rotation motor. */
uint8_t config_canraw_axes(const config_t *config);

/** Identifier of a drive.
 *  @param ids count 1 or that of the drives */
uint32_t config_canraw_id(const config_ids_t *ids, unsigned axis);

/** Identifier of a frame that so many drives may share (0: none): a single one in ids is that of the first of them. */
uint32_t config_canraw_shared_id(const config_ids_t *ids, unsigned axis, unsigned slots);

/** Identifier of the set-points of a drive. */
uint32_t config_canraw_setpoint_id(const config_can_raw_t *raw, unsigned axis);

/** Identifier of the replies of a drive. */
uint32_t config_canraw_reply_id(const config_can_raw_t *raw, unsigned axis);

/** Identifier of the status of a drive, where it comes apart. */
uint32_t config_canraw_status_id(const config_can_raw_t *raw, unsigned axis);

/** The frame that tells the status, and its key. */
const canraw_frame_t *config_canraw_status_frame(const config_can_raw_t *raw, const char **name);

/** True where the section has frames for command_id beside set-points. */
bool config_canraw_has_commands(const config_can_raw_t *raw);

/** Counts of a drive per mm (deg), as the section has them; usable only where the lists have the right lengths. */
counts_scale_t config_canraw_scale(const config_t *config, unsigned axis);

/** The map of a configuration whose drives are CONFIG_DRIVES_CAN_RAW and that config_load() accepted. */
void config_canraw_map(const config_t *config, canraw_map_t *map);

/** Checks the section, where it is in use; reports into self. */
void config_canraw_check(config_source_t *self);

#endif
