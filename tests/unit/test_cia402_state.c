/* SPDX-License-Identifier: MIT
 * test_cia402_state.c - statusword and controlword, every value, against the standard's rules written down once more.
 */
#include "heave/cia402_state.h"

#include "unity.h"

void setUp(void) {}

void tearDown(void) {}

/* Bits 6, 5, 3, 2, 1, 0 as the standard prints them, x = does not matter. */
static const char *const k_patterns[] = {
    [CIA402_NOT_READY] = "0x0000",          [CIA402_SWITCH_ON_DISABLED] = "1x0000",
    [CIA402_READY_TO_SWITCH_ON] = "010001", [CIA402_SWITCHED_ON] = "010011",
    [CIA402_OPERATION_ENABLED] = "010111",  [CIA402_QUICK_STOP_ACTIVE] = "000111",
    [CIA402_FAULT_REACTION] = "0x1111",     [CIA402_FAULT] = "0x1000",
};

static bool is_pattern(const char *pattern, unsigned word)
{
    static const unsigned k_bits[] = {6, 5, 3, 2, 1, 0};
    for (unsigned i = 0; i < 6; i++) {
        if (pattern[i] != 'x' && (word >> k_bits[i] & 1) != (unsigned)(pattern[i] - '0')) {
            return false;
        }
    }
    return true;
}

static void test_state_every_statusword_is_as_the_standard_says(void)
{
    for (unsigned word = 0; word <= 0xFFFF; word++) {
        cia402_state_t expected = CIA402_STRANGE;
        for (unsigned s = 0; s < CIA402_STRANGE; s++) {
            expected = is_pattern(k_patterns[s], word) ? (cia402_state_t)s : expected;
        }
        TEST_ASSERT_EQUAL_MESSAGE(expected, cia402_state((uint16_t)word), "statusword");
    }
}

static void test_state_words_seen_on_drives_are_decoded(void)
{
    TEST_ASSERT_EQUAL(CIA402_OPERATION_ENABLED, cia402_state(0x1237));
    TEST_ASSERT_EQUAL(CIA402_OPERATION_ENABLED, cia402_state(0x0027));
    TEST_ASSERT_EQUAL(CIA402_SWITCH_ON_DISABLED, cia402_state(0x0250));
    TEST_ASSERT_EQUAL(CIA402_FAULT, cia402_state(0x1218));
}

/* What a controlword asks for, from its bits 7, 3, 2, 1, 0. */
static char command(uint16_t word)
{
    if ((word & 0x80) != 0) {
        return 'r';
    }
    if ((word & 0x02) == 0) {
        return 'v'; /* disable voltage */
    }
    if ((word & 0x04) == 0) {
        return 'q'; /* quick stop */
    }
    if ((word & 0x01) == 0) {
        return 's'; /* shutdown */
    }
    return (word & 0x08) != 0 ? 'e' : 'o'; /* enable operation; switch on, or disable operation */
}

static void test_controlword_every_state_and_goal_is_the_next_step(void)
{
    /* not ready, disabled, ready, on, operating, quick stop, reaction, fault, strange */
    static const char *const k_expected[CIA402_GOALS] = {
        [CIA402_GOAL_OFF] = "vvvsoqvvv",
        [CIA402_GOAL_STOP] = "vvvqqqvvq",
        [CIA402_GOAL_ON] = "vsooo"
                           "qvvv",
        [CIA402_GOAL_OPERATE] = "vsoee"
                                "qvvv",
    };
    for (unsigned goal = 0; goal < CIA402_GOALS; goal++) {
        for (unsigned state = 0; state < CIA402_STATES; state++) {
            const uint16_t word = cia402_controlword((cia402_state_t)state, (cia402_goal_t)goal);
            TEST_ASSERT_EQUAL_HEX8(k_expected[goal][state], command(word));
            TEST_ASSERT_EQUAL_HEX16(0, word & 0xFF70);
        }
    }
}

static void test_controlword_in_quick_stop_never_enables(void)
{
    for (unsigned goal = 0; goal < CIA402_GOALS; goal++) {
        TEST_ASSERT_TRUE(cia402_controlword(CIA402_QUICK_STOP_ACTIVE, (cia402_goal_t)goal) != 0x000F);
    }
}

static void test_has_torque_and_names(void)
{
    for (unsigned state = 0; state < CIA402_STATES; state++) {
        const bool has = state == CIA402_OPERATION_ENABLED || state == CIA402_QUICK_STOP_ACTIVE ||
                         state == CIA402_FAULT_REACTION || state == CIA402_STRANGE;
        TEST_ASSERT_EQUAL(has, cia402_has_torque((cia402_state_t)state));
        TEST_ASSERT_TRUE(cia402_state_name((cia402_state_t)state)[0] != '\0');
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_state_every_statusword_is_as_the_standard_says);
    RUN_TEST(test_state_words_seen_on_drives_are_decoded);
    RUN_TEST(test_controlword_every_state_and_goal_is_the_next_step);
    RUN_TEST(test_controlword_in_quick_stop_never_enables);
    RUN_TEST(test_has_torque_and_names);
    return UNITY_END();
}
