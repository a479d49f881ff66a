/* SPDX-License-Identifier: MIT
 * test_healthy.c - the healthy pulse of a whole gateway over simulated hardware: a watchdog of its own looks at the line after
 * every cycle, as the relay behind it would.
 */
#include <string.h>

#include "heave/healthy.h"
#include "rig.h"
#include "unity.h"

#define TOGGLE_MS 10u
#define OFF_MS    100u

static rig_t m_rig;
static settings_t m_settings;
static uint16_t m_relay;      /* where the watchdog looks: this relay, or the line of its own */
static bool m_level;          /* seen last */
static unsigned m_quiet_ms;   /* since the last edge */
static unsigned m_longest_ms; /* between edges, since start_watching() */
static unsigned m_edges;

static void watch(void *ctx)
{
    (void)ctx;
    const bool level = m_relay != 0 ? (m_rig.relays.mask & m_relay) != 0 : m_rig.healthy.mask == 1;
    m_edges += level != m_level;
    m_quiet_ms = level != m_level ? 0 : m_quiet_ms + 1;
    m_longest_ms = m_quiet_ms > m_longest_ms ? m_quiet_ms : m_longest_ms;
    m_level = level;
}

void setUp(void)
{
    m_settings = rig_hexapod();
    m_settings.following_error_mm_q16 = 20 * 65536;
    m_relay = 0;
}

void tearDown(void) {}

static void start(bool is_settled)
{
    rig_start(&m_rig, &m_settings, is_settled);
    m_rig.is_auto_checking = true;
    m_rig.after_cycle = watch;
    m_level = false;
    m_edges = m_quiet_ms = m_longest_ms = 0;
}

static void start_watching(void)
{
    m_edges = m_quiet_ms = m_longest_ms = 0;
}

static const snapshot_t *seen(void)
{
    return gateway_snapshot(&m_rig.gateway);
}

/* Low since the cycle that has just run, and for so long. */
static void expect_no_pulse(unsigned ms)
{
    TEST_ASSERT_FALSE(m_level);
    TEST_ASSERT_FALSE(seen()->is_healthy);
    start_watching();
    rig_run_ms(&m_rig, ms);
    TEST_ASSERT_EQUAL_UINT(0, m_edges);
}

static void expect_pulse(unsigned ms)
{
    start_watching();
    rig_run_ms(&m_rig, ms);
    TEST_ASSERT_TRUE(seen()->is_healthy);
    TEST_ASSERT_UINT_WITHIN(1, ms / TOGGLE_MS, m_edges);
    TEST_ASSERT_LESS_OR_EQUAL_UINT(TOGGLE_MS, m_longest_ms);
}

static void engage(void)
{
    start(true);
    TEST_ASSERT_TRUE(rig_run_until(&m_rig, STATE_ENGAGED, 20000));
    rig_send(&m_rig, "@A6:0,0,0,0,0,30,5#");
    rig_run_ms(&m_rig, 500);
    TEST_ASSERT_TRUE(seen()->is_healthy);
}

static void test_pulse_runs_at_its_pace_in_every_state_that_is_well(void)
{
    m_settings.engage = ENGAGE_MANUAL;
    start(false);
    rig_run_ms(&m_rig, OFF_MS + TOGGLE_MS);
    expect_pulse(100);
    start_watching();
    TEST_ASSERT_EQUAL(HV_OK, rig_request(&m_rig, EVENT_ENGAGE));
    TEST_ASSERT_TRUE(rig_run_until(&m_rig, STATE_ENGAGED, 60000));
    TEST_ASSERT_EQUAL(HV_OK, rig_request(&m_rig, EVENT_HOLD));
    rig_run_ms(&m_rig, 1000);
    TEST_ASSERT_EQUAL(STATE_HOLD, seen()->state);
    TEST_ASSERT_EQUAL(HV_OK, rig_request(&m_rig, EVENT_SHUTDOWN));
    TEST_ASSERT_TRUE(rig_run_until(&m_rig, STATE_OFF, 60000));
    rig_run_ms(&m_rig, 100);
    TEST_ASSERT_LESS_OR_EQUAL_UINT(TOGGLE_MS, m_longest_ms); /* all the way: no edge was late */
}

static void test_pulse_waits_after_the_start(void)
{
    start(true);
    rig_run_ms(&m_rig, 1);
    expect_no_pulse(OFF_MS - 2);
    rig_run_ms(&m_rig, TOGGLE_MS);
    expect_pulse(100);
}

/* What can go wrong; each is noticed in the cycle after it was done. */
static void do_estop(void)
{
    sim_inputs_set(&m_rig.inputs, INPUT_ESTOP, true);
}
static void do_blind(void)
{
    m_rig.inputs.is_broken = true;
}
static void do_drive_fault(void)
{
    rig_break(&m_rig, SIM_DRIVES_FAULT, 3, 0x2310);
}
static void do_drive_offline(void)
{
    rig_break(&m_rig, SIM_DRIVES_OFFLINE, 5, 0);
}
static void do_bus_gone(void)
{
    rig_break(&m_rig, SIM_DRIVES_OFFLINE, SIM_DRIVES_ALL, 0);
}
static void do_failing(void)
{
    m_rig.is_failing = true;
}
static void do_late(void)
{
    gateway_note_late(&m_rig.gateway, 4);
}

static void test_pulse_stops_in_the_cycle_of_any_trouble(void)
{
    static void (*const k_troubles[])(void) = {do_estop,    do_blind,   do_drive_fault, do_drive_offline,
                                               do_bus_gone, do_failing, do_late};
    for (unsigned k = 0; k < sizeof k_troubles / sizeof k_troubles[0]; k++) {
        for (unsigned phase = 0; phase < 2 * TOGGLE_MS; phase++) { /* wherever the pulse is */
            engage();
            rig_run_ms(&m_rig, phase);
            k_troubles[k]();
            rig_run_ms(&m_rig, 1);
            expect_no_pulse(OFF_MS - 2);
        }
    }
}

static void test_pulse_stays_away_while_the_trouble_lasts(void)
{
    static void (*const k_troubles[])(void) = {do_estop, do_blind, do_drive_fault, do_drive_offline, do_bus_gone, do_failing};
    for (unsigned k = 0; k < sizeof k_troubles / sizeof k_troubles[0]; k++) {
        engage();
        k_troubles[k]();
        rig_run_ms(&m_rig, 1);
        expect_no_pulse(5000);
    }
}

static void test_pulse_stops_with_a_following_error(void)
{
    engage();
    rig_break(&m_rig, SIM_DRIVES_FREEZE, 1, 0);
    rig_send(&m_rig, "@A6:0,0,0,0,0,-40,5#");
    TEST_ASSERT_TRUE(rig_run_until(&m_rig, STATE_FAULT, 5000));
    expect_no_pulse(1000);
}

static void test_pulse_bears_some_late_cycles_and_returns_after_more(void)
{
    engage();
    for (unsigned i = 0; i < 50; i++) {
        gateway_note_late(&m_rig.gateway, 3);
        expect_pulse(TOGGLE_MS);
    }
    do_late();
    rig_run_ms(&m_rig, 1);
    expect_no_pulse(OFF_MS - 2);
    rig_run_ms(&m_rig, TOGGLE_MS);
    expect_pulse(100);
}

/* In OFF a drive in fault has no torque; one that is not heard may have. */
static void test_pulse_in_off_bears_a_drive_in_fault_but_none_that_is_not_heard(void)
{
    m_settings.engage = ENGAGE_MANUAL;
    start(false);
    rig_run_ms(&m_rig, OFF_MS + TOGGLE_MS);
    do_drive_fault();
    rig_run_ms(&m_rig, 10);
    TEST_ASSERT_EQUAL(STATE_OFF, seen()->state);
    expect_pulse(100);
    do_drive_offline();
    rig_run_ms(&m_rig, 1);
    TEST_ASSERT_EQUAL(STATE_OFF, seen()->state);
    expect_no_pulse(1000);
    rig_break(&m_rig, SIM_DRIVES_RECOVER, 5, 0);
    rig_run_ms(&m_rig, OFF_MS + TOGGLE_MS);
    expect_pulse(100);
}

/* A drive to which a safe-torque-off is a fault needs the pulse to get out of it. */
static void test_pulse_comes_before_a_reset_that_waits_for_drives(void)
{
    engage();
    rig_break(&m_rig, SIM_DRIVES_BROKEN, 3, 0x7300);
    rig_run_ms(&m_rig, 1);
    expect_no_pulse(1000);
    TEST_ASSERT_EQUAL(HV_OK, rig_request(&m_rig, EVENT_RESET));
    rig_run_ms(&m_rig, OFF_MS);
    expect_pulse(500);
    rig_break(&m_rig, SIM_DRIVES_RECOVER, 3, 0);
    rig_run_ms(&m_rig, 2000);
    TEST_ASSERT_EQUAL(STATE_FAULT, seen()->state); /* it was told to reset while it could not */
    expect_no_pulse(1000);
}

static void test_pulse_does_not_come_for_a_reset_while_the_estop_is_pressed(void)
{
    engage();
    do_estop();
    rig_run_ms(&m_rig, 100);
    TEST_ASSERT_EQUAL(HV_ERR_STATE, rig_request(&m_rig, EVENT_RESET));
    rig_run_ms(&m_rig, 1);
    expect_no_pulse(1000);
    sim_inputs_set(&m_rig.inputs, INPUT_ESTOP, false);
    rig_run_ms(&m_rig, 1);
    expect_no_pulse(1000);
    TEST_ASSERT_EQUAL(HV_OK, rig_request(&m_rig, EVENT_RESET));
    rig_run_ms(&m_rig, OFF_MS + TOGGLE_MS);
    TEST_ASSERT_EQUAL(STATE_OFF, seen()->state);
    expect_pulse(500);
}

static void test_pulse_on_a_relay_is_nobodys_to_command(void)
{
    m_relay = 0x4;
    m_settings.healthy.relay = 3;
    m_settings.relays.min_toggle_ms[2] = 5000;
    m_settings.relays.max_on_ms[2] = 1;
    engage(); /* its frame closes relay 1 and 3 */
    expect_pulse(500);
    TEST_ASSERT_EQUAL_HEX16(0x1, seen()->relay_mask);
    TEST_ASSERT_EQUAL_HEX16(0x1, m_rig.relays.mask & ~m_relay);
    TEST_ASSERT_EQUAL_UINT32(0, seen()->counters.relay_delayed + seen()->counters.relay_cut);
    do_drive_fault();
    rig_run_ms(&m_rig, 1);
    expect_no_pulse(500);
    TEST_ASSERT_EQUAL_HEX16(0, m_rig.relays.mask);
}

static void test_pulse_whose_line_cannot_be_written_is_told_once(void)
{
    engage();
    m_rig.healthy.fail.first = m_rig.healthy.fail.calls + 1;
    m_rig.healthy.fail.count = 300;
    rig_run_ms(&m_rig, 299);
    TEST_ASSERT_TRUE(rig_was_logged(&m_rig, "healthy pulse: its line cannot be written"));
    TEST_ASSERT_FALSE(rig_was_logged(&m_rig, "healthy pulse"));
    TEST_ASSERT_EQUAL(STATE_ENGAGED, seen()->state);
    rig_run_ms(&m_rig, 10);
    TEST_ASSERT_TRUE(rig_was_logged(&m_rig, "healthy pulse: its line is written again"));
    expect_pulse(100);
}

static void test_pulse_without_a_line_changes_nothing(void)
{
    start(true);
    m_rig.gateway.io.healthy = (hal_relays_t){NULL, NULL};
    rig_run_ms(&m_rig, 500);
    TEST_ASSERT_TRUE(seen()->is_healthy);
    TEST_ASSERT_EQUAL_UINT(0, m_edges);
}

static void test_step_rounds_up_to_whole_cycles_and_rests_low(void)
{
    static const healthy_settings_t k_settings = {.toggle_ms = 10, .off_ms = 0};
    healthy_t pulse = {.level = false};
    unsigned edges = 0;
    bool was = false;
    for (uint64_t now_us = 3000; now_us <= 3000 * 400; now_us += 3000) { /* an edge every 12 ms */
        const bool level = healthy_step(&pulse, &k_settings, true, now_us);
        edges += level != was;
        was = level;
    }
    TEST_ASSERT_EQUAL_UINT(100, edges);
    TEST_ASSERT_FALSE(healthy_step(&pulse, &k_settings, false, 1300000));
    TEST_ASSERT_FALSE(healthy_is_running(&pulse, &k_settings, 1300000));
    TEST_ASSERT_TRUE(healthy_step(&pulse, &k_settings, true, 1303000));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_pulse_runs_at_its_pace_in_every_state_that_is_well);
    RUN_TEST(test_pulse_waits_after_the_start);
    RUN_TEST(test_pulse_stops_in_the_cycle_of_any_trouble);
    RUN_TEST(test_pulse_stays_away_while_the_trouble_lasts);
    RUN_TEST(test_pulse_stops_with_a_following_error);
    RUN_TEST(test_pulse_bears_some_late_cycles_and_returns_after_more);
    RUN_TEST(test_pulse_in_off_bears_a_drive_in_fault_but_none_that_is_not_heard);
    RUN_TEST(test_pulse_comes_before_a_reset_that_waits_for_drives);
    RUN_TEST(test_pulse_does_not_come_for_a_reset_while_the_estop_is_pressed);
    RUN_TEST(test_pulse_on_a_relay_is_nobodys_to_command);
    RUN_TEST(test_pulse_whose_line_cannot_be_written_is_told_once);
    RUN_TEST(test_pulse_without_a_line_changes_nothing);
    RUN_TEST(test_step_rounds_up_to_whole_cycles_and_rests_low);
    return UNITY_END();
}
