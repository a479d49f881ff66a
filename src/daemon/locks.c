/* SPDX-License-Identifier: MIT
 * locks.c - see locks.h.
 */
#include "daemon/locks.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "common/message.h"
#include "common/state_path.h"
#include "service/lifetime.h"
#include "service/operator_log.h"

#define PATH_BYTES (CONFIG_PATH_MAX + 32u)

/* A write lock, which only those may take who may write the file: with flock() every reader could keep heaved from starting.
 * Returns the descriptor; -1: errno is EAGAIN or EACCES where another one has it. */
static int lock_file(const char *path)
{
    struct flock whole = {.l_type = F_WRLCK, .l_whence = SEEK_SET};
    const int fd = open(path, O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK | O_NOCTTY, 0640);
    if (fd < 0) {
        errno = ENOENT;
        return -1;
    }
    if (fcntl(fd, F_OFD_SETLK, &whole) != 0) {
        const int error = errno;
        (void)close(fd);
        errno = error == EACCES ? EAGAIN : error;
        return -1;
    }
    return fd;
}

int locks_acquire(locks_t *self, const config_t *config)
{
    const struct {
        const char *what, *configured, *name, *lock;
    } k_files[LOCKS] = {{"[platform] life_file", config->life_file, "/" LIFETIME_NAME, ".lock"},
                        {"[control] operator_log", config->operator_log, "/" OPERATOR_LOG_NAME, ".lock"},
                        {"[black-box] directory", config->black_box.directory, "", "/.incident.lock"},
                        {"[control] metrics", config->metrics_file, NULL, ".lock"}};
    char path[PATH_BYTES], lock[PATH_BYTES + 16u];
    for (unsigned i = 0; i < LOCKS; i++) {
        self->fd[i] = -1;
    }
    for (unsigned i = 0; i < LOCKS; i++) {
        path[0] = '\0';
        if (k_files[i].name != NULL) {
            (void)state_path(path, sizeof path, k_files[i].configured, k_files[i].name);
        } else if (strcmp(k_files[i].configured, "none") != 0) {
            (void)snprintf(path, sizeof path, "%s", k_files[i].configured);
        }
        if (path[0] == '\0') {
            continue;
        }
        if (k_files[i].lock[0] == '/') {
            (void)mkdir(path, 0750); /* as it is about to be */
        }
        (void)snprintf(lock, sizeof lock, "%s%s", path, k_files[i].lock);
        self->fd[i] = lock_file(lock);
        if (self->fd[i] < 0 && errno == EAGAIN) {
            return print_message(EXIT_UNAVAILABLE, "%s %s: another heaved writes it; give each platform its own", k_files[i].what,
                                 path);
        }
    }
    return EXIT_DONE;
}

void locks_release(locks_t *self)
{
    for (unsigned i = 0; i < LOCKS; i++) {
        if (self->fd[i] >= 0) {
            (void)close(self->fd[i]);
            self->fd[i] = -1;
        }
    }
}
