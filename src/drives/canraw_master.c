/* SPDX-License-Identifier: MIT
 * canraw_master.c - see canraw_master.h.
 */
#include "canraw_master.h"

#include "canraw_axis.h"

/* Nobody but us sends what drives hear; what they answer has other identifiers. */
static bool is_of_master(const canraw_t *self, const can_frame_t *frame)
{
    bool is_such = false;
    for (unsigned k = 0; k < self->map->axes; k++) {
        const canraw_axis_map_t *axis = &self->map->axis[k];
        is_such = is_such || frame->id == axis->command_id || frame->id == axis->setpoint_id;
    }
    return is_such && frame->is_extended == self->map->is_extended && !frame->is_rtr;
}

bool canraw_master_receive(canraw_t *self, const can_frame_t *frame)
{
    const bool is_such = is_of_master(self, frame);
    if (is_such) {
        canmaster_note(&self->master, CANRAW_OTHER_MASTER);
    }
    return is_such;
}

void canraw_master_begin(canraw_t *self)
{
    canmaster_listen(&self->master, self->map->other_master == CANRAW_MASTER_STOP ? self->map->listen_ms : 0, self->now_us);
}

/* A drive that is known, or has torque, or may have it: it has to hear of its stop. */
static bool is_any_led(const canraw_t *self)
{
    for (unsigned k = 0; k < self->map->axes; k++) {
        if (self->axis[k].is_online || self->axis[k].is_energized) {
            return true;
        }
    }
    return false;
}

/* Each of its frames may have given torque again: what takes it goes out behind each. */
static void insist(canraw_axis_t *axis, const canraw_map_t *map)
{
    const bool has_off = map->command[CANRAW_DISABLE].length != 0;
    const bool is_braking = !has_off || quick_stop_is_active(&axis->quick_stop);
    if (axis->pending == CANRAW_NOTHING) {
        axis->pending = is_braking && map->command[CANRAW_STOP].length != 0 ? CANRAW_STOP
                        : has_off                                           ? CANRAW_DISABLE
                                                                            : CANRAW_NOTHING;
    }
    axis->is_energized = has_off;
}

static void stop(canraw_t *self)
{
    for (unsigned k = 0; k < self->map->axes; k++) {
        canraw_axis_t *axis = &self->axis[k];
        if (axis->is_online && axis->state != DRIVE_FAULT) {
            canraw_axis_fault(axis, self->map, CANRAW_OTHER_MASTER, self->now_us);
        }
        if (axis->is_online) {
            insist(axis, self->map);
        }
    }
}

void canraw_master_step(canraw_t *self)
{
    if (self->is_gone) {
        canmaster_deaf(&self->master, self->now_us);
        return;
    }
    if (canmaster_step(&self->master, self->now_us) != CANMASTER_HEARD || self->map->other_master != CANRAW_MASTER_STOP) {
        return;
    }
    if (is_any_led(self)) {
        stop(self);
    } else {
        canraw_master_begin(self);
    }
}
