/* SPDX-License-Identifier: MIT
 * message.h - one line to the person in front of the program, and the program's exit codes.
 */
#ifndef HEAVE_COMMON_MESSAGE_H
#define HEAVE_COMMON_MESSAGE_H

#include <stddef.h>

/** Exit codes, with the numbers of sysexits.h. */
enum {
    EXIT_DONE = 0,
    EXIT_REFUSED = 1, /**< heavectl: heaved said no; heaved: ended by a second signal, or before every drive confirmed that its
                         torque is off; or --doctor found a fault */
    EXIT_BAD_USAGE = 64,
    EXIT_BAD_DATA = 65,
    EXIT_NO_INPUT = 66,
    EXIT_UNAVAILABLE = 69, /**< a device, a port or the daemon */
    EXIT_SOFTWARE = 70,
    EXIT_NO_OUTPUT = 73,
    EXIT_IO = 74,
    EXIT_BAD_CONFIG = 78
};

/** Prints `heaved: ` and a line to standard error, in one piece. No allocation.
 *  @return code, so that a caller can report and return at once */
int print_message(int code, const char *format, ...) __attribute__((format(printf, 2, 3)));

/** Keeps the newest line in a buffer, too, without its prefix: for who has to tell later why something failed. While there is one
 *  thread; NULL: no more. */
void print_message_keep(char *buffer, size_t size);

/** From now on a line waits as long as it takes: for a process that may only write. */
void print_message_wait(void);

#endif
