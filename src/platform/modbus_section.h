/* SPDX-License-Identifier: MIT
 * modbus_section.h - the sections [modbus], [modbus-tcp] and [modbus-rtu] as the driver and its lines want them, and what is
 * checked of them.
 */
#ifndef HEAVE_PLATFORM_MODBUS_SECTION_H
#define HEAVE_PLATFORM_MODBUS_SECTION_H

#include "config/source.h"

/** True where the drives are on Modbus. */
bool config_modbus_is_used(const config_t *config);

/** Lines: one for each drive where each has a host of its own, else one for all. */
uint8_t config_modbus_lines(const config_t *config);

/** Unit id of a drive. */
uint32_t config_modbus_unit(const config_t *config, unsigned axis);

/** Counts of a drive per mm (deg); usable only where the lists have the right lengths. */
counts_scale_t config_modbus_scale(const config_t *config, unsigned axis);

/** How long transactions take. */
modbus_drive_timing_t config_modbus_timing(const config_t *config);

/** The map of a configuration whose drives are on Modbus and that config_load() accepted. */
void config_modbus_map(const config_t *config, modbus_drive_map_t *map);

/** Checks the sections that are in use; reports errors into self. */
void config_modbus_check(config_source_t *self);

/** Writes what the lines can carry. */
void config_modbus_report(const config_t *config, FILE *out);

#endif
