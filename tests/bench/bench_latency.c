/* SPDX-License-Identifier: MIT
 * bench_latency.c - how long after a datagram set-points that differ are at six drives: sends the frames and is the drives, in
 * one process with one clock. tools/bench latency runs it beside heaved.
 *
 * usage: bench_latency modbus | bench_latency can INTERFACE
 *
 * Prints a line when the drives are there (Modbus: their six ports); waits for a line `UDP-PORT FRAMES IS-WATCHED`. Prints
 * `urgent 0|1`: whether the watches run before everything else; then, in us since then: frame SENT RETURNED FIRST LAST BEGUN
 * ACTING LATE before and after send(); the first and the last drive's set-point; on CAN the SYNC before the first one and the
 * SYNC after the last one, else 0; by how much the pause before the frame was longer than asked stall FROM TO a processor did not
 * run its most urgent thread; not told where IS-WATCHED is 0 Ends there.
 */
#include <arpa/inet.h>
#include <errno.h>
#include <pthread.h>
#include <sched.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#include "latency_drives.h"

#define REST_MS      250u /* a step of a millimetre takes 100 */
#define REST_MORE_US 150000u
#define QUIET_NS     50000000u
#define WAIT_TURNS   10000u
#define TURN_NS      200000u
#define SECOND_NS    1000000000u
#define FRAMES_MAX   1000000u
#define WATCHES_MAX  64u
#define STALLS_MAX   20000u
#define WATCH        99 /* priority */
#define WATCH_NS     500000u
#define STALL_NS     500000u

/* What has come of the frame under way; 0 = nothing. */
static uint64_t s_other_ns[DRIVES], s_newest_ns, s_sync_ns, s_begun_ns, s_acting_ns;
static uint64_t s_base_ns;

typedef struct {
    unsigned cpu;
    pthread_t thread;
    uint64_t from_ns[STALLS_MAX], to_ns[STALLS_MAX];
    unsigned stalls;
    int error; /* of asking for the priority */
} watch_t;

static watch_t s_watch[WATCHES_MAX];
static unsigned s_watches;
static bool s_is_over;

void fail(const char *what)
{
    (void)fprintf(stderr, "bench_latency: %s\n", what);
    exit(1);
}

static uint64_t ns_of(struct timespec t)
{
    return (uint64_t)t.tv_sec * SECOND_NS + (uint64_t)t.tv_nsec;
}

static struct timespec time_of(uint64_t ns)
{
    return (struct timespec){.tv_sec = (time_t)(ns / SECOND_NS), .tv_nsec = (long)(ns % SECOND_NS)};
}

static uint64_t read_clock(clockid_t clock)
{
    struct timespec t;
    (void)clock_gettime(clock, &t);
    return ns_of(t);
}

uint64_t wall_ns(void)
{
    return read_clock(CLOCK_REALTIME);
}

int be_urgent(int priority)
{
    return pthread_setschedparam(pthread_self(), SCHED_FIFO, &(struct sched_param){.sched_priority = priority});
}

static void pause_ns(uint64_t ns)
{
    const struct timespec t = time_of(ns);
    (void)nanosleep(&t, NULL);
}

/* --- What the kernel says of times --- */

void ask_for_stamps(int link)
{
    if (link >= 0 && setsockopt(link, SOL_SOCKET, SO_TIMESTAMPNS, &(int){1}, sizeof(int)) != 0) {
        fail("no stamps");
    }
}

uint64_t stamp_of(struct msghdr *message)
{
    for (struct cmsghdr *part = CMSG_FIRSTHDR(message); part != NULL; part = CMSG_NXTHDR(message, part)) {
        if (part->cmsg_level == SOL_SOCKET && part->cmsg_type == SO_TIMESTAMPNS) {
            struct timespec t;
            memcpy(&t, CMSG_DATA(part), sizeof t);
            return ns_of(t);
        }
    }
    return wall_ns();
}

/* --- Set-points --- */

static uint64_t load(const uint64_t *from)
{
    return __atomic_load_n(from, __ATOMIC_ACQUIRE);
}

/* Of all drives; 0 in first_ns where one of them has none yet. */
static void find_span(uint64_t *first_ns, uint64_t *last_ns)
{
    *first_ns = UINT64_MAX;
    *last_ns = 0;
    for (unsigned i = 0; i < DRIVES; i++) {
        const uint64_t ns = load(&s_other_ns[i]);
        *first_ns = ns < *first_ns ? ns : *first_ns;
        *last_ns = ns > *last_ns ? ns : *last_ns;
    }
}

void note_other(unsigned drive, uint64_t arrived_ns)
{
    if (load(&s_other_ns[drive]) == 0) {
        if (load(&s_begun_ns) == 0) {
            __atomic_store_n(&s_begun_ns, load(&s_sync_ns), __ATOMIC_RELEASE);
        }
        __atomic_store_n(&s_other_ns[drive], arrived_ns, __ATOMIC_RELEASE);
    }
    __atomic_store_n(&s_newest_ns, arrived_ns, __ATOMIC_RELEASE);
}

void note_sync(uint64_t arrived_ns)
{
    uint64_t first_ns = 0, last_ns = 0;
    find_span(&first_ns, &last_ns);
    if (first_ns != 0 && load(&s_acting_ns) == 0) {
        __atomic_store_n(&s_acting_ns, arrived_ns, __ATOMIC_RELEASE);
    }
    __atomic_store_n(&s_sync_ns, arrived_ns, __ATOMIC_RELEASE);
}

static void forget_all(void)
{
    for (unsigned i = 0; i < DRIVES; i++) {
        __atomic_store_n(&s_other_ns[i], 0, __ATOMIC_RELEASE);
    }
    __atomic_store_n(&s_begun_ns, 0, __ATOMIC_RELEASE);
    __atomic_store_n(&s_acting_ns, 0, __ATOMIC_RELEASE);
}

/* False where not every drive has got another set-point, and a bus with SYNC the next one, in two seconds. */
static bool wait_for_all(uint64_t *first_ns, uint64_t *last_ns)
{
    for (unsigned turn = 0; turn < WAIT_TURNS; turn++) {
        find_span(first_ns, last_ns);
        if (*first_ns != 0 && (load(&s_sync_ns) == 0 || load(&s_acting_ns) != 0)) {
            return true;
        }
        pause_ns(TURN_NS);
    }
    return false;
}

/* --- Watching the machine --- */

/* Where the most urgent thread of a processor is late, nobody ran there: neither heaved nor who measures it. */
static void *watch(void *argument)
{
    watch_t *self = argument;
    self->error = be_urgent(WATCH);
    for (uint64_t due_ns = read_clock(CLOCK_MONOTONIC); !__atomic_load_n(&s_is_over, __ATOMIC_ACQUIRE); due_ns += WATCH_NS) {
        const struct timespec due = time_of(due_ns);
        (void)clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &due, NULL);
        const uint64_t now_ns = read_clock(CLOCK_MONOTONIC);
        if (now_ns >= due_ns + STALL_NS) {
            const unsigned at =
                self->stalls < STALLS_MAX ? self->stalls++ : STALLS_MAX - 1; /* too many: the last one only ends later */
            self->to_ns[at] = wall_ns();
            self->from_ns[at] =
                at == STALLS_MAX - 1 && self->from_ns[at] != 0 ? self->from_ns[at] : self->to_ns[at] - (now_ns - due_ns);
            due_ns = now_ns;
        }
    }
    return NULL;
}

static void start_watches(void)
{
    cpu_set_t allowed;
    CPU_ZERO(&allowed);
    (void)sched_getaffinity(0, sizeof allowed, &allowed);
    for (unsigned cpu = 0; cpu < CPU_SETSIZE && s_watches < WATCHES_MAX; cpu++) {
        watch_t *self = &s_watch[s_watches];
        cpu_set_t own;
        pthread_attr_t attributes;
        if (!CPU_ISSET(cpu, &allowed)) {
            continue;
        }
        CPU_ZERO(&own);
        CPU_SET(cpu, &own);
        (void)pthread_attr_init(&attributes);
        (void)pthread_attr_setaffinity_np(&attributes, sizeof own, &own);
        if (pthread_create(&self->thread, &attributes, watch, self) != 0) {
            fail("no watch");
        }
        (void)pthread_attr_destroy(&attributes);
        s_watches++;
    }
}

/* us since the start; what was before it, or never, is 0. */
static double us(uint64_t ns)
{
    return ns > s_base_ns ? (double)(ns - s_base_ns) / 1e3 : 0;
}

static void end_watches(void)
{
    int error = 0;
    __atomic_store_n(&s_is_over, true, __ATOMIC_RELEASE);
    for (unsigned i = 0; i < s_watches; i++) {
        (void)pthread_join(s_watch[i].thread, NULL);
        error = s_watch[i].error != 0 ? s_watch[i].error : error;
        for (unsigned k = 0; k < s_watch[i].stalls; k++) {
            printf("stall %.1f %.1f\n", us(s_watch[i].from_ns[k]), us(s_watch[i].to_ns[k]));
        }
    }
    printf("urgent %d\n", error == 0);
}

/* --- Measuring --- */

/* At rest again, at a random place of heaved's cycle, and no stream of a steady rate. Returns by how much it took too long. */
static uint64_t pause_at_rest(void)
{
    static uint32_t s_random = 1;
    s_random = s_random * 1664525u + 1013904223u;
    const uint64_t ns = (REST_MS * (uint64_t)1000 + (s_random >> 8) % REST_MORE_US) * 1000u;
    const uint64_t start_ns = read_clock(CLOCK_MONOTONIC);
    pause_ns(ns);
    const uint64_t late_ns = read_clock(CLOCK_MONOTONIC) - start_ns - ns;
    while (wall_ns() - load(&s_newest_ns) < QUIET_NS) { /* it still moves */
        pause_ns(QUIET_NS);
    }
    return late_ns;
}

static void measure(int link, unsigned frames)
{
    for (unsigned n = 0; n < frames; n++) {
        char text[40];
        const int length = snprintf(text, sizeof text, "@A6:0,0,0,0,0,%u#", 101 - n % 2); /* 100 is where it is */
        const uint64_t late_ns = pause_at_rest();
        uint64_t first_ns = 0, last_ns = 0;
        forget_all();
        const uint64_t sent_ns = wall_ns();
        const bool is_sent = send(link, text, (size_t)length, 0) == length;
        const uint64_t returned_ns = wall_ns();
        if (!is_sent || !wait_for_all(&first_ns, &last_ns)) {
            printf("lost %.1f\n", us(sent_ns));
            return;
        }
        if (first_ns < sent_ns) {
            fail("the clock was set meanwhile");
        }
        if (n > 0) { /* the first one is taken over, which begins otherwise */
            printf("frame %.1f %.1f %.1f %.1f %.1f %.1f %.1f\n", us(sent_ns), us(returned_ns), us(first_ns), us(last_ns),
                   us(load(&s_begun_ns)), us(load(&s_acting_ns)), (double)late_ns / 1e3);
        }
    }
}

static int link_to(unsigned port)
{
    const struct sockaddr_in address = {
        .sin_family = AF_INET, .sin_port = htons((uint16_t)port), .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    const int link = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    if (connect(link, (const struct sockaddr *)&address, sizeof address) != 0) {
        fail("no way to heaved");
    }
    return link;
}

static void start_drives(int argc, char **argv)
{
    if (argc == 2 && strcmp(argv[1], "modbus") == 0) {
        start_modbus();
    } else if (argc == 3 && strcmp(argv[1], "can") == 0) {
        start_can(argv[2]);
        (void)be_urgent(URGENT); /* a sender is another machine; on Modbus one as urgent as heaved's lines tells how those fare */
    } else {
        fail("usage: bench_latency modbus | bench_latency can INTERFACE");
    }
    printf("\n");
    (void)fflush(stdout);
}

int main(int argc, char **argv)
{
    unsigned long number[3] = {0}; /* port, frames, whether it is watched */
    char line[60] = "";
    char *rest = line;
    start_drives(argc, argv);
    for (unsigned i = 0; i < 3 && (i > 0 || fgets(line, sizeof line, stdin) != NULL); i++) {
        number[i] = strtoul(rest, &rest, 10);
    }
    if (number[0] == 0 || number[0] > UINT16_MAX || number[1] == 0 || number[1] > FRAMES_MAX) {
        fail("no line `UDP-PORT FRAMES IS-WATCHED`");
    }
    s_base_ns = wall_ns() - SECOND_NS; /* so that nothing that counts is 0 */
    if (number[2] != 0) {
        start_watches();
    }
    measure(link_to((unsigned)number[0]), (unsigned)number[1]);
    end_watches();
    return 0;
}
