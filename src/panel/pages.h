/* SPDX-License-Identifier: MIT
 * pages.h - the files that the panel serves, in memory from the start: no path of a request ever reaches the file system.
 */
#ifndef HEAVE_PANEL_PAGES_H
#define HEAVE_PANEL_PAGES_H

#include <stdbool.h>
#include <stddef.h>

#define PAGES_MAX      64u
#define PAGES_PATH_MAX 96u

/** One file. */
typedef struct {
    char path[PAGES_PATH_MAX]; /**< as in a request, with its slash */
    const char *type;
    unsigned char *data;
    size_t length;
    unsigned char *packed; /**< the same by gzip; NULL where that is no shorter */
    size_t packed_length;
} page_t;

/** All of them. */
typedef struct {
    page_t page[PAGES_MAX];
    unsigned count;
} pages_t;

/** Loads the files of a folder, not of folders in it. @return false, and why */
bool pages_load(pages_t *self, const char *folder, char *why, size_t size);

/** The file of a request's path; `/` is index.html. NULL where there is none. */
const page_t *pages_find(const pages_t *self, const char *path);

#endif
