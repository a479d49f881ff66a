/* SPDX-License-Identifier: MIT
 * test_sender_masks.c - relay masks, decimal commas and lost values of senders, through a whole gateway.
 */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "rig.h"
#include "unity.h"

#define SAFE_MASK 0x801

static rig_t m_rig;
static settings_t m_settings;
static unsigned m_changes; /* of the relays */
static uint16_t m_mask;

void setUp(void)
{
    m_settings = rig_hexapod();
    m_settings.relay_safe_mask = SAFE_MASK;
    m_settings.takeover_ms = 2500;
    m_settings.silence_hold_ms = 1000;
}

void tearDown(void)
{
    TEST_ASSERT_TRUE(rig_is_within_limits(&m_rig));
    TEST_ASSERT_EQUAL_UINT32(0, gateway_snapshot(&m_rig.gateway)->counters.faults);
}

static const snapshot_t *seen(void)
{
    return gateway_snapshot(&m_rig.gateway);
}

static uint32_t refused(void)
{
    return seen()->counters.rejected[FRAME_ERR_MASK_FORM];
}

static void look_at_relays(void *ctx)
{
    (void)ctx;
    m_changes += m_rig.relays.mask != m_mask;
    m_mask = m_rig.relays.mask;
}

static void engage(void)
{
    rig_start(&m_rig, &m_settings, true);
    m_rig.is_auto_checking = true;
    m_rig.after_cycle = look_at_relays;
    TEST_ASSERT_TRUE(rig_run_until(&m_rig, STATE_ENGAGED, 20000));
    m_changes = 0;
}

/* Frames 16 ms apart. */
static void send_all(uint8_t host, const char *text, unsigned frames)
{
    for (unsigned i = 0; i < frames; i++) {
        rig_send_from(&m_rig, host, text);
        rig_run_ms(&m_rig, 16);
    }
}

/* A value as a program writes it whose language has decimal commas; whole ones without decimals. */
static void put_comma(char text[16], double value, int decimals, bool is_short)
{
    snprintf(text, 16, "%.*f", is_short && fabs(value - round(value)) < 1e-9 ? 0 : decimals, value);
    char *point = strchr(text, '.');
    if (point != NULL) {
        *point = ',';
    }
}

/* --- A sender with a decimal comma from its first frame on --- */

static void test_relays_do_not_chatter_with_a_decimal_comma(void)
{
    for (int decimals = 1; decimals <= 3; decimals++) {
        for (unsigned tenth_hz = 1; tenth_hz <= 20; tenth_hz += tenth_hz < 5 ? 2 : 5) {
            engage();
            for (unsigned i = 0; i < 600; i++) {
                char z[16];
                put_comma(z, 1 + 20 * sin(2 * 3.14159265358979 * tenth_hz / 10 * i * 0.016), decimals, false);
                rig_sendf(&m_rig, "@A3:0,0,%s#", z);
                rig_run_ms(&m_rig, 16);
            }
            printf("# %d decimals, %.1f Hz: the relays changed %u times\n", decimals, tenth_hz / 10.0, m_changes);
            TEST_ASSERT_LESS_OR_EQUAL_UINT(20, m_changes); /* within the first half second */
            TEST_ASSERT_EQUAL_HEX16(SAFE_MASK, m_rig.relays.mask);
            TEST_ASSERT_EQUAL(MASK_DIGITS, seen()->mask_habit);
            TEST_ASSERT_TRUE(rig_was_logged(&m_rig, "relay masks change like the digits of a value"));
        }
    }
}

/* --- Learnt --- */

static void test_a_decimal_comma_of_a_sender_without_masks_is_refused(void)
{
    engage();
    send_all(1, "@A3:0,0,13#", 60);
    TEST_ASSERT_EQUAL(MASK_NONE, seen()->mask_habit);
    send_all(1, "@A3:0,0,40,37#", 60);
    TEST_ASSERT_EQUAL_UINT32(60, refused());
    TEST_ASSERT_TRUE(rig_was_logged(&m_rig, "A3: it has a relay mask, and frames here have none: a decimal comma"));
    TEST_ASSERT_DOUBLE_WITHIN(0.01, 13, rig_pose(&m_rig, AXIS_Z));
    TEST_ASSERT_EQUAL_UINT(0, m_changes);
    rig_run_ms(&m_rig, 500);
    TEST_ASSERT_EQUAL(STATE_HOLD, seen()->state); /* refused frames do not end a silence */
    send_all(1, "@A3:0,0,13#", 1);
    TEST_ASSERT_EQUAL(STATE_ENGAGED, seen()->state);
}

static void test_a_value_lost_from_a_frame_with_a_mask_is_refused(void)
{
    engage();
    send_all(1, "@A6:0,0,0,0,0,5,20#", 60);
    TEST_ASSERT_EQUAL(MASK_SENT, seen()->mask_habit);
    send_all(1, "@A6:0,0,0,0,5,20#", 30);
    TEST_ASSERT_EQUAL_UINT32(30, refused());
    TEST_ASSERT_TRUE(rig_was_logged(&m_rig, "A6: it has no relay mask, and frames here have one: a value too few?"));
    TEST_ASSERT_DOUBLE_WITHIN(0.01, 5, rig_pose(&m_rig, AXIS_Z));
    TEST_ASSERT_EQUAL_HEX16(0x20, m_rig.relays.mask);
    send_all(1, "@A6T:0,0,0,0,5,20,100#", 1); /* T frames have none */
    rig_run_ms(&m_rig, 1000);
    TEST_ASSERT_DOUBLE_WITHIN(0.01, 20, rig_pose(&m_rig, AXIS_Z));
    TEST_ASSERT_EQUAL_UINT32(30, refused());
}

static void test_lone_frames_and_the_first_ones_are_taken_as_they_are(void)
{
    m_settings.silence_hold_ms = 0;
    engage();
    send_all(1, "@A6:0,0,0,0,0,5,F0#", 9);
    send_all(1, "@A6:0,0,0,0,0,6#", 9);
    for (unsigned i = 0; i < 12; i++) {
        send_all(1, i % 3 == 0 ? "@A6:5,6,0,5.5,3.0,20,F0#" : "@A6:5,6,0,5.5,3.0,20#", 1);
        rig_run_ms(&m_rig, 1200);
    }
    TEST_ASSERT_EQUAL_UINT32(0, refused());
    TEST_ASSERT_EQUAL_HEX16(0xF0, m_rig.relays.mask);
}

/* What another sender's frames are like is not learnt, and each new one is learnt anew. Frames that are refused keep nobody out.
 */
static void test_each_sender_has_its_own_form(void)
{
    engage();
    for (unsigned i = 0; i < 60; i++) {
        send_all(1, "@A6:0,0,0,0,0,5,F0#", 1);
        rig_send_from(&m_rig, 2, "@A6:0,0,0,0,0,5#");
    }
    TEST_ASSERT_EQUAL_UINT32(0, refused());
    TEST_ASSERT_EQUAL(MASK_SENT, seen()->mask_habit);
    for (unsigned i = 0; i < 150; i++) {
        send_all(1, "@A6:0,0,0,0,0,5#", 1);
        rig_send_from(&m_rig, 2, "@A6:0,0,0,0,0,5#");
    }
    TEST_ASSERT_EQUAL_UINT32(150, refused());
    TEST_ASSERT_EQUAL_UINT32(0, seen()->counters.owner_changes);
    for (unsigned i = 0; i < 30; i++) { /* 2.5 s after the last frame of the first one that counts */
        rig_send_from(&m_rig, 2, "@A6:0,0,0,0,0,5#");
        rig_run_ms(&m_rig, 16);
    }
    TEST_ASSERT_EQUAL_UINT32(150, refused());
    TEST_ASSERT_EQUAL_UINT32(1, seen()->counters.owner_changes);
    TEST_ASSERT_EQUAL(MASK_NONE, seen()->mask_habit);
}

static void send_from_port(uint16_t port, const char *text, unsigned frames)
{
    const hal_udp_peer_t from = {.address = {10, 0, 0, 1}, .port = port};
    for (unsigned i = 0; i < frames; i++) {
        TEST_ASSERT_EQUAL(HV_OK, sim_udp_push(&m_rig.udp, (const uint8_t *)text, strlen(text), &from));
        rig_run_ms(&m_rig, 16);
    }
}

/* Without a pause; a stray frame of the old one is of no matter. */
static void test_a_program_that_starts_again_may_have_another_form(void)
{
    engage();
    send_from_port(5000, "@A6:0,0,0,0,0,5#", 20);
    send_from_port(5001, "@A6:0,0,0,0,0,6,F0#", 20);
    TEST_ASSERT_EQUAL_UINT32(0, refused());
    TEST_ASSERT_EQUAL(MASK_SENT, seen()->mask_habit);
    TEST_ASSERT_EQUAL_HEX16(0xF0, m_rig.relays.mask);
    send_from_port(5001, "@A6:0,0,0,0,0,6#", 1);
    TEST_ASSERT_EQUAL_UINT32(1, refused());
}

/* A second program of the same PC that has another form is another sender, and teaches nothing. */
static void test_another_program_of_the_pc_teaches_nothing(void)
{
    engage();
    for (unsigned i = 0; i < 100; i++) {
        send_from_port(5000, "@A6:0,0,0,0,0,5,F0#", 1);
        send_from_port(5001, "@A6:0,0,0,0,0,5#", 1);
    }
    TEST_ASSERT_EQUAL_UINT32(0, refused());
    TEST_ASSERT_EQUAL_UINT32(98, seen()->counters.other_sender);
    TEST_ASSERT_EQUAL(MASK_SENT, seen()->mask_habit);
    TEST_ASSERT_EQUAL_HEX16(0xF0, m_rig.relays.mask);
    send_from_port(5000, "@A6:0,0,0,0,0,5#", 1);
    TEST_ASSERT_EQUAL_UINT32(1, refused());
}

/* An effect that one frame began ends with a sender that sends no masks any more, also by a policy. */
static void test_relays_do_not_stay_on_without_masks(void)
{
    engage();
    send_all(1, "@A6:0,0,0,0,0,5,F0#", 1);
    send_all(1, "@A6:0,0,0,0,0,5#", 9);
    TEST_ASSERT_EQUAL_HEX16(0xF0, m_rig.relays.mask);
    send_all(1, "@A6:0,0,0,0,0,5#", 1);
    TEST_ASSERT_EQUAL_HEX16(SAFE_MASK, m_rig.relays.mask);
    TEST_ASSERT_TRUE(rig_was_logged(&m_rig, "no relay masks any more: relays go to safe_mask"));
    engage();
    send_all(1, "@A6:0,0,0,0,0,5,F0#", 20);
    m_settings.mask_policy = MASK_NEVER;
    gateway_reload(&m_rig.gateway, &m_settings);
    send_all(1, "@A6:0,0,0,0,0,5#", 1);
    TEST_ASSERT_EQUAL_HEX16(SAFE_MASK, m_rig.relays.mask);
}

/* Where all senders are followed, two of different forms are, too. */
static void test_senders_by_turns_are_followed_where_all_are(void)
{
    m_settings.takeover_ms = 0;
    engage();
    for (unsigned i = 0; i < 60; i++) {
        send_all(1, "@A6:0,0,0,0,0,5,F0#", 1);
        send_all(2, "@A6:0,0,0,0,0,5#", 1);
    }
    for (unsigned i = 0; i < 10; i++) { /* effects by a program beside the game, on the same PC */
        send_from_port(5001, i % 2 ? "@A6:0,0,0,0,0,5,11#" : "@A6:0,0,0,0,0,5,33#", 1);
        send_from_port(5000, "@A6:0,0,0,0,0,5#", 60);
        TEST_ASSERT_EQUAL_HEX16(i % 2 ? 0x11 : 0x33, m_rig.relays.mask);
    }
    TEST_ASSERT_EQUAL_UINT32(0, refused());
}

/* --- Set --- */

static void test_a_form_that_is_set_is_refused_from_the_first_frame_on(void)
{
    static const char *const k_forms[] = {"@A6:0,0,0,0,0,7#", "@A6:0,0,0,0,0,7,F0#"};
    for (unsigned has_mask = 0; has_mask <= 1; has_mask++) {
        m_settings.mask_policy = has_mask ? MASK_NEVER : MASK_ALWAYS;
        engage();
        send_all(2, k_forms[has_mask], 5);
        TEST_ASSERT_EQUAL_UINT32(5, refused());
        TEST_ASSERT_FALSE(seen()->owner.is_taken); /* it drives nothing, and keeps nobody out */
        TEST_ASSERT_EQUAL_HEX16(SAFE_MASK, m_rig.relays.mask);
        send_all(1, k_forms[!has_mask], 50);
        rig_run_ms(&m_rig, 500);
        TEST_ASSERT_DOUBLE_WITHIN(0.01, 7, rig_pose(&m_rig, AXIS_Z));
        TEST_ASSERT_EQUAL_HEX16(has_mask ? SAFE_MASK : 0xF0, m_rig.relays.mask);
    }
}

static void test_any_form_by_turns_is_followed_where_it_is_set(void)
{
    m_settings.mask_policy = MASK_ANY;
    engage();
    for (unsigned i = 0; i < 50; i++) {
        send_all(1, "@A6:0,0,0,0,0,7#", 20);
        send_all(1, i % 2 ? "@A6:0,0,0,0,0,7,11#" : "@A6:0,0,0,0,0,7,33#", 1);
        TEST_ASSERT_EQUAL_HEX16(i % 2 ? 0x11 : 0x33, m_rig.relays.mask);
    }
    TEST_ASSERT_EQUAL_UINT32(0, refused());
    TEST_ASSERT_EQUAL(MASK_UNKNOWN, seen()->mask_habit);
}

static void test_the_policy_changes_in_operation(void)
{
    engage();
    send_all(1, "@A6:0,0,0,0,0,7#", 20);
    send_all(1, "@A6:0,0,0,0,0,7,F0#", 1);
    TEST_ASSERT_EQUAL_UINT32(1, refused());
    m_settings.mask_policy = MASK_ANY;
    gateway_reload(&m_rig.gateway, &m_settings);
    send_all(1, "@A6:0,0,0,0,0,7,F0#", 1);
    TEST_ASSERT_EQUAL_UINT32(1, refused());
    TEST_ASSERT_EQUAL_HEX16(0xF0, m_rig.relays.mask);
    send_all(1, "@A6:0,0,0,0,0,7,F0#", 20);
    m_settings.mask_policy = MASK_LEARNT; /* what was learnt before is not true any more */
    gateway_reload(&m_rig.gateway, &m_settings);
    send_all(1, "@A6:0,0,0,0,0,7,F0#", 20);
    TEST_ASSERT_EQUAL_UINT32(1, refused());
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_relays_do_not_chatter_with_a_decimal_comma);
    RUN_TEST(test_a_decimal_comma_of_a_sender_without_masks_is_refused);
    RUN_TEST(test_a_value_lost_from_a_frame_with_a_mask_is_refused);
    RUN_TEST(test_lone_frames_and_the_first_ones_are_taken_as_they_are);
    RUN_TEST(test_each_sender_has_its_own_form);
    RUN_TEST(test_a_program_that_starts_again_may_have_another_form);
    RUN_TEST(test_another_program_of_the_pc_teaches_nothing);
    RUN_TEST(test_relays_do_not_stay_on_without_masks);
    RUN_TEST(test_senders_by_turns_are_followed_where_all_are);
    RUN_TEST(test_a_form_that_is_set_is_refused_from_the_first_frame_on);
    RUN_TEST(test_any_form_by_turns_is_followed_where_it_is_set);
    RUN_TEST(test_the_policy_changes_in_operation);
    return UNITY_END();
}
