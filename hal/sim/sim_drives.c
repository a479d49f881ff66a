/* SPDX-License-Identifier: MIT
 * sim_drives.c - simulated drives; see sim_drives.h.
 * The lag is the backward-difference first-order low-pass: position += (set-point - position) * dt / (time constant + dt), which
 * is stable for every dt and needs one rounded product.
 */
#include "sim_drives.h"

#include <string.h>

/* Keeps every difference of two positions, and a second at homing speed, far inside 64 bits: 2^20 mm. */
#define POSITION_MAX_Q32 ((q32_t)1 << 52)

#define COUNTS_PER_UNIT 1000

/* Longest time one poll simulates; a longer pause counts as this. */
#define DT_MAX_US 1000000u

static q32_t offset_of(const sim_drive_t *axis, const sim_drive_config_t *config)
{
    return axis->is_homed ? 0 : config->unhomed_offset_q32;
}

static q32_t reported(const sim_drive_t *axis, const sim_drive_config_t *config)
{
    return axis->position_q32 + offset_of(axis, config);
}

static void fault(sim_drive_t *axis, uint32_t code)
{
    axis->state = DRIVE_FAULT;
    axis->fault_code = code;
}

/* The next set-point counts as a step from actual. */
static void hold_position(sim_drive_t *axis, const sim_drive_config_t *config)
{
    axis->setpoint_q32 = reported(axis, config);
    axis->has_setpoint = false;
}

static void power_up(sim_drive_t *axis, const sim_drive_config_t *config)
{
    axis->state = DRIVE_DISABLED;
    axis->is_begun = true;
    axis->is_homed = config->is_homed;
    axis->fault_code = 0;
    hold_position(axis, config);
}

/* Watches the way from one set-point to the next, and onto actual when the axis has just been enabled. */
static void watch_step(sim_drive_t *axis, const sim_drive_config_t *config, q32_t from_q32, q32_t to_q32)
{
    const q32_t step_q32 = fx_abs(to_q32 - from_q32);
    if (step_q32 > axis->step_largest_q32) {
        axis->step_largest_q32 = step_q32;
    }
    if (config->step_max_q32 != 0 && step_q32 > config->step_max_q32) {
        axis->following_errors++;
        fault(axis, SIM_DRIVES_FOLLOWING_ERROR);
    }
}

static void become_enabled(sim_drive_t *axis, const sim_drive_config_t *config)
{
    axis->state = DRIVE_ENABLED;
    if (axis->has_setpoint) {
        watch_step(axis, config, reported(axis, config), axis->setpoint_q32);
    } else {
        hold_position(axis, config);
    }
}

static void follow(sim_drive_t *axis, const sim_drive_config_t *config, uint32_t dt_us)
{
    const q32_t lag_q32 = axis->setpoint_q32 - reported(axis, config);
    const int64_t share_q32 = (int64_t)(((uint64_t)dt_us << 32) / ((uint64_t)config->time_constant_us + dt_us));
    const q32_t moved_q32 = axis->position_q32 + fx_mul_shift(lag_q32, share_q32, 32);
    axis->position_q32 = fx_clamp(moved_q32, config->travel_min_q32, config->travel_max_q32);
}

static void watch_lag(sim_drive_t *axis, const sim_drive_config_t *config)
{
    if (config->lag_max_q32 != 0 && fx_abs(axis->setpoint_q32 - reported(axis, config)) > config->lag_max_q32) {
        axis->following_errors++;
        fault(axis, SIM_DRIVES_FOLLOWING_ERROR);
    }
}

static void home(sim_drive_t *axis, const sim_drive_config_t *config, uint32_t dt_us)
{
    const q32_t reach_q32 = config->homing_per_s_q32 / 1000000 * dt_us;
    const q32_t left_q32 = config->home_q32 - axis->position_q32;
    if (config->homing_per_s_q32 != 0 && fx_abs(left_q32) > reach_q32) {
        axis->position_q32 += left_q32 > 0 ? reach_q32 : -reach_q32;
        return;
    }
    axis->position_q32 = config->home_q32;
    axis->is_homed = true;
    axis->state = DRIVE_ENABLED;
    hold_position(axis, config);
}

/* The drive's own life for one poll. */
static void advance(sim_drive_t *axis, const sim_drive_config_t *config, uint64_t now_us, uint32_t dt_us)
{
    if (axis->is_offline || axis->is_frozen) {
        if (!axis->is_offline && axis->state == DRIVE_ENABLED) {
            watch_lag(axis, config);
        }
        return;
    }
    if (!axis->is_begun) { /* a request is seen in one poll before it can end in the next */
        axis->is_begun = true;
    } else if (axis->state == DRIVE_ENABLING && now_us >= axis->enabled_us) {
        become_enabled(axis, config);
    } else if (axis->state == DRIVE_ENABLED && dt_us > 0) {
        follow(axis, config, dt_us);
        watch_lag(axis, config);
    } else if (axis->state == DRIVE_HOMING) {
        home(axis, config, dt_us);
    }
}

static void report(sim_drive_t *axis, const sim_drive_config_t *config, uint64_t now_us)
{
    if (axis->is_offline) {
        axis->feedback.state = DRIVE_OFFLINE;
    } else if (!axis->is_stale) {
        axis->feedback = (drive_feedback_t){
            .state = axis->state,
            .is_homed = axis->is_homed,
            .has_actual = true,
            .is_energized = axis->state != DRIVE_DISABLED && axis->state != DRIVE_FAULT,
            .actual_mm_q32 = reported(axis, config),
            .actual_us = now_us,
            .fault_code = axis->state == DRIVE_FAULT ? axis->fault_code : 0,
        };
    }
}

static void recover(sim_drive_t *axis, const sim_drive_config_t *config)
{
    if (axis->is_offline) {
        power_up(axis, config);
    }
    axis->is_offline = false;
    axis->is_broken = false;
    axis->is_frozen = false;
    axis->is_stale = false;
}

static void inject_axis(sim_drive_t *axis, const sim_drive_config_t *config, const sim_drives_fault_t *what)
{
    switch (what->kind) {
    case SIM_DRIVES_BROKEN:
        axis->is_broken = true;
        fault(axis, what->code);
        break;
    case SIM_DRIVES_FAULT:
        fault(axis, what->code);
        break;
    case SIM_DRIVES_OFFLINE:
        axis->is_offline = true;
        break;
    case SIM_DRIVES_FREEZE:
        axis->is_frozen = true;
        break;
    case SIM_DRIVES_STALE:
        axis->is_stale = true;
        break;
    case SIM_DRIVES_RECOVER:
        recover(axis, config);
        break;
    case SIM_DRIVES_BUSY:
        break;
    }
}

void sim_drives_inject(sim_drives_t *self, const sim_drives_fault_t *fault)
{
    if (fault->kind == SIM_DRIVES_BUSY || fault->kind == SIM_DRIVES_RECOVER) {
        self->is_busy = fault->kind == SIM_DRIVES_BUSY;
    }
    for (uint8_t k = 0; k < self->count; k++) {
        if (fault->axis == k || fault->axis == SIM_DRIVES_ALL) {
            inject_axis(&self->axis[k], &self->config[k], fault);
        }
    }
}

static void apply_plan(sim_drives_t *self)
{
    for (uint32_t i = 0; i < self->planned; i++) {
        const sim_drives_fault_t *entry = &self->plan[i];
        if (!self->is_planned_done[i] && self->polls >= entry->at_step && self->now_us >= entry->at_us) {
            self->is_planned_done[i] = true;
            sim_drives_inject(self, entry);
        }
    }
}

static bool is_bus_gone(const sim_drives_t *self)
{
    for (uint8_t k = 0; k < self->count; k++) {
        if (!self->axis[k].is_offline) {
            return false;
        }
    }
    return true;
}

/* Time since the last poll; the first one only sets the clock. */
static uint32_t step_time(sim_drives_t *self, uint64_t now_us)
{
    const uint64_t dt_us = self->has_time && now_us > self->now_us ? now_us - self->now_us : 0;
    self->has_time = true;
    self->now_us = now_us;
    return (uint32_t)(dt_us < DT_MAX_US ? dt_us : DT_MAX_US);
}

static hv_status_t drives_sim_poll(void *ctx, uint64_t now_us, drive_feedback_t feedback[DRIVES_MAX])
{
    sim_drives_t *self = ctx;
    const uint32_t dt_us = step_time(self, now_us);
    self->polls++;
    apply_plan(self);
    for (uint8_t k = 0; k < self->count; k++) {
        advance(&self->axis[k], &self->config[k], now_us, dt_us);
        report(&self->axis[k], &self->config[k], now_us);
        feedback[k] = self->axis[k].feedback;
    }
    return is_bus_gone(self) ? HV_ERR_IO : HV_OK;
}

static void apply_setpoint(sim_drive_t *axis, const sim_drive_config_t *config, q32_t setpoint_q32)
{
    const q32_t from_q32 = axis->setpoint_q32;
    if (axis->is_offline) {
        return;
    }
    axis->setpoint_q32 = fx_clamp(setpoint_q32, -POSITION_MAX_Q32, POSITION_MAX_Q32);
    axis->has_setpoint = true;
    if (axis->state == DRIVE_ENABLED) {
        watch_step(axis, config, from_q32, axis->setpoint_q32);
    }
}

static hv_status_t drives_sim_send(void *ctx, uint64_t now_us, const q32_t setpoint_q32[DRIVES_MAX])
{
    sim_drives_t *self = ctx;
    (void)now_us;
    if (self->is_busy || is_bus_gone(self)) {
        self->refused++;
        return self->is_busy ? HV_ERR_AGAIN : HV_ERR_IO;
    }
    self->sends++;
    for (uint8_t k = 0; k < self->count; k++) {
        apply_setpoint(&self->axis[k], &self->config[k], setpoint_q32[k]);
    }
    return HV_OK;
}

static bool is_axis_allowed(const sim_drives_t *self, uint8_t k, drives_request_t request)
{
    const bool is_known = !self->axis[k].is_offline && self->axis[k].feedback.has_actual;
    return drives_allow(request, is_known ? self->axis[k].state : DRIVE_OFFLINE);
}

static bool is_allowed(const sim_drives_t *self, drives_request_t request)
{
    for (uint8_t k = 0; k < self->count; k++) {
        if (!is_axis_allowed(self, k, request)) {
            return false;
        }
    }
    return true;
}

static void carry_out(sim_drive_t *axis, const sim_drive_config_t *config, drives_request_t request, uint64_t now_us)
{
    switch (request) {
    case DRIVES_ENABLE:
        if (axis->state == DRIVE_DISABLED) {
            axis->state = DRIVE_ENABLING;
            axis->enabled_us = now_us + config->enable_us;
            axis->is_begun = false;
        }
        break;
    case DRIVES_HOME:
        axis->state = DRIVE_HOMING;
        axis->is_begun = false;
        break;
    case DRIVES_DISABLE:
    case DRIVES_QUICK_STOP:
        if (axis->state != DRIVE_FAULT) {
            axis->state = DRIVE_DISABLED;
        }
        break;
    case DRIVES_RESET_FAULT:
        if (axis->state == DRIVE_FAULT && !axis->is_broken) {
            axis->state = DRIVE_DISABLED;
        }
        break;
    }
}

static hv_status_t drives_sim_request(void *ctx, drives_request_t request)
{
    sim_drives_t *self = ctx;
    if (is_bus_gone(self)) {
        return HV_ERR_IO;
    }
    if (self->is_busy) {
        return HV_ERR_AGAIN;
    }
    if (!is_allowed(self, request)) {
        return HV_ERR_STATE;
    }
    for (uint8_t k = 0; k < self->count; k++) {
        if (!self->axis[k].is_offline && !self->axis[k].is_frozen) {
            carry_out(&self->axis[k], &self->config[k], request, self->now_us);
        }
    }
    return HV_OK;
}

static hv_status_t drives_sim_request_one(void *ctx, uint8_t k, drives_request_t request)
{
    sim_drives_t *self = ctx;
    if (is_bus_gone(self)) {
        return HV_ERR_IO;
    }
    if (self->is_busy) {
        return HV_ERR_AGAIN;
    }
    if (!is_axis_allowed(self, k, request)) {
        return HV_ERR_STATE;
    }
    if (!self->axis[k].is_offline && !self->axis[k].is_frozen) {
        carry_out(&self->axis[k], &self->config[k], request, self->now_us);
    }
    return HV_OK;
}

/* What a drive whose counts are thousandths of a unit would have, in its own zero. */
static bool drives_sim_counts(void *ctx, uint8_t k, int64_t *out)
{
    const sim_drives_t *self = ctx;
    const drive_feedback_t *feedback = &self->axis[k].feedback;
    if (feedback->has_actual) {
        *out = fx_mul_shift(feedback->actual_mm_q32, COUNTS_PER_UNIT, 32);
    }
    return feedback->has_actual;
}

static uint8_t drives_sim_count(void *ctx)
{
    const sim_drives_t *self = ctx;
    return self->count;
}

static bool is_within_travel(const sim_drive_config_t *config, q32_t position_q32)
{
    return position_q32 >= config->travel_min_q32 && position_q32 <= config->travel_max_q32;
}

static bool is_config_valid(const sim_drive_config_t *config)
{
    return config->travel_min_q32 >= -POSITION_MAX_Q32 && config->travel_max_q32 <= POSITION_MAX_Q32 &&
           is_within_travel(config, config->start_q32) && is_within_travel(config, config->home_q32) &&
           config->homing_per_s_q32 >= 0 && config->homing_per_s_q32 <= POSITION_MAX_Q32 &&
           fx_abs(config->unhomed_offset_q32) <= POSITION_MAX_Q32 && config->step_max_q32 >= 0 && config->lag_max_q32 >= 0;
}

hv_status_t sim_drives_init(sim_drives_t *self, uint8_t count, const sim_drive_config_t *config, const sim_drives_fault_t *plan,
                            uint32_t planned)
{
    if (count < 1 || count > DRIVES_MAX || planned > SIM_DRIVES_PLAN_MAX) {
        return HV_ERR_RANGE;
    }
    memset(self, 0, sizeof *self);
    self->config = config;
    self->plan = plan;
    self->planned = planned;
    self->count = count;
    for (uint8_t k = 0; k < count; k++) {
        if (!is_config_valid(&config[k])) {
            return HV_ERR_RANGE;
        }
        self->axis[k].position_q32 = config[k].start_q32;
        power_up(&self->axis[k], &config[k]);
        if (config[k].is_enabled) {
            self->axis[k].state = DRIVE_ENABLED;
        }
    }
    return HV_OK;
}

void sim_drives_place(sim_drives_t *self, uint64_t now_us, const drive_feedback_t feedback[DRIVES_MAX],
                      const q32_t setpoint_q32[DRIVES_MAX])
{
    self->has_time = true;
    self->now_us = now_us;
    for (uint8_t k = 0; k < self->count; k++) {
        sim_drive_t *axis = &self->axis[k];
        axis->is_offline = feedback[k].state == DRIVE_OFFLINE;
        axis->state = axis->is_offline ? DRIVE_DISABLED : feedback[k].state;
        axis->is_homed = feedback[k].is_homed;
        axis->fault_code = feedback[k].fault_code;
        axis->position_q32 = fx_clamp(feedback[k].actual_mm_q32, self->config[k].travel_min_q32, self->config[k].travel_max_q32);
        axis->setpoint_q32 = setpoint_q32[k];
        axis->has_setpoint = true;
        axis->feedback = feedback[k];
    }
}

drives_t sim_drives_hal(sim_drives_t *self)
{
    static const drives_ops_t k_ops = {
        .poll = drives_sim_poll,
        .send = drives_sim_send,
        .request = drives_sim_request,
        .count = drives_sim_count,
        .request_one = drives_sim_request_one,
        .counts = drives_sim_counts,
    };
    return (drives_t){&k_ops, self};
}
