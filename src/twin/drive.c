/* SPDX-License-Identifier: MIT
 * drive.c - a simulated CiA 402 drive behind its bus; see drive.h.
 */
#include "twin/drive.h"

#include <math.h>
#include <stdlib.h>

#define ERRORS_KEPT       4u /* in 1003h */
#define FOLLOWING_ERROR   0x8611u
#define CONNECTION_LOST   0x8130u
#define SET_POINT_MISSING 0x8250u
#define HOMING_ERROR      0x8613u
#define WRONG_PERIOD      0xFF10u
#define TOO_HOT           0x4310u

#define MODE_PP     1
#define MODE_HOMING 6
#define MODE_IP     7
#define MODE_CSP    8

#define MODE_US    3000u /* until 6061h follows 6060h */
#define QUICK_US   2000u /* changes of state that switch nothing */
#define WARNING_C  80.0
#define TOO_HOT_C  90.0
#define ARRIVED    0.5 /* counts */
#define HOME_NEAR  100.0
#define ODD_MAX    8u
#define WORD_RESET 0x80u
#define CSP_BITS   0x70u

#define SLOW_RESET_US 100000u

typedef enum { COMMAND_NONE, COMMAND_NO_VOLTAGE, COMMAND_STOP, COMMAND_SHUTDOWN, COMMAND_SWITCH_ON, COMMAND_ENABLE } command_t;

bool drive_is_enabled(const drive_t *self)
{
    return self->state == TWIN_ENABLED;
}

static bool has_power(twin_state_t state)
{
    return state == TWIN_ON || state == TWIN_ENABLED || state == TWIN_QUICK_STOP || state == TWIN_REACTION;
}

static bool has_torque(twin_state_t state)
{
    return state == TWIN_ENABLED || state == TWIN_QUICK_STOP || state == TWIN_REACTION;
}

int32_t drive_count(const drive_t *self)
{
    return (int32_t)(int64_t)llround(self->motor.actual - self->origin);
}

static int32_t signed_of(const drive_t *self, uint16_t index, uint8_t sub)
{
    return (int32_t)objects_get(&self->od, index, sub);
}

/* Positions wrap round: of all that have these counts, the one that is nearest. */
static double target_of(const drive_t *self)
{
    const uint32_t counts = objects_get(&self->od, self->mode == MODE_IP ? 0x60C1 : 0x607A, self->mode == MODE_IP ? 1 : 0);
    const int64_t actual = llround(self->motor.actual - self->origin);
    return (double)(actual + (int32_t)(counts - (uint32_t)actual)) + self->origin;
}

/* --- What it shows --- */

static uint16_t mode_bits(const drive_t *self)
{
    if (!drive_is_enabled(self)) {
        return 0;
    }
    switch (self->mode) {
    case MODE_CSP:
        return 0x1000;
    case MODE_IP:
        return self->is_ip_active ? 0x1000 : 0;
    case MODE_PP:
        return (uint16_t)((self->is_pp_taken ? 0x1000 : 0) | (motor_is_there(&self->motor) ? 0x0400 : 0));
    case MODE_HOMING:
        return (uint16_t)((self->homing == HOMING_RUNNING  ? 0u
                           : self->homing == HOMING_DONE   ? 0x1400u
                           : self->homing == HOMING_FAILED ? 0x2000u
                                                           : 0x0400u) &
                          (quirk_is(self->quirks, QUIRK_NO_BIT_10) ? ~0x0400u : ~0u));
    default:
        return 0;
    }
}

/* The switches at the ends, as 60FDh has them. Raw counts that run backwards have the lower end where the cylinder is out. */
static uint32_t inputs(const drive_t *self)
{
    const motor_t *motor = &self->motor;
    const bool has_stops = motor->stop_low < motor->stop_high;
    return (has_stops && motor->actual <= motor->stop_low ? 1u : 0u) |
           (has_stops && motor->actual >= motor->stop_high ? 2u : 0u) | (fabs(motor->actual - self->home) < HOME_NEAR ? 4u : 0u);
}

static void show(drive_t *self)
{
    const bool is_mode_hidden = quirk_is(self->quirks, QUIRK_HIDES_MODE) && !drive_is_enabled(self);
    const unsigned powered = has_power(self->state) ? 0x10u : 0u;
    const unsigned warning = self->motor.temperature_c > WARNING_C ? 0x80u : 0u;
    const unsigned word = (unsigned)self->state | powered | warning | 0x0200u | mode_bits(self) | self->bits_set;
    objects_put(&self->od, 0x6041, 0, word & 0xFFFFu & ~(unsigned)self->bits_clear);
    objects_put(&self->od, 0x6061, 0, is_mode_hidden ? 0 : (uint8_t)self->mode);
    objects_put(&self->od, 0x6064, 0, (uint32_t)drive_count(self));
    objects_put(&self->od, 0x6062, 0, (uint32_t)(int32_t)llround(self->motor.demand - self->origin));
    objects_put(&self->od, 0x606C, 0, (uint32_t)(int32_t)lround(self->motor.speed * 1e6));
    objects_put(&self->od, 0x60F4, 0, (uint32_t)(int32_t)lround(motor_error(&self->motor)));
    objects_put(&self->od, 0x6077, 0, (uint16_t)(int16_t)lround(1000 * motor_effort(&self->motor)));
    objects_put(&self->od, 0x60FD, 0, inputs(self));
}

/* --- States --- */

static void enter(drive_t *self, twin_state_t state)
{
    self->state = self->next_state = state;
    self->state_due_us = DRIVE_NEVER;
    self->stop_due_us = DRIVE_NEVER;
    if (self->motor.has_torque != has_torque(state)) {
        motor_torque(&self->motor, has_torque(state));
    }
    if (state == TWIN_ENABLED) {
        motor_hold(&self->motor);
        self->silent_syncs = self->odd_syncs = 0;
        self->has_start = false;
        self->enabled++;
    } else {
        self->is_ip_active = self->is_pp_taken = false;
        self->homing = HOMING_NO;
    }
    self->lag_since_us = DRIVE_NEVER;
}

static void go(drive_t *self, twin_state_t state, uint32_t delay_us)
{
    if (self->next_state != state) {
        self->next_state = state;
        self->state_due_us = self->now_us + delay_us;
    }
}

/* By the quick-stop ramp, then into that state. */
static void ramp_down(drive_t *self, twin_state_t state)
{
    self->stop_due_us = self->now_us + motor_stop(&self->motor, objects_get(&self->od, 0x6085, 0));
    self->stop_state = state;
}

/* The newest comes first. */
static void remember(objects_t *od, uint16_t code)
{
    const uint32_t kept = objects_get(od, 0x1003, 0);
    for (uint8_t sub = ERRORS_KEPT; sub > 1; sub--) {
        objects_put(od, 0x1003, sub, objects_get(od, 0x1003, (uint8_t)(sub - 1)));
    }
    objects_put(od, 0x1003, 1, code);
    objects_put(od, 0x1003, 0, kept < ERRORS_KEPT ? kept + 1 : ERRORS_KEPT);
}

static void raise_emergency(drive_t *self, uint16_t code, uint8_t error_register)
{
    self->emergency = code;
    self->emergency_register = error_register;
    objects_put(&self->od, 0x603F, 0, code);
    objects_put(&self->od, 0x1001, 0, error_register);
    remember(&self->od, code);
}

void drive_fault(drive_t *self, uint16_t code)
{
    const uint32_t reaction = objects_get(&self->od, 0x605E, 0);
    const bool is_ramped = drive_is_enabled(self) && (reaction == 1 || reaction == 2);
    if (self->state == TWIN_FAULT || self->state == TWIN_REACTION) {
        return;
    }
    raise_emergency(self, code, 0x21);
    if (!is_ramped) {
        enter(self, TWIN_FAULT);
        return;
    }
    enter(self, TWIN_REACTION);
    ramp_down(self, TWIN_FAULT);
}

void drive_drop(drive_t *self)
{
    enter(self, TWIN_DISABLED);
}

/* 605Ah 0: no torque at once; 1, 2: ramp, then no torque; 5, 6: ramp, and it stays. */
static void quick_stop(drive_t *self)
{
    const uint32_t option = objects_get(&self->od, 0x605A, 0);
    if (option == 0) {
        enter(self, TWIN_DISABLED);
        return;
    }
    enter(self, TWIN_QUICK_STOP);
    ramp_down(self, option >= 5 ? TWIN_QUICK_STOP : TWIN_DISABLED);
}

void drive_connection_lost(drive_t *self)
{
    if (!drive_is_enabled(self)) {
        return;
    }
    switch (objects_get(&self->od, 0x6007, 0)) {
    case 1:
        drive_fault(self, CONNECTION_LOST);
        break;
    case 2:
        enter(self, TWIN_DISABLED);
        break;
    case 3:
        quick_stop(self);
        break;
    default:
        break;
    }
}

static command_t command_of(uint16_t word)
{
    if ((word & WORD_RESET) != 0) {
        return COMMAND_NONE;
    }
    if ((word & 0x02) == 0) {
        return COMMAND_NO_VOLTAGE;
    }
    if ((word & 0x04) == 0) {
        return COMMAND_STOP;
    }
    if ((word & 0x01) == 0) {
        return COMMAND_SHUTDOWN;
    }
    return (word & 0x08) != 0 ? COMMAND_ENABLE : COMMAND_SWITCH_ON;
}

/** Where a command leads from a state. */
typedef struct {
    twin_state_t from;
    command_t command;
    twin_state_t to;
} transition_t;

static const transition_t k_transitions[] = {
    {TWIN_DISABLED, COMMAND_SHUTDOWN, TWIN_READY},
    {TWIN_READY, COMMAND_SWITCH_ON, TWIN_ON},
    {TWIN_READY, COMMAND_ENABLE, TWIN_ON},
    {TWIN_READY, COMMAND_NO_VOLTAGE, TWIN_DISABLED},
    {TWIN_READY, COMMAND_STOP, TWIN_DISABLED},
    {TWIN_ON, COMMAND_ENABLE, TWIN_ENABLED},
    {TWIN_ON, COMMAND_SHUTDOWN, TWIN_READY},
    {TWIN_ON, COMMAND_NO_VOLTAGE, TWIN_DISABLED},
    {TWIN_ON, COMMAND_STOP, TWIN_DISABLED},
    {TWIN_ENABLED, COMMAND_SWITCH_ON, TWIN_ON},
    {TWIN_ENABLED, COMMAND_SHUTDOWN, TWIN_READY},
    {TWIN_ENABLED, COMMAND_NO_VOLTAGE, TWIN_DISABLED},
    {TWIN_QUICK_STOP, COMMAND_NO_VOLTAGE, TWIN_DISABLED},
};

static void transit(drive_t *self, command_t command)
{
    for (uint32_t i = 0; i < sizeof k_transitions / sizeof k_transitions[0]; i++) {
        const transition_t *row = &k_transitions[i];
        if (row->from == self->state && row->command == command) {
            const bool is_on = row->to == TWIN_ON && self->state == TWIN_READY;
            go(self, row->to, is_on ? self->switch_on_us : row->to == TWIN_ENABLED ? self->brake_us : QUICK_US);
            return;
        }
    }
    if (self->state != TWIN_NOT_READY) { /* a command that was on its way counts no more */
        self->next_state = self->state;
        self->state_due_us = DRIVE_NEVER;
    }
}

/* Methods 1 and 2, 17 and 18, 33 and 34 look for the same in the two directions. */
static double home_of(const drive_t *self)
{
    const unsigned method = objects_get(&self->od, 0x6098, 0) & 0xFFu, usual = self->home_method;
    const bool is_other = method != usual && method < 128u && (method + 1u) / 2u == (usual + 1u) / 2u;
    return method == 35u || method == 37u ? self->motor.actual : is_other ? self->home_other : self->home;
}

/* Bit 4 means something else in every mode. */
static void operate(drive_t *self, bool start)
{
    if (self->mode == MODE_IP) {
        self->is_ip_active = start;
    } else if (self->mode == MODE_PP && start && !self->has_start) {
        motor_travel(&self->motor, target_of(self), objects_get(&self->od, 0x6081, 0));
    } else if (self->mode == MODE_HOMING && start && self->homing == HOMING_NO) {
        self->homing = HOMING_RUNNING;
        motor_travel(&self->motor, home_of(self), objects_get(&self->od, 0x6099, 1));
    } else if (self->mode == MODE_HOMING && !start) {
        self->homing = HOMING_NO;
    }
    self->is_pp_taken = self->mode == MODE_PP && start;
    self->has_start = start;
}

static void reset_fault(drive_t *self)
{
    self->reset_due_us = DRIVE_NEVER;
    enter(self, TWIN_DISABLED);
    objects_put(&self->od, 0x1001, 0, 0);
    objects_put(&self->od, 0x603F, 0, 0);
    self->is_emergency_over = true;
}

void drive_control(drive_t *self, uint16_t word)
{
    const unsigned rising = word & ~(unsigned)self->word;
    if (self->is_deaf) {
        return;
    }
    self->word = word;
    self->reset_due_us = (word & WORD_RESET) != 0 ? self->reset_due_us : DRIVE_NEVER;
    if (self->state == TWIN_FAULT) {
        if ((rising & WORD_RESET) != 0 && !self->is_broken) {
            self->reset_due_us = self->now_us + (quirk_is(self->quirks, QUIRK_SLOW_RESET) ? SLOW_RESET_US : 0u);
        }
        return;
    }
    const command_t command = command_of(word);
    if (drive_is_enabled(self) && command == COMMAND_STOP) {
        quick_stop(self);
        return;
    }
    transit(self, command);
    if (drive_is_enabled(self)) {
        operate(self, (word & 0x10) != 0);
    }
}

uint32_t drive_choose_mode(drive_t *self, int8_t mode)
{
    const bool is_known = mode == 0 || mode == MODE_PP || mode == MODE_HOMING || mode == MODE_IP || mode == MODE_CSP;
    if (!is_known) {
        return OBJECT_BAD_VALUE;
    }
    if (drive_is_enabled(self) && mode != self->mode) {
        return OBJECT_WRONG_STATE;
    }
    self->next_mode = mode;
    self->mode_due_us = self->now_us + MODE_US;
    return 0;
}

/* --- Set-points --- */

static double period_us(const drive_t *self)
{
    const uint32_t exponent = objects_get(&self->od, 0x60C2, 2);
    return objects_get(&self->od, 0x60C2, 1) * (exponent == 0xFC ? 100.0 : 1000.0);
}

/* SYNCs that are far from 60C2h, one after the other: a master that was late once makes one long period and one short one. */
static bool is_off_beat(drive_t *self)
{
    const double off_us = fabs((double)self->sync_period_us - period_us(self));
    const bool is_off = self->mode == MODE_CSP && self->sync_period_us != 0 && off_us > 0.5 * period_us(self);
    self->odd_syncs = is_off ? (uint8_t)(self->odd_syncs + 1) : 0;
    return self->odd_syncs >= ODD_MAX;
}

static void miss(drive_t *self)
{
    self->silent_syncs++;
    if (self->missed_max != 0 && self->silent_syncs >= self->missed_max) {
        drive_fault(self, SET_POINT_MISSING);
    }
}

/* The set-point of a cyclic mode, at SYNC. */
static void follow(drive_t *self)
{
    const bool is_cyclic = self->mode == MODE_CSP || (self->mode == MODE_IP && self->is_ip_active);
    const bool is_blind =
        self->mode == MODE_CSP && quirk_is(self->quirks, QUIRK_NEEDS_BITS) && (self->word & CSP_BITS) != CSP_BITS;
    if (!drive_is_enabled(self) || self->is_deaf || !is_cyclic || is_blind) {
        return;
    }
    if (!self->has_set_point) {
        miss(self);
        return;
    }
    self->silent_syncs = 0;
    self->set_points++;
    if (fabs(target_of(self) - self->motor.actual) > self->jump_counts) {
        drive_fault(self, FOLLOWING_ERROR);
    } else if (is_off_beat(self)) {
        drive_fault(self, WRONG_PERIOD);
    } else {
        motor_aim(&self->motor, target_of(self), period_us(self));
    }
}

void drive_sync(drive_t *self, uint64_t now_us)
{
    self->sync_period_us = self->sync_us == 0 ? 0 : now_us - self->sync_us;
    self->sync_us = now_us;
    follow(self);
    self->has_set_point = false;
    show(self);
}

/* --- What it looks after by itself --- */

static void watch_lag(drive_t *self)
{
    if (!drive_is_enabled(self) || fabs(motor_error(&self->motor)) <= objects_get(&self->od, 0x6065, 0)) {
        self->lag_since_us = DRIVE_NEVER;
        return;
    }
    self->lag_since_us = self->lag_since_us == DRIVE_NEVER ? self->now_us : self->lag_since_us;
    if (self->now_us - self->lag_since_us >= objects_get(&self->od, 0x6066, 0) * 1000u) {
        drive_fault(self, FOLLOWING_ERROR);
    }
}

static void watch_homing(drive_t *self)
{
    if (self->homing != HOMING_RUNNING || !motor_is_there(&self->motor)) {
        return;
    }
    if (self->is_homing_broken) {
        self->homing = HOMING_FAILED;
    } else if (fabs(motor_error(&self->motor) - self->motor.load) < ARRIVED + self->motor.friction) {
        self->homing = HOMING_DONE;
        self->origin = self->motor.actual - signed_of(self, 0x607C, 0);
    }
}

static void change(drive_t *self)
{
    if (self->now_us >= self->stop_due_us) {
        enter(self, self->stop_state);
        motor_hold(&self->motor);
    }
    if (self->now_us >= self->state_due_us && !self->is_deaf) {
        enter(self, self->next_state);
    }
    if (self->now_us >= self->reset_due_us) {
        reset_fault(self);
    }
    if (self->now_us >= self->mode_due_us) {
        self->mode_due_us = DRIVE_NEVER;
        self->mode = self->next_mode;
    }
}

void drive_advance(drive_t *self, uint64_t now_us)
{
    self->now_us = now_us;
    motor_advance(&self->motor, now_us);
    change(self);
    watch_lag(self);
    watch_homing(self);
    if (self->motor.temperature_c > TOO_HOT_C) {
        drive_fault(self, TOO_HOT);
    }
    show(self);
}

uint64_t drive_due_us(const drive_t *self)
{
    const uint64_t state_us = self->is_deaf ? DRIVE_NEVER : self->state_due_us;
    uint64_t due_us = state_us < self->stop_due_us ? state_us : self->stop_due_us;
    due_us = self->mode_due_us < due_us ? self->mode_due_us : due_us;
    due_us = self->reset_due_us < due_us ? self->reset_due_us : due_us;
    return due_us;
}

void drive_start(drive_t *self, uint64_t now_us)
{
    self->now_us = now_us;
    self->mode_due_us = self->stop_due_us = self->reset_due_us = self->lag_since_us = DRIVE_NEVER;
    self->mode = self->next_mode = 0;
    self->word = 0;
    self->emergency = 0;
    self->is_emergency_over = self->has_set_point = false;
    self->sync_us = self->sync_period_us = 0;
    motor_torque(&self->motor, false);
    self->motor.now_us = now_us;
    self->origin = self->is_absolute ? 0 : self->motor.actual;
    enter(self, TWIN_NOT_READY);
    go(self, TWIN_DISABLED, QUICK_US);
    show(self);
}
