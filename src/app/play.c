/* SPDX-License-Identifier: MIT
 * play.c - offline runs; see play.h. The platform comes up to SETTLED as it does live, before time zero and without a trace.
 */
#include "play.h"

#include <errno.h>
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

#include "checkpoint.h"
#include "frames.h"
#include "out_file.h"
#include "rig.h"
#include "say.h"
#include "session.h"

#define SETTLE_CYCLES_MAX 100000u     /* to time zero; a few are enough */
#define EXTRA_MAX_US      7200000000u /* after the last line */
#define REST_US           500000u     /* without any change of a set-point, and four periods of the stream */
#define REST_PERIODS      4u
#define NOTES             10u

/** A line of the log worth repeating in the summary. */
typedef struct {
    uint64_t t_us;
    char text[HAL_LOG_TEXT_MAX + 1];
} note_t;

/** A run. */
typedef struct {
    session_t session;
    rig_t rig;
    frames_t frames;
    size_t next_datagram; /**< line from which on to look for one */
    size_t next_request;  /**< the same for everything else */
    out_file_t out;
    note_t note[NOTES];
    uint32_t notes; /**< seen, kept or not */
    uint32_t refused_requests;
    uint64_t rows;
    uint64_t still_since_us;
    trace_row_t row;
} play_t;

/* --- What the gateway sees --- */

/* The next line of its sort whose time has come, NULL where there is none. Datagrams and the rest go their own ways through the
 * file: what a full cycle leaves of the datagrams must not hold a request up. */
static const frames_line_t *take_due(play_t *self, size_t *next, bool is_datagram)
{
    const uint64_t t_us = self->session.now_us - self->session.zero_us;
    while (self->session.has_zero && *next < self->frames.count && self->frames.line[*next].t_us <= t_us) {
        const frames_line_t *line = &self->frames.line[(*next)++];
        if ((line->kind == FRAMES_DATAGRAM) == is_datagram) {
            return line;
        }
    }
    return NULL;
}

/* The next datagram whose time has come. */
static hv_status_t play_recv(void *ctx, uint8_t *buffer, size_t capacity, size_t *length, hal_udp_peer_t *from)
{
    play_t *self = ctx;
    const frames_line_t *line = take_due(self, &self->next_datagram, true);
    if (line == NULL) {
        return HV_ERR_AGAIN;
    }
    *length = line->length;
    *from = line->from;
    if (line->length > capacity) {
        return HV_ERR_RANGE;
    }
    memcpy(buffer, line->text, line->length);
    return HV_OK;
}

static void take_note(play_t *self, const char *text)
{
    if (self->notes < NOTES) {
        note_t *note = &self->note[self->notes];
        note->t_us = self->session.now_us - self->session.zero_us;
        (void)hal_log_copy(note->text, text);
    }
    self->notes++;
}

static void play_log(void *ctx, hal_log_level_t level, const char *text)
{
    play_t *self = ctx;
    if (level <= HAL_LOG_WARNING) {
        take_note(self, text);
    }
}

static uint32_t play_log_dropped(void *ctx)
{
    (void)ctx;
    return 0;
}

static gateway_io_t io_of(play_t *self)
{
    static const hal_udp_ops_t k_udp = {play_recv, NULL};
    static const hal_log_ops_t k_log = {play_log, play_log_dropped};
    return (gateway_io_t){.udp = {&k_udp, self}, .log = {&k_log, self}};
}

/* --- Running --- */

static void note_refused(play_t *self, const frames_line_t *line, hv_status_t status, const char *what)
{
    char text[HAL_LOG_TEXT_MAX + 1];
    if (status != HV_OK) {
        (void)snprintf(text, sizeof text, "line %" PRIu32 ": %s is refused in %s", line->line, what,
                       state_name(gateway_snapshot(&self->session.gateway)->state));
        take_note(self, text);
        self->refused_requests++;
    }
}

/* What a drive did; one that this platform does not have did nothing. */
static void inject(play_t *self, const frames_line_t *line)
{
    const sim_drives_fault_t fault = {.kind = line->state == DRIVE_FAULT     ? SIM_DRIVES_FAULT
                                              : line->state == DRIVE_OFFLINE ? SIM_DRIVES_OFFLINE
                                                                             : SIM_DRIVES_RECOVER,
                                      .axis = (uint8_t)(line->drive - 1),
                                      .code = line->number};
    sim_drives_inject(&self->rig.sim_drives, &fault);
}

static void carry_out(play_t *self, const frames_line_t *line)
{
    gateway_t *gateway = &self->session.gateway;
    switch (line->kind) {
    case FRAMES_REQUEST:
        note_refused(self, line, gateway_request(gateway, line->request, self->session.now_us), event_name(line->request));
        break;
    case FRAMES_INTENSITY:
        note_refused(self, line, gateway_set_intensity(gateway, line->number), "intensity beyond [motion] intensity_max_percent");
        break;
    case FRAMES_ESTOP:
        sim_inputs_set(&self->rig.sim_inputs, INPUT_ESTOP, line->number != 0);
        break;
    case FRAMES_LATE:
        gateway_note_late(gateway, line->number);
        break;
    case FRAMES_DRIVE:
        inject(self, line);
        break;
    case FRAMES_DATAGRAM:
    case FRAMES_FROM:
    case FRAMES_STATE:
        break;
    }
}

/* Everything but datagrams that is due before the coming cycle. */
static void carry_out_due(play_t *self)
{
    for (;;) {
        const frames_line_t *line = take_due(self, &self->next_request, false);
        if (line == NULL) {
            return;
        }
        carry_out(self, line);
    }
}

static void write_row(play_t *self)
{
    char line[TRACE_LINE_MAX];
    out_file_write(&self->out, line, trace_format(&self->row, line));
}

static bool is_state_at_rest(const snapshot_t *s)
{
    switch (s->state) {
    case STATE_HOMING:
    case STATE_RISING:
    case STATE_SETTLING:
        return false;
    case STATE_SETTLED:
    case STATE_NEUTRAL:
        return s->goal == s->state; /* else it goes on with the next cycle */
    case STATE_OFF:
    case STATE_ENGAGED:
    case STATE_HOLD:
    case STATE_FAULT:
    case STATE_ESTOP:
    case STATES:
        break;
    }
    return true;
}

/* Whether a set-point has changed. Not the pose: it is solved from them, and its last bits may go to and fro. */
static bool has_moved(const trace_row_t *before, const trace_row_t *row)
{
    const size_t first = AXIS_ANGLE;
    return memcmp(&before->value_q32[first], &row->value_q32[first], sizeof row->value_q32 - first * sizeof row->value_q32[0]) !=
           0;
}

/* Keeps track of how long nothing has moved. */
static void watch_rest(play_t *self, const trace_row_t *before)
{
    if (!is_state_at_rest(gateway_snapshot(&self->session.gateway)) || has_moved(before, &self->row)) {
        self->still_since_us = self->row.t_us;
    }
}

static uint64_t last_line_us(const play_t *self)
{
    return self->frames.count > 0 ? self->frames.line[self->frames.count - 1].t_us : 0;
}

/* Nothing has moved for a while, and nothing more comes. */
static bool is_at_rest(const play_t *self)
{
    const snapshot_t *s = gateway_snapshot(&self->session.gateway);
    const uint64_t last_us = last_line_us(self);
    const uint64_t since_us = self->still_since_us > last_us ? self->still_since_us : last_us;
    const bool is_read = self->next_datagram == self->frames.count && self->next_request == self->frames.count;
    return is_read && self->row.t_us >= since_us + REST_US + (uint64_t)REST_PERIODS * s->stream_period_us;
}

/* Comes up to SETTLED. What the auto policy does comes after it: a platform that waits for frames is brought up by a request. */
static bool settle(play_t *self, const settings_t *settings)
{
    const bool is_asked = settings->engage == ENGAGE_MANUAL || settings->auto_frames > 0;
    if (is_asked && gateway_request(&self->session.gateway, EVENT_PARK, self->session.now_us) != HV_OK) {
        return false;
    }
    for (unsigned i = 0; i < SETTLE_CYCLES_MAX; i++) {
        if (session_cycle(&self->session)) {
            if (is_asked) {
                gateway_restart_auto(&self->session.gateway);
            }
            return true;
        }
    }
    return false;
}

/* Whether the file says where to go on from, instead of time zero. */
static bool has_state(const play_t *self)
{
    return self->frames.count > 0 && self->frames.line[0].kind == FRAMES_STATE;
}

/* Goes on from a saved state, the drives included.
 * Returns NULL; or what is wrong. */
static const char *resume(play_t *self, const config_t *config, const gateway_io_t *io)
{
    static session_t saved;
    q32_t setpoint_q32[DRIVES_MAX] = {0};
    const char *wrong = checkpoint_parse(self->frames.line[0].text, self->frames.line[0].length, &saved);
    if (wrong != NULL) {
        return wrong;
    }
    if (saved.cycle_us != config->settings.cycle_us || gateway_resume(&self->session.gateway, &saved.gateway, io) != HV_OK) {
        return "the !state is of another platform; play it with the platform.ini beside it";
    }
    self->session.cycle_us = saved.cycle_us;
    self->session.now_us = saved.now_us;
    self->session.has_zero = saved.has_zero;
    self->session.zero_us = saved.zero_us;
    self->session.late_cycles = saved.late_cycles;
    const snapshot_t *snapshot = gateway_snapshot(&self->session.gateway);
    for (unsigned i = 0; i < snapshot->cylinders; i++) {
        setpoint_q32[i] = snapshot->extension_mm_q32[i];
    }
    setpoint_q32[snapshot->cylinders] = snapshot->angle_deg_q32;
    sim_drives_place(&self->rig.sim_drives, snapshot->now_us, snapshot->drive, setpoint_q32);
    sim_inputs_set(&self->rig.sim_inputs, INPUT_ESTOP, snapshot->is_estop_active);
    return NULL;
}

/* From time zero, or where it goes on from, to rest.
 * Returns false where it did not come to rest. */
static bool run(play_t *self)
{
    session_row(&self->session, &self->row);
    if (!has_state(self)) { /* that row is of the cycle before */
        write_row(self);
        self->rows = 1;
    }
    self->still_since_us = self->row.t_us;
    while (!is_at_rest(self) && self->out.error == 0) {
        const trace_row_t before = self->row;
        if (before.t_us > last_line_us(self) + EXTRA_MAX_US) {
            return false;
        }
        carry_out_due(self);
        (void)session_cycle(&self->session);
        session_row(&self->session, &self->row);
        watch_rest(self, &before);
        write_row(self);
        self->rows++;
    }
    return true;
}

/* --- The summary --- */

static void say_rejects(const counters_t *counters)
{
    for (unsigned i = 0; i < FRAME_ERRORS; i++) {
        if (counters->rejected[i] != 0) {
            (void)say(0, "  rejected %-14s %" PRIu32, frame_error_name((frame_error_t)i), counters->rejected[i]);
        }
    }
}

static void say_notes(const play_t *self)
{
    const uint32_t kept = self->notes < NOTES ? self->notes : NOTES;
    for (uint32_t i = 0; i < kept; i++) {
        (void)say(0, "  at %" PRIu64 ".%03u ms: %s", self->note[i].t_us / 1000, (unsigned)(self->note[i].t_us % 1000),
                  self->note[i].text);
    }
    if (self->notes > kept) {
        (void)say(0, "  and %" PRIu32 " more of such lines", self->notes - kept);
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
    const snapshot_t *s = gateway_snapshot(&self->session.gateway);
    const counters_t *counters = &s->counters;
    (void)say(0, "%" PRIu64 " cycles, %" PRIu64 ".%03u s simulated, ends in %s", self->rows, self->row.t_us / 1000000,
              (unsigned)(self->row.t_us / 1000 % 1000), state_name(s->state));
    (void)say(0,
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
    if (bad < 0) {
        return say(EXIT_NO_INPUT, "%s: %s", path, strerror(errno));
    }
    return bad > 0 ? EXIT_BAD_DATA : EXIT_DONE;
}

static int open_all(play_t *self, const config_t *config, const char *trace_path)
{
    gateway_io_t io = io_of(self);
    if (rig_open_settled(&self->rig, config, &io) != HV_OK || session_init(&self->session, &config->settings, &io) != HV_OK ||
        (!has_state(self) && !settle(self, &config->settings))) {
        return say(EXIT_BAD_CONFIG, "this platform cannot be simulated: its settled or neutral position is out of reach");
    }
    const char *wrong = has_state(self) ? resume(self, config, &io) : NULL;
    if (wrong != NULL) {
        return say(EXIT_BAD_DATA, "line %u: %s", (unsigned)self->frames.line[0].line, wrong);
    }
    if (!out_file_open(&self->out, trace_path != NULL ? trace_path : "/dev/null", OUT_FILE_WAITS)) {
        return say(EXIT_NO_OUTPUT, "%s: %s", trace_path, strerror(self->out.error));
    }
    char header[TRACE_LINE_MAX];
    out_file_write(&self->out, header, trace_header(header));
    return EXIT_DONE;
}

static int play(play_t *self, const config_t *config, const char *frames_path, const char *trace_path)
{
    int code = load(self, frames_path);
    code = code == EXIT_DONE ? open_all(self, config, trace_path) : code;
    if (code != EXIT_DONE) {
        return code;
    }
    if (!run(self)) {
        (void)say(0, "not at rest two hours after the last line: the run ends here");
    }
    if (!out_file_close(&self->out)) {
        return say(EXIT_IO, "%s: %s", trace_path, strerror(self->out.error));
    }
    say_summary(self);
    return EXIT_DONE;
}

int play_run(const config_t *config, const char *frames_path, const char *trace_path)
{
    play_t *self = calloc(1, sizeof *self);
    if (self == NULL) {
        return say(EXIT_IO, "no memory");
    }
    self->out.fd = -1;
    const int code = play(self, config, frames_path, trace_path);
    frames_free(&self->frames);
    free(self);
    return code;
}
