/* SPDX-License-Identifier: MIT
 * bench_latency.c - how long after a datagram the first set-point that differs arrives at a drive on Modbus TCP: sends the frames
 * and is the six drives, in one process with one clock. tools/bench latency runs it beside heaved.
 *
 * Prints its six ports; waits for a line `UDP-PORT FRAMES`; prints one line a frame: us until the first drive has such a
 * set-point, until the last one has, and by how much the pause before the frame was longer than asked. Ends there.
 */
#include <arpa/inet.h>
#include <pthread.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#define DRIVES     6u
#define REGISTERS  1024u
#define STATUS     0x0100u /* as in config/modbus-tcp-hexapod.ini */
#define POSITION   0x0101u
#define TARGET     0x0200u
#define CONTROL    0x0210u
#define START      70000000u /* 70 mm */
#define HEAD       7u        /* of a frame over TCP */
#define FRAME_MAX  260u
#define REST_MS    250u /* a step of a millimetre takes 100 */
#define WAIT_TURNS 10000u
#define TURN_NS    200000

typedef struct {
    int listener;
    uint16_t value[REGISTERS];
    uint64_t changed_ns; /* when a target other than the one before came; 0: none since it was taken back */
    pthread_t thread;
} drive_t;

static drive_t s_drive[DRIVES];

static void fail(const char *what)
{
    (void)fprintf(stderr, "bench_latency: %s\n", what);
    exit(1);
}

static uint64_t now_ns(void)
{
    struct timespec t;
    (void)clock_gettime(CLOCK_MONOTONIC, &t);
    return (uint64_t)t.tv_sec * 1000000000u + (uint64_t)t.tv_nsec;
}

static void pause_ns(uint64_t ns)
{
    const struct timespec t = {.tv_sec = (time_t)(ns / 1000000000u), .tv_nsec = (long)(ns % 1000000000u)};
    (void)nanosleep(&t, NULL);
}

static unsigned word_at(const uint8_t *at)
{
    return (unsigned)at[0] << 8 | at[1];
}

static void put_word(uint8_t *at, unsigned value)
{
    at[0] = (uint8_t)(value >> 8);
    at[1] = (uint8_t)value;
}

/* --- A drive --- */

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
    if (is_other && __atomic_load_n(&self->changed_ns, __ATOMIC_ACQUIRE) == 0) {
        __atomic_store_n(&self->changed_ns, arrived_ns, __ATOMIC_RELEASE);
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

static bool receive_all(int link, uint8_t *to, size_t bytes)
{
    return recv(link, to, bytes, MSG_WAITALL) == (ssize_t)bytes;
}

static void *serve(void *argument)
{
    drive_t *self = argument;
    for (;;) {
        const int link = accept(self->listener, NULL, NULL);
        uint8_t frame[HEAD + FRAME_MAX];
        while (receive_all(link, frame, HEAD) && word_at(frame + 4) >= 2 && word_at(frame + 4) < FRAME_MAX &&
               receive_all(link, frame + HEAD, word_at(frame + 4) - 1)) {
            const size_t length = answer(self, frame, now_ns());
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

/* --- Measuring --- */

/* False where not every drive has got another set-point in two seconds. */
static bool wait_for_all(uint64_t *first_ns, uint64_t *last_ns)
{
    for (unsigned turn = 0; turn < WAIT_TURNS; turn++) {
        unsigned changed = 0;
        *first_ns = UINT64_MAX;
        *last_ns = 0;
        for (unsigned i = 0; i < DRIVES; i++) {
            const uint64_t ns = __atomic_load_n(&s_drive[i].changed_ns, __ATOMIC_ACQUIRE);
            changed += ns != 0;
            *first_ns = ns != 0 && ns < *first_ns ? ns : *first_ns;
            *last_ns = ns > *last_ns ? ns : *last_ns;
        }
        if (changed == DRIVES) {
            return true;
        }
        pause_ns(TURN_NS);
    }
    return false;
}

/* At rest again, at a random place of heaved's cycle, and no stream of a steady rate. */
static uint64_t rest(void)
{
    const uint64_t start_ns = now_ns();
    const uint64_t ns = REST_MS * (uint64_t)1000000 + start_ns % 150000 * 1000; /* its last digits are as good as random */
    pause_ns(ns);
    return now_ns() - start_ns - ns;
}

static void measure(int link, unsigned frames)
{
    for (unsigned n = 0; n < frames; n++) {
        char text[40];
        const int length = snprintf(text, sizeof text, "@A6:0,0,0,0,0,%u#", 101 - n % 2); /* 100 is where it is */
        const uint64_t late_ns = rest();
        uint64_t first_ns = 0, last_ns = 0;
        for (unsigned i = 0; i < DRIVES; i++) {
            __atomic_store_n(&s_drive[i].changed_ns, 0, __ATOMIC_RELEASE);
        }
        const uint64_t sent_ns = now_ns();
        if (send(link, text, (size_t)length, 0) != length || !wait_for_all(&first_ns, &last_ns)) {
            fail("a frame moved nothing");
        }
        if (n > 0) { /* the first one is taken over, which begins otherwise */
            printf("%.1f %.1f %.1f\n", (double)(first_ns - sent_ns) / 1e3, (double)(last_ns - sent_ns) / 1e3,
                   (double)late_ns / 1e3);
        }
    }
}

int main(void)
{
    for (unsigned i = 0; i < DRIVES; i++) {
        start(&s_drive[i]);
    }
    printf("\n");
    (void)fflush(stdout);
    char line[40] = "";
    char *end = line;
    const unsigned long port = fgets(line, sizeof line, stdin) != NULL ? strtoul(line, &end, 10) : 0;
    const unsigned long frames = strtoul(end, NULL, 10);
    if (port == 0 || port > UINT16_MAX || frames == 0) {
        fail("no line `UDP-PORT FRAMES`");
    }
    const struct sockaddr_in address = {
        .sin_family = AF_INET, .sin_port = htons((uint16_t)port), .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    const int link = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    if (connect(link, (const struct sockaddr *)&address, sizeof address) != 0) {
        fail("no way to heaved");
    }
    measure(link, (unsigned)frames);
    return 0;
}
