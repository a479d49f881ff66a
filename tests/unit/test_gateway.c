/* SPDX-License-Identifier: MIT
 * test_gateway.c - a whole gateway over simulated hardware: frames, relays, silence, states, faults, e-stop.
 * Limits, steps and following errors are judged by the rig in every cycle of every test.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "rig.h"
#include "unity.h"

static rig_t m_rig;
static settings_t m_settings;
static bool m_is_fault_expected;

void setUp(void)
{
    m_settings = rig_hexapod();
    m_settings.relay_safe_mask = 0x801;
    m_is_fault_expected = false;
}

static void start(bool is_settled)
{
    rig_start(&m_rig, &m_settings, is_settled);
    m_rig.is_auto_checking = true;
}

static void engage(void)
{
    start(true);
    TEST_ASSERT_TRUE(rig_run_until(&m_rig, STATE_ENGAGED, 20000));
    rig_send(&m_rig, m_settings.geometry.kind == KIN_HEXAPOD ? "@A6:0,0,0,0,0,0#" : "@A3:0,0,0#");
    rig_run_ms(&m_rig, 1000);
}

void tearDown(void)
{
    TEST_ASSERT_TRUE(rig_is_within_limits(&m_rig));
    TEST_ASSERT_EQUAL_UINT(0, rig_following_errors(&m_rig));
    if (!m_is_fault_expected) {
        TEST_ASSERT_EQUAL_UINT32(0, gateway_snapshot(&m_rig.gateway)->counters.faults);
    }
}

static const snapshot_t *seen(void)
{
    return gateway_snapshot(&m_rig.gateway);
}

static const counters_t *counted(void)
{
    return &seen()->counters;
}

static uint32_t rejected(void)
{
    uint32_t sum = 0;
    for (unsigned i = 0; i < FRAME_ERRORS; i++) {
        sum += counted()->rejected[i];
    }
    return sum;
}

static void send_and_run(const char *text, unsigned ms)
{
    rig_send(&m_rig, text);
    rig_run_ms(&m_rig, ms);
}

static void assert_heights(double z)
{
    TEST_ASSERT_DOUBLE_WITHIN(1e-3, z, rig_pose(&m_rig, AXIS_Z));
}

static double biggest_move(unsigned ms)
{
    double from[6], most = 0;
    for (unsigned i = 0; i < 6; i++) {
        from[i] = rig_cylinder_mm(&m_rig, i + 1);
    }
    for (unsigned k = 0; k < ms; k++) {
        rig_run_ms(&m_rig, 1);
        for (unsigned i = 0; i < 6; i++) {
            most = fmax(most, fabs(rig_cylinder_mm(&m_rig, i + 1) - from[i]));
        }
    }
    return most;
}

/* ---- what drives may tell that the simulated ones do not ---- */

static int m_unheard;            /* the axis that has not said where it is; -1: none */
static drive_report_t m_reports; /* of axis 2 */
static drive_guard_t m_guard;    /* of a drive that its set-points were too far for */
static unsigned m_guarded;       /* which one */

static hv_status_t poll_unheard(void *ctx, uint64_t now_us, drive_feedback_t *feedback)
{
    const hv_status_t status = drives_poll(((rig_t *)ctx)->inner, now_us, feedback);
    if (m_unheard >= 0) {
        feedback[m_unheard].has_actual = false;
    }
    if (drive_guard_is_found(&m_guard)) {
        feedback[m_guarded].state = DRIVE_FAULT;
        feedback[m_guarded].fault_code = 0x8611;
        feedback[m_guarded].guard = m_guard;
    }
    return status;
}

static void report_of_axis_2(void *ctx, uint8_t axis, drive_report_t *out)
{
    (void)ctx;
    if (axis == 1) {
        *out = m_reports;
    }
}

/* The rig's drives, with more to tell. */
static void make_talkative(void)
{
    static drives_ops_t talkative;
    talkative = *m_rig.gateway.io.drives.ops;
    talkative.poll = poll_unheard;
    talkative.report = report_of_axis_2;
    m_rig.gateway.io.drives.ops = &talkative;
    m_unheard = -1;
    m_guard = (drive_guard_t){.jump_q32 = 0};
    m_reports = (drive_report_t){.phase = "", .trouble = "", .detail = ""};
}

/* ---- start ---- */

static void test_gateway_init_wrong_hardware_is_refused(void)
{
    start(true);
    static gateway_t other;
    gateway_io_t io = m_rig.gateway.io;
    const settings_t tripod = rig_tripod();
    TEST_ASSERT_EQUAL(HV_ERR_ARG, gateway_init(&other, &tripod, &io)); /* seven drives for three cylinders */
    for (unsigned missing = 0; missing < 5; missing++) {
        io = m_rig.gateway.io;
        io.udp.ops = missing == 0 ? NULL : io.udp.ops;
        io.drives.ops = missing == 1 ? NULL : io.drives.ops;
        io.relays.ops = missing == 2 ? NULL : io.relays.ops;
        io.inputs.ops = missing == 3 ? NULL : io.inputs.ops;
        io.log.ops = missing == 4 ? NULL : io.log.ops;
        TEST_ASSERT_EQUAL(HV_ERR_ARG, gateway_init(&other, &m_settings, &io));
    }
    io = m_rig.gateway.io;
    settings_t bad = m_settings;
    bad.axis[AXIS_Z].jerk = 0;
    TEST_ASSERT_EQUAL(HV_ERR_RANGE, gateway_init(&other, &bad, &io));
    bad = m_settings;
    bad.neutral_q16[AXIS_Z] = 110 * 65536; /* out of reach */
    TEST_ASSERT_EQUAL(HV_ERR_RANGE, gateway_init(&other, &bad, &io));
}

static void test_start_unhomed_drives_are_homed_and_brought_up(void)
{
    start(false);
    TEST_ASSERT_TRUE(rig_run_until(&m_rig, STATE_HOMING, 100));
    TEST_ASSERT_TRUE(rig_run_until(&m_rig, STATE_SETTLED, 30000));
    for (unsigned i = 1; i <= 6; i++) {
        TEST_ASSERT_EQUAL_DOUBLE(6, rig_cylinder_mm(&m_rig, i));
    }
    TEST_ASSERT_TRUE(rig_run_until(&m_rig, STATE_RISING, 100));
    rig_check_reset(&m_rig);
    TEST_ASSERT_TRUE(rig_run_until(&m_rig, STATE_ENGAGED, 30000));
    TEST_ASSERT_TRUE(m_rig.check.speed * 400 <= 50.01);
    assert_heights(0);
}

static void test_start_drives_elsewhere_go_to_settled_first(void)
{
    m_settings.settled_extension_mm_q16 = 50 * 65536;
    start(false);
    for (unsigned i = 0; i < 7; i++) {
        m_rig.drives.axis[i].is_homed = true;
    }
    TEST_ASSERT_TRUE(rig_run_until(&m_rig, STATE_HOMING, 100));
    TEST_ASSERT_TRUE(rig_run_until(&m_rig, STATE_SETTLED, 30000));
    TEST_ASSERT_EQUAL_DOUBLE(50, rig_cylinder_mm(&m_rig, 1));
}

/* Drives that heaved finds under torque, as after an end by force. */
static void start_enabled(double extension_mm)
{
    m_settings.engage = ENGAGE_MANUAL;
    start(false);
    for (unsigned i = 0; i < 7; i++) {
        sim_drive_t *drive = &m_rig.drives.axis[i];
        drive->state = DRIVE_ENABLED;
        drive->is_homed = true;
        drive->position_q32 = i == 6 ? 0 : (q32_t)(extension_mm * 4294967296.0);
        drive->setpoint_q32 = drive->position_q32;
    }
    rig_run_ms(&m_rig, 500);
}

static void test_start_drives_under_torque_are_taken_over_without_a_move(void)
{
    start_enabled(6.5);
    TEST_ASSERT_EQUAL(STATE_SETTLED, seen()->state);
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, 6.5, rig_cylinder_mm(&m_rig, 1));
    start_enabled(90);
    TEST_ASSERT_EQUAL(STATE_OFF, seen()->state); /* not settled: nobody knows who is on it */
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, 90, rig_cylinder_mm(&m_rig, 1));
    TEST_ASSERT_EQUAL(DRIVE_ENABLED, m_rig.drives.axis[0].state);
    TEST_ASSERT_EQUAL(HV_OK, rig_request(&m_rig, EVENT_PARK));
    TEST_ASSERT_TRUE(rig_run_until(&m_rig, STATE_SETTLED, 30000));
    TEST_ASSERT_EQUAL_DOUBLE(6, rig_cylinder_mm(&m_rig, 1));
}

/* Enabled, but where it stands is not known yet: nothing is homed and nothing moves on a guess. */
static void test_start_waits_for_the_position_of_every_drive(void)
{
    m_is_fault_expected = true;
    for (unsigned is_ever_heard = 0; is_ever_heard < 2; is_ever_heard++) {
        start(false);
        make_talkative();
        m_unheard = 2;
        TEST_ASSERT_FALSE(rig_run_until(&m_rig, STATE_FAULT, 9000));
        TEST_ASSERT_EQUAL(STATE_HOMING, seen()->state);
        TEST_ASSERT_NOT_EQUAL(DRIVE_HOMING, m_rig.drives.axis[0].state);
        if (is_ever_heard) {
            m_unheard = -1;
            TEST_ASSERT_TRUE(rig_run_until(&m_rig, STATE_ENGAGED, 60000));
        } else {
            TEST_ASSERT_TRUE(rig_run_until(&m_rig, STATE_FAULT, 1100));
            TEST_ASSERT_EQUAL(FAULT_DRIVE_TIMEOUT, seen()->fault.code);
        }
    }
}

static void test_start_manual_policy_waits_for_the_operator(void)
{
    m_settings.engage = ENGAGE_MANUAL;
    start(false);
    for (unsigned i = 0; i < 100; i++) {
        send_and_run("@A6:5,5,5,20,20,20,FFF#", 20);
    }
    TEST_ASSERT_EQUAL(STATE_OFF, seen()->state);
    TEST_ASSERT_EQUAL(DRIVE_DISABLED, m_rig.drives.axis[0].state);
    TEST_ASSERT_EQUAL_HEX16(0x801, m_rig.relays.mask);
    TEST_ASSERT_EQUAL(HV_OK, rig_request(&m_rig, EVENT_ENGAGE));
    TEST_ASSERT_TRUE(rig_run_until(&m_rig, STATE_ENGAGED, 60000));
}

/* Waits for as many valid frames within a second, to the frame; bad ones and slow senders do not count. */
static void test_start_auto_waits_for_a_stream(void)
{
    m_settings.auto_frames = 20;
    start(false);
    for (unsigned i = 0; i < 40; i++) {
        send_and_run("@A6:0,0,0,0,0,0#", 60); /* 17 in a second */
    }
    TEST_ASSERT_EQUAL(STATE_OFF, seen()->state);
    for (unsigned i = 0; i < 100; i++) {
        send_and_run("@A6:0,0,0,0,0#", 10);
    }
    TEST_ASSERT_EQUAL(STATE_OFF, seen()->state);
    rig_run_ms(&m_rig, 1000);
    for (unsigned i = 0; i < 19; i++) {
        send_and_run("@A6:0,0,0,0,0,0#", 20);
    }
    TEST_ASSERT_EQUAL(STATE_OFF, seen()->state);
    send_and_run("@A6:0,0,0,0,0,0#", 2);
    TEST_ASSERT_EQUAL(STATE_HOMING, seen()->state);
    TEST_ASSERT_TRUE(rig_run_until(&m_rig, STATE_ENGAGED, 60000));
}

/* The newest twenty within a second, whatever came before: fifteen gaps of 60 ms and four of 20. */
static void test_start_auto_counts_the_newest_frames(void)
{
    m_settings.auto_frames = 20;
    start(false);
    for (unsigned i = 0; i < 40; i++) {
        send_and_run("@A6:0,0,0,0,0,0#", 60);
    }
    for (unsigned i = 0; i < 4; i++) {
        send_and_run("@A6:0,0,0,0,0,0#", 20);
        TEST_ASSERT_EQUAL(STATE_OFF, seen()->state);
    }
    send_and_run("@A6:0,0,0,0,0,0#", 2);
    TEST_ASSERT_EQUAL(STATE_HOMING, seen()->state);
}

/* Once per start, and never after a fault, an e-stop or an operator's word. */
static void test_start_auto_is_over_after_fault_estop_and_requests(void)
{
    for (unsigned what = 0; what < 3; what++) {
        m_settings.auto_frames = 5;
        start(false);
        rig_run_ms(&m_rig, 10);
        if (what == 0) {
            TEST_ASSERT_EQUAL(HV_OK, rig_request(&m_rig, EVENT_PARK));
            TEST_ASSERT_TRUE(rig_run_until(&m_rig, STATE_SETTLED, 60000));
        } else if (what == 1) {
            sim_inputs_set(&m_rig.inputs, INPUT_ESTOP, true);
            rig_run_ms(&m_rig, 10);
            sim_inputs_set(&m_rig.inputs, INPUT_ESTOP, false);
            rig_run_ms(&m_rig, 1);
            TEST_ASSERT_EQUAL(HV_OK, rig_request(&m_rig, EVENT_RESET));
            rig_run_ms(&m_rig, 10);
        } else {
            m_is_fault_expected = true;
            TEST_ASSERT_EQUAL(HV_OK, rig_request(&m_rig, EVENT_ENGAGE));
            rig_run_ms(&m_rig, 200);
            rig_break(&m_rig, SIM_DRIVES_FAULT, 1, 7);
            rig_run_ms(&m_rig, 2000);
            rig_break(&m_rig, SIM_DRIVES_RECOVER, SIM_DRIVES_ALL, 0);
            TEST_ASSERT_EQUAL(HV_OK, rig_request(&m_rig, EVENT_RESET));
            rig_run_ms(&m_rig, 100);
        }
        const state_t state = seen()->state;
        TEST_ASSERT_EQUAL(what == 0 ? STATE_SETTLED : STATE_OFF, state);
        for (unsigned i = 0; i < 200; i++) {
            send_and_run("@A6:0,0,0,0,0,0#", 10);
        }
        TEST_ASSERT_EQUAL(state, seen()->state);
    }
}

/* Who ends the other master does not expect this one to go on. */
static void test_start_auto_is_over_where_another_master_leads(void)
{
    for (uint32_t code = DRIVE_CODE_MASTER_FIRST - 1; code <= DRIVE_CODE_MASTER_LAST + 1; code++) {
        const bool is_led = code >= DRIVE_CODE_MASTER_FIRST && code <= DRIVE_CODE_MASTER_LAST;
        start(false);
        rig_break(&m_rig, SIM_DRIVES_OFFLINE, SIM_DRIVES_ALL, 0);
        rig_run_ms(&m_rig, 500);
        m_rig.drives.axis[3].feedback.fault_code = code;
        rig_run_ms(&m_rig, 1);
        m_rig.drives.axis[3].feedback.fault_code = 0;
        rig_run_ms(&m_rig, 2000);
        rig_break(&m_rig, SIM_DRIVES_RECOVER, SIM_DRIVES_ALL, 0);
        TEST_ASSERT_EQUAL(!is_led, rig_run_until(&m_rig, STATE_ENGAGED, 60000));
        TEST_ASSERT_EQUAL(is_led, rig_was_logged(&m_rig, "engage = auto is void: another master is on the bus"));
        if (is_led) {
            TEST_ASSERT_EQUAL(STATE_OFF, seen()->state);
            TEST_ASSERT_EQUAL(HV_OK, rig_request(&m_rig, EVENT_ENGAGE));
            TEST_ASSERT_TRUE(rig_run_until(&m_rig, STATE_ENGAGED, 60000));
        }
    }
}

/* Found at rest, it is no fault of the platform: but who resets the drives does not ask for it to rise. */
static void test_start_auto_is_over_where_another_master_is_found_at_rest(void)
{
    m_settings.auto_frames = 5;
    start(false);
    rig_run_ms(&m_rig, 500);
    rig_break(&m_rig, SIM_DRIVES_FAULT, SIM_DRIVES_ALL, DRIVE_CODE_MASTER_FIRST);
    rig_run_ms(&m_rig, 100);
    rig_break(&m_rig, SIM_DRIVES_RECOVER, SIM_DRIVES_ALL, 0);
    (void)rig_request(&m_rig, EVENT_RESET);
    rig_run_ms(&m_rig, 100);
    for (unsigned i = 0; i < 200; i++) {
        send_and_run("@A6:0,0,0,0,0,0#", 10);
    }
    TEST_ASSERT_EQUAL(STATE_OFF, seen()->state);
    TEST_ASSERT_TRUE(rig_was_logged(&m_rig, "engage = auto is void: another master is on the bus"));
}

static void test_settled_manual_frames_move_nothing(void)
{
    static const char *const k_frames[] = {"@A6:5,5,5,20,20,20,FFF#", "@A6T:5,5,5,20,20,20,500#", "@C6:50,60,70,80,90,100,7#",
                                           "@C7T:50,60,70,80,90,100,90,20#", "@A7:1,2,3,4,5,6,77,1#"};
    m_settings.engage = ENGAGE_MANUAL;
    start(true);
    rig_run_ms(&m_rig, 10);
    for (unsigned i = 0; i < 5; i++) {
        rig_send(&m_rig, k_frames[i]);
        TEST_ASSERT_EQUAL_DOUBLE(0, biggest_move(600));
        TEST_ASSERT_EQUAL_DOUBLE(0, rig_angle_deg(&m_rig));
    }
    TEST_ASSERT_EQUAL(STATE_SETTLED, seen()->state);
    TEST_ASSERT_EQUAL_UINT32(5, counted()->not_followed);
    TEST_ASSERT_EQUAL_HEX16(0x801, m_rig.relays.mask);
    TEST_ASSERT_EQUAL(HV_ERR_STATE, rig_request(&m_rig, EVENT_RESUME));
    TEST_ASSERT_EQUAL(HV_ERR_STATE, rig_request(&m_rig, EVENT_RESET));
}

/* A drive that is in fault when the gateway comes to it can be reset before anything is engaged. */
static void test_off_reset_takes_back_the_faults_of_drives(void)
{
    m_settings.engage = ENGAGE_MANUAL;
    m_is_fault_expected = true;
    start(false);
    rig_run_ms(&m_rig, 10);
    TEST_ASSERT_EQUAL(HV_ERR_STATE, rig_request(&m_rig, EVENT_RESET));
    rig_break(&m_rig, SIM_DRIVES_FAULT, 1, 0x8130);
    rig_run_ms(&m_rig, 100);
    TEST_ASSERT_EQUAL(STATE_OFF, seen()->state);
    TEST_ASSERT_EQUAL(DRIVE_FAULT, seen()->drive[1].state);
    TEST_ASSERT_EQUAL(HV_OK, rig_request(&m_rig, EVENT_RESET));
    rig_run_ms(&m_rig, 100);
    TEST_ASSERT_EQUAL(DRIVE_DISABLED, seen()->drive[1].state);
    TEST_ASSERT_EQUAL(STATE_OFF, seen()->state);
}

/* ---- frames ---- */

static void test_frames_bad_ones_change_nothing_and_are_counted(void)
{
    static const char *const k_bad[] = {"@A6:9,9,9,9,9,9,G#",
                                        "@A6:9,9,9,9,9#",
                                        "@A6:9,9,9,9,9,9,9,9#",
                                        "@A6:nan,9,9,9,9,9,0#",
                                        "@A6:inf,9,9,9,9,9,0#",
                                        "@A6:0x10,9,9,9,9,9,0#",
                                        "@A6:,9,9,9,9,9,0#",
                                        "@A6:9,9,9,9,9,9,FFFFF#",
                                        "@A6T:9,9,9,9,9,9#",
                                        "@A6T:9,9,9,9,9,9,-1#",
                                        "@A6T:9,9,9,9,9,9,nan#",
                                        "@A6T:9,9,9,9,9,9,3600001#",
                                        "A6:9,9,9,9,9,9,FFF#",
                                        "@B6:9,9,9,9,9,9,FFF#",
                                        "@A6 9,9,9,9,9,9,FFF#",
                                        "@A6:9,9,9,9,9,9,FFF",
                                        "@A6:9,9,9,40000,9,9,F#",
                                        ("@\xD0\x90"
                                         "6:9,9,9,9,9,9,F#"),
                                        "",
                                        "@A6:9 9,9,9,9,9,9,F#"};
    engage();
    send_and_run("@A6:1,0,0,0,0,0,F0#", 1000);
    const uint32_t accepted = counted()->accepted[FRAME_A6];
    for (unsigned i = 0; i < sizeof k_bad / sizeof k_bad[0]; i++) {
        const uint32_t before = rejected();
        rig_send(&m_rig, k_bad[i]);
        TEST_ASSERT_EQUAL_DOUBLE_MESSAGE(0, biggest_move(120), k_bad[i]);
        TEST_ASSERT_TRUE_MESSAGE(rejected() > before, k_bad[i]);
        TEST_ASSERT_EQUAL_HEX16(0xF0, m_rig.relays.mask);
    }
    TEST_ASSERT_EQUAL_UINT32(accepted, counted()->accepted[FRAME_A6]);
}

static void test_frames_several_in_a_datagram_the_last_one_counts(void)
{
    engage();
    send_and_run("@A6:9,0,0,0,0,0,1#@A6:zz#@A6:0,0,0,0,0,30,2#\r\n", 2000);
    assert_heights(30);
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, 0, rig_pose(&m_rig, AXIS_ROLL));
    TEST_ASSERT_EQUAL_HEX16(2, m_rig.relays.mask);
    TEST_ASSERT_EQUAL_UINT32(3, counted()->accepted[FRAME_A6]); /* the first one was sent by engage() */
    TEST_ASSERT_EQUAL_UINT32(1, rejected());
}

static void test_frames_more_than_a_cycle_takes_wait_for_the_next(void)
{
    engage();
    const uint32_t before = counted()->datagrams;
    for (int i = 0; i < 30; i++) {
        rig_sendf(&m_rig, "@A6:0,0,0,0,0,%d#", i);
    }
    rig_run_ms(&m_rig, 2000);
    TEST_ASSERT_EQUAL_UINT32(before + 30, counted()->datagrams);
    assert_heights(29);
}

static hv_status_t recv_without_end(void *ctx, uint8_t *data, size_t capacity, size_t *length, hal_udp_peer_t *from)
{
    static const char k_frame[] = "@A6:0,0,0,0,0,30#";
    (void)ctx;
    TEST_ASSERT_TRUE(capacity > sizeof k_frame);
    *length = sizeof k_frame - 1;
    memcpy(data, k_frame, sizeof k_frame);
    *from = (hal_udp_peer_t){.address = {127, 0, 0, 1}, .port = 4000};
    return HV_OK;
}

/* A sender that is quicker than this program does not hold a cycle up. */
static void test_frames_without_end_are_taken_so_many_per_cycle(void)
{
    engage();
    hal_udp_ops_t ops = *m_rig.gateway.io.udp.ops;
    ops.recv = recv_without_end;
    m_rig.gateway.io.udp.ops = &ops;
    const uint32_t before = counted()->datagrams;
    rig_run_ms(&m_rig, 1500);
    TEST_ASSERT_EQUAL_UINT32(before + 1500 * GATEWAY_DATAGRAMS_PER_CYCLE, counted()->datagrams);
    assert_heights(30);
}

/* Frames that come in one cycle in the middle of a motion: the first few, many between if so asked, and the last one. Where the
 * cylinders are in every one of the cycles after it. */
static void run_burst(unsigned between, double mm[][CYLINDERS_MAX], unsigned cycles)
{
    engage();
    for (unsigned i = 0; i < 30; i++) {
        rig_sendf(&m_rig, "@A6:0,0,0,0,0,%u#", i / 3);
        rig_run_ms(&m_rig, 16);
    }
    for (unsigned i = 0; i < GATEWAY_TARGETS_PER_CYCLE; i++) {
        rig_send(&m_rig, "@A6:0,0,0,0,0,10#");
    }
    for (unsigned i = 0; i < between; i++) {
        rig_sendf(&m_rig, i % 2 == 0 ? "@A6:0,0,0,0,0,1%u.%u#" : "@C6:%u,63,60,%u,60,60#", i % 4, i % 7);
    }
    rig_send(&m_rig, "@A6:0,0,0,0,0,11#");
    for (unsigned k = 0; k < cycles; k++) {
        rig_run_ms(&m_rig, 1);
        for (unsigned i = 0; i < CYLINDERS_MAX; i++) {
            mm[k][i] = rig_cylinder_mm(&m_rig, i + 1);
        }
    }
}

static void test_frames_of_many_in_a_cycle_only_the_newest_costs_motion(void)
{
    enum { CYCLES = 1500, BETWEEN = SIM_UDP_DATAGRAMS - GATEWAY_TARGETS_PER_CYCLE - 1 };
    static double few_mm[CYCLES][CYLINDERS_MAX], many_mm[CYCLES][CYLINDERS_MAX];
    run_burst(0, few_mm, CYCLES);
    const uint32_t few = counted()->accepted[FRAME_A6] + counted()->accepted[FRAME_C6];
    TEST_ASSERT_TRUE(rig_is_within_limits(&m_rig));
    run_burst(BETWEEN, many_mm, CYCLES);
    TEST_ASSERT_EQUAL_MEMORY(few_mm, many_mm, sizeof few_mm);
    TEST_ASSERT_EQUAL_UINT32(few + BETWEEN, counted()->accepted[FRAME_A6] + counted()->accepted[FRAME_C6]);
    assert_heights(11);
}

static void test_frames_oversize_datagram_is_counted_and_ignored(void)
{
    static char text[900];
    engage();
    memset(text, ' ', sizeof text - 1);
    memcpy(text, "@A6:0,0,0,0,0,30,2#", 19);
    rig_send(&m_rig, text);
    TEST_ASSERT_EQUAL_DOUBLE(0, biggest_move(500));
    TEST_ASSERT_EQUAL_UINT32(1, counted()->oversize);
    TEST_ASSERT_TRUE(rig_was_logged(&m_rig, "longer than 512"));
}

static void test_frames_receive_errors_are_counted_and_passed(void)
{
    engage();
    m_rig.udp.fail.first = m_rig.udp.fail.calls + 1;
    m_rig.udp.fail.count = 5;
    rig_send(&m_rig, "@A6:0,0,0,0,0,30#");
    rig_run_ms(&m_rig, 2000);
    TEST_ASSERT_EQUAL_UINT32(5, counted()->receive_errors);
    assert_heights(30);
}

static void check_platform_error(const char *frame, const char *logged)
{
    const uint32_t before = counted()->rejected[FRAME_ERR_PLATFORM];
    rig_run_ms(&m_rig, 1100); /* the log takes one line per reason and second */
    rig_send(&m_rig, frame);
    TEST_ASSERT_EQUAL_DOUBLE_MESSAGE(0, biggest_move(50), frame);
    TEST_ASSERT_EQUAL_UINT32(before + 1, counted()->rejected[FRAME_ERR_PLATFORM]);
    TEST_ASSERT_TRUE_MESSAGE(rig_was_logged(&m_rig, logged), frame);
}

static void test_frames_for_another_platform_name_what_is_missing(void)
{
    m_settings.has_angle = false;
    engage();
    check_platform_error("@A7:1,2,3,4,5,6,7,0#", "A7: it needs a rotation motor");
    check_platform_error("@A4:1,2,3,4,0#", "A4: it needs a rotation motor");
    check_platform_error("@C7:1,2,3,4,5,6,7,0#", "C7: it needs a rotation motor");
    check_platform_error("@C3:50,60,70,0#", "C3: it is for three cylinders");
    m_settings = rig_tripod();
    engage();
    check_platform_error("@A6:1,2,3,4,5,6,0#", "A6: it is for six cylinders");
    check_platform_error("@A7T:1,2,3,4,5,6,7,100#", "A7: it is for six cylinders");
    check_platform_error("@C6:50,60,70,80,90,100,0#", "C6: it is for six cylinders");
    check_platform_error("@A4:1,2,3,4,0#", "A4: it needs a rotation motor");
    send_and_run("@A3:2,1,10,0#", 2000);
    assert_heights(10);
    send_and_run("@C3:90,100,110,0#", 2000);
    TEST_ASSERT_EQUAL_DOUBLE(110, rig_cylinder_mm(&m_rig, 3));
}

static void test_frames_tripod_with_motor_takes_a4(void)
{
    m_settings = rig_tripod();
    m_settings.has_angle = true;
    engage();
    send_and_run("@A4:2,1,10,33,0#", 3000);
    assert_heights(10);
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, 33, rig_angle_deg(&m_rig));
}

/* A platform with strokes so long that most combinations of extensions belong to no pose. */
static void test_frames_extensions_without_a_pose_are_counted_and_move_nothing(void)
{
    for (unsigned i = 0; i < 6; i++) {
        m_settings.geometry.retracted_mm_q16[i] = 650 * 65536;
        m_settings.stroke_mm_q16[i] = 1200 * 65536;
    }
    engage();
    const uint32_t accepted = counted()->accepted[FRAME_C6];
    unsigned impossible = 0;
    static const char *const k_frames[] = {"@C6:1195,5,1195,5,1195,5,F#", "@C6:5,1195,5,5,5,5,F#", "@C6:1195,1195,5,5,5,5,F#"};
    for (unsigned i = 0; i < 3; i++) {
        const uint32_t before = counted()->impossible;
        rig_send(&m_rig, k_frames[i]);
        rig_run_ms(&m_rig, 1);
        if (counted()->impossible > before) {
            impossible++;
            TEST_ASSERT_EQUAL_DOUBLE(0, biggest_move(500));
            TEST_ASSERT_EQUAL_HEX16(m_settings.relay_safe_mask, m_rig.relays.mask);
        }
    }
    TEST_ASSERT_TRUE(impossible > 0);
    TEST_ASSERT_EQUAL_UINT32(accepted + 3 - impossible, counted()->accepted[FRAME_C6]);
    TEST_ASSERT_TRUE(rig_was_logged(&m_rig, "no pose has these extensions, or one too near a singularity"));
}

/* Both ends of the way are held by their cylinders, the middle is not: 842 and 891 are reached through a plate on edge. */
static void engage_where_ways_lead_near_a_singularity(void)
{
    m_settings = rig_tripod();
    m_settings.blend_ms = 250; /* each frame is a sender of its own, and gets to where its way leads */
    for (unsigned i = 0; i < 3; i++) {
        m_settings.geometry.retracted_mm_q16[i] = 260 * 65536;
        m_settings.stroke_mm_q16[i] = 1000 * 65536;
    }
    engage();
    send_and_run("@C3:260,842,891#", 1500);
    TEST_ASSERT_EQUAL_UINT32(1, counted()->singular_stops);
    TEST_ASSERT_EQUAL_UINT32(0, counted()->impossible);
}

static void test_frames_extensions_that_lead_near_a_singularity_stop_the_platform(void)
{
    engage_where_ways_lead_near_a_singularity();
    TEST_ASSERT_TRUE(rig_was_logged(&m_rig, "stopped: the extensions sent lead too near a singularity"));
    TEST_ASSERT_TRUE(kin_margin(motion_kin(&m_rig.gateway.motion), &seen()->sent) >= KIN_MARGIN_LEAST_Q32 * 99 / 100);
    rig_send(&m_rig, "@C3:260,842,891#"); /* a sender that insists does not make it try again */
    TEST_ASSERT_EQUAL_DOUBLE(0, biggest_move(500));
    TEST_ASSERT_EQUAL_UINT32(1, counted()->impossible);
    TEST_ASSERT_TRUE(rig_was_logged(&m_rig, "C3: no pose has these extensions, or one too near a singularity"));
    send_and_run("@A3:0,0,0#", 20000); /* and goes round it */
    assert_heights(0);
    TEST_ASSERT_EQUAL_UINT32(1, counted()->singular_stops);
}

static void test_frames_that_lead_near_a_singularity_are_logged_at_most_once_a_second(void)
{
    engage_where_ways_lead_near_a_singularity();
    unsigned lines = 0;
    for (unsigned i = 0; i < 100; i++) {
        send_and_run("@C3:360,360,360#", 300); /* by itself, not a stream whose jumps are smoothed */
        send_and_run("@C3:260,842,891#", 900);
        lines += rig_was_logged(&m_rig, "stopped: the extensions sent lead too near a singularity");
    }
    TEST_ASSERT_GREATER_THAN_UINT32(20, counted()->singular_stops);
    TEST_ASSERT_UINT_WITHIN(50, 70, lines); /* of 120 s */
    TEST_ASSERT_TRUE(kin_margin(motion_kin(&m_rig.gateway.motion), &seen()->sent) >= KIN_MARGIN_LEAST_Q32 * 99 / 100);
}

static void test_frames_reject_lines_are_rate_limited_and_count_what_was_left_out(void)
{
    engage();
    for (int i = 0; i < 50; i++) {
        send_and_run("@A6:9,9#", 10);
    }
    rig_run_ms(&m_rig, 1000);
    send_and_run("@A6:9,9#", 10);
    TEST_ASSERT_TRUE(rig_was_logged(&m_rig, "rejected"));
    TEST_ASSERT_TRUE(rig_was_logged(&m_rig, "; before that 49 more"));
    TEST_ASSERT_EQUAL_UINT32(51, counted()->rejected[FRAME_ERR_COUNT]);
}

/* The next line of the log that has this beginning, to its end. */
static void expect_line(const char *beginning, const char *line)
{
    const sim_log_line_t *logged;
    do {
        logged = sim_log_pop(&m_rig.log);
        TEST_ASSERT_NOT_NULL_MESSAGE(logged, line);
    } while (strncmp(logged->text, beginning, strlen(beginning)) != 0);
    TEST_ASSERT_EQUAL_STRING(line, logged->text);
}

/* Of its neighbours nothing, wherever in the datagram it is, and up to its last byte. */
static void test_frames_a_reject_line_quotes_the_frame_alone(void)
{
    engage();
    send_and_run("@A6:1,0,0,0,0,0,1#@A6:2,zz#@A6:3,0,0,0,0,0,3#", 10);
    expect_line(
        "frame",
        "frame from 127.0.0.1:9 rejected: byte 24: value 2 of A6 (pitch) is not a decimal number; write it as 5, -5.5 or 1E-05; "
        "found 'z': \"@A6:2,zz#\"");
    send_and_run("@A6:1,0,0,0,0,0,1#@A6:5,6#", 10);
    expect_line("frame", "frame from 127.0.0.1:9 rejected: byte 25: A6 takes 6 values and a mask, found 2: \"@A6:5,6#\"");
}

/* One frame of a stream at 50 Hz, the others of which are all zero, is far off. */
static void send_spike(double z)
{
    for (unsigned i = 0; i < 40; i++) {
        rig_sendf(&m_rig, "@A6:0,0,0,0,0,%g#", i == 20 ? z : 0.0);
        rig_run_ms(&m_rig, 20);
    }
}

static void test_spikes_are_told_and_the_gate_may_be_opened_in_operation(void)
{
    engage();
    send_spike(50);
    TEST_ASSERT_EQUAL_UINT32(1, counted()->spikes);
    expect_line("sample", "sample from 127.0.0.1:9 not followed, a spike: z 50.0 after 0.0");
    settings_t settings = m_settings;
    settings.spike_gate = 0;
    gateway_reload(&m_rig.gateway, &settings);
    send_spike(-60);
    TEST_ASSERT_EQUAL_UINT32(1, counted()->spikes);
    settings.spike_gate = 10;
    gateway_reload(&m_rig.gateway, &settings);
    send_spike(-60);
    TEST_ASSERT_EQUAL_UINT32(2, counted()->spikes);
    expect_line("sample", "sample from 127.0.0.1:9 not followed, a spike: z -60.0 after 0.0");
}

/* ---- relays ---- */

static void test_relays_follow_the_mask_only_while_engaged(void)
{
    engage();
    TEST_ASSERT_EQUAL_HEX16(0x801, m_rig.relays.mask); /* no mask was sent so far */
    send_and_run("@A6:0,0,0,0,0,0,F0#", 2);
    TEST_ASSERT_EQUAL_HEX16(0xF0, m_rig.relays.mask);
    send_and_run("@A6:0,0,0,0,0,0#", 2);
    TEST_ASSERT_EQUAL_HEX16(0xF0, m_rig.relays.mask);
    send_and_run("@A6T:0,0,0,0,0,0,500#", 2);
    TEST_ASSERT_EQUAL_HEX16(0xF0, m_rig.relays.mask);
    send_and_run("@A6:0,0,0,0,0,0,0xF00F#", 2);
    TEST_ASSERT_EQUAL_HEX16(0x00F, m_rig.relays.mask); /* bits 12 to 15 are ignored */
    TEST_ASSERT_EQUAL_UINT32(0, counted()->relay_missing);
    TEST_ASSERT_EQUAL(HV_OK, rig_request(&m_rig, EVENT_HOLD));
    rig_run_ms(&m_rig, 2);
    TEST_ASSERT_EQUAL_HEX16(0x801, m_rig.relays.mask);
    send_and_run("@A6:0,0,0,0,0,0,0FF#", 2);
    TEST_ASSERT_EQUAL_HEX16(0x801, m_rig.relays.mask);
    TEST_ASSERT_EQUAL(HV_OK, rig_request(&m_rig, EVENT_RESUME));
    rig_run_ms(&m_rig, 500);
    TEST_ASSERT_EQUAL_HEX16(0x801, m_rig.relays.mask); /* until the sender says so again */
    send_and_run("@A6:0,0,0,0,0,0,0FF#", 2);
    TEST_ASSERT_EQUAL_HEX16(0x0FF, m_rig.relays.mask);
}

static void test_relays_may_outlast_a_hold_for_a_while(void)
{
    m_settings.relay_safe_after_ms = 300;
    m_settings.silence_hold_ms = 200;
    engage();
    send_and_run("@A6:0,0,0,0,0,0,F0#", 202);
    TEST_ASSERT_EQUAL(STATE_HOLD, seen()->state);
    rig_run_ms(&m_rig, 290);
    TEST_ASSERT_EQUAL_HEX16(0xF0, m_rig.relays.mask);
    rig_run_ms(&m_rig, 12);
    TEST_ASSERT_EQUAL_HEX16(0x801, m_rig.relays.mask);
    send_and_run("@A6:0,0,0,0,0,0,F0#", 100);
    TEST_ASSERT_EQUAL(HV_OK, rig_request(&m_rig, EVENT_PARK));
    rig_run_ms(&m_rig, 2);
    TEST_ASSERT_EQUAL_HEX16(0x801, m_rig.relays.mask);
}

static void test_relays_bits_without_a_relay_are_counted(void)
{
    m_settings.relays.count = 4;
    m_settings.relay_safe_mask = 0;
    engage();
    send_and_run("@A6:0,0,0,0,0,0,13#", 2);
    TEST_ASSERT_EQUAL_HEX16(0x3, m_rig.relays.mask);
    TEST_ASSERT_EQUAL_UINT32(1, counted()->relay_missing);
}

static void test_relays_failed_write_is_counted_and_tried_again(void)
{
    engage();
    m_rig.relays.fail.first = m_rig.relays.fail.calls + 1;
    m_rig.relays.fail.count = 3;
    send_and_run("@A6:0,0,0,0,0,0,F0#", 10);
    TEST_ASSERT_EQUAL_UINT32(3, counted()->relay_errors);
    TEST_ASSERT_EQUAL_HEX16(0xF0, m_rig.relays.mask);
}

static void test_relays_that_cannot_be_switched_are_shown_and_told_once(void)
{
    engage();
    m_rig.relays.fail.first = m_rig.relays.fail.calls + 1;
    m_rig.relays.fail.count = 5;
    send_and_run("@A6:0,0,0,0,0,0,F0#", 3);
    TEST_ASSERT_TRUE(seen()->is_relays_unknown);
    TEST_ASSERT_TRUE(rig_was_logged(&m_rig, "relays: cannot be switched, their state is not known"));
    send_and_run("@A6:0,0,0,0,0,0,F0#", 10);
    TEST_ASSERT_FALSE(seen()->is_relays_unknown);
    TEST_ASSERT_TRUE(rig_was_logged(&m_rig, "relays: switched again"));
    TEST_ASSERT_FALSE(rig_was_logged(&m_rig, "relays: cannot"));
    TEST_ASSERT_EQUAL_HEX16(0xF0, m_rig.relays.mask);
}

static hv_status_t read_back_fails(void *ctx, uint16_t *mask) /* NOLINT(readability-non-const-parameter): an op */
{
    (void)ctx;
    (void)mask;
    return HV_ERR_IO;
}

/* A bank that takes every mask and does not say what it made of it. */
static void test_relays_that_cannot_be_looked_at_are_written_in_every_cycle(void)
{
    engage();
    const hal_relays_ops_t *const sim = m_rig.gateway.io.relays.ops;
    hal_relays_ops_t blind = *sim;
    blind.read_back = read_back_fails;
    m_rig.gateway.io.relays.ops = &blind;
    const uint32_t writes = m_rig.relays.writes;
    rig_run_ms(&m_rig, 20);
    TEST_ASSERT_TRUE(seen()->is_relays_unknown);
    TEST_ASSERT_TRUE(rig_was_logged(&m_rig, "relays: cannot be switched, their state is not known"));
    TEST_ASSERT_UINT_WITHIN(1, 20, m_rig.relays.writes - writes);
    m_rig.gateway.io.relays.ops = sim;
    rig_run_ms(&m_rig, 2);
    TEST_ASSERT_FALSE(seen()->is_relays_unknown);
    TEST_ASSERT_TRUE(rig_was_logged(&m_rig, "relays: switched again"));
    TEST_ASSERT_EQUAL_UINT32(0, counted()->relay_errors);
}

static void test_relays_limits_of_time_apply_to_the_sender_not_to_the_safe_mask(void)
{
    m_settings.relays.max_on_ms[4] = 20;
    m_settings.relays.min_toggle_ms[5] = 500;
    engage();
    send_and_run("@A6:0,0,0,0,0,0,F0#", 10);
    TEST_ASSERT_EQUAL_HEX16(0xF0, m_rig.relays.mask);
    send_and_run("@A6:0,0,0,0,0,0,F0#", 20);
    TEST_ASSERT_EQUAL_HEX16(0xE0, m_rig.relays.mask);
    TEST_ASSERT_EQUAL_UINT32(1, counted()->relay_cut);
    send_and_run("@A6:0,0,0,0,0,0,00#", 5);
    TEST_ASSERT_EQUAL_HEX16(0x20, m_rig.relays.mask);
    TEST_ASSERT_EQUAL_UINT32(1, counted()->relay_delayed);
    TEST_ASSERT_EQUAL(HV_OK, rig_request(&m_rig, EVENT_HOLD));
    rig_run_ms(&m_rig, 2);
    TEST_ASSERT_EQUAL_HEX16(0x801, m_rig.relays.mask);
}

/* ---- axes ---- */

static void test_axes_sign_scale_and_offset_apply(void)
{
    m_settings.axis[AXIS_ROLL].sign = -1;
    m_settings.axis[AXIS_PITCH].scale_q16 = 65536 / 2;
    m_settings.axis[AXIS_PITCH].offset_q16 = 65536;
    m_settings.axis[AXIS_Z].offset_q16 = -20 * 65536;
    m_settings.axis[AXIS_ANGLE].sign = -1;
    m_settings.axis[AXIS_ANGLE].scale_q16 = 2 * 65536;
    engage();
    send_and_run("@A7:3,4,0,0,0,30,20,0#", 4000);
    TEST_ASSERT_DOUBLE_WITHIN(1e-4, -3, rig_pose(&m_rig, AXIS_ROLL));
    TEST_ASSERT_DOUBLE_WITHIN(1e-4, 3, rig_pose(&m_rig, AXIS_PITCH));
    assert_heights(10);
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, -40, rig_angle_deg(&m_rig));
}

static void turn_to(double degrees)
{
    rig_sendf(&m_rig, "@A7:0,0,0,0,0,0,%f,0#", degrees);
    rig_run_ms(&m_rig, 12000);
}

static void test_axes_shortest_angle_takes_the_shorter_way_round(void)
{
    m_settings.axis[AXIS_ANGLE].wrap = ANGLE_SHORTEST;
    engage();
    turn_to(359);
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, -1, rig_angle_deg(&m_rig));
    turn_to(1);
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, 1, rig_angle_deg(&m_rig));
    turn_to(-350);
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, 10, rig_angle_deg(&m_rig));
    turn_to(170);
    turn_to(-170);
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, 190, rig_angle_deg(&m_rig));
}

/* The shorter way ends at a limit of the motor; the other way round does not. */
static void test_axes_shortest_angle_turns_round_where_a_limit_is_in_the_way(void)
{
    m_settings.axis[AXIS_ANGLE].wrap = ANGLE_SHORTEST;
    m_settings.axis[AXIS_ANGLE].min_q16 = -200 * 65536;
    m_settings.axis[AXIS_ANGLE].max_q16 = 200 * 65536;
    engage();
    turn_to(150);
    turn_to(-150); /* 210 is beyond */
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, -150, rig_angle_deg(&m_rig));
    turn_to(150); /* -210 is */
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, 150, rig_angle_deg(&m_rig));
    m_settings.axis[AXIS_ANGLE].min_q16 = -100 * 65536;
    m_settings.axis[AXIS_ANGLE].max_q16 = 100 * 65536;
    engage();
    turn_to(120); /* no way round: to the limit */
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, 100, rig_angle_deg(&m_rig));
    turn_to(-100);
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, -100, rig_angle_deg(&m_rig));
    turn_to(120);
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, -100, rig_angle_deg(&m_rig));
}

static void test_axes_angle_as_sent_is_the_number_itself(void)
{
    m_settings.axis[AXIS_ANGLE].wrap = ANGLE_AS_SENT;
    engage();
    turn_to(359);
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, 359, rig_angle_deg(&m_rig));
    turn_to(1);
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, 1, rig_angle_deg(&m_rig));
}

/* A sender that counts from 0 to 360 moves the platform as one that counts from -180 to 180, whatever sign, scale and offset. */
static void test_axes_rotations_from_0_to_360_move_as_signed_ones(void)
{
    static const char *const k_axes[] = {"@A6:%f,0,0,0,0,0#", "@A6:0,%f,0,0,0,0#", "@A6:0,0,%f,0,0,0#"};
    for (unsigned axis = AXIS_ROLL; axis <= AXIS_YAW; axis++) {
        for (int scaled = 0; scaled <= 1; scaled++) {
            double signed_deg[400];
            for (int is_turned = 0; is_turned <= 1; is_turned++) {
                setUp();
                m_settings.axis[axis].wrap = is_turned ? ANGLE_SHORTEST : ANGLE_AS_SENT;
                m_settings.axis[axis].sign = scaled ? -1 : 1;
                m_settings.axis[axis].scale_q16 = scaled ? 32768 : 65536;
                m_settings.axis[axis].offset_q16 = scaled ? 2 * 65536 : 0;
                engage();
                for (unsigned i = 0; i < 400; i++) {
                    const double deg = 6 * sin(i * 0.04);
                    rig_sendf(&m_rig, k_axes[axis], is_turned && deg < 0 ? deg + 360 : deg);
                    rig_run_ms(&m_rig, 16);
                    const double at = rig_pose(&m_rig, axis);
                    signed_deg[i] = is_turned ? signed_deg[i] : at;
                    TEST_ASSERT_DOUBLE_WITHIN(0.001, signed_deg[i], at);
                }
                TEST_ASSERT_FALSE(rig_was_logged(&m_rig, "jumps by nearly a whole turn"));
            }
        }
    }
}

/* A heading goes all the way round: the platform goes from one limit to the other where that is the nearer one. */
static void test_axes_heading_all_the_way_round_stays_within_the_limits(void)
{
    m_settings.axis[AXIS_YAW].wrap = ANGLE_SHORTEST;
    m_settings.axis[AXIS_YAW].min_q16 = -10 * 65536;
    m_settings.axis[AXIS_YAW].max_q16 = 10 * 65536;
    engage();
    for (unsigned turn = 0; turn < 3; turn++) {
        for (unsigned deg = 0; deg < 360; deg += 2) {
            rig_sendf(&m_rig, "@A6:0,0,%u,0,0,0#", deg);
            rig_run_ms(&m_rig, 100);
            const double asked = deg <= 10 ? deg : deg <= 190 ? 10 : deg < 350 ? -10 : (double)deg - 360;
            const bool is_on_its_way = deg > 188 && deg < 220;
            TEST_ASSERT_TRUE(is_on_its_way || fabs(rig_pose(&m_rig, AXIS_YAW) - asked) < 6);
        }
    }
    TEST_ASSERT_FALSE(rig_was_logged(&m_rig, "jumps by nearly a whole turn"));
}

/* As sent, the platform would swing from limit to limit: that is followed, and told. */
static void test_axes_jump_by_a_turn_is_told(void)
{
    static const struct {
        const char *first, *second, *told; /**< told: NULL: nothing */
        unsigned pause_ms;
    } k_rows[] = {{"@A6:0,0,1,0,0,0#", "@A6:0,0,359,0,0,0#", "yaw jumps by nearly a whole turn", 16},
                  {"@A6:0,0,359.5,0,0,0#", "@A6:0,0,4,0,0,0#", "set [yaw] wrap = shortest", 16},
                  {"@A6:179,0,0,0,0,0#", "@A6:-179,0,0,0,0,0#", "roll jumps", 16},
                  {"@A6:0,-175,0,0,0,0#", "@A6:0,170,0,0,0,0#", "pitch jumps", 16},
                  {"@A7:0,0,0,0,0,0,355#", "@A7:0,0,0,0,0,0,2#", "angle jumps", 16},
                  {"@A6:0,0,1,0,0,0#", "@A6:0,0,320,0,0,0#", NULL, 16},
                  {"@A6:0,0,1,0,0,0#", "@A6:0,0,359,0,0,0#", NULL, 400}, /* poses one by one */
                  {"@A6:0,0,359,0,0,0#", "@A3:0,0,0#", NULL, 16},        /* it does not say so, it has none */
                  {"@C6:100,100,100,100,100,100#", "@C6:100,101,100,100,100,100#", NULL, 16}};
    for (unsigned i = 0; i < sizeof k_rows / sizeof k_rows[0]; i++) {
        engage();
        send_and_run(k_rows[i].first, k_rows[i].pause_ms);
        send_and_run(k_rows[i].second, 3000);
        const char *told = k_rows[i].told != NULL ? k_rows[i].told : "jumps by nearly a whole turn";
        TEST_ASSERT_EQUAL_MESSAGE(k_rows[i].told != NULL, rig_was_logged(&m_rig, told), k_rows[i].second);
    }
    engage(); /* and not with every frame */
    for (unsigned i = 0; i < 60; i++) {
        send_and_run(i % 2 ? "@A6:0,0,1,0,0,0#" : "@A6:0,0,359,0,0,0#", 16);
    }
    TEST_ASSERT_TRUE(rig_was_logged(&m_rig, "yaw jumps"));
    TEST_ASSERT_FALSE(rig_was_logged(&m_rig, "yaw jumps"));
}

static void test_axes_frame_without_angle_keeps_it(void)
{
    engage();
    turn_to(30);
    send_and_run("@A6:1,0,0,0,0,0,0#", 1000);
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, 30, rig_angle_deg(&m_rig));
}

/* ---- silence ---- */

static void test_silence_holds_then_neutral_then_settles(void)
{
    m_settings.silence_hold_ms = 300;
    m_settings.silence_neutral_ms = 2000;
    m_settings.silence_settle_ms = 12000;
    engage();
    send_and_run("@A6:0,0,0,0,0,30,F0#", 250);
    TEST_ASSERT_EQUAL(STATE_ENGAGED, seen()->state);
    rig_run_ms(&m_rig, 60);
    TEST_ASSERT_EQUAL(STATE_HOLD, seen()->state);
    TEST_ASSERT_TRUE(seen()->is_held_by_silence);
    TEST_ASSERT_EQUAL_HEX16(0x801, m_rig.relays.mask);
    TEST_ASSERT_TRUE(rig_run_until(&m_rig, STATE_NEUTRAL, 9000));
    TEST_ASSERT_TRUE(m_rig.now_us > 2000000);
    assert_heights(0);
    TEST_ASSERT_TRUE(rig_run_until(&m_rig, STATE_SETTLED, 30000));
    send_and_run("@A6:0,0,0,0,0,30#", 2000);
    TEST_ASSERT_EQUAL(STATE_SETTLED, seen()->state); /* people may be boarding: a frame does not raise it */
}

static void test_silence_returning_sender_engages_again_at_engage_speed(void)
{
    m_settings.silence_hold_ms = 300;
    engage();
    send_and_run("@A6:0,0,0,0,0,40#", 3000);
    TEST_ASSERT_EQUAL(STATE_HOLD, seen()->state);
    rig_check_reset(&m_rig);
    for (int i = 0; i < 300; i++) {
        send_and_run("@A6:0,0,0,0,0,-40#", 20);
    }
    TEST_ASSERT_EQUAL(STATE_ENGAGED, seen()->state);
    assert_heights(-40);
    TEST_ASSERT_TRUE(m_rig.check.speed * 400 <= 50.1);
}

static void test_silence_operator_hold_is_not_released_by_frames(void)
{
    m_settings.silence_hold_ms = 300;
    engage();
    TEST_ASSERT_EQUAL(HV_OK, rig_request(&m_rig, EVENT_HOLD));
    rig_run_ms(&m_rig, 1000);
    rig_send(&m_rig, "@A6:0,0,0,0,0,-40#");
    TEST_ASSERT_EQUAL_DOUBLE(0, biggest_move(500));
    TEST_ASSERT_EQUAL(STATE_HOLD, seen()->state);
}

static void test_silence_never_strikes_while_a_timed_move_runs(void)
{
    m_settings.silence_hold_ms = 200;
    engage();
    rig_send(&m_rig, "@A6T:0,0,0,0,0,30,5000#");
    for (int ms = 0; ms < 5150; ms++) {
        rig_run_ms(&m_rig, 1);
        if (seen()->state != STATE_ENGAGED && ms > 5) {
            TEST_FAIL_MESSAGE("held in the middle of a timed move");
        }
    }
    assert_heights(30);
    rig_run_ms(&m_rig, 100);
    TEST_ASSERT_EQUAL(STATE_HOLD, seen()->state);
}

static void test_silence_bad_frames_do_not_count_as_a_sender(void)
{
    m_settings.silence_hold_ms = 300;
    engage();
    send_and_run("@A6:0,0,0,0,0,5#", 100);
    for (int i = 0; i < 30; i++) {
        send_and_run("@A6:1,2#", 10);
        send_and_run("@C3:1,2,3#", 10);
    }
    TEST_ASSERT_EQUAL(STATE_HOLD, seen()->state);
}

/* ---- two senders ---- */

/* Two senders, poses far apart, mixed at random: only the first one moves anything. */
static void test_senders_two_at_once_only_one_is_followed(void)
{
    m_settings.takeover_ms = 2500;
    start(true);
    TEST_ASSERT_TRUE(rig_run_until(&m_rig, STATE_ENGAGED, 20000));
    for (unsigned i = 0; i < 300; i++) {
        rig_send_from(&m_rig, 1, "@A6:0,0,0,0,0,40,F1#");
        rig_run_ms(&m_rig, 1 + i % 9);
        rig_send_from(&m_rig, 2, "@A6:0,0,0,0,0,-40,F2#");
        rig_run_ms(&m_rig, 1 + i % 7);
    }
    assert_heights(40);
    TEST_ASSERT_EQUAL_HEX16(0xF1, m_rig.relays.mask);
    TEST_ASSERT_EQUAL_UINT32(300, counted()->other_sender);
    TEST_ASSERT_EQUAL_UINT32(300, counted()->accepted[FRAME_A6]);
    TEST_ASSERT_EQUAL_UINT8(1, seen()->owner.peer.address[3]);
    TEST_ASSERT_EQUAL_UINT8(2, seen()->other.peer.address[3]);
    expect_line("frame", "frame from 10.0.0.2:4000 not followed: 10.0.0.1:4000 drives");
}

/* From any moment of the first one's motion: the second takes over after the silence, at engage speed. */
static void test_senders_take_over_after_silence_at_engage_speed(void)
{
    m_settings.takeover_ms = 500;
    m_settings.silence_hold_ms = 0;
    for (unsigned ms = 1; ms < 300; ms += 43) {
        start(true);
        TEST_ASSERT_TRUE(rig_run_until(&m_rig, STATE_ENGAGED, 20000));
        rig_send_from(&m_rig, 1, "@A6:0,0,0,0,0,40,F1#");
        rig_run_ms(&m_rig, 3000);
        rig_send_from(&m_rig, 1, "@A6:0,0,0,0,0,20,F1#");
        rig_run_ms(&m_rig, 500);
        rig_check_reset(&m_rig);
        rig_send_from(&m_rig, 2, "@A6:0,0,0,0,0,-40#");
        for (unsigned i = 0; i < 400; i++) {
            rig_run_ms(&m_rig, 10);
            rig_send_from(&m_rig, 2, "@A6:0,0,0,0,0,-40#");
        }
        assert_heights(-40);
        TEST_ASSERT_TRUE(m_rig.check.speed * 400 <= 50.1);
        TEST_ASSERT_EQUAL_HEX16(m_settings.relay_safe_mask, m_rig.relays.mask); /* what the first one switched is undone */
        TEST_ASSERT_EQUAL_UINT32(1, counted()->owner_changes);
        expect_line("10.", "10.0.0.2:4000 drives from now on");
    }
}

/* 60 Hz at that height; returns the highest speed of a cylinder meanwhile. */
static double stream_height(const char *frame, unsigned frames)
{
    rig_check_reset(&m_rig);
    for (unsigned i = 0; i < frames; i++) {
        rig_send(&m_rig, frame);
        rig_run_ms(&m_rig, i % 3 == 0 ? 16 : 17);
    }
    return m_rig.check.speed * 400;
}

static void test_senders_stream_that_returns_after_a_gap_is_taken_over_at_engage_speed(void)
{
    m_settings.silence_hold_ms = 0;
    engage();
    (void)stream_height("@A6:0,0,0,0,0,-40#", 200);
    TEST_ASSERT_TRUE(stream_height("@A6:0,0,0,0,0,40#", 200) > 100); /* no gap: a step of the stream */
    rig_run_ms(&m_rig, 150);
    TEST_ASSERT_TRUE(stream_height("@A6:0,0,0,0,0,-40#", 200) > 100); /* a gap in which the motion has not ended yet */
    for (unsigned gap_ms = 400; gap_ms < 1500; gap_ms += 170) {
        rig_run_ms(&m_rig, gap_ms);
        TEST_ASSERT_TRUE(stream_height("@A6:0,0,0,0,0,40#", 250) <= 50.1);
        assert_heights(40);
        TEST_ASSERT_TRUE(stream_height("@A6:0,0,0,0,0,-40#", 200) > 100); /* and then as ever */
        assert_heights(-40);
    }
}

/* What a stall held back comes in one go, and its first frames are where the motion ended. */
static void test_senders_burst_after_a_silence_is_taken_over_at_engage_speed(void)
{
    m_settings.silence_hold_ms = 0;
    engage();
    for (unsigned gap_ms = 450; gap_ms < 1000; gap_ms += 110) {
        (void)stream_height("@A6:0,0,0,0,0,-40#", 200);
        rig_run_ms(&m_rig, gap_ms);
        rig_check_reset(&m_rig);
        for (unsigned frame = 0; frame < 20; frame++) {
            rig_sendf(&m_rig, "@A6:0,0,0,0,0,%u#", 2 * frame - 38);
        }
        TEST_ASSERT_TRUE(stream_height("@A6:0,0,0,0,0,0#", 250) <= 50.1);
        assert_heights(0);
    }
}

/* Whoever moves a slider sends only while it moves: nothing is taken over. */
static void test_senders_stream_that_goes_on_from_where_it_ended_is_followed_at_once(void)
{
    m_settings.silence_hold_ms = 0;
    engage();
    (void)stream_height("@A6:0,0,0,0,0,-40#", 200);
    for (unsigned gap_ms = 400; gap_ms < 900; gap_ms += 170) {
        rig_run_ms(&m_rig, gap_ms);
        for (int mm = -39; mm <= 40; mm++) {
            rig_sendf(&m_rig, "@A6:0,0,0,0,0,%d#", mm);
            rig_run_ms(&m_rig, 17);
            TEST_ASSERT_EQUAL_UINT(0, seen()->flags & MOTION_TAKEOVER);
        }
        TEST_ASSERT_DOUBLE_WITHIN(60 * 0.06, 40, rig_pose(&m_rig, AXIS_Z)); /* no later than any stream */
        for (int mm = 39; mm >= -40; mm--) {
            rig_sendf(&m_rig, "@A6:0,0,0,0,0,%d#", mm);
            rig_run_ms(&m_rig, 17);
        }
    }
}

static void test_senders_poses_one_by_one_are_at_full_speed_whatever_is_between(void)
{
    m_settings.silence_hold_ms = 0;
    engage();
    for (unsigned i = 0; i < 20; i++) {
        rig_check_reset(&m_rig);
        send_and_run(i % 2 == 0 ? "@A6:0,0,0,0,0,40#" : "@A6:0,0,0,0,0,-40#", 1500);
        TEST_ASSERT_TRUE(i == 0 || m_rig.check.speed * 400 > 100);
    }
}

static void test_senders_priority_takes_over_in_motion_without_a_jump(void)
{
    m_settings.takeover_ms = 2500;
    m_settings.priority = (hal_udp_networks_t){.count = 1, .network = {{.prefix = 32, .address = {10, 0, 0, 2}}}};
    for (unsigned ms = 1; ms < 400; ms += 57) {
        start(true);
        TEST_ASSERT_TRUE(rig_run_until(&m_rig, STATE_ENGAGED, 20000));
        rig_send_from(&m_rig, 1, "@A6:0,0,0,0,0,0#");
        rig_run_ms(&m_rig, 1000);
        rig_send_from(&m_rig, 1, "@A6:0,0,0,0,0,60#");
        rig_run_ms(&m_rig, ms);
        for (unsigned i = 0; i < 400; i++) {
            rig_send_from(&m_rig, 2, "@A6:0,0,0,0,0,-40#");
            rig_send_from(&m_rig, 1, "@A6:0,0,0,0,0,60#");
            rig_run_ms(&m_rig, 10);
        }
        assert_heights(-40); /* limits are judged in tearDown */
        TEST_ASSERT_EQUAL_UINT32(1, counted()->owner_changes);
    }
}

static void send_from_port(uint16_t port, const char *text)
{
    const hal_udp_peer_t from = {.address = {10, 0, 0, 1}, .port = port};
    TEST_ASSERT_EQUAL(HV_OK, sim_udp_push(&m_rig.udp, (const uint8_t *)text, strlen(text), &from));
}

/* Two programs of one PC: the first one drives, and the second one's poses are not between its own. */
static void test_sender_second_program_of_its_address_is_another_one(void)
{
    m_settings.takeover_ms = 2500;
    start(true);
    TEST_ASSERT_TRUE(rig_run_until(&m_rig, STATE_ENGAGED, 20000));
    double lowest = 0;
    for (unsigned i = 0; i < 600; i++) {
        send_from_port(5000, "@A6:0,0,0,0,0,40,1#");
        rig_run_ms(&m_rig, 8);
        send_from_port(5001, "@A6:0,0,0,0,0,-40,2#");
        rig_run_ms(&m_rig, 8);
        lowest = fmin(lowest, rig_pose(&m_rig, AXIS_Z));
    }
    assert_heights(40);
    TEST_ASSERT_DOUBLE_WITHIN(0.1, 0, lowest);
    TEST_ASSERT_EQUAL_HEX16(0x1, m_rig.relays.mask);
    TEST_ASSERT_EQUAL_UINT16(5001, seen()->other.peer.port);
    TEST_ASSERT_EQUAL_UINT32(598, counted()->other_sender);
    TEST_ASSERT_TRUE(rig_was_logged(&m_rig, "programs of one address send by turns"));
    TEST_ASSERT_TRUE(rig_was_logged(&m_rig, "frame from 10.0.0.1:5001 not followed: 10.0.0.1:5000 drives"));
    for (unsigned i = 0; i < 400; i++) { /* the first one ends */
        send_from_port(5001, "@A6:0,0,0,0,0,-40,2#");
        rig_run_ms(&m_rig, 16);
    }
    assert_heights(-40);
    TEST_ASSERT_EQUAL_UINT32(1, counted()->owner_changes);
}

/* ---- far jumps ---- */

static void expect_unconfirmed(uint32_t jumps, double z)
{
    assert_heights(z);
    TEST_ASSERT_EQUAL_UINT32(jumps, counted()->unconfirmed);
}

static void test_jumps_lone_far_frame_moves_nothing_relays_neither(void)
{
    m_settings.confirm_jump_mm_q16 = 20 * 65536;
    engage();
    send_and_run("@A6:0,0,0,0,0,10,1#", 1000);
    send_and_run("@A6:0,0,0,0,0,60,FF#", 1500);
    expect_unconfirmed(1, 10);
    TEST_ASSERT_EQUAL_HEX16(0x1, m_rig.relays.mask);
    TEST_ASSERT_TRUE(rig_was_logged(&m_rig, "not followed, a far jump that no second one confirmed: z 60.0 after 10.0"));
    send_and_run("@A6:0,0,0,0,0,-60,FF#", 100);
    send_and_run("@A6:0,0,0,0,0,11,3#", 1000);
    expect_unconfirmed(2, 11);
    TEST_ASSERT_EQUAL_HEX16(0x3, m_rig.relays.mask);
    TEST_ASSERT_EQUAL_UINT32(5, counted()->accepted[FRAME_A6]); /* good frames all of them, that of engage() too */
}

/* In mm for extensions, in degrees for the motor; each has its own distance. */
static void test_jumps_are_named_by_cylinder_and_motor(void)
{
    m_settings.confirm_jump_mm_q16 = 20 * 65536;
    m_settings.confirm_jump_deg_q16 = 10 * 65536;
    engage();
    const double at = rig_cylinder_mm(&m_rig, 1);
    rig_sendf(&m_rig, "@C6:%.1f,%.1f,%.1f,%.1f,%.1f,%.1f#", at, at, at + 25, at, at, at);
    rig_run_ms(&m_rig, 1100);
    TEST_ASSERT_EQUAL_UINT32(1, counted()->unconfirmed);
    TEST_ASSERT_TRUE(rig_was_logged(&m_rig, "a far jump that no second one confirmed: cylinder 3 "));
    rig_sendf(&m_rig, "@C7:%.1f,%.1f,%.1f,%.1f,%.1f,%.1f,40#", at, at, at, at, at, at);
    rig_run_ms(&m_rig, 1100);
    TEST_ASSERT_TRUE(rig_was_logged(&m_rig, "a far jump that no second one confirmed: angle 40.0 after 0.0"));
    m_settings.confirm_jump_mm_q16 = 0; /* and the motor's alone */
    engage();
    send_and_run("@A7:0,0,0,0,0,60,10#", 2000);
    send_and_run("@A7:0,0,0,0,0,60,20.5#", 1100);
    expect_unconfirmed(1, 60);
    TEST_ASSERT_TRUE(rig_was_logged(&m_rig, "a far jump that no second one confirmed: angle 20.5 after 10.0"));
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, 10, rig_angle_deg(&m_rig));
}

static void test_jumps_are_no_matter_before_anybody_is_followed(void)
{
    m_settings.engage = ENGAGE_MANUAL;
    m_settings.confirm_jump_mm_q16 = 20 * 65536;
    start(true);
    send_and_run("@A6:0,0,0,0,0,60#", 1100);
    TEST_ASSERT_EQUAL_UINT32(0, counted()->unconfirmed);
    TEST_ASSERT_EQUAL_UINT32(1, counted()->not_followed);
}

/* The move takes the second frame's time, from the second frame on. */
static void test_jumps_second_frame_is_followed_with_its_own_time(void)
{
    m_settings.confirm_jump_mm_q16 = 20 * 65536;
    engage();
    send_and_run("@A6T:0,0,0,0,0,60,500#", 100);
    expect_unconfirmed(0, 0);
    send_and_run("@A6T:0,0,0,0,0,50,2000#", 1900);
    TEST_ASSERT_TRUE(rig_pose(&m_rig, AXIS_Z) < 49.99 && rig_pose(&m_rig, AXIS_Z) > 45);
    rig_run_ms(&m_rig, 101);
    expect_unconfirmed(0, 50);
}

static void test_jumps_hold_by_silence_comes_when_it_would(void)
{
    m_settings.confirm_jump_mm_q16 = 20 * 65536;
    m_settings.silence_hold_ms = 700;
    engage();
    TEST_ASSERT_EQUAL(STATE_HOLD, seen()->state);
    send_and_run("@A6:0,0,0,0,0,60#", 699); /* ends the hold as any frame would, and is one for the silence */
    TEST_ASSERT_EQUAL(STATE_ENGAGED, seen()->state);
    rig_run_ms(&m_rig, 2);
    TEST_ASSERT_EQUAL(STATE_HOLD, seen()->state);
    expect_unconfirmed(0, 0);
    rig_run_ms(&m_rig, 400);
    expect_unconfirmed(1, 0);
}

static void test_jumps_of_the_sender_before_confirm_nothing(void)
{
    m_settings.confirm_jump_mm_q16 = 20 * 65536;
    m_settings.takeover_ms = 2500;
    m_settings.priority = (hal_udp_networks_t){.count = 1, .network = {{.prefix = 32, .address = {10, 0, 0, 2}}}};
    start(true);
    TEST_ASSERT_TRUE(rig_run_until(&m_rig, STATE_ENGAGED, 20000));
    rig_send_from(&m_rig, 1, "@A6:0,0,0,0,0,60#");
    rig_run_ms(&m_rig, 20);
    rig_send_from(&m_rig, 2, "@A6:0,0,0,0,0,60#");
    rig_run_ms(&m_rig, 500);
    assert_heights(0);
    rig_send_from(&m_rig, 2, "@A6:0,0,0,0,0,61#");
    rig_run_ms(&m_rig, 5000);
    expect_unconfirmed(0, 61);
}

static void test_jumps_every_frame_is_followed_where_it_is_off(void)
{
    engage();
    send_and_run("@A6:0,0,0,0,0,60#", 2000);
    expect_unconfirmed(0, 60);
    settings_t settings = m_settings;
    settings.confirm_jump_mm_q16 = 20 * 65536;
    gateway_reload(&m_rig.gateway, &settings); /* from now on, measured from what was followed before */
    send_and_run("@A6:0,0,0,0,0,45#", 2000);
    expect_unconfirmed(0, 45);
    send_and_run("@A6:0,0,0,0,0,0#", 2000);
    expect_unconfirmed(1, 45);
}

/* ---- e-stop ---- */

static void start_moving(unsigned ms)
{
    rig_send(&m_rig, "@A7:5,-4,3,10,20,30,60,F0#");
    rig_run_ms(&m_rig, ms);
}

static void test_estop_in_motion_latches_and_comes_up_through_homing(void)
{
    for (unsigned ms = 1; ms < 600; ms += 37) {
        engage();
        start_moving(ms);
        sim_inputs_set(&m_rig.inputs, INPUT_ESTOP, true);
        rig_run_ms(&m_rig, 1);
        TEST_ASSERT_EQUAL(STATE_ESTOP, seen()->state);
        TEST_ASSERT_EQUAL_HEX16(0x801, m_rig.relays.mask);
        for (unsigned i = 0; i < 7; i++) {
            TEST_ASSERT_EQUAL(DRIVE_DISABLED, m_rig.drives.axis[i].state);
            TEST_ASSERT_EQUAL_INT64(m_rig.drives.axis[i].position_q32, m_rig.drives.axis[i].setpoint_q32);
        }
        rig_send(&m_rig, "@A6:0,0,0,0,0,0#");
        TEST_ASSERT_EQUAL_DOUBLE(0, biggest_move(300));
        TEST_ASSERT_EQUAL(HV_ERR_STATE, rig_request(&m_rig, EVENT_RESET));
        rig_run_ms(&m_rig, 500);
        TEST_ASSERT_EQUAL(STATE_ESTOP, seen()->state);
        sim_inputs_set(&m_rig.inputs, INPUT_ESTOP, false);
        rig_run_ms(&m_rig, 100);
        TEST_ASSERT_EQUAL(STATE_ESTOP, seen()->state);
        TEST_ASSERT_EQUAL(HV_ERR_STATE, rig_request(&m_rig, EVENT_ENGAGE));
        TEST_ASSERT_EQUAL(HV_OK, rig_request(&m_rig, EVENT_RESET));
        rig_run_ms(&m_rig, 5);
        TEST_ASSERT_EQUAL(STATE_OFF, seen()->state);
        rig_run_ms(&m_rig, 500);
        TEST_ASSERT_EQUAL(STATE_OFF, seen()->state);
        TEST_ASSERT_EQUAL(HV_OK, rig_request(&m_rig, EVENT_ENGAGE));
        rig_run_ms(&m_rig, 1);
        TEST_ASSERT_EQUAL(STATE_HOMING, seen()->state);
        TEST_ASSERT_TRUE(rig_run_until(&m_rig, STATE_ENGAGED, 30000));
        TEST_ASSERT_EQUAL_UINT(0, rig_following_errors(&m_rig));
    }
}

static void test_estop_input_that_cannot_be_read_counts_as_active(void)
{
    engage();
    m_rig.inputs.is_broken = true;
    rig_run_ms(&m_rig, 1);
    TEST_ASSERT_EQUAL(STATE_ESTOP, seen()->state);
}

static void test_estop_in_every_state_ends_in_estop(void)
{
    static const state_t k_states[] = {STATE_HOMING, STATE_SETTLED, STATE_RISING, STATE_NEUTRAL, STATE_ENGAGED};
    for (unsigned i = 0; i < 5; i++) {
        for (unsigned later = 0; later < 3000; later += 777) {
            start(false);
            TEST_ASSERT_TRUE(rig_run_until(&m_rig, k_states[i], 60000));
            rig_run_ms(&m_rig, later);
            sim_inputs_set(&m_rig.inputs, INPUT_ESTOP, true);
            rig_run_ms(&m_rig, 2);
            TEST_ASSERT_EQUAL(STATE_ESTOP, seen()->state);
            TEST_ASSERT_EQUAL_DOUBLE(0, biggest_move(100));
            TEST_ASSERT_EQUAL_UINT(0, rig_following_errors(&m_rig));
        }
    }
}

/* ---- faults ---- */

static void expect_fault(fault_code_t code, unsigned axis, uint32_t device_code)
{
    m_is_fault_expected = true;
    TEST_ASSERT_EQUAL(STATE_FAULT, seen()->state);
    TEST_ASSERT_EQUAL(code, seen()->fault.code);
    TEST_ASSERT_EQUAL_UINT8(axis, seen()->fault.axis);
    TEST_ASSERT_EQUAL_HEX32(device_code, seen()->fault.device_code);
}

/* Every drive but one, which has stopped itself, was told to stop in the cycle that has just run. */
static void expect_quick_stop(unsigned but)
{
    TEST_ASSERT_EQUAL(FAULT_REACT_QUICK_STOP, seen()->reaction);
    for (unsigned i = 0; i < m_rig.drives.count; i++) {
        if (i != but) {
            TEST_ASSERT_EQUAL(DRIVE_DISABLED, m_rig.drives.axis[i].state);
        }
    }
}

static void test_fault_of_a_drive_stops_all_and_latches(void)
{
    for (unsigned ms = 1; ms < 500; ms += 29) {
        const uint8_t axis = (uint8_t)(ms % 7);
        engage();
        start_moving(ms);
        rig_break(&m_rig, SIM_DRIVES_FAULT, axis, 0x2310);
        rig_run_ms(&m_rig, 1);
        expect_fault(FAULT_DRIVE, axis + 1u, 0x2310);
        TEST_ASSERT_EQUAL_HEX16(0x801, m_rig.relays.mask);
        expect_quick_stop(axis);
        rig_run_ms(&m_rig, 50);
        rig_break(&m_rig, SIM_DRIVES_FAULT, (uint8_t)((axis + 1) % 7), 0x9999); /* a second one */
        rig_run_ms(&m_rig, 700);
        expect_fault(FAULT_DRIVE, axis + 1u, 0x2310);
        TEST_ASSERT_EQUAL_UINT32(2, counted()->faults);
        TEST_ASSERT_EQUAL_UINT32(2, counted()->fault[FAULT_DRIVE]);
        for (unsigned i = 0; i < 7; i++) {
            TEST_ASSERT_TRUE(m_rig.drives.axis[i].state == DRIVE_DISABLED || m_rig.drives.axis[i].state == DRIVE_FAULT);
        }
        TEST_ASSERT_EQUAL(HV_ERR_STATE, rig_request(&m_rig, EVENT_ENGAGE));
        TEST_ASSERT_EQUAL(HV_OK, rig_request(&m_rig, EVENT_RESET));
        rig_run_ms(&m_rig, 5);
        TEST_ASSERT_EQUAL(STATE_OFF, seen()->state);
        TEST_ASSERT_EQUAL(FAULT_NONE, seen()->fault.code);
        TEST_ASSERT_EQUAL(HV_OK, rig_request(&m_rig, EVENT_ENGAGE));
        TEST_ASSERT_TRUE(rig_run_until(&m_rig, STATE_ENGAGED, 30000));
        TEST_ASSERT_TRUE(rig_is_within_limits(&m_rig));
        TEST_ASSERT_EQUAL_UINT(0, rig_following_errors(&m_rig));
    }
}

static void test_fault_whose_cause_stays_cannot_be_reset(void)
{
    engage();
    rig_break(&m_rig, SIM_DRIVES_BROKEN, 2, 0x7300);
    rig_run_ms(&m_rig, 1000);
    TEST_ASSERT_EQUAL(HV_OK, rig_request(&m_rig, EVENT_RESET));
    rig_run_ms(&m_rig, 3000);
    expect_fault(FAULT_DRIVE, 3, 0x7300);
    TEST_ASSERT_TRUE(rig_was_logged(&m_rig, "reset refused"));
    rig_break(&m_rig, SIM_DRIVES_RECOVER, 2, 0);
    TEST_ASSERT_EQUAL(HV_OK, rig_request(&m_rig, EVENT_RESET));
    rig_run_ms(&m_rig, 10);
    TEST_ASSERT_EQUAL(STATE_OFF, seen()->state);
}

/* Who resets does not know yet of what comes after it. */
static void test_reset_is_given_up_for_what_comes_after_it(void)
{
    for (unsigned what = 0; what < 3; what++) {
        engage();
        m_is_fault_expected = true;
        rig_break(&m_rig, SIM_DRIVES_OFFLINE, 1, 0);
        rig_run_ms(&m_rig, 1000);
        TEST_ASSERT_EQUAL(HV_OK, rig_request(&m_rig, EVENT_RESET));
        rig_run_ms(&m_rig, 300);
        if (what == 0) {
            sim_inputs_set(&m_rig.inputs, INPUT_ESTOP, true);
            rig_run_ms(&m_rig, 100);
            sim_inputs_set(&m_rig.inputs, INPUT_ESTOP, false);
        } else if (what == 1) {
            rig_break(&m_rig, SIM_DRIVES_OFFLINE, 2, 0);
        } else {
            m_rig.is_failing = true;
            rig_run_ms(&m_rig, 100);
            m_rig.is_failing = false;
        }
        rig_run_ms(&m_rig, 100);
        rig_break(&m_rig, SIM_DRIVES_RECOVER, SIM_DRIVES_ALL, 0);
        rig_run_ms(&m_rig, 3000);
        TEST_ASSERT_EQUAL(what == 0 ? STATE_ESTOP : STATE_FAULT, seen()->state);
        TEST_ASSERT_TRUE(rig_was_logged(&m_rig, "reset refused: a new fault or the e-stop came after it"));
        TEST_ASSERT_EQUAL(HV_OK, rig_request(&m_rig, EVENT_RESET));
        rig_run_ms(&m_rig, 10);
        TEST_ASSERT_EQUAL(STATE_OFF, seen()->state);
    }
}

static void test_fault_drive_offline_stops_all(void)
{
    engage();
    start_moving(150);
    rig_break(&m_rig, SIM_DRIVES_OFFLINE, 4, 0);
    rig_run_ms(&m_rig, 1);
    expect_fault(FAULT_DRIVE_OFFLINE, 5, 0);
    rig_run_ms(&m_rig, 1000);
    TEST_ASSERT_EQUAL(DRIVE_DISABLED, m_rig.drives.axis[0].state);
    rig_break(&m_rig, SIM_DRIVES_RECOVER, 4, 0);
    rig_run_ms(&m_rig, 10);
    expect_fault(FAULT_DRIVE_OFFLINE, 5, 0);
    TEST_ASSERT_EQUAL(HV_OK, rig_request(&m_rig, EVENT_RESET));
    rig_run_ms(&m_rig, 10);
    TEST_ASSERT_EQUAL(HV_OK, rig_request(&m_rig, EVENT_ENGAGE));
    TEST_ASSERT_TRUE(rig_run_until(&m_rig, STATE_ENGAGED, 60000));
}

static void test_fault_drive_that_drops_out_stops_all(void)
{
    engage();
    start_moving(150);
    m_rig.drives.axis[1].state = DRIVE_DISABLED;
    rig_run_ms(&m_rig, 2);
    expect_fault(FAULT_DRIVE_DROPPED, 2, 0);
}

/* Way of cylinder 1 in the next cycle. */
static double step_taken_mm(void)
{
    const double from = rig_cylinder_mm(&m_rig, 1);
    rig_run_ms(&m_rig, 1);
    return rig_cylinder_mm(&m_rig, 1) - from;
}

/* While the bus takes nothing the motion waits: the largest step the drives see is none that they would not have seen anyway. */
static void test_fault_bus_busy_for_some_cycles_makes_motion_wait(void)
{
    for (unsigned busy_ms = 1; busy_ms < 60; busy_ms += 7) {
        engage();
        start_moving(150);
        const double before = fabs(step_taken_mm());
        rig_break(&m_rig, SIM_DRIVES_BUSY, 0, 0);
        rig_run_ms(&m_rig, busy_ms);
        const double at = rig_cylinder_mm(&m_rig, 1);
        rig_break(&m_rig, SIM_DRIVES_RECOVER, SIM_DRIVES_ALL, 0);
        rig_run_ms(&m_rig, 2);
        TEST_ASSERT_DOUBLE_WITHIN(0.2 * before, before, fabs(rig_cylinder_mm(&m_rig, 1) - at));
        rig_run_ms(&m_rig, 2000);
        TEST_ASSERT_EQUAL(STATE_ENGAGED, seen()->state);
        assert_heights(30);
    }
}

static void test_fault_bus_that_stays_busy_is_a_fault_and_returns_without_a_jump(void)
{
    for (unsigned ms = 10; ms < 500; ms += 35) {
        engage();
        start_moving(ms);
        rig_break(&m_rig, SIM_DRIVES_BUSY, 0, 0);
        rig_run_ms(&m_rig, 105);
        expect_fault(FAULT_BUS, 0, 0);
        rig_run_ms(&m_rig, ms);
        rig_break(&m_rig, SIM_DRIVES_RECOVER, SIM_DRIVES_ALL, 0);
        rig_run_ms(&m_rig, 10);
        expect_fault(FAULT_BUS, 0, 0);
        TEST_ASSERT_EQUAL(DRIVE_DISABLED, m_rig.drives.axis[0].state);
        TEST_ASSERT_EQUAL_UINT(0, rig_following_errors(&m_rig));
    }
}

/* A cylinder that stands still while it is led: 20 ms after it is 4 mm behind, to the cycle, all stop. */
static void test_fault_following_error_stops_all_in_time(void)
{
    m_settings.following_error_mm_q16 = 4 * Q16_ONE;
    for (uint8_t axis = 0; axis < 6; axis++) {
        engage();
        send_and_run("@A6:0,0,0,0,0,60#", 100);
        m_rig.drive_config[axis].lag_max_q32 = q32_from_int(1000); /* the drive's own watch would be quicker */
        m_rig.drives.axis[axis].is_frozen = true;
        unsigned far_ms = 0;
        for (unsigned ms = 0; ms < 2000 && seen()->state == STATE_ENGAGED; ms++) {
            rig_run_ms(&m_rig, 1);
            const double off = rig_cylinder_mm(&m_rig, axis + 1u) - (double)seen()->drive[axis].actual_mm_q32 / 4294967296.0;
            far_ms = seen()->state != STATE_ENGAGED ? far_ms : fabs(off) > 4 ? far_ms + 1 : 0;
        }
        expect_fault(FAULT_FOLLOWING, axis + 1u, 0);
        TEST_ASSERT_UINT_WITHIN(2, 20, far_ms);
        expect_quick_stop(axis);
    }
    start(true); /* the frozen drive hears no request and counts its own errors */
}

/* A set-point that its driver did not send: that is heaved's own finding, with how far it was. */
static void test_fault_found_by_the_guard_of_set_points_tells_the_distance(void)
{
    static const struct {
        unsigned axis;
        bool is_jump;
        fault_code_t code;
        const char *line;
    } k_rows[] = {
        {2, false, FAULT_FOLLOWING,
         "a cylinder does not follow its set-points, axis 3: found by heaved, 12.35 mm off, allowed 10.00 mm"},
        {2, true, FAULT_SETPOINT_JUMP,
         "a set-point jumped away from its drive, axis 3: found by heaved, 12.35 mm off, allowed 10.00 mm"},
        {6, true, FAULT_SETPOINT_JUMP,
         "a set-point jumped away from its drive, axis 7: found by heaved, 12.35 deg off, allowed 10.00 deg"},
    };
    for (unsigned i = 0; i < sizeof k_rows / sizeof k_rows[0]; i++) {
        engage();
        make_talkative();
        m_guarded = k_rows[i].axis;
        m_guard = (drive_guard_t){.allowed_q32 = 10 * Q32_ONE};
        *(k_rows[i].is_jump ? &m_guard.jump_q32 : &m_guard.lag_q32) = Q32_ONE * 247 / 20;
        rig_run_ms(&m_rig, 2);
        expect_fault(k_rows[i].code, k_rows[i].axis + 1, 0);
        TEST_ASSERT_EQUAL(FAULT_REACT_QUICK_STOP, seen()->reaction);
        TEST_ASSERT_EQUAL_INT64(Q32_ONE * 247 / 20, seen()->fault.off_q32);
        TEST_ASSERT_EQUAL_INT64(m_guard.allowed_q32, seen()->fault.allowed_q32);
        TEST_ASSERT_EQUAL_UINT32(1, counted()->fault[k_rows[i].code]);
        TEST_ASSERT_EQUAL_UINT32(0, counted()->fault[FAULT_DRIVE]);
        expect_line("a ", k_rows[i].line);
    }
}

/* ---- drives that stand where no cylinder can ---- */

/* Every cylinder at its place, one elsewhere, all without torque. */
static void start_at(unsigned axis, double extension_mm, bool is_homed)
{
    m_settings.engage = ENGAGE_MANUAL;
    start(false);
    for (unsigned i = 0; i < 6; i++) {
        sim_drive_t *drive = &m_rig.drives.axis[i];
        drive->is_homed = is_homed;
        drive->position_q32 = (q32_t)((i == axis ? extension_mm : 20.0) * 4294967296.0);
        drive->setpoint_q32 = drive->position_q32;
    }
    rig_run_ms(&m_rig, 10);
    TEST_ASSERT_EQUAL(STATE_OFF, seen()->state);
}

static void test_engage_with_a_drive_outside_its_stroke_is_refused_before_there_is_torque(void)
{
    const double stroke_mm = m_settings.stroke_mm_q16[4] / 65536.0;
    const double places_mm[] = {-5.5, stroke_mm + 5.5, -30000, 30000};
    for (unsigned i = 0; i < sizeof places_mm / sizeof places_mm[0]; i++) {
        start_at(4, places_mm[i], true);
        TEST_ASSERT_EQUAL(HV_OK, rig_request(&m_rig, EVENT_ENGAGE));
        for (unsigned ms = 0; ms < 50; ms++) {
            rig_run_ms(&m_rig, 1);
            TEST_ASSERT_EQUAL(DRIVE_DISABLED, m_rig.drives.axis[4].state);
        }
        expect_fault(FAULT_OUTSIDE_STROKE, 5, 0);
        TEST_ASSERT_DOUBLE_WITHIN(1e-6, places_mm[i] < 0 ? -places_mm[i] : places_mm[i] - stroke_mm,
                                  (double)seen()->fault.off_q32 / 4294967296.0);
        TEST_ASSERT_EQUAL(HV_OK, rig_request(&m_rig, EVENT_RESET));
        rig_run_ms(&m_rig, 100);
        TEST_ASSERT_EQUAL(STATE_OFF, seen()->state);
        TEST_ASSERT_EQUAL(HV_OK, rig_request(&m_rig, EVENT_PARK)); /* whoever asks, as long as it is so */
        rig_run_ms(&m_rig, 10);
        expect_fault(FAULT_OUTSIDE_STROKE, 5, 0);
        TEST_ASSERT_EQUAL_UINT32(2, counted()->fault[FAULT_OUTSIDE_STROKE]);
    }
    expect_line("a cylinder", "a cylinder stands outside its stroke, says its drive, axis 5: found by heaved, 29800.00 mm off, "
                              "allowed 5.00 mm");
}

/* A stop gives way, a switch is a little off; what a drive without a zero says is no place at all. */
static void test_engage_with_a_drive_a_little_outside_or_without_its_zero_comes_up(void)
{
    const double places_mm[] = {-4.5, 4.5 + m_settings.stroke_mm_q16[4] / 65536.0};
    for (unsigned i = 0; i < 2; i++) {
        start_at(4, places_mm[i], true);
        TEST_ASSERT_EQUAL(HV_OK, rig_request(&m_rig, EVENT_PARK));
        TEST_ASSERT_TRUE(rig_run_until(&m_rig, STATE_SETTLED, 60000));
    }
    start_at(4, 300, false);
    TEST_ASSERT_EQUAL(HV_OK, rig_request(&m_rig, EVENT_PARK));
    TEST_ASSERT_TRUE(rig_run_until(&m_rig, STATE_SETTLED, 60000));
}

/* What a replay is told was found is found, as if the drives had brought it about. */
static void test_fault_told_is_found_in_the_next_cycle(void)
{
    for (unsigned code = FAULT_NONE + 1u; code < FAULT_CODES; code++) {
        const unsigned axis = fault_is_of_axis((fault_code_t)code) ? 5 : 0;
        engage();
        start_moving(150);
        const uint32_t faults = seen()->counters.faults;
        gateway_inject_fault(&m_rig.gateway, (fault_code_t)code, axis == 0 ? 1 : 0); /* it does not go with that axis */
        rig_run_ms(&m_rig, 1);
        TEST_ASSERT_EQUAL(STATE_ENGAGED, seen()->state);
        gateway_inject_fault(&m_rig.gateway, (fault_code_t)code, axis);
        rig_run_ms(&m_rig, 1);
        expect_fault((fault_code_t)code, axis, 0);
        TEST_ASSERT_EQUAL(fault_reaction((fault_code_t)code), seen()->reaction);
        TEST_ASSERT_EQUAL_HEX32(1u << code, seen()->begun[axis]);
        rig_run_ms(&m_rig, 1);
        TEST_ASSERT_EQUAL_HEX32(0, seen()->begun[axis]);
        TEST_ASSERT_EQUAL_UINT32(faults + 1, seen()->counters.faults);
    }
}

static void test_fault_told_that_is_there_counts_once(void)
{
    engage();
    const uint32_t faults = seen()->counters.faults;
    rig_break(&m_rig, SIM_DRIVES_FAULT, 2, 0x2310);
    gateway_inject_fault(&m_rig.gateway, FAULT_DRIVE, 3);
    rig_run_ms(&m_rig, 1);
    expect_fault(FAULT_DRIVE, 3, 0x2310);
    rig_run_ms(&m_rig, 10);
    TEST_ASSERT_EQUAL_UINT32(faults + 1, seen()->counters.faults);
}

static void test_fault_told_in_off_is_none(void)
{
    start(false);
    gateway_inject_fault(&m_rig.gateway, FAULT_BUS, 0);
    gateway_inject_fault(&m_rig.gateway, FAULT_CODES, 0);
    gateway_inject_fault(&m_rig.gateway, FAULT_DRIVE, DRIVES_MAX + 1u);
    TEST_ASSERT_EQUAL(STATE_OFF, seen()->state);
    rig_run_ms(&m_rig, 2);
    TEST_ASSERT_EQUAL_UINT32(0, seen()->counters.faults);
}

/* The first fault is shown, the worst reaction wins. */
static void test_fault_worse_one_later_escalates_and_the_first_is_kept(void)
{
    engage();
    start_moving(150);
    rig_break(&m_rig, SIM_DRIVES_FAULT, 2, 0x2310);
    rig_run_ms(&m_rig, 3);
    rig_break(&m_rig, SIM_DRIVES_OFFLINE, SIM_DRIVES_ALL, 0);
    rig_run_ms(&m_rig, 3);
    expect_fault(FAULT_DRIVE, 3, 0x2310);
    TEST_ASSERT_EQUAL(FAULT_REACT_SILENT, seen()->reaction);
    TEST_ASSERT_EQUAL_UINT32(1, counted()->fault[FAULT_BUS]);
    TEST_ASSERT_TRUE(seen()->fault_last_us[FAULT_BUS] > seen()->fault.at_us);
}

/* The e-stop of one channel has stopped all already; that they disagree is told beside it, and holds a reset back. */
static void test_channels_apart_are_a_fault_in_estop_that_holds_back_a_reset(void)
{
    engage();
    start_moving(200);
    m_rig.inputs.levels = INPUT_ESTOP;
    rig_run_ms(&m_rig, 300);
    TEST_ASSERT_EQUAL(FAULT_NONE, seen()->fault.code);
    m_rig.inputs.levels = INPUT_ESTOP | INPUT_APART;
    rig_run_ms(&m_rig, 1);
    m_is_fault_expected = true;
    TEST_ASSERT_EQUAL(STATE_ESTOP, seen()->state);
    TEST_ASSERT_EQUAL(FAULT_ESTOP_CHANNELS, seen()->fault.code);
    TEST_ASSERT_EQUAL_HEX32(1u << FAULT_ESTOP_CHANNELS, seen()->begun[0]);
    rig_run_ms(&m_rig, 1000);
    TEST_ASSERT_EQUAL_UINT32(1, counted()->faults);
    TEST_ASSERT_EQUAL(HV_ERR_STATE, rig_request(&m_rig, EVENT_RESET));
    m_rig.inputs.levels = 0;
    rig_run_ms(&m_rig, 10);
    TEST_ASSERT_EQUAL(FAULT_ESTOP_CHANNELS, seen()->fault.code); /* latched */
    TEST_ASSERT_EQUAL(HV_OK, rig_request(&m_rig, EVENT_RESET));
    rig_run_ms(&m_rig, 100);
    TEST_ASSERT_EQUAL(STATE_OFF, seen()->state);
    TEST_ASSERT_EQUAL(FAULT_NONE, seen()->fault.code);
    m_rig.inputs.levels = INPUT_ESTOP | INPUT_APART; /* the next one is another one */
    rig_run_ms(&m_rig, 2);
    TEST_ASSERT_EQUAL_UINT32(2, counted()->faults);
}

static void test_power_that_fails_stops_what_is_not_settled_in_time(void)
{
    m_settings.power_settle_ms = 900; /* before the silence of the sender does anything */
    for (unsigned ms = 1; ms < 400; ms += 57) {
        engage();
        start_moving(ms);
        m_rig.inputs.levels = INPUT_POWER;
        rig_run_ms(&m_rig, 900);
        TEST_ASSERT_NOT_EQUAL(STATE_FAULT, seen()->state);
        TEST_ASSERT_TRUE(seen()->is_power_failing);
        rig_run_ms(&m_rig, 2);
        expect_fault(FAULT_POWER, 0, 0);
        TEST_ASSERT_EQUAL(FAULT_REACT_STOP, seen()->reaction);
        rig_run_ms(&m_rig, 3000);
        for (unsigned i = 0; i < 7; i++) {
            TEST_ASSERT_EQUAL(DRIVE_DISABLED, m_rig.drives.axis[i].state);
        }
        TEST_ASSERT_EQUAL_UINT32(1, counted()->fault[FAULT_POWER]);
    }
}

/* Asked before a request that would lead into a fault; the others have their own ways. */
static void test_drives_that_are_not_there_are_told_before_they_are_brought_up(void)
{
    m_settings.engage = ENGAGE_MANUAL;
    start(false);
    TEST_ASSERT_EQUAL_HEX32(0x7F,
                            gateway_absent(&m_rig.gateway, EVENT_ENGAGE)); /* nobody has been heard before the first cycle */
    rig_run_ms(&m_rig, 10);
    TEST_ASSERT_EQUAL_HEX32(0, gateway_absent(&m_rig.gateway, EVENT_ENGAGE));
    rig_break(&m_rig, SIM_DRIVES_OFFLINE, 4, 0);
    rig_break(&m_rig, SIM_DRIVES_OFFLINE, 0, 0);
    rig_run_ms(&m_rig, 100);
    TEST_ASSERT_EQUAL(STATE_OFF, seen()->state);
    TEST_ASSERT_EQUAL_HEX32(0x11, gateway_absent(&m_rig.gateway, EVENT_ENGAGE));
    TEST_ASSERT_EQUAL_HEX32(0x11, gateway_absent(&m_rig.gateway, EVENT_PARK));
    for (event_t other = 0; other < EVENTS; other++) {
        TEST_ASSERT_TRUE(other == EVENT_ENGAGE || other == EVENT_PARK || gateway_absent(&m_rig.gateway, other) == 0);
    }
    rig_break(&m_rig, SIM_DRIVES_RECOVER, SIM_DRIVES_ALL, 0);
    rig_run_ms(&m_rig, 100);
    TEST_ASSERT_EQUAL_HEX32(0, gateway_absent(&m_rig.gateway, EVENT_ENGAGE));
    TEST_ASSERT_EQUAL(HV_OK, rig_request(&m_rig, EVENT_ENGAGE));
    TEST_ASSERT_TRUE(rig_run_until(&m_rig, STATE_ENGAGED, 60000));
    m_is_fault_expected = true;
    rig_break(&m_rig, SIM_DRIVES_OFFLINE, 4, 0);
    rig_run_ms(&m_rig, 100);
    TEST_ASSERT_EQUAL(STATE_FAULT, seen()->state);
    TEST_ASSERT_EQUAL_HEX32(0, gateway_absent(&m_rig.gateway, EVENT_ENGAGE)); /* the state refuses it, in its own words */
}

/* What heaved makes of keys, supply and approvals. */
static void test_what_is_withheld_keeps_the_platform_down_and_leads_it_down(void)
{
    start(false);
    TEST_ASSERT_EQUAL(EVENTS, gateway_withhold(&m_rig.gateway, PERMIT_KEY | PERMIT_SELFTEST));
    TEST_ASSERT_EQUAL_UINT32(PERMIT_KEY | PERMIT_SELFTEST, gateway_missing(&m_rig.gateway, EVENT_ENGAGE));
    TEST_ASSERT_EQUAL_UINT32(PERMIT_KEY, gateway_missing(&m_rig.gateway, EVENT_PARK));
    TEST_ASSERT_EQUAL(HV_ERR_STATE, rig_request(&m_rig, EVENT_ENGAGE));
    TEST_ASSERT_EQUAL(HV_ERR_STATE, rig_request(&m_rig, EVENT_PARK));
    rig_run_ms(&m_rig, 100);
    TEST_ASSERT_EQUAL(STATE_OFF, seen()->state);

    engage();
    TEST_ASSERT_EQUAL_UINT32(0, gateway_missing(&m_rig.gateway, EVENT_HOLD));
    TEST_ASSERT_EQUAL(EVENT_PARK, gateway_withhold(&m_rig.gateway, PERMIT_SUPPLY));
    TEST_ASSERT_EQUAL(EVENTS, gateway_withhold(&m_rig.gateway, PERMIT_SUPPLY)); /* once */
    TEST_ASSERT_EQUAL(HV_OK, rig_request(&m_rig, EVENT_PARK));
    TEST_ASSERT_EQUAL(HV_OK, rig_request(&m_rig, EVENT_HOLD));
    TEST_ASSERT_EQUAL(HV_ERR_STATE, rig_request(&m_rig, EVENT_RESUME));
    TEST_ASSERT_EQUAL(HV_ERR_STATE, rig_request(&m_rig, EVENT_ENGAGE));
    TEST_ASSERT_EQUAL(HV_OK, rig_request(&m_rig, EVENT_PARK)); /* down is always allowed */
    rig_run_ms(&m_rig, 5000);
    TEST_ASSERT_EQUAL(STATE_SETTLED, seen()->state);
    TEST_ASSERT_EQUAL(EVENTS, gateway_withhold(&m_rig.gateway, 0));
    TEST_ASSERT_EQUAL(HV_OK, rig_request(&m_rig, EVENT_ENGAGE));
}

static void test_each_cycle_that_is_too_late_leads_to_a_hold(void)
{
    engage();
    for (unsigned i = 0; i < 3; i++) {
        TEST_ASSERT_EQUAL(EVENT_HOLD, gateway_withhold(&m_rig.gateway, PERMIT_PUNCTUAL));
        TEST_ASSERT_EQUAL(HV_OK, rig_request(&m_rig, EVENT_HOLD));
        TEST_ASSERT_EQUAL(EVENTS, gateway_withhold(&m_rig.gateway, PERMIT_PUNCTUAL)); /* it is on hold already */
        TEST_ASSERT_EQUAL(HV_OK, rig_request(&m_rig, EVENT_RESUME));
        rig_run_ms(&m_rig, 1);
    }
}

static void test_a_shutdown_withholds_by_itself_all_that_is_not_its_own(void)
{
    engage();
    TEST_ASSERT_EQUAL_UINT32(0, gateway_missing(&m_rig.gateway, EVENT_PARK));
    TEST_ASSERT_EQUAL(HV_OK, rig_request(&m_rig, EVENT_SHUTDOWN));
    TEST_ASSERT_EQUAL_UINT32(PERMIT_RUNNING, gateway_missing(&m_rig.gateway, EVENT_PARK));
    TEST_ASSERT_EQUAL_UINT32(PERMIT_RUNNING, gateway_missing(&m_rig.gateway, EVENT_ENGAGE));
    TEST_ASSERT_EQUAL_UINT32(0, gateway_missing(&m_rig.gateway, EVENT_HOLD));
    TEST_ASSERT_EQUAL_UINT32(0, gateway_missing(&m_rig.gateway, EVENT_SHUTDOWN));
}

static void test_power_that_fails_leaves_who_is_down_in_peace(void)
{
    m_settings.power_settle_ms = 100;
    m_settings.engage = ENGAGE_MANUAL;
    start(true);
    rig_run_ms(&m_rig, 10);
    m_rig.inputs.levels = INPUT_POWER;
    rig_run_ms(&m_rig, 10000);
    TEST_ASSERT_EQUAL(STATE_SETTLED, seen()->state);
    m_rig.inputs.levels = 0;
    rig_run_ms(&m_rig, 10);
    TEST_ASSERT_FALSE(seen()->is_power_failing);
    TEST_ASSERT_EQUAL(HV_OK, rig_request(&m_rig, EVENT_ENGAGE));
    rig_run_ms(&m_rig, 500);
    for (unsigned i = 0; i < 5; i++) { /* short failures do not add up */
        m_rig.inputs.levels = INPUT_POWER;
        rig_run_ms(&m_rig, 90);
        m_rig.inputs.levels = 0;
        rig_run_ms(&m_rig, 1);
    }
    TEST_ASSERT_EQUAL_UINT32(0, counted()->faults);
}

/* Every code has its words in both languages, and a reaction. */
static void test_fault_tables_are_complete(void)
{
    start(true);
    for (unsigned code = 1; code < FAULT_CODES; code++) {
        const fault_help_t *help = fault_help((fault_code_t)code);
        const fault_reaction_t reaction = fault_reaction((fault_code_t)code);
        TEST_ASSERT_TRUE(reaction >= FAULT_REACT_STOP && reaction <= FAULT_REACT_SILENT);
        TEST_ASSERT_TRUE(help->name[0] != '\0' && fault_text((fault_code_t)code)[0] != '\0' && help->text_zh[0] != '\0');
        for (unsigned language = 0; language < FAULT_LANGUAGES; language++) {
            TEST_ASSERT_TRUE(help->cause[language][0] != '\0' && help->remedy[language][0] != '\0');
        }
        for (unsigned other = 0; other < code; other++) {
            TEST_ASSERT_TRUE(strcmp(help->name, fault_help((fault_code_t)other)->name) != 0);
        }
    }
    TEST_ASSERT_EQUAL_PTR(fault_help(FAULT_NONE), fault_help(FAULT_CODES));
    TEST_ASSERT_EQUAL_STRING("none", fault_text(FAULT_CODES));
    TEST_ASSERT_EQUAL(FAULT_REACT_NONE, fault_reaction(FAULT_CODES));
    TEST_ASSERT_EQUAL_STRING("silent", fault_reaction_name(FAULT_REACT_SILENT));
    TEST_ASSERT_EQUAL_STRING("?", fault_reaction_name((fault_reaction_t)(FAULT_REACT_SILENT + 1)));
}

static void test_fault_bus_gone_is_a_fault_that_can_be_reset(void)
{
    engage();
    start_moving(150);
    rig_break(&m_rig, SIM_DRIVES_OFFLINE, SIM_DRIVES_ALL, 0);
    rig_run_ms(&m_rig, 500);
    expect_fault(FAULT_BUS, 0, 0);
    rig_break(&m_rig, SIM_DRIVES_RECOVER, SIM_DRIVES_ALL, 0);
    rig_run_ms(&m_rig, 10);
    TEST_ASSERT_EQUAL(HV_OK, rig_request(&m_rig, EVENT_RESET));
    rig_run_ms(&m_rig, 10);
    TEST_ASSERT_EQUAL(HV_OK, rig_request(&m_rig, EVENT_ENGAGE));
    TEST_ASSERT_TRUE(rig_run_until(&m_rig, STATE_ENGAGED, 60000));
}

/* The drives still hear: all come to rest together within every limit, and lose their torque then, not before. */
static void test_fault_bus_failing_is_a_controlled_stop(void)
{
    for (unsigned ms = 10; ms < 500; ms += 35) {
        engage();
        start_moving(ms);
        rig_check_reset(&m_rig);
        m_rig.is_failing = true;
        rig_run_ms(&m_rig, 1);
        expect_fault(FAULT_BUS_FAILING, 0, 0);
        TEST_ASSERT_EQUAL(FAULT_REACT_STOP, seen()->reaction);
        while (m_rig.drives.axis[0].state == DRIVE_ENABLED) {
            const double before = rig_cylinder_mm(&m_rig, 1);
            rig_run_ms(&m_rig, 1);
            TEST_ASSERT_TRUE(m_rig.drives.axis[0].state == DRIVE_ENABLED || fabs(rig_cylinder_mm(&m_rig, 1) - before) < 1e-3);
            TEST_ASSERT_TRUE(seen()->now_us - seen()->fault.at_us < 1000000);
        }
        TEST_ASSERT_TRUE(rig_is_within_limits(&m_rig));
        TEST_ASSERT_EQUAL_UINT(0, rig_following_errors(&m_rig));
        for (unsigned i = 0; i < 7; i++) {
            TEST_ASSERT_EQUAL(DRIVE_DISABLED, m_rig.drives.axis[i].state);
        }
        TEST_ASSERT_EQUAL_UINT32(1, counted()->fault[FAULT_BUS_FAILING]);
    }
}

static void test_fault_bus_failing_is_latched_until_it_has_recovered(void)
{
    engage();
    m_rig.is_failing = true;
    rig_run_ms(&m_rig, 1000);
    TEST_ASSERT_EQUAL(HV_OK, rig_request(&m_rig, EVENT_RESET));
    rig_run_ms(&m_rig, 3000);
    TEST_ASSERT_TRUE(rig_was_logged(&m_rig, "reset refused"));
    expect_fault(FAULT_BUS_FAILING, 0, 0);
    m_rig.is_failing = false;
    rig_run_ms(&m_rig, 10);
    expect_fault(FAULT_BUS_FAILING, 0, 0);
    TEST_ASSERT_EQUAL(HV_OK, rig_request(&m_rig, EVENT_RESET));
    rig_run_ms(&m_rig, 10);
    TEST_ASSERT_EQUAL(STATE_OFF, seen()->state);
    m_rig.is_failing = true; /* while nobody is on it: said as soon as somebody wants to */
    rig_run_ms(&m_rig, 10);
    TEST_ASSERT_EQUAL(STATE_OFF, seen()->state);
    TEST_ASSERT_EQUAL(HV_OK, rig_request(&m_rig, EVENT_ENGAGE));
    rig_run_ms(&m_rig, 2);
    expect_fault(FAULT_BUS_FAILING, 0, 0);
}

static void test_fault_drives_that_never_enable_time_out(void)
{
    start(false);
    for (unsigned i = 0; i < 7; i++) {
        m_rig.drive_config[i].enable_us = 60000000;
    }
    TEST_ASSERT_TRUE(rig_run_until(&m_rig, STATE_FAULT, 12000));
    expect_fault(FAULT_DRIVE_TIMEOUT, 0, 0);
}

static void test_fault_in_every_phase_of_coming_up_latches(void)
{
    m_is_fault_expected = true;
    for (unsigned ms = 3; ms < 14000; ms += 491) {
        start(false);
        rig_run_ms(&m_rig, ms);
        rig_break(&m_rig, SIM_DRIVES_FAULT, 3, 0x1234);
        rig_run_ms(&m_rig, 1000);
        expect_fault(FAULT_DRIVE, 4, 0x1234);
        TEST_ASSERT_EQUAL(DRIVE_DISABLED, m_rig.drives.axis[0].state);
        TEST_ASSERT_EQUAL_UINT(0, rig_following_errors(&m_rig));
        TEST_ASSERT_EQUAL(HV_OK, rig_request(&m_rig, EVENT_RESET));
        rig_run_ms(&m_rig, 10);
        TEST_ASSERT_EQUAL(HV_OK, rig_request(&m_rig, EVENT_ENGAGE));
        TEST_ASSERT_TRUE(rig_run_until(&m_rig, STATE_ENGAGED, 60000));
        TEST_ASSERT_TRUE(rig_is_within_limits(&m_rig));
    }
}

/* ---- hold, resume, shutdown ---- */

static void test_hold_during_coming_up_stops_and_resume_goes_on(void)
{
    for (unsigned ms = 5; ms < 9000; ms += 233) {
        start(false);
        rig_run_ms(&m_rig, ms);
        TEST_ASSERT_EQUAL(HV_OK, rig_request(&m_rig, EVENT_HOLD));
        rig_run_ms(&m_rig, ms % 3 == 0 ? 20 : 1500); /* sometimes while it still slows down */
        TEST_ASSERT_EQUAL(STATE_HOLD, seen()->state);
        for (unsigned i = 0; i < 7; i++) {
            TEST_ASSERT_TRUE(m_rig.drives.axis[i].state != DRIVE_HOMING);
        }
        TEST_ASSERT_EQUAL(HV_OK, rig_request(&m_rig, EVENT_RESUME));
        TEST_ASSERT_TRUE(rig_run_until(&m_rig, STATE_ENGAGED, 60000));
        TEST_ASSERT_TRUE(rig_is_within_limits(&m_rig));
        TEST_ASSERT_EQUAL_UINT(0, rig_following_errors(&m_rig));
    }
}

static void shut_down_after(unsigned ms)
{
    (void)!rig_request(&m_rig, EVENT_SHUTDOWN);
    rig_run_ms(&m_rig, 2);
    TEST_ASSERT_EQUAL(HV_ERR_STATE, rig_request(&m_rig, EVENT_ENGAGE));
    for (unsigned t = 0; t < 60000 && !gateway_is_finished(&m_rig.gateway); t++) {
        rig_run_ms(&m_rig, 1);
    }
    char text[64];
    snprintf(text, sizeof text, "after %u ms: %s", ms, state_name(seen()->state));
    TEST_ASSERT_TRUE_MESSAGE(gateway_is_finished(&m_rig.gateway), text);
    TEST_ASSERT_EQUAL_MESSAGE(STATE_OFF, seen()->state, text);
    rig_run_ms(&m_rig, 5);
    for (unsigned i = 0; i < 7; i++) {
        TEST_ASSERT_EQUAL_MESSAGE(DRIVE_DISABLED, m_rig.drives.axis[i].state, text);
    }
    TEST_ASSERT_TRUE(rig_is_within_limits(&m_rig));
    TEST_ASSERT_EQUAL_UINT(0, rig_following_errors(&m_rig));
}

static void test_shutdown_from_every_moment_ends_in_off(void)
{
    for (unsigned ms = 0; ms < 16000; ms += 397) {
        start(false);
        rig_run_ms(&m_rig, ms);
        rig_send(&m_rig, "@A6:5,-4,3,10,20,30#");
        rig_run_ms(&m_rig, 130);
        if (ms % 2 == 0) {
            (void)!rig_request(&m_rig, EVENT_HOLD);
            rig_run_ms(&m_rig, ms % 300);
        }
        shut_down_after(ms);
    }
}

/* Homing takes seconds, here and minutes elsewhere: nobody waits for its end, and no drive goes on with it. */
static void test_shutdown_while_the_drives_come_up_ends_at_once(void)
{
    unsigned homing = 0;
    for (unsigned ms = 1; ms < 4000; ms += 113) {
        start(false);
        rig_run_ms(&m_rig, ms);
        const bool is_homing = m_rig.drives.axis[0].state == DRIVE_HOMING;
        const bool is_enabling = m_rig.drives.axis[0].state == DRIVE_ENABLING;
        if (seen()->state != STATE_HOMING || !(is_homing || is_enabling)) {
            continue;
        }
        homing += is_homing;
        TEST_ASSERT_EQUAL(HV_OK, rig_request(&m_rig, EVENT_SHUTDOWN));
        rig_run_ms(&m_rig, 1);
        const q32_t stopped_q32 = m_rig.drives.axis[0].position_q32;
        rig_run_ms(&m_rig, 4);
        TEST_ASSERT_TRUE(gateway_is_finished(&m_rig.gateway));
        TEST_ASSERT_EQUAL(STATE_OFF, seen()->state);
        for (unsigned i = 0; i < 7; i++) {
            TEST_ASSERT_EQUAL(DRIVE_DISABLED, m_rig.drives.axis[i].state);
        }
        TEST_ASSERT_EQUAL_INT64(stopped_q32, m_rig.drives.axis[0].position_q32);
        TEST_ASSERT_TRUE(rig_was_logged(&m_rig, "HOMING -> HOLD"));
    }
    TEST_ASSERT_GREATER_THAN_UINT(3, homing);
}

/* A drive that does not obey, and a bus that takes nothing: bounded all the same. */
static void test_shutdown_while_a_drive_homes_for_ever_is_bounded(void)
{
    static const struct {
        sim_drives_fault_kind_t kind;
        unsigned most_ms;
    } k_cases[] = {{SIM_DRIVES_FREEZE, 9010}, {SIM_DRIVES_BUSY, 1200}};
    for (unsigned n = 0; n < 2; n++) {
        start(false);
        while (m_rig.drives.axis[2].state != DRIVE_HOMING) {
            rig_run_ms(&m_rig, 1);
        }
        rig_break(&m_rig, k_cases[n].kind, 2, 0);
        TEST_ASSERT_EQUAL(HV_OK, rig_request(&m_rig, EVENT_SHUTDOWN));
        rig_run_ms(&m_rig, k_cases[n].most_ms);
        TEST_ASSERT_TRUE(gateway_is_finished(&m_rig.gateway));
        TEST_ASSERT_EQUAL(HV_ERR_STATE, rig_request(&m_rig, EVENT_ENGAGE));
    }
    m_is_fault_expected = true;
}

/* The operator may stop it on its way down; then it is neither brought down nor dropped until somebody says so. */
static void test_shutdown_can_be_held_and_asked_for_again(void)
{
    engage();
    send_and_run("@A6:0,0,0,0,0,40#", 2000);
    TEST_ASSERT_EQUAL(HV_OK, rig_request(&m_rig, EVENT_SHUTDOWN));
    rig_run_ms(&m_rig, 500);
    TEST_ASSERT_EQUAL(STATE_SETTLING, seen()->state);
    TEST_ASSERT_EQUAL(HV_OK, rig_request(&m_rig, EVENT_HOLD));
    rig_run_ms(&m_rig, 1000);
    TEST_ASSERT_EQUAL_DOUBLE(0, biggest_move(4000));
    TEST_ASSERT_EQUAL(STATE_HOLD, seen()->state);
    TEST_ASSERT_EQUAL(DRIVE_ENABLED, m_rig.drives.axis[0].state);
    TEST_ASSERT_FALSE(gateway_is_finished(&m_rig.gateway));
    shut_down_after(0);
}

static void test_shutdown_in_fault_and_estop_is_finished_at_rest(void)
{
    engage();
    start_moving(100);
    rig_break(&m_rig, SIM_DRIVES_FAULT, 0, 1);
    rig_run_ms(&m_rig, 1);
    TEST_ASSERT_FALSE(gateway_is_finished(&m_rig.gateway)); /* nobody has asked for an end */
    (void)!rig_request(&m_rig, EVENT_SHUTDOWN);
    rig_run_ms(&m_rig, 1);
    TEST_ASSERT_TRUE(gateway_is_finished(&m_rig.gateway));
    m_is_fault_expected = true;
    engage();
    sim_inputs_set(&m_rig.inputs, INPUT_ESTOP, true);
    rig_run_ms(&m_rig, 1);
    (void)!rig_request(&m_rig, EVENT_SHUTDOWN);
    rig_run_ms(&m_rig, 1);
    TEST_ASSERT_TRUE(gateway_is_finished(&m_rig.gateway));
}

static void test_late_cycles_never_count_from_zero_again(void)
{
    gateway_note_late(&m_rig.gateway, UINT32_MAX - 1);
    gateway_note_late(&m_rig.gateway, 1);
    TEST_ASSERT_EQUAL_UINT32(UINT32_MAX, seen()->counters.late_cycles);
    gateway_note_late(&m_rig.gateway, UINT32_MAX);
    TEST_ASSERT_EQUAL_UINT32(UINT32_MAX, seen()->counters.late_cycles);
}

static void test_telemetry_actual_speed_is_that_of_the_plate(void)
{
    engage();
    TEST_ASSERT_TRUE(seen()->plate.has_rates);
    send_and_run("@A6T:0,0,0,0,0,60,2000#", 1000);
    const double before_mm = rig_pose(&m_rig, AXIS_Z);
    rig_run_ms(&m_rig, 20);
    const double speed_mm_s = (rig_pose(&m_rig, AXIS_Z) - before_mm) / 0.02; /* half-way the speed is at its largest and steady */
    TEST_ASSERT_TRUE(speed_mm_s > 30);
    TEST_ASSERT_TRUE(seen()->plate.has_rates);
    TEST_ASSERT_DOUBLE_WITHIN(0.02 * speed_mm_s, speed_mm_s, (double)seen()->plate.speed_per_s.axis_q32[AXIS_Z] / 4294967296.0);
    TEST_ASSERT_DOUBLE_WITHIN(0.01, 0, (double)seen()->plate.speed_per_s.axis_q32[AXIS_ROLL] / 4294967296.0);
    TEST_ASSERT_DOUBLE_WITHIN(10, 0, (double)seen()->plate.accel_per_s2.axis_q32[AXIS_Z] / 4294967296.0);
    rig_run_ms(&m_rig, 2000);
    TEST_ASSERT_DOUBLE_WITHIN(0.01, 0, (double)seen()->plate.speed_per_s.axis_q32[AXIS_Z] / 4294967296.0);
}

static void test_telemetry_actual_pose_follows_the_feedback(void)
{
    engage();
    send_and_run("@A6:5,-4,3,10,20,30#", 3000);
    TEST_ASSERT_TRUE(seen()->plate.has_pose);
    for (unsigned i = 0; i < POSE_AXES; i++) {
        TEST_ASSERT_INT64_WITHIN(Q32_ONE / 1000, seen()->sent.axis_q32[i], seen()->plate.pose.axis_q32[i]);
    }
    gateway_note_late(&m_rig.gateway, 3);
    rig_run_ms(&m_rig, 1);
    TEST_ASSERT_EQUAL_UINT32(3, counted()->late_cycles);
}

static void test_telemetry_reports_of_drives_are_logged_once_with_what_they_name(void)
{
    engage();
    make_talkative();
    m_reports = (drive_report_t){.address = 12,
                                 .phase = "configuring",
                                 .trouble = "refused",
                                 .code = 0x31,
                                 .object = 0x608100,
                                 .detail = "no such object",
                                 .detail_code = 0x6020000,
                                 .since_us = 1};
    rig_run_ms(&m_rig, 5);
    TEST_ASSERT_TRUE(
        rig_was_logged(&m_rig, "axis 2, node 12, configuring: refused (0x0031), object 6081:00: no such object (0x6020000)"));
    TEST_ASSERT_FALSE(rig_was_logged(&m_rig, "axis 2"));
    m_reports = (drive_report_t){.address = 12, .phase = "ready", .trouble = "", .detail = ""};
    rig_run_ms(&m_rig, 5);
    TEST_ASSERT_TRUE(rig_was_logged(&m_rig, "axis 2, node 12, ready"));
    m_reports = (drive_report_t){.address = 12,
                                 .phase = "refused",
                                 .trouble = "not taken",
                                 .code = 0x33,
                                 .object = 0x60C201,
                                 .detail = "it holds another value",
                                 .has_found = true,
                                 .found = 10,
                                 .wanted = 4};
    rig_run_ms(&m_rig, 5);
    TEST_ASSERT_TRUE(rig_was_logged(
        &m_rig, "axis 2, node 12, refused: not taken (0x0033), object 60C2:01: it holds another value, found 0xA, wanted 0x4"));
    m_reports = (drive_report_t){.is_modbus = true,
                                 .address = 3,
                                 .phase = "missing",
                                 .trouble = "no answer",
                                 .code = 0x32,
                                 .object = 0x10200,
                                 .detail = ""};
    rig_run_ms(&m_rig, 5);
    TEST_ASSERT_TRUE(rig_was_logged(&m_rig, "axis 2, unit 3, missing: no answer (0x0032), register 0x0102"));
}

/* The drive is back, or off again: what it was stays until the reset. */
static void test_fault_keeps_what_its_drive_said(void)
{
    engage();
    make_talkative();
    m_reports = (drive_report_t){.address = 12,
                                 .phase = "lost",
                                 .trouble = "started again",
                                 .detail = "under-voltage",
                                 .code = 0x10005,
                                 .object = 0x606000,
                                 .detail_code = 0x3220};
    rig_break(&m_rig, SIM_DRIVES_OFFLINE, 1, 0);
    rig_run_ms(&m_rig, 20);
    TEST_ASSERT_TRUE(seen()->fault.axis == 2 && seen()->fault.device_code != 0);
    m_reports = (drive_report_t){.address = 12, .phase = "ready", .trouble = "", .detail = ""};
    rig_break(&m_rig, SIM_DRIVES_RECOVER, 1, 0);
    rig_run_ms(&m_rig, 500);
    TEST_ASSERT_EQUAL(STATE_FAULT, seen()->state);
    TEST_ASSERT_EQUAL_STRING("started again", seen()->fault_report.trouble);
    TEST_ASSERT_EQUAL_STRING("under-voltage", seen()->fault_report.detail);
    TEST_ASSERT_EQUAL_HEX32(0x606000, seen()->fault_report.object);
    TEST_ASSERT_EQUAL(HV_OK, rig_request(&m_rig, EVENT_RESET));
    rig_run_ms(&m_rig, 500);
    TEST_ASSERT_EQUAL(STATE_OFF, seen()->state);
    TEST_ASSERT_EQUAL_STRING("", seen()->fault_report.trouble);
    m_is_fault_expected = true;
}

/* A drive that boots for ever. */
static void test_telemetry_reports_that_come_and_go_are_told_of_less_often(void)
{
    const drive_report_t bad = {.address = 12, .phase = "missing", .trouble = "no answer", .detail = "", .code = 0x31};
    const drive_report_t good = {.address = 12, .phase = "ready", .trouble = "", .detail = ""};
    unsigned lines = 0;
    engage();
    make_talkative();
    for (unsigned i = 0; i < 200; i++) {
        m_reports = i % 2 == 0 ? bad : good;
        rig_run_ms(&m_rig, 100);
        lines += rig_was_logged(&m_rig, "axis 2, node 12, ");
    }
    TEST_ASSERT_TRUE(lines >= 5 && lines <= 7);
    m_reports = bad;
    rig_run_ms(&m_rig, 10500);
    TEST_ASSERT_TRUE(rig_was_logged(&m_rig, "axis 2, node 12, missing: no answer (0x0031); "));
    rig_run_ms(&m_rig, 60000);
    TEST_ASSERT_FALSE(rig_was_logged(&m_rig, "axis 2"));
}

static void test_telemetry_notes_of_drives_are_logged_when_they_change(void)
{
    engage();
    make_talkative();
    m_reports = (drive_report_t){.address = 12, .phase = "enabled", .trouble = "", .detail = "", .notes = 0x30};
    rig_run_ms(&m_rig, 5);
    TEST_ASSERT_TRUE(rig_was_logged(&m_rig, "axis 2, node 12: is at a limit of its own; warns"));
    TEST_ASSERT_EQUAL_HEX32(0x30, seen()->report[1].notes);
    rig_run_ms(&m_rig, 5);
    TEST_ASSERT_FALSE(rig_was_logged(&m_rig, "axis 2"));
    m_reports.notes = 0;
    rig_run_ms(&m_rig, 5);
    TEST_ASSERT_TRUE(rig_was_logged(&m_rig, "axis 2, node 12: nothing to tell of any more"));
    TEST_ASSERT_EQUAL_STRING("", drive_note_text(DRIVE_NOTES));
}

static void test_telemetry_errors_of_drives_are_logged_once_a_second(void)
{
    engage();
    make_talkative();
    m_reports =
        (drive_report_t){.address = 12,
                         .phase = "enabled",
                         .trouble = "",
                         .detail = "",
                         .error = "too hot",
                         .emergency = {.at_us = 1, .count = 1, .code = 0x4310, .error_register = 9, .maker = {0xAB, 0, 0, 0, 1}}};
    rig_run_ms(&m_rig, 5);
    TEST_ASSERT_TRUE(
        rig_was_logged(&m_rig, "axis 2, node 12: error 0x4310, too hot; register 0x09, manufacturer AB 00 00 00 01"));
    m_reports.emergency.count = 201;
    rig_run_ms(&m_rig, 500);
    TEST_ASSERT_FALSE(rig_was_logged(&m_rig, "axis 2"));
    rig_run_ms(&m_rig, 600);
    TEST_ASSERT_TRUE(rig_was_logged(&m_rig, "manufacturer AB 00 00 00 01; the last of 200"));
    rig_run_ms(&m_rig, 2000);
    TEST_ASSERT_FALSE(rig_was_logged(&m_rig, "axis 2"));
}

static unsigned cycles_until(state_t state)
{
    unsigned cycles = 0;
    while (seen()->state != state) {
        rig_run_ms(&m_rig, 1);
        TEST_ASSERT_LESS_THAN_UINT(200000, ++cycles);
    }
    return cycles;
}

/* The way down takes as long as ever: it ends a motion, and the service manager waits for it. */
static void test_rise_percent_slows_what_goes_up_and_nothing_else(void)
{
    static const unsigned k_percent[] = {100, 10};
    unsigned up[2], down[2];
    engage();
    TEST_ASSERT_EQUAL(HV_ERR_RANGE, gateway_set_rise_percent(&m_rig.gateway, 0));
    TEST_ASSERT_EQUAL(HV_ERR_RANGE, gateway_set_rise_percent(&m_rig.gateway, 101));
    for (unsigned i = 0; i < 2; i++) {
        TEST_ASSERT_EQUAL(HV_OK, gateway_set_rise_percent(&m_rig.gateway, k_percent[i]));
        TEST_ASSERT_EQUAL(HV_OK, gateway_request(&m_rig.gateway, EVENT_PARK, m_rig.now_us));
        down[i] = cycles_until(STATE_SETTLED);
        TEST_ASSERT_EQUAL(HV_OK, gateway_request(&m_rig.gateway, EVENT_ENGAGE, m_rig.now_us));
        up[i] = cycles_until(STATE_ENGAGED);
    }
    TEST_ASSERT_TRUE(rig_was_logged(&m_rig, "rises at 10 % of engage speed"));
    TEST_ASSERT_UINT_WITHIN(1, down[0], down[1]);
    TEST_ASSERT_GREATER_THAN_UINT(up[0] * 5, up[1]);
    TEST_ASSERT_LESS_THAN_UINT(up[0] * 21 / 2, up[1]);
}

static void test_intensity_is_taken_within_its_range_and_told(void)
{
    m_settings.intensity_max_percent = 80;
    m_settings.intensity_start_percent = 80;
    engage();
    TEST_ASSERT_EQUAL(HV_ERR_RANGE, gateway_set_intensity(&m_rig.gateway, 81));
    rig_run_ms(&m_rig, 1);
    TEST_ASSERT_EQUAL_UINT8(80, seen()->intensity_percent);
    TEST_ASSERT_FALSE(rig_was_logged(&m_rig, "intensity"));
    TEST_ASSERT_EQUAL(HV_OK, gateway_set_intensity(&m_rig.gateway, 50));
    send_and_run("@A6:0,0,0,0,0,40#", 4000);
    TEST_ASSERT_EQUAL_UINT8(50, seen()->intensity_percent);
    TEST_ASSERT_TRUE(rig_was_logged(&m_rig, "intensity 50 %"));
    assert_heights(20);
}

/* ---- an end on a bus that takes nothing ---- */

static void test_shutdown_on_a_bus_that_takes_nothing_ends_all_the_same(void)
{
    m_is_fault_expected = true;
    engage();
    rig_break(&m_rig, SIM_DRIVES_BUSY, 0, 0);
    TEST_ASSERT_EQUAL(HV_OK, rig_request(&m_rig, EVENT_SHUTDOWN));
    rig_run_ms(&m_rig, 50);
    TEST_ASSERT_FALSE(gateway_is_finished(&m_rig.gateway));
    rig_run_ms(&m_rig, 1000);
    TEST_ASSERT_EQUAL(STATE_FAULT, seen()->state);
    TEST_ASSERT_FALSE(gateway_is_finished(&m_rig.gateway)); /* a bus may come back */
    rig_run_ms(&m_rig, 100);
    TEST_ASSERT_TRUE(gateway_is_finished(&m_rig.gateway));
    TEST_ASSERT_TRUE(rig_was_logged(&m_rig, "not confirmed that the torque is off: axis 1, 2, 3, 4, 5, 6, 7"));
}

/* Off already, but the drives have not been told: that is waited for, as long as there is hope. */
static void test_shutdown_from_settled_waits_until_the_bus_has_taken_it(void)
{
    for (unsigned busy_ms = 20; busy_ms <= 2000; busy_ms += 1980) {
        m_settings.engage = ENGAGE_MANUAL;
        start(true);
        rig_run_ms(&m_rig, 10);
        rig_break(&m_rig, SIM_DRIVES_BUSY, 0, 0);
        TEST_ASSERT_EQUAL(HV_OK, rig_request(&m_rig, EVENT_SHUTDOWN));
        rig_run_ms(&m_rig, busy_ms);
        TEST_ASSERT_EQUAL(STATE_OFF, seen()->state);
        TEST_ASSERT_EQUAL(DRIVE_ENABLED, m_rig.drives.axis[0].state);
        TEST_ASSERT_EQUAL(busy_ms > 1100, gateway_is_finished(&m_rig.gateway)); /* the drives' own watch has to stop them */
        rig_break(&m_rig, SIM_DRIVES_RECOVER, SIM_DRIVES_ALL, 0);
        rig_run_ms(&m_rig, 2);
        TEST_ASSERT_EQUAL(STATE_OFF, seen()->state); /* drives that are still enabled do not bring it up again */
        TEST_ASSERT_EQUAL(DRIVE_DISABLED, m_rig.drives.axis[0].state);
        TEST_ASSERT_TRUE(gateway_is_finished(&m_rig.gateway));
    }
}

/* ---- an end that drives do not confirm ---- */

static void settled_with_a_frozen_drive(unsigned axis)
{
    m_settings.engage = ENGAGE_MANUAL;
    start(true);
    rig_run_ms(&m_rig, 10);
    TEST_ASSERT_EQUAL_HEX32(0x7F, gateway_energized(&m_rig.gateway));
    rig_break(&m_rig, SIM_DRIVES_FREEZE, axis, 0);
    TEST_ASSERT_FALSE(gateway_is_finished(&m_rig.gateway));
}

static void test_end_waits_until_each_drive_has_confirmed_and_no_longer(void)
{
    for (unsigned late_ms = 0; late_ms < 3000; late_ms += 700) {
        settled_with_a_frozen_drive(5);
        if (late_ms == 0) {
            rig_break(&m_rig, SIM_DRIVES_RECOVER, SIM_DRIVES_ALL, 0);
        }
        TEST_ASSERT_EQUAL(HV_OK, rig_request(&m_rig, EVENT_SHUTDOWN));
        rig_run_ms(&m_rig, 1);
        TEST_ASSERT_EQUAL(STATE_OFF, seen()->state);
        TEST_ASSERT_FALSE(gateway_is_finished(&m_rig.gateway)); /* asked, not answered */
        for (unsigned t = 0; t < late_ms; t++) {
            rig_run_ms(&m_rig, 1);
            TEST_ASSERT_EQUAL_HEX32(0x20, gateway_energized(&m_rig.gateway));
            TEST_ASSERT_FALSE(gateway_is_finished(&m_rig.gateway));
        }
        rig_break(&m_rig, SIM_DRIVES_RECOVER, SIM_DRIVES_ALL, 0);
        m_rig.drives.axis[5].state = DRIVE_DISABLED; /* what it was told is only now obeyed */
        rig_run_ms(&m_rig, 1);
        TEST_ASSERT_TRUE(gateway_is_finished(&m_rig.gateway));
        TEST_ASSERT_EQUAL_HEX32(0, gateway_energized(&m_rig.gateway));
        TEST_ASSERT_FALSE(rig_was_logged(&m_rig, "not confirmed"));
    }
}

static void test_end_names_the_drive_that_does_not_confirm(void)
{
    settled_with_a_frozen_drive(2);
    TEST_ASSERT_EQUAL(HV_OK, rig_request(&m_rig, EVENT_SHUTDOWN));
    rig_run_ms(&m_rig, 6000);
    TEST_ASSERT_FALSE(gateway_is_finished(&m_rig.gateway));
    TEST_ASSERT_FALSE(rig_was_logged(&m_rig, "not confirmed"));
    rig_run_ms(&m_rig, 1);
    TEST_ASSERT_TRUE(gateway_is_finished(&m_rig.gateway));
    TEST_ASSERT_TRUE(rig_was_logged(&m_rig, "not confirmed that the torque is off: axis 3"));
    TEST_ASSERT_EQUAL_HEX32(0x04, gateway_energized(&m_rig.gateway));
    rig_run_ms(&m_rig, 10);
    TEST_ASSERT_FALSE(rig_was_logged(&m_rig, "not confirmed")); /* said once */
}

/* Its time begins when it is told. */
static void test_end_begins_when_the_drives_are_told(void)
{
    settled_with_a_frozen_drive(2);
    rig_break(&m_rig, SIM_DRIVES_BUSY, SIM_DRIVES_ALL, 0);
    TEST_ASSERT_EQUAL(HV_OK, rig_request(&m_rig, EVENT_SHUTDOWN));
    rig_run_ms(&m_rig, 80);
    m_rig.drives.is_busy = false;
    rig_run_ms(&m_rig, 6000);
    TEST_ASSERT_FALSE(gateway_is_finished(&m_rig.gateway));
    TEST_ASSERT_EQUAL(DRIVE_DISABLED, m_rig.drives.axis[0].state);
    rig_run_ms(&m_rig, 3);
    TEST_ASSERT_TRUE(gateway_is_finished(&m_rig.gateway));
}

/* Lost while it was under torque: nobody knows. Lost without: there is nothing to wait for. */
static void test_end_does_not_wait_for_long_for_a_drive_that_is_lost(void)
{
    m_is_fault_expected = true;
    engage();
    rig_break(&m_rig, SIM_DRIVES_OFFLINE, 6, 0);
    rig_run_ms(&m_rig, 5000);
    TEST_ASSERT_EQUAL(STATE_FAULT, seen()->state);
    TEST_ASSERT_EQUAL(HV_OK, rig_request(&m_rig, EVENT_SHUTDOWN));
    rig_run_ms(&m_rig, 1000);
    TEST_ASSERT_FALSE(gateway_is_finished(&m_rig.gateway));
    rig_run_ms(&m_rig, 1);
    TEST_ASSERT_TRUE(gateway_is_finished(&m_rig.gateway));
    TEST_ASSERT_TRUE(rig_was_logged(&m_rig, "not confirmed that the torque is off: axis 7"));
    m_settings.engage = ENGAGE_MANUAL;
    start(false);
    rig_run_ms(&m_rig, 10);
    rig_break(&m_rig, SIM_DRIVES_OFFLINE, 6, 0);
    TEST_ASSERT_EQUAL(HV_OK, rig_request(&m_rig, EVENT_SHUTDOWN));
    rig_run_ms(&m_rig, 1);
    TEST_ASSERT_TRUE(gateway_is_finished(&m_rig.gateway));
}

/* ---- what a take-over cannot follow ---- */

/* During a take-over only the blend bounds what extensions ask for. A timed move after a jump in a stream was planned from a
 * speed that no cylinder has, and took hours, in which silence did not count. */
static void test_takeover_timed_move_after_a_jump_of_extensions_ends_in_time(void)
{
    m_settings.silence_hold_ms = 1000;
    m_settings.blend_ms = 2500;
    start(true);
    TEST_ASSERT_TRUE(rig_run_until(&m_rig, STATE_ENGAGED, 20000));
    for (unsigned i = 0; i < 112; i++) {
        const int a = i < 110 ? 100 : 10;
        rig_sendf(&m_rig, "@C6:%d,%d,%d,%d,%d,%d#", a, 200 - a, a, 200 - a, a, 200 - a);
        rig_run_ms(&m_rig, 10);
    }
    TEST_ASSERT_BITS_HIGH(MOTION_TAKEOVER, seen()->flags);
    rig_send(&m_rig, "@C6T:60,60,60,60,60,60,500#");
    rig_run_ms(&m_rig, 500);
    TEST_ASSERT_TRUE(motion_timed_end_us(&m_rig.gateway.motion) < m_rig.now_us + 20000000);
    TEST_ASSERT_TRUE(rig_run_until(&m_rig, STATE_HOLD, 20000));
    for (unsigned i = 0; i < 6; i++) {
        TEST_ASSERT_DOUBLE_WITHIN(1e-6, 60, seen()->extension_mm_q32[i] / 4294967296.0);
    }
}

/* ---- what was saved ---- */

/* Half a second of a ride, with a move at its end. */
static void ride_on(void)
{
    for (unsigned i = 0; i < 30; i++) {
        rig_sendf(&m_rig, "@A6:0,0,0,0,0,%u#", i < 15 ? i : 30 - i);
        rig_run_ms(&m_rig, 16);
    }
    rig_send(&m_rig, "@A6T:1,2,0,3,4,-5,600#");
    rig_run_ms(&m_rig, 20);
}

static void test_resume_goes_on_as_what_was_saved(void)
{
    static gateway_t saved, other;
    static rig_t then;
    engage();
    for (unsigned moment = 0; moment < 8; moment++) { /* at rest, and in a move */
        then = m_rig;
        TEST_ASSERT_EQUAL(EVENTS, gateway_withhold(&m_rig.gateway, PERMIT_APPROVAL)); /* a replay knows of none */
        gateway_save(&m_rig.gateway, &saved);
        TEST_ASSERT_NULL(saved.io.drives.ctx);
        ride_on();
        const snapshot_t expected = *seen();
        m_rig = then;
        TEST_ASSERT_EQUAL(HV_OK, gateway_init(&other, &m_settings, &m_rig.gateway.io));
        gateway_resume(&other, &saved);
        TEST_ASSERT_EQUAL_UINT32(0, gateway_missing(&other, EVENT_ENGAGE));
        TEST_ASSERT_EQUAL_STRING("", other.snapshot.report[0].phase);
        m_rig.gateway = other;
        ride_on();
        TEST_ASSERT_EQUAL_MEMORY(&expected.sent, &seen()->sent, sizeof expected.sent);
        TEST_ASSERT_EQUAL_MEMORY(expected.extension_mm_q32, seen()->extension_mm_q32, sizeof expected.extension_mm_q32);
        TEST_ASSERT_EQUAL_MEMORY(&expected.counters, &seen()->counters, sizeof expected.counters);
    }
}

static void run_driving(void)
{
    RUN_TEST(test_gateway_init_wrong_hardware_is_refused);
    RUN_TEST(test_start_unhomed_drives_are_homed_and_brought_up);
    RUN_TEST(test_start_drives_elsewhere_go_to_settled_first);
    RUN_TEST(test_start_drives_under_torque_are_taken_over_without_a_move);
    RUN_TEST(test_start_waits_for_the_position_of_every_drive);
    RUN_TEST(test_start_manual_policy_waits_for_the_operator);
    RUN_TEST(test_start_auto_waits_for_a_stream);
    RUN_TEST(test_start_auto_counts_the_newest_frames);
    RUN_TEST(test_start_auto_is_over_after_fault_estop_and_requests);
    RUN_TEST(test_start_auto_is_over_where_another_master_leads);
    RUN_TEST(test_start_auto_is_over_where_another_master_is_found_at_rest);
    RUN_TEST(test_settled_manual_frames_move_nothing);
    RUN_TEST(test_off_reset_takes_back_the_faults_of_drives);
    RUN_TEST(test_frames_bad_ones_change_nothing_and_are_counted);
    RUN_TEST(test_frames_several_in_a_datagram_the_last_one_counts);
    RUN_TEST(test_frames_more_than_a_cycle_takes_wait_for_the_next);
    RUN_TEST(test_frames_without_end_are_taken_so_many_per_cycle);
    RUN_TEST(test_frames_of_many_in_a_cycle_only_the_newest_costs_motion);
    RUN_TEST(test_frames_oversize_datagram_is_counted_and_ignored);
    RUN_TEST(test_frames_receive_errors_are_counted_and_passed);
    RUN_TEST(test_frames_for_another_platform_name_what_is_missing);
    RUN_TEST(test_frames_tripod_with_motor_takes_a4);
    RUN_TEST(test_frames_extensions_without_a_pose_are_counted_and_move_nothing);
    RUN_TEST(test_frames_extensions_that_lead_near_a_singularity_stop_the_platform);
    RUN_TEST(test_frames_that_lead_near_a_singularity_are_logged_at_most_once_a_second);
    RUN_TEST(test_frames_reject_lines_are_rate_limited_and_count_what_was_left_out);
    RUN_TEST(test_frames_a_reject_line_quotes_the_frame_alone);
    RUN_TEST(test_spikes_are_told_and_the_gate_may_be_opened_in_operation);
    RUN_TEST(test_relays_follow_the_mask_only_while_engaged);
    RUN_TEST(test_relays_may_outlast_a_hold_for_a_while);
    RUN_TEST(test_relays_bits_without_a_relay_are_counted);
    RUN_TEST(test_relays_failed_write_is_counted_and_tried_again);
    RUN_TEST(test_relays_that_cannot_be_switched_are_shown_and_told_once);
    RUN_TEST(test_relays_that_cannot_be_looked_at_are_written_in_every_cycle);
    RUN_TEST(test_relays_limits_of_time_apply_to_the_sender_not_to_the_safe_mask);
    RUN_TEST(test_axes_sign_scale_and_offset_apply);
    RUN_TEST(test_axes_shortest_angle_takes_the_shorter_way_round);
    RUN_TEST(test_axes_shortest_angle_turns_round_where_a_limit_is_in_the_way);
    RUN_TEST(test_axes_angle_as_sent_is_the_number_itself);
    RUN_TEST(test_axes_rotations_from_0_to_360_move_as_signed_ones);
    RUN_TEST(test_axes_heading_all_the_way_round_stays_within_the_limits);
    RUN_TEST(test_axes_jump_by_a_turn_is_told);
    RUN_TEST(test_axes_frame_without_angle_keeps_it);
    RUN_TEST(test_silence_holds_then_neutral_then_settles);
    RUN_TEST(test_silence_returning_sender_engages_again_at_engage_speed);
    RUN_TEST(test_silence_operator_hold_is_not_released_by_frames);
    RUN_TEST(test_silence_never_strikes_while_a_timed_move_runs);
    RUN_TEST(test_silence_bad_frames_do_not_count_as_a_sender);
    RUN_TEST(test_senders_two_at_once_only_one_is_followed);
    RUN_TEST(test_senders_take_over_after_silence_at_engage_speed);
    RUN_TEST(test_senders_stream_that_returns_after_a_gap_is_taken_over_at_engage_speed);
    RUN_TEST(test_senders_burst_after_a_silence_is_taken_over_at_engage_speed);
    RUN_TEST(test_senders_stream_that_goes_on_from_where_it_ended_is_followed_at_once);
    RUN_TEST(test_senders_poses_one_by_one_are_at_full_speed_whatever_is_between);
    RUN_TEST(test_senders_priority_takes_over_in_motion_without_a_jump);
    RUN_TEST(test_sender_second_program_of_its_address_is_another_one);
    RUN_TEST(test_jumps_lone_far_frame_moves_nothing_relays_neither);
    RUN_TEST(test_jumps_are_named_by_cylinder_and_motor);
    RUN_TEST(test_jumps_are_no_matter_before_anybody_is_followed);
    RUN_TEST(test_jumps_second_frame_is_followed_with_its_own_time);
    RUN_TEST(test_jumps_hold_by_silence_comes_when_it_would);
    RUN_TEST(test_jumps_of_the_sender_before_confirm_nothing);
    RUN_TEST(test_jumps_every_frame_is_followed_where_it_is_off);
}

static void run_supervision(void)
{
    RUN_TEST(test_estop_in_motion_latches_and_comes_up_through_homing);
    RUN_TEST(test_estop_input_that_cannot_be_read_counts_as_active);
    RUN_TEST(test_estop_in_every_state_ends_in_estop);
    RUN_TEST(test_fault_of_a_drive_stops_all_and_latches);
    RUN_TEST(test_fault_whose_cause_stays_cannot_be_reset);
    RUN_TEST(test_reset_is_given_up_for_what_comes_after_it);
    RUN_TEST(test_fault_drive_offline_stops_all);
    RUN_TEST(test_fault_drive_that_drops_out_stops_all);
    RUN_TEST(test_fault_bus_busy_for_some_cycles_makes_motion_wait);
    RUN_TEST(test_fault_bus_that_stays_busy_is_a_fault_and_returns_without_a_jump);
    RUN_TEST(test_fault_following_error_stops_all_in_time);
    RUN_TEST(test_fault_found_by_the_guard_of_set_points_tells_the_distance);
    RUN_TEST(test_engage_with_a_drive_outside_its_stroke_is_refused_before_there_is_torque);
    RUN_TEST(test_engage_with_a_drive_a_little_outside_or_without_its_zero_comes_up);
    RUN_TEST(test_fault_told_is_found_in_the_next_cycle);
    RUN_TEST(test_fault_told_that_is_there_counts_once);
    RUN_TEST(test_fault_told_in_off_is_none);
    RUN_TEST(test_fault_worse_one_later_escalates_and_the_first_is_kept);
    RUN_TEST(test_channels_apart_are_a_fault_in_estop_that_holds_back_a_reset);
    RUN_TEST(test_power_that_fails_stops_what_is_not_settled_in_time);
    RUN_TEST(test_drives_that_are_not_there_are_told_before_they_are_brought_up);
    RUN_TEST(test_what_is_withheld_keeps_the_platform_down_and_leads_it_down);
    RUN_TEST(test_each_cycle_that_is_too_late_leads_to_a_hold);
    RUN_TEST(test_a_shutdown_withholds_by_itself_all_that_is_not_its_own);
    RUN_TEST(test_power_that_fails_leaves_who_is_down_in_peace);
    RUN_TEST(test_fault_tables_are_complete);
    RUN_TEST(test_fault_bus_gone_is_a_fault_that_can_be_reset);
    RUN_TEST(test_fault_bus_failing_is_a_controlled_stop);
    RUN_TEST(test_fault_bus_failing_is_latched_until_it_has_recovered);
    RUN_TEST(test_fault_drives_that_never_enable_time_out);
    RUN_TEST(test_fault_in_every_phase_of_coming_up_latches);
    RUN_TEST(test_hold_during_coming_up_stops_and_resume_goes_on);
    RUN_TEST(test_shutdown_from_every_moment_ends_in_off);
    RUN_TEST(test_shutdown_while_the_drives_come_up_ends_at_once);
    RUN_TEST(test_shutdown_while_a_drive_homes_for_ever_is_bounded);
    RUN_TEST(test_shutdown_can_be_held_and_asked_for_again);
    RUN_TEST(test_shutdown_in_fault_and_estop_is_finished_at_rest);
    RUN_TEST(test_late_cycles_never_count_from_zero_again);
    RUN_TEST(test_telemetry_actual_speed_is_that_of_the_plate);
    RUN_TEST(test_telemetry_actual_pose_follows_the_feedback);
    RUN_TEST(test_telemetry_reports_of_drives_are_logged_once_with_what_they_name);
    RUN_TEST(test_fault_keeps_what_its_drive_said);
    RUN_TEST(test_telemetry_reports_that_come_and_go_are_told_of_less_often);
    RUN_TEST(test_telemetry_notes_of_drives_are_logged_when_they_change);
    RUN_TEST(test_telemetry_errors_of_drives_are_logged_once_a_second);
    RUN_TEST(test_rise_percent_slows_what_goes_up_and_nothing_else);
    RUN_TEST(test_intensity_is_taken_within_its_range_and_told);
    RUN_TEST(test_shutdown_on_a_bus_that_takes_nothing_ends_all_the_same);
    RUN_TEST(test_shutdown_from_settled_waits_until_the_bus_has_taken_it);
    RUN_TEST(test_end_waits_until_each_drive_has_confirmed_and_no_longer);
    RUN_TEST(test_end_names_the_drive_that_does_not_confirm);
    RUN_TEST(test_end_begins_when_the_drives_are_told);
    RUN_TEST(test_end_does_not_wait_for_long_for_a_drive_that_is_lost);
    RUN_TEST(test_resume_goes_on_as_what_was_saved);
    RUN_TEST(test_takeover_timed_move_after_a_jump_of_extensions_ends_in_time);
}

int main(void)
{
    UNITY_BEGIN();
    run_driving();
    run_supervision();
    return UNITY_END();
}
