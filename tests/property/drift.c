/* SPDX-License-Identifier: MIT
 * drift.c - a platform that has come to rest on a target stays there to the last bit, however long: after random rides, with a
 * sender that goes on to repeat its last frame and with one that has gone silent.
 *
 *   drift [SEED [CYCLES [RIDES]]]      CYCLES of rest after each of RIDES rides; a day is 86400000
 *
 * That nothing changes in a day is shown in two ways. By induction: everything of the motion that set-points come from (all of it
 * but times, counts and places in rings) is the same before and after each cycle, whatever the time it is told. And by running
 * the cycles, as many as are asked for, through the whole gateway.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "random.h"
#include "rig.h"

#define CYCLES_DEFAULT 100000
#define RIDES_DEFAULT  8
#define REST_MS        30000u /* a ride is at rest after so long, or never */
#define FADE_CYCLES    20000  /* what ramps remember of a motion has faded by then */
#define PROVED_CYCLES  20000u
#define PERIODS_60_HZ  16667u /* us */

static rig_t m_rig;
static long m_cycles, m_proved;
static q32_t m_rest_q32[DRIVES_MAX];
static bool m_is_watching;
static long m_moved;
static uint64_t m_moved_us;
static unsigned m_case;

static double around(double range)
{
    return ((double)(random_bits() >> 11) / 4503599627370496.0 - 1) * range;
}

static void watch(void *ctx)
{
    (void)ctx;
    if (m_is_watching && memcmp(m_rest_q32, m_rig.sent_q32, sizeof m_rest_q32) != 0) {
        m_moved_us = m_moved++ == 0 ? m_rig.now_us : m_moved_us;
    }
}

static void report(bool is_ok, const char *what, const char *ride)
{
    printf("%s %u - %s, %s\n", is_ok ? "ok" : "not ok", ++m_case, ride, what);
}

/* ---- rides ---- */

typedef struct {
    bool is_pose, is_repeated;
    double target[AXES_MAX];
    unsigned count;
    char text[400]; /* the frame that it ends with */
} ride_t;

static void make_frame(ride_t *ride, double size, unsigned time_ms)
{
    const unsigned cylinders = m_rig.gateway.snapshot.cylinders;
    ride->count = cylinders + (m_rig.settings.has_angle ? 1u : 0u);
    int used = snprintf(ride->text, sizeof ride->text, "@%c%u%s:", ride->is_pose ? 'A' : 'C', ride->count, time_ms ? "T" : "");
    for (unsigned i = 0; i < ride->count; i++) {
        const bool is_angle = i == cylinders, is_rotation = cylinders == 3 ? i < 2 : i < 3;
        const double value = is_angle         ? around(90)
                             : !ride->is_pose ? 100 + around(15 * size)
                                              : around((is_rotation ? 3 : 15) * size);
        const int printed = snprintf(ride->text + used, sizeof ride->text - (size_t)used, "%.*f,", (int)random_below(7), value);
        ride->target[i] = strtod(ride->text + used, NULL);
        used += printed;
    }
    (void)snprintf(ride->text + used, sizeof ride->text - (size_t)used, "%u#", time_ms);
}

/* Some seconds of frames of one kind: steps, timed moves, a stream of wild ones. The last one is what it rests on. */
static void make_ride(ride_t *ride)
{
    static const unsigned k_gaps_ms[] = {4, 16, 16, 33, 100, 400};
    const unsigned parts = 1 + random_below(4);
    for (unsigned part = 0; part < parts; part++) {
        const unsigned gap_ms = k_gaps_ms[random_below(6)], frames = 2 + random_below(100);
        const unsigned time_ms = random_below(3) == 0 ? 1 + random_below(2 * gap_ms) : 0;
        const double size = (1 + random_below(10)) / 10.0;
        ride->is_pose = random_below(3) != 0;
        for (unsigned i = 0; i < frames; i++) {
            make_frame(ride, size, time_ms);
            rig_send(&m_rig, ride->text);
            rig_run_ms(&m_rig, gap_ms);
        }
    }
}

/* ---- repeating the last frame ---- */

static void run(const ride_t *ride, long cycles)
{
    if (!ride->is_repeated) {
        rig_run_ms(&m_rig, (unsigned)cycles);
        return;
    }
    const uint64_t end_us = m_rig.now_us + (uint64_t)cycles * 1000;
    uint64_t sent_us = m_rig.now_us;
    while (m_rig.now_us < end_us) {
        rig_send(&m_rig, ride->text);
        sent_us += PERIODS_60_HZ;
        const uint64_t next_us = sent_us + random_below(5000); /* jitter */
        const uint64_t until_us = next_us < end_us ? next_us : end_us;
        rig_run_ms(&m_rig, until_us > m_rig.now_us ? (unsigned)((until_us - m_rig.now_us + 999) / 1000) : 1);
    }
}

static bool comes_to_rest(const ride_t *ride)
{
    for (unsigned ms = 0; ms < REST_MS; ms += 1000) {
        memcpy(m_rest_q32, m_rig.sent_q32, sizeof m_rest_q32);
        m_moved = 0;
        m_is_watching = true;
        run(ride, 1000);
        m_is_watching = false;
        if (m_moved == 0 && motion_is_at_rest(&m_rig.gateway.motion)) {
            return true;
        }
    }
    return false;
}

/* On the target, but for the last bit of a frame's Q16.16. */
static bool is_on_target(const ride_t *ride)
{
    const unsigned cylinders = m_rig.gateway.snapshot.cylinders;
    for (unsigned i = 0; i < ride->count; i++) {
        static const unsigned k_tripod_axes[] = {AXIS_ROLL, AXIS_PITCH, AXIS_Z};
        const double at = i == cylinders   ? rig_angle_deg(&m_rig)
                          : !ride->is_pose ? rig_cylinder_mm(&m_rig, i + 1)
                          : cylinders == 3 ? rig_pose(&m_rig, k_tripod_axes[i])
                                           : rig_pose(&m_rig, i);
        if (fabs(at - ride->target[i]) > 1.0 / 65536) {
            printf("# value %u rests at %.9f\n", i + 1, at);
            return false;
        }
    }
    return true;
}

/* ---- the proof ---- */

/* What of a motion set-points come from: times, counts and places in rings set to nothing. How a motion would go on is forgotten
 * where no sample is missing, as it is found anew before it is used. */
static void essence(motion_t *motion)
{
    motion->times.last_us = 0;
    motion->gate = (spike_filter_t){0};
    stream_t *stream = &motion->stream;
    memset(&stream->thin, 0, sizeof stream->thin);
    memset(&stream->clock, 0, sizeof stream->clock);
    memset(&stream->evidence, 0, sizeof stream->evidence); /* which values came at which times, ... */
    stream->sample = (stream_sample_t){0};                 /* ... and how well they fitted; all are equal now */
    stream->between_q32 = stream->error_q32 = stream->rate_q32[0] = stream->rate_q32[1] = 0;
    stream_curve_t *curve = &stream->curve;
    for (unsigned i = 0; i < AXES_MAX; i++) {
        curve->extrapolation[i] = (stream_extrapolation_t){0};
        curve->low_q32[i] = curve->high_q32[i] =
            0; /* the recent range narrows for half a minute; off_q32, which it bounds, is compared */
    }
    curve->predictor = (stream_predictor_t){0};
    curve->head = curve->watched = 0;
    curve->mean_points = 0; /* of equal points, any number has the same mean, ... */
    curve->led_q32 = 0;     /* ... and none leads anywhere, ... */
    curve->change = 0;      /* ... nor is a change of them one */
    memset(curve->was_q32, 0, sizeof curve->was_q32);
    curve->ahead = curve->patience = 0;
    curve->period_cycles_q16 = curve->bandwidth_q32 = curve->softest_q32 = 0;
    curve->reach_min_q16 = curve->reach_max_q16 = 0;
    governor_t *governor =
        &curve->governor; /* its levels, output and strength are compared; the rest is worked out from the period */
    governor->period_us = governor->single_us = 0;
    memset(governor->event, 0, sizeof governor->event); /* when more was needed than there was */
    governor->fall_q32 = governor->strength_q32 == 0 ? 0 : governor->fall_q32;
    memset(governor->per_limit_q62, 0, sizeof governor->per_limit_q62);
    memset(governor->share_q32, 0, sizeof governor->share_q32);
    curve->is_off = false; /* off_q32 says how far, and is compared */
    memset(curve->is_sample, 0, sizeof curve->is_sample);
}

/* A T frame that is repeated with jitter may be a sample now and a move then, both to where the platform is: then the ramps alone
 * are compared. */
static void ramps_alone(motion_t *motion)
{
    unsigned char *from = (unsigned char *)&motion->source;
    memset(from, 0, (size_t)((unsigned char *)(motion + 1) - from));
}

static unsigned first_difference(const motion_t *a, const motion_t *b)
{
    unsigned i = 0;
    while (i < sizeof *a && ((const unsigned char *)a)[i] == ((const unsigned char *)b)[i]) {
        i++;
    }
    return i;
}

static bool is_same(const motion_t *before, const motion_t *after, bool is_source_kept)
{
    static motion_t s_before, s_after;
    memcpy(&s_before, before, sizeof s_before);
    memcpy(&s_after, after, sizeof s_after);
    essence(&s_before);
    essence(&s_after);
    if (!is_source_kept) {
        ramps_alone(&s_before);
        ramps_alone(&s_after);
    }
    const unsigned byte = first_difference(&s_before, &s_after);
    if (byte < sizeof s_before) {
        printf("# the state changes at rest, first at byte %u of motion_t\n", byte);
    }
    return byte == sizeof s_before;
}

static bool is_fixed_point(const ride_t *ride)
{
    static const uint64_t k_leaps_us[] = {1000, 1000000, 3600000000u, 86400000000u, UINT64_C(3155760000000000)};
    static motion_t s_before, s_after;
    motion_output_t out;
    const bool is_source_kept = !ride->is_repeated || strchr(ride->text, 'T') == NULL;
    run(ride, FADE_CYCLES);
    memcpy(&s_before, &m_rig.gateway.motion, sizeof s_before);
    for (unsigned i = 0; i < PROVED_CYCLES; i += 7) {
        run(ride, 7);
        if (!is_same(&s_before, &m_rig.gateway.motion, is_source_kept)) {
            return false;
        }
        m_proved += 7;
    }
    for (unsigned i = 0; i < sizeof k_leaps_us / sizeof k_leaps_us[0]; i++) {
        memcpy(&s_after, &m_rig.gateway.motion, sizeof s_after);
        motion_step(&s_after, m_rig.now_us + k_leaps_us[i], &out);
        if (!is_same(&s_before, &s_after, is_source_kept)) {
            return false;
        }
    }
    return true;
}

static bool stays(const ride_t *ride, long cycles)
{
    m_moved = 0;
    m_is_watching = true;
    run(ride, cycles);
    m_is_watching = false;
    m_cycles += cycles;
    if (m_moved > 0) {
        printf("# %ld cycles beside where it rested, the first at %.3f s\n", m_moved, (double)m_moved_us / 1e6);
    }
    return m_moved == 0;
}

static bool try_ride(const char *platform, bool is_repeated, long cycles)
{
    ride_t ride = {.is_repeated = is_repeated};
    char name[80];
    make_ride(&ride);
    (void)snprintf(name, sizeof name, "%s, %s frame %s", platform, ride.is_pose ? "pose" : "cylinder",
                   is_repeated ? "repeated at 60 Hz" : "alone");
    const bool rests = comes_to_rest(&ride) && is_on_target(&ride);
    report(rests, "comes to rest on it", name);
    const bool is_fixed = rests && is_fixed_point(&ride);
    report(is_fixed, "a cycle changes nothing that set-points come from", name);
    const bool is_there = rests && stays(&ride, cycles);
    report(is_there, "set-points stay to the last bit", name);
    if (!(rests && is_fixed && is_there)) {
        printf("# ended with %s\n", ride.text);
    }
    return rests && is_fixed && is_there;
}

static bool try_platform(const char *name, settings_t settings, long cycles, long rides)
{
    rig_start(&m_rig, &settings, true);
    m_rig.is_checking = false;
    m_rig.after_cycle = watch;
    bool is_ok = rig_run_until(&m_rig, STATE_ENGAGED, 60000);
    for (long i = 0; i < rides; i++) {
        is_ok &= try_ride(name, i % 2 == 1, cycles);
    }
    return is_ok;
}

int main(int count, char **arguments)
{
    const uint64_t seed = count > 1 ? strtoull(arguments[1], NULL, 0) : 20261122;
    const long cycles = count > 2 ? strtol(arguments[2], NULL, 0) : CYCLES_DEFAULT;
    const long rides = count > 3 ? strtol(arguments[3], NULL, 0) : RIDES_DEFAULT;
    printf("TAP version 13\n1..%ld\n# seed %llu; again: drift SEED CYCLES RIDES\n", 6 * rides, (unsigned long long)seed);
    random_begin(seed * 0x9E3779B97F4A7C15u + 1);
    bool is_ok = try_platform("hexapod", rig_hexapod(), cycles, rides);
    is_ok &= try_platform("tripod", rig_tripod(), cycles, rides);
    printf("# figure %ld cycles at rest, set-points compared bit by bit\n# figure %ld of state compared\n", m_cycles, m_proved);
    return is_ok ? EXIT_SUCCESS : EXIT_FAILURE;
}
