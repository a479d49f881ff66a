/* SPDX-License-Identifier: MIT
 * test_canpassive.c - the time that a controller has been error-passive, against one that says what a test wants.
 */
#include "heave/canpassive.h"

#include "unity.h"

#define LIMIT_MS 1000u
#define LIMIT_US 1000000u

static canpassive_t m_passive;
static hal_can_state_t m_reported;
static hal_can_state_t m_true;
static hv_status_t m_report;
static hv_status_t m_answer;
static unsigned m_asked;

static hv_status_t report(void *ctx, hal_can_state_t *out)
{
    (void)ctx;
    *out = m_reported;
    return m_report;
}

static hv_status_t ask(void *ctx, hal_can_state_t *out)
{
    (void)ctx;
    m_asked++;
    if (m_answer == HV_OK) {
        *out = m_true;
    }
    return m_answer;
}

static const hal_can_ops_t k_ops = {.bus_state = report, .ask_state = ask};
static const hal_can_ops_t k_old_ops = {.bus_state = report};

static bool look_at(const hal_can_ops_t *ops, uint64_t now_us, uint32_t limit_ms)
{
    canpassive_step(&m_passive, (hal_can_t){ops, NULL}, now_us, limit_ms);
    return m_passive.is_failing;
}

static bool look(uint64_t now_us)
{
    return look_at(&k_ops, now_us, LIMIT_MS);
}

void setUp(void)
{
    m_passive = (canpassive_t){.is_failing = false};
    m_reported = m_true = HAL_CAN_PASSIVE;
    m_answer = m_report = HV_OK;
    m_asked = 0;
}

void tearDown(void) {}

static void test_step_failing_after_the_limit_and_not_before(void)
{
    const uint64_t begin_us = UINT64_C(400) * 86400 * 1000000;
    TEST_ASSERT_FALSE(look(begin_us));
    TEST_ASSERT_FALSE(look(begin_us + LIMIT_US - 1));
    TEST_ASSERT_EQUAL_UINT(0, m_asked);
    TEST_ASSERT_TRUE(look(begin_us + LIMIT_US));
    TEST_ASSERT_EQUAL_UINT(1, m_asked);
    TEST_ASSERT_TRUE(look(begin_us + LIMIT_US + 1));
    TEST_ASSERT_EQUAL_UINT(1, m_asked); /* not every cycle */
}

static void test_step_every_other_state_ends_it_and_the_time_starts_anew(void)
{
    static const hal_can_state_t k_others[] = {HAL_CAN_ACTIVE, HAL_CAN_WARNING, HAL_CAN_BUS_OFF, HAL_CAN_DOWN, HAL_CAN_GONE};
    for (size_t i = 0; i < sizeof k_others / sizeof k_others[0]; i++) {
        setUp();
        (void)look(5);
        TEST_ASSERT_TRUE(look(5 + LIMIT_US));
        m_reported = k_others[i];
        TEST_ASSERT_FALSE(look(6 + LIMIT_US));
        m_reported = HAL_CAN_PASSIVE;
        TEST_ASSERT_FALSE(look(7 + LIMIT_US));
        TEST_ASSERT_FALSE(look(6 + 2 * LIMIT_US));
        TEST_ASSERT_TRUE(look(7 + 2 * LIMIT_US));
    }
}

static void test_step_recovery_that_is_never_reported_is_found_by_asking(void)
{
    m_true = HAL_CAN_ACTIVE;
    (void)look(0);
    TEST_ASSERT_FALSE(look(LIMIT_US));
    TEST_ASSERT_FALSE(look(2 * LIMIT_US - 1));
    m_true = HAL_CAN_PASSIVE;
    TEST_ASSERT_TRUE(look(2 * LIMIT_US));
    m_true = HAL_CAN_ACTIVE;
    TEST_ASSERT_TRUE(look(3 * LIMIT_US - 1));
    TEST_ASSERT_FALSE(look(3 * LIMIT_US));
}

static void test_step_report_stands_where_nobody_can_be_asked(void)
{
    m_answer = HV_ERR_IO;
    (void)look(0);
    TEST_ASSERT_TRUE(look(LIMIT_US));
    setUp();
    (void)look_at(&k_old_ops, 0, LIMIT_MS);
    TEST_ASSERT_TRUE(look_at(&k_old_ops, LIMIT_US, LIMIT_MS));
}

static void test_step_limit_0_never(void)
{
    TEST_ASSERT_FALSE(look_at(&k_ops, 0, 0));
    TEST_ASSERT_FALSE(look_at(&k_ops, UINT64_MAX, 0));
}

/* A backend that knows no state says nothing of it either way: other watches see to a bus that is gone. */
static void test_step_state_that_is_not_known_is_not_passive(void)
{
    m_report = HV_ERR_IO;
    TEST_ASSERT_FALSE(look(5));
    TEST_ASSERT_FALSE(look(5 + 2 * LIMIT_US));
    TEST_ASSERT_EQUAL_UINT(0, m_asked);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_step_failing_after_the_limit_and_not_before);
    RUN_TEST(test_step_every_other_state_ends_it_and_the_time_starts_anew);
    RUN_TEST(test_step_recovery_that_is_never_reported_is_found_by_asking);
    RUN_TEST(test_step_report_stands_where_nobody_can_be_asked);
    RUN_TEST(test_step_limit_0_never);
    RUN_TEST(test_step_state_that_is_not_known_is_not_passive);
    return UNITY_END();
}
