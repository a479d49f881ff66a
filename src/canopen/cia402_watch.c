/* SPDX-License-Identifier: MIT
 * cia402_watch.c - what a drive's answers say beyond its state and position; see cia402_watch.h.
 */
#include "cia402_watch.h"

#define ANSWERS_MIN 2u
#define NOTE_US     5000000u /* a limit that is met now and then is told of once, not at every peak */

static bool is_enabled(const cia402_axis_t *axis)
{
    return cia402_state(axis->statusword) == CIA402_OPERATION_ENABLED;
}

static bool has(const cia402_axis_t *axis, uint16_t bit)
{
    return (axis->statusword & bit) != 0;
}

/* A change of mode is asked for without torque only. A drive that shows none without torque may need a moment. */
static bool is_out_of_mode(const cia402_axis_t *axis)
{
    if (axis->mode_shown == (int8_t)axis->setup.mode || !is_enabled(axis) || axis->setup.job != CIA402_JOB_NONE) {
        return false;
    }
    return !axis->hides_mode || axis->mode_shown != 0 || axis->has_shown_mode;
}

/* Some drives never show bit 12 in CSP: counts where it was there. In PP it means something else. */
static bool is_not_following(const cia402_axis_t *axis)
{
    const bool is_cyclic = axis->setup.mode == CIA402_MODE_CSP || axis->setup.mode == CIA402_MODE_IP;
    return is_enabled(axis) && is_cyclic && axis->has_followed && !has(axis, CIA402_STATUS_BIT12);
}

static bool is_local(const cia402_axis_t *axis)
{
    return !has(axis, CIA402_STATUS_REMOTE);
}

/* Likewise: bit 4 is not in every drive. */
static bool is_without_voltage(const cia402_axis_t *axis)
{
    return is_enabled(axis) && axis->had_voltage && !has(axis, CIA402_STATUS_VOLTAGE);
}

static bool is_limited(const cia402_axis_t *axis)
{
    return is_enabled(axis) && axis->setup.mode != CIA402_MODE_HOMING && has(axis, CIA402_STATUS_LIMIT);
}

static bool is_warning(const cia402_axis_t *axis)
{
    return has(axis, CIA402_STATUS_WARNING);
}

static const struct {
    bool (*is_seen)(const cia402_axis_t *axis);
    cia402_trouble_t trouble;
    bool is_of_set_points;
} k_watches[CIA402_WATCHES] = {
    [CIA402_WATCH_MODE] = {is_out_of_mode, CIA402_LEFT_MODE, false},
    [CIA402_WATCH_FOLLOWING] = {is_not_following, CIA402_NOT_FOLLOWING, true},
    [CIA402_WATCH_LOCAL] = {is_local, CIA402_REMOTE_OFF, false},
    [CIA402_WATCH_VOLTAGE] = {is_without_voltage, CIA402_NO_VOLTAGE, false},
    [CIA402_WATCH_LIMIT] = {is_limited, CIA402_LIMITED, true},
    [CIA402_WATCH_WARNING] = {is_warning, CIA402_WARNING, false},
    [CIA402_WATCH_MASTER] = {NULL, CIA402_TROUBLE_NONE, false}, /* in no answer: cia402_master.c */
};

void cia402_watch_restart(cia402_axis_t *self)
{
    self->has_followed = false;
    self->had_voltage = false;
    self->has_shown_mode = false;
    self->notes = 0;
    for (unsigned i = 0; i < CIA402_WATCHES; i++) {
        self->watch_answers[i] = 0;
    }
}

static void learn(cia402_axis_t *self)
{
    const bool is_up = is_enabled(self);
    const bool is_in_mode = self->mode_shown == (int8_t)self->setup.mode;
    self->has_shown_mode = is_up && (self->has_shown_mode || is_in_mode);
    self->has_followed = is_up && (self->has_followed || (is_in_mode && has(self, CIA402_STATUS_BIT12)));
    self->had_voltage = is_up && (self->had_voltage || has(self, CIA402_STATUS_VOLTAGE));
}

void cia402_watch_step(cia402_drive_t drive)
{
    cia402_axis_t *self = drive.axis;
    const bool is_answer = self->has_answer;
    self->has_answer = false;
    if (is_answer) {
        learn(self);
    }
    for (unsigned i = 0; i < CIA402_WATCHES; i++) {
        const bool is_seen = k_watches[i].is_seen != NULL && k_watches[i].is_seen(self);
        uint8_t *answers = &self->watch_answers[i];
        *answers = !is_seen ? 0 : (uint8_t)(*answers + (is_answer && *answers < ANSWERS_MIN));
        if (*answers >= ANSWERS_MIN && drive.config->reaction[i] != CIA402_IGNORE) {
            self->notes |= 1u << i;
            self->note_us[i] = drive.now_us;
        } else if (drive.now_us - self->note_us[i] >= NOTE_US) {
            self->notes &= ~(1u << i);
        }
    }
}

cia402_trouble_t cia402_watch_find(cia402_drive_t drive, bool is_following)
{
    for (unsigned i = 0; i < CIA402_WATCHES; i++) {
        const bool is_judged = is_following || !k_watches[i].is_of_set_points;
        if (is_judged && drive.config->reaction[i] == CIA402_STOP && drive.axis->watch_answers[i] >= ANSWERS_MIN) {
            return k_watches[i].trouble;
        }
    }
    return CIA402_TROUBLE_NONE;
}
