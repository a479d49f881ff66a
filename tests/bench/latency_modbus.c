/* SPDX-License-Identifier: MIT
 * latency_modbus.c - six drives on Modbus TCP, each a server of its own, registers as in config/modbus-tcp-hexapod.ini.
 */
#include <arpa/inet.h>
#include <pthread.h>
#include <stdbool.h>
#include <stdio.h>
#include <sys/socket.h>
#include <unistd.h>

#include "latency_drives.h"

#define REGISTERS 1024u
#define STATUS    0x0100u
#define POSITION  0x0101u
#define TARGET    0x0200u
#define CONTROL   0x0210u
#define START     70000000u /* 70 mm */
#define HEAD      7u        /* of a frame over TCP */
#define FRAME_MAX 260u

typedef struct {
    unsigned number;
    int listener;
    uint16_t value[REGISTERS];
    pthread_t thread;
} drive_t;

static drive_t s_drive[DRIVES];

static unsigned word_at(const uint8_t *at)
{
    return (unsigned)at[0] << 8 | at[1];
}

static void put_word(uint8_t *at, unsigned value)
{
    at[0] = (uint8_t)(value >> 8);
    at[1] = (uint8_t)value;
}

static void write_register(drive_t *self, unsigned address, unsigned value)
{
    if (address == CONTROL) {
        self->value[STATUS] = value == 1;
    }
    self->value[address % REGISTERS] = (uint16_t)value;
}

/* Follows at once. */
static void take_target(drive_t *self, const uint8_t *at, uint64_t arrived_ns)
{
    const bool is_other = word_at(at) != self->value[TARGET] || word_at(at + 2) != self->value[TARGET + 1];
    if (is_other) {
        note_other(self->number, arrived_ns);
    }
    self->value[POSITION] = (uint16_t)word_at(at);
    self->value[POSITION + 1] = (uint16_t)word_at(at + 2);
}

/* Carries out a question and makes the answer of it. Returns its length, head included. */
static size_t answer(drive_t *self, uint8_t *frame, uint64_t arrived_ns)
{
    uint8_t *const body = frame + HEAD; /* function, address, count or value, then bytes and values */
    const unsigned address = word_at(body + 1), count = word_at(body + 3);
    size_t length = 5;
    if (body[0] == 3 || body[0] == 4) {
        body[1] = (uint8_t)(2 * count);
        for (unsigned i = 0; i < count && i < 100; i++) {
            put_word(body + 2 + 2 * i, self->value[(address + i) % REGISTERS]);
        }
        length = 2 + 2 * (size_t)count;
    } else if (body[0] == 16) {
        if (address == TARGET) {
            take_target(self, body + 6, arrived_ns);
        }
        for (unsigned i = 0; i < count && i < 100; i++) {
            write_register(self, address + i, word_at(body + 6 + 2 * i));
        }
    } else {
        write_register(self, address, count);
    }
    put_word(frame + 4, (unsigned)length + 1);
    return HEAD + length;
}

/* All of so many bytes, and when the last of them was received. */
static bool receive_all(int link, void *to, size_t bytes, uint64_t *arrived_ns)
{
    char control[STAMP_MAX];
    struct iovec part = {to, bytes};
    struct msghdr message = {.msg_iov = &part, .msg_iovlen = 1, .msg_control = control, .msg_controllen = sizeof control};
    if (recvmsg(link, &message, MSG_WAITALL) != (ssize_t)bytes) {
        return false;
    }
    *arrived_ns = stamp_of(&message);
    return true;
}

static void *serve(void *argument)
{
    drive_t *self = argument;
    (void)be_urgent(URGENT);
    for (;;) {
        const int link = accept(self->listener, NULL, NULL);
        uint8_t frame[HEAD + FRAME_MAX];
        uint64_t arrived_ns = 0;
        ask_for_stamps(link);
        while (receive_all(link, frame, HEAD, &arrived_ns) && word_at(frame + 4) >= 2 && word_at(frame + 4) < FRAME_MAX &&
               receive_all(link, frame + HEAD, word_at(frame + 4) - 1, &arrived_ns)) {
            const size_t length = answer(self, frame, arrived_ns);
            if (send(link, frame, length, MSG_NOSIGNAL) != (ssize_t)length) {
                break;
            }
        }
        (void)close(link);
    }
    return NULL;
}

static void start(drive_t *self)
{
    struct sockaddr_in address = {.sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    socklen_t length = sizeof address;
    self->value[TARGET] = self->value[POSITION] = (uint16_t)(START >> 16);
    self->value[TARGET + 1] = self->value[POSITION + 1] = (uint16_t)(START & 0xFFFFu);
    self->listener = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    if (bind(self->listener, (struct sockaddr *)&address, length) != 0 || listen(self->listener, 1) != 0 ||
        getsockname(self->listener, (struct sockaddr *)&address, &length) != 0 ||
        pthread_create(&self->thread, NULL, serve, self) != 0) {
        fail("no server");
    }
    printf("%u ", (unsigned)ntohs(address.sin_port));
}

void start_modbus(void)
{
    for (unsigned i = 0; i < DRIVES; i++) {
        s_drive[i].number = i;
        start(&s_drive[i]);
    }
}
