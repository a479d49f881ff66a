/* SPDX-License-Identifier: MIT
 * test_service_mode.c - SERVICE of a whole gateway over simulated drives: what moves, how fast, for how long after the hand has
 * gone, and what is refused. The checker of the rig judges every set-point; what a jog may do at most is looked at beside it.
 */
#include <math.h>
#include <string.h>

#include "random.h"
#include "rig.h"
#include "unity.h"

#define Q(x)      ((q16_t)((x)*65536.0))
#define JOG_MM_S  20.0 /* of the rig */
#define JOG_DEG_S 5.0

static rig_t m_rig;
static settings_t m_settings;
static uint32_t m_series;
static excitation_request_t m_signal; /* of the next requests, as this: */
static q16_t m_way_q16;
static double m_fastest[DRIVES_MAX]; /* mm/s, deg/s */
static double m_last[DRIVES_MAX];

void setUp(void)
{
    m_settings = rig_hexapod();
    m_settings.engage = ENGAGE_MANUAL;
    m_settings.following_error_mm_q16 = Q(5);
    m_series = 0;
    m_way_q16 = 0;
    m_signal = (excitation_request_t){EXCITATION_SINE, Q(2), 2000, 0, 4000};
}

void tearDown(void) {}

static const snapshot_t *seen(void)
{
    return gateway_snapshot(&m_rig.gateway);
}

static double setpoint(unsigned i)
{
    return i < seen()->cylinders ? rig_cylinder_mm(&m_rig, i + 1) : rig_angle_deg(&m_rig);
}

static void watch(void *ctx)
{
    (void)ctx;
    for (unsigned i = 0; i < m_rig.drives.count; i++) {
        const double now = setpoint(i);
        const double speed = fabs(now - m_last[i]) * 1e6 / m_settings.cycle_us;
        m_fastest[i] = speed > m_fastest[i] ? speed : m_fastest[i];
        m_last[i] = now;
    }
}

static void forget_speeds(void)
{
    for (unsigned i = 0; i < m_rig.drives.count; i++) {
        m_fastest[i] = 0;
        m_last[i] = setpoint(i);
    }
}

static service_answer_t ask_aged(service_verb_t verb, unsigned axis, double speed, uint64_t age_us)
{
    const service_request_t request = {.verb = verb,
                                       .axis = (uint8_t)axis,
                                       .speed_q16 = Q(speed),
                                       .way_q16 = m_way_q16,
                                       .signal = m_signal,
                                       .series = service_is_held(verb) ? ++m_series : m_series,
                                       .age_us = age_us};
    return gateway_service(&m_rig.gateway, &request, m_rig.now_us);
}

static service_answer_t ask(service_verb_t verb, unsigned axis, double speed)
{
    return ask_aged(verb, axis, speed, 0);
}

static service_answer_t beat(uint32_t counter, uint64_t age_us)
{
    const service_request_t request = {.verb = SERVICE_BEAT, .series = m_series, .counter = counter, .age_us = age_us};
    return gateway_service(&m_rig.gateway, &request, m_rig.now_us);
}

/* The hand is there for so long. */
static void hold_ms(unsigned ms)
{
    static uint32_t counter;
    for (unsigned at = 0; at < ms; at += 50) {
        rig_run_ms(&m_rig, ms - at < 50 ? ms - at : 50);
        (void)beat(++counter, 0);
    }
}

/* In SERVICE: from SETTLED, with torque and zeros; else from OFF, without. */
static void start(bool is_settled)
{
    rig_start(&m_rig, &m_settings, is_settled);
    m_rig.is_auto_checking = true;
    rig_run_ms(&m_rig, 20);
    TEST_ASSERT_EQUAL(HV_OK, rig_request(&m_rig, EVENT_SERVICE));
    rig_run_ms(&m_rig, 10);
    TEST_ASSERT_EQUAL(STATE_SERVICE, seen()->state);
    m_rig.after_cycle = watch;
    forget_speeds();
}

static void torque_all_on(void)
{
    TEST_ASSERT_EQUAL(SERVICE_DONE, ask(SERVICE_TORQUE_ON, SERVICE_ALL, 0));
    rig_run_ms(&m_rig, 200);
    TEST_ASSERT_EQUAL(0x7F, seen()->service.torque);
}

static void assert_well(void)
{
    TEST_ASSERT_EQUAL_STRING("SERVICE", state_name(seen()->state));
    TEST_ASSERT_TRUE(rig_is_within_limits(&m_rig));
    TEST_ASSERT_EQUAL(0, rig_following_errors(&m_rig));
    for (unsigned i = 0; i < seen()->cylinders; i++) {
        TEST_ASSERT_TRUE(m_fastest[i] <= JOG_MM_S + 1e-6);
    }
}

/* ---- coming and going ---- */

static void test_service_is_entered_from_settled_with_torque_and_moves_nothing(void)
{
    start(true);
    TEST_ASSERT_EQUAL(0x7F, seen()->service.torque);
    rig_send(&m_rig, "@P1 1 1 1 1 1"); /* nobody listens */
    rig_run_ms(&m_rig, 2000);
    for (unsigned i = 0; i < m_rig.drives.count; i++) {
        TEST_ASSERT_TRUE(m_fastest[i] == 0);
    }
    assert_well();
}

static void test_service_is_entered_from_off_without_torque(void)
{
    start(false);
    rig_run_ms(&m_rig, 500);
    TEST_ASSERT_EQUAL(0, seen()->service.torque);
    for (unsigned i = 0; i < m_rig.drives.count; i++) {
        TEST_ASSERT_EQUAL(DRIVE_DISABLED, m_rig.drives.axis[i].state);
    }
}

static void test_service_is_refused_where_the_platform_is_up(void)
{
    rig_start(&m_rig, &m_settings, true);
    rig_run_ms(&m_rig, 20);
    TEST_ASSERT_EQUAL(HV_OK, rig_request(&m_rig, EVENT_ENGAGE));
    rig_run_ms(&m_rig, 100);
    TEST_ASSERT_EQUAL(HV_ERR_STATE, rig_request(&m_rig, EVENT_SERVICE));
    TEST_ASSERT_EQUAL(STATE_RISING, seen()->state);
    TEST_ASSERT_EQUAL(SERVICE_NOT_SERVING, ask(SERVICE_JOG_AXIS, 1, 5));
}

static void test_service_is_refused_while_a_drive_does_not_answer(void)
{
    rig_start(&m_rig, &m_settings, false);
    rig_break(&m_rig, SIM_DRIVES_OFFLINE, 2, 0);
    rig_run_ms(&m_rig, 20);
    TEST_ASSERT_EQUAL(HV_ERR_STATE, rig_request(&m_rig, EVENT_SERVICE));
    rig_break(&m_rig, SIM_DRIVES_RECOVER, 2, 0);
    rig_run_ms(&m_rig, 20);
    TEST_ASSERT_EQUAL(HV_OK, rig_request(&m_rig, EVENT_SERVICE));
}

static void test_service_ends_in_off_with_every_drive_off(void)
{
    start(true);
    TEST_ASSERT_EQUAL(SERVICE_DONE, ask(SERVICE_JOG_AXIS, 1, 20));
    rig_run_ms(&m_rig, 200);
    TEST_ASSERT_EQUAL(HV_OK, rig_request(&m_rig, EVENT_SERVICE_OFF));
    rig_run_ms(&m_rig, 2);
    TEST_ASSERT_EQUAL(STATE_OFF, seen()->state);
    TEST_ASSERT_EQUAL(HV_ERR_STATE, rig_request(&m_rig, EVENT_SERVICE)); /* it is still stopping */
    rig_run_ms(&m_rig, 2000);
    for (unsigned i = 0; i < m_rig.drives.count; i++) {
        TEST_ASSERT_EQUAL(DRIVE_DISABLED, m_rig.drives.axis[i].state);
    }
    TEST_ASSERT_TRUE(rig_is_within_limits(&m_rig));
    TEST_ASSERT_EQUAL(HV_OK, rig_request(&m_rig, EVENT_PARK));
    TEST_ASSERT_TRUE(rig_run_until(&m_rig, STATE_SETTLED, 20000));
    TEST_ASSERT_TRUE(rig_is_within_limits(&m_rig));
}

static void test_service_requests_that_lead_up_are_refused(void)
{
    static const event_t k_up[] = {EVENT_ENGAGE, EVENT_PARK, EVENT_RESUME, EVENT_RESET};
    start(true);
    for (unsigned i = 0; i < 4; i++) {
        TEST_ASSERT_EQUAL(HV_ERR_STATE, rig_request(&m_rig, k_up[i]));
    }
    TEST_ASSERT_EQUAL(STATE_SERVICE, seen()->state);
}

/* ---- jog ---- */

static void test_jog_moves_one_cylinder_at_its_speed_while_the_hand_is_there(void)
{
    start(true);
    const double from = setpoint(2);
    TEST_ASSERT_EQUAL(SERVICE_DONE, ask(SERVICE_JOG_AXIS, 3, 5));
    hold_ms(2000);
    TEST_ASSERT_TRUE(m_fastest[2] > 4.8 && m_fastest[2] <= 5 + 1e-6);
    TEST_ASSERT_TRUE(setpoint(2) > from + 8.5);
    TEST_ASSERT_EQUAL(SERVICE_JOG_AXIS, seen()->service.doing);
    for (unsigned i = 0; i < m_rig.drives.count; i++) {
        TEST_ASSERT_TRUE(i == 2 || m_fastest[i] == 0);
    }
    assert_well();
}

static void test_jog_without_a_hand_stops_after_250_ms_and_its_stop(void)
{
    start(true);
    TEST_ASSERT_EQUAL(SERVICE_DONE, ask(SERVICE_JOG_AXIS, 3, -1000)); /* as fast as it may be */
    hold_ms(1000);
    rig_run_ms(&m_rig, 249);
    TEST_ASSERT_EQUAL(SERVICE_JOG_AXIS, seen()->service.doing);
    rig_run_ms(&m_rig, 2);
    TEST_ASSERT_EQUAL(SERVICE_NOTHING, seen()->service.doing);
    rig_run_ms(&m_rig, 150); /* 20 mm/s at 200 mm/s^2 and 50000 mm/s^3 */
    forget_speeds();
    TEST_ASSERT_EQUAL(SERVICE_OVER, beat(100000, 0));
    rig_run_ms(&m_rig, 1000);
    TEST_ASSERT_TRUE(m_fastest[2] == 0);
    assert_well();
}

static void test_jog_old_beats_in_a_burst_move_nothing(void)
{
    start(true);
    TEST_ASSERT_EQUAL(SERVICE_DONE, ask(SERVICE_JOG_AXIS, 3, 5));
    rig_run_ms(&m_rig, 240);
    for (uint32_t i = 1; i < 40; i++) {
        (void)beat(i, 240000);
    }
    rig_run_ms(&m_rig, 12);
    TEST_ASSERT_EQUAL(SERVICE_NOTHING, seen()->service.doing);
    rig_run_ms(&m_rig, 200);
    forget_speeds();
    for (uint32_t i = 40; i < 80; i++) {
        TEST_ASSERT_EQUAL(SERVICE_OVER, beat(i, 0));
        rig_run_ms(&m_rig, 5);
    }
    TEST_ASSERT_TRUE(m_fastest[2] == 0);
    TEST_ASSERT_EQUAL(SERVICE_STALE, ask_aged(SERVICE_JOG_AXIS, 3, 5, 250000));
    rig_run_ms(&m_rig, 100);
    TEST_ASSERT_TRUE(m_fastest[2] == 0);
}

static void test_jog_skipped_cycles_are_time_of_the_hand(void)
{
    start(true);
    TEST_ASSERT_EQUAL(SERVICE_DONE, ask(SERVICE_JOG_AXIS, 3, 5));
    rig_run_ms(&m_rig, 100);
    gateway_note_late(&m_rig.gateway, 148);
    rig_run_ms(&m_rig, 1);
    TEST_ASSERT_EQUAL(SERVICE_JOG_AXIS, seen()->service.doing);
    rig_run_ms(&m_rig, 3);
    TEST_ASSERT_EQUAL(SERVICE_NOTHING, seen()->service.doing);
}

static void test_jog_ends_at_the_margin_of_the_stroke_and_goes_no_further(void)
{
    start(true);
    TEST_ASSERT_EQUAL(SERVICE_DONE, ask(SERVICE_JOG_AXIS, 2, -20));
    hold_ms(12000);
    const double least = m_settings.margin_mm_q16 / 65536.0;
    TEST_ASSERT_TRUE(fabs(setpoint(1) - least) < 1e-6);
    TEST_ASSERT_EQUAL(SERVICE_DONE, ask(SERVICE_RELEASE, 0, 0));
    rig_run_ms(&m_rig, 20);
    TEST_ASSERT_EQUAL(SERVICE_AT_END, ask(SERVICE_JOG_AXIS, 2, -20));
    TEST_ASSERT_EQUAL(SERVICE_DONE, ask(SERVICE_JOG_AXIS, 2, 20));
    assert_well();
}

static void test_jog_of_the_rotation_motor_keeps_its_limit(void)
{
    start(true);
    TEST_ASSERT_EQUAL(SERVICE_DONE, ask(SERVICE_JOG_AXIS, 7, 90));
    hold_ms(3000);
    TEST_ASSERT_TRUE(m_fastest[6] > JOG_DEG_S * 0.95 && m_fastest[6] <= JOG_DEG_S + 1e-6);
    assert_well();
}

static void test_jog_of_a_pose_axis_goes_straight_and_keeps_every_cylinder_slow(void)
{
    for (unsigned axis = 0; axis < POSE_AXES; axis++) {
        for (int sign = -1; sign <= 1; sign += 2) {
            start(true);
            TEST_ASSERT_EQUAL(SERVICE_DONE, ask(SERVICE_JOG_AXIS, 1, 20)); /* off the symmetry */
            hold_ms(1000);
            TEST_ASSERT_EQUAL(SERVICE_DONE, ask(SERVICE_RELEASE, 0, 0));
            rig_run_ms(&m_rig, 500);
            TEST_ASSERT_EQUAL(SERVICE_DONE, ask(SERVICE_JOG_POSE, AXIS_Z + 1, 20)); /* to where there is way to all sides */
            hold_ms(4000);
            TEST_ASSERT_EQUAL(SERVICE_DONE, ask(SERVICE_RELEASE, 0, 0));
            rig_run_ms(&m_rig, 500);
            double before[POSE_AXES];
            for (unsigned i = 0; i < POSE_AXES; i++) {
                before[i] = rig_pose(&m_rig, i);
            }
            forget_speeds();
            TEST_ASSERT_EQUAL(SERVICE_DONE, ask(SERVICE_JOG_POSE, axis + 1, sign * 1000));
            hold_ms(1500);
            const double went = (rig_pose(&m_rig, axis) - before[axis]) * sign;
            TEST_ASSERT_TRUE(went > (axis < AXIS_X ? 0.5 : 5));
            for (unsigned i = 0; i < POSE_AXES; i++) {
                TEST_ASSERT_TRUE(i == axis || fabs(rig_pose(&m_rig, i) - before[i]) < 1e-5);
            }
            hold_ms(20000); /* to the edge of what the cylinders reach */
            assert_well();
            for (unsigned i = 0; i < POSE_AXES; i++) {
                TEST_ASSERT_TRUE(i == axis || fabs(rig_pose(&m_rig, i) - before[i]) < 1e-5);
            }
            forget_speeds();
            hold_ms(100);
            TEST_ASSERT_TRUE(m_fastest[0] == 0);
        }
    }
}

static void test_jog_of_a_tripod_takes_the_axes_that_it_has(void)
{
    m_settings = rig_tripod();
    m_settings.engage = ENGAGE_MANUAL;
    start(true);
    TEST_ASSERT_EQUAL(SERVICE_NO_SUCH, ask(SERVICE_JOG_POSE, AXIS_X + 1, 5));
    TEST_ASSERT_EQUAL(SERVICE_NO_SUCH, ask(SERVICE_JOG_AXIS, 4, 5));
    TEST_ASSERT_EQUAL(SERVICE_DONE, ask(SERVICE_JOG_POSE, AXIS_Z + 1, 5));
    hold_ms(1000);
    TEST_ASSERT_TRUE(fabs(setpoint(0) - setpoint(1)) < 1e-6);
    assert_well();
}

static void test_jog_press_during_another_is_refused_and_changes_nothing(void)
{
    start(true);
    TEST_ASSERT_EQUAL(SERVICE_DONE, ask(SERVICE_JOG_AXIS, 3, 5));
    rig_run_ms(&m_rig, 100);
    const uint32_t series = m_series;
    TEST_ASSERT_EQUAL(SERVICE_BUSY, ask(SERVICE_JOG_AXIS, 4, 5));
    TEST_ASSERT_EQUAL(SERVICE_BUSY, ask(SERVICE_TORQUE_ON, 1, 0));
    TEST_ASSERT_EQUAL(series, seen()->service.series);
    rig_run_ms(&m_rig, 100);
    TEST_ASSERT_TRUE(m_fastest[3] == 0 && m_fastest[2] > 0);
}

/* It is never refused. What moves stops within its limits, which the rig's checker judges, and then the torque goes. */
static void test_torque_off_during_a_jog_stops_it_first(void)
{
    for (unsigned off = 0; off < 3; off++) { /* of the drive that moves, of another one, of all */
        start(true);
        TEST_ASSERT_EQUAL(SERVICE_DONE, off == 1 ? ask(SERVICE_JOG_POSE, AXIS_Z + 1, 20) : ask(SERVICE_JOG_AXIS, 3, 20));
        hold_ms(400);
        const double speed = m_fastest[2];
        TEST_ASSERT_TRUE(speed > 0.5 * JOG_MM_S);
        TEST_ASSERT_EQUAL(SERVICE_DONE, ask(SERVICE_TORQUE_OFF, off == 0 ? 3 : off == 1 ? 1 : SERVICE_ALL, 0));
        forget_speeds();
        unsigned cycles = 0;
        while ((seen()->service.torque >> (off == 1 ? 0 : 2) & 1u) != 0) {
            TEST_ASSERT_EQUAL(DRIVE_ENABLED, seen()->drive[off == 1 ? 0 : 2].state);
            rig_run_ms(&m_rig, 1);
            TEST_ASSERT_EQUAL(SERVICE_NOTHING, seen()->service.doing);
            cycles++;
            TEST_ASSERT_LESS_THAN_UINT(1000, cycles);
        }
        TEST_ASSERT_GREATER_THAN_UINT(5, cycles);
        TEST_ASSERT_TRUE(m_fastest[2] <= speed + 1e-6);
        rig_run_ms(&m_rig, 100);
        TEST_ASSERT_EQUAL(off == 0 ? 0x7B : off == 1 ? 0x7E : 0, seen()->service.torque);
        const double at = setpoint(2);
        rig_run_ms(&m_rig, 100);
        TEST_ASSERT_TRUE(fabs(setpoint(2) - at) < 1e-3);
        assert_well();
    }
}

static void test_torque_off_during_homing_stops_it(void)
{
    start(true);
    TEST_ASSERT_EQUAL(SERVICE_DONE, ask(SERVICE_HOME, 3, 0));
    rig_run_ms(&m_rig, 20);
    TEST_ASSERT_EQUAL(DRIVE_HOMING, seen()->drive[2].state);
    TEST_ASSERT_EQUAL(SERVICE_DONE, ask(SERVICE_TORQUE_OFF, SERVICE_ALL, 0));
    rig_run_ms(&m_rig, 20);
    TEST_ASSERT_EQUAL(0, seen()->service.torque);
    TEST_ASSERT_EQUAL(DRIVE_DISABLED, seen()->drive[2].state);
    TEST_ASSERT_EQUAL(STATE_SERVICE, seen()->state);
}

/* All before the next cycle: what stops the drive is still to be sent, and stays so. */
static void test_torque_on_again_does_not_replace_the_stop_of_a_homing(void)
{
    start(true);
    TEST_ASSERT_EQUAL(SERVICE_DONE, ask(SERVICE_HOME, 3, 0));
    rig_run_ms(&m_rig, 20);
    TEST_ASSERT_EQUAL(SERVICE_DONE, ask(SERVICE_TORQUE_OFF, 3, 0));
    TEST_ASSERT_EQUAL(SERVICE_BUSY, ask(SERVICE_TORQUE_ON, 3, 0));
    rig_run_ms(&m_rig, 20);
    TEST_ASSERT_EQUAL(DRIVE_DISABLED, seen()->drive[2].state);
    TEST_ASSERT_EQUAL(SERVICE_DONE, ask(SERVICE_TORQUE_ON, 3, 0));
    rig_run_ms(&m_rig, 200);
    TEST_ASSERT_EQUAL(DRIVE_ENABLED, seen()->drive[2].state);
}

static void test_jog_hold_stops_it_and_stays_in_service(void)
{
    start(true);
    TEST_ASSERT_EQUAL(SERVICE_DONE, ask(SERVICE_JOG_AXIS, 3, 20));
    rig_run_ms(&m_rig, 200);
    TEST_ASSERT_EQUAL(HV_OK, rig_request(&m_rig, EVENT_HOLD));
    rig_run_ms(&m_rig, 200);
    forget_speeds();
    TEST_ASSERT_EQUAL(SERVICE_OVER, beat(1, 0));
    rig_run_ms(&m_rig, 200);
    TEST_ASSERT_TRUE(m_fastest[2] == 0);
    assert_well();
}

static void test_jog_fault_and_estop_end_it_as_anywhere(void)
{
    start(true);
    TEST_ASSERT_EQUAL(SERVICE_DONE, ask(SERVICE_JOG_AXIS, 3, 20));
    rig_run_ms(&m_rig, 200);
    rig_break(&m_rig, SIM_DRIVES_FAULT, 0, 0x2310);
    rig_run_ms(&m_rig, 5);
    TEST_ASSERT_EQUAL(STATE_FAULT, seen()->state);
    TEST_ASSERT_EQUAL(FAULT_DRIVE, seen()->fault.code);
    rig_run_ms(&m_rig, 200);
    TEST_ASSERT_EQUAL(DRIVE_DISABLED, m_rig.drives.axis[3].state);

    start(true);
    TEST_ASSERT_EQUAL(SERVICE_DONE, ask(SERVICE_JOG_AXIS, 3, 20));
    rig_run_ms(&m_rig, 200);
    sim_inputs_set(&m_rig.inputs, INPUT_ESTOP, true);
    rig_run_ms(&m_rig, 5);
    TEST_ASSERT_EQUAL(STATE_ESTOP, seen()->state);
    rig_run_ms(&m_rig, 200);
    TEST_ASSERT_EQUAL(DRIVE_DISABLED, m_rig.drives.axis[3].state);
    TEST_ASSERT_EQUAL(SERVICE_NOT_SERVING, beat(2, 0));
}

/* A cylinder that does not follow is found as anywhere, one without torque is nobody's fault. */
static void test_jog_stuck_cylinder_is_a_following_error(void)
{
    start(true);
    TEST_ASSERT_EQUAL(SERVICE_DONE, ask(SERVICE_JOG_AXIS, 3, 20));
    m_rig.drives.axis[2].is_frozen = true;
    hold_ms(1000);
    TEST_ASSERT_EQUAL(STATE_FAULT, seen()->state);
    TEST_ASSERT_EQUAL(FAULT_FOLLOWING, seen()->fault.code);
    TEST_ASSERT_EQUAL(3, seen()->fault.axis);
}

/* ---- torque ---- */

static void test_torque_of_one_drive_leaves_the_others_alone(void)
{
    start(false);
    TEST_ASSERT_EQUAL(SERVICE_NO_TORQUE, ask(SERVICE_JOG_AXIS, 4, 5));
    TEST_ASSERT_EQUAL(SERVICE_DONE, ask(SERVICE_TORQUE_ON, 4, 0));
    rig_run_ms(&m_rig, 200);
    TEST_ASSERT_EQUAL(1u << 3, seen()->service.torque);
    for (unsigned i = 0; i < m_rig.drives.count; i++) {
        TEST_ASSERT_EQUAL(i == 3 ? DRIVE_ENABLED : DRIVE_DISABLED, m_rig.drives.axis[i].state);
    }
    TEST_ASSERT_EQUAL(SERVICE_DONE, ask(SERVICE_JOG_AXIS, 4, 5)); /* without a zero: as the drive counts */
    hold_ms(1000);
    TEST_ASSERT_TRUE(m_fastest[3] > 4.8);
    TEST_ASSERT_EQUAL(SERVICE_DONE, ask(SERVICE_RELEASE, 0, 0));
    rig_run_ms(&m_rig, 200);
    TEST_ASSERT_EQUAL(SERVICE_DONE, ask(SERVICE_TORQUE_OFF, 4, 0));
    rig_run_ms(&m_rig, 20);
    TEST_ASSERT_EQUAL(DRIVE_DISABLED, m_rig.drives.axis[3].state);
    TEST_ASSERT_EQUAL(0, seen()->service.torque);
    assert_well();
}

/* Somebody turns a spindle by hand: the set-point goes with it, so that torque finds it where it is. */
static void test_torque_comes_on_where_the_cylinder_is(void)
{
    start(false);
    m_rig.drives.axis[1].position_q32 += q32_from_int(7);
    rig_run_ms(&m_rig, 10);
    forget_speeds();
    torque_all_on();
    assert_well();
}

static void test_torque_that_does_not_come_is_a_fault(void)
{
    start(false);
    m_rig.drives.axis[1].is_frozen = true;
    TEST_ASSERT_EQUAL(SERVICE_DONE, ask(SERVICE_TORQUE_ON, 2, 0));
    rig_run_ms(&m_rig, 9900);
    TEST_ASSERT_EQUAL(STATE_SERVICE, seen()->state);
    rig_run_ms(&m_rig, 200);
    TEST_ASSERT_EQUAL(STATE_FAULT, seen()->state);
    TEST_ASSERT_EQUAL(FAULT_DRIVE_TIMEOUT, seen()->fault.code);
}

static void test_torque_that_is_lost_is_a_fault(void)
{
    start(false);
    torque_all_on();
    m_rig.drives.axis[5].state = DRIVE_DISABLED;
    rig_run_ms(&m_rig, 5);
    TEST_ASSERT_EQUAL(STATE_FAULT, seen()->state);
    TEST_ASSERT_EQUAL(FAULT_DRIVE_DROPPED, seen()->fault.code);
}

/* Outside of the stroke, as a drive without a zero may seem to be: torque alone brings nothing in, and a jog only as asked. */
static void test_torque_outside_of_the_stroke_moves_nothing(void)
{
    rig_start(&m_rig, &m_settings, false);
    m_rig.drive_config[2].unhomed_offset_q32 = -q32_from_int(60);
    rig_run_ms(&m_rig, 20);
    TEST_ASSERT_EQUAL(HV_OK, rig_request(&m_rig, EVENT_SERVICE));
    rig_run_ms(&m_rig, 10);
    TEST_ASSERT_EQUAL(SERVICE_DONE, ask(SERVICE_TORQUE_ON, 3, 0));
    rig_run_ms(&m_rig, 200);
    m_rig.after_cycle = watch;
    forget_speeds();
    const double from = setpoint(2);
    TEST_ASSERT_TRUE(from < -30);
    rig_run_ms(&m_rig, 500);
    TEST_ASSERT_TRUE(m_fastest[2] == 0);
    TEST_ASSERT_EQUAL(SERVICE_AT_END, ask(SERVICE_JOG_AXIS, 3, -5));
    TEST_ASSERT_EQUAL(SERVICE_DONE, ask(SERVICE_JOG_AXIS, 3, 5));
    hold_ms(1000);
    rig_run_ms(&m_rig, 600);
    TEST_ASSERT_TRUE(m_fastest[2] > 4.8 && m_fastest[2] <= 5 + 1e-6);
    TEST_ASSERT_TRUE(setpoint(2) > from + 4 && setpoint(2) < from + 8);
    forget_speeds();
    rig_run_ms(&m_rig, 500);
    TEST_ASSERT_TRUE(m_fastest[2] == 0);
}

/* ---- homing ---- */

static void test_home_of_one_drive_goes_on_while_the_hand_is_there(void)
{
    start(false);
    torque_all_on();
    TEST_ASSERT_EQUAL(SERVICE_NOT_HOMED, ask(SERVICE_JOG_POSE, AXIS_Z + 1, 5));
    TEST_ASSERT_EQUAL(SERVICE_DONE, ask(SERVICE_HOME, 3, 0));
    hold_ms(2000);
    for (unsigned i = 0; i < m_rig.drives.count; i++) {
        TEST_ASSERT_EQUAL(i == 2, m_rig.drives.axis[i].is_homed);
        TEST_ASSERT_EQUAL(DRIVE_ENABLED, m_rig.drives.axis[i].state);
    }
    TEST_ASSERT_EQUAL(SERVICE_NOTHING, seen()->service.doing);
    TEST_ASSERT_EQUAL(SERVICE_DONE, ask(SERVICE_HOME, SERVICE_ALL, 0));
    hold_ms(2000);
    TEST_ASSERT_EQUAL(SERVICE_NOTHING, seen()->service.doing);
    TEST_ASSERT_EQUAL(SERVICE_DONE, ask(SERVICE_JOG_POSE, AXIS_Z + 1, 5));
    hold_ms(1000);
    TEST_ASSERT_EQUAL(STATE_SERVICE, seen()->state);
    TEST_ASSERT_EQUAL(0, rig_following_errors(&m_rig));
}

/* Where actual jumps at the end of homing, the set-point is there in the same cycle. */
static void test_home_goes_on_from_the_new_zero(void)
{
    rig_start(&m_rig, &m_settings, false);
    m_rig.drive_config[2].unhomed_offset_q32 = q32_from_int(40);
    rig_run_ms(&m_rig, 20);
    TEST_ASSERT_EQUAL(HV_OK, rig_request(&m_rig, EVENT_SERVICE));
    rig_run_ms(&m_rig, 10);
    torque_all_on();
    TEST_ASSERT_EQUAL(SERVICE_DONE, ask(SERVICE_HOME, 3, 0));
    hold_ms(2000);
    TEST_ASSERT_TRUE(m_rig.drives.axis[2].is_homed);
    TEST_ASSERT_TRUE(fabs(setpoint(2)) < 1e-6);
    TEST_ASSERT_EQUAL(STATE_SERVICE, seen()->state);
    TEST_ASSERT_EQUAL(0, rig_following_errors(&m_rig));
}

static void test_home_without_a_hand_stops_the_drive_that_moves(void)
{
    start(false);
    torque_all_on();
    TEST_ASSERT_EQUAL(SERVICE_DONE, ask(SERVICE_HOME, 3, 0));
    rig_run_ms(&m_rig, 200);
    TEST_ASSERT_EQUAL(DRIVE_HOMING, m_rig.drives.axis[2].state);
    rig_run_ms(&m_rig, 60);
    TEST_ASSERT_EQUAL(DRIVE_DISABLED, m_rig.drives.axis[2].state);
    TEST_ASSERT_EQUAL(0x7Bu, seen()->service.torque);
    rig_run_ms(&m_rig, 1000);
    TEST_ASSERT_FALSE(m_rig.drives.axis[2].is_homed);
    TEST_ASSERT_EQUAL(STATE_SERVICE, seen()->state);
}

/* ---- relays, counts, words ---- */

static void test_relay_is_switched_for_as_long_as_it_is_held(void)
{
    m_settings.relay_safe_mask = 0x0002;
    start(true);
    TEST_ASSERT_EQUAL(SERVICE_NO_SUCH, ask(SERVICE_RELAY, 13, 0));
    TEST_ASSERT_EQUAL(SERVICE_NO_SUCH, ask(SERVICE_RELAY, 0, 0));
    TEST_ASSERT_EQUAL(SERVICE_DONE, ask(SERVICE_RELAY, 5, 0));
    hold_ms(1000);
    TEST_ASSERT_EQUAL_HEX16(0x0012, m_rig.relays.mask);
    rig_run_ms(&m_rig, 252);
    TEST_ASSERT_EQUAL_HEX16(0x0002, m_rig.relays.mask);
    TEST_ASSERT_EQUAL(SERVICE_DONE, ask(SERVICE_RELAY, 2, 0)); /* closed where it is safe: it opens */
    rig_run_ms(&m_rig, 5);
    TEST_ASSERT_EQUAL_HEX16(0x0000, m_rig.relays.mask);
    TEST_ASSERT_EQUAL(SERVICE_DONE, ask(SERVICE_RELEASE, 0, 0));
    rig_run_ms(&m_rig, 2);
    TEST_ASSERT_EQUAL_HEX16(0x0002, m_rig.relays.mask);
}

static void test_relay_of_the_healthy_pulse_is_nobodys(void)
{
    m_settings.healthy.relay = 4;
    start(true);
    TEST_ASSERT_EQUAL(SERVICE_PULSE, ask(SERVICE_RELAY, 4, 0));
}

static void test_counts_are_those_of_the_drives_before_there_is_torque(void)
{
    start(false);
    TEST_ASSERT_EQUAL_HEX32(0x7F, seen()->service.has_counts);
    const int64_t before = seen()->service.counts[1];
    m_rig.drives.axis[1].position_q32 -= q32_from_int(3);
    rig_run_ms(&m_rig, 2);
    TEST_ASSERT_EQUAL_INT64(before - 3000, seen()->service.counts[1]);
}

/* Objects of drives: who may do what where. These drives have none. */
static void test_objects_are_read_at_rest_and_written_in_service(void)
{
    const drive_object_t read = {.index = 0x6041};
    const drive_object_t write = {.index = 0x6083, .is_write = true, .size = 4};
    drive_object_t out;
    uint32_t code = 0;
    start(true);
    TEST_ASSERT_EQUAL(SERVICE_NO_SUCH, gateway_object_begin(&m_rig.gateway, 0, &read));
    TEST_ASSERT_EQUAL(SERVICE_NO_SUCH, gateway_object_begin(&m_rig.gateway, 8, &read));
    TEST_ASSERT_EQUAL(SERVICE_NO_OBJECTS, gateway_object_begin(&m_rig.gateway, 1, &read));
    TEST_ASSERT_EQUAL(SERVICE_NO_OBJECTS, gateway_object_begin(&m_rig.gateway, 1, &write));
    TEST_ASSERT_EQUAL(DRIVE_OBJECT_NONE, gateway_object_end(&m_rig.gateway, &out, &code));
    TEST_ASSERT_EQUAL(SERVICE_DONE, ask(SERVICE_JOG_AXIS, 1, 5));
    hold_ms(500);
    TEST_ASSERT_EQUAL(SERVICE_BUSY, gateway_object_begin(&m_rig.gateway, 1, &write));
    TEST_ASSERT_EQUAL(SERVICE_NO_OBJECTS, gateway_object_begin(&m_rig.gateway, 1, &read));
    rig_run_ms(&m_rig, 251); /* nobody holds, and it still moves */
    TEST_ASSERT_EQUAL(SERVICE_BUSY, gateway_object_begin(&m_rig.gateway, 1, &write));
    rig_run_ms(&m_rig, 2000);
    TEST_ASSERT_EQUAL(SERVICE_NO_OBJECTS, gateway_object_begin(&m_rig.gateway, 1, &write));
    TEST_ASSERT_EQUAL(HV_OK, rig_request(&m_rig, EVENT_SERVICE_OFF));
    rig_run_ms(&m_rig, 2000);
    TEST_ASSERT_EQUAL(STATE_OFF, seen()->state);
    TEST_ASSERT_EQUAL(SERVICE_NO_OBJECTS, gateway_object_begin(&m_rig.gateway, 1, &read));
    TEST_ASSERT_EQUAL(SERVICE_NOT_SERVING, gateway_object_begin(&m_rig.gateway, 1, &write));
    m_rig.after_cycle = NULL;
    TEST_ASSERT_EQUAL(HV_OK, rig_request(&m_rig, EVENT_ENGAGE));
    while (seen()->state != STATE_ENGAGED) {
        rig_run_ms(&m_rig, 1);
        const bool is_rest = seen()->state == STATE_OFF;
        TEST_ASSERT_EQUAL(is_rest ? SERVICE_NO_OBJECTS : SERVICE_MOVING, gateway_object_begin(&m_rig.gateway, 1, &read));
        TEST_ASSERT_EQUAL(SERVICE_NOT_SERVING, gateway_object_begin(&m_rig.gateway, 1, &write));
    }
}

static void test_words_are_complete(void)
{
    TEST_ASSERT_EQUAL_STRING("", service_answer_text(SERVICE_DONE));
    for (unsigned i = 1; i < SERVICE_ANSWERS; i++) {
        TEST_ASSERT_TRUE(strlen(service_answer_text((service_answer_t)i)) > 10);
        for (unsigned other = 0; other < i; other++) {
            TEST_ASSERT_TRUE(strcmp(service_answer_name((service_answer_t)i), service_answer_name((service_answer_t)other)) != 0);
        }
    }
    for (unsigned i = 0; i < SERVICE_VERBS; i++) {
        TEST_ASSERT_TRUE(strcmp(service_verb_name((service_verb_t)i), "?") != 0);
    }
    TEST_ASSERT_EQUAL_STRING("?", service_answer_text(SERVICE_ANSWERS));
    TEST_ASSERT_EQUAL_STRING("?", service_answer_name(SERVICE_ANSWERS));
    TEST_ASSERT_EQUAL_STRING("?", service_verb_name((service_verb_t)SERVICE_VERBS));
}

static void test_ticks_are_as_old_as_they_were_shown(void)
{
    start(true);
    const uint64_t tick_us = seen()->service.tick_us;
    TEST_ASSERT_EQUAL_UINT64(1000, gateway_tick_age(&m_rig.gateway, tick_us));
    rig_run_ms(&m_rig, 10);
    TEST_ASSERT_EQUAL_UINT64(11000, gateway_tick_age(&m_rig.gateway, tick_us));
    gateway_note_late(&m_rig.gateway, 5);
    TEST_ASSERT_EQUAL_UINT64(16000, gateway_tick_age(&m_rig.gateway, tick_us)); /* at once: a proof that waited as long is old */
    rig_run_ms(&m_rig, 1);
    TEST_ASSERT_EQUAL_UINT64(17000, gateway_tick_age(&m_rig.gateway, tick_us));
    TEST_ASSERT_EQUAL_UINT64(UINT64_MAX, gateway_tick_age(&m_rig.gateway, tick_us + 1000000));
}

static void go_to_the_middle(void)
{
    TEST_ASSERT_EQUAL(SERVICE_DONE, ask(SERVICE_JOG_POSE, AXIS_Z + 1, 20));
    hold_ms(1500);
    rig_run_ms(&m_rig, 1500);
    forget_speeds();
}

static void test_jog_with_a_way_ends_after_it(void)
{
    start(true);
    const double from = setpoint(2);
    m_way_q16 = Q(5);
    TEST_ASSERT_EQUAL(SERVICE_DONE, ask(SERVICE_JOG_AXIS, 3, 10));
    hold_ms(1000);
    TEST_ASSERT_EQUAL(SERVICE_NOTHING, seen()->service.doing);
    TEST_ASSERT_EQUAL(m_series, seen()->service.finished);
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, from + 5, setpoint(2));
    m_way_q16 = Q(3);
    TEST_ASSERT_EQUAL(SERVICE_DONE, ask(SERVICE_JOG_AXIS, 3, -10));
    hold_ms(1000);
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, from + 2, setpoint(2));
    m_way_q16 = Q(30000); /* further than there is way */
    TEST_ASSERT_EQUAL(SERVICE_DONE, ask(SERVICE_JOG_AXIS, 3, -20));
    hold_ms(3000);
    TEST_ASSERT_EQUAL(m_series, seen()->service.finished);
    TEST_ASSERT_TRUE(setpoint(2) <= from + 2 && setpoint(2) >= 0);
    const double z = (double)seen()->sent.axis_q32[AXIS_Z] / 4294967296.0;
    m_way_q16 = Q(4);
    TEST_ASSERT_EQUAL(SERVICE_DONE, ask(SERVICE_JOG_POSE, AXIS_Z + 1, 20));
    hold_ms(2000);
    TEST_ASSERT_EQUAL(m_series, seen()->service.finished);
    TEST_ASSERT_DOUBLE_WITHIN(1e-4, z + 4, (double)seen()->sent.axis_q32[AXIS_Z] / 4294967296.0);
    TEST_ASSERT_TRUE(rig_is_within_limits(&m_rig));
}

/* ---- test signals ---- */

static double pose_z(void)
{
    return (double)seen()->sent.axis_q32[AXIS_Z] / 4294967296.0;
}

/* A hand for so long; the widest way of z meanwhile. */
static void hold_and_watch_z(unsigned ms, double *least, double *most)
{
    static uint32_t counter = 1000000;
    for (unsigned at = 0; at < ms; at++) {
        rig_run_ms(&m_rig, 1);
        if (at % 50 == 0) {
            (void)beat(++counter, 0);
        }
        *least = pose_z() < *least ? pose_z() : *least;
        *most = pose_z() > *most ? pose_z() : *most;
    }
}

static void test_signal_of_every_kind_ends_where_it_began(void)
{
    static const excitation_request_t k_signals[] = {{EXCITATION_SINE, Q(2), 2000, 0, 4000},
                                                     {EXCITATION_STEP, Q(3), 500, 0, 9000},
                                                     {EXCITATION_CHIRP, Q(5), 500, 20000, 25000},
                                                     {EXCITATION_NOISE, Q(5), 500, 20000, 14000}};
    start(true);
    go_to_the_middle();
    const double middle = pose_z();
    for (unsigned i = 0; i < 4; i++) {
        double least = middle, most = middle;
        const double amplitude = k_signals[i].amplitude_q16 / 65536.0;
        m_signal = k_signals[i];
        TEST_ASSERT_EQUAL(SERVICE_DONE, ask(SERVICE_SIGNAL_POSE, AXIS_Z + 1, 0));
        hold_and_watch_z(k_signals[i].duration_ms + 100, &least, &most);
        TEST_ASSERT_EQUAL(SERVICE_NOTHING, seen()->service.doing);
        TEST_ASSERT_EQUAL(m_series, seen()->service.finished);
        TEST_ASSERT_DOUBLE_WITHIN(1e-5, middle, pose_z());
        TEST_ASSERT_TRUE(most - middle <= amplitude + 1e-5 && middle - least <= amplitude + 1e-5);
        TEST_ASSERT_TRUE(most - middle > amplitude * (i == 3 ? 0.1 : 0.7));
        TEST_ASSERT_TRUE(rig_is_within_limits(&m_rig));
        TEST_ASSERT_EQUAL(0, rig_following_errors(&m_rig));
        for (unsigned k = 0; k < seen()->cylinders; k++) {
            TEST_ASSERT_TRUE(m_fastest[k] <= 100 + 1e-6);
        }
    }
}

static void test_signal_leads_one_cylinder(void)
{
    start(true);
    go_to_the_middle();
    double from[DRIVES_MAX];
    for (unsigned i = 0; i < m_rig.drives.count; i++) {
        from[i] = setpoint(i);
    }
    TEST_ASSERT_EQUAL(SERVICE_DONE, ask(SERVICE_SIGNAL_AXIS, 3, 0));
    hold_ms(4100);
    TEST_ASSERT_EQUAL(m_series, seen()->service.finished);
    for (unsigned i = 0; i < m_rig.drives.count; i++) {
        TEST_ASSERT_TRUE(i == 2 ? m_fastest[i] > 15 : m_fastest[i] == 0);
        TEST_ASSERT_DOUBLE_WITHIN(1e-6, from[i], setpoint(i));
    }
    TEST_ASSERT_TRUE(rig_is_within_limits(&m_rig));
}

/* The limits of a ride stop it: 100 mm/s at 3000 mm/s^2 take 34 ms, and the jerk 60 ms more. */
static void test_signal_without_a_hand_stops(void)
{
    for (unsigned at = 300; at < 4000; at += 370) {
        start(true);
        go_to_the_middle();
        m_signal = (excitation_request_t){EXCITATION_CHIRP, Q(10), 1000, 20000, 12000};
        TEST_ASSERT_EQUAL(SERVICE_DONE, ask(SERVICE_SIGNAL_POSE, AXIS_Z + 1, 0));
        hold_ms(at);
        rig_run_ms(&m_rig, 250 + 150);
        TEST_ASSERT_EQUAL(SERVICE_NOTHING, seen()->service.doing);
        TEST_ASSERT_NOT_EQUAL(m_series, seen()->service.finished);
        forget_speeds();
        rig_run_ms(&m_rig, 500);
        for (unsigned i = 0; i < m_rig.drives.count; i++) {
            TEST_ASSERT_TRUE(m_fastest[i] == 0);
        }
        TEST_ASSERT_TRUE(rig_is_within_limits(&m_rig));
    }
}

/* As motion does where a jog leads near a singularity or beyond the stroke. */
static void test_what_motion_stops_is_not_finished(void)
{
    start(true);
    go_to_the_middle();
    const uint32_t finished = seen()->service.finished;
    TEST_ASSERT_EQUAL(SERVICE_DONE, ask(SERVICE_SIGNAL_AXIS, 3, 0));
    hold_ms(1000);
    motion_stop(&m_rig.gateway.motion);
    hold_ms(1000);
    TEST_ASSERT_EQUAL(SERVICE_NOTHING, seen()->service.doing);
    TEST_ASSERT_EQUAL(finished, seen()->service.finished);
    m_way_q16 = Q(5);
    TEST_ASSERT_EQUAL(SERVICE_DONE, ask(SERVICE_JOG_AXIS, 3, 10));
    hold_ms(200);
    motion_stop(&m_rig.gateway.motion);
    hold_ms(1000);
    TEST_ASSERT_EQUAL(SERVICE_NOTHING, seen()->service.doing);
    TEST_ASSERT_EQUAL(finished, seen()->service.finished);
    TEST_ASSERT_TRUE(rig_is_within_limits(&m_rig));
}

static void test_signal_is_refused_by_name(void)
{
    start(true);
    TEST_ASSERT_EQUAL(SERVICE_AT_END, ask(SERVICE_SIGNAL_POSE, AXIS_Z + 1, 0)); /* settled: no way down */
    go_to_the_middle();
    TEST_ASSERT_EQUAL(SERVICE_NO_SUCH, ask(SERVICE_SIGNAL_AXIS, 9, 0));
    TEST_ASSERT_EQUAL(SERVICE_NO_SUCH, ask(SERVICE_SIGNAL_AXIS, 0, 0));
    TEST_ASSERT_EQUAL(SERVICE_NO_SUCH, ask(SERVICE_SIGNAL_POSE, 7, 0));
    m_signal.amplitude_q16 = Q(10.1);
    TEST_ASSERT_EQUAL(SERVICE_TOO_WIDE, ask(SERVICE_SIGNAL_POSE, AXIS_Z + 1, 0));
    TEST_ASSERT_EQUAL(SERVICE_TOO_WIDE, ask(SERVICE_SIGNAL_AXIS, 2, 0));
    m_signal.amplitude_q16 = Q(3.1);
    TEST_ASSERT_EQUAL(SERVICE_TOO_WIDE, ask(SERVICE_SIGNAL_POSE, AXIS_ROLL + 1, 0));
    m_signal.duration_ms = 2000;
    TEST_ASSERT_EQUAL(SERVICE_BAD_SIGNAL, ask(SERVICE_SIGNAL_POSE, AXIS_Z + 1, 0));
    m_signal.duration_ms = 4000;
    TEST_ASSERT_EQUAL(SERVICE_DONE, ask(SERVICE_TORQUE_OFF, 2, 0));
    rig_run_ms(&m_rig, 100);
    TEST_ASSERT_EQUAL(SERVICE_NO_TORQUE, ask(SERVICE_SIGNAL_POSE, AXIS_Z + 1, 0));
    TEST_ASSERT_EQUAL(SERVICE_DONE, ask(SERVICE_SIGNAL_AXIS, 3, 0)); /* has its own */
    rig_run_ms(&m_rig, 20);
    TEST_ASSERT_EQUAL(SERVICE_BUSY, ask(SERVICE_SIGNAL_AXIS, 4, 0));
}

/* Hands that come and go at random, with any request, for minutes: limits hold, and without a hand everything rests. */
static void test_random_hands_never_move_anything_alone(void)
{
    random_begin(RANDOM_SEED);
    unsigned away_ms = 0, moved = 0;
    uint32_t was_led = 0;
    start(true);
    for (unsigned n = 0; n < 60000; n++) {
        const uint32_t random = random_below(UINT32_MAX);
        const bool is_away = n / 1500u % 2u == 1u;
        const unsigned what = random % 40u;
        if (!is_away && what == 0) {
            (void)ask_aged((service_verb_t)(SERVICE_JOG_AXIS + random / 64u % 6u), random / 256u % 9u,
                           (int)(random / 4096u % 61u) - 30, random / 8192u % 300000u);
        } else if (!is_away && what < 10) {
            (void)beat(n + 1, random / 8192u % 300000u);
        } else if (!is_away && what == 39 && random / 64u % 50u == 0) {
            (void)ask(random / 8192u % 8u ? SERVICE_TORQUE_ON : SERVICE_TORQUE_OFF, random / 256u % 8u, 0);
        }
        away_ms = is_away ? away_ms + 1 : 0;
        forget_speeds();
        rig_run_ms(&m_rig, 1);
        for (unsigned i = 0; i < m_rig.drives.count; i++) {
            const bool is_led = (was_led & seen()->service.torque & ~seen()->service.homing) >> i & 1u;
            moved += is_led && m_fastest[i] > 0;
            TEST_ASSERT_TRUE(!is_led || m_fastest[i] <= (i < 6 ? JOG_MM_S : JOG_DEG_S) + 1e-6);
            TEST_ASSERT_TRUE(away_ms < 250 + 150 || m_fastest[i] == 0);
        }
        was_led = seen()->service.torque & ~seen()->service.homing;
        TEST_ASSERT_EQUAL_STRING("SERVICE", state_name(seen()->state));
    }
    TEST_ASSERT_TRUE(moved > 5000);
    TEST_ASSERT_EQUAL(0, rig_following_errors(&m_rig));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_service_is_entered_from_settled_with_torque_and_moves_nothing);
    RUN_TEST(test_service_is_entered_from_off_without_torque);
    RUN_TEST(test_service_is_refused_where_the_platform_is_up);
    RUN_TEST(test_service_is_refused_while_a_drive_does_not_answer);
    RUN_TEST(test_service_ends_in_off_with_every_drive_off);
    RUN_TEST(test_service_requests_that_lead_up_are_refused);
    RUN_TEST(test_jog_moves_one_cylinder_at_its_speed_while_the_hand_is_there);
    RUN_TEST(test_jog_without_a_hand_stops_after_250_ms_and_its_stop);
    RUN_TEST(test_jog_old_beats_in_a_burst_move_nothing);
    RUN_TEST(test_jog_skipped_cycles_are_time_of_the_hand);
    RUN_TEST(test_jog_ends_at_the_margin_of_the_stroke_and_goes_no_further);
    RUN_TEST(test_jog_of_the_rotation_motor_keeps_its_limit);
    RUN_TEST(test_jog_of_a_pose_axis_goes_straight_and_keeps_every_cylinder_slow);
    RUN_TEST(test_jog_of_a_tripod_takes_the_axes_that_it_has);
    RUN_TEST(test_jog_press_during_another_is_refused_and_changes_nothing);
    RUN_TEST(test_torque_off_during_a_jog_stops_it_first);
    RUN_TEST(test_torque_off_during_homing_stops_it);
    RUN_TEST(test_torque_on_again_does_not_replace_the_stop_of_a_homing);
    RUN_TEST(test_jog_hold_stops_it_and_stays_in_service);
    RUN_TEST(test_jog_fault_and_estop_end_it_as_anywhere);
    RUN_TEST(test_jog_stuck_cylinder_is_a_following_error);
    RUN_TEST(test_torque_of_one_drive_leaves_the_others_alone);
    RUN_TEST(test_torque_comes_on_where_the_cylinder_is);
    RUN_TEST(test_torque_that_does_not_come_is_a_fault);
    RUN_TEST(test_torque_that_is_lost_is_a_fault);
    RUN_TEST(test_torque_outside_of_the_stroke_moves_nothing);
    RUN_TEST(test_home_of_one_drive_goes_on_while_the_hand_is_there);
    RUN_TEST(test_home_goes_on_from_the_new_zero);
    RUN_TEST(test_home_without_a_hand_stops_the_drive_that_moves);
    RUN_TEST(test_relay_is_switched_for_as_long_as_it_is_held);
    RUN_TEST(test_relay_of_the_healthy_pulse_is_nobodys);
    RUN_TEST(test_counts_are_those_of_the_drives_before_there_is_torque);
    RUN_TEST(test_words_are_complete);
    RUN_TEST(test_ticks_are_as_old_as_they_were_shown);
    RUN_TEST(test_jog_with_a_way_ends_after_it);
    RUN_TEST(test_signal_of_every_kind_ends_where_it_began);
    RUN_TEST(test_signal_leads_one_cylinder);
    RUN_TEST(test_signal_without_a_hand_stops);
    RUN_TEST(test_what_motion_stops_is_not_finished);
    RUN_TEST(test_signal_is_refused_by_name);
    RUN_TEST(test_random_hands_never_move_anything_alone);
    RUN_TEST(test_objects_are_read_at_rest_and_written_in_service);
    return UNITY_END();
}
