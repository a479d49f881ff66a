/* SPDX-License-Identifier: MIT
 * status_json.c - the status as JSON; see status_json.h.
 */
#include "service/status_json.h"

#include <stdio.h>

#include "common/build_id.h"
#include "common/decimal.h"
#include "common/translate.h"
#include "heave/motion.h" // MOTION_CLAMPED and its kin
#include "service/report_json.h"
#include "service/service_json.h"

static const char *const k_pose_keys[POSE_AXES] = {"roll_deg", "pitch_deg", "yaw_deg", "x_mm", "y_mm", "z_mm"};
static const char *const k_speed_keys[POSE_AXES] = {"roll_deg_s", "pitch_deg_s", "yaw_deg_s", "x_mm_s", "y_mm_s", "z_mm_s"};
static const char *const k_accel_keys[POSE_AXES] = {"roll_deg_s2", "pitch_deg_s2", "yaw_deg_s2", "x_mm_s2", "y_mm_s2", "z_mm_s2"};

static const char *const k_drive_states[] = {
    [DRIVE_OFFLINE] = "offline", [DRIVE_DISABLED] = "disabled", [DRIVE_ENABLING] = "enabling",
    [DRIVE_ENABLED] = "enabled", [DRIVE_HOMING] = "homing",     [DRIVE_FAULT] = "fault",
};

static const struct {
    unsigned flag;
    const char *word;
} k_flags[] = {
    {MOTION_CLAMPED, "clamped"},     {MOTION_SPEED, "speed"},       {MOTION_ACCEL, "accel"},
    {MOTION_STRETCHED, "stretched"}, {MOTION_TAKEOVER, "takeover"}, {MOTION_IN_CYLINDERS, "cylinders"},
    {MOTION_OFF_PATH, "off-path"},   {MOTION_NO_POSE, "no-pose"},
};

static void write_pose(json_t *json, const char *key, const char *const axis_keys[POSE_AXES], const pose_t *pose)
{
    json_open(json, key, '{');
    for (unsigned i = 0; i < POSE_AXES; i++) {
        json_q32(json, axis_keys[i], pose->axis_q32[i]);
    }
    json_close(json, '}');
}

/* What feedback tells of the plate; null where it does not. */
static void write_actual(json_t *json, const char *key, const char *const axis_keys[POSE_AXES], const pose_t *pose, bool is_known)
{
    if (is_known) {
        write_pose(json, key, axis_keys, pose);
    } else {
        json_null(json, key);
    }
}

/* What the device code of the fault meant when it began; of a drive that was not there, and said nothing, what it was at. */
static const char *device_text(const snapshot_t *s)
{
    const drive_report_t *report = &s->fault_report;
    if (report->code != 0 && report->code == s->fault.device_code) {
        return report->trouble;
    }
    const bool is_at = s->fault.code == FAULT_DRIVE_OFFLINE && s->fault.device_code == 0 && report->phase != NULL;
    return is_at ? report->phase : "";
}

static const char *found_by(fault_code_t code)
{
    if (code == FAULT_NONE) {
        return "";
    }
    return fault_is_found_by_drive(code) ? "drive" : "heaved";
}

/* How far off a cylinder is in mm, or the rotation motor in deg; null where the fault is not about that. */
static void write_distance(json_t *json, const snapshot_t *s, bool is_angle)
{
    const bool is_there = s->fault.allowed_q32 != 0 && (s->fault.axis > s->cylinders) == is_angle;
    if (is_there) {
        json_q32(json, is_angle ? "off_deg" : "off_mm", s->fault.off_q32);
        json_q32(json, is_angle ? "allowed_deg" : "allowed_mm", s->fault.allowed_q32);
    } else {
        json_null(json, is_angle ? "off_deg" : "off_mm");
        json_null(json, is_angle ? "allowed_deg" : "allowed_mm");
    }
}

static void write_fault(json_t *json, const snapshot_t *s)
{
    const fault_help_t *help = fault_help(s->fault.code);
    json_open(json, "fault", '{');
    json_number(json, "code", (uint64_t)s->fault.code);
    json_text(json, "name", help->name);
    json_number(json, "axis", s->fault.axis);
    json_number(json, "device_code", s->fault.device_code);
    json_text(json, "device_text", device_text(s));
    report_json(json, &s->fault_report, s->fault.axis > s->cylinders, s->now_us);
    json_text(json, "found_by", found_by(s->fault.code));
    write_distance(json, s, false);
    write_distance(json, s, true);
    json_ms(json, "at_ms", s->fault.at_us);
    json_text(json, "reaction", fault_reaction_name(s->reaction));
    json_text(json, "text", fault_text(s->fault.code));
    json_text(json, "cause", help->cause[FAULT_ENGLISH]);
    json_text(json, "remedy", help->remedy[FAULT_ENGLISH]);
    json_text(json, "text_zh", help->text_zh);
    json_text(json, "cause_zh", help->cause[FAULT_CHINESE]);
    json_text(json, "remedy_zh", help->remedy[FAULT_CHINESE]);
    json_close(json, '}');
}

/* How often each has been, and when last. */
static void write_fault_counts(json_t *json, const snapshot_t *s)
{
    json_open(json, "fault_counts", '[');
    for (unsigned i = 1; i < FAULT_CODES; i++) {
        if (s->counters.fault[i] > 0) {
            json_open(json, NULL, '{');
            json_number(json, "code", i);
            json_text(json, "name", fault_help((fault_code_t)i)->name);
            json_number(json, "count", s->counters.fault[i]);
            json_ms(json, "last_ms", s->fault_last_us[i]);
            json_close(json, '}');
        }
    }
    json_close(json, ']');
}

/* Engaged, or held since, and nobody has ever sent a frame that it could follow. */
static bool is_waiting_for_sender(const snapshot_t *s)
{
    return s->last_frame_us == 0 && (s->state == STATE_ENGAGED || s->is_held_by_silence);
}

static void write_hold_reason(json_t *json, const motion_view_t *view)
{
    const snapshot_t *s = &view->snapshot;
    char text[64] = "";
    if (s->state == STATE_HOLD && s->is_held_by_silence) {
        (void)snprintf(text, sizeof text, "%s", N_("the sender is silent"));
    } else if (s->state == STATE_HOLD && view->hold_late_cycles > 0) {
        (void)snprintf(text, sizeof text, N_("%u cycles were late"), (unsigned)view->hold_late_cycles);
    } else if (s->state == STATE_HOLD && s->interrupted == STATE_HOMING && view->is_shutting_down) {
        (void)snprintf(text, sizeof text, "%s", N_("the drives were coming up when it was to end"));
    } else if (s->state == STATE_HOLD) {
        (void)snprintf(text, sizeof text, "%s", N_("a hold was asked for"));
    }
    json_text(json, "hold_reason", text);
}

static void write_state(json_t *json, const motion_view_t *view)
{
    const snapshot_t *s = &view->snapshot;
    json_text(json, "state", state_name(s->state));
    json_text(json, "goal", state_name(s->goal));
    json_bool(json, "held_by_silence", s->is_held_by_silence);
    write_hold_reason(json, view);
    json_bool(json, "waiting_for_sender", is_waiting_for_sender(s));
    json_bool(json, "healthy", s->is_healthy);
    json_bool(json, "estop_active", s->is_estop_active);
    json_bool(json, "power_failing", s->is_power_failing);
    json_bool(json, "shutting_down", view->is_shutting_down);
    json_open(json, "service", '{');
    service_json_hand(json, s);
    json_close(json, '}');
    write_fault(json, s);
}

static void write_poses(json_t *json, const snapshot_t *s)
{
    pose_t received;
    for (unsigned i = 0; i < POSE_AXES; i++) {
        received.axis_q32[i] = q32_from_q16(s->received_q16[i]);
    }
    write_actual(json, "pose_received", k_pose_keys, &received, s->has_received);
    write_pose(json, "pose_asked", k_pose_keys, &s->asked);
    write_pose(json, "pose_sent", k_pose_keys, &s->sent);
    write_actual(json, "pose_actual", k_pose_keys, &s->plate.pose, s->plate.has_pose);
    write_actual(json, "speed_actual", k_speed_keys, &s->plate.speed_per_s, s->plate.has_rates);
    write_actual(json, "accel_actual", k_accel_keys, &s->plate.accel_per_s2, s->plate.has_rates);
}

/* How a drive is served; null where its bus has a period of its own, or nothing is known yet. */
static void write_service(json_t *json, const drive_feedback_t *drive, const drive_report_t *report, uint64_t now_us)
{
    if (report->period_us != 0) {
        json_ms(json, "period_ms", report->period_us);
    } else {
        json_null(json, "period_ms");
    }
    report_json_age(json, "setpoint_age_ms", report->setpoint_us, now_us);
    report_json_age(json, "feedback_age_ms", drive->has_actual ? drive->actual_us : 0, now_us);
}

/* Members that every axis has; unit is "mm" or "deg" in the keys. */
static void write_axis(json_t *json, const snapshot_t *s, unsigned axis, q32_t sent_q32, const char *sent_key,
                       const char *actual_key)
{
    const drive_feedback_t *drive = &s->drive[axis];
    json_q32(json, sent_key, sent_q32);
    if (drive->has_actual) {
        json_q32(json, actual_key, drive->actual_mm_q32);
    } else {
        json_null(json, actual_key);
    }
    json_text(json, "drive", k_drive_states[drive->state]);
    json_bool(json, "torque", drive_has_torque(drive));
    json_bool(json, "homed", drive->is_homed);
    json_number(json, "device_code", drive->fault_code);
    write_service(json, drive, &s->report[axis], s->now_us);
    report_json(json, &s->report[axis], axis >= s->cylinders, s->now_us);
}

static void write_axes(json_t *json, const snapshot_t *s, const config_t *config)
{
    json_open(json, "cylinders", '[');
    for (unsigned i = 0; i < s->cylinders; i++) {
        json_open(json, NULL, '{');
        json_number(json, "number", i + 1);
        json_q32(json, "stroke_mm", q32_from_q16(config->settings.stroke_mm_q16[i]));
        write_axis(json, s, i, s->extension_mm_q32[i], "sent_mm", "actual_mm");
        json_close(json, '}');
    }
    json_close(json, ']');
    if (s->has_angle) {
        json_open(json, "rotation", '{');
        write_axis(json, s, s->cylinders, s->angle_deg_q32, "sent_deg", "actual_deg");
        json_close(json, '}');
    } else {
        json_null(json, "rotation");
    }
}

static void write_relays(json_t *json, const snapshot_t *s)
{
    char mask[5] = {0};
    (void)decimal_put_hex(mask, s->relay_mask, 4);
    json_open(json, "relays", '{');
    json_number(json, "count", s->relay_count);
    json_bool(json, "known", !s->is_relays_unknown);
    json_text(json, "mask", mask);
    json_open(json, "on", '[');
    for (unsigned i = 0; i < s->relay_count; i++) {
        if ((s->relay_mask >> i & 1) != 0) {
            json_number(json, NULL, i + 1);
        }
    }
    json_close(json, ']');
    json_close(json, '}');
}

/* The platform is where it was asked to be. */
static bool has_arrived(const snapshot_t *s)
{
    bool is_there = true;
    for (unsigned i = 0; i < POSE_AXES; i++) {
        is_there = is_there && s->asked.axis_q32[i] == s->sent.axis_q32[i];
    }
    return is_there;
}

/* A move that took longer has done so once it has arrived. */
static void write_flags(json_t *json, const snapshot_t *s)
{
    const unsigned over = has_arrived(s) ? MOTION_STRETCHED : 0u;
    json_open(json, "flags", '[');
    for (size_t i = 0; i < sizeof k_flags / sizeof k_flags[0]; i++) {
        if ((s->flags & ~over & k_flags[i].flag) != 0) {
            json_text(json, NULL, k_flags[i].word);
        }
    }
    json_close(json, ']');
    json_number(json, "limiting_cylinder", s->limiting_cylinder);
}

/* The buses of drives and relays; null where there is none, or only one that has always worked. */
static void write_bus(json_t *json, const motion_view_t *view, const config_t *config)
{
    if (config->drives == CONFIG_DRIVES_SIM && view->bus_last_trouble[0] == '\0') {
        json_null(json, "bus");
        return;
    }
    json_open(json, "bus", '{');
    json_text(json, "trouble", view->bus_trouble);
    json_text(json, "last_trouble", view->bus_last_trouble);
    json_close(json, '}');
}

static void write_intensity(json_t *json, const snapshot_t *s, const config_t *config)
{
    json_open(json, "intensity", '{');
    json_number(json, "percent", s->intensity_percent);
    json_q32(json, "now_percent", s->intensity_now_q32);
    json_number(json, "max_percent", config->settings.intensity_max_percent);
    json_close(json, '}');
}

/* What kind of sender it is. */
static const char *sender_name(stream_sender_t sender)
{
    static const char *const k_names[] = {[STREAM_SENDER_UNKNOWN] = "",
                                          [STREAM_SENDER_EVEN] = "even",
                                          [STREAM_SENDER_BURSTS] = "bursts",
                                          [STREAM_SENDER_ARRIVALS] = "arrivals"};
    return k_names[sender];
}

static void write_stream(json_t *json, const snapshot_t *s)
{
    json_open(json, "stream", '{');
    if (s->stream_period_us != 0) {
        json_ms(json, "period_ms", s->stream_period_us);
    } else {
        json_null(json, "period_ms");
    }
    json_ms(json, "delay_ms", s->stream_delay_us);
    json_text(json, "sender", sender_name(s->stream.sender));
    json_ms(json, "jitter_ms", s->stream.jitter_us);
    json_number(json, "lost_permille", s->stream.lost_permille);
    json_ms(json, "wait_ms", s->stream.wait_us);
    json_ms(json, "smoothing_ms", s->stream.smoothing_us);
    if (s->last_frame_us != 0) {
        json_ms(json, "last_frame_age_ms", s->now_us - s->last_frame_us);
    } else {
        json_null(json, "last_frame_age_ms");
    }
    json_close(json, '}');
}

/* Whether its frames have a relay mask. */
static const char *mask_name(mask_habit_t habit)
{
    static const char *const k_names[] = {
        [MASK_UNKNOWN] = "unknown", [MASK_SENT] = "sent", [MASK_NONE] = "none", [MASK_DIGITS] = "digits"};
    return k_names[habit];
}

/* Who drives, or who else sent last; null where nobody does.
 * mask: NULL: of no matter. */
static void write_owner(json_t *json, const char *key, const owner_t *owner, const char *mask, uint64_t now_us)
{
    char peer[HAL_UDP_PEER_TEXT_MAX];
    if (!owner->is_taken) {
        json_null(json, key);
        return;
    }
    (void)hal_udp_peer_text(&owner->peer, peer, sizeof peer);
    json_open(json, key, '{');
    json_text(json, "address", peer);
    json_ms(json, "age_ms", now_us - owner->last_us);
    if (mask != NULL) {
        json_text(json, "mask", mask);
    }
    json_close(json, '}');
}

static void write_frame_counters(json_t *json, const counters_t *c)
{
    json_open(json, "accepted", '{');
    for (unsigned i = 0; i < FRAME_COMMANDS; i++) {
        json_number(json, frame_command_name((frame_command_t)i), c->accepted[i]);
    }
    json_close(json, '}');
    json_number(json, "accepted_timed", c->accepted_timed);
    json_open(json, "rejected", '{');
    for (unsigned i = 0; i < FRAME_ERRORS; i++) {
        json_number(json, frame_error_name((frame_error_t)i), c->rejected[i]);
    }
    json_close(json, '}');
}

static void write_counters(json_t *json, const motion_view_t *view)
{
    const counters_t *c = &view->snapshot.counters;
    json_open(json, "counters", '{');
    json_number(json, "datagrams", c->datagrams);
    json_number(json, "oversize", c->oversize);
    json_number(json, "receive_errors", c->receive_errors);
    json_number(json, "refused_senders", view->udp_refused);
    json_number(json, "stale", view->udp_stale);
    json_number(json, "lost_in_kernel", view->udp_dropped);
    write_frame_counters(json, c);
    json_number(json, "other_sender", c->other_sender);
    json_number(json, "owner_changes", c->owner_changes);
    json_number(json, "not_followed", c->not_followed);
    json_number(json, "impossible", c->impossible);
    json_number(json, "singular_stops", c->singular_stops);
    json_number(json, "spikes", c->spikes);
    json_number(json, "unconfirmed", c->unconfirmed);
    json_number(json, "clamped", c->clamped);
    json_number(json, "stretched", c->stretched);
    json_number(json, "relay_missing", c->relay_missing);
    json_number(json, "relay_errors", c->relay_errors);
    json_number(json, "relay_cut", c->relay_cut);
    json_number(json, "relay_delayed", c->relay_delayed);
    json_number(json, "faults", c->faults);
    json_close(json, '}');
}

static void write_times(json_t *json, const char *key, const histogram_t *times)
{
    static const uint32_t k_shares[] = {50000, 99000, 99900, 99990};
    static const char *const k_keys[] = {"p50_us", "p99_us", "p99_9_us", "p99_99_us"};
    enum { SHARES = sizeof k_shares / sizeof k_shares[0] };
    uint64_t us[SHARES];
    histogram_percentiles_us(times, SHARES, k_shares, us);
    json_open(json, key, '{');
    json_number(json, "count", histogram_count(times));
    for (unsigned i = 0; i < SHARES; i++) {
        json_number(json, k_keys[i], us[i]);
    }
    json_number(json, "max_us", histogram_max_us(times));
    json_close(json, '}');
}

static void write_program(json_t *json, const motion_view_t *view, const config_t *config, const status_lost_t *lost,
                          const motion_times_t *times)
{
    json_number(json, "cycle", view->snapshot.cycle);
    json_number(json, "cycle_us", config->settings.cycle_us);
    json_number(json, "tick", view->snapshot.service.tick_us);
    json_ms(json, "uptime_ms", (view->snapshot.cycle + view->snapshot.counters.late_cycles) * config->settings.cycle_us);
    json_number(json, "time_unix_ms", lost->unix_ms);
    json_number(json, "late_cycles", view->snapshot.counters.late_cycles);
    json_bool(json, "realtime", view->is_realtime);
    write_times(json, "wake_latency", &times->wake);
    write_times(json, "cycle_time", &times->work);
    write_times(json, "frame_latency", &times->frame);
    json_bool(json, "memory_locked", view->is_memory_locked);
    json_number(json, "page_faults", view->page_faults);
    json_open(json, "lost", '{');
    json_number(json, "trace_rows", lost->trace_rows);
    json_number(json, "record_lines", lost->record_lines);
    json_number(json, "log_lines", lost->log_lines);
    json_number(json, "metrics", lost->metrics);
    json_number(json, "operator_entries", lost->operator_entries);
    json_close(json, '}');
    json_text(json, "version", HEAVE_VERSION);
    json_text(json, "build", build_id());
    json_open(json, "configuration", '{');
    json_text(json, "hash", config->hash);
    json_text(json, "digest", lost->digest != NULL ? lost->digest : "");
    json_text(json, "approved", config->approved.text);
    json_bool(json, "barred", lost->is_unapproved);
    json_text(json, "machine", config->machine_hash);
    json_bool(json, "slow_rise", lost->is_slow);
    if (lost->life != NULL && lost->life->commissioned.day != 0) {
        json_number(json, "commissioned_day", lost->life->commissioned.day);
    } else {
        json_null(json, "commissioned_day");
    }
    json_text(json, "changed", lost->changed != NULL ? lost->changed : "");
    json_text(json, "put_back", lost->put_back != NULL ? lost->put_back : "");
    json_close(json, '}');
}

/* Hours, way and cycles of each axis, with those before this start where they are kept. */
static void write_life(json_t *json, const lifetime_totals_t *life, const snapshot_t *s)
{
    if (life == NULL) {
        return;
    }
    json_open(json, "life", '{');
    json_number(json, "rides", life->rides);
    json_number(json, "faults", life->faults);
    json_open(json, "axes", '[');
    for (unsigned i = 0; i < life->axes; i++) {
        json_open(json, NULL, '{');
        json_number(json, "energized_s", life->axis[i].energized_ms / 1000);
        json_ms(json, i < s->cylinders ? "travel_mm" : "travel_deg", life->axis[i].travel_milli);
        json_number(json, "cycles", life->axis[i].turns / 2);
        json_close(json, '}');
    }
    json_close(json, ']');
    json_close(json, '}');
}

void status_json_write(json_t *json, const motion_view_t *view, const config_t *config, const status_lost_t *lost,
                       const motion_times_t *times)
{
    const snapshot_t *s = &view->snapshot;
    json_open(json, NULL, '{');
    json_bool(json, "ok", true);
    write_state(json, view);
    write_poses(json, s);
    write_axes(json, s, config);
    write_bus(json, view, config);
    write_relays(json, s);
    write_intensity(json, s, config);
    write_flags(json, s);
    write_stream(json, s);
    write_owner(json, "sender", &s->owner, mask_name(s->mask_habit), s->now_us);
    write_owner(json, "other_sender", &s->other, NULL, s->now_us);
    json_bool(json, "flood", lost->is_flood);
    write_counters(json, view);
    write_fault_counts(json, s);
    write_life(json, lost->life, s);
    service_json_selftest(json, lost, config);
    write_program(json, view, config, lost, times);
    json_close(json, '}');
}
