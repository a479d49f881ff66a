/* SPDX-License-Identifier: MIT
 * cia402_stage.c - what the drives do together; see cia402_stage.h.
 * A mode is changed only without torque. Drives are switched on together and get their torque together; where one of them does
 * not come along, all are led back and that one is faulty.
 */
#include "cia402_stage.h"

#include "cia402_node.h"
#include "cia402_setup.h"
#include "cia402_watch.h"

#define SWITCHED_ON_SYNCS 3u /* SYNCs with set-points at the actual position before torque */
#define MODE_TIMEOUT_US   6000000u
#define HOMING_BEGIN_US                                                                                                          \
    500000u /* "done" or "failed" at the begin counts only after this time: it may be left from the last homing */
#define HOMING_BITS    (CIA402_STATUS_BIT12 | CIA402_STATUS_REACHED)
#define HOMING_MOST_US 100000000u /* of all drives; the gateway, which knows no drive by name, waits longer */
#define STANDS_US      1000000u
#define STANDS_LONG_US 5000000u

static void enter(cia402_t *self, cia402_stage_t stage)
{
    self->stage = stage;
    self->stage_us = self->now_us;
    self->stage_syncs = 0;
}

static void set_goals(cia402_t *self, cia402_goal_t goal)
{
    for (unsigned k = 0; k < self->config->axes; k++) {
        self->axis[k].goal = goal;
    }
}

static bool needs_homing(const cia402_t *self, unsigned k)
{
    return self->config->axis[k].homing_method != 0;
}

static bool is_any_to_home(const cia402_t *self)
{
    for (unsigned k = 0; k < self->config->axes; k++) {
        if (needs_homing(self, k)) {
            return true;
        }
    }
    return false;
}

static bool is_in_state(const cia402_t *self, cia402_state_t state)
{
    for (unsigned k = 0; k < self->config->axes; k++) {
        if (cia402_axis_state(&self->axis[k]) != state) {
            return false;
        }
    }
    return true;
}

/* Takes the torque off; drives may stay switched on. */
static void withdraw(cia402_t *self)
{
    enter(self, CIA402_STAGE_WITHDRAW);
    for (unsigned k = 0; k < self->config->axes; k++) {
        const cia402_state_t state = cia402_axis_state(&self->axis[k]);
        const bool is_on = state == CIA402_SWITCHED_ON || state == CIA402_OPERATION_ENABLED;
        self->axis[k].goal = is_on ? CIA402_GOAL_ON : CIA402_GOAL_OFF;
    }
}

void cia402_stage_begin(cia402_t *self, bool is_homing)
{
    self->is_begun = false;
    self->is_homing = is_homing;
    self->is_homing_asked = is_homing;
    for (unsigned k = 0; k < self->config->axes; k++) {
        self->axis[k].is_in = true;
        self->axis[k].reset_until_us = 0; /* a fault from now on is not the one that was to be reset */
        self->axis[k].trouble = CIA402_TROUBLE_NONE;
        self->axis[k].homing = is_homing && needs_homing(self, k) ? CIA402_HOMING_WAITING : CIA402_HOMING_NO;
    }
    if (is_homing && !is_any_to_home(self)) {
        enter(self, CIA402_STAGE_HOMING); /* which then is over */
    } else {
        withdraw(self);
    }
}

void cia402_stage_end(cia402_t *self, cia402_goal_t goal)
{
    enter(self, CIA402_STAGE_OFF);
    for (unsigned k = 0; k < self->config->axes; k++) {
        cia402_axis_t *axis = &self->axis[k];
        axis->is_in = false;
        axis->homing = CIA402_HOMING_NO;
        if (axis->setup.job == CIA402_JOB_MODE) {
            axis->setup.job = CIA402_JOB_NONE;
        }
        if (axis->phase == CIA402_UP && axis->goal != CIA402_GOAL_STOP) { /* a quick stop goes on to its end */
            axis->goal = goal;
        }
    }
}

static cia402_mode_t mode_of(const cia402_t *self, unsigned k)
{
    return self->is_homing && needs_homing(self, k) ? CIA402_MODE_HOMING : cia402_mode(self->config, k);
}

/* --- Towards enabled --- */

static void step_withdraw(cia402_t *self)
{
    for (unsigned k = 0; k < self->config->axes; k++) {
        if (cia402_has_torque(cia402_axis_state(&self->axis[k]))) {
            return;
        }
    }
    enter(self, CIA402_STAGE_MODE);
    for (unsigned k = 0; k < self->config->axes; k++) {
        cia402_setup_begin(&self->axis[k], CIA402_JOB_MODE, mode_of(self, k), self->now_us);
    }
}

static bool is_in_mode(const cia402_axis_t *axis)
{
    const bool is_hidden = axis->hides_mode && axis->mode_shown == 0;
    return axis->setup.job == CIA402_JOB_NONE && (is_hidden || axis->mode_shown == (int8_t)axis->setup.mode);
}

/* A drive that is late may show the reason. */
static cia402_trouble_t reason_of(const cia402_axis_t *axis, cia402_trouble_t why)
{
    if (why == CIA402_NO_TORQUE && axis->operating_us != 0 && axis->mode_shown != (int8_t)axis->setup.mode) {
        return CIA402_NO_MODE;
    }
    const bool is_local = (axis->statusword & CIA402_STATUS_REMOTE) == 0;
    return is_local && why != CIA402_NO_MODE ? CIA402_REMOTE_OFF : why;
}

/* Reports the drives that have not arrived in time. */
static void fail_where(cia402_t *self, bool (*is_there)(cia402_t *self, unsigned k), cia402_trouble_t why)
{
    for (unsigned k = 0; k < self->config->axes; k++) {
        if (!is_there(self, k)) {
            cia402_axis_fail(cia402_drive(self, k), reason_of(&self->axis[k], why));
        }
    }
}

static bool has_mode(cia402_t *self, unsigned k)
{
    return is_in_mode(&self->axis[k]);
}

static bool is_switched_on(cia402_t *self, unsigned k)
{
    return cia402_axis_state(&self->axis[k]) == CIA402_SWITCHED_ON;
}

static bool is_operating(cia402_t *self, unsigned k)
{
    return cia402_axis_is_operating(cia402_drive(self, k));
}

static bool are_all(cia402_t *self, bool (*is_there)(cia402_t *self, unsigned k))
{
    for (unsigned k = 0; k < self->config->axes; k++) {
        if (!is_there(self, k)) {
            return false;
        }
    }
    return true;
}

static uint64_t power_timeout_us(const cia402_t *self)
{
    return self->config->power_timeout_ms * (uint64_t)1000u;
}

static bool is_late(const cia402_t *self, uint64_t limit_us)
{
    return self->now_us - self->stage_us >= limit_us;
}

static void step_mode(cia402_t *self)
{
    if (are_all(self, has_mode)) {
        enter(self, CIA402_STAGE_SWITCH_ON);
        set_goals(self, CIA402_GOAL_ON);
    } else if (is_late(self, MODE_TIMEOUT_US)) {
        fail_where(self, has_mode, CIA402_NO_MODE);
    }
}

static void step_switch_on(cia402_t *self)
{
    if (!is_in_state(self, CIA402_SWITCHED_ON)) {
        self->stage_syncs = 0;
    } else if (self->stage_syncs >= SWITCHED_ON_SYNCS) {
        enter(self, CIA402_STAGE_OPERATE);
        set_goals(self, CIA402_GOAL_OPERATE);
        for (unsigned k = 0; k < self->config->axes; k++) {
            self->axis[k].has_operated = false;
        }
        return;
    }
    if (is_late(self, power_timeout_us(self))) {
        fail_where(self, is_switched_on, CIA402_NO_POWER);
    }
}

static void begin_following(cia402_t *self)
{
    enter(self, CIA402_STAGE_FOLLOW);
    self->pp_step = 0;
    for (unsigned k = 0; k < self->config->axes; k++) {
        self->axis[k].has_sent = false;
    }
}

/* A drive that had torque and lost it does not get it again. */
static void watch_relapse(cia402_t *self)
{
    for (unsigned k = 0; k < self->config->axes; k++) {
        cia402_axis_t *axis = &self->axis[k];
        const bool is_there = axis->operating_us != 0;
        if (axis->has_operated && !is_there) {
            cia402_axis_fail(cia402_drive(self, k), CIA402_FELL_OUT);
        }
        axis->has_operated |= is_there;
    }
}

static void step_operate(cia402_t *self)
{
    watch_relapse(self);
    if (are_all(self, is_operating)) {
        if (self->is_homing) {
            enter(self, CIA402_STAGE_HOMING);
        } else {
            begin_following(self);
        }
    } else if (is_late(self, power_timeout_us(self))) {
        fail_where(self, is_operating, CIA402_NO_TORQUE);
    }
}

/* --- Homing --- */

/* True if homing of drive k may start: at once, or, with homing in turn, after all drives before it. */
static bool may_start(const cia402_t *self, unsigned k)
{
    for (unsigned i = 0; self->config->is_homing_in_turn && i < k; i++) {
        if (self->axis[i].homing != CIA402_HOMING_NO && self->axis[i].homing != CIA402_HOMING_DONE) {
            return false;
        }
    }
    return true;
}

/* How long it has been slower than a tenth of the speed that it looks for its zero with. */
static uint64_t stands_us(cia402_t *self, unsigned k)
{
    cia402_axis_t *axis = &self->axis[k];
    const int64_t moved = (int64_t)axis->actual_counts - axis->stand_counts;
    const int64_t most = self->config->axis[k].homing_speed[1] / 10u;
    if (moved > most || moved < -most) {
        axis->stand_counts = axis->actual_counts;
        axis->stand_us = self->now_us;
    }
    return self->now_us - axis->stand_us;
}

/* Some drives never set bit 10. They have their zero when bit 12 has come, or was never away, and they stand. */
static bool has_zero(cia402_t *self, unsigned k)
{
    cia402_axis_t *axis = &self->axis[k];
    const uint16_t bits = axis->statusword & HOMING_BITS;
    const uint64_t stood_us = stands_us(self, k);
    axis->was_without_zero |= (bits & CIA402_STATUS_BIT12) == 0 && axis->word_syncs > 0;
    return bits == HOMING_BITS ||
           (bits == CIA402_STATUS_BIT12 && stood_us >= (axis->was_without_zero ? STANDS_US : STANDS_LONG_US));
}

static void step_homing_axis(cia402_t *self, unsigned k)
{
    cia402_axis_t *axis = &self->axis[k];
    if (axis->homing == CIA402_HOMING_WAITING && may_start(self, k)) {
        axis->homing = CIA402_HOMING_STARTED;
        axis->was_without_zero = false;
        axis->stand_counts = axis->actual_counts;
        axis->stand_us = axis->phase_us = self->now_us;
        return;
    }
    if (axis->homing != CIA402_HOMING_STARTED && axis->homing != CIA402_HOMING_RUNNING) {
        return;
    }
    const bool is_error = (axis->statusword & CIA402_STATUS_BIT13) != 0;
    const bool has_begun = axis->homing == CIA402_HOMING_RUNNING || self->now_us - axis->phase_us >= HOMING_BEGIN_US;
    const bool is_there = has_zero(self, k);
    if (is_error && has_begun) {
        cia402_axis_fail(cia402_drive(self, k), CIA402_HOMING_ERROR);
    } else if (is_there && has_begun) {
        axis->homing = CIA402_HOMING_DONE;
        axis->is_homed = true;
    } else if (is_late(self, HOMING_MOST_US)) {
        cia402_axis_fail(cia402_drive(self, k), CIA402_HOMING_LATE);
    } else if (!is_there && !is_error && axis->word_syncs > 0) {
        axis->homing = CIA402_HOMING_RUNNING;
    }
}

/* After homing: back to the mode of the set-points, with the new zero. */
static void step_homing(cia402_t *self)
{
    bool is_over = true;
    bool is_any = false;
    for (unsigned k = 0; k < self->config->axes; k++) {
        step_homing_axis(self, k);
        is_any |= self->axis[k].homing != CIA402_HOMING_NO;
        is_over &= self->axis[k].homing == CIA402_HOMING_NO || self->axis[k].homing == CIA402_HOMING_DONE;
    }
    if (!is_over) {
        return;
    }
    self->is_homing = false;
    if (is_any) {
        withdraw(self);
    } else {
        begin_following(self);
    }
}

/* --- Following --- */

/* Finds a drive that has left the enabled state by itself, or that reports that it cannot follow. */
static void watch_operation(cia402_t *self)
{
    for (unsigned k = 0; k < self->config->axes; k++) {
        cia402_axis_t *axis = &self->axis[k];
        const cia402_state_t state = cia402_axis_state(axis);
        const bool is_watched = cia402_mode(self->config, k) != CIA402_MODE_IP && self->stage == CIA402_STAGE_FOLLOW;
        if (!axis->is_in) {
            continue;
        }
        if (state != CIA402_OPERATION_ENABLED) {
            axis->is_in = false;
            axis->goal = CIA402_GOAL_STOP;
            axis->trouble = CIA402_FELL_OUT;
            axis->trouble_us = self->now_us;
        } else if (is_watched && (axis->statusword & CIA402_STATUS_BIT13) != 0) {
            cia402_axis_fail(cia402_drive(self, k), CIA402_FOLLOWING_ERROR);
        }
    }
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

/* Finds problems of a drive that is in the right state and reports no fault. */
static void watch_answers(cia402_t *self)
{
    for (unsigned k = 0; k < self->config->axes; k++) {
        const cia402_drive_t drive = cia402_drive(self, k);
        const cia402_trouble_t why = cia402_watch_find(drive, self->stage == CIA402_STAGE_FOLLOW);
        if (drive.axis->is_in && why != CIA402_TROUBLE_NONE) {
            cia402_axis_fail(drive, why);
        }
    }
}

static void step(cia402_t *self)
{
    switch (self->stage) {
    case CIA402_STAGE_WITHDRAW:
        step_withdraw(self);
        break;
    case CIA402_STAGE_MODE:
        step_mode(self);
        break;
    case CIA402_STAGE_SWITCH_ON:
        step_switch_on(self);
        break;
    case CIA402_STAGE_OPERATE:
        step_operate(self);
        break;
    case CIA402_STAGE_HOMING:
        watch_operation(self);
        step_homing(self);
        break;
    case CIA402_STAGE_OFF:
    case CIA402_STAGE_FOLLOW:
        watch_operation(self);
        break;
    }
}

void cia402_stage_step(cia402_t *self)
{
    if (self->stage == CIA402_STAGE_OFF) {
        return;
    }
    if (!self->is_begun) { /* a request is visible for one poll before the next one carries it out */
        self->is_begun = true;
        return;
    }
    if (are_all_in(self) || self->stage == CIA402_STAGE_FOLLOW) {
        watch_answers(self);
        step(self);
    }
    if (!are_all_in(self) && self->stage != CIA402_STAGE_FOLLOW) { /* when following, the gateway decides */
        cia402_stage_end(self, CIA402_GOAL_STOP);
    }
}

uint16_t cia402_stage_mode_bits(const cia402_t *self, unsigned k)
{
    const cia402_axis_t *axis = &self->axis[k];
    if (axis->homing != CIA402_HOMING_NO && self->is_homing) {
        return axis->homing == CIA402_HOMING_WAITING ? 0 : CIA402_WORD_BIT4;
    }
    const cia402_mode_t mode = cia402_mode(self->config, k);
    if (mode == CIA402_MODE_PP) {
        return CIA402_WORD_AT_ONCE | (self->pp_step == 1u ? CIA402_WORD_BIT4 : 0);
    }
    if (mode == CIA402_MODE_CSP) {
        return self->config->csp_control_bits;
    }
    return mode == CIA402_MODE_IP ? CIA402_WORD_BIT4 : 0;
}
