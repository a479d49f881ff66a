/* SPDX-License-Identifier: MIT
 * selftest_report.c - what a self-test has found; see selftest_report.h.
 */
#include "heavectl/selftest_report.h"

#include <cjson/cJSON.h>
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "common/columns.h"
#include "common/translate.h"
#include "common/sentence.h"
#define RESULT_COLUMNS 8u

static const char *result_name(selftest_result_t result)
{
    static const char *const k_names[] = {N_("passed"), N_("failed"), N_("skipped"), N_("unused")};
    return k_names[result];
}

void selftest_note(selftest_report_t *self, const char *name, selftest_result_t result, const char *note, const char *shown)
{
    if (self->items < SELFTEST_ITEMS_MAX) {
        selftest_item_t *item = &self->item[self->items++];
        item->result = result;
        (void)snprintf(item->name, sizeof item->name, "%s", name);
        (void)snprintf(item->note, sizeof item->note, "%s", note);
    }
    const char *word = translate(result_name(result));
    char own[SELFTEST_NOTE_MAX];
    printf("  %s%*s %s%s%s\n", word, columns_lacking(word, RESULT_COLUMNS), "", sentence(name, own, sizeof own),
           shown[0] != '\0' ? _(": ") : "", shown);
    (void)fflush(stdout);
}

bool selftest_has_passed(const selftest_report_t *self)
{
    unsigned passed = 0, others = 0;
    for (unsigned i = 0; i < self->items; i++) {
        passed += self->item[i].result == SELFTEST_PASSED;
        others += self->item[i].result == SELFTEST_FAILED || self->item[i].result == SELFTEST_SKIPPED;
    }
    return passed > 0 && others == 0;
}

static cJSON *report_of(const selftest_report_t *self, const char *configuration, const char *version, const char *build)
{
    char when[32];
    const time_t now = time(NULL);
    struct tm date = {0};
    (void)gmtime_r(&now, &date);
    (void)strftime(when, sizeof when, "%Y-%m-%dT%H:%M:%SZ", &date);
    cJSON *report = cJSON_CreateObject();
    (void)cJSON_AddStringToObject(report, "when", when);
    (void)cJSON_AddNumberToObject(report, "uid", (double)getuid());
    (void)cJSON_AddStringToObject(report, "configuration", configuration);
    (void)cJSON_AddStringToObject(report, "version", version);
    (void)cJSON_AddStringToObject(report, "build", build);
    (void)cJSON_AddBoolToObject(report, "passed", selftest_has_passed(self));
    cJSON *items = cJSON_AddArrayToObject(report, "items");
    for (unsigned i = 0; i < self->items; i++) {
        cJSON *item = cJSON_CreateObject();
        (void)cJSON_AddStringToObject(item, "name", self->item[i].name);
        (void)cJSON_AddStringToObject(item, "result", result_name(self->item[i].result));
        (void)cJSON_AddStringToObject(item, "note", self->item[i].note);
        (void)cJSON_AddItemToArray(items, item);
    }
    return report;
}

int selftest_write(const selftest_report_t *self, const char *file, const char *configuration, const char *version,
                   const char *build)
{
    char part[512];
    if (snprintf(part, sizeof part, "%s.new", file) >= (int)sizeof part) {
        return ENAMETOOLONG;
    }
    cJSON *report = report_of(self, configuration, version, build);
    char *text = cJSON_Print(report);
    cJSON_Delete(report);
    FILE *out = text != NULL ? fopen(part, "wxe") : NULL;
    int error = out == NULL ? (text != NULL ? errno : ENOMEM) : 0;
    if (out != NULL) {
        const bool is_written = fprintf(out, "%s\n", text) >= 0 && fflush(out) == 0 && fsync(fileno(out)) == 0;
        error = is_written ? 0 : errno;
        (void)fclose(out);
        if (error == 0 && rename(part, file) != 0) {
            error = errno;
        }
        if (error != 0) {
            (void)unlink(part);
        }
    }
    free(text);
    return error;
}
