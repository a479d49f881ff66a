/* SPDX-License-Identifier: MIT
 * test_excitation.c - test signals: their shape against double precision, and their bounds by finite differences of the shares
 * alone, over many frequencies, limits and cycle times.
 */
#include "heave/excitation.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "unity.h"

#define SAMPLES_MAX 700000

static excitation_t m_signal;
static double m_share[SAMPLES_MAX + 8];
static int m_samples;
static uint64_t m_random;

void setUp(void)
{
    m_random = 88172645463325252u;
}

void tearDown(void) {}

static double random_unit(void)
{
    m_random ^= m_random << 13;
    m_random ^= m_random >> 7;
    m_random ^= m_random << 17;
    return (double)(m_random >> 11) / 9007199254740992.0;
}

static double random_log(double low, double high)
{
    return low * pow(high / low, random_unit());
}

/* Limits of an axis, in mm and s, for an amplitude. */
static path_limits_t limits_of(double vel, double acc, double jerk, double amplitude, double cycle_s)
{
    const double of[3] = {vel * cycle_s, acc * cycle_s * cycle_s, jerk * cycle_s * cycle_s * cycle_s};
    int64_t q62[3];
    for (unsigned i = 0; i < 3; i++) {
        const double share = of[i] / amplitude;
        q62[i] = share >= 1 ? Q62_ONE : (int64_t)(share * (double)Q62_ONE);
    }
    return (path_limits_t){q62[0], q62[1], q62[2]};
}

static void run(void)
{
    m_samples = 0;
    m_share[m_samples++] = 0;
    m_share[m_samples++] = 0;
    m_share[m_samples++] = 0;
    while (!excitation_is_done(&m_signal) && m_samples < SAMPLES_MAX) {
        m_share[m_samples++] = (double)excitation_step(&m_signal) / (double)Q62_ONE;
    }
    for (unsigned i = 0; i < 4; i++) {
        m_share[m_samples++] = (double)excitation_step(&m_signal) / (double)Q62_ONE;
    }
}

/* The largest of the k-th differences. */
static double largest(unsigned k)
{
    double most = 0;
    for (int i = 3; i < m_samples; i++) {
        const double *s = &m_share[i];
        const double d = k == 0   ? s[0]
                         : k == 1 ? s[0] - s[-1]
                         : k == 2 ? s[0] - 2 * s[-1] + s[-2]
                                  : s[0] - 3 * s[-1] + 3 * s[-2] - s[-3];
        most = fabs(d) > most ? fabs(d) : most;
    }
    return most;
}

static excitation_request_t wish(excitation_kind_t kind, double from_hz, double to_hz, double seconds)
{
    return (excitation_request_t){.kind = kind,
                                  .amplitude_q16 = 65536,
                                  .from_mhz = (uint32_t)lround(from_hz * 1000),
                                  .to_mhz = (uint32_t)lround(to_hz * 1000),
                                  .duration_ms = (uint32_t)lround(seconds * 1000)};
}

static void start(excitation_request_t request, const path_limits_t *limits, uint32_t cycle_us)
{
    TEST_ASSERT_TRUE(excitation_is_allowed(&request, cycle_us));
    TEST_ASSERT_EQUAL(HV_OK, excitation_init(&m_signal, &request, limits, cycle_us));
}

static void test_a_sine_is_a_sine_of_its_frequency(void)
{
    const path_limits_t wide = path_limits_none();
    start(wish(EXCITATION_SINE, 1.5, 0, 12), &wide, 1000);
    run();
    TEST_ASSERT_EQUAL(12000, m_samples - 3 - 4);
    const double height = m_share[2 + 3500]; /* 5.25 periods */
    TEST_ASSERT_TRUE(height > 0.98 && height <= 1);
    for (int i = 3000; i < 9000; i++) { /* between the ramps of 1333 ms */
        TEST_ASSERT_DOUBLE_WITHIN(1e-9, height * sin(2 * acos(-1) * 1.5 * (i - 2) / 1000.0), m_share[i]);
    }
    TEST_ASSERT_TRUE(m_share[m_samples - 5] == 0);
}

static void test_a_chirp_sweeps_its_band(void)
{
    const path_limits_t wide = path_limits_none();
    double crossing[2] = {0, 0};
    start(wish(EXCITATION_CHIRP, 0.5, 20, 30), &wide, 1000);
    run();
    TEST_ASSERT_EQUAL(30000, m_samples - 3 - 4);
    for (int i = 4; i < m_samples; i++) { /* half periods, by zero crossings: none is longer than the one before */
        if ((m_share[i - 1] < 0) != (m_share[i] < 0) && i > 10 && i < m_samples - 8) {
            const double at = i - 1 + m_share[i - 1] / (m_share[i - 1] - m_share[i]);
            if (crossing[0] > 0) {
                TEST_ASSERT_TRUE(at - crossing[1] <= (crossing[1] - crossing[0]) * 1.02 + 0.5);
            }
            crossing[0] = crossing[1];
            crossing[1] = at;
        }
    }
    TEST_ASSERT_DOUBLE_WITHIN(0.5, 25, crossing[1] - crossing[0]); /* 20 Hz at the end */
    TEST_ASSERT_TRUE(largest(0) > 0.99);
}

/* Of signals and limits of all kinds: no share beyond 1, no limit beyond itself, rest at both ends. */
static void test_no_signal_goes_beyond_its_limits(void)
{
    double most[4] = {0};
    unsigned made = 0;
    for (unsigned n = 0; n < 400; n++) {
        static const uint32_t k_cycles_us[] = {500, 1000, 2000, 5000, 10000};
        const uint32_t cycle_us = k_cycles_us[n % 5];
        const double cycle_s = cycle_us / 1e6;
        const double top_hz = 1 / (8 * cycle_s) < 50 ? 1 / (8 * cycle_s) : 50;
        const double from = random_log(0.05, top_hz / 1.5);
        const double to = random_log(from * 1.2, top_hz);
        const excitation_kind_t kind = (excitation_kind_t)(n % 4);
        const bool has_band = kind == EXCITATION_CHIRP || kind == EXCITATION_NOISE;
        const double periods = 2 + fmax(4.01, kind == EXCITATION_CHIRP ? 1.85 * log(to / from) : 0);
        const double seconds = (fmax(2.5, periods / from) + 1.5) * (1 + random_unit());
        const double amplitude = random_log(0.1, 20);
        const path_limits_t limits =
            limits_of(random_log(5, 500), random_log(50, 10000), random_log(1000, 1e6), amplitude, cycle_s);
        const excitation_request_t request = wish(kind, from, has_band ? to : 0, seconds);
        if (!excitation_is_allowed(&request, cycle_us) || excitation_init(&m_signal, &request, &limits, cycle_us) != HV_OK ||
            seconds / cycle_s > SAMPLES_MAX - 1000) {
            continue;
        }
        made++;
        run();
        const double bound[4] = {1, (double)limits.vel_q62 / (double)Q62_ONE, (double)limits.acc_q62 / (double)Q62_ONE,
                                 (double)limits.jerk_q62 / (double)Q62_ONE};
        for (unsigned k = 0; k < 4; k++) {
            const double used = largest(k) / bound[k];
            char text[160];
            (void)snprintf(text, sizeof text, "kind %u, difference %u: %.4f of its bound at %.3f Hz to %.3f, %u us", kind, k,
                           used, from, to, cycle_us);
            most[k] = used > most[k] ? used : most[k];
            TEST_ASSERT_TRUE_MESSAGE(used <= 1.0 + (k == 3 ? 1e-3 : 1e-6), text);
        }
        TEST_ASSERT_TRUE(m_share[m_samples - 5] == 0 || fabs(m_share[m_samples - 5]) < 1e-6);
    }
    TEST_ASSERT_TRUE(made > 300);
    TEST_ASSERT_TRUE(most[0] > 0.99 && most[1] > 0.7 && most[2] > 0.6 && most[3] > 0.5); /* they are used, too */
}

static void test_steps_go_to_one_side_and_come_back(void)
{
    const path_limits_t limits = limits_of(50, 2000, 50000, 2, 0.001);
    int outs = 0;
    start(wish(EXCITATION_STEP, 0.5, 0, 9), &limits, 1000);
    run();
    for (int i = 3; i < m_samples; i++) {
        TEST_ASSERT_TRUE(m_share[i] >= 0);
        outs += m_share[i] == 1.0 && m_share[i - 1] < 1.0;
    }
    TEST_ASSERT_EQUAL(4, outs); /* the fifth would not come back in time */
    TEST_ASSERT_TRUE(m_share[m_samples - 1] == 0);
}

static void test_noise_is_the_same_each_time(void)
{
    static double first[20000];
    const path_limits_t wide = path_limits_none();
    start(wish(EXCITATION_NOISE, 0.5, 20, 15), &wide, 1000);
    run();
    memcpy(first, m_share, sizeof first);
    start(wish(EXCITATION_NOISE, 0.5, 20, 15), &wide, 1000);
    run();
    TEST_ASSERT_EQUAL_MEMORY(first, m_share, 15000 * sizeof first[0]);
    TEST_ASSERT_TRUE(largest(0) > 0.3);
}

static void test_what_makes_no_signal_is_refused(void)
{
    const path_limits_t wide = path_limits_none();
    const path_limits_t nothing = {0, Q62_ONE, Q62_ONE};
    const excitation_request_t good = wish(EXCITATION_CHIRP, 0.5, 20, 30);
#define REFUSED(member, value)                                                                                                   \
    do {                                                                                                                         \
        excitation_request_t bad = good;                                                                                         \
        bad.member = (value);                                                                                                    \
        TEST_ASSERT_FALSE_MESSAGE(excitation_is_allowed(&bad, 1000), #member " " #value);                                        \
        TEST_ASSERT_EQUAL(HV_ERR_RANGE, excitation_init(&m_signal, &bad, &wide, 1000));                                          \
    } while (0)
    REFUSED(kind, EXCITATION_KINDS);
    REFUSED(kind, EXCITATION_SINE); /* takes one frequency */
    REFUSED(amplitude_q16, 0);
    REFUSED(amplitude_q16, -65536);
    REFUSED(from_mhz, 9);
    REFUSED(from_mhz, 0);
    REFUSED(to_mhz, 50001);
    REFUSED(to_mhz, 500); /* no band */
    REFUSED(to_mhz, 0);
    REFUSED(duration_ms, 2999);
    REFUSED(duration_ms, 11999); /* less than six periods */
    REFUSED(duration_ms, 600001);
#undef REFUSED
    TEST_ASSERT_FALSE(excitation_is_allowed(&good, 10000)); /* 20 Hz of 10 ms: five cycles for a period */
    TEST_ASSERT_EQUAL(HV_ERR_RANGE, excitation_init(&m_signal, &good, &nothing, 1000));
    TEST_ASSERT_EQUAL(HV_ERR_RANGE, excitation_init(&m_signal, &good, &(path_limits_t){Q62_ONE, 0, Q62_ONE}, 1000));
    TEST_ASSERT_EQUAL(HV_ERR_RANGE, excitation_init(&m_signal, &good, &(path_limits_t){Q62_ONE, Q62_ONE, 0}, 1000));
}

/* From 0.1 to 50 Hz there are nine octaves: 1.3 periods of 10 s each, and the ramps. */
static void test_chirp_that_rises_too_quickly_is_refused(void)
{
    const excitation_request_t quick = wish(EXCITATION_CHIRP, 0.1, 50, 100);
    const excitation_request_t slow = wish(EXCITATION_CHIRP, 0.1, 50, 160);
    TEST_ASSERT_FALSE(excitation_is_allowed(&quick, 1000));
    TEST_ASSERT_TRUE(excitation_is_allowed(&slow, 1000));
}

/* Where the band ends at eight cycles for a period nothing leads beyond. */
static void test_chirp_to_the_highest_frequency_ends_there(void)
{
    const path_limits_t wide = path_limits_none();
    for (unsigned seconds = 20; seconds < 60; seconds++) {
        int64_t most = 0;
        start(wish(EXCITATION_CHIRP, 1, 50, seconds), &wide, 2500);
        while (!excitation_is_done(&m_signal)) {
            const int64_t before = m_signal.turn_q64[0];
            (void)excitation_step(&m_signal);
            TEST_ASSERT_TRUE(m_signal.turn_q64[0] >= before);
            most = m_signal.turn_q64[0] > most ? m_signal.turn_q64[0] : most;
        }
        TEST_ASSERT_TRUE(most <= (int64_t)1 << 61 && most > ((int64_t)1 << 61) / 100 * 99);
    }
}

/* However many cycles the sweep has. */
static void test_chirp_never_leaves_its_band(void)
{
    const path_limits_t wide = path_limits_none();
    const double band_q64 = ldexp(0.05, 64); /* 50 Hz, in turns per cycle */
    for (unsigned more = 0; more < 16; more++) {
        start(wish(EXCITATION_CHIRP, 5, 50, 3.5 + 0.001 * more), &wide, 1000);
        while (!excitation_is_done(&m_signal)) {
            (void)excitation_step(&m_signal);
            TEST_ASSERT_TRUE((double)m_signal.turn_q64[0] <= band_q64);
        }
        TEST_ASSERT_TRUE((double)m_signal.turn_q64[0] > 0.97 * band_q64);
    }
}

/* What is narrowest still moves: the least limits that a signal can have. */
static void test_signal_of_the_least_limits_has_an_amplitude(void)
{
    const path_limits_t least = {1, 1, 1};
    static const excitation_kind_t k_kinds[] = {EXCITATION_SINE, EXCITATION_NOISE, EXCITATION_CHIRP};
    for (unsigned i = 0; i < 3; i++) {
        start(wish(k_kinds[i], 2, k_kinds[i] == EXCITATION_SINE ? 0 : 50, 30), &least, 1000);
        TEST_ASSERT_TRUE(m_signal.share_q62[0] > 0);
        TEST_ASSERT_TRUE(m_signal.share_q62[0] < Q62_ONE / 1000000);
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_a_sine_is_a_sine_of_its_frequency);
    RUN_TEST(test_a_chirp_sweeps_its_band);
    RUN_TEST(test_no_signal_goes_beyond_its_limits);
    RUN_TEST(test_steps_go_to_one_side_and_come_back);
    RUN_TEST(test_noise_is_the_same_each_time);
    RUN_TEST(test_what_makes_no_signal_is_refused);
    RUN_TEST(test_chirp_that_rises_too_quickly_is_refused);
    RUN_TEST(test_chirp_to_the_highest_frequency_ends_there);
    RUN_TEST(test_chirp_never_leaves_its_band);
    RUN_TEST(test_signal_of_the_least_limits_has_an_amplitude);
    return UNITY_END();
}
