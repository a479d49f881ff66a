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

/* Conditions of the reply with the status; homing may have a reply of its own. */
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
    return status_word_is_distinct(&conditions) ? NULL
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
    return self->is_powered && self->motor->has_torque;
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
static int64_t within_field(const canraw_frame_t *frame, canraw_value_t value, unsigned slot, int64_t number)
{
    const canraw_field_t *field = canraw_find_of(frame, value, slot);
    return field == NULL ? 0 : fx_clamp(number, canraw_field_min(field), canraw_field_max(field));
}

/* A frame that it sends, and which of its fields are this drive's. */
typedef struct {
    const canraw_frame_t *frame;
    bool is_status; /* the status of its own frame */
} reply_t;

static uint32_t id_of(const frame_drive_t *self, const reply_t *form)
{
    return form->is_status ? self->axis->status_id : self->axis->reply_id;
}

static unsigned slot_of(const frame_drive_t *self, const reply_t *form)
{
    return form->is_status ? self->axis->status_slot : self->axis->reply_slot;
}

/* The next drive that shares a frame with this one, the first where `before` is NULL; NULL behind the last. */
static frame_drive_t *next_sharing(frame_drive_t *self, const reply_t *form, frame_drive_t *before)
{
    if (self->all == NULL) {
        return before == NULL ? self : NULL;
    }
    frame_drive_t *end = self->all + self->map->axes;
    for (frame_drive_t *drive = before == NULL ? self->all : before + 1; drive < end; drive++) {
        if (id_of(drive, form) == id_of(self, form)) {
            return drive;
        }
    }
    return NULL;
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

/* What holds of those that share a status: of all, but faults of any. */
static unsigned what_holds_together(frame_drive_t *self, const reply_t *form)
{
    const unsigned of_any = STATUS_FAILED | STATUS_FAULT;
    unsigned all = ~0u;
    unsigned any = 0;
    for (frame_drive_t *drive = next_sharing(self, form, NULL); drive != NULL; drive = next_sharing(self, form, drive)) {
        all &= what_holds(drive);
        any |= what_holds(drive);
    }
    return (all & ~of_any) | (any & of_any);
}

/* Its numbers in a reply. Its torque is what drives it: how far the demand is ahead. */
static void send_reply(frame_drive_t *self, const reply_t *form, const status_conditions_t *conditions, int64_t *value)
{
    const unsigned slot = slot_of(self, form);
    const canraw_field_t *status = canraw_find_of(form->frame, CANRAW_STATUS, slot);
    const bool is_own = status != NULL && status->slot != 0;
    const int64_t torque = self->motor->has_torque ? (int64_t)motor_error(self->motor) : 0;
    value[canraw_value_at(CANRAW_POSITION, slot)] = within_field(form->frame, CANRAW_POSITION, slot, frame_drive_count(self));
    value[canraw_value_at(CANRAW_STATUS, is_own ? slot : 0)] =
        (int64_t)status_word(conditions, is_own ? what_holds(self) : what_holds_together(self, form));
    value[canraw_value_at(CANRAW_FAULT, slot)] = within_field(form->frame, CANRAW_FAULT, slot, self->fault_code);
    value[canraw_value_at(CANRAW_TORQUE, slot)] = within_field(form->frame, CANRAW_TORQUE, slot, torque);
}

/* What is wrong with a reply, of all that share it. Returns false where it is not sent. */
static bool add_wrong(frame_drive_t *self, bool *is_damaged, bool *is_stuck, uint32_t *late_us)
{
    const bool is_sent = self->is_powered && !self->is_cut && !self->is_mute && self->lost == 0;
    self->lost -= self->lost > 0 ? 1 : 0;
    *is_damaged = *is_damaged || (is_sent && self->damaged > 0);
    self->damaged -= is_sent && self->damaged > 0 ? 1 : 0;
    *is_stuck = *is_stuck || self->is_stuck;
    *late_us = self->late_us > *late_us ? self->late_us : *late_us;
    return is_sent;
}

static void reply(frame_drive_t *self, reply_t form, const status_conditions_t *conditions)
{
    can_frame_t out = {.id = id_of(self, &form), .is_extended = self->map->is_extended, .length = form.frame->length};
    int64_t value[DRIVES_MAX * CANRAW_VALUES] = {0};
    bool is_sent = true;
    bool is_damaged = false;
    bool is_stuck = false;
    uint32_t late_us = 0;
    frame_drive_t *first = next_sharing(self, &form, NULL);
    uint32_t *counter = form.is_status ? &first->status_counter : &first->counter;
    for (frame_drive_t *drive = first; drive != NULL; drive = next_sharing(self, &form, drive)) {
        is_sent = add_wrong(drive, &is_damaged, &is_stuck, &late_us) && is_sent;
        send_reply(drive, &form, conditions, value);
    }
    *counter += is_stuck ? 0 : 1;
    value[CANRAW_COUNTER] = *counter;
    if (!is_sent || canraw_pack(form.frame, value, out.data) != HV_OK) {
        return;
    }
    if (is_damaged) {
        spoil(form.frame, out.data);
    }
    if (late_us == 0) {
        self->out.put(self->out.ctx, &out);
    } else if (self->waits < FRAME_DRIVE_WAITING) {
        self->waiting[self->waits++] = (node_waiting_t){self->now_us + late_us, out};
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

static void send_position(frame_drive_t *self)
{
    const status_conditions_t conditions = conditions_of(self->map);
    reply(self, (reply_t){&self->map->position_reply, false}, &conditions);
}

static void send_homing(frame_drive_t *self)
{
    const status_conditions_t conditions = conditions_of_homing(self->map);
    reply(self, (reply_t){&self->map->homing_reply, false}, &conditions);
}

static void send_status(frame_drive_t *self)
{
    const status_conditions_t conditions = conditions_of(self->map);
    reply(self, (reply_t){&self->map->status_reply, true}, &conditions);
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
    self->state = FRAME_DRIVE_FAULT;
    if (!self->is_torque_kept) {
        torque_off(self, FRAME_DRIVE_FAULT);
    }
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
    const bool is_incremental = has(self->map, CANRAW_HOME) && !self->is_absolute;
    self->is_powered = is_on;
    self->now_us = now_us;
    self->boot_us = self->send_us = self->status_us = now_us + BOOT_US;
    self->fault_code = 0;
    self->steps = 0;
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

/* What had no torque before has none again. */
static void leave_homing(frame_drive_t *self)
{
    self->state = FRAME_DRIVE_TORQUE;
    if (self->before_homing == FRAME_DRIVE_OFF) {
        torque_off(self, FRAME_DRIVE_OFF);
    }
}

static void command(frame_drive_t *self, canraw_command_t which)
{
    switch (which) {
    case CANRAW_STOP:
        if (self->state == FRAME_DRIVE_HOMING) {
            leave_homing(self);
        }
        (void)motor_stop(self->motor, self->usual_speed / STOP_S);
        return;
    case CANRAW_DISABLE:
        torque_off(self, self->state == FRAME_DRIVE_FAULT ? FRAME_DRIVE_FAULT : FRAME_DRIVE_OFF);
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

static void apply_set_point(frame_drive_t *self, const uint8_t *data)
{
    const canraw_field_t *field = canraw_find_of(&self->map->setpoint, CANRAW_POSITION, self->axis->setpoint_slot);
    if (self->state == FRAME_DRIVE_OFF && !has(self->map, CANRAW_ENABLE)) {
        torque_on(self); /* the first set-point is its word for torque */
    }
    if (self->state != FRAME_DRIVE_TORQUE || field == NULL) {
        return;
    }
    self->set_points++;
    motor_aim(self->motor, (double)canraw_extract(field, data) + self->origin, self->map->period_us);
}

static bool is_started(const frame_drive_t *self)
{
    return self->steps >= CANRAW_STEPS_MAX || self->map->step[self->steps].frame.length == 0;
}

static bool is_exactly(const canraw_frame_t *frame, const can_frame_t *heard)
{
    return heard->length == frame->length && canraw_matches(frame, heard->data, heard->length);
}

/* Starting up, in this order; the first frame begins it again. Returns whether it was one of them. */
static bool accept_step(frame_drive_t *self, const can_frame_t *frame)
{
    const canraw_step_t *step = self->map->step;
    const bool is_next = !is_started(self) && is_exactly(&step[self->steps].frame, frame);
    if (!is_next && !is_exactly(&step[0].frame, frame)) {
        return false;
    }
    self->steps = is_next ? self->steps : 0;
    if (step[self->steps].answer.length > 0) {
        const status_conditions_t none = {.done = {0, 0}};
        reply(self, (reply_t){&step[self->steps].answer, false}, &none);
    }
    self->steps++;
    return true;
}

/* Questions and commands have constants that set-points lack. */
static void receive(frame_drive_t *self, const can_frame_t *frame)
{
    const canraw_map_t *map = self->map;
    if ((frame->id == self->axis->command_id && accept_step(self, frame)) || !is_started(self)) {
        return;
    }
    if (frame->id != self->axis->command_id) {
        if (!self->is_deaf && is_exactly(&map->setpoint, frame)) {
            apply_set_point(self, frame->data);
        }
        return;
    }
    if (is_exactly(&map->position_query, frame)) {
        send_position(self);
        return;
    }
    if (is_exactly(&map->homing_query, frame)) {
        send_homing(self);
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
    if (!self->is_deaf && frame->id == self->axis->setpoint_id && is_exactly(&map->setpoint, frame)) {
        apply_set_point(self, frame->data);
    }
}

void frame_drive_hear(frame_drive_t *self, const can_frame_t *frame, uint64_t now_us)
{
    if (!self->is_powered || self->is_cut || now_us < self->boot_us || frame->is_error ||
        frame->is_extended != self->map->is_extended ||
        (frame->id != self->axis->command_id && frame->id != self->axis->setpoint_id)) {
        return;
    }
    frame_drive_advance(self, now_us);
    receive(self, frame);
}

static void end_homing(frame_drive_t *self)
{
    leave_homing(self);
    self->is_homed = !self->is_homing_broken;
    self->has_homing_failed = self->is_homing_broken;
    self->origin = self->is_homed ? 0 : self->origin;
    if (self->has_homing_failed && self->map->homing_failed.mask != 0) { /* else heaved finds that it takes too long */
        frame_drive_fault(self, CANRAW_FAULT_HOMING);
    }
}

/* Whether it comes by itself, and does now. */
static bool is_unasked(const frame_drive_t *self, bool is_status)
{
    const bool is_by_itself = is_status ? self->map->status_reply.length != 0 : self->map->position_query.length == 0;
    return is_by_itself && self->is_powered && !self->is_cut && is_started(self);
}

/* What comes by itself, from the first of those that share it. */
static void send_unasked(frame_drive_t *self, const reply_t *form, uint64_t *due_us, uint32_t every_us)
{
    if (!is_unasked(self, form->is_status) || self->now_us < *due_us) {
        return;
    }
    *due_us += every_us;
    *due_us = *due_us > self->now_us ? *due_us : self->now_us + every_us;
    if (next_sharing(self, form, NULL) != self) {
        return;
    }
    if (form->is_status) {
        send_status(self);
    } else {
        send_position(self);
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
    send_unasked(self, &(reply_t){&self->map->position_reply, false}, &self->send_us, self->map->period_us);
    send_unasked(self, &(reply_t){&self->map->status_reply, true}, &self->status_us,
                 self->map->period_us * self->map->status_every);
}

uint64_t frame_drive_due_us(const frame_drive_t *self)
{
    const uint64_t look_us = self->now_us + STEP_US;
    const uint64_t waiting_us = first_waiting(self);
    const uint64_t send_us = is_unasked(self, false) ? self->send_us : DRIVE_NEVER;
    const uint64_t status_us = is_unasked(self, true) ? self->status_us : DRIVE_NEVER;
    const uint64_t command_us = send_us < status_us ? send_us : status_us;
    const uint64_t first_us = waiting_us < command_us ? waiting_us : command_us;
    return first_us < look_us ? first_us : look_us;
}
