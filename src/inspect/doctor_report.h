/* SPDX-License-Identifier: MIT
 * doctor_report.h - what heaved --doctor prints: one finding after the other, each with what to do about it.
 */
#ifndef HEAVE_INSPECT_DOCTOR_REPORT_H
#define HEAVE_INSPECT_DOCTOR_REPORT_H

#include <stdio.h>

/** How bad a finding is. */
typedef enum {
    DOCTOR_OK,
    DOCTOR_WARN, /**< the platform runs, but not as well as it should */
    DOCTOR_FAIL  /**< it does not run, or not safely */
} doctor_level_t;

/** Takes findings. */
typedef struct {
    FILE *out;
    unsigned count[DOCTOR_FAIL + 1];
} doctor_report_t;

/** Prints a finding. The format's ` -> ` is where the remedy begins: what fits goes into one line, else the remedy has its own.
 */
void doctor_say(doctor_report_t *self, doctor_level_t level, const char *format, ...) __attribute__((format(printf, 3, 4)));

/** Prints how many there were. */
void doctor_sum(const doctor_report_t *self);

#endif
