/* SPDX-License-Identifier: MIT
 * check_json.c - see check_json.h.
 */
#include "daemon/check_json.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/json.h"
#include "common/message.h"
#include "config/config.h"
#include "platform/load.h"
#include "daemon/gpio_setup.h"
#include "heave/gateway.h"
#include "inspect/report.h"
#include "service/control_geometry.h"

#define TEXT_BYTES 1048576u

/* What one error says, without the file: `PATH:LINE: text`, or `PATH: text`. */
static void put_error(json_t *json, const char *path, const char *text)
{
    const size_t prefix = strlen(path);
    unsigned long line = 0;
    if (strncmp(text, path, prefix) == 0 && text[prefix] == ':') {
        char *end = NULL;
        line = strtoul(&text[prefix + 1u], &end, 10);
        text = line > 0 && *end == ':' ? end + 1 : &text[prefix + 1u];
        text += *text == ' ';
    }
    json_open(json, NULL, '{');
    json_number(json, "line", line);
    json_text(json, "text", text);
    json_close(json, '}');
}

static void put_errors(json_t *json, const char *path, char *errors)
{
    json_open(json, "errors", '[');
    for (char *line = strtok(errors, "\n"); line != NULL;
         line = strtok(NULL, "\n")) { // NOLINT(concurrency-mt-unsafe): one thread
        put_error(json, path, line);
    }
    json_close(json, ']');
}

static void put_report(json_t *json, const config_t *config)
{
    char *text = NULL;
    size_t length = 0;
    FILE *const out = open_memstream(&text, &length);
    if (out == NULL) {
        return;
    }
    (void)report_write(config, sizeof(gateway_t), out);
    (void)gpio_setup_check(config, out);
    if (fclose(out) == 0) {
        json_text(json, "report", text);
    }
    free(text);
}

static int write_check(const char *path, FILE *errors, char **error_text)
{
    static config_t config;
    json_t json;
    const bool is_right = config_load(path, &config, errors) == 0;
    char *const text = fclose(errors) == 0 ? malloc(TEXT_BYTES) : NULL;
    if (text == NULL) {
        return print_message(EXIT_UNAVAILABLE, "no memory");
    }
    json_start(&json, text, TEXT_BYTES);
    json_open(&json, NULL, '{');
    json_bool(&json, "ok", is_right);
    put_errors(&json, path, *error_text);
    if (is_right) {
        json_text(&json, "hash", config.hash);
        put_report(&json, &config);
        json_open(&json, "geometry", '{');
        control_geometry_put(&json, &config.settings);
        json_close(&json, '}');
    }
    json_close(&json, '}');
    json_newline(&json);
    const bool is_written = !json.is_cut && fwrite(text, 1, json.length, stdout) == json.length;
    free(text);
    return !is_written ? EXIT_SOFTWARE : is_right ? EXIT_DONE : EXIT_BAD_CONFIG;
}

int check_json(const char *path)
{
    char *text = NULL;
    size_t length = 0;
    FILE *const errors = open_memstream(&text, &length);
    if (errors == NULL) {
        return print_message(EXIT_UNAVAILABLE, "no memory");
    }
    const int code = write_check(path, errors, &text);
    free(text);
    return code;
}
