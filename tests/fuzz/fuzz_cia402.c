/* SPDX-License-Identifier: MIT
 * fuzz_cia402.c - frames from the bus (SDO answers, TPDOs, emergencies, heartbeats, reports) to the CANopen driver, while seven
 * simulated drives do their work. Input: records of twelve bytes, see step().
 * What must hold: frames that are not meant for it, or that no such node sends, change nothing in the driver (a second one does
 * not get them); it sends the frames of a master only; while a drive is enabled its target moves by no more than the largest
 * step; sets taken and refused add up, and each emergency that it got is counted once; what it reports makes sense.
 */
#include <stdlib.h>
#include <string.h>

#include "can_tap.h"
#include "canopen_drives.h"
#include "drive_run.h"
#include "heave/cia402.h"

#define CYCLE_US      1000u
#define RECORDS_MAX   48u
#define CYCLES_MAX    16u
#define COUNTS_PER_MM 1000
#define STEP_MM       2
#define FUNCTION      0x780u
#define NODE          0x7Fu

/* The bus, its drives, and the driver. */
typedef struct {
    sim_can_bus_t bus;
    sim_can_t node;
    canopen_drives_t twin;
    can_tap_t tap;
    cia402_t driver;
    drive_run_t run;
    bool was_enabled[DRIVES_MAX]; /* when its last target was sent */
    int32_t target[DRIVES_MAX];
    uint8_t asked[DRIVES_MAX][8]; /* newest SDO request */
    uint32_t emergencies;         /* that the driver got */
} world_t;

static const cia402_item_t k_items[] = {
    {.index = 0x2030, .sub = 1, .bytes = 2, .value = 50, .is_written = true, .is_checked = true},
    {.index = 0x2099, .bytes = 1, .is_written = true, .is_optional = true}, /* no drive has it */
    {.index = 0x2031, .bytes = 4, .value = 0x80000000u, .is_written = true, .is_last = true},
    {.index = 0x2032, .bytes = 1, .value = 3, .is_last = true},
};
static cia402_config_t m_config;
static world_t m_start[2][2]; /* off, and enabled */
static world_t m_world[2];    /* the one that gets everything, and the one without what is not meant for it */

/* --- What the driver sends --- */

static void watch_target(world_t *self, unsigned k, const can_frame_t *frame)
{
    const uint8_t *data = frame->data;
    const int32_t target =
        (int32_t)((uint32_t)data[2] | (uint32_t)data[3] << 8 | (uint32_t)data[4] << 16 | (uint32_t)data[5] << 24);
    const bool is_enabled = self->run.feedback[k].state == DRIVE_ENABLED && self->driver.stage == CIA402_STAGE_FOLLOW;
    FUZZ_REQUIRE(frame->length == 6);
    if (is_enabled && self->was_enabled[k]) {
        const int64_t step = llabs((int64_t)target - self->target[k]);
        FUZZ_REQUIRE(step <= STEP_MM * COUNTS_PER_MM + 1);
    }
    self->target[k] = target;
    self->was_enabled[k] = is_enabled;
}

static void see_sent(void *watcher, const can_frame_t *frame)
{
    world_t *self = watcher;
    const unsigned node = frame->id & NODE;
    const bool is_drive = node >= 1 && node <= DRIVES_MAX;
    FUZZ_REQUIRE(!frame->is_extended && !frame->is_rtr && !frame->is_error && frame->length <= 8);
    switch (frame->id & FUNCTION) {
    case 0x000:
        FUZZ_REQUIRE(node == 0 && frame->length == 2 && frame->data[1] <= DRIVES_MAX);
        break;
    case 0x080:
        FUZZ_REQUIRE(node == 0 && frame->length == 0);
        break;
    case 0x200:
        FUZZ_REQUIRE(is_drive);
        watch_target(self, node - 1, frame);
        break;
    case 0x600:
        FUZZ_REQUIRE(is_drive && frame->length == 8);
        memcpy(self->asked[node - 1], frame->data, 8);
        break;
    default:
        FUZZ_REQUIRE(frame->id == 0x77F && frame->length == 1 && frame->data[0] == 5);
        break;
    }
}

/* --- What it gets --- */

static bool is_emergency(const can_frame_t *frame)
{
    return (frame->id & FUNCTION) == 0x080 && !frame->is_extended && !frame->is_rtr && !frame->is_error &&
           (frame->id & NODE) >= 1 && (frame->id & NODE) <= DRIVES_MAX;
}

static void see_received(void *watcher, const can_frame_t *frame)
{
    world_t *self = watcher;
    self->emergencies += is_emergency(frame);
}

/* --- Cycles --- */

static void check_report(const world_t *self, hv_status_t status)
{
    for (uint8_t k = 0; k < DRIVES_MAX; k++) {
        const drive_feedback_t *feedback = &self->run.feedback[k];
        drive_report_t report;
        FUZZ_REQUIRE(feedback->state <= DRIVE_FAULT && (status == HV_OK || feedback->state == DRIVE_OFFLINE));
        FUZZ_REQUIRE(feedback->state == DRIVE_FAULT || feedback->state == DRIVE_OFFLINE || feedback->fault_code == 0);
        FUZZ_REQUIRE(!feedback->has_actual || feedback->actual_us <= self->run.now_us);
        FUZZ_REQUIRE(drives_report(self->run.drives, k, &report));
        FUZZ_REQUIRE(report.phase != NULL && report.trouble != NULL && report.detail != NULL && report.address == k + 1u);
        FUZZ_REQUIRE(report.notes >> DRIVE_NOTES == 0);
        FUZZ_REQUIRE(self->driver.axis[k].sdo.size <= SDO_BYTES_MAX && self->driver.axis[k].sdo.at <= SDO_BYTES_MAX);
    }
}

static void cycle(void *world)
{
    world_t *self = world;
    drive_run_t *run = &self->run;
    run->now_us += CYCLE_US;
    canopen_drives_step(&self->twin, run->now_us);
    const hv_status_t status = drives_poll(run->drives, run->now_us, run->feedback);
    FUZZ_REQUIRE(status == HV_OK || status == HV_ERR_IO);
    check_report(self, status);
    FUZZ_REQUIRE(self->driver.emergencies == self->emergencies);
    const uint32_t sets = self->driver.sets + self->driver.refused;
    (void)!drives_send(run->drives, run->now_us, run->setpoint_q32);
    FUZZ_REQUIRE(self->driver.sets + self->driver.refused - sets <= 1);
}

/* --- Coming up --- */

static void configure(void)
{
    m_config = (cia402_config_t){
        .axes = DRIVES_MAX,
        .master_node = 127,
        .mode = CIA402_MODE_CSP,
        .period_us = 2 * CYCLE_US,
        .heartbeat_ms = 50,
        .heartbeat_timeout_ms = 150,
        .sdo_timeout_ms = 100,
        .boot_timeout_ms = 1000,
        .power_timeout_ms = 2000,
        .window_ms = 20,
        .abort_option = 1,
        .is_reset_wanted = true,
        .is_support_checked = true,
        .telemetry = DRIVE_HAS_TORQUE | DRIVE_HAS_LAG | DRIVE_HAS_INPUTS,
        .telemetry_every = 2,
        .reaction = {CIA402_STOP, CIA402_STOP, CIA402_STOP, CIA402_STOP, CIA402_REPORT, CIA402_REPORT, CIA402_STOP}};
    for (uint8_t k = 0; k < DRIVES_MAX; k++) {
        m_config.axis[k] = (cia402_axis_config_t){.node = (uint8_t)(k + 1),
                                                  .scale = {k % 2 ? -COUNTS_PER_MM : COUNTS_PER_MM, 1, 5000 * k},
                                                  .step_max_q32 = q32_from_int(STEP_MM),
                                                  .following_max_q32 = q32_from_int(10),
                                                  .window_counts = 10000,
                                                  .items = sizeof k_items / sizeof k_items[0]};
        memcpy(m_config.axis[k].item, k_items, sizeof k_items);
    }
}

static void bring_up(unsigned i)
{
    world_t *self = &m_world[i];
    hal_can_filter_t filter[CIA402_FILTERS_MAX];
    memset(self, 0, sizeof *self);
    self->run.now_us = 5000000;
    sim_can_bus_init(&self->bus, 0, NULL, 0);
    canopen_drives_open(&self->twin, &self->bus);
    FUZZ_REQUIRE(sim_can_open(&self->node, &self->bus, filter, cia402_filters(&m_config, filter)) == HV_OK);
    self->tap = (can_tap_t){.inner = sim_can_hal(&self->node), .watcher = self, .sent = see_sent, .received = see_received};
    FUZZ_REQUIRE(cia402_init(&self->driver, &m_config, can_tap_hal(&self->tap)) == HV_OK);
    self->run.drives = cia402_hal(&self->driver);
    drive_run_await(&self->run, DRIVE_DISABLED, cycle, self);
    m_start[i][0] = *self;
    FUZZ_REQUIRE(drives_request(self->run.drives, DRIVES_ENABLE) == HV_OK);
    drive_run_await(&self->run, DRIVE_ENABLED, cycle, self);
    m_start[i][1] = *self;
}

/* --- Records --- */

static can_frame_t frame_of(const record_t *record, uint32_t function)
{
    can_frame_t frame = {.id = function + record->drive + 1u, .length = record->length};
    memcpy(frame.data, record->data, record->length);
    return frame;
}

/* Something that a node might send. */
static can_frame_t any_frame(const record_t *record)
{
    static const uint32_t k_functions[] = {0x080, 0x180, 0x580, 0x700, 0x280, 0x380};
    static const uint8_t k_length[] = {8, 7, 8, 1, 6, 4};
    can_frame_t frame = frame_of(record, k_functions[record->kind % 6]);
    if ((record->kind & 0x80) == 0) { /* as long as it should be */
        frame.length = k_length[record->kind % 6];
        memcpy(frame.data, record->data, frame.length);
    }
    return frame;
}

/* An answer to what this drive was asked last; the record chooses how right it is. */
static can_frame_t sdo_answer(const world_t *world, const record_t *record)
{
    static const uint8_t k_commands[] = {0x60, 0x43, 0x4B, 0x4F, 0x41, 0x42, 0x80, 0x20, 0x30, 0x00, 0x10, 0x01, 0x11, 0x0D};
    can_frame_t frame = {.id = 0x580u + record->drive + 1u, .length = 8};
    memcpy(frame.data, world->asked[record->drive], 4);
    memcpy(frame.data + 4, record->data, 4);
    frame.data[0] = k_commands[record->kind % sizeof k_commands];
    frame.data[1 + record->data[4] % 3] ^= record->data[5]; /* another object, unless 0 */
    return frame;
}

/* Nothing that concerns the driver. */
static can_frame_t strange_frame(const record_t *record)
{
    can_frame_t frame = any_frame(record);
    switch (record->data[7] % 6) {
    case 0:
        frame.is_extended = true;
        break;
    case 1:
        frame.is_rtr = true;
        break;
    case 2: /* a node that is not ours */
        frame.id = (frame.id & FUNCTION) + DRIVES_MAX + 1u + record->kind % 64;
        break;
    case 3: /* a function that is not a drive's */
        frame.id = 0x480u + record->drive + 1u;
        break;
    case 4: /* an SDO answer that is too short */
        frame = frame_of(record, 0x580);
        frame.length = (uint8_t)(record->length % 8);
        break;
    default: /* no heartbeat */
        frame = frame_of(record, 0x700);
        frame.length = record->length == 1 ? 2 : record->length;
        break;
    }
    return frame;
}

static void receive(world_t *self, const can_frame_t *frame)
{
    const uint32_t emergencies = self->emergencies;
    can_tap_slip_in(&self->tap, frame);
    cycle(self);
    FUZZ_REQUIRE(self->emergencies >= emergencies + is_emergency(frame));
}

static void disturb(world_t *self, const record_t *record)
{
    canopen_drive_t *drive = &self->twin.drive[record->drive];
    switch (record->kind % 8) {
    case 0:
        canopen_drives_fault(&self->twin, record->drive, (uint16_t)(record->data[0] | record->data[1] << 8));
        break;
    case 1:
        canopen_drives_power(&self->twin, record->drive, record->data[0] % 2 != 0);
        break;
    case 2:
        canopen_drives_drop(&self->twin, record->drive);
        break;
    case 3:
        drive->node.is_mute = record->data[0] % 2 != 0;
        break;
    case 4:
        drive->node.tpdo_drop = record->data[0] % 8;
        break;
    case 5:
        drive->node.has_no_heartbeat = record->data[0] % 2 != 0;
        break;
    case 6:
        drive->is_answering_late = record->data[0] % 2 != 0;
        break;
    default:
        drive->node.is_sdo_silent = record->data[0] % 2 != 0;
        break;
    }
}

/* Nobody moves on beside another master. */
static void hear_master(world_t *self, const record_t *record)
{
    const uint32_t ids[] = {0x000, 0x080, 0x200u + record->drive + 1u, 0x77F};
    can_frame_t frame = {.id = ids[record->data[0] % 4], .length = record->length};
    memcpy(frame.data, record->data, record->length);
    if (frame.id == 0x000) {
        frame.length = 2;
        frame.data[1] = record->data[1] % (DRIVES_MAX + 1u);
    }
    receive(self, &frame);
    for (unsigned k = 0; k < DRIVES_MAX && self->driver.master.heard_us == self->run.now_us; k++) {
        FUZZ_REQUIRE(self->run.feedback[k].state != DRIVE_ENABLED);
    }
}

static void disturb_bus(world_t *self, const record_t *record)
{
    static const hal_can_state_t k_states[] = {HAL_CAN_ACTIVE, HAL_CAN_WARNING, HAL_CAN_PASSIVE, HAL_CAN_BUS_OFF};
    const can_frame_t report = {.id = record->data[0], .is_error = true};
    switch (record->kind % 5) {
    case 0:
        sim_can_set_state(&self->node, k_states[record->data[0] % 4]);
        break;
    case 1:
        sim_can_unplug(&self->node);
        break;
    case 2:
        sim_can_plug(&self->node);
        break;
    case 3:
        receive(self, &report);
        break;
    default:
        hear_master(self, record);
        break;
    }
}

/* After homing set-points begin at actual again, which an old one may be far from. */
static void ask(world_t *self, const record_t *record)
{
    if (drive_run_ask(&self->run, record) == HV_OK && record->kind % (DRIVES_RESET_FAULT + 1u) == DRIVES_HOME) {
        memset(self->was_enabled, 0, sizeof self->was_enabled);
    }
}

/* One record in a world; is_all: the one that gets everything. */
static void step(world_t *self, const record_t *record, bool is_all)
{
    can_frame_t frame;
    switch (record->op % 8) {
    case 0:
        for (unsigned i = 0; i < record->kind % CYCLES_MAX; i++) {
            cycle(self);
        }
        break;
    case 1:
        frame = any_frame(record);
        receive(self, &frame);
        break;
    case 2:
        frame = sdo_answer(self, record);
        receive(self, &frame);
        break;
    case 3:
        frame = strange_frame(record);
        if (is_all) {
            can_tap_slip_in(&self->tap, &frame);
        }
        cycle(self);
        break;
    case 4:
        disturb(self, record);
        break;
    case 5:
        disturb_bus(self, record);
        break;
    case 6:
        ask(self, record);
        break;
    default:
        drive_run_move(&self->run, record);
        cycle(self);
        break;
    }
}

static void compare(void)
{
    static cia402_t all, some;
    all = m_world[0].driver;
    some = m_world[1].driver;
    all.can = some.can;
    FUZZ_REQUIRE(memcmp(&all, &some, sizeof all) == 0);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    fuzz_input_t in = {data, size};
    if (m_config.axes == 0) {
        configure();
        bring_up(0);
        bring_up(1);
    }
    const unsigned is_enabled = fuzz_u8(&in) % 2;
    m_world[0] = m_start[0][is_enabled];
    m_world[1] = m_start[1][is_enabled];
    for (unsigned i = 0; i < RECORDS_MAX && in.left > 0; i++) {
        const record_t record = record_read(&in);
        step(&m_world[0], &record, true);
        step(&m_world[1], &record, false);
        compare();
    }
    return 0;
}
