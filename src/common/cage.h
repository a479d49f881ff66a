/* SPDX-License-Identifier: MIT
 * cage.h - runs a function on data that nobody vouches for, in a process that can do no harm: it reads and writes what is open,
 * and ends (the strict mode of Linux's seccomp). Whatever the data makes of it, it reaches no file, no process and no network.
 */
#ifndef HEAVE_COMMON_CAGE_H
#define HEAVE_COMMON_CAGE_H

/** Results of cage_run() that are no code of the function. */
enum {
    CAGE_MISSING = -1, /**< this system has no such cage, or no process is left: the function has not run */
    CAGE_BROKEN = -2   /**< the process tried something else, crashed, or took too long, and was killed */
};

/** Runs the function in a child process and waits for its end. One thread. The function must not allocate, open or close
 * anything; its changes of memory are lost. A signal that ends the child from outside ends this process in the same way.
 *  @param output  a descriptor that stays open beside the standard ones
 *  @param seconds most processor time
 *  @return what the function returned, [0, 254]; or CAGE_MISSING or CAGE_BROKEN */
int cage_run(int (*run)(void *ctx), void *ctx, int output, unsigned seconds);

#endif
