/* SPDX-License-Identifier: MIT
 * selftest_seen.c - see selftest_seen.h.
 */
#include "heavectl/selftest_seen.h"

#include <string.h>

#include "heavectl/heaved_link.h"

bool selftest_is_estop(const cJSON *status)
{
    return heaved_link_is_set(status, "estop_active");
}
bool selftest_is_no_estop(const cJSON *status)
{
    return !heaved_link_is_set(status, "estop_active");
}
bool selftest_is_failing(const cJSON *status)
{
    return heaved_link_is_set(status, "power_failing");
}
bool selftest_is_supplied(const cJSON *status)
{
    return !heaved_link_is_set(status, "power_failing");
}
bool selftest_is_out(const cJSON *status)
{
    return strcmp(heaved_link_text(status, "state"), "SERVICE") != 0;
}

/* Every drive has torque, and its zero too. */
static bool has_all(const cJSON *counts, const char *what)
{
    const cJSON *drive = NULL;
    bool has = cJSON_GetArraySize(cJSON_GetObjectItemCaseSensitive(counts, "drives")) > 0;
    cJSON_ArrayForEach(drive, cJSON_GetObjectItemCaseSensitive(counts, "drives"))
    {
        has = has && heaved_link_is_set(drive, what);
    }
    return has;
}

bool selftest_has_torque(const cJSON *counts)
{
    return has_all(counts, "torque");
}
bool selftest_is_homed(const cJSON *counts)
{
    return has_all(counts, "homed");
}
