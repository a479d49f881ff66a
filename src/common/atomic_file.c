/* SPDX-License-Identifier: MIT
 * atomic_file.c - writing beside and renaming; see atomic_file.h.
 */
#include "common/atomic_file.h"

#include <errno.h>
#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#define MODE_NEW 0666

/* Where a path leads to, through links. */
static bool resolve(atomic_file_t *self, const char *path)
{
    if (realpath(path, self->path) != NULL) {
        return true;
    }
    if (errno != ENOENT || strlen(path) >= sizeof self->path) {
        return false;
    }
    memcpy(self->path, path, strlen(path) + 1);
    return true;
}

/* Creates the file beside, with the permissions of what it will replace. */
static bool open_beside(atomic_file_t *self, const struct stat *old)
{
    const int length = snprintf(self->part, sizeof self->part, "%s.%ld.part", self->path, (long)getpid());
    if (length < 0 || (size_t)length >= sizeof self->part) {
        errno = ENAMETOOLONG;
        return false;
    }
    const int fd = open(self->part, O_WRONLY | O_CREAT | O_TRUNC | O_NOFOLLOW | O_CLOEXEC, MODE_NEW);
    if (fd < 0) {
        return false;
    }
    if (old != NULL) {
        (void)fchmod(fd, old->st_mode & 07777u);
    }
    self->stream = fdopen(fd, "w");
    if (self->stream == NULL) {
        const int error = errno;
        (void)close(fd);
        (void)unlink(self->part);
        errno = error;
    }
    return self->stream != NULL;
}

bool atomic_file_open(atomic_file_t *self, const char *path)
{
    struct stat old;
    self->stream = stdout;
    self->part[0] = '\0';
    if (strcmp(path, "-") == 0) {
        return true;
    }
    const bool is_there = stat(path, &old) == 0;
    if (is_there && !S_ISREG(old.st_mode)) {
        self->stream = fopen(path, "we"); /* refuses a folder */
        return self->stream != NULL;
    }
    return resolve(self, path) && open_beside(self, is_there ? &old : NULL);
}

/* Everything written and, for a file, on the disk; 0, or errno. */
static int finish(atomic_file_t *self)
{
    int error = fflush(self->stream) != 0 ? errno : ferror(self->stream) != 0 ? EIO : 0;
    if (self->part[0] != '\0' && error == 0 && fsync(fileno(self->stream)) != 0) {
        error = errno;
    }
    if (self->stream != stdout && fclose(self->stream) != 0 && error == 0) {
        error = errno;
    }
    return error;
}

bool atomic_file_close(atomic_file_t *self)
{
    int error = finish(self);
    if (self->part[0] != '\0') {
        if (error == 0 && rename(self->part, self->path) != 0) {
            error = errno;
        }
        if (error != 0) {
            (void)unlink(self->part);
        }
    }
    self->stream = NULL;
    errno = error;
    return error == 0;
}
