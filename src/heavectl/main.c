/* SPDX-License-Identifier: MIT
 * main.c - talks to a running heaved over its local socket: asks, shows, watches.
 */
#include <errno.h>
#include <langinfo.h>
#include <locale.h>
#include <poll.h>
#include <signal.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <time.h>
#include <unistd.h>

#include "common/message.h" // exit codes
#include "common/presets.h"
#include "common/standard_descriptors.h"
#include "common/usage.h"
#include "heavectl/hold.h"
#include "heavectl/lists.h"
#include "heavectl/scope.h"
#include "heavectl/selftest.h"
#include "heavectl/socket.h"
#include "heavectl/usage.h"
#include "heavectl/view.h"

#define ANSWER_MS     5000
#define DUMP_MS       60000 /* a slow disk */
#define WAIT_MS_MAX   1000  /* a signal between a look and a wait is seen by then */
#define LINE_BYTES    65536u
#define COLUMNS       80u
#define TERMINAL_HZ   20u
#define PLAIN_HZ      1u
#define FOR_MAX_S     1e9
#define WATCH_REQUEST "watch 20" /* of who waits: HOLD may come after 100 ms */

/** A run of the program. */
typedef struct {
    const char *command;
    const char *argument; /**< what follows the command, one blank between words; NULL: nothing */
    char words[64];       /**< of that */
    const char *socket;   /**< NULL = not named */
    const char *platform; /**< NULL = not named */
    char path[SOCKET_PATH_MAX];
    bool is_json;
    bool is_waiting; /* --wait */
    double for_s;    /**< 0 = until interrupted */
    unsigned hz;     /**< 0 = as it suits the output */
    int fd;
    int error; /**< why the system does not let it hear heaved, an errno; 0 = it does */
    char line[LINE_BYTES];
    size_t length;   /**< bytes in line */
    size_t consumed; /**< of those, given out already */
} ctl_t;

static volatile sig_atomic_t is_interrupted; /* set by the signal handler, which can reach nothing else */

static void on_signal(int signal_number)
{
    (void)signal_number;
    is_interrupted = 1;
}

static void catch_signals(void)
{
    const struct sigaction action = {.sa_handler = on_signal};
    (void)sigaction(SIGINT, &action, NULL);
    (void)sigaction(SIGTERM, &action, NULL);
    (void)sigaction(SIGHUP, &action, NULL);
}

static __attribute__((format(printf, 2, 3))) int complain(int code, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    fputs("heavectl: ", stderr);
    vfprintf(stderr, format, arguments);
    fputc('\n', stderr);
    va_end(arguments);
    return code;
}

/* Standard output that took everything; EXIT_IO: it has not, and that was said. */
static int end_stdout(int code)
{
    if (code != EXIT_IO && (fflush(stdout) != 0 || ferror(stdout) != 0)) {
        return complain(EXIT_IO, "standard output: %s", strerror(errno));
    }
    return code;
}

/* --- The link --- */

static int not_running(const ctl_t *self, int error)
{
    if (error == EACCES) {
        return complain(EXIT_UNAVAILABLE, "%s: no permission to talk to heaved; its user or group may", self->socket);
    }
    return complain(EXIT_UNAVAILABLE,
                    "heaved is not running at %s (%s): start it with `heaved --config FILE`, or give --socket PATH", self->socket,
                    strerror(error));
}

static int open_link(ctl_t *self)
{
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    if (strlen(self->socket) >= sizeof address.sun_path) {
        return complain(EXIT_BAD_USAGE, "%s: a socket's path has at most 107 characters", self->socket);
    }
    memcpy(address.sun_path, self->socket, strlen(self->socket));
    self->fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    if (self->fd < 0 || connect(self->fd, (const struct sockaddr *)&address, sizeof address) != 0) {
        return not_running(self, errno);
    }
    return EXIT_DONE;
}

/* Where heaved has closed the link, what it said before is still to be read. A signal that ends the program is the reader's to
 * see. */
static int send_line(const ctl_t *self, const char *request)
{
    char line[96];
    const int length = snprintf(line, sizeof line, "%s\n", request);
    ssize_t sent;
    do {
        sent = send(self->fd, line, (size_t)length, MSG_NOSIGNAL);
    } while (sent < 0 && errno == EINTR && is_interrupted == 0);
    if (sent < 0 && errno != EPIPE && errno != ECONNRESET && errno != EINTR) {
        return complain(EXIT_UNAVAILABLE, "heaved cannot be asked: %s", strerror(errno));
    }
    return EXIT_DONE;
}

static int64_t now_ms(void)
{
    struct timespec now;
    (void)clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000 + now.tv_nsec / 1000000;
}

/* Waits for bytes until the given time.
 * Returns false: time is up, a signal came that ends the program, or the system refuses to wait. */
static bool wait_for_bytes(ctl_t *self, int64_t until_ms)
{
    struct pollfd wait = {.fd = self->fd, .events = POLLIN};
    for (;;) {
        const int64_t left_ms = until_ms - now_ms();
        if (left_ms <= 0 || is_interrupted != 0) {
            return false;
        }
        const int ready = poll(&wait, 1, left_ms < WAIT_MS_MAX ? (int)left_ms : WAIT_MS_MAX);
        if (ready < 0 && errno != EINTR) {
            self->error = errno;
            return false;
        }
        if (ready > 0) {
            return true;
        }
    }
}

/* More bytes into the line, until the given time.
 * Returns false: as above, or the link is closed, or the line is longer than any answer. */
static bool receive_more(ctl_t *self, int64_t until_ms)
{
    const size_t room = sizeof self->line - 1 - self->length;
    if (room == 0 || !wait_for_bytes(self, until_ms)) {
        return false;
    }
    const ssize_t received = recv(self->fd, &self->line[self->length], room, 0);
    self->length += received > 0 ? (size_t)received : 0;
    if (received < 0 && errno != EINTR && errno != ECONNRESET) {
        self->error = errno;
    }
    return received > 0 || (received < 0 && errno == EINTR);
}

/* The next answer, ended by a NUL; NULL: none came. Valid until the next call. */
static const char *receive_line(ctl_t *self, int64_t until_ms)
{
    self->length -= self->consumed;
    memmove(self->line, &self->line[self->consumed], self->length);
    self->consumed = 0;
    char *newline = memchr(self->line, '\n', self->length);
    while (newline == NULL) {
        if (!receive_more(self, until_ms)) {
            return NULL;
        }
        newline = memchr(self->line, '\n', self->length);
    }
    *newline = '\0';
    self->consumed = (size_t)(newline + 1 - self->line);
    return self->line;
}

/* No answer, or no more of them.
 * Returns the exit code. */
static int not_heard(const ctl_t *self, const char *why)
{
    return self->error != 0 ? complain(EXIT_UNAVAILABLE, "heaved cannot be heard: %s", strerror(self->error))
                            : complain(EXIT_UNAVAILABLE, "%s", why);
}

/* --- Showing --- */

/* What the locale's variables say of a category. */
static const char *locale_of(const char *category)
{
    const char *const names[] = {"LC_ALL", category, "LANG"};
    for (size_t i = 0; i < sizeof names / sizeof names[0]; i++) {
        const char *value = getenv(names[i]);
        if (value != NULL && value[0] != '\0') {
            return value;
        }
    }
    return "";
}

/* The language of messages. */
static bool is_chinese(void)
{
    return strncmp(locale_of("LC_MESSAGES"), "zh", 2) == 0;
}

/* Also where the locale that is asked for was never made on this box: the terminal is what it is. */
static bool is_utf8(void)
{
    const char *codeset = strchr(locale_of("LC_CTYPE"), '.');
    return strcmp(nl_langinfo(CODESET), "UTF-8") == 0 ||
           (codeset != NULL && (strcasecmp(codeset, ".UTF-8") == 0 || strcasecmp(codeset, ".utf8") == 0));
}

/* On a terminal that knows them, unless NO_COLOR says otherwise (no-color.org). */
static bool is_coloured(void)
{
    const char *refused = getenv("NO_COLOR");
    const char *terminal = getenv("TERM");
    return isatty(STDOUT_FILENO) != 0 && (refused == NULL || refused[0] == '\0') &&
           (terminal == NULL || strcmp(terminal, "dumb") != 0);
}

static unsigned terminal_columns(void)
{
    struct winsize size;
    return ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col >= 20 ? size.ws_col : COLUMNS;
}

/* 0: it does not say. */
static unsigned terminal_rows(void)
{
    struct winsize size;
    return ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) == 0 ? size.ws_row : 0;
}

static void show_table(const cJSON *status, bool is_watching)
{
    static char text[CTL_VIEW_BYTES];
    const ctl_view_style_t style = {.columns = terminal_columns(),
                                    .rows = is_watching ? terminal_rows() : 0,
                                    .is_chinese = is_chinese(),
                                    .is_utf8 = is_utf8(),
                                    .is_coloured = is_coloured(),
                                    .line_end = is_watching ? "\x1b[K\r\n" : "\n"};
    (void)ctl_view_table(status, &style, text);
    printf("%s%s%s", is_watching ? "\x1b[H" : "", text, is_watching ? "\x1b[J" : "");
}

/* What heaved said no to.
 * Returns the exit code. */
static int judge(const cJSON *answer)
{
    const cJSON *error = cJSON_GetObjectItemCaseSensitive(answer, "error");
    if (cJSON_IsTrue(cJSON_GetObjectItemCaseSensitive(answer, "ok"))) {
        return EXIT_DONE;
    }
    return complain(EXIT_REFUSED, "%s", cJSON_IsString(error) ? error->valuestring : "heaved gave an answer that says nothing");
}

static void show_answer(const ctl_t *self, const cJSON *answer)
{
    const cJSON *state = cJSON_GetObjectItemCaseSensitive(answer, "state");
    const cJSON *folder = cJSON_GetObjectItemCaseSensitive(answer, "folder");
    if (cJSON_IsString(folder)) {
        printf("%s: %s\n", self->command, folder->valuestring);
    } else if (cJSON_IsArray(cJSON_GetObjectItemCaseSensitive(answer, "incidents"))) {
        lists_show_incidents(cJSON_GetObjectItemCaseSensitive(answer, "incidents"));
    } else if (strcmp(self->command, "status") == 0) {
        show_table(answer, false);
    } else if (cJSON_IsArray(cJSON_GetObjectItemCaseSensitive(answer, "drives"))) {
        lists_show_counts(answer);
    } else if (strcmp(self->command, "intensity") == 0) {
        const cJSON *percent = cJSON_GetObjectItemCaseSensitive(answer, "intensity_percent");
        printf("intensity: %.0f %%\n", cJSON_IsNumber(percent) ? percent->valuedouble : 0.0);
    } else {
        printf("%s: %s\n", self->command, cJSON_IsString(state) ? state->valuestring : "?");
    }
}

/* True where a request that brings the platform up has ended in FAULT or ESTOP at once: a script has to see that. */
static bool has_failed(const ctl_t *self, const cJSON *answer)
{
    const cJSON *state = cJSON_GetObjectItemCaseSensitive(answer, "state");
    const bool is_up =
        strcmp(self->command, "engage") == 0 || strcmp(self->command, "resume") == 0 || strcmp(self->command, "park") == 0;
    return is_up && cJSON_IsString(state) &&
           (strcmp(state->valuestring, "FAULT") == 0 || strcmp(state->valuestring, "ESTOP") == 0);
}

static int show(const ctl_t *self, const char *line)
{
    cJSON *answer = cJSON_Parse(line);
    if (self->is_json && !self->is_waiting) {
        printf("%s\n", line);
    }
    int code = judge(answer);
    if (code == EXIT_DONE && has_failed(self, answer)) {
        code = complain(EXIT_REFUSED, "%s: the platform is in %s; heavectl status says why", self->command,
                        cJSON_GetObjectItemCaseSensitive(answer, "state")->valuestring);
    }
    if (code == EXIT_DONE && !self->is_json && !self->is_waiting) {
        show_answer(self, answer);
    }
    cJSON_Delete(answer);
    return code;
}

static int ask(ctl_t *self)
{
    char request[80];
    (void)snprintf(request, sizeof request, "%s%s%s", self->command, self->argument != NULL ? " " : "",
                   self->argument != NULL ? self->argument : "");
    const int64_t until_ms = now_ms() + (strcmp(self->command, "dump") == 0 ? DUMP_MS : ANSWER_MS);
    const int code = send_line(self, request);
    if (code != EXIT_DONE) {
        return code;
    }
    const char *line = receive_line(self, until_ms);
    return line != NULL ? show(self, line) : not_heard(self, "heaved does not answer");
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
        show_table(status, true);
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
    const int64_t until_ms = self->for_s > 0.0 ? now_ms() + (int64_t)(self->for_s * 1000.0) : INT64_MAX;
    for (;;) {
        const char *line = receive_line(self, until_ms);
        if (line == NULL) {
            break;
        }
        if (!show_update(self, line, is_terminal)) {
            return EXIT_REFUSED;
        }
        if (fflush(stdout) != 0 && is_interrupted == 0) {
            return complain(EXIT_IO, "standard output: %s", strerror(errno));
        }
    }
    if (is_interrupted != 0) { /* Ctrl-C in the middle of a write is no fault of the terminal */
        clearerr(stdout);
    }
    return is_interrupted != 0 || now_ms() >= until_ms ? EXIT_DONE : EXIT_UNAVAILABLE;
}

static int watch(ctl_t *self)
{
    const bool is_terminal = !self->is_json && isatty(STDOUT_FILENO) != 0;
    const unsigned hz = self->hz != 0 ? self->hz : is_terminal || self->is_json ? TERMINAL_HZ : PLAIN_HZ;
    char request[24];
    catch_signals();
    (void)snprintf(request, sizeof request, "watch %u", hz);
    int code = send_line(self, request);
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
        return show(self, self->line);
    }
    return code == EXIT_UNAVAILABLE ? not_heard(self, "heaved has ended") : code;
}

/* --- Waiting for the end of what was asked for --- */

static const char *text_of(const cJSON *object, const char *name)
{
    const cJSON *item = cJSON_GetObjectItemCaseSensitive(object, name);
    return cJSON_IsString(item) ? item->valuestring : "?";
}

/* Where a request leads to; NULL: nowhere that could be waited for. */
static const char *destination(const char *command)
{
    static const char *const k_rows[][2] = {{"engage", "ENGAGED"}, {"resume", ""}, {"park", "SETTLED"}, {"shutdown", "OFF"}};
    for (size_t i = 0; i < sizeof k_rows / sizeof k_rows[0]; i++) {
        if (strcmp(k_rows[i][0], command) == 0) {
            return k_rows[i][1];
        }
    }
    return NULL;
}

/* Whether a status is the end; code: what came of it. */
static bool has_ended(const ctl_t *self, const cJSON *status, int *code)
{
    const char *state = text_of(status, "state");
    const char *wanted = destination(self->command)[0] != '\0' ? destination(self->command) : text_of(status, "goal");
    const bool is_silent = cJSON_IsTrue(cJSON_GetObjectItemCaseSensitive(status, "held_by_silence"));
    *code = EXIT_DONE;
    if (strcmp(state, wanted) == 0 || (strcmp(wanted, "ENGAGED") == 0 && is_silent)) {
        return true;
    }
    if (strcmp(state, "FAULT") == 0 || strcmp(state, "ESTOP") == 0) {
        const cJSON *fault = cJSON_GetObjectItemCaseSensitive(status, "fault");
        *code = complain(EXIT_REFUSED, "%s: the platform is in %s (%s); heavectl status says more", self->command, state,
                         text_of(fault, "text"));
        return true;
    }
    if (strcmp(state, "HOLD") == 0) {
        *code = complain(EXIT_REFUSED, "%s: somebody has asked for hold; heavectl resume goes on", self->command);
        return true;
    }
    return false;
}

static void show_end(const ctl_t *self, const cJSON *status)
{
    const bool is_alone = cJSON_IsTrue(cJSON_GetObjectItemCaseSensitive(status, "waiting_for_sender"));
    printf("%s: %s%s\n", self->command, text_of(status, "state"), is_alone ? ", waiting for a sender" : "");
}

/* Until the state is there that was asked for, or cannot come any more. */
static int wait_for_end(ctl_t *self)
{
    const int64_t until_ms = self->for_s > 0.0 ? now_ms() + (int64_t)(self->for_s * 1000.0) : INT64_MAX;
    const bool is_shutdown = strcmp(self->command, "shutdown") == 0;
    int code = send_line(self, WATCH_REQUEST);
    bool is_over = code != EXIT_DONE;
    while (!is_over) {
        const char *line = receive_line(self, until_ms);
        if (line == NULL) {
            const bool is_late = now_ms() >= until_ms;
            code = is_late       ? complain(EXIT_REFUSED, "%s: not done in time; it goes on", self->command)
                   : is_shutdown ? EXIT_DONE
                                 : not_heard(self, "heaved has ended");
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
                           .is_interrupted = &is_interrupted};
    char error[256] = "";
    catch_signals();
    int code = send_line(self, "samples");
    if (code != EXIT_DONE) {
        return code;
    }
    const int fd = scope_receive(self->fd, self->line, sizeof self->line);
    if (fd < 0) {
        return self->line[0] != '\0' ? show(self, self->line) : not_heard(self, "heaved does not answer");
    }
    code = scope_run(&scope, self->fd, fd, error, sizeof error);
    (void)close(fd);
    return code == EXIT_DONE ? code : complain(code, "%s", error);
}

/* --- Counts --- */

/* Once where the output is no terminal, else until Ctrl-C: somebody turns a spindle and looks at the number. */
static int watch_counts(ctl_t *self)
{
    const struct timespec pause = {.tv_nsec = 100000000};
    if (self->is_json || isatty(STDOUT_FILENO) == 0) {
        return ask(self);
    }
    catch_signals();
    const int64_t until_ms = self->for_s > 0.0 ? now_ms() + (int64_t)(self->for_s * 1000.0) : INT64_MAX;
    printf("\x1b[2J");
    while (is_interrupted == 0 && now_ms() < until_ms) {
        printf("\x1b[H");
        const int code = ask(self);
        (void)fflush(stdout);
        if (code != EXIT_DONE) {
            return is_interrupted != 0 ? EXIT_DONE : code;
        }
        (void)nanosleep(&pause, NULL);
    }
    return EXIT_DONE;
}

/* --- By hand --- */

static bool is_held(const ctl_t *self)
{
    return strcmp(self->command, "jog") == 0 || strcmp(self->command, "home") == 0 || strcmp(self->command, "relay") == 0;
}

static int hold(ctl_t *self)
{
    char request[80];
    catch_signals();
    (void)snprintf(request, sizeof request, "%s %s", self->command, self->argument);
    return hold_run(self->fd, request, NULL, &is_interrupted);
}

static int selftest(const ctl_t *self)
{
    catch_signals();
    return selftest_run(self->socket, self->argument, &is_interrupted);
}

/* --- The command line --- */

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
static const char *take_option(ctl_t *self, int option)
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
                   : "--platform needs the NAME of a service heave@NAME, without a /";
    case OPTION_WAIT:
        self->is_waiting = true;
        break;
    case OPTION_FOR:
        return read_seconds(optarg, &self->for_s) ? NULL : "--for needs a number of seconds above 0";
    case OPTION_HZ:
        return read_hz(optarg, &self->hz) ? NULL : "--hz needs a whole number from 1 to 50";
    case OPTION_HELP:
        self->command = "help";
        break;
    case OPTION_VERSION:
        self->command = "version";
        break;
    default: /* getopt's own values: '?' and ':' */
        return option == ':' ? "an option needs a value" : "unknown option";
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

static const char *take_options(ctl_t *self, int argc, char **argv)
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
        const char *wrong = take_option(self, option);
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

/* Takes a unit off the end of a speed: heaved knows it by the axis. */
static void drop_unit(char *words)
{
    static const char *const k_units[] = {"mm/s", "deg/s"};
    const size_t length = strlen(words);
    for (size_t i = 0; i < sizeof k_units / sizeof k_units[0]; i++) {
        const size_t unit = strlen(k_units[i]);
        if (length > unit && strcmp(&words[length - unit], k_units[i]) == 0) {
            words[length - unit] = '\0';
        }
    }
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

static const char *take_command(ctl_t *self, int argc, char **argv)
{
    static char wrong[128];
    if (optind == argc) {
        return "a command is needed: status, watch, engage, hold, resume, park, reset, shutdown, dump, acknowledge or intensity "
               "PERCENT";
    }
    const usage_row_t *row = find_command(argv[optind]);
    const int words = argc - optind - 1;
    if (row == NULL) {
        return "unknown command; status, watch, engage, hold, resume, park, reset, shutdown, dump, incidents, seen, acknowledge, "
               "intensity, service, service-off, counts, torque, jog, home, relay, selftest, scope and presets are allowed";
    }
    const bool is_all_columns = strcmp(row->name, "scope") == 0 && words == 0;
    const bool is_without_file = strcmp(row->name, "selftest") == 0 && words == 0;
    if (!is_all_columns && !is_without_file && words != words_in(row->argument)) {
        (void)snprintf(wrong, sizeof wrong, "%s needs %s", row->name, row->argument);
        return strcmp(row->name, "intensity") == 0 ? "intensity needs a whole number of percent, as in `heavectl intensity 50`"
               : row->argument != NULL             ? wrong
                                                   : "one command is needed";
    }
    if (!join(self, &argv[optind + 1], words)) {
        return "a word is empty, has a blank in it, or is too long";
    }
    if (self->is_waiting && destination(row->name) == NULL) {
        return "--wait goes with engage, resume, park and shutdown";
    }
    self->command = row->name;
    if (strcmp(row->name, "jog") == 0) {
        drop_unit(self->words);
    }
    return NULL;
}

/* Whom to ask: what the command line names, then the environment, then what is there. */
static int choose_socket(ctl_t *self)
{
    const char *environment = getenv("HEAVE_SOCKET");
    char platforms[512];
    if (self->socket != NULL) {
        return self->platform == NULL ? EXIT_DONE : complain(EXIT_BAD_USAGE, "--socket or --platform, not both");
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
        return complain(EXIT_BAD_USAGE, "several platforms run here: %s; say which: --platform NAME or --socket PATH", platforms);
    }
    return EXIT_DONE;
}

static int carry_out(ctl_t *self)
{
    return strcmp(self->command, "watch") == 0      ? watch(self)
           : strcmp(self->command, "scope") == 0    ? scope(self)
           : strcmp(self->command, "counts") == 0   ? watch_counts(self)
           : strcmp(self->command, "selftest") == 0 ? selftest(self)
           : is_held(self)                          ? hold(self)
                                                    : ask(self);
}

int main(int argc, char **argv)
{
    static ctl_t ctl;
    if (!standard_descriptors_open()) {
        return complain(EXIT_UNAVAILABLE, "the null device: %s", strerror(errno));
    }
    (void)setlocale(LC_CTYPE, "");
    const char *wrong = take_options(&ctl, argc, argv);
    if (wrong == NULL && ctl.command != NULL) {
        if (strcmp(ctl.command, "help") == 0) {
            usage_print(&heavectl_usage, stdout);
        } else {
            printf("heavectl " HEAVE_VERSION "\n");
        }
        return end_stdout(EXIT_DONE);
    }
    wrong = wrong == NULL ? take_command(&ctl, argc, argv) : wrong;
    if (wrong != NULL) {
        return complain(EXIT_BAD_USAGE, "%s; see heavectl --help", wrong);
    }
    if (strcmp(ctl.command, "presets") == 0) {
        return presets_list(stdout) >= 0 ? end_stdout(EXIT_DONE)
                                         : complain(EXIT_UNAVAILABLE, "%s: %s", presets_directory(), strerror(errno));
    }
    int code = choose_socket(&ctl);
    code = code == EXIT_DONE ? open_link(&ctl) : code;
    if (code != EXIT_DONE) {
        return code;
    }
    code = carry_out(&ctl);
    return end_stdout(ctl.is_waiting && code == EXIT_DONE ? wait_for_end(&ctl) : code);
}
