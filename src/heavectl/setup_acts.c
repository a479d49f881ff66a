/* SPDX-License-Identifier: MIT
 * setup_acts.c - see setup_acts.h.
 */
#include "heavectl/setup_acts.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>

#include "common/atomic_file.h"
#include "common/columns.h"
#include "common/message.h" // exit codes
#include "common/translate.h"
#include "heavectl/setup_motion.h"

#define COLUMNS 78u

/* Bytes up to where a line may end next, and how wide they are. */
static size_t word_of(const char *text, size_t length, unsigned *columns)
{
    const char *previous = NULL;
    size_t at = 0;
    *columns = 0;
    while (at < length && text[at] != ' ' && !columns_may_break(previous, &text[at])) {
        const glyph_t glyph = columns_glyph(&text[at]);
        *columns += glyph.columns;
        previous = &text[at];
        at += glyph.bytes;
    }
    return at;
}

/* A line of words, broken where it has to be. */
static void print_words(const char *indent, const char *text, size_t length)
{
    const unsigned room = COLUMNS - columns_of(indent);
    unsigned column = 0, columns = 0;
    bool is_spaced = false;
    printf("%s", indent);
    for (size_t at = 0; at < length;) {
        const size_t word = word_of(&text[at], length - at, &columns);
        const bool is_broken = column > 0 && column + is_spaced + columns > room;
        printf("%s%s%s%.*s", is_broken ? "\n" : "", is_broken ? indent : "", is_spaced && !is_broken ? " " : "", (int)word,
               &text[at]);
        column = (is_broken ? 0 : column + is_spaced) + columns;
        at += word;
        is_spaced = at < length && text[at] == ' ';
        at += is_spaced ? 1u : 0;
    }
    printf("\n");
}

/* Lines that begin with a blank are drawings. */
void setup_print(const char *indent, const char *text)
{
    while (*text != '\0') {
        const size_t length = strcspn(text, "\n");
        if (*text == ' ') {
            printf("%.*s\n", (int)length, text);
        } else {
            print_words(indent, text, length);
        }
        text += length + (text[length] == '\n');
    }
    (void)fflush(stdout);
}

static bool fail(setup_session_t *session, const char *text)
{
    (void)snprintf(session->error, sizeof session->error, "%.2000s", text);
    return false;
}

static bool act_start(setup_session_t *session, const setup_t *setup, char result[SETUP_ANSWER_MAX])
{
    char kind[INI_VALUE_MAX], driver[INI_VALUE_MAX], rotation[INI_VALUE_MAX];
    static setup_t loaded;
    loaded = *setup;
    (void)snprintf(result, SETUP_ANSWER_MAX, "none");
    if (strcmp(setup_get(setup, "start"), "none") == 0) {
        return true;
    }
    if (!setup_session_load(session, &loaded)) {
        return false;
    }
    if (!ini_text_get(&loaded.start, "platform", "kind", kind)) {
        return fail(session, _("that file has no [platform] kind: \"back\", and another one"));
    }
    if (ini_text_get(&loaded.start, "angle", "present", rotation) && strcmp(rotation, "yes") == 0) {
        return fail(
            session,
            _("that platform has a rotation motor, which setup does not know yet: \"back\", and another one; its cylinders alone "
              "can be set up with [angle] present = no"));
    }
    const bool has_driver = ini_text_get(&loaded.start, "drives", "driver", driver);
    (void)snprintf(result, SETUP_ANSWER_MAX, "%.60s %.60s", kind, has_driver ? driver : "sim");
    return true;
}

/* heaved says it in the language of its reader, as this does. */
static bool names_exchange(const char *line, char result[SETUP_ANSWER_MAX])
{
    static const char *const k_sets[] = {"base", "plate"};
    char said[128];
    for (unsigned n = 0; n < 2u * SETUP_DRIVES_MAX * SETUP_DRIVES_MAX; n++) {
        const char *set = k_sets[n % 2u];
        const unsigned one = n / 2u / SETUP_DRIVES_MAX + 1u, other = n / 2u % SETUP_DRIVES_MAX + 1u;
        (void)snprintf(said, sizeof said, _("%s%u and %s%u look exchanged"), set, one, set, other);
        if (strstr(line, said) != NULL) {
            (void)snprintf(result, SETUP_ANSWER_MAX, "exchanged %s%u %s%u", set, one, set, other);
            return true;
        }
    }
    return false;
}

/* Lines of heaved without the name of a file that nobody knows; and what it names. */
static void show_errors(const setup_session_t *session, char exchanged[SETUP_ANSWER_MAX])
{
    char line[1024];
    exchanged[0] = '\0';
    for (const char *at = session->output; *at != '\0';) {
        const size_t length = strcspn(at, "\n");
        (void)snprintf(line, sizeof line, "%.*s", (int)length, at);
        at += length + (at[length] == '\n');
        const char *text = strstr(line, ".ini:");
        text = text != NULL ? text + 5 + strspn(text + 5, "0123456789: ") : line;
        setup_print("  ", text);
        (void)(exchanged[0] == '\0' && names_exchange(line, exchanged));
    }
}

static bool act_check(setup_session_t *session, const setup_t *setup, char result[SETUP_ANSWER_MAX])
{
    static ini_text_t config;
    const char *const options[] = {"--check", NULL};
    setup_configure(setup, SETUP_STAGE_GEOMETRY, NULL, &config);
    const int code = setup_session_run(session, &config, options);
    (void)snprintf(result, SETUP_ANSWER_MAX, "right");
    if (code == EXIT_DONE) {
        printf("%s\n", _("heaved finds nothing wrong with this mechanism."));
        return true;
    }
    if (code != EXIT_BAD_CONFIG) {
        return code < 0 ? false : fail(session, session->output);
    }
    show_errors(session, result);
    if (result[0] == '\0') {
        (void)snprintf(result, SETUP_ANSWER_MAX, "wrong");
    }
    return true;
}

/* Where a text begins as this format does. NULL: nowhere */
static const char *find(const char *text, const char *format)
{
    char beginning[128];
    (void)snprintf(beginning, sizeof beginning, "%.*s", (int)strcspn(format, "%"), format);
    return strstr(text, beginning);
}

/* The limits that follow, as --check has them. */
static bool act_limits(setup_session_t *session, const setup_t *setup, char result[SETUP_ANSWER_MAX])
{
    static ini_text_t config;
    const char *const options[] = {"--check", NULL};
    setup_configure(setup, SETUP_STAGE_FULL, NULL, &config);
    const int code = setup_session_run(session, &config, options);
    if (code < 0) {
        return false;
    }
    if (code != EXIT_DONE) {
        char exchanged[SETUP_ANSWER_MAX];
        show_errors(session, exchanged);
        return fail(session, _("heaved refuses this configuration; \"back\" leads to what has to be changed"));
    }
    char line[1024];
    const char *limits =
                   find(session->output,
                        _("limits that each axis alone can have with these cylinders (%.5g mm/s, %.5g mm/s^2, %d mm/s^3)\n")),
               *counts = find(session->output, _("counts of the drives"));
    (void)snprintf(line, sizeof line, "%.*s", counts != NULL ? (int)strcspn(counts, "\n") : 0, counts != NULL ? counts : "");
    setup_print("", line);
    for (const char *at = limits; at != NULL && *at != '\0'; at += *at == '\n') {
        const size_t length = strcspn(at, "\n");
        (void)snprintf(line, sizeof line, "%.*s", (int)length, at);
        setup_print(line[0] == ' ' ? "  " : "", line + strspn(line, " "));
        at += length;
    }
    (void)snprintf(result, SETUP_ANSWER_MAX, "shown");
    return true;
}

/* Bytes of a line of heaved --scan in front of the number of one that can be a drive; 0: it is another line. */
static size_t scanned(const char *line)
{
    const char *const formats[] = {_("node %u: drive, vendor 0x%X product 0x%X revision 0x%X serial 0x%X %s\n"),
                                   _("unit %u: answers\n")};
    for (size_t i = 0; i < sizeof formats / sizeof formats[0]; i++) {
        const size_t length = strcspn(formats[i], "%");
        if (strncmp(line, formats[i], length) == 0) {
            return length;
        }
    }
    return 0;
}

/* "/0x1A2B" behind an address: the fourth of the hexadecimal numbers of its line, where that is not 0. */
static size_t put_serial(const char *line, char *out, size_t size)
{
    const char *const end = line + strcspn(line, "\n"), *at = line;
    for (unsigned i = 0; i < 4u && at != NULL; i++) {
        at = strstr(at + (i > 0 ? 2 : 0), "0x");
    }
    const unsigned long serial = at != NULL && at < end ? strtoul(at, NULL, 16) : 0;
    return serial != 0 ? (size_t)snprintf(out, size, "/0x%lX", serial) : 0;
}

static bool act_scan(setup_session_t *session, const setup_t *setup, char result[SETUP_ANSWER_MAX])
{
    char bus[SETUP_ANSWER_MAX];
    size_t length = 0;
    const char *const options[] = {"--scan", bus, NULL};
    if (!setup_session_is_bus_free(session, setup)) {
        return false;
    }
    result[0] = '\0';
    if (!setup_bus(setup, bus)) {
        return fail(session, _("this bus cannot be scanned"));
    }
    printf(_("Looking who is on %s; this takes some seconds.\n"), bus);
    (void)fflush(stdout);
    const int code = setup_session_run(session, NULL, options);
    printf("%s", session->output);
    if (code != EXIT_DONE) {
        return code < 0 ? false : fail(session, _("the bus has to be right first, see above"));
    }
    for (const char *at = session->output; *at != '\0' && length < SETUP_ANSWER_MAX - 16u;) {
        const size_t words = scanned(at);
        if (words > 0) {
            char *end = NULL;
            length += (size_t)snprintf(&result[length], SETUP_ANSWER_MAX - length, "%s%lu", length > 0 ? "," : "",
                                       strtoul(at + words, &end, 10));
            length += put_serial(end, &result[length], SETUP_ANSWER_MAX - length);
        }
        at += strcspn(at, "\n");
        at += *at == '\n';
    }
    if (length == 0) {
        (void)snprintf(result, SETUP_ANSWER_MAX, "none");
    }
    return true;
}

/* --- The file --- */

const char *const setup_acts_foreign = N_("has come meanwhile, and setup does not change it: move it away first");

/* Setup itself says in the first line that it wrote it. */
bool setup_acts_may_write(const char *file)
{
    char line[256] = "";
    struct stat about;
    if (stat(file, &about) != 0) {
        return errno == ENOENT;
    }
    FILE *stream = S_ISREG(about.st_mode) ? fopen(file, "re") : NULL;
    const bool is_read = stream != NULL && fgets(line, sizeof line, stream) != NULL;
    if (stream != NULL) {
        (void)fclose(stream);
    }
    return is_read && line[0] == ';' && strstr(line, "heavectl") != NULL && strstr(line, "setup") != NULL;
}

static bool act_write(setup_session_t *session, const setup_t *setup, const char *file, char result[SETUP_ANSWER_MAX])
{
    static ini_text_t config;
    static atomic_file_t out;
    char report[SETUP_PATH_MAX], when[64], exchanged[SETUP_ANSWER_MAX];
    const char *const options[] = {"--check", NULL};
    const time_t now = time(NULL);
    struct tm local;
    setup_configure(setup, SETUP_STAGE_FULL, NULL, &config);
    const int code = setup_session_run(session, &config, options);
    if (code < 0) {
        return false;
    }
    if (code != EXIT_DONE) {
        show_errors(session, exchanged);
        return fail(session, _("heaved refuses this configuration; \"back\" leads to what has to be changed"));
    }
    if (!setup_acts_may_write(file)) {
        (void)snprintf(session->error, sizeof session->error, "%.1000s: %s", file, _(setup_acts_foreign));
        return false;
    }
    (void)strftime(when, sizeof when, "%Y-%m-%d %H:%M", localtime_r(&now, &local));
    if (!setup_write_report(setup, file, when, report)) {
        (void)snprintf(session->error, sizeof session->error, "%.1000s: %s", report, error_text(errno));
        return false;
    }
    const bool is_open = atomic_file_open(&out, file);
    if (is_open) {
        fprintf(out.stream, _("; Written by heavectl setup, %s. What was found and measured: %s\n"), when, report);
        fputs(config.text, out.stream);
    }
    if (!is_open || !atomic_file_close(&out)) {
        (void)snprintf(session->error, sizeof session->error, "%.1000s: %s", file, error_text(errno));
        return false;
    }
    (void)snprintf(result, SETUP_ANSWER_MAX, "written");
    printf(_("Written: %s, and the report %s (.html to print, .json for programs)\n"), file, report);
    return true;
}

bool setup_act(setup_session_t *session, const setup_t *setup, const setup_question_t *question, const char *file,
               char result[SETUP_ANSWER_MAX])
{
    switch (question->act) {
    case SETUP_ACT_START:
        return act_start(session, setup, result);
    case SETUP_ACT_CHECK:
        return act_check(session, setup, result);
    case SETUP_ACT_SCAN:
        return act_scan(session, setup, result);
    case SETUP_ACT_JOG:
        return setup_motion_jog(session, setup, question, result);
    case SETUP_ACT_HOME:
        return setup_motion_home(session, setup, question, result);
    case SETUP_ACT_COUNTS:
        return setup_motion_counts(session, setup, question, result);
    case SETUP_ACT_SAME:
        return setup_motion_same(session, setup, question, result);
    case SETUP_ACT_POSE:
        return setup_motion_pose(session, setup, question, result);
    case SETUP_ACT_LIMITS:
        return act_limits(session, setup, result);
    case SETUP_ACT_RELAY:
        return setup_motion_relay(session, setup, question, result);
    case SETUP_ACT_SWITCH:
        return setup_motion_switch(session, setup, question, result);
    case SETUP_ACT_RISE:
        return setup_motion_rise(session, setup, question, result);
    case SETUP_ACT_TILT:
        return setup_motion_tilt(session, setup, question, result);
    case SETUP_ACT_ENDS:
        return setup_motion_ends(session, setup, question, result);
    case SETUP_ACT_WRITE:
        return act_write(session, setup, file, result);
    case SETUP_ACT_NONE:
        break;
    }
    return fail(session, _("there is no such step"));
}
