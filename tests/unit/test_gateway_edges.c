/* SPDX-License-Identifier: MIT
 * test_gateway_edges.c - a whole gateway where few ever get it: lines of the log about what seldom happens, hardware that answers
 * half, axes that a sender has no scale for, poses beyond all numbers of the mechanism.
 */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "../../src/gateway/fault_watch.h"
#include "../../src/gateway/target.h"
#include "heave/mask_guard.h"
#include "rig.h"
#include "unity.h"

#define Q(x) ((q16_t)((x)*65536.0))

static rig_t m_rig;
static settings_t m_settings;
static drive_report_t m_report;

void setUp(void)
{
    m_settings = rig_hexapod();
    m_report = (drive_report_t){.phase = "", .trouble = "", .detail = ""};
}

void tearDown(void) {}

static const snapshot_t *seen(void)
{
    return gateway_snapshot(&m_rig.gateway);
}

static void engage(void)
{
    rig_start(&m_rig, &m_settings, true);
    m_rig.is_auto_checking = true;
    TEST_ASSERT_TRUE(rig_run_until(&m_rig, STATE_ENGAGED, 20000));
}

static unsigned lines_with(const char *text)
{
    unsigned lines = 0;
    while (rig_was_logged(&m_rig, text)) {
        lines++;
    }
    return lines;
}

/* ---- words ---- */

static void report(void *ctx, uint8_t axis, drive_report_t *out)
{
    (void)ctx;
    if (axis == 2) {
        *out = m_report;
    }
}

static void test_reports_name_an_identifier_or_an_axis_of_a_node(void)
{
    static drives_ops_t ops;
    engage();
    ops = *m_rig.gateway.io.drives.ops;
    ops.report = report;
    m_rig.gateway.io.drives.ops = &ops;
    m_report = (drive_report_t){.address = 3,
                                .identifier = 0x18FF0202,
                                .phase = "missing",
                                .trouble = "nothing comes from it",
                                .detail = "",
                                .code = 0x10001};
    rig_run_ms(&m_rig, 5);
    TEST_ASSERT_TRUE(rig_was_logged(&m_rig, "axis 3, identifier 0x18FF0202, missing: nothing comes from it (0x10001)"));
    m_report = (drive_report_t){.address = 12, .channel = 2, .phase = "ready", .trouble = "", .detail = ""};
    rig_run_ms(&m_rig, 5);
    TEST_ASSERT_TRUE(rig_was_logged(&m_rig, "axis 3, node 12.2, ready"));
}

static void test_fault_of_a_drive_is_told_from_those_that_heaved_finds(void)
{
    for (unsigned code = 0; code < FAULT_CODES; code++) {
        TEST_ASSERT_EQUAL(code == FAULT_DRIVE, fault_is_found_by_drive((fault_code_t)code));
    }
}

/* A jog that begins anew in front of a singularity stops at once again: one line for both. */
static void test_stops_before_a_singularity_in_a_row_are_one_line(void)
{
    m_settings = rig_tripod();
    m_settings.engage = ENGAGE_MANUAL;
    m_settings.jog_mm_s_q16 = Q(50);
    for (unsigned i = 0; i < 3; i++) {
        m_settings.geometry.retracted_mm_q16[i] = Q(260);
        m_settings.stroke_mm_q16[i] = Q(1000);
    }
    static const int k_at[] = {140, 600, 891};
    service_request_t jog = {.verb = SERVICE_JOG_AXIS, .axis = 1, .speed_q16 = Q(-50), .series = 1};
    rig_start(&m_rig, &m_settings, false);
    rig_run_ms(&m_rig, 20);
    TEST_ASSERT_EQUAL(HV_OK, rig_request(&m_rig, EVENT_SERVICE));
    for (int part = 1; part <= 1000; part++) { /* turned there by hand: the pose is known all the way */
        for (unsigned i = 0; i < 3; i++) {
            m_rig.drives.axis[i].is_homed = true;
            m_rig.drives.axis[i].position_q32 = q32_from_int(20) + (q32_from_int(k_at[i]) - q32_from_int(20)) / 1000 * part;
        }
        rig_run_ms(&m_rig, 1);
    }
    const service_request_t on = {.verb = SERVICE_TORQUE_ON, .axis = SERVICE_ALL};
    TEST_ASSERT_EQUAL(SERVICE_DONE, gateway_service(&m_rig.gateway, &on, m_rig.now_us));
    rig_run_ms(&m_rig, 200);
    uint64_t stopped_us[3] = {0};
    for (unsigned stops = 0; stops < 3;) {
        const service_answer_t answer = gateway_service(&m_rig.gateway, &jog, m_rig.now_us);
        TEST_ASSERT_TRUE(answer == SERVICE_DONE || answer == SERVICE_BUSY);
        jog.series++;
        for (unsigned ms = 0; ms < 200 && seen()->counters.singular_stops == stops; ms++) {
            rig_run_ms(&m_rig, 1);
        }
        if (seen()->counters.singular_stops > stops) {
            stopped_us[stops++] = m_rig.now_us;
        }
        TEST_ASSERT_LESS_THAN_UINT(40, jog.series);
        rig_run_ms(&m_rig, 60);
    }
    TEST_ASSERT_TRUE(stopped_us[2] - stopped_us[0] < 1000000);
    TEST_ASSERT_EQUAL_UINT(1, lines_with("lead too near a singularity"));
}

/* ---- hardware that answers half ---- */

static hv_status_t write_relays(void *ctx, uint16_t mask)
{
    (void)ctx;
    (void)mask;
    return HV_OK;
}

static hv_status_t read_nothing(void *ctx, uint16_t *mask)
{
    (void)ctx;
    (void)mask;
    return HV_ERR_IO;
}

static uint8_t one(void *ctx)
{
    (void)ctx;
    return 1;
}

static void test_pulse_that_cannot_be_read_back_is_logged_once(void)
{
    static const hal_relays_ops_t k_ops = {.write = write_relays, .read_back = read_nothing, .count = one};
    engage();
    m_rig.gateway.io.healthy.ops = &k_ops;
    rig_run_ms(&m_rig, 50);
    TEST_ASSERT_EQUAL_UINT(1, lines_with("healthy pulse: its line cannot be written"));
    m_rig.gateway.io.healthy = sim_relays_hal(&m_rig.healthy);
    rig_run_ms(&m_rig, 50);
    TEST_ASSERT_EQUAL_UINT(1, lines_with("healthy pulse: its line is written again"));
}

static void test_gateway_does_not_start_with_half_a_line_for_its_pulse(void)
{
    static const hal_relays_ops_t k_half = {.write = write_relays};
    static gateway_t other;
    engage();
    gateway_io_t io = m_rig.gateway.io;
    io.healthy.ops = &k_half;
    TEST_ASSERT_EQUAL(HV_ERR_ARG, gateway_init(&other, &m_settings, &io));
    io.healthy = sim_relays_hal(&m_rig.healthy);
    TEST_ASSERT_EQUAL(HV_OK, gateway_init(&other, &m_settings, &io));
}

static hv_status_t waited(void *ctx, uint32_t *us)
{
    (void)ctx;
    *us = 5000;
    return HV_OK;
}

/* A datagram that waited for longer than a cycle came in a cycle that was late: it counts as one that waited for this one. */
static void test_datagram_that_waited_longer_than_a_cycle_counts_as_of_this_one(void)
{
    static hal_udp_ops_t ops;
    engage();
    ops = *m_rig.gateway.io.udp.ops;
    ops.waited = waited;
    m_rig.gateway.io.udp.ops = &ops;
    rig_send(&m_rig, "@A6:0,0,0,0,0,1#");
    rig_run_ms(&m_rig, 1);
    TEST_ASSERT_EQUAL_UINT32(m_settings.cycle_us - 1, m_rig.gateway.receiver.waited_us);
    TEST_ASSERT_EQUAL_UINT32(1, seen()->counters.accepted[FRAME_A6]);
}

/* ---- the supply ---- */

static void test_supply_that_fails_is_no_fault_where_nothing_is_set(void)
{
    fault_watch_t watch = {.power_since_us = 0};
    for (uint64_t us = 1; us < 100000000; us += 1000000) {
        TEST_ASSERT_EQUAL(FAULT_NONE, fault_watch_power(&watch, true, 0, false, us));
    }
    TEST_ASSERT_EQUAL(FAULT_POWER, fault_watch_power(&watch, true, 100, false, 200000000));
}

/* How far off the rotation motor is only its drive knows. */
static void test_following_error_of_the_motor_has_no_distance_of_its_own(void)
{
    q32_t setpoint_q32[CYLINDERS_MAX] = {0};
    drive_feedback_t drive[DRIVES_MAX] = {{.state = DRIVE_ENABLED}};
    const fault_watch_in_t in = {.settings = &m_settings,
                                 .drives = {&(drives_ops_t){.count = one}, NULL},
                                 .feedback = {.drive = drive, .count = DRIVES_MAX},
                                 .setpoint_mm_q32 = setpoint_q32,
                                 .cylinders = CYLINDERS_MAX};
    drive[1].actual_mm_q32 = drive[CYLINDERS_MAX].actual_mm_q32 = q32_from_int(9);
    m_settings.following_error_mm_q16 = Q(5);
    const fault_t cylinder = fault_watch_fault_of(&in, FAULT_FOLLOWING, 1);
    TEST_ASSERT_EQUAL_INT64(q32_from_int(9), cylinder.off_q32);
    TEST_ASSERT_EQUAL_INT64(q32_from_int(5), cylinder.allowed_q32);
    const fault_t motor = fault_watch_fault_of(&in, FAULT_FOLLOWING, CYLINDERS_MAX);
    TEST_ASSERT_EQUAL(CYLINDERS_MAX + 1, motor.axis);
    TEST_ASSERT_EQUAL_INT64(0, motor.off_q32);
    TEST_ASSERT_EQUAL_INT64(0, motor.allowed_q32);
}

/* ---- senders ---- */

/* Another policy, and the habit of the sender is not known before its next frame. */
static void test_habit_of_a_sender_is_unknown_under_another_policy(void)
{
    const frame_t frame = {.command = FRAME_A3, .count = 3, .has_mask = true};
    mask_guard_t guard = {.frames = 0};
    for (unsigned i = 0; i < MASK_GUARD_FRAMES; i++) {
        TEST_ASSERT_TRUE(mask_guard_passes(&guard, MASK_LEARNT, &frame, i * 16000));
    }
    TEST_ASSERT_EQUAL(MASK_SENT, mask_guard_habit(&guard, MASK_LEARNT));
    TEST_ASSERT_TRUE(mask_guard_passes(&guard, MASK_ANY, &frame, 1000000));
    TEST_ASSERT_EQUAL(MASK_UNKNOWN, mask_guard_habit(&guard, MASK_ANY));
    TEST_ASSERT_EQUAL(MASK_UNKNOWN, mask_guard_habit(&guard, MASK_LEARNT));
}

/* A sender whose decimals are found, told otherwise, and found once more within a second: one line. */
static void test_masks_like_digits_are_logged_at_most_once_a_second(void)
{
    engage();
    unsigned found = 0, lines = 0;
    bool was_digits = false;
    for (unsigned ms = 0; ms < 900 && found < 2; ms++) {
        m_rig.settings.mask_policy = was_digits ? MASK_ANY : MASK_LEARNT;
        if (ms % 4 == 0) {
            rig_sendf(&m_rig, "@A3:0,0,1,%u#", (ms * 37u + ms * ms) % 1000u);
            was_digits = false;
        }
        rig_run_ms(&m_rig, 1);
        lines += lines_with("relay masks change like the digits of a value");
        was_digits = was_digits || seen()->mask_habit == MASK_DIGITS;
        found += ms % 4 == 0 && seen()->mask_habit == MASK_DIGITS;
    }
    TEST_ASSERT_EQUAL_UINT(2, found);
    TEST_ASSERT_EQUAL_UINT(1, lines);
}

/* An axis with a scale of 0 has no turn, whatever is said of its wrap. */
static void test_rotation_without_a_scale_is_never_turned(void)
{
    const q32_t last_q32[AXES_MAX] = {0};
    const rotations_t before = {.is_there = {true}, .deg_q16 = {Q(179)}};
    const rotations_t now = {.is_there = {true}, .deg_q16 = {Q(-179)}};
    const frame_t frame = {.command = FRAME_A3, .count = 3, .value_q16 = {Q(350), Q(350), 0}};
    TEST_ASSERT_EQUAL_UINT(AXIS_ROLL, target_jumps_by_turn(&m_settings, &before, &now));
    m_settings.axis[AXIS_ROLL].scale_q16 = 0;
    TEST_ASSERT_EQUAL_UINT(AXES_MAX, target_jumps_by_turn(&m_settings, &before, &now));
    m_settings.axis[AXIS_ROLL].wrap = m_settings.axis[AXIS_PITCH].wrap = ANGLE_SHORTEST;
    const motion_target_t target = target_of(&m_settings, last_q32, &frame);
    TEST_ASSERT_EQUAL_INT64(0, target.value_q32[AXIS_ROLL]);
    TEST_ASSERT_EQUAL_INT64(q32_from_int(-10), target.value_q32[AXIS_PITCH]);
}

/* ---- beyond all numbers ---- */

/* Axes may be set so wide that no mechanism has a pose there: a sender that goes there is pulled in, and followed again when it
 * comes back. */
static void test_stream_beyond_what_the_mechanism_can_calculate_is_pulled_in(void)
{
    for (unsigned style = 0; style < 2; style++) {
        m_settings = rig_hexapod();
        m_settings.stream_style = style == 0 ? STREAM_SMOOTH : STREAM_BALANCED;
        m_settings.axis[AXIS_X].min_q16 = Q(-30000);
        m_settings.axis[AXIS_X].max_q16 = Q(30000);
        m_settings.spike_gate = style == 0 ? 0 : 10;
        engage();
        for (unsigned i = 0; i < 1500; i++) {
            const double x = i < 200 ? 0 : i < 600 ? 25000 * sin((i - 200) * 0.05) : i < 800 ? 22000 : 10 * sin(i * 0.05);
            rig_sendf(&m_rig, "@A6:0,0,0,%.3f,0,0#", x);
            rig_run_ms(&m_rig, 16);
            TEST_ASSERT_EQUAL(STATE_ENGAGED, seen()->state);
            TEST_ASSERT_TRUE(fabs(rig_pose(&m_rig, AXIS_X)) < 500);
        }
        TEST_ASSERT_TRUE(rig_is_within_limits(&m_rig));
        TEST_ASSERT_EQUAL_UINT(0, rig_following_errors(&m_rig));
        rig_send(&m_rig, "@A6:0,0,0,0,0,0#");
        rig_run_ms(&m_rig, 4000);
        TEST_ASSERT_DOUBLE_WITHIN(0.01, 0, rig_pose(&m_rig, AXIS_X));
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_reports_name_an_identifier_or_an_axis_of_a_node);
    RUN_TEST(test_fault_of_a_drive_is_told_from_those_that_heaved_finds);
    RUN_TEST(test_stops_before_a_singularity_in_a_row_are_one_line);
    RUN_TEST(test_pulse_that_cannot_be_read_back_is_logged_once);
    RUN_TEST(test_gateway_does_not_start_with_half_a_line_for_its_pulse);
    RUN_TEST(test_datagram_that_waited_longer_than_a_cycle_counts_as_of_this_one);
    RUN_TEST(test_supply_that_fails_is_no_fault_where_nothing_is_set);
    RUN_TEST(test_following_error_of_the_motor_has_no_distance_of_its_own);
    RUN_TEST(test_habit_of_a_sender_is_unknown_under_another_policy);
    RUN_TEST(test_masks_like_digits_are_logged_at_most_once_a_second);
    RUN_TEST(test_rotation_without_a_scale_is_never_turned);
    RUN_TEST(test_stream_beyond_what_the_mechanism_can_calculate_is_pulled_in);
    return UNITY_END();
}
