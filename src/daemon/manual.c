/* SPDX-License-Identifier: MIT
 * manual.c - writes the manual pages out of the tables that the programs read: --help's and that of the configuration's keys.
 *
 * usage: manual heaved.8|heavectl.1|heave-twin.1|heave-panel.8|heave.ini.5 DATE
 */
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "common/message.h"
#include "common/roff.h"
#include "common/translate.h"
#include "common/usage.h"
#include "config/config.h"
#include "heave/status.h"
#include "twin/twin_options.h"
#ifdef HEAVE_HAS_PANEL
#include "panel/panel_options.h"
#endif

static void write_synopsis(const usage_t *usage, FILE *out)
{
    char text[200];
    roff_heading(_("SYNOPSIS"), out);
    for (const usage_row_t *form = usage->forms; !usage_is_end(form); form++) {
        (void)snprintf(text, sizeof text, "%s %s%s%s", usage->program, usage->common != NULL ? usage->common : "",
                       usage->common != NULL ? " " : "", form->argument);
        fputs(form == usage->forms ? "" : ".br\n", out);
        roff_bold(text, out);
    }
}

/* What it is called, and what it means. */
static void write_rows(const char *title, const usage_row_t *rows, const char *before, FILE *out)
{
    char text[160];
    roff_heading(title, out);
    for (const usage_row_t *row = rows; !usage_is_end(row); row++) {
        (void)snprintf(text, sizeof text, "%s%s%s%s", before, row->name, row->argument != NULL ? " " : "",
                       row->argument != NULL ? row->argument : "");
        roff_item(text, out);
        roff_text(translate(row->help), out);
    }
}

static void write_exits(const usage_exit_t *exits, FILE *out)
{
    char text[16];
    roff_heading(_("EXIT STATUS"), out);
    for (const usage_exit_t *exit = exits; exit->meaning != NULL; exit++) {
        (void)snprintf(text, sizeof text, "%d", exit->code);
        roff_item(text, out);
        roff_text(translate(exit->meaning), out);
    }
}

/* What there is of a section; DESCRIPTION stands before the options, the others behind. */
static void write_sections(const usage_section_t *sections, bool is_description, FILE *out)
{
    for (; sections->title != NULL; sections++) {
        if ((strcmp(sections->title, "DESCRIPTION") == 0) == is_description) {
            roff_heading(translate(sections->title), out);
            roff_paragraphs(translate(sections->text), out);
        }
    }
}

static void write_program(const usage_t *usage, const char *date, FILE *out)
{
    roff_title(usage->program, usage->manual_section, date, HEAVE_VERSION, out);
    roff_heading(_("NAME"), out);
    fprintf(out, "%s \\- %s\n", usage->program, translate(usage->summary));
    write_synopsis(usage, out);
    write_sections(usage->manual, true, out);
    if (usage->commands != NULL) {
        write_rows(_("COMMANDS"), usage->commands, "", out);
    }
    write_rows(_("OPTIONS"), usage->options, "--", out);
    write_sections(usage->manual, false, out);
    write_exits(usage->exits, out);
    roff_heading(_("SEE ALSO"), out);
    roff_text(usage->see_also, out);
}

static void write_configuration(const char *date, FILE *out)
{
    roff_title("heave.ini", "5", date, HEAVE_VERSION, out);
    roff_heading(_("NAME"), out);
    fprintf(out, "heave.ini \\- %s\n", _("configuration of a motion platform for heaved"));
    roff_heading(_("DESCRIPTION"), out);
    roff_paragraphs(
        _("One INI file is one platform. Comments start with a semicolon; a decimal point, no thousands separator. Units stand "
          "in "
          "the "
          "names of keys. An unknown key, a value out of range or a position out of reach is an error with file and line, and "
          "heaved "
          "does not start.\n\n"
          "Ready-made platforms are in /usr/share/doc/heave/config. `heaved --config FILE --check` says whether one is right and "
          "what "
          "follows from it; `--dump-config` prints it with every key there is.\n\n"
          "Keys marked (SIGHUP) change in operation when heaved gets that signal and the whole file is right; the others need a "
          "restart.\n"),
        out);
    config_write_manual(out);
    roff_heading(_("SEE ALSO"), out);
    roff_text("heaved(8), heavectl(1)", out);
}

int main(int argc, char **argv)
{
    if (argc != 3) {
        return EXIT_BAD_USAGE;
    }
    translate_begin(); /* which language, the build says */
    if (strcmp(argv[1], "heaved.8") == 0) {
        write_program(&heaved_usage, argv[2], stdout);
    } else if (strcmp(argv[1], "heavectl.1") == 0) {
        write_program(&heavectl_usage, argv[2], stdout);
    } else if (strcmp(argv[1], "heave-twin.1") == 0) {
        write_program(twin_usage(), argv[2], stdout);
#ifdef HEAVE_HAS_PANEL
    } else if (strcmp(argv[1], "heave-panel.8") == 0) {
        write_program(&heave_panel_usage, argv[2], stdout);
#endif
    } else if (strcmp(argv[1], "heave.ini.5") == 0) {
        write_configuration(argv[2], stdout);
    } else {
        return EXIT_BAD_USAGE;
    }
    return fflush(stdout) == 0 ? EXIT_DONE : EXIT_IO;
}
