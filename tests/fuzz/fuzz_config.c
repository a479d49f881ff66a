/* SPDX-License-Identifier: MIT
 * fuzz_config.c - configuration files. Input: the file.
 * What must hold: a wrong file changes nothing, and each of its errors is one printable line that names the file and a line of
 * it; what a right one is dumped to loads to the same configuration and dumps to the same text; a gateway starts with it.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

#include "config/config.h"
#include "platform/load.h"
#include "fuzz.h"
#include "heave/gateway.h"
#include "sim_drives.h"
#include "sim_inputs.h"
#include "sim_log.h"
#include "sim_relays.h"
#include "sim_udp.h"

#define CANARY 0x5A

/* A file in memory, and its path. */
typedef struct {
    int fd;
    char path[32];
} file_t;

static void write_file(file_t *self, const void *bytes, size_t length)
{
    if (self->fd == 0) {
        self->fd = memfd_create("fuzz", MFD_CLOEXEC);
        (void)snprintf(self->path, sizeof self->path, "/proc/self/fd/%d", self->fd);
    }
    FUZZ_REQUIRE(self->fd > 0 && ftruncate(self->fd, 0) == 0);
    FUZZ_REQUIRE(pwrite(self->fd, bytes, length, 0) == (ssize_t)length);
}

static long lines_of(const uint8_t *bytes, size_t length)
{
    long lines = 1;
    for (size_t i = 0; i < length; i++) {
        lines += bytes[i] == '\n';
    }
    return lines;
}

/* Bytes of a sign that an error may show as it is: plain ones, the degree sign, Chinese and Japanese writing and its punctuation
 * (U+3000 to U+9FFF, U+FF00 to U+FF3F). Returns 0 for any other. */
static size_t legible(const char *text)
{
    const unsigned char *byte = (const unsigned char *)text;
    if (byte[0] >= ' ' && byte[0] <= '~') {
        return 1;
    }
    if (byte[0] == 0xC2 && byte[1] == 0xB0) {
        return 2;
    }
    const bool is_lead = (byte[0] >= 0xE3 && byte[0] <= 0xE9) || (byte[0] == 0xEF && byte[1] == 0xBC);
    return is_lead && byte[1] >= 0x80 && byte[1] <= 0xBF && byte[2] >= 0x80 && byte[2] <= 0xBF ? 3 : 0;
}

/* Each error: `PATH:LINE: what is wrong`. */
static void check_errors(const char *text, const char *path, int errors, long lines)
{
    int found = 0;
    for (const char *line = text; *line != '\0'; found++) {
        const char *const end = strchr(line, '\n');
        char *behind = NULL;
        FUZZ_REQUIRE(end != NULL && strncmp(line, path, strlen(path)) == 0 && line[strlen(path)] == ':');
        const long number = strtol(line + strlen(path) + 1, &behind, 10);
        FUZZ_REQUIRE(number >= 1 && number <= lines && behind[0] == ':' && behind[1] == ' ' && behind + 2 < end);
        for (const char *c = behind; c < end; c += legible(c)) {
            FUZZ_REQUIRE(legible(c) > 0);
        }
        line = end + 1;
    }
    FUZZ_REQUIRE(found == errors);
}

/* Loads a file; out is as before where it is wrong. */
static int load(const file_t *file, long lines, config_t *out)
{
    char *text = NULL;
    size_t length = 0;
    static config_t before;
    FILE *errors = open_memstream(&text, &length);
    FUZZ_REQUIRE(errors != NULL);
    memset(out, CANARY, sizeof *out);
    memset(&before, CANARY, sizeof before);
    const int count = config_load(file->path, out, errors);
    (void)fclose(errors);
    check_errors(text, file->path, count, lines);
    FUZZ_REQUIRE(count == 0 || memcmp(out, &before, sizeof before) == 0);
    free(text);
    return count;
}

static char *dump(const config_t *config, size_t *length)
{
    char *text = NULL;
    FILE *out = open_memstream(&text, length);
    FUZZ_REQUIRE(out != NULL);
    config_dump(config, out);
    (void)fclose(out);
    return text;
}

static void check_dump(const config_t *config)
{
    static file_t file;
    static config_t again;
    size_t length = 0, second_length = 0;
    char *const first = dump(config, &length);
    write_file(&file, first, length);
    FUZZ_REQUIRE(load(&file, lines_of((const uint8_t *)first, length), &again) == 0);
    char *const second = dump(&again, &second_length);
    FUZZ_REQUIRE(length == second_length && memcmp(first, second, length) == 0);
    FUZZ_REQUIRE(memcmp(config, &again, sizeof again) == 0);
    free(first);
    free(second);
}

static void check_start(const config_t *config)
{
    static gateway_t gateway;
    static sim_drives_t drives;
    static sim_udp_t udp;
    static sim_relays_t relays;
    static sim_inputs_t inputs;
    static sim_log_t log;
    static sim_drive_config_t drive[DRIVES_MAX];
    const unsigned cylinders = config->settings.geometry.kind == KIN_HEXAPOD ? 6 : 3;
    const uint8_t count = (uint8_t)(cylinders + (config->settings.has_angle ? 1 : 0));
    for (unsigned i = 0; i < DRIVES_MAX; i++) {
        drive[i] = (sim_drive_config_t){.travel_max_q32 = Q32_ONE};
    }
    FUZZ_REQUIRE(sim_drives_init(&drives, count, drive, NULL, 0) == HV_OK);
    sim_udp_init(&udp);
    sim_relays_init(&relays, 12);
    sim_inputs_init(&inputs, INPUT_ESTOP);
    sim_log_init(&log);
    const gateway_io_t io = {.udp = sim_udp_hal(&udp),
                             .drives = sim_drives_hal(&drives),
                             .relays = sim_relays_hal(&relays),
                             .inputs = sim_inputs_hal(&inputs),
                             .log = sim_log_hal(&log)};
    FUZZ_REQUIRE(gateway_init(&gateway, &config->settings, &io) == HV_OK);
    for (uint64_t i = 1; i <= 3; i++) {
        gateway_cycle(&gateway, i * config->settings.cycle_us);
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static file_t file;
    static config_t config;
    write_file(&file, data, size);
    if (load(&file, lines_of(data, size), &config) == 0) {
        check_dump(&config);
        check_start(&config);
    }
    return 0;
}
