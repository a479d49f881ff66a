/* SPDX-License-Identifier: MIT
 * player.c - lines of frames through a gateway; see player.h.
 */
#include "record/player.h"

#include <string.h>

#define SETTLE_CYCLES_MAX 100000u     /* to time zero; a few are enough */
#define EXTRA_MAX_US      7200000000u /* after the last line */
#define REST_US           500000u     /* without any change of a set-point, and four periods of the stream */
#define REST_PERIODS      4u

/* --- What the gateway sees --- */

/* The next line of its sort whose time has come; NULL: none. Datagrams and all other lines have an index of their own, because
 * datagrams that did not fit into a cycle must not delay a request. */
static const frames_line_t *pop_due(player_t *self, size_t *next, bool is_datagram)
{
    const uint64_t t_us = self->session.now_us - self->session.zero_us;
    while ((self->session.has_zero || self->is_before_zero) && *next < self->lines && self->line[*next].t_us <= t_us) {
        const frames_line_t *line = &self->line[(*next)++];
        if ((line->kind == FRAMES_DATAGRAM) == is_datagram) {
            return line;
        }
    }
    return NULL;
}

/* The next datagram whose time has come. */
static hv_status_t player_recv(void *ctx, uint8_t *buffer, size_t capacity, size_t *length, hal_udp_peer_t *from)
{
    player_t *self = ctx;
    const frames_line_t *line = pop_due(self, &self->next_datagram, true);
    if (line == NULL) {
        return HV_ERR_AGAIN;
    }
    *length = line->length;
    *from = line->from;
    if (line->length > capacity) {
        return HV_ERR_RANGE;
    }
    memcpy(buffer, line->text, line->length);
    return HV_OK;
}

/* Time since then. */
static hv_status_t player_waited(void *ctx, uint32_t *us)
{
    const player_t *self = ctx;
    const uint64_t t_us = self->session.now_us - self->session.zero_us;
    const size_t taken = self->next_datagram;
    *us = taken > 0 ? (uint32_t)(t_us - self->line[taken - 1].t_us) : 0;
    return HV_OK;
}

hal_udp_t player_udp(player_t *self)
{
    static const hal_udp_ops_t k_udp = {.recv = player_recv, .waited = player_waited};
    return (hal_udp_t){&k_udp, self};
}

/* --- Drives whose feedback is in the lines --- */

static hv_status_t recorded_poll(void *ctx, uint64_t now_us, drive_feedback_t feedback[DRIVES_MAX])
{
    player_t *self = ctx;
    const drives_t behind = sim_drives_hal(self->drives);
    const hv_status_t status = drives_poll(behind, now_us, feedback);
    bool is_any = !self->is_recorded;
    for (unsigned i = 0; self->is_recorded && i < drives_count(behind); i++) {
        feedback[i] = self->recorded_drive[i];
        feedback[i].actual_us =
            now_us - (self->recorded_drive[i].actual_us < now_us ? self->recorded_drive[i].actual_us : now_us);
        is_any = is_any || feedback[i].state != DRIVE_OFFLINE;
    }
    return self->is_recorded ? (is_any ? HV_OK : HV_ERR_IO) : status;
}

static hv_status_t recorded_send(void *ctx, uint64_t now_us, const q32_t setpoint_q32[DRIVES_MAX])
{
    player_t *self = ctx;
    const hv_status_t status = drives_send(sim_drives_hal(self->drives), now_us, setpoint_q32);
    return self->is_recorded ? HV_OK : status;
}

/* Accepts a request as the contract demands for the recorded states of the drives. */
static hv_status_t recorded_request(void *ctx, drives_request_t request)
{
    player_t *self = ctx;
    const drives_t behind = sim_drives_hal(self->drives);
    const hv_status_t status = drives_request(behind, request);
    for (unsigned i = 0; self->is_recorded && i < drives_count(behind); i++) {
        if (!drives_allow(request, self->recorded_drive[i].state)) {
            return HV_ERR_STATE;
        }
    }
    return self->is_recorded ? HV_OK : status;
}

static hv_status_t recorded_request_one(void *ctx, uint8_t axis, drives_request_t request)
{
    player_t *self = ctx;
    const hv_status_t status = drives_request_one(sim_drives_hal(self->drives), axis, request);
    return !self->is_recorded ? status : drives_allow(request, self->recorded_drive[axis].state) ? HV_OK : HV_ERR_STATE;
}

static uint8_t recorded_count(void *ctx)
{
    const player_t *self = ctx;
    return drives_count(sim_drives_hal(self->drives));
}

drives_t player_drives(player_t *self)
{
    static const drives_ops_t k_ops = {
        .poll = recorded_poll,
        .send = recorded_send,
        .request = recorded_request,
        .count = recorded_count,
        .request_one = recorded_request_one,
    };
    return (drives_t){&k_ops, self};
}

/* --- Running --- */

static void log_refused(const player_t *self, const frames_line_t *line, hv_status_t status, const char *what)
{
    if (status != HV_OK && self->refused != NULL) {
        self->refused(self->ctx, line, what);
    }
}

/* Applies an event of a drive. Drives that this platform does not have are ignored. */
static void inject(player_t *self, const frames_line_t *line)
{
    const sim_drives_fault_t fault = {.kind = line->state == DRIVE_FAULT     ? SIM_DRIVES_FAULT
                                              : line->state == DRIVE_OFFLINE ? SIM_DRIVES_OFFLINE
                                                                             : SIM_DRIVES_RECOVER,
                                      .axis = (uint8_t)(line->drive - 1),
                                      .code = line->number};
    sim_drives_inject(self->drives, &fault);
}

static void serve(player_t *self, const frames_line_t *line)
{
    const service_answer_t answer = gateway_service(&self->session.gateway, &line->service, self->session.now_us);
    log_refused(self, line, answer == SERVICE_DONE ? HV_OK : HV_ERR_STATE, service_verb_name(line->service.verb));
}

static void carry_out(player_t *self, const frames_line_t *line)
{
    gateway_t *gateway = &self->session.gateway;
    switch (line->kind) {
    case FRAMES_REQUEST:
        log_refused(self, line, gateway_request(gateway, line->request, self->session.now_us), event_name(line->request));
        break;
    case FRAMES_INTENSITY:
        log_refused(self, line, gateway_set_intensity(gateway, line->number), "intensity beyond [motion] intensity_max_percent");
        break;
    case FRAMES_RISE:
        log_refused(self, line, gateway_set_rise_percent(gateway, line->number), "a percentage that is not 1 to 100");
        break;
    case FRAMES_SERVICE:
        serve(self, line);
        break;
    case FRAMES_ESTOP:
        sim_inputs_set(self->inputs, INPUT_ESTOP, line->number != 0);
        break;
    case FRAMES_LATE:
        gateway_note_late(gateway, line->number);
        break;
    case FRAMES_DRIVE:
        inject(self, line);
        break;
    case FRAMES_FAULT:
        gateway_inject_fault(gateway, line->fault, line->drive);
        break;
    case FRAMES_FEEDBACK:
        self->is_recorded = true;
        self->recorded_drive[line->drive - 1] = line->feedback;
        break;
    case FRAMES_END:
        self->is_ended = true;
        break;
    case FRAMES_DATAGRAM:
    case FRAMES_FROM:
    case FRAMES_STATE:
        break;
    }
}

/* Everything but datagrams that is due before the coming cycle. */
static void carry_out_due(player_t *self)
{
    for (;;) {
        const frames_line_t *line = pop_due(self, &self->next_request, false);
        if (line == NULL) {
            return;
        }
        carry_out(self, line);
    }
}

static bool is_state_at_rest(const snapshot_t *s)
{
    switch (s->state) {
    case STATE_HOMING:
    case STATE_RISING:
    case STATE_SETTLING:
        return false;
    case STATE_SETTLED:
    case STATE_NEUTRAL:
        return s->goal == s->state; /* otherwise the next cycle moves it on */
    case STATE_OFF:
    case STATE_ENGAGED:
    case STATE_HOLD:
    case STATE_SERVICE:
    case STATE_FAULT:
    case STATE_ESTOP:
    case STATES:
        break;
    }
    return true;
}

/* Whether a set-point has changed. The pose is not compared: it is calculated from the set-points, and its last bits may
 * alternate. */
static bool has_moved(const trace_row_t *before, const trace_row_t *row)
{
    const size_t first = AXIS_ANGLE;
    return memcmp(&before->value_q32[first], &row->value_q32[first], sizeof row->value_q32 - first * sizeof row->value_q32[0]) !=
           0;
}

/* Keeps track of how long nothing has moved. */
static void watch_rest(player_t *self, const trace_row_t *before)
{
    if (!is_state_at_rest(gateway_snapshot(&self->session.gateway)) || has_moved(before, &self->row)) {
        self->still_since_us = self->row.t_us;
    }
}

uint64_t player_span_us(const player_t *self)
{
    const frames_line_t *last = &self->line[self->lines - 1];
    const uint64_t first_us = self->line[0].t_us; /* of all sorts; a datagram at the end of the file may be before it */
    return (last->t_us > first_us ? last->t_us - first_us : 0) + (last->kind == FRAMES_END ? 0 : EXTRA_MAX_US);
}

static uint64_t last_line_us(const player_t *self)
{
    return self->lines > 0 ? self->line[self->lines - 1].t_us : 0;
}

bool player_is_at_rest(const player_t *self)
{
    const snapshot_t *s = gateway_snapshot(&self->session.gateway);
    const uint64_t last_us = last_line_us(self);
    const uint64_t since_us = self->still_since_us > last_us ? self->still_since_us : last_us;
    const bool is_read = self->next_datagram == self->lines && self->next_request == self->lines;
    return self->is_ended || (is_read && self->row.t_us >= since_us + REST_US + (uint64_t)REST_PERIODS * s->stream_period_us);
}

bool player_is_endless(const player_t *self)
{
    return self->row.t_us > last_line_us(self) + EXTRA_MAX_US;
}

/* Brings the platform up to SETTLED. The auto policy acts only afterwards, so a request brings up a platform that waits for
 * frames. */
bool player_settle(player_t *self, const settings_t *settings)
{
    const bool is_asked = settings->engage == ENGAGE_MANUAL || settings->auto_frames > 0;
    if (is_asked && gateway_request(&self->session.gateway, EVENT_PARK, self->session.now_us) != HV_OK) {
        return false;
    }
    for (unsigned i = 0; i < SETTLE_CYCLES_MAX; i++) {
        if (session_cycle(&self->session)) {
            if (is_asked) {
                gateway_restart_auto(&self->session.gateway);
            }
            return true;
        }
    }
    return false;
}

void player_resume(player_t *self, const session_t *saved)
{
    q32_t setpoint_q32[DRIVES_MAX] = {0};
    session_resume(&self->session, saved);
    self->is_before_zero = !saved->has_zero;
    const snapshot_t *snapshot = gateway_snapshot(&self->session.gateway);
    for (unsigned i = 0; i < snapshot->cylinders; i++) {
        setpoint_q32[i] = snapshot->extension_mm_q32[i];
    }
    setpoint_q32[snapshot->cylinders] = snapshot->angle_deg_q32;
    sim_drives_place(self->drives, snapshot->now_us, snapshot->drive, setpoint_q32);
    sim_inputs_set(self->inputs, INPUT_ESTOP, snapshot->is_estop_active);
}

void player_begin(player_t *self)
{
    session_row(&self->session, &self->row);
    self->still_since_us = self->row.t_us;
}

void player_cycle(player_t *self)
{
    const trace_row_t before = self->row;
    carry_out_due(self);
    (void)session_cycle(&self->session);
    session_row(&self->session, &self->row);
    watch_rest(self, &before);
}
