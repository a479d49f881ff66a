/* SPDX-License-Identifier: MIT
 * platform.h - one platform as constant tables, where a PC would read a configuration file.
 */
#ifndef PLATFORM_H
#define PLATFORM_H

#include "heave/cia402.h"
#include "heave/settings.h"

extern const settings_t k_platform;
extern const cia402_config_t k_platform_drives;

#endif
