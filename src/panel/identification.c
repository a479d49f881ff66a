/* SPDX-License-Identifier: MIT
 * identification.c - see identification.h.
 */
#include "panel/identification.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "identify/identify_plan.h"
#include "identify/response.h"

#define NAME_BYTES 32
#define SPARE_S    5.0

static const samples_column_t *column(const identification_t *self, const char *what, const char *name)
{
    char text[2 * NAME_BYTES];
    (void)snprintf(text, sizeof text, "%s_%s", what, name);
    return samples_column_named(self->reader.header, text, strlen(text));
}

static bool add_channel(identification_t *self, const char *label, const char *name)
{
    const samples_column_t *const sent = column(self, "sent", name), *const actual = column(self, "actual", name);
    if (sent == NULL || actual == NULL || self->channels == IDENTIFY_CHANNELS_MAX) {
        return false;
    }
    self->sent[self->channels] = sent;
    self->actual[self->channels] = actual;
    (void)snprintf(self->report.channel[self->channels].name, IDENTIFY_NAME_BYTES, "%s", label);
    self->channels++;
    return true;
}

/* The axis first; of a pose the cylinders, too. */
static bool add_channels(identification_t *self)
{
    char name[NAME_BYTES], label[NAME_BYTES];
    const bool is_drive = strspn(self->axis, "123456789") == 1 && self->axis[1] == '\0';
    if (is_drive) {
        self->report.unit = "mm";
        (void)snprintf(name, sizeof name, "c%s_mm", self->axis);
        return add_channel(self, self->axis, name);
    }
    self->report.is_posed = true;
    self->report.unit = identify_is_rotation(self->axis) ? "deg" : "mm";
    (void)snprintf(name, sizeof name, "%s_%s", self->axis, self->report.unit);
    bool is_added = add_channel(self, self->axis, name);
    for (unsigned i = 1; is_added && i < IDENTIFY_CHANNELS_MAX; i++) {
        (void)snprintf(name, sizeof name, "c%u_mm", i);
        (void)snprintf(label, sizeof label, "%u", i);
        if (!add_channel(self, label, name)) {
            break;
        }
    }
    return is_added && self->channels > 1;
}

static bool make_room(identification_t *self, double cycle_s)
{
    self->capacity = (size_t)((self->report.seconds + SPARE_S + IDENTIFY_AFTER_MS / 1000.0) / cycle_s);
    for (unsigned i = 0; i < self->channels; i++) {
        self->sent_at[i] = calloc(self->capacity, sizeof(double));
        self->actual_at[i] = calloc(self->capacity, sizeof(double));
        if (self->sent_at[i] == NULL || self->actual_at[i] == NULL) {
            return false;
        }
    }
    return true;
}

static double number_of(const cJSON *message, const char *name)
{
    const cJSON *const item = cJSON_GetObjectItemCaseSensitive(message, name);
    return cJSON_IsNumber(item) && item->valuedouble > 0 && item->valuedouble < 1e6 ? item->valuedouble : 0;
}

/* Limits of every cylinder stand in the geometry, which pages ask for as well; without them nothing is recommended of limits. */
static void parse_limits(identification_t *self, const cJSON *message)
{
    const cJSON *const limits = cJSON_GetObjectItemCaseSensitive(message, "cylinder_limits");
    self->report.speed_mm_s = number_of(limits, "speed_mm_s");
    self->report.accel_mm_s2 = number_of(limits, "accel_mm_s2");
    self->report.jerk_mm_s3 = number_of(limits, "jerk_mm_s3");
    self->report.window_mm = number_of(limits, "following_error_mm");
}

bool identification_begin(identification_t *self, const upstream_t *upstream, const cJSON *message, char *line, size_t line_size,
                          char *why, size_t size)
{
    const cJSON *const axis = cJSON_GetObjectItemCaseSensitive(message, "axis");
    identification_end(self);
    (void)snprintf(why, size, "that is no axis of this platform; allowed: a drive's number, roll, pitch, yaw, x, y, z");
    if (!cJSON_IsString(axis) || strlen(axis->valuestring) >= IDENTIFICATION_AXIS_MAX || axis->valuestring[0] == '\0' ||
        strspn(axis->valuestring, "abcdefghijklmnopqrstuvwxyz123456789") != strlen(axis->valuestring)) {
        return false;
    }
    if (upstream->samples.header == NULL) {
        (void)snprintf(why, size, "there are no samples; [samples] seconds has to be above 0");
        return false;
    }
    (void)snprintf(self->axis, sizeof self->axis, "%s", axis->valuestring);
    self->reader = upstream->samples;
    self->reader.next = __atomic_load_n(&self->reader.header->written, __ATOMIC_ACQUIRE);
    self->reader.lost = 0;
    if (!add_channels(self)) {
        return false;
    }
    const double cycle_s = self->reader.header->cycle_us / 1e6;
    self->report.axis = self->axis;
    self->report.amplitude = number_of(message, "amplitude");
    self->report.from_hz = number_of(message, "from_hz");
    self->report.to_hz = number_of(message, "to_hz");
    self->report.seconds = number_of(message, "seconds");
    parse_limits(self, message);
    if (!identify_plan(&self->report, cycle_s, why, size)) {
        return false;
    }
    if (!make_room(self, cycle_s)) {
        (void)snprintf(why, size, "no memory");
        return false;
    }
    (void)snprintf(line, line_size, "signal %s chirp %.6g %.6g %.6g %.6g", self->axis, self->report.amplitude,
                   self->report.from_hz, self->report.to_hz, self->report.seconds);
    return true;
}

bool identification_collect(identification_t *self, int64_t now_ms)
{
    samples_record_t record;
    while (self->count < self->capacity && samples_reader_next(&self->reader, &record)) {
        for (unsigned i = 0; i < self->channels; i++) {
            self->sent_at[i][self->count] = samples_value(self->sent[i], &record);
            self->actual_at[i][self->count] = samples_value(self->actual[i], &record);
        }
        self->count++;
    }
    return self->until_ms != 0 && now_ms >= self->until_ms;
}

void identification_arrived(identification_t *self, int64_t now_ms)
{
    self->until_ms = self->until_ms != 0 ? self->until_ms : now_ms + IDENTIFY_AFTER_MS;
}

int identification_work(void *context, int fd)
{
    identification_t *const self = context;
    FILE *const out = fdopen(fd, "w");
    if (out == NULL) {
        return 1;
    }
    if (self->reader.lost > 0 || self->count == self->capacity) {
        fprintf(out, "{\"ok\":false,\"error\":\"%s\"}\n",
                "cycles are missing in the record: this machine was too busy; try again");
        return fclose(out) == 0 ? 0 : 1;
    }
    if (self->report.is_posed) {
        identify_pose(self->sent_at, self->actual_at, self->channels, self->count);
    }
    self->report.channels = self->channels;
    for (unsigned i = 0; i < self->channels; i++) {
        response_find(&self->report.channel[i].response, self->sent_at[i], self->actual_at[i], self->count,
                      self->reader.header->cycle_us / 1e6, self->report.from_hz, self->report.to_hz);
    }
    identify_report_json(&self->report, out);
    return fclose(out) == 0 ? 0 : 1;
}

void identification_end(identification_t *self)
{
    for (unsigned i = 0; i < IDENTIFY_CHANNELS_MAX; i++) {
        free(self->sent_at[i]);
        free(self->actual_at[i]);
    }
    *self = (identification_t){.viewer = 0};
}
