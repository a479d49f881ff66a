/* SPDX-License-Identifier: MIT
 * blackbox_files.c - what an incident has in its files; see blackbox_files.h.
 */
#include "record/blackbox_files.h"

#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "common/build_id.h"
#include "common/decimal.h"
#include "common/message.h"
#include "heave/text.h"
#include "record/blackbox_folders.h"
#include "record/blackbox_kept.h"

#define ITEMS_PER_POP   1000u /* written before what is fed meanwhile is taken over */
#define FEEDBACK_PLACES 6u

/** Where a replay begins. */
typedef enum {
    START_NEVER, /**< what led here is older than what is kept */
    START_ZERO,  /**< time zero of the run */
    START_STATE  /**< read.state */
} start_t;

/* --- Where a replay begins --- */

static void start_reading(blackbox_lane_t *lane)
{
    lane->reader = lane->kept;
    lane->is_reading = true;
}

static bool read_next(blackbox_t *self, blackbox_lane_t *lane, size_t *length)
{
    *length = ring_pop(&lane->reader, &self->read, sizeof self->read);
    return *length > 0;
}

/* The oldest place since when nothing is missing. */
static start_t find_start(blackbox_t *self, uint64_t *start_us)
{
    const uint64_t lost_us =
        self->records.lost_until_us > self->rows.lost_until_us ? self->records.lost_until_us : self->rows.lost_until_us;
    size_t length = 0;
    *start_us = 0;
    if (self->records.is_gap || self->rows.is_gap) {
        return START_NEVER;
    }
    if (self->zero_us != 0 && self->zero_us > lost_us) {
        *start_us = self->zero_us;
        return START_ZERO;
    }
    while (read_next(self, &self->states, &length)) {
        if (self->read.state.now_us > lost_us) {
            *start_us = self->read.state.now_us;
            return START_STATE;
        }
    }
    return START_NEVER;
}

/* --- Files --- */

static bool open_file(blackbox_t *self, unsigned file)
{
    return output_file_open(&self->file, blackbox_path_of(self, BLACKBOX_PART, blackbox_file_name[file]), OUTPUT_FILE_WAITS);
}

static void write_text(blackbox_t *self, const char *text)
{
    output_file_write(&self->file, text, strlen(text));
}

/* Now and then, and where the file takes no more.
 * Returns whether to go on. */
static bool go_on(blackbox_t *self, uint32_t *items)
{
    if (++*items % ITEMS_PER_POP == 0) {
        blackbox_pop(self);
    }
    return self->file.error == 0;
}

static void write_head(blackbox_t *self, const blackbox_row_t *cause, const char *name, start_t start)
{
    static const char *const k_starts[] = {
        [START_NEVER] = "; NO REPLAY: what led here is older than what was kept\n",
        [START_ZERO] = "; replay: heaved --config platform.ini --play frames --trace OUT repeats trace.csv from time zero on\n",
        [START_STATE] =
            "; replay, by the same version of heaved: heaved --config platform.ini --play frames --trace OUT repeats trace.csv\n",
    };
    char text[640];
    const bool is_fault = cause != NULL && cause->fault != FAULT_NONE;
    (void)snprintf(text, sizeof text, "; heaved %s, build %s, configuration %.300s, %s, %s\n; %s", HEAVE_VERSION, build_id(),
                   self->config_path, self->config_hash, name,
                   cause == NULL ? "asked for by an operator"
                   : is_fault    ? fault_text((fault_code_t)cause->fault)
                                 : "e-stop");
    write_text(self, text);
    if (is_fault && cause->fault_axis != 0) {
        (void)snprintf(text, sizeof text, ", axis %u", (unsigned)cause->fault_axis);
        write_text(self, text);
    }
    if (cause != NULL) {
        (void)snprintf(text, sizeof text, ", at %" PRIu64 ".%03u ms%s", cause->row.t_us / 1000,
                       (unsigned)(cause->row.t_us % 1000), cause->now_us == cause->row.t_us ? " since the start" : "");
        write_text(self, text);
    }
    write_text(self, "\n");
    write_text(self, k_starts[start]);
}

/* A state to begin with has what changed before it; platform.ini has nothing of it. */
static void write_reload(blackbox_t *self, start_t start, uint64_t start_us)
{
    if (self->reloaded_us != 0) {
        write_text(self, "; the configuration was read again: platform.ini is as it was at the start of heaved\n");
        write_text(self, start == START_STATE && self->reloaded_us < start_us
                             ? "; what changed is part of the replay\n"
                             : "; what changed does not replay, but for faults: the rows are the same up to there\n");
    }
}

/* Turns the records from where the replay begins into lines; all of them where it cannot begin, as comments. */
static void write_records(blackbox_t *self, record_writer_t *writer, uint64_t from_us)
{
    char line[RECORD_LINE_MAX];
    uint32_t items = 0;
    size_t length = 0;
    while (go_on(self, &items) && read_next(self, &self->records, &length)) {
        const record_t *record = &self->read.record;
        if (record->head.t_us >= from_us && record->head.t_us <= self->until_us) {
            output_file_write(&self->file, line, record_writer_line(writer, record, length - sizeof record->head, line));
        }
    }
}

/* What the drives told in a cycle, where it is not what they told in the one before. */
static void write_feedback(blackbox_t *self, const blackbox_row_t *row, const blackbox_row_t *before)
{
    char line[64];
    for (unsigned i = 0; i < row->drives; i++) {
        if (before->drives != 0 && row->drive[i] == before->drive[i] && row->known[i] == before->known[i] &&
            row->actual_q32[i] == before->actual_q32[i] && row->age_us[i] == before->age_us[i] &&
            row->code[i] == before->code[i]) {
            continue;
        }
        size_t at = decimal_put_ms(line, row->now_us);
        at += decimal_put_text(&line[at], " !feedback ");
        at += decimal_put_u64(&line[at], i + 1);
        at += decimal_put_text(&line[at], " ");
        at += decimal_put_hex(&line[at], (uint32_t)row->drive[i] << 4 | row->known[i], 2);
        at += decimal_put_hex(&line[at], (uint32_t)((uint64_t)row->actual_q32[i] >> 32), 8);
        at += decimal_put_hex(&line[at], (uint32_t)row->actual_q32[i], 8);
        at += decimal_put_hex(&line[at], row->age_us[i], 8);
        at += decimal_put_hex(&line[at], row->code[i], 8);
        at += decimal_put_text(&line[at], "\n");
        output_file_write(&self->file, line, at);
    }
}

/* Before time zero drives live by times of their own: a replay is told what they told, among the records. */
static void write_drives(blackbox_t *self, record_writer_t *writer, uint64_t from_us)
{
    char line[RECORD_LINE_MAX];
    uint32_t items = 0;
    size_t record = 0;
    self->written[0].drives = 0;
    bool has_record = read_next(self, &self->records, &record);
    while (go_on(self, &items) && ring_pop(&self->rows.reader, &self->written[1], sizeof self->written[1]) > 0) {
        const blackbox_row_t *row = &self->written[1];
        for (; has_record && self->read.record.head.t_us <= row->now_us; has_record = read_next(self, &self->records, &record)) {
            if (self->read.record.head.t_us >= from_us && row->now_us <= self->until_us) {
                const size_t bytes = record - sizeof self->read.record.head;
                output_file_write(&self->file, line, record_writer_line(writer, &self->read.record, bytes, line));
            }
        }
        if (row->now_us >= from_us && row->now_us <= self->until_us) {
            write_feedback(self, row, &self->written[0]);
            self->written[0] = *row;
        }
    }
    start_reading(&self->rows); /* for the files that follow */
}

/* Where trace.csv ends, a replay does. */
static void write_end(blackbox_t *self, const record_writer_t *writer)
{
    char line[64];
    size_t length = decimal_put_ms(line, self->until_us - writer->zero_us);
    length += decimal_put_text(&line[length], " !end\n");
    output_file_write(&self->file, line, length);
}

static bool write_frames(blackbox_t *self, const blackbox_row_t *cause, const char *name, start_t start, uint64_t start_us)
{
    record_writer_t writer;
    record_writer_init(&writer, self->settings, self->settings->engage == ENGAGE_AUTO && self->settings->auto_frames == 0);
    if (!open_file(self, BLACKBOX_FRAMES)) {
        return false;
    }
    write_head(self, cause, name, start);
    write_reload(self, start, start_us);
    if (start == START_STATE) {
        writer.has_zero = true;
        writer.zero_us = self->zero_us;
        output_file_write(&self->file, self->line, checkpoint_format(&self->read.state, self->config_hash, self->line));
    }
    if (start == START_STATE && self->zero_us == 0) {
        write_drives(self, &writer, start_us);
    } else {
        write_records(self, &writer, start == START_STATE ? start_us : 0);
    }
    if (start != START_NEVER) {
        write_end(self, &writer);
    }
    return blackbox_close_file(self);
}

static void put_feedback_head(const settings_t *settings, char *to, size_t capacity)
{
    const unsigned cylinders = settings->geometry.kind == KIN_HEXAPOD ? 6u : 3u;
    text_t text = text_start(to, capacity);
    text_put(&text, "t_ms");
    for (unsigned i = 1; i <= cylinders; i++) {
        text_put(&text, ",c");
        text_put_u32(&text, i);
        text_put(&text, "_state,c");
        text_put_u32(&text, i);
        text_put(&text, "_actual_mm,c");
        text_put_u32(&text, i);
        text_put(&text, "_code,c");
        text_put_u32(&text, i);
        text_put(&text, "_error");
    }
    text_put(&text, settings->has_angle ? ",angle_state,angle_actual_deg,angle_code,angle_error,fault\n" : ",fault\n");
}

static size_t format_feedback(const blackbox_row_t *row, char *to)
{
    static const char *const k_drives[] = {"offline", "disabled", "enabling", "enabled", "homing", "fault"};
    size_t at = decimal_put_ms(to, row->row.t_us);
    for (unsigned i = 0; i < row->drives; i++) {
        at += decimal_put_text(&to[at], ",");
        at += decimal_put_text(&to[at], row->drive[i] <= DRIVE_FAULT ? k_drives[row->drive[i]] : "?");
        at += decimal_put_text(&to[at], ",");
        at += decimal_put_q32(&to[at], row->actual_q32[i], FEEDBACK_PLACES);
        at += decimal_put_text(&to[at], ",");
        at += decimal_put_hex(&to[at], row->code[i], 8);
        at += decimal_put_text(&to[at], ",");
        at += decimal_put_hex(&to[at], row->error[i], 4);
    }
    at += decimal_put_text(&to[at], ",");
    at += decimal_put_text(&to[at], row->fault == FAULT_NONE ? "" : fault_help((fault_code_t)row->fault)->name);
    return at + decimal_put_text(&to[at], "\n");
}

static size_t format_row(const blackbox_row_t *row, char *to)
{
    return trace_format(&row->row, to);
}

static bool write_rows(blackbox_t *self, unsigned file, const char *head, size_t (*format)(const blackbox_row_t *, char *),
                       uint64_t from_us)
{
    char line[2 * TRACE_LINE_MAX];
    uint32_t items = 0;
    size_t length = 0;
    if (!open_file(self, file)) {
        return false;
    }
    write_text(self, head);
    while (go_on(self, &items) && read_next(self, &self->rows, &length)) {
        if (self->read.row.now_us >= from_us && self->read.row.now_us <= self->until_us) {
            output_file_write(&self->file, line, format(&self->read.row, line));
        }
    }
    return blackbox_close_file(self);
}

static bool write_platform(blackbox_t *self)
{
    if (!open_file(self, BLACKBOX_PLATFORM)) {
        return false;
    }
    for (size_t at = 0; at < self->platform_length && self->file.error == 0;) {
        const size_t left = self->platform_length - at;
        const size_t piece = left < OUTPUT_FILE_BYTES ? left : OUTPUT_FILE_BYTES;
        output_file_write(&self->file, &self->platform[at], piece);
        at += piece;
    }
    return blackbox_close_file(self);
}

/* --- An incident --- */

static bool write_files(blackbox_t *self, const blackbox_row_t *cause, const char *name)
{
    char feedback_head[2 * TRACE_LINE_MAX];
    char trace_head[TRACE_LINE_MAX];
    trace_head[trace_header(trace_head)] = '\0';
    put_feedback_head(self->settings, feedback_head, sizeof feedback_head);
    blackbox_pop(self);
    self->until_us = self->newest_us;
    blackbox_pop(self); /* every record of the cycles up to then has come now */
    start_reading(&self->states);
    start_reading(&self->records);
    start_reading(&self->rows);
    uint64_t start_us = 0;
    const start_t start = find_start(self, &start_us);
    const uint64_t rows_us = start == START_ZERO ? 0 : start_us; /* what came before time zero is shown, if not replayed */
    bool is_good =
        write_frames(self, cause, name, start, start_us) && write_rows(self, BLACKBOX_TRACE, trace_head, format_row, rows_us);
    start_reading(&self->rows); /* once more */
    is_good = is_good && write_rows(self, BLACKBOX_FEEDBACK, feedback_head, format_feedback, rows_us) && write_platform(self);
    self->states.is_reading = false;
    self->records.is_reading = false;
    self->rows.is_reading = false;
    return is_good;
}

static int make_incident(blackbox_t *self, const blackbox_row_t *cause, const char *name)
{
    blackbox_remove_folder(self, BLACKBOX_PART);
    (void)mkdir(self->directory, 0750);
    if (mkdir(blackbox_path_of(self, BLACKBOX_PART, ""), 0750) != 0) {
        return errno;
    }
    self->file.error = 0;
    if (write_files(self, cause, name) && blackbox_name_folder(self, name)) {
        return 0;
    }
    const int error = self->file.error != 0 ? self->file.error : errno;
    blackbox_remove_folder(self, BLACKBOX_PART);
    return error;
}

bool blackbox_write(blackbox_t *self, const blackbox_row_t *cause, char text[BLACKBOX_TEXT_MAX])
{
    char name[BLACKBOX_NAME_MAX];
    self->number++;
    blackbox_make_name(self, cause == NULL, name);
    const int error = make_incident(self, cause, name);
    if (error != 0) {
        self->number--;
        (void)snprintf(text, BLACKBOX_TEXT_MAX, "%s: %s", self->directory, strerror(error));
        (void)print_message(0, "black box: %s: no incident written", text);
        return false;
    }
    blackbox_add_folder(self, name);
    blackbox_drop_surplus(self, cause == NULL);
    (void)snprintf(text, BLACKBOX_TEXT_MAX, "%s", blackbox_path_of(self, name, ""));
    (void)print_message(0, "black box: %s", text);
    return true;
}
