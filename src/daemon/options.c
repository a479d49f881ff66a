/* SPDX-License-Identifier: MIT
 * options.c - the command line of heaved; see options.h.
 */
#include "daemon/options.h"

#include <string.h>

#include "common/message.h"
#include "common/presets.h"
#include "common/translate.h"
#include "common/usage.h"
#include "config/config.h"

enum {
    OPTION_CONFIG = 1,
    OPTION_CHECK,
    OPTION_JSON,
    OPTION_KEYS,
    OPTION_ENVELOPE,
    OPTION_DOCTOR,
    OPTION_DUMP,
    OPTION_DUMP_DBC,
    OPTION_EDS,
    OPTION_IMPORT_DCF,
    OPTION_PLAY,
    OPTION_TRACE,
    OPTION_RECORD,
    OPTION_SOCKET,
    OPTION_PRESET,
    OPTION_PRESETS,
    OPTION_SCAN,
    OPTION_TEMPLATE,
    OPTION_DRIVE,
    OPTION_PARTIAL,
    OPTION_HELP,
    OPTION_VERSION
};

static const usage_row_t k_forms[] = {
    {.argument = "[--socket PATH] [--record FRAMES] [--trace OUT]", .help = N_("run")},
    {.argument = "--check [--json | --eds EDS]", .help = N_("validate, and print what follows from it")},
    {.argument = "--envelope OUT", .help = N_("what the geometry can do, as CSV (docs/envelope.md)")},
    {.argument = "--doctor", .help = N_("look at machine, CAN interface and drives: what is wrong, what helps")},
    {.argument = "--dump-config", .help = N_("every key with its value, unit, range and help")},
    {.argument = "--dump-dbc", .help = N_("the frames of [can-raw] or [cia402] as a DBC file")},
    {.argument = "--import-dcf DCF --drive N|all", .help = N_("what it sets, as the start-up list of a drive, or of all")},
    {.argument = "--import-dcf DCF...", .help = N_("of drives 1, 2, ...: what is alike for all of them, and lists of each")},
    {.argument = "--play FRAMES [--trace OUT]", .help = N_("offline: simulated time and devices")},
    {.argument = "--presets", .help = N_("ready-made platforms, without a file")},
    {.argument = "--keys", .help = N_("every key with help, unit, range and default as JSON, without a file")},
    {.argument = "--scan BUS", .help = N_("who is on a bus, without a file")},
    {.argument = "--template KIND DRIVER", .help = N_("a file to fill in, without a file")},
    {0},
};

static const usage_row_t k_options[] = {
    {"config", "FILE", N_("the platform (INI)"), OPTION_CONFIG},
    {"preset", "NAME", N_("a ready-made platform, in place of --config"), OPTION_PRESET},
    {"presets", NULL, N_("their names"), OPTION_PRESETS},
    {"scan", "BUS",
     N_("a CAN interface: CANopen nodes; or DEVICE[,BAUD[,PARITY[,STOP]]]: Modbus units; writes nothing into a drive"),
     OPTION_SCAN},
    {"template", "KIND", N_("hexapod, tripod or tripod-3rps, and a driver: sim, cia402, can-raw, modbus-tcp or modbus-rtu"),
     OPTION_TEMPLATE},
    {"check", NULL,
     N_("say whether the platform is valid, what it can reach, what it costs the bus, and what would suit it better"),
     OPTION_CHECK},
    {"json", NULL, N_("of --check: mistakes with their lines, the report and the geometry as a JSON object"), OPTION_JSON},
    {"keys", NULL, N_("for programs that edit a configuration"), OPTION_KEYS},
    {"envelope", "OUT", N_("a file, there as a whole or not at all; - is standard output"), OPTION_ENVELOPE},
    {"doctor", NULL, N_("a line for each finding; writes nothing into a drive"), OPTION_DOCTOR},
    {"dump-config", NULL, N_("as a file that --config takes"), OPTION_DUMP},
    {"dump-dbc", NULL, N_("for tools that show CAN frames"), OPTION_DUMP_DBC},
    {"eds", "EDS", N_("the file of the drives ([drives] driver = cia402): which objects they lack, which settings do not fit"),
     OPTION_EDS},
    {"import-dcf", "DCF", N_("a drive as its maker's program left it; what is left out is a comment, with the reason"),
     OPTION_IMPORT_DCF},
    {"drive", "N", N_("of --import-dcf with one file: 1 to 6, angle for the rotation motor, or all for all cylinders alike"),
     OPTION_DRIVE},
    {"partial", NULL, N_("of --import-dcf: exit 0 also where settings are left out that the drive may need"), OPTION_PARTIAL},
    {"play", "FRAMES", N_("lines `<t_ms> <text>`, `<t_ms> !engage` ...; - is standard input"), OPTION_PLAY},
    {"trace", "OUT", N_("the set-points of every cycle (CSV); - is standard output"), OPTION_TRACE},
    {"record", "FRAMES", N_("log every datagram and request, so that --play repeats the run"), OPTION_RECORD},
    {"socket", "PATH", N_("for heavectl, instead of [control] socket"), OPTION_SOCKET},
    {"help", NULL, N_("print this"), OPTION_HELP},
    {"version", NULL, N_("print the version"), OPTION_VERSION},
    {0},
};

static const usage_exit_t k_exits[] = {
    {EXIT_DONE, N_("done")},
    {EXIT_REFUSED, N_("ended by a second signal, torque not confirmed off, --doctor, --scan or --eds found something wrong, or "
                      "--import-dcf left something out")},
    {EXIT_BAD_USAGE, N_("usage")},
    {EXIT_BAD_DATA, N_("bad FRAMES, EDS or DCF")},
    {EXIT_NO_INPUT, N_("no input")},
    {EXIT_UNAVAILABLE, N_("port or socket in use")},
    {EXIT_SOFTWARE, N_("a bug")},
    {EXIT_NO_OUTPUT, N_("output cannot be created")},
    {EXIT_IO, N_("output cannot be written")},
    {EXIT_BAD_CONFIG, N_("configuration")},
    {0},
};

static const usage_section_t k_manual[] = {
    {N_("DESCRIPTION"),
     N_("`heaved` takes a motion platform's UDP frames (protocol V3.0), works out where each cylinder has to be, and drives "
        "cylinders and relays "
        "itself. `heavectl(1)` talks to it. As a service it is `heave@NAME`, which runs /etc/heave/NAME.ini.\n\n"
        "It is no safety function: the e-stop chain has to take the power from the drives by itself, whatever heaved does.\n")},
    {N_("SIGNALS"),
     N_("SIGTERM and SIGINT settle the platform, switch the drives off and end; a second one ends at once. SIGHUP reads the "
        "configuration again: "
        "what may change in operation does, the rest is named with its line and needs a restart; a wrong file changes "
        "nothing.\n")},
    {N_("ENVIRONMENT"),
     N_("`NOTIFY_SOCKET` and `WATCHDOG_USEC` are those of systemd: it is told when the platform is ready and what state it is "
        "in, "
        "and that the "
        "motion thread advances. `STATE_DIRECTORY` is where the black box goes if the configuration names no directory, "
        "`RUNTIME_DIRECTORY` where the socket is if it names no other. `LANGUAGE`, `LC_ALL`, "
        "`LC_MESSAGES` and `LANG` choose the language of what is printed before it runs, as `--check` and errors of the "
        "configuration; the log is English.\n")},
    {N_("FILES"),
     N_(" /etc/heave/NAME.ini          the platform of heave@NAME; see heave.ini(5)\n"
        " /etc/heave/demo.ini          a simulated one, to try things out\n"
        " /usr/share/heave/presets/    ready-made platforms, for --preset; HEAVE_PRESETS says another folder\n"
        " /run/heave/NAME/heaved.sock  of heave@NAME, for heavectl; members of group heave may\n"
        " /run/heave/heaved.sock       of a heaved started by hand\n"
        " /var/lib/heave/NAME/         incidents of the black box, and the configuration that was applied (heavectl config)\n")},
    {N_("EXAMPLES"), N_("Is a platform valid, and what does it come to?\n"
                        " heaved --config /etc/heave/demo.ini --check\n"
                        "What would a frame do? Three seconds after the start a pose, then down:\n"
                        " printf '%s\\n' '3000 @A6:5,6,0,5.5,3.0,20,F0#' '5000 !park' |\n"
                        "     heaved --config /etc/heave/demo.ini --play - --trace /tmp/trace.csv\n")},
    {0},
};

const usage_t heaved_usage = {
    .program = "heaved",
    .manual_section = "8",
    .summary = N_("motion platform gateway: takes UDP frames, moves the cylinders"),
    .common = "--config FILE",
    .forms = k_forms,
    .options = k_options,
    .notes = N_("SIGTERM or Ctrl-C settles the platform, switches the drives off and ends; a second one ends at once."),
    .exits = k_exits,
    .manual = k_manual,
    .see_also = "heavectl(1), heave.ini(5)",
};

/* The mode that an option asks for; MODE_RUN where it asks for none. */
static run_mode_t mode_of(int option)
{
    static const run_mode_t k_modes[] = {
        [OPTION_CHECK] = MODE_CHECK,           [OPTION_KEYS] = MODE_KEYS,        [OPTION_ENVELOPE] = MODE_ENVELOPE,
        [OPTION_DOCTOR] = MODE_DOCTOR,         [OPTION_DUMP] = MODE_DUMP_CONFIG, [OPTION_DUMP_DBC] = MODE_DUMP_DBC,
        [OPTION_IMPORT_DCF] = MODE_IMPORT_DCF, [OPTION_PLAY] = MODE_PLAY,        [OPTION_PRESETS] = MODE_PRESETS,
        [OPTION_TEMPLATE] = MODE_TEMPLATE,     [OPTION_SCAN] = MODE_SCAN,        [OPTION_HELP] = MODE_HELP,
        [OPTION_VERSION] = MODE_VERSION};
    return (size_t)option < sizeof k_modes / sizeof k_modes[0] ? k_modes[option] : MODE_RUN;
}

/* Where the value of an option goes; NULL where it has none. */
static const char **value_of(options_t *self, int option)
{
    switch (option) {
    case OPTION_ENVELOPE:
        return &self->envelope;
    case OPTION_EDS:
        return &self->eds;
    case OPTION_PLAY:
        return &self->play;
    case OPTION_TRACE:
        return &self->trace;
    case OPTION_RECORD:
        return &self->record;
    case OPTION_SOCKET:
        return &self->socket;
    case OPTION_TEMPLATE:
        return &self->template_kind;
    case OPTION_SCAN:
        return &self->scan;
    default:
        return NULL;
    }
}

/* Which configuration: a file, or one of the ready-made platforms. */
static const char *accept_config(options_t *self, int option)
{
    const bool is_preset = option == OPTION_PRESET;
    if (is_preset ? self->config != NULL : self->config == self->preset) {
        return _("--config or --preset, not both");
    }
    self->config = is_preset ? self->preset : optarg;
    return !is_preset || presets_path(optarg, self->preset, sizeof self->preset)
               ? NULL
               : _("--preset needs one of the names that --presets shows");
}

static const char *accept_dcf(options_t *self, const char *path)
{
    if (self->dcfs == OPTIONS_DCF_MAX) {
        return _("--import-dcf takes up to 6 files, one for each cylinder's drive");
    }
    self->dcf[self->dcfs++] = path;
    return NULL;
}

/* The list that a file goes into. */
static const char *accept_drive(options_t *self, const char *which)
{
    const bool is_number = which[0] >= '1' && which[0] < '1' + (int)OPTIONS_DCF_MAX && which[1] == '\0';
    if (!is_number && strcmp(which, "all") != 0 && strcmp(which, "angle") != 0) {
        return _("--drive is 1 to 6, angle or all");
    }
    (void)snprintf(self->dcf_section, sizeof self->dcf_section, "cia402-%sstartup%s%s", which[1] == 'n' ? "angle-" : "",
                   is_number ? "-" : "", is_number ? which : "");
    return NULL;
}

/* Of the things that heaved does, one at a time. */
static const char *accept_mode(options_t *self, run_mode_t mode)
{
    if (mode != MODE_RUN && self->mode != MODE_RUN && self->mode != mode) {
        return _("only one of --check, --envelope, --doctor, --dump-config, --dump-dbc, --import-dcf, --play, --presets, "
                 "--scan, --template, --keys, --help, --version at a time");
    }
    self->mode = mode != MODE_RUN ? mode : self->mode;
    return NULL;
}

static const char *accept_option(options_t *self, int option)
{
    if (option == '?' || option == ':') { /* getopt's own */
        return option == ':' ? _("option needs a value") : _("unknown option");
    }
    if (option == OPTION_CONFIG || option == OPTION_PRESET) {
        return accept_config(self, option);
    }
    self->is_json = self->is_json || option == OPTION_JSON;
    self->is_partial = self->is_partial || option == OPTION_PARTIAL;
    const char *wrong = option == OPTION_IMPORT_DCF ? accept_dcf(self, optarg)
                        : option == OPTION_DRIVE    ? accept_drive(self, optarg)
                                                    : NULL;
    if (wrong != NULL) {
        return wrong;
    }
    if (value_of(self, option) != NULL) {
        *value_of(self, option) = optarg;
    }
    return accept_mode(self, mode_of(option));
}

static const char *dcf_contradiction(const options_t *self)
{
    const bool has_drive = self->dcf_section[0] != '\0';
    if (self->mode != MODE_IMPORT_DCF) {
        return has_drive || self->is_partial ? _("--drive and --partial are for --import-dcf") : NULL;
    }
    if (self->dcfs > 1 && has_drive) {
        return _("--drive is for --import-dcf with one file; several are of drives 1, 2, ...");
    }
    return self->dcfs > 1 || has_drive ? NULL
                                       : _("whose file is it? --drive 1 to 6 or angle, or --drive all for all cylinders alike");
}

/* Options that do not go together. */
/* Options of another mode than the one that was asked for. */
static const char *stray_option(const options_t *self)
{
    if (self->mode != MODE_RUN && (self->record != NULL || self->socket != NULL)) {
        return _("--record and --socket are for running live");
    }
    if (self->is_json && (self->mode != MODE_CHECK || self->eds != NULL)) {
        return _("--json is for --check, without --eds");
    }
    if (self->eds != NULL && self->mode != MODE_CHECK) {
        return _("--eds is for --check");
    }
    if (self->trace != NULL && self->mode != MODE_RUN && self->mode != MODE_PLAY) {
        return _("--trace is for running live and for --play");
    }
    if (self->socket != NULL && (self->socket[0] == '\0' || strlen(self->socket) >= CONFIG_PATH_MAX)) {
        return _("--socket needs a path of 1 to 107 characters");
    }
    return NULL;
}

static bool is_without_config(run_mode_t mode)
{
    return mode == MODE_HELP || mode == MODE_VERSION || mode == MODE_PRESETS || mode == MODE_IMPORT_DCF || mode == MODE_SCAN ||
           mode == MODE_KEYS;
}

static const char *contradiction(const options_t *self)
{
    const char *wrong = dcf_contradiction(self);
    if (wrong != NULL || is_without_config(self->mode)) {
        return wrong;
    }
    if (self->mode == MODE_TEMPLATE) {
        return self->template_driver != NULL ? NULL : _("--template needs a kind and a driver, as in --template hexapod cia402");
    }
    return self->config == NULL ? _("--config FILE or --preset NAME is missing") : stray_option(self);
}

static int complain(const char *what, const char *about)
{
    return print_message(EXIT_BAD_USAGE, "%s%s%s; see heaved --help", what, about != NULL ? ": " : "",
                         about != NULL ? about : "");
}

int options_read(options_t *self, int argc, char **argv)
{
    *self = (options_t){.mode = MODE_RUN};
    struct option known[USAGE_OPTIONS_MAX + 1];
    usage_options(&heaved_usage, known);
    opterr = 0;
    for (;;) {
        const int at = optind;
        const int option = getopt_long(argc, argv, ":", known, NULL);
        if (option < 0) {
            break;
        }
        const char *wrong = accept_option(self, option);
        if (wrong != NULL) {
            return complain(wrong, option == '?' || option == ':' ? argv[at] : NULL);
        }
    }
    if (self->mode == MODE_TEMPLATE && optind < argc) {
        self->template_driver = argv[optind++];
    }
    const char *wrong = NULL;
    while (self->mode == MODE_IMPORT_DCF && optind < argc && wrong == NULL) {
        wrong = accept_dcf(self, argv[optind++]);
    }
    if (wrong != NULL || optind < argc) {
        return wrong != NULL ? complain(wrong, NULL) : complain(_("unexpected argument"), argv[optind]);
    }
    wrong = contradiction(self);
    return wrong != NULL ? complain(wrong, NULL) : EXIT_DONE;
}
