/* SPDX-License-Identifier: MIT
 * test_switches.c - bouncing contacts, an e-stop that acts at once, inputs that cannot be read.
 */
#include <string.h>

#include "unity.h"

#include "heave/switches.h"
#include "sim_inputs.h"

#define CYCLE_US 1000u
#define SETTLE   (SWITCHES_SETTLE_US / CYCLE_US)
#define ALL      (INPUT_ESTOP | INPUT_ENABLE | INPUT_RESET)
#define BOTH     (INPUT_ESTOP | INPUT_ESTOP2)
#define APART    (INPUT_ESTOP | INPUT_APART)
#define APART_MS 300u

static sim_inputs_t m_inputs;
static switches_t m_switches;
static uint64_t m_now_us;

static void start(uint32_t levels)
{
    sim_inputs_init(&m_inputs, ALL);
    m_inputs.levels = levels;
    switches_init(&m_switches, sim_inputs_hal(&m_inputs), 0);
    m_now_us = 0;
}

void setUp(void)
{
    start(0);
}

void tearDown(void) {}

/* A cycle in which the switches stand like this. */
static switches_change_t step(uint32_t levels)
{
    m_inputs.levels = levels;
    m_now_us += CYCLE_US;
    return switches_step(&m_switches, m_now_us);
}

static uint32_t levels(void)
{
    uint32_t out = 0xDEAD;
    TEST_ASSERT_EQUAL(HV_OK, hal_inputs_read(switches_hal(&m_switches), &out));
    return out;
}

static void step_quiet(uint32_t raw, unsigned cycles, uint32_t expected)
{
    for (unsigned i = 0; i < cycles; i++) {
        const switches_change_t change = step(raw);
        TEST_ASSERT_EQUAL_HEX32(0, change.on | change.off);
        TEST_ASSERT_EQUAL_HEX32(expected, levels());
    }
}

static void test_first_levels_count_and_are_no_change(void)
{
    for (uint32_t first = 0; first <= ALL; first++) {
        start(first);
        step_quiet(first, 3 * SETTLE, first);
        TEST_ASSERT_EQUAL_HEX32(ALL, hal_inputs_present(switches_hal(&m_switches)));
    }
}

static void test_estop_counts_in_the_cycle_that_sees_it_and_goes_when_it_has_stood_still(void)
{
    step_quiet(0, 1, 0);
    step_quiet(INPUT_ESTOP, 1, INPUT_ESTOP);
    step_quiet(0, SETTLE, INPUT_ESTOP);
    step_quiet(0, 1, 0);
    step_quiet(INPUT_ESTOP, 1, INPUT_ESTOP);
}

static void test_estop_release_that_bounces_starts_anew(void)
{
    step_quiet(INPUT_ESTOP, 1, INPUT_ESTOP);
    for (unsigned pause = 1; pause <= SETTLE; pause++) {
        step_quiet(0, pause, INPUT_ESTOP);
        step_quiet(INPUT_ESTOP, 1, INPUT_ESTOP);
    }
    step_quiet(0, SETTLE, INPUT_ESTOP);
    step_quiet(0, 1, 0);
}

static void assert_one_change(uint32_t input)
{
    switches_change_t change = step(input);
    TEST_ASSERT_EQUAL_HEX32(input, change.on);
    TEST_ASSERT_EQUAL_HEX32(0, change.off);
    step_quiet(input, 3 * SETTLE, input);
    step_quiet(0, SETTLE, input);
    change = step(0);
    TEST_ASSERT_EQUAL_HEX32(0, change.on);
    TEST_ASSERT_EQUAL_HEX32(input, change.off);
    step_quiet(0, 3 * SETTLE, 0);
}

static void test_key_and_button_change_once_when_they_have_stood_still(void)
{
    step_quiet(0, 1, 0);
    for (uint32_t input = INPUT_ENABLE; input <= INPUT_RESET; input <<= 1) {
        for (unsigned i = 0; i < 40; i++) {
            step_quiet(input, 1 + i % 3, 0);
            step_quiet(0, 1 + i % 2, 0);
        }
        step_quiet(input, SETTLE, 0);
        assert_one_change(input);
    }
}

static void test_a_glitch_presses_no_button(void)
{
    step_quiet(0, 1, 0);
    for (unsigned cycles = 1; cycles <= SETTLE; cycles++) {
        step_quiet(INPUT_RESET, cycles, 0);
        step_quiet(0, 2, 0);
    }
}

static void test_inputs_that_cannot_be_read_say_so_and_come_back_as_an_estop(void)
{
    uint32_t out = 0xDEAD;
    step_quiet(INPUT_ENABLE, 1, INPUT_ENABLE);
    m_inputs.is_broken = true;
    (void)step(INPUT_ENABLE | INPUT_RESET);
    TEST_ASSERT_TRUE(switches_is_lost(&m_switches));
    TEST_ASSERT_EQUAL(HV_ERR_IO, hal_inputs_read(switches_hal(&m_switches), &out));
    TEST_ASSERT_EQUAL_HEX32(0xDEAD, out);
    m_inputs.is_broken = false;
    step_quiet(INPUT_ENABLE, SETTLE - 1, INPUT_ENABLE | INPUT_ESTOP);
    TEST_ASSERT_FALSE(switches_is_lost(&m_switches));
    step_quiet(INPUT_ENABLE, 1, INPUT_ENABLE);
}

/* A button that is held down while nothing can be seen has to be pressed again, for long enough, to count. */
static void test_a_button_pressed_unseen_counts_after_its_time_only(void)
{
    step_quiet(0, 1, 0);
    step_quiet(INPUT_RESET, SETTLE, 0);
    m_inputs.is_broken = true;
    for (unsigned i = 0; i < 2 * SETTLE; i++) {
        TEST_ASSERT_EQUAL_HEX32(0, step(INPUT_RESET).on);
    }
    m_inputs.is_broken = false;
    for (unsigned i = 0; i + 1 < SETTLE; i++) {
        TEST_ASSERT_EQUAL_HEX32(0, step(INPUT_RESET).on);
    }
    TEST_ASSERT_EQUAL_HEX32(INPUT_RESET, step(INPUT_RESET).on);
}

static void test_broken_from_the_start_is_an_estop_until_it_is_released(void)
{
    m_inputs.is_broken = true;
    (void)step(0);
    TEST_ASSERT_TRUE(switches_is_lost(&m_switches));
    m_inputs.is_broken = false;
    step_quiet(0, 1, INPUT_ESTOP);
}

static void test_key_is_off_where_there_is_one(void)
{
    step_quiet(0, 1, 0);
    TEST_ASSERT_TRUE(switches_is_key_off(&m_switches));
    start(INPUT_ENABLE);
    step_quiet(INPUT_ENABLE, 1, INPUT_ENABLE);
    TEST_ASSERT_FALSE(switches_is_key_off(&m_switches));
    start(0);
    m_inputs.present = INPUT_ESTOP;
    step_quiet(0, 1, 0);
    TEST_ASSERT_FALSE(switches_is_key_off(&m_switches));
}

/* ---- Two channels ---- */

static void start_two(void)
{
    sim_inputs_init(&m_inputs, ALL | INPUT_ESTOP2 | INPUT_POWER);
    switches_init(&m_switches, sim_inputs_hal(&m_inputs), APART_MS * 1000);
    m_now_us = 0;
    step_quiet(0, 2 * APART_MS, 0);
}

static void test_channels_either_one_is_an_estop_and_both_have_to_be_released(void)
{
    start_two();
    for (uint32_t first = INPUT_ESTOP; first <= INPUT_ESTOP2; first *= INPUT_ESTOP2) {
        step_quiet(first, 1, INPUT_ESTOP);
        step_quiet(first, APART_MS - 10, INPUT_ESTOP);
        step_quiet(BOTH, 1000, INPUT_ESTOP);
        step_quiet(first, SETTLE + 100, INPUT_ESTOP); /* the other one is released first */
        step_quiet(0, SETTLE, INPUT_ESTOP);
        step_quiet(0, 1000, 0);
    }
}

static void test_channels_that_disagree_too_long_are_apart_until_both_have_opened_and_closed(void)
{
    for (uint32_t stuck = INPUT_ESTOP; stuck <= INPUT_ESTOP2; stuck *= INPUT_ESTOP2) {
        const uint32_t moves = BOTH & ~stuck;
        start_two();
        step_quiet(moves, APART_MS - 1, INPUT_ESTOP);
        step_quiet(moves, 1000, APART);
        step_quiet(0, 2000, APART); /* released: what is welded looks well now */
        step_quiet(moves, 1000, APART);
        step_quiet(stuck, 1000, APART);
        step_quiet(BOTH, 100, APART);
        step_quiet(0, SETTLE, APART);
        step_quiet(0, 1000, 0);
        step_quiet(moves, APART_MS - 1, INPUT_ESTOP); /* and from the beginning */
        step_quiet(moves, 1, APART);
    }
}

static void test_channels_one_that_does_not_close_again_is_apart(void)
{
    start_two();
    step_quiet(BOTH, 100, INPUT_ESTOP);
    step_quiet(INPUT_ESTOP2, SETTLE + APART_MS - 1, INPUT_ESTOP);
    step_quiet(INPUT_ESTOP2, 100, INPUT_ESTOP | INPUT_APART);
    step_quiet(0, 1000, APART); /* its wire is mended, and nobody has pressed it yet */
    step_quiet(BOTH, 1, APART);
    step_quiet(0, SETTLE, APART);
    step_quiet(0, 1, 0);
}

static void test_channels_that_bounce_agree(void)
{
    start_two();
    for (unsigned i = 0; i < 2000; i++) {
        (void)step(i % 3 == 0 ? INPUT_ESTOP : i % 3 == 1 ? INPUT_ESTOP2 : 0);
        TEST_ASSERT_EQUAL_HEX32(INPUT_ESTOP, levels());
    }
}

static void test_channels_that_cannot_be_read_do_not_disagree(void)
{
    start_two();
    m_inputs.is_broken = true;
    for (unsigned i = 0; i < 3 * APART_MS; i++) {
        (void)step(INPUT_ESTOP);
    }
    m_inputs.is_broken = false;
    step_quiet(BOTH, 10, INPUT_ESTOP);
    step_quiet(0, SETTLE, INPUT_ESTOP);
    step_quiet(0, 1, 0);
}

static void test_channels_one_alone_is_never_apart(void)
{
    step_quiet(0, 1, 0);
    step_quiet(INPUT_ESTOP, 100000, INPUT_ESTOP);
}

static void test_power_is_told_of_once_when_it_has_stood_still(void)
{
    start_two();
    TEST_ASSERT_FALSE(switches_is_power_failing(&m_switches));
    step_quiet(INPUT_POWER, SETTLE, 0);
    TEST_ASSERT_EQUAL_HEX32(INPUT_POWER, step(INPUT_POWER).on);
    TEST_ASSERT_TRUE(switches_is_power_failing(&m_switches));
    step_quiet(INPUT_POWER, 1000, INPUT_POWER);
    step_quiet(0, SETTLE, INPUT_POWER);
    TEST_ASSERT_EQUAL_HEX32(INPUT_POWER, step(0).off);
    TEST_ASSERT_FALSE(switches_is_power_failing(&m_switches));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_first_levels_count_and_are_no_change);
    RUN_TEST(test_estop_counts_in_the_cycle_that_sees_it_and_goes_when_it_has_stood_still);
    RUN_TEST(test_estop_release_that_bounces_starts_anew);
    RUN_TEST(test_key_and_button_change_once_when_they_have_stood_still);
    RUN_TEST(test_a_glitch_presses_no_button);
    RUN_TEST(test_inputs_that_cannot_be_read_say_so_and_come_back_as_an_estop);
    RUN_TEST(test_a_button_pressed_unseen_counts_after_its_time_only);
    RUN_TEST(test_broken_from_the_start_is_an_estop_until_it_is_released);
    RUN_TEST(test_key_is_off_where_there_is_one);
    RUN_TEST(test_channels_either_one_is_an_estop_and_both_have_to_be_released);
    RUN_TEST(test_channels_that_disagree_too_long_are_apart_until_both_have_opened_and_closed);
    RUN_TEST(test_channels_one_that_does_not_close_again_is_apart);
    RUN_TEST(test_channels_that_bounce_agree);
    RUN_TEST(test_channels_that_cannot_be_read_do_not_disagree);
    RUN_TEST(test_channels_one_alone_is_never_apart);
    RUN_TEST(test_power_is_told_of_once_when_it_has_stood_still);
    return UNITY_END();
}
