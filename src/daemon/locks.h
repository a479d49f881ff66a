/* SPDX-License-Identifier: MIT
 * locks.h - files that one heaved at a time writes: life of the machine, operator log, black box, metrics.
 * Two on one of them would count backwards, and remove each other's lines and incidents.
 */
#ifndef HEAVE_DAEMON_LOCKS_H
#define HEAVE_DAEMON_LOCKS_H

#include "config/config.h"

#define LOCKS 4u

/** Descriptors of the locks, -1 = none. They end with the process, whatever ends it. */
typedef struct {
    int fd[LOCKS];
} locks_t;

/** Locks them, by a file `NAME.lock` beside each. Where that file cannot be created nothing is locked: what it stands for says so
 *  by itself. At the start; opens files.
 *  @return EXIT_DONE; EXIT_UNAVAILABLE: another heaved has one of them, which has been said */
int locks_acquire(locks_t *self, const config_t *config);

/** Releases them; harmless where locks_acquire() failed. */
void locks_release(locks_t *self);

#endif
