/* SPDX-License-Identifier: MIT
 * main.c - heaved: reads the command line and the configuration, then runs what was asked for.
 */
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "config.h"
#include "dbc.h"
#include "doctor.h"
#include "envelope_csv.h"
#include "gpio_setup.h"
#include "heave/gateway.h"
#include "live.h"
#include "options.h"
#include "play.h"
#include "say.h"
#include "usage.h"
#include "whole_file.h"

void hv_assert_failed(const char *file, int line)
{
    (void)say(0, "%s:%d: assertion failed, this is a bug", file, line);
    abort();
}

/* Whether the file can be read at all, before its contents are looked at. */
static bool is_readable(const char *path)
{
    char byte;
    const int fd = open(path, O_RDONLY | O_CLOEXEC);
    const bool is_read = fd >= 0 && read(fd, &byte, 1) >= 0;
    const int error = errno;
    if (fd >= 0) {
        (void)close(fd);
    }
    errno = error;
    return is_read;
}

/* Standard output that took everything. */
static int end_stdout(int code)
{
    if (fflush(stdout) != 0 || ferror(stdout) != 0) {
        return say(EXIT_IO, "standard output: %s", strerror(errno));
    }
    return code;
}

static int dump_dbc(const options_t *options, const config_t *config)
{
    if (config->drives != CONFIG_DRIVES_CAN_RAW) {
        return say(EXIT_BAD_CONFIG, "%s: [drives] driver: has no frames of its own; allowed for --dump-dbc: can-raw",
                   options->config);
    }
    dbc_write(config, stdout);
    return end_stdout(EXIT_DONE);
}

static int write_envelope(const char *path, const config_t *config)
{
    static envelope_t envelope;
    static whole_file_t file;
    if (!envelope_find(&envelope, &config->settings)) {
        return EXIT_SOFTWARE; /* not a configuration that config_load() accepted */
    }
    if (!whole_file_open(&file, path)) {
        return say(EXIT_NO_OUTPUT, "%s: %s", path, strerror(errno));
    }
    envelope_csv_write(&envelope, file.stream);
    if (!whole_file_close(&file)) {
        return say(EXIT_IO, "%s: %s", path, strerror(errno));
    }
    return EXIT_DONE;
}

static int run(const options_t *options, const config_t *config)
{
    switch (options->mode) {
    case MODE_RUN:
        return live_run(config, options);
    case MODE_PLAY:
        return play_run(config, options->play, options->trace);
    case MODE_CHECK:
        (void)config_check_report(config, sizeof(gateway_t), stdout);
        (void)gpio_setup_check(config, stdout);
        return end_stdout(EXIT_DONE);
    case MODE_ENVELOPE:
        return write_envelope(options->envelope, config);
    case MODE_DOCTOR:
        return end_stdout(doctor_run(config, options->config, stdout) ? EXIT_DONE : EXIT_REFUSED);
    case MODE_DUMP_CONFIG:
        config_dump(config, stdout);
        return end_stdout(EXIT_DONE);
    case MODE_DUMP_DBC:
        return dump_dbc(options, config);
    case MODE_HELP:
    case MODE_VERSION:
        break;
    }
    return EXIT_SOFTWARE;
}

int main(int argc, char **argv)
{
    options_t options;
    static config_t config;
    const int code = options_read(&options, argc, argv);
    if (code != EXIT_DONE) {
        return code;
    }
    if (options.mode == MODE_HELP || options.mode == MODE_VERSION) {
        if (options.mode == MODE_HELP) {
            usage_print(&heaved_usage, stdout);
        } else {
            printf("heaved " HEAVE_VERSION "\n");
        }
        return end_stdout(EXIT_DONE);
    }
    if (!is_readable(options.config)) {
        return say(EXIT_NO_INPUT, "%s: %s", options.config, strerror(errno));
    }
    if (config_load(options.config, &config, stderr) != 0) {
        return EXIT_BAD_CONFIG;
    }
    return run(&options, &config);
}
