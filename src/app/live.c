/* SPDX-License-Identifier: MIT
 * live.c - the service thread: signals, control socket, log, recording and trace; see live.h.
 * After the start nothing here allocates: what would (stdio, time zones) is not used.
 */
#include "live.h"

#include <errno.h>
#include <inttypes.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/signalfd.h>
#include <time.h>
#include <unistd.h>

#include "build_id.h"
#include "config_hash.h"
#include "control.h"
#include "flood.h"
#include "linux_clock.h"
#include "linux_log.h"
#include "linux_udp.h"
#include "linux_udp_filter.h"
#include "manager.h"
#include "metrics.h"
#include "motion_loop.h"
#include "out_file.h"
#include "record.h"
#include "say.h"
#include "socket_path.h"

#define TICK_MS          10
#define UDP_BUFFER_BYTES 131072 /* a few cycles of the densest stream: what waits longer is old */
#define QUIT_WAIT_MS     1000
#define FIRST_CYCLE_US   500000u
#define END_WAIT_US      2000000u
#define SHUTDOWN_REST_US 15000000u /* a stop before settling, the drives going off, files */

/** Everything of a live run. Large: from the heap, at the start. */
typedef struct {
    motion_loop_t loop;
    control_t control;
    config_t config; /**< as it was, with what reloads changed */
    manager_t manager;
    metrics_t metrics;
    flood_t flood;
    blackbox_t blackbox;
    operator_log_t operators;
    life_t life;
    motion_view_words_t view; /**< for the manager, the metrics and the watch over floods */
    linux_udp_t udp;
    linux_log_t log;
    int signal_fd;
    bool is_thread_running;
    unsigned signals; /**< requests to end so far */
    FILE *errors;     /**< standard error for what a reload has to say; never blocks on a pipe or a terminal */
    const options_t *options;
    record_writer_t writer;
    out_file_t record;
    out_file_t trace;
} live_t;

/* --- Files --- */

static void write_records(live_t *self)
{
    record_t record;
    char line[RECORD_LINE_MAX];
    while (out_file_has_room(&self->record, sizeof line)) {
        const size_t length = ring_pop(&self->loop.record, &record, sizeof record);
        if (length == 0) {
            return;
        }
        out_file_write(&self->record, line, record_writer_line(&self->writer, &record, length - sizeof record.head, line));
    }
}

static void write_rows(live_t *self)
{
    trace_row_t row;
    char line[TRACE_LINE_MAX];
    while (out_file_has_room(&self->trace, sizeof line) && ring_pop(&self->loop.trace, &row, sizeof row) > 0) {
        out_file_write(&self->trace, line, trace_format(&row, line));
    }
}

/* What fits into the buffers, and as much of that as the files take. What has to wait stays in the rings, which count what they
 * cannot hold. */
static void write_files(live_t *self)
{
    out_file_flush(&self->record);
    write_records(self);
    out_file_flush(&self->record);
    out_file_flush(&self->trace);
    write_rows(self);
    out_file_flush(&self->trace);
    self->control.lost.record_lines = ring_dropped(&self->loop.record);
    self->control.lost.trace_rows = ring_dropped(&self->loop.trace);
    self->control.lost.is_unapproved = __atomic_load_n(&self->loop.is_unapproved, __ATOMIC_ACQUIRE) != 0;
    self->control.lost.operator_entries = operator_log_lost(&self->operators);
    self->control.lost.log_lines = hal_log_dropped(linux_log_hal(&self->log));
}

static bool open_file(out_file_t *file, const char *path, bool *is_used)
{
    file->fd = -1;
    *is_used = path != NULL;
    return path == NULL || out_file_open(file, path, OUT_FILE_GOES_ON);
}

static void write_record_head(live_t *self, const char *config_path)
{
    char line[512];
    const time_t now = time(NULL);
    struct tm date;
    (void)gmtime_r(&now, &date);
    const int length = snprintf(line, sizeof line,
                                "; heaved %s, build %s, configuration %.300s, %s, %04d-%02d-%02d %02d:%02d:%02d UTC\n"
                                "; before time zero: comments, in ms since the start\n",
                                HEAVE_VERSION, build_id(), config_path, self->config.hash, date.tm_year + 1900, date.tm_mon + 1,
                                date.tm_mday, date.tm_hour, date.tm_min, date.tm_sec);
    out_file_write(&self->record, line, (size_t)length);
}

static int open_files(live_t *self)
{
    const options_t *options = self->options;
    if (!open_file(&self->record, options->record, &self->loop.is_recording)) {
        return say(EXIT_NO_OUTPUT, "%s: %s", options->record, strerror(self->record.error));
    }
    if (!open_file(&self->trace, options->trace, &self->loop.is_tracing)) {
        return say(EXIT_NO_OUTPUT, "%s: %s", options->trace, strerror(self->trace.error));
    }
    if (self->loop.is_recording) {
        write_record_head(self, options->config);
    }
    if (self->loop.is_tracing) {
        char header[TRACE_LINE_MAX];
        out_file_write(&self->trace, header, trace_header(header));
    }
    return EXIT_DONE;
}

/* Closes a file at the end and says what is missing in it. */
static int close_file(out_file_t *file, const char *path, const ring_t *ring, const char *what)
{
    const bool is_whole = out_file_close(file);
    if (ring_dropped(ring) > 0) {
        (void)say(0, "%s: %" PRIu32 " %s are missing: writing was too slow", path, ring_dropped(ring), what);
    }
    return is_whole ? EXIT_DONE : say(EXIT_IO, "%s: %s", path, strerror(file->error));
}

/* --- Floods --- */

/* Only what no frame begins with: the scanner passes over blanks and ends of lines. */
static linux_udp_filter_t filter_of(const config_t *config)
{
    static const uint8_t k_v3[] = {'@', ' ', '\t', '\r', '\n', '\0'};
    static const uint8_t k_lenient[] = {'@', '#', 'A', 'C', 'a', 'c', ' ', '\t', '\r', '\n', '\0'};
    const bool is_lenient = config->settings.dialect == FRAME_LENIENT;
    return (linux_udp_filter_t){.heads = is_lenient ? k_lenient : k_v3,
                                .head_count = is_lenient ? sizeof k_lenient : sizeof k_v3,
                                .bytes_max = GATEWAY_DATAGRAM_MAX,
                                .allow = config->udp.allow};
}

/* Says what becomes of useless datagrams from now on. */
static void set_filter(live_t *self)
{
    if (!self->flood.is_on) {
        linux_udp_filter_off(&self->udp);
        (void)say(0, "the flood is over: rejected frames are told again");
        return;
    }
    const linux_udp_filter_t filter = filter_of(&self->config);
    if (linux_udp_filter_on(&self->udp, &filter) == HV_OK) {
        (void)say(0,
                  "a flood of useless datagrams: what cannot be a frame, or comes from a sender that is not allowed, is dropped "
                  "in the kernel and counted as lost there until it is over");
    } else {
        (void)say(0, "a flood of useless datagrams, and the kernel takes no filter against it: %s", strerror(errno));
    }
}

static uint32_t useless(const motion_view_t *view)
{
    const counters_t *counters = &view->snapshot.counters;
    uint32_t count = view->udp_refused + view->udp_dropped + counters->oversize;
    for (unsigned i = 0; i < FRAME_ERRORS; i++) {
        count += counters->rejected[i];
    }
    return count;
}

static void watch_floods(live_t *self, uint64_t now)
{
    if (flood_judge(&self->flood, useless(&self->view.view), now)) {
        set_filter(self);
        self->control.lost.is_flood = self->flood.is_on;
    }
}

/* --- Signals --- */

static bool open_signals(live_t *self)
{
    sigset_t set;
    (void)signal(SIGPIPE, SIG_IGN);
    (void)sigemptyset(&set);
    (void)sigaddset(&set, SIGTERM);
    (void)sigaddset(&set, SIGINT);
    (void)sigaddset(&set, SIGHUP);
    if (sigprocmask(SIG_BLOCK, &set, NULL) != 0) {
        return false;
    }
    self->signal_fd = signalfd(-1, &set, SFD_CLOEXEC | SFD_NONBLOCK);
    return self->signal_fd >= 0;
}

/* Reads the configuration again. What may change in operation does, if the whole file is right. */
static void reload(live_t *self)
{
    if (config_reload(self->options->config, &self->config, self->errors) != 0) {
        (void)say(0, "%s is not right: nothing has changed", self->options->config);
    } else if (!motion_loop_reload(&self->loop, &self->config)) {
        (void)say(0, "too many reloads at once: send SIGHUP again");
    } else {
        (void)say(0, "%s has been read again: configuration %s", self->options->config, self->config.hash);
        if (!config_is_unapproved(&self->config)) {
            __atomic_store_n(&self->loop.is_unapproved, 0, __ATOMIC_RELEASE);
        }
        if (self->flood.is_on) {
            set_filter(self);
        }
    }
}

/* The longest that a shutdown takes: a stop, the longest cylinder's whole stroke at engage speed, and the drives going off. */
static uint64_t shutdown_most_us(const settings_t *settings)
{
    int64_t stroke_mm_q16 = 0;
    for (unsigned i = 0; i < CYLINDERS_MAX; i++) {
        stroke_mm_q16 = settings->stroke_mm_q16[i] > stroke_mm_q16 ? settings->stroke_mm_q16[i] : stroke_mm_q16;
    }
    const int64_t speed_q16 = settings->engage_speed_mm_s_q16;
    const int64_t way_us = stroke_mm_q16 * 1000000 / speed_q16;
    const int64_t ramps_us = 2 * speed_q16 * 1000000 / settings->engage_accel_mm_s2_q16;
    return (uint64_t)(way_us + ramps_us) + SHUTDOWN_REST_US;
}

/* Who has sent it, as far as the kernel says. */
static void log_signal(live_t *self, const struct signalfd_siginfo *info)
{
    operator_entry_t entry = {.uid = info->ssi_uid, .pid = (int32_t)info->ssi_pid};
    (void)clock_gettime(CLOCK_REALTIME, &entry.at);
    (void)snprintf(entry.request, sizeof entry.request, "%s",
                   info->ssi_signo == SIGHUP    ? "SIGHUP"
                   : info->ssi_signo == SIGTERM ? "SIGTERM"
                                                : "SIGINT");
    entry.before = entry.after = control_state(&self->control);
    operator_log_add(&self->operators, &entry);
}

/* The first signal settles the platform, the second one ends at once. */
static void take_signals(live_t *self)
{
    struct signalfd_siginfo info;
    while (read(self->signal_fd, &info, sizeof info) == (ssize_t)sizeof info) {
        if (info.ssi_signo == SIGHUP) {
            log_signal(self, &info);
            reload(self);
            continue;
        }
        self->signals++;
        log_signal(self, &info);
        if (self->signals == 1) {
            const motion_request_t request = {.event = EVENT_SHUTDOWN};
            (void)ring_push(&self->loop.requests, &request, sizeof request, NULL, 0);
            manager_stopping(&self->manager, shutdown_most_us(&self->config.settings));
            (void)say(0, "shutting down: the platform settles first; once more ends at once");
        } else {
            motion_loop_quit(&self->loop);
        }
    }
}

/* --- Running --- */

static uint64_t now_us(const live_t *self)
{
    return hal_clock_now_us(self->loop.clock);
}

/* Both go on being tried, and heaved goes on. */
static void tell_log_trouble(live_t *self)
{
    int error = 0;
    if (operator_log_trouble(&self->operators, &error)) {
        (void)say(0, "operator log %s: %s", self->operators.path, error != 0 ? strerror(error) : "written again");
    }
    if (life_trouble(&self->life, &error)) {
        (void)say(0, "life of the machine %s: %s", self->life.path, error != 0 ? strerror(error) : "written again");
    }
}

/* The service manager, and whoever collects metrics. */
static void tell_others(live_t *self)
{
    if (seqlock_read(&self->loop.view, self->view.word)) {
        watch_floods(self, now_us(self));
        life_serve(&self->life, &self->view.view.snapshot, now_us(self));
        manager_serve(&self->manager, &self->view.view.snapshot, now_us(self));
        metrics_serve(&self->metrics, &self->view.view, &self->config, &self->loop.times, now_us(self));
    }
}

static void serve_once(live_t *self)
{
    struct pollfd fds[CONTROL_FDS + 1];
    control_fill(&self->control, fds);
    fds[CONTROL_FDS] = (struct pollfd){.fd = self->signal_fd, .events = POLLIN};
    if (poll(fds, CONTROL_FDS + 1, control_timeout_ms(&self->control, now_us(self), TICK_MS)) < 0) {
        return; /* interrupted */
    }
    take_signals(self);
    control_serve(&self->control, fds, now_us(self));
    tell_others(self);
    tell_log_trouble(self);
    write_files(self);
    (void)!linux_log_flush(&self->log); /* what does not go out now goes out later */
}

/* Until the motion thread has ended; after the second signal it gets a short while.
 * Returns false where it did not end. */
static bool serve(live_t *self)
{
    uint64_t quit_us = UINT64_MAX;
    while (!motion_loop_has_ended(&self->loop)) {
        serve_once(self);
        if (self->signals > 1 && quit_us == UINT64_MAX) {
            quit_us = now_us(self) + (uint64_t)QUIT_WAIT_MS * 1000;
        }
        if (now_us(self) >= quit_us) {
            return false;
        }
    }
    return true;
}

static void say_ready(const live_t *self, const config_t *config)
{
    const bool is_barred = __atomic_load_n(&self->loop.is_unapproved, __ATOMIC_ACQUIRE) != 0;
    (void)say(0, "build %s, configuration %s", build_id(), config->hash);
    if (is_barred) {
        (void)say(0, "configuration %s was approved, this is another one: nothing moves until `heavectl acknowledge`",
                  config->approved.text);
    }
    (void)say(0, "version %s, %u cylinders, cycle %" PRIu32 " us, UDP %s port %u, control socket %s", HEAVE_VERSION,
              config->settings.geometry.kind == KIN_HEXAPOD ? 6u : 3u, config->settings.cycle_us, config->udp.bind,
              (unsigned)self->udp.port, self->control.socket[0].path);
}

/* The rings hold more than the buffers: what a slow reader still takes within its time. */
static void write_all(live_t *self)
{
    const uint64_t until_us = now_us(self) + END_WAIT_US;
    do {
        write_files(self);
    } while ((!ring_is_empty(&self->loop.record) || !ring_is_empty(&self->loop.trace)) && now_us(self) < until_us);
}

static int finish(live_t *self)
{
    control_serve(&self->control, (const struct pollfd[CONTROL_FDS]){{.fd = -1}}, now_us(self)); /* the last answers */
    control_close(&self->control);
    metrics_remove(&self->metrics);
    write_all(self);
    (void)!linux_log_flush(&self->log);
    if (!self->is_thread_running) {
        (void)blackbox_close(&self->blackbox); /* what has just happened is written now */
    }
    int code = EXIT_DONE;
    if (self->loop.is_recording) {
        code = close_file(&self->record, self->options->record, &self->loop.record, "lines");
    }
    if (self->loop.is_tracing) {
        const int trace_code = close_file(&self->trace, self->options->trace, &self->loop.trace, "rows");
        code = code == EXIT_DONE ? trace_code : code;
    }
    return code;
}

/* Clients are served from the first cycle on. */
static void await_first_cycle(live_t *self)
{
    const uint64_t until_us = now_us(self) + FIRST_CYCLE_US;
    while (!seqlock_read(&self->loop.view, self->control.view.word) && now_us(self) < until_us) {
        (void)!hal_clock_sleep_until_us(self->loop.clock, now_us(self) + 1000);
    }
}

static int run(live_t *self, const config_t *config)
{
    if (!operator_log_start(&self->operators)) {
        return say(EXIT_UNAVAILABLE, "cannot start the operator log: %s", strerror(errno));
    }
    if (!life_start(&self->life)) {
        return say(EXIT_UNAVAILABLE, "cannot start what keeps the life of the machine: %s", strerror(errno));
    }
    if (!motion_loop_start(&self->loop)) {
        return say(EXIT_UNAVAILABLE, "cannot start the motion thread: %s", strerror(errno));
    }
    self->is_thread_running = true;
    if (!blackbox_start(&self->blackbox)) {
        (void)say(0, "cannot start the black box: %s", strerror(errno));
    }
    await_first_cycle(self);
    const bool is_locked = mlockall(MCL_CURRENT | MCL_FUTURE) == 0;
    motion_loop_memory(&self->loop, is_locked ? MOTION_MEMORY_LOCKED : MOTION_MEMORY_UNLOCKED);
    if (!is_locked) {
        (void)say(0, "memory is not locked (%s): cycles may be late when memory is short", strerror(errno));
    }
    say_ready(self, config);
    manager_ready(&self->manager, now_us(self));
    metrics_init(&self->metrics, strcmp(self->config.metrics_file, "none") == 0 ? "" : self->config.metrics_file);
    const bool has_ended = serve(self);
    if (has_ended) {
        (void)pthread_join(self->loop.thread, NULL);
        self->is_thread_running = false;
    }
    const int code = finish(self);
    if (has_ended && self->loop.has_lost_clock) {
        return say(EXIT_SOFTWARE, "the system does not wait for the next cycle: all drives were told to stop now");
    }
    if (self->signals > 1) {
        const bool is_energized = has_ended && self->loop.is_energized;
        return say(EXIT_REFUSED, "ended at once by a second signal%s",
                   is_energized ? ", and not every drive has confirmed that its torque is off" : "");
    }
    if (has_ended && gateway_energized(&self->loop.session.gateway) != 0) {
        return say(EXIT_REFUSED, "ended, but not every drive has confirmed that its torque is off");
    }
    return code;
}

/* --- Start --- */

static int open_udp(live_t *self, const config_t *config)
{
    const linux_udp_config_t udp = {.bind = config->udp.bind, .port = config->udp.port, .receive_buffer = UDP_BUFFER_BYTES};
    return linux_udp_open(&self->udp, &udp) == HV_OK ? EXIT_DONE : say(EXIT_UNAVAILABLE, "%s", self->udp.error_text);
}

/* A platform without a black box moves as well: it only says so. */
static void open_blackbox(live_t *self, const config_t *config)
{
    const char *trouble = blackbox_open(&self->blackbox, self->options->config, config);
    if (trouble != NULL) {
        (void)say(0, "%s", trouble);
    }
    self->loop.blackbox = blackbox_feed(&self->blackbox);
}

/* Without a buffer: what is not taken at once is lost. */
static void open_errors(live_t *self, int fd)
{
    self->errors = fd != STDERR_FILENO ? fdopen(fd, "w") : stderr;
    self->errors = self->errors != NULL ? self->errors : stderr;
    (void)setvbuf(self->errors, NULL, _IONBF, 0);
}

/* What can be refused comes first: a second heaved must not empty the files of the first. */
static int open_all(live_t *self, const config_t *config)
{
    char in_directory[SOCKET_PATH_MAX];
    const char *path =
        self->options->socket != NULL ? self->options->socket : socket_path_of_daemon(in_directory, config->control_socket);
    int code = open_udp(self, config);
    code = code == EXIT_DONE ? control_open(&self->control, path, &self->config, &self->loop, &self->blackbox, &self->operators)
                             : code;
    code = code == EXIT_DONE ? open_files(self) : code;
    code = code == EXIT_DONE ? operator_log_open(&self->operators, config) : code;
    const uint32_t cylinders = config->settings.geometry.kind == KIN_HEXAPOD ? 6 : 3;
    code = code == EXIT_DONE ? life_open(&self->life, config, cylinders + (config->settings.has_angle ? 1u : 0u)) : code;
    self->control.lost.life = &self->life.now;
    if (code != EXIT_DONE) {
        return code;
    }
    open_blackbox(self, config);
    const int errors = out_file_unblocked(STDERR_FILENO);
    linux_log_init(&self->log, errors);
    open_errors(self, errors);
    record_writer_init(&self->writer, &config->settings,
                       config->settings.engage == ENGAGE_AUTO && config->settings.auto_frames == 0);
    if (!open_signals(self)) {
        return say(EXIT_UNAVAILABLE, "signals: %s", strerror(errno));
    }
    self->loop.is_unapproved = config_is_unapproved(config);
    const hv_status_t status =
        motion_loop_init(&self->loop, config, linux_udp_hal(&self->udp), linux_log_hal(&self->log), linux_clock_hal());
    if (rig_trouble(&self->loop.rig)[0] != '\0') {
        (void)say(0, "%s", rig_trouble(&self->loop.rig));
    }
    if (status == HV_ERR_IO) {
        return EXIT_UNAVAILABLE;
    }
    if (status != HV_OK) {
        return say(EXIT_BAD_CONFIG, "this platform cannot be moved: its settled or neutral position is out of reach");
    }
    return EXIT_DONE;
}

int live_run(const config_t *config, const options_t *options)
{
    live_t *self = calloc(1, sizeof *self);
    if (self == NULL) {
        return say(EXIT_UNAVAILABLE, "no memory");
    }
    self->options = options;
    self->config = *config;
    control_init(&self->control);
    self->manager.fd = -1;
    self->udp.fd = -1;
    int code = open_all(self, config);
    code = code == EXIT_DONE ? run(self, config) : code;
    control_close(&self->control);
    manager_close(&self->manager);
    const bool has_life_ended = life_close(&self->life);
    const bool has_log_ended = operator_log_close(&self->operators) && has_life_ended;
    if (!self->is_thread_running) { /* a stuck thread may still use all this: the end of the process gives it back */
        const bool has_blackbox_ended = blackbox_close(&self->blackbox);
        const bool has_rig_ended = rig_close(&self->loop.rig, self->config.settings.relay_safe_mask);
        linux_udp_close(&self->udp);
        if (has_blackbox_ended && has_log_ended && has_rig_ended) {
            free(self);
        }
    }
    return code;
}
