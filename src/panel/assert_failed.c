/* SPDX-License-Identifier: MIT
 * assert_failed.c - what heave-panel does where an assertion of the core fails; see heave/status.h.
 */
#include <stdio.h>
#include <stdlib.h>

#include "heave/status.h"

void hv_assert_failed(const char *file, int line)
{
    fprintf(stderr, "heave-panel: %s:%d: assertion failed, this is a bug\n", file, line);
    abort();
}
