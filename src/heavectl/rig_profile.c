/* SPDX-License-Identifier: MIT
 * rig_profile.c - see rig_profile.h.
 */
#include "heavectl/rig_profile.h"

#include <dirent.h>
#include <errno.h>
#include <limits.h>
#include <spawn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include "common/message.h" // exit codes
#include "common/translate.h"

#define ENDING     ".ini"
#define FOLDER     ".d"
#define DIRECTORY  "/etc/heave"
#define ANSWER_MS  5000
#define NAME_BYTES 128u

/** Where the profiles of a platform are. */
typedef struct {
    const char *directory;
    char platform[NAME_BYTES];
    char active[NAME_BYTES]; /**< "": none, or the file is no link into the folder */
    char link[PATH_MAX];     /**< NAME.ini */
    char folder[PATH_MAX];   /**< NAME.d */
} place_t;

static bool ends_with(const char *text, const char *ending)
{
    const size_t length = strlen(text), end = strlen(ending);
    return length > end && strcmp(&text[length - end], ending) == 0;
}

static int is_profile(const struct dirent *entry)
{
    return entry->d_name[0] != '.' && ends_with(entry->d_name, ENDING);
}

static int is_folder(const struct dirent *entry)
{
    return entry->d_name[0] != '.' && ends_with(entry->d_name, FOLDER);
}

static void free_entries(struct dirent **entry, int count)
{
    for (int i = 0; i < count; i++) {
        free(entry[i]);
    }
    free(entry);
}

/* --- Which platform --- */

/* The only one that has profiles. Exit code; what is wrong was said. */
static int find_platform(place_t *place)
{
    struct dirent **entry = NULL;
    const int count = scandir(place->directory, &entry, is_folder, alphasort);
    int code = EXIT_DONE;
    if (count < 0 && errno != ENOENT) {
        code = ctl_complain(EXIT_NO_INPUT, "%s: %s", place->directory, error_text(errno));
    } else if (count == 1) {
        (void)snprintf(place->platform, sizeof place->platform, "%.*s", (int)(strlen(entry[0]->d_name) - strlen(FOLDER)),
                       entry[0]->d_name);
    } else if (count > 1) {
        code =
            ctl_complain(EXIT_BAD_USAGE, "several platforms have profiles in %s: say which, --platform NAME", place->directory);
    } else {
        code = ctl_complain(EXIT_NO_INPUT, "no platform has profiles: those of heave@NAME are the files in %s/NAME.d",
                            place->directory);
    }
    free_entries(entry, count);
    return code;
}

/* What NAME.ini leads to, if that is a profile. Exit code; what is wrong was said. */
static int find_active(place_t *place)
{
    char target[PATH_MAX];
    const ssize_t length = readlink(place->link, target, sizeof target - 1u);
    place->active[0] = '\0';
    if (length < 0 && errno != ENOENT && errno != EINVAL) { /* the latter: a file, and no link */
        return ctl_complain(EXIT_NO_INPUT, "%s: %s", place->link, error_text(errno));
    }
    if (length <= 0) {
        return EXIT_DONE;
    }
    target[length] = '\0';
    const char *slash = strrchr(target, '/');
    char folder[NAME_BYTES + 8u];
    (void)snprintf(folder, sizeof folder, "%s" FOLDER, place->platform);
    const char *before = slash;
    while (before != NULL && before > target && before[-1] != '/') {
        before--;
    }
    const bool is_in_folder =
        slash != NULL && (size_t)(slash - before) == strlen(folder) && memcmp(before, folder, strlen(folder)) == 0;
    if (is_in_folder && ends_with(slash + 1, ENDING) && strlen(slash + 1) < sizeof place->active) {
        (void)snprintf(place->active, sizeof place->active, "%.*s", (int)(strlen(slash + 1) - strlen(ENDING)), slash + 1);
    }
    return EXIT_DONE;
}

static int find(const ctl_t *self, place_t *place)
{
    const char *named = getenv("HEAVE_CONFIG_DIRECTORY");
    int code = EXIT_DONE;
    place->directory = named != NULL && named[0] != '\0' ? named : DIRECTORY;
    if (self->platform == NULL) {
        code = find_platform(place);
    } else if (strlen(self->platform) >= sizeof place->platform) {
        code = ctl_complain(EXIT_BAD_USAGE, "--platform: the name is too long");
    } else {
        (void)snprintf(place->platform, sizeof place->platform, "%s", self->platform);
    }
    const int link = snprintf(place->link, sizeof place->link, "%s/%s" ENDING, place->directory, place->platform);
    const int folder = snprintf(place->folder, sizeof place->folder, "%s/%s" FOLDER, place->directory, place->platform);
    if (code == EXIT_DONE && (link >= PATH_MAX || folder >= PATH_MAX)) {
        code = ctl_complain(EXIT_BAD_USAGE, "%s: the path is too long", place->directory);
    }
    return code == EXIT_DONE ? find_active(place) : code;
}

/* --- List --- */

static int list(const ctl_t *self, const place_t *place)
{
    struct dirent **entry = NULL;
    const int count = scandir(place->folder, &entry, is_profile, alphasort);
    if (count < 0) {
        return ctl_complain(EXIT_NO_INPUT, "%s: %s", place->folder, error_text(errno));
    }
    cJSON *profiles = cJSON_CreateArray();
    for (int i = 0; i < count; i++) {
        char *name = entry[i]->d_name;
        name[strlen(name) - strlen(ENDING)] = '\0';
        if (!self->is_json) {
            printf("%s %s\n", strcmp(name, place->active) == 0 ? "*" : " ", name);
        }
        (void)cJSON_AddItemToArray(profiles, cJSON_CreateString(name));
    }
    if (!self->is_json && place->active[0] == '\0') {
        printf(_("none is active: %s is no link into %s\n"), place->link, place->folder);
    }
    cJSON *all = cJSON_CreateObject();
    (void)cJSON_AddBoolToObject(all, "ok", true);
    (void)cJSON_AddStringToObject(all, "platform", place->platform);
    (void)cJSON_AddStringToObject(all, "active", place->active);
    (void)cJSON_AddItemToObject(all, "profiles", profiles);
    char *text = self->is_json ? cJSON_PrintUnformatted(all) : NULL;
    if (text != NULL) {
        printf("%s\n", text);
    }
    free(text);
    cJSON_Delete(all);
    free_entries(entry, count);
    return EXIT_DONE;
}

/* --- Change --- */

/* Runs a program to its end, with our output. Returns its exit status; -1: it could not be run, or was ended. */
static int run(char *const *word)
{
    pid_t child = 0;
    int status = 0;
    (void)fflush(stdout);
    if (posix_spawnp(&child, word[0], NULL, NULL, word, environ) != 0) {
        return -1;
    }
    while (waitpid(child, &status, 0) < 0) {
        if (errno != EINTR) {
            return -1;
        }
    }
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

/* heaved beside this program, else that of the path. */
static int check(char *file)
{
    char program[PATH_MAX] = "";
    const ssize_t length = readlink("/proc/self/exe", program, sizeof program - sizeof "/heaved");
    char *slash = length > 0 ? strrchr(program, '/') : NULL;
    if (slash != NULL) {
        (void)snprintf(slash, (size_t)(&program[sizeof program] - slash), "/heaved");
    }
    char *const words[] = {slash != NULL && access(program, X_OK) == 0 ? program : "heaved", "--config", file, "--check", NULL};
    char *const quiet[] = {"/bin/sh", "-c", "exec \"$0\" \"$@\" >/dev/null", words[0], words[1], words[2], words[3], NULL};
    const int code = run(quiet);
    return code == 0 ? EXIT_DONE : ctl_complain(EXIT_BAD_CONFIG, "%s: not taken; the profile stays as it is", file);
}

/* Whether heaved is in a state in which its machine may become another one.
 * @param is_running out */
static int may_change(ctl_t *self, bool *is_running)
{
    struct stat about;
    *is_running = false;
    if (stat(self->socket, &about) != 0 && errno == ENOENT) {
        return EXIT_DONE;
    }
    const int opened = ctl_open(self);
    if (opened != EXIT_DONE) {
        return opened;
    }
    const int sent = ctl_send(self, "status");
    const char *line = sent == EXIT_DONE ? ctl_receive(self, ctl_now_ms() + ANSWER_MS) : NULL;
    cJSON *status = line != NULL ? cJSON_Parse(line) : NULL;
    const cJSON *state = cJSON_GetObjectItemCaseSensitive(status, "state");
    const char *name = cJSON_IsString(state) ? state->valuestring : "?";
    const bool is_good = strcmp(name, "OFF") == 0 || strcmp(name, "SETTLED") == 0;
    *is_running = true;
    const int code = status == NULL ? ctl_not_heard(self, _("heaved does not answer"))
                     : is_good
                         ? EXIT_DONE
                         : ctl_complain(EXIT_REFUSED, "profile: the platform is in %s; possible in OFF and SETTLED: park first",
                                        translate(name));
    cJSON_Delete(status);
    return code;
}

/* The link is there or is the old one, at every moment. */
static int put_link(const place_t *place, const char *profile)
{
    char target[2u * NAME_BYTES + 16u], temporary[PATH_MAX + 8u];
    struct stat about;
    const bool is_there = lstat(place->link, &about) == 0;
    if (!is_there && errno != ENOENT) {
        return ctl_complain(EXIT_NO_INPUT, "%s: %s", place->link, error_text(errno));
    }
    if (is_there && !S_ISLNK(about.st_mode)) {
        return ctl_complain(EXIT_REFUSED, "%s is a file: move it into %s first, as one of the profiles", place->link,
                            place->folder);
    }
    (void)snprintf(target, sizeof target, "%s" FOLDER "/%s" ENDING, place->platform, profile);
    (void)snprintf(temporary, sizeof temporary, "%s.new", place->link);
    (void)unlink(temporary);
    if (symlink(target, temporary) != 0 || rename(temporary, place->link) != 0) {
        const int error = errno;
        (void)unlink(temporary);
        return ctl_complain(EXIT_NO_OUTPUT, "%s: %s%s", place->link, error_text(error),
                            error == EACCES ? _("; it takes root: sudo heavectl profile ...") : "");
    }
    return EXIT_DONE;
}

static int restart(const place_t *place)
{
    char unit[NAME_BYTES + 8u];
    (void)snprintf(unit, sizeof unit, "heave@%s", place->platform);
    char *const words[] = {"systemctl", "restart", unit, NULL};
    return run(words) == 0
               ? EXIT_DONE
               : ctl_complain(EXIT_UNAVAILABLE, "heaved still runs with the profile of before: systemctl restart %s", unit);
}

static int change(ctl_t *self, const place_t *place, const char *profile)
{
    char file[PATH_MAX + NAME_BYTES + 8u];
    bool is_running = false;
    (void)snprintf(file, sizeof file, "%s/%s" ENDING, place->folder, profile);
    if (strchr(profile, '/') != NULL || profile[0] == '.' || strlen(profile) >= NAME_BYTES ||
        (access(file, F_OK) != 0 && errno == ENOENT)) {
        return ctl_complain(EXIT_NO_INPUT, "profile: there is no %s; heavectl profile lists those that there are", file);
    }
    int code = check(file);
    code = code == EXIT_DONE ? may_change(self, &is_running) : code;
    code = code == EXIT_DONE ? put_link(place, profile) : code;
    code = code == EXIT_DONE && is_running ? restart(place) : code;
    if (code == EXIT_DONE && !self->is_json) {
        printf(_("profile: %s, %s\n"), profile, is_running ? _("and heaved runs with it") : _("from the next start"));
    }
    return code;
}

int profile_run(ctl_t *self)
{
    place_t place = {.directory = NULL};
    const int code = find(self, &place);
    if (code != EXIT_DONE) {
        return code;
    }
    if (self->argument == NULL) {
        return list(self, &place);
    }
    if (self->socket == NULL && !socket_path_of_platform(self->path, SOCKET_DIRECTORY, place.platform)) {
        return ctl_complain(EXIT_BAD_USAGE, "%s: no name of a platform", place.platform);
    }
    self->socket = self->socket == NULL ? self->path : self->socket;
    return change(self, &place, self->argument);
}
