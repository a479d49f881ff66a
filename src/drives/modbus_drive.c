/* SPDX-License-Identifier: MIT
 * modbus_drive.c - drives on Modbus: who uses which slot of which line, and what the motion asks, as the lines can carry it; see
 * modbus_drive.h.
 */
#include "heave/modbus_drive.h"

#include "modbus_drive_axis.h"
#include "modbus_drive_phase.h"

#define SHARE_ONE     (INT64_C(1) << 30)
#define PERIOD_MAX_US 10000000u
#define SEND_GAP_US   100000u /* a longer gap between set-points is not made up for */

static unsigned write_slot(unsigned k)
{
    return 2u * k;
}

static unsigned read_slot(unsigned k)
{
    return 2u * k + 1u;
}

static hal_modbus_t line_of(const modbus_drive_t *self, unsigned k)
{
    return self->line[self->map->axis[k].line];
}

hv_status_t modbus_drive_init(modbus_drive_t *self, const modbus_drive_map_t *map, const hal_modbus_t line[DRIVES_MAX])
{
    if (!modbus_drive_map_is_valid(map)) {
        return HV_ERR_RANGE;
    }
    *self = (modbus_drive_t){.map = map};
    for (unsigned k = 0; k < map->axes; k++) {
        if (!hal_modbus_valid(line[map->axis[k].line])) {
            return HV_ERR_ARG;
        }
        self->line[map->axis[k].line] = line[map->axis[k].line];
        modbus_drive_axis_init(&self->axis[k], map);
    }
    return HV_OK;
}

/* One that refuses what it is asked, or whose answers are damaged, is no sign of a lost line. */
static bool is_any_answering(const modbus_drive_t *self)
{
    for (unsigned k = 0; k < self->map->axes; k++) {
        const uint32_t trouble = self->axis[k].trouble;
        const bool is_strange = trouble == MODBUS_DRIVE_EXCEPTION || trouble == MODBUS_DRIVE_DAMAGED;
        if (self->axis[k].phase != MODBUS_DRIVE_WAITING || is_strange) {
            return true;
        }
    }
    return false;
}

/* --- Lines --- */

/* One has gone out on a line: nobody else on it has to send another. */
static void end_broadcasts(modbus_drive_t *self, uint8_t line)
{
    for (unsigned k = 0; k < self->map->axes; k++) {
        if (self->map->axis[k].line == line) {
            modbus_drive_axis_end_broadcast(&self->axis[k]);
        }
    }
}

static void receive(modbus_drive_t *self, unsigned k)
{
    modbus_drive_axis_t *axis = &self->axis[k];
    modbus_result_t result;
    if (hal_modbus_poll(line_of(self, k), write_slot(k), &result) == HV_OK) {
        if (axis->is_broadcast && result.tag == axis->write.tag) {
            end_broadcasts(self, self->map->axis[k].line);
        }
        self->setpoints += modbus_drive_axis_receive_write(axis, self->map, &self->map->axis[k], &result, self->now_us);
        self->failures += result.status != HV_OK;
    }
    if (hal_modbus_poll(line_of(self, k), read_slot(k), &result) == HV_OK) {
        modbus_drive_axis_receive_read(axis, self->map, &self->map->axis[k].scale, &result, self->now_us);
        self->failures += result.status != HV_OK;
    }
}

static void submit_write(modbus_drive_t *self, unsigned k)
{
    modbus_request_t request;
    if (modbus_drive_axis_next_write(&self->axis[k], self->map, &self->map->axis[k], self->now_us, &request)) {
        (void)!hal_modbus_submit(line_of(self, k), write_slot(k), &request);
    }
}

static void submit_read(modbus_drive_t *self, unsigned k)
{
    modbus_request_t request;
    if (modbus_drive_axis_next_read(&self->axis[k], self->map, self->map->axis[k].unit, self->now_us, &request)) {
        (void)!hal_modbus_submit(line_of(self, k), read_slot(k), &request);
    }
}

/* --- Set-points --- */

/* Nobody follows before everybody has torque, unless they are asked one by one: then those that stand without it stay so. */
static void begin_together(modbus_drive_t *self)
{
    for (unsigned k = 0; k < self->map->axes; k++) {
        const modbus_drive_phase_t phase = self->axis[k].phase;
        if (self->is_one_by_one && phase != MODBUS_DRIVE_HOLDING) {
            continue;
        }
        if (phase != MODBUS_DRIVE_HOLDING && phase != MODBUS_DRIVE_ENABLED) {
            return;
        }
    }
    for (unsigned k = 0; k < self->map->axes; k++) {
        if (self->axis[k].phase == MODBUS_DRIVE_HOLDING) {
            modbus_drive_axis_begin(&self->axis[k], &self->map->axis[k].scale, self->now_us);
        }
    }
}

static bool is_following(const modbus_drive_t *self, unsigned k)
{
    return self->axis[k].phase == MODBUS_DRIVE_ENABLED;
}

/* How long this axis' set-points take: as measured, or longer while the newest one is waited for. */
static uint32_t present_period_us(const modbus_drive_t *self, const modbus_drive_axis_t *axis)
{
    const uint64_t waited_us = axis->setpoint_us != 0 ? self->now_us - axis->setpoint_us : 0;
    return waited_us > axis->period_us ? (uint32_t)(waited_us < PERIOD_MAX_US ? waited_us : PERIOD_MAX_US) : axis->period_us;
}

static uint32_t slowest_period_us(const modbus_drive_t *self)
{
    uint32_t slowest_us = self->map->period_us;
    for (unsigned k = 0; k < self->map->axes; k++) {
        const uint32_t period_us = present_period_us(self, &self->axis[k]);
        if (is_following(self, k) && period_us > slowest_us) {
            slowest_us = period_us;
        }
    }
    return slowest_us;
}

/* The share of their way that all axes can go in this cycle, in SHARE_ONE. */
static int64_t share_of(const modbus_drive_t *self, const q32_t setpoint_q32[DRIVES_MAX], uint32_t passed_us)
{
    const uint32_t period_us = slowest_period_us(self);
    int64_t share = SHARE_ONE;
    for (unsigned k = 0; k < self->map->axes; k++) {
        const q32_t carry_q32 = self->map->axis[k].carry_q32;
        if (!is_following(self, k) || carry_q32 == 0) {
            continue;
        }
        const q32_t travel_q32 = fx_abs(fx_sub_sat(setpoint_q32[k], self->axis[k].paced_q32));
        const q32_t allowed_q32 = fx_mul_div(carry_q32, passed_us, period_us);
        if (travel_q32 > allowed_q32) {
            const int64_t own = fx_mul_div(allowed_q32, SHARE_ONE, travel_q32);
            share = own < share ? own : share;
        }
    }
    return share;
}

static void pace(modbus_drive_t *self, const q32_t setpoint_q32[DRIVES_MAX], uint32_t passed_us)
{
    const int64_t share = share_of(self, setpoint_q32, passed_us);
    self->paced += share < SHARE_ONE;
    for (unsigned k = 0; k < self->map->axes; k++) {
        modbus_drive_axis_t *axis = &self->axis[k];
        if (!is_following(self, k)) {
            continue;
        }
        const q32_t travel_q32 = fx_sub_sat(setpoint_q32[k], axis->paced_q32);
        axis->paced_q32 = fx_add_sat(axis->paced_q32, fx_mul_div(travel_q32, share, SHARE_ONE));
        modbus_drive_axis_offer(axis, self->map, &self->map->axis[k], self->now_us);
    }
}

static bool is_watched(modbus_drive_phase_t phase)
{
    return phase == MODBUS_DRIVE_ENABLED || phase == MODBUS_DRIVE_PLACING || phase == MODBUS_DRIVE_ENABLING ||
           phase == MODBUS_DRIVE_CONFIRMING || phase == MODBUS_DRIVE_HOLDING;
}

/* --- drives.h --- */

static hv_status_t drive_poll(void *ctx, uint64_t now_us, drive_feedback_t feedback[DRIVES_MAX])
{
    modbus_drive_t *self = ctx;
    self->now_us = now_us;
    for (unsigned k = 0; k < self->map->axes; k++) {
        receive(self, k);
        modbus_drive_axis_step(&self->axis[k], self->map, now_us);
    }
    begin_together(self);
    for (unsigned k = 0; k < self->map->axes; k++) {
        modbus_drive_axis_feedback(&self->axis[k], &feedback[k]);
        submit_write(self, k);
        submit_read(self, k);
    }
    return is_any_answering(self) ? HV_OK : HV_ERR_IO;
}

static hv_status_t drive_send(void *ctx, uint64_t now_us, const q32_t setpoint_q32[DRIVES_MAX])
{
    modbus_drive_t *self = ctx;
    if (!is_any_answering(self)) {
        return HV_ERR_IO;
    }
    const uint64_t passed_us = self->sent_us != 0 ? now_us - self->sent_us : 0;
    self->sent_us = now_us;
    for (unsigned k = 0; k < self->map->axes; k++) {
        if (is_watched(self->axis[k].phase)) {
            modbus_drive_axis_watch(&self->axis[k], self->map, &self->map->axis[k], setpoint_q32[k], self->now_us);
        }
    }
    pace(self, setpoint_q32, (uint32_t)(passed_us < SEND_GAP_US ? passed_us : SEND_GAP_US));
    for (unsigned k = 0; k < self->map->axes; k++) {
        submit_write(self, k);
    }
    return HV_OK;
}

/* Whether drives allow a request. One that is being stopped gets torque again only after it has lost it. */
static hv_status_t judge(const modbus_drive_t *self, unsigned from, unsigned end, drives_request_t request)
{
    hv_status_t status = HV_OK;
    for (unsigned k = from; k < end; k++) {
        if (!drives_allow(request, modbus_drive_axis_state(&self->axis[k]))) {
            return HV_ERR_STATE;
        }
        status = request == DRIVES_ENABLE && modbus_drive_phase_is_stopping(&self->axis[k]) ? HV_ERR_AGAIN : status;
    }
    return status;
}

/* What stops drives is handed over at once and replaces set-points that wait: there may be no other cycle. */
static hv_status_t drive_request(void *ctx, drives_request_t request)
{
    modbus_drive_t *self = ctx;
    if (!is_any_answering(self)) {
        return HV_ERR_IO;
    }
    const hv_status_t status = judge(self, 0, self->map->axes, request);
    if (status != HV_OK) {
        return status;
    }
    self->is_one_by_one = false;
    for (unsigned k = 0; k < self->map->axes; k++) {
        modbus_drive_axis_request(&self->axis[k], self->map, request, self->now_us);
        submit_write(self, k);
    }
    return HV_OK;
}

/* Where a stop would go to a whole line, this one goes to its drive. */
static hv_status_t drive_request_one(void *ctx, uint8_t k, drives_request_t request)
{
    modbus_drive_t *self = ctx;
    if (!is_any_answering(self)) {
        return HV_ERR_IO;
    }
    const hv_status_t status = judge(self, k, k + 1u, request);
    if (status != HV_OK) {
        return status;
    }
    modbus_drive_axis_request(&self->axis[k], self->map, request, self->now_us);
    modbus_drive_axis_end_broadcast(&self->axis[k]);
    self->is_one_by_one = true;
    submit_write(self, k);
    return HV_OK;
}

static bool drive_counts(void *ctx, uint8_t k, int64_t *out)
{
    const modbus_drive_t *self = ctx;
    if (self->axis[k].has_actual) {
        *out = self->axis[k].actual_counts;
    }
    return self->axis[k].has_actual;
}

static uint8_t drive_count(void *ctx)
{
    const modbus_drive_t *self = ctx;
    return self->map->axes;
}

static void drive_report(void *ctx, uint8_t axis, drive_report_t *out)
{
    const modbus_drive_t *self = ctx;
    modbus_drive_axis_words(&self->axis[axis], self->map, self->map->axis[axis].unit, out);
}

static bool drive_is_stopping(void *ctx)
{
    const modbus_drive_t *self = ctx;
    for (unsigned k = 0; k < self->map->axes; k++) {
        if (modbus_drive_phase_is_stopping(&self->axis[k])) {
            return true;
        }
    }
    return false;
}

drives_t modbus_drive_hal(modbus_drive_t *self)
{
    static const drives_ops_t k_ops = {
        .poll = drive_poll,
        .send = drive_send,
        .request = drive_request,
        .count = drive_count,
        .report = drive_report,
        .request_one = drive_request_one,
        .counts = drive_counts,
        .is_stopping = drive_is_stopping,
    };
    return (drives_t){&k_ops, self};
}
