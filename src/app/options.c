/* SPDX-License-Identifier: MIT
 * options.c - the command line of heaved; see options.h.
 */
#include "options.h"

#include <getopt.h>
#include <string.h>

#include "config.h"
#include "say.h"

enum {
    OPTION_CONFIG = 1,
    OPTION_CHECK,
    OPTION_ENVELOPE,
    OPTION_DOCTOR,
    OPTION_DUMP,
    OPTION_DUMP_DBC,
    OPTION_PLAY,
    OPTION_TRACE,
    OPTION_RECORD,
    OPTION_SOCKET,
    OPTION_HELP,
    OPTION_VERSION
};

const char options_help[] =
    "heaved - motion platform gateway: takes UDP frames, moves the cylinders.\n"
    "\n"
    "  heaved --config FILE [--socket PATH] [--record FRAMES] [--trace OUT]   run\n"
    "  heaved --config FILE --check                      validate, and print what follows from it\n"
    "  heaved --config FILE --envelope OUT               what the geometry can do, as CSV (docs/envelope.md)\n"
    "  heaved --config FILE --doctor                     look at machine, CAN interface and drives: what is wrong, what helps\n"
    "  heaved --config FILE --dump-config                every key with its value, unit, range and help\n"
    "  heaved --config FILE --dump-dbc                   the frames of [can-raw] as a DBC file\n"
    "  heaved --config FILE --play FRAMES [--trace OUT]  offline: simulated time and devices\n"
    "\n"
    "  --config FILE    the platform (INI)\n"
    "  --record FRAMES  log every datagram and request, so that --play repeats the run\n"
    "  --trace OUT      the set-points of every cycle (CSV); - is standard output\n"
    "  --envelope OUT   a file, there as a whole or not at all; - is standard output\n"
    "  --play FRAMES    lines `<t_ms> <text>`, `<t_ms> !engage` ...; - is standard input\n"
    "  --socket PATH    for heavectl, instead of [control] socket\n"
    "  --help, --version\n"
    "\n"
    "SIGTERM or Ctrl-C settles the platform, switches the drives off and ends; a second one ends at once.\n"
    "Exit codes: 0 done, 1 ended by a second signal or --doctor found something wrong, 64 usage, 65 bad FRAMES, 66 no input,\n"
    "69 port or socket in use, 73 output cannot be created, 74 output cannot be written, 78 configuration.\n";

static const struct option k_options[] = {
    {"config", required_argument, NULL, OPTION_CONFIG},
    {"check", no_argument, NULL, OPTION_CHECK},
    {"envelope", required_argument, NULL, OPTION_ENVELOPE},
    {"doctor", no_argument, NULL, OPTION_DOCTOR},
    {"dump-config", no_argument, NULL, OPTION_DUMP},
    {"dump-dbc", no_argument, NULL, OPTION_DUMP_DBC},
    {"play", required_argument, NULL, OPTION_PLAY},
    {"trace", required_argument, NULL, OPTION_TRACE},
    {"record", required_argument, NULL, OPTION_RECORD},
    {"socket", required_argument, NULL, OPTION_SOCKET},
    {"help", no_argument, NULL, OPTION_HELP},
    {"version", no_argument, NULL, OPTION_VERSION},
    {NULL, 0, NULL, 0},
};

/* Sets the mode; two different ones contradict each other. */
static bool set_mode(options_t *self, run_mode_t mode)
{
    const bool is_free = self->mode == MODE_RUN || self->mode == mode;
    self->mode = mode;
    return is_free;
}

static const char *take_option(options_t *self, int option)
{
    static const char k_one_mode[] =
        "only one of --check, --envelope, --doctor, --dump-config, --dump-dbc, --play, --help, --version at a time";
    bool is_free = true;
    switch (option) {
    case OPTION_CONFIG:
        self->config = optarg;
        break;
    case OPTION_CHECK:
        is_free = set_mode(self, MODE_CHECK);
        break;
    case OPTION_ENVELOPE:
        self->envelope = optarg;
        is_free = set_mode(self, MODE_ENVELOPE);
        break;
    case OPTION_DOCTOR:
        is_free = set_mode(self, MODE_DOCTOR);
        break;
    case OPTION_DUMP:
        is_free = set_mode(self, MODE_DUMP_CONFIG);
        break;
    case OPTION_DUMP_DBC:
        is_free = set_mode(self, MODE_DUMP_DBC);
        break;
    case OPTION_PLAY:
        self->play = optarg;
        is_free = set_mode(self, MODE_PLAY);
        break;
    case OPTION_TRACE:
        self->trace = optarg;
        break;
    case OPTION_RECORD:
        self->record = optarg;
        break;
    case OPTION_SOCKET:
        self->socket = optarg;
        break;
    case OPTION_HELP:
        is_free = set_mode(self, MODE_HELP);
        break;
    case OPTION_VERSION:
        is_free = set_mode(self, MODE_VERSION);
        break;
    default: /* getopt's own values: '?' and ':' */
        return option == ':' ? "option needs a value" : "unknown option";
    }
    return is_free ? NULL : k_one_mode;
}

/* Options that do not go together. */
static const char *contradiction(const options_t *self)
{
    if (self->mode == MODE_HELP || self->mode == MODE_VERSION) {
        return NULL;
    }
    if (self->config == NULL) {
        return "--config FILE is missing";
    }
    if (self->mode != MODE_RUN && (self->record != NULL || self->socket != NULL)) {
        return "--record and --socket are for running live";
    }
    if (self->trace != NULL && self->mode != MODE_RUN && self->mode != MODE_PLAY) {
        return "--trace is for running live and for --play";
    }
    if (self->socket != NULL && (self->socket[0] == '\0' || strlen(self->socket) >= CONFIG_PATH_MAX)) {
        return "--socket needs a path of 1 to 107 characters";
    }
    return NULL;
}

static int complain(const char *what, const char *about)
{
    return say(EXIT_BAD_USAGE, "%s%s%s; see heaved --help", what, about != NULL ? ": " : "", about != NULL ? about : "");
}

int options_read(options_t *self, int argc, char **argv)
{
    *self = (options_t){.mode = MODE_RUN};
    opterr = 0;
    for (;;) {
        const int at = optind;
        const int option = getopt_long(argc, argv, ":", k_options, NULL);
        if (option < 0) {
            break;
        }
        const char *wrong = take_option(self, option);
        if (wrong != NULL) {
            return complain(wrong, option == '?' || option == ':' ? argv[at] : NULL);
        }
    }
    if (optind < argc) {
        return complain("unexpected argument", argv[optind]);
    }
    const char *wrong = contradiction(self);
    return wrong != NULL ? complain(wrong, NULL) : EXIT_DONE;
}
