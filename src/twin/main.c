/* SPDX-License-Identifier: MIT
 * main.c - heave-twin: simulates the drives, switches and relays of a configuration until a signal ends it.
 */
#include <inttypes.h>
#include <poll.h>
#include <sched.h>
#include <signal.h>
#include <stdio.h>
#include <sys/resource.h>
#include <time.h>
#include <unistd.h>

#include "common/message.h" // exit codes
#include "platform/canraw_section.h"
#include "platform/cia402_section.h"
#include "platform/modbus_section.h"
#include "twin/twin_control.h"
#include "twin/modbus_ports.h"
#include "twin/twin_options.h"
#include "twin/script.h"
#include "twin/wire.h"
#include "platform/load.h"

#define FDS_MAX        (WIRE_FDS_MAX + CONTROL_FDS_MAX + MODBUS_PORTS_FDS_MAX)
#define PRIORITY       40    /* heaved has 80, interrupts 50 */
#define NICE           (-15) /* if real-time priority is not allowed */
#define LISTEN_US      2000000u
#define LISTEN_STEP_MS 10
#define AWAKE_US       1000000u /* longest time between two rounds of the main loop */

/** A run of the program. */
typedef struct {
    twin_options_t options;
    config_t config;
    twin_settings_t settings;
    lines_t lines;
    script_t script;
    wire_t wire; /**< for drives on CAN */
    modbus_ports_t ports;
    control_t control;
    twin_t twin;
    uint64_t start_us;
    uint64_t now_us;
} run_t;

static volatile sig_atomic_t is_ended; /* set by the signal handler, which can reach nothing else */

static void on_signal(int signal_number)
{
    (void)signal_number;
    is_ended = 1;
}

static uint64_t clock_us(void)
{
    struct timespec now;
    (void)clock_gettime(CLOCK_MONOTONIC, &now);
    return (uint64_t)now.tv_sec * 1000000u + (uint64_t)now.tv_nsec / 1000u;
}

static int reject(int code, const char *where, const char *why)
{
    fprintf(stderr, "heave-twin: %s: %s\n", where, why);
    return code;
}

static bool has_wire(const run_t *self)
{
    return self->script.machine.kind == TWIN_DRIVES_CIA402 || self->script.machine.kind == TWIN_DRIVES_FRAMES;
}

/* --- Before it runs --- */

static int read_script(run_t *self, unsigned drives)
{
    char why[FAULT_WHY_MAX];
    for (unsigned i = 0; i < self->options.faults; i++) {
        if (!script_add(&self->script, self->options.fault[i], drives, why)) {
            fprintf(stderr, "heave-twin: --fault '%s': %s\n", self->options.fault[i], why);
            return EXIT_BAD_DATA;
        }
    }
    if (self->options.script == NULL) {
        return EXIT_DONE;
    }
    const int wrong = script_load(&self->script, self->options.script, drives, stderr);
    return wrong == 0 ? EXIT_DONE : wrong > 0 ? EXIT_BAD_DATA : EXIT_NO_INPUT;
}

static unsigned drives_of(const run_t *self)
{
    const settings_t *settings = &self->config.settings;
    const unsigned drives = (settings->geometry.kind == KIN_HEXAPOD ? 6u : 3u) + (settings->has_angle ? 1u : 0u);
    return twin_kind(&self->config) == TWIN_DRIVES_NONE ? 0 : drives;
}

static int prepare(run_t *self)
{
    if (config_load(self->options.config, &self->config, stderr) != 0) {
        return EXIT_BAD_CONFIG;
    }
    if (!self->options.is_without_gpio) {
        lines_plan(&self->lines, &self->config);
    }
    const char *refusal = twin_refusal(&self->config, &self->lines);
    if (refusal != NULL) {
        return reject(EXIT_BAD_CONFIG, self->options.config, refusal);
    }
    const unsigned cylinders = self->config.settings.geometry.kind == KIN_HEXAPOD ? 6 : 3;
    const unsigned drives = drives_of(self);
    twin_settings_init(&self->settings, &self->config);
    self->script.machine = (fault_machine_t){.kind = twin_kind(&self->config),
                                             .has_board = self->config.relays.driver == CONFIG_RELAYS_MODBUS,
                                             .has_adapter = self->options.slcan != NULL,
                                             .lines = &self->lines};
    const char *bus = self->options.slcan != NULL ? "--slcan" : self->options.interface != NULL ? "--interface" : NULL;
    if (bus != NULL && !has_wire(self)) {
        return reject(EXIT_BAD_USAGE, bus, "the drives of this configuration are not on CAN");
    }
    const int code = twin_options_apply(&self->options, drives, cylinders, &self->settings);
    return code != EXIT_DONE ? code : read_script(self, drives);
}

/* --- Before it speaks --- */

/** What is listened for: which of the drives that will be simulated was heard. */
typedef struct {
    canraw_map_t frames;
    cia402_config_t nodes;
    bool is_frames;
    unsigned heard; /**< from 1; 0 = none */
} listening_t;

/* What drives send: EMCY, TPDOs, answers to SDO, heartbeats. */
static bool is_of_node(uint32_t id, uint8_t node)
{
    static const uint32_t k_functions[] = {0x080, 0x180, 0x280, 0x380, 0x480, 0x580, 0x700};
    for (size_t i = 0; i < sizeof k_functions / sizeof k_functions[0]; i++) {
        if (id == k_functions[i] + node) {
            return true;
        }
    }
    return false;
}

static void listen_to(void *ctx, const can_frame_t *frame)
{
    listening_t *self = ctx;
    const unsigned axes = self->is_frames ? self->frames.axes : self->nodes.axes;
    for (unsigned k = 0; k < axes; k++) {
        const canraw_axis_map_t *axis = &self->frames.axis[k];
        const bool is_heard = self->is_frames ? frame->is_extended == self->frames.is_extended &&
                                                    (frame->id == axis->reply_id || frame->id == axis->status_id)
                                              : !frame->is_extended && is_of_node(frame->id, self->nodes.axis[k].node);
        self->heard = is_heard ? k + 1 : self->heard;
    }
}

/* No real drive answers to what its master says, or tells of itself. */
static bool is_alone(run_t *self, char why[WIRE_WHY_MAX])
{
    static listening_t listening;
    const uint64_t end_us = clock_us() + LISTEN_US;
    listening.is_frames = self->script.machine.kind == TWIN_DRIVES_FRAMES;
    if (listening.is_frames) {
        config_canraw_map(&self->config, &listening.frames);
    } else {
        config_cia402(&self->config, &listening.nodes);
    }
    bool is_up = wire_is_up(&self->wire);
    while (is_up && listening.heard == 0 && clock_us() < end_us && is_ended == 0) {
        struct pollfd fds[WIRE_FDS_MAX];
        (void)poll(fds, wire_watch(&self->wire, fds), LISTEN_STEP_MS);
        is_up = wire_hear(&self->wire, listen_to, &listening) && wire_is_up(&self->wire);
    }
    if (listening.heard != 0) {
        (void)snprintf(why, WIRE_WHY_MAX, "%s: drive %u is there already, and heave-twin would answer in its place",
                       self->wire.end, listening.heard);
    } else if (!is_up) {
        (void)snprintf(why, WIRE_WHY_MAX, "%s: is not up, so that nobody hears whether drives are there: ip link set %s up",
                       self->wire.end, self->wire.end);
    }
    return is_up && listening.heard == 0;
}

static int open_all(run_t *self)
{
    char why[WIRE_WHY_MAX];
    self->control = (control_t){.fd = -1};
    if (!modbus_ports_open(&self->ports, &self->config, self->options.is_on_real_bus, why)) {
        return reject(EXIT_UNAVAILABLE, self->options.config, why);
    }
    const char *where = self->options.interface != NULL ? "--interface" : "[can] interface";
    if (has_wire(self) && !wire_open(&self->wire, &self->config.can, self->options.interface, self->options.slcan,
                                     self->options.is_on_real_bus, why)) {
        return reject(EXIT_UNAVAILABLE, where, why);
    }
    if (has_wire(self) && self->wire.is_real && !is_alone(self, why)) {
        return reject(EXIT_UNAVAILABLE, where, why);
    }
    char line_why[LINES_WHY_MAX];
    if (!lines_open(&self->lines, &self->config, clock_us(), line_why)) {
        return reject(EXIT_UNAVAILABLE, self->options.config, line_why);
    }
    if (!control_open(&self->control, self->options.socket, why)) {
        return reject(EXIT_UNAVAILABLE, self->options.socket, why);
    }
    return EXIT_DONE;
}

static void say_what_runs(const run_t *self)
{
    const wire_t *wire = &self->wire;
    modbus_ports_describe(&self->ports, stdout);
    lines_describe(&self->lines, stdout);
    if (self->script.machine.kind == TWIN_DRIVES_NONE) {
        printf("heave-twin: no drives: heaved simulates them itself\n");
        (void)fflush(stdout);
        return;
    }
    if (!has_wire(self)) {
        printf("heave-twin: %u drives on Modbus, units", self->twin.drives);
        for (unsigned k = 0; k < self->twin.drives; k++) {
            printf(" %u", self->twin.modbus.map.axis[k].unit);
        }
        printf("\n");
        (void)fflush(stdout);
        return;
    }
    if (wire->kind == WIRE_SLCAN) {
        char terminal[64] = "?";
        (void)ttyname_r(wire->slcan.terminal, terminal, sizeof terminal);
        printf("heave-twin: a serial CAN adapter (slcan) at %s, which is %s\n", wire->adapter, terminal);
    }
    const bool is_frames = self->script.machine.kind == TWIN_DRIVES_FRAMES;
    printf("heave-twin: %u drives on %s%s, %s", self->twin.drives, wire->kind == WIRE_SLCAN ? wire->adapter : wire->end,
           wire->kind == WIRE_LOCAL ? " (a bus between programs; no CAN)" : "",
           is_frames ? "frames of their own to identifiers" : "CiA 402, nodes");
    for (unsigned k = 0; k < self->twin.drives; k++) {
        if (is_frames) {
            printf(" 0x%" PRIX32, self->twin.frame_map.axis[k].command_id);
        } else {
            printf(" %u", self->twin.node[k].number);
        }
    }
    printf("\n");
    (void)fflush(stdout);
}

/* --- While it runs --- */

static void hear(void *ctx, const can_frame_t *frame)
{
    run_t *self = ctx;
    twin_hear(&self->twin, frame, self->now_us);
}

static uint64_t next_us(const run_t *self)
{
    const uint64_t twin_us = twin_due_us(&self->twin);
    const uint64_t script_us = script_due_us(&self->script, self->start_us, self->twin.enabled_us);
    const uint64_t port_us = modbus_ports_due_us(&self->ports);
    const uint64_t first_us = twin_us < script_us ? twin_us : script_us;
    const uint64_t due_us = first_us < port_us ? first_us : port_us;
    const uint64_t latest_us = self->now_us + AWAKE_US;
    return due_us < latest_us ? due_us : latest_us;
}

/* Until something is heard, something is due, or a signal comes. */
static void wait(const run_t *self, const sigset_t *open)
{
    struct pollfd fds[FDS_MAX];
    const uint64_t due_us = next_us(self);
    const uint64_t now_us = clock_us();
    const uint64_t span_us = due_us > now_us ? due_us - now_us : 0;
    const struct timespec span = {.tv_sec = (time_t)(span_us / 1000000u), .tv_nsec = (long)(span_us % 1000000u) * 1000};
    unsigned count = !has_wire(self) ? 0 : wire_watch(&self->wire, fds);
    count += modbus_ports_watch(&self->ports, fds + count);
    count += control_watch(&self->control, fds + count);
    (void)ppoll(fds, count, &span, open);
}

static int run(run_t *self, const sigset_t *open)
{
    while (is_ended == 0) {
        wait(self, open);
        self->now_us = clock_us();
        if (has_wire(self) && !wire_hear(&self->wire, hear, self)) {
            return reject(EXIT_UNAVAILABLE, self->wire.end, "the interface is gone");
        }
        twin_advance(&self->twin, self->now_us);
        modbus_ports_serve(&self->ports, &self->twin.modbus, self->now_us);
        script_run(&self->script, &self->twin, self->start_us, self->now_us, stderr);
        control_serve(&self->control, &self->twin, self->now_us);
    }
    return EXIT_DONE;
}

/* Signals are taken while it waits, and at no other time. Returns the mask to wait with. */
static sigset_t catch_signals(void)
{
    sigset_t ends;
    sigset_t open;
    const struct sigaction action = {.sa_handler = on_signal};
    (void)sigemptyset(&ends);
    (void)sigaddset(&ends, SIGTERM);
    (void)sigaddset(&ends, SIGINT);
    (void)sigprocmask(SIG_BLOCK, &ends, &open);
    (void)sigaction(SIGTERM, &action, NULL);
    (void)sigaction(SIGINT, &action, NULL);
    return open;
}

/* Drives have a processor to themselves. Where it may, the twin comes before everything but the motion thread of heaved, so that
 * a busy machine loses no drive. */
static void ask_for_priority(void)
{
    const struct sched_param parameters = {.sched_priority = PRIORITY};
    if (sched_setscheduler(0, SCHED_FIFO, &parameters) != 0) {
        (void)setpriority(PRIO_PROCESS, 0, NICE);
    }
}

static int run_twin(run_t *self)
{
    const sigset_t open = catch_signals();
    ask_for_priority();
    int code = open_all(self);
    if (code == EXIT_DONE) {
        self->start_us = self->now_us = clock_us();
        twin_start(&self->twin, &self->config, &self->settings, (node_out_t){wire_put, &self->wire}, self->now_us);
        self->twin.bus = (twin_bus_t){wire_fault, &self->wire, self->options.slcan != NULL};
        self->twin.lines = &self->lines;
        say_what_runs(self);
        code = run(self, &open);
    }
    control_close(&self->control);
    modbus_ports_close(&self->ports);
    lines_close(&self->lines);
    if (self->wire.name[0] != '\0') {
        wire_close(&self->wire);
    }
    return code;
}

static int check(run_t *self)
{
    const unsigned drives = drives_of(self);
    lines_describe(&self->lines, stdout);
    if (self->script.machine.kind == TWIN_DRIVES_NONE) {
        printf("%s: no drives, %u GPIO lines, %u faults: right\n", self->options.config, self->lines.count, self->script.count);
    } else if (!has_wire(self)) {
        printf("%s: %u drives on Modbus, %u faults: right\n", self->options.config, drives, self->script.count);
    } else {
        printf("%s: %u %s on %s, %u faults: right\n", self->options.config, drives,
               self->script.machine.kind == TWIN_DRIVES_FRAMES ? "drives with frames of their own" : "CiA 402 drives",
               self->options.interface != NULL ? self->options.interface : self->config.can.interface, self->script.count);
    }
    return EXIT_DONE;
}

int main(int argc, char **argv)
{
    static run_t self;
    int code = twin_options_read(&self.options, argc, argv);
    if (code != EXIT_DONE) {
        return code;
    }
    switch (self.options.mode) {
    case TWIN_HELP:
        usage_print(twin_usage(), stdout);
        return EXIT_DONE;
    case TWIN_VERSION:
        printf("heave-twin %s\n", HEAVE_VERSION);
        return EXIT_DONE;
    case TWIN_ASK:
        return control_ask(self.options.socket, self.options.line);
    case TWIN_RUN:
    case TWIN_CHECK:
        code = prepare(&self);
        return code != EXIT_DONE ? code : self.options.mode == TWIN_CHECK ? check(&self) : run_twin(&self);
    }
    return EXIT_SOFTWARE;
}
