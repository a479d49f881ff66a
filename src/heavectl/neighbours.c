/* SPDX-License-Identifier: MIT
 * neighbours.c - see neighbours.h.
 */
#include "heavectl/neighbours.h"

#include <ctype.h>
#include <dirent.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/translate.h"
#include "setup/ini_text.h"

#define COMMAND_MAX 8192u

/* The words of a command line, each ended by a NUL. @return bytes; 0: it is no heaved */
static size_t read_command(const char *pid, char command[COMMAND_MAX])
{
    char path[64];
    (void)snprintf(path, sizeof path, "/proc/%.20s/cmdline", pid);
    FILE *file = fopen(path, "re");
    if (file == NULL) {
        return 0;
    }
    const size_t length = fread(command, 1, COMMAND_MAX - 1u, file);
    (void)fclose(file);
    command[length] = '\0';
    const char *slash = strrchr(command, '/');
    return strcmp(slash != NULL ? slash + 1 : command, "heaved") == 0 ? length : 0;
}

/* The word behind --config; NULL: it runs no platform. */
static const char *config_of(const char *command, size_t length)
{
    const char *found = NULL;
    for (const char *word = command; word < command + length; word += strlen(word) + 1u) {
        if (strcmp(word, "--config") == 0) {
            found = word + strlen(word) + 1u;
        } else if (strncmp(word, "--config=", 9) == 0) {
            found = word + 9;
        } else if (strcmp(word, "--check") == 0 || strcmp(word, "--play") == 0) {
            return NULL;
        }
    }
    return found;
}

/* As heaved itself would read it. */
static bool read_config(const char *pid, const char *path, ini_text_t *out)
{
    char inside[4200];
    (void)snprintf(inside, sizeof inside, path[0] == '/' ? "/proc/%.20s/root%s" : "/proc/%.20s/cwd/%s", pid, path);
    return ini_text_read(out, inside) || (path[0] == '/' && ini_text_read(out, path));
}

/* What was applied over the file is in the state directory of that heaved. @return false: errno says why; ENOENT: there is none
 */
static bool read_applied(const char *pid, ini_text_t *out)
{
    static const char k_name[] = "STATE_DIRECTORY=/";
    char path[4200];
    char *word = NULL;
    size_t size = 0;
    bool is_found = false;
    (void)snprintf(path, sizeof path, "/proc/%.20s/environ", pid);
    FILE *file = fopen(path, "re");
    if (file == NULL) {
        return false;
    }
    errno = 0;
    while (!is_found && getdelim(&word, &size, '\0', file) >= 0) {
        is_found = strncmp(word, k_name, sizeof k_name - 1u) == 0;
    }
    int error = is_found || errno == 0 ? ENOENT : errno;
    (void)fclose(file);
    if (is_found) {
        const char *folder = word + sizeof k_name - 2u;
        (void)snprintf(path, sizeof path, "/proc/%.20s/root%.*s/configuration.ini", pid, (int)strcspn(folder, ":"), folder);
        is_found = ini_text_read(out, path);
        error = errno;
    }
    free(word);
    errno = error;
    return is_found;
}

static bool is_same_bus(const ini_text_t *config, const char *driver, const char *bus)
{
    char value[INI_VALUE_MAX];
    const bool is_can = strcmp(driver, "cia402") == 0 || strcmp(driver, "can-raw") == 0;
    if (!ini_text_get(config, "drives", "driver", value) || strcmp(value, "sim") == 0) {
        return false;
    }
    const bool has_can = strcmp(value, "cia402") == 0 || strcmp(value, "can-raw") == 0;
    if (is_can != has_can || (!is_can && strcmp(value, driver) != 0)) {
        return false;
    }
    if (is_can) {
        return strcmp(ini_text_get(config, "can", "interface", value) ? value : "can0", bus) == 0;
    }
    return ini_text_get(config, driver, strcmp(driver, "modbus-rtu") == 0 ? "device" : "hosts", value) && strcmp(value, bus) == 0;
}

typedef enum { BUS_FREE, BUS_TAKEN, BUS_HIDDEN } bus_t;

/* Either of its two files may be in force, and what may not be read may have the bus. */
static bus_t look_at(const char *pid, const char *path, const char *driver, const char *bus)
{
    static ini_text_t config;
    bool is_read = read_config(pid, path, &config);
    if (!is_read && errno != EACCES && errno != EPERM) {
        return BUS_FREE; /* its file is gone, and it with it, or soon: a master that goes on is heard by --scan */
    }
    if (is_read && !is_same_bus(&config, driver, bus)) {
        is_read = read_applied(pid, &config);
        if (!is_read && errno != EACCES && errno != EPERM) {
            return BUS_FREE;
        }
        return !is_read ? BUS_HIDDEN : is_same_bus(&config, driver, bus) ? BUS_TAKEN : BUS_FREE;
    }
    return is_read ? BUS_TAKEN : BUS_HIDDEN;
}

/* NULL: the end, or errno is not 0. */
static const struct dirent *next_of(DIR *processes)
{
    errno = 0;
    return readdir(processes);
}

/* Whoever cannot see whether there is another master does not become one. */
static bool cannot_look(char *text, size_t size)
{
    (void)snprintf(text, size, _("whether heaved is running on this bus already cannot be seen: /proc: %s"), error_text(errno));
    return true;
}

bool neighbours_have(const char *driver, const char *bus, char *text, size_t size)
{
    static char command[COMMAND_MAX];
    bool is_found = false;
    DIR *processes = opendir("/proc");
    if (processes == NULL) {
        return cannot_look(text, size);
    }
    for (const struct dirent *entry = next_of(processes); entry != NULL && !is_found; entry = next_of(processes)) {
        const size_t length = isdigit((unsigned char)entry->d_name[0]) ? read_command(entry->d_name, command) : 0;
        const char *path = length > 0 ? config_of(command, length) : NULL;
        if (path == NULL) {
            continue;
        }
        const bus_t found = look_at(entry->d_name, path, driver, bus);
        is_found = found != BUS_FREE;
        if (is_found) {
            (void)snprintf(
                text, size,
                found == BUS_TAKEN
                    ? _("heaved is running on this bus already (process %s, %s). Two masters on one bus must not be: stop it "
                        "first, as in `systemctl stop heave@NAME`")
                    : _("heaved is running (process %s) on a configuration that you may not read (%s): it may have this bus. "
                        "Stop it first, or run setup as root"),
                entry->d_name, path);
        }
    }
    is_found = is_found || (errno != 0 && cannot_look(text, size));
    (void)closedir(processes);
    return is_found;
}
