/* SPDX-License-Identifier: MIT
 * stalled_disk.c - preloaded into a program: a folder (HEAVE_STALLED) whose disk does not answer as long as there is a file
 * `stall` beside it (FOLDER.stall). Whoever opens, writes, renames, removes or syncs there waits, as on a frozen filesystem.
 */
#include <fcntl.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

#define PATH_BYTES 512

static char g_folder[PATH_BYTES];
static char g_flag[PATH_BYTES + 8];

static __attribute__((constructor)) void start(void)
{
    const char *given = getenv("HEAVE_STALLED");
    (void)snprintf(g_folder, sizeof g_folder, "%s", given != NULL ? given : "");
    (void)snprintf(g_flag, sizeof g_flag, "%s.stall", g_folder);
}

static void wait_for_disk(const char *path)
{
    const struct timespec pause = {.tv_nsec = 1000000};
    if (g_folder[0] != '\0' && strncmp(path, g_folder, strlen(g_folder)) == 0 && path[strlen(g_folder)] == '/') {
        while (syscall(SYS_faccessat, AT_FDCWD, g_flag, F_OK) == 0) {
            (void)nanosleep(&pause, NULL);
        }
    }
}

static void wait_for_fd(int fd)
{
    char link[32];
    char path[PATH_BYTES] = "";
    (void)snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
    if (readlink(link, path, sizeof path - 1) > 0) {
        wait_for_disk(path);
    }
}

ssize_t write(int fd, const void *bytes, size_t length)
{
    wait_for_fd(fd);
    return syscall(SYS_write, fd, bytes, length);
}

int fsync(int fd)
{
    wait_for_fd(fd);
    return (int)syscall(SYS_fsync, fd);
}

int open(const char *path, int flags, ...)
{
    va_list arguments;
    va_start(arguments, flags);
    const unsigned mode = (flags & O_CREAT) != 0 ? va_arg(arguments, unsigned) : 0;
    va_end(arguments);
    wait_for_disk(path);
    return (int)syscall(SYS_openat, AT_FDCWD, path, flags, mode);
}

int rename(const char *from, const char *to)
{
    wait_for_disk(from);
    return (int)syscall(SYS_renameat2, AT_FDCWD, from, AT_FDCWD, to, 0);
}

int unlink(const char *path)
{
    wait_for_disk(path);
    return (int)syscall(SYS_unlinkat, AT_FDCWD, path, 0);
}
