/* SPDX-License-Identifier: MIT
 * test_relay_policy.c - longest time closed and shortest time between changes: one relay by hand, all of them at random.
 */
#include <string.h>

#include "random.h"
#include "unity.h"

#include "heave/relay_policy.h"

#define MS 1000u

static relay_policy_t m_policy;
static settings_t m_settings;
static uint64_t m_now_us;

void setUp(void)
{
    memset(&m_policy, 0, sizeof m_policy);
    memset(&m_settings, 0, sizeof m_settings);
    m_settings.relays.count = 12;
    m_now_us = 5000000;
}

void tearDown(void) {}

/* A cycle of 1 ms. */
static uint16_t step(uint16_t asked)
{
    m_now_us += MS;
    return relay_policy_step(&m_policy, &m_settings.relays, asked, false, m_now_us);
}

static uint16_t step_safe(uint16_t asked)
{
    m_now_us += MS;
    return relay_policy_step(&m_policy, &m_settings.relays, asked, true, m_now_us);
}

static void assert_for(unsigned cycles, uint16_t asked, uint16_t expected)
{
    for (unsigned i = 0; i < cycles; i++) {
        TEST_ASSERT_EQUAL_HEX16(expected, step(asked));
    }
}

static void test_step_without_limits_passes_every_mask(void)
{
    for (unsigned mask = 0; mask < 0x1000; mask++) {
        TEST_ASSERT_EQUAL_HEX16(mask, step((uint16_t)mask));
    }
    TEST_ASSERT_EQUAL_UINT32(0, m_policy.cut_count);
    TEST_ASSERT_EQUAL_UINT32(0, m_policy.delay_count);
}

static void test_step_bits_without_a_relay_are_left_out(void)
{
    m_settings.relays.count = 3;
    TEST_ASSERT_EQUAL_HEX16(7, step(0xFFFF));
    m_settings.relays.count = 0;
    setUp();
    m_settings.relays.count = 0;
    TEST_ASSERT_EQUAL_HEX16(0, step(0xFFFF));
}

static void test_step_closed_for_too_long_opens_until_asked_to(void)
{
    m_settings.relays.max_on_ms[1] = 10;
    assert_for(10, 0x7, 0x7);
    assert_for(50, 0x7, 0x5); /* the others stay */
    TEST_ASSERT_EQUAL_UINT32(1, m_policy.cut_count);
    assert_for(1, 0x5, 0x5);
    assert_for(10, 0x7, 0x7);
    assert_for(5, 0x7, 0x5);
    TEST_ASSERT_EQUAL_UINT32(2, m_policy.cut_count);
}

static void test_step_opened_in_time_counts_anew(void)
{
    m_settings.relays.max_on_ms[0] = 10;
    for (unsigned i = 0; i < 10; i++) {
        assert_for(9, 1, 1);
        assert_for(1, 0, 0);
    }
    TEST_ASSERT_EQUAL_UINT32(0, m_policy.cut_count);
}

static void test_step_change_too_soon_waits(void)
{
    m_settings.relays.min_toggle_ms[0] = 20;
    assert_for(5, 1, 1); /* the first change never waits */
    assert_for(15, 0, 1);
    assert_for(1, 0, 0);
    TEST_ASSERT_EQUAL_UINT32(1, m_policy.delay_count);
    assert_for(5, 1, 0); /* a pulse that is over before its time */
    assert_for(40, 0, 0);
    TEST_ASSERT_EQUAL_UINT32(2, m_policy.delay_count);
    assert_for(1, 1, 1);
    TEST_ASSERT_EQUAL_UINT32(2, m_policy.delay_count);
}

static void test_step_safe_mask_never_waits(void)
{
    m_settings.relays.min_toggle_ms[0] = 1000;
    m_settings.relays.min_toggle_ms[3] = 1000;
    assert_for(2, 0x1, 0x1);
    TEST_ASSERT_EQUAL_HEX16(0x8, step_safe(0x8));
    TEST_ASSERT_EQUAL_HEX16(0x0, step_safe(0x0));
    assert_for(998, 0x1, 0x0); /* back under a sender's mask it does, 1000 ms after the last change */
    TEST_ASSERT_EQUAL_HEX16(0x1, step(0x1));
}

static void test_step_longest_time_does_not_wait_for_the_shortest(void)
{
    m_settings.relays.min_toggle_ms[0] = 20;
    m_settings.relays.max_on_ms[0] = 10; /* the configuration refuses that; opening wins all the same */
    assert_for(10, 1, 1);
    assert_for(10, 1, 0);
}

/* What must hold of any relay, judged from the masks alone. */
typedef struct {
    uint64_t closed_since_us, changed_us;
    bool is_closed, has_changed;
} seen_t;

static void judge(seen_t *seen, unsigned i, bool is_closed, bool is_asked, bool is_safe)
{
    const uint32_t on_us = m_settings.relays.max_on_ms[i] * MS;
    const uint32_t toggle_us = m_settings.relays.min_toggle_ms[i] * MS;
    const uint64_t age_us = m_now_us - seen->changed_us;
    const bool is_young = seen->has_changed && age_us < toggle_us;
    if (is_closed != seen->is_closed) {
        TEST_ASSERT_TRUE_MESSAGE(is_safe || !is_young, "changed too soon");
        TEST_ASSERT_TRUE_MESSAGE(is_asked || !is_closed, "closed without being asked");
        seen->is_closed = is_closed;
        seen->has_changed = true;
        seen->changed_us = m_now_us;
    } else if (is_closed) {
        TEST_ASSERT_TRUE_MESSAGE(on_us == 0 || age_us < on_us, "closed for too long");
        TEST_ASSERT_TRUE_MESSAGE(is_asked || (is_young && !is_safe), "still closed, for no reason");
    }
    if (is_safe && !is_asked) {
        TEST_ASSERT_FALSE_MESSAGE(is_closed, "not safe at once");
    }
}

static void test_step_at_random_keeps_every_limit(void)
{
    seen_t seen[HAL_RELAYS_MAX] = {{0}};
    uint16_t asked = 0;
    random_begin(RANDOM_SEED);
    for (unsigned i = 0; i < HAL_RELAYS_MAX; i++) {
        m_settings.relays.min_toggle_ms[i] = i % 3 * 7;
        m_settings.relays.max_on_ms[i] = i % 4 * 15;
    }
    for (unsigned cycle = 0; cycle < 200000; cycle++) {
        asked = random_below(4) == 0 ? asked ^ (uint16_t)(1u << random_below(12)) : asked;
        const bool is_safe = cycle / 100 % 5 == 4;
        const uint16_t mask = is_safe ? step_safe(0) : step(asked);
        for (unsigned i = 0; i < HAL_RELAYS_MAX; i++) {
            judge(&seen[i], i, (mask >> i & 1) != 0, !is_safe && (asked >> i & 1) != 0, is_safe);
        }
    }
    TEST_ASSERT_GREATER_THAN_UINT32(1000, m_policy.cut_count);
    TEST_ASSERT_GREATER_THAN_UINT32(1000, m_policy.delay_count);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_step_without_limits_passes_every_mask);
    RUN_TEST(test_step_bits_without_a_relay_are_left_out);
    RUN_TEST(test_step_closed_for_too_long_opens_until_asked_to);
    RUN_TEST(test_step_opened_in_time_counts_anew);
    RUN_TEST(test_step_change_too_soon_waits);
    RUN_TEST(test_step_safe_mask_never_waits);
    RUN_TEST(test_step_longest_time_does_not_wait_for_the_shortest);
    RUN_TEST(test_step_at_random_keeps_every_limit);
    return UNITY_END();
}
