/* SPDX-License-Identifier: MIT
 * frame_drive.c - a simulated drive with CAN frames of its own; see frame_drive.h.
 */
#include "twin/frame_drive.h"

#include <math.h>
#include <string.h>

#include "twin/status_word.h"

#define BOOT_US     300000u
#define STEP_US     10000u /* it is looked at so often beside its frames */
#define STOP_S      0.1    /* a stop from the usual speed */
#define HOMING_PART 5.0    /* it homes at such a part of the usual speed */

static bool has(const canraw_map_t *map, canraw_command_t command)
{
    return map->command[command].length != 0;
}

/* Conditions of the reply with the position; homing may have a reply of its own. */
static status_conditions_t conditions_of(const canraw_map_t *map)
{
    const bool is_apart = map->homing_query.length != 0;
    const canraw_when_t none = {0, 0};
    return (status_conditions_t){is_apart ? none : map->homing_done, is_apart ? none : map->homing_failed, map->enabled_when,
                                 map->fault_when};
}

static status_conditions_t conditions_of_homing(const canraw_map_t *map)
{
    return (status_conditions_t){.done = map->homing_done, .failed = map->homing_failed};
}

const char *frame_drive_refusal(const canraw_map_t *map)
{
    const status_conditions_t conditions = conditions_of(map);
    return status_word_tells(&conditions) ? NULL
                                          : "[can-raw] enabled_when, fault_when and homing_done_when: no status tells them "
                                            "apart, so heave-twin can show none";
}

void frame_drive_init(frame_drive_t *self, const canraw_map_t *map, unsigned axis, node_out_t out)
{
    *self = (frame_drive_t){.map = map, .axis = &map->axis[axis], .out = out};
}

int64_t frame_drive_count(const frame_drive_t *self)
{
    return (int64_t)round(self->motor->actual - self->origin);
}

bool frame_drive_is_enabled(const frame_drive_t *self)
{
    return self->is_powered && (self->state == FRAME_DRIVE_TORQUE || self->state == FRAME_DRIVE_HOMING);
}

/* --- What it sends --- */

static unsigned what_holds(const frame_drive_t *self)
{
    unsigned wanted = self->is_homed ? STATUS_DONE : 0;
    wanted |= self->has_homing_failed ? STATUS_FAILED : 0;
    wanted |= frame_drive_is_enabled(self) ? STATUS_ENABLED : 0;
    wanted |= self->state == FRAME_DRIVE_FAULT ? STATUS_FAULT : 0;
    return wanted;
}

/* What no field can hold is shown as its end. */
static int64_t within_field(const canraw_frame_t *frame, canraw_value_t value, int64_t number)
{
    const canraw_field_t *field = canraw_find(frame, value);
    return field == NULL ? 0 : fx_clamp(number, canraw_field_min(field), canraw_field_max(field));
}

static uint64_t first_waiting(const frame_drive_t *self)
{
    uint64_t due_us = DRIVE_NEVER;
    for (uint32_t i = 0; i < self->waits; i++) {
        due_us = self->waiting[i].due_us < due_us ? self->waiting[i].due_us : due_us;
    }
    return due_us;
}

static void spoil(const canraw_frame_t *frame, uint8_t *data)
{
    for (unsigned i = 0; i < frame->fields; i++) {
        if (canraw_is_check(frame->field[i].value)) {
            data[frame->field[i].at] ^= 0xFFu;
            return;
        }
    }
    data[0] ^= 0xFFu; /* without a check byte: another frame */
}

static void reply(frame_drive_t *self, const canraw_frame_t *frame, const status_conditions_t *conditions)
{
    can_frame_t out = {.id = self->axis->reply_id, .is_extended = self->map->is_extended, .length = frame->length};
    int64_t value[CANRAW_VALUES] = {0};
    self->counter += self->is_stuck ? 0 : 1;
    value[CANRAW_POSITION] = within_field(frame, CANRAW_POSITION, frame_drive_count(self));
    value[CANRAW_STATUS] = (int64_t)status_word(conditions, what_holds(self));
    value[CANRAW_COUNTER] = self->counter;
    value[CANRAW_FAULT] = within_field(frame, CANRAW_FAULT, self->fault_code);
    if (self->lost > 0 || self->is_mute || canraw_pack(frame, value, out.data) != HV_OK) {
        self->lost -= self->lost > 0 ? 1 : 0;
        return;
    }
    if (self->damaged > 0) {
        self->damaged--;
        spoil(frame, out.data);
    }
    if (self->late_us == 0) {
        self->out.put(self->out.ctx, &out);
    } else if (self->waits < FRAME_DRIVE_WAITING) {
        self->waiting[self->waits++] = (node_waiting_t){self->now_us + self->late_us, out};
    }
}

static void send_waiting(frame_drive_t *self)
{
    uint32_t left = 0;
    for (uint32_t i = 0; i < self->waits; i++) {
        if (self->waiting[i].due_us <= self->now_us) {
            self->out.put(self->out.ctx, &self->waiting[i].frame);
        } else {
            self->waiting[left++] = self->waiting[i];
        }
    }
    self->waits = left;
}

static void tell_position(frame_drive_t *self)
{
    const status_conditions_t conditions = conditions_of(self->map);
    reply(self, &self->map->position_reply, &conditions);
}

static void tell_homing(frame_drive_t *self)
{
    const status_conditions_t conditions = conditions_of_homing(self->map);
    reply(self, &self->map->homing_reply, &conditions);
}

/* --- What it does --- */

static void torque_off(frame_drive_t *self, frame_drive_state_t state)
{
    motor_torque(self->motor, false);
    self->state = state;
}

static void torque_on(frame_drive_t *self)
{
    motor_torque(self->motor, true);
    self->state = FRAME_DRIVE_TORQUE;
}

void frame_drive_fault(frame_drive_t *self, uint32_t code)
{
    self->fault_code = code;
    torque_off(self, FRAME_DRIVE_FAULT);
}

void frame_drive_drop(frame_drive_t *self)
{
    torque_off(self, FRAME_DRIVE_OFF);
}

/* A drive whose map has no word for torque has it as long as it has power. */
static bool is_always_on(const canraw_map_t *map)
{
    return !has(map, CANRAW_ENABLE) && map->enabled_when.mask == 0;
}

void frame_drive_power(frame_drive_t *self, bool is_on, uint64_t now_us)
{
    const bool is_incremental = has(self->map, CANRAW_HOME);
    self->is_powered = is_on;
    self->now_us = now_us;
    self->boot_us = self->send_us = now_us + BOOT_US;
    self->fault_code = 0;
    self->has_homing_failed = false;
    self->is_homed = !is_incremental;
    self->origin = is_incremental ? self->motor->actual : self->origin;
    self->waits = 0;
    torque_off(self, FRAME_DRIVE_OFF);
    if (is_on && is_always_on(self->map)) {
        torque_on(self);
    }
}

static void home(frame_drive_t *self)
{
    if (self->state == FRAME_DRIVE_FAULT || self->state == FRAME_DRIVE_HOMING) {
        return;
    }
    self->before_homing = self->state;
    self->is_homed = self->has_homing_failed = false;
    torque_on(self);
    self->state = FRAME_DRIVE_HOMING;
    motor_travel(self->motor, self->home, self->usual_speed / HOMING_PART);
}

static void command(frame_drive_t *self, canraw_command_t which)
{
    switch (which) {
    case CANRAW_STOP:
        (void)motor_stop(self->motor, self->usual_speed / STOP_S);
        return;
    case CANRAW_DISABLE:
        if (self->state != FRAME_DRIVE_FAULT) {
            torque_off(self, FRAME_DRIVE_OFF);
        }
        return;
    case CANRAW_RESET:
        if (self->state == FRAME_DRIVE_FAULT && !self->is_broken) {
            self->fault_code = 0;
            torque_off(self, FRAME_DRIVE_OFF);
        }
        return;
    case CANRAW_ENABLE:
        if (self->state == FRAME_DRIVE_OFF) {
            torque_on(self);
        }
        return;
    case CANRAW_HOME:
        home(self);
        return;
    }
}

static void take_set_point(frame_drive_t *self, const uint8_t *data)
{
    const canraw_field_t *field = canraw_find(&self->map->setpoint, CANRAW_POSITION);
    if (self->state == FRAME_DRIVE_OFF && !has(self->map, CANRAW_ENABLE)) {
        torque_on(self); /* the first set-point is its word for torque */
    }
    if (self->state != FRAME_DRIVE_TORQUE || field == NULL) {
        return;
    }
    self->set_points++;
    motor_aim(self->motor, (double)canraw_extract(field, data) + self->origin, self->map->period_us);
}

static bool is_exactly(const canraw_frame_t *frame, const can_frame_t *heard)
{
    return heard->length == frame->length && canraw_matches(frame, heard->data, heard->length);
}

/* Questions and commands have constants that set-points lack. */
static void take(frame_drive_t *self, const can_frame_t *frame)
{
    const canraw_map_t *map = self->map;
    if (is_exactly(&map->position_query, frame)) {
        tell_position(self);
        return;
    }
    if (is_exactly(&map->homing_query, frame)) {
        tell_homing(self);
        return;
    }
    for (unsigned i = 0; i < CANRAW_COMMANDS; i++) {
        if (is_exactly(&map->command[i], frame)) {
            if (!self->is_deaf) {
                command(self, (canraw_command_t)i);
            }
            return;
        }
    }
    if (!self->is_deaf && is_exactly(&map->setpoint, frame)) {
        take_set_point(self, frame->data);
    }
}

void frame_drive_hear(frame_drive_t *self, const can_frame_t *frame, uint64_t now_us)
{
    if (!self->is_powered || self->is_cut || now_us < self->boot_us || frame->is_error ||
        frame->is_extended != self->map->is_extended || frame->id != self->axis->command_id) {
        return;
    }
    frame_drive_advance(self, now_us);
    take(self, frame);
}

/* Homing is over. What had no torque before has none again. */
static void end_homing(frame_drive_t *self)
{
    if (self->is_homing_broken) {
        self->has_homing_failed = true;
        self->state = self->before_homing;
        if (self->map->homing_failed.mask == 0) {
            return; /* it cannot tell: heaved waits, and finds that it takes too long */
        }
        frame_drive_fault(self, CANRAW_FAULT_HOMING);
        return;
    }
    self->origin = 0;
    self->is_homed = true;
    if (self->before_homing == FRAME_DRIVE_OFF) {
        torque_off(self, FRAME_DRIVE_OFF);
    } else {
        self->state = FRAME_DRIVE_TORQUE;
    }
}

void frame_drive_advance(frame_drive_t *self, uint64_t now_us)
{
    self->now_us = now_us;
    motor_advance(self->motor, now_us);
    if (self->state == FRAME_DRIVE_HOMING && motor_is_there(self->motor)) {
        end_homing(self);
    }
    if (!self->is_powered || self->is_cut) {
        self->waits = 0;
        return;
    }
    send_waiting(self);
    if (self->map->position_query.length == 0 && now_us >= self->send_us) {
        self->send_us += self->map->period_us;
        self->send_us = self->send_us > now_us ? self->send_us : now_us + self->map->period_us;
        tell_position(self);
    }
}

uint64_t frame_drive_due_us(const frame_drive_t *self)
{
    const uint64_t look_us = self->now_us + STEP_US;
    const uint64_t waiting_us = first_waiting(self);
    const uint64_t send_us = self->map->position_query.length == 0 && self->is_powered ? self->send_us : DRIVE_NEVER;
    const uint64_t first_us = waiting_us < send_us ? waiting_us : send_us;
    return first_us < look_us ? first_us : look_us;
}
