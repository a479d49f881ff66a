/* SPDX-License-Identifier: MIT
 * confirm.c - far jumps wait for a second frame; see confirm.h.
 */
#include "heave/confirm.h"

enum { NO_AXIS = AXIS_ANGLE + 1 };

static q32_t value_of(const motion_target_t *target, unsigned axis)
{
    return axis == AXIS_ANGLE ? target->angle_deg_q32 : target->value_q32[axis];
}

/* The first axis on which two targets of the same space are far from each other; NO_AXIS where none is. */
static unsigned far_axis(const confirm_distance_t *distance, const motion_target_t *a, const motion_target_t *b)
{
    for (unsigned i = 0; i < NO_AXIS; i++) {
        const bool is_turn = i == AXIS_ANGLE || (a->space == MOTION_POSE && i <= AXIS_YAW);
        const q32_t far_q32 = is_turn ? distance->deg_q32 : distance->mm_q32;
        const bool is_compared = far_q32 > 0 && (i != AXIS_ANGLE || (a->has_angle && b->has_angle));
        if (is_compared && fx_abs(value_of(a, i) - value_of(b, i)) > far_q32) {
            return i;
        }
    }
    return NO_AXIS;
}

static bool is_equal(const motion_target_t *a, const motion_target_t *b)
{
    bool is_equal =
        a->space == b->space && a->has_angle == b->has_angle && a->is_timed == b->is_timed && a->time_ms == b->time_ms;
    for (unsigned i = 0; is_equal && i < NO_AXIS; i++) {
        is_equal = value_of(a, i) == value_of(b, i);
    }
    return is_equal;
}

static void drop(confirm_t *self)
{
    if (self->is_waiting) {
        self->is_waiting = false;
        self->dropped++;
        self->drop = self->jump;
    }
}

static void hold_back(confirm_t *self, unsigned axis, const motion_target_t *target, uint64_t now_us)
{
    drop(self);
    self->is_waiting = true;
    self->waiting = *target;
    self->waiting_us = now_us;
    self->jump = (confirm_jump_t){target->space, (uint8_t)axis, value_of(target, axis), value_of(&self->last, axis)};
}

void confirm_restart(confirm_t *self)
{
    self->has_last = false;
    self->is_waiting = false;
}

void confirm_cycle(confirm_t *self, uint64_t now_us)
{
    if (self->is_waiting && now_us - self->waiting_us > CONFIRM_WAIT_US) {
        drop(self);
    }
}

bool confirm_passes(confirm_t *self, const confirm_distance_t *distance, const motion_target_t *here,
                    const motion_target_t *target, uint64_t now_us)
{
    if (!self->has_last || self->last.space != target->space) {
        self->has_last = true;
        self->last = *here;
    }
    if (self->is_waiting && now_us - self->waiting_us < CONFIRM_APART_US && is_equal(&self->waiting, target)) {
        return false;
    }
    const unsigned axis = far_axis(distance, &self->last, target);
    if (axis == NO_AXIS) {
        drop(self);
        return true;
    }
    if (self->is_waiting && self->waiting.space == target->space && far_axis(distance, &self->waiting, target) == NO_AXIS) {
        self->is_waiting = false;
        return true;
    }
    hold_back(self, axis, target, now_us);
    return false;
}

void confirm_followed(confirm_t *self, const motion_target_t *target)
{
    const motion_target_t before = self->last;
    self->has_last = true;
    self->last = *target;
    if (!target->has_angle) { /* the motor stays where it was sent */
        self->last.has_angle = before.has_angle;
        self->last.angle_deg_q32 = before.angle_deg_q32;
    }
}
