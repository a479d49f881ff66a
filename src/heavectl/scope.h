/* SPDX-License-Identifier: MIT
 * scope.h - heavectl scope: the samples of every cycle, as CSV, or as live columns on a terminal.
 */
#ifndef HEAVE_HEAVECTL_SCOPE_H
#define HEAVE_HEAVECTL_SCOPE_H

#include <signal.h>
#include <stdbool.h>
#include <stddef.h>

/** What to show, and for how long. */
typedef struct {
    const char *columns; /**< names, separated by commas; NULL: all of a file, the poses on a terminal */
    double for_s;        /**< 0 = until interrupted */
    unsigned hz;         /**< lines a second on a terminal */
    bool is_terminal;
    const volatile sig_atomic_t *is_interrupted;
} scope_t;

/** Receives the answer to `samples` and the descriptor that comes with it.
 *  @param line out: the answer, without its end
 *  @return the descriptor; -1: there was none, line says why where it is not empty */
int scope_receive(int socket_fd, char *line, size_t size);

/** Shows samples until time is up, an interrupt, or the end of heaved.
 *  @param error out: what is wrong where it returns an exit code that is not EXIT_DONE
 *  @return exit code */
int scope_run(const scope_t *self, int socket_fd, int samples_fd, char *error, size_t size);

#endif
