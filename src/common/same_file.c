/* SPDX-License-Identifier: MIT
 * same_file.c - see same_file.h.
 */
#include "common/same_file.h"

#include <limits.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

static bool is_there(const char *path, bool is_output, struct stat *out)
{
    const int standard = is_output ? STDOUT_FILENO : STDIN_FILENO;
    return (strcmp(path, "-") == 0 ? fstat(standard, out) : stat(path, out)) == 0;
}

static bool is_one(const struct stat *a, const struct stat *b)
{
    return a->st_dev == b->st_dev && a->st_ino == b->st_ino;
}

/* Of a file that is not there yet: the folder that it will be in.
 * Returns its name there; NULL: no such folder. */
static const char *folder_of(const char *path, struct stat *out)
{
    char folder[PATH_MAX];
    const char *slash = strrchr(path, '/');
    const int length =
        snprintf(folder, sizeof folder, "%.*s", slash != NULL ? (int)(slash + 1 - path) : 1, slash != NULL ? path : ".");
    return length < (int)sizeof folder && stat(folder, out) == 0 ? (slash != NULL ? slash + 1 : path) : NULL;
}

bool same_file(const char *output, const char *other, bool is_other_output)
{
    struct stat a, b;
    const bool is_output_there = is_there(output, true, &a);
    const bool is_other_there = is_there(other, is_other_output, &b);
    if (is_output_there && is_other_there) {
        return is_one(&a, &b) && (S_ISREG(a.st_mode) || (S_ISFIFO(a.st_mode) && is_other_output));
    }
    if (is_output_there || is_other_there) {
        return false;
    }
    const char *name = folder_of(output, &a);
    const char *other_name = folder_of(other, &b);
    return name != NULL && other_name != NULL && is_one(&a, &b) && strcmp(name, other_name) == 0;
}
