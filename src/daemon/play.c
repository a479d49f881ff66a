/* SPDX-License-Identifier: MIT
 * play.c - offline runs; see play.h.
 */
#include "daemon/play.h"

#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/cage.h"
#include "common/message.h"
#include "common/output_file.h"
#include "daemon/devices.h"
#include "record/checkpoint.h"
#include "record/frames.h"
#include "record/player.h"

#define NOTES        10u
#define CAGE_SPARE_S 10u /* processor time beyond the simulated time, which a replay takes a hundredth of */

/** A line of the log worth repeating in the summary. */
typedef struct {
    uint64_t t_us;
    char text[HAL_LOG_TEXT_MAX + 1];
} note_t;

/** A run. */
typedef struct {
    player_t player;
    devices_t devices;
    frames_t frames;
    session_t saved; /**< where the run goes on from, if the file says so */
    output_file_t out;
    const char *trace_path; /**< NULL: no trace is wanted */
    note_t note[NOTES];
    uint32_t notes; /**< seen, kept or not */
    uint32_t refused_requests;
    uint64_t rows;
} play_t;

/* --- What the gateway sees --- */

static void add_note(play_t *self, const char *text)
{
    if (self->notes < NOTES) {
        note_t *note = &self->note[self->notes];
        note->t_us = self->player.session.now_us - self->player.session.zero_us;
        (void)hal_log_copy(note->text, text);
    }
    self->notes++;
}

static void play_log(void *ctx, hal_log_level_t level, const char *text)
{
    play_t *self = ctx;
    if (level <= HAL_LOG_WARNING) {
        add_note(self, text);
    }
}

static void note_refused(void *ctx, const frames_line_t *line, const char *what)
{
    play_t *self = ctx;
    char text[HAL_LOG_TEXT_MAX + 1];
    (void)snprintf(text, sizeof text, "line %" PRIu32 ": %s is refused in %s", line->line, what,
                   state_name(gateway_snapshot(&self->player.session.gateway)->state));
    add_note(self, text);
    self->refused_requests++;
}

static uint32_t play_log_dropped(void *ctx)
{
    (void)ctx;
    return 0;
}

static gateway_io_t io_of(play_t *self)
{
    static const hal_log_ops_t k_log = {play_log, play_log_dropped};
    return (gateway_io_t){.udp = player_udp(&self->player), .log = {&k_log, self}};
}

/* --- Running --- */

static void write_row(play_t *self)
{
    char line[TRACE_LINE_MAX];
    if (self->trace_path != NULL) {
        output_file_write(&self->out, line, trace_format(&self->player.row, line));
    }
    self->rows++;
}

/* Whether the file says where to go on from, instead of time zero. */
static bool has_state(const play_t *self)
{
    return self->frames.count > 0 && self->frames.line[0].kind == FRAMES_STATE;
}

/* From time zero, or where it goes on from, to rest.
 * Returns false where it did not come to rest. */
static bool run(play_t *self)
{
    player_begin(&self->player);
    if (!has_state(self)) { /* that row is of the cycle before */
        write_row(self);
    }
    while (!player_is_at_rest(&self->player) && self->out.error == 0) {
        if (player_is_endless(&self->player)) {
            return false;
        }
        player_cycle(&self->player);
        write_row(self);
    }
    return true;
}

/* --- The summary --- */

static void say_rejects(const counters_t *counters)
{
    for (unsigned i = 0; i < FRAME_ERRORS; i++) {
        if (counters->rejected[i] != 0) {
            (void)print_message(0, "  rejected %-14s %" PRIu32, frame_error_name((frame_error_t)i), counters->rejected[i]);
        }
    }
}

static void say_notes(const play_t *self)
{
    const uint32_t kept = self->notes < NOTES ? self->notes : NOTES;
    for (uint32_t i = 0; i < kept; i++) {
        (void)print_message(0, "  at %" PRIu64 ".%03u ms: %s", self->note[i].t_us / 1000, (unsigned)(self->note[i].t_us % 1000),
                            self->note[i].text);
    }
    if (self->notes > kept) {
        (void)print_message(0, "  and %" PRIu32 " more of such lines", self->notes - kept);
    }
}

static uint32_t sum(const uint32_t *numbers, size_t count)
{
    uint32_t total = 0;
    for (size_t i = 0; i < count; i++) {
        total += numbers[i];
    }
    return total;
}

static void say_summary(const play_t *self)
{
    const snapshot_t *s = gateway_snapshot(&self->player.session.gateway);
    const counters_t *counters = &s->counters;
    (void)print_message(0, "%" PRIu64 " cycles, %" PRIu64 ".%03u s simulated, ends in %s", self->rows,
                        self->player.row.t_us / 1000000, (unsigned)(self->player.row.t_us / 1000 % 1000), state_name(s->state));
    (void)print_message(0,
                        "%" PRIu32 " datagrams: %" PRIu32 " frames accepted, %" PRIu32 " of them not followed, %" PRIu32
                        " rejected, %" PRIu32 " oversize; %" PRIu32 " requests refused",
                        counters->datagrams, sum(counters->accepted, FRAME_COMMANDS), counters->not_followed,
                        sum(counters->rejected, FRAME_ERRORS), counters->oversize, self->refused_requests);
    say_rejects(counters);
    say_notes(self);
}

/* --- Start and end --- */

static int load(play_t *self, const char *path)
{
    const int bad = frames_load(&self->frames, path, stderr);
    if (bad < 0 && (errno == EFBIG || errno == EMSGSIZE)) {
        return print_message(EXIT_BAD_DATA, "%s: %s; allowed: a file of frames, `<t_ms> <text>` on each line", path,
                             errno == EFBIG ? "more than 1 GiB" : "a line of more than 1 MiB");
    }
    if (bad < 0) {
        return print_message(EXIT_NO_INPUT, "%s: %s", path, strerror(errno));
    }
    return bad > 0 ? EXIT_BAD_DATA : EXIT_DONE;
}

/* Whether the platform can begin, or the saved state be read. */
static int open_player(play_t *self, const config_t *config)
{
    gateway_io_t io = io_of(self);
    self->player.line = self->frames.line;
    self->player.lines = self->frames.count;
    self->player.drives = &self->devices.sim_drives;
    self->player.inputs = &self->devices.sim_inputs;
    self->player.refused = note_refused;
    self->player.ctx = self;
    const bool is_open = devices_open_settled(&self->devices, config, &io) == HV_OK;
    io.drives = player_drives(&self->player);
    if (!is_open || session_init(&self->player.session, &config->settings, &io) != HV_OK ||
        (!has_state(self) && !player_settle(&self->player, &config->settings))) {
        return print_message(EXIT_BAD_CONFIG,
                             "this platform cannot be simulated: its settled or neutral position is out of reach");
    }
    const frames_line_t *first = self->frames.line;
    const char *wrong = has_state(self) ? checkpoint_parse(first->text, first->length, config->hash, &self->saved) : NULL;
    if (wrong != NULL) {
        return print_message(EXIT_BAD_DATA, "line %u: %s", (unsigned)first->line, wrong);
    }
    return EXIT_DONE;
}

static int open_trace(play_t *self, const char *path)
{
    char header[TRACE_LINE_MAX];
    if (!output_file_open(&self->out, path != NULL ? path : "/dev/null", OUTPUT_FILE_WAITS)) {
        return print_message(EXIT_NO_OUTPUT, "%s: %s", path, strerror(self->out.error));
    }
    self->trace_path = path;
    output_file_write(&self->out, header, trace_header(header));
    output_file_flush(&self->out); /* of this process, not of the one in the cage, too */
    return EXIT_DONE;
}

static int run_and_say(play_t *self)
{
    if (!run(self)) {
        (void)print_message(0, "not at rest two hours after the last line: the run ends here");
    }
    output_file_flush(&self->out);
    if (self->out.error != 0) {
        return print_message(EXIT_IO, "%s: %s", self->trace_path, strerror(self->out.error));
    }
    say_summary(self);
    return EXIT_DONE;
}

static int run_saved(void *ctx)
{
    play_t *self = ctx;
    print_message_wait();
    player_resume(&self->player, &self->saved);
    return run_and_say(self);
}

/* A saved state may be anybody's. Nobody judges it, but the process that believes it can only write its trace. */
static int run_in_cage(play_t *self)
{
    const uint64_t span_s = player_span_us(&self->player) / 1000000;
    const int code = cage_run(run_saved, self, self->out.fd, (unsigned)span_s + CAGE_SPARE_S);
    if (code == CAGE_MISSING) {
        return print_message(EXIT_UNAVAILABLE,
                             "a !state only replays where Linux can confine a process (seccomp), which it cannot here");
    }
    if (code == CAGE_BROKEN) {
        return print_message(
            EXIT_BAD_DATA,
            "line %u: the replay from this !state crashed or did not end, and was stopped; is it as heaved wrote it?",
            (unsigned)self->frames.line[0].line);
    }
    return code;
}

static int play(play_t *self, const config_t *config, const char *frames_path, const char *trace_path)
{
    int code = load(self, frames_path);
    code = code == EXIT_DONE ? open_player(self, config) : code;
    code = code == EXIT_DONE ? open_trace(self, trace_path) : code;
    if (code != EXIT_DONE) {
        return code;
    }
    code = has_state(self) ? run_in_cage(self) : run_and_say(self);
    if (!output_file_close(&self->out) && code == EXIT_DONE) {
        return print_message(EXIT_IO, "%s: %s", trace_path, strerror(self->out.error));
    }
    return code;
}

int play_run(const config_t *config, const char *frames_path, const char *trace_path)
{
    play_t *self = calloc(1, sizeof *self);
    if (self == NULL) {
        return print_message(EXIT_IO, "no memory");
    }
    self->out.fd = -1;
    const int code = play(self, config, frames_path, trace_path);
    frames_free(&self->frames);
    free(self);
    return code;
}
