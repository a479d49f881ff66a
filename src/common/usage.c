/* SPDX-License-Identifier: MIT
 * usage.c - a program's table as --help, and as options of getopt; see usage.h.
 */
#include "common/usage.h"

#include <string.h>

#include "common/columns.h"
#include "common/translate.h"

#define COLUMN_MAX 56 /* forms longer than that leave their help no room beside them */
#define LINE_WIDTH 120

bool usage_is_end(const usage_row_t *row)
{
    return row->name == NULL && row->argument == NULL && row->help == NULL;
}

/* Returns the length of what stands left of the help. */
static int row_text(const usage_row_t *row, const char *before, char *text, size_t size)
{
    return snprintf(text, size, "%s%s%s%s", before, row->name != NULL ? row->name : "",
                    row->name != NULL && row->argument != NULL ? " " : "", row->argument != NULL ? row->argument : "");
}

/* One row a line, helps below each other. */
static void print_rows(const usage_row_t *rows, const char *before, FILE *out)
{
    char text[160];
    int width = 0;
    for (const usage_row_t *row = rows; !usage_is_end(row); row++) {
        const int length = row_text(row, before, text, sizeof text);
        width = length > width && length <= COLUMN_MAX ? length : width;
    }
    for (const usage_row_t *row = rows; !usage_is_end(row); row++) {
        (void)row_text(row, before, text, sizeof text);
        if (row->help != NULL) {
            fprintf(out, "%-*s  %s\n", width, text, translate(row->help));
        } else {
            fprintf(out, "%s\n", text);
        }
    }
}

/* "Exit codes: 0 done, 1 ...", in lines. */
static void print_exits(const usage_exit_t *exits, FILE *out)
{
    size_t column = columns_of(_("Exit codes:"));
    fputs(_("Exit codes:"), out);
    for (const usage_exit_t *exit = exits; exit->meaning != NULL; exit++) {
        const char *meaning = translate(exit->meaning);
        const size_t length = columns_of(meaning) + 5;
        if (column + length > LINE_WIDTH) {
            fputc('\n', out);
            column = 0;
        }
        fprintf(out, "%s%d %s%s", column == 0 ? "" : " ", exit->code, meaning, exit[1].meaning != NULL ? _(",") : _("."));
        column += length;
    }
    fputc('\n', out);
}

void usage_print(const usage_t *self, FILE *out)
{
    char before[80];
    fprintf(out, _("%s - %s.\n\n"), self->program, translate(self->summary));
    (void)snprintf(before, sizeof before, "  %s %s%s", self->program, self->common != NULL ? self->common : "",
                   self->common != NULL ? " " : "");
    print_rows(self->forms, before, out);
    if (self->commands != NULL) {
        fputc('\n', out);
        print_rows(self->commands, "  ", out);
    }
    fputc('\n', out);
    print_rows(self->options, "  --", out);
    fprintf(out, "\n%s%s", self->notes != NULL ? translate(self->notes) : "", self->notes != NULL ? "\n" : "");
    print_exits(self->exits, out);
}

void usage_options(const usage_t *self, struct option out[USAGE_OPTIONS_MAX + 1])
{
    unsigned count = 0;
    for (const usage_row_t *row = self->options; !usage_is_end(row) && count < USAGE_OPTIONS_MAX; row++) {
        out[count++] = (struct option){row->name, row->argument != NULL ? required_argument : no_argument, NULL, row->value};
    }
    out[count] = (struct option){NULL, 0, NULL, 0};
}
