/* SPDX-License-Identifier: MIT
 * setup_report.c - what was asked, answered, found and mended, on paper.
 */
#include <cjson/cJSON.h>
#include <errno.h>
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

static const char k_head[] =
    "<!doctype html>\n<meta charset=\"utf-8\">\n"
    "<style>body{font:11pt "
    "sans-serif;max-width:180mm;margin:auto}td{vertical-align:top;padding-right:1em}tr{break-inside:avoid}</style>\n";

/** Where it is written, and how. */
typedef struct {
    FILE *out;
    bool is_page; /**< HTML, for a browser to print; else lines */
} sheet_t;

static void put(const sheet_t *sheet, const char *text)
{
    for (; *text != '\0'; text++) {
        const char *const escaped = !sheet->is_page ? NULL
                                    : *text == '<'  ? "&lt;"
                                    : *text == '>'  ? "&gt;"
                                    : *text == '&'  ? "&amp;"
                                                    : NULL;
        if (escaped != NULL) {
            fputs(escaped, sheet->out);
        } else {
            fputc(*text, sheet->out);
        }
    }
}

static void put_heading(const sheet_t *sheet, const char *text)
{
    fputs(sheet->is_page ? "<h2>" : "\n", sheet->out);
    put(sheet, text);
    fputs(sheet->is_page ? "</h2>\n" : "\n", sheet->out);
}

static void put_found(const sheet_t *sheet, const char *text)
{
    fputs(sheet->is_page ? "<p>" : "  - ", sheet->out);
    put(sheet, text);
    fputs(sheet->is_page ? "</p>\n" : "\n", sheet->out);
}

static void put_row(const sheet_t *sheet, const char *title, const char *name, const char *text)
{
    if (sheet->is_page) {
        const char *const cells[] = {title, name, text};
        fputs("<tr>", sheet->out);
        for (size_t i = 0; i < sizeof cells / sizeof cells[0]; i++) {
            fputs("<td>", sheet->out);
            put(sheet, cells[i]);
        }
        fputs("\n", sheet->out);
    } else {
        columns_put(sheet->out, title, TITLE_COLUMNS);
        fprintf(sheet->out, " %-14s %s\n", name, text);
    }
}

static void write_chapter(const setup_t *self, const char *beginning, const char *title, const sheet_t *sheet)
{
    bool is_first = true;
    for (unsigned i = 0; i < self->count; i++) {
        if (is_of(self->answer[i].key, beginning)) {
            const char *dot = strchr(self->answer[i].key, '.');
            put_row(sheet, is_first ? _(title) : "", dot != NULL ? dot + 1 : "", self->answer[i].text);
            is_first = false;
        }
    }
}

static void write_sheet(const setup_t *self, const sheet_t *sheet, const char *file, const char *when)
{
    char shown[SENTENCE_MAX];
    const char *const title = _("Commissioning of a platform with heavectl setup");
    if (sheet->is_page) {
        fputs(k_head, sheet->out);
        fprintf(sheet->out, "<title>%s</title>\n<h1>%s</h1>\n<table>\n", title, title);
    } else {
        fprintf(sheet->out, "%s\n\n", title);
    }
    put_row(sheet, _("Configuration"), "", file);
    put_row(sheet, _("Written"), "", when);
    fputs(sheet->is_page ? "</table>\n" : "", sheet->out);
    put_heading(sheet, _("What was found, and mended"));
    const char *note = answers_get_nth(self, "note", 1);
    if (note == NULL) {
        put_found(sheet, _("nothing"));
    }
    for (unsigned i = 1; note != NULL; note = answers_get_nth(self, "note", ++i)) {
        put_found(sheet, sentence(note, shown, sizeof shown));
    }
    put_heading(sheet, _("What was answered and measured"));
    fputs(sheet->is_page ? "<table>\n" : "", sheet->out);
    for (size_t i = 0; i < sizeof k_chapters / sizeof k_chapters[0]; i++) {
        write_chapter(self, k_chapters[i].beginning, k_chapters[i].title, sheet);
    }
    fputs(sheet->is_page ? "</table>\n" : "", sheet->out);
    put_heading(sheet,
                _("Still to be done before people board: the first rises, then heavectl commissioned (docs/commissioning.md); "
                  "heavectl selftest, the limits and the e-stop chain (docs/safety.md)."));
    put_heading(sheet, _("Date and signature:"));
    fputs(sheet->is_page ? "<p>____________________________________</p>\n" : "____________________________________\n",
          sheet->out);
}

/* As it was said, for programs: notes are English. */
static bool write_json(const setup_t *self, FILE *out, const char *file, const char *when)
{
    cJSON *root = cJSON_CreateObject();
    (void)cJSON_AddStringToObject(root, "configuration", file);
    (void)cJSON_AddStringToObject(root, "written", when);
    cJSON *found = cJSON_AddArrayToObject(root, "found"), *answers = cJSON_AddObjectToObject(root, "answers");
    for (unsigned i = 0; i < self->count; i++) {
        if (strncmp(self->answer[i].key, "note.", 5) == 0) {
            (void)cJSON_AddItemToArray(found, cJSON_CreateString(self->answer[i].text));
        } else {
            (void)cJSON_AddStringToObject(answers, self->answer[i].key, self->answer[i].text);
        }
    }
    char *text = cJSON_Print(root);
    const bool is_there = text != NULL;
    fprintf(out, "%s\n", is_there ? text : "");
    cJSON_free(text);
    cJSON_Delete(root);
    errno = is_there ? errno : ENOMEM;
    return is_there;
}

bool setup_write_report(const setup_t *self, const char *file, const char *when, char path[SETUP_PATH_MAX])
{
    static const char *const k_endings[] = {"json", "html", "txt"};
    static atomic_file_t report;
    for (size_t i = 0; i < sizeof k_endings / sizeof k_endings[0]; i++) {
        (void)snprintf(path, SETUP_PATH_MAX, "%s.report.%s", file, k_endings[i]);
        if (!atomic_file_open(&report, path)) {
            return false;
        }
        bool is_whole = true;
        if (i == 0) {
            is_whole = write_json(self, report.stream, file, when);
        } else {
            write_sheet(self, &(sheet_t){report.stream, i == 1}, file, when);
        }
        if (!atomic_file_close(&report) || !is_whole) {
            return false;
        }
    }
    return true;
}
