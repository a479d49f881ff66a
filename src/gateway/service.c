/* SPDX-License-Identifier: MIT
 * service.c - the state SERVICE in deeds; see service.h.
 * A drive is up once it is enabled after somebody wanted its torque; from then on it is watched as in any other state. Whatever
 * is not up is led by nobody: its set-point is where it is.
 */
#include "service.h"

#include "actions.h"

#define UP_TIMEOUT_US   10000000u
#define HOME_TIMEOUT_US 120000000u

static unsigned drive_count(const gateway_t *self)
{
    return drives_count(self->io.drives);
}

static uint32_t all_of(const gateway_t *self)
{
    return (1u << drive_count(self)) - 1u;
}

static unsigned motion_axis(const gateway_t *self, unsigned i)
{
    return i < self->snapshot.cylinders ? i : (unsigned)AXIS_ANGLE;
}

/* A hand's time: that of the gateway, and the cycles that were skipped. */
static uint64_t hand_us(const gateway_t *self, uint64_t now_us)
{
    return now_us + self->service.late_us;
}

uint64_t gateway_tick_age(const gateway_t *self, uint64_t tick_us)
{
    const uint64_t next_us = self->snapshot.now_us + self->settings->cycle_us; /* this cycle's tick has not been told yet */
    return tick_us <= self->snapshot.service.tick_us ? hand_us(self, next_us) - tick_us : UINT64_MAX;
}

bool service_is_up(const gateway_t *self, unsigned i)
{
    return (self->service.up & ~self->service.homing) >> i & 1u;
}

void service_begin(gateway_t *self, bool has_torque)
{
    service_t *own = &self->service;
    const uint32_t axes = has_torque ? all_of(self) : 0;
    own->doing = SERVICE_NOTHING;
    own->wanted = axes;
    own->up = axes;
    own->homing = 0;
    own->off_due = 0;
    own->stop_due = 0;
    deadman_release(&own->hand);
    self->is_tracking_actual = false;
    motion_serve(&self->motion);
}

/* --- Letting go --- */

static hv_status_t ask(gateway_t *self, unsigned i, drives_request_t request)
{
    return drives_request_one(self->io.drives, (uint8_t)i, request);
}

/* Drives that look for their zero move by themselves: they are stopped, and have no torque then. */
static void stop_homing(gateway_t *self)
{
    service_t *own = &self->service;
    own->stop_due |= own->homing;
    own->wanted &= ~own->homing;
    own->up &= ~own->homing;
    own->homing = 0;
}

static bool is_signal(service_verb_t verb)
{
    return verb == SERVICE_SIGNAL_AXIS || verb == SERVICE_SIGNAL_POSE;
}

static bool moves_by_hand(service_verb_t verb)
{
    return verb == SERVICE_JOG_AXIS || verb == SERVICE_JOG_POSE || is_signal(verb);
}

void service_let_go(gateway_t *self)
{
    service_t *own = &self->service;
    deadman_release(&own->hand);
    if (moves_by_hand(own->doing)) {
        motion_stop(&self->motion);
    } else if (own->doing == SERVICE_HOME) {
        stop_homing(self);
    }
    own->doing = SERVICE_NOTHING;
}

/* --- The cycle --- */

/* Asks drives, together where it is all of them, since a bus may know it no other way.
 * Returns those that the bus has not taken it for. */
static uint32_t ask_due(gateway_t *self, uint32_t due, drives_request_t request)
{
    if (due == all_of(self)) {
        return drives_request(self->io.drives, request) == HV_ERR_AGAIN ? due : 0;
    }
    for (unsigned i = 0; i < drive_count(self); i++) {
        if ((due >> i & 1u) != 0 && ask(self, i, request) != HV_ERR_AGAIN) {
            due &= ~(1u << i);
        }
    }
    return due;
}

/* The axis is where its drive is. */
static void place(gateway_t *self, unsigned i)
{
    motion_place_axis(&self->motion, motion_axis(self, i), self->snapshot.drive[i].actual_mm_q32);
}

/* Asks a drive that is to come up, or notes that it has.
 * Returns false where it takes too long. */
static bool step_up(gateway_t *self, unsigned i, uint64_t now_us)
{
    service_t *own = &self->service;
    const drive_state_t state = self->snapshot.drive[i].state;
    if (state == DRIVE_ENABLED && self->snapshot.drive[i].has_actual) {
        own->up |= 1u << i;
        place(self, i);
    } else if (state == DRIVE_DISABLED && ((own->off_due | own->stop_due) >> i & 1u) == 0) {
        (void)!ask(self, i, DRIVES_ENABLE);
    }
    return now_us < own->deadline_us[i];
}

/* Returns false where it takes too long. */
static bool step_home(gateway_t *self, unsigned i, uint64_t now_us)
{
    service_t *own = &self->service;
    const drive_feedback_t *drive = &self->snapshot.drive[i];
    if (drive->state == DRIVE_ENABLED && drive->is_homed) {
        own->homing &= ~(1u << i);
        place(self, i); /* on its new zero */
    }
    return now_us < own->deadline_us[i];
}

/* What has no torque, or moves by itself, is where it is. */
static void place_loose(gateway_t *self)
{
    const uint32_t loose = ~self->service.up | self->service.homing;
    for (unsigned i = 0; i < drive_count(self); i++) {
        if ((loose >> i & 1u) != 0 && self->snapshot.drive[i].has_actual) {
            place(self, i);
        }
    }
}

fault_code_t service_step(gateway_t *self, uint64_t now_us)
{
    service_t *own = &self->service;
    bool is_in_time = true;
    if (own->doing != SERVICE_NOTHING && !deadman_step(&own->hand, hand_us(self, now_us))) {
        service_let_go(self);
    }
    own->stop_due = ask_due(self, own->stop_due, DRIVES_QUICK_STOP);
    if (own->off_due != 0 && motion_is_at_rest(&self->motion)) {
        own->up &= ~own->off_due;
        own->off_due = ask_due(self, own->off_due, DRIVES_DISABLE);
    }
    for (unsigned i = 0; i < drive_count(self); i++) {
        if ((own->homing >> i & 1u) != 0) {
            is_in_time = step_home(self, i, now_us) && is_in_time;
        } else if (((own->wanted & ~own->up) >> i & 1u) != 0) {
            is_in_time = step_up(self, i, now_us) && is_in_time;
        }
    }
    place_loose(self);
    if (moves_by_hand(own->doing) && motion_is_stopping(&self->motion)) {
        service_let_go(self); /* motion stopped what led astray: that is no end of its own */
    }
    if ((own->doing == SERVICE_HOME && own->homing == 0) ||
        (own->has_end && moves_by_hand(own->doing) && motion_is_done(&self->motion))) {
        own->doing = SERVICE_NOTHING;
        own->finished = own->hand.series;
        deadman_release(&own->hand);
    }
    return is_in_time ? FAULT_NONE : FAULT_DRIVE_TIMEOUT;
}

uint16_t service_relays(const gateway_t *self)
{
    const uint16_t safe = self->settings->relay_safe_mask;
    return self->service.doing == SERVICE_RELAY ? (uint16_t)(safe ^ 1u << (self->service.axis - 1u)) : safe;
}

void service_publish(gateway_t *self)
{
    const service_t *own = &self->service;
    service_view_t *view = &self->snapshot.service;
    view->tick_us = hand_us(self, self->snapshot.now_us);
    view->doing = own->doing;
    view->axis = own->axis;
    view->is_held = own->hand.is_held;
    view->series = own->hand.series;
    view->finished = own->finished;
    view->torque = own->up;
    view->homing = own->homing;
    view->has_counts = 0;
    for (unsigned i = 0; i < drive_count(self); i++) {
        if (drives_counts(self->io.drives, (uint8_t)i, &view->counts[i])) {
            view->has_counts |= 1u << i;
        }
    }
}

/* --- Requests --- */

/* The drives that a request names; 0: no such drive. */
static uint32_t named(const gateway_t *self, uint8_t axis)
{
    return axis == SERVICE_ALL ? all_of(self) : axis <= drive_count(self) ? 1u << (axis - 1u) : 0;
}

static bool has_one_by_one(const gateway_t *self)
{
    return self->io.drives.ops->request_one != NULL;
}

static service_answer_t switch_torque(gateway_t *self, uint32_t axes, bool is_on, uint64_t now_us)
{
    service_t *own = &self->service;
    if (axes == 0) {
        return SERVICE_NO_SUCH;
    }
    if (axes != all_of(self) && !has_one_by_one(self)) {
        return SERVICE_TOGETHER;
    }
    if (!is_on) { /* never refused: what moves stops first */
        if (own->doing != SERVICE_NOTHING && own->doing != SERVICE_RELAY) {
            service_let_go(self);
        }
        own->wanted &= ~axes;
        own->off_due |= axes;
        return SERVICE_DONE;
    }
    if (own->doing != SERVICE_NOTHING || !motion_is_at_rest(&self->motion) || (own->stop_due & axes) != 0) {
        return SERVICE_BUSY;
    }
    for (unsigned i = 0; i < drive_count(self); i++) {
        own->deadline_us[i] = (axes >> i & 1u) != 0 ? now_us + UP_TIMEOUT_US : own->deadline_us[i];
    }
    if (!has_one_by_one(self) && drives_request(self->io.drives, DRIVES_ENABLE) != HV_OK) {
        return SERVICE_NOT_TAKEN;
    }
    own->off_due &= ~axes;
    own->wanted |= axes;
    return SERVICE_DONE;
}

/* Drives that are up and at rest, where they have to move. */
static bool are_up(const gateway_t *self, uint32_t axes)
{
    return (self->service.up & ~self->service.homing & ~self->service.off_due & axes) == axes;
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

static bool are_homed(const gateway_t *self, uint32_t axes)
{
    for (unsigned i = 0; i < drive_count(self); i++) {
        if ((axes >> i & 1u) != 0 && !self->snapshot.drive[i].is_homed) {
            return false;
        }
    }
    return true;
}

static service_answer_t jog_axis(gateway_t *self, const service_request_t *request)
{
    const uint32_t axes = request->axis != SERVICE_ALL ? named(self, request->axis) : 0;
    if (axes == 0) {
        return SERVICE_NO_SUCH;
    }
    if (!are_up(self, axes)) {
        return SERVICE_NO_TORQUE;
    }
    return answer_of(motion_jog_axis(&self->motion, motion_axis(self, request->axis - 1u), request->speed_q16, request->way_q16));
}

static service_answer_t jog_pose(gateway_t *self, const service_request_t *request)
{
    const unsigned cylinders = self->snapshot.cylinders;
    if (request->axis < 1 || request->axis > POSE_AXES) {
        return SERVICE_NO_SUCH;
    }
    if (!are_up(self, (1u << cylinders) - 1u)) {
        return SERVICE_NO_TORQUE;
    }
    if (!are_homed(self, (1u << cylinders) - 1u)) {
        return SERVICE_NOT_HOMED;
    }
    return answer_of(motion_jog_pose(&self->motion, request->axis - 1u, request->speed_q16, request->way_q16));
}

/* A signal goes by where things are, so its drives have found their zero. */
static service_answer_t excite(gateway_t *self, const service_request_t *request)
{
    const bool is_posed = request->verb == SERVICE_SIGNAL_POSE;
    const uint32_t axes = is_posed                       ? (1u << self->snapshot.cylinders) - 1u
                          : request->axis != SERVICE_ALL ? named(self, request->axis)
                                                         : 0;
    if (axes == 0 || (is_posed && (request->axis < 1 || request->axis > POSE_AXES))) {
        return SERVICE_NO_SUCH;
    }
    if (!excitation_is_allowed(&request->signal, self->settings->cycle_us)) {
        return SERVICE_BAD_SIGNAL;
    }
    if (!are_up(self, axes)) {
        return SERVICE_NO_TORQUE;
    }
    if (!are_homed(self, axes)) {
        return SERVICE_NOT_HOMED;
    }
    return answer_of(is_posed ? motion_excite_pose(&self->motion, request->axis - 1u, &request->signal)
                              : motion_excite_axis(&self->motion, motion_axis(self, request->axis - 1u), &request->signal));
}

static service_answer_t home(gateway_t *self, const service_request_t *request, uint64_t now_us)
{
    service_t *own = &self->service;
    const uint32_t axes = named(self, request->axis);
    if (axes == 0) {
        return SERVICE_NO_SUCH;
    }
    if (!are_up(self, axes)) {
        return SERVICE_NO_TORQUE;
    }
    if (axes != all_of(self) && !has_one_by_one(self)) {
        return SERVICE_TOGETHER;
    }
    const hv_status_t status =
        axes == all_of(self) ? drives_request(self->io.drives, DRIVES_HOME) : ask(self, request->axis - 1u, DRIVES_HOME);
    if (status != HV_OK) {
        return SERVICE_NOT_TAKEN;
    }
    own->homing = axes;
    for (unsigned i = 0; i < drive_count(self); i++) {
        own->deadline_us[i] = now_us + HOME_TIMEOUT_US;
    }
    return SERVICE_DONE;
}

static service_answer_t take_relay(const gateway_t *self, uint8_t relay)
{
    return relay < 1 || relay > self->settings->relays.count ? SERVICE_NO_SUCH
           : relay == self->settings->healthy.relay          ? SERVICE_PULSE
                                                             : SERVICE_DONE;
}

static service_answer_t start(gateway_t *self, const service_request_t *request, uint64_t now_us)
{
    switch (request->verb) {
    case SERVICE_JOG_AXIS:
        return jog_axis(self, request);
    case SERVICE_JOG_POSE:
        return jog_pose(self, request);
    case SERVICE_HOME:
        return home(self, request, now_us);
    case SERVICE_RELAY:
        return take_relay(self, request->axis);
    case SERVICE_SIGNAL_AXIS:
    case SERVICE_SIGNAL_POSE:
        return excite(self, request);
    case SERVICE_NOTHING:
    case SERVICE_TORQUE_ON:
    case SERVICE_TORQUE_OFF:
    case SERVICE_BEAT:
    case SERVICE_RELEASE:
        break;
    }
    return SERVICE_NO_SUCH;
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
static service_answer_t hold(gateway_t *self, const service_request_t *request, uint64_t now_us)
{
    service_t *own = &self->service;
    deadman_t hand = own->hand;
    const deadman_answer_t pressed = deadman_press(&hand, request->series, request->age_us, hand_us(self, now_us));
    if (pressed != DEADMAN_TAKEN) {
        return answer_of_hand(pressed);
    }
    if (own->doing != SERVICE_NOTHING) {
        return SERVICE_BUSY;
    }
    const service_answer_t answer = start(self, request, now_us);
    if (answer == SERVICE_DONE) {
        own->hand = hand;
        own->doing = request->verb;
        own->has_end = is_signal(request->verb) || request->way_q16 > 0;
        own->axis = request->axis;
    }
    return answer;
}

/* A release of what is over is done already. */
static service_answer_t release(gateway_t *self, uint32_t series)
{
    if (self->service.hand.is_held && self->service.hand.series == series) {
        service_let_go(self);
    }
    return SERVICE_DONE;
}

service_answer_t gateway_service(gateway_t *self, const service_request_t *request, uint64_t now_us)
{
    if (self->supervisor.state != STATE_SERVICE) {
        return SERVICE_NOT_SERVING;
    }
    if (service_is_held(request->verb)) {
        return hold(self, request, now_us);
    }
    switch (request->verb) {
    case SERVICE_TORQUE_ON:
    case SERVICE_TORQUE_OFF:
        return switch_torque(self, named(self, request->axis), request->verb == SERVICE_TORQUE_ON, now_us);
    case SERVICE_BEAT:
        return answer_of_hand(
            deadman_beat(&self->service.hand, request->series, request->counter, request->age_us, hand_us(self, now_us)));
    case SERVICE_RELEASE:
        return release(self, request->series);
    case SERVICE_NOTHING:
    case SERVICE_JOG_AXIS:
    case SERVICE_JOG_POSE:
    case SERVICE_HOME:
    case SERVICE_RELAY:
    case SERVICE_SIGNAL_AXIS:
    case SERVICE_SIGNAL_POSE:
        break;
    }
    return SERVICE_NO_SUCH;
}
