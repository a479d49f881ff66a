/* SPDX-License-Identifier: MIT
 * contract.h - runs one list of tests on a table of backends; the name of a test starts with the backend's.
 * Include it instead of unity.h. A suite lists its tests by RUN_TEST as usual, in a function that is called once per backend.
 */
#ifndef CONTRACT_H
#define CONTRACT_H

#include <stdio.h>

#define RUN_TEST(function) contract_run(function, #function, __LINE__)

#include "unity.h"

/** Name of the backend under test; set by the suite's main. */
static const char *contract_backend;

static void contract_run(void (*function)(void), const char *name, int line)
{
    char full[160];
    (void)snprintf(full, sizeof full, "%s.%s", contract_backend, name);
    UnityDefaultTestRun(function, full, line);
}

#endif
