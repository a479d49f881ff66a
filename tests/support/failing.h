/* SPDX-License-Identifier: MIT
 * failing.h - calls of the system that fail when a test says so: for tests that put functions of their own in the system's place.
 *
 * Each such function asks failing_error() first, with the address that it returns to: that is the place in the sources, and a
 * place fails, not a function. failing_sweep() runs a trial as it is, and then again and again with one place failing with one of
 * the errors of its function, once or from then on. HEAVE_FAILED_PLACES names a file which the places that failed are added to,
 * for tests/system/test_syscalls.py, which knows whether that is all of them. Threads may ask at any time; all else is the
 * test's.
 */
#ifndef FAILING_H
#define FAILING_H

#include <stdbool.h>

#define FAILING_ERRORS_MAX 16

/** What a function can fail with; 0 ends the list where it is shorter. */
typedef struct {
    const char *function;
    int error[FAILING_ERRORS_MAX];
} failing_errors_t;

/** To be asked by each stand-in first: FAILING("socket", -1) returns -1 with errno where this call is to fail. */
#define FAILING(function, result)                                                                                                \
    do {                                                                                                                         \
        const int failing = failing_error(function, __builtin_return_address(0));                                                \
        if (failing != 0) {                                                                                                      \
            errno = failing;                                                                                                     \
            return result;                                                                                                       \
        }                                                                                                                        \
    } while (0)

/** The same for functions that return the number of the error. */
#define FAILING_NUMBER(function)                                                                                                 \
    do {                                                                                                                         \
        const int failing = failing_error(function, __builtin_return_address(0));                                                \
        if (failing != 0) {                                                                                                      \
            return failing;                                                                                                      \
        }                                                                                                                        \
    } while (0)

/** The error that this call is to fail with, 0 for none. */
int failing_error(const char *function, const void *returns_to);

/** From here on the place under trial may fail: called by a trial, once or where it likes. */
void failing_begin(void);

/** From here on nothing fails. */
void failing_end(void);

/** How many calls have failed since failing_begin(). */
unsigned failing_count(void);

/** "socket at 0x1234 fails with EMFILE for ever", or "nothing fails": for messages. */
const char *failing_text(void);

/** Whether the place under trial is a call of that function. */
bool failing_is(const char *function);

/** Runs the trial with each place that it reaches, each error, once and for ever. A function that is not in the list is a failure
 * of the test.
 *  @param errors  ends with function NULL
 *  @return how many trials met their failure */
unsigned failing_sweep(const failing_errors_t *errors, void (*trial)(void));

#endif
