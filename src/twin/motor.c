/* SPDX-License-Identifier: MIT
 * motor.c - what moves behind a simulated drive; see motor.h.
 */
#include "twin/motor.h"

#include <math.h>

#define WARM_US      120e6 /* time constant of the winding */
#define RATED_RISE_C 45.0
#define SECOND_US    1e6

#define RATED_ERROR_S 0.02 /* of travel at rated speed: the error that takes the rated torque */
#define EFFORT_MAX    3.0

void motor_start(motor_t *self, double position, uint64_t now_us)
{
    self->actual = position;
    self->temperature_c = self->ambient_c;
    self->has_torque = false;
    self->now_us = now_us;
    motor_hold(self);
}

void motor_hold(motor_t *self)
{
    self->demand = self->goal = self->actual;
    self->speed = self->brake = 0;
}

void motor_torque(motor_t *self, bool is_on)
{
    self->has_torque = is_on;
    motor_hold(self);
}

void motor_aim(motor_t *self, double target, double period_us)
{
    self->goal = target;
    self->brake = 0;
    self->speed = (target - self->demand) / fmax(1, period_us);
}

void motor_travel(motor_t *self, double target, double counts_per_s)
{
    self->goal = target;
    self->brake = 0;
    self->speed = copysign(fmax(counts_per_s, 1) / SECOND_US, target - self->demand);
}

uint64_t motor_stop(motor_t *self, double counts_per_s2)
{
    self->brake = fmax(counts_per_s2, 1) / (SECOND_US * SECOND_US);
    self->goal = self->demand + copysign(self->speed * self->speed / (2 * self->brake), self->speed);
    return (uint64_t)(fabs(self->speed) / self->brake) + 1;
}

bool motor_is_there(const motor_t *self)
{
    return !(fabs(self->goal - self->demand) > 0);
}

double motor_error(const motor_t *self)
{
    return self->demand - self->actual;
}

double motor_effort(const motor_t *self)
{
    const double rated = self->rated_speed * RATED_ERROR_S;
    return self->has_torque && rated > 0 ? fmin(fmax(motor_error(self) / rated, -EFFORT_MAX), EFFORT_MAX) : 0;
}

static void move_demand(motor_t *self, double span_us)
{
    double step = self->speed * span_us;
    if (motor_is_there(self)) {
        self->speed = 0;
        return;
    }
    if (self->brake > 0) {
        const double slower = fmax(0, fabs(self->speed) - self->brake * span_us);
        step = copysign((fabs(self->speed) + slower) / 2 * span_us, self->speed);
        self->speed = copysign(slower, self->speed);
    }
    if (fabs(step) >= fabs(self->goal - self->demand) || (self->brake > 0 && !(fabs(self->speed) > 0))) {
        self->demand = self->goal;
    } else {
        self->demand += step;
    }
}

/* Where the axis would like to be: with torque behind the demand, without it where the brake lets it. */
static double drawn_to(const motor_t *self, double span_us)
{
    const double wanted = self->demand - self->load;
    if (!self->has_torque) {
        return self->actual - self->slip * span_us / SECOND_US;
    }
    if (fabs(wanted - self->actual) <= self->friction) {
        return self->actual;
    }
    return self->lag_us > 0 ? wanted + (self->actual - wanted) * exp(-span_us / self->lag_us) : wanted;
}

void motor_advance(motor_t *self, uint64_t now_us)
{
    if (now_us <= self->now_us) {
        return;
    }
    const double span_us = (double)(now_us - self->now_us);
    const double before = self->actual;
    self->now_us = now_us;
    move_demand(self, span_us);
    if (!self->is_jammed) {
        self->actual = drawn_to(self, span_us);
    }
    if (self->stop_low < self->stop_high) {
        self->actual = fmin(fmax(self->actual, self->stop_low), self->stop_high);
    }
    const double pace = self->rated_speed > 0 ? (self->actual - before) / span_us * SECOND_US / self->rated_speed : 0;
    const double warm_c = self->ambient_c + RATED_RISE_C * fmin(pace * pace, 4);
    self->temperature_c = warm_c + (self->temperature_c - warm_c) * exp(-span_us / WARM_US);
    if (!self->has_torque) {
        motor_hold(self);
    }
}
