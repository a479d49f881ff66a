/* SPDX-License-Identifier: MIT
 * anew.c - see anew.h.
 */
#include "daemon/anew.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define NAME "HEAVE_STARTED_ANEW"

/* NAME=, a digit of anew_t, and why. Put into the environment at the start: nothing is allocated later. */
static char s_said[sizeof NAME + 1u + ANEW_WHY_MAX] = NAME "=0";

anew_t anew_read(char why[ANEW_WHY_MAX])
{
    const char *const value = getenv(NAME); // NOLINT(concurrency-mt-unsafe): no other thread yet
    const char *const said = value != NULL ? value : "0";
    const anew_t how = said[0] == '1' ? ANEW_APPLIED : said[0] == '2' ? ANEW_PUT_BACK : ANEW_NOT;
    (void)snprintf(why, ANEW_WHY_MAX, "%s", how == ANEW_PUT_BACK ? &said[1] : "");
    (void)putenv(s_said); // NOLINT(concurrency-mt-unsafe)
    return how;
}

void anew_start(char **argv, anew_t how, const char *why)
{
    (void)snprintf(s_said, sizeof s_said, NAME "=%u%s", (unsigned)how, why);
    (void)execv("/proc/self/exe", argv);
}
