/* SPDX-License-Identifier: MIT
 * lists.c - see lists.h.
 */
#include "heavectl/lists.h"

#include <stdbool.h>
#include <stdio.h>
#include <unistd.h>

#include "common/translate.h"
void lists_show_incidents(const cJSON *incidents)
{
    const cJSON *incident = NULL;
    cJSON_ArrayForEach(incident, incidents)
    {
        const cJSON *name = cJSON_GetObjectItemCaseSensitive(incident, "name");
        const bool is_seen = cJSON_IsTrue(cJSON_GetObjectItemCaseSensitive(incident, "seen"));
        printf(_("%s: %s\n"), cJSON_IsString(name) ? name->valuestring : "?", is_seen ? _("seen") : _("new"));
    }
    if (cJSON_GetArraySize(incidents) == 0) {
        printf(_("no incidents\n"));
    }
}

void lists_show_counts(const cJSON *answer)
{
    const cJSON *drive = NULL;
    cJSON_ArrayForEach(drive, cJSON_GetObjectItemCaseSensitive(answer, "drives"))
    {
        const cJSON *number = cJSON_GetObjectItemCaseSensitive(drive, "drive");
        const cJSON *state = cJSON_GetObjectItemCaseSensitive(drive, "state");
        const cJSON *counts = cJSON_GetObjectItemCaseSensitive(drive, "counts");
        const cJSON *mm = cJSON_GetObjectItemCaseSensitive(drive, "actual_mm");
        const cJSON *deg = cJSON_GetObjectItemCaseSensitive(drive, "actual_deg");
        const cJSON *actual = mm != NULL ? mm : deg;
        printf(_("drive %.0f: "), cJSON_IsNumber(number) ? number->valuedouble : 0.0);
        if (cJSON_IsNumber(counts)) {
            printf(_("%12.0f counts"), counts->valuedouble);
        } else {
            printf(_("           - counts"));
        }
        if (cJSON_IsNumber(actual)) {
            printf("  %11.3f %s", actual->valuedouble, mm != NULL ? "mm " : "deg");
        }
        printf("  %s%s%s", cJSON_IsString(state) ? translate(state->valuestring) : "?",
               cJSON_IsTrue(cJSON_GetObjectItemCaseSensitive(drive, "homed")) ? _(", homed") : _(", not homed"),
               cJSON_IsTrue(cJSON_GetObjectItemCaseSensitive(drive, "torque")) ? _(", torque") : "");
        printf("%s", isatty(STDOUT_FILENO) != 0 ? "\x1b[K\n" : "\n");
    }
}
