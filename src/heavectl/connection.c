/* SPDX-License-Identifier: MIT
 * connection.c - requests to heaved and its answers, line by line; see ctl.h.
 */
#include <errno.h>
#include <poll.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <time.h>
#include <unistd.h>

#include "common/message.h" // exit codes
#include "common/translate.h"
#include "heavectl/ctl.h"

#define AGAIN_MS    100
#define WAIT_MS_MAX 1000 /* a signal between a look and a wait is seen by then */

volatile sig_atomic_t ctl_is_interrupted; /* set by the signal handler, which can reach nothing else */

static void on_signal(int signal_number)
{
    (void)signal_number;
    ctl_is_interrupted = 1;
}

void ctl_catch_signals(void)
{
    const struct sigaction action = {.sa_handler = on_signal};
    (void)sigaction(SIGINT, &action, NULL);
    (void)sigaction(SIGTERM, &action, NULL);
    (void)sigaction(SIGHUP, &action, NULL);
}

int ctl_complain(int code, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    fputs("heavectl: ", stderr);
    vfprintf(stderr, translate(format), arguments);
    fputc('\n', stderr);
    va_end(arguments);
    return code;
}

/* --- The link --- */

static int not_running(const ctl_t *self, int error)
{
    if (error == EACCES) {
        return ctl_complain(EXIT_UNAVAILABLE, "%s: no permission to talk to heaved; its user or group may", self->socket);
    }
    return ctl_complain(EXIT_UNAVAILABLE,
                        "heaved is not running at %s (%s): start it with `heaved --config FILE`, or give --socket PATH",
                        self->socket, error_text(error));
}

/* Returns a connected socket; -1: errno says why not. */
static int connect_to(const struct sockaddr_un *address)
{
    const int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    if (fd >= 0 && connect(fd, (const struct sockaddr *)address, sizeof *address) != 0) {
        const int error = errno;
        (void)close(fd);
        errno = error;
        return -1;
    }
    return fd;
}

/* Whether heaved may be about to be there, for who waits until something is done. */
static bool is_worth_waiting(const ctl_t *self, int error)
{
    return (error == ENOENT || error == ECONNREFUSED) && self->is_waiting && strcmp(self->command, "shutdown") != 0 &&
           ctl_now_ms() < self->ready_by_ms && ctl_is_interrupted == 0;
}

int ctl_open(ctl_t *self)
{
    static const struct timespec k_pause = {.tv_nsec = AGAIN_MS * 1000000};
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    if (strlen(self->socket) >= sizeof address.sun_path) {
        return ctl_complain(EXIT_BAD_USAGE, "%s: a socket's path has at most 107 characters", self->socket);
    }
    memcpy(address.sun_path, self->socket, strlen(self->socket));
    self->fd = connect_to(&address);
    if (self->fd < 0 && is_worth_waiting(self, errno)) {
        fprintf(stderr, _("heavectl: heaved is not running yet at %s; waiting\n"), self->socket);
    }
    while (self->fd < 0 && is_worth_waiting(self, errno)) {
        (void)nanosleep(&k_pause, NULL);
        self->fd = connect_to(&address);
    }
    return self->fd < 0 ? not_running(self, errno) : EXIT_DONE;
}

/* Where heaved has closed the link, what it said before is still to be read. A signal that ends the program is the reader's to
 * see. */
int ctl_send(const ctl_t *self, const char *request)
{
    char line[96];
    const int length = snprintf(line, sizeof line, "%s\n", request);
    ssize_t sent;
    do {
        sent = send(self->fd, line, (size_t)length, MSG_NOSIGNAL);
    } while (sent < 0 && errno == EINTR && ctl_is_interrupted == 0);
    if (sent < 0 && errno != EPIPE && errno != ECONNRESET && errno != EINTR) {
        return ctl_complain(EXIT_UNAVAILABLE, "heaved cannot be asked: %s", error_text(errno));
    }
    return EXIT_DONE;
}

int64_t ctl_now_ms(void)
{
    struct timespec now;
    (void)clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000 + now.tv_nsec / 1000000;
}

/* Waits for bytes until the given time.
 * Returns false: time is up, a signal came that ends the program, or the system refuses to wait. */
static bool wait_for_bytes(ctl_t *self, int64_t until_ms)
{
    struct pollfd wait = {.fd = self->fd, .events = POLLIN};
    for (;;) {
        const int64_t left_ms = until_ms - ctl_now_ms();
        if (left_ms <= 0 || ctl_is_interrupted != 0) {
            return false;
        }
        const int ready = poll(&wait, 1, left_ms < WAIT_MS_MAX ? (int)left_ms : WAIT_MS_MAX);
        if (ready < 0 && errno != EINTR) {
            self->error = errno;
            return false;
        }
        if (ready > 0) {
            return true;
        }
    }
}

/* More bytes into the line, until the given time.
 * Returns false: as above, or the link is closed, or the line is longer than any answer. */
static bool receive_more(ctl_t *self, int64_t until_ms)
{
    const size_t room = sizeof self->line - 1 - self->length;
    if (room == 0 || !wait_for_bytes(self, until_ms)) {
        return false;
    }
    const ssize_t received = recv(self->fd, &self->line[self->length], room, 0);
    self->length += received > 0 ? (size_t)received : 0;
    if (received < 0 && errno != EINTR && errno != ECONNRESET) {
        self->error = errno;
    }
    return received > 0 || (received < 0 && errno == EINTR);
}

/* The next answer, ended by a NUL; NULL: none came. Valid until the next call. */
const char *ctl_receive(ctl_t *self, int64_t until_ms)
{
    self->length -= self->consumed;
    memmove(self->line, &self->line[self->consumed], self->length);
    self->consumed = 0;
    char *newline = memchr(self->line, '\n', self->length);
    while (newline == NULL) {
        if (!receive_more(self, until_ms)) {
            return NULL;
        }
        newline = memchr(self->line, '\n', self->length);
    }
    *newline = '\0';
    self->consumed = (size_t)(newline + 1 - self->line);
    return self->line;
}

/* No answer, or no more of them.
 * Returns the exit code. */
int ctl_not_heard(const ctl_t *self, const char *why)
{
    return self->error != 0 ? ctl_complain(EXIT_UNAVAILABLE, "heaved cannot be heard: %s", error_text(self->error))
                            : ctl_complain(EXIT_UNAVAILABLE, "%s", why);
}
