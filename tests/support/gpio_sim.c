/* SPDX-License-Identifier: MIT
 * gpio_sim.c - GPIO chips that the kernel simulates; see gpio_sim.h.
 */
#include "gpio_sim.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#define CONFIGFS "/sys/kernel/config/gpio-sim"

static bool put(const char *folder, const char *name, const char *text)
{
    char path[256];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    FILE *file = fopen(path, "w");
    const bool is_written = file != NULL && fputs(text, file) >= 0;
    if (file != NULL && fclose(file) == 0 && is_written) {
        return true;
    }
    printf("# %s <- %s: %s\n", path, text, strerror(errno));
    return false;
}

static void get(const char *folder, const char *name, char *text, size_t size)
{
    char path[256];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    FILE *file = fopen(path, "r");
    text[0] = '\0';
    if (file != NULL) {
        text[fread(text, 1, size - 1, file)] = '\0';
        text[strcspn(text, "\n")] = '\0';
        fclose(file);
    }
}

static bool make_folder(char *path, size_t size, const char *in, const char *name)
{
    snprintf(path, size, "%s/%s", in, name);
    return mkdir(path, 0755) == 0 || errno == EEXIST;
}

static bool name_lines(const char *bank, unsigned lines, const char *prefix)
{
    for (unsigned i = 0; i < lines; i++) {
        char number[32], folder[256], name[64];
        snprintf(number, sizeof number, "line%u", i);
        snprintf(name, sizeof name, "%s%u", prefix, i);
        if (!make_folder(folder, sizeof folder, bank, number) || !put(folder, "name", name)) {
            return false;
        }
    }
    return true;
}

bool gpio_sim_make(gpio_sim_t *self, const char *name, const char *label, unsigned lines, const char *prefix)
{
    char bank[128], count[16], device[32], chip[32];
    memset(self, 0, sizeof *self);
    self->lines = lines;
    snprintf(count, sizeof count, "%u", lines);
    if (!make_folder(self->folder, sizeof self->folder, CONFIGFS, name) ||
        !make_folder(bank, sizeof bank, self->folder, "bank") || !put(bank, "num_lines", count) || !put(bank, "label", label) ||
        (prefix != NULL && !name_lines(bank, lines, prefix)) || !put(self->folder, "live", "1")) {
        return false;
    }
    get(self->folder, "dev_name", device, sizeof device);
    get(bank, "chip_name", chip, sizeof chip);
    snprintf(self->sysfs, sizeof self->sysfs, "/sys/devices/platform/%s/%s", device, chip);
    for (unsigned i = 0; i < lines; i++) {
        char path[256];
        snprintf(path, sizeof path, "%s/sim_gpio%u/value", self->sysfs, i);
        self->value[i] = open(path, O_RDONLY | O_CLOEXEC);
    }
    self->is_live = true;
    return true;
}

void gpio_sim_unplug(gpio_sim_t *self)
{
    for (unsigned i = 0; self->is_live && i < self->lines; i++) {
        (void)close(self->value[i]);
    }
    if (self->is_live) {
        (void)put(self->folder, "live", "0");
        self->is_live = false;
    }
}

void gpio_sim_drop(gpio_sim_t *self)
{
    char path[256];
    gpio_sim_unplug(self);
    for (unsigned i = 0; i < self->lines; i++) {
        snprintf(path, sizeof path, "%s/bank/line%u", self->folder, i);
        (void)rmdir(path);
    }
    snprintf(path, sizeof path, "%s/bank", self->folder);
    (void)rmdir(path);
    (void)rmdir(self->folder);
}

bool gpio_sim_level(const gpio_sim_t *self, unsigned line)
{
    char level = '0';
    (void)!pread(self->value[line], &level, 1, 0);
    return level == '1';
}

void gpio_sim_pull(const gpio_sim_t *self, unsigned line, bool is_up)
{
    char name[32];
    snprintf(name, sizeof name, "sim_gpio%u/pull", line);
    (void)put(self->sysfs, name, is_up ? "pull-up" : "pull-down");
}
