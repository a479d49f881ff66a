/* SPDX-License-Identifier: MIT
 * test_mask_guard.c - whether the last value of a frame is a mask: what senders do, frame by frame.
 */
#include "unity.h"

#include "heave/mask_guard.h"

#include <stdio.h>
#include <string.h>

#define PERIOD_US 16667u

static mask_guard_t m_guard;
static mask_policy_t m_policy;
static uint64_t m_now_us;
static uint64_t m_random;

void setUp(void)
{
    memset(&m_guard, 0, sizeof m_guard);
    m_policy = MASK_LEARNT;
    m_now_us = 5000000;
    m_random = UINT64_C(0x9E3779B97F4A7C15);
}

void tearDown(void) {}

static unsigned below(unsigned end)
{
    m_random = m_random * UINT64_C(6364136223846793005) + 1442695040888963407u;
    return (unsigned)(m_random >> 33) % end;
}

static bool pass(bool has_mask, bool is_timed)
{
    const frame_t frame = {.has_mask = has_mask, .is_timed = is_timed};
    m_now_us += PERIOD_US;
    return mask_guard_allows(m_policy, &frame) && mask_guard_passes(&m_guard, m_policy, &frame, m_now_us);
}

static void pass_all(bool has_mask, unsigned frames)
{
    for (unsigned i = 0; i < frames; i++) {
        TEST_ASSERT_TRUE(pass(has_mask, false));
    }
}

static mask_habit_t habit(void)
{
    return mask_guard_habit(&m_guard, m_policy);
}

static void test_ten_frames_of_a_form_refuse_the_other(void)
{
    for (int has_mask = 0; has_mask <= 1; has_mask++) {
        setUp();
        pass_all(!has_mask, 9);
        pass_all(has_mask, 9); /* nine of the other begin anew */
        TEST_ASSERT_EQUAL(MASK_UNKNOWN, habit());
        pass_all(has_mask, 1);
        TEST_ASSERT_EQUAL(has_mask ? MASK_SENT : MASK_NONE, habit());
        for (unsigned i = 0; i < 1000; i++) { /* however often it comes, also mixed with good ones */
            TEST_ASSERT_FALSE(pass(!has_mask, false));
            TEST_ASSERT_TRUE(i % 3 != 0 || pass(has_mask, false));
        }
        TEST_ASSERT_EQUAL(has_mask ? MASK_SENT : MASK_NONE, habit());
    }
}

static void test_silence_forgets_and_refused_frames_are_no_silence(void)
{
    pass_all(false, 10);
    for (unsigned i = 0; i < 5; i++) {
        m_now_us += MASK_GUARD_GAP_US - 2 * PERIOD_US;
        TEST_ASSERT_FALSE(pass(true, false));
    }
    m_now_us += MASK_GUARD_GAP_US - PERIOD_US;
    TEST_ASSERT_TRUE(pass(true, false));
    TEST_ASSERT_EQUAL(MASK_UNKNOWN, habit());
    pass_all(false, 10);
    mask_guard_restart(&m_guard);
    TEST_ASSERT_TRUE(pass(true, false));
}

/* As the vendor's examples are tried by hand: nothing is learnt of them. */
static void test_lone_frames_are_taken_in_any_form(void)
{
    for (unsigned i = 0; i < 100; i++) {
        m_now_us += 2000000;
        TEST_ASSERT_TRUE(pass(below(2) != 0, below(4) == 0));
        TEST_ASSERT_TRUE(mask_guard_follows(&m_guard, m_policy, (uint16_t)below(0x1000)));
    }
}

static void test_timed_frames_have_no_form(void)
{
    pass_all(true, 9);
    TEST_ASSERT_TRUE(pass(false, true));
    pass_all(true, 1);
    TEST_ASSERT_EQUAL(MASK_SENT, habit());
    TEST_ASSERT_TRUE(pass(false, true));
    TEST_ASSERT_FALSE(pass(false, false));
    m_policy = MASK_ALWAYS;
    TEST_ASSERT_TRUE(pass(false, true));
}

static void test_policies_that_are_set(void)
{
    static const struct {
        mask_policy_t policy;
        bool takes[2];
        mask_habit_t habit;
    } k_rows[] = {
        {MASK_ALWAYS, {false, true}, MASK_SENT}, {MASK_NEVER, {true, false}, MASK_NONE}, {MASK_ANY, {true, true}, MASK_UNKNOWN}};
    for (unsigned row = 0; row < sizeof k_rows / sizeof k_rows[0]; row++) {
        setUp();
        m_policy = k_rows[row].policy;
        for (unsigned i = 0; i < 200; i++) {
            const bool has_mask = below(2) != 0;
            TEST_ASSERT_EQUAL(k_rows[row].takes[has_mask], pass(has_mask, false));
            TEST_ASSERT_TRUE(mask_guard_follows(&m_guard, m_policy, (uint16_t)(i % 100 / 10 * 16 + i % 10)));
            TEST_ASSERT_EQUAL(k_rows[row].habit, habit());
        }
    }
}

/* --- Digits --- */

static uint16_t bcd(unsigned value)
{
    return (uint16_t)(value % 10 + value / 10 % 10 * 16 + value / 100 % 10 * 256);
}

/* Of so many frames: how often a relay's mask changes, as the sender would have it switched. */
static unsigned changes(unsigned frames, uint16_t (*mask_of)(unsigned frame))
{
    uint16_t followed = 0;
    unsigned changes = 0;
    for (unsigned i = 0; i < frames; i++) {
        const uint16_t mask = mask_of(i);
        TEST_ASSERT_TRUE(pass(true, false));
        const bool is_followed = mask_guard_follows(&m_guard, m_policy, mask);
        const uint16_t next = habit() == MASK_DIGITS ? 0 : is_followed ? mask : followed;
        changes += next != followed;
        followed = next;
    }
    return changes;
}

static uint16_t random_digits(unsigned frame)
{
    (void)frame;
    return bcd(below(100));
}

static uint16_t random_digit(unsigned frame)
{
    (void)frame;
    return bcd(below(10));
}

static uint16_t three_digits(unsigned frame)
{
    return bcd(frame * 37);
}

static uint16_t counting(unsigned frame)
{
    return bcd(frame);
}

static uint16_t counting_down(unsigned frame)
{
    return bcd(9999 - frame);
}

static void test_digits_of_a_value_do_not_chatter(void)
{
    static uint16_t (*const k_senders[])(unsigned) = {random_digits, random_digit, three_digits, counting, counting_down};
    for (unsigned i = 0; i < sizeof k_senders / sizeof k_senders[0]; i++) {
        setUp();
        const unsigned seen = changes(600, k_senders[i]);
        printf("# sender %u: %u changes in 600 frames\n", i, seen);
        TEST_ASSERT_EQUAL(MASK_DIGITS, habit());
        TEST_ASSERT_LESS_OR_EQUAL_UINT(16, seen); /* until it is known, then none */
    }
}

/* --- Masks --- */

static uint16_t steady(unsigned frame)
{
    return frame / 30 % 2 ? 0x10 : 0x01;
}

static uint16_t chase_of_twelve(unsigned frame)
{
    return (uint16_t)(1u << frame / 5 % 12); /* twelve a second at 60 frames a second */
}

static uint16_t relay_by_relay(unsigned frame)
{
    return (uint16_t)(1u << frame % 12);
}

static uint16_t pairs_each_frame(unsigned frame)
{
    return (uint16_t)(0x11u << frame % 4);
}

static uint16_t opposed_pairs(unsigned frame)
{
    return (uint16_t)(0x41u << frame / 6 % 6);
}

static uint16_t three_at_once(unsigned frame)
{
    static const uint16_t k_masks[] = {0, 1, 3, 7, 3, 1}; /* up and down */
    return k_masks[frame / 3 % 6];
}

static uint16_t three_lamps_counting(unsigned frame)
{
    return (uint16_t)(frame / 6 % 8);
}

static uint16_t nine_lamps_at_random(unsigned frame)
{
    static uint16_t mask;
    mask = frame % 6 == 0 ? (uint16_t)(below(8) | below(8) << 4 | below(8) << 8) : mask;
    return mask;
}

static uint16_t every_mask(unsigned frame)
{
    return (uint16_t)(frame / 4 * 0x2B3 & 0xFFF); /* hexadecimal letters among them */
}

static void test_masks_of_shows_are_followed(void)
{
    TEST_ASSERT_EQUAL_UINT(20, changes(600, steady)); /* from no relay, then each half second */
    setUp();
    TEST_ASSERT_EQUAL_UINT(120, changes(600, chase_of_twelve));
    setUp();
    TEST_ASSERT_EQUAL_UINT(600, changes(600, relay_by_relay));
    setUp();
    TEST_ASSERT_EQUAL_UINT(600, changes(600, pairs_each_frame));
    setUp();
    TEST_ASSERT_EQUAL_UINT(100, changes(600, opposed_pairs));
    setUp();
    TEST_ASSERT_EQUAL_UINT(199, changes(600, three_at_once));
    setUp();
    TEST_ASSERT_EQUAL_UINT(99, changes(600, three_lamps_counting));
    setUp();
    TEST_ASSERT_GREATER_OR_EQUAL_UINT(95, changes(600, nine_lamps_at_random));
    setUp();
    TEST_ASSERT_GREATER_OR_EQUAL_UINT(149, changes(600, every_mask));
    TEST_ASSERT_NOT_EQUAL(MASK_DIGITS, habit());
}

/* A letter among them: these are masks. */
static void test_digits_end_with_a_mask_that_has_a_letter_or_with_silence(void)
{
    (void)changes(100, counting);
    TEST_ASSERT_EQUAL(MASK_DIGITS, habit());
    TEST_ASSERT_TRUE(mask_guard_follows(&m_guard, m_policy, 0x0F));
    TEST_ASSERT_NOT_EQUAL(MASK_DIGITS, habit());
    (void)changes(100, counting);
    TEST_ASSERT_EQUAL(MASK_DIGITS, habit());
    TEST_ASSERT_EQUAL_UINT(0, changes(1000, steady)); /* the value stands still */
    m_now_us += MASK_GUARD_GAP_US;
    TEST_ASSERT_TRUE(pass(true, false));
    TEST_ASSERT_NOT_EQUAL(MASK_DIGITS, habit());
}

/* As somebody tries them, or plays them from a list. */
static void test_masks_at_leisure_are_followed(void)
{
    for (unsigned i = 0; i < 200; i++) {
        m_now_us += MASK_GUARD_QUICK_US - PERIOD_US;
        TEST_ASSERT_TRUE(pass(true, false));
        TEST_ASSERT_TRUE(mask_guard_follows(&m_guard, m_policy, bcd(i * 37)));
    }
}

/* One mask that stays for one frame only, as of a pulse, is followed both ways. */
static void test_a_pulse_of_one_frame_is_followed(void)
{
    static const uint16_t k_masks[] = {1, 1, 1, 3, 1, 1, 1};
    for (unsigned i = 0; i < sizeof k_masks / sizeof k_masks[0]; i++) {
        TEST_ASSERT_TRUE(pass(true, false));
        TEST_ASSERT_TRUE(mask_guard_follows(&m_guard, m_policy, k_masks[i]));
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_ten_frames_of_a_form_refuse_the_other);
    RUN_TEST(test_silence_forgets_and_refused_frames_are_no_silence);
    RUN_TEST(test_lone_frames_are_taken_in_any_form);
    RUN_TEST(test_timed_frames_have_no_form);
    RUN_TEST(test_policies_that_are_set);
    RUN_TEST(test_digits_of_a_value_do_not_chatter);
    RUN_TEST(test_masks_of_shows_are_followed);
    RUN_TEST(test_digits_end_with_a_mask_that_has_a_letter_or_with_silence);
    RUN_TEST(test_masks_at_leisure_are_followed);
    RUN_TEST(test_a_pulse_of_one_frame_is_followed);
    return UNITY_END();
}
