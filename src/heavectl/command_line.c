/* SPDX-License-Identifier: MIT
 * command_line.c - what heavectl is asked for; see ctl.h.
 */
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/message.h" // exit codes
#include "common/nearest.h"
#include "common/translate.h"
#include "common/usage.h"
#include "heavectl/ctl.h"
#include "heavectl/identify.h"
#include "heavectl/socket.h"
#include "heavectl/command_usage.h"

#define FOR_MAX_S 1e9

/* Where a request leads to; NULL: nowhere that could be waited for. */
const char *ctl_destination(const char *command)
{
    static const char *const k_rows[][2] = {{"engage", "ENGAGED"}, {"resume", ""}, {"park", "SETTLED"}, {"shutdown", "OFF"}};
    for (size_t i = 0; i < sizeof k_rows / sizeof k_rows[0]; i++) {
        if (strcmp(k_rows[i][0], command) == 0) {
            return k_rows[i][1];
        }
    }
    return NULL;
}

static bool read_seconds(const char *text, double *out)
{
    char *end = NULL;
    *out = strtod(text, &end);
    return end != text && *end == '\0' && *out > 0.0 && *out < FOR_MAX_S;
}

static bool read_hz(const char *text, unsigned *out)
{
    char *end = NULL;
    const unsigned long value = strtoul(text, &end, 10);
    *out = (unsigned)value;
    return end != text && *end == '\0' && value >= 1 && value <= 50;
}

/* Takes an option; returns what is wrong with it, NULL if nothing is. */
static const char *accept_option(ctl_t *self, int option)
{
    switch (option) {
    case OPTION_JSON:
        self->is_json = true;
        break;
    case OPTION_SOCKET:
        self->socket = optarg;
        break;
    case OPTION_PLATFORM:
        self->platform = optarg;
        return socket_path_of_platform(self->path, SOCKET_DIRECTORY, optarg)
                   ? NULL
                   : _("--platform needs the NAME of a service heave@NAME, without a /");
    case OPTION_WAIT:
        self->is_waiting = true;
        break;
    case OPTION_FOR:
        return read_seconds(optarg, &self->for_s) ? NULL : _("--for needs a number of seconds above 0");
    case OPTION_AMPLITUDE:
        return read_seconds(optarg, &self->amplitude) ? NULL : _("--amplitude needs a number above 0, in mm or degrees");
    case OPTION_BAND:
        return identify_read_band(optarg, &self->from_hz, &self->to_hz)
                   ? NULL
                   : _("--band needs two frequencies in Hz, as in 0.2-20, at most 50");
    case OPTION_HZ:
        return read_hz(optarg, &self->hz) ? NULL : _("--hz needs a whole number from 1 to 50");
    case OPTION_SAVE:
        self->save = optarg;
        break;
    case OPTION_COMPARE:
        self->compare = optarg;
        break;
    case OPTION_EDS:
        self->eds = optarg;
        break;
    case OPTION_HELP:
        self->command = "help";
        break;
    case OPTION_VERSION:
        self->command = "version";
        break;
    default: /* getopt's own values: '?' and ':' */
        return option == ':' ? _("an option needs a value") : _("unknown option");
    }
    return NULL;
}

/* A number below zero is no option: getopt does not see its sign. */
#define HIDDEN_SIGN '\x01'

static void hide_signs(int argc, char **argv)
{
    for (int i = 1; i < argc; i++) {
        if (argv[i][0] == '-' && argv[i][1] != '\0' && strchr("0123456789.", argv[i][1]) != NULL) {
            argv[i][0] = HIDDEN_SIGN;
        }
    }
}

const char *ctl_parse_options(ctl_t *self, int argc, char **argv)
{
    struct option known[USAGE_OPTIONS_MAX + 1];
    usage_options(&heavectl_usage, known);
    hide_signs(argc, argv);
    opterr = 0;
    for (;;) {
        const int option = getopt_long(argc, argv, ":", known, NULL);
        if (option < 0) {
            return NULL;
        }
        const char *wrong = accept_option(self, option);
        if (wrong != NULL) {
            return wrong;
        }
    }
}

static const usage_row_t *find_command(const char *name)
{
    const usage_row_t *row = heavectl_usage.commands;
    while (!usage_is_end(row) && strcmp(name, row->name) != 0) {
        row++;
    }
    return usage_is_end(row) ? NULL : row;
}

static int words_in(const char *text)
{
    int words = text != NULL ? 1 : 0;
    for (; text != NULL && *text != '\0'; text++) {
        words += *text == ' ';
    }
    return words;
}

/* True where so many words fit: those in brackets, as [FILE], [TO_HZ], may be left out. */
static bool is_enough(const char *argument, int words)
{
    int least = words_in(argument);
    for (const char *at = argument; at != NULL && strchr(argument, ',') == NULL && *at != '\0'; at++) {
        least -= *at == '[';
    }
    return words >= least && words <= words_in(argument);
}

/* Takes the units off speed and way: heaved knows them by the axis.
 * Returns 'm' or 'd' as they began, '?' where there were both, '\0' where there were none. */
static int drop_units(char *words)
{
    static const char *const k_units[] = {"mm/s", "deg/s", "mm", "deg"};
    int seen = '\0';
    char *to = words;
    const char *word = words;
    for (bool is_last = *word == '\0'; !is_last;) {
        const size_t length = strcspn(word, " ");
        size_t kept = length;
        for (size_t i = 0; i < sizeof k_units / sizeof k_units[0] && kept == length; i++) {
            const size_t unit = strlen(k_units[i]);
            kept -= length > unit && memcmp(&word[length - unit], k_units[i], unit) == 0 ? unit : 0;
        }
        seen = kept == length ? seen : seen != '\0' && seen != word[kept] ? '?' : word[kept];
        is_last = word[length] == '\0';
        memmove(to, word, kept);
        to += kept;
        word += length + 1u;
        *to++ = is_last ? '\0' : ' ';
    }
    return seen;
}

/* Words that follow the command, with one blank between. */
static bool join(ctl_t *self, char *const *word, int count)
{
    size_t length = 0;
    for (int i = 0; i < count; i++) {
        if (word[i][0] == HIDDEN_SIGN) {
            word[i][0] = '-';
        }
        if (word[i][0] == '\0' || strpbrk(word[i], " \r\n") != NULL) {
            return false;
        }
        const int more = snprintf(&self->words[length], sizeof self->words - length, "%s%s", i > 0 ? " " : "", word[i]);
        length += (size_t)more;
        if (length >= sizeof self->words) {
            return false;
        }
    }
    self->argument = count > 0 ? self->words : NULL;
    return true;
}

/* Options that go with other commands, or not together; NULL: none. */
static const char *stray_option(const ctl_t *self, const char *command)
{
    if (self->is_waiting && ctl_destination(command) == NULL) {
        return _("--wait goes with engage, resume, park and shutdown");
    }
    if ((self->save != NULL || self->compare != NULL || self->eds != NULL) && strcmp(command, "drive") != 0) {
        return _("--save, --compare and --eds go with drive");
    }
    if (self->compare != NULL && (self->save != NULL || self->eds != NULL)) {
        return _("--save, with or without --eds, or --compare, not both");
    }
    return self->eds != NULL && self->save == NULL ? _("--eds goes with --save") : NULL;
}

/* The command that somebody has meant; NULL: none is near. */
static const char *nearest_command(const char *word)
{
    const char *nearest = NULL;
    unsigned least = UINT_MAX;
    for (const usage_row_t *row = heavectl_usage.commands; !usage_is_end(row); row++) {
        const unsigned slips = nearest_slips(word, row->name);
        if (slips < least && nearest_is_likely(slips, row->name)) {
            least = slips;
            nearest = row->name;
        }
    }
    return nearest;
}

/* There is none, or no such: names what is meant, else all there are. */
static const char *no_command(const char *word)
{
    static char wrong[1024];
    char all[512];
    const char *nearest = word != NULL ? nearest_command(word) : NULL;
    size_t length = 0;
    for (const usage_row_t *row = heavectl_usage.commands; !usage_is_end(row) && length < sizeof all; row++) {
        length += (size_t)snprintf(&all[length], sizeof all - length, "%s%s", length > 0 ? ", " : "", row->name);
    }
    if (word == NULL) {
        (void)snprintf(wrong, sizeof wrong, _("a command is needed; allowed: %s"), all);
    } else if (nearest != NULL) {
        (void)snprintf(wrong, sizeof wrong, _("unknown command \"%.200s\", the nearest is %s"), word, nearest);
    } else {
        (void)snprintf(wrong, sizeof wrong, _("unknown command \"%.200s\"; allowed: %s"), word, all);
    }
    return wrong;
}

const char *ctl_parse_command(ctl_t *self, int argc, char **argv)
{
    static char wrong[128];
    if (optind == argc) {
        return no_command(NULL);
    }
    const usage_row_t *row = find_command(argv[optind]);
    const int words = argc - optind - 1;
    if (row == NULL) {
        return no_command(argv[optind]);
    }
    const bool is_all_columns = strcmp(row->name, "scope") == 0 && words == 0;
    if (!is_all_columns && !is_enough(row->argument, words)) {
        (void)snprintf(wrong, sizeof wrong, _("%s needs %s"), row->name, row->argument);
        return strcmp(row->name, "intensity") == 0 ? _("intensity needs a whole number of percent, as in `heavectl intensity 50`")
               : row->argument != NULL             ? wrong
                                                   : _("one command is needed");
    }
    if (!join(self, &argv[optind + 1], words)) {
        return _("a word is empty, has a blank in it, or is too long");
    }
    const char *stray = stray_option(self, row->name);
    if (stray != NULL) {
        return stray;
    }
    self->command = row->name;
    if (strcmp(row->name, "jog") == 0) {
        self->unit = drop_units(self->words);
    }
    return NULL;
}

/* Whom to ask: what the command line names, then the environment, then what is there. */
int ctl_choose_socket(ctl_t *self)
{
    const char *environment = getenv("HEAVE_SOCKET");
    char platforms[512];
    if (self->socket != NULL) {
        return self->platform == NULL ? EXIT_DONE : ctl_complain(EXIT_BAD_USAGE, "--socket or --platform, not both");
    }
    self->socket = self->path;
    if (self->platform != NULL) {
        return EXIT_DONE;
    }
    if (environment != NULL && environment[0] != '\0') {
        self->socket = environment;
        return EXIT_DONE;
    }
    if (!ctl_socket_find(self->path, SOCKET_DIRECTORY, platforms, sizeof platforms)) {
        return ctl_complain(EXIT_BAD_USAGE, "several platforms run here: %s; say which: --platform NAME or --socket PATH",
                            platforms);
    }
    return EXIT_DONE;
}
