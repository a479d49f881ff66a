/* SPDX-License-Identifier: MIT
 * canraw.c - drives with a raw CAN map: what goes out when, what came in, and whether the bus works; see canraw.h.
 * A set goes out in this order: what stops or resets drives, set-points, what enables or homes them, queries.
 */
#include "heave/canraw.h"

#include "canraw_axis.h"

#define STALLED_PERIODS 3u      /* without an echo: the bus is gone */
#define RESTART_US      500000u /* between attempts to restart the bus */
#define FRAMES_PER_POLL 128u

static bool is_any_online(const canraw_t *self)
{
    for (unsigned k = 0; k < self->map->axes; k++) {
        if (self->axis[k].is_online) {
            return true;
        }
    }
    return false;
}

static void lose_all(canraw_t *self)
{
    for (unsigned k = 0; k < self->map->axes; k++) {
        canraw_axis_lose(&self->axis[k], self->map);
    }
}

/* --- In --- */

static void take_frame(canraw_t *self, const can_frame_t *frame)
{
    for (unsigned k = 0; k < self->map->axes; k++) {
        const canraw_axis_map_t *axis = &self->map->axis[k];
        if (frame->id != axis->reply_id || frame->is_extended != self->map->is_extended || frame->is_rtr) {
            continue;
        }
        if (!canraw_axis_receive(&self->axis[k], self->map, &axis->scale, frame, self->now_us)) {
            self->strange++;
        }
        return;
    }
}

/* Everything that waits, within bounds.
 * Returns false where the interface is gone. */
static bool receive(canraw_t *self)
{
    for (unsigned i = 0; i < FRAMES_PER_POLL; i++) {
        can_frame_t frame;
        uint64_t rx_time_us = 0; /* not used: states are judged in the time of poll */
        const hv_status_t status = hal_can_recv(self->can, &frame, &rx_time_us);
        if (status != HV_OK) {
            return status == HV_ERR_AGAIN;
        }
        if (!frame.is_error) {
            take_frame(self, &frame);
        } else if ((frame.id & CAN_ERROR_RESTARTED) != 0) {
            lose_all(self);
        }
    }
    return true;
}

/* --- The bus --- */

static bool is_controller_up(const canraw_t *self)
{
    hal_can_state_t state = HAL_CAN_DOWN;
    return hal_can_bus_state(self->can, &state) == HV_OK && state != HAL_CAN_BUS_OFF && state != HAL_CAN_DOWN &&
           state != HAL_CAN_GONE;
}

static void restart_bus(canraw_t *self)
{
    self->restart_us = self->now_us;
    if (hal_can_restart(self->can) == HV_OK) {
        self->restarts++;
        self->free_us = self->now_us;
        self->is_refused = false;
    }
}

/* Whether the bus works: up, and not long ago there was room and what was sent has been seen on the wire. */
static void watch_bus(canraw_t *self, bool is_up)
{
    uint32_t waiting = 0;
    self->is_free = hal_can_unconfirmed(self->can, &waiting) != HV_OK || waiting == 0;
    self->free_us = self->is_free && !self->is_refused ? self->now_us : self->free_us;
    const bool is_stalled = self->now_us - self->free_us >= (uint64_t)STALLED_PERIODS * self->map->period_us;
    const bool is_gone = !is_up || is_stalled || !is_controller_up(self);
    if (is_gone) { /* also who is heard meanwhile: nothing reaches it */
        lose_all(self);
    }
    if (is_gone && (!self->is_gone || self->now_us - self->restart_us >= RESTART_US)) {
        restart_bus(self);
    }
    self->is_gone = is_gone;
}

/* --- Out --- */

static hv_status_t send_bytes(canraw_t *self, unsigned k, uint8_t length, const uint8_t data[CANRAW_BYTES_MAX])
{
    can_frame_t frame = {.id = self->map->axis[k].command_id, .is_extended = self->map->is_extended, .length = length};
    for (unsigned i = 0; i < CANRAW_BYTES_MAX; i++) {
        frame.data[i] = data[i];
    }
    const hv_status_t status = hal_can_send(self->can, &frame);
    self->axis[k].counter += status == HV_OK; /* what did not go out is no gap */
    return status;
}

/* A frame without values but counter and check byte. */
static hv_status_t send_plain(canraw_t *self, unsigned k, const canraw_frame_t *frame)
{
    const int64_t value[CANRAW_VALUES] = {[CANRAW_COUNTER] = self->axis[k].counter};
    uint8_t data[CANRAW_BYTES_MAX];
    const hv_status_t status = canraw_pack(frame, value, data);
    return status == HV_OK ? send_bytes(self, k, frame->length, data) : status;
}

/* Commands that wait, of the kinds up to last; what the bus does not take waits on. */
static void send_commands(canraw_t *self, canraw_command_t last)
{
    for (unsigned k = 0; k < self->map->axes; k++) {
        canraw_axis_t *axis = &self->axis[k];
        if (axis->pending > last) {
            continue;
        }
        const canraw_frame_t *command = &self->map->command[axis->pending];
        if (send_plain(self, k, command) == HV_OK) {
            axis->pending = CANRAW_NOTHING;
            axis->told_us = self->now_us;
        }
    }
}

/* The round's queries; one that the bus does not take is left out. */
static void send_queries(canraw_t *self)
{
    const canraw_map_t *map = self->map;
    for (unsigned k = 0; k < map->axes; k++) {
        if (self->round % map->query_every != k % map->query_every) {
            continue;
        }
        const canraw_asked_t asked = canraw_axis_next_query(&self->axis[k], map);
        const canraw_frame_t *query = asked == CANRAW_ASKED_HOMING ? &map->homing_query : &map->position_query;
        if (asked != CANRAW_ASKED_NOTHING && send_plain(self, k, query) != HV_OK) {
            self->axis[k].asked = CANRAW_ASKED_NOTHING;
        }
    }
    self->round++;
    self->query_us = self->now_us;
}

/* The speed field of a way since the last set: its magnitude at least speed_least, what does not fit at the field's end. */
static int64_t speed_of(const canraw_t *self, unsigned k, q32_t travel_q32)
{
    const canraw_field_t *field = canraw_find(&self->map->setpoint, CANRAW_SPEED);
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

/* Bytes of a set-point. */
static hv_status_t pack_setpoint(const canraw_t *self, unsigned k, q32_t setpoint_q32, int64_t *counts,
                                 uint8_t data[CANRAW_BYTES_MAX])
{
    const canraw_axis_t *axis = &self->axis[k];
    int64_t value[CANRAW_VALUES] = {0};
    if (counts_from_units(&self->map->axis[k].scale, setpoint_q32, counts) != HV_OK) {
        return HV_ERR_RANGE;
    }
    value[CANRAW_POSITION] = *counts;
    value[CANRAW_COUNTER] = axis->counter;
    value[CANRAW_SPEED] = speed_of(self, k, axis->has_sent ? fx_sub_sat(setpoint_q32, axis->sent_q32) : 0);
    return canraw_pack(&self->map->setpoint, value, data);
}

static hv_status_t send_setpoint(canraw_t *self, unsigned k, q32_t setpoint_q32)
{
    canraw_axis_t *axis = &self->axis[k];
    uint8_t data[CANRAW_BYTES_MAX];
    int64_t counts = 0;
    canraw_axis_watch(axis, self->map, &self->map->axis[k], setpoint_q32);
    if (!canraw_axis_is_streaming(axis, self->map)) {
        return HV_OK;
    }
    if (pack_setpoint(self, k, setpoint_q32, &counts, data) != HV_OK) {
        const guard_limits_t limits = canraw_axis_limits(axis, &self->map->axis[k]);
        const drive_guard_t guard = guard_out_of_counts(setpoint_q32, &limits);
        canraw_axis_fault_of_guard(axis, self->map, &guard);
        return HV_OK;
    }
    if (!self->map->is_on_change || !axis->has_sent || counts != axis->sent_counts) {
        const hv_status_t status = send_bytes(self, k, self->map->setpoint.length, data);
        if (status != HV_OK) {
            return status;
        }
    }
    axis->sent_counts = counts;
    axis->sent_q32 = setpoint_q32;
    axis->has_sent = axis->state == DRIVE_ENABLED;
    return HV_OK;
}

/* A set that breaks off is offered again as a whole: the same set-point twice moves nothing. */
static hv_status_t send_set(canraw_t *self, const q32_t setpoint_q32[DRIVES_MAX])
{
    send_commands(self, CANRAW_RESET);
    for (unsigned k = 0; k < self->map->axes; k++) {
        const bool is_streaming = canraw_axis_is_streaming(&self->axis[k], self->map);
        const hv_status_t status = is_streaming ? send_setpoint(self, k, setpoint_q32[k]) : HV_OK;
        if (status != HV_OK) {
            return status;
        }
    }
    send_commands(self, CANRAW_HOME);
    return HV_OK;
}

/* --- drives.h --- */

static void take_time(canraw_t *self, uint64_t now_us)
{
    self->now_us = now_us;
    if (!self->has_time) {
        self->has_time = true;
        self->is_due = true;
        self->free_us = now_us;
        self->set_us = now_us;
    }
    self->is_due |= now_us - self->set_us >= self->map->period_us;
}

static hv_status_t canraw_poll(void *ctx, uint64_t now_us, drive_feedback_t feedback[DRIVES_MAX])
{
    canraw_t *self = ctx;
    take_time(self, now_us);
    const bool is_up = receive(self);
    watch_bus(self, is_up);
    canpassive_step(&self->passive, self->can, now_us, self->map->passive_stop_ms);
    for (unsigned k = 0; k < self->map->axes; k++) {
        canraw_axis_step(&self->axis[k], self->map, now_us);
        if (self->is_free) {
            canraw_axis_note_off(&self->axis[k], self->map);
        }
        canraw_axis_report(&self->axis[k], &feedback[k]);
    }
    /* send asks once per period; where nobody calls it, or nobody answers, this does */
    if (!self->is_gone && self->is_free && now_us - self->query_us >= 2u * (uint64_t)self->map->period_us) {
        send_queries(self);
    }
    return self->is_gone || !is_any_online(self) ? HV_ERR_IO : HV_OK;
}

static hv_status_t canraw_send(void *ctx, uint64_t now_us, const q32_t setpoint_q32[DRIVES_MAX])
{
    canraw_t *self = ctx;
    (void)now_us; /* that of the poll before */
    if (self->is_gone || !is_any_online(self)) {
        return HV_ERR_IO;
    }
    if (!self->is_due) {
        return HV_OK;
    }
    const hv_status_t status = self->is_free ? send_set(self, setpoint_q32) : HV_ERR_AGAIN;
    self->is_refused = self->is_free && status != HV_OK;
    if (status != HV_OK) {
        self->refused++;
        return status;
    }
    self->is_due = false;
    self->set_us = self->now_us;
    self->sets++;
    send_queries(self);
    return HV_OK;
}

static bool is_axis_allowed(const canraw_t *self, unsigned k, drives_request_t request)
{
    drive_feedback_t feedback;
    canraw_axis_report(&self->axis[k], &feedback);
    return drives_allow(request, feedback.state);
}

static bool is_allowed(const canraw_t *self, drives_request_t request)
{
    for (unsigned k = 0; k < self->map->axes; k++) {
        if (!is_axis_allowed(self, k, request)) {
            return false;
        }
    }
    return true;
}

/* What stops drives goes out at once, past the gate: after the last set-point there may be no other chance. */
static hv_status_t canraw_request(void *ctx, drives_request_t request)
{
    canraw_t *self = ctx;
    if (self->is_gone || !is_any_online(self)) {
        return HV_ERR_IO;
    }
    if (!is_allowed(self, request)) {
        return HV_ERR_STATE;
    }
    for (unsigned k = 0; k < self->map->axes; k++) {
        if (self->axis[k].is_online) {
            canraw_axis_request(&self->axis[k], self->map, request, self->now_us);
        }
    }
    send_commands(self, CANRAW_RESET);
    return HV_OK;
}

static hv_status_t canraw_request_one(void *ctx, uint8_t k, drives_request_t request)
{
    canraw_t *self = ctx;
    if (self->is_gone || !is_any_online(self)) {
        return HV_ERR_IO;
    }
    if (!is_axis_allowed(self, k, request)) {
        return HV_ERR_STATE;
    }
    if (self->axis[k].is_online) {
        canraw_axis_request(&self->axis[k], self->map, request, self->now_us);
    }
    send_commands(self, CANRAW_RESET);
    return HV_OK;
}

static bool canraw_counts(void *ctx, uint8_t k, int64_t *out)
{
    const canraw_t *self = ctx;
    if (self->axis[k].has_actual) {
        *out = self->axis[k].counts;
    }
    return self->axis[k].has_actual;
}

static uint8_t canraw_count(void *ctx)
{
    const canraw_t *self = ctx;
    return self->map->axes;
}

static bool canraw_is_failing(void *ctx)
{
    const canraw_t *self = ctx;
    return self->passive.is_failing;
}

drives_t canraw_hal(canraw_t *self)
{
    static const drives_ops_t k_ops = {canraw_poll, canraw_send,       canraw_request,     canraw_count,
                                       NULL,        canraw_is_failing, canraw_request_one, canraw_counts};
    return (drives_t){&k_ops, self};
}
