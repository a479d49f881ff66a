/* SPDX-License-Identifier: MIT
 * modbus_drive_setpoint.c - set-points of one drive on Modbus: the mean that is written next, its speed field, and its guard.
 */
#include "modbus_drive_axis.h"
#include "modbus_drive_phase.h"

#define SUMS_MAX 4096u /* of the mean: more would leave 64 bits, in time */

static guard_limits_t limits_of(const modbus_drive_axis_t *self, const modbus_drive_axis_map_t *axis)
{
    return (guard_limits_t){.from_q32 = self->has_sent ? self->asked_q32 : self->actual_q32,
                            .step_max_q32 = axis->step_max_q32,
                            .actual_q32 = self->actual_q32,
                            .window_q32 = axis->following_max_q32};
}

static void fail_of_guard(modbus_drive_axis_t *self, const modbus_drive_map_t *map, drive_guard_t guard, uint64_t now_us)
{
    modbus_drive_phase_fail(self, map, MODBUS_DRIVE_FOLLOWING, now_us);
    self->guard = guard;
}

/* Nearest, halves away from zero. */
static q32_t mean_of(int64_t sum_q32, uint32_t count)
{
    const int64_t half = sum_q32 < 0 ? -(int64_t)(count / 2u) : (int64_t)(count / 2u);
    return fx_add_sat(sum_q32, half) / (int64_t)count;
}

void modbus_drive_axis_begin(modbus_drive_axis_t *self, const counts_scale_t *scale, uint64_t now_us)
{
    q32_t placed_q32 = self->actual_q32;
    (void)!counts_to_units(scale, self->target_counts, &placed_q32);
    modbus_drive_phase_enter(self, MODBUS_DRIVE_ENABLED, now_us);
    modbus_drive_phase_start_job(self, MODBUS_DRIVE_JOB_SETPOINT);
    self->paced_q32 = placed_q32;
    self->offered_q32 = placed_q32;
    self->written_q32 = placed_q32;
    self->sum_q32 = 0;
    self->sums = 0;
    self->setpoint_us = 0;
    self->due_us = 0;
    self->has_sent = false;
    self->is_fresh = false;
}

/* The speed field: the way since the last set-point in the period of the line and an eighth more; what does not fit at the
 * field's end. */
static int64_t speed_of(const modbus_drive_axis_t *self, const modbus_drive_map_t *map, const modbus_drive_axis_map_t *axis,
                        q32_t travel_q32)
{
    const modbus_drive_field_t *field = modbus_drive_find(&map->setpoint, MODBUS_DRIVE_SPEED, NULL);
    int64_t speed = 0;
    if (field == NULL) {
        return 0;
    }
    const q32_t asked_q32 = fx_mul_div(fx_add_sat(travel_q32, travel_q32 / 8), 1000000, self->period_us);
    const q32_t per_s_q32 = fx_clamp(asked_q32, -axis->speed_max_q32, axis->speed_max_q32);
    if (counts_from_units(&axis->speed, per_s_q32, &speed) != HV_OK) {
        speed = (per_s_q32 < 0) == (axis->speed.num < 0) ? INT64_MAX : INT64_MIN;
    }
    const int64_t magnitude = fx_clamp(fx_abs(speed), map->speed_least, INT64_MAX);
    return fx_clamp(field->is_signed && speed < 0 ? -magnitude : magnitude, modbus_drive_field_min(field),
                    modbus_drive_field_max(field));
}

/* A set-point of several blocks goes out whole. Where the position is not in the first one, that is already so once the first one
 * is submitted: its speed is for this position. */
static bool is_going_out(const modbus_drive_axis_t *self, const modbus_drive_map_t *map)
{
    unsigned block = 0;
    (void)modbus_drive_find(&map->setpoint, MODBUS_DRIVE_POSITION, &block);
    return self->step != 0 || (block != 0 && self->write.is_out);
}

void modbus_drive_axis_offer(modbus_drive_axis_t *self, const modbus_drive_map_t *map, const modbus_drive_axis_map_t *axis,
                             uint64_t now_us)
{
    if (self->sums == SUMS_MAX) {
        self->sum_q32 /= 2;
        self->sums /= 2u;
    }
    self->sum_q32 = fx_add_sat(self->sum_q32, self->paced_q32);
    self->sums++;
    if (is_going_out(self, map)) {
        return;
    }
    self->offered_q32 = mean_of(self->sum_q32, self->sums);
    self->is_fresh = true;
    if (counts_from_units(&axis->scale, self->offered_q32, &self->target_counts) != HV_OK) {
        const guard_limits_t limits = limits_of(self, axis);
        fail_of_guard(self, map, guard_out_of_counts(self->offered_q32, &limits), now_us);
    }
}

void modbus_drive_axis_choose_speed(modbus_drive_axis_t *self, const modbus_drive_map_t *map, const modbus_drive_axis_map_t *axis)
{
    self->target_speed = speed_of(self, map, axis, fx_sub_sat(self->offered_q32, self->written_q32));
}

void modbus_drive_axis_confirm(modbus_drive_axis_t *self, const modbus_drive_map_t *map, const modbus_drive_axis_map_t *axis,
                               int64_t counts)
{
    q32_t at_q32 = self->written_q32;
    (void)!counts_to_units(&axis->scale, counts, &at_q32); /* which it was made from */
    if (self->step + 1u < map->setpoint.count) {           /* the other blocks are those of this position */
        self->target_counts = counts;
        self->target_speed = speed_of(self, map, axis, fx_sub_sat(at_q32, self->written_q32));
        self->is_fresh = false;
    }
    self->written_q32 = at_q32;
}

void modbus_drive_axis_watch(modbus_drive_axis_t *self, const modbus_drive_map_t *map, const modbus_drive_axis_map_t *axis,
                             q32_t setpoint_q32, uint64_t now_us)
{
    const guard_limits_t limits = limits_of(self, axis);
    const drive_guard_t guard = guard_judge(setpoint_q32, &limits);
    if (drive_guard_is_found(&guard)) {
        fail_of_guard(self, map, guard, now_us);
        return;
    }
    self->asked_q32 = setpoint_q32;
    self->has_sent = self->phase == MODBUS_DRIVE_ENABLED;
}
