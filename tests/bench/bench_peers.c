/* SPDX-License-Identifier: MIT
 * bench_peers.c - Heave's parts beside their peers, in turn within one process; tools/bench peers runs it and prints the figures.
 * Before a clock runs, the results of all are compared; where they do not agree there are no figures.
 *
 *   bench_peers                        `SUBJECT CANDIDATE...`, one line a subject; the first candidate is Heave
 *   bench_peers SUBJECT COUNT ROUNDS   `off CANDIDATE N OF`: values that are not the nearest, or cycles in which it gave up;
 *                                      then one line a round: ns of a run
 *                                      of each candidate, in their order. CPU time of this thread, each over COUNT runs.
 *   bench_peers SUBJECT COUNT CANDIDATE  COUNT runs in bench_region(), for callgrind --toggle-collect=bench_region*
 */
#include "bench_gateway.h"
#include "heave/frame.h"
#include "heave/kin.h"
#include "heave/ramp.h"
#include "heave/stream.h"
#include "peers.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define POSES          512u /* a power of 2 */
#define CANDIDATES_MAX 8u
#define PLATFORMS_MAX  64u
#define AXES           7u
#define SPEED          400
#define ACCEL          3000
#define JERK           50000
#define SIGNAL_CYCLES  10000u /* in which the signal repeats */
#define FOLLOWED_MM    20     /* the stream runs at 140 mm/s and 50 ms late */

typedef struct bench bench_t;

typedef struct {
    const char *name;
    void (*run)(bench_t *b, unsigned n);
} candidate_t;

typedef struct {
    const char *name;
    void (*set_up)(bench_t *b);
    void (*compare)(bench_t *b, const candidate_t *candidate); /* ends the program where they do not agree */
    candidate_t candidate[CANDIDATES_MAX];
} subject_t;

struct bench {
    bench_texts_t texts;
    frame_t frame;
    peer_frame_t peer_frame;
    bool is_read;
    kin_t kin;
    peer_hexapod_t hexapod;
    pose_t pose[POSES];
    pose_t guess[POSES];
    q32_t extension_mm_q32[POSES][CYLINDERS_MAX];
    double peer_pose[POSES][POSE_AXES];
    double peer_guess[POSES][POSE_AXES];
    double peer_extension[POSES][CYLINDERS_MAX];
    q32_t solved_q32[POSE_AXES];
    double peer_solved[POSE_AXES];
    double signal[SIGNAL_CYCLES][AXES];
    q32_t signal_q32[SIGNAL_CYCLES][AXES];
    stream_t stream;
    ramp_t ramp[AXES];
    uint64_t now_us;
    double position[AXES];
    bench_gateway_t platform[PLATFORMS_MAX];
    uint64_t random;
    uint64_t sum; /* of results, so that none is computed in vain */
};

static bench_t s_bench;

static double between(bench_t *b, double low, double high)
{
    b->random ^= b->random << 13;
    b->random ^= b->random >> 7;
    b->random ^= b->random << 17;
    return low + (high - low) * ((double)(b->random >> 11) / 9007199254740992.0);
}

/* --- Frames --- */

/* The examples of the vendor's document, but for the two with blanks, which from_chars() cannot read. */
static void set_up_document(bench_t *b)
{
    static const char *const k_frames[] = {
        "@A3:5.5,3.0,20,0F#",
        "@A3T:5.5,3.0,20,3000#",
        "@A4:5.5,3.0,20,45,0F#",
        "@A4T:5.5,3.0,20,45,3000#",
        "@A6:5,6,0,5.5,3.0,20,F0#",
        "@A6T:5,6,0,5.5,3.0,20,3000#",
        "@A7:5,6,0,5.5,3.0,20,-30,F0#",
        "@A7T:5,6,0,5.5,3.0,20,-30,3000#",
        "@C3:55,33,25,01#",
        "@C6:55,33,25,20,20,50,0100#",
        "@C6T:55,33,25,20,20,50,3000#",
        "@C7:55,33,25,20,20,50,25.5,0100#",
        "@C7T:55,33,25,20,20,50,25.5,3000#",
    };
    enum { FRAMES = sizeof k_frames / sizeof k_frames[0] };
    b->texts.count = BENCH_TEXTS;
    for (unsigned n = 0; n < BENCH_TEXTS; n++) {
        bench_put_text(&b->texts, n, k_frames[(unsigned)between(b, 0, FRAMES)]);
    }
}

static void set_up_stream_texts(bench_t *b)
{
    bench_make_stream(&b->texts, 60, 3);
}

static void set_up_long_texts(bench_t *b)
{
    b->texts.count = BENCH_TEXTS;
    for (unsigned n = 0; n < BENCH_TEXTS; n++) {
        char text[BENCH_TEXT_MAX];
        (void)snprintf(text, sizeof text, "@A7:%.6f,%.6f,%.6f,%.6f,%.6f,%.6f,%.6f,F0#", between(b, -20, 20), between(b, -20, 20),
                       between(b, -20, 20), between(b, -99, 99), between(b, -99, 99), between(b, -99, 99), between(b, -300, 300));
        bench_put_text(&b->texts, n, text);
    }
}

/* As the gateway reads a datagram, its end included. */
static void run_frame(bench_t *b, unsigned n)
{
    const unsigned i = n % b->texts.count;
    frame_scanner_t scanner;
    frame_reject_t why;
    size_t position = 0;
    frame_scanner_init(&scanner, FRAME_V3);
    b->is_read = false;
    while (frame_next(&scanner, (const uint8_t *)b->texts.text[i], b->texts.length[i], &position, &b->frame, &why) ==
           FRAME_EVENT_FRAME) {
        b->is_read = true;
    }
}

static void run_sscanf(bench_t *b, unsigned n)
{
    const unsigned i = n % b->texts.count;
    b->is_read = peer_sscanf(b->texts.text[i], b->texts.length[i], &b->peer_frame);
}

static void run_strtof(bench_t *b, unsigned n)
{
    const unsigned i = n % b->texts.count;
    b->is_read = peer_strtof(b->texts.text[i], b->texts.length[i], &b->peer_frame);
}

static bool is_same_frame(const frame_t *ours, const peer_frame_t *theirs)
{
    const char *name = frame_command_name(ours->command);
    return name[0] == theirs->command[0] && name[1] == theirs->command[1] && ours->is_timed == theirs->is_timed &&
           ours->count == theirs->count && ours->relay_mask == theirs->relay_mask && ours->time_ms == theirs->time_ms;
}

/* float and double round twice: one LSB of Q16.16 may be lost. */
static void compare_frames(bench_t *b, const candidate_t *candidate)
{
    unsigned off = 0, values = 0;
    for (unsigned n = 0; n < b->texts.count; n++) {
        run_frame(b, n);
        const bool is_read = b->is_read;
        candidate->run(b, n);
        if (!is_read || !b->is_read || !is_same_frame(&b->frame, &b->peer_frame)) {
            bench_fail("parsers read different frames");
        }
        for (unsigned i = 0; i < b->frame.count; i++) {
            const int64_t difference = (int64_t)b->frame.value_q16[i] - b->peer_frame.value_q16[i];
            if (llabs(difference) > 1) {
                bench_fail("parsers read different values");
            }
            off += difference != 0;
            values++;
        }
    }
    printf("off %s %u %u\n", candidate->name, off, values);
}

/* --- Kinematics --- */

static double mm_of(q16_t value_q16)
{
    return value_q16 / 65536.0;
}

static void set_hexapod(peer_hexapod_t *hexapod, const kin_geometry_t *geometry)
{
    for (unsigned axis = 0; axis < 3; axis++) {
        hexapod->mrp[axis] = mm_of(geometry->mrp_mm_q16[axis]);
    }
    hexapod->zero_height = mm_of(geometry->zero_height_mm_q16);
    for (unsigned i = 0; i < CYLINDERS_MAX; i++) {
        hexapod->retracted[i] = mm_of(geometry->retracted_mm_q16[i]);
        for (unsigned axis = 0; axis < 3; axis++) {
            hexapod->base[i][axis] = mm_of(geometry->base_mm_q16[i][axis]);
            hexapod->plate[i][axis] = mm_of(geometry->plate_mm_q16[i][axis]);
        }
    }
}

static void set_up_kinematics(bench_t *b)
{
    static const double k_size[POSE_AXES] = {6, 6, 8, 30, 30, 40};
    const settings_t settings = rig_hexapod();
    set_hexapod(&b->hexapod, &settings.geometry);
    if (kin_init(&b->kin, &settings.geometry) != HV_OK) {
        bench_fail("kin_init");
    }
    for (unsigned n = 0; n < POSES; n++) {
        for (unsigned i = 0; i < POSE_AXES; i++) {
            b->pose[n].axis_q32[i] = llround(between(b, -1, 1) * k_size[i] * 4294967296.0);
            b->guess[n].axis_q32[i] =
                b->pose[n].axis_q32[i] + llround(between(b, -1, 1) * (i < AXIS_X ? 0.05 : 0.5) * 4294967296.0);
            b->peer_pose[n][i] = (double)b->pose[n].axis_q32[i] / 4294967296.0;
            b->peer_guess[n][i] = (double)b->guess[n].axis_q32[i] / 4294967296.0;
        }
        if (kin_inverse(&b->kin, &b->pose[n], b->extension_mm_q32[n]) != HV_OK) {
            bench_fail("kin_inverse");
        }
        peer_inverse(&b->hexapod, b->peer_pose[n], b->peer_extension[n]);
    }
}

static void set_up_cold(bench_t *b)
{
    set_up_kinematics(b);
    memset(b->guess, 0, sizeof b->guess);
    memset(b->peer_guess, 0, sizeof b->peer_guess);
}

static void run_inverse(bench_t *b, unsigned n)
{
    b->is_read = kin_inverse(&b->kin, &b->pose[n % POSES], b->solved_q32) == HV_OK;
}

static void run_inverse_double(bench_t *b, unsigned n)
{
    peer_inverse(&b->hexapod, b->peer_pose[n % POSES], b->peer_solved);
    b->is_read = true;
}

static void run_forward(bench_t *b, unsigned n)
{
    pose_t pose;
    b->is_read = kin_forward(&b->kin, b->extension_mm_q32[n % POSES], &b->guess[n % POSES], &pose, NULL) == HV_OK;
    memcpy(b->solved_q32, pose.axis_q32, sizeof b->solved_q32);
}

static void run_forward_double(bench_t *b, unsigned n)
{
    b->is_read = peer_forward(&b->hexapod, b->peer_extension[n % POSES], b->peer_guess[n % POSES], b->peer_solved);
}

/* Within 1 um, and 1e-6 deg. */
static void compare_solutions(bench_t *b, const candidate_t *candidate, void (*ours)(bench_t *b, unsigned n), bool is_forward)
{
    for (unsigned n = 0; n < POSES; n++) {
        ours(b, n);
        const bool is_solved = b->is_read;
        candidate->run(b, n);
        for (unsigned i = 0; i < POSE_AXES; i++) {
            const double difference = fabs((double)b->solved_q32[i] / 4294967296.0 - b->peer_solved[i]);
            if (!is_solved || !b->is_read || difference > (is_forward && i < AXIS_X ? 1e-6 : 1e-3)) {
                bench_fail("kinematics give different results");
            }
        }
    }
}

static void compare_inverse(bench_t *b, const candidate_t *candidate)
{
    compare_solutions(b, candidate, run_inverse, false);
}

static void compare_forward(bench_t *b, const candidate_t *candidate)
{
    compare_solutions(b, candidate, run_forward, true);
}

/* --- Streams --- */

static void start_ramps(bench_t *b)
{
    ramp_limits_t limits;
    if (ramp_limits_from_units(-1000 * Q16_ONE, 1000 * Q16_ONE, SPEED * Q16_ONE, ACCEL * Q16_ONE, JERK, 1000, &limits) != HV_OK) {
        bench_fail("limits of the ramps");
    }
    b->now_us = 1000000;
    stream_init(&b->stream, 1000, AXES, STREAM_SMOOTH);
    for (unsigned i = 0; i < AXES; i++) {
        if (ramp_init(&b->ramp[i], &limits, 0) != HV_OK) {
            bench_fail("a ramp does not start");
        }
        const governor_limits_t asked = {limits.vel_per_cycle_q32, limits.acc_per_cycle2_q32, limits.jerk_per_cycle3_q32};
        stream_set_limits(&b->stream, i, &asked);
    }
#ifdef BENCH_RUCKIG
    peer_ruckig_start(SPEED, ACCEL, JERK);
#endif
}

static void set_up_stream(bench_t *b)
{
    for (unsigned n = 0; n < SIGNAL_CYCLES; n++) {
        bench_stream_pose(n / 1000.0, b->signal[n]);
        b->signal[n][AXES - 1] = b->signal[n][0] + b->signal[n][3];
        for (unsigned i = 0; i < AXES; i++) {
            b->signal_q32[n][i] = llround(b->signal[n][i] * 4294967296.0);
        }
    }
    start_ramps(b);
}

/* A sample at 60 Hz; a new reference for each ramp in every cycle. */
static void run_ramps(bench_t *b, unsigned n)
{
    ramp_ref_t ref[AXES] = {{0}};
    b->now_us += 1000;
    if (n * 60 / 1000 != (n + 1) * 60 / 1000) {
        stream_push(&b->stream, b->now_us, NULL, b->signal_q32[n % SIGNAL_CYCLES]);
    }
    q32_t position_q32[AXES];
    (void)stream_step(&b->stream, b->now_us, NULL, ref);
    (void)ramp_step_all(b->ramp, AXES, ref, RAMP_SOFT, position_q32);
    for (unsigned i = 0; i < AXES; i++) {
        b->position[i] = (double)position_q32[i] / 4294967296.0;
    }
}

#ifdef BENCH_RUCKIG
static void run_ruckig(bench_t *b, unsigned n)
{
    b->is_read = peer_ruckig_step(b->signal[n % SIGNAL_CYCLES], b->position);
}
#endif

/* Each follows the same signal for 10 s, as closely as its delay allows. Returns in how many cycles it gave up. */
static unsigned follow(bench_t *b, void (*run)(bench_t *b, unsigned n))
{
    unsigned failures = 0;
    for (unsigned n = 0; n < SIGNAL_CYCLES; n++) {
        b->is_read = true;
        run(b, n);
        failures += !b->is_read;
        for (unsigned i = 0; i < AXES; i++) {
            if (fabs(b->position[i] - b->signal[n][i]) > FOLLOWED_MM) {
                bench_fail("a limiter does not follow the stream");
            }
        }
    }
    return failures;
}

static void compare_following(bench_t *b, const candidate_t *candidate)
{
    (void)follow(b, run_ramps);
    start_ramps(b);
    printf("off %s %u %u\n", candidate->name, follow(b, candidate->run), SIGNAL_CYCLES);
    start_ramps(b);
}

/* --- Whole platforms --- */

static void set_up_platforms(bench_t *b)
{
    bench_make_stream(&b->texts, 60, 3);
    for (unsigned i = 0; i < PLATFORMS_MAX; i++) {
        bench_gateway_start(&b->platform[i]);
        b->platform[i].texts = &b->texts;
        b->platform[i].next_text = 64 * i;
    }
}

/* As many cycles whatever the number of platforms, so that each candidate is timed as long: all of them in turn, PLATFORMS_MAX in
 * all. Every platform gets its frames at other times. */
static void run_platforms(bench_t *b, unsigned platforms, unsigned n)
{
    const unsigned cycles = PLATFORMS_MAX / platforms;
    for (unsigned cycle = n * cycles; cycle < (n + 1) * cycles; cycle++) {
        for (unsigned i = 0; i < platforms; i++) {
            bench_gateway_stream_cycle(&b->platform[i], cycle + i);
        }
    }
}

#define PLATFORMS(count)                                                                                                         \
    static void run_platforms_##count(bench_t *b, unsigned n)                                                                    \
    {                                                                                                                            \
        run_platforms(b, count, n);                                                                                              \
    }
PLATFORMS(1)
PLATFORMS(2)
PLATFORMS(4)
PLATFORMS(8)
PLATFORMS(16)
PLATFORMS(32)
PLATFORMS(64)

#ifdef BENCH_CXX
static void run_from_chars(bench_t *b, unsigned n)
{
    const unsigned i = n % b->texts.count;
    b->is_read = peer_from_chars(b->texts.text[i], b->texts.length[i], &b->peer_frame);
}
#define FROM_CHARS {"from_chars", run_from_chars},
#else
#define FROM_CHARS
#endif
#ifdef BENCH_RUCKIG
#define RUCKIG {"ruckig", run_ruckig},
#else
#define RUCKIG
#endif

#define PARSERS                                                                                                                  \
    {                                                                                                                            \
        {"heave", run_frame}, {"sscanf", run_sscanf}, {"strtof", run_strtof}, FROM_CHARS                                         \
    }

static const subject_t k_subjects[] = {
    {"parse-document", set_up_document, compare_frames, PARSERS},
    {"parse-3", set_up_stream_texts, compare_frames, PARSERS},
    {"parse-6", set_up_long_texts, compare_frames, PARSERS},
    {"inverse", set_up_kinematics, compare_inverse, {{"heave", run_inverse}, {"double", run_inverse_double}}},
    {"forward-warm", set_up_kinematics, compare_forward, {{"heave", run_forward}, {"double", run_forward_double}}},
    {"forward-cold", set_up_cold, compare_forward, {{"heave", run_forward}, {"double", run_forward_double}}},
    {"stream", set_up_stream, compare_following, {{"heave", run_ramps}, RUCKIG}},
    {"platforms",
     set_up_platforms,
     NULL,
     {{"of-1", run_platforms_1},
      {"of-2", run_platforms_2},
      {"of-4", run_platforms_4},
      {"of-8", run_platforms_8},
      {"of-16", run_platforms_16},
      {"of-32", run_platforms_32},
      {"of-64", run_platforms_64}}},
};

#define SUBJECTS (sizeof k_subjects / sizeof k_subjects[0])

/* --- Measuring --- */

void bench_region(const candidate_t *candidate, bench_t *b, unsigned first, unsigned count);

/** Not inlined and not static, so that callgrind finds it by its name. */
__attribute__((noinline)) void bench_region(const candidate_t *candidate, bench_t *b, unsigned first, unsigned count)
{
    for (unsigned n = first; n < first + count; n++) {
        candidate->run(b, n);
        b->sum += b->is_read;
    }
}

/* Time that others take on this CPU does not count. */
static double clock_ns(void)
{
    struct timespec t;
    (void)clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return (double)t.tv_sec * 1e9 + (double)t.tv_nsec;
}

static unsigned candidates_of(const subject_t *subject)
{
    unsigned count = 0;
    while (count < CANDIDATES_MAX && subject->candidate[count].name != NULL) {
        count++;
    }
    return count;
}

/* The candidates take turns within a round, and each round begins with another one. */
static void time_rounds(const subject_t *subject, bench_t *b, unsigned count, unsigned rounds)
{
    const unsigned candidates = candidates_of(subject);
    for (unsigned round = 0; round <= rounds; round++) { /* the first one warms up */
        double took_ns[CANDIDATES_MAX] = {0};
        for (unsigned turn = 0; turn < candidates; turn++) {
            const unsigned i = (round + turn) % candidates;
            const double start = clock_ns();
            bench_region(&subject->candidate[i], b, round * count, count);
            took_ns[i] = (clock_ns() - start) / count;
        }
        for (unsigned i = 0; i < candidates && round > 0; i++) {
            printf("%.3f%c", took_ns[i], i + 1 < candidates ? ' ' : '\n');
        }
    }
}

static void count_runs(const subject_t *subject, bench_t *b, unsigned count, const char *name)
{
    for (unsigned i = 0; i < candidates_of(subject); i++) {
        if (strcmp(subject->candidate[i].name, name) == 0) {
            bench_region(&subject->candidate[i], b, 0, count);
            return;
        }
    }
    bench_fail("no such candidate");
}

static const subject_t *find_subject(const char *name)
{
    for (size_t i = 0; i < SUBJECTS; i++) {
        if (strcmp(name, k_subjects[i].name) == 0) {
            return &k_subjects[i];
        }
    }
    bench_fail("no such subject");
    return NULL;
}

static void list(void)
{
    for (size_t i = 0; i < SUBJECTS; i++) {
        printf("%s", k_subjects[i].name);
        for (unsigned k = 0; k < candidates_of(&k_subjects[i]); k++) {
            printf(" %s", k_subjects[i].candidate[k].name);
        }
        puts("");
    }
}

int main(int argc, char **argv)
{
    if (argc == 1) {
        list();
        return 0;
    }
    const long count = argc == 4 ? strtol(argv[2], NULL, 10) : 0;
    if (count < 1 || count > 1000000) {
        bench_fail("usage: bench_peers [SUBJECT COUNT ROUNDS|CANDIDATE]");
    }
    const subject_t *subject = find_subject(argv[1]);
    char *end = NULL;
    const long rounds = strtol(argv[3], &end, 10);
    const bool is_timed = *end == '\0' && rounds > 0 && rounds < 100000;
    s_bench.random = 88172645463325252u;
    subject->set_up(&s_bench);
    for (unsigned i = 1; i < candidates_of(subject) && is_timed && subject->compare != NULL; i++) {
        subject->compare(&s_bench, &subject->candidate[i]);
    }
    if (is_timed) {
        time_rounds(subject, &s_bench, (unsigned)count, (unsigned)rounds);
    } else {
        count_runs(subject, &s_bench, (unsigned)count, argv[3]);
    }
    fprintf(stderr, "%u\n", (unsigned)(s_bench.sum & 0xFFFFu)); /* so that the compiler cannot leave the work out */
    return 0;
}
