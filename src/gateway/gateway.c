/* SPDX-License-Identifier: MIT
 * gateway.c - one cycle of the gateway, in the order of the picture in DESIGN.md.
 */
#include "heave/gateway.h"

#include "auto_engage.h"
#include "heave/motion_sane.h"
#include "heave/sane.h"
#include "heave/text.h"
#include "frame_receiver.h"
#include "actions.h"
#include "relay_output.h"
#include "reports.h"
#include "sender.h"
#include "sequencer.h"
#include "service.h"
#include "shutdown.h"

#define SINGULAR_LOG_US 1000000 /* lines about the same thing are no closer */

static bool is_io_valid(const gateway_io_t *io)
{
    return hal_udp_valid(io->udp) && drives_valid(io->drives) && hal_relays_valid(io->relays) && hal_inputs_valid(io->inputs) &&
           hal_log_valid(io->log) && (io->healthy.ops == NULL || hal_relays_valid(io->healthy));
}

/* Texts of drives that have said nothing yet. */
static void clear_reports(gateway_t *self)
{
    self->snapshot.fault_report = (drive_report_t){.phase = "", .trouble = "", .detail = ""};
    for (unsigned i = 0; i < DRIVES_MAX; i++) {
        self->snapshot.report[i] = (drive_report_t){.phase = "", .trouble = "", .detail = ""};
    }
}

/* What may change in operation. */
static void keep_changeable(gateway_settings_t *own, const settings_t *settings)
{
    own->silence_hold_ms = settings->silence_hold_ms;
    own->silence_neutral_ms = settings->silence_neutral_ms;
    own->silence_settle_ms = settings->silence_settle_ms;
    own->takeover_ms = settings->takeover_ms;
    own->priority = settings->priority;
    own->dialect = settings->dialect;
    own->relay_safe_mask = settings->relay_safe_mask;
    own->relay_safe_after_ms = settings->relay_safe_after_ms;
    own->following_error_mm_q16 = settings->following_error_mm_q16;
    own->power_settle_ms = settings->power_settle_ms;
    own->mask_policy = settings->mask_policy;
    own->confirm_jump_mm_q16 = settings->confirm_jump_mm_q16;
    own->confirm_jump_deg_q16 = settings->confirm_jump_deg_q16;
}

static void keep_settings(gateway_settings_t *own, const settings_t *settings)
{
    own->cycle_us = settings->cycle_us;
    own->engage = settings->engage;
    own->auto_frames = settings->auto_frames;
    for (unsigned i = 0; i < AXES_MAX; i++) {
        const axis_settings_t *axis = &settings->axis[i];
        own->axis[i] = (axis_input_t){axis->sign, axis->scale_q16, axis->offset_q16, axis->wrap, axis->min_q16, axis->max_q16};
    }
    own->has_angle = settings->has_angle;
    for (unsigned i = 0; i < CYLINDERS_MAX; i++) {
        own->stroke_mm_q16[i] = settings->stroke_mm_q16[i];
    }
    own->relays = settings->relays;
    own->healthy = settings->healthy;
    keep_changeable(own, settings);
}

hv_status_t gateway_init(gateway_t *self, const settings_t *settings, const gateway_io_t *io)
{
    if (!is_io_valid(io)) {
        return HV_ERR_ARG;
    }
    *self = (gateway_t){.io = *io, .is_tracking_actual = true};
    keep_settings(&self->settings, settings);
    clear_reports(self);
    gateway_restart_auto(self);
    const hv_status_t status = motion_init(&self->motion, settings);
    if (status != HV_OK) {
        return status;
    }
    const unsigned cylinders = kin_cylinders(motion_kin(&self->motion));
    if (drives_count(io->drives) != cylinders + (settings->has_angle ? 1u : 0u)) {
        return HV_ERR_ARG;
    }
    supervisor_init(&self->supervisor);
    self->snapshot.cylinders = (uint8_t)cylinders;
    self->snapshot.has_angle = settings->has_angle;
    self->snapshot.relay_count = settings->relays.count;
    self->snapshot.sent = self->motion.pose;
    self->sender.frame_mask = settings->relay_safe_mask;
    return HV_OK;
}

void gateway_restart_auto(gateway_t *self)
{
    const gateway_settings_t *own = &self->settings;
    auto_engage_init(&self->auto_engage, own->engage == ENGAGE_AUTO, own->cycle_us, own->auto_frames);
}

void gateway_save(const gateway_t *self, gateway_t *out)
{
    *out = *self;
    out->io = (gateway_io_t){.udp = {NULL, NULL}};
    out->snapshot.fault_report = (drive_report_t){.phase = NULL};
    for (unsigned i = 0; i < DRIVES_MAX; i++) {
        out->snapshot.report[i] = (drive_report_t){.phase = NULL};
    }
}

static bool is_pulse_same(const healthy_settings_t *saved, const healthy_settings_t *prepared)
{
    return saved->relay == prepared->relay && saved->toggle_ms == prepared->toggle_ms && saved->off_ms == prepared->off_ms &&
           saved->late_cycles == prepared->late_cycles;
}

/* What may change in operation may be another than in the configuration of the start; the rest may not. */
static bool are_settings_sane(const gateway_settings_t *saved, const gateway_settings_t *prepared)
{
    bool is_sane = saved->cycle_us == prepared->cycle_us && sane_bool(&saved->has_angle) &&
                   saved->has_angle == prepared->has_angle && saved->engage == prepared->engage &&
                   saved->auto_frames == prepared->auto_frames && saved->relays.count == prepared->relays.count &&
                   is_pulse_same(&saved->healthy, &prepared->healthy) && (unsigned)saved->dialect <= FRAME_LENIENT &&
                   (unsigned)saved->mask_policy <= MASK_ANY && saved->priority.count <= HAL_UDP_NETWORKS_MAX &&
                   saved->following_error_mm_q16 >= 0 && saved->confirm_jump_mm_q16 >= 0 && saved->confirm_jump_deg_q16 >= 0;
    for (unsigned i = 0; i < AXES_MAX; i++) {
        const axis_input_t *axis = &saved->axis[i], *own = &prepared->axis[i];
        is_sane = is_sane && axis->sign == own->sign && axis->scale_q16 == own->scale_q16 &&
                  axis->offset_q16 == own->offset_q16 && axis->wrap == own->wrap && axis->min_q16 == own->min_q16 &&
                  axis->max_q16 == own->max_q16;
    }
    for (unsigned i = 0; i < CYLINDERS_MAX; i++) {
        is_sane = is_sane && saved->stroke_mm_q16[i] == prepared->stroke_mm_q16[i];
    }
    for (unsigned i = 0; i < HAL_RELAYS_MAX; i++) {
        is_sane = is_sane && saved->relays.max_on_ms[i] == prepared->relays.max_on_ms[i] &&
                  saved->relays.min_toggle_ms[i] == prepared->relays.min_toggle_ms[i];
    }
    for (unsigned i = 0; is_sane && i < saved->priority.count; i++) {
        const hal_udp_network_t *network = &saved->priority.network[i];
        is_sane = sane_bool(&network->is_ipv6) && network->prefix <= (network->is_ipv6 ? 128u : 32u);
    }
    return is_sane;
}

static bool is_output_sane(const motion_output_t *output)
{
    return sane_all_q32(output->asked.axis_q32, POSE_AXES) && sane_all_q32(output->sent.axis_q32, POSE_AXES) &&
           sane_all_q32(output->extension_mm_q32, CYLINDERS_MAX) && sane_q32(output->angle_deg_q32) &&
           output->limiting_cylinder <= CYLINDERS_MAX;
}

static bool are_drives_sane(const gateway_t *saved)
{
    bool is_sane = true;
    for (unsigned i = 0; i < DRIVES_MAX; i++) {
        const drive_feedback_t *drive = &saved->snapshot.drive[i];
        const wear_t *wear = &saved->snapshot.wear[i];
        is_sane = is_sane && sane_bool(&wear->is_known) && sane_bool(&wear->is_upwards) && sane_q32(wear->mark_q32) &&
                  sane_q32(wear->extreme_q32);
        is_sane = is_sane && (unsigned)saved->axis_fault[i] < FAULT_CODES && (unsigned)drive->state <= DRIVE_FAULT &&
                  sane_bool(&drive->is_homed) && sane_bool(&drive->has_actual) && sane_bool(&drive->is_energized) &&
                  sane_q32(drive->actual_mm_q32) && sane_time(drive->actual_us) && sane_q32(drive->guard.jump_q32) &&
                  sane_q32(drive->guard.lag_q32) && sane_q32(drive->guard.allowed_q32);
    }
    for (unsigned i = 0; i <= DRIVES_MAX; i++) {
        is_sane = is_sane && ((saved->told[i] | saved->snapshot.begun[i]) >> (unsigned)FAULT_CODES) == 0;
    }
    return is_sane;
}

static bool is_snapshot_sane(const snapshot_t *s, const snapshot_t *prepared)
{
    return sane_time(s->now_us) && (unsigned)s->state < STATES && (unsigned)s->goal < STATES && sane_bool(&s->is_estop_active) &&
           sane_bool(&s->is_power_failing) && sane_bool(&s->is_healthy) && (unsigned)s->fault.code < FAULT_CODES &&
           s->fault.axis <= DRIVES_MAX && (unsigned)s->reaction <= FAULT_REACT_SILENT && s->cylinders == prepared->cylinders &&
           sane_bool(&s->has_angle) && s->has_angle == prepared->has_angle && s->relay_count == prepared->relay_count &&
           sane_bool(&s->is_relays_unknown) && plate_is_sane(&s->plate) && sane_all_q32(s->asked.axis_q32, POSE_AXES) &&
           sane_all_q32(s->sent.axis_q32, POSE_AXES) && sane_all_q32(s->extension_mm_q32, CYLINDERS_MAX) &&
           sane_q32(s->angle_deg_q32) && s->limiting_cylinder <= CYLINDERS_MAX && owner_is_sane(&s->owner) &&
           owner_is_sane(&s->other) && sane_bool(&s->service.is_held) && sane_time(s->service.tick_us) &&
           (unsigned)s->service.doing < SERVICE_VERBS;
}

static bool are_bools_sane(const gateway_t *saved)
{
    return sane_bool(&saved->is_bus_lost) && sane_bool(&saved->is_bus_failing) && sane_bool(&saved->is_tracking_actual) &&
           sane_bool(&saved->is_disable_due) && sane_bool(&saved->is_shutdown_asked) && sane_bool(&saved->is_end_overdue) &&
           sane_bool(&saved->sender.has_newest) && sane_bool(&saved->sender.is_known) &&
           sane_bool(&saved->relay_output.is_mask_written) && sane_bool(&saved->sender.newest_from.is_ipv6) &&
           sane_bool(&saved->is_estop_apart) && sane_bool(&saved->is_power_overdue) && sane_bool(&saved->is_late) &&
           sane_bool(&saved->relay_output.is_pulse_lost) && sane_bool(&saved->relay_output.healthy.level);
}

static bool are_rotations_sane(const rotations_t *rotations)
{
    bool is_sane = true;
    for (unsigned i = 0; i < ROTATIONS; i++) {
        is_sane = is_sane && sane_bool(&rotations->is_there[i]);
    }
    return is_sane;
}

/* A file may hold anything: every index, enum, bool and divisor is judged before it is used. */
static bool is_saved_sane(const gateway_t *saved, const gateway_t *prepared)
{
    return are_bools_sane(saved) && are_settings_sane(&saved->settings, &prepared->settings) &&
           is_snapshot_sane(&saved->snapshot, &prepared->snapshot) && are_drives_sane(saved) &&
           supervisor_is_sane(&saved->supervisor) && (unsigned)saved->bring_up <= BRING_UP_MOVE &&
           service_is_sane(&saved->service, &prepared->service, prepared->snapshot.cylinders + 1u) &&
           auto_engage_is_sane(&saved->auto_engage, &prepared->auto_engage) && owner_is_sane(&saved->sender.owner) &&
           sane_time(saved->power_since_us) && sane_time(saved->relay_output.healthy.ill_us) &&
           sane_time(saved->relay_output.healthy.changed_us) && confirm_is_sane(&saved->sender.confirm) &&
           sane_all_q32(saved->sender.rotation_deg_q32, AXIS_YAW + 1u) && are_rotations_sane(&saved->sender.rotations) &&
           mask_guard_is_sane(&saved->sender.mask_guard) && (unsigned)saved->snapshot.mask_habit <= MASK_DIGITS &&
           relay_policy_is_sane(&saved->relay_output.policy) && (unsigned)saved->sender.newest_command <= FRAME_COMMANDS &&
           motion_target_is_sane(&saved->sender.newest) && is_output_sane(&saved->output) &&
           motion_state_is_sane(&saved->motion, &prepared->motion);
}

hv_status_t gateway_resume(gateway_t *self, const gateway_t *saved, const gateway_io_t *io)
{
    if (!is_io_valid(io) || !is_saved_sane(saved, self) ||
        drives_count(io->drives) != self->snapshot.cylinders + (self->settings.has_angle ? 1u : 0u)) {
        return HV_ERR_ARG;
    }
    *self = *saved;
    self->io = *io;
    frame_scanner_init(&self->receiver.scanner, self->settings.dialect); /* it starts anew with every datagram */
    clear_reports(self);
    return HV_OK;
}

void gateway_start_settled(gateway_t *self)
{
    supervisor_init_settled(&self->supervisor);
    self->is_tracking_actual = false;
    if (auto_engage_is_ready(&self->auto_engage, 0)) {
        auto_engage_end(&self->auto_engage);
        self->supervisor.goal = STATE_ENGAGED;
    }
}

void gateway_reload(gateway_t *self, const settings_t *settings)
{
    if (self->settings.mask_policy != settings->mask_policy) {
        mask_guard_restart(&self->sender.mask_guard);
    }
    keep_changeable(&self->settings, settings);
    motion_set_spike_gate(&self->motion, settings->spike_gate);
}

hv_status_t gateway_request(gateway_t *self, event_t request, uint64_t now_us)
{
    return sequencer_request(self, request, now_us);
}

hv_status_t gateway_set_intensity(gateway_t *self, unsigned percent)
{
    const hv_status_t status = motion_set_intensity(&self->motion, percent);
    if (status == HV_OK) {
        char line[HAL_LOG_TEXT_MAX + 1];
        text_t text = text_start(line, sizeof line);
        text_put(&text, "intensity ");
        text_put_u32(&text, percent);
        text_put(&text, " %");
        hal_log_write(self->io.log, HAL_LOG_NOTICE, line);
    }
    return status;
}

void gateway_note_late(gateway_t *self, uint32_t cycles)
{
    uint32_t *late = &self->snapshot.counters.late_cycles;
    *late = cycles < UINT32_MAX - *late ? *late + cycles : UINT32_MAX; /* a count that began anew would look like none late */
    self->service.late_us += (uint64_t)cycles * self->settings.cycle_us;
    self->is_late |= cycles > self->settings.healthy.late_cycles;
}

void gateway_tell_fault(gateway_t *self, fault_code_t code, unsigned axis)
{
    if ((unsigned)code < FAULT_CODES && axis <= DRIVES_MAX) {
        self->told[axis] |= 1u << (unsigned)code;
    }
}

/* A hold leaves a ride's relays as they are for a while, if so configured. */
static bool is_hold_young(const gateway_t *self, uint64_t now_us)
{
    return self->supervisor.state == STATE_HOLD && self->supervisor.interrupted == STATE_ENGAGED &&
           now_us - self->state_since_us < (uint64_t)self->settings.relay_safe_after_ms * 1000;
}

/* Only an engaged sender commands the relays, or a hand in service; the safe mask holds everywhere else. */
static void write_relays(gateway_t *self, uint64_t now_us)
{
    const bool is_sender_heard = self->supervisor.state == STATE_ENGAGED || is_hold_young(self, now_us);
    const bool is_serving = self->supervisor.state == STATE_SERVICE;
    const uint16_t wanted = is_sender_heard ? self->sender.frame_mask
                            : is_serving    ? service_relays(self)
                                            : self->settings.relay_safe_mask;
    const relay_output_in_t in = {.wanted_mask = wanted,
                                  .is_safe = wanted == self->settings.relay_safe_mask && !is_sender_heard,
                                  .is_well = sequencer_is_well(self),
                                  .was_unknown = self->snapshot.is_relays_unknown};
    const relay_output_out_t out = relay_output_step(&self->relay_output, &self->settings, &self->io, &in, now_us);
    self->is_late = false;
    self->snapshot.is_healthy = out.is_healthy;
    self->snapshot.is_relays_unknown = out.is_unknown;
    self->snapshot.counters.relay_errors += out.is_refused;
}

HV_OWN_FRAME static void send_setpoints(gateway_t *self, uint64_t now_us)
{
    q32_t setpoint_q32[DRIVES_MAX] = {0};
    const unsigned cylinders = kin_cylinders(motion_kin(&self->motion));
    for (unsigned i = 0; i < cylinders; i++) {
        setpoint_q32[i] = self->output.extension_mm_q32[i];
    }
    setpoint_q32[cylinders] = self->output.angle_deg_q32;
    self->unsent_cycles = drives_send(self->io.drives, now_us, setpoint_q32) == HV_OK ? 0 : self->unsent_cycles + 1;
}

static void receive_frames(gateway_t *self, uint64_t now_us)
{
    const frame_receiver_io_t io = {self->io.udp, self->io.log, &self->snapshot.counters};
    frame_t frame;
    frame_receiver_begin(&self->receiver);
    sender_begin(self, now_us);
    while (frame_receiver_next(&self->receiver, &self->settings, &io, now_us, &frame)) {
        sender_take(self, &frame, now_us);
    }
    sender_end(self, now_us);
}

/* Motion waits for a bus that has not taken the last set: what the drives get next then follows on what they got last. Where the
 * set-points follow the drives there is nothing to wait for. */
static void step_motion(gateway_t *self, uint64_t now_us)
{
    if (self->unsent_cycles == 0 || self->is_tracking_actual) {
        motion_step(&self->motion, now_us, &self->output);
    }
}

/* One line for the first such stop of a burst. */
static void note_singular_stops(gateway_t *self, uint64_t now_us)
{
    const uint32_t stops = motion_singular_stops(&self->motion);
    if (stops != self->snapshot.counters.singular_stops &&
        (self->singular_logged_us == 0 || now_us - self->singular_logged_us >= SINGULAR_LOG_US)) {
        hal_log_write(self->io.log, HAL_LOG_WARNING,
                      "stopped: the extensions sent lead too near a singularity; send ones that go round it");
        self->singular_logged_us = now_us;
    }
    self->snapshot.counters.singular_stops = stops;
}

static void publish(gateway_t *self, uint64_t now_us)
{
    snapshot_t *s = &self->snapshot;
    s->now_us = now_us;
    s->state = self->supervisor.state;
    s->goal = self->supervisor.goal;
    s->is_held_by_silence = self->supervisor.is_held_by_silence;
    s->relay_mask = self->relay_output.effects_mask;
    s->asked = self->output.asked;
    s->sent = self->output.sent;
    for (unsigned i = 0; i < CYLINDERS_MAX; i++) {
        s->extension_mm_q32[i] = self->output.extension_mm_q32[i];
    }
    s->angle_deg_q32 = self->output.angle_deg_q32;
    reports_take(&self->reports, self->io.drives, self->io.log, now_us, s->report);
    s->flags = self->output.flags;
    s->limiting_cylinder = self->output.limiting_cylinder;
    s->intensity_percent = (uint8_t)motion_intensity(&self->motion)->percent;
    s->intensity_now_q32 = intensity_percent_q32(motion_intensity(&self->motion));
    s->stream_period_us = stream_period_us(motion_stream(&self->motion));
    s->stream = stream_report(motion_stream(&self->motion));
    s->stream_delay_us = s->stream.delay_us;
    s->owner = self->sender.owner;
    s->mask_habit = mask_guard_habit(&self->sender.mask_guard, self->settings.mask_policy);
    service_publish(self);
    s->counters.clamped += (s->flags & MOTION_CLAMPED) != 0;
    s->counters.relay_cut = self->relay_output.policy.cut_count;
    s->counters.relay_delayed = self->relay_output.policy.delay_count;
    s->counters.spikes = spike_filter_spikes(motion_spike_filter(&self->motion));
    note_singular_stops(self, now_us);
    s->counters.unconfirmed = self->sender.confirm.dropped;
    s->counters.stretched = motion_stretched_count(&self->motion);
    for (unsigned i = 0; i < drives_count(self->io.drives); i++) {
        wear_step(&s->wear[i], &s->drive[i], self->settings.cycle_us);
    }
    plate_take(&s->plate, motion_kin(&self->motion), s->drive, &s->sent, now_us);
    s->cycle++;
}

void gateway_cycle(gateway_t *self, uint64_t now_us)
{
    sequencer_before_frames(self, now_us);
    receive_frames(self, now_us);
    sequencer_after_frames(self, now_us);
    step_motion(self, now_us);
    send_setpoints(self, now_us);
    actions_after_motion(self);
    shutdown_watch(self, now_us);
    write_relays(self, now_us);
    publish(self, now_us);
}

const snapshot_t *gateway_snapshot(const gateway_t *self)
{
    return &self->snapshot;
}

bool gateway_is_finished(const gateway_t *self)
{
    return self->end_since_us != 0 && (gateway_energized(self) == 0 || self->is_end_overdue);
}

uint32_t gateway_energized(const gateway_t *self)
{
    return shutdown_energized(self, false);
}
