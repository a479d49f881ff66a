/* SPDX-License-Identifier: MIT
 * modbus_server.c - a Modbus server made from libmodbus; see modbus_server.h.
 */
#include "modbus_server.h"

#include <arpa/inet.h>
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

#define VALUES     128
#define WATCH_MS   50 /* how often the thread looks whether it shall end */
#define BITS_8N1   10u
#define FRAME_MAX  260
#define CRC_LENGTH 2

/* --- Frames --- */

/* What a serial question is long, from its first seven characters. */
static int question_length(const uint8_t *frame)
{
    const bool has_values = frame[1] == MODBUS_FC_WRITE_MULTIPLE_COILS || frame[1] == MODBUS_FC_WRITE_MULTIPLE_REGISTERS;
    return has_values ? 7 + frame[6] + CRC_LENGTH : 6 + CRC_LENGTH;
}

static int answer_length(const uint8_t *frame)
{
    const int count = frame[4] << 8 | frame[5];
    switch (frame[1]) {
    case MODBUS_FC_READ_COILS:
    case MODBUS_FC_READ_DISCRETE_INPUTS:
        return 3 + (count + 7) / 8 + CRC_LENGTH;
    case MODBUS_FC_READ_HOLDING_REGISTERS:
    case MODBUS_FC_READ_INPUT_REGISTERS:
        return 3 + 2 * count + CRC_LENGTH;
    default:
        return 6 + CRC_LENGTH;
    }
}

/* false: nothing more comes, or the server ends. */
static bool is_readable(modbus_server_t *self, int fd)
{
    struct pollfd watched = {.fd = fd, .events = POLLIN};
    while (__atomic_load_n(&self->is_ending, __ATOMIC_ACQUIRE) == 0) {
        if (poll(&watched, 1, WATCH_MS) > 0 && (watched.revents & POLLIN) != 0) {
            return true;
        }
        if ((watched.revents & POLLHUP) != 0) {
            /* a pseudo terminal that no client has open */
            (void)poll(NULL, 0, 1);
        }
        watched.revents = 0;
    }
    return false;
}

/* libmodbus' own reception knows one unit only, and takes what follows a question to another unit for that unit's answer. */
static int receive_serial(modbus_server_t *self, uint8_t *frame)
{
    int have = 0, wanted = 8;
    while (have < wanted) {
        if (!is_readable(self, self->line)) {
            return -1;
        }
        const ssize_t got = read(self->line, frame + have, (size_t)(wanted - have));
        have += got > 0 ? (int)got : 0;
        wanted = have >= 8 ? question_length(frame) : 8;
    }
    return have;
}

static int receive(modbus_server_t *self, uint8_t *frame)
{
    if (self->is_serial) {
        return receive_serial(self, frame);
    }
    return is_readable(self, modbus_get_socket(self->modbus)) ? modbus_receive(self->modbus, frame) : -1;
}

/* Every unit does it and nobody answers: libmodbus answers into nothing. */
static void carry_out_broadcast(modbus_server_t *self, const uint8_t *frame, int length)
{
    const int line = modbus_get_socket(self->modbus);
    const int nothing = open("/dev/null", O_WRONLY | O_CLOEXEC);
    (void)modbus_set_socket(self->modbus, nothing);
    for (unsigned i = 0; i < MODBUS_SERVER_UNITS; i++) {
        (void)!modbus_reply(self->modbus, frame, length, self->unit[i]);
    }
    (void)modbus_set_socket(self->modbus, line);
    (void)close(nothing);
}

static void pace(const modbus_server_t *self, const uint8_t *frame, int length)
{
    const uint64_t ns = (uint64_t)(length + answer_length(frame)) * self->character_ns;
    const struct timespec pause = {.tv_sec = (time_t)(ns / 1000000000u), .tv_nsec = (long)(ns % 1000000000u)};
    if (ns != 0) {
        (void)nanosleep(&pause, NULL);
    }
}

static void deal_with(modbus_server_t *self, const uint8_t *frame, int length)
{
    const unsigned unit = frame[self->is_serial ? 0 : 6];
    if (self->is_serial) {
        pace(self, frame, length);
    }
    (void)pthread_mutex_lock(&self->lock);
    (void)modbus_set_slave(self->modbus, (int)unit);
    if (unit == MODBUS_BROADCAST_ADDRESS) {
        carry_out_broadcast(self, frame, length);
    } else if (unit <= MODBUS_SERVER_UNITS) {
        (void)!modbus_reply(self->modbus, frame, length, self->unit[unit - 1]);
    }
    (void)pthread_mutex_unlock(&self->lock);
    __atomic_fetch_add(&self->frames, 1, __ATOMIC_RELEASE);
}

/* --- The thread --- */

static void serve_link(modbus_server_t *self)
{
    uint8_t frame[FRAME_MAX];
    for (int length; (length = receive(self, frame)) > 0;) {
        deal_with(self, frame, length);
    }
}

static void *serve(void *argument)
{
    modbus_server_t *self = argument;
    if (self->is_serial) {
        serve_link(self);
        return NULL;
    }
    while (is_readable(self, self->listener)) {
        if (modbus_tcp_accept(self->modbus, &self->listener) >= 0) {
            serve_link(self);
            modbus_close(self->modbus);
        }
    }
    return NULL;
}

static bool start(modbus_server_t *self)
{
    for (unsigned i = 0; i < MODBUS_SERVER_UNITS; i++) {
        self->unit[i] = modbus_mapping_new(VALUES, VALUES, VALUES, VALUES);
    }
    return pthread_mutex_init(&self->lock, NULL) == 0 && pthread_create(&self->thread, NULL, serve, self) == 0;
}

bool modbus_server_start_tcp(modbus_server_t *self)
{
    struct sockaddr_in address = {.sin_family = AF_INET};
    socklen_t length = sizeof address;
    memset(self, 0, sizeof *self);
    self->line = -1;
    self->modbus = modbus_new_tcp("127.0.0.1", 0);
    self->listener = self->modbus != NULL ? modbus_tcp_listen(self->modbus, 4) : -1;
    if (self->listener < 0 || getsockname(self->listener, (struct sockaddr *)&address, &length) != 0) {
        return false;
    }
    self->port = ntohs(address.sin_port);
    return start(self);
}

bool modbus_server_start_serial(modbus_server_t *self, uint32_t bps)
{
    struct termios raw;
    memset(self, 0, sizeof *self);
    self->is_serial = true;
    self->character_ns = bps == 0 ? 0 : (uint32_t)(BITS_8N1 * (uint64_t)1000000000u / bps);
    self->listener = -1;
    self->line = posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC);
    if (self->line < 0 || grantpt(self->line) != 0 || unlockpt(self->line) != 0 ||
        ptsname_r(self->line, self->path, sizeof self->path) != 0 || tcgetattr(self->line, &raw) != 0) {
        return false;
    }
    cfmakeraw(&raw);
    (void)tcsetattr(self->line, TCSANOW, &raw);
    self->modbus = modbus_new_rtu(self->path, 115200, 'N', 8, 1);
    return self->modbus != NULL && modbus_set_socket(self->modbus, self->line) == 0 && start(self);
}

void modbus_server_stop(modbus_server_t *self)
{
    __atomic_store_n(&self->is_ending, 1, __ATOMIC_RELEASE);
    (void)pthread_join(self->thread, NULL);
    (void)pthread_mutex_destroy(&self->lock);
    for (unsigned i = 0; i < MODBUS_SERVER_UNITS; i++) {
        modbus_mapping_free(self->unit[i]);
    }
    if (self->listener >= 0) {
        (void)close(self->listener);
    }
    if (self->line >= 0) {
        (void)close(self->line);
    }
    modbus_free(self->modbus);
}

/* --- Values --- */

uint32_t modbus_server_frames(const modbus_server_t *self)
{
    return __atomic_load_n(&self->frames, __ATOMIC_ACQUIRE);
}

void modbus_server_set(modbus_server_t *self, unsigned unit, modbus_server_bank_t bank, unsigned address, uint16_t value)
{
    modbus_mapping_t *map = self->unit[unit - 1];
    (void)pthread_mutex_lock(&self->lock);
    switch (bank) {
    case MODBUS_SERVER_HOLDING:
        map->tab_registers[address] = value;
        break;
    case MODBUS_SERVER_INPUT:
        map->tab_input_registers[address] = value;
        break;
    case MODBUS_SERVER_COIL:
        map->tab_bits[address] = (uint8_t)value;
        break;
    case MODBUS_SERVER_DISCRETE:
        map->tab_input_bits[address] = (uint8_t)value;
        break;
    }
    (void)pthread_mutex_unlock(&self->lock);
}

uint16_t modbus_server_get(modbus_server_t *self, unsigned unit, modbus_server_bank_t bank, unsigned address)
{
    const modbus_mapping_t *map = self->unit[unit - 1];
    (void)pthread_mutex_lock(&self->lock);
    const uint16_t values[] = {map->tab_registers[address], map->tab_input_registers[address], map->tab_bits[address],
                               map->tab_input_bits[address]};
    (void)pthread_mutex_unlock(&self->lock);
    return values[bank];
}
