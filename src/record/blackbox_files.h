/* SPDX-License-Identifier: MIT
 * blackbox_files.h - the folders of the black box: found, written, removed. Private to blackbox*.c; its thread, or the start.
 */
#ifndef HEAVE_RECORD_BLACKBOX_FILES_H
#define HEAVE_RECORD_BLACKBOX_FILES_H

#include "record/blackbox.h"

/** Looks which incidents there are, and makes the directory where it is missing. At the start: allocates.
 *  @return NULL; or that nothing can be written there, as it is now */
const char *blackbox_find_folders(blackbox_t *self);

/** Writes what is kept into a folder of its own, which gets its name when it is complete; the oldest one of its sort makes way,
 *  but not the first fault since a person looked. Says so.
 *  @param cause the row that began it; NULL: an operator's request
 *  @param text  where to, or why not
 *  @return false: nothing was written */
bool blackbox_write(blackbox_t *self, const blackbox_row_t *cause, char text[BLACKBOX_TEXT_MAX]);

/** Keeps what a person has seen in the directory, where that has changed. Says where it cannot. */
void blackbox_keep_seen(blackbox_t *self);

#endif
