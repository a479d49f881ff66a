/* SPDX-License-Identifier: MIT
 * scope.c - samples for people and files; see scope.h. A reader that is too slow loses records, says so at its end, and holds
 * nobody up.
 */
#include "heavectl/scope.h"

#include <errno.h>
#include <poll.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <time.h>

#include "common/message.h" // exit codes
#include "common/samples.h"
#include "common/translate.h"
#include "heavectl/ctl.h"

#define COLUMNS_MAX 128u
#define LOOK_MS     5 /* between looks into the memory */

static const char k_on_terminal[] = "t_ms,state,sent_roll_deg,sent_pitch_deg,sent_yaw_deg,sent_x_mm,sent_y_mm,sent_z_mm";

/* A run. */
typedef struct {
    const scope_t *scope;
    samples_reader_t reader;
    const samples_column_t *column[COLUMNS_MAX];
    unsigned columns;
} run_t;

int scope_receive(int socket_fd, char *line, size_t size)
{
    union {
        struct cmsghdr header;
        char bytes[CMSG_SPACE(sizeof(int))];
    } passed;
    struct iovec bytes = {line, size - 1u};
    struct msghdr message = {
        .msg_iov = &bytes, .msg_iovlen = 1, .msg_control = passed.bytes, .msg_controllen = sizeof passed.bytes};
    int fd = -1;
    ssize_t length;
    do {
        length = recvmsg(socket_fd, &message, MSG_CMSG_CLOEXEC);
    } while (length < 0 && errno == EINTR);
    line[length > 0 ? length : 0] = '\0';
    line[strcspn(line, "\n")] = '\0';
    const struct cmsghdr *header = length > 0 ? CMSG_FIRSTHDR(&message) : NULL;
    if (header != NULL && header->cmsg_level == SOL_SOCKET && header->cmsg_type == SCM_RIGHTS &&
        header->cmsg_len == CMSG_LEN(sizeof fd)) {
        memcpy(&fd, CMSG_DATA(header), sizeof fd);
    }
    return fd;
}

/* Returns false: a name that is none, which error tells. */
static bool choose_columns(run_t *self, char *error, size_t size)
{
    const samples_header_t *header = self->reader.header;
    const char *names = self->scope->columns;
    names = names == NULL && self->scope->is_terminal ? k_on_terminal : names;
    for (uint32_t i = 0; names == NULL && i < header->columns && i < COLUMNS_MAX; i++) {
        self->column[self->columns++] = samples_column(header, i);
    }
    while (names != NULL && self->columns < COLUMNS_MAX) {
        const size_t length = strcspn(names, ",");
        const samples_column_t *column = samples_column_named(header, names, length);
        if (column != NULL) {
            self->column[self->columns++] = column;
        } else if (names != k_on_terminal && self->scope->columns != NULL) {
            (void)snprintf(error, size, _("scope: %.*s is no column; `heavectl --for 0.1 scope | head -1` shows them all"),
                           (int)(length < 40 ? length : 40), names);
            return false;
        }
        names = names[length] == ',' ? &names[length + 1u] : NULL;
    }
    return true;
}

static void write_head(const run_t *self)
{
    for (unsigned i = 0; i < self->columns; i++) {
        printf(self->scope->is_terminal ? "%s%14s" : "%s%s",
               i == 0                     ? ""
               : self->scope->is_terminal ? " "
                                          : ",",
               self->column[i]->name);
    }
    printf("\n");
}

/* Whole numbers as such; what is scaled with its fraction. */
static void write_row(const run_t *self, const samples_record_t *record)
{
    for (unsigned i = 0; i < self->columns; i++) {
        const samples_column_t *column = self->column[i];
        const double value = samples_value(column, record);
        const int digits = column->scale == 1.0 ? 0 : self->scope->is_terminal || column->scale > 1e-4 ? 3 : 9;
        printf("%s%*.*f", i == 0 ? "" : self->scope->is_terminal ? " " : ",", self->scope->is_terminal ? 14 : 0, digits, value);
    }
    printf("\n");
}

static double now_s(void)
{
    struct timespec now = {0};
    (void)clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + (double)now.tv_nsec / 1e9;
}

/* Waits a moment. Returns false: heaved has closed the link, it has ended. */
static bool wait_a_moment(int socket_fd)
{
    struct pollfd wait = {.fd = socket_fd, .events = POLLIN};
    return poll(&wait, 1, LOOK_MS) <= 0 || (wait.revents & (POLLHUP | POLLIN)) == 0;
}

/* Everything that is there; on a terminal so many lines a second. */
static void write_rows(run_t *self, double *next_s)
{
    samples_record_t record;
    while (samples_reader_next(&self->reader, &record)) {
        const bool is_due = !self->scope->is_terminal || now_s() >= *next_s;
        if (is_due) {
            write_row(self, &record);
            *next_s = now_s() + 1.0 / self->scope->hz;
        }
    }
}

static int show(run_t *self, int socket_fd, char *error, size_t size)
{
    const double until_s = self->scope->for_s > 0 ? now_s() + self->scope->for_s : 0;
    double next_s = 0;
    bool is_alive = true;
    write_head(self);
    while (is_alive && *self->scope->is_interrupted == 0 && (until_s <= 0 || now_s() < until_s)) {
        is_alive = wait_a_moment(socket_fd);
        write_rows(self, &next_s);
        if (fflush(stdout) != 0) {
            (void)snprintf(error, size, _("standard output: %s"), error_text(errno));
            return EXIT_IO;
        }
    }
    if (self->reader.lost > 0) {
        (void)ctl_complain(EXIT_DONE, "scope: %llu records were overwritten before they could be written",
                           (unsigned long long)self->reader.lost);
    }
    if (!is_alive) {
        (void)snprintf(error, size, "%s", _("heaved has ended"));
        return EXIT_UNAVAILABLE;
    }
    return EXIT_DONE;
}

int scope_run(const scope_t *self, int socket_fd, int samples_fd, char *error, size_t size)
{
    run_t run = {.scope = self};
    const char *wrong = samples_reader_open(&run.reader, samples_fd);
    if (wrong != NULL) {
        (void)snprintf(error, size, "scope: %s", translate(wrong));
        return EXIT_UNAVAILABLE;
    }
    const int code = choose_columns(&run, error, size) ? show(&run, socket_fd, error, size) : EXIT_BAD_USAGE;
    samples_reader_close(&run.reader);
    return code;
}
