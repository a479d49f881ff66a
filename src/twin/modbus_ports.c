/* SPDX-License-Identifier: MIT
 * modbus_ports.c - the lines of Modbus; see modbus_ports.h.
 */
#include "twin/modbus_ports.h"

#include <arpa/inet.h>
#include <errno.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "platform/modbus_section.h"
#include "twin/pty.h"

#define HEAD_TCP 7u /* transaction, protocol, length, unit */
#define CRC_SIZE 2u
#define GAP_US   100000u /* a frame that is not whole by then never will be */
#define BACKLOG  2

/* --- Opening --- */

static bool open_door(modbus_port_t *self, char why[MODBUS_WHY_MAX])
{
    struct sockaddr_in address = {.sin_family = AF_INET, .sin_port = htons(self->host.port)};
    const int yes = 1;
    const char *name = self->host.address;
    self->door = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    if (self->door < 0 || inet_pton(AF_INET, name, &address.sin_addr) != 1) {
        (void)snprintf(why, MODBUS_WHY_MAX, "%s:%u: %s", name, self->host.port, strerror(errno));
        return false;
    }
    (void)setsockopt(self->door, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
    if (bind(self->door, (const struct sockaddr *)&address, sizeof address) == 0 && listen(self->door, BACKLOG) == 0) {
        return true;
    }
    const char *help = errno == EADDRNOTAVAIL
                           ? "; take 127.0.0.1 and a port of its own for each, as 127.0.0.1:15021, in a copy of the file"
                       : errno == EACCES ? "; ports below 1024 are root's, others are written as 127.0.0.1:15021"
                                         : "";
    (void)snprintf(why, MODBUS_WHY_MAX, "%s:%u: %s%s", name, self->host.port, strerror(errno), help);
    return false;
}

/* A serial line is always a pseudo terminal of our own. */
static bool is_of_this_machine(const modbus_port_t *self, char why[MODBUS_WHY_MAX])
{
    const bool is_loopback = self->is_serial || strncmp(self->host.address, "127.", 4) == 0;
    if (!is_loopback) {
        (void)snprintf(
            why, MODBUS_WHY_MAX,
            "%s:%u: on a network that may have real drives. Take 127.0.0.1 and a port of its own for each in a copy of "
            "the file; --on-real-bus where no drive is on it",
            self->host.address, self->host.port);
    }
    return is_loopback;
}

static bool open_port(modbus_port_t *self, char why[MODBUS_WHY_MAX])
{
    if (!self->is_serial) {
        return open_door(self, why);
    }
    self->has_link = pty_open(self->device, &self->talk, &self->door, why, MODBUS_WHY_MAX);
    return self->has_link;
}

static modbus_port_t *add(modbus_ports_t *self, unsigned line)
{
    modbus_port_t *port = &self->port[self->count++];
    *port = (modbus_port_t){.line = line, .door = -1, .talk = -1};
    return port;
}

static bool add_serial(modbus_ports_t *self, unsigned line, const config_modbus_rtu_t *serial, const char *section,
                       char why[MODBUS_WHY_MAX])
{
    modbus_port_t *port = add(self, line);
    port->is_serial = true;
    (void)snprintf(port->device, sizeof port->device, "%s", serial->device);
    if (serial->parity != CONFIG_PARITY_NONE) {
        (void)snprintf(why, MODBUS_WHY_MAX, "%s parity: a pseudo terminal has none; write parity = none in a copy of the file",
                       section);
        return false;
    }
    return true;
}

bool modbus_ports_open(modbus_ports_t *self, const config_t *config, bool is_real_allowed, char why[MODBUS_WHY_MAX])
{
    bool is_open = true;
    *self = (modbus_ports_t){0};
    if (config->drives == CONFIG_DRIVES_MODBUS_RTU) {
        is_open = add_serial(self, 0, &config->modbus_rtu, "[modbus-rtu]", why);
    } else if (config->drives == CONFIG_DRIVES_MODBUS_TCP) {
        for (unsigned i = 0; i < config_modbus_lines(config); i++) {
            add(self, i)->host = config->modbus_tcp.hosts.host[i];
        }
    }
    if (config->relays.driver == CONFIG_RELAYS_MODBUS) {
        if (config->relays_modbus.hosts.count > 0) {
            add(self, MODBUS_BOARD_LINE)->host = config->relays_modbus.hosts.host[0];
        } else {
            is_open = add_serial(self, MODBUS_BOARD_LINE, &config->relays_modbus.serial, "[relays-modbus]", why) && is_open;
        }
    }
    for (unsigned i = 0; i < self->count && is_open && !is_real_allowed; i++) {
        is_open = is_of_this_machine(&self->port[i], why);
    }
    for (unsigned i = 0; i < self->count && is_open; i++) {
        is_open = open_port(&self->port[i], why);
    }
    return is_open;
}

static void hang_up(modbus_port_t *self)
{
    if (self->talk >= 0) {
        (void)close(self->talk);
    }
    self->talk = -1;
    self->length = self->helds = 0;
}

static void close_port(modbus_port_t *self)
{
    hang_up(self);
    if (self->door >= 0) {
        (void)close(self->door);
    }
    if (self->has_link) {
        (void)unlink(self->device);
    }
    self->door = -1;
    self->has_link = false;
}

void modbus_ports_close(modbus_ports_t *self)
{
    for (unsigned i = 0; i < self->count; i++) {
        close_port(&self->port[i]);
    }
    self->count = 0;
}

void modbus_ports_describe(const modbus_ports_t *self, FILE *out)
{
    for (unsigned i = 0; i < self->count; i++) {
        const modbus_port_t *port = &self->port[i];
        const char *who = port->line == MODBUS_BOARD_LINE ? "relays" : "drives";
        if (port->is_serial) {
            char terminal[64] = "?";
            (void)ttyname_r(port->door, terminal, sizeof terminal);
            fprintf(out, "heave-twin: %s on %s, which is %s\n", who, port->device, terminal);
        } else {
            fprintf(out, "heave-twin: %s on %s:%u\n", who, port->host.address, port->host.port);
        }
    }
}

unsigned modbus_ports_watch(const modbus_ports_t *self, struct pollfd fds[MODBUS_PORTS_FDS_MAX])
{
    unsigned count = 0;
    for (unsigned i = 0; i < self->count; i++) {
        const modbus_port_t *port = &self->port[i];
        if (port->door >= 0 && !port->is_serial) {
            fds[count++] = (struct pollfd){.fd = port->door, .events = POLLIN};
        }
        if (port->talk >= 0) {
            fds[count++] = (struct pollfd){.fd = port->talk, .events = POLLIN};
        }
    }
    return count;
}

uint64_t modbus_ports_due_us(const modbus_ports_t *self)
{
    uint64_t due_us = UINT64_MAX;
    for (unsigned i = 0; i < self->count; i++) {
        const modbus_port_t *port = &self->port[i]; /* the first that is held goes before the others, however late it is */
        due_us = port->helds > 0 && port->held[0].due_us < due_us ? port->held[0].due_us : due_us;
    }
    return due_us;
}

/* --- Frames --- */

static unsigned crc16(const uint8_t *bytes, unsigned length)
{
    unsigned crc = 0xFFFF;
    for (unsigned i = 0; i < length; i++) {
        crc ^= bytes[i];
        for (unsigned bit = 0; bit < 8; bit++) {
            crc = (crc & 1u) != 0 ? crc >> 1 ^ 0xA001u : crc >> 1;
        }
    }
    return crc;
}

/* Length of the first question in what was heard; 0: not whole yet. More than was heard is never returned. */
static unsigned first_length(const modbus_port_t *self)
{
    unsigned length = 0;
    if (!self->is_serial) {
        length = self->length >= HEAD_TCP ? 6u + ((unsigned)self->heard[4] << 8 | self->heard[5]) : MODBUS_FRAME_MAX + 1u;
    } else if (self->length >= HEAD_TCP) {
        const uint8_t function = self->heard[1];
        length = function == MODBUS_WRITE_COILS || function == MODBUS_WRITE_REGISTERS ? 9u + self->heard[6] : 8u;
    }
    return length != 0 && length <= self->length ? length : 0;
}

static void put(modbus_port_t *self, const uint8_t *bytes, unsigned length)
{
    (void)!write(self->talk, bytes, length); /* a master that takes nothing has left */
}

static void answer(modbus_port_t *self, const uint8_t *bytes, unsigned length, const modbus_way_t *way, uint64_t now_us)
{
    if (way->late_us == 0 && self->helds == 0) {
        put(self, bytes, length);
    } else if (self->helds < MODBUS_HELD_MAX) { /* behind those that are late already: a device answers in turn */
        modbus_held_t *held = &self->held[self->helds++];
        held->due_us = now_us + way->late_us;
        held->length = length;
        memcpy(held->bytes, bytes, length);
    }
}

static void put_late(modbus_port_t *self, uint64_t now_us)
{
    while (self->helds > 0 && now_us >= self->held[0].due_us) {
        put(self, self->held[0].bytes, self->held[0].length);
        memmove(self->held, self->held + 1, --self->helds * sizeof self->held[0]);
    }
}

static void ask_serial(modbus_port_t *self, modbus_side_t *side, unsigned length, uint64_t now_us)
{
    uint8_t out[MODBUS_FRAME_MAX];
    modbus_way_t way;
    const unsigned body = length - CRC_SIZE;
    if (crc16(self->heard, body) != ((unsigned)self->heard[body] | (unsigned)self->heard[body + 1] << 8)) {
        self->length = 0; /* noise: nobody answers, and the master begins anew */
        return;
    }
    unsigned said = modbus_side_ask(side, self->line, self->heard[0], self->heard + 1, body - 1, now_us, out + 1, &way);
    if (said == 0) {
        return;
    }
    out[0] = self->heard[0];
    said++;
    const unsigned crc = crc16(out, said) ^ (way.is_damaged ? 0x1000u : 0u);
    out[said++] = (uint8_t)crc;
    out[said++] = (uint8_t)(crc >> 8);
    answer(self, out, way.is_half ? said / 2 : said, &way, now_us);
}

static void ask_tcp(modbus_port_t *self, modbus_side_t *side, unsigned length, uint64_t now_us)
{
    uint8_t out[MODBUS_FRAME_MAX];
    modbus_way_t way;
    unsigned said = modbus_side_ask(side, self->line, self->heard[6], self->heard + HEAD_TCP, length - HEAD_TCP, now_us,
                                    out + HEAD_TCP, &way);
    if (said == 0) {
        return;
    }
    memcpy(out, self->heard, 4);
    out[4] = (uint8_t)((said + 1) >> 8);
    out[5] = (uint8_t)(said + 1);
    out[6] = self->heard[6];
    out[HEAD_TCP] = (uint8_t)(out[HEAD_TCP] ^ (way.is_damaged ? 0x40u : 0u));
    said += HEAD_TCP;
    answer(self, out, way.is_half ? said / 2 : said, &way, now_us);
}

static void ask(modbus_port_t *self, modbus_side_t *side, uint64_t now_us)
{
    unsigned length = 0;
    while (self->talk >= 0 && (length = first_length(self)) != 0) {
        if (!self->is_serial && (length < HEAD_TCP + 1 || self->heard[2] != 0 || self->heard[3] != 0)) {
            hang_up(self); /* not Modbus */
            return;
        }
        if (self->is_serial) {
            ask_serial(self, side, length, now_us);
        } else {
            ask_tcp(self, side, length, now_us);
        }
        const unsigned used = length < self->length ? length : self->length;
        memmove(self->heard, self->heard + used, self->length - used);
        self->length -= used;
    }
}

static void hear(modbus_port_t *self, modbus_side_t *side, uint64_t now_us)
{
    if (self->is_serial && self->length > 0 && now_us > self->heard_us + GAP_US) {
        self->length = 0;
    }
    while (self->talk >= 0 && self->length < MODBUS_FRAME_MAX) {
        const ssize_t got = read(self->talk, self->heard + self->length, MODBUS_FRAME_MAX - self->length);
        if (got <= 0) {
            if (!self->is_serial && (got == 0 || (errno != EAGAIN && errno != EINTR))) {
                hang_up(self);
            }
            return;
        }
        self->length += (unsigned)got;
        self->heard_us = now_us;
        ask(self, side, now_us);
        if (self->length == MODBUS_FRAME_MAX) {
            self->length = 0; /* no frame is so long */
        }
    }
}

/* A master that comes takes the place of the one before. */
static void accept_master(modbus_port_t *self)
{
    const int yes = 1;
    const int fresh = self->is_serial || self->door < 0 ? -1 : accept4(self->door, NULL, NULL, SOCK_NONBLOCK | SOCK_CLOEXEC);
    if (fresh >= 0) {
        hang_up(self);
        (void)setsockopt(fresh, IPPROTO_TCP, TCP_NODELAY, &yes, sizeof yes);
        self->talk = fresh;
    }
}

void modbus_ports_serve(modbus_ports_t *self, modbus_side_t *side, uint64_t now_us)
{
    char why[MODBUS_WHY_MAX];
    for (unsigned i = 0; i < self->count; i++) {
        modbus_port_t *port = &self->port[i];
        if (side->is_unplugged) {
            close_port(port);
            continue;
        }
        if (port->door < 0 && !open_port(port, why)) { /* it tries again */
            close_port(port);
            continue;
        }
        accept_master(port);
        hear(port, side, now_us);
        if (port->talk >= 0) {
            put_late(port, now_us);
        }
    }
}
