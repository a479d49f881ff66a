/* SPDX-License-Identifier: MIT
 * drive_commands.h - one drive in its own words: what heaved sees of it, and what its dictionary says. Blocks; one thread.
 */
#ifndef HEAVE_HEAVECTL_DRIVE_COMMANDS_H
#define HEAVE_HEAVECTL_DRIVE_COMMANDS_H

#include "heavectl/ctl.h"

/** `heavectl drive N`: shows it; or with a file saves what it is set to, or compares. @return exit code */
int drive_run(ctl_t *self);

/** Shows the answer to `sdo`. */
void drive_show_object(const cJSON *answer);

/* --- private to drive*.c --- */

/** Asks heaved.
 *  @param code out: EXIT_DONE; else what is wrong was said
 *  @return the answer, for cJSON_Delete(); NULL where code is not EXIT_DONE */
cJSON *drive_request(ctl_t *self, const char *request, int *code);

/** Asks for an object of the drive; tries again while heaved has something else to do with it.
 *  @param code out: EXIT_DONE, also where heaved or the drive said no; else what is wrong was said
 *  @return the answer, for cJSON_Delete(); NULL where code is not EXIT_DONE */
cJSON *drive_ask(ctl_t *self, unsigned drive, uint16_t index, uint8_t sub, int *code);

/** True for an answer with a value. */
bool drive_is_good(const cJSON *answer);

/** True where the drive was asked, and refused just this object, or kept silent about it. */
bool drive_is_missing(const cJSON *answer);

/** A member's text; "" where there is none. */
const char *drive_text(const cJSON *object, const char *name);

/** --save, --compare. @return exit code */
int drive_save(ctl_t *self, unsigned drive, unsigned channel);
int drive_compare(ctl_t *self, unsigned drive, uint32_t node);

#endif
