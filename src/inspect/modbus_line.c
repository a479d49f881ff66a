/* SPDX-License-Identifier: MIT
 * modbus_line.c - see modbus_line.h.
 */
#include "inspect/modbus_line.h"

#define BROADCAST_US 20000u /* after a broadcast, for drives to act */

static linux_modbus_config_t line_of(const config_host_t *host, const config_modbus_rtu_t *serial)
{
    static const char k_parities[] = {'N', 'E', 'O'};
    if (host != NULL) {
        return (linux_modbus_config_t){.host = host->address, .port = host->port};
    }
    return (linux_modbus_config_t){.device = serial->device,
                                   .baud_bps = serial->baud_bps,
                                   .parity = k_parities[serial->parity],
                                   .stop_bits = serial->stop_bits,
                                   .direction = (linux_modbus_direction_t)serial->rs485,
                                   .direction_delay_us = serial->rs485_delay_us};
}

linux_modbus_config_t modbus_line_of_drives(const config_t *config, unsigned line)
{
    const bool is_tcp = config->drives == CONFIG_DRIVES_MODBUS_TCP;
    linux_modbus_config_t modbus = line_of(is_tcp ? &config->modbus_tcp.hosts.host[line] : NULL, &config->modbus_rtu);
    modbus.timeout_us = config->modbus.timeout_ms * 1000u;
    modbus.broadcast_pause_us = BROADCAST_US;
    return modbus;
}

linux_modbus_config_t modbus_line_of_relays(const config_relays_modbus_t *board)
{
    linux_modbus_config_t modbus = line_of(board->hosts.count != 0 ? &board->hosts.host[0] : NULL, &board->serial);
    modbus.timeout_us = board->timeout_ms * 1000u;
    return modbus;
}
