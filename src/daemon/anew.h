/* SPDX-License-Identifier: MIT
 * anew.h - heaved in place of itself, with another configuration: what the new image of the process is told by the one before.
 * In the environment, which outlives it. By the one thread there is.
 */
#ifndef HEAVE_DAEMON_ANEW_H
#define HEAVE_DAEMON_ANEW_H

#define ANEW_WHY_MAX 240u

/** How this image of the process has begun. */
typedef enum {
    ANEW_NOT,     /**< somebody has started it */
    ANEW_APPLIED, /**< with what was just applied */
    ANEW_PUT_BACK /**< what was applied could not be started: with the configuration before it */
} anew_t;

/** Once, at the start: how it has begun; the environment says ANEW_NOT from then on.
 *  @param why out: of ANEW_PUT_BACK, what could not be started and why; else "" */
anew_t anew_read(char why[ANEW_WHY_MAX]);

/** The same program with the same arguments, in place of this one. What the next anew_read() returns is how and why.
 *  @return it does only where that fails; errno says why */
void anew_start(char **argv, anew_t how, const char *why);

#endif
