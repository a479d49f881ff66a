/* SPDX-License-Identifier: MIT
 * cia402.c - CANopen drives behind drives.h: SYNC, heartbeat, set-points, requests; see cia402.h.
 */
#include "heave/cia402.h"
#include "heave/guard.h"

#include "cia402_bus.h"
#include "cia402_loss.h"
#include "cia402_map.h"
#include "cia402_master.h"
#include "cia402_node.h"
#include "cia402_pdo.h"
#include "cia402_report.h"
#include "cia402_stage.h"
#include "cia402_visit.h"

#define REQUESTS_MAX    4u    /* SDO requests in a cycle: with their answers they take 0.9 ms at 1 Mbit/s */
#define FRAMES_PER_POLL 1024u /* also of a storm of error frames: what waits behind it is ours */
#define COB_FUNCTION    0x780u
#define NMT_PREOP       0x80u
#define NMT_RESET       0x82u
#define NMT_OPERATIONAL 0x05u

/* One that answers but cannot be used, or is being set up, is no sign of a lost bus. */
static bool is_any_answering(const cia402_t *self)
{
    for (unsigned k = 0; k < self->config->axes; k++) {
        if (self->axis[k].is_answering) {
            return true;
        }
    }
    return false;
}

/* --- In --- */

static void receive_for(cia402_t *self, unsigned k, const can_frame_t *frame)
{
    const cia402_drive_t drive = cia402_drive(self, k);
    switch (frame->id & COB_FUNCTION) {
    case CIA402_COB_SYNC:
        self->emergencies += drive.own->channel == 0;
        cia402_axis_receive_emergency(drive, frame);
        break;
    case CIA402_COB_SDO_ANSWER:
        if (drive.axis->is_asking) {
            sdo_receive(cia402_sdo_of(self, k), frame);
        }
        break;
    case CIA402_COB_HEARTBEAT:
        cia402_axis_receive_heartbeat(drive, frame);
        break;
    default: /* no enum: whatever else is on the bus */
        break;
    }
}

static void receive_frame(cia402_t *self, const can_frame_t *frame)
{
    if (frame->is_extended || frame->is_rtr || cia402_master_receive(self, frame) || self->master.is_listening) {
        return;
    }
    if (frame->id >= CIA402_COB_TPDO && frame->id < CIA402_COB_SDO_ANSWER) {
        cia402_pdo_receive(self, frame);
        return;
    }
    for (unsigned k = 0; k < self->config->axes; k++) {
        if ((frame->id & CIA402_NODE_MAX) == self->config->axis[k].node) {
            receive_for(self, k, frame);
        }
    }
}

/* Everything that waits, within bounds.
 * Returns false where the interface is gone. */
static bool receive(cia402_t *self)
{
    for (unsigned i = 0; i < FRAMES_PER_POLL; i++) {
        can_frame_t frame;
        uint64_t rx_time_us = 0; /* not used: everything is judged in the time of poll */
        const hv_status_t status = hal_can_recv(self->can, &frame, &rx_time_us);
        if (status != HV_OK) {
            return status == HV_ERR_AGAIN;
        }
        if (!frame.is_error) {
            receive_frame(self, &frame);
        } else if ((frame.id & CAN_ERROR_RESTARTED) != 0) {
            cia402_bus_lose(self);
        }
    }
    return true;
}

/* --- Out --- */

static bool send_frame(const cia402_t *self, const can_frame_t *frame)
{
    return hal_can_send(self->can, frame) == HV_OK;
}

static bool send_nmt(const cia402_t *self, uint8_t command, uint8_t node)
{
    return send_frame(self, &(can_frame_t){.id = CIA402_COB_NMT, .length = 2, .data = {command, node}});
}

/* SYNC of a period that has begun. */
static void send_sync(cia402_t *self)
{
    can_frame_t frame = {.id = CIA402_COB_SYNC};
    if (self->config->sync_counter != 0) {
        frame.length = 1;
        frame.data[0] = self->sync_count;
    }
    self->is_refused = !send_frame(self, &frame);
    if (self->is_refused) {
        return;
    }
    self->sync_count = self->sync_count < self->config->sync_counter ? (uint8_t)(self->sync_count + 1u) : CIA402_SYNC_FIRST;
    self->is_due = false;
    self->is_open = true;
    self->syncs++;
    self->stage_syncs++;
    const bool is_late = self->now_us >= self->due_us + self->config->period_us;
    self->due_us = (is_late ? self->now_us : self->due_us) + self->config->period_us;
    for (unsigned k = 0; k < self->config->axes; k++) {
        cia402_axis_note_sync(cia402_drive(self, k));
    }
}

static void send_heartbeat(cia402_t *self)
{
    const can_frame_t frame = {.id = CIA402_COB_HEARTBEAT + self->config->master_node, .length = 1, .data = {NMT_OPERATIONAL}};
    if (self->now_us - self->heartbeat_us >= self->config->heartbeat_ms * (uint64_t)1000u && send_frame(self, &frame)) {
        self->heartbeat_us = self->now_us;
    }
}

/* One in a call: what is asked for is sent back at once. The one that was asked longest ago, or none would be left for the last.
 */
static void send_guarding(cia402_t *self)
{
    const uint64_t period_us = self->config->heartbeat_ms * (uint64_t)1000u;
    unsigned next = self->config->axes;
    for (unsigned k = 0; k < self->config->axes && self->config->is_guarded; k++) {
        const cia402_axis_t *axis = &self->axis[k];
        const bool is_there = axis->phase >= CIA402_CONFIGURING && axis->phase <= CIA402_UP;
        if (self->config->axis[k].channel == 0 && is_there && self->now_us - axis->guard_us >= period_us &&
            (next == self->config->axes || axis->guard_us < self->axis[next].guard_us)) {
            next = k;
        }
    }
    if (next < self->config->axes) {
        const can_frame_t frame = {.id = CIA402_COB_HEARTBEAT + self->config->axis[next].node, .is_rtr = true, .length = 1};
        self->axis[next].guard_us = send_frame(self, &frame) ? self->now_us : self->axis[next].guard_us;
    }
}

/* What has time.
 * @param most SDO requests */
static void send_services(cia402_t *self, unsigned most)
{
    send_heartbeat(self);
    send_guarding(self);
    if (self->is_preop_due) {
        self->is_preop_due = !send_nmt(self, NMT_PREOP, 0);
        return;
    }
    for (unsigned k = 0; k < self->config->axes; k++) {
        cia402_axis_t *axis = &self->axis[k];
        can_frame_t frame;
        if (axis->nmt_command != 0 && send_nmt(self, axis->nmt_command, self->config->axis[k].node)) {
            axis->nmt_command = 0;
        }
        sdo_t *sdo = cia402_sdo_of(self, k);
        if (most > 0 && axis->nmt_command == 0 && (!axis->has_mates || cia402_node_may_ask(cia402_drive(self, k))) &&
            sdo_step(sdo, self->now_us, &frame) && send_frame(self, &frame)) {
            sdo_sent(sdo, self->now_us);
            axis->is_asking = true;
            most--;
        }
        axis->is_asking = axis->is_asking && sdo->state == SDO_BUSY;
    }
}

/* Command and target of one drive, or of all of its node; the target is actual where no set-point counts. */
static bool send_rpdos(const cia402_t *self, unsigned k)
{
    for (unsigned i = 0; i < CIA402_MAPS_MAX; i++) {
        can_frame_t frame;
        if (cia402_pdo_command(self, k, i, &frame) && !send_frame(self, &frame)) {
            return false;
        }
    }
    return true;
}

static int32_t wrap(int64_t counts)
{
    const uint32_t bits = (uint32_t)(uint64_t)counts;
    return bits <= INT32_MAX ? (int32_t)bits : (int32_t)(bits - INT32_MAX - 1u) + INT32_MIN;
}

/* A set-point that jumps is a fault instead: from actual at first, later from the one before. In PP not every one is sent. */
static guard_limits_t limits_of(const cia402_t *self, unsigned k)
{
    const cia402_axis_t *axis = &self->axis[k];
    const cia402_axis_config_t *own = &self->config->axis[k];
    const bool is_step = cia402_mode(self->config, k) != CIA402_MODE_PP || !axis->has_sent;
    return (guard_limits_t){.from_q32 = axis->has_sent ? axis->sent_q32 : axis->actual_q32,
                            .step_max_q32 = is_step ? own->step_max_q32 : INT64_MAX,
                            .actual_q32 = axis->actual_q32,
                            .window_q32 = own->following_max_q32};
}

static void apply_setpoint(cia402_t *self, unsigned k, q32_t setpoint_q32)
{
    cia402_axis_t *axis = &self->axis[k];
    const guard_limits_t limits = limits_of(self, k);
    drive_guard_t guard = guard_judge(setpoint_q32, &limits);
    int64_t counts = 0;
    if (!drive_guard_is_found(&guard) && counts_from_units(&self->config->axis[k].scale, setpoint_q32, &counts) != HV_OK) {
        guard = guard_out_of_counts(setpoint_q32, &limits);
    }
    if (drive_guard_is_found(&guard)) {
        cia402_axis_fail(cia402_drive(self, k), CIA402_FOLLOWING_ERROR);
        axis->guard = axis->own_fault == CIA402_FOLLOWING_ERROR ? guard : axis->guard;
        return;
    }
    axis->target_counts = wrap(counts);
    axis->sent_q32 = setpoint_q32;
    axis->has_sent = true;
}

/* Targets of the next set. Once a drive holds its position, its target stays until set-points come: a target that followed
 * actual would let it creep under load. */
static void choose_target(cia402_t *self, unsigned k, q32_t setpoint_q32)
{
    cia402_axis_t *axis = &self->axis[k];
    const bool is_holding = axis->is_in && cia402_axis_is_operating(cia402_drive(self, k)) && axis->homing == CIA402_HOMING_NO;
    if (axis->is_in && self->stage == CIA402_STAGE_FOLLOW) {
        if (self->pp_step == 0 || cia402_mode(self->config, k) != CIA402_MODE_PP) {
            apply_setpoint(self, k, setpoint_q32);
        }
    } else if (!is_holding && axis->phase == CIA402_UP) {
        axis->target_counts = axis->actual_counts;
    }
}

/* The handshake of PP: offered when every drive has taken its acknowledgement back, withdrawn when every drive has given it. */
static void step_pp(cia402_t *self)
{
    unsigned acknowledged = 0;
    unsigned drives = 0;
    for (unsigned k = 0; k < self->config->axes; k++) {
        const bool is_such = cia402_mode(self->config, k) == CIA402_MODE_PP;
        drives += is_such;
        acknowledged += is_such && (self->axis[k].statusword & CIA402_STATUS_BIT12) != 0;
    }
    if (drives == 0 || self->stage != CIA402_STAGE_FOLLOW) {
        self->pp_step = 0;
        return;
    }
    if (self->pp_step == 0 && acknowledged == 0) {
        self->pp_step = 1;
    } else if (self->pp_step == 1u && acknowledged == drives) {
        self->pp_step = 2;
    } else if (self->pp_step == 2u && acknowledged == 0) {
        self->pp_step = 0;
    }
}

static hv_status_t send_words(cia402_t *self)
{
    for (unsigned k = 0; k < self->config->axes; k++) {
        if (cia402_axis_is_heard(&self->axis[k]) && !send_rpdos(self, k)) {
            return HV_ERR_AGAIN;
        }
    }
    return HV_OK;
}

static hv_status_t send_set(cia402_t *self, const q32_t setpoint_q32[DRIVES_MAX])
{
    for (unsigned k = 0; k < self->config->axes; k++) {
        choose_target(self, k, setpoint_q32[k]);
    }
    step_pp(self);
    for (unsigned k = 0; k < self->config->axes; k++) {
        cia402_axis_next_word(cia402_drive(self, k), cia402_stage_mode_bits(self, k));
    }
    self->is_open = false;
    return send_words(self);
}

/* --- drives.h --- */

static void step_time(cia402_t *self, uint64_t now_us)
{
    self->now_us = now_us;
    if (!self->has_time) {
        self->has_time = true;
        self->is_preop_due = true;
        self->free_us = now_us;
        self->due_us = now_us;
        for (unsigned k = 0; k < self->config->axes; k++) {
            cia402_axis_init(cia402_drive(self, k));
        }
        cia402_master_begin(self);
    }
    self->is_due |= now_us >= self->due_us;
}

static void work(cia402_t *self)
{
    if (cia402_master_step(self)) {
        return;
    }
    for (unsigned k = 0; k < self->config->axes; k++) {
        cia402_axis_step(cia402_drive(self, k));
    }
    cia402_stage_step(self);
    const bool is_period_begin = self->is_due;
    if (self->is_due && self->is_free) {
        send_sync(self);
    }
    if (!is_period_begin) {
        send_services(self, REQUESTS_MAX);
    } else if (!self->is_due) { /* beside SYNC, where the set follows */
        send_services(self, 1);
    }
}

static hv_status_t cia402_poll(void *ctx, uint64_t now_us, drive_feedback_t feedback[DRIVES_MAX])
{
    cia402_t *self = ctx;
    step_time(self, now_us);
    const bool is_up = receive(self);
    cia402_bus_watch(self, is_up);
    canpassive_step(&self->passive, self->can, now_us, self->config->passive_stop_ms);
    if (self->is_gone) {
        canmaster_deaf(&self->master, now_us);
    } else {
        work(self);
    }
    cia402_visit_step(self);
    for (uint8_t k = 0; k < self->config->axes; k++) {
        cia402_report_feedback(self, k, &feedback[k]);
    }
    return self->is_gone || !is_any_answering(self) ? HV_ERR_IO : HV_OK;
}

static hv_status_t cia402_send(void *ctx, uint64_t now_us, const q32_t setpoint_q32[DRIVES_MAX])
{
    cia402_t *self = ctx;
    (void)now_us; /* that of the poll before */
    if (self->is_gone) {
        return HV_ERR_IO;
    }
    hv_status_t status = self->is_due ? HV_ERR_AGAIN : HV_OK;
    if (self->is_open) {
        status = send_set(self, setpoint_q32);
        self->is_open = self->is_refused = status != HV_OK;
        self->sets += status == HV_OK;
    }
    self->refused += status != HV_OK;
    return is_any_answering(self) ? status : HV_ERR_IO;
}

static bool is_allowed(const cia402_t *self, drives_request_t request)
{
    for (uint8_t k = 0; k < self->config->axes; k++) {
        if (!drives_allow(request, cia402_report_state(self, k))) {
            return false;
        }
    }
    return true;
}

static bool are_all_in(const cia402_t *self)
{
    for (unsigned k = 0; k < self->config->axes; k++) {
        if (!self->axis[k].is_in) {
            return false;
        }
    }
    return true;
}

/* Goes out at once where the period's set has gone already: it acts one SYNC earlier than with the next one. */
static void stop_now(cia402_t *self)
{
    cia402_stage_end(self, CIA402_GOAL_STOP);
    for (unsigned k = 0; k < self->config->axes && !self->is_open; k++) {
        cia402_axis_next_word(cia402_drive(self, k), 0);
    }
    if (!self->is_open) {
        (void)!send_words(self);
    }
}

static hv_status_t cia402_request(void *ctx, drives_request_t request)
{
    cia402_t *self = ctx;
    if (request == DRIVES_RESET_FAULT) {
        cia402_master_wake(self);
    }
    if (self->is_gone || !is_any_answering(self)) {
        return HV_ERR_IO;
    }
    if (!is_allowed(self, request)) {
        return HV_ERR_STATE;
    }
    switch (request) {
    case DRIVES_ENABLE:
        if (self->stage == CIA402_STAGE_OFF || !are_all_in(self)) {
            cia402_stage_begin(self, false);
        }
        break;
    case DRIVES_HOME:
        cia402_stage_begin(self, true);
        break;
    case DRIVES_DISABLE:
        cia402_stage_end(self, CIA402_GOAL_OFF);
        break;
    case DRIVES_QUICK_STOP:
        stop_now(self);
        break;
    case DRIVES_RESET_FAULT:
        for (unsigned k = 0; k < self->config->axes; k++) {
            cia402_axis_reset(cia402_drive(self, k));
        }
        break;
    }
    return HV_OK;
}

static uint8_t cia402_count(void *ctx)
{
    const cia402_t *self = ctx;
    return self->config->axes;
}

static void cia402_report(void *ctx, uint8_t axis, drive_report_t *out)
{
    cia402_report_words(ctx, axis, out);
}

/* 6064h as it was last told. */
static bool cia402_counts(void *ctx, uint8_t axis, int64_t *out)
{
    const cia402_t *self = ctx;
    if (self->axis[axis].has_actual) {
        *out = self->axis[axis].actual_counts;
    }
    return self->axis[axis].has_actual;
}

static bool cia402_is_failing(void *ctx)
{
    const cia402_t *self = ctx;
    return self->passive.is_failing;
}

drives_t cia402_hal(cia402_t *self)
{
    static const drives_ops_t k_ops = {
        .poll = cia402_poll,
        .send = cia402_send,
        .request = cia402_request,
        .count = cia402_count,
        .report = cia402_report,
        .is_failing = cia402_is_failing,
        .counts = cia402_counts,
        .object_begin = cia402_visit_begin,
        .object_end = cia402_visit_end,
    };
    return (drives_t){&k_ops, self};
}

void cia402_leave(cia402_t *self)
{
    for (unsigned k = 0; k < self->config->axes && !self->is_gone && !self->master.is_listening; k++) {
        if (self->config->axis[k].channel == 0 && cia402_node_is_off(cia402_drive(self, k))) {
            (void)!send_nmt(self, NMT_RESET, self->config->axis[k].node);
        }
    }
}
