/* SPDX-License-Identifier: MIT
 * upstream.c - see upstream.h.
 */
#include "panel/upstream.h"

#include <cjson/cJSON.h>
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <sys/un.h>
#include <unistd.h>

#include "common/sentence.h"

#define STATUS_HZ         10
#define PATIENCE_US       300000 /* for the memory of the samples, once per connection */
#define CONFIGURATION_MAX 131072 /* bytes, as heaved has it */
#define NO_CONNECTION     "heaved is not there"

bool upstream_init(upstream_t *self, const char *name, const char *path, const upstream_calls_t *calls)
{
    *self = (upstream_t){.calls = calls, .incidents = -1, .log = -1, .status = calloc(1, UPSTREAM_LINE_MAX)};
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

/* @param passing goes with the first byte; -1: none */
static bool put_with(int fd, const char *text, int passing)
{
    union {
        struct cmsghdr header;
        char bytes[CMSG_SPACE(sizeof(int))];
    } control;
    union {
        const char *in;
        char *out;
    } bytes = {.in = text}; /* sendmsg changes nothing */
    struct iovec part = {bytes.out, strlen(text)};
    struct msghdr message = {.msg_iov = &part, .msg_iovlen = 1};
    if (passing >= 0) {
        memset(&control, 0, sizeof control);
        message.msg_control = control.bytes;
        message.msg_controllen = sizeof control.bytes;
        struct cmsghdr *const head = CMSG_FIRSTHDR(&message);
        head->cmsg_level = SOL_SOCKET;
        head->cmsg_type = SCM_RIGHTS;
        head->cmsg_len = CMSG_LEN(sizeof passing);
        memcpy(CMSG_DATA(head), &passing, sizeof passing);
    }
    return sendmsg(fd, &message, MSG_DONTWAIT | MSG_NOSIGNAL) == (ssize_t)part.iov_len;
}

static bool put(int fd, const char *text)
{
    return put_with(fd, text, -1);
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

static void forget(int *fd)
{
    if (*fd >= 0) {
        (void)close(*fd);
    }
    *fd = -1;
}

static void forget_configuration(upstream_t *self)
{
    free(self->configuration.text);
    self->configuration = (configuration_t){.text = NULL};
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
        forget(&self->incidents);
        forget(&self->log);
        forget_configuration(self);
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

/* The descriptor comes with the first byte of the answer, which is one line. */
static int receive_descriptor(int fd, char *line, size_t size)
{
    union {
        struct cmsghdr align;
        char bytes[CMSG_SPACE(sizeof(int))];
    } control;
    struct iovec part = {line, size - 1};
    struct msghdr message = {
        .msg_iov = &part, .msg_iovlen = 1, .msg_control = control.bytes, .msg_controllen = sizeof control.bytes};
    int passed = -1;
    const ssize_t got = recvmsg(fd, &message, MSG_CMSG_CLOEXEC);
    line[got > 0 ? got : 0] = '\0';
    const struct cmsghdr *const head = got > 0 ? CMSG_FIRSTHDR(&message) : NULL;
    if (head != NULL && head->cmsg_level == SOL_SOCKET && head->cmsg_type == SCM_RIGHTS) {
        memcpy(&passed, CMSG_DATA(head), sizeof passed);
    }
    return passed;
}

/* The answers that are waited for, a little. @return a descriptor; -1: there is none, or it may not be had */
static int ask_descriptor(const upstream_t *self, const char *request, char *line, size_t size)
{
    const struct timeval patience = {.tv_usec = PATIENCE_US};
    const int fd = join(self->path);
    line[0] = '\0';
    if (fd < 0) {
        return -1;
    }
    (void)fcntl(fd, F_SETFL, 0);
    (void)setsockopt(fd, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
    const int passed = put(fd, request) ? receive_descriptor(fd, line, size) : -1;
    (void)close(fd);
    return passed;
}

static void open_samples(upstream_t *self)
{
    char line[256];
    const int memory = self->samples.header == NULL ? ask_descriptor(self, "samples\n", line, sizeof line) : -1;
    if (memory >= 0) {
        if (samples_reader_open(&self->samples, memory) != NULL) {
            self->samples = (samples_reader_t){.header = NULL};
        }
        (void)close(memory);
    }
}

/* Where incidents and the operator log are. What may be read there is the kernel's to say. */
static void open_folders(upstream_t *self)
{
    static const char k_file[] = "\"file\":\"";
    char line[256];
    self->incidents = ask_descriptor(self, "incident-folder\n", line, sizeof line);
    self->log = ask_descriptor(self, "operator-log\n", line, sizeof line);
    const char *const name = strstr(line, k_file);
    const size_t length = name != NULL ? strcspn(name + strlen(k_file), "\"") : 0;
    (void)snprintf(self->log_name, sizeof self->log_name, "%.*s", (int)length, length > 0 ? name + strlen(k_file) : "");
}

static bool receive_text(configuration_t *self, int fd, const cJSON *answer)
{
    const cJSON *const bytes = cJSON_GetObjectItemCaseSensitive(answer, "bytes");
    const double length = cJSON_IsNumber(bytes) ? bytes->valuedouble : -1;
    if (length < 0 || length > CONFIGURATION_MAX) {
        return false;
    }
    self->length = (size_t)length;
    self->text = malloc(self->length + 1u);
    if (self->text == NULL || pread(fd, self->text, self->length, 0) != (ssize_t)self->length) {
        return false;
    }
    self->text[self->length] = '\0';
    return true;
}

static void copy_text(char *out, size_t size, const cJSON *answer, const char *name)
{
    const cJSON *const item = cJSON_GetObjectItemCaseSensitive(answer, name);
    (void)snprintf(out, size, "%s", cJSON_IsString(item) ? item->valuestring : "");
}

/* Another one is in force than the one that is known. */
static void open_configuration(upstream_t *self, const char *digest, size_t length)
{
    char line[1024];
    configuration_t *const it = &self->configuration;
    forget_configuration(self);
    (void)snprintf(it->digest, sizeof it->digest, "%.*s", (int)length, digest);
    const int fd = length > 0 ? ask_descriptor(self, "configuration\n", line, sizeof line) : -1;
    cJSON *const answer = fd >= 0 ? cJSON_Parse(line) : NULL;
    if (answer != NULL && !receive_text(it, fd, answer)) {
        free(it->text);
        it->text = NULL;
    }
    copy_text(it->file, sizeof it->file, answer, "file");
    it->is_applied = cJSON_IsString(cJSON_GetObjectItemCaseSensitive(answer, "applied"));
    it->is_kept = cJSON_IsTrue(cJSON_GetObjectItemCaseSensitive(answer, "keeps"));
    cJSON_Delete(answer);
    forget(&(int){fd});
}

static void watch_configuration(upstream_t *self, const char *status)
{
    static const char k_digest[] = "\"digest\":\"";
    const char *const at = strstr(status, k_digest);
    const char *const digest = at != NULL ? at + sizeof k_digest - 1u : "";
    const size_t length = strcspn(digest, "\"");
    if (length < UPSTREAM_DIGEST_MAX &&
        (strlen(self->configuration.digest) != length || strncmp(self->configuration.digest, digest, length) != 0)) {
        open_configuration(self, digest, length);
    }
}

/* Looked up once for each reason: that takes longer than all else about a status. */
static void watch_put_back(upstream_t *self, const char *status)
{
    static const char k_put_back[] = "\"put_back\":";
    char out[SENTENCE_MAX];
    const char *const at = strstr(status, k_put_back);
    cJSON *const item = at != NULL ? cJSON_Parse(at + sizeof k_put_back - 1u) : NULL;
    const char *const why = cJSON_IsString(item) ? item->valuestring : "";
    if (strcmp(why, self->put_back) != 0) {
        (void)snprintf(self->put_back, sizeof self->put_back, "%s", why);
        self->put_back_zh[0] = '\0';
        const char *const chinese = sentence(self->put_back, out, sizeof out);
        cJSON *const text = chinese != self->put_back ? cJSON_CreateStringReference(chinese) : NULL;
        if (text != NULL && !cJSON_PrintPreallocated(text, self->put_back_zh, (int)sizeof self->put_back_zh, false)) {
            self->put_back_zh[0] = '\0'; /* longer than any */
        }
        cJSON_Delete(text);
    }
    cJSON_Delete(item);
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
    return upstream_send_with(self, kind, line, asker, -1);
}

const char *upstream_send_with(upstream_t *self, link_kind_t kind, const char *line, const asker_t *asker, int fd)
{
    link_t *const link = &self->link[kind];
    char text[UPSTREAM_HEARD + UPSTREAM_BY_MAX + 8];
    const bool is_named = asker->by[0] != '\0' && strcmp(asker->by, link->by) != 0;
    if (!open_link(link)) {
        return NO_CONNECTION;
    }
    if (link->waits + 2 > UPSTREAM_WAITING) {
        return UPSTREAM_BUSY;
    }
    (void)snprintf(text, sizeof text, "%s%s%s%s\n", is_named ? "by " : "", is_named ? asker->by : "", is_named ? "\n" : "", line);
    if (!put_with(link->fd, text, fd)) { /* half a request may have gone: that connection is over */
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

static void receive_line(link_t *link, char *line)
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
            open_folders(self);
        }
        watch_configuration(self, line);
        watch_put_back(self, line);
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
        receive_line(link, link->line);
        if (link->fd < 0) {
            return true;
        }
        link->length -= used;
        memmove(link->line, link->line + used, link->length);
    }
    return link->length < UPSTREAM_LINE_MAX - 1;
}
