/* SPDX-License-Identifier: MIT
 * fuzz_canraw.c - frames from the bus (positions, answers about homing, what is nearly one of them, reports) to the driver of raw
 * CAN maps, while seven simulated drives do their work, in four dialects. Input: records of twelve bytes, see step().
 * What must hold: frames that are not meant for it change nothing in the driver (a second one does not get them), and what is
 * no reply is counted, told in words, and no more; only frames of the map go out; set-points go to drives that may have them, no
 * step larger than the largest one; positions, drives that are gone and faults are told exactly when what was received and sent
 * says so.
 */
#include <stdlib.h>
#include <string.h>

#include "can_tap.h"
#include "canraw_drives.h"
#include "canraw_maps.h"
#include "drive_run.h"

#define CYCLE_US    1000u
#define RECORDS_MAX 48u
#define CYCLES_MAX  16u
#define DIALECTS    4u
#define STATUS_ON   1u
#define STATUS_BAD  2u
#define STATUS_FAIL 8u /* of homing */

enum { AMBIGUOUS, PLAIN, RICH, SEALED };

/* What one drive was sent and has told, by the bytes alone. */
typedef struct {
    bool is_heard;    /* since it was lost */
    bool has_told;    /* ever */
    bool is_faulty;   /* it has told so in this cycle */
    bool has_target;  /* sent while it was enabled, in one go */
    bool was_faulty;  /* as reported before this cycle */
    bool is_homing_q; /* asked for homing last, else for its position */
    bool is_reset;    /* a reset was asked for since */
    bool is_stopped;  /* a stop frame went out in this request */
    bool has_counter; /* sealed: a reply has come, */
    uint8_t counter;  /* with this */
    int64_t told_counts;
    uint8_t status;
    uint64_t told_us;
    int64_t target_counts;
    q32_t target_q32;
} seen_t;

/* The bus, its drives, and the driver. */
typedef struct {
    drive_run_t run;
    sim_can_bus_t bus;
    sim_can_t node;
    canraw_drives_t slave;
    can_tap_t tap;
    canraw_t driver;
    unsigned dialect;
    uint32_t strange; /* what no reply is, counted here */
    bool is_led;      /* another master has spoken in this cycle, and that stops */
    seen_t seen[DRIVES_MAX];
    uint64_t frame_us; /* the last frame on an identifier of the drives; 0 = none */
} world_t;

static canraw_map_t m_map[DIALECTS];
static world_t m_start[2][DIALECTS][2]; /* off, and enabled */
static world_t m_world[2];              /* the one that gets everything, and the one without what is not meant for it */

static const canraw_map_t *map_of(const world_t *self)
{
    return &m_map[self->dialect];
}

static bool is_rich(const world_t *self)
{
    return self->dialect == RICH || self->dialect == SEALED;
}

/* --- Numbers, by the register lists of canraw_drives.h --- */

static int64_t le32(const uint8_t *data)
{
    return (int64_t)((uint32_t)data[0] | (uint32_t)data[1] << 8 | (uint32_t)data[2] << 16 | (uint32_t)data[3] << 24);
}

static int64_t be32(const uint8_t *data)
{
    return (int32_t)((uint32_t)data[3] | (uint32_t)data[2] << 8 | (uint32_t)data[1] << 16 | (uint32_t)data[0] << 24);
}

static int64_t counts_of(const world_t *self, q32_t mm_q32)
{
    const bool has_status = is_rich(self);
    return drive_run_counts(mm_q32, has_status ? -10000 : 6000, has_status ? CANRAW_DRIVES_RICH_ZERO : 0);
}

/* True where counts are those of a position, but for one. */
static bool are_counts_of(const world_t *self, int64_t counts, q32_t mm_q32)
{
    return llabs(counts - counts_of(self, mm_q32)) <= 1;
}

static int64_t counts_per_mm(const world_t *self)
{
    return is_rich(self) ? 3334 : 2000;
}

/* --- What the driver sends --- */

/* A set-point for a drive that may have it. */
static void see_setpoint(world_t *self, unsigned k, int64_t counts)
{
    seen_t *seen = &self->seen[k];
    const drive_state_t state = self->run.feedback[k].state;
    const int64_t from = seen->has_target ? seen->target_counts : seen->told_counts;
    FUZZ_REQUIRE(state == DRIVE_ENABLED || (state == DRIVE_ENABLING && is_rich(self)));
    FUZZ_REQUIRE(are_counts_of(self, counts, self->run.setpoint_q32[k]));
    FUZZ_REQUIRE(llabs(counts - from) <= counts_per_mm(self) + 1);
    FUZZ_REQUIRE(llabs(counts - seen->told_counts) <= 10 * counts_per_mm(self) + 1);
    seen->has_target = state == DRIVE_ENABLED;
    seen->target_counts = counts;
    seen->target_q32 = self->run.setpoint_q32[k];
}

static bool is_bytes(const can_frame_t *frame, const void *bytes, uint8_t length)
{
    return frame->length == length && memcmp(frame->data, bytes, length) == 0;
}

static void see_plain(world_t *self, unsigned k, const can_frame_t *frame)
{
    if (frame->length == 8 && frame->data[0] == 1 && frame->data[1] == 5) {
        FUZZ_REQUIRE(frame->data[6] == (3000 & 0xFF) && frame->data[7] == 3000 >> 8);
        see_setpoint(self, k, le32(frame->data + 2));
    } else if (is_bytes(frame, "\x00\x15", 2)) {
        self->seen[k].is_homing_q = false;
    } else if (is_bytes(frame, "\x00\x12", 2)) {
        self->seen[k].is_homing_q = true;
    } else {
        FUZZ_REQUIRE(is_bytes(frame, "\x01\x03\x01\x00\x00\x00\x00\x00", 8));
    }
}

static void see_rich(world_t *self, unsigned k, const can_frame_t *frame)
{
    const unsigned more = self->dialect == SEALED ? 2 : 0;
    FUZZ_REQUIRE(more == 0 ||
                 (frame->length > 2 && canraw_drives_crc(frame->data, frame->length - 1u) == frame->data[frame->length - 1]));
    if (frame->data[0] == 0x10) {
        FUZZ_REQUIRE(frame->length == 5 + more);
        see_setpoint(self, k, be32(frame->data + 1));
    } else {
        FUZZ_REQUIRE(frame->length == 1 + more && ((frame->data[0] >= 0x20 && frame->data[0] <= 0x24) || frame->data[0] == 0x30));
        self->seen[k].is_stopped |= frame->data[0] == 0x22;
    }
}

static void see_sent(void *watcher, const can_frame_t *frame)
{
    world_t *self = watcher;
    const bool has_status = is_rich(self);
    const uint32_t k = frame->id - (has_status ? 0x18FF0100u : 0x601u);
    FUZZ_REQUIRE(frame->is_extended == has_status && !frame->is_rtr && !frame->is_error && k < DRIVES_MAX);
    if (has_status) {
        see_rich(self, k, frame);
    } else {
        see_plain(self, k, frame);
    }
}

/* --- What the driver receives --- */

static bool begins(const can_frame_t *frame, uint8_t first, uint8_t second)
{
    return frame->data[0] == first && frame->data[1] == second;
}

/* Where no byte tells replies apart, what was asked does. The driver says whether it still waits for an answer. */
static bool is_position(world_t *self, unsigned k, const can_frame_t *frame)
{
    seen_t *seen = &self->seen[k];
    if (self->dialect == SEALED) {
        if (frame->length < 8 || frame->data[0] != 0x30 || canraw_drives_crc(frame->data, 7) != frame->data[7]) {
            return false;
        }
        const bool is_new = !seen->has_counter || seen->counter != frame->data[6];
        seen->has_counter = true;
        seen->counter = frame->data[6];
        return is_new;
    }
    if (frame->length < 6) {
        return false;
    }
    if (self->dialect == AMBIGUOUS) {
        return self->driver.axis[k].asked != CANRAW_ASKED_NOTHING && !seen->is_homing_q;
    }
    return is_rich(self) ? frame->data[0] == 0x30 : begins(frame, 0, 0x15);
}

static bool is_about_homing(const world_t *self, unsigned k, const can_frame_t *frame)
{
    if (frame->length < 3 || is_rich(self)) {
        return false;
    }
    if (self->dialect == AMBIGUOUS) {
        return self->driver.axis[k].asked != CANRAW_ASKED_NOTHING && self->seen[k].is_homing_q;
    }
    return begins(frame, 0, 0x12);
}

static void see_position(world_t *self, unsigned k, const can_frame_t *frame)
{
    seen_t *seen = &self->seen[k];
    const bool has_status = is_rich(self);
    seen->is_heard = true;
    seen->has_told = true;
    seen->told_us = self->run.now_us;
    seen->told_counts = has_status ? be32(frame->data + 2) : (int32_t)le32(frame->data + 2);
    seen->status = has_status ? frame->data[1] : STATUS_ON;
    seen->is_faulty |= (seen->status & STATUS_BAD) != 0 || (has_status && (seen->status & STATUS_FAIL) != 0);
}

static void lose_all(world_t *self)
{
    for (unsigned k = 0; k < DRIVES_MAX; k++) {
        self->seen[k].is_heard = false;
        self->seen[k].was_faulty = false; /* it may come back without */
    }
}

static bool is_of_master(const world_t *self, const can_frame_t *frame)
{
    const bool has_status = is_rich(self);
    return !frame->is_error && !frame->is_rtr && frame->is_extended == has_status &&
           frame->id - (has_status ? 0x18FF0100u : 0x601u) < DRIVES_MAX;
}

static void see_received(void *watcher, const can_frame_t *frame)
{
    world_t *self = watcher;
    const bool has_status = is_rich(self);
    const uint32_t k = frame->id - (has_status ? 0x18FF0200u : 0x581u);
    self->is_led |= is_of_master(self, frame) && map_of(self)->other_master == CANRAW_MASTER_STOP;
    if (frame->is_error) {
        if ((frame->id & CAN_ERROR_RESTARTED) != 0) {
            lose_all(self);
        }
    } else if (frame->is_extended == has_status && !frame->is_rtr && k < DRIVES_MAX) {
        if (!self->driver.master.is_listening) {
            self->frame_us = self->run.now_us;
        }
        if (is_position(self, k, frame)) {
            see_position(self, k, frame);
        } else {
            self->strange += !is_about_homing(self, k, frame);
        }
    }
}

/* --- Cycles --- */

static bool is_actual(const world_t *self, unsigned k)
{
    const drive_feedback_t *feedback = &self->run.feedback[k];
    const seen_t *seen = &self->seen[k];
    return feedback->has_actual == seen->has_told &&
           (!seen->has_told ||
            (feedback->actual_us == seen->told_us && are_counts_of(self, seen->told_counts, feedback->actual_mm_q32)));
}

static void check_drive(world_t *self, unsigned k)
{
    const canraw_map_t *map = map_of(self);
    const drive_feedback_t *feedback = &self->run.feedback[k];
    seen_t *seen = &self->seen[k];
    const uint64_t age_us = self->run.now_us - seen->told_us;
    const bool is_there = !self->driver.is_gone && seen->is_heard && age_us <= (uint64_t)map->offline_periods * map->period_us;
    const bool is_faulty = feedback->state == DRIVE_FAULT;
    FUZZ_REQUIRE((feedback->state != DRIVE_OFFLINE) == is_there);
    FUZZ_REQUIRE(is_actual(self, k));
    FUZZ_REQUIRE((feedback->fault_code != 0) == is_faulty);
    FUZZ_REQUIRE(!is_faulty || seen->was_faulty || seen->is_faulty || self->is_led);
    FUZZ_REQUIRE(!self->is_led || !is_there || is_faulty);
    FUZZ_REQUIRE(is_faulty || !seen->was_faulty || !is_there || seen->is_reset);
    FUZZ_REQUIRE(!is_there || (seen->status & STATUS_BAD) == 0 || is_faulty);
    FUZZ_REQUIRE(feedback->state != DRIVE_ENABLED || (seen->status & STATUS_ON) != 0);
    seen->is_heard = is_there;
    seen->is_faulty = false;
    seen->has_target = seen->has_target && feedback->state == DRIVE_ENABLED;
}

/* Drives that say something, whatever it is, are no lost bus. */
static bool is_any_strange(const world_t *self)
{
    const canraw_map_t *map = map_of(self);
    return self->frame_us != 0 && self->run.now_us - self->frame_us <= (uint64_t)map->offline_periods * map->period_us;
}

static void poll(world_t *self)
{
    drive_run_t *run = &self->run;
    run->now_us += CYCLE_US;
    canraw_drives_step(&self->slave, run->now_us);
    const hv_status_t status = drives_poll(run->drives, run->now_us, run->feedback);
    for (unsigned k = 0; k < DRIVES_MAX; k++) {
        check_drive(self, k);
    }
    self->is_led = false;
    FUZZ_REQUIRE((status == HV_OK) ==
                 (!self->driver.is_gone && (!drive_run_are_all(run, DRIVE_OFFLINE) || is_any_strange(self))));
    FUZZ_REQUIRE(status == HV_OK || status == HV_ERR_IO);
    FUZZ_REQUIRE(self->driver.strange == self->strange);
    FUZZ_REQUIRE(!drives_is_failing(run->drives));
}

/* Whether a set-point has to be refused as a following error. */
typedef enum { GOOD, DOUBTFUL, WRONG } verdict_t;

static verdict_t judge(const world_t *self, const seen_t *seen, unsigned k)
{
    const drive_run_t *run = &self->run;
    const q32_t actual_q32 = run->feedback[k].actual_mm_q32;
    const q32_t from_q32 = seen->has_target ? seen->target_q32 : actual_q32;
    const q32_t setpoint_q32 = run->setpoint_q32[k];
    const int64_t counts = counts_of(self, setpoint_q32);
    if (drive_run_is_beyond(setpoint_q32, from_q32, Q32_ONE) || drive_run_is_beyond(setpoint_q32, actual_q32, 10 * Q32_ONE)) {
        return WRONG;
    }
    if (is_rich(self) || counts >= 0) {
        return GOOD;
    }
    return counts < -1 ? WRONG : DOUBTFUL; /* no room for what is below 0 */
}

/* Faults that are found while a set goes out: a set that is taken as a whole has them all. */
static void check_set(world_t *self, const seen_t before[DRIVES_MAX], bool is_whole)
{
    for (unsigned k = 0; k < DRIVES_MAX; k++) {
        const drive_state_t state = self->run.feedback[k].state;
        const bool is_streamed = state == DRIVE_ENABLED || (state == DRIVE_ENABLING && is_rich(self));
        const bool is_new = state != DRIVE_FAULT && self->driver.axis[k].state == DRIVE_FAULT;
        const verdict_t verdict = judge(self, &before[k], k);
        FUZZ_REQUIRE(!is_new || (is_streamed && verdict != GOOD && self->driver.axis[k].fault_code == CANRAW_FAULT_FOLLOWING));
        FUZZ_REQUIRE(is_new || !is_whole || !is_streamed || verdict != WRONG);
    }
}

static void note_faults(world_t *self)
{
    for (unsigned k = 0; k < DRIVES_MAX; k++) {
        self->seen[k].was_faulty = self->driver.axis[k].state == DRIVE_FAULT;
        self->seen[k].is_reset &= self->seen[k].was_faulty;
    }
}

static void cycle(void *world)
{
    world_t *self = world;
    drive_run_t *run = &self->run;
    seen_t before[DRIVES_MAX];
    poll(self);
    const uint32_t sets = self->driver.sets;
    const uint32_t refused = self->driver.refused;
    memcpy(before, self->seen, sizeof before);
    const hv_status_t status = drives_send(run->drives, run->now_us, run->setpoint_q32);
    FUZZ_REQUIRE(self->driver.refused - refused ==
                 (status == HV_ERR_AGAIN || (status != HV_OK && !drive_run_are_all(run, DRIVE_OFFLINE))));
    FUZZ_REQUIRE(self->driver.sets - sets <= (status == HV_OK));
    check_set(self, before, self->driver.sets != sets);
    note_faults(self);
}

/* --- Coming up --- */

static void configure(void)
{
    m_map[AMBIGUOUS] = canraw_maps_plain();
    m_map[PLAIN] = canraw_maps_plain();
    m_map[PLAIN].position_reply.constant = m_map[PLAIN].homing_reply.constant = 3;
    m_map[PLAIN].position_reply.data[1] = 0x15;
    m_map[PLAIN].homing_reply.data[1] = 0x12;
    m_map[RICH] = canraw_maps_rich();
    m_map[SEALED] = canraw_maps_sealed();
    m_map[RICH].other_master = m_map[SEALED].other_master = CANRAW_MASTER_STOP;
    m_map[RICH].homing_failed = m_map[SEALED].homing_failed = (canraw_when_t){STATUS_FAIL, STATUS_FAIL};
}

static void bring_up(unsigned i, unsigned dialect)
{
    world_t *self = &m_world[i];
    hal_can_filter_t filter[CANRAW_FILTERS_MAX];
    memset(self, 0, sizeof *self);
    self->dialect = dialect;
    self->run.now_us = 5000000;
    sim_can_bus_init(&self->bus, 0, NULL, 0);
    canraw_drives_open(&self->slave, &self->bus, m_map[dialect]);
    for (unsigned k = 0; k < DRIVES_MAX; k++) {
        const int32_t mm = 20 + 10 * (int32_t)k;
        canraw_drives_place(&self->slave, k, is_rich(self) ? CANRAW_DRIVES_RICH_ZERO - mm * 10000 / 3 : mm * 2000);
    }
    FUZZ_REQUIRE(sim_can_open(&self->node, &self->bus, filter, canraw_filters(&m_map[dialect], filter)) == HV_OK);
    self->tap = (can_tap_t){.inner = sim_can_hal(&self->node), .watcher = self, .sent = see_sent, .received = see_received};
    FUZZ_REQUIRE(canraw_init(&self->driver, &m_map[dialect], can_tap_hal(&self->tap)) == HV_OK);
    self->run.drives = canraw_hal(&self->driver);
    drive_run_await(&self->run, DRIVE_DISABLED, cycle, self);
    m_start[i][dialect][0] = *self;
    FUZZ_REQUIRE(drives_request(self->run.drives, DRIVES_ENABLE) == HV_OK);
    drive_run_await(&self->run, DRIVE_ENABLED, cycle, self);
    m_start[i][dialect][1] = *self;
}

/* --- Records --- */

static can_frame_t frame_of(const world_t *world, const record_t *record)
{
    can_frame_t frame = {
        .id = map_of(world)->axis[record->drive].reply_id, .is_extended = map_of(world)->is_extended, .length = record->length};
    memcpy(frame.data, record->data, record->length);
    return frame;
}

static void put_counts(const world_t *world, int64_t counts, uint8_t *out)
{
    for (unsigned i = 0; i < 4; i++) {
        out[i] = (uint8_t)((uint64_t)counts >> (is_rich(world) ? 24 - 8 * i : 8 * i));
    }
}

/* A reply as the map has it: any position, or one near the last, a status; or bytes as they come. */
static can_frame_t reply(const world_t *world, const record_t *record)
{
    can_frame_t frame = frame_of(world, record);
    const bool is_near = record->kind % 4 == 1;
    const int64_t near = world->seen[record->drive].told_counts + (int16_t)(record->data[2] | record->data[3] << 8);
    if (record->kind % 4 == 3) {
        return frame;
    }
    if (record->kind % 4 == 2 && !is_rich(world)) { /* about homing */
        frame.length = 3;
        memcpy(frame.data, "\x00\x12", 2);
        return frame;
    }
    frame.length = 6;
    memcpy(frame.data + 2, record->data + 2, 4);
    frame.data[0] = is_rich(world) ? 0x30 : 0;
    frame.data[1] = is_rich(world) ? record->data[1] : 0x15;
    if (is_near) {
        put_counts(world, near, frame.data + 2);
    }
    if (world->dialect == SEALED) {
        frame.length = 8;
        frame.data[6] = record->data[6];
        frame.data[7] = (uint8_t)(canraw_drives_crc(frame.data, 7) ^ (record->kind % 16 == 4 ? 1u << record->data[7] % 8 : 0));
    }
    return frame;
}

/* Whether every drive that sends with an identifier has said something since it was lost: else any frame is a sign of life, with
 * which its start-up begins. */
static bool are_heard(const world_t *world, uint32_t id)
{
    const canraw_map_t *map = map_of(world);
    bool are_so = true;
    for (unsigned k = 0; k < map->axes; k++) {
        const bool is_its = map->axis[k].reply_id == id || (map->status_reply.length != 0 && map->axis[k].status_id == id);
        are_so = are_so && (!is_its || world->driver.axis[k].is_talking);
    }
    return are_so;
}

/* Nothing that concerns the driver, but for a count. */
static can_frame_t strange_frame(const world_t *world, const record_t *record)
{
    can_frame_t frame = reply(world, record);
    switch (record->data[7] % 6) {
    case 0:
        frame.is_extended = !frame.is_extended;
        frame.id &= frame.is_extended ? CAN_ID_EXTENDED_MAX : CAN_ID_MAX;
        break;
    case 1:
        frame.is_rtr = true;
        break;
    case 2: /* behind the last drive */
        frame.id += DRIVES_MAX - record->drive + record->data[6] % 32u;
        break;
    case 3: /* where commands go */
        frame.id = map_of(world)->axis[record->drive].command_id;
        break;
    case 4: /* too short for anything */
        frame.id = are_heard(world, frame.id) ? frame.id : map_of(world)->axis[record->drive].command_id;
        frame.length = (uint8_t)(record->length % 3);
        break;
    default: /* a report that changes nothing */
        frame = (can_frame_t){.id = record->data[0] & ~(uint32_t)CAN_ERROR_RESTARTED, .is_error = true};
        break;
    }
    frame.is_rtr |= is_of_master(world, &frame) && map_of(world)->other_master != CANRAW_MASTER_IGNORE;
    return frame;
}

/* Plain drives have no word for torque and faults: one that fails stands. */
static void disturb(world_t *self, const record_t *record)
{
    const unsigned k = record->drive;
    frame_drive_t *drive = &self->slave.twin[k];
    const bool is_so = record->data[0] % 2 != 0;
    switch (record->kind % 6) {
    case 0:
        self->slave.motor[k].is_jammed = is_so && !is_rich(self);
        if (is_rich(self) && is_so) {
            frame_drive_fault(drive, 1);
        } else if (is_rich(self)) {
            canraw_drives_command(&self->slave, k, CANRAW_RESET);
        }
        break;
    case 1:
        drive->is_cut = !is_so;
        break;
    case 2:
        if (is_rich(self)) {
            canraw_drives_command(&self->slave, k, is_so ? CANRAW_ENABLE : CANRAW_DISABLE);
        }
        break;
    case 3:
        drive->is_mute = is_so;
        break;
    case 4:
        drive->is_homing_broken = is_so;
        self->slave.sent[k].homing_takes_us = record->data[0] % 4 < 2 ? 30000 : UINT32_MAX;
        break;
    default:
        drive->is_homed = is_so;
        break;
    }
}

static void receive(world_t *self, const can_frame_t *frame)
{
    can_tap_slip_in(&self->tap, frame);
    cycle(self);
}

static void disturb_bus(world_t *self, const record_t *record)
{
    static const hal_can_state_t k_states[] = {HAL_CAN_ACTIVE, HAL_CAN_WARNING, HAL_CAN_PASSIVE, HAL_CAN_BUS_OFF};
    const can_frame_t report = {.id = record->data[0], .is_error = true};
    const can_frame_t command = {.id = map_of(self)->axis[record->drive].command_id,
                                 .is_extended = map_of(self)->is_extended,
                                 .length = record->length % 9u};
    switch (record->kind % 6) {
    case 0:
        sim_can_set_state(&self->node, k_states[record->data[0] % 4]);
        break;
    case 1:
        sim_can_unplug(&self->node);
        break;
    case 2:
        sim_can_plug(&self->node);
        break;
    case 3: /* nobody acknowledges */
        self->slave.node.is_plugged = record->data[0] % 2 != 0;
        break;
    case 4:
        receive(self, &report);
        break;
    default: /* another master */
        receive(self, &command);
        break;
    }
}

/* Who is told to stop is told at once, unless the bus takes nothing. */
static void ask(world_t *self, const record_t *record)
{
    const unsigned request = record->kind % (DRIVES_RESET_FAULT + 1u);
    const bool is_stop = request == DRIVES_QUICK_STOP && is_rich(self);
    for (unsigned k = 0; k < DRIVES_MAX; k++) {
        self->seen[k].is_stopped = false;
    }
    const hv_status_t status = drive_run_ask(&self->run, record);
    for (unsigned k = 0; status == HV_OK && k < DRIVES_MAX; k++) {
        const bool is_there = self->run.feedback[k].state != DRIVE_OFFLINE;
        self->seen[k].is_reset |= request == DRIVES_RESET_FAULT;
        FUZZ_REQUIRE(!is_there || !is_stop || self->seen[k].is_stopped || self->driver.axis[k].pending == CANRAW_STOP);
    }
    note_faults(self);
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
    case 2:
        frame = reply(self, record);
        receive(self, &frame);
        break;
    case 3:
        frame = strange_frame(self, record);
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
    static canraw_t all, some;
    all = m_world[0].driver;
    some = m_world[1].driver;
    all.can = some.can;
    all.strange = some.strange;
    all.master = some.master;                   /* where it is ignored it is counted, no more */
    for (unsigned k = 0; k < DRIVES_MAX; k++) { /* what is told of it in words */
        all.axis[k].trouble = some.axis[k].trouble;
        all.axis[k].trouble_us = some.axis[k].trouble_us;
        all.axis[k].heard_us = some.axis[k].heard_us;
    }
    FUZZ_REQUIRE(memcmp(&all, &some, sizeof all) == 0);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    fuzz_input_t in = {data, size};
    if (m_map[0].axes == 0) {
        configure();
        for (unsigned i = 0; i < 2 * DIALECTS; i++) {
            bring_up(i % 2, i / 2);
        }
    }
    const uint8_t choice = fuzz_u8(&in);
    m_world[0] = m_start[0][choice / 2 % DIALECTS][choice % 2];
    m_world[1] = m_start[1][choice / 2 % DIALECTS][choice % 2];
    for (unsigned i = 0; i < RECORDS_MAX && in.left > 0; i++) {
        const record_t record = record_read(&in);
        step(&m_world[0], &record, true);
        step(&m_world[1], &record, false);
        compare();
    }
    return 0;
}
