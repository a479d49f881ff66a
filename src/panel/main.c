/* SPDX-License-Identifier: MIT
 * main.c - heave-panel: the platforms of a box in a browser.
 */
#include <glob.h>
#include <libgen.h>
#include <limits.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <termios.h>
#include <unistd.h>

#include "common/message.h"
#include "common/translate.h" // exit codes
#include "panel/panel_options.h"
#include "panel/server.h"

#ifndef HEAVE_PANEL_WWW
#error "where the pages are installed"
#endif

#ifndef HEAVE_PANEL_HEAVED
#error "where heaved is installed"
#endif

#define WHY_MAX      256u
#define PASSWORD_MAX 256u
#define PLACE_MAX    (PATH_MAX + 16u)

static volatile sig_atomic_t is_ended; /* set by the signal handler, which can reach nothing else */

static void on_signal(int number)
{
    (void)number;
    is_ended = 1;
}

static int reject(int code, const char *why)
{
    fprintf(stderr, "heave-panel: %s\n", why);
    return code;
}

/* --- Passwords --- */

static bool read_password(char password[PASSWORD_MAX])
{
    struct termios usual, quiet;
    const bool is_terminal = tcgetattr(STDIN_FILENO, &usual) == 0;
    if (is_terminal) {
        quiet = usual;
        quiet.c_lflag &= (tcflag_t)~ECHO;
        fputs("Password: ", stderr);
        (void)tcsetattr(STDIN_FILENO, TCSAFLUSH, &quiet);
    }
    const bool is_read = fgets(password, (int)PASSWORD_MAX, stdin) != NULL;
    if (is_terminal) {
        (void)tcsetattr(STDIN_FILENO, TCSAFLUSH, &usual);
        fputs("\n", stderr);
    }
    if (is_read) {
        password[strcspn(password, "\r\n")] = '\0';
    }
    return is_read;
}

static int set_password(const char *state, const char *word)
{
    char password[PASSWORD_MAX] = "";
    char why[WHY_MAX];
    const int role = access_role(word);
    if (role < 0) {
        return reject(EXIT_BAD_USAGE, "passwd: the roles are look, operate and service");
    }
    const bool is_set = read_password(password) && access_set_password(state, (level_t)role, password, why, sizeof why);
    memset(password, 0, sizeof password);
    if (!is_set) {
        return reject(EXIT_BAD_CONFIG, why);
    }
    printf("heave-panel: the password of %s is set; restart heave-panel\n", word);
    return EXIT_DONE;
}

/* --- Platforms --- */

/* A name stands in messages as it is. */
static bool add(viewers_t *viewers, const char *name, size_t length, const char *path)
{
    static const char k_letters[] = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789-_.";
    char short_name[UPSTREAM_NAME_MAX];
    if (viewers->platforms == VIEWER_PLATFORMS || length == 0 || length >= sizeof short_name ||
        strspn(name, k_letters) < length) {
        return false;
    }
    (void)snprintf(short_name, sizeof short_name, "%.*s", (int)length, name);
    return upstream_init(&viewers->platform[viewers->platforms++], short_name, path, &server_upstream_calls);
}

/* Those of services, by their folders; and that of a heaved started by hand. */
static void add_found(viewers_t *viewers)
{
    glob_t found = {0};
    if (glob(SOCKET_DIRECTORY "/*/" SOCKET_NAME, 0, NULL, &found) == 0) {
        for (size_t i = 0; i < found.gl_pathc; i++) {
            const char *const name = found.gl_pathv[i] + strlen(SOCKET_DIRECTORY "/");
            (void)add(viewers, name, strcspn(name, "/"), found.gl_pathv[i]);
        }
    }
    globfree(&found);
    if (viewers->platforms == 0) {
        (void)add(viewers, "heave", strlen("heave"), SOCKET_DIRECTORY "/" SOCKET_NAME);
    }
}

static bool add_platforms(viewers_t *viewers, const panel_options_t *options)
{
    for (unsigned i = 0; i < options->platforms; i++) {
        const char *const equals = strchr(options->platform[i], '=');
        if (!add(viewers, options->platform[i], (size_t)(equals - options->platform[i]), equals + 1)) {
            return false;
        }
    }
    if (options->platforms == 0) {
        add_found(viewers);
    }
    return true;
}

static const char *state_of(const panel_options_t *options)
{
    const char *const given = getenv("STATE_DIRECTORY");
    return options->state != NULL ? options->state : given != NULL ? given : "/var/lib/heave-panel";
}

/* What is installed; where it is not, that of the build which this program is part of. */
static const char *installed_or_built(const char *installed, const char *name, char built[PLACE_MAX])
{
    char program[PATH_MAX];
    const ssize_t length = readlink("/proc/self/exe", program, sizeof program);
    if (access(installed, F_OK) == 0 || length <= 0 || length >= (ssize_t)sizeof program) {
        return installed;
    }
    program[length] = '\0';
    (void)snprintf(built, PLACE_MAX, "%s/%s", dirname(program), name);
    return access(built, F_OK) == 0 ? built : installed;
}

/* Who may come in, and where. */
static int read_access(const panel_options_t *options, listener_address_t *where, char proxy[ACCESS_ADDRESS_MAX],
                       access_t *access)
{
    static const char *const k_names[] = {"127.0.0.1", "localhost", "[::1]"};
    char why[WHY_MAX];
    if (!listener_read(where, options->listen)) {
        return reject(EXIT_BAD_USAGE, "--listen: written as 127.0.0.1:9801 or [::1]:9801, without names");
    }
    if (options->proxy != NULL && (!access_read_address(options->proxy, proxy) || strncmp(proxy, "::ffff:", 7) == 0)) {
        return reject(EXIT_BAD_USAGE, "--proxy: an address, written as 127.0.0.1 or ::1");
    }
    if (!access_load(access, state_of(options), why, sizeof why)) {
        return reject(EXIT_BAD_CONFIG, why);
    }
    if (!access->has_password && !listener_is_this_machine(where)) {
        return reject(EXIT_BAD_CONFIG, "--listen: other machines only once there is a password: heave-panel passwd service");
    }
    if (!access->has_password && options->proxy != NULL) {
        return reject(EXIT_BAD_CONFIG, "--proxy: only once there is a password: heave-panel passwd service");
    }
    for (unsigned i = 0; i < sizeof k_names / sizeof k_names[0]; i++) {
        (void)access_allow_host(access, k_names[i]);
    }
    (void)access_allow_host(access, where->host);
    for (unsigned i = 0; i < options->hosts; i++) {
        if (!access_allow_host(access, options->host[i])) {
            return reject(EXIT_BAD_USAGE, "--allow-host: too long");
        }
    }
    return EXIT_DONE;
}

static int serve(const panel_options_t *options)
{
    static access_t passwords;
    static pages_t pages;
    static upstream_t platform[VIEWER_PLATFORMS];
    static viewers_t viewers = {.platform = platform};
    static char built[2][PLACE_MAX];
    listener_address_t where;
    char why[WHY_MAX];
    char proxy[ACCESS_ADDRESS_MAX];
    const char *const www = options->www != NULL ? options->www : installed_or_built(HEAVE_PANEL_WWW, "../www", built[0]);
    const struct sigaction action = {.sa_handler = on_signal};
    server_t server = {.where = &where,
                       .certificate = options->certificate,
                       .key = options->key,
                       .proxy = options->proxy != NULL ? proxy : NULL,
                       .state = state_of(options),
                       .heaved =
                           options->heaved != NULL ? options->heaved : installed_or_built(HEAVE_PANEL_HEAVED, "heaved", built[1]),
                       .access = &passwords,
                       .pages = &pages,
                       .viewers = &viewers,
                       .version = HEAVE_VERSION};
    viewers.state = server.state;
    const int code = read_access(options, &where, proxy, &passwords);
    if (code != EXIT_DONE) {
        return code;
    }
    if (!pages_load(&pages, www, why, sizeof why)) {
        return reject(EXIT_BAD_CONFIG, why);
    }
    if (!add_platforms(&viewers, options)) {
        return reject(EXIT_BAD_USAGE, "--platform: NAME has 1 to 31 letters, digits, - _ or .");
    }
    (void)sigaction(SIGINT, &action, NULL);
    (void)sigaction(SIGTERM, &action, NULL);
    if (!server_open(&server)) {
        return EXIT_UNAVAILABLE;
    }
    while (is_ended == 0 && server_turn(true)) {}
    server_close();
    return EXIT_DONE;
}

int main(int argc, char **argv)
{
    panel_options_t options;
    const int code = panel_options_read(&options, argc, argv);
    if (code != EXIT_DONE) {
        return code;
    }
    (void)translate_begin_in("zh_CN"); /* for refusals: pages are in either language. Nothing else here is translated */
    if (options.is_help) {
        usage_print(&heave_panel_usage, stdout);
        return EXIT_DONE;
    }
    if (options.is_version) {
        printf("heave-panel %s\n", HEAVE_VERSION);
        return EXIT_DONE;
    }
    return options.password_of != NULL ? set_password(state_of(&options), options.password_of) : serve(&options);
}
