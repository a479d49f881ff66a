/* SPDX-License-Identifier: MIT
 * motor.h - what moves behind a simulated drive: the demand, and an axis that lags behind it, rubs, gives way under its load,
 * meets its end stops, is held by its brake and gets warm. Counts and microseconds; time is an argument.
 */
#ifndef HEAVE_TWIN_MOTOR_H
#define HEAVE_TWIN_MOTOR_H

#include <stdbool.h>
#include <stdint.h>

#define MOTOR_AMBIENT_C 25.0 /* unless it is said */

/** One axis. Set by the caller: the first block. */
typedef struct {
    double lag_us;      /**< time constant behind the demand */
    double friction;    /**< counts that the demand has to be ahead before the axis breaks loose */
    double load;        /**< counts that it gives way under torque */
    double slip;        /**< counts/s at which the brake lets it go without torque */
    double stop_low;    /**< end stops; none where low is not below high */
    double stop_high;   /**< likewise */
    double rated_speed; /**< counts/s at which it warms to 45 C above its surroundings */
    double ambient_c;   /**< temperature round it */
    bool is_jammed;     /**< stands whatever is asked */

    double actual;        /**< counts */
    double temperature_c; /**< of the winding */
    double demand;
    double goal;
    double speed; /**< counts/us of the demand */
    double brake; /**< counts/us^2 while it stops */
    bool has_torque;
    uint64_t now_us;
} motor_t;

/** Stands still there. */
void motor_start(motor_t *self, double position, uint64_t now_us);

/** The demand stays where the axis is. */
void motor_hold(motor_t *self);

/** Torque on (the brake opens) or off (it holds). */
void motor_torque(motor_t *self, bool is_on);

/** The next set-point of a cyclic mode: there within the period. */
void motor_aim(motor_t *self, double target, double period_us);

/** A move at constant speed. */
void motor_travel(motor_t *self, double target, double counts_per_s);

/** A ramp down from the present speed; returns how long it takes, us. */
uint64_t motor_stop(motor_t *self, double counts_per_s2);

/** The demand has arrived. */
bool motor_is_there(const motor_t *self);

/** Demand less actual. */
double motor_error(const motor_t *self);

/** Its torque, as a share of the rated one: that of a stiff controller, in proportion to the error. */
double motor_effort(const motor_t *self);

/** Moves it up to now. */
void motor_advance(motor_t *self, uint64_t now_us);

#endif
