/* SPDX-License-Identifier: MIT
 * state_path.c - where a program keeps what outlives it; see state_path.h.
 */
#include "common/state_path.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

bool state_path(char *path, size_t capacity, const char *configured, const char *name)
{
    const char *const given = getenv("STATE_DIRECTORY");
    int needed = 0;
    path[0] = '\0';
    if (strcmp(configured, "none") != 0) {
        needed = snprintf(path, capacity, "%s", configured);
    } else if (given != NULL && given[0] == '/') {
        needed = snprintf(path, capacity, "%.*s%s", (int)strcspn(given, ":"), given, name);
    }
    return needed >= 0 && (size_t)needed < capacity;
}
