/* SPDX-License-Identifier: MIT
 * sender.c - see sender.h.
 */
#include "sender.h"

#include "auto_engage.h"
#include "actions.h"
#include "target.h"

#define STREAM_PERIOD_US 250000u /* frames that follow each other so quickly may be those of a stream */

static void refuse(gateway_t *self, frame_command_t command, frame_error_t error, const char *why, const hal_udp_peer_t *from,
                   uint64_t now_us)
{
    const frame_receiver_io_t io = {self->io.udp, self->io.log, &self->snapshot.counters};
    frame_receiver_refuse(&self->receiver, &io, command, error, why, from, now_us);
}

/* One line where the digits of a value have been taken for masks. */
static void log_digits(gateway_t *self, uint64_t now_us)
{
    if (self->sender.digits_logged_us == 0 || now_us - self->sender.digits_logged_us >= REJECT_LOG_INTERVAL_US) {
        hal_log_write(self->io.log, HAL_LOG_WARNING,
                      "relay masks change like the digits of a value, relays stay at safe_mask: decimal commas? ([udp] mask)");
        self->sender.digits_logged_us = now_us;
    }
}

/* Whether the frame has a mask that relays may follow. */
static bool has_relay_mask(gateway_t *self, const frame_t *frame, uint64_t now_us)
{
    mask_guard_t *guard = &self->sender.mask_guard;
    const bool was_digits = guard->is_digits;
    if (!frame->has_mask || mask_guard_follows(guard, self->settings->mask_policy, frame->relay_mask)) {
        return frame->has_mask;
    }
    if (guard->is_digits) {
        self->sender.frame_mask = self->settings->relay_safe_mask;
    }
    if (guard->is_digits && !was_digits) {
        log_digits(self, now_us);
    }
    return false;
}

/* What the sender asks of the relays; bits that no relay has are counted. */
static void take_mask(gateway_t *self, const frame_t *frame)
{
    const uint16_t wired = (uint16_t)((1u << self->settings->relays.count) - 1u);
    self->snapshot.counters.relay_missing += (frame->relay_mask & FRAME_RELAY_MASK & ~(unsigned)wired) != 0;
    self->sender.frame_mask = frame->relay_mask & wired;
}

/* Axes of a pose and the rotation motor, or cylinders. */
static const char *axis_text(motion_space_t space, unsigned axis)
{
    static const char *const k_axes[AXES_MAX] = {"roll", "pitch", "yaw", "x", "y", "z", "angle"};
    static const char *const k_cylinders_1_to_6[CYLINDERS_MAX] = {"cylinder 1", "cylinder 2", "cylinder 3",
                                                                  "cylinder 4", "cylinder 5", "cylinder 6"};
    return space == MOTION_CYLINDERS && axis < CYLINDERS_MAX ? k_cylinders_1_to_6[axis] : k_axes[axis];
}

/* One line about a value of the sender that drives. */
static void log_not_followed(gateway_t *self, const char *what, const char *why, const confirm_jump_t *jump, uint32_t suppressed)
{
    char line[HAL_LOG_TEXT_MAX + 1];
    char peer[HAL_UDP_PEER_TEXT_MAX];
    text_t text = text_start(line, sizeof line);
    (void)hal_udp_peer_text(&self->sender.owner.peer, peer, sizeof peer);
    text_put(&text, what);
    text_put(&text, " from ");
    text_put(&text, peer);
    text_put(&text, " not followed, ");
    text_put(&text, why);
    text_put(&text, ": ");
    text_put(&text, axis_text(jump->space, jump->axis));
    text_put(&text, " ");
    text_put_q32(&text, jump->value_q32, 1);
    text_put(&text, " after ");
    text_put_q32(&text, jump->from_q32, 1);
    frame_receiver_put_suppressed(&text, suppressed);
    hal_log_write(self->io.log, HAL_LOG_WARNING, line);
}

/* One line for the first spike of a burst; what is left out is told with a later one. */
static void log_spikes(gateway_t *self, uint64_t now_us)
{
    const spike_filter_t *gate = motion_spike_filter(&self->motion);
    const uint32_t unlogged = spike_filter_spikes(gate) - self->sender.spikes_logged;
    if (unlogged == 0 || (self->sender.spike_logged_us != 0 && now_us - self->sender.spike_logged_us < REJECT_LOG_INTERVAL_US)) {
        return;
    }
    const spike_t *spike = spike_filter_last_spike(gate);
    const confirm_jump_t jump = {MOTION_POSE, spike->axis, spike->value_q32, spike->before_q32};
    log_not_followed(self, "sample", "a spike", &jump, unlogged - 1);
    self->sender.spike_logged_us = now_us;
    self->sender.spikes_logged += unlogged;
}

/* The same of far jumps. */
static void log_jumps(gateway_t *self, uint64_t now_us)
{
    const uint32_t unlogged = self->sender.confirm.dropped - self->sender.jumps_logged;
    if (unlogged == 0 || (self->sender.jump_logged_us != 0 && now_us - self->sender.jump_logged_us < REJECT_LOG_INTERVAL_US)) {
        return;
    }
    log_not_followed(self, "frame", "a far jump that no second one confirmed", &self->sender.confirm.drop, unlogged - 1);
    self->sender.jump_logged_us = now_us;
    self->sender.jumps_logged += unlogged;
}

/* One line for the first frame of a sender that does not drive, and then at times. */
HV_OWN_FRAME static void log_other(gateway_t *self, const hal_udp_peer_t *from, uint64_t now_us)
{
    if (self->sender.other_logged_us != 0 && now_us - self->sender.other_logged_us < REJECT_LOG_INTERVAL_US) {
        self->sender.other_suppressed++;
        return;
    }
    char line[HAL_LOG_TEXT_MAX + 1];
    char peer[HAL_UDP_PEER_TEXT_MAX];
    text_t text = text_start(line, sizeof line);
    text_put(&text, "frame from ");
    (void)hal_udp_peer_text(from, peer, sizeof peer);
    text_put(&text, peer);
    text_put(&text, " not followed: ");
    (void)hal_udp_peer_text(&self->sender.owner.peer, peer, sizeof peer);
    text_put(&text, peer);
    text_put(&text, " drives");
    frame_receiver_put_suppressed(&text, self->sender.other_suppressed);
    hal_log_write(self->io.log, HAL_LOG_WARNING, line);
    self->sender.other_logged_us = now_us;
    self->sender.other_suppressed = 0;
}

/* What the next rotations are nearest to, where they count modulo one turn. */
static void keep_rotation(gateway_t *self, const pose_t *pose)
{
    for (unsigned i = AXIS_ROLL; i <= AXIS_YAW; i++) {
        const axis_settings_t *axis = &self->settings->axis[i];
        self->sender.rotation_deg_q32[i] = fx_clamp(pose->axis_q32[i], q32_from_q16(axis->min_q16), q32_from_q16(axis->max_q16));
    }
}

/* A sender takes over from another: the platform stops and goes to its first pose at engage speed. */
HV_OWN_FRAME static void change_owner(gateway_t *self, uint64_t now_us)
{
    char line[HAL_LOG_TEXT_MAX + 1];
    char peer[HAL_UDP_PEER_TEXT_MAX];
    text_t text = text_start(line, sizeof line);
    (void)hal_udp_peer_text(&self->sender.owner.peer, peer, sizeof peer);
    text_put(&text, peer);
    text_put(&text, " drives from now on");
    hal_log_write(self->io.log, HAL_LOG_NOTICE, line);
    self->snapshot.counters.owner_changes++;
    confirm_restart(&self->sender.confirm); /* what waits is another sender's */
    keep_rotation(self, &self->output.sent);
    if (self->supervisor.state == STATE_ENGAGED) {
        actions_follow(self, now_us);
    }
}

/* Whether the frame is of the sender that drives; keeps who that is. */
static bool is_followed(gateway_t *self, const hal_udp_peer_t *from, uint64_t now_us)
{
    const settings_t *settings = self->settings;
    const bool was_port_fixed = self->sender.owner.is_port_fixed;
    const owner_verdict_t verdict = owner_judge(&self->sender.owner, from, (uint64_t)settings->takeover_ms * 1000,
                                                &settings->priority, motion_timed_end_us(&self->motion), now_us);
    if (verdict == OWNER_OTHER) {
        self->snapshot.counters.other_sender++;
        self->snapshot.other = (owner_t){.is_taken = true, .peer = *from, .last_us = now_us};
        log_other(self, from, now_us);
    } else if (verdict == OWNER_NEW) {
        change_owner(self, now_us);
    }
    if (self->sender.owner.is_port_fixed && !was_port_fixed) {
        hal_log_write(self->io.log, HAL_LOG_WARNING,
                      "programs of one address send by turns: one of them drives, told by its port; end the others");
    }
    return verdict != OWNER_OTHER;
}

/* False for a frame that is no silence, but none of the sender's either: its sender may be taken over as if it had not come. */
static bool is_of_its_form(gateway_t *self, const frame_t *frame, const hal_udp_peer_t *from, uint64_t now_us)
{
    self->sender.is_known = owner_is_known(&self->sender.owner, from);
    return mask_guard_allows(self->settings->mask_policy, frame) &&
           (!self->sender.is_known || mask_guard_passes(&self->sender.mask_guard, self->settings->mask_policy, frame, now_us));
}

/* The first frame of a sender, or of a new port of it: another program. What was learnt of the last one is not true of it. */
static void begin_sender(gateway_t *self, const frame_t *frame, uint64_t now_us)
{
    mask_guard_restart(&self->sender.mask_guard);
    (void)mask_guard_passes(&self->sender.mask_guard, self->settings->mask_policy, frame, now_us);
    self->sender.rotations = (rotations_t){.is_there = {false}};
}

/* Whoever sends no masks asks for nothing: an effect that an earlier frame began does not go on. Where all senders are followed,
 * another one may have asked for it. */
static void watch_mask_habit(gateway_t *self)
{
    if (self->settings->takeover_ms != 0 &&
        mask_guard_habit(&self->sender.mask_guard, self->settings->mask_policy) == MASK_NONE &&
        self->sender.frame_mask != self->settings->relay_safe_mask) {
        self->sender.frame_mask = self->settings->relay_safe_mask;
        hal_log_write(self->io.log, HAL_LOG_WARNING,
                      "frames here have no relay masks any more: relays go to safe_mask ([udp] mask = any keeps them)");
    }
}

HV_OWN_FRAME static void refuse_form(gateway_t *self, const frame_t *frame, const hal_udp_peer_t *from, uint64_t now_us)
{
    refuse(self, frame->command, FRAME_ERR_MASK_FORM,
           frame->has_mask ? "it has a relay mask, and frames here have none: a decimal comma, or a value too many? ([udp] mask)"
                           : "it has no relay mask, and frames here have one: a value too few? ([udp] mask)",
           from, now_us);
}

/* Tells motion of a target.
 * Returns false: it is impossible, and has been refused. */
static bool tell_motion(gateway_t *self, const motion_target_t *target, frame_command_t command, const hal_udp_peer_t *from,
                        uint64_t now_us)
{
    if (self->supervisor.state == STATE_ENGAGED &&
        motion_target(&self->motion, target, now_us - self->receiver.waited_us) != HV_OK) {
        self->snapshot.counters.impossible++;
        refuse(self, command, FRAME_ERR_PLATFORM, "no pose has these extensions, or one too near a singularity", from, now_us);
        return false;
    }
    log_spikes(self, now_us);
    return true;
}

/* The first ones of a cycle at once; then the newest one waits until there is no newer one, and counts as possible. */
static bool take_target(gateway_t *self, const motion_target_t *target, frame_command_t command, const hal_udp_peer_t *from,
                        uint64_t now_us)
{
    self->sender.targets++;
    if (self->sender.targets <= GATEWAY_TARGETS_PER_CYCLE) {
        return tell_motion(self, target, command, from, now_us);
    }
    self->sender.has_newest = true;
    self->sender.newest = *target;
    self->sender.newest_command = command;
    self->sender.newest_from = *from;
    return true;
}

/* Where the platform is, as a target of that space. */
static motion_target_t here(const gateway_t *self, motion_space_t space)
{
    motion_target_t target = {
        .space = space, .has_angle = self->settings->has_angle, .angle_deg_q32 = self->output.angle_deg_q32};
    for (unsigned i = 0; i < POSE_AXES; i++) {
        target.value_q32[i] = space == MOTION_POSE ? self->output.sent.axis_q32[i] : self->output.extension_mm_q32[i];
    }
    return target;
}

/* False for a far jump that waits for a second frame. */
HV_OWN_FRAME static bool is_confirmed(gateway_t *self, const motion_target_t *target, uint64_t now_us)
{
    const bool is_asked_for = self->settings->confirm_jump_mm_q16 != 0 || self->settings->confirm_jump_deg_q16 != 0;
    if (!is_asked_for || self->supervisor.state != STATE_ENGAGED) {
        return true;
    }
    const confirm_distance_t distance = {q32_from_q16(self->settings->confirm_jump_mm_q16),
                                         q32_from_q16(self->settings->confirm_jump_deg_q16)};
    const motion_target_t from = here(self, target->space);
    return confirm_passes(&self->sender.confirm, &distance, &from, target, now_us);
}

static void keep_asked_rotation(gateway_t *self, const motion_target_t *target)
{
    if (target->space == MOTION_POSE) {
        pose_t pose;
        for (unsigned i = 0; i < POSE_AXES; i++) {
            pose.axis_q32[i] = target->value_q32[i];
        }
        keep_rotation(self, &pose);
    }
}

/* Follows a target that nothing is to be waited for.
 * Returns false: it is impossible, and has been refused. */
static bool follow(gateway_t *self, const motion_target_t *target, frame_command_t command, const hal_udp_peer_t *from,
                   uint64_t now_us)
{
    const bool is_taken = take_target(self, target, command, from, now_us);
    if (is_taken) {
        confirm_followed(&self->sender.confirm, target);
        keep_asked_rotation(self, target);
    }
    return is_taken;
}

/* One line where a sender's angles go round from 0 to 360, say, and the platform would swing from one side to the other. */
HV_OWN_FRAME static void watch_turn(gateway_t *self, const frame_t *frame, uint64_t now_us)
{
    const rotations_t now = target_rotations(frame);
    const unsigned axis = target_jumps_by_turn(self->settings, &self->sender.rotations, &now);
    const bool is_stream = now_us - self->snapshot.last_frame_us < STREAM_PERIOD_US;
    const bool is_due = self->sender.turn_logged_us == 0 || now_us - self->sender.turn_logged_us >= REJECT_LOG_INTERVAL_US;
    self->sender.rotations = now;
    if (axis == AXES_MAX || !is_stream || !is_due) {
        return;
    }
    char line[HAL_LOG_TEXT_MAX + 1];
    text_t text = text_start(line, sizeof line);
    text_put(&text, axis_text(MOTION_POSE, axis));
    text_put(&text, " jumps by nearly a whole turn from one frame to the next: set [");
    text_put(&text, axis_text(MOTION_POSE, axis));
    text_put(&text, "] wrap = shortest if this sender counts from 0 to 360, or from -180 to 180");
    hal_log_write(self->io.log, HAL_LOG_WARNING, line);
    self->sender.turn_logged_us = now_us;
}

/* As a target, by the last one of each axis that turns. */
static motion_target_t target_from(gateway_t *self, const frame_t *frame, uint64_t now_us)
{
    q32_t last_deg_q32[AXES_MAX] = {[AXIS_ANGLE] = motion_angle_target(&self->motion)};
    if (self->supervisor.state != STATE_ENGAGED) {
        keep_rotation(self, &self->output.sent);
    }
    for (unsigned i = AXIS_ROLL; i <= AXIS_YAW; i++) {
        last_deg_q32[i] = self->sender.rotation_deg_q32[i];
    }
    watch_turn(self, frame, now_us);
    return target_of(self->settings, last_deg_q32, frame);
}

void sender_take(gateway_t *self, const frame_t *frame, uint64_t now_us)
{
    const hal_udp_peer_t *from = &self->receiver.from;
    const char *missing = target_missing(frame->command, kin_cylinders(motion_kin(&self->motion)), self->settings->has_angle);
    if (missing != NULL) {
        refuse(self, frame->command, FRAME_ERR_PLATFORM, missing, from, now_us);
        return;
    }
    if (!is_of_its_form(self, frame, from, now_us)) {
        refuse_form(self, frame, from, now_us);
        return;
    }
    if (!is_followed(self, from, now_us)) {
        return;
    }
    if (!self->sender.is_known) {
        begin_sender(self, frame, now_us);
    }
    auto_engage_frame(&self->auto_engage, now_us);
    const motion_target_t target = target_from(self, frame, now_us);
    actions_event(self, EVENT_FRAME, now_us);
    const bool is_waiting = !is_confirmed(self, &target, now_us);
    if (!is_waiting && !follow(self, &target, frame->command, from, now_us)) {
        return;
    }
    const bool has_mask = has_relay_mask(self, frame, now_us);
    watch_mask_habit(self);
    target_received(&self->snapshot, frame);
    counters_t *counters = &self->snapshot.counters;
    counters->accepted[frame->command]++;
    counters->accepted_timed += frame->is_timed;
    self->snapshot.last_frame_us = now_us;
    self->sender.start_us = now_us;
    if (self->supervisor.state != STATE_ENGAGED) {
        counters->not_followed++;
    } else if (!is_waiting && has_mask) {
        take_mask(self, frame);
    }
}

void sender_begin(gateway_t *self, uint64_t now_us)
{
    self->sender.targets = 0;
    confirm_cycle(&self->sender.confirm, now_us);
}

void sender_end(gateway_t *self, uint64_t now_us)
{
    if (self->sender.has_newest) {
        self->sender.has_newest = false;
        (void)tell_motion(self, &self->sender.newest, self->sender.newest_command, &self->sender.newest_from, now_us);
    }
    log_jumps(self, now_us);
}
