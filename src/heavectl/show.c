/* SPDX-License-Identifier: MIT
 * show.c - answers of heaved as people read them; see ctl.h.
 */
#include <langinfo.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include "common/message.h" // exit codes
#include "common/translate.h"
#include "heavectl/ctl.h"
#include "heavectl/drive_commands.h"
#include "heavectl/lists.h"
#include "common/sentence.h"
#include "heavectl/view.h"

#define COLUMNS 80u

/* Characters of a terminal that has them; its locale may be one that was never made on this box. */
static bool is_utf8(void)
{
    return strcmp(nl_langinfo(CODESET), "UTF-8") == 0;
}

/* On a terminal that knows them, unless NO_COLOR says otherwise (no-color.org). */
static bool is_coloured(void)
{
    const char *refused = getenv("NO_COLOR");
    const char *terminal = getenv("TERM");
    return isatty(STDOUT_FILENO) != 0 && (refused == NULL || refused[0] == '\0') &&
           (terminal == NULL || strcmp(terminal, "dumb") != 0);
}

static unsigned terminal_columns(void)
{
    struct winsize size;
    return ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col >= 20 ? size.ws_col : COLUMNS;
}

/* 0: it does not say. */
static unsigned terminal_rows(void)
{
    struct winsize size;
    return ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) == 0 ? size.ws_row : 0;
}

void ctl_show_table(const cJSON *status, bool is_watching)
{
    static char text[CTL_VIEW_BYTES];
    const ctl_view_style_t style = {.columns = terminal_columns(),
                                    .rows = is_watching ? terminal_rows() : 0,
                                    .is_utf8 = is_utf8(),
                                    .is_coloured = is_coloured(),
                                    .line_end = is_watching ? "\x1b[K\r\n" : "\n"};
    (void)ctl_view_table(status, &style, text);
    printf("%s%s%s", is_watching ? "\x1b[H" : "", text, is_watching ? "\x1b[J" : "");
}

const char *ctl_own_words(const cJSON *object, const char *name)
{
    char own[32];
    (void)snprintf(own, sizeof own, "%s_%.2s", name, translate_language());
    const cJSON *translated = cJSON_GetObjectItemCaseSensitive(object, own);
    const cJSON *english = cJSON_GetObjectItemCaseSensitive(object, name);
    return cJSON_IsString(translated) ? translated->valuestring : cJSON_IsString(english) ? translate(english->valuestring) : "?";
}

/* What heaved said no to.
 * Returns the exit code. */
int ctl_judge(const cJSON *answer)
{
    const cJSON *error = cJSON_GetObjectItemCaseSensitive(answer, "error");
    if (cJSON_IsTrue(cJSON_GetObjectItemCaseSensitive(answer, "ok"))) {
        return EXIT_DONE;
    }
    char shown[SENTENCE_MAX];
    return ctl_complain(EXIT_REFUSED, "%s",
                        cJSON_IsString(error) ? sentence(error->valuestring, shown, sizeof shown)
                                              : _("heaved gave an answer that says nothing"));
}

static void show_answer(const ctl_t *self, const cJSON *answer)
{
    const cJSON *state = cJSON_GetObjectItemCaseSensitive(answer, "state");
    const cJSON *folder = cJSON_GetObjectItemCaseSensitive(answer, "folder");
    if (cJSON_IsString(folder)) {
        printf(_("%s: %s\n"), self->command, folder->valuestring);
    } else if (cJSON_IsArray(cJSON_GetObjectItemCaseSensitive(answer, "incidents"))) {
        lists_show_incidents(cJSON_GetObjectItemCaseSensitive(answer, "incidents"));
    } else if (strcmp(self->command, "status") == 0) {
        ctl_show_table(answer, false);
    } else if (cJSON_IsArray(cJSON_GetObjectItemCaseSensitive(answer, "drives"))) {
        lists_show_counts(answer);
    } else if (strcmp(self->command, "config") == 0) {
        const cJSON *hash = cJSON_GetObjectItemCaseSensitive(answer, "hash");
        printf("config: %s%s\n", cJSON_IsString(hash) ? hash->valuestring : "?",
               cJSON_IsTrue(cJSON_GetObjectItemCaseSensitive(answer, "restart")) ? _(", heaved starts anew") : "");
    } else if (strcmp(self->command, "sdo") == 0) {
        drive_show_object(answer);
    } else if (strcmp(self->command, "intensity") == 0) {
        const cJSON *percent = cJSON_GetObjectItemCaseSensitive(answer, "intensity_percent");
        printf(_("intensity: %.0f %%\n"), cJSON_IsNumber(percent) ? percent->valuedouble : 0.0);
    } else {
        printf(_("%s: %s\n"), self->command, cJSON_IsString(state) ? translate(state->valuestring) : "?");
    }
}

/* What whoever asked has to know, though it is done. Not on standard output, which scripts read. */
static void show_notice(const ctl_t *self, const cJSON *answer)
{
    const cJSON *notice = cJSON_GetObjectItemCaseSensitive(answer, "notice");
    if (cJSON_IsString(notice)) {
        fprintf(stderr, "%s: %s\n", self->command, translate(notice->valuestring));
    }
}

/* True where a request that brings the platform up has ended in FAULT or ESTOP at once: a script has to see that. */
static bool has_failed(const ctl_t *self, const cJSON *answer)
{
    const cJSON *state = cJSON_GetObjectItemCaseSensitive(answer, "state");
    const bool is_up =
        strcmp(self->command, "engage") == 0 || strcmp(self->command, "resume") == 0 || strcmp(self->command, "park") == 0;
    return is_up && cJSON_IsString(state) &&
           (strcmp(state->valuestring, "FAULT") == 0 || strcmp(state->valuestring, "ESTOP") == 0);
}

int ctl_show(const ctl_t *self, const char *line)
{
    cJSON *answer = cJSON_Parse(line);
    if (self->is_json && !self->is_waiting) {
        printf("%s\n", line);
    }
    int code = ctl_judge(answer);
    if (code == EXIT_DONE && has_failed(self, answer)) {
        code = ctl_complain(EXIT_REFUSED, "%s: the platform is in %s; heavectl status says why", self->command,
                            translate(cJSON_GetObjectItemCaseSensitive(answer, "state")->valuestring));
    }
    if (code == EXIT_DONE && !self->is_json && !self->is_waiting) {
        show_answer(self, answer);
    }
    if (code == EXIT_DONE && !self->is_json) {
        show_notice(self, answer);
    }
    cJSON_Delete(answer);
    return code;
}
