/* SPDX-License-Identifier: MIT
 * metrics.c - the status for Prometheus; see metrics.h. Names and units follow its conventions: base units, _total for counters.
 */
#include "service/metrics.h"

#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "common/build_id.h"
#include "common/decimal.h"
#include "common/message.h"

#define NUMBER_MAX 32u

/** A text being written. What does not fit sets is_cut. */
typedef struct {
    char *at;
    size_t capacity;
    size_t length;
    bool is_cut;
} sheet_t;

static __attribute__((format(printf, 2, 3))) void put(sheet_t *self, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    const int length = vsnprintf(&self->at[self->length], self->capacity - self->length, format, arguments);
    va_end(arguments);
    if (length < 0 || (size_t)length >= self->capacity - self->length) {
        self->is_cut = true;
    } else {
        self->length += (size_t)length;
    }
}

/* What the samples that follow are. */
static void head(sheet_t *self, const char *name, const char *type, const char *help)
{
    put(self, "# HELP heave_%s %s\n# TYPE heave_%s %s\n", name, help, name, type);
}

/* A sample without labels, with its head. */
static void whole(sheet_t *self, const char *name, const char *type, const char *help, uint64_t value)
{
    head(self, name, type, help);
    put(self, "heave_%s %" PRIu64 "\n", name, value);
}

static const char *q32_text(q32_t value_q32, char text[NUMBER_MAX])
{
    text[decimal_put_q32(text, value_q32, 6)] = '\0';
    return text;
}

/* Microseconds as seconds. */
static const char *seconds_text(uint64_t us, char text[NUMBER_MAX])
{
    (void)snprintf(text, NUMBER_MAX, "%" PRIu64 ".%06u", us / 1000000u, (unsigned)(us % 1000000u));
    return text;
}

/* --- Parts --- */

static void put_state(sheet_t *self, const snapshot_t *s)
{
    head(self, "state", "gauge", "1 for the state the platform is in");
    for (unsigned i = 0; i < STATES; i++) {
        put(self, "heave_state{state=\"%s\"} %u\n", state_name((state_t)i), s->state == (state_t)i ? 1u : 0u);
    }
    whole(self, "healthy", "gauge", "1 while states, deadlines and drives are as they should be, and have been for a while",
          s->is_healthy);
    whole(self, "power_failing", "gauge", "1 while the supply is failing", s->is_power_failing);
    whole(self, "estop_active", "gauge", "1 while the e-stop is pressed", s->is_estop_active);
    whole(self, "held_by_silence", "gauge", "1 while it holds because no frames come", s->is_held_by_silence);
    whole(self, "fault_code", "gauge", "the first fault since the last reset, 0 = none", (uint64_t)s->fault.code);
    head(self, "faults_total", "counter", "faults since the start, those that have been");
    for (unsigned i = 1; i < FAULT_CODES; i++) {
        if (s->counters.fault[i] > 0) {
            put(self, "heave_faults_total{fault=\"%s\"} %" PRIu32 "\n", fault_help((fault_code_t)i)->name, s->counters.fault[i]);
        }
    }
}

static void put_frames(sheet_t *self, const motion_view_t *view)
{
    const counters_t *c = &view->snapshot.counters;
    whole(self, "udp_datagrams_total", "counter", "datagrams read", c->datagrams);
    whole(self, "udp_dropped_total", "counter", "datagrams the kernel lost: its queue was full, or there was a flood",
          view->udp_dropped);
    whole(self, "udp_stale_total", "counter",
          "datagrams that had waited for more than 1 s while heaved stood still: not followed", view->udp_stale);
    whole(self, "udp_refused_total", "counter", "datagrams of senders that are not allowed", view->udp_refused);
    whole(self, "udp_other_sender_total", "counter", "valid frames of senders that do not drive", c->other_sender);
    whole(self, "owner_changes_total", "counter", "take-overs by another sender", c->owner_changes);
    head(self, "udp_frames_total", "counter", "frames by what became of them");
    for (unsigned i = 0; i < FRAME_COMMANDS; i++) {
        put(self, "heave_udp_frames_total{result=\"accepted\",what=\"%s\"} %" PRIu32 "\n", frame_command_name((frame_command_t)i),
            c->accepted[i]);
    }
    for (unsigned i = 0; i < FRAME_ERRORS; i++) {
        put(self, "heave_udp_frames_total{result=\"rejected\",what=\"%s\"} %" PRIu32 "\n", frame_error_name((frame_error_t)i),
            c->rejected[i]);
    }
    whole(self, "spikes_total", "counter", "samples that were not followed", c->spikes);
    whole(self, "unconfirmed_jumps_total", "counter", "far jumps that no second frame confirmed", c->unconfirmed);
    whole(self, "clamped_cycles_total", "counter", "cycles that pulled a target in", c->clamped);
    whole(self, "stretched_total", "counter", "timed moves that took longer than asked", c->stretched);
    whole(self, "singular_stops_total", "counter", "stops before a singularity", c->singular_stops);
}

static void put_stream(sheet_t *self, const snapshot_t *s)
{
    char text[NUMBER_MAX];
    head(self, "stream_period_seconds", "gauge", "the sender's period as estimated, 0 = unknown");
    put(self, "heave_stream_period_seconds %s\n", seconds_text(s->stream_period_us, text));
    head(self, "stream_delay_seconds", "gauge", "how late the motion follows the sender");
    put(self, "heave_stream_delay_seconds %s\n", seconds_text(s->stream_delay_us, text));
    if (s->last_frame_us != 0) {
        head(self, "last_frame_age_seconds", "gauge", "since the last accepted frame");
        put(self, "heave_last_frame_age_seconds %s\n", seconds_text(s->now_us - s->last_frame_us, text));
    }
    whole(self, "intensity_percent", "gauge", "how much of the sender's motion is asked for", s->intensity_percent);
}

static q32_t sent_q32(const snapshot_t *s, unsigned axis)
{
    return axis < s->cylinders ? s->extension_mm_q32[axis] : s->angle_deg_q32;
}

/* Axes are numbered from 1; the rotation motor is the last one and in degrees, so its unit is a label. */
static void put_axis_value(sheet_t *self, const snapshot_t *s, const char *name, unsigned axis, q32_t value_q32)
{
    char text[NUMBER_MAX];
    put(self, "heave_axis_%s{axis=\"%u\",unit=\"%s\"} %s\n", name, axis + 1, axis < s->cylinders ? "mm" : "deg",
        q32_text(value_q32, text));
}

static void put_axes(sheet_t *self, const snapshot_t *s)
{
    const unsigned axes = s->cylinders + (s->has_angle ? 1u : 0u);
    head(self, "axis_sent", "gauge", "set-point of the axis");
    for (unsigned i = 0; i < axes; i++) {
        put_axis_value(self, s, "sent", i, sent_q32(s, i));
    }
    head(self, "axis_actual", "gauge", "position the drive reports, missing while it reports none");
    for (unsigned i = 0; i < axes; i++) {
        if (s->drive[i].has_actual) {
            put_axis_value(self, s, "actual", i, s->drive[i].actual_mm_q32);
        }
    }
    head(self, "axis_following_error", "gauge", "set-point minus actual position");
    for (unsigned i = 0; i < axes; i++) {
        if (s->drive[i].has_actual) {
            put_axis_value(self, s, "following_error", i, sent_q32(s, i) - s->drive[i].actual_mm_q32);
        }
    }
    head(self, "drive_enabled", "gauge", "1 while the drive holds its position");
    for (unsigned i = 0; i < axes; i++) {
        put(self, "heave_drive_enabled{axis=\"%u\"} %u\n", i + 1, s->drive[i].state == DRIVE_ENABLED ? 1u : 0u);
    }
}

/* Missing for drives that tell of nothing. */
static void put_drives(sheet_t *self, const snapshot_t *s)
{
    const unsigned axes = s->cylinders + (s->has_angle ? 1u : 0u);
    head(self, "drive_errors_total", "counter", "errors that the drive told of by itself (EMCY)");
    for (unsigned i = 0; i < axes; i++) {
        if (s->report[i].phase[0] != '\0') {
            put(self, "heave_drive_errors_total{axis=\"%u\"} %" PRIu32 "\n", i + 1, s->report[i].emergency.count);
        }
    }
    head(self, "drive_error_code", "gauge", "the last one that it has not taken back, 0 = none");
    for (unsigned i = 0; i < axes; i++) {
        if (s->report[i].phase[0] != '\0') {
            const drive_emergency_t *emergency = &s->report[i].emergency;
            put(self, "heave_drive_error_code{axis=\"%u\"} %u\n", i + 1, emergency->is_over ? 0u : (unsigned)emergency->code);
        }
    }
    head(self, "drive_notes", "gauge",
         "what a drive tells that goes on: bits of mode, set-points, remote, voltage, limit, warning");
    for (unsigned i = 0; i < axes; i++) {
        if (s->report[i].phase[0] != '\0') {
            put(self, "heave_drive_notes{axis=\"%u\"} %" PRIu32 "\n", i + 1, s->report[i].notes);
        }
    }
}

static bool has_telemetry(const snapshot_t *s, unsigned axes)
{
    unsigned has = 0;
    for (unsigned i = 0; i < axes; i++) {
        has |= s->report[i].telemetry.has;
    }
    return has != 0;
}

/* Only of drives that measure it. */
static void put_telemetry(sheet_t *self, const snapshot_t *s)
{
    const unsigned axes = s->cylinders + (s->has_angle ? 1u : 0u);
    char text[NUMBER_MAX];
    if (!has_telemetry(s, axes)) {
        return;
    }
    head(self, "drive_torque_percent", "gauge", "torque, of the rated one; positive pushes out");
    for (unsigned i = 0; i < axes; i++) {
        if ((s->report[i].telemetry.has & DRIVE_HAS_TORQUE) != 0) {
            const q32_t torque_q32 = q32_from_int(s->report[i].telemetry.torque_permille) / 10;
            put(self, "heave_drive_torque_percent{axis=\"%u\"} %s\n", i + 1, q32_text(torque_q32, text));
        }
    }
    head(self, "drive_following_error", "gauge", "demand less actual, as the drive sees it");
    for (unsigned i = 0; i < axes; i++) {
        if ((s->report[i].telemetry.has & DRIVE_HAS_LAG) != 0) {
            put(self, "heave_drive_following_error{axis=\"%u\",unit=\"%s\"} %s\n", i + 1, i < s->cylinders ? "mm" : "deg",
                q32_text(s->report[i].telemetry.lag_q32, text));
        }
    }
    head(self, "drive_inputs", "gauge", "digital inputs: bit 0 negative limit, 1 positive limit, 2 home");
    for (unsigned i = 0; i < axes; i++) {
        if ((s->report[i].telemetry.has & DRIVE_HAS_INPUTS) != 0) {
            put(self, "heave_drive_inputs{axis=\"%u\"} %" PRIu32 "\n", i + 1, s->report[i].telemetry.inputs);
        }
    }
}

/* Turns are in degrees, ways in millimetres. */
static void put_rates(sheet_t *self, const char *name, const char *help, const char *per, const pose_t *rates)
{
    static const char *const k_axes[POSE_AXES] = {"roll", "pitch", "yaw", "x", "y", "z"};
    char text[NUMBER_MAX];
    head(self, name, "gauge", help);
    for (unsigned i = 0; i < POSE_AXES; i++) {
        put(self, "heave_%s{axis=\"%s\",unit=\"%s/%s\"} %s\n", name, k_axes[i], i < AXIS_X ? "deg" : "mm", per,
            q32_text(rates->axis_q32[i], text));
    }
}

/* Missing while feedback does not tell. */
static void put_plate(sheet_t *self, const snapshot_t *s)
{
    if (s->plate.has_rates) {
        put_rates(self, "plate_speed", "speed of the plate from feedback", "s", &s->plate.speed_per_s);
        put_rates(self, "plate_acceleration", "acceleration of the plate from feedback", "s2", &s->plate.accel_per_s2);
    }
}

static void put_relays(sheet_t *self, const snapshot_t *s)
{
    head(self, "relay_on", "gauge", "1 while the relay is closed");
    for (unsigned i = 0; i < s->relay_count; i++) {
        put(self, "heave_relay_on{relay=\"%u\"} %u\n", i + 1, s->relay_mask >> i & 1u);
    }
    whole(self, "relay_missing_total", "counter", "masks that set a relay this platform does not have",
          s->counters.relay_missing);
    whole(self, "relay_errors_total", "counter", "masks that could not be written", s->counters.relay_errors);
    whole(self, "relay_cut_total", "counter", "relays opened because they were closed for max_on_ms", s->counters.relay_cut);
    whole(self, "relay_delayed_total", "counter", "changes of relays that had to wait for min_toggle_ms",
          s->counters.relay_delayed);
}

/* Percentiles, as a summary: the bins are finer than anything a collector wants to store. */
static void put_times(sheet_t *self, const char *name, const char *help, const histogram_t *times)
{
    static const uint32_t k_shares[] = {50000, 99000, 99900, 99990, 100000};
    static const char *const k_quantiles[] = {"0.5", "0.99", "0.999", "0.9999", "1"};
    enum { SHARES = sizeof k_shares / sizeof k_shares[0] };
    uint64_t us[SHARES];
    char text[NUMBER_MAX];
    histogram_percentiles_us(times, SHARES, k_shares, us);
    head(self, name, "summary", help);
    for (unsigned i = 0; i < SHARES; i++) {
        put(self, "heave_%s{quantile=\"%s\"} %s\n", name, k_quantiles[i], seconds_text(us[i], text));
    }
    put(self, "heave_%s_count %" PRIu64 "\n", name, histogram_count(times));
}

static void put_program(sheet_t *self, const motion_view_t *view, const config_t *config, const char *hash,
                        const motion_times_t *times)
{
    const snapshot_t *s = &view->snapshot;
    char text[NUMBER_MAX];
    head(self, "build_info", "gauge", "the version of heaved, its build and the configuration it runs");
    put(self, "heave_build_info{version=\"%s\",build=\"%s\",configuration=\"%s\"} 1\n", HEAVE_VERSION, build_id(), hash);
    head(self, "uptime_seconds", "gauge", "since the start");
    put(self, "heave_uptime_seconds %s\n", seconds_text((s->cycle + s->counters.late_cycles) * config->settings.cycle_us, text));
    whole(self, "cycles_total", "counter", "motion cycles", s->cycle);
    whole(self, "late_cycles_total", "counter", "motion cycles that were skipped because the program was late",
          s->counters.late_cycles);
    whole(self, "realtime", "gauge", "1 with real-time priority", view->is_realtime);
    put_times(self, "wake_latency_seconds", "from the time of a cycle to its beginning, since the start", &times->wake);
    put_times(self, "cycle_time_seconds", "from the beginning of a cycle to its end, since the start", &times->work);
    put_times(self, "frame_latency_seconds",
              "from the arrival of a frame to the end of the cycle that follows it, since the start", &times->frame);
    whole(self, "memory_locked", "gauge", "1 where memory is locked", view->is_memory_locked);
    whole(self, "page_faults_total", "counter", "page faults of the motion thread since the start", view->page_faults);
}

static void put_lost(sheet_t *self, const status_lost_t *lost)
{
    head(self, "lost_total", "counter", "what was not written because a disk or a reader was too slow");
    put(self, "heave_lost_total{what=\"trace_rows\"} %" PRIu32 "\n", lost->trace_rows);
    put(self, "heave_lost_total{what=\"record_lines\"} %" PRIu32 "\n", lost->record_lines);
    put(self, "heave_lost_total{what=\"log_lines\"} %" PRIu32 "\n", lost->log_lines);
    put(self, "heave_lost_total{what=\"metrics\"} %" PRIu32 "\n", lost->metrics);
}

/* NOLINTNEXTLINE(readability-non-const-parameter): the sheet writes through it */
size_t metrics_text(const motion_view_t *view, const config_t *config, const char *hash, const motion_times_t *times,
                    const status_lost_t *lost, char *text, size_t capacity)
{
    const snapshot_t *s = &view->snapshot;
    sheet_t sheet = {.capacity = capacity};
    sheet.at = text;
    put_program(&sheet, view, config, hash, times);
    put_state(&sheet, s);
    put_axes(&sheet, s);
    put_drives(&sheet, s);
    put_telemetry(&sheet, s);
    put_plate(&sheet, s);
    put_relays(&sheet, s);
    put_frames(&sheet, view);
    put_stream(&sheet, s);
    put_lost(&sheet, lost);
    return sheet.is_cut ? 0 : sheet.length;
}

/* --- The file --- */

void metrics_init(metrics_t *self, const char *path, uint64_t now_us)
{
    self->path = path;
    self->next_us = now_us;
    self->error = 0;
    (void)snprintf(self->temporary, sizeof self->temporary, "%s.new", path);
}

/* Writes the text beside the file and puts it in its place.
 * Returns errno, 0 = done. */
static int replace(const metrics_t *self, size_t length)
{
    if (length == 0) {
        return EMSGSIZE;
    }
    (void)unlink(self->temporary); /* in a folder where others write, too, it may be a link of theirs */
    const int fd = open(self->temporary, O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0644);
    if (fd < 0) {
        return errno;
    }
    (void)fchmod(fd, 0644); /* whatever the umask: node_exporter reads it, and is in no group of ours */
    errno = ENOSPC;         /* what a write that is too short means */
    int error = write(fd, self->text, length) == (ssize_t)length ? 0 : errno;
    error = close(fd) != 0 && error == 0 ? errno : error;
    error = error == 0 && rename(self->temporary, self->path) != 0 ? errno : error;
    if (error != 0) {
        (void)unlink(self->temporary);
    }
    return error;
}

static void lose(metrics_t *self, uint64_t count)
{
    __atomic_store_n(&self->lost, self->lost + (uint32_t)count, __ATOMIC_RELAXED);
}

/* Periods that have passed over one file are lost. */
static void end_write(metrics_t *self, uint64_t now_us)
{
    if (self->busy_ms != 0) {
        __atomic_store_n(&self->busy_ms, 0, __ATOMIC_RELAXED);
        lose(self, (now_us - self->since_us) / METRICS_PERIOD_US);
    }
}

static void begin_write(metrics_t *self, uint64_t now_us)
{
    self->since_us = now_us;
    __atomic_store_n(&self->busy_ms, (uint32_t)(now_us / 1000u) | 1u, __ATOMIC_RELAXED);
}

void metrics_serve(metrics_t *self, const motion_view_t *view, const config_t *config, const char *hash,
                   const motion_times_t *times, const status_lost_t *lost, uint64_t now_us)
{
    end_write(self, now_us);
    if (now_us < self->next_us) {
        return;
    }
    self->next_us += METRICS_PERIOD_US * (1 + (now_us - self->next_us) / METRICS_PERIOD_US);
    begin_write(self, now_us);
    const int error = replace(self, metrics_text(view, config, hash, times, lost, self->text, sizeof self->text));
    if (error != 0 && error != self->error) {
        (void)print_message(0, "metrics %s: %s; tried again every second", self->path, strerror(error));
    }
    lose(self, error != 0);
    self->error = error;
}

uint32_t metrics_lost(const metrics_t *self, uint64_t now_us)
{
    const uint32_t busy_ms = __atomic_load_n(&self->busy_ms, __ATOMIC_RELAXED);
    const int32_t for_ms = busy_ms != 0 ? (int32_t)((uint32_t)(now_us / 1000u) - busy_ms) : 0; /* may have begun since now */
    const uint32_t late = for_ms > 0 ? (uint32_t)for_ms / (METRICS_PERIOD_US / 1000u) : 0;
    return __atomic_load_n(&self->lost, __ATOMIC_RELAXED) + late;
}

void metrics_remove(metrics_t *self)
{
    (void)unlink(self->path);
}
