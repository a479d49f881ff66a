/* SPDX-License-Identifier: MIT
 * identify.c - see identify.h. Set-points and feedback come from the samples, every cycle of them; the signal is made by heaved.
 */
#include "heavectl/identify.h"

#include <cjson/cJSON.h>
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

#include "common/message.h" // exit codes
#include "common/samples.h"
#include "common/translate.h"
#include "heavectl/ctl.h"
#include "heavectl/hold.h"
#include "identify/identify_plan.h"
#include "identify/identify_report.h"
#include "heavectl/scope.h"
#include "common/sentence.h"
#include "heavectl/heaved_link.h"

#define AFTER_MS   1000 /* what lags comes to rest */
#define NAME_BYTES 32

/** A channel: what is sent, and what comes back. */
typedef struct {
    char name[NAME_BYTES];
    const samples_column_t *sent, *actual;
    double *sent_at, *actual_at; /**< of every cycle of the record */
} channel_t;

typedef struct {
    const identify_t *what;
    const char *path;
    heaved_link_t link;
    samples_reader_t reader;
    channel_t channel[IDENTIFY_CHANNELS_MAX];
    unsigned channels;
    size_t count, capacity; /* cycles */
    bool was_pressed;
    bool is_full;
    identify_report_t report;
} run_t;

static int fail(int code, const char *why)
{
    char shown[SENTENCE_MAX];
    return ctl_complain(code, "identify: %s", sentence(why, shown, sizeof shown));
}

bool identify_read_band(const char *text, double *from_hz, double *to_hz)
{
    char *end = NULL;
    *from_hz = strtod(text, &end);
    if (end == text || *end != '-') {
        return false;
    }
    const char *second = end + 1;
    *to_hz = strtod(second, &end);
    return end != second && *end == '\0' && *from_hz > 0 && *to_hz > *from_hz && *to_hz <= 50;
}

/* --- Channels --- */

static const samples_column_t *column(const run_t *self, const char *what, const char *name)
{
    char text[2 * NAME_BYTES];
    (void)snprintf(text, sizeof text, "%s_%s", what, name);
    return samples_column_named(self->reader.header, text, strlen(text));
}

static bool add_channel(run_t *self, const char *label, const char *name)
{
    channel_t *channel = &self->channel[self->channels];
    channel->sent = column(self, "sent", name);
    channel->actual = column(self, "actual", name);
    (void)snprintf(channel->name, sizeof channel->name, "%s", label);
    self->channels += channel->sent != NULL && channel->actual != NULL;
    return channel->sent != NULL && channel->actual != NULL;
}

/* The axis first; of a pose the cylinders, too. The drive after the last cylinder is the rotation motor. */
static bool add_channels(run_t *self)
{
    char name[NAME_BYTES], label[NAME_BYTES];
    const char *axis = self->what->axis;
    char *end = NULL;
    const unsigned long drive = strtoul(axis, &end, 10);
    unsigned cylinders = 0;
    for (bool is_there = true; is_there; cylinders += is_there) {
        (void)snprintf(name, sizeof name, "c%u_mm", cylinders + 1u);
        is_there = column(self, "sent", name) != NULL;
    }
    if (*end == '\0' && drive == cylinders + 1u) {
        self->report.unit = "deg";
        return add_channel(self, axis, "angle_deg");
    }
    if (*end == '\0') {
        (void)snprintf(name, sizeof name, "c%lu_mm", drive);
        self->report.unit = "mm";
        return add_channel(self, axis, name);
    }
    self->report.is_posed = true;
    self->report.unit = identify_is_rotation(axis) ? "deg" : "mm";
    (void)snprintf(name, sizeof name, "%.8s_%s", axis, self->report.unit);
    bool is_added = add_channel(self, axis, name);
    for (unsigned i = 0; i < cylinders && is_added; i++) {
        (void)snprintf(name, sizeof name, "c%u_mm", i + 1u);
        (void)snprintf(label, sizeof label, "%u", i + 1u);
        is_added = add_channel(self, label, name);
    }
    return is_added;
}

static bool make_room(run_t *self, double cycle_s)
{
    self->capacity = (size_t)((self->report.seconds + 5.0 + AFTER_MS / 1000.0) / cycle_s);
    for (unsigned i = 0; i < self->channels; i++) {
        self->channel[i].sent_at = calloc(self->capacity, sizeof(double));
        self->channel[i].actual_at = calloc(self->capacity, sizeof(double));
        if (self->channel[i].sent_at == NULL || self->channel[i].actual_at == NULL) {
            return false;
        }
    }
    return true;
}

/* --- The record --- */

static void collect(run_t *self)
{
    samples_record_t record;
    while (samples_reader_next(&self->reader, &record)) {
        self->is_full = self->count == self->capacity;
        for (unsigned i = 0; i < self->channels && !self->is_full; i++) {
            self->channel[i].sent_at[self->count] = samples_value(self->channel[i].sent, &record);
            self->channel[i].actual_at[self->count] = samples_value(self->channel[i].actual, &record);
        }
        self->count += !self->is_full;
    }
}

/* Each press begins the signal anew, and so the record. */
static bool look_on(void *context, bool is_pressed)
{
    run_t *self = context;
    if (!is_pressed || !self->was_pressed) {
        self->count = is_pressed ? self->count : 0;
    }
    self->was_pressed = is_pressed;
    collect(self);
    if (!is_pressed && self->count > 0) { /* the last cycle at rest is where it begins */
        for (unsigned i = 0; i < self->channels; i++) {
            self->channel[i].sent_at[0] = self->channel[i].sent_at[self->count - 1u];
            self->channel[i].actual_at[0] = self->channel[i].actual_at[self->count - 1u];
        }
        self->count = 1;
    }
    return false;
}

static int make_signal(run_t *self)
{
    char request[96];
    const identify_report_t *report = &self->report;
    const hold_watch_t watch = {.is_over = look_on, .context = self};
    const int fd = heaved_link_open(self->path);
    if (fd < 0) {
        return fail(EXIT_UNAVAILABLE, error_text(errno));
    }
    (void)snprintf(request, sizeof request, "signal %s chirp %.6g %.6g %.6g %.6g", self->what->axis, report->amplitude,
                   report->from_hz, report->to_hz, report->seconds);
    const int code = hold_run(fd, request, &watch, self->what->is_interrupted);
    (void)close(fd);
    if (code != EXIT_DONE) {
        return code;
    }
    if (!hold_has_arrived()) {
        return fail(EXIT_REFUSED, N_("ended before the signal was: nothing is known; hold the key until it says so"));
    }
    for (int64_t until_ms = heaved_link_now_ms() + AFTER_MS; heaved_link_now_ms() < until_ms;) {
        const struct timespec pause = {.tv_nsec = 10000000};
        (void)nanosleep(&pause, NULL);
        collect(self);
    }
    return self->reader.lost > 0 || self->is_full
               ? fail(EXIT_REFUSED,
                      N_("cycles are missing in the record: this machine, or the link to it, was too busy; try again"))
               : EXIT_DONE;
}

/* --- The run --- */

static void read_limits(run_t *self)
{
    cJSON *geometry = heaved_link_ask(&self->link, "geometry");
    const cJSON *cylinders = cJSON_GetObjectItemCaseSensitive(geometry, "cylinder_limits");
    self->report.speed_mm_s = heaved_link_number(cylinders, "speed_mm_s");
    self->report.accel_mm_s2 = heaved_link_number(cylinders, "accel_mm_s2");
    self->report.jerk_mm_s3 = heaved_link_number(cylinders, "jerk_mm_s3");
    self->report.window_mm = heaved_link_number(cylinders, "following_error_mm");
    cJSON_Delete(geometry);
}

static bool begin(run_t *self, const char *path)
{
    self->link.fd = heaved_link_open(path);
    if (self->link.fd < 0) {
        (void)fail(EXIT_UNAVAILABLE, error_text(errno));
        return false;
    }
    read_limits(self);
    if (send(self->link.fd, "samples\n", 8, MSG_NOSIGNAL) != 8) {
        return false;
    }
    const int samples = scope_receive(self->link.fd, self->link.line, sizeof self->link.line);
    const char *wrong = samples < 0 ? N_("there are no samples; [samples] seconds has to be above 0")
                                    : samples_reader_open(&self->reader, samples);
    if (samples >= 0) {
        (void)close(samples);
    }
    if (wrong != NULL) {
        (void)fail(EXIT_UNAVAILABLE, wrong);
    }
    return wrong == NULL;
}

static int identify(run_t *self)
{
    const double cycle_s = self->reader.header->cycle_us / 1e6;
    if (!add_channels(self)) {
        return fail(EXIT_BAD_USAGE, N_("that is no axis of this platform; allowed: a drive's number, roll, pitch, yaw, x, y, z"));
    }
    char why[IDENTIFY_WHY_BYTES];
    self->report.axis = self->what->axis;
    self->report.amplitude = self->what->amplitude;
    self->report.from_hz = self->what->from_hz;
    self->report.to_hz = self->what->to_hz;
    self->report.seconds = self->what->seconds;
    if (!identify_plan(&self->report, cycle_s, why, sizeof why)) {
        return fail(EXIT_BAD_USAGE, why);
    }
    if (!make_room(self, cycle_s)) {
        return fail(EXIT_UNAVAILABLE, error_text(errno));
    }
    const int code = make_signal(self);
    if (code != EXIT_DONE) {
        return code;
    }
    if (self->report.is_posed) {
        double *sent[IDENTIFY_CHANNELS_MAX], *actual[IDENTIFY_CHANNELS_MAX];
        for (unsigned i = 0; i < self->channels; i++) {
            sent[i] = self->channel[i].sent_at;
            actual[i] = self->channel[i].actual_at;
        }
        identify_pose(sent, actual, self->channels, self->count);
    }
    for (unsigned i = 0; i < self->channels; i++) {
        channel_t *channel = &self->channel[i];
        identify_channel_t *result = &self->report.channel[self->report.channels++];
        (void)snprintf(result->name, sizeof result->name, "%s", channel->name);
        response_find(&result->response, channel->sent_at, channel->actual_at, self->count, cycle_s, self->report.from_hz,
                      self->report.to_hz);
    }
    return identify_report_write(&self->report, self->what->file, self->what->is_json);
}

int identify_run(const char *path, const identify_t *what)
{
    static run_t run;
    int code = EXIT_UNAVAILABLE;
    run = (run_t){.what = what, .path = path, .link = {.is_interrupted = what->is_interrupted, .fd = -1}};
    if (isatty(STDIN_FILENO) == 0) {
        return fail(EXIT_BAD_USAGE, N_("goes on while a key is held, which takes a terminal"));
    }
    if (begin(&run, path)) {
        code = identify(&run);
        samples_reader_close(&run.reader);
    }
    for (unsigned i = 0; i < run.channels; i++) {
        free(run.channel[i].sent_at);
        free(run.channel[i].actual_at);
    }
    if (run.link.fd >= 0) {
        (void)close(run.link.fd);
    }
    return code;
}
