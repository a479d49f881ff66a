/* SPDX-License-Identifier: MIT
 * test_drives.c - the contract of drives.h on every backend, and the simulated drives: lag, supervision, determinism, fault plan.
 */
#include "contract.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "canraw_drives.h"
#include "canraw_maps.h"
#include "canopen_drives.h"
#include "heave/cia402.h"
#include "modbus_drives.h"
#include "modbus_maps.h"
#include "sim_drives.h"

/** A backend under test: seven axes with 300 mm of travel each, standing at 100 mm + 10 mm per axis, homed, disabled. */
typedef struct {
    const char *name;
    bool (*open)(drives_t *drives); /**< false: not to be had on this machine */
    void (*close)(void);
    void (*settle)(uint64_t now_us);             /**< lets the other side act up to now */
    void (*fault_axis)(uint8_t axis);            /**< the drive of an axis fails; NULL: cannot */
    void (*set_power)(uint8_t axis, bool is_on); /**< takes an axis off the bus and back; NULL: cannot */
    bool (*has_torque)(uint8_t axis);            /**< seen at the drive; NULL: nothing takes torque from these drives */
    void (*glide)(uint32_t for_us);              /**< a stop leaves the drives their torque, and they go on for so long, at more
                                                    than 10 mm/s; NULL: they stop dead */
} fixture_t;

#define AXES     DRIVES_MAX
#define CYCLE_US 1000u
#define MM(x)    ((q32_t)(x)*Q32_ONE)

static const fixture_t *fixture;
static drives_t hal;
static uint64_t now_us;
static drive_feedback_t feedback[DRIVES_MAX];
static q32_t setpoint_q32[DRIVES_MAX];

static sim_drives_t sim;
static sim_drive_config_t config[DRIVES_MAX];

static void configure(void)
{
    for (uint8_t k = 0; k < AXES; k++) {
        config[k] = (sim_drive_config_t){.start_q32 = MM(100 + 10 * k),
                                         .travel_max_q32 = MM(300),
                                         .time_constant_us = 5000,
                                         .enable_us = 20000u + 3000u * k,
                                         .homing_per_s_q32 = MM(50),
                                         .step_max_q32 = MM(1),
                                         .lag_max_q32 = MM(5),
                                         .is_homed = true};
    }
}

static void start_sim(const sim_drives_fault_t *plan, uint32_t planned)
{
    now_us = 5000000;
    TEST_ASSERT_EQUAL(HV_OK, sim_drives_init(&sim, AXES, config, plan, planned));
    hal = sim_drives_hal(&sim);
}

static bool open_sim(drives_t *drives)
{
    configure();
    start_sim(NULL, 0);
    *drives = hal;
    return true;
}

static void close_sim(void) {}

static void settle_sim(uint64_t until_us)
{
    (void)until_us;
}

static void inject(sim_drives_fault_kind_t kind, uint8_t axis)
{
    sim_drives_inject(&sim, &(sim_drives_fault_t){.kind = kind, .axis = axis, .code = 0x2310});
}

static void fault_sim(uint8_t axis)
{
    inject(SIM_DRIVES_FAULT, axis);
}

static void power_sim(uint8_t axis, bool is_on)
{
    inject(is_on ? SIM_DRIVES_RECOVER : SIM_DRIVES_OFFLINE, axis);
}

static bool has_torque_sim(uint8_t axis)
{
    return sim.axis[axis].state != DRIVE_DISABLED && sim.axis[axis].state != DRIVE_FAULT;
}

/* Drives with frames of their own, behind the raw CAN driver. */

static sim_can_bus_t canraw_bus;
static sim_can_t canraw_node;
static canraw_drives_t canraw_drives;
static canraw_map_t canraw_map;
static canraw_t canraw;

static void settle_canraw(uint64_t until_us)
{
    canraw_drives_step(&canraw_drives, until_us);
}

/* On the bus, and long enough for the drives to say that they are homed. */
static void start_canraw(drives_t *drives, bool is_rich)
{
    hal_can_filter_t filter[CANRAW_FILTERS_MAX];
    sim_can_bus_init(&canraw_bus, 0, NULL, 0);
    canraw_map = is_rich ? canraw_maps_rich() : canraw_maps_plain();
    canraw_map.period_us = is_rich ? CYCLE_US : 2 * CYCLE_US;
    canraw_drives_open(&canraw_drives, &canraw_bus, canraw_map);
    for (uint8_t k = 0; k < AXES; k++) {
        const int32_t mm = 100 + 10 * k;
        canraw_drives_place(&canraw_drives, k, is_rich ? CANRAW_DRIVES_RICH_ZERO - (mm * 10000 + 1) / 3 : mm * 2000);
    }
    const uint32_t filters = canraw_filters(&canraw_map, filter);
    TEST_ASSERT_EQUAL(HV_OK, sim_can_open(&canraw_node, &canraw_bus, filter, filters));
    TEST_ASSERT_EQUAL(HV_OK, canraw_init(&canraw, &canraw_map, sim_can_hal(&canraw_node)));
    *drives = canraw_hal(&canraw);
    for (int i = 0; i < 30; i++) {
        now_us += CYCLE_US;
        settle_canraw(now_us);
        (void)!drives_poll(*drives, now_us, feedback);
        (void)!drives_send(*drives, now_us, setpoint_q32);
    }
}

static bool open_canraw_plain(drives_t *drives)
{
    start_canraw(drives, false);
    return true;
}

static bool open_canraw_rich(drives_t *drives)
{
    start_canraw(drives, true);
    return true;
}

static void fault_canraw(uint8_t axis)
{
    frame_drive_fault(&canraw_drives.twin[axis], 1);
}

static void power_canraw(uint8_t axis, bool is_on)
{
    canraw_drives.twin[axis].is_cut = !is_on;
}

static bool has_torque_canraw(uint8_t axis)
{
    return frame_drive_is_enabled(&canraw_drives.twin[axis]);
}

static void glide_canraw(uint32_t for_us)
{
    canraw_drives.is_holding_on_stop = true;
    canraw_drives.glide_takes_us = for_us;
}

/* CANopen drives, behind the CiA 402 driver. */

void hv_assert_failed(const char *file, int line)
{
    (void)printf("%s:%d: assertion failed\n", file, line);
    abort();
}

static sim_can_bus_t cia402_bus;
static sim_can_t cia402_node;
static canopen_drives_t canopen_drives;
static cia402_config_t cia402_config;
static cia402_t cia402;

static void settle_cia402(uint64_t until_us)
{
    canopen_drives_step(&canopen_drives, until_us);
}

static void configure_cia402(cia402_mode_t mode, uint32_t period_us)
{
    cia402_config = (cia402_config_t){.axes = AXES,
                                      .master_node = 127,
                                      .mode = mode,
                                      .period_us = period_us,
                                      .heartbeat_ms = 50,
                                      .heartbeat_timeout_ms = 150,
                                      .sdo_timeout_ms = 100,
                                      .boot_timeout_ms = 1000,
                                      .power_timeout_ms = 2000,
                                      .window_ms = 20,
                                      .abort_option = 1,
                                      .is_reset_wanted = true};
    for (uint8_t k = 0; k < AXES; k++) {
        cia402_config.axis[k] = (cia402_axis_config_t){.node = (uint8_t)(k + 1),
                                                       .scale = {k % 2 ? -1000 : 1000, 1, 5000 * k},
                                                       .step_max_q32 = MM(2),
                                                       .following_max_q32 = MM(10),
                                                       .window_counts = 10000,
                                                       .profile_speed = 100000,
                                                       .profile_accel = 1000000};
    }
}

/* On the bus, and long enough for the drives to be set up. */
static bool start_cia402(drives_t *drives, cia402_mode_t mode, uint32_t period_us)
{
    hal_can_filter_t filter[CIA402_FILTERS_MAX];
    drive_state_t last = DRIVE_OFFLINE;
    sim_can_bus_init(&cia402_bus, 0, NULL, 0);
    canopen_drives_open(&canopen_drives, &cia402_bus);
    configure_cia402(mode, period_us);
    for (uint8_t k = 0; k < AXES; k++) {
        canopen_drives_place(&canopen_drives, k, 5000 * k + (k % 2 ? -1000 : 1000) * (100 + 10 * k));
    }
    const uint32_t filters = cia402_filters(&cia402_config, filter);
    TEST_ASSERT_EQUAL(HV_OK, sim_can_open(&cia402_node, &cia402_bus, filter, filters));
    TEST_ASSERT_EQUAL(HV_OK, cia402_init(&cia402, &cia402_config, sim_can_hal(&cia402_node)));
    *drives = cia402_hal(&cia402);
    for (int i = 0; i < 5000 && last != DRIVE_DISABLED; i++) {
        now_us += CYCLE_US;
        settle_cia402(now_us);
        (void)!drives_poll(*drives, now_us, feedback);
        (void)!drives_send(*drives, now_us, setpoint_q32);
        last = DRIVE_DISABLED;
        for (uint8_t k = 0; k < AXES; k++) {
            last = feedback[k].state != DRIVE_DISABLED ? feedback[k].state : last;
        }
    }
    return true;
}

static bool open_cia402_csp(drives_t *drives)
{
    return start_cia402(drives, CIA402_MODE_CSP, CYCLE_US);
}

static bool open_cia402_slow(drives_t *drives)
{
    return start_cia402(drives, CIA402_MODE_CSP, 4 * CYCLE_US);
}

static bool open_cia402_ip(drives_t *drives)
{
    return start_cia402(drives, CIA402_MODE_IP, CYCLE_US);
}

static bool open_cia402_pp(drives_t *drives)
{
    return start_cia402(drives, CIA402_MODE_PP, CYCLE_US);
}

static void fault_cia402(uint8_t axis)
{
    canopen_drives_fault(&canopen_drives, axis, 0x2310);
    for (uint32_t i = 0; i < cia402_config.period_us / CYCLE_US; i++) { /* the next SYNC tells */
        now_us += CYCLE_US;
        settle_cia402(now_us);
        (void)!drives_poll(hal, now_us, feedback);
        (void)!drives_send(hal, now_us, setpoint_q32);
    }
}

static void power_cia402(uint8_t axis, bool is_on)
{
    canopen_drives_power(&canopen_drives, axis, is_on);
}

/* Operation enabled, quick stop, fault reaction. */
static bool has_torque_cia402(uint8_t axis)
{
    const twin_state_t state = canopen_drives.drive[axis].node.drive.state;
    return state == TWIN_ENABLED || state == TWIN_QUICK_STOP || state == TWIN_REACTION;
}

static void glide_cia402(uint32_t for_us)
{
    for (uint8_t k = 0; k < AXES; k++) {
        canopen_drives.drive[k].glide_us = for_us;
        canopen_drives.drive[k].glide_counts = 20;
    }
}

/* Drives behind Modbus lines: one each (TCP), or one for all (RTU). */

static modbus_drives_t modbus_drives;
static modbus_drive_map_t modbus_map;
static modbus_drive_t modbus_drive;

static void settle_modbus(uint64_t until_us)
{
    modbus_drives_step(&modbus_drives, until_us);
}

static void cycles_modbus(drives_t drives, int count)
{
    while (count-- > 0) {
        now_us += CYCLE_US;
        settle_modbus(now_us);
        (void)!drives_poll(drives, now_us, feedback);
        (void)!drives_send(drives, now_us, setpoint_q32);
    }
}

/* On the lines, and long enough for the drives to be started up. */
static void start_modbus(drives_t *drives, bool is_small, bool is_shared)
{
    hal_modbus_t line[DRIVES_MAX];
    modbus_drives_open(&modbus_drives, is_small, is_shared, is_shared ? 150 : 300, 20000);
    modbus_map = is_small ? modbus_maps_small(is_shared) : modbus_maps_wide(is_shared);
    for (unsigned k = 0; k < AXES; k++) {
        const int32_t mm = 100 + 10 * (int32_t)k;
        modbus_drives_place(&modbus_drives, k, is_small ? mm * 100 : MODBUS_DRIVES_WIDE_ZERO - (mm * 10000 + 1) / 3);
    }
    modbus_drives_lines(&modbus_drives, line);
    TEST_ASSERT_EQUAL(HV_OK, modbus_drive_init(&modbus_drive, &modbus_map, line));
    *drives = modbus_drive_hal(&modbus_drive);
    cycles_modbus(*drives, 100);
}

static bool open_modbus_tcp(drives_t *drives)
{
    start_modbus(drives, false, false);
    return true;
}

static bool open_modbus_rtu(drives_t *drives)
{
    start_modbus(drives, false, true);
    return true;
}

static bool open_modbus_small(drives_t *drives)
{
    start_modbus(drives, true, true);
    return true;
}

static void fault_modbus(uint8_t axis)
{
    register_drive_fault(&modbus_drives.twin[axis], MODBUS_DRIVES_ALARM);
    cycles_modbus(hal, 20); /* the next feedback tells */
}

static void power_modbus(uint8_t axis, bool is_on)
{
    modbus_drives_power(&modbus_drives, axis, is_on);
}

static bool has_torque_modbus(uint8_t axis)
{
    return modbus_drives.motor[axis].has_torque;
}

static void glide_modbus(uint32_t for_us)
{
    modbus_drives.is_holding_on_stop = true;
    modbus_drives.glide_takes_us = for_us;
}

static const fixture_t k_fixtures[] = {
    {"sim", open_sim, close_sim, settle_sim, fault_sim, power_sim, has_torque_sim, NULL},
    {"canraw-plain", open_canraw_plain, close_sim, settle_canraw, NULL, power_canraw, NULL, NULL},
    {"canraw-rich", open_canraw_rich, close_sim, settle_canraw, fault_canraw, power_canraw, has_torque_canraw, glide_canraw},
    {"cia402-csp", open_cia402_csp, close_sim, settle_cia402, fault_cia402, power_cia402, has_torque_cia402, glide_cia402},
    {"cia402-slow", open_cia402_slow, close_sim, settle_cia402, fault_cia402, power_cia402, has_torque_cia402, glide_cia402},
    {"cia402-ip", open_cia402_ip, close_sim, settle_cia402, fault_cia402, power_cia402, has_torque_cia402, glide_cia402},
    {"cia402-pp", open_cia402_pp, close_sim, settle_cia402, fault_cia402, power_cia402, has_torque_cia402, glide_cia402},
    {"modbus-tcp", open_modbus_tcp, close_sim, settle_modbus, fault_modbus, power_modbus, has_torque_modbus, glide_modbus},
    {"modbus-rtu", open_modbus_rtu, close_sim, settle_modbus, fault_modbus, power_modbus, has_torque_modbus, glide_modbus},
    {"modbus-small", open_modbus_small, close_sim, settle_modbus, fault_modbus, power_modbus, has_torque_modbus, glide_modbus},
};

static hv_status_t poll_once(void)
{
    now_us += CYCLE_US;
    fixture->settle(now_us);
    return drives_poll(hal, now_us, feedback);
}

/* One cycle as the gateway does it. */
static void cycle(void)
{
    TEST_ASSERT_EQUAL(HV_OK, poll_once());
    TEST_ASSERT_EQUAL(HV_OK, drives_send(hal, now_us, setpoint_q32));
}

static void follow_actual(void)
{
    for (uint8_t k = 0; k < AXES; k++) {
        setpoint_q32[k] = feedback[k].actual_mm_q32;
    }
}

void setUp(void)
{
    now_us = 5000000;
    if (!fixture->open(&hal)) {
        TEST_IGNORE_MESSAGE("not to be had on this machine");
    }
    memset(setpoint_q32, 0, sizeof setpoint_q32);
    TEST_ASSERT_EQUAL(HV_OK, poll_once());
    follow_actual();
}

void tearDown(void)
{
    fixture->close();
}

static bool are_all(drive_state_t state)
{
    for (uint8_t k = 0; k < AXES; k++) {
        if (feedback[k].state != state) {
            return false;
        }
    }
    return true;
}

static void assert_all(drive_state_t state)
{
    for (uint8_t k = 0; k < AXES; k++) {
        TEST_ASSERT_EQUAL(state, feedback[k].state);
    }
}

static void request_ok(drives_request_t request)
{
    TEST_ASSERT_EQUAL(HV_OK, drives_request(hal, request));
}

/* Cycles until every axis is in the state; the set-points follow actual, as they must while axes come up. */
static void await(drive_state_t state)
{
    int cycles = 0;
    do {
        TEST_ASSERT_EQUAL(HV_OK, poll_once());
        follow_actual();
        TEST_ASSERT_EQUAL(HV_OK, drives_send(hal, now_us, setpoint_q32));
    } while (!are_all(state) && ++cycles < 20000);
    assert_all(state);
}

/* Drives that are being stopped take it later. */
static void enable(void)
{
    hv_status_t status = drives_request(hal, DRIVES_ENABLE);
    for (int i = 0; i < 6000 && status == HV_ERR_AGAIN; i++) {
        cycle();
        status = drives_request(hal, DRIVES_ENABLE);
    }
    TEST_ASSERT_EQUAL(HV_OK, status);
    await(DRIVE_ENABLED);
}

/* The greatest distance of an axis from the given positions, in Q32. */
static q32_t distance(const q32_t from_q32[DRIVES_MAX])
{
    q32_t most_q32 = 0;
    for (uint8_t k = 0; k < AXES; k++) {
        const q32_t d_q32 = fx_abs(feedback[k].actual_mm_q32 - from_q32[k]);
        most_q32 = d_q32 > most_q32 ? d_q32 : most_q32;
    }
    return most_q32;
}

static void keep_actual(q32_t kept_q32[DRIVES_MAX])
{
    for (uint8_t k = 0; k < AXES; k++) {
        kept_q32[k] = feedback[k].actual_mm_q32;
    }
}

static void test_valid_complete_accepts(void)
{
    TEST_ASSERT_TRUE(drives_valid(hal));
}

static void test_valid_any_op_missing_refuses(void)
{
    TEST_ASSERT_FALSE(drives_valid((drives_t){NULL, NULL}));
    for (int i = 0; i < 4; i++) {
        drives_ops_t ops = *hal.ops;
        ops.poll = i == 0 ? NULL : ops.poll;
        ops.send = i == 1 ? NULL : ops.send;
        ops.request = i == 2 ? NULL : ops.request;
        ops.count = i == 3 ? NULL : ops.count;
        TEST_ASSERT_FALSE(drives_valid((drives_t){&ops, hal.ctx}));
    }
}

static void test_poll_after_start_tells_where_the_axes_are(void)
{
    TEST_ASSERT_EQUAL_UINT8(AXES, drives_count(hal));
    assert_all(DRIVE_DISABLED);
    for (uint8_t k = 0; k < AXES; k++) {
        TEST_ASSERT_TRUE(feedback[k].has_actual);
        TEST_ASSERT_TRUE(feedback[k].is_homed);
        TEST_ASSERT_TRUE(fx_abs(feedback[k].actual_mm_q32 - MM(100 + 10 * k)) < MM(1) / 1000);
        TEST_ASSERT_TRUE(feedback[k].actual_us <= now_us && now_us - feedback[k].actual_us <= 5 * CYCLE_US);
        TEST_ASSERT_EQUAL_UINT32(0, feedback[k].fault_code);
    }
}

static void test_send_while_disabled_moves_nothing(void)
{
    q32_t before_q32[DRIVES_MAX];
    keep_actual(before_q32);
    memset(setpoint_q32, 0, sizeof setpoint_q32);
    for (int i = 0; i < 200; i++) {
        cycle();
    }
    assert_all(DRIVE_DISABLED);
    TEST_ASSERT_TRUE(distance(before_q32) < MM(1) / 100);
}

static void test_request_enable_comes_up_without_motion(void)
{
    q32_t before_q32[DRIVES_MAX];
    keep_actual(before_q32);
    request_ok(DRIVES_ENABLE);
    for (int i = 0; i < 20000 && !are_all(DRIVE_ENABLED); i++) {
        cycle();
        TEST_ASSERT_TRUE(distance(before_q32) < MM(1) / 100);
        for (uint8_t k = 0; k < AXES; k++) {
            TEST_ASSERT_TRUE(feedback[k].state == DRIVE_DISABLED || feedback[k].state == DRIVE_ENABLING ||
                             feedback[k].state == DRIVE_ENABLED);
        }
    }
    assert_all(DRIVE_ENABLED);
}

static unsigned energized(void)
{
    unsigned count = 0;
    for (uint8_t k = 0; k < AXES; k++) {
        count += feedback[k].is_energized;
    }
    return count;
}

/* Drives that no command of their map takes torque from are never said to have any. */
static void test_request_off_tells_when_the_torque_is_off(void)
{
    static const drives_request_t k_requests[] = {DRIVES_DISABLE, DRIVES_QUICK_STOP};
    for (int i = 0; i < 20; i++) {
        cycle();
    }
    TEST_ASSERT_EQUAL_UINT(0, energized());
    for (int i = 0; i < 2; i++) {
        enable();
        const unsigned can_tell = energized();
        TEST_ASSERT_TRUE(can_tell == 0 || can_tell == AXES);
        request_ok(k_requests[i]);
        for (int n = 0; n < 10000 && energized() > 0; n++) {
            cycle();
        }
        for (int n = 0; n < 100; n++) {
            cycle();
            TEST_ASSERT_EQUAL_UINT(0, energized());
        }
        assert_all(DRIVE_DISABLED);
    }
}

static void test_send_while_enabled_is_followed_to_the_end(void)
{
    q32_t goal_q32[DRIVES_MAX];
    enable();
    for (int i = 0; i < 2000; i++) {
        for (uint8_t k = 0; k < AXES; k++) {
            setpoint_q32[k] += MM(k % 2 ? 1 : -1) / 40;
            goal_q32[k] = setpoint_q32[k];
        }
        cycle();
    }
    for (int i = 0; i < 500; i++) {
        cycle();
    }
    assert_all(DRIVE_ENABLED);
    TEST_ASSERT_TRUE(distance(goal_q32) < MM(1) / 50);
}

static void test_send_jump_while_enabled_faults_that_axis(void)
{
    enable();
    setpoint_q32[2] += MM(50);
    for (int i = 0; i < 300 && feedback[2].state == DRIVE_ENABLED; i++) {
        cycle();
    }
    TEST_ASSERT_EQUAL(DRIVE_FAULT, feedback[2].state);
    TEST_ASSERT_TRUE(feedback[2].fault_code != 0);
}

static void test_send_elsewhere_while_enabling_faults_instead_of_jumping(void)
{
    q32_t before_q32[DRIVES_MAX];
    keep_actual(before_q32);
    request_ok(DRIVES_ENABLE);
    for (uint8_t k = 0; k < AXES; k++) {
        setpoint_q32[k] -= MM(60);
    }
    for (int i = 0; i < 3000 && !are_all(DRIVE_FAULT); i++) {
        cycle();
    }
    assert_all(DRIVE_FAULT);
    TEST_ASSERT_TRUE(distance(before_q32) < MM(10));
}

static void test_request_reset_fault_leads_back_to_enabled(void)
{
    if (fixture->fault_axis == NULL) {
        TEST_IGNORE_MESSAGE("this backend's drives cannot be made to fail from here");
    }
    enable();
    fixture->fault_axis(3);
    cycle();
    TEST_ASSERT_EQUAL(DRIVE_FAULT, feedback[3].state);
    TEST_ASSERT_TRUE(feedback[3].fault_code != 0);
    TEST_ASSERT_EQUAL(HV_ERR_STATE, drives_request(hal, DRIVES_ENABLE));
    TEST_ASSERT_EQUAL(HV_ERR_STATE, drives_request(hal, DRIVES_HOME));
    request_ok(DRIVES_DISABLE);
    cycle();
    TEST_ASSERT_EQUAL(DRIVE_FAULT, feedback[3].state);
    request_ok(DRIVES_RESET_FAULT);
    await(DRIVE_DISABLED);
    TEST_ASSERT_EQUAL_UINT32(0, feedback[3].fault_code);
    enable();
}

/* A request that was taken is seen in the next poll: nobody may take the state before it for its result. */
static void test_request_taken_is_seen_in_the_next_poll(void)
{
    request_ok(DRIVES_ENABLE);
    TEST_ASSERT_EQUAL(HV_OK, poll_once());
    assert_all(DRIVE_ENABLING);
    await(DRIVE_ENABLED);
    request_ok(DRIVES_HOME);
    TEST_ASSERT_EQUAL(HV_OK, poll_once());
    assert_all(DRIVE_HOMING);
}

static void test_request_disable_and_quick_stop_end_in_disabled(void)
{
    static const drives_request_t k_requests[] = {DRIVES_DISABLE, DRIVES_QUICK_STOP};
    for (size_t i = 0; i < 2; i++) {
        enable();
        request_ok(k_requests[i]);
        await(DRIVE_DISABLED);
        for (int n = 0; n < 6000 && drives_request(hal, DRIVES_ENABLE) == HV_ERR_AGAIN; n++) {
            cycle();
        }
        cycle();
        request_ok(k_requests[i]);
        await(DRIVE_DISABLED);
    }
}

/* ---- one by one ---- */

/* A cycle in which what is not enabled is led by nobody. */
static void loose_cycle(void)
{
    TEST_ASSERT_EQUAL(HV_OK, poll_once());
    for (uint8_t k = 0; k < AXES; k++) {
        setpoint_q32[k] = feedback[k].state == DRIVE_ENABLED ? setpoint_q32[k] : feedback[k].actual_mm_q32;
    }
    TEST_ASSERT_EQUAL(HV_OK, drives_send(hal, now_us, setpoint_q32));
}

/* Until the axis is in the state; every other one stays in its own. */
static void await_one(uint8_t axis, drive_state_t state)
{
    drive_state_t kept[AXES];
    for (uint8_t k = 0; k < AXES; k++) {
        kept[k] = feedback[k].state;
    }
    for (int cycles = 0; cycles < 20000 && feedback[axis].state != state; cycles++) {
        loose_cycle();
        for (uint8_t k = 0; k < AXES; k++) {
            TEST_ASSERT_TRUE(k == axis || feedback[k].state == kept[k]);
        }
    }
    TEST_ASSERT_EQUAL(state, feedback[axis].state);
}

/* --- How a quick stop ends --- */

static unsigned with_torque(void)
{
    unsigned count = 0;
    for (uint8_t k = 0; k < AXES; k++) {
        count += fixture->has_torque(k);
    }
    return count;
}

/* What has been told of the torque is true of every drive that answers. */
static void cycle_watched(void)
{
    TEST_ASSERT_EQUAL(HV_OK, poll_once());
    for (uint8_t k = 0; k < AXES; k++) {
        setpoint_q32[k] = feedback[k].state == DRIVE_ENABLED ? setpoint_q32[k] : feedback[k].actual_mm_q32;
        TEST_ASSERT_TRUE(feedback[k].is_energized || !fixture->has_torque(k));
    }
    TEST_ASSERT_EQUAL(HV_OK, drives_send(hal, now_us, setpoint_q32));
}

/* Enabled, with drives that keep their torque after a stop and go on for some time.
 * Returns false where the backend's drives have no torque that can be taken. */
static bool enable_gliding(uint32_t for_us)
{
    if (fixture->has_torque == NULL) {
        return false;
    }
    if (fixture->glide != NULL) {
        fixture->glide(for_us);
    }
    enable();
    for (int i = 0; i < 50; i++) {
        cycle_watched();
    }
    TEST_ASSERT_EQUAL_UINT(AXES, with_torque());
    return true;
}

/* Until no drive has torque, which stays so. Returns the time it took [us]. */
static uint64_t await_off(void)
{
    const uint64_t from_us = now_us;
    while (with_torque() > 0 && now_us - from_us < 8000000) {
        cycle_watched();
    }
    const uint64_t took_us = now_us - from_us;
    TEST_ASSERT_EQUAL_UINT(0, with_torque());
    for (int i = 0; i < 200; i++) {
        cycle_watched();
        TEST_ASSERT_EQUAL_UINT(0, with_torque());
    }
    TEST_ASSERT_EQUAL_UINT(0, energized());
    return took_us;
}

/* A platform would drop under drives that lose their torque in motion, and stay up under those that never lose it. */
static void test_quick_stop_takes_the_torque_at_rest(void)
{
    if (!enable_gliding(400000)) {
        return;
    }
    request_ok(DRIVES_QUICK_STOP);
    const uint64_t took_us = await_off();
    TEST_ASSERT_TRUE(fixture->glide == NULL || took_us >= 400000);
    TEST_ASSERT_TRUE(took_us <= 1000000);
    assert_all(DRIVE_DISABLED);
    enable();
}

static void test_quick_stop_without_rest_ends_after_five_seconds(void)
{
    if (!enable_gliding(7000000) || fixture->glide == NULL) {
        return;
    }
    request_ok(DRIVES_QUICK_STOP);
    const uint64_t took_us = await_off();
    TEST_ASSERT_TRUE(took_us >= 4900000 && took_us <= 5200000);
}

/* As the gateway does it: the drive that fails, and then all. */
static void test_quick_stop_after_a_fault_takes_the_torque_of_all(void)
{
    for (int is_own = 0; is_own < 2; is_own++) {
        if (!enable_gliding(400000) || (is_own == 1 && fixture->fault_axis == NULL)) {
            return;
        }
        if (is_own == 1) {
            fixture->fault_axis(2);
        } else {
            setpoint_q32[2] += MM(50);
        }
        for (int i = 0; i < 300 && feedback[2].state != DRIVE_FAULT; i++) {
            cycle();
        }
        TEST_ASSERT_EQUAL(DRIVE_FAULT, feedback[2].state);
        request_ok(DRIVES_QUICK_STOP);
        TEST_ASSERT_TRUE(await_off() <= 1000000);
        TEST_ASSERT_EQUAL(DRIVE_FAULT, feedback[2].state);
        request_ok(DRIVES_RESET_FAULT);
        await(DRIVE_DISABLED);
    }
}

/* Neither torque off nor a reset, both asked for in motion, cut it short. */
static void test_quick_stop_goes_on_beside_other_requests(void)
{
    static const drives_request_t k_requests[] = {DRIVES_DISABLE, DRIVES_RESET_FAULT, DRIVES_QUICK_STOP};
    for (size_t i = 0; i < sizeof k_requests / sizeof k_requests[0]; i++) {
        if (!enable_gliding(400000)) {
            return;
        }
        setpoint_q32[2] += MM(50);
        for (int n = 0; n < 300 && feedback[2].state != DRIVE_FAULT; n++) {
            cycle();
        }
        request_ok(DRIVES_QUICK_STOP);
        for (int n = 0; n < 100; n++) {
            cycle_watched();
        }
        request_ok(k_requests[i]);
        const uint64_t took_us = await_off();
        TEST_ASSERT_TRUE(fixture->glide == NULL || took_us >= 250000);
        request_ok(DRIVES_RESET_FAULT);
        await(DRIVE_DISABLED);
    }
}

/* Asked for again and again, as the gateway does it. */
static void test_quick_stop_ends_before_torque_comes_back(void)
{
    bool was_off[DRIVES_MAX] = {false};
    if (!enable_gliding(400000)) {
        return;
    }
    request_ok(DRIVES_QUICK_STOP);
    cycle_watched();
    for (uint8_t k = 0; k < AXES; k++) {
        was_off[k] = !fixture->has_torque(k);
    }
    for (int i = 0; i < 5000 && !are_all(DRIVE_ENABLED); i++) {
        const hv_status_t status = drives_request(hal, DRIVES_ENABLE);
        TEST_ASSERT_TRUE(status == HV_OK || status == HV_ERR_AGAIN);
        cycle_watched();
        for (uint8_t k = 0; k < AXES; k++) {
            was_off[k] |= !fixture->has_torque(k);
            TEST_ASSERT_TRUE(was_off[k] || feedback[k].state != DRIVE_ENABLED);
        }
    }
    assert_all(DRIVE_ENABLED);
}

static void test_quick_stop_of_one_drive_takes_its_torque_alone(void)
{
    if (!enable_gliding(400000) || hal.ops->request_one == NULL) {
        return;
    }
    TEST_ASSERT_EQUAL(HV_OK, drives_request_one(hal, 1, DRIVES_QUICK_STOP));
    for (int i = 0; i < 1000; i++) {
        const hv_status_t status = drives_request_one(hal, 1, DRIVES_ENABLE);
        TEST_ASSERT_TRUE(status == HV_OK || (status == HV_ERR_AGAIN && fixture->glide != NULL));
        if (status == HV_OK) {
            break;
        }
        cycle_watched();
        TEST_ASSERT_TRUE(fixture->has_torque(0) && feedback[0].state == DRIVE_ENABLED);
    }
    await_one(1, DRIVE_ENABLED);
}

static void test_request_home_needs_enabled_and_returns_there_homed(void)
{
    TEST_ASSERT_EQUAL(HV_ERR_STATE, drives_request(hal, DRIVES_HOME));
    enable();
    request_ok(DRIVES_HOME);
    TEST_ASSERT_EQUAL(HV_ERR_STATE, drives_request(hal, DRIVES_HOME));
    await(DRIVE_ENABLED);
    for (uint8_t k = 0; k < AXES; k++) {
        TEST_ASSERT_TRUE(feedback[k].is_homed);
    }
    for (int i = 0; i < 50; i++) {
        cycle();
    }
    assert_all(DRIVE_ENABLED);
}

static void test_request_one_changes_that_axis_and_no_other(void)
{
    q32_t kept_q32[DRIVES_MAX];
    keep_actual(kept_q32);
    const hv_status_t status = drives_request_one(hal, 1, DRIVES_ENABLE);
    if (hal.ops->request_one == NULL) {
        TEST_ASSERT_EQUAL(HV_ERR_NOSUP, status);
        return;
    }
    TEST_ASSERT_EQUAL(HV_OK, status);
    await_one(1, DRIVE_ENABLED);
    TEST_ASSERT_EQUAL(HV_ERR_STATE, drives_request_one(hal, 0, DRIVES_HOME)); /* it is not enabled */
    for (int i = 0; i < 1000; i++) {                                          /* the one that is up follows */
        setpoint_q32[1] += i < 500 ? MM(1) / 500 : 0;
        loose_cycle();
    }
    TEST_ASSERT_TRUE(fx_abs(feedback[1].actual_mm_q32 - kept_q32[1] - MM(1)) < MM(1) / 10);
    TEST_ASSERT_TRUE(fx_abs(feedback[0].actual_mm_q32 - kept_q32[0]) < MM(1) / 100);

    TEST_ASSERT_EQUAL(HV_OK, drives_request_one(hal, 0, DRIVES_ENABLE)); /* beside one that holds its position */
    await_one(0, DRIVE_ENABLED);
    for (int i = 0; i < 200; i++) {
        loose_cycle();
        TEST_ASSERT_EQUAL(DRIVE_ENABLED, feedback[1].state);
    }
    TEST_ASSERT_TRUE(fx_abs(feedback[1].actual_mm_q32 - setpoint_q32[1]) < MM(1) / 10);

    TEST_ASSERT_EQUAL(HV_OK, drives_request_one(hal, 1, DRIVES_DISABLE));
    await_one(1, DRIVE_DISABLED);
    TEST_ASSERT_EQUAL(HV_OK, drives_request_one(hal, 0, DRIVES_QUICK_STOP));
    await_one(0, DRIVE_DISABLED);
    enable(); /* together again, as ever */
}

static void test_request_one_home_leaves_the_others_holding(void)
{
    if (hal.ops->request_one == NULL) {
        return;
    }
    enable();
    const q32_t held_q32 = setpoint_q32[0];
    TEST_ASSERT_EQUAL(HV_OK, drives_request_one(hal, 1, DRIVES_HOME));
    loose_cycle();
    TEST_ASSERT_EQUAL(DRIVE_HOMING, feedback[1].state);
    await_one(1, DRIVE_ENABLED);
    TEST_ASSERT_TRUE(feedback[1].is_homed);
    setpoint_q32[1] = feedback[1].actual_mm_q32;
    TEST_ASSERT_EQUAL(HV_OK, drives_send(hal, now_us, setpoint_q32));
    for (int i = 0; i < 200; i++) {
        loose_cycle();
        assert_all(DRIVE_ENABLED);
    }
    TEST_ASSERT_TRUE(fx_abs(feedback[0].actual_mm_q32 - held_q32) < MM(1) / 10);
}

/* What a person compares with the way a spindle was turned. */
/* Cycles with set-points that move, until the access has ended. */
static drive_object_state_t await_object(drive_object_t *object, uint32_t *code)
{
    drive_object_state_t state = drives_object_end(hal, object, code);
    for (int i = 0; i < 2000 && state == DRIVE_OBJECT_BUSY; i++) {
        for (uint8_t k = 0; k < AXES; k++) {
            setpoint_q32[k] += MM(i % 200 < 100 ? 1 : -1) / 40;
        }
        cycle();
        state = drives_object_end(hal, object, code);
    }
    return state;
}

static void test_object_is_read_beside_the_motion_or_not_supported(void)
{
    drive_object_t object = {.index = 0x1000};
    uint32_t code = 0;
    TEST_ASSERT_EQUAL(DRIVE_OBJECT_NONE, drives_object_end(hal, &object, &code));
    enable();
    const hv_status_t status = drives_object_begin(hal, 3, &object);
    if (hal.ops->object_begin == NULL) {
        TEST_ASSERT_EQUAL(HV_ERR_NOSUP, status);
        TEST_ASSERT_EQUAL(DRIVE_OBJECT_NONE, drives_object_end(hal, &object, &code));
        return;
    }
    TEST_ASSERT_EQUAL(HV_OK, status);
    TEST_ASSERT_EQUAL(HV_ERR_AGAIN, drives_object_begin(hal, 2, &object));
    TEST_ASSERT_EQUAL(DRIVE_OBJECT_DONE, await_object(&object, &code));
    TEST_ASSERT_EQUAL_UINT8(4, object.size);
    TEST_ASSERT_EQUAL_UINT8(0x92, object.value[0]); /* 402 */
    object.index = 0x5FFF;
    TEST_ASSERT_EQUAL(HV_OK, drives_object_begin(hal, 6, &object));
    TEST_ASSERT_EQUAL(DRIVE_OBJECT_REFUSED, await_object(&object, &code));
    TEST_ASSERT_EQUAL_HEX32(0x06020000, code);
    assert_all(DRIVE_ENABLED);
}

static void test_object_that_cannot_be_written_is_refused_at_once(void)
{
    drive_object_t object = {.index = 0x2000, .is_write = true};
    if (hal.ops->object_begin == NULL) {
        TEST_ASSERT_EQUAL(HV_ERR_NOSUP, drives_object_begin(hal, 0, &object));
        return;
    }
    TEST_ASSERT_EQUAL(HV_ERR_RANGE, drives_object_begin(hal, 0, &object));
    object.size = DRIVE_OBJECT_BYTES + 1u;
    TEST_ASSERT_EQUAL(HV_ERR_RANGE, drives_object_begin(hal, 0, &object));
    object = (drive_object_t){.index = 0x6040, .is_write = true, .size = 2};
    TEST_ASSERT_EQUAL(HV_ERR_ARG, drives_object_begin(hal, 0, &object));
    fixture->set_power(4, false);
    for (int i = 0; i < 400; i++) {
        cycle();
    }
    TEST_ASSERT_EQUAL(HV_ERR_STATE, drives_object_begin(hal, 4, &(drive_object_t){.index = 0x1000}));
    TEST_ASSERT_EQUAL(HV_OK, drives_object_begin(hal, 5, &(drive_object_t){.index = 0x1000}));
}

static void test_counts_go_with_the_position(void)
{
    int64_t before = 0;
    int64_t after = 0;
    enable();
    TEST_ASSERT_TRUE(drives_counts(hal, 1, &before));
    const q32_t from_q32 = feedback[1].actual_mm_q32;
    for (int i = 0; i < 3000; i++) {
        setpoint_q32[1] += i < 1000 ? MM(1) / 500 : 0;
        cycle();
    }
    const double mm = (double)(feedback[1].actual_mm_q32 - from_q32) / 4294967296.0;
    TEST_ASSERT_TRUE(mm > 1.8 && mm < 2.2);
    TEST_ASSERT_TRUE(drives_counts(hal, 1, &after));
    const double per_mm = (double)(after - before) / mm;
    TEST_ASSERT_TRUE(per_mm > 50 || per_mm < -50); /* a drive may count the other way round */
}

static void test_power_lost_is_offline_and_returns_disabled(void)
{
    if (fixture->set_power == NULL) {
        TEST_IGNORE_MESSAGE("this backend's drives cannot be cut off from here");
    }
    enable();
    fixture->set_power(1, false);
    for (int i = 0; i < 1000 && feedback[1].state != DRIVE_OFFLINE; i++) {
        cycle();
    }
    TEST_ASSERT_EQUAL(DRIVE_OFFLINE, feedback[1].state);
    TEST_ASSERT_EQUAL(HV_ERR_STATE, drives_request(hal, DRIVES_ENABLE));
    fixture->set_power(1, true);
    for (int i = 0; i < 10000 && feedback[1].state == DRIVE_OFFLINE; i++) {
        cycle();
    }
    TEST_ASSERT_EQUAL(DRIVE_DISABLED, feedback[1].state);
}

static void test_power_lost_everywhere_says_io_and_comes_back(void)
{
    hv_status_t status = HV_OK;
    if (fixture->set_power == NULL) {
        TEST_IGNORE_MESSAGE("this backend's drives cannot be cut off from here");
    }
    for (uint8_t k = 0; k < AXES; k++) {
        fixture->set_power(k, false);
    }
    for (int i = 0; i < 1000 && status == HV_OK; i++) {
        status = poll_once();
    }
    TEST_ASSERT_EQUAL(HV_ERR_IO, status);
    assert_all(DRIVE_OFFLINE);
    TEST_ASSERT_EQUAL(HV_ERR_IO, drives_send(hal, now_us, setpoint_q32));
    TEST_ASSERT_EQUAL(HV_ERR_IO, drives_request(hal, DRIVES_DISABLE));
    for (uint8_t k = 0; k < AXES; k++) {
        fixture->set_power(k, true);
    }
    for (int i = 0; i < 10000 && !are_all(DRIVE_DISABLED); i++) {
        (void)!poll_once();
    }
    assert_all(DRIVE_DISABLED);
    follow_actual();
    enable();
}

static void run_contract(void)
{
    RUN_TEST(test_valid_complete_accepts);
    RUN_TEST(test_valid_any_op_missing_refuses);
    RUN_TEST(test_poll_after_start_tells_where_the_axes_are);
    RUN_TEST(test_send_while_disabled_moves_nothing);
    RUN_TEST(test_request_enable_comes_up_without_motion);
    RUN_TEST(test_request_off_tells_when_the_torque_is_off);
    RUN_TEST(test_send_while_enabled_is_followed_to_the_end);
    RUN_TEST(test_send_jump_while_enabled_faults_that_axis);
    RUN_TEST(test_send_elsewhere_while_enabling_faults_instead_of_jumping);
    RUN_TEST(test_request_reset_fault_leads_back_to_enabled);
    RUN_TEST(test_request_taken_is_seen_in_the_next_poll);
    RUN_TEST(test_request_disable_and_quick_stop_end_in_disabled);
    RUN_TEST(test_quick_stop_takes_the_torque_at_rest);
    RUN_TEST(test_quick_stop_without_rest_ends_after_five_seconds);
    RUN_TEST(test_quick_stop_after_a_fault_takes_the_torque_of_all);
    RUN_TEST(test_quick_stop_goes_on_beside_other_requests);
    RUN_TEST(test_quick_stop_ends_before_torque_comes_back);
    RUN_TEST(test_quick_stop_of_one_drive_takes_its_torque_alone);
    RUN_TEST(test_request_home_needs_enabled_and_returns_there_homed);
    RUN_TEST(test_request_one_changes_that_axis_and_no_other);
    RUN_TEST(test_request_one_home_leaves_the_others_holding);
    RUN_TEST(test_object_is_read_beside_the_motion_or_not_supported);
    RUN_TEST(test_object_that_cannot_be_written_is_refused_at_once);
    RUN_TEST(test_counts_go_with_the_position);
    RUN_TEST(test_power_lost_is_offline_and_returns_disabled);
    RUN_TEST(test_power_lost_everywhere_says_io_and_comes_back);
}

/* The simulated drives. */

static void reopen_sim(const sim_drives_fault_t *plan, uint32_t planned)
{
    start_sim(plan, planned);
    TEST_ASSERT_EQUAL(HV_OK, poll_once());
    follow_actual();
}

static void test_sim_init_impossible_figures_are_refused(void)
{
    static const sim_drives_fault_t k_plan[SIM_DRIVES_PLAN_MAX + 1];
    TEST_ASSERT_EQUAL(HV_ERR_RANGE, sim_drives_init(&sim, 0, config, NULL, 0));
    TEST_ASSERT_EQUAL(HV_ERR_RANGE, sim_drives_init(&sim, DRIVES_MAX + 1, config, NULL, 0));
    TEST_ASSERT_EQUAL(HV_ERR_RANGE, sim_drives_init(&sim, AXES, config, k_plan, SIM_DRIVES_PLAN_MAX + 1));
    for (int i = 0; i < 6; i++) {
        configure();
        config[4].start_q32 = i == 0 ? MM(301) : config[4].start_q32;
        config[4].travel_max_q32 = i == 1 ? INT64_MAX : config[4].travel_max_q32;
        config[4].travel_min_q32 = i == 2 ? MM(150) : config[4].travel_min_q32;
        config[4].homing_per_s_q32 = i == 3 ? -1 : config[4].homing_per_s_q32;
        config[4].step_max_q32 = i == 4 ? -1 : config[4].step_max_q32;
        config[4].unhomed_offset_q32 = i == 5 ? INT64_MIN : config[4].unhomed_offset_q32;
        TEST_ASSERT_EQUAL(HV_ERR_RANGE, sim_drives_init(&sim, AXES, config, NULL, 0));
    }
}

static void test_sim_start_enabled_follows_from_the_first_cycle(void)
{
    for (uint8_t k = 0; k < AXES; k++) {
        config[k].is_enabled = true;
    }
    reopen_sim(NULL, 0);
    assert_all(DRIVE_ENABLED);
    for (int i = 0; i < 100; i++) {
        setpoint_q32[0] += MM(1) / 100;
        cycle();
    }
    TEST_ASSERT_TRUE(feedback[0].actual_mm_q32 > MM(100));
    TEST_ASSERT_TRUE(sim.axis[0].step_largest_q32 == MM(1) / 100);
}

/* Against the same recursion in double precision, with cycles of uneven length. */
static void test_sim_lag_matches_the_model(void)
{
    double model_mm = 100.0, asked_mm = 100.0, worst_mm = 0.0;
    enable();
    for (unsigned i = 0; i < 5000; i++) {
        const unsigned dt_us = 500u + i * 7919u % 1500u;
        model_mm += (asked_mm - model_mm) * dt_us / (5000.0 + dt_us);
        now_us += dt_us;
        now_us -= CYCLE_US; /* which the cycle adds */
        cycle();
        asked_mm = ldexp((double)setpoint_q32[0], -32); /* sent in this cycle, in force in the next */
        worst_mm = fmax(worst_mm, fabs(model_mm - ldexp((double)feedback[0].actual_mm_q32, -32)));
        setpoint_q32[0] = MM(100) + (q32_t)(sin(i * 0.001) * 20.0 * 4294967296.0);
        TEST_ASSERT_TRUE(setpoint_q32[0] >= MM(79));
    }
    assert_all(DRIVE_ENABLED);
    TEST_ASSERT_TRUE_MESSAGE(worst_mm < 1e-6, "worst error");
}

static void test_sim_no_time_constant_follows_at_once(void)
{
    config[5].time_constant_us = 0;
    reopen_sim(NULL, 0);
    enable();
    for (int i = 0; i < 50; i++) {
        setpoint_q32[5] += MM(1) / 3;
        cycle();
        TEST_ASSERT_EQUAL_INT64(setpoint_q32[5] - MM(1) / 3, feedback[5].actual_mm_q32);
    }
}

static void test_sim_step_window_is_exact(void)
{
    enable();
    setpoint_q32[0] += MM(1);
    cycle();
    cycle();
    TEST_ASSERT_EQUAL(DRIVE_ENABLED, feedback[0].state);
    TEST_ASSERT_EQUAL_INT64(MM(1), sim.axis[0].step_largest_q32);
    setpoint_q32[0] += MM(1) + 1;
    cycle();
    cycle();
    TEST_ASSERT_EQUAL(DRIVE_FAULT, feedback[0].state);
    TEST_ASSERT_EQUAL_HEX32(SIM_DRIVES_FOLLOWING_ERROR, feedback[0].fault_code);
    TEST_ASSERT_EQUAL_INT64(MM(1) + 1, sim.axis[0].step_largest_q32);
    TEST_ASSERT_EQUAL_UINT32(1, sim.axis[0].following_errors);
}

static void test_sim_extreme_setpoints_fault_and_do_not_overflow(void)
{
    static const q32_t k_wild[] = {INT64_MAX, INT64_MIN};
    for (size_t i = 0; i < 2; i++) {
        reopen_sim(NULL, 0);
        enable();
        for (uint8_t k = 0; k < AXES; k++) {
            setpoint_q32[k] = k_wild[i];
        }
        cycle();
        cycle();
        assert_all(DRIVE_FAULT);
        config[0].step_max_q32 = 0;
        config[0].lag_max_q32 = 0;
        reopen_sim(NULL, 0);
        enable();
        setpoint_q32[0] = k_wild[i];
        for (int n = 0; n < 100; n++) {
            cycle();
        }
        TEST_ASSERT_EQUAL_INT64(i == 0 ? MM(300) : 0, feedback[0].actual_mm_q32);
        configure();
    }
}

static void test_sim_homing_moves_the_zero(void)
{
    config[0].is_homed = false;
    config[0].unhomed_offset_q32 = MM(37);
    config[0].home_q32 = MM(2);
    reopen_sim(NULL, 0);
    TEST_ASSERT_FALSE(feedback[0].is_homed);
    TEST_ASSERT_EQUAL_INT64(MM(137), feedback[0].actual_mm_q32);
    enable();
    request_ok(DRIVES_HOME);
    await(DRIVE_ENABLED);
    TEST_ASSERT_TRUE(feedback[0].is_homed);
    TEST_ASSERT_EQUAL_INT64(MM(2), feedback[0].actual_mm_q32);
    cycle();
    TEST_ASSERT_EQUAL(DRIVE_ENABLED, feedback[0].state);
}

/* Set-points that stay in the old zero after homing are a jump. */
static void test_sim_homing_old_setpoints_afterwards_fault(void)
{
    enable();
    request_ok(DRIVES_HOME);
    for (int i = 0; i < 10000 && feedback[0].state != DRIVE_FAULT; i++) {
        cycle();
    }
    TEST_ASSERT_EQUAL(DRIVE_FAULT, feedback[0].state);
}

/* As a real drive that kept its last target over a crash of the gateway. */
static void test_sim_setpoint_left_over_from_before_enabling_faults(void)
{
    setpoint_q32[1] += MM(20);
    cycle();
    request_ok(DRIVES_ENABLE);
    for (int i = 0; i < 60; i++) {
        TEST_ASSERT_EQUAL(HV_OK, poll_once());
    }
    TEST_ASSERT_EQUAL(DRIVE_FAULT, feedback[1].state);
    TEST_ASSERT_EQUAL(DRIVE_ENABLED, feedback[0].state);
    TEST_ASSERT_EQUAL_INT64(MM(110), feedback[1].actual_mm_q32);
}

static void test_sim_frozen_axis_is_found_by_its_lag(void)
{
    enable();
    inject(SIM_DRIVES_FREEZE, 2);
    for (int i = 0; i < 200; i++) {
        for (uint8_t k = 0; k < AXES; k++) {
            setpoint_q32[k] += MM(1) / 20;
        }
        cycle();
    }
    TEST_ASSERT_EQUAL(DRIVE_FAULT, feedback[2].state);
    TEST_ASSERT_EQUAL_INT64(MM(120), feedback[2].actual_mm_q32);
    TEST_ASSERT_EQUAL(DRIVE_ENABLED, feedback[1].state);
}

static void test_sim_stale_axis_shows_its_age(void)
{
    enable();
    const uint64_t last_us = feedback[4].actual_us;
    inject(SIM_DRIVES_STALE, 4);
    for (int i = 1; i <= 20; i++) {
        cycle();
        TEST_ASSERT_EQUAL_UINT64(last_us, feedback[4].actual_us);
        TEST_ASSERT_EQUAL_UINT64(now_us, feedback[3].actual_us);
        TEST_ASSERT_EQUAL(DRIVE_ENABLED, feedback[4].state);
    }
    inject(SIM_DRIVES_RECOVER, 4);
    cycle();
    TEST_ASSERT_EQUAL_UINT64(now_us, feedback[4].actual_us);
}

static void test_sim_busy_bus_takes_nothing_until_it_recovers(void)
{
    enable();
    inject(SIM_DRIVES_BUSY, SIM_DRIVES_ALL);
    TEST_ASSERT_EQUAL(HV_OK, poll_once());
    TEST_ASSERT_EQUAL(HV_ERR_AGAIN, drives_send(hal, now_us, setpoint_q32));
    TEST_ASSERT_EQUAL(HV_ERR_AGAIN, drives_request(hal, DRIVES_DISABLE));
    TEST_ASSERT_EQUAL_UINT32(1, sim.refused);
    inject(SIM_DRIVES_RECOVER, SIM_DRIVES_ALL);
    cycle();
    assert_all(DRIVE_ENABLED);
}

static void test_sim_broken_axis_resets_only_after_recovery(void)
{
    inject(SIM_DRIVES_BROKEN, 0);
    cycle();
    for (int i = 0; i < 5; i++) {
        request_ok(DRIVES_RESET_FAULT);
        cycle();
        TEST_ASSERT_EQUAL(DRIVE_FAULT, feedback[0].state);
    }
    inject(SIM_DRIVES_RECOVER, 0);
    request_ok(DRIVES_RESET_FAULT);
    await(DRIVE_DISABLED);
}

/* Runs a script with everything in it and folds every feedback bit into one number (FNV-1a). */
static uint64_t fingerprint(void)
{
    static const sim_drives_fault_t k_plan[] = {{SIM_DRIVES_STALE, 1, 0, 90, 0},
                                                {SIM_DRIVES_RECOVER, 1, 0, 110, 0},
                                                {SIM_DRIVES_FAULT, 6, 0x3210, 0, 5350000},
                                                {SIM_DRIVES_OFFLINE, 2, 0, 250, 0}};
    uint64_t hash = UINT64_C(0xCBF29CE484222325);
    for (uint8_t k = 0; k < AXES; k++) {
        config[k].homing_per_s_q32 = MM(4000) + k * 12345;
    }
    reopen_sim(k_plan, 4);
    request_ok(DRIVES_ENABLE);
    for (int64_t i = 0; i < 400; i++) {
        TEST_ASSERT_EQUAL(HV_OK, poll_once());
        for (uint8_t k = 0; k < AXES; k++) {
            const q32_t step_q32 = ((i * 977 + k * 131) % 201 - 100) * (Q32_ONE / 1000);
            setpoint_q32[k] = feedback[k].state == DRIVE_ENABLED ? setpoint_q32[k] + step_q32 : feedback[k].actual_mm_q32;
        }
        TEST_ASSERT_EQUAL(HV_OK, drives_send(hal, now_us, setpoint_q32));
        if (i == 60) {
            request_ok(DRIVES_HOME);
        }
        for (uint8_t k = 0; k < AXES; k++) {
            const uint64_t words[] = {(uint64_t)feedback[k].actual_mm_q32, feedback[k].actual_us, (uint64_t)feedback[k].state,
                                      feedback[k].fault_code};
            for (size_t w = 0; w < 4; w++) {
                hash = (hash ^ words[w]) * UINT64_C(0x100000001B3);
            }
        }
    }
    return hash;
}

/* The number is part of the promise "the same bits on every CPU": it changes only where the model is changed on purpose. */
static void test_sim_same_calls_give_the_same_bits(void)
{
    const uint64_t hash = fingerprint();
    TEST_ASSERT_EQUAL_HEX64(hash, fingerprint());
    TEST_ASSERT_EQUAL_HEX64(UINT64_C(0x853FB7B7E6B1EEF1), hash);
}

/* Moves all axes together with one fault at step `at`, then recovers, resets, enables: whatever the kind and the step, no axis
 * moves without being told, the others stay as they are, and the way back is free of jumps. */
static void sweep(sim_drives_fault_kind_t kind, uint32_t at)
{
    const sim_drives_fault_t plan[] = {{kind, 3, 0x7305, at, 0}, {SIM_DRIVES_RECOVER, 3, 0, 121, 0}};
    q32_t before_q32[DRIVES_MAX];
    reopen_sim(plan, 2);
    const hv_status_t asked = drives_request(hal, DRIVES_ENABLE);
    TEST_ASSERT_TRUE(asked == HV_OK || at == 1);
    for (int i = 0; i < 119; i++) {
        keep_actual(before_q32);
        TEST_ASSERT_EQUAL(HV_OK, poll_once());
        for (uint8_t k = 0; k < AXES; k++) {
            TEST_ASSERT_TRUE(feedback[k].state == DRIVE_ENABLED || feedback[k].actual_mm_q32 == before_q32[k]);
            TEST_ASSERT_TRUE(k == 3 || (feedback[k].state != DRIVE_FAULT && feedback[k].state != DRIVE_OFFLINE));
        }
        const q32_t step_q32 = are_all(DRIVE_ENABLED) && !sim.is_busy ? MM(1) / 50 : 0;
        for (uint8_t k = 0; k < AXES; k++) {
            setpoint_q32[k] += step_q32;
        }
        TEST_ASSERT_EQUAL(sim.is_busy ? HV_ERR_AGAIN : HV_OK, drives_send(hal, now_us, setpoint_q32));
    }
    cycle();
    request_ok(DRIVES_DISABLE);
    request_ok(DRIVES_RESET_FAULT);
    await(DRIVE_DISABLED);
    enable();
    for (uint8_t k = 0; k < AXES; k++) {
        TEST_ASSERT_EQUAL_UINT32(0, sim.axis[k].following_errors);
        TEST_ASSERT_TRUE(sim.axis[k].step_largest_q32 <= MM(1) / 10);
    }
}

static void test_sim_one_fault_at_every_step_leads_back_to_enabled(void)
{
    static const sim_drives_fault_kind_t k_kinds[] = {SIM_DRIVES_FAULT,  SIM_DRIVES_BROKEN, SIM_DRIVES_OFFLINE,
                                                      SIM_DRIVES_FREEZE, SIM_DRIVES_STALE,  SIM_DRIVES_BUSY};
    for (size_t kind = 0; kind < sizeof k_kinds / sizeof k_kinds[0]; kind++) {
        for (uint32_t at = 1; at <= 119; at++) {
            sweep(k_kinds[kind], at);
        }
    }
}

static void run_sim(void)
{
    RUN_TEST(test_sim_init_impossible_figures_are_refused);
    RUN_TEST(test_sim_start_enabled_follows_from_the_first_cycle);
    RUN_TEST(test_sim_lag_matches_the_model);
    RUN_TEST(test_sim_no_time_constant_follows_at_once);
    RUN_TEST(test_sim_step_window_is_exact);
    RUN_TEST(test_sim_extreme_setpoints_fault_and_do_not_overflow);
    RUN_TEST(test_sim_homing_moves_the_zero);
    RUN_TEST(test_sim_homing_old_setpoints_afterwards_fault);
    RUN_TEST(test_sim_setpoint_left_over_from_before_enabling_faults);
    RUN_TEST(test_sim_frozen_axis_is_found_by_its_lag);
    RUN_TEST(test_sim_stale_axis_shows_its_age);
    RUN_TEST(test_sim_busy_bus_takes_nothing_until_it_recovers);
    RUN_TEST(test_sim_broken_axis_resets_only_after_recovery);
    RUN_TEST(test_sim_same_calls_give_the_same_bits);
    RUN_TEST(test_sim_one_fault_at_every_step_leads_back_to_enabled);
}

int main(void)
{
    UNITY_BEGIN();
    for (size_t i = 0; i < sizeof k_fixtures / sizeof k_fixtures[0]; i++) {
        fixture = &k_fixtures[i];
        contract_backend = fixture->name;
        run_contract();
    }
    fixture = &k_fixtures[0];
    contract_backend = fixture->name;
    run_sim();
    return UNITY_END();
}
