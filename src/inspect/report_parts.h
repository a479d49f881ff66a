/* SPDX-License-Identifier: MIT
 * report_parts.h - what the files that write the report of --check share.
 */
#ifndef HEAVE_INSPECT_REPORT_PARTS_H
#define HEAVE_INSPECT_REPORT_PARTS_H

#include <stdio.h>

#include "config/config.h"
#include "config/config_text.h"
#include "platform/envelope.h"

/** A report in the making. */
typedef struct {
    const config_t *config;
    const settings_t *settings;
    FILE *out;
    envelope_t envelope;
    int warnings;
} report_t;

/** What rounds to 0.000 is 0: no "-0.000". */
double report_zero_free(double value);

/** A figure for people. */
double report_number(q32_t value_q32);
double report_number_q16(q16_t value_q16);

/** "cylinder 3", or what else ends a reach: an ENVELOPE_ value. */
const char *report_cause_text(unsigned cause, config_text_t *text);

/** The axes that the platform has, with their values. */
const char *report_pose_text(const report_t *self, const pose_t *pose, config_text_t *text);

/** What asks for more than there is, and counts it in self->warnings; then what is only to be known. */
void report_write_warnings(report_t *self);

#endif
