/* SPDX-License-Identifier: MIT
 * blackbox_folders.h - finds, names and removes the folders of the black box, and knows which of them a person has seen.
 * Private to blackbox*.c. Only for the thread of the black box, and for the start.
 */
#ifndef HEAVE_RECORD_BLACKBOX_FOLDERS_H
#define HEAVE_RECORD_BLACKBOX_FOLDERS_H

#include "record/blackbox.h"

#define BLACKBOX_PART ".incident.part" /**< name of a folder while it is written */

/** Files of an incident. */
typedef enum { BLACKBOX_FRAMES, BLACKBOX_TRACE, BLACKBOX_FEEDBACK, BLACKBOX_PLATFORM, BLACKBOX_FILES } blackbox_file_t;

extern const char *const blackbox_file_name[BLACKBOX_FILES];

/** Makes the directory if it is missing, and lists the incidents in it. Only at the start, because it allocates.
 *  @return NULL; or a text that says why nothing can be written there now */
const char *blackbox_find_folders(blackbox_t *self);

/** Path of a file in a folder of the directory. With an empty `file`, the path of the folder.
 *  @return self->path, which the next call overwrites */
const char *blackbox_path_of(blackbox_t *self, const char *folder, const char *file);

/** Synchronises the open file to the disk and closes it, because the power may fail next.
 *  @return false: self->file.error says why */
bool blackbox_close_file(blackbox_t *self);

/** Name of the next incident: its number, date and time. */
void blackbox_make_name(blackbox_t *self, bool is_dump, char name[BLACKBOX_NAME_MAX]);

/** Renames BLACKBOX_PART to `name` and synchronises the directory to the disk.
 *  @return false: errno says why */
bool blackbox_name_folder(blackbox_t *self, const char *name);

/** Removes a folder and the files of an incident in it. */
void blackbox_remove_folder(blackbox_t *self, const char *name);

/** Adds a folder to the list. */
void blackbox_add_folder(blackbox_t *self, const char *name);

/** Removes the oldest folders of a sort if there are too many. The first fault since a person last looked always stays. */
void blackbox_drop_surplus(blackbox_t *self, bool is_dump);

/** Writes the number of the newest folder that a person has seen into the directory, if it has changed. Logs an error. */
void blackbox_keep_seen(blackbox_t *self);

#endif
