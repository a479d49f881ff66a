/* SPDX-License-Identifier: MIT
 * blackbox_files.h - writes an incident: its files, in a folder of its own. Private to blackbox*.c; its thread.
 */
#ifndef HEAVE_RECORD_BLACKBOX_FILES_H
#define HEAVE_RECORD_BLACKBOX_FILES_H

#include "record/blackbox.h"

/** Writes what is kept into a folder of its own, which gets its name when it is complete; the oldest one of its sort makes way,
 *  but not the first fault since a person looked. Says so.
 *  @param cause the row that began it; NULL: an operator's request
 *  @param text  where to, or why not
 *  @return false: nothing was written */
bool blackbox_write(blackbox_t *self, const blackbox_row_t *cause, char text[BLACKBOX_TEXT_MAX]);

#endif
