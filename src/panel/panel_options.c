/* SPDX-License-Identifier: MIT
 * panel_options.c - see panel_options.h.
 */
#include "panel/panel_options.h"

#include <string.h>

#include "common/message.h" // exit codes

enum {
    OPTION_HELP = 'h',
    OPTION_VERSION = 'V',
    OPTION_LISTEN = 256,
    OPTION_WWW,
    OPTION_STATE,
    OPTION_HEAVED,
    OPTION_PLATFORM,
    OPTION_HOST,
    OPTION_PROXY,
    OPTION_CERT,
    OPTION_KEY
};

static const usage_row_t k_forms[] = {
    {.argument = "[OPTION ...]", .help = "serve, until Ctrl-C"},
    {.argument = "[--state DIR] passwd look|operate|service", .help = "set the password of a role, read from standard input"},
    {0},
};

static const usage_row_t k_options[] = {
    {"listen", "ADDRESS:PORT", "where, such as [fd00::2]:9801; else 127.0.0.1:9801. Other machines only once there is a password",
     OPTION_LISTEN},
    {"platform", "NAME=SOCKET", "a heaved; else all of /run/heave. May be given again", OPTION_PLATFORM},
    {"allow-host", "NAME", "a name or address that browsers call it by, beside its own. May be given again", OPTION_HOST},
    {"proxy", "ADDRESS", "address of a reverse proxy; its X-Forwarded-For and X-Forwarded-Proto are believed", OPTION_PROXY},
    {"state", "DIR", "where passwords and configurations being edited are; else $STATE_DIRECTORY, else /var/lib/heave-panel",
     OPTION_STATE},
    {"www", "DIR", "its pages", OPTION_WWW},
    {"heaved", "PROGRAM", "heaved, which checks configurations that somebody edits; else the one that is installed",
     OPTION_HEAVED},
    {"tls-cert", "FILE", "certificate, for https; with --tls-key", OPTION_CERT},
    {"tls-key", "FILE", "its key", OPTION_KEY},
    {"help", NULL, "print this", OPTION_HELP},
    {"version", NULL, "print the version", OPTION_VERSION},
    {0},
};

static const usage_exit_t k_exits[] = {
    {EXIT_DONE, "ended by a signal"},
    {EXIT_BAD_USAGE, "wrong use"},
    {EXIT_BAD_CONFIG, "passwords or pages cannot be read, or --listen or --proxy needs a password"},
    {EXIT_UNAVAILABLE, "it cannot listen there, or its limit of open files is too low"},
    {0}};

static const usage_section_t k_manual[] = {
    {"DESCRIPTION",
     "Serves pages for a browser: what every platform of this machine does, the buttons of an operator, moves by hand, curves, "
     "incidents and the log of operators.\n\n"
     "It listens on this machine alone until a password is set: then for other machines too, by --listen. The roles are look, "
     "operate and service, as the levels of heaved's control socket. Hold is for all of them. Beyond a network of your own, use "
     "--tls-cert and --tls-key.\n\n"
     "It is a client of heaved. heaved does not need it, and stops what somebody moves by hand 250 ms after the last sign of "
     "that hand, whatever becomes of this program.\n"},
    {"EXAMPLES", "A password, and other machines:\n\n"
                 "  heave-panel --state /var/lib/heave-panel passwd operate\n"
                 "  heave-panel --listen 192.168.7.2:9801 --allow-host ride.local\n\n"
                 "Behind a reverse proxy of this machine, with TLS or below a path:\n\n"
                 "  heave-panel --proxy 127.0.0.1 --allow-host hall.example\n\n"
                 "A heaved that was started by hand:\n\n"
                 "  heave-panel --platform ride=/tmp/heaved.sock\n"},
    {"FILES",
     "/var/lib/heave-panel/passwords has a line for each role that has a password, hashed by crypt(5). staged-NAME.ini is the "
     "configuration of a platform as somebody edits it.\n"},
    {NULL, NULL},
};

const usage_t heave_panel_usage = {
    .program = "heave-panel",
    .manual_section = "8",
    .summary = "motion platforms in a browser, for operators",
    .forms = k_forms,
    .options = k_options,
    .notes = "What it can do, heavectl can do. heaved does not need it: it may die and come back at any time.",
    .exits = k_exits,
    .manual = k_manual,
    .see_also = "heaved(8), heavectl(1), crypt(5)",
};

static int complain(const char *what, const char *right)
{
    fprintf(stderr, "heave-panel: %s: %s; see --help\n", what, right);
    return EXIT_BAD_USAGE;
}

static int accept(panel_options_t *self, int option, const char *value)
{
    switch (option) {
    case OPTION_HELP:
        self->is_help = true;
        return EXIT_DONE;
    case OPTION_VERSION:
        self->is_version = true;
        return EXIT_DONE;
    case OPTION_LISTEN:
        self->listen = value;
        return EXIT_DONE;
    case OPTION_HEAVED:
        self->heaved = value;
        return EXIT_DONE;
    case OPTION_PLATFORM:
        if (self->platforms == OPTIONS_LIST_MAX || strchr(value, '=') == NULL) {
            return complain("--platform", "written as NAME=SOCKET, at most 16");
        }
        self->platform[self->platforms++] = value;
        return EXIT_DONE;
    case OPTION_HOST:
        if (self->hosts == OPTIONS_LIST_MAX) {
            return complain("--allow-host", "at most 16");
        }
        self->host[self->hosts++] = value;
        return EXIT_DONE;
    case OPTION_PROXY:
        if (self->proxy != NULL) {
            return complain("--proxy", "once");
        }
        self->proxy = value;
        return EXIT_DONE;
    case OPTION_STATE:
        self->state = value;
        return EXIT_DONE;
    case OPTION_WWW:
        self->www = value;
        return EXIT_DONE;
    case OPTION_CERT:
        self->certificate = value;
        return EXIT_DONE;
    case OPTION_KEY:
        self->key = value;
        return EXIT_DONE;
    default:
        return EXIT_BAD_USAGE;
    }
}

int panel_options_read(panel_options_t *self, int argc, char **argv)
{
    struct option options[USAGE_OPTIONS_MAX + 1];
    int option = 0;
    int code = EXIT_DONE;
    *self = (panel_options_t){.listen = "127.0.0.1:9801"};
    usage_options(&heave_panel_usage, options);
    while (code == EXIT_DONE && (option = getopt_long(argc, argv, "hV", options, NULL)) != -1) {
        code = accept(self, option, optarg);
    }
    if (code != EXIT_DONE) {
        return code;
    }
    if (optind + 2 == argc && strcmp(argv[optind], "passwd") == 0) {
        self->password_of = argv[optind + 1];
    } else if (optind != argc) {
        return complain(argv[optind], "only `passwd ROLE` is known");
    }
    return (self->certificate == NULL) == (self->key == NULL) ? EXIT_DONE : complain("--tls-cert and --tls-key", "only together");
}
