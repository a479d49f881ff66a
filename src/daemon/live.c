/* SPDX-License-Identifier: MIT
 * live.c - the service thread: signals, control socket, what the service manager hears; see live.h. It writes no file.
 * After the start nothing here allocates: what would (stdio, time zones) is not used.
 */
#include "daemon/live.h"

#include <errno.h>
#include <inttypes.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/signalfd.h>
#include <time.h>
#include <unistd.h>

#include "common/build_id.h"
#include "common/message.h"
#include "common/output_file.h"
#include "common/socket_path.h"
#include "config/hash.h"
#include "daemon/flood.h"
#include "daemon/motion_loop.h"
#include "daemon/sd_notify.h"
#include "daemon/writers.h"
#include "linux_clock.h"
#include "linux_udp.h"
#include "linux_udp_filter.h"
#include "service/control.h"
#include "service/control_selftest.h"

#define TICK_MS         10
#define WAITING_MS      1  /* between looks where the system does not wait */
#define DESCRIPTORS_MIN 64 /* all clients, lines and files at once; half of it is used in the worst case */
/* As many short datagrams as a cycle takes, and a third more: the kernel grants twice that and charges 768 bytes and more for
 * each. What does not fit is lost as it comes; a longer queue would have the cycle follow what is older than the one before. */
#define UDP_BUFFER_BYTES 32768
#define QUIT_WAIT_MS     1000
#define FIRST_CYCLE_US   500000u

/** Everything of a live run. Large: from the heap, at the start. */
typedef struct {
    motion_loop_t loop;
    control_t control;
    config_t config; /**< as it was, with what reloads changed */
    sd_notify_t manager;
    flood_t flood;
    blackbox_t blackbox;
    operator_log_t operators;
    lifetime_t life;
    motion_view_words_t view; /**< for the manager, the life of the machine and the watch over floods */
    linux_udp_t udp;
    writers_t writers;
    bool was_lossy; /**< it has been said that something is lost */
    int signal_fd;
    bool is_thread_running;
    bool has_writers_ended;
    unsigned signals; /**< requests to end so far */
    FILE *errors;     /**< standard error for what a reload has to say; never blocks on a pipe or a terminal */
    const options_t *options;
} live_t;

/* --- Floods --- */

#define FRAME_BYTES_MIN 9u /* A3:0,0,0# */

/* Only what no frame begins with, as far as its command: the scanner passes over blanks and ends of lines. */
static linux_udp_filter_t filter_of(const config_t *config)
{
#define WHITE                                                                                                                    \
    {                                                                                                                            \
        {                                                                                                                        \
            LINUX_UDP_SET(" \t\r\n\0")                                                                                           \
        }                                                                                                                        \
    }
    static const linux_udp_form_t k_v3[] = {
        {{LINUX_UDP_SET("@"), LINUX_UDP_SET("AC"), LINUX_UDP_SET("3467"), LINUX_UDP_SET(":T")}}, WHITE};
    static const linux_udp_form_t k_lenient[] = {
        {{LINUX_UDP_SET("@#"), LINUX_UDP_SET("ACac"), LINUX_UDP_SET("3467"), LINUX_UDP_SET(":Tt")}},
        {{LINUX_UDP_SET("ACac"), LINUX_UDP_SET("3467"), LINUX_UDP_SET(":Tt")}},
        WHITE};
#undef WHITE
    const bool is_lenient = config->settings.dialect == FRAME_LENIENT;
    return (linux_udp_filter_t){.forms = is_lenient ? k_lenient : k_v3,
                                .form_count = is_lenient ? sizeof k_lenient / sizeof k_lenient[0] : sizeof k_v3 / sizeof k_v3[0],
                                .bytes_min = FRAME_BYTES_MIN,
                                .bytes_max = GATEWAY_DATAGRAM_MAX,
                                .allow = config->udp.allow};
}

/* Says what becomes of useless datagrams from now on. */
static void set_filter(live_t *self)
{
    if (!self->flood.is_on) {
        linux_udp_filter_off(&self->udp);
        writers_say(&self->writers, "the flood is over: rejected frames are told again");
        return;
    }
    const linux_udp_filter_t filter = filter_of(&self->config);
    if (linux_udp_filter_on(&self->udp, &filter) == HV_OK) {
        writers_say(
            &self->writers,
            "a flood of useless datagrams: what cannot be a frame, or comes from a sender that is not allowed, is dropped "
            "in the kernel and counted as lost there until it is over");
    } else {
        writers_say(&self->writers, "a flood of useless datagrams, and the kernel takes no filter against it: %s",
                    strerror(errno));
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
        writers_say(&self->writers, "%s is not right: nothing has changed", self->options->config);
    } else if (!motion_loop_reload(&self->loop, &self->config)) {
        writers_say(&self->writers, "too many reloads at once: send SIGHUP again");
    } else {
        writers_say(&self->writers, "%s has been read again: configuration %s", self->options->config, self->config.hash);
        writers_tell_hash(&self->writers, self->config.hash);
        if (!config_is_unapproved(&self->config)) {
            __atomic_store_n(&self->loop.handover.is_unapproved, 0, __ATOMIC_RELEASE);
        }
        if (self->flood.is_on) {
            set_filter(self);
        }
    }
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
            (void)ring_push(&self->loop.handover.requests, &request, sizeof request, NULL, 0);
            sd_notify_stopping(&self->manager, sd_notify_shutdown_us(&self->config.settings));
            writers_say(&self->writers, "shutting down: the platform settles first; once more ends at once");
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

static void tell_acknowledged(live_t *self)
{
    const level_peer_t by = self->control.acknowledged_by;
    if (by.pid != 0) {
        writers_say(&self->writers, "configuration %s: acknowledged by user %u, process %d", self->config.hash, (unsigned)by.uid,
                    (int)by.pid);
    }
    self->control.acknowledged_by.pid = 0;
}

static void watch_selftest(live_t *self)
{
    char said[128];
    if (control_selftest_watch(&self->control, &self->life, &self->config, said)) {
        writers_say(&self->writers, "%s", said);
    }
}

/* Both go on being tried, and heaved goes on. */
static void tell_trouble(live_t *self)
{
    int error = 0;
    if (operator_log_trouble(&self->operators, &error)) {
        writers_say(&self->writers, "operator log %s: %s", self->operators.path, error != 0 ? strerror(error) : "written again");
    }
    if (lifetime_trouble(&self->life, &error)) {
        writers_say(&self->writers, "life of the machine %s: %s", self->life.path,
                    error != 0 ? strerror(error) : "written again");
    }
}

/* The service manager; and who reads the log, where something is lost. */
static void tell_others(live_t *self)
{
    if (seqlock_read(&self->loop.handover.view, self->view.word)) {
        watch_floods(self, now_us(self));
        lifetime_serve(&self->life, &self->view.view.snapshot, now_us(self));
        sd_notify_serve(&self->manager, &self->view.view.snapshot, now_us(self));
    }
}

/* poll has failed, perhaps for good: signals and requests are looked for all the same. Nothing of it blocks. */
static void suppose_all(struct pollfd *fds, unsigned count)
{
    const struct timespec pause = {.tv_nsec = errno == EINTR ? 0 : WAITING_MS * 1000000L};
    for (unsigned i = 0; i < count; i++) {
        fds[i].revents = (short)(fds[i].fd >= 0 ? fds[i].events : 0);
    }
    (void)nanosleep(&pause, NULL);
}

static void count_losses(live_t *self)
{
    status_lost_t *lost = &self->control.lost;
    writers_count(&self->writers, lost);
    lost->operator_entries = operator_log_lost(&self->operators);
    lost->is_unapproved = __atomic_load_n(&self->loop.handover.is_unapproved, __ATOMIC_ACQUIRE) != 0;
    const bool is_lossy = lost->trace_rows != 0 || lost->record_lines != 0;
    if (is_lossy && !self->was_lossy) {
        writers_say(&self->writers,
                    "what is written is lost: the disk or the reader of %s is too slow; `lost` in the status counts",
                    lost->record_lines != 0 ? "--record" : "--trace");
    }
    self->was_lossy = is_lossy;
}

static void serve_once(live_t *self)
{
    struct pollfd fds[CONTROL_FDS + 1];
    control_fill(&self->control, fds);
    fds[CONTROL_FDS] = (struct pollfd){.fd = self->signal_fd, .events = POLLIN};
    if (poll(fds, CONTROL_FDS + 1, control_timeout_ms(&self->control, now_us(self), TICK_MS)) < 0) {
        suppose_all(fds, CONTROL_FDS + 1);
    }
    take_signals(self);
    control_serve(&self->control, fds, now_us(self));
    tell_others(self);
    tell_acknowledged(self);
    watch_selftest(self);
    tell_trouble(self);
    count_losses(self);
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
    (void)print_message(0, "build %s, configuration %s", build_id(), config->hash);
    if (self->control.lost.is_untested) {
        (void)print_message(0, "a self-test is due: nobody engages until `heavectl selftest` has passed%s",
                            self->life.path[0] != '\0' ? "" : "; without [platform] life_file that is forgotten at the end");
    }
    if (__atomic_load_n(&self->loop.handover.is_unapproved, __ATOMIC_ACQUIRE) != 0) {
        (void)print_message(0, "configuration %s was approved, this is another one: nothing moves until `heavectl acknowledge`",
                            config->approved.text);
    }
    (void)print_message(0, "version %s, %u cylinders, cycle %" PRIu32 " us, UDP %s port %u%s%s, control socket %s", HEAVE_VERSION,
                        config->settings.geometry.kind == KIN_HEXAPOD ? 6u : 3u, config->settings.cycle_us, config->udp.bind,
                        (unsigned)self->udp.port, config->udp.group[0] == '\0' ? "" : ", group ", config->udp.group,
                        self->control.socket[0].path);
}

static int finish(live_t *self)
{
    control_serve(&self->control, (const struct pollfd[CONTROL_FDS]){{.fd = -1}}, now_us(self)); /* the last answers */
    control_close(&self->control);
    const int code = writers_close(&self->writers, &self->has_writers_ended);
    if (!self->is_thread_running) {
        (void)blackbox_close(&self->blackbox); /* what has just happened is written now */
    }
    return code;
}

/* Clients are served from the first cycle on. */
static void await_first_cycle(live_t *self)
{
    const uint64_t until_us = now_us(self) + FIRST_CYCLE_US;
    while (!seqlock_read(&self->loop.handover.view, self->control.view.word) && now_us(self) < until_us) {
        (void)!hal_clock_sleep_until_us(self->loop.clock, now_us(self) + 1000);
    }
}

static int run(live_t *self, const config_t *config)
{
    if (!operator_log_start(&self->operators)) {
        return print_message(EXIT_UNAVAILABLE, "cannot start the operator log: %s", strerror(errno));
    }
    if (!lifetime_start(&self->life)) {
        return print_message(EXIT_UNAVAILABLE, "cannot start what keeps the life of the machine: %s", strerror(errno));
    }
    if (!motion_loop_start(&self->loop)) {
        return print_message(EXIT_UNAVAILABLE, "cannot start the motion thread: %s", strerror(errno));
    }
    self->is_thread_running = true;
    if (!blackbox_start(&self->blackbox)) {
        (void)print_message(0, "cannot start the black box: %s", strerror(errno));
    }
    writers_start(&self->writers);
    await_first_cycle(self);
    const bool is_locked = mlockall(MCL_CURRENT | MCL_FUTURE) == 0;
    motion_loop_memory(&self->loop, is_locked ? MOTION_MEMORY_LOCKED : MOTION_MEMORY_UNLOCKED);
    if (!is_locked) {
        (void)print_message(0, "memory is not locked (%s): cycles may be late when memory is short", strerror(errno));
    }
    say_ready(self, config);
    sd_notify_ready(&self->manager, now_us(self));
    const bool has_ended = serve(self);
    if (has_ended) {
        (void)pthread_join(self->loop.thread, NULL);
        self->is_thread_running = false;
    }
    const int code = finish(self);
    if (has_ended && self->loop.has_lost_clock) {
        return print_message(EXIT_SOFTWARE, "the system does not wait for the next cycle: all drives were told to stop now");
    }
    if (self->signals > 1) {
        const bool is_energized = has_ended && self->loop.is_energized;
        return print_message(EXIT_REFUSED, "ended at once by a second signal%s",
                             is_energized ? ", and not every drive has confirmed that its torque is off" : "");
    }
    if (has_ended && gateway_energized(&self->loop.session.gateway) != 0) {
        return print_message(EXIT_REFUSED, "ended, but not every drive has confirmed that its torque is off");
    }
    return code;
}

/* --- Start --- */

/* With too few, poll, accept and the files of incidents would fail later, in motion. */
static int check_descriptors(void)
{
    struct rlimit limit;
    if (getrlimit(RLIMIT_NOFILE, &limit) != 0 || limit.rlim_cur >= DESCRIPTORS_MIN) {
        return EXIT_DONE;
    }
    limit.rlim_cur = limit.rlim_max < DESCRIPTORS_MIN ? limit.rlim_max : DESCRIPTORS_MIN;
    if (setrlimit(RLIMIT_NOFILE, &limit) != 0 || limit.rlim_cur < DESCRIPTORS_MIN) {
        return print_message(EXIT_UNAVAILABLE,
                             "only %llu open files are allowed (ulimit -n, LimitNOFILE=); at least %d are needed",
                             (unsigned long long)limit.rlim_cur, DESCRIPTORS_MIN);
    }
    return EXIT_DONE;
}

static int open_udp(live_t *self, const config_t *config)
{
    const linux_udp_config_t udp = {
        .bind = config->udp.bind, .group = config->udp.group, .port = config->udp.port, .receive_buffer = UDP_BUFFER_BYTES};
    return linux_udp_open(&self->udp, &udp) == HV_OK ? EXIT_DONE : print_message(EXIT_UNAVAILABLE, "%s", self->udp.error_text);
}

/* A platform without a black box moves as well: it only says so. */
static void open_blackbox(live_t *self, const config_t *config)
{
    const char *trouble = blackbox_open(&self->blackbox, self->options->config, config);
    if (trouble != NULL) {
        (void)print_message(0, "%s", trouble);
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
    int code = check_descriptors();
    code = code == EXIT_DONE ? open_udp(self, config) : code;
    code = code == EXIT_DONE
               ? control_open(&self->control, path, &self->config, &self->loop.handover, &self->blackbox, &self->operators)
               : code;
    code = code == EXIT_DONE ? writers_open(&self->writers, self->options, config, &self->loop) : code;
    code = code == EXIT_DONE ? operator_log_open(&self->operators, config) : code;
    const uint32_t cylinders = config->settings.geometry.kind == KIN_HEXAPOD ? 6 : 3;
    code = code == EXIT_DONE ? lifetime_open(&self->life, config, cylinders + (config->settings.has_angle ? 1u : 0u)) : code;
    self->control.lost.life = &self->life.now;
    if (code != EXIT_DONE) {
        return code;
    }
    open_blackbox(self, config);
    const int errors = output_file_unblocked(STDERR_FILENO);
    linux_log_init(&self->writers.log, errors);
    linux_log_init(&self->writers.said, errors);
    open_errors(self, errors);
    if (!open_signals(self)) {
        return print_message(EXIT_UNAVAILABLE, "signals: %s", strerror(errno));
    }
    if (!samples_writer_open(&self->loop.samples, config)) { /* who looks on has to do without: the platform does not need it */
        (void)print_message(0, "samples: no memory to share: %s", strerror(errno));
    }
    self->control.samples_fd = self->loop.samples.fd;
    self->loop.handover.is_unapproved = config_is_unapproved(config);
    watch_selftest(self);
    const hv_status_t status =
        motion_loop_init(&self->loop, config, linux_udp_hal(&self->udp), linux_log_hal(&self->writers.log), linux_clock_hal());
    if (devices_trouble(&self->loop.devices)[0] != '\0') {
        (void)print_message(0, "%s", devices_trouble(&self->loop.devices));
    }
    if (status == HV_ERR_IO) {
        return EXIT_UNAVAILABLE;
    }
    if (status != HV_OK) {
        return print_message(EXIT_BAD_CONFIG, "this platform cannot be moved: its settled or neutral position is out of reach");
    }
    return EXIT_DONE;
}

int live_run(const config_t *config, const options_t *options)
{
    live_t *self = calloc(1, sizeof *self);
    if (self == NULL) {
        return print_message(EXIT_UNAVAILABLE, "no memory");
    }
    self->options = options;
    self->config = *config;
    control_init(&self->control);
    self->manager.fd = -1;
    self->has_writers_ended = true;
    self->udp.fd = -1;
    int code = open_all(self, config);
    code = code == EXIT_DONE ? run(self, config) : code;
    control_close(&self->control);
    sd_notify_close(&self->manager);
    const bool has_life_ended = lifetime_close(&self->life);
    const bool has_log_ended = operator_log_close(&self->operators) && has_life_ended;
    if (!self->is_thread_running) { /* a stuck thread may still use all this: the end of the process gives it back */
        const bool has_blackbox_ended = blackbox_close(&self->blackbox);
        const bool have_devices_ended = devices_close(&self->loop.devices, self->config.settings.relay_safe_mask);
        linux_udp_close(&self->udp);
        samples_writer_close(&self->loop.samples);
        if (has_blackbox_ended && has_log_ended && have_devices_ended && self->has_writers_ended) {
            free(self);
        }
    }
    return code;
}
