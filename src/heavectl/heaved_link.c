/* SPDX-License-Identifier: MIT
 * heaved_link.c - see heaved_link.h.
 */
#include "heavectl/heaved_link.h"

#include <poll.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

#include "common/translate.h"
#define ANSWER_MS 5000
#define LOOK_MS   HEAVED_LINK_LOOK_MS

int64_t heaved_link_now_ms(void)
{
    struct timespec now = {0};
    (void)clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000 + now.tv_nsec / 1000000;
}

int heaved_link_open(const char *path)
{
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    if (strlen(path) >= sizeof address.sun_path) {
        return -1;
    }
    memcpy(address.sun_path, path, strlen(path));
    const int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    if (fd >= 0 && connect(fd, (const struct sockaddr *)&address, sizeof address) != 0) {
        (void)close(fd);
        return -1;
    }
    return fd;
}

cJSON *heaved_link_ask(heaved_link_t *self, const char *request)
{
    char line[96];
    size_t length = 0;
    const int64_t until_ms = heaved_link_now_ms() + ANSWER_MS;
    const int bytes = snprintf(line, sizeof line, "%s\n", request);
    if (send(self->fd, line, (size_t)bytes, MSG_NOSIGNAL) != bytes) {
        return NULL;
    }
    while (length < sizeof self->line - 1 && heaved_link_now_ms() < until_ms) {
        struct pollfd wait = {.fd = self->fd, .events = POLLIN};
        if (poll(&wait, 1, LOOK_MS) <= 0) {
            continue;
        }
        const ssize_t received = recv(self->fd, &self->line[length], sizeof self->line - 1 - length, 0);
        if (received <= 0) {
            return NULL;
        }
        length += (size_t)received;
        self->line[length] = '\0';
        if (self->line[length - 1] == '\n') {
            return cJSON_Parse(self->line);
        }
    }
    return NULL;
}

const char *heaved_link_text(const cJSON *object, const char *name)
{
    const cJSON *item = cJSON_GetObjectItemCaseSensitive(object, name);
    return cJSON_IsString(item) ? item->valuestring : "";
}

double heaved_link_number(const cJSON *object, const char *name)
{
    const cJSON *item = cJSON_GetObjectItemCaseSensitive(object, name);
    return cJSON_IsNumber(item) ? item->valuedouble : 0.0;
}

bool heaved_link_is_set(const cJSON *object, const char *name)
{
    return cJSON_IsTrue(cJSON_GetObjectItemCaseSensitive(object, name));
}

bool heaved_link_has_done(heaved_link_t *self, const char *request, char error[HEAVED_LINK_ERROR_MAX])
{
    cJSON *answer = heaved_link_ask(self, request);
    const bool is_done = heaved_link_is_set(answer, "ok");
    (void)snprintf(error, HEAVED_LINK_ERROR_MAX, "%s",
                   is_done          ? ""
                   : answer != NULL ? heaved_link_text(answer, "error")
                                    : N_("heaved does not answer"));
    self->is_over = self->is_over || answer == NULL;
    cJSON_Delete(answer);
    return is_done;
}

/* A line from the person, without blocking: 0, or its first letter. */
static int typed(void)
{
    char line[64];
    struct pollfd wait = {.fd = STDIN_FILENO, .events = POLLIN};
    if (poll(&wait, 1, 0) <= 0) {
        return '\0';
    }
    const ssize_t length = read(STDIN_FILENO, line, sizeof line);
    return length <= 0 ? 'q' : line[0];
}

int heaved_link_wait(heaved_link_t *self, const char *request, heaved_link_seen_t is_seen, int64_t most_ms)
{
    const int64_t until_ms = heaved_link_now_ms() + most_ms;
    const struct timespec pause = {.tv_nsec = LOOK_MS * 1000000L};
    while (heaved_link_now_ms() < until_ms && *self->is_interrupted == 0) {
        cJSON *answer = heaved_link_ask(self, request);
        const bool is_there = answer != NULL && is_seen(answer);
        const bool is_gone = answer == NULL;
        cJSON_Delete(answer);
        if (is_there) {
            return 'y';
        }
        const int key = typed();
        if (is_gone || key == 'q' || key == 's') {
            self->is_over = self->is_over || is_gone || key == 'q';
            return is_gone ? 'q' : key;
        }
        (void)nanosleep(&pause, NULL);
    }
    self->is_over = self->is_over || *self->is_interrupted != 0;
    return self->is_over ? 'q' : 'n';
}

int heaved_link_question(heaved_link_t *self, const char *text)
{
    char line[64];
    for (;;) {
        (void)tcflush(STDIN_FILENO, TCIFLUSH);
        printf(_("%s [y/n, s leaves it out, q ends] "), text);
        (void)fflush(stdout);
        const ssize_t length = read(STDIN_FILENO, line, sizeof line);
        const int key = length > 0 ? line[0] : 'q';
        if (length <= 0 || *self->is_interrupted != 0 || key == 'q') {
            self->is_over = true;
            return 'q';
        }
        if (key == 'y' || key == 'n' || key == 's') {
            return key;
        }
    }
}
