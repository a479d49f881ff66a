/* SPDX-License-Identifier: MIT
 * upstream.c - see upstream.h.
 */
#include "panel/upstream.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <sys/un.h>
#include <unistd.h>

#define STATUS_HZ     10
#define PATIENCE_US   300000 /* for the memory of the samples, once per connection */
#define NO_CONNECTION "heaved is not there"

bool upstream_init(upstream_t *self, const char *name, const char *path, const upstream_calls_t *calls)
{
    *self = (upstream_t){.calls = calls, .status = calloc(1, UPSTREAM_LINE_MAX)};
    bool is_ready = self->status != NULL;
    (void)snprintf(self->name, sizeof self->name, "%s", name);
    (void)snprintf(self->path, sizeof self->path, "%s", path);
    for (unsigned i = 0; i < LINKS; i++) {
        self->link[i] = (link_t){.upstream = self, .kind = (link_kind_t)i, .fd = -1, .line = calloc(1, UPSTREAM_LINE_MAX)};
        is_ready = is_ready && self->link[i].line != NULL;
    }
    return is_ready;
}

/* Never waits: a heaved that stands still has a full queue. */
static int join(const char *path)
{
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    if (strlen(path) >= sizeof address.sun_path) {
        return -1;
    }
    memcpy(address.sun_path, path, strlen(path) + 1);
    const int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    if (fd >= 0 && connect(fd, (const struct sockaddr *)&address, sizeof address) != 0) {
        (void)close(fd);
        return -1;
    }
    return fd;
}

static bool put(int fd, const char *text)
{
    const size_t length = strlen(text);
    return send(fd, text, length, MSG_DONTWAIT | MSG_NOSIGNAL) == (ssize_t)length;
}

/* Everybody who waits is told. */
static void lose(link_t *link)
{
    upstream_t *const self = link->upstream;
    link->fd = -1;
    link->length = 0;
    link->by[0] = '\0';
    for (unsigned i = 0; i < link->waits; i++) {
        self->calls->answer(self, &link->waiting[i], NULL);
    }
    link->waits = 0;
}

void upstream_closed(link_t *link)
{
    upstream_t *const self = link->upstream;
    const bool was_watch = link->kind == LINK_WATCH && link->fd >= 0;
    lose(link);
    if (was_watch && self->is_there) {
        self->is_there = false;
        self->status[0] = '\0';
        samples_reader_close(&self->samples);
        self->samples = (samples_reader_t){.header = NULL};
        self->calls->gone(self);
    }
}

static bool open_link(link_t *link)
{
    if (link->fd >= 0) {
        return true;
    }
    link->fd = join(link->upstream->path);
    if (link->fd < 0) {
        return false;
    }
    if (link->kind == LINK_WATCH) {
        char line[24];
        (void)snprintf(line, sizeof line, "watch %d\n", STATUS_HZ);
        (void)put(link->fd, line);
    }
    link->upstream->calls->watch_fd(link);
    return link->fd >= 0;
}

/* The descriptor comes with the first byte of the answer. */
static int receive_memory(int fd)
{
    char text[256];
    union {
        struct cmsghdr align;
        char bytes[CMSG_SPACE(sizeof(int))];
    } control;
    struct iovec part = {text, sizeof text};
    struct msghdr message = {
        .msg_iov = &part, .msg_iovlen = 1, .msg_control = control.bytes, .msg_controllen = sizeof control.bytes};
    int memory = -1;
    if (recvmsg(fd, &message, MSG_CMSG_CLOEXEC) <= 0) {
        return -1;
    }
    const struct cmsghdr *const head = CMSG_FIRSTHDR(&message);
    if (head != NULL && head->cmsg_level == SOL_SOCKET && head->cmsg_type == SCM_RIGHTS) {
        memcpy(&memory, CMSG_DATA(head), sizeof memory);
    }
    return memory;
}

static void open_samples(upstream_t *self)
{
    const struct timeval patience = {.tv_usec = PATIENCE_US};
    const int fd = self->samples.header == NULL ? join(self->path) : -1;
    if (fd < 0) {
        return;
    }
    (void)fcntl(fd, F_SETFL, 0); /* the one answer that is waited for, a little */
    (void)setsockopt(fd, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
    const int memory = put(fd, "samples\n") ? receive_memory(fd) : -1;
    if (memory >= 0) {
        if (samples_reader_open(&self->samples, memory) != NULL) {
            self->samples = (samples_reader_t){.header = NULL};
        }
        (void)close(memory);
    }
    (void)close(fd);
}

void upstream_connect(upstream_t *self)
{
    if (!open_link(&self->link[LINK_WATCH])) {
        return;
    }
    (void)open_link(&self->link[LINK_QUICK]);
    (void)open_link(&self->link[LINK_SLOW]);
}

const char *upstream_send(upstream_t *self, link_kind_t kind, const char *line, const asker_t *asker)
{
    link_t *const link = &self->link[kind];
    char text[UPSTREAM_REQUEST + UPSTREAM_NAME_MAX + 8];
    const bool is_named = asker->by[0] != '\0' && strcmp(asker->by, link->by) != 0;
    if (!open_link(link)) {
        return NO_CONNECTION;
    }
    if (link->waits + 2 > UPSTREAM_WAITING) {
        return "too many requests wait for heaved: try again";
    }
    (void)snprintf(text, sizeof text, "%s%s%s%s\n", is_named ? "by " : "", is_named ? asker->by : "", is_named ? "\n" : "", line);
    if (!put(link->fd, text)) { /* half a request may have gone: that connection is over */
        (void)shutdown(link->fd, SHUT_RDWR);
        return NO_CONNECTION;
    }
    if (is_named) {
        link->waiting[link->waits++] = (asker_t){.viewer = 0};
        (void)snprintf(link->by, sizeof link->by, "%s", asker->by);
    }
    link->waiting[link->waits++] = *asker;
    return NULL;
}

static const char k_good[] = "{\"ok\":true";

static void take_line(link_t *link, char *line)
{
    upstream_t *const self = link->upstream;
    if (link->kind == LINK_WATCH && strncmp(line, k_good, strlen(k_good)) != 0) {
        return; /* that it gives way to another client */
    }
    if (link->kind == LINK_WATCH) {
        (void)snprintf(self->status, UPSTREAM_LINE_MAX, "%s", line);
        const char *const percent = strstr(line, "\"now_percent\":");
        self->intensity = percent != NULL ? (unsigned)strtoul(percent + strlen("\"now_percent\":"), NULL, 10) : 0;
        if (!self->is_there) {
            self->is_there = true;
            open_samples(self);
        }
        self->calls->status(self);
        return;
    }
    if (link->waits == 0) {
        return; /* that it gives way to another client */
    }
    const asker_t asker = link->waiting[0];
    link->waits--;
    memmove(&link->waiting[0], &link->waiting[1], link->waits * sizeof link->waiting[0]);
    self->calls->answer(self, &asker, line);
}

bool upstream_readable(link_t *link)
{
    const ssize_t got = recv(link->fd, link->line + link->length, UPSTREAM_LINE_MAX - 1 - link->length, MSG_DONTWAIT);
    if (got <= 0) {
        return got < 0 && (errno == EAGAIN || errno == EINTR);
    }
    link->length += (size_t)got;
    char *end = NULL;
    while ((end = memchr(link->line, '\n', link->length)) != NULL) {
        const size_t used = (size_t)(end - link->line) + 1;
        *end = '\0';
        take_line(link, link->line);
        if (link->fd < 0) {
            return true;
        }
        link->length -= used;
        memmove(link->line, link->line + used, link->length);
    }
    return link->length < UPSTREAM_LINE_MAX - 1;
}
