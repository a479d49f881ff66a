/* SPDX-License-Identifier: MIT
 * sim_chip.c - a GPIO chip that the kernel simulates; see sim_chip.h.
 */
#include "twin/sim_chip.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#define CONFIGFS      "/sys/kernel/config/gpio-sim"
#define OURS          "heave-twin-" /* a folder of ours: this, the process, the number of the chip */
#define PATH_MAX_HERE 256

static const char k_without[] =
    "this kernel simulates no GPIO lines. Load it (as root: modprobe gpio-sim; mount -t configfs none /sys/kernel/config, "
    "where that is not mounted), run all in heave-lab, or give --no-gpio";

static bool put(const char *folder, const char *name, const char *text)
{
    char path[PATH_MAX_HERE];
    (void)snprintf(path, sizeof path, "%s/%s", folder, name);
    const int fd = open(path, O_WRONLY | O_CLOEXEC);
    const bool is_written = fd >= 0 && write(fd, text, strlen(text)) == (ssize_t)strlen(text);
    const int error = errno;
    if (fd >= 0) {
        (void)close(fd);
    }
    errno = error;
    return is_written;
}

static void get(const char *folder, const char *name, char *text, size_t size)
{
    char path[PATH_MAX_HERE];
    (void)snprintf(path, sizeof path, "%s/%s", folder, name);
    const int fd = open(path, O_RDONLY | O_CLOEXEC);
    const ssize_t length = fd >= 0 ? read(fd, text, size - 1) : 0;
    text[length > 0 ? length : 0] = '\0';
    text[strcspn(text, "\n")] = '\0';
    if (fd >= 0) {
        (void)close(fd);
    }
}

static bool reject(const char *what, char *why, size_t size)
{
    const char *help = errno == EACCES || errno == EPERM ? "; it takes root" : "";
    (void)snprintf(why, size, "gpio-sim: %s: %s%s", what, strerror(errno), help);
    return false;
}

/* A folder of configfs goes from the inside to the outside; its attributes are no files of their own. */
static void remove_chip(const char *chip)
{
    char path[2 * PATH_MAX_HERE];
    char bank[PATH_MAX_HERE];
    (void)put(chip, "live", "0");
    (void)snprintf(bank, sizeof bank, "%s/bank", chip);
    DIR *lines = opendir(bank);
    for (const struct dirent *entry = NULL; lines != NULL && (entry = readdir(lines)) != NULL;) {
        if (strncmp(entry->d_name, "line", 4) == 0) {
            (void)snprintf(path, sizeof path, "%s/%s", bank, entry->d_name);
            (void)rmdir(path);
        }
    }
    if (lines != NULL) {
        (void)closedir(lines);
    }
    (void)rmdir(bank);
    (void)rmdir(chip);
}

void sim_chip_tidy(void)
{
    char path[2 * PATH_MAX_HERE];
    DIR *chips = opendir(CONFIGFS);
    for (const struct dirent *entry = NULL; chips != NULL && (entry = readdir(chips)) != NULL;) {
        const bool is_ours = strncmp(entry->d_name, OURS, strlen(OURS)) == 0;
        const long process = is_ours ? strtol(entry->d_name + strlen(OURS), NULL, 10) : 0;
        if (process > 0 && kill((pid_t)process, 0) != 0 && errno == ESRCH) {
            (void)snprintf(path, sizeof path, "%s/%s", CONFIGFS, entry->d_name);
            remove_chip(path);
        }
    }
    if (chips != NULL) {
        (void)closedir(chips);
    }
}

bool sim_chip_make(sim_chip_t *self, unsigned number, const char *label, unsigned lines, char *why, size_t size)
{
    char bank[PATH_MAX_HERE];
    char count[16];
    memset(self, 0, sizeof *self);
    (void)snprintf(self->folder, sizeof self->folder, "%s/%s%ld-%u", CONFIGFS, OURS, (long)getpid(), number);
    (void)snprintf(bank, sizeof bank, "%s/bank", self->folder);
    (void)snprintf(count, sizeof count, "%u", lines);
    if (access(CONFIGFS, F_OK) != 0) {
        (void)snprintf(why, size, "%s", k_without);
        return false;
    }
    if (mkdir(self->folder, 0755) != 0) {
        return reject("a chip", why, size);
    }
    self->is_made = true;
    if (mkdir(bank, 0755) != 0 || !put(bank, "num_lines", count) || !put(bank, "label", label)) {
        return reject(label, why, size);
    }
    return true;
}

bool sim_chip_name(const sim_chip_t *self, unsigned line, const char *name, char *why, size_t size)
{
    char folder[PATH_MAX_HERE];
    (void)snprintf(folder, sizeof folder, "%s/bank/line%u", self->folder, line);
    return (mkdir(folder, 0755) == 0 && put(folder, "name", name)) || reject(name, why, size);
}

static void *pull_out(void *ctx)
{
    const sim_chip_t *self = ctx;
    (void)put(self->folder, "live", "0");
    return NULL;
}

static void wait_until_out(sim_chip_t *self)
{
    if (self->is_leaving) {
        (void)pthread_join(self->thread, NULL);
        self->is_leaving = false;
    }
}

bool sim_chip_plug(sim_chip_t *self, bool is_live, char *why, size_t size)
{
    char bank[PATH_MAX_HERE];
    char device[32];
    char chip[32];
    wait_until_out(self);
    if (!is_live) {
        self->is_live = false;
        self->is_leaving = pthread_create(&self->thread, NULL, pull_out, self) == 0;
        return self->is_leaving || put(self->folder, "live", "0") || reject("pulling the chip out", why, size);
    }
    if (!put(self->folder, "live", "1")) {
        return reject("plugging the chip", why, size);
    }
    self->is_live = true;
    (void)snprintf(bank, sizeof bank, "%s/bank", self->folder);
    get(self->folder, "dev_name", device, sizeof device);
    get(bank, "chip_name", chip, sizeof chip);
    (void)snprintf(self->sysfs, sizeof self->sysfs, "/sys/devices/platform/%s/%s", device, chip);
    return true;
}

void sim_chip_drop(sim_chip_t *self)
{
    wait_until_out(self);
    if (self->is_made) {
        remove_chip(self->folder);
    }
    self->is_made = self->is_live = false;
}

int sim_chip_open(const sim_chip_t *self, unsigned line)
{
    char path[PATH_MAX_HERE];
    (void)snprintf(path, sizeof path, "%s/sim_gpio%u/value", self->sysfs, line);
    return open(path, O_RDONLY | O_CLOEXEC);
}

int sim_chip_level(int fd)
{
    char level = '?';
    return fd >= 0 && pread(fd, &level, 1, 0) == 1 && (level == '0' || level == '1') ? level - '0' : -1;
}

void sim_chip_pull(const sim_chip_t *self, unsigned line, bool is_up)
{
    char name[32];
    (void)snprintf(name, sizeof name, "sim_gpio%u/pull", line);
    (void)put(self->sysfs, name, is_up ? "pull-up" : "pull-down");
}
