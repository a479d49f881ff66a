/* SPDX-License-Identifier: MIT
 * assert_failed.c - what a program does where an assertion of the core fails, unless it has a way of its own; see heave/status.h.
 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>

#include "heave/status.h"

void hv_assert_failed(const char *file, int line)
{
    fprintf(stderr, "%s: %s:%d: assertion failed, this is a bug\n", program_invocation_short_name, file, line);
    abort();
}
