/* SPDX-License-Identifier: MIT
 * script.c - faults with times; see script.h.
 */
#include "twin/script.h"

#include <errno.h>
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

#define SECONDS_MAX 1e6
#define SECOND_US   1e6

static bool reject_time(const char *line, char why[FAULT_WHY_MAX])
{
    (void)snprintf(why, FAULT_WHY_MAX,
                   "%.*s is no time: seconds since the start as 2.5, or since all drives had torque as +2.5; at most 1000000",
                   (int)strcspn(line, " \t"), line);
    return false;
}

bool script_add(script_t *self, const char *line, unsigned drives, char why[FAULT_WHY_MAX])
{
    const bool is_after = line[0] == '+';
    const char *number = line + (is_after ? 1 : 0);
    char *end = NULL;
    const double seconds = strtod(number, &end);
    const bool is_number = strspn(number, "0123456789.") == (size_t)(end - number) && end != number;
    if (!is_number || (*end != ' ' && *end != '\t') || !(seconds <= SECONDS_MAX)) {
        return reject_time(line, why);
    }
    if (self->count == SCRIPT_MAX || strlen(line) >= SCRIPT_LINE_MAX) {
        (void)snprintf(why, FAULT_WHY_MAX, "too much: at most %u lines of %u characters", SCRIPT_MAX, SCRIPT_LINE_MAX - 1);
        return false;
    }
    if (is_after && self->machine.kind == TWIN_DRIVES_NONE) {
        (void)snprintf(why, FAULT_WHY_MAX,
                       "%.*s counts since the drives had torque, and heaved simulates them: write a time since the start",
                       (int)strcspn(line, " \t"), line);
        return false;
    }
    script_entry_t *entry = &self->entry[self->count];
    *entry = (script_entry_t){.is_after_enabled = is_after, .at_us = (uint64_t)(seconds * SECOND_US)};
    if (!fault_read(&entry->fault, end, drives, why) || !fault_suits(&entry->fault, &self->machine, why)) {
        return false;
    }
    (void)snprintf(entry->text, sizeof entry->text, "%s", end + strspn(end, " \t"));
    self->count++;
    return true;
}

static void trim(char *line)
{
    size_t length = strcspn(line, "#\r\n");
    while (length > 0 && (line[length - 1] == ' ' || line[length - 1] == '\t')) {
        length--;
    }
    line[length] = '\0';
}

int script_load(script_t *self, const char *path, unsigned drives, FILE *errors)
{
    char line[2 * SCRIPT_LINE_MAX];
    char why[FAULT_WHY_MAX];
    int wrong = 0;
    FILE *file = fopen(path, "r");
    if (file == NULL) {
        fprintf(errors, "heave-twin: %s: %s\n", path, strerror(errno));
        return -1;
    }
    for (unsigned number = 1; fgets(line, sizeof line, file) != NULL; number++) {
        trim(line);
        const char *from = line + strspn(line, " \t");
        if (*from != '\0' && !script_add(self, from, drives, why)) {
            fprintf(errors, "%s:%u: %s\n", path, number, why);
            wrong++;
        }
    }
    const bool is_read = ferror(file) == 0;
    (void)fclose(file);
    if (!is_read) {
        fprintf(errors, "heave-twin: %s cannot be read\n", path);
    }
    return is_read ? wrong : -1;
}

/* DRIVE_NEVER where it is done, or not known yet. */
static uint64_t entry_due_us(const script_entry_t *entry, uint64_t start_us, uint64_t enabled_us)
{
    if (entry->is_done || (entry->is_after_enabled && enabled_us == 0)) {
        return DRIVE_NEVER;
    }
    return (entry->is_after_enabled ? enabled_us : start_us) + entry->at_us;
}

uint64_t script_due_us(const script_t *self, uint64_t start_us, uint64_t enabled_us)
{
    uint64_t due_us = DRIVE_NEVER;
    for (unsigned i = 0; i < self->count; i++) {
        const uint64_t entry_us = entry_due_us(&self->entry[i], start_us, enabled_us);
        due_us = entry_us < due_us ? entry_us : due_us;
    }
    return due_us;
}

void script_run(script_t *self, twin_t *twin, uint64_t start_us, uint64_t now_us, FILE *out)
{
    char why[FAULT_WHY_MAX];
    for (unsigned i = 0; i < self->count; i++) {
        script_entry_t *entry = &self->entry[i];
        if (now_us >= entry_due_us(entry, start_us, twin->enabled_us)) {
            const bool is_made = fault_do(&entry->fault, twin, now_us, why);
            entry->is_done = true;
            fprintf(out, "heave-twin: %" PRIu64 ".%03u s: %s%s%s\n", (now_us - start_us) / 1000000u,
                    (unsigned)((now_us - start_us) / 1000u % 1000u), entry->text, is_made ? "" : ": ", is_made ? "" : why);
        }
    }
}
