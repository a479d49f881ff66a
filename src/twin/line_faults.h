/* SPDX-License-Identifier: MIT
 * line_faults.h - what faults mean on GPIO lines: switches that are opened and closed, chips that go.
 */
#ifndef HEAVE_TWIN_LINE_FAULTS_H
#define HEAVE_TWIN_LINE_FAULTS_H

#include "twin/twin_faults.h"

/** `open` or `closed`: 0 or 1. */
bool line_fault_read_state(const char *word, double *out, char why[FAULT_WHY_MAX]);

/** `relays`, `inputs` or `healthy`. */
bool line_fault_read_section(const char *word, double *out, char why[FAULT_WHY_MAX]);

/** Whether it is one of GPIO lines, and whether there are such lines. */
bool line_fault_is(bus_fault_t kind);
bool line_fault_suits(const fault_t *fault, bus_fault_t kind, const lines_t *lines);

/** Makes it so. */
bool line_fault_do(const fault_t *fault, bus_fault_t kind, lines_t *lines, char why[FAULT_WHY_MAX]);

#endif
