/* SPDX-License-Identifier: MIT
 * test_canraw_map.c - maps of raw CAN drives that contradict themselves, one change at a time against one that does not; what the
 * driver asks of the bus for it; and float fields against the division of the machine.
 */
#include <string.h>

#include "../../src/drives/canraw_axis.h"
#include "../../src/drives/canraw_float.h"
#include "heave/canraw.h"
#include "sim_can.h"
#include "unity.h"

#define AXES 3u

static canraw_map_t m_map;
static sim_can_bus_t m_bus;
static sim_can_t m_node;
static canraw_t m_driver;

static canraw_field_t field(canraw_value_t value, unsigned at, unsigned bits, bool is_signed)
{
    return (canraw_field_t){.value = value, .at = (uint8_t)at, .bits = (uint8_t)bits, .is_signed = is_signed};
}

static canraw_frame_t constant(unsigned length, unsigned first)
{
    return (canraw_frame_t){.length = (uint8_t)length, .constant = (uint8_t)((1u << length) - 1u), .data = {(uint8_t)first}};
}

/* A byte that tells the frame, and a status behind it. */
static canraw_frame_t status_frame(unsigned first)
{
    return (canraw_frame_t){
        .length = 2, .constant = 0x01, .fields = 1, .data = {(uint8_t)first}, .field = {field(CANRAW_STATUS, 1, 8, false)}};
}

/* Drives with identifiers of their own. */
void setUp(void)
{
    m_map = (canraw_map_t){.axes = AXES,
                           .period_us = 2000,
                           .query_every = 1,
                           .offline_periods = 5,
                           .speed_least = 1,
                           .position_query = constant(1, 0x30),
                           .homing_query = constant(1, 0x31),
                           .homing_reply = status_frame(0x31),
                           .enabled_when = {0x01, 0x01},
                           .fault_when = {0x02, 0x02},
                           .homing_done = {0x01, 0x01}};
    m_map.setpoint = (canraw_frame_t){.length = 8, .constant = 0x01, .fields = 3, .data = {0x10}};
    m_map.setpoint.field[0] = field(CANRAW_POSITION, 1, 32, true);
    m_map.setpoint.field[1] = field(CANRAW_SPEED, 5, 16, false);
    m_map.setpoint.field[2] = field(CANRAW_COUNTER, 7, 8, false);
    m_map.position_reply = (canraw_frame_t){.length = 7, .constant = 0x01, .fields = 3, .data = {0x30}};
    m_map.position_reply.field[0] = field(CANRAW_STATUS, 1, 8, false);
    m_map.position_reply.field[1] = field(CANRAW_POSITION, 2, 32, true);
    m_map.position_reply.field[2] = field(CANRAW_TORQUE, 6, 8, true);
    for (unsigned i = 0; i < CANRAW_COMMANDS; i++) {
        m_map.command[i] = constant(1, 0x20 + i);
    }
    m_map.command[CANRAW_HOME] = constant(2, 0x24);
    m_map.command[CANRAW_HOME].constant = 0x01;
    m_map.command[CANRAW_HOME].fields = 1;
    m_map.command[CANRAW_HOME].field[0] = field(CANRAW_SUM, 1, 8, false);
    m_map.step[0] = (canraw_step_t){.frame = constant(1, 0x40), .answer = constant(2, 0x41)};
    m_map.step[1].frame = constant(1, 0x42);
    for (unsigned k = 0; k < AXES; k++) {
        m_map.axis[k] = (canraw_axis_map_t){.command_id = 0x100 + k,
                                            .setpoint_id = 0x120 + k,
                                            .reply_id = 0x140 + k,
                                            .status_id = 0x160 + k,
                                            .scale = {1000, 1, 0},
                                            .speed = {0, 1, 0},
                                            .step_max_q32 = Q32_ONE,
                                            .following_max_q32 = q32_from_int(10)};
    }
    sim_can_bus_init(&m_bus, 0, NULL, 0);
    TEST_ASSERT_EQUAL(HV_OK, sim_can_open(&m_node, &m_bus, NULL, 0));
}

void tearDown(void)
{
    sim_can_close(&m_node);
}

static hv_status_t init(void)
{
    return canraw_init(&m_driver, &m_map, sim_can_hal(&m_node));
}

/* Their status comes by itself. */
static void give_status(void)
{
    m_map.status_reply = status_frame(0x50);
    m_map.status_every = 10;
}

/* Two drives share the frame of set-points, and that of replies. */
static void share(void)
{
    m_map.axes = 2;
    m_map.setpoint = (canraw_frame_t){.length = 8, .fields = 2};
    m_map.setpoint.field[0] = field(CANRAW_POSITION, 0, 32, true);
    m_map.setpoint.field[1] = field(CANRAW_POSITION, 4, 32, true);
    m_map.setpoint.field[0].slot = 1;
    m_map.setpoint.field[1].slot = 2;
    m_map.position_reply = m_map.setpoint;
    m_map.enabled_when = m_map.fault_when = (canraw_when_t){0, 0};
    for (unsigned k = 0; k < 2; k++) {
        m_map.axis[k].setpoint_id = 0x120;
        m_map.axis[k].reply_id = 0x140;
        m_map.axis[k].setpoint_slot = m_map.axis[k].reply_slot = (uint8_t)(k + 1u);
    }
}

/* ---- maps that are sound ---- */

static void test_map_that_does_not_contradict_itself_is_accepted(void)
{
    TEST_ASSERT_EQUAL(HV_OK, init());
    give_status();
    TEST_ASSERT_EQUAL(HV_OK, init());
    setUp();
    share();
    TEST_ASSERT_EQUAL(HV_OK, init());
}

static void float_of_position(void)
{
    m_map.setpoint.field[0].divisor = CANRAW_DIVISOR_MAX;
}

static void float_of_speed(void)
{
    m_map.setpoint.field[0].bits = 16;
    m_map.setpoint.field[1] = field(CANRAW_SPEED, 3, 32, true);
    m_map.setpoint.field[1].divisor = 10;
}

static void float_of_torque(void)
{
    m_map.position_reply.length = 8;
    m_map.position_reply.field[1].bits = 16;
    m_map.position_reply.field[2] = field(CANRAW_TORQUE, 4, 32, true);
    m_map.position_reply.field[2].divisor = 1000;
}

/* It is shown, and judged by nobody. */
static void status_without_conditions(void)
{
    give_status();
    m_map.enabled_when = m_map.fault_when = (canraw_when_t){0, 0};
}

/* On the identifier of the positions, which it is told from by its first byte. */
static void status_beside_positions(void)
{
    give_status();
    for (unsigned k = 0; k < AXES; k++) {
        m_map.axis[k].status_id = m_map.axis[k].reply_id;
    }
}

/* One for all of them. */
static void status_of_all(void)
{
    give_status();
    for (unsigned k = 0; k < AXES; k++) {
        m_map.axis[k].status_id = 0x160;
    }
}

static void status_that_looks_like_another_reply_elsewhere(void)
{
    give_status();
    m_map.status_reply.data[0] = 0x31;
}

static void every_bit_of_its_own(void)
{
    m_map.setpoint.field[1] = field(CANRAW_SPEED, 5, 12, false);
    m_map.setpoint.field[2] = field(CANRAW_COUNTER, 6, 12, false);
    m_map.setpoint.field[2].skip = 4;
}

static void test_maps_are_accepted(void)
{
    static const struct {
        const char *what;
        void (*change)(void);
    } k_maps[] = {
        {"a float of position", float_of_position},
        {"a float of speed", float_of_speed},
        {"a float of torque", float_of_torque},
        {"a status without conditions", status_without_conditions},
        {"a status on reply_id", status_beside_positions},
        {"a status of all", status_of_all},
        {"alike on different identifiers", status_that_looks_like_another_reply_elsewhere},
        {"fields that begin within a byte", every_bit_of_its_own},
    };
    for (unsigned i = 0; i < sizeof k_maps / sizeof k_maps[0]; i++) {
        setUp();
        k_maps[i].change();
        TEST_ASSERT_EQUAL_MESSAGE(HV_OK, init(), k_maps[i].what);
    }
}

/* ---- fields ---- */

static void test_fields_that_cannot_be_are_refused(void)
{
    static const struct {
        const char *what;
        canraw_field_t field;
    } k_fields[] = {
        {"no bits", {.value = CANRAW_TORQUE, .at = 6, .bits = 0}},
        {"33 bits", {.value = CANRAW_TORQUE, .at = 2, .bits = 33}},
        {"beyond the end", {.value = CANRAW_TORQUE, .at = 6, .bits = 16}},
        {"a whole byte skipped", {.value = CANRAW_TORQUE, .at = 5, .bits = 8, .skip = 8}},
        {"no such value", {.value = (canraw_value_t)CANRAW_VALUES, .at = 6, .bits = 8}},
        {"a check of 7 bits", {.value = CANRAW_XOR, .at = 6, .bits = 7}},
        {"a check that begins within a byte", {.value = CANRAW_XOR, .at = 5, .bits = 8, .skip = 1}},
        {"a check of one drive", {.value = CANRAW_XOR, .at = 6, .bits = 8, .slot = 1}},
        {"a counter of one drive", {.value = CANRAW_COUNTER, .at = 6, .bits = 8, .slot = 1}},
        {"a drive that cannot be", {.value = CANRAW_TORQUE, .at = 6, .bits = 8, .slot = DRIVES_MAX + 1u}},
    };
    for (unsigned i = 0; i < sizeof k_fields / sizeof k_fields[0]; i++) {
        setUp();
        m_map.position_reply.field[2] = k_fields[i].field;
        TEST_ASSERT_EQUAL_MESSAGE(HV_ERR_RANGE, init(), k_fields[i].what);
    }
    m_map.position_reply.field[2] = field(CANRAW_XOR, 6, 8, false);
    TEST_ASSERT_EQUAL(HV_OK, init());
}

static void test_floats_that_cannot_be_are_refused(void)
{
    static const struct {
        const char *what;
        canraw_field_t field;
    } k_fields[] = {
        {"16 bits", {.value = CANRAW_TORQUE, .at = 4, .bits = 16, .is_signed = true, .divisor = 10}},
        {"without a sign", {.value = CANRAW_TORQUE, .at = 4, .bits = 32, .divisor = 10}},
        {"too large a divisor",
         {.value = CANRAW_TORQUE, .at = 4, .bits = 32, .is_signed = true, .divisor = CANRAW_DIVISOR_MAX + 1}},
        {"of a fault code", {.value = CANRAW_FAULT, .at = 4, .bits = 32, .is_signed = true, .divisor = 10}},
    };
    for (unsigned i = 0; i < sizeof k_fields / sizeof k_fields[0]; i++) {
        setUp();
        float_of_torque();
        m_map.position_reply.field[2] = k_fields[i].field;
        TEST_ASSERT_EQUAL_MESSAGE(HV_ERR_RANGE, init(), k_fields[i].what);
    }
}

/* ---- frames ---- */

static void many_counters(void)
{
    m_map.command[CANRAW_ENABLE].fields = CANRAW_FIELDS_MAX + 1u;
    for (unsigned i = 0; i < CANRAW_FIELDS_MAX; i++) {
        m_map.command[CANRAW_ENABLE].field[i] = field(CANRAW_COUNTER, 0, 1, false);
    }
}

static void two_checks(void)
{
    m_map.position_reply.length = 8;
    m_map.position_reply.field[2] = field(CANRAW_SUM, 6, 8, false);
    m_map.position_reply.field[3] = field(CANRAW_XOR, 7, 8, false);
    m_map.position_reply.fields = 4;
}

static void answer_too_long(void)
{
    m_map.step[0].answer.length = 9;
}

static void answer_like_homing(void)
{
    m_map.step[0].answer.data[0] = 0x31;
}

static void answer_like_status(void)
{
    give_status();
    m_map.step[0].answer.data[0] = 0x50;
}

static void answer_like_position(void)
{
    m_map.step[0].answer = constant(7, 0x30);
}

static void answer_to_nothing(void)
{
    m_map.step[5].answer = constant(2, 0x41);
}

static void status_too_long(void)
{
    give_status();
    m_map.status_reply.length = 9;
}

static void status_every_too_many(void)
{
    give_status();
    m_map.status_every = 1001;
}

static void status_like_homing(void)
{
    status_beside_positions();
    m_map.status_reply.data[0] = 0x31;
}

static void status_like_position(void)
{
    status_beside_positions();
    m_map.status_reply.data[0] = 0x30;
}

static void status_where_setpoints_are(void)
{
    give_status();
    m_map.axis[2].status_id = m_map.axis[0].setpoint_id;
}

static void status_where_commands_are(void)
{
    give_status();
    m_map.axis[2].status_id = m_map.axis[0].command_id;
}

static void test_frames_that_confuse_are_refused(void)
{
    static const struct {
        const char *what;
        void (*change)(void);
    } k_maps[] = {
        {"more fields than there may be", many_counters},
        {"two check bytes", two_checks},
        {"an answer of nine bytes", answer_too_long},
        {"an answer like that to the homing query", answer_like_homing},
        {"an answer like a status", answer_like_status},
        {"an answer like a position", answer_like_position},
        {"an answer without a step", answer_to_nothing},
        {"a status of nine bytes", status_too_long},
        {"a status every 1001 periods", status_every_too_many},
        {"a status like the homing reply", status_like_homing},
        {"a status like a position", status_like_position},
        {"a status with the identifier of set-points", status_where_setpoints_are},
        {"a status with the identifier of commands", status_where_commands_are},
    };
    for (unsigned i = 0; i < sizeof k_maps / sizeof k_maps[0]; i++) {
        setUp();
        k_maps[i].change();
        TEST_ASSERT_EQUAL_MESSAGE(HV_ERR_RANGE, init(), k_maps[i].what);
    }
}

/* ---- drives ---- */

static void test_identifiers_beyond_those_of_the_frames_are_refused(void)
{
    uint32_t *const ids[] = {&m_map.axis[1].command_id, &m_map.axis[1].setpoint_id, &m_map.axis[1].reply_id,
                             &m_map.axis[1].status_id};
    for (unsigned i = 0; i < sizeof ids / sizeof ids[0]; i++) {
        const uint32_t good = *ids[i];
        m_map.is_extended = false;
        *ids[i] = CAN_ID_MAX + 1u;
        TEST_ASSERT_EQUAL(HV_ERR_RANGE, init());
        m_map.is_extended = true;
        TEST_ASSERT_EQUAL(HV_OK, init());
        *ids[i] = CAN_ID_EXTENDED_MAX + 1u;
        TEST_ASSERT_EQUAL(HV_ERR_RANGE, init());
        *ids[i] = good;
    }
}

static void test_slots_that_a_frame_does_not_have_are_refused(void)
{
    uint8_t *const slots[] = {&m_map.axis[1].setpoint_slot, &m_map.axis[1].reply_slot, &m_map.axis[1].status_slot};
    for (unsigned i = 0; i < sizeof slots / sizeof slots[0]; i++) {
        give_status();
        *slots[i] = 1; /* each frame has the fields of all */
        TEST_ASSERT_EQUAL(HV_ERR_RANGE, init());
        *slots[i] = 0;
        TEST_ASSERT_EQUAL(HV_OK, init());
    }
}

/* Fields of its own in a shared frame, or a frame of its own: for each of two drives. */
static void test_drives_that_share_a_frame_need_a_slot_each(void)
{
    for (unsigned k = 0; k < 2; k++) {
        setUp();
        share();
        m_map.axis[k].setpoint_slot = 0;
        m_map.setpoint.field[k].slot = 0;
        TEST_ASSERT_EQUAL(HV_ERR_RANGE, init());
        setUp();
        share();
        m_map.axis[k].reply_slot = 0;
        m_map.position_reply.field[k].slot = 0;
        TEST_ASSERT_EQUAL(HV_ERR_RANGE, init());
    }
}

/* ---- what is received ---- */

static void test_filters_are_those_of_replies_and_of_another_master_each_once(void)
{
    hal_can_filter_t filter[CANRAW_FILTERS_MAX];
    TEST_ASSERT_EQUAL_UINT32(3 * AXES, canraw_filters(&m_map, filter));
    status_beside_positions();
    TEST_ASSERT_EQUAL_UINT32(3 * AXES, canraw_filters(&m_map, filter));
    status_of_all();
    TEST_ASSERT_EQUAL_UINT32(3 * AXES + 1, canraw_filters(&m_map, filter));
    TEST_ASSERT_EQUAL_UINT32(2 * AXES, canraw_owns(&m_map, filter));
    share();
    TEST_ASSERT_EQUAL_UINT32(3, canraw_owns(&m_map, filter));
    TEST_ASSERT_EQUAL_HEX32(0x100, filter[0].id);
    TEST_ASSERT_EQUAL_HEX32(0x120, filter[1].id);
    TEST_ASSERT_EQUAL_HEX32(0x101, filter[2].id);
    TEST_ASSERT_EQUAL_HEX32(CAN_ID_MAX, filter[0].mask);
    m_map.is_extended = true;
    TEST_ASSERT_EQUAL_UINT32(3, canraw_owns(&m_map, filter));
    TEST_ASSERT_EQUAL_HEX32(CAN_ID_EXTENDED_MAX, filter[0].mask);
    TEST_ASSERT_TRUE(filter[0].is_extended);
}

/* ---- floats ---- */

static uint32_t bits_of(float value)
{
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    return bits;
}

static void check_float(int64_t counts, uint32_t divisor)
{
    const float quotient = (float)counts / (float)divisor; /* both are exact: rounded once, to the nearest */
    int64_t back = 0;
    TEST_ASSERT_EQUAL_HEX32(counts == 0 ? 0 : bits_of(quotient), canraw_float_from(counts, divisor));
    TEST_ASSERT_TRUE(canraw_float_to(bits_of(quotient), divisor, &back));
    TEST_ASSERT_EQUAL_INT64(counts, back);
}

static void test_floats_are_those_of_the_machine(void)
{
    uint32_t random = 2463534242u;
    for (unsigned n = 0; n < 300000; n++) {
        random ^= random << 13;
        random ^= random >> 17;
        random ^= random << 5;
        const uint32_t divisor = random % (n % 2 ? CANRAW_DIVISOR_MAX : 2000) + 1;
        random ^= random << 13;
        random ^= random >> 17;
        random ^= random << 5;
        check_float((int64_t)(random % (2u * CANRAW_FLOAT_MAX + 1u)) - CANRAW_FLOAT_MAX, divisor);
    }
    for (uint32_t divisor = 1; divisor <= CANRAW_DIVISOR_MAX; divisor += divisor < 3000 ? 1 : 997) {
        check_float(0, divisor);
        for (unsigned bit = 0; bit < 23; bit++) { /* around each power of two, where a carry would go furthest */
            for (int off = -1; off <= 1; off++) {
                const int64_t near = ((int64_t)divisor << bit) + off;
                const int64_t counts = near <= CANRAW_FLOAT_MAX ? near : ((int64_t)divisor >> bit) + off;
                check_float(counts, divisor);
                check_float(-counts, divisor);
            }
        }
    }
}

/* ---- words ---- */

static void test_faults_of_the_driver_have_words_of_their_own(void)
{
    TEST_ASSERT_EQUAL_STRING("following error", canraw_fault_text(CANRAW_FAULT_FOLLOWING));
    TEST_ASSERT_EQUAL_STRING("homing has failed", canraw_fault_text(CANRAW_FAULT_HOMING));
    TEST_ASSERT_NOT_NULL(strstr(canraw_fault_text(CANRAW_OTHER_MASTER), "another master"));
    TEST_ASSERT_EQUAL_STRING("fault of the drive", canraw_fault_text(1));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_map_that_does_not_contradict_itself_is_accepted);
    RUN_TEST(test_maps_are_accepted);
    RUN_TEST(test_fields_that_cannot_be_are_refused);
    RUN_TEST(test_floats_that_cannot_be_are_refused);
    RUN_TEST(test_frames_that_confuse_are_refused);
    RUN_TEST(test_identifiers_beyond_those_of_the_frames_are_refused);
    RUN_TEST(test_slots_that_a_frame_does_not_have_are_refused);
    RUN_TEST(test_drives_that_share_a_frame_need_a_slot_each);
    RUN_TEST(test_filters_are_those_of_replies_and_of_another_master_each_once);
    RUN_TEST(test_floats_are_those_of_the_machine);
    RUN_TEST(test_faults_of_the_driver_have_words_of_their_own);
    return UNITY_END();
}
