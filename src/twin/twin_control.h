/* SPDX-License-Identifier: MIT
 * twin_control.h - the socket of heave-twin: a line is a fault, `status` or `pose`; the answer is a line too. And its client.
 */
#ifndef HEAVE_TWIN_TWIN_CONTROL_H
#define HEAVE_TWIN_TWIN_CONTROL_H

#include <poll.h>

#include "twin/twin_faults.h"

#define CONTROL_CLIENTS_MAX 4u
#define CONTROL_FDS_MAX     (CONTROL_CLIENTS_MAX + 1u)
#define CONTROL_LINE_MAX    160u

/** A client and what it has said of a line. */
typedef struct {
    int fd; /**< -1 = none */
    size_t length;
    char line[CONTROL_LINE_MAX];
} control_client_t;

/** The socket. */
typedef struct {
    int fd; /**< -1 = none */
    const char *path;
    control_client_t client[CONTROL_CLIENTS_MAX];
} control_t;

/** Opens it; one that nobody listens at any more is replaced. path stays the caller's; NULL: there is none.
 *  @param why what is wrong, where false is returned */
bool control_open(control_t *self, const char *path, char why[FAULT_WHY_MAX]);

void control_close(control_t *self);

/** What to wait for; returns how many. */
unsigned control_watch(const control_t *self, struct pollfd fds[CONTROL_FDS_MAX]);

/** Serves who waits. */
void control_serve(control_t *self, twin_t *twin, uint64_t now_us);

/** Asks a heave-twin and prints its answer; returns an exit code. */
int control_ask(const char *path, const char *line);

#endif
