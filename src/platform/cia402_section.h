/* SPDX-License-Identifier: MIT
 * cia402_section.h - converts the section [cia402] into the configuration of the driver, and checks it.
 */
#ifndef HEAVE_PLATFORM_CIA402_SECTION_H
#define HEAVE_PLATFORM_CIA402_SECTION_H

#include "config/source.h"
#include "heave/cia402.h"

/** Counts of a drive per mm (deg); valid only if the lists have the right lengths. */
counts_scale_t config_cia402_scale(const config_t *config, unsigned axis);

/** Node of a drive, and its axis there, from 0. */
uint32_t config_cia402_node(const config_t *config, unsigned axis);
uint32_t config_cia402_channel(const config_t *config, unsigned axis);

/** Mode of the set-points of a drive. */
cia402_mode_t config_cia402_mode(const config_t *config, unsigned axis);

/** How far a cylinder's drive is behind set-points in profile position: it is always about to stop at the last one that it took.
 *  @return mm */
q32_t config_cia402_pp_lag_q32(const config_t *config, q16_t speed_mm_s_q16);

/** The drives of a configuration whose drives are CONFIG_DRIVES_CIA402 and that config_load() accepted. */
void config_cia402(const config_t *config, cia402_config_t *out);

/** Checks the section, where it is in use; reports into self. */
void config_cia402_check(config_source_t *self);

#endif
