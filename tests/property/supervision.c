/* SPDX-License-Identifier: MIT
 * supervision.c - judges supervision; see supervision.h.
 */
#include "supervision.h"

#include <string.h>

#define RESET_US      2000000u /* a reset waits for the drives for so long */
#define CYCLES_TO_ACT 1u       /* a fault found while set-points are taken is seen in the next cycle */

static void wrong(supervision_t *self, const char *what)
{
    if (self->wrong == NULL) {
        self->wrong = what;
        self->wrong_us = self->now_us;
    }
}

hal_udp_peer_t supervision_peer(unsigned host)
{
    return (hal_udp_peer_t){.address = {10, 0, 0, (uint8_t)(host + 1)}, .port = 4000};
}

void supervision_init(supervision_t *self, const rig_t *rig)
{
    memset(self, 0, sizeof *self);
    self->rig = rig;
    self->is_up_asked = rig->settings.engage == ENGAGE_AUTO;
}

void supervision_sent(supervision_t *self, unsigned host, uint64_t timed_ms)
{
    self->has_sent[host] = true;
    self->has_next = true;
    self->is_next_timed = timed_ms != 0;
    const uint64_t until_us = self->rig->now_us + timed_ms * 1000;
    self->next_until_us = until_us > self->next_until_us ? until_us : self->next_until_us;
}

void supervision_asked(supervision_t *self, event_t request)
{
    self->reset_us = request == EVENT_RESET ? self->rig->now_us : self->reset_us;
    self->is_up_asked |= request == EVENT_ENGAGE || request == EVENT_PARK;
    self->asked_us = self->rig->now_us; /* held and resumed between two cycles: silence counts from there */
}

static uint32_t accepted(const snapshot_t *s)
{
    uint32_t sum = 0;
    for (unsigned i = 0; i < FRAME_COMMANDS; i++) {
        sum += s->counters.accepted[i];
    }
    return sum;
}

/* ---- states: what latches stays, and nothing comes up by itself ---- */

static bool is_latched(state_t state)
{
    return state == STATE_FAULT || state == STATE_ESTOP;
}

static void judge_states(supervision_t *self, state_t state)
{
    if (is_latched(self->state) && !is_latched(state)) {
        if (self->reset_us == 0 || self->now_us > self->reset_us + RESET_US) {
            wrong(self, "a latched state was left without a reset");
        }
        self->is_up_asked = false;
    }
    if (self->state == STATE_ESTOP && state == STATE_FAULT) {
        wrong(self, "an e-stop became a fault");
    }
    if (is_latched(state) && !is_latched(self->state)) {
        self->reset_us = 0;
    }
    if (self->state == STATE_OFF && state != STATE_OFF && !is_latched(state) && !self->is_up_asked) {
        wrong(self, "it came up by itself");
    }
    if (state == STATE_HOLD && self->state != STATE_HOLD) {
        self->before_hold = self->state;
        self->hold_us = self->now_us;
    }
    if (state == STATE_ENGAGED && self->state != STATE_ENGAGED) {
        self->engaged_us = self->now_us;
    }
}

/* ---- relays: the sender's in a ride and a little after, else safe ---- */

static void judge_relays(supervision_t *self, state_t state)
{
    const settings_t *settings = &self->rig->settings;
    const bool is_ride_held = state == STATE_HOLD && self->before_hold == STATE_ENGAGED &&
                              self->now_us - self->hold_us < settings->relay_safe_after_ms * UINT64_C(1000);
    if (state != STATE_ENGAGED && !is_ride_held && self->rig->relays.mask != settings->relay_safe_mask) {
        wrong(self, "relays are not safe");
    }
}

/* ---- drives: all of them together ---- */

static bool is_bad(const sim_drive_t *axis)
{
    return axis->is_offline || axis->state == DRIVE_FAULT;
}

static void judge_drives(supervision_t *self, state_t state)
{
    const sim_drives_t *drives = &self->rig->drives;
    bool has_bad = false, has_torque = false;
    for (unsigned i = 0; i < drives->count; i++) {
        has_bad |= is_bad(&drives->axis[i]);
        has_torque |= !is_bad(&drives->axis[i]) && drives->axis[i].state == DRIVE_ENABLED;
    }
    const uint64_t grace_us = CYCLES_TO_ACT * (uint64_t)self->rig->settings.cycle_us;
    if (drives->is_busy) { /* nothing can be told to them */
        self->busy_us = self->now_us;
    }
    const bool can_act = self->busy_us == 0 || self->now_us > self->busy_us + grace_us;
    if (!has_bad) {
        self->bad_us = 0;
    } else if (self->bad_us == 0) {
        self->bad_us = self->now_us;
        self->faults++;
    }
    if (has_torque && can_act && has_bad && self->now_us > self->bad_us + grace_us) {
        wrong(self, "one drive has stopped and another one has torque");
    }
    const bool is_estop = (self->rig->inputs.levels & INPUT_ESTOP) != 0;
    if (is_estop && state != STATE_ESTOP) {
        wrong(self, "the e-stop is open and it is not in ESTOP");
    }
    if (is_estop && has_torque && can_act) {
        wrong(self, "the e-stop is open and a drive has torque");
    }
    self->estops += is_estop && self->state != STATE_ESTOP;
}

/* ---- senders ---- */

/* What was sent before this cycle, and whether it counted. */
static void take_frames(supervision_t *self, const snapshot_t *s)
{
    const uint32_t count = accepted(s);
    const unsigned other = 1u - self->owner;
    if (count != self->accepted) {
        self->frame_us = self->now_us;
        if (self->has_sent[0] != self->has_sent[1]) { /* else nobody knows whose it was */
            self->heard_us[self->has_sent[other] ? other : self->owner] = self->now_us;
        }
        self->timed_until_us = self->has_next && !self->is_next_timed ? 0 : self->timed_until_us;
    }
    /* not taken or not: later rather than sooner */
    self->timed_until_us = self->next_until_us > self->timed_until_us ? self->next_until_us : self->timed_until_us;
    self->next_until_us = 0;
    self->has_next = self->has_sent[0] = self->has_sent[1] = false;
    self->accepted = count;
}

static void judge_owner(supervision_t *self, const snapshot_t *s)
{
    if (!s->owner.is_taken || s->owner.peer.address[0] != 10) {
        return;
    }
    const uint8_t owner = (uint8_t)(s->owner.peer.address[3] - 1);
    const uint64_t heard_us = self->heard_us[self->owner];
    const uint64_t takeover_us = self->rig->settings.takeover_ms * UINT64_C(1000);
    if (owner != self->owner) {
        if (heard_us != 0 && self->now_us - heard_us < takeover_us) {
            wrong(self, "the sender was replaced before its silence");
        }
        self->owners++;
        self->owner = owner;
        self->heard_us[owner] = self->now_us;
        self->frame_us = self->now_us; /* perhaps by a frame that it could not follow */
    }
}

static void watch_motion(supervision_t *self)
{
    if (memcmp(self->sent_q32, self->rig->sent_q32, sizeof self->sent_q32) != 0 || self->rig->drives.is_busy) {
        self->moved_us = self->now_us;
    }
    memcpy(self->sent_q32, self->rig->sent_q32, sizeof self->sent_q32);
}

static uint64_t latest(uint64_t a, uint64_t b)
{
    return a > b ? a : b;
}

/* Not before its time; and, where nothing moves any more and no move may be under way, not after it. */
static void judge_silence(supervision_t *self, const snapshot_t *s)
{
    const uint64_t hold_us = self->rig->settings.silence_hold_ms * UINT64_C(1000);
    const uint64_t heard_us = latest(self->frame_us, self->engaged_us);
    const uint64_t busy_until_us = latest(self->timed_until_us, self->moved_us);
    const uint64_t due_us = latest(latest(heard_us, self->asked_us), busy_until_us) + hold_us;
    if (self->state == STATE_ENGAGED && s->state == STATE_HOLD && s->is_held_by_silence) {
        self->holds++;
        if (self->now_us < heard_us + hold_us) {
            wrong(self, "held by silence before its time");
        }
    }
    if (s->state == STATE_ENGAGED && self->now_us > due_us + 2 * (uint64_t)self->rig->settings.cycle_us) {
        wrong(self, "nobody has sent anything, and it goes on");
    }
}

void supervision_judge(supervision_t *self)
{
    const snapshot_t *s = &self->rig->gateway.snapshot;
    self->now_us = s->now_us;
    judge_states(self, s->state);
    take_frames(self, s);
    watch_motion(self);
    judge_owner(self, s);
    judge_silence(self, s);
    judge_relays(self, s->state);
    judge_drives(self, s->state);
    self->state = s->state;
}
