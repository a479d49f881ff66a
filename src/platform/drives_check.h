/* SPDX-License-Identifier: MIT
 * drives_check.h - what is checked of drives in the same way, whether frames or registers carry their numbers. Each error
 * is reported at the key it concerns.
 */
#ifndef HEAVE_PLATFORM_DRIVES_CHECK_H
#define HEAVE_PLATFORM_DRIVES_CHECK_H

#include "config/source.h"

/** A field that carries a number; name: the key it is in, NULL where there is no such field. */
typedef struct {
    const char *name;
    int64_t min, max;
} config_drives_field_t;

/** The keys of one section that turn mm and deg into numbers. */
typedef struct {
    const char *section;
    const char *used_by; /**< who needs the section, in words */
    const config_ratios_t *counts_per_mm, *angle_counts_per_deg;
    const config_wholes_t *zero_counts;
    counts_scale_t (*scale)(const config_t *config, unsigned axis);
    config_drives_field_t position[2]; /**< of set-points and of feedback */
    config_drives_field_t speed;
    uint32_t speed_eighths; /**< of its limit that the speed field has to carry */
    uint32_t speed_counts;
    const config_ratios_t *speed_counts_per_mm_s, *angle_speed_counts_per_deg_s;
} config_drives_numbers_t;

/** True where a key that has to be there is.
 *  @param size 0: it is none */
bool config_drives_is_given(config_source_t *self, const char *section, const char *name, const char *used_by, unsigned size);

/** True where a list has one value, or one for each drive. */
bool config_drives_is_length(config_source_t *self, const char *section, const char *name, unsigned count, unsigned wanted);

/** Checks that every position within reach fits its fields: the first drive that does not fit speaks for the others. */
void config_drives_check_scales(config_source_t *self, const config_drives_numbers_t *numbers, unsigned cylinders);

/** Checks the keys of the speed field against each other, and that it carries the speed limits. */
void config_drives_check_speed(config_source_t *self, const config_drives_numbers_t *numbers, unsigned cylinders);

#endif
