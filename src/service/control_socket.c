/* SPDX-License-Identifier: MIT
 * control_socket.c - see control_socket.h.
 */
#include "service/control_socket.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include "common/message.h"

#define BACKLOG 8

/* Whether somebody answers at the path: a running daemon, or nobody any more. */
static bool is_alive(const struct sockaddr_un *address)
{
    const int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    const bool is_connected = fd >= 0 && connect(fd, (const struct sockaddr *)address, sizeof *address) == 0;
    if (fd >= 0) {
        (void)close(fd);
    }
    return is_connected;
}

/* The directory of the socket, where it is missing. */
static void make_directory(const char *path)
{
    char directory[CONFIG_PATH_MAX];
    (void)snprintf(directory, sizeof directory, "%s", path);
    char *const slash = strrchr(directory, '/');
    if (slash != NULL && slash != directory) {
        *slash = '\0';
        (void)!mkdir(directory, 0755);
    }
}

/* Makes way for the socket. */
static int clear_path(const char *path, const struct sockaddr_un *address)
{
    struct stat found;
    if (lstat(path, &found) != 0) {
        make_directory(path);
        return EXIT_DONE;
    }
    if (!S_ISSOCK(found.st_mode)) {
        return print_message(EXIT_NO_OUTPUT, "control socket %s: there is something else of that name", path);
    }
    if (is_alive(address)) {
        return print_message(EXIT_UNAVAILABLE, "control socket %s: another heaved is running; stop it, or give --socket PATH",
                             path);
    }
    (void)unlink(path);
    return EXIT_DONE;
}

static int fail(control_socket_t *self)
{
    const int error = errno;
    if (self->fd >= 0) {
        (void)close(self->fd);
    }
    self->fd = -1;
    return print_message(EXIT_NO_OUTPUT, "control socket %s: %s; create its directory, or give --socket PATH", self->path,
                         strerror(error));
}

int control_socket_open(control_socket_t *self, const char *path, mode_t mode)
{
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    (void)snprintf(self->path, sizeof self->path, "%s", path);
    memcpy(address.sun_path, self->path, sizeof self->path);
    const int code = clear_path(self->path, &address);
    if (code != EXIT_DONE) {
        return code;
    }
    self->fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    if (self->fd < 0 || bind(self->fd, (const struct sockaddr *)&address, sizeof address) != 0 || chmod(self->path, mode) != 0 ||
        stat(self->path, &self->made) != 0 || listen(self->fd, BACKLOG) != 0) {
        return fail(self);
    }
    return EXIT_DONE;
}

static bool is_ours(const control_socket_t *self)
{
    struct stat found;
    return stat(self->path, &found) == 0 && found.st_dev == self->made.st_dev && found.st_ino == self->made.st_ino;
}

void control_socket_close(control_socket_t *self)
{
    if (self->newcomer >= 0) {
        (void)close(self->newcomer);
    }
    self->newcomer = -1;
    if (self->fd >= 0 && is_ours(self)) {
        (void)unlink(self->path);
    }
    if (self->fd >= 0) {
        (void)close(self->fd);
    }
    self->fd = -1;
}
