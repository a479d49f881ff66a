/* SPDX-License-Identifier: MIT
 * test_cia402_visit.c - a person's access to objects of CANopen drives, beside what the driver itself asks them: it gives way, it
 * disturbs nothing, and it never writes what the driver relies on.
 */
#include "heave/cia402.h"

#include <string.h>

#include "canopen_drives.h"
#include "unity.h"

#define AXES     CANOPEN_DRIVES
#define CYCLE_US 1000u
#define MM(x)    ((q32_t)(x)*Q32_ONE)

static sim_can_bus_t bus;
static sim_can_t node;
static canopen_drives_t twin;
static cia402_config_t config;
static cia402_t driver;
static drives_t hal;
static uint64_t now_us;
static drive_feedback_t feedback[DRIVES_MAX];
static q32_t setpoint_q32[DRIVES_MAX];
static drive_object_t object;
static uint32_t code;

static void cycles(unsigned count)
{
    while (count-- > 0) {
        now_us += CYCLE_US;
        canopen_drives_step(&twin, now_us);
        (void)!drives_poll(hal, now_us, feedback);
        for (unsigned k = 0; k < AXES; k++) {
            setpoint_q32[k] = feedback[k].state == DRIVE_ENABLED ? setpoint_q32[k] : feedback[k].actual_mm_q32;
        }
        (void)!drives_send(hal, now_us, setpoint_q32);
    }
}

static void await(unsigned axis, drive_state_t state)
{
    for (unsigned i = 0; i < 5000 && feedback[axis].state != state; i++) {
        cycles(1);
    }
    TEST_ASSERT_EQUAL(state, feedback[axis].state);
}

static void start(void)
{
    hal_can_filter_t filter[CIA402_FILTERS_MAX];
    const uint32_t filters = cia402_filters(&config, filter);
    TEST_ASSERT_EQUAL(HV_OK, sim_can_open(&node, &bus, filter, filters));
    TEST_ASSERT_EQUAL(HV_OK, cia402_init(&driver, &config, sim_can_hal(&node)));
    hal = cia402_hal(&driver);
}

void setUp(void)
{
    now_us = 5000000;
    code = 0;
    memset(feedback, 0, sizeof feedback);
    sim_can_bus_init(&bus, 0, NULL, 0);
    canopen_drives_open(&twin, &bus);
    config = (cia402_config_t){.axes = AXES,
                               .master_node = 127,
                               .mode = CIA402_MODE_CSP,
                               .period_us = 4 * CYCLE_US,
                               .heartbeat_ms = 50,
                               .heartbeat_timeout_ms = 150,
                               .sdo_timeout_ms = 50,
                               .boot_timeout_ms = 500,
                               .power_timeout_ms = 300,
                               .window_ms = 20,
                               .abort_option = 1,
                               .is_reset_wanted = true};
    for (unsigned k = 0; k < AXES; k++) {
        config.axis[k] = (cia402_axis_config_t){.node = (uint8_t)(k + 1),
                                                .scale = {1000, 1, 0},
                                                .step_max_q32 = MM(2),
                                                .following_max_q32 = MM(10),
                                                .window_counts = 10000};
    }
    start();
    for (unsigned k = 0; k < AXES; k++) {
        await(k, DRIVE_DISABLED);
    }
}

void tearDown(void) {}

static hv_status_t begin_read(uint8_t axis, uint16_t index, uint8_t sub)
{
    object = (drive_object_t){.index = index, .sub = sub};
    return drives_object_begin(hal, axis, &object);
}

static drive_object_state_t end(void)
{
    drive_object_state_t state = DRIVE_OBJECT_BUSY;
    for (unsigned i = 0; i < 1000 && state == DRIVE_OBJECT_BUSY; i++) {
        cycles(1);
        state = drives_object_end(hal, &object, &code);
    }
    return state;
}

static void test_write_is_in_the_drive(void)
{
    object = (drive_object_t){.index = 0x6083, .is_write = true, .size = 4, .value = {0x10, 0x20, 0x03}};
    TEST_ASSERT_EQUAL(HV_OK, drives_object_begin(hal, 2, &object));
    TEST_ASSERT_EQUAL(DRIVE_OBJECT_DONE, end());
    TEST_ASSERT_EQUAL_HEX32(0x032010, canopen_drives_object(&twin, 2, 0x6083, 0)->value);
    TEST_ASSERT_EQUAL(HV_OK, begin_read(2, 0x6083, 0));
    TEST_ASSERT_EQUAL(DRIVE_OBJECT_DONE, end());
    TEST_ASSERT_EQUAL_UINT8(4, object.size);
    TEST_ASSERT_EQUAL_UINT8(0x20, object.value[1]);
}

static void test_every_drive_is_asked_by_its_number(void)
{
    for (uint8_t k = 0; k < AXES; k++) {
        canopen_drives_object(&twin, k, 0x6085, 0)->value = 1000u + k;
        TEST_ASSERT_EQUAL(HV_OK, begin_read(k, 0x6085, 0));
        TEST_ASSERT_EQUAL(DRIVE_OBJECT_DONE, end());
        TEST_ASSERT_EQUAL_UINT8((1000u + k) & 0xFF, object.value[0]);
    }
}

/* The change of mode before torque takes the drive's SDO: the drive comes up, and who read it is told. */
static void test_driver_takes_the_drive_when_it_needs_it(void)
{
    bool was_left = false;
    for (unsigned k = 0; k < 6; k++) { /* whenever it comes */
        TEST_ASSERT_EQUAL(HV_OK, begin_read(1, 0x6085, 0));
        cycles(k);
        TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_ENABLE));
        const drive_object_state_t state = end();
        TEST_ASSERT_TRUE(state == DRIVE_OBJECT_LEFT || state == DRIVE_OBJECT_DONE);
        was_left |= state == DRIVE_OBJECT_LEFT;
        await(1, DRIVE_ENABLED);
        TEST_ASSERT_EQUAL(HV_OK, begin_read(1, 0x6085, 0)); /* and then it is free again */
        TEST_ASSERT_EQUAL(DRIVE_OBJECT_DONE, end());
        TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, DRIVES_DISABLE));
        await(1, DRIVE_DISABLED);
    }
    TEST_ASSERT_TRUE(was_left);
}

static void test_drive_that_is_lost_ends_it(void)
{
    TEST_ASSERT_EQUAL(HV_OK, begin_read(1, 0x6085, 0));
    canopen_drives_power(&twin, 1, false);
    const drive_object_state_t state = end();
    TEST_ASSERT_TRUE(state == DRIVE_OBJECT_LEFT || state == DRIVE_OBJECT_SILENT);
    await(1, DRIVE_OFFLINE);
    TEST_ASSERT_EQUAL(HV_ERR_STATE, begin_read(1, 0x6085, 0));
    canopen_drives_power(&twin, 1, true);
    await(1, DRIVE_DISABLED); /* it is set up again */
    TEST_ASSERT_EQUAL(HV_OK, begin_read(1, 0x6085, 0));
    TEST_ASSERT_EQUAL(DRIVE_OBJECT_DONE, end());
}

static void test_drive_that_says_nothing_is_silent_and_the_others_are_not(void)
{
    twin.drive[1].node.is_sdo_silent = true;
    TEST_ASSERT_EQUAL(HV_OK, begin_read(1, 0x6085, 0));
    TEST_ASSERT_EQUAL(HV_ERR_AGAIN, begin_read(0, 0x6085, 0));
    TEST_ASSERT_EQUAL(DRIVE_OBJECT_SILENT, end());
    TEST_ASSERT_EQUAL(HV_OK, begin_read(0, 0x6085, 0));
    TEST_ASSERT_EQUAL(DRIVE_OBJECT_DONE, end());
    TEST_ASSERT_EQUAL(DRIVE_DISABLED, feedback[1].state);
}

/* A drive that was refused while it was set up can be looked into: that is when somebody wants to. */
static void test_refused_drive_is_read(void)
{
    config.axis[3].identity[0] = 0x77;
    sim_can_close(&node);
    start();
    cycles(2000);
    TEST_ASSERT_EQUAL(DRIVE_OFFLINE, feedback[3].state);
    TEST_ASSERT_EQUAL(HV_OK, begin_read(3, 0x1000, 0));
    TEST_ASSERT_EQUAL(DRIVE_OBJECT_DONE, end());
    TEST_ASSERT_EQUAL_UINT8(0x92, object.value[0]);
}

static void test_what_the_driver_relies_on_is_never_written(void)
{
    static const uint16_t k_kept[] = {0x1006, 0x1016, 0x1017, 0x1400, 0x1601, 0x1A00, 0x6007, 0x6040,
                                      0x6060, 0x6065, 0x6066, 0x607A, 0x607D, 0x607E, 0x608F, 0x6091,
                                      0x6092, 0x60C1, 0x60C2, 0x60FE, 0x60FF, 0x1F51, 0x1280};
    static const uint16_t k_free[] = {0x1003, 0x1010, 0x2000, 0x5FFF, 0x6072, 0x6083, 0x6081, 0x6098, 0x60E0};
    for (size_t i = 0; i < sizeof k_kept / sizeof k_kept[0]; i++) {
        object = (drive_object_t){.index = k_kept[i], .is_write = true, .size = 4};
        TEST_ASSERT_EQUAL(HV_ERR_ARG, drives_object_begin(hal, 0, &object));
        object.is_write = false; /* reading is everybody's */
        TEST_ASSERT_EQUAL(HV_OK, drives_object_begin(hal, 0, &object));
        (void)end();
    }
    for (size_t i = 0; i < sizeof k_free / sizeof k_free[0]; i++) {
        TEST_ASSERT_FALSE(cia402_is_relied_on(&config, 0, k_free[i], 0));
    }
}

/* What this configuration has it write, and no other, is kept too. */
static void test_configuration_says_what_else_is_kept(void)
{
    static const cia402_item_t k_items[] = {{.index = 0x2010, .sub = 3, .bytes = 2, .is_written = true},
                                            {.index = 0x2011, .sub = 0, .bytes = 2}};
    memcpy(config.axis[1].item, k_items, sizeof k_items);
    config.axis[1].items = 2;
    TEST_ASSERT_TRUE(cia402_is_relied_on(&config, 1, 0x2010, 3));
    TEST_ASSERT_FALSE(cia402_is_relied_on(&config, 0, 0x2010, 3));
    TEST_ASSERT_FALSE(cia402_is_relied_on(&config, 1, 0x2010, 4));
    TEST_ASSERT_FALSE(cia402_is_relied_on(&config, 1, 0x2011, 0)); /* only looked at */
    config.axis[0].homing_method = 35;
    TEST_ASSERT_TRUE(cia402_is_relied_on(&config, 0, 0x6098, 0));
    config.mode = CIA402_MODE_PP;
    config.axis[0].profile_accel = 5;
    TEST_ASSERT_TRUE(cia402_is_relied_on(&config, 0, 0x6083, 0));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_write_is_in_the_drive);
    RUN_TEST(test_every_drive_is_asked_by_its_number);
    RUN_TEST(test_driver_takes_the_drive_when_it_needs_it);
    RUN_TEST(test_drive_that_is_lost_ends_it);
    RUN_TEST(test_drive_that_says_nothing_is_silent_and_the_others_are_not);
    RUN_TEST(test_refused_drive_is_read);
    RUN_TEST(test_what_the_driver_relies_on_is_never_written);
    RUN_TEST(test_configuration_says_what_else_is_kept);
    return UNITY_END();
}
