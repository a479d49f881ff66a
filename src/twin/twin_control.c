/* SPDX-License-Identifier: MIT
 * twin_control.c - the socket of heave-twin; see twin_control.h.
 */
#include "twin/twin_control.h"

#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include "common/message.h" // exit codes

#define ANSWER_MAX 4096u
#define BACKLOG    4

static bool address_of(const char *path, struct sockaddr_un *out)
{
    *out = (struct sockaddr_un){.sun_family = AF_UNIX};
    if (strlen(path) >= sizeof out->sun_path) {
        return false;
    }
    memcpy(out->sun_path, path, strlen(path));
    return true;
}

static int join(const struct sockaddr_un *address)
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

bool control_open(control_t *self, const char *path, char why[FAULT_WHY_MAX])
{
    struct sockaddr_un address;
    *self = (control_t){.fd = -1};
    for (unsigned i = 0; i < CONTROL_CLIENTS_MAX; i++) {
        self->client[i].fd = -1;
    }
    if (path == NULL) {
        return true;
    }
    if (!address_of(path, &address)) {
        (void)snprintf(why, FAULT_WHY_MAX, "a socket's path has at most 107 characters");
        return false;
    }
    const int other = join(&address);
    if (other >= 0) {
        (void)close(other);
        (void)snprintf(why, FAULT_WHY_MAX, "another program listens there already");
        return false;
    }
    if (errno == ECONNREFUSED) {
        (void)unlink(path);
    }
    self->fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    if (self->fd < 0 || bind(self->fd, (const struct sockaddr *)&address, sizeof address) != 0 ||
        listen(self->fd, BACKLOG) != 0) {
        (void)snprintf(why, FAULT_WHY_MAX, "%s", strerror(errno));
        return false;
    }
    self->path = path;
    return true;
}

static void drop(control_client_t *client)
{
    if (client->fd >= 0) {
        (void)close(client->fd);
    }
    client->fd = -1;
    client->length = 0;
}

void control_close(control_t *self)
{
    for (unsigned i = 0; i < CONTROL_CLIENTS_MAX; i++) {
        drop(&self->client[i]);
    }
    if (self->fd >= 0) {
        (void)close(self->fd);
    }
    if (self->path != NULL) {
        (void)unlink(self->path);
    }
    self->fd = -1;
    self->path = NULL;
}

unsigned control_watch(const control_t *self, struct pollfd fds[CONTROL_FDS_MAX])
{
    unsigned count = 0;
    if (self->fd >= 0) {
        fds[count++] = (struct pollfd){.fd = self->fd, .events = POLLIN};
    }
    for (unsigned i = 0; i < CONTROL_CLIENTS_MAX; i++) {
        if (self->client[i].fd >= 0) {
            fds[count++] = (struct pollfd){.fd = self->client[i].fd, .events = POLLIN};
        }
    }
    return count;
}

/* --- Answers --- */

static const char *state_name(const node_t *node)
{
    if (!node->is_powered) {
        return "no power";
    }
    switch (node->drive.state) {
    case TWIN_NOT_READY:
        return "not ready";
    case TWIN_DISABLED:
        return "switch on disabled";
    case TWIN_READY:
        return "ready";
    case TWIN_ON:
        return "switched on";
    case TWIN_ENABLED:
        return "operation enabled";
    case TWIN_QUICK_STOP:
        return "quick stop";
    case TWIN_REACTION:
        return "fault reaction";
    case TWIN_FAULT:
        return "fault";
    }
    return "?";
}

static const char *register_state_name(const register_drive_t *drive)
{
    static const char *const k_names[] = {"no torque", "torque", "homing", "fault"};
    return drive->is_powered ? k_names[drive->state] : "no power";
}

static size_t answer_register_drive(char *out, size_t size, twin_t *twin, unsigned k)
{
    const register_drive_t *drive = &twin->modbus.drive[k];
    return (size_t)snprintf(out, size,
                            "%s{\"drive\": %u, \"unit\": %u, \"leg\": %u, \"state\": \"%s\", \"alarm\": %" PRIu32
                            ", \"counts\": %" PRId32 ", \"position\": %.4f, \"error\": %.4f, \"set_points\": %" PRIu32 "}",
                            k == 0 ? "" : ", ", k + 1, drive->axis->unit, twin->leg_of[k] + 1u, register_state_name(drive),
                            drive->alarm, register_drive_count(drive), twin_position(twin, k),
                            motor_error(drive->motor) / twin->per_unit[k], drive->set_points);
}

static const char *frame_state_name(const frame_drive_t *drive)
{
    static const char *const k_names[] = {"no torque", "torque", "homing", "fault"};
    return drive->is_powered ? k_names[drive->state] : "no power";
}

static size_t answer_frame_drive(char *out, size_t size, twin_t *twin, unsigned k)
{
    const frame_drive_t *drive = &twin->frame[k];
    return (size_t)snprintf(out, size,
                            "%s{\"drive\": %u, \"id\": %" PRIu32 ", \"leg\": %u, \"state\": \"%s\", \"alarm\": %" PRIu32
                            ", \"counts\": %" PRId64 ", \"position\": %.4f, \"error\": %.4f, \"set_points\": %" PRIu32 "}",
                            k == 0 ? "" : ", ", k + 1, drive->axis->command_id, twin->leg_of[k] + 1u, frame_state_name(drive),
                            drive->fault_code, frame_drive_count(drive), twin_position(twin, k),
                            motor_error(drive->motor) / twin->per_unit[k], drive->set_points);
}

/* The coils that are on, from 0. */
static size_t answer_board(char *out, size_t size, const modbus_board_t *board)
{
    size_t at = (size_t)snprintf(out, size, "], \"coils\": [");
    const char *comma = "";
    for (unsigned i = 0; i < MODBUS_COILS_MAX && at < size; i++) {
        if (board->coil[i]) {
            at += (size_t)snprintf(out + at, size - at, "%s%u", comma, i);
            comma = ", ";
        }
    }
    return at;
}

/* One JSON object; each drive where it really is. */
static void answer_status(char *out, twin_t *twin, uint64_t now_us)
{
    pose_t pose;
    size_t at = (size_t)snprintf(out, ANSWER_MAX, "{\"ok\": true, \"drives\": [");
    for (unsigned k = 0; k < twin->drives && at < ANSWER_MAX; k++) {
        const node_t *node = &twin->node[k];
        if (twin->kind == TWIN_DRIVES_FRAMES) {
            at += answer_frame_drive(out + at, ANSWER_MAX - at, twin, k);
            continue;
        }
        if (twin->kind == TWIN_DRIVES_MODBUS) {
            at += answer_register_drive(out + at, ANSWER_MAX - at, twin, k);
            continue;
        }
        at += (size_t)snprintf(out + at, ANSWER_MAX - at,
                               "%s{\"drive\": %u, \"node\": %u, \"leg\": %u, \"state\": \"%s\", \"counts\": %" PRId32
                               ", \"position\": %.4f, \"error\": %.4f, \"temperature_c\": %.1f, \"set_points\": %" PRIu32 "}",
                               k == 0 ? "" : ", ", k + 1, node->number, twin->leg_of[k] + 1u, state_name(node),
                               drive_count(&node->drive), twin_position(twin, k),
                               motor_error(&node->drive.motor) / twin->per_unit[k], node->drive.motor.temperature_c,
                               node->drive.set_points);
    }
    const bool has_pose = twin_find_pose(twin, &pose);
    if (twin->modbus.board.is_there && at < ANSWER_MAX) {
        at += answer_board(out + at, ANSWER_MAX - at, &twin->modbus.board);
    }
    at += (size_t)snprintf(out + at, ANSWER_MAX - at, "]");
    if (twin->lines != NULL && at < ANSWER_MAX) {
        at += lines_status(twin->lines, now_us, out + at, ANSWER_MAX - at);
    }
    at += (size_t)snprintf(out + at, ANSWER_MAX - at, ", \"pose\": %s", has_pose ? "[" : "null");
    for (unsigned i = 0; i < POSE_AXES && has_pose; i++) {
        at +=
            (size_t)snprintf(out + at, ANSWER_MAX - at, "%s%.4f", i == 0 ? "" : ", ", (double)pose.axis_q32[i] / (double)Q32_ONE);
    }
    (void)snprintf(out + at, ANSWER_MAX - at, "%s}\n", has_pose ? "]" : "");
}

static void answer(control_client_t *client, const char *line, twin_t *twin, uint64_t now_us)
{
    char out[ANSWER_MAX];
    char why[FAULT_WHY_MAX];
    fault_t fault;
    if (strcmp(line, "status") == 0) {
        answer_status(out, twin, now_us);
    } else if (fault_read(&fault, line, twin->drives, why) && fault_do(&fault, twin, now_us, why)) {
        (void)snprintf(out, sizeof out, "ok\n");
    } else {
        (void)snprintf(out, sizeof out, "error: %s\n", why);
    }
    if (send(client->fd, out, strlen(out), MSG_DONTWAIT | MSG_NOSIGNAL) < 0) {
        drop(client);
    }
}

static void hear(control_client_t *client, twin_t *twin, uint64_t now_us)
{
    const ssize_t length = recv(client->fd, client->line + client->length, CONTROL_LINE_MAX - client->length, MSG_DONTWAIT);
    if (length <= 0) {
        if (length == 0 || (errno != EAGAIN && errno != EWOULDBLOCK && errno != EINTR)) {
            drop(client);
        }
        return;
    }
    client->length += (size_t)length;
    char *end = NULL;
    while (client->fd >= 0 && (end = memchr(client->line, '\n', client->length)) != NULL) {
        const size_t used = (size_t)(end - client->line) + 1;
        char line[CONTROL_LINE_MAX];
        memcpy(line, client->line, used);
        line[used - 1] = '\0';
        memmove(client->line, client->line + used, client->length - used);
        client->length -= used;
        answer(client, line, twin, now_us);
    }
    if (client->length == CONTROL_LINE_MAX) { /* no such line is ours */
        drop(client);
    }
}

void control_serve(control_t *self, twin_t *twin, uint64_t now_us)
{
    const int fd = self->fd >= 0 ? accept4(self->fd, NULL, NULL, SOCK_NONBLOCK | SOCK_CLOEXEC) : -1;
    bool is_taken = fd < 0;
    for (unsigned i = 0; i < CONTROL_CLIENTS_MAX; i++) {
        control_client_t *client = &self->client[i];
        if (client->fd >= 0) {
            hear(client, twin, now_us);
        } else if (!is_taken) {
            client->fd = fd;
            client->length = 0;
            is_taken = true;
        }
    }
    if (!is_taken) {
        (void)close(fd);
    }
}

/* --- The client --- */

int control_ask(const char *path, const char *line)
{
    struct sockaddr_un address;
    char text[ANSWER_MAX];
    size_t length = 0;
    const int fd = address_of(path, &address) ? join(&address) : -1;
    if (fd < 0) {
        fprintf(stderr, "heave-twin: nobody answers at %s: start heave-twin --config FILE --socket %s\n", path, path);
        return EXIT_UNAVAILABLE;
    }
    (void)snprintf(text, sizeof text, "%s\n", line);
    if (send(fd, text, strlen(text), MSG_NOSIGNAL) < 0) {
        (void)close(fd);
        return EXIT_UNAVAILABLE;
    }
    while (length + 1 < sizeof text) {
        const ssize_t got = recv(fd, text + length, sizeof text - 1 - length, 0);
        if (got <= 0) {
            break;
        }
        length += (size_t)got;
        if (text[length - 1] == '\n') {
            break;
        }
    }
    text[length] = '\0';
    (void)close(fd);
    if (length == 0) {
        fprintf(stderr, "heave-twin: no answer from %s\n", path);
        return EXIT_UNAVAILABLE;
    }
    const bool is_refused = strncmp(text, "error: ", 7) == 0;
    fputs(text, is_refused ? stderr : stdout);
    return is_refused ? EXIT_REFUSED : EXIT_DONE;
}
