/* SPDX-License-Identifier: MIT
 * cia402.c - CANopen drives behind drives.h: the bus, SYNC, heartbeat, set-points, requests; see cia402.h.
 */
#include "heave/cia402.h"
#include "heave/guard.h"

#include "cia402_report.h"
#include "cia402_stage.h"

#define STALLED_PERIODS  3u
#define RESTART_US       500000u /* between attempts to restart the bus */
#define SILENCE_LEAST_US 500000u
#define FRAMES_PER_POLL  128u
#define NODE_MAX         127u
#define COB_NMT          0x000u
#define COB_SYNC         0x080u /* and emergencies */
#define COB_TPDO         0x180u
#define COB_RPDO         0x200u
#define COB_SDO_ANSWER   0x580u
#define COB_SDO_REQUEST  0x600u
#define COB_HEARTBEAT    0x700u
#define COB_FUNCTION     0x780u
#define NMT_PREOP        0x80u
#define NMT_RESET        0x82u
#define NMT_OPERATIONAL  0x05u
#define COUNTER_FIRST    1u

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

static void lose_all(cia402_t *self)
{
    for (unsigned k = 0; k < self->config->axes; k++) {
        cia402_axis_lose(cia402_drive(self, k), CIA402_LOST_BUS);
    }
}

/* --- In --- */

static void take_for(cia402_t *self, unsigned k, const can_frame_t *frame)
{
    const cia402_drive_t drive = cia402_drive(self, k);
    switch (frame->id & COB_FUNCTION) {
    case COB_SYNC:
        self->emergencies++;
        cia402_axis_take_emergency(drive, frame);
        break;
    case COB_TPDO:
        cia402_axis_take_tpdo(drive, frame);
        break;
    case COB_SDO_ANSWER:
        sdo_receive(&drive.axis->sdo, frame);
        break;
    case COB_HEARTBEAT:
        cia402_axis_take_heartbeat(drive, frame);
        break;
    default: /* no enum: whatever else is on the bus */
        break;
    }
}

static void take_frame(cia402_t *self, const can_frame_t *frame)
{
    for (unsigned k = 0; k < self->config->axes; k++) {
        if ((frame->id & NODE_MAX) == self->config->axis[k].node && !frame->is_extended && !frame->is_rtr) {
            take_for(self, k, frame);
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
            take_frame(self, &frame);
        } else if ((frame.id & CAN_ERROR_RESTARTED) != 0) {
            lose_all(self);
        }
    }
    return true;
}

/* --- The bus --- */

static bool is_controller_up(const cia402_t *self)
{
    hal_can_state_t state = HAL_CAN_DOWN;
    return hal_can_bus_state(self->can, &state) == HV_OK && state != HAL_CAN_BUS_OFF && state != HAL_CAN_DOWN &&
           state != HAL_CAN_GONE;
}

/* The drives' watch over our heartbeat runs out before we are heard again. */
static uint64_t silence_us(const cia402_t *self)
{
    const uint64_t watch_us = self->config->heartbeat_timeout_ms * (uint64_t)1500u;
    return watch_us > SILENCE_LEAST_US ? watch_us : SILENCE_LEAST_US;
}

static void come_back(cia402_t *self)
{
    self->is_gone = false;
    self->is_refused = false;
    self->is_preop_due = true;
    self->free_us = self->now_us;
    self->due_us = self->now_us;
    self->is_due = true;
    self->restarts++;
}

static void try_restart(cia402_t *self, bool is_bad)
{
    if (self->now_us - self->gone_us < silence_us(self) || self->now_us - self->restart_us < RESTART_US) {
        return;
    }
    self->restart_us = self->now_us;
    const hv_status_t status = hal_can_restart(self->can);
    if (status == HV_OK || (status == HV_ERR_NOSUP && !is_bad)) {
        come_back(self);
    }
}

/* Whether the bus works: up, and not long ago there was room and what was sent has been seen on the wire. */
static void watch_bus(cia402_t *self, bool is_up)
{
    uint32_t waiting = 0;
    self->is_free = hal_can_unconfirmed(self->can, &waiting) != HV_OK || waiting == 0;
    self->free_us = self->is_free && !self->is_refused ? self->now_us : self->free_us;
    const bool is_stalled = self->now_us - self->free_us >= (uint64_t)STALLED_PERIODS * self->config->period_us;
    const bool is_bad = !is_up || is_stalled || !is_controller_up(self);
    if (is_bad && !self->is_gone) {
        self->is_gone = true;
        self->gone_us = self->now_us;
        cia402_stage_end(self, CIA402_GOAL_OFF);
        lose_all(self);
    }
    if (self->is_gone) {
        try_restart(self, is_bad);
    }
}

/* --- Out --- */

static bool send_frame(const cia402_t *self, const can_frame_t *frame)
{
    return hal_can_send(self->can, frame) == HV_OK;
}

static bool send_nmt(const cia402_t *self, uint8_t command, uint8_t node)
{
    return send_frame(self, &(can_frame_t){.id = COB_NMT, .length = 2, .data = {command, node}});
}

/* SYNC of a period that has begun. */
static void send_sync(cia402_t *self)
{
    can_frame_t frame = {.id = COB_SYNC};
    if (self->config->sync_counter != 0) {
        frame.length = 1;
        frame.data[0] = self->sync_count;
    }
    self->is_refused = !send_frame(self, &frame);
    if (self->is_refused) {
        return;
    }
    self->sync_count = self->sync_count < self->config->sync_counter ? (uint8_t)(self->sync_count + 1u) : COUNTER_FIRST;
    self->is_due = false;
    self->is_open = true;
    self->syncs++;
    self->stage_syncs++;
    const bool is_late = self->now_us >= self->due_us + self->config->period_us;
    self->due_us = (is_late ? self->now_us : self->due_us) + self->config->period_us;
    for (unsigned k = 0; k < self->config->axes; k++) {
        cia402_axis_note_sync(&self->axis[k]);
    }
}

static void send_heartbeat(cia402_t *self)
{
    const can_frame_t frame = {.id = COB_HEARTBEAT + self->config->master_node, .length = 1, .data = {NMT_OPERATIONAL}};
    if (self->now_us - self->heartbeat_us >= self->config->heartbeat_ms * (uint64_t)1000u && send_frame(self, &frame)) {
        self->heartbeat_us = self->now_us;
    }
}

/* What has time. */
static void send_services(cia402_t *self)
{
    send_heartbeat(self);
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
        if (axis->nmt_command == 0 && sdo_step(&axis->sdo, self->now_us, &frame) && send_frame(self, &frame)) {
            sdo_sent(&axis->sdo, self->now_us);
        }
    }
}

/* Command and target of one drive; the target is actual where no set-point counts. */
static bool send_rpdo(cia402_t *self, unsigned k)
{
    const cia402_axis_t *axis = &self->axis[k];
    const uint32_t target = (uint32_t)axis->target_counts;
    const can_frame_t frame = {.id = (uint32_t)COB_RPDO + self->config->axis[k].node,
                               .length = CIA402_RPDO_BYTES,
                               .data = {(uint8_t)axis->word, (uint8_t)(axis->word >> 8), (uint8_t)target, (uint8_t)(target >> 8),
                                        (uint8_t)(target >> 16), (uint8_t)(target >> 24)}};
    return send_frame(self, &frame);
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
    const bool is_step = self->config->mode != CIA402_MODE_PP || !axis->has_sent;
    return (guard_limits_t){.from_q32 = axis->has_sent ? axis->sent_q32 : axis->actual_q32,
                            .step_max_q32 = is_step ? own->step_max_q32 : INT64_MAX,
                            .actual_q32 = axis->actual_q32,
                            .window_q32 = own->following_max_q32};
}

static void take_setpoint(cia402_t *self, unsigned k, q32_t setpoint_q32)
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
        if (self->pp_step == 0) {
            take_setpoint(self, k, setpoint_q32);
        }
    } else if (!is_holding && axis->phase == CIA402_UP) {
        axis->target_counts = axis->actual_counts;
    }
}

/* The handshake of PP: offered when every drive has taken its acknowledgement back, withdrawn when every drive has given it. */
static void step_pp(cia402_t *self)
{
    unsigned acknowledged = 0;
    if (self->config->mode != CIA402_MODE_PP || self->stage != CIA402_STAGE_FOLLOW) {
        self->pp_step = 0;
        return;
    }
    for (unsigned k = 0; k < self->config->axes; k++) {
        acknowledged += (self->axis[k].statusword & CIA402_STATUS_BIT12) != 0;
    }
    if (self->pp_step == 0 && acknowledged == 0) {
        self->pp_step = 1;
    } else if (self->pp_step == 1u && acknowledged == self->config->axes) {
        self->pp_step = 2;
    } else if (self->pp_step == 2u && acknowledged == 0) {
        self->pp_step = 0;
    }
}

static hv_status_t send_words(cia402_t *self)
{
    for (unsigned k = 0; k < self->config->axes; k++) {
        if (cia402_axis_is_heard(&self->axis[k]) && !send_rpdo(self, k)) {
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

static void take_time(cia402_t *self, uint64_t now_us)
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
    }
    self->is_due |= now_us >= self->due_us;
}

static void work(cia402_t *self)
{
    for (unsigned k = 0; k < self->config->axes; k++) {
        cia402_axis_step(cia402_drive(self, k));
    }
    cia402_stage_step(self);
    const bool is_period_begin = self->is_due;
    if (self->is_due && self->is_free) {
        send_sync(self);
    }
    if (!is_period_begin || self->was_period_begin) {
        send_services(self);
    }
    self->was_period_begin = is_period_begin;
}

static hv_status_t cia402_poll(void *ctx, uint64_t now_us, drive_feedback_t feedback[DRIVES_MAX])
{
    cia402_t *self = ctx;
    take_time(self, now_us);
    const bool is_up = receive(self);
    watch_bus(self, is_up);
    canpassive_step(&self->passive, self->can, now_us, self->config->passive_stop_ms);
    if (!self->is_gone) {
        work(self);
    }
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
    static const drives_ops_t k_ops = {cia402_poll,   cia402_send,       cia402_request, cia402_count,
                                       cia402_report, cia402_is_failing, NULL,           cia402_counts};
    return (drives_t){&k_ops, self};
}

void cia402_leave(cia402_t *self)
{
    for (unsigned k = 0; k < self->config->axes && !self->is_gone; k++) {
        const cia402_axis_t *axis = &self->axis[k];
        if (axis->phase == CIA402_UP && !cia402_has_torque(cia402_axis_state(axis))) {
            (void)!send_nmt(self, NMT_RESET, self->config->axis[k].node);
        }
    }
}

/* --- Configuration --- */

static bool is_node_free(const cia402_config_t *config, unsigned k)
{
    const uint8_t node = config->axis[k].node;
    for (unsigned i = 0; i < k; i++) {
        if (config->axis[i].node == node) {
            return false;
        }
    }
    return node >= 1 && node <= NODE_MAX && node != config->master_node;
}

static bool is_config_valid(const cia402_config_t *config)
{
    const bool is_mode = config->mode == CIA402_MODE_CSP || config->mode == CIA402_MODE_IP || config->mode == CIA402_MODE_PP;
    const bool is_counter = config->sync_counter == 0 || (config->sync_counter >= 2 && config->sync_counter <= 240);
    if (config->axes < 1 || config->axes > DRIVES_MAX || config->master_node < 1 || config->master_node > NODE_MAX || !is_mode ||
        !is_counter || !cia402_is_period(config->period_us) || config->heartbeat_ms == 0 ||
        config->heartbeat_timeout_ms <= config->heartbeat_ms || config->sdo_timeout_ms == 0) {
        return false;
    }
    for (unsigned k = 0; k < config->axes; k++) {
        const cia402_axis_config_t *axis = &config->axis[k];
        if (!is_node_free(config, k) || !counts_is_valid(&axis->scale) || axis->step_max_q32 <= 0 ||
            axis->following_max_q32 < 0 || axis->items > CIA402_ITEMS_MAX || (axis->items > 0 && axis->item == NULL)) {
            return false;
        }
    }
    return true;
}

hv_status_t cia402_init(cia402_t *self, const cia402_config_t *config, hal_can_t can)
{
    if (!hal_can_valid(can)) {
        return HV_ERR_ARG;
    }
    if (!is_config_valid(config)) {
        return HV_ERR_RANGE;
    }
    *self = (cia402_t){.config = config, .can = can, .sync_count = COUNTER_FIRST};
    return HV_OK;
}

static uint32_t put_filter(hal_can_filter_t *filter, uint32_t id)
{
    *filter = (hal_can_filter_t){.id = id, .mask = CAN_ID_MAX};
    return 1;
}

uint32_t cia402_filters(const cia402_config_t *config, hal_can_filter_t filter[CIA402_FILTERS_MAX])
{
    static const uint32_t k_functions[] = {COB_SYNC, COB_TPDO, COB_SDO_ANSWER, COB_HEARTBEAT};
    uint32_t count = 0;
    for (unsigned k = 0; k < config->axes; k++) {
        for (size_t i = 0; i < sizeof k_functions / sizeof k_functions[0]; i++) {
            count += put_filter(&filter[count], k_functions[i] + config->axis[k].node);
        }
    }
    return count;
}

uint32_t cia402_owns(const cia402_config_t *config, hal_can_filter_t filter[CIA402_OWNS_MAX])
{
    uint32_t count = 0;
    count += put_filter(&filter[count], COB_NMT);
    count += put_filter(&filter[count], COB_SYNC);
    count += put_filter(&filter[count], COB_HEARTBEAT + config->master_node);
    for (unsigned k = 0; k < config->axes; k++) {
        count += put_filter(&filter[count], COB_RPDO + config->axis[k].node);
        count += put_filter(&filter[count], COB_SDO_REQUEST + config->axis[k].node);
    }
    return count;
}
