/* SPDX-License-Identifier: MIT
 * canraw_setpoint.c - what a frame of set-points carries; see canraw_setpoint.h.
 */
#include "canraw_setpoint.h"

#include "canraw_axis.h"

/* The speed field of a way since the last set: its magnitude at least speed_least, what does not fit at the field's end. */
static int64_t speed_of(const canraw_t *self, unsigned k, q32_t travel_q32)
{
    const canraw_field_t *field = canraw_find_of(&self->map->setpoint, CANRAW_SPEED, self->map->axis[k].setpoint_slot);
    const counts_scale_t *scale = &self->map->axis[k].speed;
    int64_t speed = 0;
    if (field == NULL) {
        return 0;
    }
    const q32_t per_s_q32 = fx_mul_div(travel_q32, 1000000, self->map->period_us);
    if (counts_from_units(scale, per_s_q32, &speed) != HV_OK) {
        speed = (per_s_q32 < 0) == (scale->num < 0) ? INT64_MAX : INT64_MIN;
    }
    const int64_t magnitude = fx_clamp(fx_abs(speed), self->map->speed_least, INT64_MAX);
    return fx_clamp(field->is_signed && speed < 0 ? -magnitude : magnitude, canraw_field_min(field), canraw_field_max(field));
}

static bool is_carried(const canraw_map_t *map, const canraw_axis_map_t *axis, int64_t counts)
{
    const canraw_field_t *field = canraw_find_of(&map->setpoint, CANRAW_POSITION, axis->setpoint_slot);
    return counts >= canraw_field_min(field) && counts <= canraw_field_max(field);
}

/* Counts of a set-point that goes out.
 * Returns false where the drive does not follow, or has stopped because it cannot. */
static bool find_setpoint(canraw_t *self, unsigned k, q32_t setpoint_q32, int64_t *counts)
{
    const canraw_map_t *map = self->map;
    const canraw_axis_map_t *axis_map = &map->axis[k];
    canraw_axis_t *axis = &self->axis[k];
    if (!canraw_axis_is_streaming(axis, map)) {
        return false;
    }
    canraw_axis_watch(axis, map, axis_map, setpoint_q32, self->now_us);
    if (!canraw_axis_is_streaming(axis, map)) {
        return false;
    }
    if (counts_from_units(&axis_map->scale, setpoint_q32, counts) != HV_OK || !is_carried(map, axis_map, *counts)) {
        const guard_limits_t limits = canraw_axis_limits(axis, axis_map);
        const drive_guard_t guard = guard_out_of_counts(setpoint_q32, &limits);
        canraw_axis_fault_of_guard(axis, map, &guard, self->now_us);
        return false;
    }
    return true;
}

void canraw_setpoint_add(canraw_t *self, canraw_setpoints_t *set, unsigned k, q32_t setpoint_q32)
{
    const canraw_axis_map_t *axis_map = &self->map->axis[k];
    const canraw_field_t *field = canraw_find_of(&self->map->setpoint, CANRAW_POSITION, axis_map->setpoint_slot);
    const canraw_axis_t *axis = &self->axis[k];
    const q32_t travel_q32 = axis->has_sent ? fx_sub_sat(setpoint_q32, axis->sent_q32) : 0;
    int64_t *counts = &set->counts[k];
    set->is_following[k] = find_setpoint(self, k, setpoint_q32, counts);
    if (set->is_following[k]) {
        set->is_any = true;
        set->is_news |= !self->map->is_on_change || !axis->has_sent || *counts != axis->sent_counts;
    } else {
        *counts = fx_clamp(canraw_axis_held(axis, self->map), canraw_field_min(field), canraw_field_max(field));
        set->is_unknown |= !axis->has_actual || axis->state == DRIVE_HOMING; /* it moves by itself: a set-point would end that */
    }
    set->value[canraw_value_at(CANRAW_POSITION, axis_map->setpoint_slot)] = *counts;
    set->value[canraw_value_at(CANRAW_SPEED, axis_map->setpoint_slot)] = speed_of(self, k, set->is_following[k] ? travel_q32 : 0);
}
