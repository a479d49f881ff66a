/* SPDX-License-Identifier: MIT
 * test_stream.c - the stream reconstruction: steps, exactness, quality on motion-cue signals, hostile arrivals, ends.
 * Signals and arrivals are made here in double precision from fixed seeds; what is measured is the reference itself.
 */
#include "heave/stream.h"
#include "random.h"
#include "unity.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define CYCLE_US 1000u
#define LONG_MS  40000
#define SAMPLES  10000
#define CUES     20
#define SINES    8

static stream_t s_stream;

void hv_assert_failed(const char *file, int line)
{
    printf("%s:%d: assertion\n", file, line);
    abort();
}

void setUp(void)
{
    random_begin(RANDOM_SEED);
    stream_init(&s_stream, CYCLE_US, 1, STREAM_SMOOTH);
}

void tearDown(void) {}

/* ---- signals ---- */

static q32_t q32(double value)
{
    return (q32_t)llround(value * 65536.0) * 65536;
}

static double mm(q32_t value)
{
    return (double)value / 4294967296.0;
}

/* A motion cue signal: slow sines on a 100 mm axis and onsets that wash out. */
static struct {
    double amplitude[SINES], hz[SINES], phase[SINES], cue_at[CUES], cue[CUES];
} s_signal;

static void make_signal(unsigned seed)
{
    random_begin(RANDOM_SEED + seed * 7919u);
    for (int i = 0; i < 20; i++) {
        random_unit();
    }
    double sum = 0;
    for (int i = 0; i < SINES; i++) {
        s_signal.hz[i] = 0.1 * pow(20.0, (i + 0.6 * random_unit()) / (SINES - 0.4));
        s_signal.amplitude[i] = (0.5 + random_unit()) / pow(s_signal.hz[i], 1.3);
        s_signal.phase[i] = 6.283185307 * random_unit();
        sum += s_signal.amplitude[i];
    }
    double at = 1.0;
    for (int i = 0; i < CUES; i++) {
        s_signal.cue_at[i] = at;
        s_signal.cue[i] = (random_unit() < 0.5 ? -1 : 1) * (3 + 7 * random_unit());
        at += 1.5 + 3 * random_unit();
    }
    for (int i = 0; i < SINES; i++) {
        s_signal.amplitude[i] *= 45 / sum;
    }
}

static double signal_at(double t)
{
    double sum = 0;
    for (int i = 0; i < SINES; i++) {
        sum += s_signal.amplitude[i] * sin(6.283185307 * s_signal.hz[i] * t + s_signal.phase[i]);
    }
    for (int i = 0; i < CUES && t > s_signal.cue_at[i]; i++) {
        const double since = t - s_signal.cue_at[i];
        const double x = since < 0.3 ? since / 0.3 : 1;
        sum += s_signal.cue[i] * x * x * x * x * (35 + x * (-84 + x * (70 - 20 * x))) * exp(-since);
    }
    return sum;
}

/* ---- senders ---- */

typedef struct {
    double rate_hz, jitter_ms, loss;
} network_t;

/* What has been sent and when it arrives. */
static struct {
    int count;
    int in_a_row; /* most samples lost one after the other, beyond the first 2 s */
    double at[SAMPLES], value[SAMPLES];
} s_sent;

static void send(double at, double value)
{
    TEST_ASSERT_TRUE(s_sent.count < SAMPLES);
    const double before = s_sent.count > 0 ? s_sent.at[s_sent.count - 1] : 0;
    s_sent.at[s_sent.count] = at > before ? at : before;
    s_sent.value[s_sent.count++] = round(value * 1000) / 1000; /* as text with 3 decimals */
}

/* Sends the signal from one time to another through a network that delays by 2 ms and the jitter, and loses. */
static void send_signal(const network_t *network, double from, double to)
{
    int lost = 0;
    for (double at = from; at < to; at += 1 / network->rate_hz) {
        const double arrival = at + 0.002 + 0.001 * network->jitter_ms * random_unit();
        if (random_unit() >= network->loss) {
            send(arrival, signal_at(at));
            lost = 0;
        } else {
            lost += at > 2;
            s_sent.in_a_row = lost > s_sent.in_a_row ? lost : s_sent.in_a_row;
        }
    }
}

static ramp_ref_t s_ref[LONG_MS];

/* Pushes what was sent and steps each millisecond. */
static void render(uint64_t origin_us, int from_ms, int to_ms)
{
    static int next;
    next = from_ms == 0 ? 0 : next;
    for (int ms = from_ms; ms < to_ms; ms++) {
        const uint64_t now_us = origin_us + (uint64_t)ms * 1000u;
        for (; next < s_sent.count && s_sent.at[next] * 1000 <= ms; next++) {
            const q32_t sample = q32(s_sent.value[next]);
            stream_push(&s_stream, origin_us + (uint64_t)llround(s_sent.at[next] * 1e6), NULL, &sample);
        }
        s_ref[ms] = (ramp_ref_t){0};
        stream_step(&s_stream, now_us, NULL, &s_ref[ms]);
    }
}

/* An axis of 3000 mm/s^2 and 50000 mm/s^3. */
static const governor_limits_t k_limits = {
    .vel_per_cycle_q32 = Q32_ONE, .acc_per_cycle2_q32 = 12884902, .jerk_per_cycle3_q32 = 214748};

static void start(stream_style_t style)
{
    stream_init(&s_stream, CYCLE_US, 1, style);
    stream_set_limits(&s_stream, 0, &k_limits);
    stream_set_delay_max(&s_stream, 120000);
    s_sent.count = s_sent.in_a_row = 0;
}

/* ---- measurements ---- */

typedef struct {
    double lag_ms, shape_um, jerk, jerk_true, worst_mm;
} quality_t;

static double shape_error(int from_ms, int to_ms, double lag_ms)
{
    double sum = 0;
    int count = 0;
    for (int ms = from_ms; ms < to_ms; ms += 29, count++) {
        const double error = mm(s_ref[ms].pos_q32) - signal_at(0.001 * (ms - lag_ms));
        sum += error * error;
    }
    return sqrt(sum / count);
}

static double best_lag(int from_ms, int to_ms, double low, double high)
{
    while (high - low > 0.05) { /* the error has one minimum near the lag */
        const double third = (high - low) / 3;
        if (shape_error(from_ms, to_ms, low + third) < shape_error(from_ms, to_ms, high - third)) {
            high -= third;
        } else {
            low += third;
        }
    }
    return (low + high) / 2;
}

static quality_t measure(int from_ms, int to_ms, double lag_max_ms)
{
    quality_t quality = {.lag_ms = best_lag(from_ms, to_ms, 0, lag_max_ms)};
    quality.shape_um = 1000 * shape_error(from_ms, to_ms, quality.lag_ms);
    double sum = 0, sum_true = 0, truth[4] = {0};
    for (int ms = from_ms; ms < to_ms; ms++) {
        memmove(&truth[1], truth, sizeof truth - sizeof truth[0]);
        truth[0] = signal_at(0.001 * (ms - quality.lag_ms));
        quality.worst_mm = fmax(quality.worst_mm, fabs(mm(s_ref[ms].pos_q32) - truth[0]));
        if (ms >= from_ms + 3) {
            sum += pow(1e9 * mm(s_ref[ms].jerk_per_cycle3_q32), 2);
            sum_true += pow(1e9 * (truth[0] - 3 * truth[1] + 3 * truth[2] - truth[3]), 2);
        }
    }
    quality.jerk = sqrt(sum / (to_ms - from_ms - 3));
    quality.jerk_true = sqrt(sum_true / (to_ms - from_ms - 3));
    return quality;
}

/* 40 s of a seed's signal; measured from a time on. */
static quality_t measure_seed(unsigned seed, stream_style_t style, const network_t *network, int from_ms)
{
    make_signal(seed);
    start(style);
    send_signal(network, random_unit() / network->rate_hz, LONG_MS * 0.001);
    render(0, 0, LONG_MS);
    return measure(from_ms, LONG_MS, 4000 / network->rate_hz + 10);
}

static void assert_differences(const ramp_ref_t *before, const ramp_ref_t *ref)
{
    TEST_ASSERT_EQUAL_INT64(ref->pos_q32 - before->pos_q32, ref->vel_per_cycle_q32);
    TEST_ASSERT_EQUAL_INT64(ref->vel_per_cycle_q32 - before->vel_per_cycle_q32, ref->acc_per_cycle2_q32);
    TEST_ASSERT_EQUAL_INT64(ref->acc_per_cycle2_q32 - before->acc_per_cycle2_q32, ref->jerk_per_cycle3_q32);
}

static void assert_at_rest(q32_t pos_q32, const ramp_ref_t *ref)
{
    TEST_ASSERT_EQUAL_INT64(pos_q32, ref->pos_q32);
    TEST_ASSERT_EQUAL_INT64(0, ref->vel_per_cycle_q32);
    TEST_ASSERT_EQUAL_INT64(0, ref->acc_per_cycle2_q32);
    TEST_ASSERT_EQUAL_INT64(0, ref->jerk_per_cycle3_q32);
}

/* Largest magnitude of the velocity, in mm/s. */
static double speed_max(int from_ms, int to_ms)
{
    double most = 0;
    for (int ms = from_ms; ms < to_ms; ms++) {
        most = fmax(most, fabs(1000 * mm(s_ref[ms].vel_per_cycle_q32)));
    }
    return most;
}

static double signal_speed_max(double from, double to)
{
    double most = 0;
    for (double t = from; t < to; t += 0.005) {
        most = fmax(most, fabs(signal_at(t + 0.001) - signal_at(t)) * 1000);
    }
    return most;
}

/* ---- steps ---- */

static void test_stream_step_without_sample_returns_false(void)
{
    ramp_ref_t ref = {1, 2, 3, 4};
    TEST_ASSERT_FALSE(stream_step(&s_stream, 1000, NULL, &ref));
    TEST_ASSERT_EQUAL_INT64(1, ref.pos_q32);
    TEST_ASSERT_EQUAL_INT64(4, ref.jerk_per_cycle3_q32);
    const q32_t sample = 77;
    stream_push(&s_stream, 1000, NULL, &sample);
    TEST_ASSERT_TRUE(stream_step(&s_stream, 1000, NULL, &ref));
    stream_reset(&s_stream);
    TEST_ASSERT_FALSE(stream_step(&s_stream, 2000, NULL, &ref));
}

static void test_stream_step_lone_sample_is_a_step(void)
{
    start(STREAM_SMOOTH);
    send(0.010, 12.345);
    send(0.010 + 0.0005 + 0.001 * STREAM_PERIOD_MAX_US / 1000 + 0.001, -50); /* too late to be a stream */
    render(1, 0, 1000);
    assert_at_rest(q32(12.345), &s_ref[10]);
    assert_at_rest(q32(12.345), &s_ref[561]);
    assert_at_rest(q32(-50), &s_ref[562]);
    assert_at_rest(q32(-50), &s_ref[999]);
    TEST_ASSERT_FALSE(stream_is_live(&s_stream, 1000000));
    TEST_ASSERT_EQUAL_UINT32(0, stream_period_us(&s_stream));
}

static void test_stream_push_two_samples_at_once_steps_to_the_second(void)
{
    start(STREAM_SMOOTH);
    send(0.010, 1);
    send(0.010, 2);
    render(0, 0, 500);
    assert_at_rest(q32(2), &s_ref[10]);
    assert_at_rest(q32(2), &s_ref[499]);
}

/* Two samples are steps. The curve starts where the second one was, and comes to the third without a jump; it goes further by no
 * more than an axis that has just begun to move takes to stop. */
static void test_stream_step_third_sample_starts_at_the_second(void)
{
    start(STREAM_SMOOTH);
    send(0.010, 10);
    send(0.030, 20);
    send(0.050, 30);
    render(0, 0, 2000);
    assert_at_rest(q32(10), &s_ref[10]);
    assert_at_rest(q32(10), &s_ref[29]);
    assert_at_rest(q32(20), &s_ref[30]);
    assert_at_rest(q32(20), &s_ref[49]);
    for (int ms = 50; ms < 2000; ms++) {
        assert_differences(&s_ref[ms - 1], &s_ref[ms]);
        TEST_ASSERT_TRUE(mm(s_ref[ms].pos_q32) <= 30 + 3.6);
    }
    /* 10 mm in 20 ms, of which 20 ms at 3000 mm/s^2 make 60 mm/s, and what the curve needs for its way to them */
    TEST_ASSERT_TRUE(speed_max(50, 2000) < 65);
    assert_at_rest(q32(30), &s_ref[1999]);
}

/* ---- slow senders ---- */

/* Renders what is sent, from 10 ms on, up to two seconds after the last sample; how many rows differ from a step to each sample.
 */
static int rows_beside_steps(int *until_ms)
{
    int count = 0;
    *until_ms = (int)(s_sent.at[s_sent.count - 1] * 1000) + 2000;
    render(1000000, 0, *until_ms);
    for (int ms = 10, i = 0; ms < *until_ms; ms++) {
        while (i + 1 < s_sent.count && s_sent.at[i + 1] * 1000 <= ms) {
            i++;
        }
        count += s_ref[ms].pos_q32 != q32(s_sent.value[i]) ? 1 : 0;
    }
    return count;
}

/* Even steps that lead on: a stream from the fourth one on, which ends on its last sample and goes nowhere else. */
static void test_stream_step_even_slow_steps_are_a_stream_that_ends_on_the_last(void)
{
    for (int period_ms = 160; period_ms <= 540; period_ms += 95) {
        int until_ms;
        start(STREAM_SMOOTH);
        for (int i = 0; i < 8; i++) {
            send(0.010 + 0.001 * period_ms * i, 3.0 * i);
        }
        TEST_ASSERT_TRUE(rows_beside_steps(&until_ms) > 0);
        for (int ms = 10; ms < until_ms; ms++) {
            const double at = mm(s_ref[ms].pos_q32);
            TEST_ASSERT_TRUE(at >= 0 && at <= 21);
            TEST_ASSERT_TRUE(ms <= 12 + 2 * period_ms || fabs(mm(s_ref[ms].vel_per_cycle_q32)) <= 3.0 / period_ms * 1.15);
        }
        assert_at_rest(q32(21), &s_ref[until_ms - 1]);
    }
}

static void test_stream_step_slow_poses_that_do_not_lead_on_are_steps(void)
{
    const double values[][8] = {
        {0, 20, -20, 20, -20, 20, -20, 20}, /* to and fro */
        {5, 5, 5, 5, 30, 30, 30, 30},       /* repeated */
        {0, 20, 21, 1, 5, 40, 20, 15},      /* now far, now near */
    };
    for (unsigned i = 0; i < sizeof values / sizeof values[0]; i++) {
        for (int period_ms = 160; period_ms <= 540; period_ms += 95) {
            int until_ms;
            start(STREAM_SMOOTH);
            for (int k = 0; k < 8; k++) {
                send(0.010 + 0.001 * period_ms * k, values[i][k]);
            }
            TEST_ASSERT_EQUAL_INT(0, rows_beside_steps(&until_ms));
        }
    }
}

/* A slow stream whose samples begin to go to and fro has ended: they are steps. */
static void test_stream_step_leaps_of_a_slow_stream_are_steps(void)
{
    const double values[] = {0, 4, 8, 12, 16, 10, 16, 10, 16};
    for (int period_ms = 160; period_ms <= 540; period_ms += 95) {
        start(STREAM_SMOOTH);
        for (int i = 0; i < 9; i++) {
            send(0.010 + 0.001 * period_ms * i, values[i]);
        }
        render(1000000, 0, 10 + 9 * period_ms);
        TEST_ASSERT_TRUE(s_ref[9 + 5 * period_ms].pos_q32 < q32(12)); /* a stream, and late */
        for (int ms = 11 + 5 * period_ms; ms < 10 + 9 * period_ms; ms++) {
            const bool is_arriving = (ms - 10) % period_ms == 0; /* in this row or in the next one: times are rounded */
            TEST_ASSERT_TRUE(is_arriving || s_ref[ms].pos_q32 == q32(values[(ms - 10) / period_ms]));
        }
    }
}

static void test_stream_step_uneven_slow_steps_are_steps(void)
{
    const double gaps_s[] = {0.3, 0.2, 0.45, 0.16, 0.3, 0.4, 0.25, 0.54};
    int until_ms;
    double at = 0.010;
    start(STREAM_SMOOTH);
    for (int i = 0; i < 8; i++) {
        send(at, 3.0 * i);
        at += gaps_s[i];
    }
    TEST_ASSERT_EQUAL_INT(0, rows_beside_steps(&until_ms));
}

/* One that is lost among the first samples is missing, and not late for ever. */
static void test_stream_step_slow_stream_with_an_early_loss_is_no_later(void)
{
    for (int lost = 3; lost < 12; lost++) {
        start(STREAM_SMOOTH);
        for (int i = 0; i < 24; i++) {
            if (i != lost) {
                send(0.010 + 0.3 * i, 3.0 * i);
            }
        }
        render(1000000, 0, 7000);
        TEST_ASSERT_UINT32_WITHIN(3000, 300000, stream_period_us(&s_stream));
        TEST_ASSERT_UINT32_WITHIN(20000, 300000 * 17 / 8, stream_delay_us(&s_stream));
    }
}

/* ---- exactness ---- */

static void test_stream_step_constant_samples_give_a_constant_reference(void)
{
    const network_t network = {60, 8, 0.05};
    const q32_t values[] = {0, 1, -1, 0x123456789ABCD, -0x7FFFFFFFFFFF, Q32_ONE / 3};
    for (unsigned style = STREAM_SMOOTH; style <= STREAM_BALANCED; style++) {
        for (unsigned i = 0; i < sizeof values / sizeof values[0]; i++) {
            start(style);
            send_signal(&network, 0, 2);
            int next = 0;
            for (int ms = 0; ms < 2000; ms++) {
                ramp_ref_t ref;
                for (; next < s_sent.count && s_sent.at[next] * 1000 <= ms; next++) {
                    stream_push(&s_stream, (uint64_t)ms * 1000, NULL, &values[i]);
                }
                if (stream_step(&s_stream, (uint64_t)ms * 1000, NULL, &ref)) {
                    assert_at_rest(values[i], &ref);
                }
            }
        }
    }
}

static void test_stream_step_differences_are_consistent(void)
{
    const network_t network = {60, 5, 0.03};
    for (unsigned style = STREAM_SMOOTH; style <= STREAM_BALANCED; style++) {
        make_signal(5);
        start(style);
        send_signal(&network, 0.0005, 10);
        render(0, 0, 10000);
        for (int ms = 60; ms < 10000; ms++) { /* three samples */
            assert_differences(&s_ref[ms - 1], &s_ref[ms]);
        }
    }
}

/* The samples go on but do not change: exactly there, although the arrivals keep jittering. */
static void test_stream_step_signal_that_stops_is_met_exactly(void)
{
    const network_t network = {60, 5, 0.01};
    make_signal(2);
    start(STREAM_SMOOTH);
    send_signal(&network, 0, 4);
    const double last = s_sent.value[s_sent.count - 1];
    for (double at = 4.01; at < 6; at += 1 / 60.0) {
        send(at + 0.005 * random_unit(), last);
    }
    render(0, 0, 6000);
    for (int ms = 4700; ms < 6000; ms++) {
        assert_at_rest(q32(last), &s_ref[ms]);
    }
}

static void test_stream_step_time_near_its_end_gives_the_same_bits(void)
{
    static ramp_ref_t plain[5000];
    const network_t network = {60, 5, 0.02};
    make_signal(6);
    start(STREAM_SMOOTH);
    send_signal(&network, 0.003, 5);
    render(0, 0, 5000);
    memcpy(plain, s_ref, sizeof plain);
    const uint64_t origins_us[] = {1, (UINT64_C(1) << 63) - 2000000, UINT64_MAX - 5000000};
    for (int i = 0; i < 3; i++) {
        stream_reset(&s_stream);
        render(origins_us[i], 0, 5000);
        TEST_ASSERT_EQUAL_MEMORY(plain, s_ref, sizeof plain);
    }
}

/* Axes that are multiples of one signal give multiples of one curve: nothing but the clock and what is lost couples them. */
static void test_stream_step_axes_of_one_signal_move_as_one(void)
{
    static stream_t seven;
    make_signal(2);
    start(STREAM_SMOOTH);
    stream_set_limits(&s_stream, 0, &(governor_limits_t){.jerk_per_cycle3_q32 = 0});
    stream_init(&seven, CYCLE_US, AXES_MAX, STREAM_SMOOTH);
    stream_set_delay_max(&seven, 120000);
    for (int ms = 0; ms < 20000; ms++) {
        const uint64_t now_us = (uint64_t)ms * 1000;
        if (ms % 16 == 3 && random_unit() > 0.1) {
            q32_t sample[AXES_MAX];
            for (unsigned axis = 0; axis < AXES_MAX; axis++) {
                sample[axis] = q32(signal_at(0.001 * ms)) / 8 * (q32_t)axis;
            }
            stream_push(&seven, now_us, NULL, sample);
            stream_push(&s_stream, now_us, NULL, &sample[AXES_MAX - 1]);
        }
        ramp_ref_t ref[AXES_MAX] = {{0}}, one = {0};
        TEST_ASSERT_EQUAL(stream_step(&s_stream, now_us, NULL, &one), stream_step(&seven, now_us, NULL, ref));
        for (unsigned axis = 0; axis < AXES_MAX; axis++) {
            /* a distance of less than 0.5 um is given up, on each axis by itself */
            TEST_ASSERT_DOUBLE_WITHIN(2e-3, mm(one.pos_q32) * axis / (AXES_MAX - 1), mm(ref[axis].pos_q32));
        }
    }
}

/* ---- quality ---- */

static const network_t k_usual = {60, 5, 0.01};

static void test_stream_smooth_on_cue_signals_keeps_its_figures(void)
{
    double sum = 0, sum_true = 0;
    for (unsigned seed = 1; seed <= 24; seed++) {
        const quality_t cold = measure_seed(seed, STREAM_SMOOTH, &k_usual, 300);

        const quality_t quality = measure(2000, LONG_MS, 80);
        sum += quality.jerk * quality.jerk;
        sum_true += quality.jerk_true * quality.jerk_true;
        if (getenv("STREAM_FIGURES")) {
            printf("smooth %2u: lag %.1f ms shape %.1f um (cold %.1f) worst %.3f mm jerk %.0f = %.2f x (cold %.2f), %d lost in a "
                   "row\n",
                   seed, quality.lag_ms, quality.shape_um, cold.shape_um, quality.worst_mm, quality.jerk,
                   quality.jerk / quality.jerk_true, cold.jerk / cold.jerk_true, s_sent.in_a_row);
        }
        TEST_ASSERT_TRUE(quality.lag_ms * 0.060 <= 2.5);
        TEST_ASSERT_TRUE(quality.shape_um <= 50);
        TEST_ASSERT_TRUE(quality.worst_mm <= 1.0); /* two losses in a row */
        /* two in a row at an onset: the second guess is as far off as the onset's jerk makes it, and is taken back */
        TEST_ASSERT_TRUE(quality.jerk <= (s_sent.in_a_row > 1 ? 1.4 : 1.3) * quality.jerk_true);
    }
    TEST_ASSERT_TRUE(sqrt(sum / sum_true) <= 1.15);
}

static void test_stream_balanced_on_cue_signals_keeps_its_figures(void)
{
    for (unsigned seed = 1; seed <= 5; seed++) {
        const quality_t quality = measure_seed(seed, STREAM_BALANCED, &k_usual, 2000);
        if (getenv("STREAM_FIGURES")) {
            printf("balanced %2u: lag %.1f ms shape %.1f um worst %.3f mm jerk %.2f x\n", seed, quality.lag_ms, quality.shape_um,
                   quality.worst_mm, quality.jerk / quality.jerk_true);
        }
        TEST_ASSERT_TRUE(quality.lag_ms * 0.060 <= 1.9); /* 4.5 ms of the network in it */
        TEST_ASSERT_TRUE(quality.shape_um <= 75);        /* two losses in a row */
        TEST_ASSERT_TRUE(quality.jerk <= (s_sent.in_a_row > 1 ? 2.1 : 1.5) * quality.jerk_true);
    }
}

/* Jitter of a whole period: an early, a late and a lost frame look alike in time, and frames come two at once. */
static void test_stream_jitter_of_a_period_is_told_from_losses(void)
{
    const network_t network = {200, 5, 0.01};
    for (unsigned seed = 1; seed <= 10; seed++) {
        const quality_t quality = measure_seed(seed, seed % 2 ? STREAM_SMOOTH : STREAM_BALANCED, &network, 4000);
        if (getenv("STREAM_FIGURES")) {
            printf("jitter %2u: lag %.1f ms shape %.1f um worst %.3f mm jerk %.2f x\n", seed, quality.lag_ms, quality.shape_um,
                   quality.worst_mm, quality.jerk / quality.jerk_true);
        }
        TEST_ASSERT_TRUE(quality.lag_ms <= 21);
        TEST_ASSERT_TRUE(quality.shape_um <= 90);
        TEST_ASSERT_TRUE(quality.worst_mm <= 1);
        TEST_ASSERT_TRUE(quality.jerk <= 9 * quality.jerk_true);
    }
}

/* Late arrivals beside losses: for eight intervals or so they look like a slower rate. */
static void test_stream_step_late_arrivals_and_losses_are_no_new_rate(void)
{
    for (unsigned seed = 1; seed <= 40; seed++) {
        const network_t network = {45, 11, 0.05};
        make_signal(seed);
        start(STREAM_SMOOTH);
        send_signal(&network, 0, LONG_MS * 0.001);
        double off = 0;
        for (int ms = 0; ms < LONG_MS; ms++) {
            render(0, ms, ms + 1);
            off = ms > 2000 ? fmax(off, fabs(stream_period_us(&s_stream) * 45e-6 - 1)) : 0;
        }
        if (getenv("STREAM_FIGURES")) {
            printf("late %2u: period off %.1f %%\n", seed, 100 * off);
        }
        TEST_ASSERT_TRUE(off < 0.1);
    }
}

/* Jitter 30 % of the period: known to 4 % from 32 samples on, where a late sample was taken for a loss or a loss for a late
 * sample, else much better; the shape near the signal: the bound grows with the distance of the samples. */
static void test_stream_step_all_rates_converge(void)
{
    const int rates[] = {7, 10, 20, 30, 50, 60, 100, 200, 250};
    for (unsigned i = 0; i < sizeof rates / sizeof rates[0]; i++) {
        const network_t network = {rates[i], 300.0 / rates[i], 0.02};
        make_signal(3);
        start(STREAM_SMOOTH);
        send_signal(&network, 0.0013, LONG_MS * 0.001);
        const int known_ms = 32000 / rates[i] + 50;
        render(0, 0, known_ms);
        double off = 0;
        for (int ms = known_ms; ms < LONG_MS; ms++) {
            render(0, ms, ms + 1);
            off = fmax(off, fabs(stream_period_us(&s_stream) * 1e-6 * rates[i] - 1));
        }
        const quality_t quality = measure(known_ms, LONG_MS, 4000.0 / rates[i] + 10);
        if (getenv("STREAM_FIGURES")) {
            printf("rate %3d: period off %.2f %% lag %.2f periods shape %.1f um worst %.3f mm jerk %.2f x\n", rates[i], 100 * off,
                   quality.lag_ms * rates[i] / 1000, quality.shape_um, quality.worst_mm, quality.jerk / quality.jerk_true);
        }
        TEST_ASSERT_TRUE(off <= 0.04);
        TEST_ASSERT_TRUE(quality.lag_ms <= 2500.0 / rates[i] + 4.5);
        TEST_ASSERT_TRUE(quality.shape_um <= 45 + 180e3 / rates[i] / rates[i]);
    }
}

/* Losses among the first samples are told from the period, in every one of 100 starts. */
static void test_stream_step_lossy_start_finds_the_period(void)
{
    const network_t network = {60, 5, 0.05};
    double early = 0, late = 0;
    for (unsigned seed = 0; seed < 100; seed++) {
        make_signal(seed);
        start(STREAM_SMOOTH);
        send_signal(&network, random_unit() / 60, 3);
        render(0, 0, 700);
        for (int ms = 700; ms < 3000; ms++) {
            render(0, ms, ms + 1);
            double *const off = ms < 1500 ? &early : &late;
            *off = fmax(*off, fabs(stream_period_us(&s_stream) * 60e-6 - 1));
        }
    }
    if (getenv("STREAM_FIGURES")) {
        printf("start: period off %.2f %%, from 1.5 s on %.2f %%\n", 100 * early, 100 * late);
    }
    TEST_ASSERT_TRUE(early < 0.04);
    TEST_ASSERT_TRUE(late < 0.03);
}

/* Largest distance to what the signal was when rendered, while the delay is within the bound given in stream.h. */
static double worst_error(int from_ms, int to_ms, double lag_ms)
{
    double worst = 0;
    for (int ms = from_ms; ms < to_ms; ms++) {
        worst = fmax(worst, fabs(mm(s_ref[ms].pos_q32) - signal_at(0.001 * (ms - lag_ms))));
    }
    return worst;
}

/* ---- ends ---- */

/* How far an axis of k_stop goes on from a velocity and an acceleration towards it, mm and s. */
static double stop_distance(double velocity, double acceleration)
{
    const double jerk = 50000, at_zero = velocity + acceleration * acceleration / 2 / jerk;
    const double rise = velocity * acceleration / jerk + pow(acceleration, 3) / 3 / jerk / jerk;
    return rise + (at_zero < 180 ? at_zero * sqrt(at_zero / jerk) : at_zero / 2 * (at_zero / 3000 + 0.06));
}

/* From any moment and speed: no further beyond the last sample than the axis takes to stop, or 50 ms of its speed and what a led
 * curve is ahead, or one more step; and at rest exactly on it after two seconds. */
static void test_stream_step_ended_stream_rests_on_its_last_sample(void)
{
    double worst = 0;
    for (int i = 0; i < 300; i++) {
        const double rate = i % 2 ? 60 : i % 4 ? 100 : 30;
        const network_t network = {rate, 4, 0};
        make_signal((unsigned)i % 10);
        start(i % 3 ? STREAM_SMOOTH : STREAM_BALANCED);
        send_signal(&network, 0, 1.2 + 0.01 * i);
        const int end_ms = (int)(1200 + 10 * i);
        render(0, 0, end_ms + 2100);
        const double *v = &s_sent.value[s_sent.count - 1];
        const double way = v[0] - v[-1] < 0 ? -1 : 1;
        const double velocity = fabs(v[0] - v[-1]) * rate, acceleration = fmax(0, (v[0] - 2 * v[-1] + v[-2]) * rate * rate * way);
        const double led = i % 3 ? 0 : 0.7 / rate;
        const double kept_up = fmin(fmax(3 / rate + led, 0.050), 0.062);
        const double goes_on = velocity + acceleration * kept_up; /* it goes on as it has begun, and comes to that speed */
        const double allowed = fmax(stop_distance(velocity, acceleration), (kept_up + led) * goes_on) +
                               (1 + led * rate) * acceleration / rate / rate + 0.06;
        double beyond = 0;
        for (int ms = end_ms; ms < end_ms + 2100; ms++) {
            assert_differences(&s_ref[ms - 1], &s_ref[ms]);
            beyond = fmax(beyond, (mm(s_ref[ms].pos_q32) - v[0]) * way);
        }
        worst = fmax(worst, beyond / allowed);
        TEST_ASSERT_TRUE(beyond <= allowed);
        assert_at_rest(q32(v[0]), &s_ref[end_ms + 2050]);
    }
    if (getenv("STREAM_FIGURES")) {
        printf("end: beyond the last sample %.2f of what is allowed at most\n", worst);
    }
    TEST_ASSERT_TRUE(worst > 0.7); /* the bound was tried */
}

/* Takes samples away, from a time on. */
static void lose(double from, int samples)
{
    int first = 0;
    while (s_sent.at[first] < from) {
        first++;
    }
    s_sent.count -= samples;
    memmove(&s_sent.at[first], &s_sent.at[first + samples], (size_t)(s_sent.count - first) * sizeof s_sent.at[0]);
    memmove(&s_sent.value[first], &s_sent.value[first + samples], (size_t)(s_sent.count - first) * sizeof s_sent.value[0]);
}

/* Bursts of losses at random phases: the acceleration stays near the signal's own, and the curve is back on it. */
static void test_stream_step_bursts_of_losses_are_bridged_softly(void)
{
    for (int lost = 1; lost <= 12; lost++) {
        double ratio = 0, worst = 0;
        for (unsigned seed = 0; seed < 40; seed++) {
            const network_t network = {60, 3, 0};
            make_signal(seed);
            start(STREAM_SMOOTH);
            const double from = 3 + 0.5 * random_unit();
            send_signal(&network, 0, 6);
            lose(from, lost);
            render(0, 0, 5900);
            double most = 0, most_true = 0;
            for (int ms = 2950; ms < 4700; ms++) {
                assert_differences(&s_ref[ms - 1], &s_ref[ms]);
                const double t = 0.001 * ms - 0.037;
                most = fmax(most, fabs(1e6 * mm(s_ref[ms].acc_per_cycle2_q32)));
                most_true = fmax(most_true, fabs(1e6 * (signal_at(t + 0.001) - 2 * signal_at(t) + signal_at(t - 0.001))));
            }
            ratio += most / most_true / 40;
            worst = fmax(worst, most);
            TEST_ASSERT_TRUE(measure(5000, 5900, 120).worst_mm < 0.8); /* later, where they were taken for a pause */
        }
        if (getenv("STREAM_FIGURES")) {
            printf("%2d lost: acceleration %.2f x the signal's, %.0f mm/s^2 at most\n", lost, ratio, worst);
        }
        TEST_ASSERT_TRUE(ratio < (lost == 1 ? 1.05 : lost <= 3 ? 1.6 : 3));
        TEST_ASSERT_TRUE(worst < 3000);
    }
}

/* A shake of 1 mm: every 25 samples one or two are lost, or one comes late. What is guessed in their place turns back where the
 * shake does. */
static double most_of_a_shake(stream_style_t style, double hz, double rate_hz, int lost, double late)
{
    start(style);
    for (int i = 0; i < (int)(9 * rate_hz); i++) {
        const bool is_hit = i % 25 < (lost > 0 ? lost : 1);
        if (!is_hit || lost == 0) {
            send(i / rate_hz + 0.002 + (is_hit ? late / rate_hz : 0.0005 * random_unit()), sin(6.283185307 * hz * i / rate_hz));
        }
    }
    render(0, 0, 8900);
    double most = 0;
    for (int ms = 3000; ms < 8900; ms++) {
        most = fmax(most, fabs(mm(s_ref[ms].pos_q32)));
    }
    return most;
}

static void test_stream_step_shake_with_losses_swings_no_further(void)
{
    for (int i = 0; i < 60; i++) {
        const double rate_hz = i % 3 == 0 ? 60 : i % 3 == 1 ? 90 : 120;
        const double hz = 1.1 + 7.1 * (i / 6) / 10.0;
        const int lost = i % 2 == 0 ? i % 4 / 2 + 1 : 0;
        const stream_style_t style = i % 4 < 2 ? STREAM_SMOOTH : STREAM_BALANCED;
        const double most = most_of_a_shake(style, hz, rate_hz, lost, 0.9);
        if (getenv("STREAM_FIGURES")) {
            printf("shake %.1f Hz at %.0f Hz, %d lost, style %d: %.3f\n", hz, rate_hz, lost, (int)style, most);
        }
        TEST_ASSERT_TRUE(most < 1.1);
    }
}

/* Neither from rest nor out of a slow motion of 0.05 mm a sample. */
static void test_stream_step_jump_at_the_end_is_not_continued(void)
{
    for (int kind = 0; kind < 4; kind++) {
        const double step = kind / 2 * 0.05;
        start(STREAM_SMOOTH);
        for (int i = 0; i < 61 + kind % 2; i++) {
            send(0.005 + i / 60.0, i < 60 ? 10 - step * (60 - i) : 60);
        }
        render(0, 0, 4000);
        for (int ms = 5; ms < 4000; ms++) {
            TEST_ASSERT_TRUE(s_ref[ms].pos_q32 >= q32(10 - step * 60) - 2 && s_ref[ms].pos_q32 <= q32(60 + 10 * step) + 2);
        }
        assert_at_rest(q32(60), &s_ref[3900]);
    }
}

/* A sway of 20 mm in steps, at 60 Hz through the usual network: the largest acceleration of its curve, and the delay shown. */
static double coarse_sway(stream_style_t style, double step_mm, unsigned *delay_us)
{
    start(style);
    for (double at = 0; at < 9; at += 1 / 60.0) {
        if (random_unit() >= 0.01) {
            send(at + 0.002 + 0.005 * random_unit(), step_mm * round(20 * sin(3.14159265 * at) / step_mm));
        }
    }
    render(0, 0, 9000);
    double worst = 0;
    for (int ms = 2000; ms < 9000; ms++) {
        worst = fmax(worst, 1e6 * fabs(mm(s_ref[ms].acc_per_cycle2_q32)));
    }
    *delay_us = stream_delay_us(&s_stream);
    if (getenv("STREAM_FIGURES")) {
        printf("steps of %.2f mm: %.0f mm/s^2, %u us late\n", step_mm, worst, *delay_us);
    }
    return worst;
}

/* The sway itself takes 197 mm/s^2; whole millimetres make steps of 3600. What need not be smoothed does not come later. */
static void test_stream_coarse_values_come_out_as_the_motion_that_was_rounded(void)
{
    for (stream_style_t style = STREAM_SMOOTH; style <= STREAM_BALANCED; style++) {
        unsigned fine_us, tenths_us, coarse_us;
        TEST_ASSERT_TRUE(coarse_sway(style, 0.01, &fine_us) < 600);
        TEST_ASSERT_TRUE(coarse_sway(style, 0.1, &tenths_us) < 700);
        TEST_ASSERT_TRUE(coarse_sway(style, 1, &coarse_us) < 900);
        TEST_ASSERT_TRUE(fine_us < 45000 && tenths_us < fine_us + 26000 && coarse_us < fine_us + 101000);
        for (int ms = 2000; ms < 9000; ms++) {
            const double error = mm(s_ref[ms].pos_q32) - 20 * sin(3.14159265e-3 * (ms - (int)coarse_us / 1000 - 4));
            TEST_ASSERT_TRUE(fabs(error) < 1.5);
        }
    }
}

/* Even ramps and jumps now and then are multiples of something too. */
static void test_stream_even_ramps_and_jumps_are_not_coarse(void)
{
    for (int kind = 0; kind < 2; kind++) {
        start(STREAM_SMOOTH);
        for (int i = 0; i < 500; i++) {
            send(0.003 + i / 60.0, kind == 0 ? 2.5 * abs(i % 80 - 40) : 10 * (i / 45 % 3));
        }
        for (int ms = 0; ms < 8000; ms++) {
            render(0, ms, ms + 1);
            TEST_ASSERT_EQUAL_INT32(1, s_stream.curve.window == 0 ? 1 : s_stream.curve.window);
        }
    }
}

/* A pause of 0.3 s is a loss: the same stream goes on, without a step. */
static void test_stream_step_after_a_pause_goes_on(void)
{
    make_signal(4);
    start(STREAM_SMOOTH);
    send_signal(&k_usual, 0, 2);
    send_signal(&k_usual, 2.3, 6);
    render(0, 0, 6000);
    for (int ms = 100; ms < 6000; ms++) {
        assert_differences(&s_ref[ms - 1], &s_ref[ms]);
    }
    TEST_ASSERT_TRUE(speed_max(2000, 3500) < 2 * signal_speed_max(0, 6));
    TEST_ASSERT_TRUE(measure(3500, 6000, 80).shape_um < 40);
}

static void test_stream_step_after_an_end_starts_again(void)
{
    make_signal(4);
    start(STREAM_SMOOTH);
    send_signal(&k_usual, 0, 2);
    const double last = s_sent.value[s_sent.count - 1];
    const int again = s_sent.count;
    send_signal(&k_usual, 4.3, 8); /* a pause of 2.3 s */
    render(0, 0, 8000);
    const int again_ms = (int)ceil(s_sent.at[again] * 1000);
    assert_at_rest(q32(last), &s_ref[again_ms - 1]);
    assert_at_rest(q32(s_sent.value[again]), &s_ref[again_ms]);
    assert_at_rest(q32(s_sent.value[again]), &s_ref[again_ms + 10]);
    for (int ms = again_ms + 60; ms < 8000; ms++) { /* two samples are steps */
        assert_differences(&s_ref[ms - 1], &s_ref[ms]);
    }
    TEST_ASSERT_TRUE(measure(5000, 8000, 80).shape_um < 80);
}

static void test_stream_is_live_while_samples_come(void)
{
    const network_t network = {50, 0, 0};
    make_signal(1);
    start(STREAM_BALANCED);
    send_signal(&network, 0, 2);
    TEST_ASSERT_FALSE(stream_is_live(&s_stream, 0));
    TEST_ASSERT_EQUAL_UINT32(0, stream_delay_us(&s_stream));
    render(0, 0, 2000);
    TEST_ASSERT_TRUE(stream_is_live(&s_stream, 1999000));
    TEST_ASSERT_UINT32_WITHIN(100, 20000, stream_period_us(&s_stream));
    TEST_ASSERT_UINT32_WITHIN(1500, 26500, stream_delay_us(&s_stream));
    TEST_ASSERT_FALSE(stream_is_live(&s_stream, 2140000));
    render(0, 2000, 3200);
    TEST_ASSERT_FALSE(stream_is_live(&s_stream, 3199000));
    TEST_ASSERT_EQUAL_UINT32(0, stream_period_us(&s_stream));
}

/* ---- senders and networks that misbehave ---- */

/* Renders and checks in every cycle that the delay reported stays within the bound. */
static double delay_max_periods(int from_ms, int to_ms)
{
    double most = 0;
    for (int ms = from_ms; ms < to_ms; ms++) {
        render(0, ms, ms + 1);
        if (stream_period_us(&s_stream) > 0) {
            most = fmax(most, (double)stream_delay_us(&s_stream) / stream_period_us(&s_stream));
        }
    }
    return most;
}

static void report(const char *what, int from_ms, int to_ms, double delay)
{
    if (getenv("STREAM_FIGURES")) {
        printf("%s: speed %.0f of %.0f mm/s, worst %.2f mm, delay at most %.2f periods, period %u us\n", what,
               speed_max(from_ms, to_ms), signal_speed_max(0.001 * from_ms, 0.001 * to_ms), worst_error(from_ms, to_ms, 45),
               delay, (unsigned)stream_period_us(&s_stream));
    }
}

static void test_stream_step_changing_rates_are_followed(void)
{
    const double rates[] = {60, 30, 100, 20, 60, 45};
    make_signal(9);
    start(STREAM_SMOOTH);
    for (int i = 0; i < 6; i++) {
        const network_t network = {rates[i], 3, 0.01};
        send_signal(&network, 0.001 + 4 * i, 4 * (i + 1));
    }
    for (int i = 0; i < 6; i++) {
        const int from_ms = 4000 * i, to_ms = from_ms + 4000;
        const double delay = delay_max_periods(from_ms, to_ms);
        report("rate", from_ms + 200, to_ms, delay);
        TEST_ASSERT_TRUE(delay < 6);
        TEST_ASSERT_TRUE(speed_max(from_ms + 200, to_ms) < 1.3 * signal_speed_max(0.001 * from_ms - 0.3, 0.001 * to_ms));
        TEST_ASSERT_TRUE(measure(from_ms + 2000, to_ms, 4000 / rates[i]).shape_um < 50 + 120e3 / rates[i] / rates[i]);
        const double each = i == 1 ? 2 : 1; /* half of the rate before: every second period has a sample */
        TEST_ASSERT_TRUE(fabs(stream_period_us(&s_stream) * 1e-6 * each * rates[i] - 1) < 0.01);
        TEST_ASSERT_TRUE(fabs(stream_report(&s_stream).period_us * 1e-6 * rates[i] - 1) < 0.01);
    }
    for (int ms = 100; ms < 23000; ms++) {
        assert_differences(&s_ref[ms - 1], &s_ref[ms]);
    }
}

/* The acceleration stays continuous when the rate is found anew: on a straight motion all of it comes from the pace of rendering,
 * and goes up over some cycles, not in one. */
static void test_stream_step_new_rate_gives_no_jump_of_acceleration(void)
{
    start(STREAM_SMOOTH);
    for (int i = 0; i < 100; i++) {
        send(0.0012 + i / 30.0, 60 * i / 30.0); /* 60 mm/s */
    }
    for (int i = 0; i < 100; i++) {
        send(0.0012 + 100 / 30.0 + i / 60.0, 200 + 60 * i / 60.0);
    }
    render(0, 0, 4800);
    int64_t acc = 0, jerk = 0;
    for (int ms = 3300; ms < 4800; ms++) {
        acc = llabs(s_ref[ms].acc_per_cycle2_q32) > acc ? llabs(s_ref[ms].acc_per_cycle2_q32) : acc;
        jerk = llabs(s_ref[ms].jerk_per_cycle3_q32) > jerk ? llabs(s_ref[ms].jerk_per_cycle3_q32) : jerk;
    }
    if (getenv("STREAM_FIGURES")) {
        printf("new rate: acceleration %.0f mm/s^2, jerk %.0f mm/s^3\n", 1e6 * mm(acc), 1e9 * mm(jerk));
    }
    TEST_ASSERT_TRUE(jerk * 4 < acc);
}

/* A frame rate that wanders between 45 and 75 Hz, as a game's does. */
/* A sender that falls from a fast rate to a slow one: what the curve was off is taken back in the new one's time, and the end is
 * met. */
static void test_stream_step_much_slower_rate_does_not_swing(void)
{
    for (unsigned fast_hz = 60; fast_hz <= 240; fast_hz += 60) {
        start(STREAM_SMOOTH);
        double at = 0.001;
        for (; at < 3.2; at += 1.0 / fast_hz) {
            send(at, 10 * sin(3.0 * at));
        }
        for (; at < 6.2; at += 0.1) {
            send(at, 10 * sin(3.0 * at));
        }
        const double last = s_sent.value[s_sent.count - 1];
        render(0, 0, 10000);
        for (int ms = 0; ms < 10000; ms++) {
            TEST_ASSERT_DOUBLE_WITHIN(15, 0, mm(s_ref[ms].pos_q32));
        }
        assert_at_rest(q32(last), &s_ref[9999]);
    }
}

static void test_stream_step_wandering_rate_is_followed(void)
{
    make_signal(8);
    start(STREAM_SMOOTH);
    double rate = 60;
    for (double at = 0; at < 20; at += 1 / rate) {
        send(at + 0.002 + 0.002 * random_unit(), signal_at(at));
        rate = fmin(75, fmax(45, rate + 4 * (random_unit() - 0.5)));
    }
    const double delay = delay_max_periods(0, 20000);
    report("wandering", 500, 20000, delay);
    TEST_ASSERT_TRUE(delay < 5);
    TEST_ASSERT_TRUE(speed_max(500, 20000) < 1.5 * signal_speed_max(0, 20));
    TEST_ASSERT_TRUE(measure(1000, 20000, 80).shape_um < 400);
}

/* Every second the network holds everything back for up to 120 ms, then delivers it at once. */
static void test_stream_step_held_back_bursts_are_sorted_in(void)
{
    const network_t network = {60, 3, 0};
    make_signal(7);
    start(STREAM_SMOOTH);
    send_signal(&network, 0, 20);
    for (int i = 0; i < s_sent.count; i++) {
        const double hold = 0.005 * floor(s_sent.at[i]), within = fmod(s_sent.at[i], 1.0);
        s_sent.at[i] = within < hold ? floor(s_sent.at[i]) + hold : s_sent.at[i];
    }
    const double delay = delay_max_periods(0, 19900);
    report("bursts", 300, 19900, delay);
    TEST_ASSERT_TRUE(delay < 120e-3 * 60 + 0.5);
    TEST_ASSERT_TRUE(speed_max(300, 19900) < 1.5 * signal_speed_max(0, 20));
    TEST_ASSERT_TRUE(worst_error(300, 19900, 45) < 20);
}

static void test_stream_step_datagrams_sent_twice_change_nothing(void)
{
    static ramp_ref_t plain[5000];
    make_signal(6);
    start(STREAM_SMOOTH);
    send_signal(&k_usual, 0.0003, 5);
    render(0, 0, 5000);
    memcpy(plain, s_ref, sizeof plain);
    const int count = s_sent.count;
    for (int i = 2 * count - 1; i >= 0; i--) {
        s_sent.at[i] = s_sent.at[i / 2];
        s_sent.value[i] = s_sent.value[i / 2];
    }
    s_sent.count = 2 * count;
    stream_reset(&s_stream);
    render(0, 0, 5000);
    TEST_ASSERT_EQUAL_MEMORY(plain, s_ref, sizeof plain);
}

/* Two samples a datagram apart arrive together, always: half the rate in arrivals, all of it in samples. */
static void test_stream_step_paired_arrivals_are_spread(void)
{
    make_signal(5);
    start(STREAM_SMOOTH);
    for (int i = 0; i < 600; i++) {
        send((i / 2 * 2 + 1) / 60.0 + 0.003, signal_at(i / 60.0));
    }
    const double delay = delay_max_periods(0, 9900);
    report("pairs", 500, 9900, delay);
    TEST_ASSERT_TRUE(measure(1000, 9900, 90).shape_um < 200);
}

static void test_stream_step_flood_is_thinned_out(void)
{
    make_signal(5);
    start(STREAM_SMOOTH);
    for (int i = 0; i < 6000; i++) {
        send(0.001 + 0.0005 * i, signal_at(0.0005 * i));
    }
    const double delay = delay_max_periods(0, 2900);
    report("flood", 50, 2900, delay);
    TEST_ASSERT_UINT32_WITHIN(501, STREAM_PERIOD_MIN_US, stream_period_us(&s_stream)); /* every 8th or 9th */
    TEST_ASSERT_TRUE(delay < 4.5);
    TEST_ASSERT_TRUE(speed_max(50, 2900) < 2 * signal_speed_max(0, 3));
    TEST_ASSERT_TRUE(measure(200, 2900, 40).shape_um < 400);
}

/* Where another share of the samples is taken the rate is another one at once: neither in between for seconds, nor a loss for
 * each sample that is further away. */
static void test_stream_step_other_share_of_a_flood_is_another_rate(void)
{
    for (unsigned seed = 1; seed <= 10; seed++) {
        make_signal(seed);
        start(STREAM_SMOOTH);
        for (int i = 0; i < 9900; i++) {
            send(0.001 + (i + 0.5 * random_unit()) / 750, signal_at(i / 750.0));
        }
        int off_ms = 0;
        for (int ms = 0; ms < 13100; ms++) {
            render(0, ms, ms + 1);
            const double samples = stream_period_us(&s_stream) * 750e-6; /* every third or fourth one */
            off_ms += ms > 200 && fabs(samples - round(samples)) > 0.25;
        }
        if (getenv("STREAM_FIGURES")) {
            printf("share %2u: off for %d ms, shape %.1f um\n", seed, off_ms, measure(200, 13100, 40).shape_um);
        }
        TEST_ASSERT_TRUE(off_ms < 400);
        TEST_ASSERT_TRUE(measure(1000, 13100, 40).shape_um < 40);
    }
}

/* A flood that is thinned out stands, falls silent, and goes on at a common rate from somewhere else: what it was away is no
 * period of the new rate, and the way between no speed, and where it was away for long no motion at all. */
static void test_stream_step_flood_that_pauses_and_jumps_does_not_swing(void)
{
    for (unsigned n = 0; n < 64; n++) {
        const double flood_hz = 600 + 150 * (n % 4), pause_s = 0.1 + 0.2 * (n / 4 % 4), rate_hz = n < 32 ? 50 : 100;
        start(n / 16 % 2 == 0 ? STREAM_SMOOTH : STREAM_BALANCED);
        double at = 0.001, lowest = 0, highest = 0;
        for (; at < 2; at += 1 / flood_hz) {
            send(at, 22.6);
        }
        for (at += pause_s; at < 5; at += 1 / rate_hz) {
            send(at + 0.005 * random_unit(), 0);
        }
        render(0, 0, 8000);
        for (int ms = 0; ms < 8000; ms++) {
            lowest = fmin(lowest, mm(s_ref[ms].pos_q32));
            highest = fmax(highest, mm(s_ref[ms].pos_q32));
        }
        if (getenv("STREAM_FIGURES")) {
            printf("flood of %3.0f Hz, pause of %.1f s, %3.0f Hz: from %.2f to %.2f mm\n", flood_hz, pause_s, rate_hz, lowest,
                   highest);
        }
        TEST_ASSERT_DOUBLE_WITHIN(1, 0, lowest);
        TEST_ASSERT_DOUBLE_WITHIN(pause_s < 0.2 ? 8.5 : 3, 22.6, highest);
        assert_at_rest(0, &s_ref[7999]);
    }
}

/* A loop that sends the newest value of a slower game, again and again. */
static void test_stream_step_repeated_values_are_followed_at_their_own_rate(void)
{
    const double rates[][2] = {{100, 50}, {200, 50}, {100, 60}, {120, 30}, {100, 33.3}, {144, 60},
                               {40, 20},  {200, 60}, {30, 15},  {120, 60}, {20, 10}};
    for (unsigned i = 0; i < sizeof rates / sizeof rates[0]; i++) {
        const double rate = rates[i][1];
        make_signal(i + 1);
        start(i % 2 ? STREAM_BALANCED : STREAM_SMOOTH);
        for (double at = 0; at < 20; at += 1 / rates[i][0]) {
            if (random_unit() > 0.01) {
                send(at + 0.002 + 0.002 * random_unit(), signal_at(floor(at * rate + 1e-9) / rate));
            }
        }
        const quality_t quality = (render(0, 0, 20000), measure(3000, 19900, 5000 / rate));
        if (getenv("STREAM_FIGURES")) {
            printf("repeats %3.0f of %3.0f Hz: lag %.1f periods, shape %.1f um, worst %.3f mm, jerk %.2f x\n", rates[i][0], rate,
                   quality.lag_ms * rate / 1000, quality.shape_um, quality.worst_mm, quality.jerk / quality.jerk_true);
        }
        TEST_ASSERT_TRUE(quality.lag_ms * rate <= (i % 2 ? 1900 : 2500) + 500 * rate / rates[i][0]);
        TEST_ASSERT_TRUE(quality.shape_um <= 35 + 90e3 / rate / rate);
        TEST_ASSERT_TRUE(quality.jerk <= 1.45 * quality.jerk_true); /* most at 20 Hz: a guess of 50 ms */
    }
}

/* A game that becomes quicker, until each frame has a value of its own. */
static void test_stream_step_values_repeated_less_often_are_followed_too(void)
{
    const double rates[] = {50, 100, 200};
    make_signal(3);
    start(STREAM_SMOOTH);
    for (double at = 0; at < 24; at += 0.005) {
        const double rate = rates[(int)(at / 8)];
        send(at + 0.002 + 0.001 * random_unit(), signal_at(floor(at * rate + 1e-9) / rate));
    }
    render(0, 0, 24000);
    for (int i = 0; i < 3; i++) {
        const quality_t quality = measure(8000 * i + 2000, 8000 * i + 7900, 5000 / rates[i]);
        if (getenv("STREAM_FIGURES")) {
            printf("repeats less, %3.0f Hz: lag %.1f periods, shape %.1f um\n", rates[i], quality.lag_ms * rates[i] / 1000,
                   quality.shape_um);
        }
        TEST_ASSERT_TRUE(quality.lag_ms * rates[i] <= 2500 + 4.5 * rates[i]);
        TEST_ASSERT_TRUE(quality.shape_um <= 60);
    }
}

/* A slow motion in whole or tenths of millimetres has equal values too, of its own making; and a sender that stands. */
static void test_stream_step_slow_coarse_motion_repeats_nothing(void)
{
    const double quanta[] = {0.1, 1};
    for (unsigned i = 0; i < 2; i++) {
        double off = 0;
        start(STREAM_SMOOTH);
        for (double at = 0; at < 30; at += 0.01) {
            const double value = fmod(at, 7) < 4 ? sin(at) + 0.5 * sin(2.3 * at) : 0.3;
            send(at + 0.002 + 0.002 * random_unit(), quanta[i] * round(20 * value));
        }
        for (int ms = 0; ms < 30000; ms++) {
            render(0, ms, ms + 1);
            off = ms > 500 ? fmax(off, fabs(stream_period_us(&s_stream) * 1e-4 - 1)) : 0;
        }
        TEST_ASSERT_TRUE(off < 0.05);
    }
}

/* Each value twice, where the values by themselves are too rare for a stream, and where the sender states the period of its
 * frames. */
static void test_stream_step_repeats_are_samples_where_values_are_rare_or_the_period_is_stated(void)
{
    const struct {
        uint32_t frame_us, stated_us, period_us;
    } senders[] = {{60000, 0, 120000}, {60000, 60000, 60000}, {100000, 0, 100000}};
    for (unsigned i = 0; i < sizeof senders / sizeof senders[0]; i++) {
        ramp_ref_t ref;
        uint64_t now_us = 1000000;
        stream_init(&s_stream, CYCLE_US, 1, STREAM_SMOOTH);
        for (unsigned frame = 0; frame < 100; frame++) {
            const q32_t sample = q32(round(50000 * sin(0.15 * (frame - frame % 2))) / 1000);
            stream_hint_period(&s_stream, senders[i].stated_us);
            stream_push(&s_stream, now_us, NULL, &sample);
            for (const uint64_t next_us = now_us + senders[i].frame_us; now_us < next_us; now_us += CYCLE_US) {
                TEST_ASSERT_TRUE(stream_step(&s_stream, now_us, NULL, &ref));
            }
        }
        TEST_ASSERT_UINT32_WITHIN(senders[i].period_us / 50, senders[i].period_us, stream_period_us(&s_stream));
        TEST_ASSERT_UINT32_WITHIN(senders[i].frame_us / 10, senders[i].frame_us, stream_frame_us(&s_stream));
        stream_reset(&s_stream);
        TEST_ASSERT_EQUAL_UINT32(0, stream_frame_us(&s_stream));
    }
}

/* Noise for samples, arrivals of every kind, cycles left out: nothing runs away, nothing is inconsistent. */
static void test_stream_step_noise_stays_bounded(void)
{
    const q32_t range = 50 * Q32_ONE;
    const uint32_t cycles_us[] = {500, 1000, 10000};
    for (int run = 0; run < 60; run++) {
        const uint32_t cycle_us = cycles_us[run % 3];
        const governor_limits_t limits = {.vel_per_cycle_q32 = k_limits.vel_per_cycle_q32 * cycle_us / 1000,
                                          .acc_per_cycle2_q32 = k_limits.acc_per_cycle2_q32 * cycle_us / 1000 * cycle_us / 1000,
                                          .jerk_per_cycle3_q32 =
                                              k_limits.jerk_per_cycle3_q32 * cycle_us / 1000 * cycle_us / 1000 * cycle_us / 1000};
        stream_init(&s_stream, cycle_us, 1, run % 2 ? STREAM_SMOOTH : STREAM_BALANCED);
        stream_set_limits(&s_stream, 0, &limits);
        ramp_ref_t ref = {0};
        uint64_t now_us = 0;
        q32_t low = range, high = -range;
        for (int i = 0; i < 5000; i++) {
            now_us += random_unit() < 0.01 ? (uint64_t)(random_unit() * 300000) : cycle_us;
            const double chance = run < 30 ? 0.01 * (run + 1) : 0.5;
            while (random_unit() < chance) {
                const q32_t sample = (q32_t)((random_unit() * 2 - 1) * (double)range);
                low = sample < low ? sample : low;
                high = sample > high ? sample : high;
                stream_push(&s_stream, now_us, NULL, &sample);
            }
            if (!stream_step(&s_stream, now_us, NULL, &ref)) {
                continue;
            }
            const q32_t span = high - low; /* noise as fast as this swings the curve about: not out of all bounds */
            TEST_ASSERT_TRUE(ref.pos_q32 >= low - 30 * span - 2 && ref.pos_q32 <= high + 30 * span + 2);
            TEST_ASSERT_TRUE(stream_period_us(&s_stream) <= STREAM_PERIOD_MAX_US / 3 * 4);
        }
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_stream_step_without_sample_returns_false);
    RUN_TEST(test_stream_step_lone_sample_is_a_step);
    RUN_TEST(test_stream_push_two_samples_at_once_steps_to_the_second);
    RUN_TEST(test_stream_step_third_sample_starts_at_the_second);
    RUN_TEST(test_stream_step_even_slow_steps_are_a_stream_that_ends_on_the_last);
    RUN_TEST(test_stream_step_slow_poses_that_do_not_lead_on_are_steps);
    RUN_TEST(test_stream_step_leaps_of_a_slow_stream_are_steps);
    RUN_TEST(test_stream_step_uneven_slow_steps_are_steps);
    RUN_TEST(test_stream_step_slow_stream_with_an_early_loss_is_no_later);
    RUN_TEST(test_stream_step_constant_samples_give_a_constant_reference);
    RUN_TEST(test_stream_step_differences_are_consistent);
    RUN_TEST(test_stream_step_signal_that_stops_is_met_exactly);
    RUN_TEST(test_stream_step_time_near_its_end_gives_the_same_bits);
    RUN_TEST(test_stream_step_axes_of_one_signal_move_as_one);
    RUN_TEST(test_stream_smooth_on_cue_signals_keeps_its_figures);
    RUN_TEST(test_stream_balanced_on_cue_signals_keeps_its_figures);
    RUN_TEST(test_stream_jitter_of_a_period_is_told_from_losses);
    RUN_TEST(test_stream_step_late_arrivals_and_losses_are_no_new_rate);
    RUN_TEST(test_stream_step_all_rates_converge);
    RUN_TEST(test_stream_step_lossy_start_finds_the_period);
    RUN_TEST(test_stream_step_ended_stream_rests_on_its_last_sample);
    RUN_TEST(test_stream_step_shake_with_losses_swings_no_further);
    RUN_TEST(test_stream_step_jump_at_the_end_is_not_continued);
    RUN_TEST(test_stream_step_bursts_of_losses_are_bridged_softly);
    RUN_TEST(test_stream_coarse_values_come_out_as_the_motion_that_was_rounded);
    RUN_TEST(test_stream_even_ramps_and_jumps_are_not_coarse);
    RUN_TEST(test_stream_step_after_a_pause_goes_on);
    RUN_TEST(test_stream_step_after_an_end_starts_again);
    RUN_TEST(test_stream_is_live_while_samples_come);
    RUN_TEST(test_stream_step_changing_rates_are_followed);
    RUN_TEST(test_stream_step_new_rate_gives_no_jump_of_acceleration);
    RUN_TEST(test_stream_step_much_slower_rate_does_not_swing);
    RUN_TEST(test_stream_step_wandering_rate_is_followed);
    RUN_TEST(test_stream_step_held_back_bursts_are_sorted_in);
    RUN_TEST(test_stream_step_datagrams_sent_twice_change_nothing);
    RUN_TEST(test_stream_step_paired_arrivals_are_spread);
    RUN_TEST(test_stream_step_flood_is_thinned_out);
    RUN_TEST(test_stream_step_repeated_values_are_followed_at_their_own_rate);
    RUN_TEST(test_stream_step_values_repeated_less_often_are_followed_too);
    RUN_TEST(test_stream_step_slow_coarse_motion_repeats_nothing);
    RUN_TEST(test_stream_step_repeats_are_samples_where_values_are_rare_or_the_period_is_stated);
    RUN_TEST(test_stream_step_other_share_of_a_flood_is_another_rate);
    RUN_TEST(test_stream_step_flood_that_pauses_and_jumps_does_not_swing);
    RUN_TEST(test_stream_step_noise_stays_bounded);
    return UNITY_END();
}
