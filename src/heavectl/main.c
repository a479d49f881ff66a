/* SPDX-License-Identifier: MIT
 * main.c - talks to a running heaved over its local socket: asks, shows, watches.
 */
#include <errno.h>
#include <signal.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#include "common/message.h" // exit codes
#include "common/presets.h"
#include "common/sentence.h"
#include "common/standard_descriptors.h"
#include "common/translate.h"
#include "common/usage.h"
#include "heavectl/configuration.h"
#include "heavectl/ctl.h"
#include "heavectl/drive_commands.h"
#include "heavectl/hold.h"
#include "heavectl/identify.h"
#include "heavectl/lists.h"
#include "heavectl/rig_profile.h"
#include "heavectl/scope.h"
#include "heavectl/selftest.h"
#include "heavectl/setup_dialog.h"
#include "heavectl/command_usage.h"
#include "heavectl/view.h"

#define ANSWER_MS     5000
#define DUMP_MS       60000 /* a slow disk */
#define DRIVE_MS      30000 /* a slow drive */
#define READY_MS      5000  /* drives that are being set up */
#define AGAIN_MS      100
#define TERMINAL_HZ   20u
#define PLAIN_HZ      1u
#define WATCH_REQUEST "watch 20" /* of who waits: HOLD may come after 100 ms */

/* When what goes on for a time ends: never before it is over, though this clock counts whole milliseconds. */
/* Standard output that took everything; EXIT_IO: it has not, and that was said. */
static int end_stdout(int code)
{
    if (code != EXIT_IO && (fflush(stdout) != 0 || ferror(stdout) != 0)) {
        return ctl_complain(EXIT_IO, "standard output: %s", error_text(errno));
    }
    return code;
}

/* Drives that are not there yet may be soon: they start, or are being set up. Whoever asks again says what it has heard, so that
 * a hold in between ends it. */
static bool is_to_ask_again(const ctl_t *self, const char *line, bool is_first, char *request, size_t size)
{
    char shown[SENTENCE_MAX];
    cJSON *answer = cJSON_Parse(line);
    const cJSON *why = cJSON_GetObjectItemCaseSensitive(answer, "why");
    const cJSON *tick = cJSON_GetObjectItemCaseSensitive(answer, "tick");
    const cJSON *error = cJSON_GetObjectItemCaseSensitive(answer, "error");
    const bool is_again = cJSON_IsString(why) && strcmp(why->valuestring, "not-ready") == 0 && cJSON_IsNumber(tick) &&
                          cJSON_IsString(error) && ctl_now_ms() < self->ready_by_ms;
    if (is_again) {
        (void)snprintf(request, size, "heard %.0f %s", tick->valuedouble, self->command);
        if (is_first) {
            fprintf(stderr, _("heavectl: %s; waiting\n"), sentence(error->valuestring, shown, sizeof shown));
        }
    }
    cJSON_Delete(answer);
    return is_again;
}

static int ask(ctl_t *self)
{
    static const struct timespec k_pause = {.tv_nsec = AGAIN_MS * 1000000};
    const int most_ms = strcmp(self->command, "dump") == 0 ? DUMP_MS : strcmp(self->command, "sdo") == 0 ? DRIVE_MS : ANSWER_MS;
    char request[80];
    (void)snprintf(request, sizeof request, "%s%s%s", self->command, self->argument != NULL ? " " : "",
                   self->argument != NULL ? self->argument : "");
    for (bool is_first = true;; is_first = false) {
        const int code = ctl_send(self, request);
        if (code != EXIT_DONE) {
            return code;
        }
        const char *line = ctl_receive(self, ctl_now_ms() + most_ms);
        if (line == NULL) {
            return ctl_not_heard(self, _("heaved does not answer"));
        }
        if (!is_to_ask_again(self, line, is_first, request, sizeof request)) {
            return ctl_show(self, line);
        }
        (void)nanosleep(&k_pause, NULL);
    }
}

/* --- Watching --- */

/* Returns false: heaved says no, which is left to show. */
static bool show_update(const ctl_t *self, const char *line, bool is_terminal)
{
    static char text[CTL_VIEW_BYTES];
    cJSON *status = cJSON_Parse(line);
    const bool is_refused = cJSON_IsFalse(cJSON_GetObjectItemCaseSensitive(status, "ok"));
    if (is_refused) {
        /* not here: the terminal's other screen goes away */
    } else if (self->is_json) {
        printf("%s\n", line);
    } else if (is_terminal) {
        ctl_show_table(status, true);
    } else {
        (void)ctl_view_line(status, text);
        printf("%s\n", text);
    }
    cJSON_Delete(status);
    return !is_refused;
}

/* Until time is up, Ctrl-C, the end of heaved, or a line in which it says no; that is left to show. */
static int follow(ctl_t *self, bool is_terminal)
{
    for (;;) {
        const char *line = ctl_receive(self, self->until_ms);
        if (line == NULL) {
            break;
        }
        if (!show_update(self, line, is_terminal)) {
            return EXIT_REFUSED;
        }
        if (fflush(stdout) != 0 && ctl_is_interrupted == 0) {
            return ctl_complain(EXIT_IO, "standard output: %s", error_text(errno));
        }
    }
    if (ctl_is_interrupted != 0) { /* Ctrl-C in the middle of a write is no fault of the terminal */
        clearerr(stdout);
    }
    return ctl_is_interrupted != 0 || ctl_now_ms() >= self->until_ms ? EXIT_DONE : EXIT_UNAVAILABLE;
}

static int watch(ctl_t *self)
{
    const bool is_terminal = !self->is_json && isatty(STDOUT_FILENO) != 0;
    const unsigned hz = self->hz != 0 ? self->hz : is_terminal || self->is_json ? TERMINAL_HZ : PLAIN_HZ;
    char request[24];
    ctl_catch_signals();
    (void)snprintf(request, sizeof request, "watch %u", hz);
    int code = ctl_send(self, request);
    if (code != EXIT_DONE) {
        return code;
    }
    if (is_terminal) {
        printf("\x1b[?1049h\x1b[?25l"); /* other screen, no cursor */
    }
    code = follow(self, is_terminal);
    if (is_terminal) {
        printf("\x1b[?25h\x1b[?1049l");
        (void)fflush(stdout);
    }
    if (code == EXIT_REFUSED) {
        return ctl_show(self, self->line);
    }
    return code == EXIT_UNAVAILABLE ? ctl_not_heard(self, _("heaved has ended")) : code;
}

/* --- Waiting for the end of what was asked for --- */

static const char *text_of(const cJSON *object, const char *name)
{
    const cJSON *item = cJSON_GetObjectItemCaseSensitive(object, name);
    return cJSON_IsString(item) ? item->valuestring : "?";
}

/* Whether a status is the end; code: what came of it. */
static bool has_ended(const ctl_t *self, const cJSON *status, int *code)
{
    const char *state = text_of(status, "state");
    const char *wanted = ctl_destination(self->command)[0] != '\0' ? ctl_destination(self->command) : text_of(status, "goal");
    const bool is_silent = cJSON_IsTrue(cJSON_GetObjectItemCaseSensitive(status, "held_by_silence"));
    *code = EXIT_DONE;
    if (strcmp(state, wanted) == 0 || (strcmp(wanted, "ENGAGED") == 0 && is_silent)) {
        return true;
    }
    if (strcmp(state, "FAULT") == 0 || strcmp(state, "ESTOP") == 0) {
        const cJSON *fault = cJSON_GetObjectItemCaseSensitive(status, "fault");
        *code = ctl_complain(EXIT_REFUSED, "%s: the platform is in %s (%s); heavectl status says more", self->command,
                             translate(state), ctl_own_words(fault, "text"));
        return true;
    }
    if (strcmp(state, "HOLD") == 0) {
        char shown[SENTENCE_MAX];
        *code = ctl_complain(EXIT_REFUSED, "%s: the platform was put on hold: %s; heavectl resume goes on", self->command,
                             sentence(text_of(status, "hold_reason"), shown, sizeof shown));
        return true;
    }
    return false;
}

static void show_end(const ctl_t *self, const cJSON *status)
{
    const bool is_alone = cJSON_IsTrue(cJSON_GetObjectItemCaseSensitive(status, "waiting_for_sender"));
    printf(_("%s: %s%s\n"), self->command, translate(text_of(status, "state")), is_alone ? _(", waiting for a sender") : "");
}

/* Until the state is there that was asked for, or cannot come any more. */
static int wait_for_end(ctl_t *self)
{
    const bool is_shutdown = strcmp(self->command, "shutdown") == 0;
    int code = ctl_send(self, WATCH_REQUEST);
    bool is_over = code != EXIT_DONE;
    while (!is_over) {
        const char *line = ctl_receive(self, self->until_ms);
        if (line == NULL) {
            const bool is_late = ctl_now_ms() >= self->until_ms;
            code = is_late       ? ctl_complain(EXIT_REFUSED, "%s: not done in time; it goes on", self->command)
                   : is_shutdown ? EXIT_DONE
                                 : ctl_not_heard(self, _("heaved has ended"));
            break;
        }
        cJSON *status = cJSON_Parse(line);
        is_over = !is_shutdown && has_ended(self, status, &code);
        if (is_over && code == EXIT_DONE && !self->is_json) {
            show_end(self, status);
        } else if (is_over && self->is_json) {
            printf("%s\n", line);
        }
        cJSON_Delete(status);
    }
    return code;
}

/* --- Samples --- */

static int scope(ctl_t *self)
{
    const scope_t scope = {.columns = self->argument,
                           .for_s = self->for_s,
                           .hz = self->hz != 0 ? self->hz : TERMINAL_HZ,
                           .is_terminal = isatty(STDOUT_FILENO) != 0,
                           .is_interrupted = &ctl_is_interrupted};
    char error[256] = "";
    ctl_catch_signals();
    int code = ctl_send(self, "samples");
    if (code != EXIT_DONE) {
        return code;
    }
    const int fd = scope_receive(self->fd, self->line, sizeof self->line);
    if (fd < 0) {
        return self->line[0] != '\0' ? ctl_show(self, self->line) : ctl_not_heard(self, _("heaved does not answer"));
    }
    code = scope_run(&scope, self->fd, fd, error, sizeof error);
    (void)close(fd);
    return code == EXIT_DONE ? code : ctl_complain(code, "%s", error);
}

/* --- Counts --- */

/* Once where the output is no terminal, else until Ctrl-C: somebody turns a spindle and looks at the number. */
static int watch_counts(ctl_t *self)
{
    const struct timespec pause = {.tv_nsec = 100000000};
    if (self->is_json || isatty(STDOUT_FILENO) == 0) {
        return ask(self);
    }
    ctl_catch_signals();
    printf("\x1b[2J");
    while (ctl_is_interrupted == 0 && ctl_now_ms() < self->until_ms) {
        printf("\x1b[H");
        const int code = ask(self);
        (void)fflush(stdout);
        if (code != EXIT_DONE) {
            return ctl_is_interrupted != 0 ? EXIT_DONE : code;
        }
        (void)nanosleep(&pause, NULL);
    }
    return EXIT_DONE;
}

/* --- By hand --- */

/* Whether an axis is led in degrees, as heaved has it where it is a number. Returns 'm' or 'd'; '\0': there is no such axis. */
static int unit_of(ctl_t *self, const char *axis)
{
    static const char *const k_turned[] = {"roll", "pitch", "yaw"}, *const k_led[] = {"x", "y", "z"};
    for (size_t i = 0; i < sizeof k_led / sizeof k_led[0]; i++) {
        if (strcmp(axis, k_turned[i]) == 0 || strcmp(axis, k_led[i]) == 0) {
            return strcmp(axis, k_turned[i]) == 0 ? 'd' : 'm';
        }
    }
    const char *line = ctl_send(self, "geometry") == EXIT_DONE ? ctl_receive(self, ctl_now_ms() + ANSWER_MS) : NULL;
    cJSON *geometry = line != NULL ? cJSON_Parse(line) : NULL;
    const int cylinders = cJSON_GetArraySize(cJSON_GetObjectItemCaseSensitive(geometry, "base_mm"));
    cJSON_Delete(geometry);
    const long number = strtol(axis, NULL, 10);
    return number < 1 || cylinders == 0 ? '\0' : number <= cylinders ? 'm' : 'd';
}

/* Degrees for a cylinder, or mm for a rotation, come from somebody who means another axis. */
static int check_unit(ctl_t *self)
{
    char axis[16];
    (void)snprintf(axis, sizeof axis, "%.*s", (int)strcspn(self->argument, " "), self->argument);
    const int is = self->unit == '\0' ? '\0' : unit_of(self, axis);
    if (is == '\0' || is == self->unit) {
        return EXIT_DONE;
    }
    return ctl_complain(EXIT_BAD_USAGE,
                        is == 'm' ? N_("jog %s: this axis moves in mm, not in degrees")
                                  : N_("jog %s: this axis turns in degrees, not in mm"),
                        axis);
}

static int hold(ctl_t *self)
{
    char request[160];
    const int wrong = check_unit(self);
    if (wrong != EXIT_DONE) {
        return wrong;
    }
    ctl_catch_signals();
    (void)snprintf(request, sizeof request, "%s %s", self->command, self->argument);
    return hold_run(self->fd, request, NULL, &ctl_is_interrupted);
}

static int selftest(ctl_t *self)
{
    ctl_catch_signals();
    return selftest_run(self->socket, self->argument, &ctl_is_interrupted);
}

/* An axis, and a file where there is a second word. */
static int identify(ctl_t *self)
{
    char *blank = strchr(self->words, ' ');
    identify_t what = {.axis = self->words,
                       .amplitude = self->amplitude,
                       .from_hz = self->from_hz,
                       .to_hz = self->to_hz,
                       .seconds = self->for_s,
                       .is_json = self->is_json,
                       .is_interrupted = &ctl_is_interrupted};
    if (blank != NULL) {
        *blank = '\0';
        what.file = blank + 1;
    }
    ctl_catch_signals();
    return identify_run(self->socket, &what);
}

static int carry_out(ctl_t *self)
{
    static const struct {
        const char *command;
        int (*run)(ctl_t *self);
    } k_rows[] = {
        {"watch", watch},         {"scope", scope},       {"config", configuration_run},
        {"counts", watch_counts}, {"selftest", selftest}, {"identify", identify},
        {"drive", drive_run},     {"jog", hold},          {"home", hold},
        {"relay", hold},          {"signal", hold},
    };
    for (size_t i = 0; i < sizeof k_rows / sizeof k_rows[0]; i++) {
        if (strcmp(self->command, k_rows[i].command) == 0) {
            return k_rows[i].run(self);
        }
    }
    return ask(self);
}

/* What asks no heaved, or looks for one by itself. */
static bool is_done_alone(ctl_t *self, int *code)
{
    if (strcmp(self->command, "presets") == 0) {
        *code = presets_list(stdout) >= 0 ? EXIT_DONE
                                          : ctl_complain(EXIT_UNAVAILABLE, "%s: %s", presets_directory(), error_text(errno));
    } else if (strcmp(self->command, "setup") == 0) {
        ctl_catch_signals();
        *code = setup_run(self->argument, &ctl_is_interrupted);
    } else if (strcmp(self->command, "profile") == 0) {
        *code = profile_run(self);
    } else {
        return false;
    }
    return true;
}

int main(int argc, char **argv)
{
    static ctl_t ctl;
    int code = EXIT_DONE;
    if (!standard_descriptors_open()) {
        return ctl_complain(EXIT_UNAVAILABLE, "the null device: %s", error_text(errno));
    }
    translate_begin();
    const char *wrong = ctl_parse_options(&ctl, argc, argv);
    if (wrong == NULL && ctl.command != NULL) {
        if (strcmp(ctl.command, "help") == 0) {
            usage_print(&heavectl_usage, stdout);
        } else {
            printf("heavectl " HEAVE_VERSION "\n");
        }
        return end_stdout(EXIT_DONE);
    }
    wrong = wrong == NULL ? ctl_parse_command(&ctl, argc, argv) : wrong;
    if (wrong != NULL) {
        return ctl_complain(EXIT_BAD_USAGE, "%s; see heavectl --help", wrong);
    }
    if (is_done_alone(&ctl, &code)) {
        return end_stdout(code);
    }
    const int64_t now_ms = ctl_now_ms();
    ctl.until_ms = ctl.for_s > 0.0 ? now_ms + (int64_t)(ctl.for_s * 1000.0) + 1 : INT64_MAX;
    ctl.ready_by_ms = ctl.for_s > 0.0 ? ctl.until_ms : now_ms + READY_MS;
    code = ctl_choose_socket(&ctl);
    code = code == EXIT_DONE ? ctl_open(&ctl) : code;
    if (code != EXIT_DONE) {
        return code;
    }
    code = carry_out(&ctl);
    return end_stdout(ctl.is_waiting && code == EXIT_DONE ? wait_for_end(&ctl) : code);
}
