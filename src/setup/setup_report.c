/* SPDX-License-Identifier: MIT
 * setup_report.c - what was asked, answered, found and mended, on paper.
 */
#include <stdio.h>
#include <string.h>

#include "common/atomic_file.h"
#include "common/columns.h"
#include "common/sentence.h"
#include "common/translate.h"
#include "setup/answers.h"

#define TITLE_COLUMNS 44u

/** A chapter of the report: answers whose key begins so. */
static const struct {
    const char *beginning, *title;
} k_chapters[] = {
    {"start", N_("Begun from")},
    {"kind", N_("Kind")},
    {"base", N_("Lower joints")},
    {"plate", N_("Upper joints")},
    {"retracted", N_("Length, fully in (mm)")},
    {"stroke", N_("Stroke (mm)")},
    {"driver", N_("Driver")},
    {"interface", N_("Interface")},
    {"hosts", N_("Hosts")},
    {"device", N_("Serial port")},
    {"scan", N_("Drives that answer, with serial numbers")},
    {"nodes", N_("Addresses, in the order of the drives")},
    {"turn", N_("Counts of a turn")},
    {"gear", N_("Gear")},
    {"lead", N_("Lead, as given (mm)")},
    {"legs", N_("Each drive moved alone")},
    {"again", N_("Each cylinder moved as set")},
    {"zero", N_("Zero")},
    {"speed", N_("Speed of a cylinder (mm/s)")},
    {"accel", N_("Acceleration of a cylinder (mm/s^2)")},
    {"jerk", N_("Jerk of a cylinder (mm/s^3)")},
    {"margin", N_("Margin (mm)")},
    {"settled", N_("Settled extension (mm)")},
    {"limits", N_("Limits")},
    {"relay", N_("Relays")},
    {"switch", N_("Switches")},
    {"rise", N_("First rise")},
    {"supply", N_("Counts before and after the supply was off")},
    {"tilt", N_("Tilted to the front and to the right")},
    {"ends", N_("To the ends of the cylinders")},
};

/* "legs", "legs.way.3" but not "legsomething". */
static bool is_of(const char *key, const char *beginning)
{
    const size_t length = strlen(beginning);
    return strncmp(key, beginning, length) == 0 &&
           (key[length] == '\0' || key[length] == '.' || strcmp(&key[length], "s.kind") == 0 ||
            strncmp(&key[length], "s.", 2) == 0 || strncmp(&key[length], "es.", 3) == 0);
}

static void write_chapter(const setup_t *self, const char *beginning, const char *title, FILE *out)
{
    bool is_first = true;
    for (unsigned i = 0; i < self->count; i++) {
        if (is_of(self->answer[i].key, beginning)) {
            const char *dot = strchr(self->answer[i].key, '.'), *name = dot != NULL ? dot + 1 : "";
            columns_put(out, is_first ? _(title) : "", TITLE_COLUMNS);
            fprintf(out, " %-14s %s\n", name, self->answer[i].text);
            is_first = false;
        }
    }
}

bool setup_write_report(const setup_t *self, const char *path, const char *file, const char *when)
{
    static atomic_file_t report;
    if (!atomic_file_open(&report, path)) {
        return false;
    }
    char shown[SENTENCE_MAX];
    fprintf(report.stream, _("Commissioning of a platform with heavectl setup\n\nconfiguration  %s\nwritten        %s\n\n"), file,
            when);
    fprintf(report.stream, "%s\n", _("What was found, and mended"));
    const char *note = answers_get_nth(self, "note", 1);
    for (unsigned i = 1; note != NULL; note = answers_get_nth(self, "note", ++i)) {
        fprintf(report.stream, "  - %s\n", sentence(note, shown, sizeof shown));
    }
    if (answers_get_nth(self, "note", 1) == NULL) {
        fprintf(report.stream, "  %s\n", _("nothing"));
    }
    fprintf(report.stream, "\n%s\n", _("What was answered and measured"));
    for (size_t i = 0; i < sizeof k_chapters / sizeof k_chapters[0]; i++) {
        write_chapter(self, k_chapters[i].beginning, k_chapters[i].title, report.stream);
    }
    fprintf(report.stream, "\n%s\n\n%s ____________________________________\n",
            _("Still to be done before people board: the first rises, then heavectl commissioned (docs/commissioning.md); "
              "heavectl selftest, the limits and the e-stop chain (docs/safety.md)."),
            _("Date and signature:"));
    return atomic_file_close(&report);
}
