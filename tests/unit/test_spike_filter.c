/* SPDX-License-Identifier: MIT
 * test_spike_filter.c - the spike gate: wild samples, steps, losses, jitter, duplicates and ordinary motion at all rates.
 * Signals and arrivals are made here in double precision; the period is that of the sender, as a settled clock finds it.
 */
#include "heave/spike_filter.h"
#include "random.h"
#include "unity.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#define ACCEL  3000.0 /* mm/s^2 and deg/s^2 */
#define FACTOR 10
#define SINES  6

static spike_filter_t s_gate;

void hv_assert_failed(const char *file, int line)
{
    printf("%s:%d: assertion\n", file, line);
    abort();
}

static void start(uint32_t factor)
{
    q16_t accel_q16[POSE_AXES];
    for (unsigned i = 0; i < POSE_AXES; i++) {
        accel_q16[i] = (q16_t)(ACCEL * 65536);
    }
    TEST_ASSERT_EQUAL(HV_OK, spike_filter_init(&s_gate, accel_q16, factor));
}

void setUp(void)
{
    random_begin(RANDOM_SEED);
    start(FACTOR);
}

void tearDown(void) {}

/* A sample with one axis away from zero, and the same for all axes. */
static bool push(double at_s, uint32_t period_us, unsigned axis, double value)
{
    q32_t sample[POSE_AXES] = {0};
    sample[axis] = (q32_t)llround(value * 65536) * 65536;
    return spike_filter_passes(&s_gate, (uint64_t)llround(at_s * 1e6), period_us, sample);
}

/* A motion cue signal whose acceleration goes up to a share of the limit. */
static struct {
    double hz[SINES], amplitude[SINES], phase[SINES], speed;
} s_signal;

static void make_signal(double share)
{
    double accel = 0;
    for (int i = 0; i < SINES; i++) {
        s_signal.hz[i] = 0.1 * pow(30, (i + random_unit()) / SINES);
        s_signal.phase[i] = 6.283185307 * random_unit();
        s_signal.amplitude[i] = (0.3 + random_unit()) / pow(s_signal.hz[i], 1.2);
        accel += s_signal.amplitude[i] * pow(6.283185307 * s_signal.hz[i], 2);
    }
    s_signal.speed = 0;
    for (int i = 0; i < SINES; i++) {
        s_signal.amplitude[i] *= share * ACCEL / accel;
        s_signal.speed += s_signal.amplitude[i] * 6.283185307 * s_signal.hz[i];
    }
}

static double signal_at(double t)
{
    double sum = 0;
    for (int i = 0; i < SINES; i++) {
        sum += s_signal.amplitude[i] * sin(6.283185307 * s_signal.hz[i] * t + s_signal.phase[i]);
    }
    return sum;
}

static const double k_rates_hz[] = {10, 20, 30, 50, 60, 100, 144, 200};
enum { RATES = sizeof k_rates_hz / sizeof k_rates_hz[0] };

/* ---- what must pass ---- */

/* The network: jitter in ms, losses, now and then a burst after silence; arrivals never decrease and are seen each ms. */
typedef struct {
    double jitter_ms, loss, burst;
} network_t;

static double arrival(const network_t *network, double sent, double *held_until, double before)
{
    if (random_unit() < network->burst) {
        *held_until = sent + 0.05 * random_unit();
    }
    const double through = sent + 0.002 + 0.001 * network->jitter_ms * random_unit();
    const double at = fmax(fmax(through, *held_until), before);
    return ceil(at * 1000) / 1000;
}

static void test_gate_passes_ordinary_motion_at_all_rates(void)
{
    static const network_t k_networks[] = {{0, 0, 0}, {5, 0.01, 0}, {5, 0.1, 0}, {15, 0.02, 0}, {2, 0.02, 0.01}};
    static const double k_shares[] = {0.1, 0.5, 1, 2, 3};
    for (unsigned r = 0; r < RATES; r++) {
        for (unsigned n = 0; n < sizeof k_networks / sizeof k_networks[0]; n++) {
            for (unsigned run = 0; run < 25; run++) {
                double held = 0, before = 0;
                start(FACTOR);
                make_signal(k_shares[run % 5]);
                for (double t = 0; t < 20; t += 1 / k_rates_hz[r]) {
                    const double at = arrival(&k_networks[n], t, &held, before);
                    if (random_unit() < k_networks[n].loss) {
                        continue;
                    }
                    before = at;
                    TEST_ASSERT_TRUE(
                        push(at, (uint32_t)(1e6 / k_rates_hz[r]), run % POSE_AXES, round(signal_at(t) * 1000) / 1000));
                }
                TEST_ASSERT_EQUAL_UINT32(0, spike_filter_spikes(&s_gate));
            }
        }
    }
}

static void test_gate_passes_frames_that_come_twice(void)
{
    make_signal(2);
    for (int i = 0; i < 5000; i++) {
        const double t = i * 0.01, value = signal_at(t);
        TEST_ASSERT_TRUE(push(t, 10000, AXIS_Z, value));
        if (random_unit() < 0.3) {
            TEST_ASSERT_TRUE(push(t + 0.009 * random_unit(), 10000, AXIS_Z, value));
        }
    }
}

static void test_gate_passes_everything_outside_a_stream(void)
{
    for (int i = 0; i < 100; i++) {
        TEST_ASSERT_TRUE(push(i, 0, AXIS_X, i % 2 * 100));
    }
    start(0);
    for (int i = 0; i < 100; i++) {
        TEST_ASSERT_TRUE(push(i * 0.02, 20000, AXIS_X, i % 2 * 100));
    }
    TEST_ASSERT_EQUAL_UINT32(0, spike_filter_spikes(&s_gate));
}

static void test_gate_passes_after_a_gap_without_a_known_course(void)
{
    for (int i = 0; i < 50; i++) {
        TEST_ASSERT_TRUE(push(i * 0.02, 20000, AXIS_X, 0));
    }
    TEST_ASSERT_TRUE(push(1.2, 20000, AXIS_X, 90));
}

/* ---- spikes and steps ---- */

/* What a sample differs by at least so that it counts as wild, whatever the course was and up to three losses: the gate, and how
 * far the signal at its quickest may have moved. */
static double wild(double rate_hz)
{
    return FACTOR * ACCEL / (rate_hz * rate_hz) * 10 + 2 * s_signal.speed * (5 / rate_hz + 0.01);
}

static void test_gate_random_spikes_none_followed_and_nothing_else_lost(void)
{
    unsigned spikes = 0;
    for (unsigned r = 0; r < RATES; r++) {
        for (unsigned run = 0; run < 20; run++) {
            const network_t network = {run % 2 * 0.3 * 1000 / k_rates_hz[r], run % 3 * 0.02, 0};
            const unsigned axis = run % POSE_AXES;
            unsigned since = 0, expected = 0;
            double held = 0, before = 0;
            start(FACTOR);
            make_signal(1);
            for (double t = 0; t < 20; t += 1 / k_rates_hz[r]) {
                const double at = arrival(&network, t, &held, before);
                if (random_unit() < network.loss) {
                    continue;
                }
                before = at;
                const bool is_spike = ++since > 10 && random_unit() < 0.05;
                const double off = (random_unit() < 0.5 ? -1 : 1) * wild(k_rates_hz[r]) * (1 + 5 * random_unit());
                since = is_spike ? 8 : since; /* at least two good ones in between */
                TEST_ASSERT_EQUAL(!is_spike,
                                  push(at, (uint32_t)(1e6 / k_rates_hz[r]), axis, signal_at(t) + (is_spike ? off : 0)));
                expected += is_spike;
            }
            expected -= since == 8; /* nothing came after it */
            TEST_ASSERT_EQUAL_UINT32(expected, spike_filter_spikes(&s_gate));
            TEST_ASSERT_TRUE(expected == 0 || spike_filter_last_spike(&s_gate)->axis == axis);
            spikes += expected;
        }
    }
    printf("spikes: %u sent, none followed\n", spikes);
    TEST_ASSERT_TRUE(spikes > 2000);
}

/* The value of a spike is told. */
static void test_gate_spike_tells_axis_value_and_the_sample_before(void)
{
    for (int i = 0; i < 20; i++) {
        TEST_ASSERT_TRUE(push(i * 0.02, 20000, AXIS_PITCH, 5));
    }
    TEST_ASSERT_FALSE(push(0.40, 20000, AXIS_PITCH, -80));
    TEST_ASSERT_EQUAL_UINT32(0, spike_filter_spikes(&s_gate));
    TEST_ASSERT_TRUE(push(0.42, 20000, AXIS_PITCH, 5));
    TEST_ASSERT_EQUAL_UINT32(1, spike_filter_spikes(&s_gate));
    const spike_t *spike = spike_filter_last_spike(&s_gate);
    TEST_ASSERT_EQUAL_UINT8(AXIS_PITCH, spike->axis);
    TEST_ASSERT_TRUE(spike->value_q32 == q32_from_int(-80) && spike->before_q32 == q32_from_int(5));
}

static void test_gate_random_steps_come_one_sample_later_and_are_no_spikes(void)
{
    for (unsigned r = 0; r < RATES; r++) {
        for (unsigned run = 0; run < 20; run++) {
            const network_t network = {run % 2 * 0.3 * 1000 / k_rates_hz[r], run % 3 * 0.02, 0};
            double base = 0, held = 0, before = 0;
            unsigned since = 0, withheld = 0;
            start(FACTOR);
            make_signal(1);
            for (double t = 0; t < 20; t += 1 / k_rates_hz[r]) {
                const double at = arrival(&network, t, &held, before);
                if (random_unit() < network.loss) {
                    continue;
                }
                before = at;
                const bool is_step = ++since > 12 && random_unit() < 0.05;
                base += is_step ? (base > 0 ? -1 : 1) * wild(k_rates_hz[r]) * (1 + random_unit()) : 0;
                since = is_step ? 0 : since;
                withheld += is_step;
                TEST_ASSERT_EQUAL(!is_step, push(at, (uint32_t)(1e6 / k_rates_hz[r]), AXIS_Z, signal_at(t) + base));
            }
            TEST_ASSERT_TRUE(withheld > 0);
            TEST_ASSERT_EQUAL_UINT32(0, spike_filter_spikes(&s_gate));
        }
    }
}

/* Whatever comes, there are never two in a row. */
static void test_gate_noise_withholds_at_most_every_other_sample(void)
{
    bool did_pass = true;
    unsigned withheld = 0;
    for (int i = 0; i < 100000; i++) {
        q32_t sample[POSE_AXES];
        for (unsigned a = 0; a < POSE_AXES; a++) {
            sample[a] = (q32_t)((random_unit() - 0.5) * 36028797018963968.0); /* +-2^54 */
        }
        const bool passes = spike_filter_passes(&s_gate, (uint64_t)i * 20000 + (uint64_t)(random_unit() * 19000), 20000, sample);
        TEST_ASSERT_TRUE(passes || did_pass);
        withheld += !passes;
        did_pass = passes;
    }
    TEST_ASSERT_TRUE(withheld > 10000);
}

static void test_gate_spike_that_comes_twice_confirms_nothing(void)
{
    for (int i = 0; i < 20; i++) {
        TEST_ASSERT_TRUE(push(i * 0.02, 20000, AXIS_X, 0));
    }
    TEST_ASSERT_FALSE(push(0.400, 20000, AXIS_X, 90));
    TEST_ASSERT_FALSE(push(0.402, 20000, AXIS_X, 90));
    TEST_ASSERT_TRUE(push(0.420, 20000, AXIS_X, 0));
    TEST_ASSERT_EQUAL_UINT32(1, spike_filter_spikes(&s_gate));
}

static void test_gate_last_word_is_overdue_after_four_periods(void)
{
    for (int i = 0; i < 20; i++) {
        TEST_ASSERT_TRUE(push(i * 0.02, 20000, AXIS_X, 50));
    }
    TEST_ASSERT_FALSE(push(0.4, 20000, AXIS_X, 0));
    TEST_ASSERT_FALSE(spike_filter_is_overdue(&s_gate, 480000));
    TEST_ASSERT_TRUE(spike_filter_is_overdue(&s_gate, 480001));
    spike_filter_reset(&s_gate);
    TEST_ASSERT_FALSE(spike_filter_is_overdue(&s_gate, 900000));
    TEST_ASSERT_EQUAL_UINT32(0, spike_filter_spikes(&s_gate));
}

static void test_gate_factor_out_of_range_is_refused(void)
{
    const q16_t accel_q16[POSE_AXES] = {1, 1, 1, 1, 1, 1};
    TEST_ASSERT_EQUAL(HV_ERR_RANGE, spike_filter_init(&s_gate, accel_q16, SPIKE_FILTER_FACTOR_MAX + 1));
}

/* The gate is where it says: just inside passes, just outside does not. */
static void test_gate_at_rest_is_factor_times_acceleration_times_period_squared(void)
{
    for (unsigned r = 0; r < RATES; r++) {
        const double period = floor(1e6 / k_rates_hz[r]) / 1e6, edge = FACTOR * ACCEL * period * period;
        for (int outside = 0; outside < 2; outside++) {
            start(FACTOR);
            for (int i = 0; i < 20; i++) {
                TEST_ASSERT_TRUE(push(i * period, (uint32_t)lround(period * 1e6), AXIS_ROLL, 1));
            }
            TEST_ASSERT_EQUAL(!outside,
                              push(20 * period, (uint32_t)lround(period * 1e6), AXIS_ROLL, 1 + edge * (outside ? 1.001 : 0.999)));
        }
    }
}

/* Whole units at 100 Hz: a step of one is more than the gate lets pass, but no spike where they are known to be the values'
 * quantum. */
static void test_gate_quantum_passes_steps_as_coarse_as_the_values(void)
{
    for (int quantum = 0; quantum <= 1; quantum++) {
        start(FACTOR);
        spike_filter_set_quantum(&s_gate, 2, quantum * 4 * Q32_ONE);
        for (int i = 0; i < 40; i++) {
            (void)push(i * 0.01, 10000, 2, 0);
        }
        TEST_ASSERT_EQUAL(quantum, push(0.4, 10000, 2, 4));
        TEST_ASSERT_TRUE(push(0.41, 10000, 2, 4));
        (void)push(0.42, 10000, 2, 4);
        (void)push(0.43, 10000, 2, 4);
        TEST_ASSERT_FALSE(push(0.44, 10000, 2, 12));
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_gate_passes_ordinary_motion_at_all_rates);
    RUN_TEST(test_gate_quantum_passes_steps_as_coarse_as_the_values);
    RUN_TEST(test_gate_passes_frames_that_come_twice);
    RUN_TEST(test_gate_passes_everything_outside_a_stream);
    RUN_TEST(test_gate_passes_after_a_gap_without_a_known_course);
    RUN_TEST(test_gate_random_spikes_none_followed_and_nothing_else_lost);
    RUN_TEST(test_gate_spike_tells_axis_value_and_the_sample_before);
    RUN_TEST(test_gate_random_steps_come_one_sample_later_and_are_no_spikes);
    RUN_TEST(test_gate_noise_withholds_at_most_every_other_sample);
    RUN_TEST(test_gate_spike_that_comes_twice_confirms_nothing);
    RUN_TEST(test_gate_last_word_is_overdue_after_four_periods);
    RUN_TEST(test_gate_factor_out_of_range_is_refused);
    RUN_TEST(test_gate_at_rest_is_factor_times_acceleration_times_period_squared);
    return UNITY_END();
}
