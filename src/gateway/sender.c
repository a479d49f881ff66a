/* SPDX-License-Identifier: MIT
 * sender.c - see sender.h.
 */
#include "sender.h"

#include "log_limit.h"
#include "target.h"

#define STREAM_PERIOD_US 250000u /* frames that follow each other so quickly may be those of a stream */

static void reject(const sender_in_t *in, frame_command_t command, frame_error_t error, const char *why,
                   const hal_udp_peer_t *from)
{
    frame_receiver_reject(in->receiver, &in->io, command, error, why, from, in->now_us);
}

/* Whether the frame has a mask that relays may follow. */
static bool has_relay_mask(sender_t *self, const sender_in_t *in, const frame_t *frame)
{
    mask_guard_t *guard = &self->mask_guard;
    const bool was_digits = guard->is_digits;
    if (!frame->has_mask || mask_guard_follows(guard, in->settings->mask_policy, frame->relay_mask)) {
        return frame->has_mask;
    }
    if (guard->is_digits) {
        self->frame_mask = in->settings->relay_safe_mask;
    }
    if (guard->is_digits && !was_digits && log_limit_event(&self->digits_log, in->now_us) > 0) {
        hal_log_write(in->io.log, HAL_LOG_WARNING,
                      "relay masks change like the digits of a value, relays stay at safe_mask: decimal commas? ([udp] mask)");
    }
    return false;
}

/* What the sender asks of the relays; bits that no relay has are counted. */
static void apply_mask(sender_t *self, const sender_in_t *in, const frame_t *frame)
{
    const uint16_t wired = (uint16_t)((1u << in->settings->relays.count) - 1u);
    in->io.counters->relay_missing += (frame->relay_mask & FRAME_RELAY_MASK & ~(unsigned)wired) != 0;
    self->frame_mask = frame->relay_mask & wired;
}

/* Axes of a pose and the rotation motor, or cylinders. */
static const char *axis_text(motion_space_t space, unsigned axis)
{
    static const char *const k_axes[AXES_MAX] = {"roll", "pitch", "yaw", "x", "y", "z", "angle"};
    static const char *const k_cylinders_1_to_6[CYLINDERS_MAX] = {"cylinder 1", "cylinder 2", "cylinder 3",
                                                                  "cylinder 4", "cylinder 5", "cylinder 6"};
    return space == MOTION_CYLINDERS && axis < CYLINDERS_MAX ? k_cylinders_1_to_6[axis] : k_axes[axis];
}

static void put_peer(text_t *text, const hal_udp_peer_t *peer)
{
    char name[HAL_UDP_PEER_TEXT_MAX];
    (void)hal_udp_peer_text(peer, name, sizeof name);
    text_put(text, name);
}

/* One line about a value of the sender that drives. */
static void log_not_followed(const sender_t *self, const sender_in_t *in, const char *what, const char *why,
                             const confirm_jump_t *jump, uint32_t count)
{
    char line[HAL_LOG_TEXT_MAX + 1];
    text_t text = text_start(line, sizeof line);
    text_put(&text, what);
    text_put(&text, " from ");
    put_peer(&text, &self->owner.peer);
    text_put(&text, " not followed, ");
    text_put(&text, why);
    text_put(&text, ": ");
    text_put(&text, axis_text(jump->space, jump->axis));
    text_put(&text, " ");
    text_put_q32(&text, jump->value_q32, 1);
    text_put(&text, " after ");
    text_put_q32(&text, jump->from_q32, 1);
    log_limit_put(&text, count);
    hal_log_write(in->io.log, HAL_LOG_WARNING, line);
}

static void log_spikes(sender_t *self, const sender_in_t *in)
{
    const spike_filter_t *gate = motion_spike_filter(in->motion);
    const uint32_t count = log_limit_due(&self->spike_log, spike_filter_spikes(gate), in->now_us);
    if (count > 0) {
        const spike_t *spike = spike_filter_last_spike(gate);
        const confirm_jump_t jump = {MOTION_POSE, spike->axis, spike->value_q32, spike->before_q32};
        log_not_followed(self, in, "sample", "a spike", &jump, count);
    }
}

static void log_jumps(sender_t *self, const sender_in_t *in)
{
    const uint32_t count = log_limit_due(&self->jump_log, self->confirm.dropped, in->now_us);
    if (count > 0) {
        log_not_followed(self, in, "frame", "a far jump that no second one confirmed", &self->confirm.drop, count);
    }
}

/* One line for the first frame of a sender that does not drive, and then at times. */
HV_OWN_FRAME static void log_other(sender_t *self, const sender_in_t *in, const hal_udp_peer_t *from)
{
    const uint32_t count = log_limit_due(&self->other_log, in->io.counters->other_sender, in->now_us);
    if (count == 0) {
        return;
    }
    char line[HAL_LOG_TEXT_MAX + 1];
    text_t text = text_start(line, sizeof line);
    text_put(&text, "frame from ");
    put_peer(&text, from);
    text_put(&text, " not followed: ");
    put_peer(&text, &self->owner.peer);
    text_put(&text, " drives");
    log_limit_put(&text, count);
    hal_log_write(in->io.log, HAL_LOG_WARNING, line);
}

/* What the next rotations are nearest to, where they count modulo one turn. */
static void keep_rotation(sender_t *self, const sender_in_t *in, const q32_t pose_q32[POSE_AXES])
{
    for (unsigned i = AXIS_ROLL; i <= AXIS_YAW; i++) {
        const axis_settings_t *axis = &in->settings->axis[i];
        self->rotation_deg_q32[i] = fx_clamp(pose_q32[i], q32_from_q16(axis->min_q16), q32_from_q16(axis->max_q16));
    }
}

/* A sender takes over from another. */
HV_OWN_FRAME static void change_owner(sender_t *self, const sender_in_t *in)
{
    char line[HAL_LOG_TEXT_MAX + 1];
    text_t text = text_start(line, sizeof line);
    put_peer(&text, &self->owner.peer);
    text_put(&text, " drives from now on");
    hal_log_write(in->io.log, HAL_LOG_NOTICE, line);
    in->io.counters->owner_changes++;
    confirm_restart(&self->confirm); /* what waits is another sender's */
    keep_rotation(self, in, in->output->sent.axis_q32);
}

/* Keeps who drives. */
static owner_verdict_t judge_owner(sender_t *self, const sender_in_t *in, const hal_udp_peer_t *from)
{
    const bool was_port_fixed = self->owner.is_port_fixed;
    const owner_verdict_t verdict = owner_judge(&self->owner, from, (uint64_t)in->settings->takeover_ms * 1000,
                                                &in->settings->priority, motion_timed_end_us(in->motion), in->now_us);
    if (verdict == OWNER_OTHER) {
        in->io.counters->other_sender++;
        self->other = (owner_t){.is_taken = true, .peer = *from, .last_us = in->now_us};
        log_other(self, in, from);
    } else if (verdict == OWNER_NEW) {
        change_owner(self, in);
    }
    if (self->owner.is_port_fixed && !was_port_fixed) {
        hal_log_write(in->io.log, HAL_LOG_WARNING,
                      "programs of one address send by turns: one of them drives, told by its port; end the others");
    }
    return verdict;
}

/* False for a frame that is no silence, but none of the sender's either: its sender may be taken over as if it had not come. */
static bool is_of_its_form(sender_t *self, const sender_in_t *in, const frame_t *frame, bool is_known)
{
    return mask_guard_allows(in->settings->mask_policy, frame) &&
           (!is_known || mask_guard_passes(&self->mask_guard, in->settings->mask_policy, frame, in->now_us));
}

/* The first frame of a sender, or of a new port of it: another program. What was learnt of the last one is not true of it. */
static void begin_sender(sender_t *self, const sender_in_t *in, const frame_t *frame)
{
    mask_guard_restart(&self->mask_guard);
    (void)mask_guard_passes(&self->mask_guard, in->settings->mask_policy, frame, in->now_us);
    self->rotations = (rotations_t){.is_there = {false}};
}

/* Whoever sends no masks asks for nothing: an effect that an earlier frame began does not go on. Where all senders are followed,
 * another one may have asked for it. */
static void watch_mask_habit(sender_t *self, const sender_in_t *in)
{
    if (in->settings->takeover_ms != 0 && mask_guard_habit(&self->mask_guard, in->settings->mask_policy) == MASK_NONE &&
        self->frame_mask != in->settings->relay_safe_mask) {
        self->frame_mask = in->settings->relay_safe_mask;
        hal_log_write(in->io.log, HAL_LOG_WARNING,
                      "frames here have no relay masks any more: relays go to safe_mask ([udp] mask = any keeps them)");
    }
}

HV_OWN_FRAME static void reject_form(const sender_in_t *in, const frame_t *frame)
{
    reject(in, frame->command, FRAME_ERR_MASK_FORM,
           frame->has_mask ? "it has a relay mask, and frames here have none: a decimal comma, or a value too many? ([udp] mask)"
                           : "it has no relay mask, and frames here have one: a value too few? ([udp] mask)",
           &in->receiver->from);
}

/* Tells motion of a target.
 * Returns false: it is impossible, and has been refused. */
static bool send_target(sender_t *self, const sender_in_t *in, const motion_target_t *target, frame_command_t command,
                        const hal_udp_peer_t *from)
{
    if (in->state == STATE_ENGAGED && motion_target(in->motion, target, in->now_us - in->receiver->waited_us) != HV_OK) {
        in->io.counters->impossible++;
        reject(in, command, FRAME_ERR_PLATFORM, "no pose has these extensions, or one too near a singularity", from);
        return false;
    }
    log_spikes(self, in);
    return true;
}

/* The first ones of a cycle at once; then the newest one waits until there is no newer one, and counts as possible. */
static bool queue_target(sender_t *self, const sender_in_t *in, const motion_target_t *target, frame_command_t command)
{
    self->targets++;
    if (self->targets <= GATEWAY_TARGETS_PER_CYCLE) {
        return send_target(self, in, target, command, &in->receiver->from);
    }
    self->has_newest = true;
    self->newest = *target;
    self->newest_command = command;
    self->newest_from = in->receiver->from;
    return true;
}

/* Where the platform is, as a target of that space. */
static motion_target_t here(const sender_in_t *in, motion_space_t space)
{
    motion_target_t target = {.space = space, .has_angle = in->settings->has_angle, .angle_deg_q32 = in->output->angle_deg_q32};
    for (unsigned i = 0; i < POSE_AXES; i++) {
        target.value_q32[i] = space == MOTION_POSE ? in->output->sent.axis_q32[i] : in->output->extension_mm_q32[i];
    }
    return target;
}

/* False for a far jump that waits for a second frame. */
HV_OWN_FRAME static bool is_confirmed(sender_t *self, const sender_in_t *in, const motion_target_t *target)
{
    const bool is_asked_for = in->settings->confirm_jump_mm_q16 != 0 || in->settings->confirm_jump_deg_q16 != 0;
    if (!is_asked_for || in->state != STATE_ENGAGED) {
        return true;
    }
    const confirm_distance_t distance = {q32_from_q16(in->settings->confirm_jump_mm_q16),
                                         q32_from_q16(in->settings->confirm_jump_deg_q16)};
    const motion_target_t from = here(in, target->space);
    return confirm_passes(&self->confirm, &distance, &from, target, in->now_us);
}

/* Follows a target that nothing is to be waited for.
 * Returns false: it is impossible, and has been refused. */
static bool follow(sender_t *self, const sender_in_t *in, const motion_target_t *target, frame_command_t command)
{
    const bool is_taken = queue_target(self, in, target, command);
    if (is_taken) {
        confirm_followed(&self->confirm, target);
    }
    if (is_taken && target->space == MOTION_POSE) {
        keep_rotation(self, in, target->value_q32);
    }
    return is_taken;
}

/* One line where a sender's angles go round from 0 to 360, say, and the platform would swing from one side to the other. */
HV_OWN_FRAME static void watch_turn(sender_t *self, const sender_in_t *in, const frame_t *frame)
{
    const rotations_t now = target_rotations(frame);
    const unsigned axis = target_jumps_by_turn(in->settings, &self->rotations, &now);
    const bool is_stream = in->now_us - self->last_frame_us < STREAM_PERIOD_US;
    self->rotations = now;
    if (axis == AXES_MAX || !is_stream || log_limit_event(&self->turn_log, in->now_us) == 0) {
        return;
    }
    char line[HAL_LOG_TEXT_MAX + 1];
    text_t text = text_start(line, sizeof line);
    text_put(&text, axis_text(MOTION_POSE, axis));
    text_put(&text, " jumps by nearly a whole turn from one frame to the next: set [");
    text_put(&text, axis_text(MOTION_POSE, axis));
    text_put(&text, "] wrap = shortest if this sender counts from 0 to 360, or from -180 to 180");
    hal_log_write(in->io.log, HAL_LOG_WARNING, line);
}

sender_verdict_t sender_judge(sender_t *self, const sender_in_t *in, const frame_t *frame)
{
    const hal_udp_peer_t *from = &in->receiver->from;
    const char *missing = target_missing(frame->command, kin_cylinders(motion_kin(in->motion)), in->settings->has_angle);
    const bool is_known = owner_is_known(&self->owner, from);
    if (missing != NULL) {
        reject(in, frame->command, FRAME_ERR_PLATFORM, missing, from);
        return SENDER_REFUSED;
    }
    if (!is_of_its_form(self, in, frame, is_known)) {
        reject_form(in, frame);
        return SENDER_REFUSED;
    }
    const owner_verdict_t verdict = judge_owner(self, in, from);
    if (verdict == OWNER_OTHER) {
        return SENDER_REFUSED;
    }
    if (!is_known) {
        begin_sender(self, in, frame);
    }
    return verdict == OWNER_NEW ? SENDER_NEW : SENDER_DRIVES;
}

motion_target_t sender_target(sender_t *self, const sender_in_t *in, const frame_t *frame)
{
    q32_t last_deg_q32[AXES_MAX] = {[AXIS_ANGLE] = motion_angle_target(in->motion)};
    if (in->state != STATE_ENGAGED) {
        keep_rotation(self, in, in->output->sent.axis_q32);
    }
    for (unsigned i = AXIS_ROLL; i <= AXIS_YAW; i++) {
        last_deg_q32[i] = self->rotation_deg_q32[i];
    }
    watch_turn(self, in, frame);
    return target_of(in->settings, last_deg_q32, frame);
}

bool sender_follow(sender_t *self, const sender_in_t *in, const frame_t *frame, const motion_target_t *target)
{
    counters_t *counters = in->io.counters;
    const bool is_waiting = !is_confirmed(self, in, target);
    if (!is_waiting && !follow(self, in, target, frame->command)) {
        return false;
    }
    const bool has_mask = has_relay_mask(self, in, frame);
    watch_mask_habit(self, in);
    counters->accepted[frame->command]++;
    counters->accepted_timed += frame->is_timed;
    self->received = target_received(frame);
    self->last_frame_us = in->now_us;
    self->start_us = in->now_us;
    if (in->state != STATE_ENGAGED) {
        counters->not_followed++;
    } else if (!is_waiting && has_mask) {
        apply_mask(self, in, frame);
    }
    return true;
}

void sender_begin(sender_t *self, uint64_t now_us)
{
    self->targets = 0;
    confirm_cycle(&self->confirm, now_us);
}

void sender_end(sender_t *self, const sender_in_t *in)
{
    if (self->has_newest) {
        self->has_newest = false;
        (void)send_target(self, in, &self->newest, self->newest_command, &self->newest_from);
    }
    log_jumps(self, in);
}

void sender_restart(sender_t *self, uint16_t safe_mask, uint64_t now_us)
{
    self->start_us = now_us;
    self->frame_mask = safe_mask;
    confirm_restart(&self->confirm);
}
