/* SPDX-License-Identifier: MIT
 * test_canraw_stops.c - raw CAN drives on a bus played by hand: what stops them is not lost with them or with the bus, nothing
 * comes between, and frames that are no replies count for nothing.
 */
#include <string.h>

#include "heave/canraw.h"
#include "unity.h"

#define CYCLE_US  1000u
#define PERIOD_US 2000u
#define AXES      2u
#define ENABLE    0x20u
#define DISABLE   0x21u
#define STOP      0x22u
#define RESET     0x23u
#define HOME      0x24u
#define QUERY     0x30u
#define STEP      0x40u
#define LOG       20000u

static canraw_map_t m_map;
static canraw_t m_driver;
static drives_t m_drives;
static drive_feedback_t m_feedback[DRIVES_MAX];
static q32_t m_setpoint_q32[DRIVES_MAX];
static uint64_t m_now_us;

/* The bus. */
static can_frame_t m_sent[LOG];
static unsigned m_count;
static can_frame_t m_waiting[16];
static unsigned m_to_receive, m_received;
static unsigned m_refused_byte; /* frames that begin so are not taken */
static uint32_t m_unconfirmed;
static hal_can_state_t m_state;

/* The drives. */
static bool m_is_alive[AXES];
static uint8_t m_status[AXES]; /* bit 0 torque, bit 1 fault, bit 2 homed */
static int16_t m_counts[AXES];

static hv_status_t bus_send(void *ctx, const can_frame_t *frame)
{
    (void)ctx;
    if (frame->data[0] == m_refused_byte) {
        return HV_ERR_AGAIN;
    }
    TEST_ASSERT_LESS_THAN_UINT(LOG, m_count);
    m_sent[m_count++] = *frame;
    const unsigned k = frame->id - 0x100u;
    if (k < AXES && frame->length == 1) {
        m_status[k] = (uint8_t)(frame->data[0] == ENABLE    ? m_status[k] | 1u
                                : frame->data[0] == DISABLE ? m_status[k] & ~1u
                                                            : m_status[k]);
    }
    return HV_OK;
}

static hv_status_t bus_recv(void *ctx, can_frame_t *out, uint64_t *rx_time_us)
{
    (void)ctx;
    if (m_received == m_to_receive) {
        m_received = m_to_receive = 0;
        return HV_ERR_AGAIN;
    }
    *out = m_waiting[m_received++];
    *rx_time_us = m_now_us;
    return HV_OK;
}

static hv_status_t bus_state(void *ctx, hal_can_state_t *out)
{
    (void)ctx;
    *out = m_state;
    return HV_OK;
}

static hv_status_t bus_unconfirmed(void *ctx, uint32_t *frames)
{
    (void)ctx;
    *frames = m_unconfirmed;
    return HV_OK;
}

static hv_status_t bus_restart(void *ctx)
{
    (void)ctx;
    return HV_ERR_AGAIN;
}

static const hal_can_ops_t k_bus = {
    .send = bus_send, .recv = bus_recv, .bus_state = bus_state, .unconfirmed = bus_unconfirmed, .restart = bus_restart};

static canraw_field_t field(canraw_value_t value, unsigned at, unsigned bits, bool is_signed)
{
    return (canraw_field_t){.value = value, .at = (uint8_t)at, .bits = (uint8_t)bits, .is_signed = is_signed};
}

static canraw_frame_t byte(unsigned value)
{
    return (canraw_frame_t){.length = 1, .constant = 0x01, .data = {(uint8_t)value}};
}

/* 1000 counts per mm; a status and a position in each reply, to a query. */
static void describe(void)
{
    m_map = (canraw_map_t){.axes = AXES,
                           .period_us = PERIOD_US,
                           .query_every = 1,
                           .offline_periods = 5,
                           .position_query = byte(QUERY),
                           .command = {[CANRAW_STOP] = byte(STOP),
                                       [CANRAW_DISABLE] = byte(DISABLE),
                                       [CANRAW_RESET] = byte(RESET),
                                       [CANRAW_ENABLE] = byte(ENABLE),
                                       [CANRAW_HOME] = byte(HOME)},
                           .enabled_when = {0x01, 0x01},
                           .fault_when = {0x02, 0x02},
                           .homing_done = {0x04, 0x04}};
    m_map.setpoint = (canraw_frame_t){.length = 3, .constant = 0x01, .fields = 1, .data = {0x10}};
    m_map.setpoint.field[0] = field(CANRAW_POSITION, 1, 16, true);
    m_map.position_reply = (canraw_frame_t){.length = 4, .constant = 0x01, .fields = 2, .data = {QUERY}};
    m_map.position_reply.field[0] = field(CANRAW_STATUS, 1, 8, false);
    m_map.position_reply.field[1] = field(CANRAW_POSITION, 2, 16, true);
    for (unsigned k = 0; k < AXES; k++) {
        m_map.axis[k] = (canraw_axis_map_t){.command_id = 0x100 + k,
                                            .setpoint_id = 0x100 + k,
                                            .reply_id = 0x140 + k,
                                            .status_id = 0x160 + k,
                                            .scale = {1000, 1, 0},
                                            .speed = {0, 1, 0},
                                            .step_max_q32 = Q32_ONE,
                                            .following_max_q32 = q32_from_int(10)};
    }
}

void setUp(void)
{
    m_now_us = 10000000;
    m_count = m_to_receive = m_received = 0;
    m_refused_byte = UINT32_MAX;
    m_unconfirmed = 0;
    m_state = HAL_CAN_ACTIVE;
    memset(m_setpoint_q32, 0, sizeof m_setpoint_q32);
    for (unsigned k = 0; k < AXES; k++) {
        m_is_alive[k] = true;
        m_status[k] = 4;
        m_counts[k] = 0;
    }
    describe();
}

void tearDown(void) {}

static void start(void)
{
    TEST_ASSERT_EQUAL(HV_OK, canraw_init(&m_driver, &m_map, (hal_can_t){&k_bus, NULL}));
    m_drives = canraw_hal(&m_driver);
}

static void receive(uint32_t id, unsigned length, const uint8_t *data)
{
    can_frame_t frame = {.id = id, .length = (uint8_t)length};
    memcpy(frame.data, data, length);
    m_waiting[m_to_receive++] = frame;
}

static void reply(unsigned k)
{
    const uint8_t data[] = {QUERY, m_status[k], (uint8_t)(m_counts[k] & 0xFF), (uint8_t)(m_counts[k] >> 8)};
    receive(0x140 + k, 4, data);
}

static void poll(void)
{
    m_now_us += CYCLE_US;
    (void)!drives_poll(m_drives, m_now_us, m_feedback);
}

static void run_ms(unsigned ms)
{
    for (unsigned i = 0; i < ms; i++) {
        for (unsigned k = 0; k < AXES; k++) {
            if (m_is_alive[k]) {
                reply(k);
            }
        }
        poll();
        (void)!drives_send(m_drives, m_now_us, m_setpoint_q32);
    }
}

static unsigned count_to(unsigned k, unsigned value)
{
    unsigned count = 0;
    for (unsigned i = 0; i < m_count; i++) {
        count += m_sent[i].id == 0x100 + k && m_sent[i].data[0] == value;
    }
    return count;
}

static void forget(void)
{
    m_count = 0;
}

static void assert_states(drive_state_t first, drive_state_t second)
{
    TEST_ASSERT_EQUAL(first, m_feedback[0].state);
    TEST_ASSERT_EQUAL(second, m_feedback[1].state);
}

static void enable(void)
{
    start();
    run_ms(20);
    assert_states(DRIVE_DISABLED, DRIVE_DISABLED);
    TEST_ASSERT_EQUAL(HV_OK, drives_request(m_drives, DRIVES_ENABLE));
    run_ms(20);
    assert_states(DRIVE_ENABLED, DRIVE_ENABLED);
    forget();
}

static drive_report_t report(unsigned k)
{
    drive_report_t out;
    m_drives.ops->report(m_drives.ctx, (uint8_t)k, &out);
    return out;
}

/* ---- lost under torque ---- */

/* It may hear what it does not answer: it is stopped, then its torque is taken, and only then it is started up again. */
static void test_lost_drive_is_stopped_before_it_is_started_up(void)
{
    m_map.step[0].frame = byte(STEP);
    enable();
    m_is_alive[0] = false;
    run_ms(1000);
    assert_states(DRIVE_OFFLINE, DRIVE_ENABLED);
    TEST_ASSERT_EQUAL(1, count_to(0, STOP));
    run_ms(3500);
    TEST_ASSERT_EQUAL(0, count_to(0, STEP));
    TEST_ASSERT_EQUAL(0, count_to(0, DISABLE));
    run_ms(3000);
    TEST_ASSERT_EQUAL(1, count_to(0, STOP));
    TEST_ASSERT_GREATER_THAN_UINT(1, count_to(0, STEP));
    unsigned last = 0;
    for (unsigned i = 0; i < m_count; i++) { /* torque off before each attempt: the drive may have had it all the time */
        if (m_sent[i].id == 0x100 && m_sent[i].data[0] != QUERY) {
            TEST_ASSERT_TRUE(m_sent[i].data[0] != STEP || last == DISABLE);
            last = m_sent[i].data[0];
        }
    }
    TEST_ASSERT_TRUE(m_feedback[0].is_energized); /* nobody has seen that it is off */
}

static void test_lost_drive_is_not_started_up_where_its_torque_was_not_taken(void)
{
    m_map.step[0].frame = byte(STEP);
    enable();
    m_is_alive[0] = false;
    run_ms(5050);
    forget();
    m_refused_byte = DISABLE;
    run_ms(3000);
    TEST_ASSERT_EQUAL(0, count_to(0, STEP));
    m_refused_byte = STEP;
    run_ms(100);
    TEST_ASSERT_GREATER_THAN_UINT(0, count_to(0, DISABLE));
    m_refused_byte = UINT32_MAX;
    run_ms(1500);
    TEST_ASSERT_GREATER_THAN_UINT(0, count_to(0, STEP));
}

static void test_stop_that_the_bus_has_not_taken_is_not_lost_with_the_drive(void)
{
    static const struct {
        drives_request_t request;
        unsigned frame;
    } k_ends[] = {{DRIVES_QUICK_STOP, STOP}, {DRIVES_DISABLE, DISABLE}};
    for (unsigned i = 0; i < 2; i++) {
        setUp();
        enable();
        m_refused_byte = k_ends[i].frame;
        TEST_ASSERT_EQUAL(HV_OK, drives_request(m_drives, k_ends[i].request));
        m_is_alive[0] = false;
        run_ms(50);
        assert_states(DRIVE_OFFLINE, DRIVE_DISABLED);
        TEST_ASSERT_EQUAL(0, count_to(0, k_ends[i].frame));
        TEST_ASSERT_EQUAL(0, count_to(0, 0x10) > 25); /* nor do set-points go on */
        m_refused_byte = UINT32_MAX;
        run_ms(5);
        TEST_ASSERT_EQUAL(1, count_to(0, k_ends[i].frame));
        TEST_ASSERT_EQUAL(1, count_to(1, k_ends[i].frame));
    }
}

/* ---- whom a request is for ---- */

static void test_request_is_not_sent_to_a_drive_that_is_not_there(void)
{
    int64_t counts = 4711;
    start();
    m_is_alive[1] = false;
    run_ms(20);
    assert_states(DRIVE_DISABLED, DRIVE_OFFLINE);
    TEST_ASSERT_FALSE(drives_counts(m_drives, 1, &counts));
    TEST_ASSERT_EQUAL_INT64(4711, counts);
    TEST_ASSERT_TRUE(drives_counts(m_drives, 0, &counts));
    TEST_ASSERT_EQUAL_INT64(0, counts);
    forget();
    TEST_ASSERT_EQUAL(HV_OK, drives_request(m_drives, DRIVES_DISABLE));
    TEST_ASSERT_EQUAL(HV_OK, drives_request_one(m_drives, 1, DRIVES_DISABLE));
    run_ms(5);
    TEST_ASSERT_EQUAL(1, count_to(0, DISABLE));
    TEST_ASSERT_EQUAL(0, count_to(1, DISABLE));
    m_is_alive[0] = false;
    run_ms(50);
    TEST_ASSERT_EQUAL(HV_ERR_IO, drives_request_one(m_drives, 0, DRIVES_ENABLE));
}

static void test_request_to_a_bus_that_is_gone_is_refused(void)
{
    enable();
    m_state = HAL_CAN_BUS_OFF;
    run_ms(2);
    assert_states(DRIVE_OFFLINE, DRIVE_OFFLINE);
    TEST_ASSERT_EQUAL(HV_ERR_IO, drives_request(m_drives, DRIVES_QUICK_STOP));
    TEST_ASSERT_EQUAL(HV_ERR_IO, drives_request_one(m_drives, 0, DRIVES_QUICK_STOP));
    TEST_ASSERT_EQUAL(HV_ERR_IO, drives_send(m_drives, m_now_us, m_setpoint_q32));
}

/* The program may end once this is false: what stops the drives is on the wire. */
static void test_stopping_lasts_until_the_last_command_is_on_the_wire(void)
{
    start();
    TEST_ASSERT_FALSE(m_drives.ops->is_stopping(m_drives.ctx));
    enable();
    TEST_ASSERT_FALSE(m_drives.ops->is_stopping(m_drives.ctx));
    TEST_ASSERT_EQUAL(HV_OK, drives_request(m_drives, DRIVES_DISABLE));
    TEST_ASSERT_TRUE(m_drives.ops->is_stopping(m_drives.ctx));
    m_unconfirmed = 1;
    run_ms(3);
    TEST_ASSERT_TRUE(m_drives.ops->is_stopping(m_drives.ctx));
    m_unconfirmed = 0;
    run_ms(2);
    TEST_ASSERT_FALSE(m_drives.ops->is_stopping(m_drives.ctx));
    setUp();
    enable();
    TEST_ASSERT_EQUAL(HV_OK, drives_request(m_drives, DRIVES_QUICK_STOP));
    run_ms(200);
    TEST_ASSERT_TRUE(m_drives.ops->is_stopping(m_drives.ctx)); /* not at rest for long enough */
    run_ms(100);
    TEST_ASSERT_EQUAL(1, count_to(0, DISABLE));
    TEST_ASSERT_FALSE(m_drives.ops->is_stopping(m_drives.ctx));
    setUp();
    enable();
    TEST_ASSERT_EQUAL(HV_OK, drives_request(m_drives, DRIVES_QUICK_STOP));
    m_state = HAL_CAN_GONE; /* nobody waits for what cannot come */
    run_ms(2);
    TEST_ASSERT_FALSE(m_drives.ops->is_stopping(m_drives.ctx));
}

/* ---- frames ---- */

/* A status of its own is the one that counts. */
static void give_status(void)
{
    m_map.status_reply = (canraw_frame_t){.length = 3, .constant = 0x01, .fields = 2, .data = {0x50}};
    m_map.status_reply.field[0] = field(CANRAW_STATUS, 1, 8, false);
    m_map.status_reply.field[1] = field(CANRAW_COUNTER, 2, 8, false);
    m_map.status_every = 5;
}

static void status_of(unsigned k, unsigned status, unsigned counter)
{
    const uint8_t data[] = {0x50, (uint8_t)status, (uint8_t)counter};
    receive(0x160 + k, 3, data);
}

static void test_status_beside_that_in_positions_is_the_one_that_counts(void)
{
    give_status();
    start();
    for (unsigned i = 0; i < 20; i++) {
        status_of(0, 4, i);
        status_of(1, 4, i);
        m_status[0] = 6; /* a fault, in the replies with positions */
        run_ms(1);
    }
    assert_states(DRIVE_DISABLED, DRIVE_DISABLED);
    status_of(0, 6, 100);
    run_ms(1);
    assert_states(DRIVE_FAULT, DRIVE_DISABLED);
}

static void test_status_with_the_counter_of_the_last_one_is_old(void)
{
    give_status();
    start();
    for (unsigned i = 0; i < 20; i++) {
        status_of(0, 4, i);
        status_of(1, 4, i);
        run_ms(1);
    }
    status_of(0, 6, 19);
    run_ms(1);
    assert_states(DRIVE_DISABLED, DRIVE_DISABLED);
    TEST_ASSERT_EQUAL_STRING("its alive counter stands still", report(0).trouble);
    for (unsigned i = 0; i < 60; i++) {
        status_of(0, 4, 19);
        status_of(1, 4, 20 + i);
        run_ms(1);
    }
    assert_states(DRIVE_OFFLINE, DRIVE_DISABLED);
}

/* Where the two replies look alike only the one that was asked for counts; what comes late is no trouble of the drive. */
static void test_late_position_is_not_believed_where_homing_was_asked_for(void)
{
    m_map.position_reply.constant = 0;
    m_map.homing_query = byte(0x31);
    m_map.homing_reply = (canraw_frame_t){.length = 8, .fields = 1};
    m_map.homing_reply.field[0] = field(CANRAW_STATUS, 7, 8, false);
    m_status[0] = m_status[1] = 0;
    start();
    run_ms(40);
    const uint32_t strange = m_driver.strange;
    const uint64_t actual_us = m_driver.axis[0].actual_us;
    m_driver.axis[0].asked = CANRAW_ASKED_HOMING;
    m_counts[0] = 500;
    reply(0);
    poll();
    TEST_ASSERT_EQUAL_UINT32(strange + 1, m_driver.strange);
    TEST_ASSERT_EQUAL_UINT64(actual_us, m_driver.axis[0].actual_us);
    TEST_ASSERT_EQUAL_STRING("", report(0).trouble);
}

static void test_reply_with_a_wrong_check_byte_is_named_whichever_it_is(void)
{
    static const uint8_t k_wrong[] = {0x31, 1, 0};
    m_map.homing_query = byte(0x31);
    m_map.homing_reply = (canraw_frame_t){.length = 3, .constant = 0x01, .fields = 2, .data = {0x31}};
    m_map.homing_reply.field[0] = field(CANRAW_STATUS, 1, 8, false);
    m_map.homing_reply.field[1] = field(CANRAW_SUM, 2, 8, false);
    start();
    run_ms(20);
    receive(0x140, sizeof k_wrong, k_wrong);
    poll();
    TEST_ASSERT_NOT_NULL(strstr(report(0).trouble, "check byte"));
    TEST_ASSERT_EQUAL_HEX32(CANRAW_STRANGE + 1u, report(0).code);
}

static void test_position_that_is_no_number_is_named(void)
{
    m_map.position_reply = (canraw_frame_t){.length = 6, .constant = 0x01, .fields = 2, .data = {QUERY}};
    m_map.position_reply.field[0] = field(CANRAW_STATUS, 1, 8, false);
    m_map.position_reply.field[1] = field(CANRAW_POSITION, 2, 32, true);
    m_map.position_reply.field[1].divisor = 1000;
    static const uint8_t k_nan[] = {QUERY, 4, 0, 0, 0xC0, 0x7F};
    start();
    receive(0x140, sizeof k_nan, k_nan);
    poll();
    TEST_ASSERT_EQUAL(DRIVE_OFFLINE, m_feedback[0].state);
    TEST_ASSERT_NOT_NULL(strstr(report(0).trouble, "no number"));
}

/* ---- starting up ---- */

static void test_answer_to_a_step_has_its_length_and_comes_from_the_drive(void)
{
    static const uint8_t k_answer[] = {0x41, 0};
    give_status();
    m_map.axis[0].status_id = 0x160;
    m_map.step[0].frame = byte(STEP);
    m_map.step[0].answer = byte(0x41);
    m_map.step[1].frame = byte(STEP + 2u);
    start();
    m_is_alive[0] = m_is_alive[1] = false;
    run_ms(20);
    TEST_ASSERT_EQUAL(1, count_to(0, STEP));
    receive(0x140, 2, k_answer); /* longer: another frame */
    run_ms(5);
    TEST_ASSERT_EQUAL(0, count_to(0, STEP + 2u));
    forget();
    receive(0x160, 1, k_answer);
    run_ms(5);
    TEST_ASSERT_EQUAL(0, count_to(0, STEP + 2u));
    receive(0x140, 1, k_answer);
    run_ms(5);
    TEST_ASSERT_EQUAL(1, count_to(0, STEP + 2u));
    TEST_ASSERT_EQUAL(0, count_to(1, STEP + 2u));
}

static void test_all_steps_that_a_map_may_have_are_sent_in_their_order(void)
{
    unsigned next = 0;
    for (unsigned i = 0; i < CANRAW_STEPS_MAX; i++) {
        m_map.step[i].frame = byte(STEP + i);
    }
    start();
    run_ms(30);
    assert_states(DRIVE_DISABLED, DRIVE_DISABLED);
    for (unsigned i = 0; i < m_count && next < CANRAW_STEPS_MAX; i++) {
        next += m_sent[i].id == 0x100 && m_sent[i].data[0] == STEP + next;
    }
    TEST_ASSERT_EQUAL(CANRAW_STEPS_MAX, next);
}

/* Its position comes, but it is not started up: nothing is said of a status that this map does not have. */
static void test_drive_that_is_never_started_up_is_missing(void)
{
    m_map.step[0].frame = byte(STEP);
    m_map.step[0].wait_us = 60000000;
    m_map.step[1].frame = byte(STEP + 1u);
    start();
    run_ms(50);
    assert_states(DRIVE_OFFLINE, DRIVE_OFFLINE);
    TEST_ASSERT_EQUAL_HEX32(CANRAW_SILENT, report(0).code);
}

/* ---- another master ---- */

static void listen(canraw_master_t reaction)
{
    m_map.other_master = reaction;
    for (unsigned k = 0; k < AXES; k++) {
        m_map.axis[k].setpoint_id = 0x120 + k;
    }
}

static void test_set_points_of_another_master_stop_the_drives(void)
{
    static const uint8_t k_setpoint[] = {0x10, 0, 0};
    listen(CANRAW_MASTER_STOP);
    enable();
    m_waiting[m_to_receive++] = (can_frame_t){.id = 0x120, .is_rtr = true, .length = 3};
    m_waiting[m_to_receive++] = (can_frame_t){.id = 0x120, .is_extended = true, .length = 3};
    run_ms(2);
    assert_states(DRIVE_ENABLED, DRIVE_ENABLED); /* these are none of ours */
    receive(0x121, sizeof k_setpoint, k_setpoint);
    run_ms(2);
    assert_states(DRIVE_FAULT, DRIVE_FAULT);
    TEST_ASSERT_EQUAL_HEX32(CANRAW_OTHER_MASTER, m_feedback[0].fault_code);
    TEST_ASSERT_EQUAL(1, count_to(0, STOP));
    TEST_ASSERT_EQUAL(1, count_to(1, STOP));
}

/* Each of its frames may have given torque again. */
static void test_another_master_is_answered_with_what_the_map_has(void)
{
    static const uint8_t k_setpoint[] = {0x10, 0, 0};
    for (unsigned i = 0; i < 4; i++) { /* stop and disable, stop, disable, neither */
        setUp();
        listen(CANRAW_MASTER_STOP);
        m_map.command[CANRAW_STOP] = i < 2 ? byte(STOP) : (canraw_frame_t){.length = 0};
        m_map.command[CANRAW_DISABLE] = i == 0 || i == 2 ? byte(DISABLE) : (canraw_frame_t){.length = 0};
        m_map.enabled_when = (canraw_when_t){0, 0};
        enable();
        for (unsigned n = 0; n < 5; n++) {
            receive(0x120, sizeof k_setpoint, k_setpoint);
            run_ms(4);
        }
        assert_states(DRIVE_FAULT, DRIVE_FAULT);
        TEST_ASSERT_EQUAL(i < 2 ? 5 : 0, count_to(0, STOP));
        TEST_ASSERT_EQUAL(i == 2 ? 5 : 0, count_to(0, DISABLE));
        TEST_ASSERT_EQUAL(i == 0, m_feedback[0].is_energized); /* it brakes; without `disable` nobody knows */
    }
}

static void test_another_master_is_answered_for_a_drive_that_was_lost_under_torque(void)
{
    static const uint8_t k_setpoint[] = {0x10, 0, 0};
    listen(CANRAW_MASTER_STOP);
    enable();
    m_is_alive[0] = m_is_alive[1] = false;
    run_ms(50);
    assert_states(DRIVE_OFFLINE, DRIVE_OFFLINE);
    receive(0x120, sizeof k_setpoint, k_setpoint);
    run_ms(2);
    TEST_ASSERT_FALSE(m_driver.master.is_listening); /* it goes on: they have to hear of their stop */
    TEST_ASSERT_EQUAL(1, count_to(0, STOP));
    m_is_alive[1] = true;
    run_ms(20);
    receive(0x120, sizeof k_setpoint, k_setpoint);
    run_ms(2);
    TEST_ASSERT_EQUAL(DRIVE_OFFLINE, m_feedback[0].state);
    TEST_ASSERT_EQUAL(DRIVE_FAULT, m_feedback[1].state);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_lost_drive_is_stopped_before_it_is_started_up);
    RUN_TEST(test_lost_drive_is_not_started_up_where_its_torque_was_not_taken);
    RUN_TEST(test_stop_that_the_bus_has_not_taken_is_not_lost_with_the_drive);
    RUN_TEST(test_request_is_not_sent_to_a_drive_that_is_not_there);
    RUN_TEST(test_request_to_a_bus_that_is_gone_is_refused);
    RUN_TEST(test_stopping_lasts_until_the_last_command_is_on_the_wire);
    RUN_TEST(test_status_beside_that_in_positions_is_the_one_that_counts);
    RUN_TEST(test_status_with_the_counter_of_the_last_one_is_old);
    RUN_TEST(test_late_position_is_not_believed_where_homing_was_asked_for);
    RUN_TEST(test_reply_with_a_wrong_check_byte_is_named_whichever_it_is);
    RUN_TEST(test_position_that_is_no_number_is_named);
    RUN_TEST(test_answer_to_a_step_has_its_length_and_comes_from_the_drive);
    RUN_TEST(test_all_steps_that_a_map_may_have_are_sent_in_their_order);
    RUN_TEST(test_drive_that_is_never_started_up_is_missing);
    RUN_TEST(test_set_points_of_another_master_stop_the_drives);
    RUN_TEST(test_another_master_is_answered_with_what_the_map_has);
    RUN_TEST(test_another_master_is_answered_for_a_drive_that_was_lost_under_torque);
    return UNITY_END();
}
