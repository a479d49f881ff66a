/* SPDX-License-Identifier: MIT
 * test_service_drives.c - SERVICE over drives that are not as they should be: a bus that knows all of them together only, one
 * that does not accept what is asked of it, drives that report less than they must; and what a person is told then.
 */

#include "rig.h"
#include "unity.h"

#define Q(x) ((q16_t)((x)*65536.0))
#define ALL  0x7Fu

static rig_t m_rig;
static settings_t m_settings;
static drives_ops_t m_ops; /* those of the rig, with what follows in between */
static drives_ops_t m_inner;
static uint32_t m_series;
static uint32_t m_counter;
static excitation_request_t m_signal;

static hv_status_t m_request;     /* HV_OK: the drives are asked */
static hv_status_t m_request_one; /* the same */
static hv_status_t m_object;
static uint32_t m_asked[DRIVES_RESET_FAULT + 1u];     /* how often of all together */
static uint32_t m_asked_one[DRIVES_RESET_FAULT + 1u]; /* and of one */
static uint32_t m_without_actual;                     /* bit i: drive i + 1 reports no position, */
static uint32_t m_without_zero;                       /* or that it has not found its zero */

static hv_status_t poll(void *ctx, uint64_t now_us, drive_feedback_t *feedback)
{
    const hv_status_t status = m_inner.poll(ctx, now_us, feedback);
    for (unsigned i = 0; i < m_rig.drives.count; i++) {
        feedback[i].has_actual = feedback[i].has_actual && (m_without_actual >> i & 1u) == 0;
        feedback[i].is_homed = feedback[i].is_homed && (m_without_zero >> i & 1u) == 0;
    }
    return status;
}

static hv_status_t request_all(void *ctx, drives_request_t request)
{
    m_asked[request]++;
    return m_request != HV_OK ? m_request : m_inner.request(ctx, request);
}

static hv_status_t request_one(void *ctx, uint8_t axis, drives_request_t request)
{
    m_asked_one[request]++;
    return m_request_one != HV_OK ? m_request_one : m_inner.request_one(ctx, axis, request);
}

static hv_status_t object_begin(void *ctx, uint8_t axis, const drive_object_t *object)
{
    (void)ctx;
    (void)axis;
    (void)object;
    return m_object;
}

static drive_object_state_t object_end(void *ctx, drive_object_t *out, uint32_t *code)
{
    (void)ctx;
    (void)out;
    *code = 7;
    return DRIVE_OBJECT_DONE;
}

void setUp(void)
{
    m_settings = rig_hexapod();
    m_settings.engage = ENGAGE_MANUAL;
    m_series = 0;
    m_counter = 0;
    m_signal = (excitation_request_t){EXCITATION_SINE, Q(2), 2000, 0, 4000};
    m_request = m_request_one = m_object = HV_OK;
    m_without_actual = m_without_zero = 0;
}

void tearDown(void) {}

static const snapshot_t *seen(void)
{
    return gateway_snapshot(&m_rig.gateway);
}

static double setpoint(unsigned drive)
{
    return drive <= seen()->cylinders ? rig_cylinder_mm(&m_rig, drive) : rig_angle_deg(&m_rig);
}

static service_answer_t ask(service_verb_t verb, unsigned axis, double speed)
{
    const service_request_t request = {.verb = verb,
                                       .axis = (uint8_t)axis,
                                       .speed_q16 = Q(speed),
                                       .signal = m_signal,
                                       .series = service_is_held(verb) ? ++m_series : m_series};
    return gateway_service(&m_rig.gateway, &request, m_rig.now_us);
}

static void hold_ms(unsigned ms)
{
    for (unsigned at = 0; at < ms; at += 50) {
        const service_request_t request = {.verb = SERVICE_BEAT, .series = m_series, .counter = ++m_counter};
        (void)!gateway_service(&m_rig.gateway, &request, m_rig.now_us);
        rig_run_ms(&m_rig, ms - at < 50 ? ms - at : 50);
    }
}

static void forget_requests(void)
{
    for (unsigned i = 0; i <= DRIVES_RESET_FAULT; i++) {
        m_asked[i] = m_asked_one[i] = 0;
    }
}

/* In SERVICE; from SETTLED with torque and zeros, else from OFF without. */
static void start(bool is_settled, bool is_one_by_one)
{
    rig_start(&m_rig, &m_settings, is_settled);
    m_inner = m_ops = *m_rig.gateway.io.drives.ops;
    m_ops.poll = poll;
    m_ops.request = request_all;
    m_ops.request_one = is_one_by_one ? request_one : NULL;
    m_ops.object_begin = object_begin;
    m_ops.object_end = object_end;
    m_rig.gateway.io.drives.ops = &m_ops;
    m_rig.is_auto_checking = true;
    rig_run_ms(&m_rig, 20);
    TEST_ASSERT_EQUAL(HV_OK, rig_request(&m_rig, EVENT_SERVICE));
    rig_run_ms(&m_rig, 10);
    TEST_ASSERT_EQUAL(STATE_SERVICE, seen()->state);
    forget_requests();
}

static void assert_well(void)
{
    TEST_ASSERT_EQUAL_STRING("SERVICE", state_name(seen()->state));
    TEST_ASSERT_EQUAL(0, rig_following_errors(&m_rig));
    TEST_ASSERT_TRUE(rig_is_within_limits(&m_rig));
}

/* ---- a bus that knows all drives together only ---- */

static void test_together_one_drive_is_refused_by_name_and_nothing_is_asked(void)
{
    start(true, false);
    TEST_ASSERT_EQUAL(SERVICE_TOGETHER, ask(SERVICE_TORQUE_OFF, 2, 0));
    TEST_ASSERT_EQUAL(SERVICE_TOGETHER, ask(SERVICE_TORQUE_ON, 2, 0));
    TEST_ASSERT_EQUAL(SERVICE_TOGETHER, ask(SERVICE_HOME, 2, 0));
    rig_run_ms(&m_rig, 100);
    for (unsigned i = 0; i <= DRIVES_RESET_FAULT; i++) {
        TEST_ASSERT_EQUAL(0, m_asked[i]);
    }
    TEST_ASSERT_EQUAL_HEX32(ALL, seen()->service.torque);
    TEST_ASSERT_EQUAL(SERVICE_NOTHING, seen()->service.doing);
    assert_well();
}

static void test_together_torque_and_zeros_are_those_of_all(void)
{
    start(false, false);
    TEST_ASSERT_EQUAL(SERVICE_DONE, ask(SERVICE_TORQUE_ON, SERVICE_ALL, 0));
    rig_run_ms(&m_rig, 200);
    TEST_ASSERT_EQUAL(1, m_asked[DRIVES_ENABLE]); /* not once more for each that is on its way */
    TEST_ASSERT_EQUAL_HEX32(ALL, seen()->service.torque);
    TEST_ASSERT_EQUAL(SERVICE_DONE, ask(SERVICE_HOME, SERVICE_ALL, 0));
    hold_ms(3000);
    TEST_ASSERT_EQUAL(m_series, seen()->service.finished);
    TEST_ASSERT_EQUAL(SERVICE_DONE, ask(SERVICE_JOG_AXIS, 3, 5)); /* a single one may move */
    hold_ms(500);
    TEST_ASSERT_TRUE(setpoint(3) > 1 && setpoint(2) < 0.001);
    TEST_ASSERT_EQUAL(SERVICE_DONE, ask(SERVICE_TORQUE_OFF, SERVICE_ALL, 0));
    rig_run_ms(&m_rig, 500);
    TEST_ASSERT_EQUAL_HEX32(0, seen()->service.torque);
    TEST_ASSERT_EQUAL(1, m_asked[DRIVES_DISABLE]);
    for (unsigned i = 0; i < m_rig.drives.count; i++) {
        TEST_ASSERT_EQUAL(DRIVE_DISABLED, m_rig.drives.axis[i].state);
    }
    TEST_ASSERT_EQUAL(STATE_SERVICE, seen()->state);
    TEST_ASSERT_EQUAL(0, rig_following_errors(&m_rig));
}

/* Those that have found their zero stop with the others: a stop of those alone the bus does not know, and without one they would
 * go on with no hand there. */
static void test_together_homing_without_a_hand_stops_when_some_have_their_zero(void)
{
    start(false, false);
    m_rig.drives.axis[1].position_q32 = 0;
    rig_run_ms(&m_rig, 2);
    TEST_ASSERT_EQUAL(SERVICE_DONE, ask(SERVICE_TORQUE_ON, SERVICE_ALL, 0));
    rig_run_ms(&m_rig, 200);
    TEST_ASSERT_EQUAL(SERVICE_DONE, ask(SERVICE_HOME, SERVICE_ALL, 0));
    hold_ms(100);
    TEST_ASSERT_EQUAL(DRIVE_ENABLED, m_rig.drives.axis[1].state);
    TEST_ASSERT_EQUAL(DRIVE_HOMING, m_rig.drives.axis[2].state);
    TEST_ASSERT_EQUAL_HEX32(ALL & ~0x42u, seen()->service.homing);
    rig_run_ms(&m_rig, 260);
    TEST_ASSERT_EQUAL(1, m_asked[DRIVES_QUICK_STOP]);
    for (unsigned i = 0; i < m_rig.drives.count; i++) {
        TEST_ASSERT_EQUAL(DRIVE_DISABLED, m_rig.drives.axis[i].state);
    }
    TEST_ASSERT_EQUAL_HEX32(0, seen()->service.torque);
    rig_run_ms(&m_rig, 2000);
    TEST_ASSERT_FALSE(m_rig.drives.axis[2].is_homed);
    TEST_ASSERT_EQUAL(STATE_SERVICE, seen()->state);
}

static void test_together_torque_that_the_bus_does_not_accept_is_told_and_not_waited_for(void)
{
    static const hv_status_t k_refusals[] = {HV_ERR_AGAIN, HV_ERR_STATE, HV_ERR_IO};
    start(false, false);
    for (unsigned i = 0; i < 3; i++) {
        m_request = k_refusals[i];
        TEST_ASSERT_EQUAL(SERVICE_NOT_TAKEN, ask(SERVICE_TORQUE_ON, SERVICE_ALL, 0));
    }
    m_request = HV_OK;
    rig_run_ms(&m_rig, 11000); /* nor is it a fault that no torque has come */
    TEST_ASSERT_EQUAL_HEX32(0, seen()->service.torque);
    TEST_ASSERT_EQUAL(DRIVE_DISABLED, m_rig.drives.axis[0].state);
    assert_well();
}

/* ---- a bus that does not accept a request now ---- */

static void test_torque_off_of_one_drive_is_asked_until_the_bus_accepts_it(void)
{
    start(true, true);
    m_request_one = HV_ERR_AGAIN;
    TEST_ASSERT_EQUAL(SERVICE_DONE, ask(SERVICE_TORQUE_OFF, 3, 0));
    rig_run_ms(&m_rig, 20);
    TEST_ASSERT_EQUAL_HEX32(ALL & ~4u, seen()->service.torque); /* it is not relied on any more */
    TEST_ASSERT_EQUAL(20, m_asked_one[DRIVES_DISABLE]);
    TEST_ASSERT_EQUAL(DRIVE_ENABLED, m_rig.drives.axis[2].state);
    TEST_ASSERT_EQUAL(SERVICE_NO_TORQUE, ask(SERVICE_JOG_AXIS, 3, 5));
    m_request_one = HV_OK;
    rig_run_ms(&m_rig, 20);
    TEST_ASSERT_EQUAL(21, m_asked_one[DRIVES_DISABLE]);
    TEST_ASSERT_EQUAL(DRIVE_DISABLED, m_rig.drives.axis[2].state);
    assert_well();
}

/* The drives move by themselves then: what stops them must not get lost. */
static void test_stop_of_homing_is_asked_until_the_bus_accepts_it(void)
{
    for (unsigned is_all = 0; is_all < 2; is_all++) {
        m_settings.has_angle = !is_all; /* it has its zero at once */
        start(false, true);
        TEST_ASSERT_EQUAL(SERVICE_DONE, ask(SERVICE_TORQUE_ON, SERVICE_ALL, 0));
        rig_run_ms(&m_rig, 200);
        TEST_ASSERT_EQUAL(SERVICE_DONE, ask(SERVICE_HOME, is_all ? SERVICE_ALL : 3, 0));
        rig_run_ms(&m_rig, 100);
        TEST_ASSERT_EQUAL(DRIVE_HOMING, m_rig.drives.axis[2].state);
        forget_requests();
        m_request = m_request_one = HV_ERR_AGAIN;
        TEST_ASSERT_EQUAL(SERVICE_DONE, ask(SERVICE_RELEASE, 0, 0));
        rig_run_ms(&m_rig, 20);
        TEST_ASSERT_EQUAL(20, is_all ? m_asked[DRIVES_QUICK_STOP] : m_asked_one[DRIVES_QUICK_STOP]);
        TEST_ASSERT_EQUAL(SERVICE_BUSY, ask(SERVICE_TORQUE_ON, 3, 0)); /* it would replace the stop */
        m_request = m_request_one = HV_OK;
        rig_run_ms(&m_rig, 20);
        TEST_ASSERT_EQUAL(DRIVE_DISABLED, m_rig.drives.axis[2].state);
        TEST_ASSERT_FALSE(m_rig.drives.axis[2].is_homed);
        TEST_ASSERT_EQUAL_HEX32(is_all ? 0 : ALL & ~4u, seen()->service.torque);
        TEST_ASSERT_EQUAL(STATE_SERVICE, seen()->state);
    }
}

static void test_home_that_the_drives_do_not_accept_holds_nothing(void)
{
    start(true, true);
    m_request = m_request_one = HV_ERR_STATE;
    TEST_ASSERT_EQUAL(SERVICE_NOT_TAKEN, ask(SERVICE_HOME, SERVICE_ALL, 0));
    TEST_ASSERT_EQUAL(SERVICE_NOT_TAKEN, ask(SERVICE_HOME, 4, 0));
    rig_run_ms(&m_rig, 10);
    TEST_ASSERT_EQUAL(SERVICE_NOTHING, seen()->service.doing);
    TEST_ASSERT_EQUAL_HEX32(0, seen()->service.homing);
    TEST_ASSERT_FALSE(seen()->service.is_held);
    TEST_ASSERT_EQUAL(SERVICE_DONE, ask(SERVICE_JOG_AXIS, 4, 5));
    assert_well();
}

/* ---- drives that report less than they must ---- */

static void test_torque_without_a_position_does_not_count(void)
{
    start(false, true);
    m_without_actual = 2;
    TEST_ASSERT_EQUAL(SERVICE_DONE, ask(SERVICE_TORQUE_ON, SERVICE_ALL, 0));
    rig_run_ms(&m_rig, 500);
    TEST_ASSERT_EQUAL(DRIVE_ENABLED, m_rig.drives.axis[1].state);
    TEST_ASSERT_EQUAL_HEX32(ALL & ~2u, seen()->service.torque);
    TEST_ASSERT_EQUAL(SERVICE_NO_TORQUE, ask(SERVICE_JOG_AXIS, 2, 5));
    rig_run_ms(&m_rig, 10000);
    TEST_ASSERT_EQUAL(STATE_FAULT, seen()->state);
    TEST_ASSERT_EQUAL(FAULT_DRIVE_TIMEOUT, seen()->fault.code);
}

static void test_drive_without_a_position_leaves_its_set_point(void)
{
    start(false, true);
    const double first = setpoint(1), second = setpoint(2);
    m_without_actual = 2;
    m_rig.drives.axis[0].position_q32 += q32_from_int(3);
    m_rig.drives.axis[1].position_q32 += q32_from_int(3);
    rig_run_ms(&m_rig, 10);
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, first + 3, setpoint(1));
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, second, setpoint(2));
}

static void test_home_that_ends_without_a_zero_is_waited_for_and_then_a_fault(void)
{
    start(true, true);
    m_without_zero = 4;
    TEST_ASSERT_EQUAL(SERVICE_DONE, ask(SERVICE_HOME, 3, 0));
    hold_ms(119900);
    TEST_ASSERT_EQUAL(DRIVE_ENABLED, m_rig.drives.axis[2].state);
    TEST_ASSERT_EQUAL_HEX32(4, seen()->service.homing);
    TEST_ASSERT_EQUAL(STATE_SERVICE, seen()->state);
    hold_ms(200);
    TEST_ASSERT_EQUAL(STATE_FAULT, seen()->state);
    TEST_ASSERT_EQUAL(FAULT_DRIVE_TIMEOUT, seen()->fault.code);
}

/* One that takes too long is a fault, also where others behind it are in time, and whatever time those have. */
static void test_torque_that_does_not_come_is_a_fault_beside_drives_in_time(void)
{
    for (unsigned is_home = 0; is_home < 2; is_home++) {
        start(false, true);
        TEST_ASSERT_EQUAL(SERVICE_DONE, ask(SERVICE_TORQUE_ON, 5, 0));
        rig_run_ms(&m_rig, 200);
        m_rig.drives.axis[1].is_frozen = true;
        TEST_ASSERT_EQUAL(SERVICE_DONE, ask(SERVICE_TORQUE_ON, 2, 0));
        rig_run_ms(&m_rig, 9900);
        m_rig.drives.axis[3].is_frozen = m_rig.drives.axis[4].is_frozen = true;
        TEST_ASSERT_EQUAL(SERVICE_DONE, is_home ? ask(SERVICE_HOME, 5, 0) : ask(SERVICE_TORQUE_ON, 4, 0));
        rig_run_ms(&m_rig, 90);
        TEST_ASSERT_EQUAL(STATE_SERVICE, seen()->state);
        rig_run_ms(&m_rig, 20);
        TEST_ASSERT_EQUAL(STATE_FAULT, seen()->state);
        TEST_ASSERT_EQUAL(FAULT_DRIVE_TIMEOUT, seen()->fault.code);
    }
}

/* ---- what is refused ---- */

static void test_what_is_not_there_is_refused_by_name(void)
{
    start(true, true);
    TEST_ASSERT_EQUAL(SERVICE_NO_SUCH, ask(SERVICE_NOTHING, 1, 5));
    TEST_ASSERT_EQUAL(SERVICE_NO_SUCH, ask((service_verb_t)SERVICE_VERBS, 1, 5));
    TEST_ASSERT_EQUAL(SERVICE_NO_SUCH, ask(SERVICE_TORQUE_ON, 8, 0));
    TEST_ASSERT_EQUAL(SERVICE_NO_SUCH, ask(SERVICE_TORQUE_OFF, 8, 0));
    TEST_ASSERT_EQUAL(SERVICE_NO_SUCH, ask(SERVICE_HOME, 8, 0));
    TEST_ASSERT_EQUAL(SERVICE_NO_SUCH, ask(SERVICE_JOG_AXIS, SERVICE_ALL, 5));
    TEST_ASSERT_EQUAL(SERVICE_NO_SUCH, ask(SERVICE_JOG_POSE, 0, 5));
    TEST_ASSERT_EQUAL(SERVICE_NO_SUCH, ask(SERVICE_JOG_POSE, POSE_AXES + 1, 5));
    TEST_ASSERT_EQUAL(SERVICE_NO_SUCH, ask(SERVICE_SIGNAL_POSE, 0, 0));
    rig_run_ms(&m_rig, 100);
    TEST_ASSERT_EQUAL(SERVICE_NOTHING, seen()->service.doing);
    TEST_ASSERT_EQUAL_HEX32(ALL, seen()->service.torque);
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, 6, setpoint(1));
    assert_well();
}

static void test_signal_needs_the_zeros_of_what_it_moves(void)
{
    start(true, true);
    TEST_ASSERT_EQUAL(SERVICE_DONE, ask(SERVICE_JOG_POSE, AXIS_Z + 1, 20));
    hold_ms(1500);
    TEST_ASSERT_EQUAL(SERVICE_DONE, ask(SERVICE_RELEASE, 0, 0));
    rig_run_ms(&m_rig, 500);
    m_without_zero = 4;
    rig_run_ms(&m_rig, 2);
    TEST_ASSERT_EQUAL(SERVICE_NOT_HOMED, ask(SERVICE_SIGNAL_AXIS, 3, 0));
    TEST_ASSERT_EQUAL(SERVICE_NOT_HOMED, ask(SERVICE_SIGNAL_POSE, AXIS_Z + 1, 0));
    TEST_ASSERT_EQUAL(SERVICE_NOT_HOMED, ask(SERVICE_JOG_POSE, AXIS_Z + 1, 5));
    TEST_ASSERT_EQUAL(SERVICE_DONE, ask(SERVICE_SIGNAL_AXIS, 2, 0)); /* has its own */
    assert_well();
}

/* Strokes so long that not all extensions belong to a pose: these do not. The cylinders can be moved one by one all the same. */
static void test_pose_that_the_extensions_do_not_have_is_told(void)
{
    for (unsigned i = 0; i < CYLINDERS_MAX; i++) {
        m_settings.geometry.retracted_mm_q16[i] = Q(650);
        m_settings.stroke_mm_q16[i] = Q(1200);
    }
    start(false, true);
    for (unsigned i = 0; i < m_rig.drives.count; i++) {
        m_rig.drives.axis[i].is_homed = true;
        m_rig.drives.axis[i].position_q32 = q32_from_int(i % 2 == 0 ? 1195 : 5);
    }
    rig_run_ms(&m_rig, 10);
    TEST_ASSERT_EQUAL(SERVICE_DONE, ask(SERVICE_TORQUE_ON, SERVICE_ALL, 0));
    rig_run_ms(&m_rig, 200);
    TEST_ASSERT_EQUAL(SERVICE_NO_POSE, ask(SERVICE_JOG_POSE, AXIS_Z + 1, 5));
    TEST_ASSERT_EQUAL(SERVICE_NO_POSE, ask(SERVICE_SIGNAL_POSE, AXIS_Z + 1, 0));
    TEST_ASSERT_EQUAL(SERVICE_DONE, ask(SERVICE_JOG_AXIS, 1, -20));
    hold_ms(2000);
    TEST_ASSERT_TRUE(setpoint(1) < 1195 - 30);
    TEST_ASSERT_EQUAL(STATE_SERVICE, seen()->state);
    TEST_ASSERT_EQUAL(0, rig_following_errors(&m_rig));
}

/* The hand is off, and the platform has not come to rest yet: what it held last still stops. */
static void test_nothing_begins_before_a_stop_has_ended(void)
{
    start(true, true);
    TEST_ASSERT_EQUAL(SERVICE_DONE, ask(SERVICE_JOG_POSE, AXIS_Z + 1, 20));
    hold_ms(1000);
    TEST_ASSERT_EQUAL(SERVICE_DONE, ask(SERVICE_RELEASE, 0, 0));
    rig_run_ms(&m_rig, 5);
    TEST_ASSERT_EQUAL(SERVICE_NOTHING, seen()->service.doing);
    TEST_ASSERT_EQUAL(SERVICE_BUSY, ask(SERVICE_JOG_AXIS, 2, 5));
    TEST_ASSERT_EQUAL(SERVICE_BUSY, ask(SERVICE_JOG_POSE, AXIS_Z + 1, 5));
    TEST_ASSERT_EQUAL(SERVICE_BUSY, ask(SERVICE_SIGNAL_AXIS, 2, 0));
    TEST_ASSERT_EQUAL(SERVICE_BUSY, ask(SERVICE_SIGNAL_POSE, AXIS_Z + 1, 0));
    rig_run_ms(&m_rig, 500);
    TEST_ASSERT_EQUAL(SERVICE_DONE, ask(SERVICE_SIGNAL_POSE, AXIS_Z + 1, 0));
    assert_well();
}

/* ---- what is held ---- */

static void test_torque_off_leaves_a_relay_held(void)
{
    start(true, true);
    TEST_ASSERT_EQUAL(SERVICE_DONE, ask(SERVICE_RELAY, 5, 0));
    rig_run_ms(&m_rig, 10);
    TEST_ASSERT_EQUAL(SERVICE_DONE, ask(SERVICE_TORQUE_OFF, SERVICE_ALL, 0));
    hold_ms(500);
    TEST_ASSERT_EQUAL(SERVICE_RELAY, seen()->service.doing);
    TEST_ASSERT_EQUAL_HEX16(0x0010, m_rig.relays.mask);
    TEST_ASSERT_EQUAL_HEX32(0, seen()->service.torque);
    TEST_ASSERT_EQUAL(DRIVE_DISABLED, m_rig.drives.axis[0].state);
}

/* A release that was on its way for long is not that of the present press. */
static void test_release_of_another_press_stops_nothing(void)
{
    start(true, true);
    TEST_ASSERT_EQUAL(SERVICE_DONE, ask(SERVICE_RELEASE, 0, 0)); /* nothing is held */
    TEST_ASSERT_EQUAL(SERVICE_DONE, ask(SERVICE_JOG_AXIS, 3, 5));
    hold_ms(200);
    TEST_ASSERT_EQUAL(SERVICE_DONE, ask(SERVICE_RELEASE, 0, 0));
    rig_run_ms(&m_rig, 500);
    TEST_ASSERT_EQUAL(SERVICE_DONE, ask(SERVICE_JOG_AXIS, 3, 5));
    hold_ms(200);
    const service_request_t late = {.verb = SERVICE_RELEASE, .series = m_series - 1u};
    TEST_ASSERT_EQUAL(SERVICE_DONE, gateway_service(&m_rig.gateway, &late, m_rig.now_us));
    rig_run_ms(&m_rig, 10);
    TEST_ASSERT_EQUAL(SERVICE_JOG_AXIS, seen()->service.doing);
    TEST_ASSERT_TRUE(seen()->service.is_held);
    assert_well();
}

/* ---- objects of drives ---- */

static void test_objects_are_answered_as_the_driver_does(void)
{
    static const struct {
        hv_status_t status;
        service_answer_t answer;
    } k_answers[] = {{HV_OK, SERVICE_DONE},           {HV_ERR_NOSUP, SERVICE_NO_OBJECTS}, {HV_ERR_STATE, SERVICE_ABSENT},
                     {HV_ERR_ARG, SERVICE_RELIED_ON}, {HV_ERR_AGAIN, SERVICE_NOT_TAKEN},  {HV_ERR_RANGE, SERVICE_NOT_TAKEN}};
    const drive_object_t write = {.index = 0x6083, .is_write = true, .size = 4};
    drive_object_t out;
    uint32_t code = 0;
    start(true, true);
    for (unsigned i = 0; i < sizeof k_answers / sizeof k_answers[0]; i++) {
        m_object = k_answers[i].status;
        TEST_ASSERT_EQUAL(k_answers[i].answer, gateway_object_begin(&m_rig.gateway, 7, &write));
    }
    TEST_ASSERT_EQUAL(DRIVE_OBJECT_DONE, gateway_object_end(&m_rig.gateway, &out, &code));
    TEST_ASSERT_EQUAL_UINT32(7, code);
}

/* A drive that has stopped is asked why; nothing is written to it. */
static void test_objects_are_read_in_fault_and_estop(void)
{
    const drive_object_t read = {.index = 0x603F};
    const drive_object_t write = {.index = 0x6083, .is_write = true, .size = 4};
    start(true, true);
    rig_break(&m_rig, SIM_DRIVES_FAULT, 0, 0x2310);
    rig_run_ms(&m_rig, 5);
    TEST_ASSERT_EQUAL(STATE_FAULT, seen()->state);
    TEST_ASSERT_EQUAL(SERVICE_DONE, gateway_object_begin(&m_rig.gateway, 1, &read));
    TEST_ASSERT_EQUAL(SERVICE_NOT_SERVING, gateway_object_begin(&m_rig.gateway, 1, &write));
    start(true, true);
    sim_inputs_set(&m_rig.inputs, INPUT_ESTOP, true);
    rig_run_ms(&m_rig, 5);
    TEST_ASSERT_EQUAL(STATE_ESTOP, seen()->state);
    TEST_ASSERT_EQUAL(SERVICE_DONE, gateway_object_begin(&m_rig.gateway, 1, &read));
    TEST_ASSERT_EQUAL(SERVICE_NOT_SERVING, gateway_object_begin(&m_rig.gateway, 1, &write));
}

/* ---- requests at random ---- */

/* A drive whose torque was taken, or that is to be stopped, is not wanted: nothing puts its torque on again by itself. */
static void test_random_requests_never_want_what_is_to_be_off(void)
{
    static const hv_status_t k_statuses[] = {HV_OK, HV_OK, HV_ERR_AGAIN, HV_ERR_STATE};
    uint32_t random = 2463534242u;
    unsigned due = 0;
    start(true, true);
    for (unsigned n = 0; n < 40000; n++) {
        random ^= random << 13;
        random ^= random >> 17;
        random ^= random << 5;
        m_request = k_statuses[random / 32u % 4u];
        m_request_one = k_statuses[random / 128u % 4u];
        if (random % 8u == 0) {
            (void)ask((service_verb_t)(random / 512u % SERVICE_VERBS), random / 8192u % 9u, (int)(random / 131072u % 21u) - 10);
        }
        rig_run_ms(&m_rig, 1);
        const service_t *service = &m_rig.gateway.sequencer.service;
        due += (service->off_due | service->stop_due) != 0;
        TEST_ASSERT_EQUAL_HEX32(0, service->wanted & (service->off_due | service->stop_due));
        TEST_ASSERT_EQUAL_HEX32(0, service->homing & ~service->up);
        TEST_ASSERT_EQUAL_STRING("SERVICE", state_name(seen()->state));
    }
    TEST_ASSERT_GREATER_THAN_UINT(300, due);
    TEST_ASSERT_EQUAL(0, rig_following_errors(&m_rig));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_together_one_drive_is_refused_by_name_and_nothing_is_asked);
    RUN_TEST(test_together_torque_and_zeros_are_those_of_all);
    RUN_TEST(test_together_homing_without_a_hand_stops_when_some_have_their_zero);
    RUN_TEST(test_together_torque_that_the_bus_does_not_accept_is_told_and_not_waited_for);
    RUN_TEST(test_torque_off_of_one_drive_is_asked_until_the_bus_accepts_it);
    RUN_TEST(test_stop_of_homing_is_asked_until_the_bus_accepts_it);
    RUN_TEST(test_home_that_the_drives_do_not_accept_holds_nothing);
    RUN_TEST(test_torque_without_a_position_does_not_count);
    RUN_TEST(test_drive_without_a_position_leaves_its_set_point);
    RUN_TEST(test_home_that_ends_without_a_zero_is_waited_for_and_then_a_fault);
    RUN_TEST(test_torque_that_does_not_come_is_a_fault_beside_drives_in_time);
    RUN_TEST(test_what_is_not_there_is_refused_by_name);
    RUN_TEST(test_signal_needs_the_zeros_of_what_it_moves);
    RUN_TEST(test_pose_that_the_extensions_do_not_have_is_told);
    RUN_TEST(test_nothing_begins_before_a_stop_has_ended);
    RUN_TEST(test_torque_off_leaves_a_relay_held);
    RUN_TEST(test_release_of_another_press_stops_nothing);
    RUN_TEST(test_objects_are_answered_as_the_driver_does);
    RUN_TEST(test_objects_are_read_in_fault_and_estop);
    RUN_TEST(test_random_requests_never_want_what_is_to_be_off);
    return UNITY_END();
}
