/* SPDX-License-Identifier: MIT
 * canraw_axis.c - one drive of a raw CAN map; see canraw_axis.h.
 */
#include "canraw_axis.h"

#include "canraw_startup.h"

#include <string.h>

#define RESET_US        1000000u /* after a reset, the drive has so long to take its fault back */
#define RESET_WAIT_US   2000000u /* it may wait so long for the end of a stop: nobody counts on an older one */
#define HOMING_BEGIN_US 500000u  /* "done" before "not done" is believed only after this: it may be that of the last homing */

static bool has(const canraw_map_t *map, canraw_command_t command)
{
    return map->command[command].length != 0;
}

static bool is_when(canraw_when_t when, uint32_t status)
{
    return when.mask != 0 && (status & when.mask) == when.value;
}

static void queue_command(canraw_axis_t *self, const canraw_map_t *map, canraw_command_t command)
{
    self->pending = has(map, command) ? (uint8_t)command : CANRAW_NOTHING;
}

/* The frame that stops a drive: its own, and torque off at rest; else torque off. */
static void queue_stop(canraw_axis_t *self, const canraw_map_t *map, uint64_t now_us)
{
    self->reset_asked_us = 0;
    if (!has(map, CANRAW_STOP)) {
        queue_command(self, map, CANRAW_DISABLE);
        return;
    }
    queue_command(self, map, CANRAW_STOP);
    if (has(map, CANRAW_DISABLE)) {
        quick_stop_begin(&self->quick_stop, now_us);
    }
}

/* What stops it is still to be told, and goes on; where nothing is, it is told now, in case it hears what it does not answer. */
static void keep_stopping(canraw_axis_t *self, const canraw_map_t *map, const canraw_axis_t *was, uint64_t now_us)
{
    if (canraw_axis_is_stopping(was)) {
        self->pending = was->pending == CANRAW_STOP || was->pending == CANRAW_DISABLE ? was->pending : CANRAW_NOTHING;
        self->quick_stop = was->quick_stop;
        self->command_us = was->command_us;
    } else if (was->is_energized) {
        queue_stop(self, map, now_us);
    }
}

void canraw_axis_lose(canraw_axis_t *self, const canraw_map_t *map, uint64_t now_us)
{
    const canraw_axis_t was = *self;
    (void)memset(self, 0, sizeof *self); /* what lies between the members, too: states are compared byte by byte */
    self->state = DRIVE_DISABLED;
    self->pending = CANRAW_NOTHING;
    self->is_begun = true;
    self->is_homed = !has(map, CANRAW_HOME);
    self->is_energized = was.is_energized;
    self->counter = was.counter;
    self->setpoint_counter = was.setpoint_counter;
    for (unsigned i = 0; i < 2; i++) { /* one that has stood still is not heard again by losing it */
        self->has_counter[i] = was.has_counter[i];
        self->counter_in[i] = was.counter_in[i];
    }
    self->failed_step = was.failed_step;
    self->trouble = was.trouble;
    self->trouble_us = was.trouble_us;
    self->heard_us = was.heard_us;
    self->phase = was.phase;
    self->phase_us = was.phase_us;
    self->has_actual = was.has_actual;
    self->counts = was.counts;
    self->actual_q32 = was.actual_q32;
    self->actual_us = was.actual_us;
    keep_stopping(self, map, &was, now_us);
}

void canraw_axis_fault(canraw_axis_t *self, const canraw_map_t *map, uint32_t code, uint64_t now_us)
{
    self->state = DRIVE_FAULT;
    self->fault_code = code;
    self->guard = (drive_guard_t){.jump_q32 = 0};
    self->reset_until_us = 0;
    queue_stop(self, map, now_us);
}

void canraw_axis_fault_of_guard(canraw_axis_t *self, const canraw_map_t *map, const drive_guard_t *guard, uint64_t now_us)
{
    canraw_axis_fault(self, map, CANRAW_FAULT_FOLLOWING, now_us);
    self->guard = *guard;
}

/* --- Received --- */

static void judge_homing(canraw_axis_t *self, const canraw_map_t *map, uint32_t status, uint64_t now_us)
{
    const bool is_done = is_when(map->homing_done, status);
    if (self->state != DRIVE_HOMING) {
        self->is_homed = is_done;
        return;
    }
    if (self->pending == CANRAW_HOME || self->is_homing_over) {
        return;
    }
    if (is_when(map->homing_failed, status)) {
        canraw_axis_fault(self, map, CANRAW_FAULT_HOMING, now_us);
    } else if (!is_done) {
        self->is_homing_seen = true;
    } else if (self->is_homing_seen || now_us - self->command_us >= HOMING_BEGIN_US) {
        self->is_homing_over = true;
        self->mark_us = now_us;
    }
}

static void judge_fault(canraw_axis_t *self, const canraw_map_t *map, uint32_t status, uint32_t code)
{
    if (is_when(map->fault_when, status)) {
        if (self->state != DRIVE_FAULT) {
            self->state = DRIVE_FAULT;
            self->fault_code = code != 0 ? code : status != 0 ? status : 1u;
            self->guard = (drive_guard_t){.jump_q32 = 0};
            self->reset_asked_us = 0;
            self->pending = canraw_axis_is_stopping(self) ? self->pending : CANRAW_NOTHING;
        }
    } else if (self->reset_until_us != 0 && self->pending != CANRAW_RESET) {
        self->state = DRIVE_DISABLED;
        self->fault_code = 0;
        self->reset_until_us = 0;
        self->reset_asked_us = 0;
    }
}

/* The status of a reply that tells it; the field is there where the map judges by it. */
static void judge_status(canraw_axis_t *self, const canraw_map_t *map, uint32_t status, uint64_t now_us)
{
    self->status = status;
    if (is_when(map->enabled_when, status)) {
        self->is_energized = has(map, CANRAW_DISABLE); /* whatever it was told */
    }
    if (map->fault_when.mask != 0) {
        judge_fault(self, map, status, self->reported_code);
    }
    if (map->homing_query.length == 0 && has(map, CANRAW_HOME)) {
        judge_homing(self, map, status, now_us);
    }
    if (self->state == DRIVE_ENABLED && map->enabled_when.mask != 0 && !is_when(map->enabled_when, status)) {
        self->state = DRIVE_DISABLED;
    }
}

static void note_trouble(canraw_axis_t *self, canraw_verdict_t trouble, uint64_t now_us)
{
    self->trouble = trouble;
    self->trouble_us = now_us;
}

/* A drive whose counter stands still repeats what it said last, whatever has become of it. */
static bool is_repeated(canraw_axis_t *self, unsigned which, const canraw_frame_t *frame, const uint8_t *data, uint64_t now_us)
{
    const canraw_field_t *counter = canraw_find(frame, CANRAW_COUNTER);
    if (counter == NULL) {
        return false;
    }
    const uint32_t found = (uint32_t)canraw_extract(counter, data);
    const bool is_same = self->has_counter[which] && found == self->counter_in[which];
    self->has_counter[which] = true;
    self->counter_in[which] = found;
    if (is_same) {
        note_trouble(self, CANRAW_REPEATED, now_us);
    }
    return is_same;
}

/* What any reply may tell beside its own. */
static void apply_beside(canraw_axis_t *self, const canraw_frame_t *frame, unsigned slot, const uint8_t *data, uint64_t now_us)
{
    const canraw_field_t *fault = canraw_find_of(frame, CANRAW_FAULT, slot);
    const canraw_field_t *torque = canraw_find_of(frame, CANRAW_TORQUE, slot);
    if (fault != NULL) {
        self->reported_code = (uint32_t)canraw_extract(fault, data);
    }
    if (torque != NULL) {
        self->torque = canraw_extract(torque, data);
        self->has_torque = true;
        self->torque_us = now_us;
    }
}

/* It is there once it has been started up, and all that it has to tell has come since. */
static void note_online(canraw_axis_t *self, const canraw_map_t *map, uint64_t now_us)
{
    if (self->is_online || !self->is_placed || !canraw_startup_is_over(self, map) ||
        (map->status_reply.length != 0 && !self->has_status)) {
        return;
    }
    if (self->is_energized && !canraw_axis_is_stopping(self)) { /* what it was told when it was lost may not have reached it */
        queue_stop(self, map, now_us);
    }
    self->is_online = true;
}

static bool apply_position(canraw_axis_t *self, const canraw_map_t *map, const canraw_axis_map_t *axis, const uint8_t *data,
                           uint64_t now_us)
{
    const canraw_frame_t *reply = &map->position_reply;
    const canraw_field_t *status = canraw_find_of(reply, CANRAW_STATUS, axis->reply_slot);
    if (is_repeated(self, 0, reply, data, now_us)) {
        return false;
    }
    const int64_t counts = canraw_extract(canraw_find_of(reply, CANRAW_POSITION, axis->reply_slot), data);
    if (counts_to_units(&axis->scale, counts, &self->actual_q32) != HV_OK) {
        note_trouble(self, CANRAW_BAD_NUMBER, now_us);
        return false;
    }
    self->counts = counts;
    self->is_placed = true;
    self->has_actual = true;
    self->actual_us = now_us;
    apply_beside(self, reply, axis->reply_slot, data, now_us);
    note_online(self, map, now_us);
    if (status != NULL && map->status_reply.length == 0) {
        judge_status(self, map, (uint32_t)canraw_extract(status, data), now_us);
    }
    return true;
}

static bool receive_status(canraw_axis_t *self, const canraw_map_t *map, unsigned slot, const uint8_t *data, uint64_t now_us)
{
    const canraw_frame_t *reply = &map->status_reply;
    if (is_repeated(self, 1, reply, data, now_us)) {
        return false;
    }
    self->has_status = true;
    self->status_us = now_us;
    apply_beside(self, reply, slot, data, now_us);
    note_online(self, map, now_us);
    judge_status(self, map, (uint32_t)canraw_extract(canraw_find_of(reply, CANRAW_STATUS, slot), data), now_us);
    return true;
}

/* Where replies look alike, only the one that was asked for counts. */
static bool is_expected(const canraw_axis_t *self, const canraw_map_t *map, canraw_asked_t asked)
{
    return self->asked == asked || !canraw_is_ambiguous(&map->position_reply, &map->homing_reply);
}

static canraw_verdict_t nearer(canraw_verdict_t a, canraw_verdict_t b)
{
    return a > b ? a : b;
}

/* A frame on its reply_id. Returns false where it is none, and how near it comes. */
static bool receive_reply(canraw_axis_t *self, const canraw_map_t *map, const canraw_axis_map_t *axis, const can_frame_t *frame,
                          canraw_verdict_t *verdict, uint64_t now_us)
{
    const canraw_verdict_t homing = canraw_judge(&map->homing_reply, frame->data, frame->length);
    const canraw_verdict_t position = canraw_judge(&map->position_reply, frame->data, frame->length);
    if (homing == CANRAW_MATCH && is_expected(self, map, CANRAW_ASKED_HOMING)) {
        const canraw_field_t *status = canraw_find_of(&map->homing_reply, CANRAW_STATUS, axis->reply_slot);
        self->asked = CANRAW_ASKED_NOTHING;
        judge_homing(self, map, (uint32_t)canraw_extract(status, frame->data), now_us);
        return true;
    }
    if (position == CANRAW_MATCH && is_expected(self, map, CANRAW_ASKED_POSITION)) {
        self->asked = CANRAW_ASKED_NOTHING;
        *verdict = CANRAW_MATCH; /* what is wrong with it then is noted there */
        return apply_position(self, map, axis, frame->data, now_us);
    }
    const bool is_late = homing == CANRAW_MATCH || position == CANRAW_MATCH;
    *verdict = is_late ? CANRAW_MATCH : nearer(*verdict, nearer(homing, position));
    return false;
}

bool canraw_axis_receive(canraw_axis_t *self, const canraw_map_t *map, const canraw_axis_map_t *axis, const can_frame_t *frame,
                         uint64_t now_us)
{
    canraw_verdict_t verdict = CANRAW_OTHER;
    self->heard_us = now_us;
    if (canraw_startup_receive(self, map, axis, frame, now_us)) {
        return true;
    }
    if (map->status_reply.length != 0 && frame->id == axis->status_id) {
        verdict = canraw_judge(&map->status_reply, frame->data, frame->length);
        if (verdict == CANRAW_MATCH) {
            return receive_status(self, map, axis->status_slot, frame->data, now_us);
        }
    }
    if (frame->id == axis->reply_id && receive_reply(self, map, axis, frame, &verdict, now_us)) {
        return true;
    }
    if (verdict != CANRAW_MATCH) {
        note_trouble(self, verdict, now_us);
    }
    return false;
}

/* --- Time --- */

/* A position has come since the request and since the command went out; and a status, where it comes apart. */
static bool is_heard(const canraw_axis_t *self, const canraw_map_t *map)
{
    const uint64_t since_us = self->mark_us > self->command_us ? self->mark_us : self->command_us;
    const bool is_status = map->status_reply.length == 0 || self->status_us > since_us;
    return self->pending == CANRAW_NOTHING && self->actual_us > since_us && is_status;
}

static bool is_enabled(const canraw_axis_t *self, const canraw_map_t *map)
{
    return is_heard(self, map) && (map->enabled_when.mask == 0 || is_when(map->enabled_when, self->status));
}

void canraw_axis_note_off(canraw_axis_t *self, const canraw_map_t *map)
{
    const bool is_down = self->state == DRIVE_DISABLED || self->state == DRIVE_FAULT;
    const bool is_over = is_heard(self, map) && !quick_stop_is_active(&self->quick_stop); /* until then it brakes */
    if (self->is_online && is_down && is_over && !is_when(map->enabled_when, self->status)) {
        self->is_energized = false;
    }
}

/* A drive that says nothing of faults is believed to have none after a reset. */
static void begin_reset(canraw_axis_t *self, const canraw_map_t *map, uint64_t now_us)
{
    self->reset_asked_us = 0;
    queue_command(self, map, CANRAW_RESET);
    if (map->fault_when.mask != 0) {
        self->reset_until_us = now_us + RESET_US;
    } else {
        self->state = DRIVE_DISABLED;
        self->fault_code = 0;
    }
}

bool canraw_axis_is_stopping(const canraw_axis_t *self)
{
    return self->pending == CANRAW_STOP || self->pending == CANRAW_DISABLE || quick_stop_is_active(&self->quick_stop);
}

/* What follows a command that stops the drive, once it has gone out: torque off at rest, then a reset that was asked for. */
static void step_stop(canraw_axis_t *self, const canraw_map_t *map, uint64_t now_us)
{
    if (self->pending == CANRAW_NOTHING &&
        quick_stop_step(&self->quick_stop, self->actual_q32, self->actual_us, self->command_us, now_us)) {
        queue_command(self, map, CANRAW_DISABLE);
    }
    if (self->reset_asked_us != 0 && now_us - self->reset_asked_us > RESET_WAIT_US) {
        self->reset_asked_us = 0;
    }
    if (self->reset_asked_us != 0 && !canraw_axis_is_stopping(self)) {
        begin_reset(self, map, now_us);
    }
}

/* Its position, or its status, is older than it may be. */
static bool is_silent(const canraw_axis_t *self, const canraw_map_t *map, uint64_t now_us)
{
    const uint64_t silent_us = (uint64_t)map->offline_periods * map->period_us;
    return (self->is_placed && now_us - self->actual_us > silent_us) ||
           (self->has_status && now_us - self->status_us > silent_us * map->status_every);
}

void canraw_axis_step(canraw_axis_t *self, const canraw_map_t *map, uint64_t now_us)
{
    if (is_silent(self, map, now_us)) {
        canraw_axis_lose(self, map, now_us);
    }
    self->reset_until_us = now_us > self->reset_until_us ? 0 : self->reset_until_us;
    step_stop(self, map, now_us);
    if (!self->is_begun) { /* a request is seen in one poll before it can end in the next */
        self->is_begun = true;
    } else if (self->state == DRIVE_ENABLING && is_enabled(self, map)) {
        self->state = DRIVE_ENABLED;
    } else if (self->state == DRIVE_HOMING && self->is_homing_over && is_enabled(self, map)) {
        self->state = DRIVE_ENABLED;
        self->is_homed = true;
        self->has_sent = false;
    }
    const uint8_t phase = (uint8_t)(self->is_online ? self->state : DRIVE_OFFLINE);
    self->phase_us = phase == self->phase && self->phase_us != 0 ? self->phase_us : now_us;
    self->phase = phase;
}

/* --- Requests --- */

static void begin(canraw_axis_t *self, drive_state_t state, uint64_t now_us)
{
    self->state = state;
    self->is_begun = false;
    self->mark_us = now_us;
    self->has_sent = false;
}

/* Without a homing frame the zero is where the drive has it. */
static void begin_homing(canraw_axis_t *self, const canraw_map_t *map, uint64_t now_us)
{
    begin(self, DRIVE_HOMING, now_us);
    queue_command(self, map, CANRAW_HOME);
    self->is_homed = false;
    self->is_homing_seen = false;
    self->is_homing_over = !has(map, CANRAW_HOME);
}

void canraw_axis_request(canraw_axis_t *self, const canraw_map_t *map, drives_request_t request, uint64_t now_us)
{
    switch (request) {
    case DRIVES_ENABLE:
        if (self->state == DRIVE_DISABLED) {
            begin(self, DRIVE_ENABLING, now_us);
            queue_command(self, map, CANRAW_ENABLE);
            self->is_energized = has(map, CANRAW_DISABLE);
        }
        break;
    case DRIVES_HOME:
        begin_homing(self, map, now_us);
        break;
    case DRIVES_DISABLE:
    case DRIVES_QUICK_STOP:
        self->reset_asked_us = 0;
        if (request == DRIVES_QUICK_STOP) {
            queue_stop(self, map, now_us);
        } else if (!canraw_axis_is_stopping(self)) { /* that goes on to its end */
            queue_command(self, map, CANRAW_DISABLE);
        }
        self->state = self->state != DRIVE_FAULT ? DRIVE_DISABLED : DRIVE_FAULT;
        break;
    case DRIVES_RESET_FAULT:
        self->reset_asked_us = self->state == DRIVE_FAULT ? now_us : 0; /* as soon as it has been stopped */
        step_stop(self, map, now_us);
        break;
    }
}

/* --- To be sent --- */

/* A drive that says when it has torque, and is not told to take it, may be waiting for its first set-point. */
bool canraw_axis_is_streaming(const canraw_axis_t *self, const canraw_map_t *map)
{
    const bool is_early = has(map, CANRAW_ENABLE) || map->enabled_when.mask != 0;
    return self->is_online && (self->state == DRIVE_ENABLED || (self->state == DRIVE_ENABLING && is_early));
}

int64_t canraw_axis_held(const canraw_axis_t *self, const canraw_map_t *map)
{
    const bool is_reported_off = map->enabled_when.mask != 0 && !is_when(map->enabled_when, self->status);
    const bool is_off = is_reported_off || (has(map, CANRAW_DISABLE) && !self->is_energized);
    return self->has_sent && !is_off ? self->sent_counts : self->counts;
}

guard_limits_t canraw_axis_limits(const canraw_axis_t *self, const canraw_axis_map_t *axis)
{
    return (guard_limits_t){.from_q32 = self->has_sent ? self->sent_q32 : self->actual_q32,
                            .step_max_q32 = axis->step_max_q32,
                            .actual_q32 = self->actual_q32,
                            .window_q32 = axis->following_max_q32};
}

void canraw_axis_watch(canraw_axis_t *self, const canraw_map_t *map, const canraw_axis_map_t *axis, q32_t setpoint_q32,
                       uint64_t now_us)
{
    const guard_limits_t limits = canraw_axis_limits(self, axis);
    const drive_guard_t guard = guard_judge(setpoint_q32, &limits);
    if (drive_guard_is_found(&guard)) {
        canraw_axis_fault_of_guard(self, map, &guard, now_us);
    }
}

canraw_asked_t canraw_axis_next_query(canraw_axis_t *self, const canraw_map_t *map)
{
    const bool is_ambiguous = canraw_is_ambiguous(&map->position_reply, &map->homing_reply);
    const bool is_homing_wanted = map->homing_query.length != 0 && !self->is_homed && !self->is_homing_over;
    if (is_ambiguous && self->asked != CANRAW_ASKED_NOTHING) {
        self->asked = CANRAW_ASKED_NOTHING; /* a round of silence: a late answer must not be taken for the next one */
    } else if (is_homing_wanted && (self->is_homing_next || map->position_query.length == 0)) {
        self->asked = CANRAW_ASKED_HOMING;
        self->is_homing_next = false;
    } else {
        self->asked = map->position_query.length != 0 ? CANRAW_ASKED_POSITION : CANRAW_ASKED_NOTHING;
        self->is_homing_next = true;
    }
    return self->asked;
}

void canraw_axis_report(const canraw_axis_t *self, drive_feedback_t *feedback)
{
    *feedback = (drive_feedback_t){
        .state = self->is_online ? self->state : DRIVE_OFFLINE,
        .is_homed = self->is_homed,
        .has_actual = self->has_actual,
        .is_energized = self->is_energized,
        .actual_mm_q32 = self->actual_q32,
        .actual_us = self->actual_us,
        .fault_code = self->state == DRIVE_FAULT ? self->fault_code : 0,
        .guard = self->state == DRIVE_FAULT ? self->guard : (drive_guard_t){.jump_q32 = 0},
    };
}
