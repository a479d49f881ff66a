/* SPDX-License-Identifier: MIT
 * script.h - faults with times: `SECONDS FAULT` since the start, `+SECONDS FAULT` since all drives had torque for the first time.
 */
#ifndef HEAVE_TWIN_SCRIPT_H
#define HEAVE_TWIN_SCRIPT_H

#include <stdio.h>

#include "twin/twin_faults.h"

#define SCRIPT_MAX      256u
#define SCRIPT_LINE_MAX 160u

/** A line. */
typedef struct {
    bool is_after_enabled;
    bool is_done;
    uint64_t at_us;
    fault_t fault;
    char text[SCRIPT_LINE_MAX];
} script_entry_t;

/** All of them. */
typedef struct {
    unsigned count;
    fault_machine_t machine; /**< what can fail; set by the caller */
    script_entry_t entry[SCRIPT_MAX];
} script_t;

/** Adds one. False where it is wrong: why says how. */
bool script_add(script_t *self, const char *line, unsigned drives, char why[FAULT_WHY_MAX]);

/** Adds those of a file; blank lines and what stands behind # is skipped. Says `FILE:LINE: what is wrong` for each that is.
 *  @return how many are wrong, or -1 where the file cannot be read, which is said as well */
int script_load(script_t *self, const char *path, unsigned drives, FILE *errors);

/** When the next one is due, us; DRIVE_NEVER: none is. */
uint64_t script_due_us(const script_t *self, uint64_t start_us, uint64_t enabled_us);

/** Does those that are due and says so. */
void script_run(script_t *self, twin_t *twin, uint64_t start_us, uint64_t now_us, FILE *out);

#endif
