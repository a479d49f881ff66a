/* SPDX-License-Identifier: MIT
 * state_file.c - see state_file.h.
 */
#include "common/state_file.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

int state_file_read(const char *path, char *text, size_t size, size_t *length)
{
    *length = 0;
    text[0] = '\0';
    const int fd = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOCTTY);
    if (fd < 0) {
        return errno;
    }
    const ssize_t count = read(fd, text, size - 1);
    const int error = errno;
    (void)close(fd);
    if (count < 0) {
        return error;
    }
    *length = (size_t)count;
    text[count] = '\0';
    return 0;
}

static int write_whole(int fd, const char *text, size_t length)
{
    const ssize_t written = write(fd, text, length);
    if (written != (ssize_t)length) {
        return written < 0 ? errno : ENOSPC;
    }
    return fsync(fd) == 0 ? 0 : errno;
}

/* The name has to be on the disk as well. */
static void sync_folder(const char *path)
{
    char folder[STATE_FILE_PATH_MAX];
    (void)snprintf(folder, sizeof folder, "%s", path);
    char *const slash = strrchr(folder, '/');
    if (slash != NULL) {
        slash[slash == folder ? 1 : 0] = '\0';
        const int fd = open(folder, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
        if (fd >= 0) {
            (void)fsync(fd);
            (void)close(fd);
        }
    }
}

int state_file_write(const char *path, const char *text, size_t length)
{
    char part[STATE_FILE_PATH_MAX + 4u];
    (void)snprintf(part, sizeof part, "%s.new", path);
    const int fd = open(part, O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC | O_NOFOLLOW, 0640);
    if (fd < 0) {
        return errno;
    }
    int error = write_whole(fd, text, length);
    (void)close(fd);
    if (error == 0 && rename(part, path) != 0) {
        error = errno;
    }
    if (error != 0) {
        (void)unlink(part);
        return error;
    }
    sync_folder(path);
    return 0;
}
