/* SPDX-License-Identifier: MIT
 * modbus_line.h - Modbus lines of a configuration as the Linux backend wants them.
 */
#ifndef HEAVE_INSPECT_MODBUS_LINE_H
#define HEAVE_INSPECT_MODBUS_LINE_H

#include "config/config.h"
#include "linux_modbus_link.h"

/** One of config_modbus_lines(). The texts are those of config. */
linux_modbus_config_t modbus_line_of_drives(const config_t *config, unsigned line);

/** The line of a board of relays. */
linux_modbus_config_t modbus_line_of_relays(const config_relays_modbus_t *board);

#endif
