/* SPDX-License-Identifier: MIT
 * output_file.c - buffered writing; see output_file.h.
 */
#include "common/output_file.h"

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#define CLOSE_WAIT_MS 1000

int output_file_reopened(int fd, bool is_waiting)
{
    struct stat about;
    char path[32];
    if (fstat(fd, &about) != 0 || !(S_ISFIFO(about.st_mode) || S_ISCHR(about.st_mode))) {
        return fd;
    }
    (void)snprintf(path, sizeof path, "/proc/self/fd/%d", fd);
    const int reopened = open(path, O_WRONLY | O_NONBLOCK | O_CLOEXEC | O_NOCTTY); /* else this would wait for a reader */
    if (reopened >= 0 && is_waiting) {
        (void)fcntl(reopened, F_SETFL, 0);
    }
    return reopened >= 0 ? reopened : fd;
}

bool output_file_open(output_file_t *self, const char *path, output_file_patience_t patience)
{
    static const int k_more[] = {[OUTPUT_FILE_WAITS] = 0, [OUTPUT_FILE_IS_NEW] = O_EXCL, [OUTPUT_FILE_GOES_ON] = O_NONBLOCK};
    const int flags = O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC | k_more[patience];
    const bool is_stdout = strcmp(path, "-") == 0;
    self->length = 0;
    self->patience = patience;
    self->fd = is_stdout ? output_file_reopened(STDOUT_FILENO, patience != OUTPUT_FILE_GOES_ON) : open(path, flags, 0666);
    self->error = self->fd < 0 ? errno : 0;
    return self->fd >= 0;
}

bool output_file_has_room(const output_file_t *self, size_t length)
{
    return OUTPUT_FILE_BYTES - self->length >= length;
}

/* A socket may have been set not to block by another program that has it, too. False where what is left has to wait. */
static bool waits_for_room(output_file_t *self)
{
    struct pollfd wait = {.fd = self->fd, .events = POLLOUT};
    if (self->patience == OUTPUT_FILE_GOES_ON) {
        return false;
    }
    if (poll(&wait, 1, -1) < 0 && errno != EINTR) {
        self->error = errno;
    }
    return true;
}

void output_file_flush(output_file_t *self)
{
    size_t done = 0;
    while (done < self->length && self->error == 0) {
        const ssize_t written = write(self->fd, &self->bytes[done], self->length - done);
        if (written >= 0) {
            done += (size_t)written;
        } else if (errno == EAGAIN || errno == EWOULDBLOCK) {
            if (!waits_for_room(self)) {
                break;
            }
        } else if (errno != EINTR) {
            self->error = errno;
        }
    }
    self->length = self->error == 0 ? self->length - done : 0;
    memmove(self->bytes, &self->bytes[done], self->length);
}

void output_file_write(output_file_t *self, const char *bytes, size_t length)
{
    if (!output_file_has_room(self, length)) {
        output_file_flush(self);
    }
    if (self->error != 0) {
        return;
    }
    HV_ASSERT(output_file_has_room(self, length));
    memcpy(&self->bytes[self->length], bytes, length);
    self->length += length;
}

bool output_file_close(output_file_t *self)
{
    if (self->fd < 0) {
        return self->error == 0;
    }
    output_file_flush(self);
    struct pollfd wait = {.fd = self->fd, .events = POLLOUT};
    while (self->length > 0 && poll(&wait, 1, CLOSE_WAIT_MS) > 0) {
        output_file_flush(self);
    }
    if (self->error == 0 && self->length > 0) {
        self->error = EAGAIN;
    }
    if (close(self->fd) != 0 && self->error == 0) {
        self->error = errno;
    }
    self->fd = -1;
    return self->error == 0;
}
