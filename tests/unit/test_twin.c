/* SPDX-License-Identifier: MIT */
#include "platform/load.h"
#include "twin/script.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "platform/startup_denied.h"
#include "heave/status.h"
#include "linux_can_local.h"
#include "random.h"
#include "twin/twin_options.h"
#include "twin/wire.h"
#include "unity.h"

#define HEARD_MAX 4096u
#define STEP_US   500u

static config_t m_config;
static twin_settings_t m_settings;
static twin_t m_twin;
static can_frame_t m_heard[HEARD_MAX]; /* what the drives have said */
static unsigned m_count;
static uint64_t m_now_us;
static bus_fault_t m_bus_fault;
static unsigned m_bus_faults;

void hv_assert_failed(const char *file, int line)
{
    fprintf(stderr, "%s:%d\n", file, line);
    abort();
}

static void put(void *ctx, const can_frame_t *frame)
{
    (void)ctx;
    TEST_ASSERT_TRUE(m_count < HEARD_MAX);
    m_heard[m_count++] = *frame;
}

static bool bus(void *ctx, bus_fault_t fault, uint32_t number, char *why, size_t size)
{
    (void)ctx;
    (void)number;
    (void)why;
    (void)size;
    m_bus_fault = fault;
    m_bus_faults++;
    return true;
}

static void run(uint64_t span_us)
{
    const uint64_t end_us = m_now_us + span_us;
    while (m_now_us < end_us) {
        m_now_us += STEP_US;
        twin_advance(&m_twin, m_now_us);
        TEST_ASSERT_TRUE_MESSAGE(twin_due_us(&m_twin) > m_now_us, "what is due has been done: heave-twin would never sleep");
    }
}

static void start(void)
{
    m_count = 0;
    twin_start(&m_twin, &m_config, &m_settings, (node_out_t){put, NULL}, m_now_us);
    m_twin.bus = (twin_bus_t){bus, NULL, false};
    run(400000);
}

void setUp(void)
{
    m_now_us = 1000000;
    m_bus_faults = 0;
    TEST_ASSERT_EQUAL(0, config_load(HEAVE_CONFIG "/hexapod-cia402.ini", &m_config, stderr));
    twin_settings_init(&m_settings, &m_config);
    start();
}

void tearDown(void) {}

static void say(uint32_t id, uint8_t length, const uint8_t *data)
{
    can_frame_t frame = {.id = id, .length = length};
    if (length > 0) {
        memcpy(frame.data, data, length);
    }
    twin_hear(&m_twin, &frame, m_now_us);
}

static const can_frame_t *last(uint32_t id)
{
    for (unsigned i = m_count; i > 0; i--) {
        if (m_heard[i - 1].id == id) {
            return &m_heard[i - 1];
        }
    }
    return NULL;
}

static uint32_t value_of(const uint8_t *data)
{
    return data[0] | (uint32_t)data[1] << 8 | (uint32_t)data[2] << 16 | (uint32_t)data[3] << 24;
}

/* Returns the abort code, 0 = taken. */
static uint32_t ask_write(unsigned node, uint16_t index, uint8_t sub, uint8_t bytes, uint32_t value)
{
    const uint8_t request[8] = {(uint8_t)(0x23 | (4 - bytes) << 2),
                                (uint8_t)index,
                                (uint8_t)(index >> 8),
                                sub,
                                (uint8_t)value,
                                (uint8_t)(value >> 8),
                                (uint8_t)(value >> 16),
                                (uint8_t)(value >> 24)};
    m_count = 0;
    say(0x600 + node, 8, request);
    run(5000);
    const can_frame_t *answer = last(0x580 + node);
    TEST_ASSERT_NOT_NULL(answer);
    return answer->data[0] == 0x60 ? 0 : value_of(answer->data + 4);
}

static uint32_t ask_read(unsigned node, uint16_t index, uint8_t sub)
{
    const uint8_t request[8] = {0x40, (uint8_t)index, (uint8_t)(index >> 8), sub};
    m_count = 0;
    say(0x600 + node, 8, request);
    run(5000);
    const can_frame_t *answer = last(0x580 + node);
    TEST_ASSERT_NOT_NULL(answer);
    TEST_ASSERT_EQUAL_HEX8(0x43, answer->data[0] & 0xF3);
    return value_of(answer->data + 4);
}

static void operational(void)
{
    say(0, 2, (const uint8_t[2]){0x01, 0});
}

/* By SDO alone, as a simple master does. */
static void enable(unsigned node, uint8_t mode)
{
    TEST_ASSERT_EQUAL_HEX32(0, ask_write(node, 0x6060, 0, 1, mode));
    ask_write(node, 0x6040, 0, 2, 0x06);
    ask_write(node, 0x6040, 0, 2, 0x07);
    run(100000);
    ask_write(node, 0x6040, 0, 2, 0x0F);
    run(200000);
    TEST_ASSERT_EQUAL_HEX32(0x27, ask_read(node, 0x6041, 0) & 0x6F);
}

static void act(const char *line)
{
    fault_t fault;
    char why[FAULT_WHY_MAX] = "";
    TEST_ASSERT_TRUE_MESSAGE(fault_read(&fault, line, m_twin.drives, why), why);
    TEST_ASSERT_TRUE(fault_do(&fault, &m_twin, m_now_us, why));
}

/* --- The motor --- */

static void test_motor_follows_with_its_lag(void)
{
    motor_t motor = {.lag_us = 10000};
    motor_start(&motor, 0, 0);
    motor_torque(&motor, true);
    motor_aim(&motor, 1000, 1);
    motor_advance(&motor, 10);
    motor_advance(&motor, 10010);
    TEST_ASSERT_DOUBLE_WITHIN(2, 632, motor.actual);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 1000, motor.demand);
}

static void test_motor_rubs_gives_way_and_meets_its_stops(void)
{
    motor_t motor = {.friction = 5, .stop_low = -100, .stop_high = 100};
    motor_start(&motor, 0, 0);
    motor_torque(&motor, true);
    motor_aim(&motor, 4, 1);
    motor_advance(&motor, 1000);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0, motor.actual);
    motor_aim(&motor, 300, 1);
    motor_advance(&motor, 2000);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 100, motor.actual);
    motor.load = 30;
    motor_aim(&motor, 50, 1);
    motor_advance(&motor, 3000);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 20, motor.actual);
}

static void test_motor_without_torque_is_held_by_its_brake_or_sinks(void)
{
    motor_t motor = {.load = 10};
    motor_start(&motor, 50, 0);
    motor_advance(&motor, 1000000);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 50, motor.actual);
    motor.slip = 20;
    motor_advance(&motor, 2000000);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 30, motor.actual);
}

static void test_motor_stops_by_its_ramp_and_gets_warm(void)
{
    motor_t motor = {.rated_speed = 1000, .ambient_c = 30};
    motor_start(&motor, 0, 0);
    TEST_ASSERT_DOUBLE_WITHIN(0.1, 30, motor.temperature_c);
    motor_torque(&motor, true);
    motor_travel(&motor, 1e9, 1000);
    motor_advance(&motor, 1000000);
    const double at = motor.actual;
    const uint64_t span_us = motor_stop(&motor, 2000);
    TEST_ASSERT_UINT64_WITHIN(2, 500000, span_us);
    motor_advance(&motor, 1000000 + span_us);
    TEST_ASSERT_DOUBLE_WITHIN(1, at + 250, motor.actual);
    motor_travel(&motor, 1e9, 1000);
    for (unsigned s = 2; s < 600; s++) {
        motor_advance(&motor, s * 1000000u);
    }
    TEST_ASSERT_DOUBLE_WITHIN(2, 30 + 45, motor.temperature_c);
}

/* --- CANopen --- */

static void test_node_boots_and_answers_questions(void)
{
    for (unsigned node = 1; node <= 6; node++) {
        const can_frame_t *boot = last(0x700 + node);
        TEST_ASSERT_NOT_NULL(boot);
        TEST_ASSERT_EQUAL(0, boot->data[0]);
    }
    TEST_ASSERT_EQUAL_HEX32(0x00020192, ask_read(3, 0x1000, 0));
    TEST_ASSERT_EQUAL_HEX32(4, ask_read(3, 0x1018, 0));
    TEST_ASSERT_EQUAL_HEX32(OBJECT_MISSING, ask_write(3, 0x5FFF, 0, 4, 1));
    TEST_ASSERT_EQUAL_HEX32(OBJECT_NO_SUB, ask_write(3, 0x1018, 9, 4, 1));
    TEST_ASSERT_EQUAL_HEX32(OBJECT_READ_ONLY, ask_write(3, 0x1000, 0, 4, 1));
    TEST_ASSERT_EQUAL_HEX32(OBJECT_TOO_LONG, ask_write(3, 0x1017, 0, 4, 1));
}

static void test_node_mapping_is_strict(void)
{
    TEST_ASSERT_EQUAL_HEX32(OBJECT_UNSUPPORTED, ask_write(1, 0x1600, 0, 1, 0)); /* switched on */
    TEST_ASSERT_EQUAL_HEX32(OBJECT_BAD_VALUE, ask_write(1, 0x1400, 1, 4, 0x333));
    TEST_ASSERT_EQUAL_HEX32(0, ask_write(1, 0x1400, 1, 4, 0x80000201));
    TEST_ASSERT_EQUAL_HEX32(OBJECT_UNSUPPORTED, ask_write(1, 0x1600, 2, 4, 0x607A0020)); /* counted */
    TEST_ASSERT_EQUAL_HEX32(0, ask_write(1, 0x1600, 0, 1, 0));
    TEST_ASSERT_EQUAL_HEX32(OBJECT_BAD_VALUE, ask_write(1, 0x1400, 1, 4, 0x201)); /* nothing mapped */
    TEST_ASSERT_EQUAL_HEX32(OBJECT_NOT_MAPPABLE, ask_write(1, 0x1600, 1, 4, 0x60640020));
    TEST_ASSERT_EQUAL_HEX32(0, ask_write(1, 0x1600, 1, 4, 0x60400010));
    TEST_ASSERT_EQUAL_HEX32(OBJECT_UNSUPPORTED, ask_write(1, 0x1600, 0, 1, 1)); /* RPDO 2 has it too */
    TEST_ASSERT_EQUAL_HEX32(0, ask_write(1, 0x1401, 1, 4, 0x80000301));
    TEST_ASSERT_EQUAL_HEX32(0, ask_write(1, 0x1600, 0, 1, 1));
    TEST_ASSERT_EQUAL_HEX32(0, ask_write(1, 0x1400, 1, 4, 0x201));
    operational();
    TEST_ASSERT_EQUAL_HEX32(OBJECT_WRONG_STATE, ask_write(1, 0x1400, 1, 4, 0x80000201));
}

static void test_node_loses_its_master_and_its_sync(void)
{
    ask_write(2, 0x1016, 1, 4, 0x7F0064);
    ask_write(2, 0x6007, 0, 2, 1);
    operational();
    enable(2, 8);
    say(0x77F, 1, (const uint8_t[1]){5});
    m_count = 0;
    run(90000);
    TEST_ASSERT_NULL(last(0x82));
    run(20000);
    TEST_ASSERT_NOT_NULL(last(0x82));
    TEST_ASSERT_EQUAL_HEX32(0x8130, value_of(last(0x82)->data) & 0xFFFF);
    TEST_ASSERT_EQUAL_HEX8(TWIN_FAULT, m_twin.node[1].drive.state);
    TEST_ASSERT_EQUAL_HEX8(0x7F, m_twin.node[1].nmt);

    ask_write(4, 0x1006, 0, 4, 4000);
    say(0x80, 0, NULL);
    operational();
    TEST_ASSERT_EQUAL_HEX8(0x05, m_twin.node[3].nmt);
    run(7000);
    TEST_ASSERT_EQUAL_HEX8(0x7F, m_twin.node[3].nmt);
    operational(); /* without SYNC it does not start */
    TEST_ASSERT_EQUAL_HEX8(0x7F, m_twin.node[3].nmt);
}

static void test_node_short_pdo_and_wrong_sync_are_told(void)
{
    operational();
    m_count = 0;
    say(0x301, 4, (const uint8_t[4]){0x06, 0, 0, 0});
    TEST_ASSERT_EQUAL_HEX32(0x8210, value_of(last(0x81)->data) & 0xFFFF);
    say(0x80, 1, (const uint8_t[1]){1});
    TEST_ASSERT_EQUAL_HEX32(0x8240, value_of(last(0x81)->data) & 0xFFFF);
}

/* --- Drives --- */

static void test_drive_stops_without_set_points_and_at_jumps(void)
{
    ask_write(1, 0x60C2, 1, 1, 4);
    operational();
    enable(1, 8);
    for (unsigned i = 0; i < 3; i++) {
        say(0x80, 0, NULL);
        run(4000);
    }
    TEST_ASSERT_EQUAL_HEX32(0x8250, ask_read(1, 0x603F, 0));
    enable(2, 8);
    const uint32_t far = (uint32_t)drive_count(&m_twin.node[1].drive) + 100u * 13107u;
    say(0x302, 6, (const uint8_t[6]){0x0F, 0, (uint8_t)far, (uint8_t)(far >> 8), (uint8_t)(far >> 16), (uint8_t)(far >> 24)});
    say(0x80, 0, NULL);
    TEST_ASSERT_EQUAL_HEX32(0x8611, ask_read(2, 0x603F, 0));
}

static void test_drive_finds_a_blocked_axis_and_is_reset_by_an_edge(void)
{
    ask_write(1, 0x6065, 0, 4, 5000);
    ask_write(1, 0x6081, 0, 4, 100000);
    operational();
    enable(1, 1);
    act("jam 1");
    ask_write(1, 0x607A, 0, 4, (uint32_t)drive_count(&m_twin.node[0].drive) + 50000u);
    ask_write(1, 0x6040, 0, 2, 0x1F);
    run(200000);
    TEST_ASSERT_EQUAL_HEX32(0x8611, ask_read(1, 0x603F, 0));
    act("broken 1");
    ask_write(1, 0x6040, 0, 2, 0x00);
    ask_write(1, 0x6040, 0, 2, 0x80);
    TEST_ASSERT_EQUAL_HEX32(TWIN_FAULT, ask_read(1, 0x6041, 0) & 0x4F);
    act("mend 1");
    ask_write(1, 0x6040, 0, 2, 0x00);
    ask_write(1, 0x6040, 0, 2, 0x80);
    TEST_ASSERT_EQUAL_HEX32(TWIN_DISABLED, ask_read(1, 0x6041, 0) & 0x4F);
}

static double homed_at(void)
{
    for (unsigned i = 0; i < m_config.cia402.homing.method.count; i++) {
        m_config.cia402.homing.method.value[i] = 17;
    }
    start();
    TEST_ASSERT_EQUAL_HEX32(0, ask_read(1, 0x6064, 0)); /* it counts from where it was switched on */
    ask_write(1, 0x6098, 0, 1, 17);
    ask_write(1, 0x6099, 1, 4, 2000000);
    operational();
    enable(1, 6);
    ask_write(1, 0x6040, 0, 2, 0x1F);
    run(8000000);
    TEST_ASSERT_EQUAL_HEX32(0x1400, ask_read(1, 0x6041, 0) & 0x3400);
    TEST_ASSERT_INT32_WITHIN(1, 0, (int32_t)ask_read(1, 0x6064, 0));
    return twin_position(&m_twin, 0);
}

static void test_drive_homes_where_it_is_in_and_backwards_where_it_is_out(void)
{
    TEST_ASSERT_DOUBLE_WITHIN(0.1, 0, homed_at());
    m_settings.is_reversed[0] = true;
    TEST_ASSERT_DOUBLE_WITHIN(0.1, 400, homed_at());
}

/* --- The mechanism --- */

static void test_mechanism_shows_how_it_was_put_together(void)
{
    const twin_options_t options = {
        .swap = {"2,5"}, .swaps = 1, .reverse = "4", .lead = "3=2.0", .zero = "1=-500", .start = "100"};
    pose_t pose;
    TEST_ASSERT_EQUAL(0, twin_options_apply(&options, 6, 6, &m_settings));
    start();
    TEST_ASSERT_EQUAL(4, m_twin.leg_of[1]);
    TEST_ASSERT_EQUAL(1, m_twin.leg_of[4]);
    TEST_ASSERT_INT32_WITHIN(1, -1310720, (int32_t)ask_read(4, 0x6064, 0)); /* 100 mm the wrong way */
    TEST_ASSERT_INT32_WITHIN(1, 655360, (int32_t)ask_read(3, 0x6064, 0));   /* half of the counts */
    TEST_ASSERT_INT32_WITHIN(1, 1310720 - 500, (int32_t)ask_read(1, 0x6064, 0));
    for (unsigned k = 0; k < 6; k++) {
        TEST_ASSERT_DOUBLE_WITHIN(1e-6, 100, twin_position(&m_twin, k));
    }
    TEST_ASSERT_TRUE(twin_find_pose(&m_twin, &pose));
    TEST_ASSERT_DOUBLE_WITHIN(1e-3, 0, (double)pose.axis_q32[AXIS_ROLL] / (double)Q32_ONE);
    m_twin.node[1].drive.motor.actual += 20 * m_twin.per_unit[1]; /* drive 2 is on leg 5 */
    TEST_ASSERT_TRUE(twin_find_pose(&m_twin, &pose));
    q32_t legs[CYLINDERS_MAX];
    TEST_ASSERT_EQUAL(HV_OK, kin_inverse(&m_twin.kin, &pose, legs));
    TEST_ASSERT_DOUBLE_WITHIN(0.01, 120, (double)legs[4] / (double)Q32_ONE);
    TEST_ASSERT_DOUBLE_WITHIN(0.01, 100, (double)legs[1] / (double)Q32_ONE);
}

static void test_options_that_mean_nothing_are_refused(void)
{
    static const twin_options_t k_wrong[] = {{.swap = {"2,7"}, .swaps = 1},
                                             {.swap = {"2"}, .swaps = 1},
                                             {.swap = {"0,1"}, .swaps = 1},
                                             {.reverse = "7"},
                                             {.reverse = "1,"},
                                             {.reverse = ""},
                                             {.lead = "3"},
                                             {.lead = "3=0"},
                                             {.lead = "7=1"},
                                             {.lead = "3=1,"},
                                             {.lead = "3=x"},
                                             {.zero = "9=1"},
                                             {.start = "high"},
                                             {.lag = "-1"},
                                             {.friction = "1mm"}};
    for (unsigned i = 0; i < sizeof k_wrong / sizeof k_wrong[0]; i++) {
        twin_settings_init(&m_settings, &m_config);
        TEST_ASSERT_EQUAL_MESSAGE(64, twin_options_apply(&k_wrong[i], 6, 6, &m_settings), "taken");
    }
}

/* --- Faults --- */

static void test_faults_every_line_of_the_table_can_be_read_and_done(void)
{
    static const char *const k_words[] = {"DRIVE",       "2",      "CODE",    "0x1000",     "COUNT", "3",         "MS",
                                          "5",           "NUMBER", "1",       "SET",        "1",     "CLEAR",     "2",
                                          "INDEX[:SUB]", "6065:0", "ABORT",   "0x06010000", "VALUE", "1",         "NODE",
                                          "9",           "MM_S",   "5",       "MM",         "1",     "ADDRESS",   "0x0300",
                                          "open|closed", "open",   "SECTION", "healthy",    "NAME",  "slow-reset"};
    const char *name;
    const char *arguments;
    const char *help;
    unsigned count = 0;
    unsigned others = 0;
    lines_t lines = {.count = SWITCHES + 1, .line = {{.section = LINES_HEALTHY}}};
    for (unsigned i = 0; i < SWITCHES; i++) {
        lines.line[i + 1] = (line_t){.section = LINES_INPUTS, .number = i};
    }
    for (; fault_describe(count, &name, &arguments, &help); count++) {
        char line[120];
        char words[120] = "";
        (void)snprintf(words, sizeof words, "%s", arguments == NULL ? "" : arguments);
        int at = snprintf(line, sizeof line, "%s", name);
        for (char *word = strtok(words, " "); word != NULL; word = strtok(NULL, " ")) {
            const char *found = NULL;
            char plain[32];
            const bool is_optional = word[0] == '[';
            (void)snprintf(plain, sizeof plain, "%.*s", (int)strlen(word) - (is_optional ? 2 : 0), word + (is_optional ? 1 : 0));
            for (unsigned i = 0; i < sizeof k_words / sizeof k_words[0]; i += 2) {
                found = strcmp(k_words[i], plain) == 0 ? k_words[i + 1] : found;
            }
            TEST_ASSERT_NOT_NULL_MESSAGE(found, plain);
            at += snprintf(line + at, sizeof line - (size_t)at, " %s", found);
        }
        fault_t fault;
        char why[FAULT_WHY_MAX] = "";
        TEST_ASSERT_TRUE_MESSAGE(fault_read(&fault, line, m_twin.drives, why), why);
        const fault_machine_t here = {.kind = TWIN_DRIVES_CIA402};
        const fault_machine_t modbus = {.kind = TWIN_DRIVES_MODBUS, .has_board = true};
        const fault_machine_t frames = {.kind = TWIN_DRIVES_FRAMES};
        const fault_machine_t with_lines = {.kind = TWIN_DRIVES_NONE, .lines = &lines};
        if (!fault_suits(&fault, &here, why)) { /* test_twin_modbus.c, test_twin_frames.c, test_twin_lines.c */
            TEST_ASSERT_TRUE_MESSAGE(fault_suits(&fault, &modbus, why) || fault_suits(&fault, &frames, why) ||
                                         fault_suits(&fault, &with_lines, why),
                                     why);
            others++;
            continue;
        }
        start();
        act(line);
        run(10000);
    }
    TEST_ASSERT_TRUE(count > 35);
    TEST_ASSERT_EQUAL(17, others);
    TEST_ASSERT_EQUAL(9, m_bus_faults);
}

static void test_faults_wrong_lines_say_what_is_wrong(void)
{
    static const char *const k_lines[][2] = {{"", "no name of a fault"},
                                             {"explode 2", "there is no fault explode"},
                                             {"jam", "this is written as: jam DRIVE"},
                                             {"jam 7", "there is no drive 7"},
                                             {"jam 0", "there is no drive 0"},
                                             {"jam 2,", "there is no drive 2,"},
                                             {"jam 2 3", "written as"},
                                             {"jam 2,9", "there is no drive 2,9"},
                                             {"emcy 2", "written as"},
                                             {"emcy 2 x", "x is no number"},
                                             {"emcy 2 70000", "from 0 to 65535"},
                                             {"sdo-mute 2 zz", "zz is no object"},
                                             {"sdo-mute 2 1FFF:1", "no object 1FFF:1"},
                                             {"node 2 300", "from 0 to 127"},
                                             {"bus-off now", "written as: bus-off"}};
    for (unsigned i = 0; i < sizeof k_lines / sizeof k_lines[0]; i++) {
        fault_t fault;
        char why[FAULT_WHY_MAX] = "";
        TEST_ASSERT_FALSE_MESSAGE(fault_read(&fault, k_lines[i][0], 6, why), k_lines[i][0]);
        TEST_ASSERT_NOT_NULL_MESSAGE(strstr(why, k_lines[i][1]), why);
    }
}

static void test_faults_of_a_drive_show_on_the_bus(void)
{
    operational();
    m_count = 0;
    act("emcy 2,3 0x5000");
    TEST_ASSERT_NOT_NULL(last(0x82));
    TEST_ASSERT_NOT_NULL(last(0x83));
    TEST_ASSERT_EQUAL_HEX32(TWIN_DISABLED, m_twin.node[1].drive.state);
    act("fault 2");
    run(2000);
    TEST_ASSERT_EQUAL_HEX32(0x2310, value_of(last(0x82)->data) & 0xFFFF);
    act("sdo-refuse 1 1017:0 0x06090030");
    TEST_ASSERT_EQUAL_HEX32(OBJECT_BAD_VALUE, ask_write(1, 0x1017, 0, 2, 10));
    act("missing 1 6065");
    TEST_ASSERT_EQUAL_HEX32(OBJECT_MISSING, ask_write(1, 0x6065, 0, 4, 10));
    act("object 1 60C2:1 7");
    TEST_ASSERT_EQUAL_HEX32(OBJECT_READ_ONLY, ask_write(1, 0x60C2, 1, 1, 4));
    TEST_ASSERT_EQUAL_HEX32(7, ask_read(1, 0x60C2, 1));
    act("sdo-slow 1 50");
    m_count = 0;
    say(0x601, 8, (const uint8_t[8]){0x40, 0x00, 0x10});
    run(45000);
    TEST_ASSERT_NULL(last(0x581));
    run(10000);
    TEST_ASSERT_NOT_NULL(last(0x581));
    act("mute all");
    m_count = 0;
    act("reboot all");
    run(500000);
    TEST_ASSERT_EQUAL(0, m_count);
    act("mend all");
    act("power-off 3");
    act("power-off 3");
    act("power-on 3");
    run(500000);
    TEST_ASSERT_NOT_NULL(last(0x703));
    act("hot 4");
    run(2000);
    TEST_ASSERT_EQUAL_HEX32(0x4310, value_of(last(0x84)->data) & 0xFFFF);
}

/* --- Scripts --- */

static script_t m_script;

static void test_mend_gives_objects_and_nodes_back_what_they_were(void)
{
    const object_t *row = objects_find(&m_twin.node[2].drive.od, 0x6065, 0);
    const uint32_t before = row->value;
    act("object 3 6065 77");
    act("object 3 6065 78");
    TEST_ASSERT_EQUAL_UINT32(78, row->value);
    act("node 4 3");
    act("node 4 9");
    TEST_ASSERT_EQUAL(9, m_twin.node[3].number);
    act("mend all");
    TEST_ASSERT_EQUAL_UINT32(before, row->value);
    TEST_ASSERT_FALSE(row->is_read_only);
    TEST_ASSERT_EQUAL(4, m_twin.node[3].number);
    run(1000000);
    TEST_ASSERT_NOT_NULL(last(0x704));
}

/* Such drives have what their start-up list names; they do not hold it before it is written, but for what is only looked at. */
static void test_objects_of_the_start_up_list_are_there(void)
{
    char why[FAULT_WHY_MAX] = "";
    fault_t fault;
    m_config.cia402.startup =
        (config_startup_t){.count = 4,
                           .item = {{.index = 0x2030, .sub = 1, .bytes = 2, .value = 50, .is_written = true},
                                    {.index = 0x2031, .bytes = 1, .value = 0, .is_written = true},
                                    {.index = 0x2032, .bytes = 4, .value = 77},
                                    {.index = 0x6502, .bytes = 4, .value = 0x80}}};
    m_config.cia402.drive_startup[2] =
        (config_startup_t){.count = 1, .item = {{.index = 0x2040, .bytes = 4, .value = 7, .is_written = true}}};
    start();
    TEST_ASSERT_EQUAL_UINT32(0, ask_read(1, 0x2030, 1));
    TEST_ASSERT_EQUAL_UINT32(1, ask_read(1, 0x2031, 0));
    TEST_ASSERT_EQUAL_UINT32(77, ask_read(1, 0x2032, 0));
    TEST_ASSERT_EQUAL_UINT32(0x80, ask_read(1, 0x6502, 0));
    TEST_ASSERT_EQUAL_HEX32(0, ask_write(1, 0x2030, 1, 2, 50));
    TEST_ASSERT_EQUAL_UINT32(50, ask_read(1, 0x2030, 1));
    TEST_ASSERT_EQUAL_HEX32(OBJECT_READ_ONLY, ask_write(1, 0x2032, 0, 4, 1));
    TEST_ASSERT_EQUAL_HEX32(0, ask_write(3, 0x2040, 0, 4, 7));
    TEST_ASSERT_EQUAL_HEX32(OBJECT_MISSING, ask_write(1, 0x2040, 0, 4, 7));
    act("object 1 2030:1 9");
    TEST_ASSERT_EQUAL_UINT32(9, ask_read(1, 0x2030, 1));
    TEST_ASSERT_TRUE_MESSAGE(fault_read(&fault, "object all 2040 9", m_twin.drives, why), why);
    TEST_ASSERT_FALSE(fault_do(&fault, &m_twin, m_now_us, why));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(why, "drive 1 has no object 2040:0; it has those of its start-up list"), why);
}

/* What the drive would show meanwhile is there again afterwards. */
static void test_object_that_the_drive_shows_is_held_until_it_is_mended(void)
{
    operational();
    act("object 1 6061 3");
    act("object 1 603F 0x1234");
    ask_write(1, 0x6060, 0, 1, 8);
    act("fault 1 0x2310");
    run(10000);
    TEST_ASSERT_EQUAL_HEX32(3, ask_read(1, 0x6061, 0));
    TEST_ASSERT_EQUAL_HEX32(0x1234, ask_read(1, 0x603F, 0));
    act("mend 1");
    run(10000);
    TEST_ASSERT_EQUAL_HEX32(8, ask_read(1, 0x6061, 0));
    TEST_ASSERT_EQUAL_HEX32(0x2310, ask_read(1, 0x603F, 0));
}

static void test_deaf_drive_waits_for_nothing(void)
{
    operational();
    ask_write(1, 0x6060, 0, 1, 8);
    ask_write(1, 0x6040, 0, 2, 0x06);
    ask_write(1, 0x6040, 0, 2, 0x07);
    TEST_ASSERT_TRUE(drive_due_us(&m_twin.node[0].drive) < DRIVE_NEVER); /* it switches on in some milliseconds */
    act("ignore 1");
    run(200000);
    act("mend 1");
    run(1000);
    TEST_ASSERT_EQUAL_HEX32(0x23, ask_read(1, 0x6041, 0) & 0x6F);
}

static void test_script_times_count_from_the_start_or_from_torque(void)
{
    char why[FAULT_WHY_MAX];
    FILE *out = tmpfile();
    memset(&m_script, 0, sizeof m_script);
    TEST_ASSERT_TRUE(script_add(&m_script, "0.5 emcy 1 0x1000", 6, why));
    TEST_ASSERT_TRUE(script_add(&m_script, "+1.0 emcy 2 0x1000", 6, why));
    const uint64_t start_us = m_now_us;
    TEST_ASSERT_EQUAL_UINT64(start_us + 500000, script_due_us(&m_script, start_us, 0));
    m_count = 0;
    script_run(&m_script, &m_twin, start_us, start_us + 499999, out);
    TEST_ASSERT_EQUAL(0, m_count);
    script_run(&m_script, &m_twin, start_us, start_us + 500000, out);
    script_run(&m_script, &m_twin, start_us, start_us + 500000, out);
    TEST_ASSERT_EQUAL(1, m_count);
    TEST_ASSERT_EQUAL_UINT64(DRIVE_NEVER, script_due_us(&m_script, start_us, 0));
    TEST_ASSERT_EQUAL_UINT64(start_us + 3000000, script_due_us(&m_script, start_us, start_us + 2000000));
    fclose(out);
}

static void test_script_wrong_lines_are_named_with_their_number(void)
{
    char path[] = "/tmp/heave-twin-XXXXXX";
    char text[1000] = "";
    FILE *file = fdopen(mkstemp(path), "w");
    FILE *out = tmpfile();
    fputs("# a comment\n\n1.0 jam 2 # and one behind\nsoon jam 2\n-1 jam 2\n1 jam 9\n1\n1e3 jam 2\nnan jam 1\n", file);
    fclose(file);
    memset(&m_script, 0, sizeof m_script);
    TEST_ASSERT_EQUAL(6, script_load(&m_script, path, 6, out));
    TEST_ASSERT_EQUAL(1, m_script.count);
    rewind(out);
    text[fread(text, 1, sizeof text - 1, out)] = '\0';
    static const char *const k_named[] = {":4: soon is no time", ":5: -1 is no time", ":6: there is no drive 9",
                                          ":7: 1 is no time", ":8: 1e3 is no time"};
    for (unsigned i = 0; i < sizeof k_named / sizeof k_named[0]; i++) {
        TEST_ASSERT_NOT_NULL_MESSAGE(strstr(text, k_named[i]), text);
    }
    TEST_ASSERT_EQUAL(-1, script_load(&m_script, "/nonexistent", 6, out));
    fclose(out);
    unlink(path);
}

/* --- The bus between programs --- */

static wire_t m_wire;
static unsigned m_wire_heard;

static void count_heard(void *ctx, const can_frame_t *frame)
{
    (void)ctx;
    m_wire_heard += frame->id == 0x123 && frame->length == 2 && frame->data[1] == 7;
}

static uint32_t unconfirmed(hal_can_t can)
{
    uint32_t frames = 99;
    TEST_ASSERT_EQUAL(HV_OK, hal_can_unconfirmed(can, &frames));
    return frames;
}

static hal_can_state_t state_of(hal_can_t can)
{
    hal_can_state_t state = HAL_CAN_WARNING;
    TEST_ASSERT_EQUAL(HV_OK, hal_can_bus_state(can, &state));
    return state;
}

static void fault_of_bus(bus_fault_t fault)
{
    char why[FAULT_WHY_MAX] = "";
    TEST_ASSERT_TRUE_MESSAGE(wire_fault(&m_wire, fault, 3, why, sizeof why), why);
}

static void test_local_bus_is_a_can_bus_with_echoes_and_faults(void)
{
    const can_frame_t frame = {.id = 0x123, .length = 2, .data = {1, 7}};
    const can_frame_t of_drive = {.id = 0x181, .length = 8, .data = {1, 2, 3, 4, 5, 6, 7, 8}};
    char name[CONFIG_NAME_MAX];
    char why[WIRE_WHY_MAX];
    linux_can_local_t local;
    linux_can_local_t other;
    can_frame_t got;
    uint64_t at_us = 0;
    (void)snprintf(name, sizeof name, "twin%u", (unsigned)getpid());
    TEST_ASSERT_EQUAL(HV_ERR_AGAIN, linux_can_local_open(&local, name)); /* nobody is it yet */
    const hal_can_t can = linux_can_local_hal(&local);
    TEST_ASSERT_NOT_NULL(strstr(local.error_text, "start heave-twin"));
    TEST_ASSERT_EQUAL(HAL_CAN_GONE, state_of(can));
    TEST_ASSERT_EQUAL(HV_ERR_IO, hal_can_send(can, &frame));
    TEST_ASSERT_EQUAL(HV_ERR_IO, hal_can_recv(can, &got, &at_us));
    config_can_t setup = {.bitrate_bps = 1000000};
    (void)snprintf(setup.interface, sizeof setup.interface, "%s", name);
    TEST_ASSERT_TRUE_MESSAGE(wire_open(&m_wire, &setup, NULL, NULL, false, why), why);
    TEST_ASSERT_EQUAL(HV_OK, hal_can_restart(can));
    TEST_ASSERT_EQUAL(HV_OK, linux_can_local_open(&other, name));
    TEST_ASSERT_TRUE(wire_hear(&m_wire, count_heard, NULL)); /* one comes in at a time */
    TEST_ASSERT_TRUE(wire_hear(&m_wire, count_heard, NULL));

    TEST_ASSERT_EQUAL(HV_OK, hal_can_send(can, &frame));
    TEST_ASSERT_EQUAL(1, unconfirmed(can));
    TEST_ASSERT_TRUE(wire_hear(&m_wire, count_heard, NULL));
    TEST_ASSERT_EQUAL(1, m_wire_heard);
    TEST_ASSERT_EQUAL(HV_ERR_AGAIN, hal_can_recv(can, &got, &at_us)); /* its own never comes back */
    TEST_ASSERT_EQUAL(0, unconfirmed(can));
    TEST_ASSERT_EQUAL(HV_OK, hal_can_recv(linux_can_local_hal(&other), &got, &at_us));
    TEST_ASSERT_EQUAL(0x123, got.id);
    wire_put(&m_wire, &of_drive);
    TEST_ASSERT_EQUAL(HV_OK, hal_can_recv(can, &got, &at_us));
    TEST_ASSERT_EQUAL_MEMORY(of_drive.data, got.data, 8);

    fault_of_bus(BUS_CABLE_OUT);
    for (unsigned i = 0; i < LINUX_CAN_LOCAL_QUEUE_FRAMES; i++) {
        TEST_ASSERT_EQUAL(HV_OK, hal_can_send(can, &frame));
    }
    TEST_ASSERT_EQUAL(HV_ERR_AGAIN, hal_can_send(can, &frame));
    wire_put(&m_wire, &of_drive);
    TEST_ASSERT_TRUE(wire_hear(&m_wire, count_heard, NULL));
    TEST_ASSERT_EQUAL(HV_ERR_AGAIN, hal_can_recv(can, &got, &at_us));
    TEST_ASSERT_EQUAL(LINUX_CAN_LOCAL_QUEUE_FRAMES, unconfirmed(can));
    TEST_ASSERT_EQUAL(1, m_wire_heard);
    fault_of_bus(BUS_CABLE_IN);

    TEST_ASSERT_EQUAL(HV_OK, hal_can_restart(can));
    TEST_ASSERT_TRUE(wire_hear(&m_wire, count_heard, NULL));
    TEST_ASSERT_EQUAL(0, unconfirmed(can));
    fault_of_bus(BUS_PASSIVE);
    TEST_ASSERT_EQUAL(HV_OK, hal_can_recv(can, &got, &at_us));
    TEST_ASSERT_TRUE(got.is_error && (got.id & CAN_ERROR_PASSIVE) != 0);
    TEST_ASSERT_EQUAL(HAL_CAN_PASSIVE, state_of(can));
    fault_of_bus(BUS_ACTIVE);
    TEST_ASSERT_EQUAL(HV_OK, hal_can_recv(can, &got, &at_us));
    TEST_ASSERT_EQUAL(HAL_CAN_ACTIVE, state_of(can));
    fault_of_bus(BUS_OFF);
    TEST_ASSERT_EQUAL(HV_OK, hal_can_recv(can, &got, &at_us));
    TEST_ASSERT_EQUAL(HAL_CAN_BUS_OFF, state_of(can));
    TEST_ASSERT_EQUAL(HV_ERR_IO, hal_can_send(can, &frame));

    fault_of_bus(BUS_DOWN);
    TEST_ASSERT_EQUAL(HV_ERR_AGAIN, hal_can_restart(can));
    fault_of_bus(BUS_UP);
    TEST_ASSERT_EQUAL(HV_OK, hal_can_restart(can));
    TEST_ASSERT_EQUAL(HAL_CAN_ACTIVE, state_of(can));
    TEST_ASSERT_EQUAL(HV_ERR_ARG, hal_can_send(can, &(can_frame_t){.id = 0x800}));
    linux_can_local_close(&local);
    linux_can_local_close(&other);
    wire_close(&m_wire);
}

/* ---- Start-up lists ---- */

#define LIST_ITEMS 100000u

static bool is_without_torque(void)
{
    for (unsigned k = 0; k < m_twin.drives; k++) {
        if (m_twin.node[k].drive.state != TWIN_DISABLED) {
            return false;
        }
    }
    return true;
}

static uint32_t some_value(void)
{
    static const uint32_t k_values[] = {0, 1, 2, 6, 7, 8, 15, 0x1F, 0x80, 0x8F, 0xFFFFFFFF, 0x80000000};
    return random_below(4u) == 0 ? random_below(UINT32_MAX) : k_values[random_below(sizeof k_values / sizeof k_values[0])];
}

/* Whatever a list writes that --check lets through, in whatever order, before NMT start and after it: no drive leaves the state
 * in which it has no torque. What it does not let through does. */
static void test_no_startup_list_gives_torque(void)
{
    const objects_t *objects = &m_twin.node[2].drive.od;
    unsigned written = 0;
    for (unsigned i = 0; i < LIST_ITEMS; i++) {
        const object_t *object = &objects->row[random_below(objects->count)];
        const uint32_t value = some_value();
        if (i == LIST_ITEMS / 2) {
            operational();
            run(20000);
        }
        if (!object->is_read_only && config_startup_denied(object->index, object->sub, value, 0) == NULL) {
            written += ask_write(3, object->index, object->sub, object->bytes, value) == 0;
            TEST_ASSERT_TRUE(is_without_torque());
        }
    }
    TEST_ASSERT_GREATER_THAN_UINT(1000, written);
    run(1000000);
    TEST_ASSERT_TRUE(is_without_torque());
    for (unsigned i = 0; i < 3; i++) {
        TEST_ASSERT_EQUAL_HEX32(0, ask_write(3, 0x6040, 0, 2, i == 0 ? 6 : i == 1 ? 7 : 15));
        run(400000);
    }
    TEST_ASSERT_FALSE(is_without_torque());
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_motor_follows_with_its_lag);
    RUN_TEST(test_motor_rubs_gives_way_and_meets_its_stops);
    RUN_TEST(test_motor_without_torque_is_held_by_its_brake_or_sinks);
    RUN_TEST(test_motor_stops_by_its_ramp_and_gets_warm);
    RUN_TEST(test_node_boots_and_answers_questions);
    RUN_TEST(test_node_mapping_is_strict);
    RUN_TEST(test_node_loses_its_master_and_its_sync);
    RUN_TEST(test_node_short_pdo_and_wrong_sync_are_told);
    RUN_TEST(test_drive_stops_without_set_points_and_at_jumps);
    RUN_TEST(test_drive_finds_a_blocked_axis_and_is_reset_by_an_edge);
    RUN_TEST(test_drive_homes_where_it_is_in_and_backwards_where_it_is_out);
    RUN_TEST(test_mechanism_shows_how_it_was_put_together);
    RUN_TEST(test_options_that_mean_nothing_are_refused);
    RUN_TEST(test_faults_every_line_of_the_table_can_be_read_and_done);
    RUN_TEST(test_faults_wrong_lines_say_what_is_wrong);
    RUN_TEST(test_faults_of_a_drive_show_on_the_bus);
    RUN_TEST(test_objects_of_the_start_up_list_are_there);
    RUN_TEST(test_object_that_the_drive_shows_is_held_until_it_is_mended);
    RUN_TEST(test_mend_gives_objects_and_nodes_back_what_they_were);
    RUN_TEST(test_deaf_drive_waits_for_nothing);
    RUN_TEST(test_script_times_count_from_the_start_or_from_torque);
    RUN_TEST(test_script_wrong_lines_are_named_with_their_number);
    RUN_TEST(test_local_bus_is_a_can_bus_with_echoes_and_faults);
    RUN_TEST(test_no_startup_list_gives_torque);
    return UNITY_END();
}
