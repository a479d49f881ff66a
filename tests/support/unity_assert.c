/* SPDX-License-Identifier: MIT
 * unity_assert.c - an assertion of the program fails the test that runs. Weak: a test may have a handler of its own.
 */
#include <stdio.h>

#include "heave/status.h"
#include "unity.h"

__attribute__((weak)) void hv_assert_failed(const char *file, int line)
{
    char text[160];
    (void)snprintf(text, sizeof text, "assertion failed: %s:%d", file, line);
    TEST_FAIL_MESSAGE(text);
}
