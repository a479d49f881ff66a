/* SPDX-License-Identifier: MIT
 * make_table.c - writes a configuration and a file of frames as a table for the firmware; see table.h.
 * usage: cortex_table CONFIG FRAMES TABLE
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "config/config.h"
#include "platform/load.h"
#include "record/frames.h"
#include "daemon/devices.h"
#include "table.h"

void hv_assert_failed(const char *file, int line)
{
    fprintf(stderr, "%s:%d: assertion failed\n", file, line);
    abort();
}

static bool put(FILE *out, const void *bytes, size_t length)
{
    return fwrite(bytes, 1, length, out) == length;
}

static bool put_line(FILE *out, const frames_line_t *line)
{
    static const uint8_t k_filler[8] = {0};
    table_line_t record;
    memset(&record, 0, sizeof record);
    record.t_us = line->t_us;
    record.kind = line->kind;
    record.request = line->request;
    record.drive = line->drive;
    record.state = line->state;
    record.number = line->number;
    record.length = line->kind == FRAMES_DATAGRAM ? line->length : 0;
    record.from = line->from;
    return put(out, &record, sizeof record) && put(out, line->text, record.length) &&
           put(out, k_filler, (8 - record.length % 8) % 8);
}

static bool put_all(FILE *out, const config_t *config, const frames_t *frames)
{
    static devices_t devices;
    static table_t table;
    gateway_io_t io;
    if (devices_open_settled(&devices, config, &io) != HV_OK) {
        return false;
    }
    table.magic = TABLE_MAGIC;
    table.bytes = sizeof table;
    table.settings = config->settings;
    memcpy(table.axis, devices.sim_axis, sizeof table.axis);
    table.axes = drives_count(io.drives);
    table.lines = (uint32_t)frames->count;
    bool is_put = put(out, &table, sizeof table);
    for (size_t i = 0; is_put && i < frames->count; i++) {
        is_put = put_line(out, &frames->line[i]);
    }
    return is_put;
}

int main(int count, char **argument)
{
    static config_t config;
    static frames_t frames;
    if (count != 4) {
        fputs("usage: cortex_table CONFIG FRAMES TABLE\n", stderr);
        return EXIT_FAILURE;
    }
    if (config_load(argument[1], &config, stderr) != 0 || frames_load(&frames, argument[2], stderr) != 0) {
        return EXIT_FAILURE;
    }
    FILE *out = fopen(argument[3], "wb");
    const bool is_put = out != NULL && put_all(out, &config, &frames);
    if (out == NULL || fclose(out) != 0 || !is_put) {
        perror(argument[3]);
        return EXIT_FAILURE;
    }
    return EXIT_SUCCESS;
}
