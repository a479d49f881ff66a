/* SPDX-License-Identifier: MIT
 * gateway.c - one cycle of the gateway, in the order of the picture in DESIGN.md.
 */
#include "heave/gateway.h"

#include "auto_engage.h"
#include "heave/text.h"
#include "frame_receiver.h"
#include "log_limit.h"
#include "actions.h"
#include "relay_output.h"
#include "reports.h"
#include "sender.h"
#include "sequencer.h"
#include "service.h"
#include "shutdown.h"
#include "target.h"

static bool is_io_valid(const gateway_io_t *io)
{
    return hal_udp_valid(io->udp) && drives_valid(io->drives) && hal_relays_valid(io->relays) && hal_inputs_valid(io->inputs) &&
           hal_log_valid(io->log) && (io->healthy.ops == NULL || hal_relays_valid(io->healthy));
}

/* Texts of drives that have said nothing yet. */
static void clear_reports(snapshot_t *shown)
{
    shown->fault_report = (drive_report_t){.phase = "", .trouble = "", .detail = ""};
    for (unsigned i = 0; i < DRIVES_MAX; i++) {
        shown->report[i] = (drive_report_t){.phase = "", .trouble = "", .detail = ""};
    }
}

hv_status_t gateway_init(gateway_t *self, const settings_t *settings, const gateway_io_t *io)
{
    if (!is_io_valid(io)) {
        return HV_ERR_ARG;
    }
    *self = (gateway_t){.settings = settings, .io = *io, .drive_control = {.is_tracking = true}};
    clear_reports(&self->snapshot);
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
    const settings_t *settings = self->settings;
    auto_engage_init(&self->auto_engage, settings->engage == ENGAGE_AUTO, settings->cycle_us, settings->auto_frames);
}

void gateway_save(const gateway_t *self, gateway_t *out)
{
    *out = *self;
    out->settings = NULL;
    out->io = (gateway_io_t){.udp = {NULL, NULL}};
    out->snapshot.fault_report = (drive_report_t){.phase = NULL};
    for (unsigned i = 0; i < DRIVES_MAX; i++) {
        out->snapshot.report[i] = (drive_report_t){.phase = NULL};
    }
}

void gateway_resume(gateway_t *self, const gateway_t *saved)
{
    const settings_t *settings = self->settings;
    const gateway_io_t io = self->io;
    *self = *saved;
    self->settings = settings;
    self->io = io;
    self->withheld = 0; /* a recording holds only requests that lacked nothing */
    frame_scanner_init(&self->receiver.scanner, self->settings->dialect); /* it starts anew with every datagram */
    clear_reports(&self->snapshot);
}

void gateway_start_settled(gateway_t *self)
{
    supervisor_init_settled(&self->supervisor);
    self->drive_control.is_tracking = false;
    if (auto_engage_is_ready(&self->auto_engage, 0)) {
        auto_engage_end(&self->auto_engage);
        self->supervisor.goal = STATE_ENGAGED;
    }
}

void gateway_reload(gateway_t *self, const settings_t *settings)
{
    self->settings = settings;
    motion_set_spike_gate(&self->motion, settings->spike_gate);
}

event_t gateway_withhold(gateway_t *self, uint32_t permits)
{
    const uint32_t lost = permits & ~self->withheld;
    self->withheld = permits & ~(uint32_t)PERMIT_PUNCTUAL; /* each cycle that is late is a loss of its own */
    return supervisor_response(&self->supervisor, lost);
}

uint32_t gateway_missing(gateway_t *self, event_t request)
{
    const cycle_t cycle = actions_cycle(self, self->snapshot.now_us);
    const supervisor_view_t view = actions_view(self, &cycle);
    return supervisor_missing(&self->supervisor, request, &view);
}

hv_status_t gateway_request(gateway_t *self, event_t request, uint64_t now_us)
{
    const cycle_t cycle = actions_cycle(self, now_us);
    return sequencer_request(self, request, &cycle);
}

service_answer_t gateway_service(gateway_t *self, const service_request_t *request, uint64_t now_us)
{
    const cycle_t cycle = actions_cycle(self, now_us);
    return self->supervisor.state == STATE_SERVICE ? service_request(&self->service, &cycle, request) : SERVICE_NOT_SERVING;
}

uint64_t gateway_tick_age(const gateway_t *self, uint64_t tick_us)
{
    const uint64_t next_us = self->snapshot.now_us + self->settings->cycle_us; /* this cycle's tick has not been told yet */
    return tick_us <= self->snapshot.service.tick_us ? next_us + self->service.late_us - tick_us : UINT64_MAX;
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
    self->service.late_us += (uint64_t)cycles * self->settings->cycle_us;
    self->is_late |= cycles > self->settings->healthy.late_cycles;
}

void gateway_tell_fault(gateway_t *self, fault_code_t code, unsigned axis)
{
    if ((unsigned)code < FAULT_CODES && axis <= drives_count(self->io.drives) && (axis != 0) == fault_is_of_axis(code)) {
        self->told[axis] |= 1u << (unsigned)code;
    }
}

/* A hold leaves a ride's relays as they are for a while, if so configured. */
static bool is_hold_young(const gateway_t *self, uint64_t now_us)
{
    return self->supervisor.state == STATE_HOLD && self->supervisor.interrupted == STATE_ENGAGED &&
           now_us - self->state_since_us < (uint64_t)self->settings->relay_safe_after_ms * 1000;
}

/* Only an engaged sender commands the relays, or a hand in service; the safe mask holds everywhere else. */
static void write_relays(gateway_t *self, const cycle_t *cycle)
{
    const bool is_sender_heard = self->supervisor.state == STATE_ENGAGED || is_hold_young(self, cycle->now_us);
    const bool is_serving = self->supervisor.state == STATE_SERVICE;
    const uint16_t wanted = is_sender_heard ? self->sender.frame_mask
                            : is_serving    ? service_relays(&self->service, self->settings->relay_safe_mask)
                                            : self->settings->relay_safe_mask;
    const relay_output_in_t in = {.wanted_mask = wanted,
                                  .is_safe = wanted == self->settings->relay_safe_mask && !is_sender_heard,
                                  .is_well = sequencer_is_well(self, cycle),
                                  .was_unknown = self->snapshot.is_relays_unknown};
    const relay_output_out_t out = relay_output_step(&self->relay_output, self->settings, &self->io, &in, cycle->now_us);
    self->is_late = false;
    self->snapshot.is_healthy = out.is_healthy;
    self->snapshot.is_relays_unknown = out.is_unknown;
    self->snapshot.counters.relay_errors += out.is_refused;
}

/* A frame may end a hold, and another sender's first one begins anew. */
static void take_frame(gateway_t *self, sender_in_t *in, const cycle_t *cycle, const frame_t *frame)
{
    in->state = self->supervisor.state;
    const sender_verdict_t verdict = sender_judge(&self->sender, in, frame);
    if (verdict == SENDER_REFUSED) {
        return;
    }
    if (verdict == SENDER_NEW && in->state == STATE_ENGAGED) {
        actions_follow(self, in->now_us);
    }
    auto_engage_frame(&self->auto_engage, in->now_us);
    const motion_target_t target = sender_target(&self->sender, in, frame);
    actions_event(self, EVENT_FRAME, cycle);
    in->state = self->supervisor.state;
    if (sender_follow(&self->sender, in, frame, &target)) {
        target_received(&self->snapshot, frame);
    }
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
        take_frame(self, &in, cycle, &frame);
    }
    in.state = self->supervisor.state;
    sender_end(&self->sender, &in);
}

/* One line for the first such stop of a burst. */
static void note_singular_stops(gateway_t *self, uint64_t now_us)
{
    const uint32_t stops = motion_singular_stops(&self->motion);
    if (stops != self->snapshot.counters.singular_stops && log_limit_due(&self->singular_log, stops, now_us) > 0) {
        hal_log_write(self->io.log, HAL_LOG_WARNING,
                      "stopped: the extensions sent lead too near a singularity; send ones that go round it");
    }
    self->snapshot.counters.singular_stops = stops;
}

static void publish(gateway_t *self, const cycle_t *cycle)
{
    const uint64_t now_us = cycle->now_us;
    snapshot_t *s = &self->snapshot;
    s->now_us = now_us;
    s->state = self->supervisor.state;
    s->goal = self->supervisor.goal;
    s->interrupted = self->supervisor.interrupted;
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
    s->other = self->sender.other;
    s->last_frame_us = self->sender.last_frame_us;
    s->mask_habit = mask_guard_habit(&self->sender.mask_guard, self->settings->mask_policy);
    service_publish(&self->service, cycle, &s->service);
    s->counters.clamped += (s->flags & MOTION_CLAMPED) != 0;
    s->counters.relay_cut = self->relay_output.policy.cut_count;
    s->counters.relay_delayed = self->relay_output.policy.delay_count;
    s->counters.spikes = spike_filter_spikes(motion_spike_filter(&self->motion));
    note_singular_stops(self, now_us);
    s->counters.unconfirmed = self->sender.confirm.dropped;
    s->counters.stretched = motion_stretched_count(&self->motion);
    for (unsigned i = 0; i < cycle->feedback.count; i++) {
        wear_step(&s->wear[i], &s->drive[i], self->settings->cycle_us);
    }
    plate_take(&s->plate, motion_kin(&self->motion), s->drive, &s->sent, now_us);
    s->cycle++;
}

static void step_shutdown(gateway_t *self, const cycle_t *cycle)
{
    const shutdown_in_t in = {.feedback = cycle->feedback,
                              .is_down = self->supervisor.state == STATE_OFF || supervisor_is_latched(&self->supervisor),
                              .is_disable_due = self->drive_control.is_disable_due,
                              .is_bus_lost = self->fault_watch.is_bus_lost ||
                                             drive_control_is_bus_stalled(&self->drive_control, self->settings->cycle_us)};
    shutdown_step(&self->shutdown, &in, self->io.log, cycle->now_us);
}

void gateway_cycle(gateway_t *self, uint64_t now_us)
{
    const cycle_t cycle = actions_cycle(self, now_us);
    sequencer_before_frames(self, &cycle);
    receive_frames(self, &cycle);
    sequencer_after_frames(self, &cycle);
    if (drive_control_takes_motion(&self->drive_control)) {
        motion_step(&self->motion, now_us, &self->output);
    }
    drive_control_send(&self->drive_control, &cycle, &self->output);
    sequencer_after_motion(self, &cycle);
    step_shutdown(self, &cycle);
    write_relays(self, &cycle);
    publish(self, &cycle);
}

const snapshot_t *gateway_snapshot(const gateway_t *self)
{
    return &self->snapshot;
}

bool gateway_is_finished(const gateway_t *self)
{
    return shutdown_is_finished(&self->shutdown, actions_feedback(self));
}

uint32_t gateway_energized(const gateway_t *self)
{
    return feedback_energized(actions_feedback(self), false);
}
