/* SPDX-License-Identifier: MIT
 * writers.c - recording, trace, metrics and log; see writers.h.
 * After the start nothing here allocates: what would (stdio, time zones) is not used.
 */
#include "daemon/writers.h"

#include <errno.h>
#include <inttypes.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "common/build_id.h"
#include "common/message.h"

#define END_WAIT_US   2000000u /* for a slow reader of a pipe */
#define CLOSE_WAIT_MS 5000u    /* for a disk */
#define PAUSE_MS      10u

static uint64_t now_us(const writers_t *self)
{
    return hal_clock_now_us(self->loop->clock);
}

/* --- Recording and trace --- */

/* After an error lines are still taken from the ring, and counted. */
static void put_line(writers_file_t *out, const char *line, size_t length)
{
    output_file_write(&out->file, line, length);
    if (out->file.error != 0) {
        __atomic_store_n(&out->error, out->file.error, __ATOMIC_RELAXED);
        __atomic_store_n(&out->thrown, out->thrown + 1u, __ATOMIC_RELAXED);
    }
}

/* What fits into the buffer, and as much of that as the file takes. What has to wait stays in the ring, which counts what it
 * cannot hold. */
static void write_records(writers_t *self)
{
    record_t record;
    char line[RECORD_LINE_MAX];
    output_file_flush(&self->record.file);
    while (output_file_has_room(&self->record.file, sizeof line)) {
        const size_t length = ring_pop(&self->loop->handover.record, &record, sizeof record);
        if (length == 0) {
            break;
        }
        put_line(&self->record, line, record_writer_line(&self->lines, &record, length - sizeof record.head, line));
    }
    output_file_flush(&self->record.file);
}

static void write_rows(writers_t *self)
{
    trace_row_t row;
    char line[TRACE_LINE_MAX];
    output_file_flush(&self->trace.file);
    while (output_file_has_room(&self->trace.file, sizeof line) && ring_pop(&self->loop->handover.trace, &row, sizeof row) > 0) {
        put_line(&self->trace, line, trace_format(&row, line));
    }
    output_file_flush(&self->trace.file);
}

/* The ring holds more than the buffer: at the end, what a slow reader still takes within its time. */
static void write_file(writers_t *self, void (*write_more)(writers_t *self), const ring_t *ring, output_file_t *file, bool is_end)
{
    const uint64_t until_us = now_us(self) + END_WAIT_US;
    do {
        write_more(self);
    } while (is_end && !ring_is_empty(ring) && now_us(self) < until_us);
    if (is_end) {
        (void)output_file_close(file); /* its error stays */
    }
}

static void record_step(void *ctx, bool is_end)
{
    writers_t *self = ctx;
    write_file(self, write_records, &self->loop->handover.record, &self->record.file, is_end);
}

static void trace_step(void *ctx, bool is_end)
{
    writers_t *self = ctx;
    write_file(self, write_rows, &self->loop->handover.trace, &self->trace.file, is_end);
}

/* --- Metrics and log --- */

void writers_put_hash(writers_t *self, const char *hash)
{
    writers_hash_t words = {{0}};
    (void)snprintf(words.text, sizeof words.text, "%s", hash);
    seqlock_write(&self->hash, words.word);
}

static void metrics_step(void *ctx, bool is_end)
{
    writers_t *self = ctx;
    status_lost_t lost = {0};
    writers_hash_t hash;
    if (is_end) {
        metrics_remove(&self->metrics);
    } else if (seqlock_read(&self->loop->handover.view, self->view.word) && seqlock_read(&self->hash, hash.word)) {
        writers_count(self, &lost);
        metrics_serve(&self->metrics, &self->view.view, self->config, hash.text, &self->loop->handover.times, &lost,
                      now_us(self));
    }
}

static void log_step(void *ctx, bool is_end)
{
    writers_t *self = ctx;
    hv_status_t status = linux_log_flush(&self->log); /* what does not go out now goes out later */
    status = status == HV_OK ? linux_log_flush(&self->said) : status;
    self->is_log_broken = is_end && status == HV_ERR_IO;
}

void writers_say(writers_t *self, const char *format, ...)
{
    char text[HAL_LOG_TEXT_MAX + 1];
    const int prefix = snprintf(text, sizeof text, "heaved: ");
    va_list arguments;
    va_start(arguments, format);
    (void)vsnprintf(&text[prefix], sizeof text - (size_t)prefix, format, arguments);
    va_end(arguments);
    hal_log_write(linux_log_hal(&self->said), HAL_LOG_NOTICE, text);
}

/* --- Start --- */

static bool open_file(writers_file_t *out, const char *path, bool *is_used)
{
    out->file.fd = -1;
    out->path = path;
    *is_used = path != NULL;
    return path == NULL || output_file_open(&out->file, path, OUTPUT_FILE_GOES_ON);
}

static void write_record_head(writers_t *self, const char *config_path)
{
    char line[512];
    const time_t now = time(NULL);
    struct tm date;
    (void)gmtime_r(&now, &date);
    const int length = snprintf(line, sizeof line,
                                "; heaved %s, build %s, configuration %.300s, %s, %04d-%02d-%02d %02d:%02d:%02d UTC\n"
                                "; before time zero: comments, in ms since the start\n",
                                HEAVE_VERSION, build_id(), config_path, self->config->hash, date.tm_year + 1900, date.tm_mon + 1,
                                date.tm_mday, date.tm_hour, date.tm_min, date.tm_sec);
    output_file_write(&self->record.file, line, (size_t)length);
}

int writers_open(writers_t *self, const options_t *options, const config_t *config, motion_loop_t *loop)
{
    self->options = options;
    self->config = config;
    self->loop = loop;
    seqlock_init(&self->hash, self->hash_words.word, sizeof self->hash_words / sizeof(uint64_t));
    writers_put_hash(self, config->hash);
    if (!open_file(&self->record, options->record, &loop->is_recording)) {
        return print_message(EXIT_NO_OUTPUT, "%s: %s", options->record, strerror(self->record.file.error));
    }
    if (!open_file(&self->trace, options->trace, &loop->is_tracing)) {
        return print_message(EXIT_NO_OUTPUT, "%s: %s", options->trace, strerror(self->trace.file.error));
    }
    if (loop->is_recording) {
        write_record_head(self, options->config);
    }
    if (loop->is_tracing) {
        char header[TRACE_LINE_MAX];
        output_file_write(&self->trace.file, header, trace_header(header));
    }
    const settings_t *settings = &config->settings;
    record_writer_init(&self->lines, settings, settings->engage == ENGAGE_AUTO && settings->auto_frames == 0);
    return EXIT_DONE;
}

static void start(worker_t *worker, worker_step_t *step, writers_t *self, const char *what)
{
    if (!worker_start(worker, step, self, PAUSE_MS)) {
        (void)print_message(0, "cannot start the thread that writes the %s: %s", what, strerror(errno));
    }
}

void writers_start(writers_t *self)
{
    const char *metrics = self->config->metrics_file;
    start(&self->log_worker, log_step, self, "log");
    if (self->loop->is_recording) {
        start(&self->record_worker, record_step, self, "recording");
    }
    if (self->loop->is_tracing) {
        start(&self->trace_worker, trace_step, self, "trace");
    }
    if (strcmp(metrics, "none") != 0) {
        metrics_init(&self->metrics, metrics, now_us(self));
        start(&self->metrics_worker, metrics_step, self, "metrics");
    }
}

static uint32_t count_lost(const writers_file_t *out, const ring_t *ring)
{
    return ring_dropped(ring) + __atomic_load_n(&out->thrown, __ATOMIC_RELAXED);
}

static void say_losses(writers_t *self, writers_file_t *out, const ring_t *ring)
{
    const int error = __atomic_load_n(&out->error, __ATOMIC_RELAXED);
    if (error != 0 && !out->is_error_logged) {
        out->is_error_logged = true;
        writers_say(self, "%s: %s: nothing more is written to it; `lost` in the status counts", out->path, strerror(error));
    }
    if (ring_dropped(ring) != 0 && !out->is_logged) {
        out->is_logged = true;
        writers_say(self, "%s: lines are lost: its disk or its reader is too slow; `lost` in the status counts", out->path);
    }
}

void writers_say_losses(writers_t *self)
{
    say_losses(self, &self->record, &self->loop->handover.record);
    say_losses(self, &self->trace, &self->loop->handover.trace);
}

void writers_count(writers_t *self, status_lost_t *lost)
{
    lost->record_lines = count_lost(&self->record, &self->loop->handover.record);
    lost->trace_rows = count_lost(&self->trace, &self->loop->handover.trace);
    lost->log_lines = hal_log_dropped(linux_log_hal(&self->log)) + hal_log_dropped(linux_log_hal(&self->said));
    lost->metrics = metrics_lost(&self->metrics, now_us(self));
}

/* --- The end --- */

/* What is missing in a file. Of one whose disk does not answer nothing is known but what could not be handed over. */
static int judge_file(const writers_file_t *out, bool has_ended, const ring_t *ring, const char *what)
{
    if (ring_dropped(ring) > 0) {
        (void)print_message(0, "%s: %" PRIu32 " %s are missing: writing was too slow", out->path, ring_dropped(ring), what);
    }
    if (!has_ended) {
        return print_message(EXIT_IO, "%s: the disk does not answer: its end is missing", out->path);
    }
    return out->file.error == 0 ? EXIT_DONE : print_message(EXIT_IO, "%s: %s", out->path, strerror(out->file.error));
}

static bool close_by(writers_t *self, worker_t *worker, uint64_t until_us)
{
    const uint64_t now = now_us(self);
    return worker_close(worker, now < until_us ? (unsigned)((until_us - now) / 1000) : 0);
}

int writers_close(writers_t *self, bool *has_ended)
{
    const uint64_t until_us = now_us(self) + CLOSE_WAIT_MS * 1000u;
    worker_request_end(&self->metrics_worker); /* all at once: they wait beside each other */
    worker_request_end(&self->record_worker);
    worker_request_end(&self->trace_worker);
    worker_request_end(&self->log_worker);
    const bool has_log = close_by(self, &self->log_worker, until_us);
    const bool has_record = close_by(self, &self->record_worker, until_us);
    const bool has_trace = close_by(self, &self->trace_worker, until_us);
    const bool has_metrics = close_by(self, &self->metrics_worker, until_us);
    *has_ended = has_metrics && has_log && has_record && has_trace;
    int code = EXIT_DONE;
    if (self->loop->is_recording) {
        code = judge_file(&self->record, has_record, &self->loop->handover.record, "lines");
    }
    if (self->loop->is_tracing) {
        const int trace_code = judge_file(&self->trace, has_trace, &self->loop->handover.trace, "rows");
        code = code == EXIT_DONE ? trace_code : code;
    }
    if (code == EXIT_DONE && has_metrics && self->metrics.error != 0) {
        code = print_message(EXIT_IO, "metrics %s: %s", self->config->metrics_file, strerror(self->metrics.error));
    }
    return code == EXIT_DONE && has_log && self->is_log_broken ? EXIT_IO : code;
}
