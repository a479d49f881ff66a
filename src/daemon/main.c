/* SPDX-License-Identifier: MIT
 * main.c - heaved: reads the command line and the configuration, then runs what was asked for.
 */
#include <errno.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "common/atomic_file.h"
#include "common/message.h"
#include "common/presets.h"
#include "common/same_file.h"
#include "common/standard_descriptors.h"
#include "common/usage.h"
#include "config/config.h"
#include "daemon/gpio_setup.h"
#include "daemon/live.h"
#include "daemon/options.h"
#include "daemon/play.h"
#include "heave/gateway.h"
#include "inspect/dbc.h"
#include "inspect/doctor.h"
#include "inspect/eds_judge.h"
#include "inspect/envelope_csv.h"
#include "inspect/report.h"

void hv_assert_failed(const char *file, int line)
{
    (void)print_message(0, "%s:%d: assertion failed, this is a bug", file, line);
    abort();
}

/* Whether there is a file that may be read. Not by reading it: from a pipe it comes once. */
static bool is_readable(const char *path)
{
    struct stat about;
    if (stat(path, &about) != 0) {
        return false;
    }
    errno = EISDIR;
    return !S_ISDIR(about.st_mode) && access(path, R_OK) == 0;
}

/** A file that a run reads or writes, and the option that names it. */
typedef struct {
    const char *option;
    const char *path; /**< NULL: none */
    bool is_output;
} named_t;

/* Before anything is opened: an output that is an input would empty it, and two outputs would overwrite each other.
 * Returns EXIT_DONE; else it has said what is wrong. */
static int check_outputs(const options_t *options, const char *metrics)
{
    const named_t named[] = {{"--config", options->config, false},    {"--play", options->play, false},
                             {"--trace", options->trace, true},       {"--record", options->record, true},
                             {"--eds", options->eds, false},          {"--import-dcf", options->dcf, false},
                             {"--envelope", options->envelope, true}, {"[control] metrics", metrics, true}};
    for (size_t out = 0; out < sizeof named / sizeof named[0]; out++) {
        for (size_t in = 0; named[out].is_output && named[out].path != NULL && in < out; in++) {
            if (named[in].path != NULL && same_file(named[out].path, named[in].path, named[in].is_output)) {
                return print_message(EXIT_BAD_USAGE,
                                     "%s %s is the file of %s, and would be written over; give it a name of its own",
                                     named[out].option, named[out].path, named[in].option);
            }
        }
    }
    return EXIT_DONE;
}

/* Standard output that took everything. */
static int end_stdout(int code)
{
    if (fflush(stdout) != 0 || ferror(stdout) != 0) {
        return print_message(EXIT_IO, "standard output: %s", strerror(errno));
    }
    return code;
}

static int dump_dbc(const options_t *options, const config_t *config)
{
    if (config->drives != CONFIG_DRIVES_CAN_RAW) {
        return print_message(EXIT_BAD_CONFIG, "%s: [drives] driver: has no frames of its own; allowed for --dump-dbc: can-raw",
                             options->config);
    }
    dbc_write(config, stdout);
    return end_stdout(EXIT_DONE);
}

/* Reads a drive's file.
 * Returns EXIT_DONE; else it has said what is wrong. */
static int read_eds(eds_t *eds, const char *path)
{
    FILE *in = is_readable(path) ? fopen(path, "r") : NULL;
    *eds = (eds_t){.object = NULL};
    if (in == NULL) {
        return print_message(EXIT_NO_INPUT, "%s: %s", path, strerror(errno));
    }
    const bool is_read = eds_read(eds, in, path, stderr);
    (void)fclose(in);
    return is_read ? EXIT_DONE : EXIT_BAD_DATA;
}

static int import_dcf(const char *path)
{
    eds_t eds;
    const int code = read_eds(&eds, path);
    if (code == EXIT_DONE) {
        eds_write_startup(&eds, stdout);
    }
    eds_free(&eds);
    return end_stdout(code);
}

/* What is wrong with the drives' file comes first: the report is long. */
static int check(const options_t *options, const config_t *config)
{
    eds_t eds = {.object = NULL};
    int code = EXIT_DONE;
    if (options->eds != NULL && config->drives != CONFIG_DRIVES_CIA402) {
        return print_message(EXIT_BAD_CONFIG, "%s: [drives] driver: has no CANopen drives; allowed for --eds: cia402",
                             options->config);
    }
    if (options->eds != NULL) {
        code = read_eds(&eds, options->eds);
    }
    if (code == EXIT_DONE) {
        (void)report_write(config, sizeof(gateway_t), stdout);
        (void)gpio_setup_check(config, stdout);
    }
    if (code == EXIT_DONE && options->eds != NULL && !eds_judge(&eds, config, stdout)) {
        code = EXIT_REFUSED;
    }
    eds_free(&eds);
    return end_stdout(code);
}

static int write_envelope(const char *path, const config_t *config)
{
    static envelope_t envelope;
    static atomic_file_t file;
    if (!envelope_find(&envelope, &config->settings)) {
        return EXIT_SOFTWARE; /* not a configuration that config_load() accepted */
    }
    if (!atomic_file_open(&file, path)) {
        return print_message(EXIT_NO_OUTPUT, "%s: %s", path, strerror(errno));
    }
    envelope_csv_write(&envelope, file.stream);
    if (!atomic_file_close(&file)) {
        return print_message(EXIT_IO, "%s: %s", path, strerror(errno));
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
        return check(options, config);
    case MODE_ENVELOPE:
        return write_envelope(options->envelope, config);
    case MODE_DOCTOR:
        return end_stdout(doctor_run(config, options->config, stdout) ? EXIT_DONE : EXIT_REFUSED);
    case MODE_DUMP_CONFIG:
        config_dump(config, stdout);
        return end_stdout(EXIT_DONE);
    case MODE_DUMP_DBC:
        return dump_dbc(options, config);
    case MODE_IMPORT_DCF:
    case MODE_HELP:
    case MODE_VERSION:
    case MODE_PRESETS:
    case MODE_TEMPLATE:
        break;
    }
    return EXIT_SOFTWARE;
}

static int list_presets(void)
{
    return presets_list(stdout) >= 0 ? end_stdout(EXIT_DONE)
                                     : print_message(EXIT_NO_INPUT, "%s: %s", presets_directory(), strerror(errno));
}

static int write_template(const options_t *options)
{
    const char *allowed = config_write_template(options->template_kind, options->template_driver, stdout);
    return allowed == NULL ? end_stdout(EXIT_DONE)
                           : print_message(EXIT_BAD_USAGE, "--template %s %s: allowed: %s", options->template_kind,
                                           options->template_driver, allowed);
}

/* What needs no configuration; -1: the rest does. */
static int run_without_file(const options_t *options)
{
    switch (options->mode) {
    case MODE_HELP:
        usage_print(&heaved_usage, stdout);
        return end_stdout(EXIT_DONE);
    case MODE_VERSION:
        printf("heaved " HEAVE_VERSION "\n");
        return end_stdout(EXIT_DONE);
    case MODE_PRESETS:
        return list_presets();
    case MODE_TEMPLATE:
        return write_template(options);
    case MODE_IMPORT_DCF:
        return import_dcf(options->dcf);
    case MODE_RUN:
    case MODE_CHECK:
    case MODE_ENVELOPE:
    case MODE_DOCTOR:
    case MODE_DUMP_CONFIG:
    case MODE_DUMP_DBC:
    case MODE_PLAY:
        break;
    }
    return -1;
}

int main(int argc, char **argv)
{
    static options_t options;
    static config_t config;
    if (!standard_descriptors_open()) {
        return print_message(EXIT_UNAVAILABLE,
                             "standard input, output or error is closed, and the null device cannot be put there: %s",
                             strerror(errno));
    }
    (void)signal(SIGXFSZ, SIG_IGN); /* a file that has reached its limit is an error of the write */
    int code = options_read(&options, argc, argv);
    if (code != EXIT_DONE) {
        return code;
    }
    code = run_without_file(&options);
    if (code >= 0) {
        return code;
    }
    if (!is_readable(options.config)) {
        return print_message(EXIT_NO_INPUT, "%s: %s", options.config, strerror(errno));
    }
    code = check_outputs(&options, NULL);
    if (code != EXIT_DONE) {
        return code;
    }
    if (config_load(options.config, &config, stderr) != 0) {
        return EXIT_BAD_CONFIG;
    }
    const bool has_metrics = options.mode == MODE_RUN && strcmp(config.metrics_file, "none") != 0;
    code = check_outputs(&options, has_metrics ? config.metrics_file : NULL);
    return code == EXIT_DONE ? run(&options, &config) : code;
}
