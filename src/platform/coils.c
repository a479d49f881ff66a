/* SPDX-License-Identifier: MIT
 * coils.c - relays on a Modbus board; see coils.h.
 */
#include "platform/coils.h"

#include <stdlib.h>
#include <string.h>

#define SECTION  "relays-modbus"
#define COIL_MAX 65535ul

/* Number of a coil; above COIL_MAX where the text is none. */
static unsigned long coil_of(const config_label_t *line)
{
    const size_t digits = strspn(line->text, "0123456789");
    return digits > 0 && digits <= 5 && line->text[digits] == '\0' ? strtoul(line->text, NULL, 10) : COIL_MAX + 1;
}

uint16_t config_coils_first(const config_t *config)
{
    return (uint16_t)coil_of(&config->relays.lines.line[0]);
}

/* One transaction writes them all, so that they change together: they follow each other. */
static void check_lines(config_source_t *self)
{
    const config_lines_t *lines = &self->config->relays.lines;
    if (lines->count == 0) {
        config_source_key_error(self, "relays", "lines", "driver modbus switches none; allowed: the coils of 1 to %u relays",
                                CONFIG_RELAYS_MAX);
    }
    for (unsigned i = 0; i < lines->count; i++) {
        if (coil_of(&lines->line[i]) > COIL_MAX) {
            config_source_key_error(self, "relays", "lines", "%s is no coil; allowed: numbers from 0 to %lu", lines->line[i].text,
                                    COIL_MAX);
            return;
        }
        if (i > 0 && coil_of(&lines->line[i]) != coil_of(&lines->line[i - 1u]) + 1u) {
            config_source_key_error(self, "relays", "lines",
                                    "%s does not follow %s; allowed: coils in a row, as one transaction writes them all",
                                    lines->line[i].text, lines->line[i - 1u].text);
            return;
        }
    }
}

static bool is_same_host(const config_host_t *a, const config_host_t *b)
{
    return strcmp(a->address, b->address) == 0 && a->port == b->port;
}

/* A drive that waits for relays, or relays for a drive, is what a line of its own avoids. */
static void check_own_line(config_source_t *self)
{
    const config_t *config = self->config;
    const config_relays_modbus_t *board = &config->relays_modbus;
    const config_hosts_t *drives = &config->modbus_tcp.hosts;
    const bool is_serial = board->hosts.count == 0;
    if (is_serial && config->drives == CONFIG_DRIVES_MODBUS_RTU && strcmp(board->serial.device, config->modbus_rtu.device) == 0) {
        config_source_key_error(self, SECTION, "device", "%s is the line of the drives; allowed: a line of its own",
                                board->serial.device);
    }
    for (unsigned i = 0; !is_serial && config->drives == CONFIG_DRIVES_MODBUS_TCP && i < drives->count; i++) {
        if (is_same_host(&board->hosts.host[0], &drives->host[i])) {
            config_source_key_error(self, SECTION, "host", "%s is that of drive %u; allowed: a host of its own",
                                    drives->host[i].address, i + 1u);
            return;
        }
    }
}

static void check_place(config_source_t *self)
{
    const config_relays_modbus_t *board = &self->config->relays_modbus;
    const bool has_device = strcmp(board->serial.device, "none") != 0;
    if (board->hosts.count > 1) {
        config_source_key_error(self, SECTION, "host", "has %u addresses; allowed: the one of the board",
                                (unsigned)board->hosts.count);
    } else if (board->hosts.count == 1 && has_device) {
        config_source_key_error(self, SECTION, "device", "the board has a host already; allowed: host or device");
    } else if (board->hosts.count == 0 && !has_device) {
        config_source_key_error(self, SECTION, "host", "missing; allowed: the board's address, or device with its serial port");
    } else if (board->hosts.count == 0 && board->unit > 247) {
        config_source_key_error(self, SECTION, "unit", "%u; allowed on a serial line: 1 to 247", (unsigned)board->unit);
    } else {
        check_own_line(self);
    }
}

void config_coils_check(config_source_t *self)
{
    if (self->config->relays.driver != CONFIG_RELAYS_MODBUS || !config_source_has_all(self, "relays") ||
        !config_source_has_all(self, SECTION)) {
        return;
    }
    check_lines(self);
    check_place(self);
}
