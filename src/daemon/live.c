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
#include <sys/signalfd.h>
#include <time.h>
#include <unistd.h>

#include "common/build_id.h"
#include "common/message.h"
#include "common/output_file.h"
#include "common/socket_path.h"
#include "config/hash.h"
#include "daemon/flood.h"
#include "daemon/flood_filter.h"
#include "daemon/motion_loop.h"
#include "daemon/reconfigure.h"
#include "daemon/locks.h"
#include "daemon/sd_notify.h"
#include "daemon/signals.h"
#include "daemon/writers.h"
#include "linux_clock.h"
#include "linux_udp.h"
#include "linux_udp_filter.h"
#include "service/control_commissioned.h"
#include "service/control_selftest.h"

#define TICK_MS    10
#define WAITING_MS 1 /* between looks where the system does not wait */
/* As many short datagrams as a cycle takes, and a third more: the kernel grants twice that and charges 768 bytes and more for
 * each. What does not fit is lost as it comes; a longer queue would have the cycle follow what is older than the one before. */
#define UDP_BUFFER_BYTES 32768
#define QUIT_WAIT_MS     7000
#define FIRST_CYCLE_US   500000u

/** Everything of a live run. Large: from the heap, at the start. */
typedef struct {
    motion_loop_t loop;
    control_t control;
    config_t config; /**< as it was, with what reloads changed */
    sd_notify_t manager;
    flood_t flood;
    owner_t flood_driver; /**< for whom the filter is */
    blackbox_t blackbox;
    operator_log_t operators;
    lifetime_t life;
    locks_t locks;
    motion_view_words_t view; /**< for the manager, the life of the machine and the watch over floods */
    linux_udp_t udp;
    writers_t writers;
    bool was_held; /**< a hold delays the end, which has been said */
    int signal_fd;
    bool is_ready; /* once */
    bool is_thread_running;
    bool has_writers_ended;
    unsigned signals; /**< requests to end so far */
    reconfigure_t reconfigure;
    config_store_t store;
    const options_t *options;
} live_t;

/* --- Floods --- */

static bool put_filter(live_t *self)
{
    self->flood_driver = self->view.view.snapshot.owner;
    const linux_udp_filter_t filter = flood_filter_of(&self->config, &self->flood_driver);
    return linux_udp_filter_on(&self->udp, &filter) == HV_OK;
}

/* Says what becomes of useless datagrams from now on. */
static void set_filter(live_t *self)
{
    if (!self->flood.is_on) {
        linux_udp_filter_off(&self->udp);
        writers_say(&self->writers, "the flood is over: rejected frames are told again");
    } else if (put_filter(self)) {
        writers_say(
            &self->writers,
            "a flood of useless datagrams: what cannot be a frame, or comes from a sender that is not allowed, and most of what "
            "comes from senders that do not drive, is dropped in the kernel and counted as lost there until it is over");
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
    } else if (self->flood.is_on && flood_filter_is_old(&self->flood_driver, &self->view.view.snapshot.owner)) {
        (void)!put_filter(self); /* the one before stays where the kernel refuses */
    }
}

/* --- Signals --- */

/* Who has sent it, as far as the kernel says. */
static void log_signal(live_t *self, const struct signalfd_siginfo *info)
{
    operator_entry_t entry = {.uid = info->ssi_uid, .pid = (int32_t)info->ssi_pid, .level = LEVEL_SERVICE};
    (void)clock_gettime(CLOCK_REALTIME, &entry.at);
    (void)snprintf(entry.request, sizeof entry.request, "%s", signals_name((int)info->ssi_signo));
    entry.before = entry.after = control_state(&self->control);
    operator_log_add(&self->operators, &entry);
}

/* The first signal settles the platform, the second one ends at once. */
static void receive_signals(live_t *self)
{
    struct signalfd_siginfo info;
    while (read(self->signal_fd, &info, sizeof info) == (ssize_t)sizeof info) {
        if (info.ssi_signo == SIGHUP) {
            log_signal(self, &info);
            reconfigure_reload(&self->reconfigure);
            continue;
        }
        self->signals++;
        self->reconfigure.is_end_wanted = true;
        log_signal(self, &info);
        if (self->signals == 1) {
            __atomic_store_n(&self->loop.handover.is_end_due, 1, __ATOMIC_RELEASE);
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

/* What people have said, and what therefore is not permitted, or slow. */
static void watch_people(live_t *self)
{
    char said[CONTROL_COMMISSIONED_SAID_MAX];
    level_peer_t *by = &self->control.acknowledged_by;
    if (by->pid != 0) {
        writers_say(&self->writers, "configuration %s: acknowledged by user %u, process %d", self->config.hash, (unsigned)by->uid,
                    (int)by->pid);
        by->pid = 0;
    }
    if (control_selftest_watch(&self->control, &self->life, &self->config, said)) {
        writers_say(&self->writers, "%s", said);
    }
    if (control_commissioned_watch(&self->control, &self->life, &self->config, said)) {
        writers_say(&self->writers, "%s", said);
    }
}

/* Both go on being tried, and heaved goes on. */
static void log_trouble(live_t *self)
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
static void serve_others(live_t *self)
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
    lost->digest = self->store.digest;
    lost->put_back = self->store.put_back;
    lost->is_unapproved = handover_is_withheld(&self->loop.handover, PERMIT_APPROVAL);
    writers_say_losses(&self->writers);
}

/* Somebody has put the platform on hold after the signal. It says what will happen, and the manager waits as long. */
static void watch_end(live_t *self)
{
    const bool is_held = self->signals < 2 && self->view.view.is_end_held;
    if (is_held && !self->was_held) {
        writers_say(&self->writers,
                    "on hold in the middle of the end: it goes on in %u s, and after %u s however often somebody holds; once "
                    "more ends at "
                    "once, with the platform up",
                    DELAYED_END_HOLD_US / 1000000u, DELAYED_END_HOLDS_US / 1000000u);
        sd_notify_stopping(&self->manager, sd_notify_shutdown_us(&self->config.settings) + DELAYED_END_HOLDS_US);
    }
    self->was_held = is_held;
}

static void serve_once(live_t *self)
{
    struct pollfd fds[CONTROL_FDS + 1];
    control_fill(&self->control, fds, now_us(self));
    fds[CONTROL_FDS] = (struct pollfd){.fd = self->signal_fd, .events = POLLIN};
    if (poll(fds, CONTROL_FDS + 1, control_timeout_ms(&self->control, now_us(self), TICK_MS)) < 0) {
        suppose_all(fds, CONTROL_FDS + 1);
    }
    receive_signals(self);
    control_serve(&self->control, fds, now_us(self));
    if (reconfigure_serve(&self->reconfigure, &self->control, now_us(self)) && self->flood.is_on) {
        set_filter(self); /* what is let through of a flood follows from the configuration */
    }
    serve_others(self);
    watch_people(self);
    watch_end(self);
    log_trouble(self);
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
    if (handover_is_withheld(&self->loop.handover, PERMIT_APPROVAL)) {
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

static int start_threads(live_t *self)
{
    if (!operator_log_start(&self->operators)) {
        return print_message(EXIT_UNAVAILABLE, "cannot start the operator log: %s", strerror(errno));
    }
    if (!config_store_start(&self->store)) {
        return print_message(EXIT_UNAVAILABLE, "cannot start what keeps the configuration: %s", strerror(errno));
    }
    if (!lifetime_start(&self->life)) {
        return print_message(EXIT_UNAVAILABLE, "cannot start what keeps the life of the machine: %s", strerror(errno));
    }
    if ((self->options->anew != ANEW_NOT && !reconfigure_stay_off(&self->reconfigure)) || !motion_loop_start(&self->loop)) {
        return print_message(EXIT_UNAVAILABLE, "cannot start the motion thread: %s", strerror(errno));
    }
    self->is_thread_running = true;
    if (!blackbox_start(&self->blackbox)) {
        (void)print_message(0, "cannot start the black box: %s", strerror(errno));
    }
    writers_start(&self->writers);
    return EXIT_DONE;
}

/* What the end was like; code where nothing is to be said of it. */
static int judge_end(const live_t *self, bool has_ended, int code)
{
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

static int run(live_t *self, const config_t *config)
{
    const int refused = start_threads(self);
    if (refused != EXIT_DONE) {
        return refused;
    }
    await_first_cycle(self);
    const bool is_locked = mlockall(MCL_CURRENT | MCL_FUTURE) == 0;
    motion_loop_memory(&self->loop, is_locked ? MOTION_MEMORY_LOCKED : MOTION_MEMORY_UNLOCKED);
    if (!is_locked) {
        (void)print_message(0, "memory is not locked (%s): cycles may be late when memory is short", strerror(errno));
    }
    say_ready(self, config);
    self->is_ready = true;
    sd_notify_ready(&self->manager, now_us(self));
    if (self->options->anew != ANEW_NOT) {
        sd_notify_restart(&self->manager, true);
    }
    const bool has_ended = serve(self);
    if (has_ended) {
        (void)pthread_join(self->loop.thread, NULL);
        self->is_thread_running = false;
    }
    const int code = judge_end(self, has_ended, finish(self));
    const bool is_anew = has_ended && code == EXIT_DONE && reconfigure_starts_anew(&self->reconfigure, &self->control);
    if (is_anew) {
        sd_notify_restart(&self->manager, false);
    }
    return is_anew ? LIVE_RESTART : code;
}

/* --- Start --- */

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

/* What can be refused comes first: a second heaved must not empty the files of the first. */
static int open_what_can_be_refused(live_t *self, const config_t *config)
{
    char in_directory[SOCKET_PATH_MAX];
    const char *path =
        self->options->socket != NULL ? self->options->socket : socket_path_of_daemon(in_directory, config->control_socket);
    int code = open_udp(self, config);
    code = code == EXIT_DONE
               ? control_open(&self->control, path, &self->config, &self->loop.handover, &self->blackbox, &self->operators)
               : code;
    code = code == EXIT_DONE ? locks_acquire(&self->locks, config) : code;
    code = code == EXIT_DONE ? writers_open(&self->writers, self->options, config, &self->loop) : code;
    code = code == EXIT_DONE ? operator_log_open(&self->operators, config) : code;
    const uint32_t cylinders = config->settings.geometry.kind == KIN_HEXAPOD ? 6 : 3;
    code = code == EXIT_DONE ? lifetime_open(&self->life, config, cylinders + (config->settings.has_angle ? 1u : 0u)) : code;
    self->control.lost.life = &self->life.now;
    self->control.store = &self->store;
    return code;
}

static int open_all(live_t *self, const config_t *config)
{
    const int code = open_what_can_be_refused(self, config);
    if (code != EXIT_DONE) {
        return code;
    }
    open_blackbox(self, config);
    const int errors = output_file_reopened(STDERR_FILENO, false);
    linux_log_init(&self->writers.log, errors);
    linux_log_init(&self->writers.said, errors);
    if (!reconfigure_open(&self->reconfigure)) {
        return print_message(EXIT_UNAVAILABLE, "no memory");
    }
    self->signal_fd = signals_open();
    if (self->signal_fd < 0) {
        return print_message(EXIT_UNAVAILABLE, "signals: %s", strerror(errno));
    }
    if (!samples_writer_open(&self->loop.samples, config)) { /* who looks on has to do without: the platform does not need it */
        (void)print_message(0, "samples: no memory to share: %s", strerror(errno));
    }
    self->control.samples_fd = self->loop.samples.fd;
    (void)handover_withhold(&self->loop.handover, PERMIT_APPROVAL, config_is_unapproved(config));
    watch_people(self);
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

int live_run(const config_t *config, const options_t *options, bool *is_ready)
{
    live_t *self = calloc(1, sizeof *self);
    if (self == NULL) {
        return print_message(EXIT_UNAVAILABLE, "no memory");
    }
    self->options = options;
    self->config = *config;
    self->reconfigure =
        (reconfigure_t){.config = &self->config, .loop = &self->loop, .writers = &self->writers, .store = &self->store};
    config_store_open(&self->store, options->file, options->config);
    self->store.no_restart =
        options->record != NULL || options->trace != NULL
            ? "heaved writes --record or --trace, and does not start anew by itself: end it, and start it with "
              "another file"
            : NULL;
    self->locks = (locks_t){{-1, -1, -1, -1}};
    control_init(&self->control);
    self->manager.fd = -1;
    self->has_writers_ended = true;
    self->udp.fd = -1;
    (void)snprintf(self->store.put_back, sizeof self->store.put_back, "%s", options->put_back);
    int code = open_all(self, config);
    print_message_keep(NULL, 0); /* other threads may say something from now on */
    code = code == EXIT_DONE ? run(self, config) : code;
    *is_ready = self->is_ready;
    control_close(&self->control);
    sd_notify_close(&self->manager);
    reconfigure_close(&self->reconfigure);
    const bool has_life_ended = lifetime_close(&self->life);
    const bool has_store_ended = config_store_close(&self->store);
    const bool has_log_ended = operator_log_close(&self->operators) && has_life_ended && has_store_ended;
    locks_release(&self->locks);
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
