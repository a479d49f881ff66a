/* SPDX-License-Identifier: MIT
 * identify_report.h - what an identification has found, for people, programs and files.
 */
#ifndef HEAVE_IDENTIFY_IDENTIFY_REPORT_H
#define HEAVE_IDENTIFY_IDENTIFY_REPORT_H

#include <stdbool.h>
#include <stdio.h>

#include "identify/response.h"

#define IDENTIFY_CHANNELS_MAX 8u /* the axis, and its cylinders */
#define IDENTIFY_NAME_BYTES   32u

typedef struct {
    char name[IDENTIFY_NAME_BYTES];
    response_t response;
} identify_channel_t;

typedef struct {
    const char *axis, *unit; /**< mm or deg */
    bool is_posed;           /**< the channels after the first are cylinders */
    double amplitude, from_hz, to_hz, seconds;
    double speed_mm_s, accel_mm_s2, jerk_mm_s3, window_mm; /**< limits of every cylinder; window_mm 0: not watched */
    unsigned channels;
    identify_channel_t channel[IDENTIFY_CHANNELS_MAX];
} identify_report_t;

/** Writes it as JSON, docs/identify.md. */
void identify_report_json(const identify_report_t *self, FILE *out);

/** Writes it to standard output, and to a file unless that is NULL.
 *  @return exit code; what is wrong was said */
int identify_report_write(const identify_report_t *self, const char *file, bool is_json);

#endif
