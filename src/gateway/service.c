/* SPDX-License-Identifier: MIT
 * service.c - the state SERVICE in deeds; see service.h.
 * A drive is up once it is enabled after somebody wanted its torque; from then on it is watched as in any other state. Whatever
 * is not up is led by nobody: its set-point is where it is.
 */
#include "service.h"

#define UP_TIMEOUT_US   10000000u
#define HOME_TIMEOUT_US 120000000u

static uint32_t all_of(const cycle_t *cycle)
{
    return (1u << cycle->feedback.count) - 1u;
}

static bool has_one_by_one(const cycle_t *cycle)
{
    return cycle->drives.ops->request_one != NULL;
}

static unsigned motion_axis(const cycle_t *cycle, unsigned i)
{
    return i < cycle->cylinders ? i : (unsigned)AXIS_ANGLE;
}

/* A hand's time: that of the gateway, and the cycles that were skipped. */
static uint64_t hand_us(const service_t *self, const cycle_t *cycle)
{
    return cycle->now_us + self->late_us;
}

uint32_t service_up(const service_t *self)
{
    return self->up & ~self->homing;
}

void service_begin(service_t *self, const cycle_t *cycle, bool has_torque)
{
    const uint32_t axes = has_torque ? all_of(cycle) : 0;
    self->doing = SERVICE_NOTHING;
    self->wanted = axes;
    self->up = axes;
    self->homing = 0;
    self->off_due = 0;
    self->stop_due = 0;
    deadman_release(&self->hand);
    motion_serve(cycle->motion);
}

/* --- Letting go --- */

static hv_status_t ask(const cycle_t *cycle, unsigned i, drives_request_t request)
{
    return drives_request_one(cycle->drives, (uint8_t)i, request);
}

/* Drives that look for their zero move by themselves: they are stopped, and have no torque then. */
static void stop_homing(service_t *self)
{
    self->stop_due |= self->homing;
    self->wanted &= ~self->homing;
    self->up &= ~self->homing;
    self->homing = 0;
}

static bool is_signal(service_verb_t verb)
{
    return verb == SERVICE_SIGNAL_AXIS || verb == SERVICE_SIGNAL_POSE;
}

static bool moves_by_hand(service_verb_t verb)
{
    return verb == SERVICE_JOG_AXIS || verb == SERVICE_JOG_POSE || is_signal(verb);
}

void service_let_go(service_t *self, motion_t *motion)
{
    deadman_release(&self->hand);
    if (moves_by_hand(self->doing)) {
        motion_stop(motion);
    } else if (self->doing == SERVICE_HOME) {
        stop_homing(self);
    }
    self->doing = SERVICE_NOTHING;
}

/* --- The cycle --- */

/* Asks drives, together where it is all of them, since a bus may know it no other way.
 * Returns those that the bus has not taken it for. */
static uint32_t ask_due(const cycle_t *cycle, uint32_t due, drives_request_t request)
{
    if (due == all_of(cycle)) {
        return drives_request(cycle->drives, request) == HV_ERR_AGAIN ? due : 0;
    }
    for (unsigned i = 0; i < cycle->feedback.count; i++) {
        if ((due >> i & 1u) != 0 && ask(cycle, i, request) != HV_ERR_AGAIN) {
            due &= ~(1u << i);
        }
    }
    return due;
}

/* Where the bus knows all drives together only, none is stopped alone: all of them are, and none has torque then. */
static void step_stop(service_t *self, const cycle_t *cycle)
{
    if (self->stop_due != 0 && !has_one_by_one(cycle)) {
        self->stop_due = all_of(cycle);
        self->wanted = 0;
        self->up = 0;
    }
    self->stop_due = ask_due(cycle, self->stop_due, DRIVES_QUICK_STOP);
}

/* The axis is where its drive is. */
static void place(const cycle_t *cycle, unsigned i)
{
    motion_place_axis(cycle->motion, motion_axis(cycle, i), cycle->feedback.drive[i].actual_mm_q32);
}

/* Asks a drive that is to come up, or notes that it has.
 * Returns false where it takes too long. */
static bool step_up(service_t *self, const cycle_t *cycle, unsigned i)
{
    const drive_state_t state = cycle->feedback.drive[i].state;
    if (state == DRIVE_ENABLED && cycle->feedback.drive[i].has_actual) {
        self->up |= 1u << i;
        place(cycle, i);
    } else if (state == DRIVE_DISABLED) { /* what is to be switched off, or stopped, is not wanted */
        (void)!ask(cycle, i, DRIVES_ENABLE);
    }
    return cycle->now_us < self->deadline_us[i];
}

/* Returns false where it takes too long. */
static bool step_home(service_t *self, const cycle_t *cycle, unsigned i)
{
    const drive_feedback_t *drive = &cycle->feedback.drive[i];
    if (drive->state == DRIVE_ENABLED && drive->is_homed) {
        self->homing &= ~(1u << i);
        place(cycle, i); /* on its new zero */
    }
    return cycle->now_us < self->deadline_us[i];
}

/* What has no torque, or moves by itself, is where it is. */
static void place_loose(service_t *self, const cycle_t *cycle)
{
    const uint32_t loose = ~self->up | self->homing;
    for (unsigned i = 0; i < cycle->feedback.count; i++) {
        if ((loose >> i & 1u) != 0 && cycle->feedback.drive[i].has_actual) {
            place(cycle, i);
        }
    }
}

/* Drives on their way to their zero, or up. Returns false where one takes too long. */
static bool step_drives(service_t *self, const cycle_t *cycle)
{
    bool is_in_time = true;
    for (unsigned i = 0; i < cycle->feedback.count; i++) {
        if ((self->homing >> i & 1u) != 0) {
            is_in_time = step_home(self, cycle, i) && is_in_time;
        } else if (((self->wanted & ~self->up) >> i & 1u) != 0) {
            is_in_time = step_up(self, cycle, i) && is_in_time;
        }
    }
    return is_in_time;
}

/* What the hand holds has come to its own end. */
static bool has_finished(const service_t *self, const cycle_t *cycle)
{
    return (self->doing == SERVICE_HOME && self->homing == 0) ||
           (self->has_end && moves_by_hand(self->doing) && motion_is_done(cycle->motion));
}

fault_code_t service_step(service_t *self, const cycle_t *cycle)
{
    if (self->doing != SERVICE_NOTHING && !deadman_step(&self->hand, hand_us(self, cycle))) {
        service_let_go(self, cycle->motion);
    }
    step_stop(self, cycle);
    if (self->off_due != 0 && motion_is_at_rest(cycle->motion)) {
        self->up &= ~self->off_due;
        self->off_due = ask_due(cycle, self->off_due, DRIVES_DISABLE);
    }
    const bool is_in_time = step_drives(self, cycle);
    place_loose(self, cycle);
    if (moves_by_hand(self->doing) && motion_is_stopping(cycle->motion)) {
        service_let_go(self, cycle->motion); /* motion stopped it before a singularity or an end: that is no end of its own */
    }
    if (has_finished(self, cycle)) {
        self->doing = SERVICE_NOTHING;
        self->finished = self->hand.series;
        deadman_release(&self->hand);
    }
    return is_in_time ? FAULT_NONE : FAULT_DRIVE_TIMEOUT;
}

uint16_t service_relays(const service_t *self, uint16_t safe_mask)
{
    return self->doing == SERVICE_RELAY ? (uint16_t)(safe_mask ^ 1u << (self->axis - 1u)) : safe_mask;
}

void service_publish(const service_t *self, const cycle_t *cycle, service_view_t *view)
{
    view->tick_us = hand_us(self, cycle);
    view->doing = self->doing;
    view->axis = self->axis;
    view->is_held = self->hand.is_held;
    view->series = self->hand.series;
    view->finished = self->finished;
    view->torque = self->up;
    view->homing = self->homing;
    view->has_counts = 0;
    for (unsigned i = 0; i < cycle->feedback.count; i++) {
        if (drives_counts(cycle->drives, (uint8_t)i, &view->counts[i])) {
            view->has_counts |= 1u << i;
        }
    }
}

/* --- Requests --- */

/* The drives that a request names; 0: no such drive. */
static uint32_t named(const cycle_t *cycle, uint8_t axis)
{
    return axis == SERVICE_ALL ? all_of(cycle) : axis <= cycle->feedback.count ? 1u << (axis - 1u) : 0;
}

/* Of what is begun, and of nothing that is on its way already. */
static void set_deadlines(service_t *self, const cycle_t *cycle, uint32_t axes, uint64_t after_us)
{
    for (unsigned i = 0; i < cycle->feedback.count; i++) {
        self->deadline_us[i] = (axes >> i & 1u) != 0 ? cycle->now_us + after_us : self->deadline_us[i];
    }
}

static service_answer_t switch_torque(service_t *self, const cycle_t *cycle, uint32_t axes, bool is_on)
{
    if (axes == 0) {
        return SERVICE_NO_SUCH;
    }
    if (axes != all_of(cycle) && !has_one_by_one(cycle)) {
        return SERVICE_TOGETHER;
    }
    if (!is_on) { /* never refused: what moves stops first */
        if (self->doing != SERVICE_NOTHING && self->doing != SERVICE_RELAY) {
            service_let_go(self, cycle->motion);
        }
        self->wanted &= ~axes;
        self->off_due |= axes;
        return SERVICE_DONE;
    }
    if (self->doing != SERVICE_NOTHING || !motion_is_at_rest(cycle->motion) || (self->stop_due & axes) != 0) {
        return SERVICE_BUSY;
    }
    set_deadlines(self, cycle, axes, UP_TIMEOUT_US);
    if (!has_one_by_one(cycle) && drives_request(cycle->drives, DRIVES_ENABLE) != HV_OK) {
        return SERVICE_NOT_TAKEN;
    }
    self->off_due &= ~axes;
    self->wanted |= axes;
    return SERVICE_DONE;
}

/* Drives that are up and at rest, where they have to move. */
static bool are_up(const service_t *self, uint32_t axes)
{
    return (self->up & ~self->homing & ~self->off_due & axes) == axes;
}

/* Of a jog. */
static service_answer_t answer_of(hv_status_t status)
{
    return status == HV_OK           ? SERVICE_DONE
           : status == HV_ERR_RANGE  ? SERVICE_AT_END
           : status == HV_ERR_NOSUP  ? SERVICE_NO_SUCH
           : status == HV_ERR_ARG    ? SERVICE_NO_POSE
           : status == HV_ERR_FORMAT ? SERVICE_TOO_WIDE
                                     : SERVICE_BUSY;
}

static bool are_homed(const cycle_t *cycle, uint32_t axes)
{
    for (unsigned i = 0; i < cycle->feedback.count; i++) {
        if ((axes >> i & 1u) != 0 && !cycle->feedback.drive[i].is_homed) {
            return false;
        }
    }
    return true;
}

static service_answer_t jog_axis(service_t *self, const cycle_t *cycle, const service_request_t *request)
{
    const uint32_t axes = request->axis != SERVICE_ALL ? named(cycle, request->axis) : 0;
    if (axes == 0) {
        return SERVICE_NO_SUCH;
    }
    if (!are_up(self, axes)) {
        return SERVICE_NO_TORQUE;
    }
    return answer_of(
        motion_jog_axis(cycle->motion, motion_axis(cycle, request->axis - 1u), request->speed_q16, request->way_q16));
}

static service_answer_t jog_pose(service_t *self, const cycle_t *cycle, const service_request_t *request)
{
    const unsigned cylinders = cycle->cylinders;
    if (request->axis < 1 || request->axis > POSE_AXES) {
        return SERVICE_NO_SUCH;
    }
    if (!are_up(self, (1u << cylinders) - 1u)) {
        return SERVICE_NO_TORQUE;
    }
    if (!are_homed(cycle, (1u << cylinders) - 1u)) {
        return SERVICE_NOT_HOMED;
    }
    return answer_of(motion_jog_pose(cycle->motion, request->axis - 1u, request->speed_q16, request->way_q16));
}

/* A signal goes by where things are, so its drives have found their zero. */
static service_answer_t excite(service_t *self, const cycle_t *cycle, const service_request_t *request)
{
    const bool is_posed = request->verb == SERVICE_SIGNAL_POSE;
    const uint32_t axes = is_posed                       ? (1u << cycle->cylinders) - 1u
                          : request->axis != SERVICE_ALL ? named(cycle, request->axis)
                                                         : 0;
    if (axes == 0 || (is_posed && (request->axis < 1 || request->axis > POSE_AXES))) {
        return SERVICE_NO_SUCH;
    }
    if (!excitation_is_allowed(&request->signal, cycle->settings->cycle_us)) {
        return SERVICE_BAD_SIGNAL;
    }
    if (!are_up(self, axes)) {
        return SERVICE_NO_TORQUE;
    }
    if (!are_homed(cycle, axes)) {
        return SERVICE_NOT_HOMED;
    }
    return answer_of(is_posed ? motion_excite_pose(cycle->motion, request->axis - 1u, &request->signal)
                              : motion_excite_axis(cycle->motion, motion_axis(cycle, request->axis - 1u), &request->signal));
}

static service_answer_t home(service_t *self, const cycle_t *cycle, const service_request_t *request)
{
    const uint32_t axes = named(cycle, request->axis);
    if (axes == 0) {
        return SERVICE_NO_SUCH;
    }
    if (!are_up(self, axes)) {
        return SERVICE_NO_TORQUE;
    }
    if (axes != all_of(cycle) && !has_one_by_one(cycle)) {
        return SERVICE_TOGETHER;
    }
    const hv_status_t status =
        axes == all_of(cycle) ? drives_request(cycle->drives, DRIVES_HOME) : ask(cycle, request->axis - 1u, DRIVES_HOME);
    if (status != HV_OK) {
        return SERVICE_NOT_TAKEN;
    }
    self->homing = axes;
    set_deadlines(self, cycle, axes, HOME_TIMEOUT_US);
    return SERVICE_DONE;
}

static service_answer_t judge_relay(const cycle_t *cycle, uint8_t relay)
{
    return relay < 1 || relay > cycle->settings->relays.count ? SERVICE_NO_SUCH
           : relay == cycle->settings->healthy.relay          ? SERVICE_PULSE
                                                              : SERVICE_DONE;
}

/* One of the requests that are held. */
static service_answer_t start(service_t *self, const cycle_t *cycle, const service_request_t *request)
{
    if (request->verb == SERVICE_JOG_AXIS) {
        return jog_axis(self, cycle, request);
    }
    if (request->verb == SERVICE_JOG_POSE) {
        return jog_pose(self, cycle, request);
    }
    if (request->verb == SERVICE_HOME) {
        return home(self, cycle, request);
    }
    return request->verb == SERVICE_RELAY ? judge_relay(cycle, request->axis) : excite(self, cycle, request);
}

static service_answer_t answer_of_hand(deadman_answer_t answer)
{
    static const service_answer_t k_answers[] = {[DEADMAN_TAKEN] = SERVICE_DONE,
                                                 [DEADMAN_STALE] = SERVICE_STALE,
                                                 [DEADMAN_OVER] = SERVICE_OVER,
                                                 [DEADMAN_KNOWN] = SERVICE_KNOWN};
    return k_answers[answer];
}

/* The proof first: what is stale must not even begin. */
static service_answer_t hold(service_t *self, const cycle_t *cycle, const service_request_t *request)
{
    deadman_t hand = self->hand;
    const deadman_answer_t pressed = deadman_press(&hand, request->series, request->age_us, hand_us(self, cycle));
    if (pressed != DEADMAN_TAKEN) {
        return answer_of_hand(pressed);
    }
    if (self->doing != SERVICE_NOTHING) {
        return SERVICE_BUSY;
    }
    const service_answer_t answer = start(self, cycle, request);
    if (answer == SERVICE_DONE) {
        self->hand = hand;
        self->doing = request->verb;
        self->has_end = is_signal(request->verb) || request->way_q16 > 0;
        self->axis = request->axis;
    }
    return answer;
}

/* A release of what is over is done already. */
static service_answer_t release(service_t *self, motion_t *motion, uint32_t series)
{
    if (self->hand.is_held && self->hand.series == series) {
        service_let_go(self, motion);
    }
    return SERVICE_DONE;
}

service_answer_t service_request(service_t *self, const cycle_t *cycle, const service_request_t *request)
{
    switch (request->verb) {
    case SERVICE_JOG_AXIS:
    case SERVICE_JOG_POSE:
    case SERVICE_HOME:
    case SERVICE_RELAY:
    case SERVICE_SIGNAL_AXIS:
    case SERVICE_SIGNAL_POSE:
        return hold(self, cycle, request);
    case SERVICE_TORQUE_ON:
    case SERVICE_TORQUE_OFF:
        return switch_torque(self, cycle, named(cycle, request->axis), request->verb == SERVICE_TORQUE_ON);
    case SERVICE_BEAT:
        return answer_of_hand(
            deadman_beat(&self->hand, request->series, request->counter, request->age_us, hand_us(self, cycle)));
    case SERVICE_RELEASE:
        return release(self, cycle->motion, request->series);
    case SERVICE_NOTHING:
        break;
    }
    return SERVICE_NO_SUCH;
}
