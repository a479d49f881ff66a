/* SPDX-License-Identifier: MIT
 * fuzz_modbus.c - replies of Modbus lines to the driver, while seven simulated drives do their work, in two dialects, on one line
 * or on seven: replies with other values, other numbers of them, exceptions, none in time, damaged ones, lines that come and go.
 * Input: records of twelve bytes, see step().
 * What must hold: a reply to what nobody waits for any more changes nothing in the driver (a second one does not get it) but the
 * count of failures; only registers of the map are asked for and written; a drive's target is within what it was asked for, at
 * first where it said that it is, and moves no faster than its line may carry; positions, drives that are gone (and why) and
 * faults are told exactly when the replies and the set-points say so.
 */
#include <stdlib.h>
#include <string.h>

#include "drive_run.h"
#include "modbus_drives.h"
#include "modbus_maps.h"
#include "modbus_tap.h"

#define CYCLE_US        1000u
#define RECORDS_MAX     48u
#define CYCLES_MAX      16u
#define SLOW            0xF7u /* cycles that come late, until a drive without feedback is gone */
#define SLOW_US         10000u
#define SLOW_CYCLES     40u
#define LAYOUTS         5u
#define CARRY_MM_PER_MS 2 /* 4 mm per period, which is 2 ms at least */
#define STEP_MM         1
#define FOLLOWING_MM    10

/* Maps and lines that are tried. */
typedef struct {
    bool is_small;
    bool is_shared;
    bool is_broadcast;
    bool is_target_last;
    uint32_t transaction_us;
} layout_t;

static const layout_t k_layout[LAYOUTS] = {{false, true, false, false, 0},
                                           {false, false, false, true, 0},
                                           {true, false, false, false, 0},
                                           {true, true, true, false, 0},
                                           {false, true, true, true, 300}};

/* What one drive was asked and has told, by the registers alone. */
typedef struct {
    bool has_told; /* ever */
    bool is_told;  /* in this cycle */
    bool is_faulty;
    bool was_waiting;    /* for its line, before this cycle */
    bool was_faulty;     /* before this cycle */
    bool is_reset;       /* a reset was asked for since */
    bool is_stopped;     /* a stop was asked for in this request */
    bool has_asked;      /* asked_q32 is of the last cycle */
    uint8_t failures[2]; /* in a row, of what is written and what is read */
    uint32_t trouble;    /* what loses it in this cycle */
    int64_t told_counts;
    uint64_t told_us;
    int64_t low, high; /* counts that its target may have */
    int64_t target;    /* counts */
    uint64_t base_us;  /* since then the mean is formed that the target is of */
    uint64_t mean_us;  /* the same, of what is to come */
    q32_t asked_q32;
} seen_t;

/* Lines, drives, and the driver. */
typedef struct {
    drive_run_t run;
    modbus_drives_t slave;
    modbus_tap_t tap;
    modbus_drive_t driver;
    const layout_t *layout;
    uint32_t cycle_us;
    uint32_t failures;  /* of transactions */
    uint32_t confirmed; /* set-points at most */
    seen_t seen[DRIVES_MAX];
} world_t;

static modbus_drive_map_t m_map[LAYOUTS];
static world_t m_start[2][LAYOUTS][2]; /* off, and enabled */
static world_t m_world[2];             /* the one that gets everything, and the one without replies that nobody waits for */

/* --- Numbers, by the register list of modbus_drives.h --- */

static int64_t counts_of(const world_t *self, q32_t mm_q32)
{
    return self->layout->is_small ? drive_run_counts(mm_q32, 300, 0) : drive_run_counts(mm_q32, -10000, MODBUS_DRIVES_WIDE_ZERO);
}

static int64_t counts_per_mm(const world_t *self)
{
    return self->layout->is_small ? 100 : 3334;
}

static int64_t position_of(const world_t *self, const uint16_t *high)
{
    return self->layout->is_small ? (int16_t)high[0] : (int32_t)((uint32_t)high[0] << 16 | high[1]);
}

/* True where a set-point has no room in its registers, or nearly none. */
static bool is_out_of_registers(const world_t *self, int64_t counts)
{
    return llabs(counts) >= (self->layout->is_small ? INT16_MAX : INT32_MAX);
}

static bool is_near(int64_t a, int64_t b)
{
    return llabs(a - b) <= 1;
}

/* --- What is asked for --- */

static bool is_coming_up(drive_state_t state)
{
    return state == DRIVE_ENABLING || state == DRIVE_HOMING;
}

static void see_setpoint(world_t *self, unsigned k, const uint16_t *value)
{
    seen_t *seen = &self->seen[k];
    const int64_t counts = position_of(self, value);
    const drive_state_t state = self->run.feedback[k].state;
    FUZZ_REQUIRE(state == DRIVE_ENABLED || is_coming_up(state));
    FUZZ_REQUIRE(self->layout->is_small || value[2] <= 10 * 1000);
    FUZZ_REQUIRE(counts >= seen->low - 1 && counts <= seen->high + 1);
    if (state == DRIVE_ENABLED) {
        const int64_t time_us = (int64_t)(self->run.now_us - seen->base_us) + self->cycle_us;
        FUZZ_REQUIRE(llabs(counts - seen->target) <= time_us * CARRY_MM_PER_MS * counts_per_mm(self) / 1000 + 2);
        seen->base_us = seen->mean_us;
    }
    seen->target = counts;
}

static void see_wide_write(world_t *self, unsigned k, const modbus_request_t *request)
{
    const uint16_t value = request->value[0];
    FUZZ_REQUIRE(request->function == MODBUS_WRITE_REGISTERS);
    if (request->address == 10) {
        FUZZ_REQUIRE(request->count == 3);
        see_setpoint(self, k, request->value);
    } else if (request->address == 20) {
        FUZZ_REQUIRE(request->count == 1 && value == 50);
    } else {
        FUZZ_REQUIRE(request->address == 0 && request->count == 1 && (value <= 2 || value == 4 || value == 8));
        self->seen[k].is_stopped |= value == 2;
    }
}

static void see_small_write(world_t *self, unsigned k, const modbus_request_t *request)
{
    FUZZ_REQUIRE(request->function == MODBUS_WRITE_REGISTER && request->count == 1);
    if (request->address == 100) {
        see_setpoint(self, k, request->value);
    } else {
        FUZZ_REQUIRE(request->address >= 101 && request->address <= 103);
        FUZZ_REQUIRE(request->value[0] == 1 || (request->value[0] == 0 && request->address == 101));
        self->seen[k].is_stopped |= request->address == 102;
    }
}

static void see_write(world_t *self, unsigned k, const modbus_request_t *request)
{
    const bool is_small = self->layout->is_small;
    if (request->unit == HAL_MODBUS_BROADCAST) {
        FUZZ_REQUIRE(self->layout->is_broadcast);
        FUZZ_REQUIRE(is_small ? request->address == 102 : request->address == 0 && request->value[0] == 2);
    }
    if (is_small) {
        see_small_write(self, k, request);
    } else {
        see_wide_write(self, k, request);
    }
}

static void see_read(const world_t *self, unsigned slot, const modbus_request_t *request)
{
    if (self->layout->is_small) {
        FUZZ_REQUIRE(slot % 2 != 0 && request->function == MODBUS_READ_INPUT && request->address == 110 && request->count == 2);
        return;
    }
    FUZZ_REQUIRE(request->function == MODBUS_READ_HOLDING);
    if (slot % 2 != 0) {
        FUZZ_REQUIRE(request->address == 1 && request->count == 4);
    } else {
        FUZZ_REQUIRE((request->address == 20 || request->address == 21) && request->count == 1);
    }
}

static void see_asked(void *watcher, unsigned line, unsigned slot, const modbus_request_t *request)
{
    world_t *self = watcher;
    const unsigned k = slot / 2;
    const bool is_shared = self->layout->is_shared;
    const bool is_write = modbus_is_write(request->function);
    FUZZ_REQUIRE(k < DRIVES_MAX && line == (is_shared ? 0 : k));
    FUZZ_REQUIRE(request->unit == (is_shared ? k + 1 : 1) || (is_write && request->unit == HAL_MODBUS_BROADCAST));
    if (is_write) {
        FUZZ_REQUIRE(slot % 2 == 0);
        see_write(self, k, request);
    } else {
        see_read(self, slot, request);
    }
}

/* --- What is answered --- */

static uint32_t trouble_of(const modbus_result_t *result)
{
    if (result->status == HV_ERR_IO) {
        return MODBUS_DRIVE_NO_LINK;
    }
    if (result->status == HV_ERR_TIMEOUT) {
        return MODBUS_DRIVE_NO_ANSWER;
    }
    return result->status == HV_ERR_STATE ? MODBUS_DRIVE_EXCEPTION : MODBUS_DRIVE_DAMAGED;
}

/* One more, or none any more; beyond what is borne the drive is lost. */
static void see_outcome(world_t *self, unsigned k, bool is_read, bool is_good, const modbus_result_t *result)
{
    seen_t *seen = &self->seen[k];
    seen->failures[is_read] = is_good ? 0 : (uint8_t)(seen->failures[is_read] + 1u);
    if (seen->failures[is_read] > self->driver.map->retries && seen->trouble == 0) {
        seen->trouble = trouble_of(result);
    }
}

static void see_feedback(world_t *self, unsigned k, const modbus_result_t *result)
{
    seen_t *seen = &self->seen[k];
    const bool is_small = self->layout->is_small;
    const bool is_good = result->status == HV_OK && result->count == (is_small ? 2 : 4);
    see_outcome(self, k, true, is_good, result);
    if (is_good) {
        seen->has_told = true;
        seen->is_told = true;
        seen->told_us = self->run.now_us;
        seen->told_counts = position_of(self, &result->value[is_small ? 0 : 1]);
        seen->is_faulty = is_small ? (result->value[1] & 128) != 0 : (result->value[0] & 2) != 0;
        if (self->run.feedback[k].state != DRIVE_ENABLED) {
            seen->low = seen->told_counts < seen->low ? seen->told_counts : seen->low;
            seen->high = seen->told_counts > seen->high ? seen->told_counts : seen->high;
        }
    }
}

static void see_written(world_t *self, unsigned k, const modbus_result_t *result)
{
    const modbus_drive_axis_t *axis = &self->driver.axis[k];
    const bool is_refusal = axis->phase == MODBUS_DRIVE_STARTING && result->status == HV_ERR_STATE;
    if (axis->is_broadcast || axis->job == MODBUS_DRIVE_NO_JOB) {
        return;
    }
    if (is_refusal && self->seen[k].failures[0] >= self->driver.map->retries) {
        self->seen[k].failures[0] = 0; /* it is there, and refuses: not lost */
        return;
    }
    see_outcome(self, k, false, result->status == HV_OK, result);
    if (result->status == HV_OK && axis->job == MODBUS_DRIVE_JOB_SETPOINT) {
        self->confirmed++;
        self->seen[k].mean_us = self->run.now_us;
    }
}

/* Before the driver has it. What is older than what it waits for changes nothing; compare() shows that. */
static void see_answered(void *watcher, unsigned line, unsigned slot, const modbus_result_t *result)
{
    world_t *self = watcher;
    const unsigned k = slot / 2;
    const modbus_drive_axis_t *axis = &self->driver.axis[k];
    const uint32_t first = slot % 2 != 0 ? axis->read.first : axis->write.first;
    (void)line;
    self->failures += result->status != HV_OK;
    if ((int32_t)(result->tag - first) < 0) {
        return;
    }
    if (slot % 2 != 0) {
        see_feedback(self, k, result);
    } else {
        see_written(self, k, result);
    }
}

/* --- Cycles --- */

static bool is_actual(const world_t *self, unsigned k)
{
    const drive_feedback_t *feedback = &self->run.feedback[k];
    const seen_t *seen = &self->seen[k];
    return feedback->has_actual == seen->has_told &&
           (!seen->has_told ||
            (feedback->actual_us == seen->told_us && is_near(seen->told_counts, counts_of(self, feedback->actual_mm_q32))));
}

/* A drive is lost by failures in a row or by silence, and says which. */
static void check_loss(const world_t *self, unsigned k)
{
    const modbus_drive_axis_t *axis = &self->driver.axis[k];
    const seen_t *seen = &self->seen[k];
    const bool is_waiting = axis->phase == MODBUS_DRIVE_WAITING;
    const bool is_old = self->run.now_us - seen->told_us > self->driver.map->feedback_timeout_us;
    if (!seen->was_waiting) {
        FUZZ_REQUIRE(is_waiting == (seen->trouble != 0 || is_old));
        FUZZ_REQUIRE(!is_waiting || axis->trouble == (seen->trouble != 0 ? seen->trouble : (uint32_t)MODBUS_DRIVE_OLD));
    }
    FUZZ_REQUIRE(!is_waiting || self->run.feedback[k].state == DRIVE_OFFLINE);
}

static void check_fault(const world_t *self, unsigned k)
{
    const seen_t *seen = &self->seen[k];
    const drive_feedback_t *feedback = &self->run.feedback[k];
    const bool is_faulty = feedback->state == DRIVE_FAULT;
    const bool is_up = feedback->state != DRIVE_OFFLINE;
    const bool has_no_room = is_out_of_registers(self, seen->low) || is_out_of_registers(self, seen->high);
    FUZZ_REQUIRE(is_faulty ? feedback->fault_code != 0 : !is_up || feedback->fault_code == 0);
    FUZZ_REQUIRE(is_faulty || !seen->was_faulty || !is_up || seen->is_reset);
    FUZZ_REQUIRE(!is_faulty || seen->was_faulty || (seen->is_told && seen->is_faulty) || has_no_room);
    FUZZ_REQUIRE(!is_up || !seen->is_told || !seen->is_faulty || is_faulty);
}

static void forget_targets(world_t *self, seen_t *seen)
{
    seen->low = INT32_MAX;
    seen->high = INT32_MIN;
    seen->base_us = self->run.now_us;
    seen->mean_us = self->run.now_us;
}

/* What may be sent next. A drive that has just got torque begins where it was placed. */
static void follow_state(world_t *self, unsigned k, drive_state_t before)
{
    seen_t *seen = &self->seen[k];
    const drive_state_t state = self->run.feedback[k].state;
    if (state == DRIVE_ENABLED) {
        if (before != DRIVE_ENABLED) {
            forget_targets(self, seen);
            seen->low = seen->high = seen->target;
            seen->has_asked = false;
        }
    } else {
        if (!is_coming_up(state)) {
            forget_targets(self, seen);
        }
        seen->has_asked = false;
    }
    seen->was_waiting = self->driver.axis[k].phase == MODBUS_DRIVE_WAITING;
    if (seen->was_waiting) {
        seen->failures[0] = seen->failures[1] = 0;
    }
}

static void check_drive(world_t *self, unsigned k, drive_state_t before)
{
    drive_report_t report;
    FUZZ_REQUIRE(is_actual(self, k));
    check_loss(self, k);
    check_fault(self, k);
    FUZZ_REQUIRE(drives_report(self->run.drives, (uint8_t)k, &report));
    FUZZ_REQUIRE(report.phase != NULL && report.trouble != NULL && report.detail != NULL && report.is_modbus);
    follow_state(self, k, before);
}

/* No drive answers: each waits, and none of them because it refuses what it is asked, or because its answers are damaged. */
static bool is_lost(const world_t *self)
{
    for (uint8_t k = 0; k < DRIVES_MAX; k++) {
        drive_report_t report;
        FUZZ_REQUIRE(drives_report(self->run.drives, k, &report));
        if (strcmp(report.phase, "waiting for the line") != 0 || report.code == MODBUS_DRIVE_EXCEPTION ||
            report.code == MODBUS_DRIVE_DAMAGED) {
            return false;
        }
    }
    return true;
}

static void poll(world_t *self)
{
    drive_run_t *run = &self->run;
    drive_feedback_t before[DRIVES_MAX];
    const uint32_t setpoints = self->driver.setpoints;
    memcpy(before, run->feedback, sizeof before);
    run->now_us += self->cycle_us;
    self->confirmed = 0;
    for (unsigned k = 0; k < DRIVES_MAX; k++) {
        self->seen[k].is_told = false;
        self->seen[k].trouble = 0;
        self->seen[k].was_faulty = self->driver.axis[k].phase == MODBUS_DRIVE_FAULT;
        self->seen[k].is_reset &= self->seen[k].was_faulty;
    }
    modbus_drives_step(&self->slave, run->now_us);
    const hv_status_t status = drives_poll(run->drives, run->now_us, run->feedback);
    for (unsigned k = 0; k < DRIVES_MAX; k++) {
        check_drive(self, k, before[k].state);
    }
    FUZZ_REQUIRE(status == (is_lost(self) ? HV_ERR_IO : HV_OK));
    FUZZ_REQUIRE(self->driver.failures == self->failures);
    FUZZ_REQUIRE(self->driver.setpoints - setpoints <= self->confirmed);
}

/* Phases in which a set-point that is far off is a fault. */
static bool is_watched(const world_t *self, unsigned k)
{
    const drive_state_t state = self->run.feedback[k].state;
    return state == DRIVE_ENABLED || state == DRIVE_ENABLING ||
           (state == DRIVE_HOMING && self->driver.axis[k].phase != MODBUS_DRIVE_HOMING);
}

static void check_send(world_t *self, unsigned k)
{
    seen_t *seen = &self->seen[k];
    const q32_t actual_q32 = self->run.feedback[k].actual_mm_q32;
    const q32_t setpoint_q32 = self->run.setpoint_q32[k];
    const bool is_wrong = drive_run_is_beyond(setpoint_q32, seen->has_asked ? seen->asked_q32 : actual_q32, STEP_MM * Q32_ONE) ||
                          drive_run_is_beyond(setpoint_q32, actual_q32, FOLLOWING_MM * Q32_ONE);
    const bool is_new = self->driver.axis[k].phase == MODBUS_DRIVE_FAULT && self->run.feedback[k].state != DRIVE_FAULT;
    const bool has_no_room = is_out_of_registers(self, seen->low) || is_out_of_registers(self, seen->high);
    FUZZ_REQUIRE(!is_new || (is_watched(self, k) && (is_wrong || has_no_room)));
    FUZZ_REQUIRE(is_new || !is_watched(self, k) || !is_wrong);
    FUZZ_REQUIRE(!is_new || self->driver.axis[k].trouble == MODBUS_DRIVE_FOLLOWING);
    seen->has_asked = self->run.feedback[k].state == DRIVE_ENABLED;
    seen->asked_q32 = setpoint_q32;
}

static void cycle(void *world)
{
    world_t *self = world;
    drive_run_t *run = &self->run;
    poll(self);
    for (unsigned k = 0; k < DRIVES_MAX; k++) {
        seen_t *seen = &self->seen[k];
        const int64_t counts = counts_of(self, run->setpoint_q32[k]);
        if (run->feedback[k].state == DRIVE_ENABLED) {
            seen->low = counts < seen->low ? counts : seen->low;
            seen->high = counts > seen->high ? counts : seen->high;
        }
    }
    const hv_status_t status = drives_send(run->drives, run->now_us, run->setpoint_q32);
    FUZZ_REQUIRE(status == (is_lost(self) ? HV_ERR_IO : HV_OK));
    for (unsigned k = 0; k < DRIVES_MAX; k++) {
        check_send(self, k);
    }
}

/* --- Coming up --- */

static void configure(unsigned i)
{
    const layout_t *layout = &k_layout[i];
    m_map[i] = layout->is_small ? modbus_maps_small(layout->is_shared) : modbus_maps_wide(layout->is_shared);
    m_map[i].is_broadcast = layout->is_broadcast;
    m_map[i].is_target_last = layout->is_target_last;
}

static void bring_up(unsigned i, unsigned layout)
{
    world_t *self = &m_world[i];
    hal_modbus_t inner[DRIVES_MAX];
    hal_modbus_t outer[DRIVES_MAX];
    memset(self, 0, sizeof *self);
    self->layout = &k_layout[layout];
    self->cycle_us = CYCLE_US;
    self->run.now_us = 5000000;
    modbus_drives_open(&self->slave, self->layout->is_small, self->layout->is_shared, self->layout->transaction_us, 20000);
    for (unsigned k = 0; k < DRIVES_MAX; k++) {
        const int32_t mm = 20 + 10 * (int32_t)k;
        modbus_drives_place(&self->slave, k, self->layout->is_small ? mm * 100 : MODBUS_DRIVES_WIDE_ZERO - mm * 10000 / 3);
        self->seen[k].was_waiting = true;
    }
    modbus_drives_lines(&self->slave, inner);
    self->tap = (modbus_tap_t){.watcher = self, .asked = see_asked, .answered = see_answered};
    modbus_tap_open(&self->tap, inner, outer);
    FUZZ_REQUIRE(modbus_drive_init(&self->driver, &m_map[layout], outer) == HV_OK);
    self->run.drives = modbus_drive_hal(&self->driver);
    drive_run_await(&self->run, DRIVE_DISABLED, cycle, self);
    m_start[i][layout][0] = *self;
    FUZZ_REQUIRE(drives_request(self->run.drives, DRIVES_ENABLE) == HV_OK);
    drive_run_await(&self->run, DRIVE_ENABLED, cycle, self);
    m_start[i][layout][1] = *self;
}

/* --- Records --- */

static modbus_tap_line_t *line_of(world_t *self, unsigned k)
{
    return &self->tap.line[self->layout->is_shared ? 0 : k];
}

/* What becomes of the next replies of a slot. */
static void spoil(world_t *self, const record_t *record)
{
    const unsigned slot = 2u * record->drive + record->kind % 2u;
    line_of(self, record->drive)->plan[slot] =
        (modbus_tap_plan_t){.how = (modbus_tap_spoil_t)(record->kind / 2 % MODBUS_TAP_SPOILS),
                            .at = record->length < 8 ? record->length : record->data[0],
                            .value = (uint16_t)(record->data[1] | record->data[2] << 8),
                            .replies = (uint16_t)(1u + record->data[3] % 4u)};
}

/* The position that is told, near the last one. */
static void shift(world_t *self, const record_t *record)
{
    const unsigned slot = 2u * record->drive + 1u;
    const int64_t counts = self->seen[record->drive].told_counts + (int16_t)(record->data[0] | record->data[1] << 8);
    line_of(self, record->drive)->plan[slot] = (modbus_tap_plan_t){.how = MODBUS_TAP_VALUE,
                                                                   .at = self->layout->is_small ? 0 : 2,
                                                                   .value = (uint16_t)counts,
                                                                   .replies = (uint16_t)(1u + record->kind)};
}

/* A reply to something that is over; it looks good, or not. */
static void slip_in(world_t *self, const record_t *record)
{
    static const hv_status_t k_status[] = {HV_OK, HV_ERR_TIMEOUT, HV_ERR_FORMAT, HV_ERR_STATE, HV_ERR_IO};
    const modbus_drive_axis_t *axis = &self->driver.axis[record->drive];
    const unsigned slot = 2u * record->drive + record->kind % 2u;
    const uint32_t first = slot % 2u != 0 ? axis->read.first : axis->write.first;
    modbus_tap_line_t *line = line_of(self, record->drive);
    modbus_result_t *result = &line->extra[slot];
    *result = (modbus_result_t){.status = k_status[record->kind / 2 % 5],
                                .exception = record->data[0],
                                .count = record->length,
                                .tag = first - 2u - record->data[1] % 4u,
                                .done_us = self->run.now_us};
    for (unsigned i = 0; i < record->length; i++) {
        result->value[i] = (uint16_t)(record->data[2] | record->data[i] << 8);
    }
    line->has_extra[slot] = true;
}

static void disturb(world_t *self, const record_t *record)
{
    const unsigned k = record->drive;
    register_drive_t *drive = &self->slave.twin[k];
    const bool is_so = record->data[0] % 2 != 0;
    switch (record->kind % 6) {
    case 0:
        if (is_so) {
            register_drive_fault(drive, MODBUS_DRIVES_ALARM);
        } else {
            modbus_drives_command(&self->slave, k, MODBUS_DRIVE_RESET);
        }
        break;
    case 1:
        modbus_drives_power(&self->slave, k, is_so);
        break;
    case 2:
        modbus_drives_command(&self->slave, k, is_so ? MODBUS_DRIVE_ENABLE : MODBUS_DRIVE_DISABLE);
        break;
    case 3:
        self->slave.asked[k].is_weak = is_so;
        break;
    case 4:
        self->slave.motor[k].is_jammed = is_so;
        break;
    default:
        drive->is_homed = is_so;
        break;
    }
}

static void disturb_line(world_t *self, const record_t *record)
{
    modbus_tap_line_t *line = line_of(self, record->drive);
    const bool is_so = record->data[0] % 2 != 0;
    switch (record->kind % 3) {
    case 0:
        line->is_down = is_so;
        break;
    case 1:
        line->is_stuck = is_so;
        break;
    default:
        self->slave.line[self->layout->is_shared ? 0 : record->drive].transaction_us = record->data[0] * 16u;
        break;
    }
}

/* Who is told to stop is told at once, in the place of what waits. */
static void ask(world_t *self, const record_t *record)
{
    const unsigned request = record->kind % (DRIVES_RESET_FAULT + 1u);
    for (unsigned k = 0; k < DRIVES_MAX; k++) {
        self->seen[k].is_stopped = false;
    }
    const hv_status_t status = drive_run_ask(&self->run, record);
    for (unsigned k = 0; status == HV_OK && k < DRIVES_MAX; k++) {
        const bool is_there = self->run.feedback[k].state != DRIVE_OFFLINE;
        self->seen[k].is_reset |= request == DRIVES_RESET_FAULT;
        FUZZ_REQUIRE(!is_there || request != DRIVES_QUICK_STOP || self->seen[k].is_stopped);
    }
}

/* One record in a world; is_all: the one that gets everything. */
static void step(world_t *self, const record_t *record, bool is_all)
{
    unsigned cycles = 1;
    switch (record->op % 8) {
    case 0:
        self->cycle_us = record->kind == SLOW ? SLOW_US : CYCLE_US;
        cycles = record->kind == SLOW ? SLOW_CYCLES : record->kind % CYCLES_MAX;
        break;
    case 1:
        spoil(self, record);
        break;
    case 2:
        shift(self, record);
        break;
    case 3:
        if (is_all) {
            slip_in(self, record);
        }
        break;
    case 4:
        disturb(self, record);
        break;
    case 5:
        disturb_line(self, record);
        break;
    case 6:
        ask(self, record);
        break;
    default:
        drive_run_move(&self->run, record);
        break;
    }
    for (unsigned i = 0; i < cycles; i++) {
        cycle(self);
    }
    self->cycle_us = CYCLE_US;
}

static void compare(void)
{
    static modbus_drive_t all, some;
    all = m_world[0].driver;
    some = m_world[1].driver;
    memcpy(all.line, some.line, sizeof all.line);
    all.failures = some.failures;
    FUZZ_REQUIRE(memcmp(&all, &some, sizeof all) == 0);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    fuzz_input_t in = {data, size};
    if (m_map[0].axes == 0) {
        for (unsigned i = 0; i < LAYOUTS; i++) {
            configure(i);
            bring_up(0, i);
            bring_up(1, i);
        }
    }
    const uint8_t choice = fuzz_u8(&in);
    m_world[0] = m_start[0][choice / 2 % LAYOUTS][choice % 2];
    m_world[1] = m_start[1][choice / 2 % LAYOUTS][choice % 2];
    for (unsigned i = 0; i < RECORDS_MAX && in.left > 0; i++) {
        const record_t record = record_read(&in);
        step(&m_world[0], &record, true);
        step(&m_world[1], &record, false);
        compare();
    }
    return 0;
}
