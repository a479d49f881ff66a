/* SPDX-License-Identifier: MIT
 * setup.c - which step comes next, and taking its answer; see setup.h.
 */
#include "setup/setup.h"

#include <ctype.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/translate.h"
#include "setup/answers.h"
#include "setup/pictures.h"
#include "setup/steps.h"

static const step_t *const k_chapters[] = {steps_geometry, steps_drives, steps_legs, steps_zero, steps_end, steps_moves};
#define CHAPTERS (sizeof k_chapters / sizeof k_chapters[0])

static unsigned times_of(const setup_t *self, const step_t *step)
{
    return step->times != NULL ? step->times(self) : 1u;
}

/* Whether a step is to be asked for an index. */
static bool is_due(const setup_t *self, const step_t *step, unsigned index)
{
    return index <= times_of(self, step) && (step->applies == NULL || step->applies(self, index)) &&
           answers_get_nth(self, step->key, step->is_repeated ? index : 0) == NULL;
}

/* The first that is due of rows that are asked together; count: of these. */
static const step_t *next_of_group(const setup_t *self, const step_t *first, unsigned *count, unsigned *index)
{
    unsigned most = 0;
    for (*count = 0; first[*count].key != NULL && first[*count].group == first->group; ++*count) {
        const unsigned times = times_of(self, &first[*count]);
        most = times > most ? times : most;
        if (first->group == 0) {
            ++*count;
            break;
        }
    }
    for (*index = 1; *index <= most; ++*index) {
        for (unsigned i = 0; i < *count; i++) {
            if (is_due(self, &first[i], *index)) {
                return &first[i];
            }
        }
    }
    return NULL;
}

static const step_t *next_step(const setup_t *self, unsigned *index)
{
    unsigned count = 1;
    for (size_t chapter = 0; chapter < CHAPTERS; chapter++) {
        for (const step_t *step = k_chapters[chapter]; step->key != NULL; step += count) {
            const step_t *found = next_of_group(self, step, &count, index);
            if (found != NULL) {
                return found;
            }
        }
    }
    return NULL;
}

static const step_t *step_of(const char *key)
{
    const char *dot = strrchr(key, '.');
    const size_t length = dot != NULL && isdigit((unsigned char)dot[1]) ? (size_t)(dot - key) : strlen(key);
    for (size_t chapter = 0; chapter < CHAPTERS; chapter++) {
        for (const step_t *step = k_chapters[chapter]; step->key != NULL; step++) {
            if (strlen(step->key) == length && strncmp(step->key, key, length) == 0) {
                return step;
            }
        }
    }
    return NULL;
}

/* What stands for %u. */
static void write_text(const char *format, unsigned index, char out[SETUP_TEXT_MAX])
{
    size_t length = 0;
    out[0] = '\0';
    for (; *format != '\0' && length < SETUP_TEXT_MAX - 12u; format++) {
        if (format[0] == '%' && format[1] == 'u') {
            length += (size_t)snprintf(&out[length], SETUP_TEXT_MAX - length, "%u", index);
            format++;
        } else {
            out[length++] = *format;
            out[length] = '\0';
        }
    }
}

static const char *help_of(const setup_t *self, const step_t *step)
{
    return step->help == NULL ? NULL : strcmp(step->help, PICTURES_HELP) == 0 ? pictures_of(self) : _(step->help);
}

void setup_next(const setup_t *self, setup_question_t *out)
{
    unsigned index = 0;
    const step_t *step = next_step(self, &index);
    *out = (setup_question_t){.kind = SETUP_FINISHED};
    if (step == NULL) {
        return;
    }
    *out = (setup_question_t){.kind = step->kind,
                              .help = help_of(self, step),
                              .choices = step->choices,
                              .least = step->least,
                              .most = step->most,
                              .unit = step->unit != NULL ? _(step->unit) : NULL,
                              .act = step->act,
                              .stage = step->stage,
                              .index = step->is_repeated ? index : 0};
    (void)snprintf(out->key, sizeof out->key, step->is_repeated ? "%s.%u" : "%s", step->key, index);
    (void)snprintf(out->fallback, sizeof out->fallback, "%s", step->fallback != NULL ? step->fallback : "");
    if (step->text != NULL) {
        write_text(_(step->text), index, out->text);
    }
    if (step->say != NULL) {
        step->say(self, out);
    }
    out->choices = out->choices != NULL ? _(out->choices) : NULL;
}

/* --- Answers --- */

/* What was typed in metres, most likely. */
static bool is_in_metres(const setup_question_t *question, const char *unit, double value)
{
    return strcmp(unit, "mm") == 0 && value > 0 && value < question->least && value < 10;
}

/* The decimal point of this country, units, degrees and words are named. */
static bool check_number(const setup_question_t *question, const char *text, char error[SETUP_ERROR_MAX])
{
    char *end = NULL;
    const double value = strtod(text, &end);
    const char *unit = question->unit != NULL ? question->unit : "";
    end += strspn(end, " ");
    const size_t length = strlen(unit);
    const bool is_unit = length > 0 && strncmp(end, unit, length) == 0 && end[length] == '\0';
    if (strchr(text, ',') != NULL) {
        (void)snprintf(error, SETUP_ERROR_MAX, _("\"%s\": a decimal point, not a comma: as in 600.5"), text);
    } else if (end == text || (*end != '\0' && !is_unit) || !isfinite(value)) {
        (void)snprintf(error, SETUP_ERROR_MAX, length > 0 ? _("\"%s\" is no number of %s") : _("\"%s\" is no number"), text,
                       unit);
    } else if (value < question->least || value > question->most) {
        (void)snprintf(error, SETUP_ERROR_MAX, _("%g %s: allowed are %g to %g %s%s"), value, unit, question->least,
                       question->most, unit, is_in_metres(question, unit, value) ? _(". In mm, not in metres") : "");
    } else {
        return true;
    }
    return false;
}

static bool check_choice(const setup_question_t *question, const char *text, char error[SETUP_ERROR_MAX])
{
    for (const char *choice = question->choices; choice != NULL; choice = strchr(choice, '|')) {
        choice += *choice == '|';
        const size_t length = strcspn(choice, " ");
        if (strlen(text) == length && strncmp(choice, text, length) == 0) {
            return true;
        }
    }
    (void)snprintf(error, SETUP_ERROR_MAX, _("\"%s\" is none of the answers"), text);
    return false;
}

/* The line without blanks at its ends, or what is meant where it is empty. */
static bool read_answer(const setup_question_t *question, const char *text, char answer[SETUP_ANSWER_MAX],
                        char error[SETUP_ERROR_MAX])
{
    text += strspn(text, " \t");
    size_t length = strcspn(text, "\r\n");
    while (length > 0 && (text[length - 1u] == ' ' || text[length - 1u] == '\t')) {
        length--;
    }
    if (length >= SETUP_ANSWER_MAX) {
        (void)snprintf(error, SETUP_ERROR_MAX, _("too long: at most %u characters"), SETUP_ANSWER_MAX - 1u);
        return false;
    }
    (void)snprintf(answer, SETUP_ANSWER_MAX, "%.*s", (int)length, length > 0 ? text : "");
    if (answer[0] == '\0') {
        (void)snprintf(answer, SETUP_ANSWER_MAX, "%s", question->fallback);
    }
    for (const char *at = answer; *at != '\0'; at++) {
        if ((unsigned char)*at < ' ') {
            (void)snprintf(error, SETUP_ERROR_MAX, _("there is a control character in it"));
            return false;
        }
    }
    if (answer[0] == '\0') {
        (void)snprintf(error, SETUP_ERROR_MAX, _("an answer is needed"));
        return false;
    }
    return true;
}

bool setup_accept(setup_t *self, const setup_question_t *question, const char *text, char error[SETUP_ERROR_MAX])
{
    const step_t *step = step_of(question->key);
    char answer[SETUP_ANSWER_MAX];
    error[0] = '\0';
    if (!read_answer(question, text, answer, error)) {
        return false;
    }
    if ((question->kind == SETUP_NUMBER && !check_number(question, answer, error)) ||
        (question->kind == SETUP_CHOICE && !check_choice(question, answer, error)) ||
        (step != NULL && step->check != NULL && !step->check(self, question->index, answer, error))) {
        return false;
    }
    if (!answers_set(self, question->key, answer)) {
        (void)snprintf(error, SETUP_ERROR_MAX, _("there is no room for more answers"));
        return false;
    }
    if (step != NULL && step->took != NULL) {
        step->took(self, question->index, answer);
    }
    return true;
}

bool setup_back(setup_t *self)
{
    while (self->count > 0) {
        const step_t *step = step_of(self->answer[--self->count].key);
        if (step != NULL && step->kind != SETUP_DO) {
            return true;
        }
    }
    return false;
}
