/* SPDX-License-Identifier: MIT
 * intake.c - frames of a sender: accepted ones become targets and relay masks, the others a count and a line in the log.
 */
#include "intake.h"

#include "auto_engage.h"
#include "heave/text.h"
#include "operate.h"

#define REJECT_LOG_INTERVAL_US 1000000u
#define REJECT_TEXT_BYTES      60u
#define STREAM_FRAMES          10u      /* as many are a stream, */
#define STREAM_PERIOD_US       250000u  /* when each comes within that after the last one, */
#define STREAM_GAP_US          1000000u /* and over when none has for that */
#define TURN_Q32               q32_from_int(360)

/* Where the values of a frame go: an axis of the platform, or a cylinder (from SLOT_CYLINDER on). */
enum { SLOT_CYLINDER = AXES_MAX };

static const uint8_t k_slots[FRAME_COMMANDS][FRAME_VALUES_MAX] = {
    [FRAME_A3] = {AXIS_ROLL, AXIS_PITCH, AXIS_Z},
    [FRAME_A4] = {AXIS_ROLL, AXIS_PITCH, AXIS_Z, AXIS_ANGLE},
    [FRAME_A6] = {AXIS_ROLL, AXIS_PITCH, AXIS_YAW, AXIS_X, AXIS_Y, AXIS_Z},
    [FRAME_A7] = {AXIS_ROLL, AXIS_PITCH, AXIS_YAW, AXIS_X, AXIS_Y, AXIS_Z, AXIS_ANGLE},
    [FRAME_C3] = {SLOT_CYLINDER, SLOT_CYLINDER + 1, SLOT_CYLINDER + 2},
    [FRAME_C6] = {SLOT_CYLINDER, SLOT_CYLINDER + 1, SLOT_CYLINDER + 2, SLOT_CYLINDER + 3, SLOT_CYLINDER + 4, SLOT_CYLINDER + 5},
    [FRAME_C7] = {SLOT_CYLINDER, SLOT_CYLINDER + 1, SLOT_CYLINDER + 2, SLOT_CYLINDER + 3, SLOT_CYLINDER + 4, SLOT_CYLINDER + 5,
                  AXIS_ANGLE},
};

/* Cylinders a command is for: 0 where poses of both kinds of platform take it. */
static const uint8_t k_cylinders[FRAME_COMMANDS] = {
    [FRAME_A6] = 6, [FRAME_A7] = 6, [FRAME_C3] = 3, [FRAME_C6] = 6, [FRAME_C7] = 6};

static bool needs_angle(frame_command_t command)
{
    return command == FRAME_A4 || command == FRAME_A7 || command == FRAME_C7;
}

/* What the platform lacks for a command; NULL where it has everything. */
static const char *missing_for(const gateway_t *self, frame_command_t command)
{
    const unsigned cylinders = kin_cylinders(motion_kin(&self->motion));
    if (k_cylinders[command] != 0 && k_cylinders[command] != cylinders) {
        return cylinders == 3
                   ? "it is for six cylinders, this platform has three (A3, C3, and A4 with a rotation motor)"
                   : "it is for three cylinders, this platform has six (A3, A6, C6, and A4, A7, C7 with a rotation motor)";
    }
    return needs_angle(command) && !self->settings.has_angle ? "it needs a rotation motor, and [angle] present is no" : NULL;
}

/* The value in the platform's own axis: sign * scale * sent + offset. */
static q32_t to_axis(const axis_input_t *axis, q16_t sent_q16)
{
    const q32_t scaled_q32 = fx_mul_shift(q32_from_q16(sent_q16), axis->scale_q16, 16);
    return (axis->sign < 0 ? -scaled_q32 : scaled_q32) + q32_from_q16(axis->offset_q16);
}

/* The same angle some whole turns nearer, if it is beyond a limit and those bring it within both. */
static q32_t turned_into_limits(const gateway_settings_t *settings, q32_t angle_q32)
{
    const q32_t min_q32 = q32_from_q16(settings->angle_min_q16);
    const q32_t max_q32 = q32_from_q16(settings->angle_max_q16);
    const q32_t beyond_q32 = angle_q32 > max_q32 ? angle_q32 - max_q32 : angle_q32 < min_q32 ? angle_q32 - min_q32 : 0;
    const q32_t turns = (fx_abs(beyond_q32) + TURN_Q32 - 1) / TURN_Q32;
    const q32_t turned_q32 = angle_q32 - (beyond_q32 < 0 ? -turns : turns) * TURN_Q32;
    return turned_q32 >= min_q32 && turned_q32 <= max_q32 ? turned_q32 : angle_q32;
}

/* If the motor takes the shorter way: the angle that is whole turns away and nearest to the last one that was asked for. Not to
 * where the motor is: it may be more than half a turn behind, and would change its direction with every frame. */
static q32_t unwrap(const gateway_t *self, q32_t angle_q32)
{
    if (self->settings.angle_wrap == ANGLE_AS_SENT) {
        return angle_q32;
    }
    const q32_t last_q32 = motion_angle_target(&self->motion);
    q32_t way_q32 = (angle_q32 - last_q32) % TURN_Q32;
    if (way_q32 > TURN_Q32 / 2) {
        way_q32 -= TURN_Q32;
    } else if (way_q32 < -TURN_Q32 / 2) {
        way_q32 += TURN_Q32;
    }
    return turned_into_limits(&self->settings, last_q32 + way_q32);
}

static motion_target_t target_of(const gateway_t *self, const frame_t *frame)
{
    const bool is_pose = k_slots[frame->command][0] < SLOT_CYLINDER;
    motion_target_t target = {
        .space = is_pose ? MOTION_POSE : MOTION_CYLINDERS, .is_timed = frame->is_timed, .time_ms = frame->time_ms};
    q16_t axis_q16[AXES_MAX] = {0};
    for (unsigned i = 0; i < frame->count; i++) {
        const uint8_t slot = k_slots[frame->command][i];
        if (slot >= SLOT_CYLINDER) {
            target.value_q32[slot - SLOT_CYLINDER] = q32_from_q16(frame->value_q16[i]);
        } else {
            axis_q16[slot] = frame->value_q16[i];
        }
    }
    for (unsigned i = 0; is_pose && i < POSE_AXES; i++) {
        target.value_q32[i] = to_axis(&self->settings.axis[i], axis_q16[i]);
    }
    target.has_angle = needs_angle(frame->command);
    target.angle_deg_q32 = unwrap(self, to_axis(&self->settings.axis[AXIS_ANGLE], axis_q16[AXIS_ANGLE]));
    return target;
}

/* What was left out since the last line of its sort. */
static void put_suppressed(text_t *text, uint32_t lines)
{
    if (lines > 0) {
        text_put(text, "; before that ");
        text_put_u32(text, lines);
        text_put(text, " more");
    }
}

/* One line for the first reject of a burst, with what was left out since the last one. */
static void log_reject(gateway_t *self, const char *reason, frame_error_t error, const uint8_t *bytes, size_t length,
                       const hal_udp_peer_t *from, uint64_t now_us)
{
    uint64_t *logged_us = &self->reject_logged_us[error];
    if (*logged_us != 0 && now_us - *logged_us < REJECT_LOG_INTERVAL_US) {
        self->reject_suppressed[error]++;
        return;
    }
    char line[HAL_LOG_TEXT_MAX + 1];
    char peer[HAL_UDP_PEER_TEXT_MAX];
    text_t text = text_start(line, sizeof line);
    (void)hal_udp_peer_text(from, peer, sizeof peer);
    text_put(&text, "frame from ");
    text_put(&text, peer);
    text_put(&text, " rejected: ");
    text_put(&text, reason);
    text_put(&text, ": \"");
    text_put_escaped(&text, bytes, length < REJECT_TEXT_BYTES ? length : REJECT_TEXT_BYTES);
    text_put(&text, "\"");
    put_suppressed(&text, self->reject_suppressed[error]);
    hal_log_write(self->io.log, HAL_LOG_WARNING, line);
    *logged_us = now_us;
    self->reject_suppressed[error] = 0;
}

HV_OWN_FRAME static void reject(gateway_t *self, const frame_reject_t *why, const hal_udp_peer_t *from, uint64_t now_us)
{
    char reason[HAL_LOG_TEXT_MAX + 1];
    self->snapshot.counters.rejected[why->error]++;
    (void)frame_reject_describe(why, reason, sizeof reason);
    log_reject(self, reason, why->error, &self->datagram[why->start], why->end - why->start, from, now_us);
}

/* A frame that is well formed but not for this platform. */
HV_OWN_FRAME static void refuse(gateway_t *self, frame_command_t command, const char *missing, const hal_udp_peer_t *from,
                                uint64_t now_us)
{
    char reason[HAL_LOG_TEXT_MAX + 1];
    text_t text = text_start(reason, sizeof reason);
    text_put(&text, frame_command_name(command));
    text_put(&text, ": ");
    text_put(&text, missing);
    self->snapshot.counters.rejected[FRAME_ERR_PLATFORM]++;
    log_reject(self, reason, FRAME_ERR_PLATFORM, (const uint8_t *)frame_command_name(command), 2, from, now_us);
}

/* What the sender asks of the relays; bits that no relay has are counted. */
static void take_mask(gateway_t *self, const frame_t *frame)
{
    if (frame->is_timed || !frame->has_mask) {
        return;
    }
    const uint16_t wired = (uint16_t)((1u << self->settings.relays.count) - 1u);
    self->snapshot.counters.relay_missing += (frame->relay_mask & FRAME_RELAY_MASK & ~(unsigned)wired) != 0;
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

/* One line about a value of the sender that drives. */
static void log_not_followed(gateway_t *self, const char *what, const char *why, const confirm_jump_t *jump, uint32_t suppressed)
{
    char line[HAL_LOG_TEXT_MAX + 1];
    char peer[HAL_UDP_PEER_TEXT_MAX];
    text_t text = text_start(line, sizeof line);
    (void)hal_udp_peer_text(&self->owner.peer, peer, sizeof peer);
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
    put_suppressed(&text, suppressed);
    hal_log_write(self->io.log, HAL_LOG_WARNING, line);
}

/* One line for the first spike of a burst; what is left out is told with a later one. */
static void log_spikes(gateway_t *self, uint64_t now_us)
{
    const gate_t *gate = motion_gate(&self->motion);
    const uint32_t unlogged = gate_spikes(gate) - self->spikes_logged;
    if (unlogged == 0 || (self->spike_logged_us != 0 && now_us - self->spike_logged_us < REJECT_LOG_INTERVAL_US)) {
        return;
    }
    const gate_spike_t *spike = gate_last_spike(gate);
    const confirm_jump_t jump = {MOTION_POSE, spike->axis, spike->value_q32, spike->before_q32};
    log_not_followed(self, "sample", "a spike", &jump, unlogged - 1);
    self->spike_logged_us = now_us;
    self->spikes_logged += unlogged;
}

/* The same of far jumps. */
static void log_jumps(gateway_t *self, uint64_t now_us)
{
    const uint32_t unlogged = self->confirm.dropped - self->jumps_logged;
    if (unlogged == 0 || (self->jump_logged_us != 0 && now_us - self->jump_logged_us < REJECT_LOG_INTERVAL_US)) {
        return;
    }
    log_not_followed(self, "frame", "a far jump that no second one confirmed", &self->confirm.drop, unlogged - 1);
    self->jump_logged_us = now_us;
    self->jumps_logged += unlogged;
}

/* One line for the first frame of a sender that does not drive, and then at times. */
HV_OWN_FRAME static void log_other(gateway_t *self, const hal_udp_peer_t *from, uint64_t now_us)
{
    if (self->other_logged_us != 0 && now_us - self->other_logged_us < REJECT_LOG_INTERVAL_US) {
        self->other_suppressed++;
        return;
    }
    char line[HAL_LOG_TEXT_MAX + 1];
    char peer[HAL_UDP_PEER_TEXT_MAX];
    text_t text = text_start(line, sizeof line);
    text_put(&text, "frame from ");
    (void)hal_udp_peer_text(from, peer, sizeof peer);
    text_put(&text, peer);
    text_put(&text, " not followed: ");
    (void)hal_udp_peer_text(&self->owner.peer, peer, sizeof peer);
    text_put(&text, peer);
    text_put(&text, " drives");
    put_suppressed(&text, self->other_suppressed);
    hal_log_write(self->io.log, HAL_LOG_WARNING, line);
    self->other_logged_us = now_us;
    self->other_suppressed = 0;
}

/* A sender takes over from another: the platform stops and goes to its first pose at engage speed. */
HV_OWN_FRAME static void change_owner(gateway_t *self, uint64_t now_us)
{
    char line[HAL_LOG_TEXT_MAX + 1];
    char peer[HAL_UDP_PEER_TEXT_MAX];
    text_t text = text_start(line, sizeof line);
    (void)hal_udp_peer_text(&self->owner.peer, peer, sizeof peer);
    text_put(&text, peer);
    text_put(&text, " drives from now on");
    hal_log_write(self->io.log, HAL_LOG_NOTICE, line);
    self->snapshot.counters.owner_changes++;
    confirm_restart(&self->confirm); /* what waits is another sender's */
    if (self->supervisor.state == STATE_ENGAGED) {
        operate_follow(self, now_us);
    }
}

/* Whether the frame is of the sender that drives; keeps who that is. */
static bool is_followed(gateway_t *self, const hal_udp_peer_t *from, uint64_t now_us)
{
    const gateway_settings_t *settings = &self->settings;
    const owner_verdict_t verdict = owner_judge(&self->owner, from, (uint64_t)settings->takeover_ms * 1000, &settings->priority,
                                                motion_timed_end_us(&self->motion), now_us);
    if (verdict == OWNER_OTHER) {
        self->snapshot.counters.other_sender++;
        self->snapshot.other = (owner_t){.is_taken = true, .peer = *from, .last_us = now_us};
        log_other(self, from, now_us);
    } else if (verdict == OWNER_NEW) {
        change_owner(self, now_us);
    }
    return verdict != OWNER_OTHER;
}

/* Tells motion of a target.
 * Returns false: it is impossible, and has been refused. */
static bool tell_motion(gateway_t *self, const motion_target_t *target, frame_command_t command, const hal_udp_peer_t *from,
                        uint64_t now_us)
{
    if (self->supervisor.state == STATE_ENGAGED && motion_target(&self->motion, target, now_us - self->waited_us) != HV_OK) {
        self->snapshot.counters.impossible++;
        refuse(self, command, "no pose has these extensions, or one too near a singularity", from, now_us);
        return false;
    }
    log_spikes(self, now_us);
    return true;
}

/* The first ones of a cycle at once; then the newest one waits until there is no newer one, and counts as possible. */
static bool take_target(gateway_t *self, const motion_target_t *target, frame_command_t command, const hal_udp_peer_t *from,
                        uint64_t now_us)
{
    self->targets++;
    if (self->targets <= GATEWAY_TARGETS_PER_CYCLE) {
        return tell_motion(self, target, command, from, now_us);
    }
    self->has_newest = true;
    self->newest = *target;
    self->newest_command = command;
    self->newest_from = *from;
    return true;
}

/* Where the platform is, as a target of that space. */
static motion_target_t here(const gateway_t *self, motion_space_t space)
{
    motion_target_t target = {.space = space, .has_angle = self->settings.has_angle, .angle_deg_q32 = self->output.angle_deg_q32};
    for (unsigned i = 0; i < POSE_AXES; i++) {
        target.value_q32[i] = space == MOTION_POSE ? self->output.sent.axis_q32[i] : self->output.extension_mm_q32[i];
    }
    return target;
}

/* False for a far jump that waits for a second frame. */
HV_OWN_FRAME static bool is_confirmed(gateway_t *self, const motion_target_t *target, uint64_t now_us)
{
    const bool is_asked_for = self->settings.confirm_jump_mm_q16 != 0 || self->settings.confirm_jump_deg_q16 != 0;
    if (!is_asked_for || self->supervisor.state != STATE_ENGAGED) {
        return true;
    }
    const confirm_distance_t distance = {q32_from_q16(self->settings.confirm_jump_mm_q16),
                                         q32_from_q16(self->settings.confirm_jump_deg_q16)};
    const motion_target_t from = here(self, target->space);
    return confirm_passes(&self->confirm, &distance, &from, target, now_us);
}

/* Follows a target that nothing is to be waited for.
 * Returns false: it is impossible, and has been refused. */
static bool follow(gateway_t *self, const motion_target_t *target, frame_command_t command, const hal_udp_peer_t *from,
                   uint64_t now_us)
{
    const bool is_taken = take_target(self, target, command, from, now_us);
    if (is_taken) {
        confirm_followed(&self->confirm, target);
    }
    return is_taken;
}

/* A stream that comes back after a gap, as of a sender that was started again, is taken over like a new sender's: nothing says
 * that it goes on where it ended. Where silence leads to HOLD within the gap that has happened already. Poses sent one by one are
 * no stream. */
static void watch_gap(gateway_t *self, uint64_t now_us)
{
    const uint64_t end_us = motion_timed_end_us(&self->motion);
    const uint64_t since_us = end_us > self->start_us ? end_us : self->start_us;
    const bool is_gap = now_us > since_us && now_us - since_us >= STREAM_GAP_US;
    if (is_gap && self->stream_frames >= STREAM_FRAMES && self->supervisor.state == STATE_ENGAGED) {
        operate_follow(self, now_us);
    }
    const bool is_next = !is_gap && now_us - self->snapshot.last_frame_us < STREAM_PERIOD_US;
    self->stream_frames = !is_next ? 0 : self->stream_frames < STREAM_FRAMES ? self->stream_frames + 1 : STREAM_FRAMES;
}

/* What the sender asked for in its own words, before sign, scale, offset, intensity and limits. */
static void keep_received(snapshot_t *s, const frame_t *frame)
{
    s->has_received = k_slots[frame->command][0] < SLOT_CYLINDER;
    for (unsigned i = 0; i < POSE_AXES; i++) {
        s->received_q16[i] = 0;
    }
    for (unsigned i = 0; s->has_received && i < frame->count; i++) {
        if (k_slots[frame->command][i] < POSE_AXES) {
            s->received_q16[k_slots[frame->command][i]] = frame->value_q16[i];
        }
    }
}

static void accept(gateway_t *self, const frame_t *frame, const hal_udp_peer_t *from, uint64_t now_us)
{
    const char *missing = missing_for(self, frame->command);
    if (missing != NULL) {
        refuse(self, frame->command, missing, from, now_us);
        return;
    }
    if (!is_followed(self, from, now_us)) {
        return;
    }
    auto_engage_frame(&self->auto_engage, now_us);
    const motion_target_t target = target_of(self, frame);
    operate_event(self, EVENT_FRAME, now_us);
    watch_gap(self, now_us);
    const bool is_waiting = !is_confirmed(self, &target, now_us);
    if (!is_waiting && !follow(self, &target, frame->command, from, now_us)) {
        return;
    }
    keep_received(&self->snapshot, frame);
    counters_t *counters = &self->snapshot.counters;
    counters->accepted[frame->command]++;
    counters->accepted_timed += frame->is_timed;
    self->snapshot.last_frame_us = now_us;
    self->start_us = now_us;
    if (self->supervisor.state != STATE_ENGAGED) {
        counters->not_followed++;
    } else if (!is_waiting) {
        take_mask(self, frame);
    }
}

static void take_datagram(gateway_t *self, size_t length, const hal_udp_peer_t *from, uint64_t now_us)
{
    frame_t frame;
    frame_reject_t why;
    size_t position = 0;
    frame_scanner_init(&self->scanner, self->settings.dialect);
    for (;;) {
        const frame_event_t event = frame_next(&self->scanner, self->datagram, length, &position, &frame, &why);
        if (event == FRAME_EVENT_NONE) {
            return;
        }
        if (event == FRAME_EVENT_FRAME) {
            accept(self, &frame, from, now_us);
        } else {
            reject(self, &why, from, now_us);
        }
    }
}

/* How long a datagram has waited for its cycle: a sender's time line is finer than cycles. What waited longer tells of a late
 * cycle, which a replay does not have. */
static void note_arrival(gateway_t *self)
{
    uint32_t waited_us = 0;
    const bool is_known = hal_udp_waited(self->io.udp, &waited_us) == HV_OK;
    self->waited_us = !is_known ? 0 : waited_us < self->settings.cycle_us ? waited_us : self->settings.cycle_us - 1;
}

/* What has arrived, as far as it fits into a cycle. */
static void receive(gateway_t *self, uint64_t now_us)
{
    for (unsigned i = 0; i < GATEWAY_DATAGRAMS_PER_CYCLE; i++) {
        hal_udp_peer_t from;
        size_t length = 0;
        const hv_status_t status = hal_udp_recv(self->io.udp, self->datagram, sizeof self->datagram, &length, &from);
        if (status == HV_ERR_AGAIN) {
            return;
        }
        if (status == HV_ERR_IO) {
            self->snapshot.counters.receive_errors++;
            return;
        }
        self->snapshot.counters.datagrams++;
        note_arrival(self);
        if (status == HV_ERR_RANGE) {
            self->snapshot.counters.oversize++;
            log_reject(self, "datagram longer than 512 bytes, send one frame per datagram", FRAME_ERR_UNFINISHED, self->datagram,
                       0, &from, now_us);
        } else {
            take_datagram(self, length, &from, now_us);
        }
    }
}

void intake_receive(gateway_t *self, uint64_t now_us)
{
    self->targets = 0;
    confirm_cycle(&self->confirm, now_us);
    receive(self, now_us);
    if (self->has_newest) {
        self->has_newest = false;
        (void)tell_motion(self, &self->newest, self->newest_command, &self->newest_from, now_us);
    }
    log_jumps(self, now_us);
}
