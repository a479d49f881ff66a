/* SPDX-License-Identifier: MIT
 * telemetry_section.h - what the drives of a configuration are set up to tell beside their position.
 */
#ifndef HEAVE_PLATFORM_TELEMETRY_SECTION_H
#define HEAVE_PLATFORM_TELEMETRY_SECTION_H

#include "config/config.h"

/** Bits DRIVE_TELLS_... */
uint8_t config_telemetry(const config_t *config);

#endif
