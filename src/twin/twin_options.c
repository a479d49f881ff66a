/* SPDX-License-Identifier: MIT
 * twin_options.c - the command line of heave-twin; see twin_options.h.
 */
#include "twin/twin_options.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/message.h" // exit codes
#include "twin/twin_faults.h"

enum {
    OPTION_CONFIG = 1,
    OPTION_CHECK,
    OPTION_FAULT,
    OPTION_SCRIPT,
    OPTION_SOCKET,
    OPTION_SWAP,
    OPTION_REVERSE,
    OPTION_LEAD,
    OPTION_ZERO,
    OPTION_START,
    OPTION_LAG,
    OPTION_FRICTION,
    OPTION_LOAD,
    OPTION_NO_GPIO,
    OPTION_SLCAN,
    OPTION_INTERFACE,
    OPTION_AMBIENT,
    OPTION_HOMED,
    OPTION_ON_REAL_BUS,
    OPTION_HELP,
    OPTION_VERSION
};

#define COMMANDS_MAX 64u
#define LEAD_MAX     1000.0
#define COUNTS_MAX   2e9
#define MM_MAX       10000.0
#define COLDEST_C    (-40.0)
#define HOTTEST_C    150.0

static const usage_row_t k_forms[] = {
    {.argument = "--config FILE [OPTION ...]", .help = "run, until Ctrl-C"},
    {.argument = "--config FILE [OPTION ...] --check", .help = "say what would run, and whether faults and script are right"},
    {.argument = "--socket PATH FAULT [ARGUMENT ...]", .help = "make it in the one that runs"},
    {.argument = "--socket PATH status", .help = "where its drives really are, as JSON"},
    {0},
};

static const usage_row_t k_options[] = {
    {"config", "FILE", "the platform (INI), as heaved has it", OPTION_CONFIG},
    {"check", NULL, "run nothing", OPTION_CHECK},
    {"fault", "LINE", "one line of a script; may be given 32 times", OPTION_FAULT},
    {"script", "FILE", "faults with times; see docs/twin.md", OPTION_SCRIPT},
    {"socket", "PATH", "where a running one can be asked", OPTION_SOCKET},
    {"slcan", "PATH", "the bus is behind a serial CAN adapter (slcan), a terminal to which PATH leads", OPTION_SLCAN},
    {"interface", "NAME", "the drives are on this CAN interface, the other end of a pair (vxcan); else [can] interface",
     OPTION_INTERFACE},
    {"swap", "A,B", "drives A and B are on each other's leg; may be given several times", OPTION_SWAP},
    {"reverse", "A,B,...", "these drives run backwards", OPTION_REVERSE},
    {"lead", "A=X,...", "drive A moves X times the way that the configuration expects", OPTION_LEAD},
    {"zero", "A=N,...", "the encoder of drive A is N counts beside", OPTION_ZERO},
    {"start", "MM", "extension of all legs at the start; else the settled one", OPTION_START},
    {"lag", "MS", "time constant with which axes follow; else 2", OPTION_LAG},
    {"friction", "MM", "how far a demand is ahead before an axis breaks loose; else 0", OPTION_FRICTION},
    {"load", "MM", "how far cylinders give way under their load; else 0", OPTION_LOAD},
    {"ambient", "C", "temperature round the motors; else 25", OPTION_AMBIENT},
    {"homed", NULL, "the drives know their zero from the start, as those with absolute encoders do", OPTION_HOMED},
    {"no-gpio", NULL, "leave the GPIO lines alone: they are real ones, or nobody needs them", OPTION_NO_GPIO},
    {"on-real-bus", NULL,
     "the interface, or the address of Modbus TCP, may lead to real drives; on CAN it listens for them first",
     OPTION_ON_REAL_BUS},
    {"help", NULL, "print this", OPTION_HELP},
    {"version", NULL, "print the version", OPTION_VERSION},
    {0},
};

static const usage_exit_t k_exits[] = {
    {EXIT_DONE, "done"},
    {EXIT_REFUSED, "refused by the one that runs"},
    {EXIT_BAD_USAGE, "usage"},
    {EXIT_BAD_DATA, "bad script"},
    {EXIT_NO_INPUT, "no script"},
    {EXIT_UNAVAILABLE, "the bus, the lines or the socket cannot be used"},
    {EXIT_BAD_CONFIG, "configuration"},
    {0},
};

static const usage_section_t k_manual[] = {
    {"DESCRIPTION",
     "`heave-twin` is the outside of a platform: the drives that its configuration names, on their bus, and the mechanism that "
     "they move. heaved(8), or any other master, sees no difference, as long as nothing is made to fail. It has no part in a "
     "machine with real drives: it takes vcan, vxcan, buses between programs, pseudo terminals and the loopback address. "
     "Anything "
     "else may lead to real drives, in whose place it would answer: that needs --on-real-bus. On CAN it listens first, for two "
     "seconds, and does not start if one of its drives is there already.\n\n"
     "It takes configurations with CANopen drives (`[drives] driver = cia402`), with drives that have CAN frames of their own "
     "(can-raw) and with drives on Modbus (modbus-tcp, modbus-rtu), and a board of relays on Modbus. Lines of [relays], [inputs] "
     "and [healthy] with `driver = gpio` are on chips "
     "that the kernel simulates (gpio-sim), which takes root; drives may then be heaved's own (`driver = sim`). For Modbus TCP "
     "it is a server at each host; for a serial line it makes a "
     "pseudo terminal, and a link to it at the configured device. `[can] interface` is a SocketCAN interface, such "
     "as vcan0; a name that begins with twin is a bus between programs, for kernels without CAN. With `--slcan PATH` the drives "
     "are behind a serial CAN adapter instead: slcand(1), or a program such as python-can, opens PATH. With `--interface NAME` "
     "they are on the other end of a pair of interfaces (vxcan), which may be in another network name space than heaved.\n"},
    {"SCRIPTS",
     "A line is `SECONDS FAULT`: a time since heave-twin started. `+SECONDS FAULT` counts since all drives had torque. What "
     "stands behind a # is a comment. Each line that is wrong is named, and then nothing starts.\n"},
    {"EXAMPLES", "A whole platform without hardware:\n"
                 " ip link add vcan0 type vcan && ip link set vcan0 up\n"
                 " heave-twin --config platform.ini --socket /tmp/twin.sock\n"
                 " heaved --config platform.ini\n"
                 "Drive 3 starts again five seconds after all have torque:\n"
                 " heave-twin --config platform.ini --fault '+5 reboot 3'\n"
                 "A cylinder jams, now:\n"
                 " heave-twin --socket /tmp/twin.sock jam 2\n"},
    {0},
};

const usage_t *twin_usage(void)
{
    static usage_row_t commands[COMMANDS_MAX];
    static usage_t usage;
    for (unsigned i = 0; i + 1 < COMMANDS_MAX && fault_describe(i, &commands[i].name, &commands[i].argument, &commands[i].help);
         i++) {}
    usage = (usage_t){.program = "heave-twin",
                      .manual_section = "1",
                      .summary = "the drives and the mechanism of a platform, simulated on their bus",
                      .forms = k_forms,
                      .commands = commands,
                      .options = k_options,
                      .notes = "DRIVE is a number, several as 2,5, or all. Never start this on the bus of real drives.",
                      .exits = k_exits,
                      .manual = k_manual,
                      .see_also = "heaved(8), heavectl(1), heave.ini(5)"};
    return &usage;
}

static int complain(const char *what, const char *text, const char *right)
{
    fprintf(stderr, "heave-twin: %s%s%s: %s\n", what, text[0] != '\0' ? " " : "", text, right);
    return EXIT_BAD_USAGE;
}

/* --- Reading --- */

static const char **place_of(twin_options_t *self, int option)
{
    switch (option) {
    case OPTION_CONFIG:
        return &self->config;
    case OPTION_SCRIPT:
        return &self->script;
    case OPTION_SLCAN:
        return &self->slcan;
    case OPTION_INTERFACE:
        return &self->interface;
    case OPTION_SOCKET:
        return &self->socket;
    case OPTION_REVERSE:
        return &self->reverse;
    case OPTION_LEAD:
        return &self->lead;
    case OPTION_ZERO:
        return &self->zero;
    case OPTION_START:
        return &self->start;
    case OPTION_LAG:
        return &self->lag;
    case OPTION_FRICTION:
        return &self->friction;
    case OPTION_LOAD:
        return &self->load;
    case OPTION_AMBIENT:
        return &self->ambient;
    case OPTION_FAULT:
        return self->faults < OPTIONS_FAULTS_MAX ? &self->fault[self->faults++] : NULL;
    case OPTION_SWAP:
        return self->swaps < DRIVES_MAX ? &self->swap[self->swaps++] : NULL;
    default:
        return NULL;
    }
}

/* False where it is none of ours, or one too many. */
static bool accept(twin_options_t *self, int option)
{
    if (option == OPTION_CHECK || option == OPTION_HELP || option == OPTION_VERSION) {
        self->mode = option == OPTION_CHECK ? TWIN_CHECK : option == OPTION_HELP ? TWIN_HELP : TWIN_VERSION;
        return true;
    }
    if (option == OPTION_NO_GPIO || option == OPTION_HOMED || option == OPTION_ON_REAL_BUS) {
        *(option == OPTION_HOMED         ? &self->is_homed
          : option == OPTION_ON_REAL_BUS ? &self->is_on_real_bus
                                         : &self->is_without_gpio) = true;
        return true;
    }
    const char **place = place_of(self, option);
    if (place != NULL) {
        *place = optarg;
    }
    return place != NULL;
}

static int accept_line(twin_options_t *self, int argc, char **argv)
{
    size_t length = 0;
    if (self->config != NULL || self->socket == NULL) {
        return complain("unexpected", argv[optind],
                        "a fault goes to a running heave-twin: --socket PATH FAULT, without --config; see --help");
    }
    self->mode = TWIN_ASK;
    for (int i = optind; i < argc && length < sizeof self->line; i++) {
        length += (size_t)snprintf(self->line + length, sizeof self->line - length, "%s%s", length == 0 ? "" : " ", argv[i]);
    }
    return length < sizeof self->line - 1 ? EXIT_DONE : complain("the fault", "", "is too long");
}

int twin_options_read(twin_options_t *self, int argc, char **argv)
{
    struct option options[USAGE_OPTIONS_MAX + 1];
    int option;
    *self = (twin_options_t){.mode = TWIN_RUN};
    usage_options(twin_usage(), options);
    while ((option = getopt_long(argc, argv, "", options, NULL)) != -1) {
        if (option == '?') {
            fputs("heave-twin: see --help\n", stderr);
            return EXIT_BAD_USAGE;
        }
        if (!accept(self, option)) {
            return complain("--fault or --swap", "", "is given too often; put faults into a --script");
        }
    }
    if (self->mode == TWIN_HELP || self->mode == TWIN_VERSION) {
        return EXIT_DONE;
    }
    if (optind < argc) {
        return accept_line(self, argc, argv);
    }
    if (self->config == NULL) {
        return complain("--config FILE", "", "is missing; see --help");
    }
    if (self->interface != NULL && self->slcan != NULL) {
        return complain("--interface", self->interface, "the bus is behind the adapter of --slcan: one of both");
    }
    const bool is_name = self->interface == NULL || (self->interface[0] != '\0' && strlen(self->interface) < CONFIG_NAME_MAX);
    return is_name ? EXIT_DONE : complain("--interface", self->interface, "a name of 1 to 15 characters");
}

/* --- Meaning --- */

/* A drive's number; 0 = none. at moves behind it. */
static unsigned read_drive(const char **at, unsigned drives)
{
    char *end = NULL;
    const unsigned long number = **at >= '0' && **at <= '9' ? strtoul(*at, &end, 10) : 0;
    if (number < 1 || number > drives) {
        return 0;
    }
    *at = end;
    return (unsigned)number;
}

static bool read_number(const char **at, double least, double most, double *out)
{
    char *end = NULL;
    const double number = strtod(*at, &end);
    const bool is_right = end != *at && number >= least && number <= most;
    *at = end;
    *out = is_right ? number : *out;
    return is_right;
}

/* `A=X,B=Y` into one value per drive. */
static bool read_pairs(const char *text, unsigned drives, double least, double most, double *out)
{
    for (const char *at = text; at != NULL && *at != '\0';) {
        const unsigned drive = read_drive(&at, drives);
        if (drive == 0 || *at++ != '=' || !read_number(&at, least, most, &out[drive - 1]) || (*at != '\0' && *at != ',')) {
            return false;
        }
        at += *at == ',' && at[1] != '\0' ? 1 : 0;
        if (*at == ',') {
            return false;
        }
    }
    return text == NULL || text[0] != '\0';
}

static bool read_swap(const char *text, unsigned cylinders, uint8_t *leg_of)
{
    const char *at = text;
    const unsigned first = read_drive(&at, cylinders);
    const bool is_pair = first != 0 && *at == ',';
    at += is_pair ? 1 : 0;
    const unsigned second = is_pair ? read_drive(&at, cylinders) : 0;
    if (second == 0 || *at != '\0') {
        return false;
    }
    const uint8_t leg = leg_of[first - 1];
    leg_of[first - 1] = leg_of[second - 1];
    leg_of[second - 1] = leg;
    return true;
}

static bool read_reverse(const char *text, unsigned drives, bool *out)
{
    for (const char *at = text; at != NULL;) {
        const unsigned drive = read_drive(&at, drives);
        if (drive == 0 || (*at != ',' && *at != '\0')) {
            return false;
        }
        out[drive - 1] = true;
        at = *at == ',' ? at + 1 : NULL;
    }
    return true;
}

static bool read_length(const char *text, double least, double *out)
{
    const char *at = text;
    return text == NULL || (read_number(&at, least, MM_MAX, out) && *at == '\0');
}

int twin_options_apply(const twin_options_t *self, unsigned drives, unsigned cylinders, twin_settings_t *out)
{
    char right[80];
    out->is_homed = self->is_homed;
    for (unsigned i = 0; i < self->swaps; i++) {
        if (!read_swap(self->swap[i], cylinders, out->leg_of)) {
            (void)snprintf(right, sizeof right, "two of the %u cylinders, as 2,5", cylinders);
            return complain("--swap", self->swap[i], right);
        }
    }
    (void)snprintf(right, sizeof right, "drives are 1 to %u, several as 2,5", drives);
    if (!read_reverse(self->reverse, drives, out->is_reversed)) {
        return complain("--reverse", self->reverse, right);
    }
    if (!read_pairs(self->lead, drives, 1 / LEAD_MAX, LEAD_MAX, out->lead)) {
        return complain("--lead", self->lead,
                        "written as 3=2.0, several as 3=2.0,4=0.5; from 0.001 to 1000, of drives that there are");
    }
    if (!read_pairs(self->zero, drives, -COUNTS_MAX, COUNTS_MAX, out->zero_counts)) {
        return complain("--zero", self->zero, "written as 3=500, in counts, of drives that there are");
    }
    if (!read_length(self->start, -MM_MAX, &out->start_mm) || !read_length(self->friction, 0, &out->friction_mm) ||
        !read_length(self->load, -MM_MAX, &out->load_mm) || !read_length(self->lag, 0, &out->lag_ms)) {
        return complain("--start, --friction, --load or --lag", "", "is no number of mm or ms");
    }
    const char *ambient = self->ambient;
    if (ambient != NULL && (!read_number(&ambient, COLDEST_C, HOTTEST_C, &out->ambient_c) || *ambient != '\0')) {
        return complain("--ambient", self->ambient, "a temperature of -40 to 150 C");
    }
    return EXIT_DONE;
}
