/* SPDX-License-Identifier: MIT
 * canraw.c - drives with a raw CAN map: what goes out when, what came in, and whether the bus works; see canraw.h.
 * A set goes out in this order: what stops or resets drives, set-points, what enables or homes them, queries.
 */
#include "heave/canraw.h"

#include "canraw_axis.h"
#include "canraw_master.h"
#include "canraw_setpoint.h"
#include "canraw_startup.h"

#define STALLED_PERIODS 3u      /* without an echo: the bus is gone */
#define RESTART_US      500000u /* between attempts to restart the bus */
#define FRAMES_PER_POLL 1024u   /* also of a storm of error frames: what waits behind it is ours */

static bool is_any_online(const canraw_t *self)
{
    for (unsigned k = 0; k < self->map->axes; k++) {
        if (self->axis[k].is_online) {
            return true;
        }
    }
    return false;
}

/* One that sends frames that are no answers, such as with a wrong check byte, is no sign of a lost bus. */
static bool is_any_heard(const canraw_t *self)
{
    const uint64_t silent_us = (uint64_t)self->map->offline_periods * self->map->period_us;
    for (unsigned k = 0; k < self->map->axes; k++) {
        if (self->axis[k].heard_us != 0 && self->now_us - self->axis[k].heard_us <= silent_us) {
            return true;
        }
    }
    return false;
}

static bool is_bus_lost(const canraw_t *self)
{
    return self->is_gone || !(is_any_online(self) || is_any_heard(self));
}

static void lose_all(canraw_t *self)
{
    for (unsigned k = 0; k < self->map->axes; k++) {
        canraw_axis_lose(&self->axis[k], self->map, self->now_us);
    }
}

/* --- In --- */

static void receive_frame(canraw_t *self, const can_frame_t *frame)
{
    if (canraw_master_receive(self, frame)) {
        return;
    }
    if (self->master.is_listening) {
        return; /* it begins with nothing known */
    }
    bool is_of_drive = false;
    bool is_strange = false;
    for (unsigned k = 0; k < self->map->axes; k++) {
        const canraw_axis_map_t *axis = &self->map->axis[k];
        const bool is_status = self->map->status_reply.length != 0 && frame->id == axis->status_id;
        if ((frame->id != axis->reply_id && !is_status) || frame->is_extended != self->map->is_extended || frame->is_rtr) {
            continue;
        }
        is_of_drive = true;
        is_strange |= !canraw_axis_receive(&self->axis[k], self->map, axis, frame, self->now_us);
    }
    self->strange += is_of_drive && is_strange ? 1u : 0u;
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
            receive_frame(self, &frame);
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

static hv_status_t send_bytes(canraw_t *self, uint32_t id, uint8_t length, const uint8_t data[CANRAW_BYTES_MAX])
{
    can_frame_t frame = {.id = id, .is_extended = self->map->is_extended, .length = length};
    for (unsigned i = 0; i < CANRAW_BYTES_MAX; i++) {
        frame.data[i] = data[i];
    }
    return hal_can_send(self->can, &frame);
}

/* A frame without values but counter and check byte. */
static hv_status_t send_plain(canraw_t *self, unsigned k, const canraw_frame_t *frame)
{
    const int64_t value[CANRAW_VALUES] = {[CANRAW_COUNTER] = self->axis[k].counter};
    uint8_t data[CANRAW_BYTES_MAX];
    hv_status_t status = canraw_pack(frame, value, data);
    status = status == HV_OK ? send_bytes(self, self->map->axis[k].command_id, frame->length, data) : status;
    self->axis[k].counter += status == HV_OK; /* what did not go out is no gap */
    return status;
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
            axis->command_us = self->now_us;
        }
    }
}

/* Drives that are not there, or have just come. */
static void send_steps(canraw_t *self)
{
    for (unsigned k = 0; k < self->map->axes; k++) {
        const canraw_frame_t *frame = canraw_startup_next(&self->axis[k], self->map, self->now_us);
        const bool is_off_due =
            frame != NULL && self->axis[k].step == 0 && self->axis[k].is_energized; /* there is `disable` then */
        if (is_off_due && canraw_axis_is_stopping(&self->axis[k])) {
            continue; /* that comes first */
        }
        if (is_off_due && send_plain(self, k, &self->map->command[CANRAW_DISABLE]) != HV_OK) {
            continue;
        }
        if (frame != NULL && send_plain(self, k, frame) == HV_OK) {
            canraw_startup_sent(&self->axis[k], self->map, self->now_us);
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

static bool is_shared(const canraw_map_t *map, unsigned a, unsigned b)
{
    return map->axis[a].setpoint_id == map->axis[b].setpoint_id;
}

static hv_status_t send_setpoints(canraw_t *self, unsigned first, canraw_setpoints_t *set)
{
    const canraw_axis_map_t *axis_map = &self->map->axis[first];
    canraw_axis_t *axis = &self->axis[first];
    uint32_t *counter = axis_map->setpoint_id == axis_map->command_id ? &axis->counter : &axis->setpoint_counter;
    uint8_t data[CANRAW_BYTES_MAX];
    set->value[CANRAW_COUNTER] = *counter;
    hv_status_t status = canraw_pack(&self->map->setpoint, set->value, data); /* every value is in its range */
    status = status == HV_OK ? send_bytes(self, axis_map->setpoint_id, self->map->setpoint.length, data) : status;
    *counter += status == HV_OK;
    return status;
}

/* The set-points of a drive, and of those that share its frame. Where one of these was never heard nobody knows what would leave
 * it where it is, and nothing is sent. */
static hv_status_t send_frame_of(canraw_t *self, unsigned first, const q32_t setpoint_q32[DRIVES_MAX])
{
    canraw_setpoints_t set = {.is_any = false};
    for (unsigned k = first; k < self->map->axes; k++) {
        if (is_shared(self->map, first, k)) {
            canraw_setpoint_add(self, &set, k, setpoint_q32[k]);
        }
    }
    if (!set.is_any || set.is_unknown) {
        return HV_OK;
    }
    const hv_status_t status = set.is_news ? send_setpoints(self, first, &set) : HV_OK;
    for (unsigned k = first; k < self->map->axes && status == HV_OK; k++) {
        canraw_axis_t *axis = &self->axis[k];
        if (is_shared(self->map, first, k) && set.is_following[k]) {
            axis->sent_counts = set.counts[k];
            axis->sent_q32 = setpoint_q32[k];
            axis->has_sent = axis->state == DRIVE_ENABLED;
        }
    }
    return status;
}

static bool is_first(const canraw_map_t *map, unsigned k)
{
    for (unsigned i = 0; i < k; i++) {
        if (is_shared(map, i, k)) {
            return false;
        }
    }
    return true;
}

/* A set that breaks off is offered again as a whole: the same set-point twice moves nothing. */
static hv_status_t send_set(canraw_t *self, const q32_t setpoint_q32[DRIVES_MAX])
{
    send_commands(self, CANRAW_RESET);
    for (unsigned k = 0; k < self->map->axes; k++) {
        const hv_status_t status = is_first(self->map, k) ? send_frame_of(self, k, setpoint_q32) : HV_OK;
        if (status != HV_OK) {
            return status;
        }
    }
    send_commands(self, CANRAW_HOME);
    return HV_OK;
}

/* --- drives.h --- */

static void step_time(canraw_t *self, uint64_t now_us)
{
    self->now_us = now_us;
    if (!self->has_time) {
        self->has_time = true;
        self->is_due = true;
        self->free_us = now_us;
        self->set_us = now_us;
        canraw_master_begin(self);
    }
    self->is_due |= now_us - self->set_us >= self->map->period_us;
}

static hv_status_t canraw_poll(void *ctx, uint64_t now_us, drive_feedback_t feedback[DRIVES_MAX])
{
    canraw_t *self = ctx;
    step_time(self, now_us);
    const bool is_up = receive(self);
    watch_bus(self, is_up);
    canraw_master_step(self);
    canpassive_step(&self->passive, self->can, now_us, self->map->passive_stop_ms);
    for (unsigned k = 0; k < self->map->axes; k++) {
        canraw_axis_step(&self->axis[k], self->map, now_us);
        if (self->is_free) {
            canraw_axis_note_off(&self->axis[k], self->map);
        }
        canraw_axis_report(&self->axis[k], &feedback[k]);
        feedback[k].fault_code = canmaster_leads(&self->master, now_us) ? CANRAW_OTHER_MASTER : feedback[k].fault_code;
    }
    const bool may_speak = !self->is_gone && self->is_free && !self->master.is_listening;
    if (may_speak) {
        send_commands(self, CANRAW_DISABLE);
        send_steps(self);
    }
    /* send asks once per period; where nobody calls it, or nobody answers, this does */
    if (may_speak && now_us - self->query_us >= 2u * (uint64_t)self->map->period_us) {
        send_queries(self);
    }
    return is_bus_lost(self) ? HV_ERR_IO : HV_OK;
}

static hv_status_t canraw_send(void *ctx, uint64_t now_us, const q32_t setpoint_q32[DRIVES_MAX])
{
    canraw_t *self = ctx;
    (void)now_us;                                /* that of the poll before */
    if (self->is_gone || !is_any_online(self)) { /* nothing to send; poll asks */
        return is_bus_lost(self) ? HV_ERR_IO : HV_OK;
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

/* Whether drives allow a request. One that is being stopped gets torque again only after it has lost it. */
static hv_status_t judge(const canraw_t *self, unsigned from, unsigned end, drives_request_t request)
{
    hv_status_t status = HV_OK;
    for (unsigned k = from; k < end; k++) {
        drive_feedback_t feedback;
        canraw_axis_report(&self->axis[k], &feedback);
        if (!drives_allow(request, feedback.state)) {
            return HV_ERR_STATE;
        }
        status = request == DRIVES_ENABLE && canraw_axis_is_stopping(&self->axis[k]) ? HV_ERR_AGAIN : status;
    }
    return status;
}

static bool is_end(drives_request_t request)
{
    return request == DRIVES_DISABLE || request == DRIVES_QUICK_STOP;
}

/* Whether a request is for it: what takes torque away is also for those that were lost under it. They may hear what they do not
 * answer, and have no watchdog. */
static bool is_commanded(const canraw_t *self, unsigned k, drives_request_t request)
{
    return self->axis[k].is_online || (is_end(request) && self->axis[k].is_energized);
}

/* What stops drives goes out at once, past the gate: after the last set-point there may be no other chance. */
static hv_status_t canraw_request(void *ctx, drives_request_t request)
{
    canraw_t *self = ctx;
    bool is_any = false;
    for (unsigned k = 0; k < self->map->axes; k++) {
        is_any |= is_commanded(self, k, request);
    }
    if (self->is_gone || !is_any) {
        return HV_ERR_IO;
    }
    const hv_status_t status = judge(self, 0, self->map->axes, request);
    for (unsigned k = 0; k < self->map->axes && status == HV_OK; k++) {
        if (is_commanded(self, k, request)) {
            canraw_axis_request(&self->axis[k], self->map, request, self->now_us);
        }
    }
    send_commands(self, CANRAW_RESET);
    return status;
}

/* Set-points are the word for torque, and others get the same frame. */
static bool would_enable_others(const canraw_map_t *map, unsigned k)
{
    bool has_others = !is_first(map, k);
    for (unsigned i = k + 1u; i < map->axes; i++) {
        has_others |= is_shared(map, i, k);
    }
    return has_others && map->command[CANRAW_ENABLE].length == 0;
}

static hv_status_t canraw_request_one(void *ctx, uint8_t k, drives_request_t request)
{
    canraw_t *self = ctx;
    if (self->is_gone || !is_any_heard(self)) {
        return HV_ERR_IO;
    }
    if (request == DRIVES_ENABLE && would_enable_others(self->map, k)) {
        return HV_ERR_STATE;
    }
    const hv_status_t status = judge(self, k, k + 1u, request);
    if (status != HV_OK) {
        return status;
    }
    for (unsigned i = 0; i < self->map->axes; i++) { /* the next set-point of another would give it its torque again */
        const bool goes_along = is_end(request) && is_shared(self->map, i, k) && would_enable_others(self->map, k);
        if (is_commanded(self, i, request) && (i == k || goes_along)) {
            canraw_axis_request(&self->axis[i], self->map, request, self->now_us);
        }
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

/* Until the last frame is on the wire. A bus that is gone takes nothing. */
static bool canraw_is_stopping(void *ctx)
{
    const canraw_t *self = ctx;
    bool is_stopping = false;
    for (unsigned k = 0; k < self->map->axes; k++) {
        const canraw_axis_t *axis = &self->axis[k];
        const bool is_under_way = axis->command_us != 0 && axis->command_us >= self->free_us;
        is_stopping |= canraw_axis_is_stopping(axis) || is_under_way;
    }
    return is_stopping && !self->is_gone;
}

static void canraw_report(void *ctx, uint8_t k, drive_report_t *out)
{
    const canraw_t *self = ctx;
    canraw_axis_words(&self->axis[k], self->map, k, self->now_us, out);
    out->notes = canmaster_was_heard(&self->master, self->now_us) && self->map->other_master == CANRAW_MASTER_REPORT
                     ? 1u << DRIVE_NOTE_MASTER
                     : 0;
    if (self->master.is_listening) {
        canraw_listening_words(canmaster_leads(&self->master, self->now_us), out);
    }
}

drives_t canraw_hal(canraw_t *self)
{
    static const drives_ops_t k_ops = {
        .poll = canraw_poll,
        .send = canraw_send,
        .request = canraw_request,
        .count = canraw_count,
        .report = canraw_report,
        .is_failing = canraw_is_failing,
        .request_one = canraw_request_one,
        .counts = canraw_counts,
        .is_stopping = canraw_is_stopping,
    };
    return (drives_t){&k_ops, self};
}
