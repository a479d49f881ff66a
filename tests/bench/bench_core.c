/* SPDX-License-Identifier: MIT
 * bench_core.c - what a cycle of the gateway costs, and its parts; tools/bench cost runs it and prints the figures.
 * The gateway stands between devices that do nothing, so that only the core is counted. Inputs are made before the clock runs.
 *
 *   bench_core                    the names of all subjects, one a line
 *   bench_core NAME COUNT ROUNDS  ns per run, one line a round, each over COUNT runs; then `single P50 P99 P999`: ns of runs
 *                                 timed one by one, the clock's own time taken off; of CAN `frames N`: on the bus in one run
 *   bench_core NAME COUNT         COUNT runs in bench_region(), for callgrind --toggle-collect=bench_region*
 */
#include "bench_gateway.h"
#include "canopen_drives.h"
#include "heave/cia402.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define POSES    512u /* a power of 2 */
#define TEXTS    BENCH_TEXTS
#define TEXT_MAX BENCH_TEXT_MAX
#define FLOOD    GATEWAY_DATAGRAMS_PER_CYCLE
#define PI       3.14159265358979

/* of the CAN subjects */
#define BUS_CYCLES     4u /* in a period of the bus */
#define BUS_CYCLE_US   1000u
#define BEAT_PERIODS   12u /* 48 ms */
#define COME_UP_CYCLES 5000u
#define RPDO           0x200u
#define TPDO           0x180u
#define HEARTBEAT      0x700u
#define SYNC           0x080u

/** Everything a subject may need. */
typedef struct {
    bench_gateway_t at;
    bench_texts_t texts;
    uint64_t now_us; /**< of the CAN subjects */
    q32_t setpoint_q32[DRIVES_MAX];
    motion_target_t target[TEXTS];
    kin_t kin;
    pose_t pose[POSES];
    pose_t guess[POSES];
    q32_t extension_mm_q32[POSES][CYLINDERS_MAX];
    sim_can_bus_t bus;
    sim_can_t master;
    cia402_config_t can_config;
    cia402_t can;
    canopen_drives_t drives; /**< brings the driver up; afterwards the bench answers for it, at less cost */
    drive_feedback_t feedback[DRIVES_MAX];
    can_frame_t answer[DRIVES_MAX]; /**< what each drive says to SYNC */
    uint64_t random;
    uint64_t sum; /**< of results, so that none is computed in vain */
} bench_t;

static bench_t s_bench;

static double chance(bench_t *b)
{
    b->random ^= b->random << 13;
    b->random ^= b->random >> 7;
    b->random ^= b->random << 17;
    return (double)(b->random >> 11) / 9007199254740992.0;
}

static double between(bench_t *b, double low, double high)
{
    return low + (high - low) * chance(b);
}

/* --- Inputs --- */

/* Frames of all kinds, each at odds with the one before. */
static void make_hostile_texts(bench_t *b)
{
    b->texts.count = TEXTS;
    for (unsigned n = 0; n < TEXTS; n++) {
        double p[POSE_AXES], c[CYLINDERS_MAX];
        for (unsigned i = 0; i < POSE_AXES; i++) {
            p[i] = between(b, -1, 1) * (i < AXIS_X ? 20 : 100);
            c[i] = between(b, 60, 140);
        }
        const double angle = between(b, -300, 300);
        const unsigned ms = (unsigned)between(b, 5, 1500);
        char text[TEXT_MAX];
        switch ((unsigned)between(b, 0, 5)) {
        case 0:
            (void)snprintf(text, sizeof text, "@A6:%.3f,%.3f,%.3f,%.3f,%.3f,%.3f,F0#", p[0], p[1], p[2], p[3], p[4], p[5]);
            break;
        case 1:
            (void)snprintf(text, sizeof text, "@A7T:%.6f,%.6f,%.6f,%.6f,%.6f,%.6f,%.6f,%u#", p[0], p[1], p[2], p[3], p[4], p[5],
                           angle, ms);
            break;
        case 2:
            (void)snprintf(text, sizeof text, "@C6:%.3f,%.3f,%.3f,%.3f,%.3f,%.3f,0F#", c[0], c[1], c[2], c[3], c[4], c[5]);
            break;
        case 3:
            (void)snprintf(text, sizeof text, "@C7T:%.3f,%.3f,%.3f,%.3f,%.3f,%.3f,%.3f,%u#", c[0], c[1], c[2], c[3], c[4], c[5],
                           angle, ms);
            break;
        default:
            (void)snprintf(text, sizeof text, "@A6:%.3f,%.3f,%.3f,%.3f,x,%.3f,F0#", p[0], p[1], p[2], p[3], p[5]);
            break;
        }
        bench_put_text(&b->texts, n, text);
    }
}

static void start_gateway(bench_t *b)
{
    bench_gateway_start(&b->at);
    b->at.texts = &b->texts;
}

static void make_poses(bench_t *b)
{
    static const double k_size[POSE_AXES] = {6, 6, 8, 30, 30, 40};
    const settings_t settings = rig_hexapod();
    if (kin_init(&b->kin, &settings.geometry) != HV_OK) {
        bench_fail("kin_init");
    }
    for (unsigned n = 0; n < POSES; n++) {
        for (unsigned i = 0; i < POSE_AXES; i++) {
            const double value = between(b, -1, 1) * k_size[i];
            const double off = between(b, -1, 1) * (i < AXIS_X ? 0.05 : 0.5);
            b->pose[n].axis_q32[i] = llround(value * 4294967296.0);
            b->guess[n].axis_q32[i] = llround((value + off) * 4294967296.0);
        }
        if (kin_inverse(&b->kin, &b->pose[n], b->extension_mm_q32[n]) != HV_OK) {
            bench_fail("kin_inverse");
        }
    }
}

static void set_up_rest(bench_t *b)
{
    start_gateway(b);
}

static void set_up_stream(bench_t *b)
{
    start_gateway(b);
    bench_make_stream(&b->texts, 60, 3);
}

/* The same stream for motion alone, and the rotation motor turns too. */
static void set_up_motion(bench_t *b)
{
    start_gateway(b);
    for (unsigned n = 0; n < TEXTS; n++) {
        double pose[POSE_AXES];
        motion_target_t *target = &b->target[n];
        bench_stream_pose(n / 60.0, pose);
        *target = (motion_target_t){.space = MOTION_POSE, .has_angle = true};
        for (unsigned i = 0; i < POSE_AXES; i++) {
            target->value_q32[i] = llround(pose[i] * 4294967296.0);
        }
        target->angle_deg_q32 = llround(20 * sin(2 * PI * 0.15 * n / 60) * 4294967296.0);
    }
}

static void set_up_hostile(bench_t *b)
{
    start_gateway(b);
    make_hostile_texts(b);
}

static void set_up_vendor_frames(bench_t *b)
{
    bench_put_text(&b->texts, 0, "@A6:5,6,0,5.5,3.0,20,F0#");
    bench_put_text(&b->texts, 1, "@A7:5,6,0,5.5,3.0,20,-30,F0#");
    b->texts.count = 2;
}

static void set_up_a6_frames(bench_t *b)
{
    bench_make_stream(&b->texts, 60, 3);
}

static void set_up_a7_frames(bench_t *b)
{
    b->texts.count = POSES;
    for (unsigned n = 0; n < POSES; n++) {
        char text[TEXT_MAX];
        (void)snprintf(text, sizeof text, "@A7:%.6f,%.6f,%.6f,%.6f,%.6f,%.6f,%.6f,F0#", between(b, -20, 20), between(b, -20, 20),
                       between(b, -20, 20), between(b, -99, 99), between(b, -99, 99), between(b, -99, 99), between(b, -300, 300));
        bench_put_text(&b->texts, n, text);
    }
}

/* --- Drives on CAN --- */

static void configure_can(bench_t *b)
{
    b->can_config = (cia402_config_t){.axes = DRIVES_MAX,
                                      .master_node = 127,
                                      .mode = CIA402_MODE_CSP,
                                      .period_us = BUS_CYCLES * BUS_CYCLE_US,
                                      .heartbeat_ms = 50,
                                      .heartbeat_timeout_ms = 150,
                                      .sdo_timeout_ms = 50,
                                      .boot_timeout_ms = 500,
                                      .power_timeout_ms = 300,
                                      .window_ms = 20,
                                      .abort_option = 1};
    for (unsigned k = 0; k < DRIVES_MAX; k++) {
        b->can_config.axis[k] = (cia402_axis_config_t){.node = (uint8_t)(k + 1),
                                                       .scale = {131072, 10, 0},
                                                       .step_max_q32 = 2 * Q32_ONE,
                                                       .following_max_q32 = 10 * Q32_ONE,
                                                       .window_counts = 131072};
    }
}

static bool are_all(const bench_t *b, drive_state_t state)
{
    for (unsigned k = 0; k < DRIVES_MAX; k++) {
        if (b->feedback[k].state != state) {
            return false;
        }
    }
    return true;
}

static void drive_cycle(bench_t *b)
{
    const drives_t can = cia402_hal(&b->can);
    (void)!drives_poll(can, b->now_us, b->feedback);
    (void)!drives_send(can, b->now_us, b->setpoint_q32);
}

static void come_up_cycle(bench_t *b)
{
    canopen_drives_step(&b->drives, b->now_us += BUS_CYCLE_US);
    drive_cycle(b);
}

/* With set-points on the actual positions. */
static void await(bench_t *b, drive_state_t state)
{
    for (unsigned i = 0; i < COME_UP_CYCLES && !are_all(b, state); i++) {
        come_up_cycle(b);
        for (unsigned k = 0; k < DRIVES_MAX; k++) {
            b->setpoint_q32[k] = b->feedback[k].actual_mm_q32;
        }
    }
    if (!are_all(b, state)) {
        bench_fail("the drives on CAN do not come up");
    }
}

/* The next cycle begins a period, so that each run is a whole one. */
static void reach_period(bench_t *b)
{
    const uint32_t before = b->can.syncs;
    while (b->can.syncs == before) {
        come_up_cycle(b);
    }
    for (unsigned cycle = 1; cycle < BUS_CYCLES; cycle++) {
        come_up_cycle(b);
    }
}

static void set_up_can(bench_t *b)
{
    hal_can_filter_t filter[CIA402_FILTERS_MAX];
    configure_can(b);
    sim_can_bus_init(&b->bus, 0, NULL, 0);
    canopen_drives_open(&b->drives, &b->bus);
    const uint32_t filters = cia402_filters(&b->can_config, filter);
    if (sim_can_open(&b->master, &b->bus, filter, filters) != HV_OK ||
        cia402_init(&b->can, &b->can_config, sim_can_hal(&b->master)) != HV_OK) {
        bench_fail("the drives on CAN do not start");
    }
    await(b, DRIVE_DISABLED);
    if (drives_request(cia402_hal(&b->can), DRIVES_ENABLE) != HV_OK) {
        bench_fail("the drives on CAN cannot be enabled");
    }
    await(b, DRIVE_ENABLED);
    reach_period(b);
    for (unsigned k = 0; k < DRIVES_MAX; k++) {
        const cia402_axis_t *axis = &b->can.axis[k];
        const uint32_t at = (uint32_t)axis->actual_counts;
        b->answer[k] = (can_frame_t){.id = TPDO + k + 1,
                                     .length = 7,
                                     .data = {(uint8_t)axis->statusword, (uint8_t)(axis->statusword >> 8), (uint8_t)at,
                                              (uint8_t)(at >> 8), (uint8_t)(at >> 16), (uint8_t)(at >> 24), CIA402_MODE_CSP}};
    }
    b->bus.frames = 0;
}

static void say_as_drives(bench_t *b, const can_frame_t *frame)
{
    if (hal_can_send(sim_can_hal(&b->drives.node), frame) != HV_OK) {
        bench_fail("no room for the drives' answers");
    }
}

/* What seven drives without any lag say: positions to SYNC, and heartbeats. */
static void answer_as_drives(bench_t *b, unsigned n)
{
    can_frame_t frame;
    uint64_t at_us = 0;
    while (hal_can_recv(sim_can_hal(&b->drives.node), &frame, &at_us) == HV_OK) {
        if (frame.id == SYNC) {
            for (unsigned k = 0; k < DRIVES_MAX; k++) {
                say_as_drives(b, &b->answer[k]);
            }
        } else if (frame.id - RPDO - 1 < DRIVES_MAX) {
            memcpy(&b->answer[frame.id - RPDO - 1].data[2], &frame.data[2], 4);
        }
    }
    for (unsigned k = 0; k < DRIVES_MAX && n % BEAT_PERIODS == 0; k++) {
        const can_frame_t beat = {.id = HEARTBEAT + k + 1, .length = 1, .data = {5}};
        say_as_drives(b, &beat);
    }
}

/* --- One run of each subject; n counts them --- */

/* Four cycles: a SYNC, seven set-points of a slow movement, their echoes, seven answers, and now and then heartbeats. */
static void run_can(bench_t *b, unsigned n)
{
    for (unsigned cycle = 0; cycle < BUS_CYCLES; cycle++) {
        b->now_us += BUS_CYCLE_US;
        for (unsigned k = 0; k < DRIVES_MAX; k++) {
            b->setpoint_q32[k] += (n & 1024u) != 0 ? -Q32_ONE / 50 : Q32_ONE / 50;
        }
        sim_can_bus_step(&b->bus, b->now_us);
        drive_cycle(b);
        sim_can_bus_step(&b->bus, b->now_us);
        if (cycle == 0) {
            answer_as_drives(b, n);
        }
    }
}

/* The same frames on the same bus without the driver. */
static void run_wire(bench_t *b, unsigned n)
{
    const hal_can_t master = sim_can_hal(&b->master);
    can_frame_t frame = {.id = SYNC};
    uint64_t at_us = 0;
    for (unsigned cycle = 0; cycle < BUS_CYCLES; cycle++) {
        b->now_us += BUS_CYCLE_US;
        sim_can_bus_step(&b->bus, b->now_us);
        while (hal_can_recv(master, &frame, &at_us) == HV_OK) {
            b->sum += frame.data[2];
        }
        for (unsigned k = 0; k <= DRIVES_MAX && cycle == 0; k++) {
            frame = (can_frame_t){.id = k == 0 ? SYNC : RPDO + k, .length = k == 0 ? 0 : 6, .data = {0x1F, 0, (uint8_t)n}};
            b->sum += (uint64_t)hal_can_send(master, &frame);
        }
        sim_can_bus_step(&b->bus, b->now_us);
        if (cycle == 0) {
            answer_as_drives(b, n);
        }
    }
}

static void run_rest(bench_t *b, unsigned n)
{
    (void)n;
    gateway_cycle(&b->at.gateway, b->at.now_us += 1000);
}

static void run_stream(bench_t *b, unsigned n)
{
    bench_gateway_stream_cycle(&b->at, n);
}

static void run_motion(bench_t *b, unsigned n)
{
    motion_t *motion = &b->at.gateway.motion;
    motion_output_t output;
    b->at.now_us += 1000;
    if (n * 60 / 1000 != (n + 1) * 60 / 1000) {
        b->sum += (uint64_t)motion_target(motion, &b->target[b->at.next_text++ % TEXTS], b->at.now_us);
    }
    motion_step(motion, b->at.now_us, &output);
    b->sum += (uint64_t)output.extension_mm_q32[0];
}

/* A frame of another kind every 7 cycles, a hold and its end every 256. */
static void run_hostile(bench_t *b, unsigned n)
{
    b->at.due = n % 7 == 0;
    if (n % 128 == 0) {
        (void)!gateway_request(&b->at.gateway, n % 256 == 0 ? EVENT_HOLD : EVENT_RESUME, b->at.now_us);
    }
    gateway_cycle(&b->at.gateway, b->at.now_us += 1000);
}

static void run_flood(bench_t *b, unsigned n)
{
    (void)n;
    b->at.due = FLOOD;
    gateway_cycle(&b->at.gateway, b->at.now_us += 1000);
}

static void run_frame(bench_t *b, unsigned n)
{
    const unsigned i = n % b->texts.count;
    frame_scanner_t scanner;
    frame_t frame;
    frame_reject_t why;
    size_t position = 0;
    frame_scanner_init(&scanner, FRAME_V3);
    while (frame_next(&scanner, (const uint8_t *)b->texts.text[i], b->texts.length[i], &position, &frame, &why) ==
           FRAME_EVENT_FRAME) {
        b->sum += (uint64_t)(int64_t)frame.value_q16[5];
    }
}

static void run_inverse(bench_t *b, unsigned n)
{
    q32_t extension_mm_q32[CYLINDERS_MAX];
    b->sum += kin_inverse(&b->kin, &b->pose[n % POSES], extension_mm_q32) == HV_OK ? (uint64_t)extension_mm_q32[n % 6] : 0;
}

static void run_forward(bench_t *b, unsigned n)
{
    pose_t pose;
    const unsigned i = n % POSES;
    b->sum +=
        kin_forward(&b->kin, b->extension_mm_q32[i], &b->guess[i], &pose, NULL) == HV_OK ? (uint64_t)pose.axis_q32[n % 6] : 0;
}

static void run_forward_cold(bench_t *b, unsigned n)
{
    static const pose_t k_zero = {{0}};
    pose_t pose;
    const unsigned i = n % POSES;
    b->sum += kin_forward(&b->kin, b->extension_mm_q32[i], &k_zero, &pose, NULL) == HV_OK ? (uint64_t)pose.axis_q32[n % 6] : 0;
}

typedef struct {
    const char *name;
    void (*set_up)(bench_t *b);
    void (*run)(bench_t *b, unsigned n);
} subject_t;

static const subject_t k_subjects[] = {
    {"cycle-rest", set_up_rest, run_rest},
    {"cycle-stream", set_up_stream, run_stream},
    {"motion-stream", set_up_motion, run_motion},
    {"cycle-hostile", set_up_hostile, run_hostile},
    {"cycle-flood", set_up_hostile, run_flood},
    {"frame-vendor", set_up_vendor_frames, run_frame},
    {"frame-a6", set_up_a6_frames, run_frame},
    {"frame-a7", set_up_a7_frames, run_frame},
    {"inverse", make_poses, run_inverse},
    {"forward-warm", make_poses, run_forward},
    {"forward-cold", make_poses, run_forward_cold},
    {"can-period", set_up_can, run_can},
    {"can-wire", set_up_can, run_wire},
};

/* --- Measuring --- */

void bench_region(const subject_t *subject, bench_t *b, unsigned first, unsigned count);

/** Not inlined and not static, so that callgrind finds it by its name. */
__attribute__((noinline)) void bench_region(const subject_t *subject, bench_t *b, unsigned first, unsigned count)
{
    for (unsigned n = first; n < first + count; n++) {
        subject->run(b, n);
    }
}

static double clock_ns(void)
{
    struct timespec t;
    (void)clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec * 1e9 + (double)t.tv_nsec;
}

static int by_value(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static double clock_cost_ns(void)
{
    double least = 1e9;
    for (unsigned i = 0; i < 1000; i++) {
        const double start = clock_ns();
        const double took = clock_ns() - start;
        least = took < least ? took : least;
    }
    return least;
}

static void time_singles(const subject_t *subject, bench_t *b, unsigned first, unsigned count)
{
    double *took = malloc(count * sizeof *took);
    if (took == NULL) {
        bench_fail("no memory");
    }
    const double cost = clock_cost_ns();
    for (unsigned n = 0; n < count; n++) {
        const double start = clock_ns();
        subject->run(b, first + n);
        took[n] = clock_ns() - start - cost;
    }
    qsort(took, count, sizeof *took, by_value);
    printf("single %.1f %.1f %.1f\n", took[count / 2], took[(count - 1) * 99ull / 100], took[(count - 1) * 999ull / 1000]);
    free(took);
}

/* Nothing has been measured that was not at work. */
static void print_frames(const subject_t *subject, const bench_t *b, unsigned runs)
{
    if (subject->set_up == set_up_can) {
        printf("frames %.3f\n", (double)b->bus.frames / runs);
    }
    if (subject->run == run_can && !are_all(b, DRIVE_ENABLED)) {
        bench_fail("the drives on CAN have been lost");
    }
}

static void time_rounds(const subject_t *subject, bench_t *b, unsigned count, unsigned rounds)
{
    bench_region(subject, b, 0, count); /* warms up */
    for (unsigned round = 1; round <= rounds; round++) {
        const double start = clock_ns();
        bench_region(subject, b, round * count, count);
        printf("%.3f\n", (clock_ns() - start) / count);
    }
    time_singles(subject, b, (rounds + 1) * count, count);
    print_frames(subject, b, (rounds + 2) * count);
}

static const subject_t *find_subject(const char *name)
{
    for (size_t i = 0; i < sizeof k_subjects / sizeof k_subjects[0]; i++) {
        if (strcmp(name, k_subjects[i].name) == 0) {
            return &k_subjects[i];
        }
    }
    bench_fail("no such subject");
    return NULL;
}

int main(int argc, char **argv)
{
    if (argc == 1) {
        for (size_t i = 0; i < sizeof k_subjects / sizeof k_subjects[0]; i++) {
            puts(k_subjects[i].name);
        }
        return 0;
    }
    const long count = argc == 3 || argc == 4 ? strtol(argv[2], NULL, 10) : 0;
    const long rounds = argc == 4 ? strtol(argv[3], NULL, 10) : 0;
    if (count < 1 || count > 1000000 || rounds < 0 || rounds > 1000) {
        bench_fail("usage: bench_core [NAME COUNT [ROUNDS]]");
    }
    const subject_t *subject = find_subject(argv[1]);
    s_bench.random = 88172645463325252u;
    subject->set_up(&s_bench);
    if (argc == 4) {
        time_rounds(subject, &s_bench, (unsigned)count, (unsigned)rounds);
    } else {
        bench_region(subject, &s_bench, 0, (unsigned)count);
    }
    fprintf(stderr, "%u\n", (unsigned)(s_bench.sum & 0xFFFFu)); /* so that the compiler cannot leave the work out */
    return 0;
}
