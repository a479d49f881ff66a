/* SPDX-License-Identifier: MIT
 * linux_modbus_config.c - what a Modbus line can be; see linux_modbus_link.h.
 */
#include <arpa/inet.h>
#include <string.h>

#include "linux_modbus_link.h"

#define TIMEOUT_MOST_US 10000000u

/* libmodbus takes any other rate for 9600. */
static bool is_rate(uint32_t bps)
{
    static const uint32_t k_rates[] = {1200,   2400,   4800,   9600,    19200,   38400,   57600,   115200,  230400,  460800,
                                       500000, 576000, 921600, 1000000, 1152000, 1500000, 2500000, 3000000, 3500000, 4000000};
    for (size_t i = 0; i < sizeof k_rates / sizeof k_rates[0]; i++) {
        if (k_rates[i] == bps) {
            return true;
        }
    }
    return false;
}

static const char *wrong_in_serial(const linux_modbus_config_t *config)
{
    if (config->device == NULL || config->device[0] == '\0' || strlen(config->device) >= LINUX_MODBUS_NAME_SIZE) {
        return "the device has to be a path such as /dev/serial/by-id/...";
    }
    if (!is_rate(config->baud_bps)) {
        return "the bit rate has to be one that Linux has, such as 9600, 19200, 38400, 57600 or 115200";
    }
    if (config->parity != 'N' && config->parity != 'E' && config->parity != 'O') {
        return "the parity has to be N, E or O";
    }
    if (config->stop_bits != 1 && config->stop_bits != 2) {
        return "the stop bits have to be 1 or 2";
    }
    return config->direction_delay_us <= 10000 ? NULL : "the direction delay has to be within 0 and 10000 us";
}

static const char *wrong_in_tcp(const linux_modbus_config_t *config)
{
    struct in_addr address;
    if (inet_pton(AF_INET, config->host, &address) != 1) {
        return "the host has to be an IPv4 address in numbers, such as 192.168.1.20";
    }
    return config->port != 0 ? NULL : "the port has to be within 1 and 65535";
}

const char *linux_modbus_config_find_wrong(const linux_modbus_config_t *config)
{
    if (config->timeout_us < 1000 || config->timeout_us > TIMEOUT_MOST_US) {
        return "the timeout has to be within 1000 and 10000000 us";
    }
    if (config->broadcast_pause_us > 999999) {
        return "the pause after a broadcast has to be within 0 and 999999 us";
    }
    return config->host != NULL ? wrong_in_tcp(config) : wrong_in_serial(config);
}
