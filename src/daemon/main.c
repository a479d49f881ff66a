/* SPDX-License-Identifier: MIT
 * main.c - heaved: reads the command line and the configuration, then runs what was asked for.
 */
#include <errno.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include "common/atomic_file.h"
#include "common/message.h"
#include "common/presets.h"
#include "common/same_file.h"
#include "common/state_path.h"
#include "common/standard_descriptors.h"
#include "common/translate.h"
#include "common/usage.h"
#include "config/config.h"
#include "platform/load.h"
#include "daemon/check_json.h"
#include "daemon/gpio_setup.h"
#include "daemon/live.h"
#include "daemon/options.h"
#include "daemon/play.h"
#include "heave/gateway.h"
#include "inspect/dbc.h"
#include "inspect/doctor.h"
#include "inspect/dcf_startup.h"
#include "inspect/eds_judge.h"
#include "inspect/envelope_csv.h"
#include "inspect/report.h"
#include "inspect/scan.h"
#include "service/config_store.h"
#include "service/lifetime.h"
#include "service/operator_log.h"

#define DESCRIPTORS_MIN 64 /* all clients, lines and files at once; half of it is used in the worst case */

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

static const char *if_any(const char *path)
{
    return path[0] != '\0' && strcmp(path, "none") != 0 ? path : NULL;
}

/* Before anything is opened: an output that is an input would empty it, and two outputs would overwrite each other.
 * config: NULL before it has been read.
 * Returns EXIT_DONE; else it has said what is wrong. */
static int check_outputs(const options_t *options, const config_t *config)
{
    char life[CONFIG_PATH_MAX] = "", operators[CONFIG_PATH_MAX] = "";
    const char *metrics = config != NULL && options->mode == MODE_RUN ? config->metrics_file : "";
    if (config != NULL) {
        (void)state_path(life, sizeof life, config->life_file, "/" LIFETIME_NAME);
        (void)state_path(operators, sizeof operators, config->operator_log, "/" OPERATOR_LOG_NAME);
    }
    const named_t named[] = {{"--config", options->config, false},
                             {"--play", options->play, false},
                             {"--trace", options->trace, true},
                             {"--record", options->record, true},
                             {"--eds", options->eds, false},
                             {"--envelope", options->envelope, true},
                             {"[control] metrics", if_any(metrics), true},
                             {"[control] operator_log", if_any(operators), true},
                             {"[platform] life_file", if_any(life), true}};
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
        return print_message(EXIT_IO, "standard output: %s", error_text(errno));
    }
    return code;
}

static int dump_dbc(const options_t *options, const config_t *config)
{
    if (config->drives == CONFIG_DRIVES_CAN_RAW) {
        dbc_write(config, stdout);
    } else if (config->drives == CONFIG_DRIVES_CIA402) {
        dbc_write_cia402(config, stdout);
    } else {
        return print_message(EXIT_BAD_CONFIG, "%s: [drives] driver: is on no CAN bus; allowed for --dump-dbc: can-raw, cia402",
                             options->config);
    }
    return end_stdout(EXIT_DONE);
}

/* Reads a drive's file.
 * Returns EXIT_DONE; else it has said what is wrong. */
static int read_eds(eds_t *eds, const char *path)
{
    FILE *in = is_readable(path) ? fopen(path, "r") : NULL;
    *eds = (eds_t){.object = NULL};
    if (in == NULL) {
        return print_message(EXIT_NO_INPUT, "%s: %s", path, error_text(errno));
    }
    const bool is_read = eds_read(eds, in, path, stderr);
    (void)fclose(in);
    return is_read ? EXIT_DONE : EXIT_BAD_DATA;
}

static int import_dcf(const options_t *options)
{
    eds_t file[OPTIONS_DCF_MAX] = {{.object = NULL}};
    int code = EXIT_DONE;
    unsigned read = 0;
    while (code == EXIT_DONE && read < options->dcfs) {
        code = read_eds(&file[read], options->dcf[read]);
        read++;
    }
    for (unsigned i = 1; code == EXIT_DONE && i < read; i++) {
        if (file[i].vendor.value != file[0].vendor.value || file[i].product.value != file[0].product.value) {
            code = print_message(EXIT_BAD_DATA, "%s: VendorNumber and ProductNumber are of another device than those of %s",
                                 options->dcf[i], options->dcf[0]);
        }
    }
    if (code == EXIT_DONE) {
        const char *section = options->dcfs == 1 ? options->dcf_section : NULL;
        const unsigned left = dcf_write_startup(file, options->dcf, read, section, stdout, stderr);
        code = left > 0 && !options->is_partial ? EXIT_REFUSED : EXIT_DONE;
    }
    for (unsigned i = 0; i < read; i++) {
        eds_free(&file[i]);
    }
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
        return print_message(EXIT_NO_OUTPUT, "%s: %s", path, error_text(errno));
    }
    envelope_csv_write(&envelope, file.stream);
    if (!atomic_file_close(&file)) {
        return print_message(EXIT_IO, "%s: %s", path, error_text(errno));
    }
    return EXIT_DONE;
}

/* What ends by itself. */
static int run(const options_t *options, const config_t *config)
{
    switch (options->mode) {
    case MODE_PLAY:
        translate_end(); /* it repeats the log */
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
    case MODE_RUN:
    case MODE_IMPORT_DCF:
    case MODE_HELP:
    case MODE_VERSION:
    case MODE_PRESETS:
    case MODE_SCAN:
    case MODE_TEMPLATE:
    case MODE_KEYS:
        break;
    }
    return EXIT_SOFTWARE;
}

static int list_presets(void)
{
    return presets_list(stdout) >= 0 ? end_stdout(EXIT_DONE)
                                     : print_message(EXIT_NO_INPUT, "%s: %s", presets_directory(), error_text(errno));
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
    case MODE_KEYS:
        config_write_keys(stdout);
        return end_stdout(EXIT_DONE);
    case MODE_SCAN:
        return end_stdout(scan_run(options->scan, stdout) ? EXIT_DONE : EXIT_REFUSED);
    case MODE_TEMPLATE:
        return write_template(options);
    case MODE_IMPORT_DCF:
        return import_dcf(options);
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

/* The file, or what was applied over it; said where that does not count any more. */
static const char *choose_file(const char *file, char kept[CONFIG_PATH_MAX])
{
    const char *const path = config_store_choose(file, kept);
    if (path != file) {
        (void)print_message(0, "%s was applied over %s, and counts until that file is changed", path, file);
    } else if (kept[0] != '\0' && access(kept, F_OK) == 0) {
        (void)print_message(0, "%s has changed since %s was applied over it: the file counts", file, kept);
    }
    return path;
}

/* What was just applied and could not be started never ran: the one before it did, and does again. What failed to start after it
 * has run, perhaps for years, stays: an older one may be that of another machine. */
static int put_back(char **argv, const char *kept, const char *why, int code)
{
    if (!config_store_put_back(kept)) {
        return print_message(code, "%s cannot be put back: %s", kept, strerror(errno));
    }
    (void)print_message(
        0, "what was applied cannot be started; it stays as %s.failed, and the configuration before it is in force", kept);
    anew_start(argv, ANEW_PUT_BACK, why[0] != '\0' ? why : N_("its log tells why"));
    return print_message(EXIT_UNAVAILABLE, "cannot start anew: %s", strerror(errno));
}

/* With too few, poll, accept and the files of incidents would fail later, in motion. */
static int check_descriptors(void)
{
    struct rlimit limit;
    if (getrlimit(RLIMIT_NOFILE, &limit) != 0 || limit.rlim_cur >= DESCRIPTORS_MIN) {
        return EXIT_DONE;
    }
    limit.rlim_cur = limit.rlim_max < DESCRIPTORS_MIN ? limit.rlim_max : DESCRIPTORS_MIN;
    if (setrlimit(RLIMIT_NOFILE, &limit) != 0 || limit.rlim_cur < DESCRIPTORS_MIN) {
        return print_message(EXIT_UNAVAILABLE,
                             "only %llu open files are allowed (ulimit -n, LimitNOFILE=); at least %d are needed",
                             (unsigned long long)limit.rlim_cur, DESCRIPTORS_MIN);
    }
    return EXIT_DONE;
}

/* @return EXIT_DONE; else it has said what is wrong */
static int load(const options_t *options, config_t *config)
{
    if (config_load(options->config, config, stderr) != 0) {
        return EXIT_BAD_CONFIG;
    }
    return check_outputs(options, config);
}

static int run_live(options_t *options, config_t *config, char **argv)
{
    static char kept[CONFIG_PATH_MAX], why[ANEW_WHY_MAX] = "";
    bool is_ready = false;
    options->anew = anew_read(options->put_back);
    options->config = choose_file(options->file, kept);
    print_message_keep(why, sizeof why);
    int code = load(options, config);
    code = code == EXIT_DONE ? check_descriptors() : code;
    if (code == EXIT_DONE) {
        translate_end(); /* the log is English, and no thread looks up texts */
        code = live_run(config, options, &is_ready);
    }
    print_message_keep(NULL, 0);
    if (code == LIVE_RESTART) {
        anew_start(argv, ANEW_APPLIED, ""); /* what was applied is read at its start */
        return print_message(EXIT_UNAVAILABLE, "cannot start anew: %s", strerror(errno));
    }
    return options->anew == ANEW_APPLIED && options->config == kept && !is_ready ? put_back(argv, kept, why, code) : code;
}

int main(int argc, char **argv)
{
    static options_t options;
    static config_t config;
    if (!standard_descriptors_open()) {
        return print_message(EXIT_UNAVAILABLE,
                             "standard input, output or error is closed, and the null device cannot be put there: %s",
                             error_text(errno));
    }
    translate_begin();
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
        return print_message(EXIT_NO_INPUT, "%s: %s", options.config, error_text(errno));
    }
    code = check_outputs(&options, NULL);
    if (code != EXIT_DONE) {
        return code;
    }
    options.file = options.config;
    if (options.mode == MODE_RUN) {
        return run_live(&options, &config, argv);
    }
    if (options.mode == MODE_CHECK && options.is_json) { /* its mistakes are a part of what it says */
        return end_stdout(check_json(options.config));
    }
    code = load(&options, &config);
    return code == EXIT_DONE ? run(&options, &config) : code;
}
