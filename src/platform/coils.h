/* SPDX-License-Identifier: MIT
 * coils.h - relays on a Modbus board as the configuration has them: [relays] driver = modbus and [relays-modbus].
 */
#ifndef HEAVE_PLATFORM_COILS_H
#define HEAVE_PLATFORM_COILS_H

#include "config/source.h"

/** Coil of relay 1; the others follow it. Of a configuration that config_load() accepted. */
uint16_t config_coils_first(const config_t *config);

/** Checks both sections, where they are in use; reports into self. */
void config_coils_check(config_source_t *self);

#endif
