/* SPDX-License-Identifier: MIT
 * clock_trust.c - see clock_trust.h.
 */
#include "common/clock_trust.h"

#include <fcntl.h>
#include <stdlib.h>
#include <time.h>
#include <unistd.h>

#define APART_MAX_S (15 * 3600)

const clock_trust_files_t clock_trust_files = {.boot_id = "/proc/sys/kernel/random/boot_id",
                                               .clock_chip = "/sys/class/rtc/rtc0/since_epoch",
                                               .synchronised = "/run/systemd/timesync/synchronized"};

/* False where there is nothing to read. */
static bool read_text(const char *path, char text[64])
{
    const int fd = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOCTTY);
    const ssize_t length = fd >= 0 ? read(fd, text, 63) : -1;
    if (fd >= 0) {
        (void)close(fd);
    }
    text[length > 0 ? length : 0] = '\0';
    return length > 0;
}

/* The first 16 hexadecimal digits, with or without dashes. */
static uint64_t number_of(const char *id)
{
    uint64_t number = 0;
    unsigned digits = 0;
    for (; digits < 16 && *id != '\0'; id++) {
        const char one[2] = {*id, '\0'};
        char *end = NULL;
        const unsigned long digit = strtoul(one, &end, 16);
        if (end != one) {
            number = number << 4 | digit;
            digits++;
        } else if (*id != '-') {
            return 0;
        }
    }
    return digits == 16 ? number : 0;
}

uint64_t clock_boot(const clock_trust_files_t *files)
{
    char text[64];
    const char *given = getenv("HEAVE_BOOT_ID");
    return given != NULL ? number_of(given) : read_text(files->boot_id, text) ? number_of(text) : 0;
}

bool clock_is_trusted(const clock_trust_files_t *files)
{
    char text[64];
    if (access(files->synchronised, F_OK) == 0) {
        return true;
    }
    if (!read_text(files->clock_chip, text)) {
        return false;
    }
    const long long apart_s = strtoll(text, NULL, 10) - (long long)time(NULL);
    return apart_s > -APART_MAX_S && apart_s < APART_MAX_S;
}
