/* SPDX-License-Identifier: MIT
 * gateway.c - one cycle of the gateway, in the order of the picture in DESIGN.md.
 */
#include "heave/gateway.h"

#include "actions.h"
#include "auto_engage.h"
#include "drive_control.h"
#include "frame_receiver.h"
#include "heave/text.h"
#include "log_limit.h"
#include "relay_output.h"
#include "reports.h"
#include "sender.h"
#include "sequencer.h"
#include "service.h"
#include "shutdown.h"

static bool is_io_valid(const gateway_io_t *io)
{
    return hal_udp_valid(io->udp) && drives_valid(io->drives) && hal_relays_valid(io->relays) && hal_inputs_valid(io->inputs) &&
           hal_log_valid(io->log) && (io->healthy.ops == NULL || hal_relays_valid(io->healthy));
}

static const drive_report_t k_no_report = {.phase = "", .trouble = "", .detail = ""};

static void set_reports(snapshot_t *shown, const drive_report_t *report)
{
    shown->fault_report = *report;
    for (unsigned i = 0; i < DRIVES_MAX; i++) {
        shown->report[i] = *report;
    }
}

static feedback_t feedback_of(const gateway_t *self)
{
    return (feedback_t){self->snapshot.drive, self->cylinders + (self->settings->has_angle ? 1u : 0u)};
}

static cycle_t cycle_of(gateway_t *self, uint64_t now_us)
{
    return (cycle_t){.settings = self->settings,
                     .drives = self->io.drives,
                     .log = self->io.log,
                     .sender = &self->sender,
                     .motion = &self->motion,
                     .output = &self->output,
                     .feedback = feedback_of(self),
                     .cylinders = self->cylinders,
                     .now_us = now_us};
}

hv_status_t gateway_init(gateway_t *self, const settings_t *settings, const gateway_io_t *io)
{
    if (!is_io_valid(io)) {
        return HV_ERR_ARG;
    }
    *self = (gateway_t){.settings = settings, .io = *io};
    sequencer_init(&self->sequencer, settings);
    set_reports(&self->snapshot, &k_no_report);
    const hv_status_t status = motion_init(&self->motion, settings);
    if (status != HV_OK) {
        return status;
    }
    const unsigned cylinders = kin_cylinders(motion_kin(&self->motion));
    if (drives_count(io->drives) != cylinders + (settings->has_angle ? 1u : 0u)) {
        return HV_ERR_ARG;
    }
    self->cylinders = (uint8_t)cylinders;
    self->snapshot.cylinders = self->cylinders;
    self->snapshot.has_angle = settings->has_angle;
    self->snapshot.relay_count = settings->relays.count;
    self->snapshot.sent = *motion_pose(&self->motion);
    self->sender.frame_mask = settings->relay_safe_mask;
    return HV_OK;
}

void gateway_restart_auto(gateway_t *self)
{
    sequencer_restart_auto(&self->sequencer, self->settings);
}

void gateway_save(const gateway_t *self, gateway_t *out)
{
    *out = *self;
    out->settings = NULL;
    out->io = (gateway_io_t){.udp = {NULL, NULL}};
    out->sequencer.faults.report = (drive_report_t){.phase = NULL};
    set_reports(&out->snapshot, &out->sequencer.faults.report);
}

void gateway_resume(gateway_t *self, const gateway_t *saved)
{
    const settings_t *settings = self->settings;
    const gateway_io_t io = self->io;
    *self = *saved;
    self->settings = settings;
    self->io = io;
    self->sequencer.withheld = 0; /* a recording holds only requests that lacked nothing */
    frame_scanner_init(&self->receiver.scanner, self->settings->dialect); /* it starts anew with every datagram */
    self->sequencer.faults.report = k_no_report;
    set_reports(&self->snapshot, &k_no_report);
}

void gateway_start_settled(gateway_t *self)
{
    sequencer_start_settled(&self->sequencer);
}

void gateway_reload(gateway_t *self, const settings_t *settings)
{
    self->settings = settings;
    motion_set_spike_gate(&self->motion, settings->spike_gate);
}

event_t gateway_withhold(gateway_t *self, uint32_t permits)
{
    const uint32_t lost = permits & ~self->sequencer.withheld;
    self->sequencer.withheld = permits & ~(uint32_t)PERMIT_PUNCTUAL; /* each cycle that is late is a loss of its own */
    return supervisor_response(&self->sequencer.supervisor, lost);
}

uint32_t gateway_missing(gateway_t *self, event_t request)
{
    const cycle_t cycle = cycle_of(self, self->snapshot.now_us);
    const supervisor_view_t view = actions_view(&self->sequencer, &cycle);
    return supervisor_missing(&self->sequencer.supervisor, request, &view);
}

uint32_t gateway_absent(const gateway_t *self, event_t request)
{
    const bool is_up = self->sequencer.supervisor.state == STATE_OFF && (request == EVENT_ENGAGE || request == EVENT_PARK);
    return is_up ? feedback_absent(feedback_of(self)) : 0;
}

hv_status_t gateway_request(gateway_t *self, event_t request, uint64_t now_us)
{
    const cycle_t cycle = cycle_of(self, now_us);
    return sequencer_request(&self->sequencer, request, &cycle);
}

service_answer_t gateway_service(gateway_t *self, const service_request_t *request, uint64_t now_us)
{
    const cycle_t cycle = cycle_of(self, now_us);
    return self->sequencer.supervisor.state == STATE_SERVICE ? service_request(&self->sequencer.service, &cycle, request)
                                                             : SERVICE_NOT_SERVING;
}

uint64_t gateway_tick_age(const gateway_t *self, uint64_t tick_us)
{
    const uint64_t next_us = self->snapshot.now_us + self->settings->cycle_us; /* this cycle's tick has not been told yet */
    return tick_us <= self->snapshot.service.tick_us ? next_us + self->sequencer.service.late_us - tick_us : UINT64_MAX;
}

static void log_percent(const gateway_t *self, const char *before, unsigned percent, const char *after)
{
    char line[HAL_LOG_TEXT_MAX + 1];
    text_t text = text_start(line, sizeof line);
    text_put(&text, before);
    text_put_u32(&text, percent);
    text_put(&text, after);
    hal_log_write(self->io.log, HAL_LOG_NOTICE, line);
}

hv_status_t gateway_set_intensity(gateway_t *self, unsigned percent)
{
    const hv_status_t status = motion_set_intensity(&self->motion, percent);
    if (status == HV_OK) {
        log_percent(self, "intensity ", percent, " %");
    }
    return status;
}

hv_status_t gateway_set_rise_percent(gateway_t *self, unsigned percent)
{
    const hv_status_t status = motion_set_rise_percent(&self->motion, percent);
    if (status == HV_OK) {
        log_percent(self, "rises at ", percent, " % of engage speed");
    }
    return status;
}

void gateway_note_late(gateway_t *self, uint32_t cycles)
{
    uint32_t *late = &self->snapshot.counters.late_cycles;
    *late = cycles < UINT32_MAX - *late ? *late + cycles : UINT32_MAX; /* a count that began anew would look like none late */
    self->sequencer.service.late_us += (uint64_t)cycles * self->settings->cycle_us;
    self->sequencer.is_late |= cycles > self->settings->healthy.late_cycles;
}

void gateway_inject_fault(gateway_t *self, fault_code_t code, unsigned axis)
{
    if ((unsigned)code < FAULT_CODES && axis <= drives_count(self->io.drives) && (axis != 0) == fault_is_of_axis(code)) {
        self->sequencer.has_injected = true;
        self->sequencer.injected[axis] |= 1u << (unsigned)code;
    }
}

/* A hold leaves a ride's relays as they are for a while, if so configured. */
static bool is_hold_young(const sequencer_t *sequencer, uint32_t safe_after_ms, uint64_t now_us)
{
    return sequencer->supervisor.state == STATE_HOLD && sequencer->supervisor.interrupted == STATE_ENGAGED &&
           now_us - sequencer->state_since_us < (uint64_t)safe_after_ms * 1000;
}

/* Only an engaged sender commands the relays, or a hand in service; the safe mask holds everywhere else. */
static void write_relays(gateway_t *self, const cycle_t *cycle)
{
    const sequencer_t *sequencer = &self->sequencer;
    const uint16_t safe_mask = self->settings->relay_safe_mask;
    const bool is_sender_heard = sequencer->supervisor.state == STATE_ENGAGED ||
                                 is_hold_young(sequencer, self->settings->relay_safe_after_ms, cycle->now_us);
    const bool is_serving = sequencer->supervisor.state == STATE_SERVICE;
    const uint16_t wanted = is_sender_heard ? self->sender.frame_mask
                            : is_serving    ? service_relays(&sequencer->service, safe_mask)
                                            : safe_mask;
    const relay_output_in_t in = {.wanted_mask = wanted,
                                  .is_safe = wanted == safe_mask && !is_sender_heard,
                                  .is_well = sequencer_is_well(sequencer, cycle)};
    self->snapshot.counters.relay_errors +=
        !relay_output_step(&self->relay_output, self->settings, &self->io, &in, cycle->now_us);
    self->sequencer.is_late = false;
}

/* A frame may end a hold, and another sender's first one begins anew. */
static void accept_frame(sequencer_t *sequencer, sender_in_t *in, const cycle_t *cycle, const frame_t *frame)
{
    in->state = sequencer->supervisor.state;
    const sender_verdict_t verdict = sender_judge(cycle->sender, in, frame);
    if (verdict == SENDER_REFUSED) {
        return;
    }
    if (verdict == SENDER_NEW && in->state == STATE_ENGAGED) {
        actions_follow(cycle);
    }
    auto_engage_frame(&sequencer->auto_engage, in->now_us);
    const motion_target_t target = sender_target(cycle->sender, in, frame);
    actions_event(sequencer, EVENT_FRAME, cycle);
    in->state = sequencer->supervisor.state;
    (void)sender_follow(cycle->sender, in, frame, &target);
}

static void receive_frames(gateway_t *self, const cycle_t *cycle)
{
    const uint64_t now_us = cycle->now_us;
    sender_in_t in = {.settings = self->settings,
                      .io = {self->io.udp, self->io.log, &self->snapshot.counters},
                      .receiver = &self->receiver,
                      .motion = &self->motion,
                      .output = &self->output,
                      .now_us = now_us};
    frame_t frame;
    frame_receiver_begin(&self->receiver);
    sender_begin(&self->sender, now_us);
    while (frame_receiver_next(&self->receiver, self->settings, &in.io, now_us, &frame)) {
        accept_frame(&self->sequencer, &in, cycle, &frame);
    }
    in.state = self->sequencer.supervisor.state;
    sender_end(&self->sender, &in);
}

/* One line for the first such stop of a burst. */
static void log_singular_stops(log_limit_t *limit, hal_log_t log, uint32_t stops, uint32_t before, uint64_t now_us)
{
    if (stops != before && log_limit_due(limit, stops, now_us) > 0) {
        hal_log_write(log, HAL_LOG_WARNING,
                      "stopped: the extensions sent lead too near a singularity; send ones that go round it");
    }
}

static void show_states(snapshot_t *s, const sequencer_t *sequencer)
{
    const supervisor_t *supervisor = &sequencer->supervisor;
    s->state = supervisor->state;
    s->goal = supervisor->goal;
    s->interrupted = supervisor->interrupted;
    s->is_held_by_silence = supervisor->is_held_by_silence;
    s->is_estop_active = sequencer->inputs.is_estop_active;
    s->is_power_failing = sequencer->inputs.is_power_failing;
    s->rides = sequencer->rides;
}

static void show_faults(snapshot_t *s, const faults_t *faults)
{
    s->fault = faults->first;
    s->fault_report = faults->report;
    s->reaction = faults->reaction;
    for (unsigned i = 0; s->counters.faults != faults->total && i < FAULT_CODES; i++) {
        s->fault_last_us[i] = faults->last_us[i];
        s->counters.fault[i] = faults->count[i];
    }
    s->counters.faults = faults->total;
    for (unsigned i = 0; i <= DRIVES_MAX; i++) {
        s->begun[i] = faults->begun[i];
    }
}

static void show_sender(snapshot_t *s, const sender_t *sender, mask_policy_t mask_policy)
{
    s->owner = sender->owner;
    s->other = sender->other;
    s->last_frame_us = sender->last_frame_us;
    s->mask_habit = mask_guard_habit(&sender->mask_guard, mask_policy);
    s->has_received = sender->received.is_pose;
    for (unsigned i = 0; i < POSE_AXES; i++) {
        s->received_q16[i] = sender->received.value_q16[i];
    }
    s->counters.unconfirmed = sender->confirm.dropped;
}

static void show_relays(snapshot_t *s, const relay_output_t *relays)
{
    s->relay_mask = relays->effects_mask;
    s->is_healthy = relays->is_healthy;
    s->is_relays_unknown = relays->is_unknown;
    s->counters.relay_cut = relays->policy.cut_count;
    s->counters.relay_delayed = relays->policy.delay_count;
}

static void show_motion(snapshot_t *s, const motion_t *motion, const motion_output_t *output)
{
    s->asked = output->asked;
    s->sent = output->sent;
    for (unsigned i = 0; i < CYLINDERS_MAX; i++) {
        s->extension_mm_q32[i] = output->extension_mm_q32[i];
    }
    s->angle_deg_q32 = output->angle_deg_q32;
    s->flags = output->flags;
    s->limiting_cylinder = output->limiting_cylinder;
    s->intensity_percent = (uint8_t)motion_intensity(motion)->percent;
    s->intensity_now_q32 = intensity_percent_q32(motion_intensity(motion));
    s->stream_period_us = stream_period_us(motion_stream(motion));
    s->stream = stream_report(motion_stream(motion));
    s->stream_delay_us = s->stream.delay_us;
    s->counters.spikes = spike_filter_spikes(motion_spike_filter(motion));
    s->counters.singular_stops = motion_singular_stops(motion);
    s->counters.stretched = motion_stretched_count(motion);
}

/* What follows from the feedback. */
static void show_drives(snapshot_t *s, const cycle_t *cycle)
{
    for (unsigned i = 0; i < cycle->feedback.count; i++) {
        wear_step(&s->wear[i], &s->drive[i], cycle->settings->cycle_us);
    }
    plate_step(&s->plate, motion_kin(cycle->motion), s->drive, &s->sent, cycle->now_us);
}

static void publish(gateway_t *self, const cycle_t *cycle)
{
    snapshot_t *s = &self->snapshot;
    s->now_us = cycle->now_us;
    s->cycle++;
    s->counters.clamped += (self->output.flags & MOTION_CLAMPED) != 0;
    log_singular_stops(&self->singular_log, self->io.log, motion_singular_stops(&self->motion), s->counters.singular_stops,
                       cycle->now_us);
    show_states(s, &self->sequencer);
    show_faults(s, &self->sequencer.faults);
    show_sender(s, &self->sender, self->settings->mask_policy);
    show_relays(s, &self->relay_output);
    show_motion(s, &self->motion, &self->output);
    show_drives(s, cycle);
    service_publish(&self->sequencer.service, cycle, &s->service);
    reports_step(&self->reports, self->io.drives, self->io.log, cycle->now_us, s->report);
}

/* What holds whenever set-points are sent. A state that breaks it commands nothing: the program ends, and the drives' watchdogs
 * stop them. */
static void assert_cycle(const sequencer_t *sequencer, const motion_t *motion)
{
    const state_t state = sequencer->supervisor.state;
    const drive_control_t *drives = &sequencer->drive_control;
    HV_ASSERT((unsigned)state < STATES && (unsigned)drives->bring_up <= BRING_UP_MOVE);
    HV_ASSERT(state == STATE_ENGAGED || !motion_is_following(motion));
    HV_ASSERT(state != STATE_ESTOP || drives->is_tracking);
    HV_ASSERT(state != STATE_OFF || drives->is_tracking || drives->is_disable_due);
}

void gateway_cycle(gateway_t *self, uint64_t now_us)
{
    const cycle_t cycle = cycle_of(self, now_us);
    sequencer_t *sequencer = &self->sequencer;
    sequencer_begin(sequencer, &cycle);
    const bool is_bus_heard = drives_poll(self->io.drives, now_us, self->snapshot.drive) == HV_OK;
    sequencer_before_frames(sequencer, &cycle, self->io.inputs, is_bus_heard);
    receive_frames(self, &cycle);
    sequencer_after_frames(sequencer, &cycle);
    if (drive_control_accepts_motion(&sequencer->drive_control)) {
        motion_step(&self->motion, now_us, &self->output);
    }
    assert_cycle(sequencer, &self->motion);
    drive_control_send(&sequencer->drive_control, &cycle, &self->output);
    sequencer_after_motion(sequencer, &cycle);
    write_relays(self, &cycle);
    publish(self, &cycle);
}

const snapshot_t *gateway_snapshot(const gateway_t *self)
{
    return &self->snapshot;
}

bool gateway_is_finished(const gateway_t *self)
{
    return shutdown_is_finished(&self->sequencer.shutdown, feedback_of(self));
}

uint32_t gateway_energized(const gateway_t *self)
{
    return feedback_energized(feedback_of(self), false);
}
