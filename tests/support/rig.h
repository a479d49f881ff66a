/* SPDX-License-Identifier: MIT
 * rig.h - a whole gateway over simulated hardware for tests, with a checker that judges every set-point the drives are sent.
 * The checker works on the drive interface alone, in double precision, and shares no code with the limiter.
 */
#ifndef RIG_H
#define RIG_H

#include "heave/gateway.h"
#include "sim_drives.h"
#include "sim_inputs.h"
#include "sim_log.h"
#include "sim_relays.h"
#include "sim_udp.h"

/** Worst figures seen, as a share of the limit (1 = exactly at it); stroke in mm outside the allowed range. */
typedef struct {
    double speed, accel, jerk, outside_mm;
    long cycles;
    long history; /* cycles in a row that were judged */
    q32_t last_q32[DRIVES_MAX], last_vel_q32[DRIVES_MAX], last_acc_q32[DRIVES_MAX];
} rig_check_t;

typedef struct {
    settings_t settings;
    gateway_t gateway;
    sim_drives_t drives;
    sim_drive_config_t drive_config[DRIVES_MAX];
    sim_udp_t udp;
    sim_relays_t relays;
    sim_relays_t healthy; /**< the line of the healthy pulse */
    sim_inputs_t inputs;
    sim_log_t log;
    drives_t inner;
    bool is_failing; /**< of the drives' bus */
    uint64_t now_us;
    rig_check_t check;
    bool is_checking;      /**< off while the drives are not enabled: set-points then follow the actual positions */
    bool is_auto_checking; /**< is_checking follows the drives: on while every one is enabled and the gateway leads them */
    q32_t step_max_q32;    /**< largest step of any set-point between two cycles in which every drive was enabled */
    q32_t sent_q32[DRIVES_MAX];
    bool was_enabled;
    void (*after_cycle)(void *ctx); /**< NULL: nobody looks; set after rig_start() */
    void *after_cycle_ctx;
} rig_t;

/** A symmetrical hexapod with a rotation motor: 200 mm stroke, 400 mm/s, 3000 mm/s^2, 50000 mm/s^3. */
settings_t rig_hexapod(void);

/** A three-cylinder platform with a central guide. */
settings_t rig_tripod(void);

/** Powers up; the drives start enabled and homed at the settled extension if is_settled, else off and not homed. */
void rig_start(rig_t *self, const settings_t *settings, bool is_settled);

/** Sends one datagram. */
void rig_send(rig_t *self, const char *text);

/** Sends one datagram from 10.0.0.host. */
void rig_send_from(rig_t *self, uint8_t host, const char *text);

/** Sends one datagram put together as by printf. */
void rig_sendf(rig_t *self, const char *format, ...);

/** Something goes wrong with a drive (SIM_DRIVES_ALL: with every one) from the next cycle on. */
void rig_break(rig_t *self, sim_drives_fault_kind_t kind, uint8_t axis, uint32_t code);

/** An operator's request now. */
hv_status_t rig_request(rig_t *self, event_t request);

/** True if a line that contains the text was logged; takes the lines up to it. */
bool rig_was_logged(rig_t *self, const char *text);

/** What the checker has seen is within the limits, apart from the rounding of double precision. */
bool rig_is_within_limits(const rig_t *self);

/** Following errors that the drives have found. */
unsigned rig_following_errors(const rig_t *self);

/** Runs cycles for so many ms. */
void rig_run_ms(rig_t *self, unsigned ms);

/** Runs until the state is reached; false after the time. */
bool rig_run_until(rig_t *self, state_t state, unsigned most_ms);

/** Last set-points in mm (deg), and the pose sent in deg and mm. */
double rig_cylinder_mm(const rig_t *self, unsigned cylinder);
double rig_angle_deg(const rig_t *self);
double rig_pose(const rig_t *self, unsigned axis);

/** Starts the figures anew. */
void rig_check_reset(rig_t *self);

#endif
