/* SPDX-License-Identifier: MIT
 * test_hal_clock.c - the contract of hal/clock.h on every backend, and what single backends promise beyond it.
 */
#include "contract.h"

#include <signal.h>
#include <string.h>
#include <sys/time.h>

#include "linux_clock.h"
#include "sim_clock.h"

/** A backend under test. */
typedef struct {
    const char *name;
    hal_clock_t (*open)(void);
} fixture_t;

static sim_clock_t sim;
static const fixture_t *fixture;
static hal_clock_t hal;

static hal_clock_t open_sim(void)
{
    sim_clock_init(&sim, 1000);
    return sim_clock_hal(&sim);
}

static const fixture_t k_fixtures[] = {{"sim", open_sim}, {"linux", linux_clock_hal}};

void setUp(void)
{
    hal = fixture->open();
}

void tearDown(void) {}

static void test_valid_complete_accepts(void)
{
    TEST_ASSERT_TRUE(hal_clock_valid(hal));
}

static void test_valid_any_op_missing_refuses(void)
{
    hal_clock_ops_t ops = *hal.ops;
    TEST_ASSERT_FALSE(hal_clock_valid((hal_clock_t){NULL, NULL}));
    ops.now_us = NULL;
    TEST_ASSERT_FALSE(hal_clock_valid((hal_clock_t){&ops, hal.ctx}));
    ops = *hal.ops;
    ops.sleep_until_us = NULL;
    TEST_ASSERT_FALSE(hal_clock_valid((hal_clock_t){&ops, hal.ctx}));
}

static void test_now_many_calls_never_decreases(void)
{
    uint64_t last_us = hal_clock_now_us(hal);
    for (int i = 0; i < 100000; i++) {
        const uint64_t now_us = hal_clock_now_us(hal);
        TEST_ASSERT_TRUE(now_us >= last_us);
        last_us = now_us;
    }
}

static void test_sleep_future_deadline_never_wakes_early(void)
{
    for (unsigned i = 0; i < 50; i++) {
        const uint64_t deadline_us = hal_clock_now_us(hal) + i * 37;
        TEST_ASSERT_EQUAL(HV_OK, hal_clock_sleep_until_us(hal, deadline_us));
        TEST_ASSERT_TRUE(hal_clock_now_us(hal) >= deadline_us);
    }
}

static void test_sleep_past_deadline_returns_ok(void)
{
    TEST_ASSERT_EQUAL(HV_OK, hal_clock_sleep_until_us(hal, 0));
    TEST_ASSERT_EQUAL(HV_OK, hal_clock_sleep_until_us(hal, hal_clock_now_us(hal)));
}

static void run_contract(void)
{
    RUN_TEST(test_valid_complete_accepts);
    RUN_TEST(test_valid_any_op_missing_refuses);
    RUN_TEST(test_now_many_calls_never_decreases);
    RUN_TEST(test_sleep_future_deadline_never_wakes_early);
    RUN_TEST(test_sleep_past_deadline_returns_ok);
}

/* What only simulated time can promise. */

static void test_sim_sleep_ends_exactly_on_the_deadline(void)
{
    TEST_ASSERT_EQUAL(HV_OK, hal_clock_sleep_until_us(hal, 5000));
    TEST_ASSERT_EQUAL_UINT64(5000, hal_clock_now_us(hal));
    TEST_ASSERT_EQUAL(HV_OK, hal_clock_sleep_until_us(hal, 4000));
    TEST_ASSERT_EQUAL_UINT64(5000, hal_clock_now_us(hal));
    sim_clock_advance(&sim, 7);
    TEST_ASSERT_EQUAL_UINT64(5007, hal_clock_now_us(hal));
}

static void test_sim_late_at_every_step_delays_that_sleep_only(void)
{
    for (uint32_t late_at = 1; late_at <= 10; late_at++) {
        (void)open_sim();
        sim.late_at = late_at;
        sim.late_us = 300;
        for (uint32_t i = 1; i <= 10; i++) {
            TEST_ASSERT_EQUAL(HV_OK, hal_clock_sleep_until_us(hal, 1000 + 1000 * i));
            TEST_ASSERT_EQUAL_UINT64(1000 + 1000 * i + (i == late_at ? 300 : 0), hal_clock_now_us(hal));
        }
    }
}

/* What only Linux can get wrong. */

static volatile sig_atomic_t alarms;

static void count_alarm(int number)
{
    (void)number;
    alarms++;
}

static void test_linux_sleep_interrupted_by_signals_still_reaches_the_deadline(void)
{
    struct sigaction action = {.sa_handler = count_alarm}, before;
    const struct itimerval every = {{0, 2000}, {0, 2000}}, never = {{0, 0}, {0, 0}};
    alarms = 0;
    TEST_ASSERT_EQUAL(0, sigaction(SIGALRM, &action, &before));
    TEST_ASSERT_EQUAL(0, setitimer(ITIMER_REAL, &every, NULL));
    const uint64_t deadline_us = hal_clock_now_us(hal) + 30000;
    const hv_status_t status = hal_clock_sleep_until_us(hal, deadline_us);
    const uint64_t woken_us = hal_clock_now_us(hal);
    TEST_ASSERT_EQUAL(0, setitimer(ITIMER_REAL, &never, NULL));
    TEST_ASSERT_EQUAL(0, sigaction(SIGALRM, &before, NULL));
    TEST_ASSERT_EQUAL(HV_OK, status);
    TEST_ASSERT_TRUE(woken_us >= deadline_us);
    TEST_ASSERT_TRUE(alarms > 0);
}

int main(void)
{
    UNITY_BEGIN();
    for (size_t i = 0; i < sizeof k_fixtures / sizeof k_fixtures[0]; i++) {
        fixture = &k_fixtures[i];
        contract_backend = fixture->name;
        run_contract();
    }
    fixture = &k_fixtures[0];
    contract_backend = fixture->name;
    RUN_TEST(test_sim_sleep_ends_exactly_on_the_deadline);
    RUN_TEST(test_sim_late_at_every_step_delays_that_sleep_only);
    fixture = &k_fixtures[1];
    contract_backend = fixture->name;
    RUN_TEST(test_linux_sleep_interrupted_by_signals_still_reaches_the_deadline);
    return UNITY_END();
}
