/* SPDX-License-Identifier: MIT
 * setup_dialog.c - see setup_dialog.h. Each answer is on the disk before the next question is asked.
 */
#include "heavectl/setup_dialog.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "common/message.h" // exit codes
#include "common/presets.h"
#include "common/translate.h"
#include "heavectl/setup_acts.h"
#include "heavectl/setup_session.h"
#include "setup/setup.h"

#define LINE_MAX_BYTES 512u

typedef struct {
    const char *file;
    char state[4096];
    setup_t setup;
    setup_session_t session;
    const volatile sig_atomic_t *is_interrupted;
} run_t;

/** What was typed. */
typedef enum { TYPED_ANSWER, TYPED_BACK, TYPED_HELP, TYPED_QUIT } typed_t;

static int complain(int code, const char *what, const char *why)
{
    fprintf(stderr, "heavectl: setup: %s: %s\n", what, why);
    return code;
}

/* False: it is over with the terminal, or somebody has interrupted it. */
static bool read_byte(const run_t *self, char *byte)
{
    ssize_t got = -1;
    do {
        got = read(STDIN_FILENO, byte, 1);
    } while (got < 0 && errno == EINTR && *self->is_interrupted == 0);
    if (got < 0 && errno != EINTR) {
        (void)complain(EXIT_IO, _("the terminal"), error_text(errno));
    }
    return got == 1 && *self->is_interrupted == 0;
}

/* Byte by byte: what comes after the line feed may be a key that is held. */
static typed_t read_line(const run_t *self, char line[LINE_MAX_BYTES])
{
    size_t length = 0;
    for (char byte = '\0'; byte != '\n';) {
        if (!read_byte(self, &byte)) {
            return TYPED_QUIT;
        }
        if (byte != '\n' && length < LINE_MAX_BYTES - 1u) {
            line[length++] = byte;
        }
    }
    while (length > 0 && (line[length - 1u] == ' ' || line[length - 1u] == '\r')) {
        length--;
    }
    line[length] = '\0';
    const char *word = line + strspn(line, " ");
    return strcmp(word, "quit") == 0                             ? TYPED_QUIT
           : strcmp(word, "back") == 0                           ? TYPED_BACK
           : strcmp(word, "help") == 0 || strcmp(word, "?") == 0 ? TYPED_HELP
                                                                 : TYPED_ANSWER;
}

static typed_t ask(const run_t *self, const setup_question_t *question, char line[LINE_MAX_BYTES])
{
    printf("\n");
    setup_print("", question->text);
    for (const char *choice = question->choices; choice != NULL; choice = strchr(choice, '|')) {
        choice += *choice == '|';
        const size_t length = strcspn(choice, "|"), word = strcspn(choice, " ");
        printf("  %.*s  %.*s\n", (int)word, choice, (int)(length - word - (length > word)), choice + word + (length > word));
    }
    printf("%s%s%s%s%s> ", question->unit != NULL ? question->unit : "", question->unit != NULL ? " " : "",
           question->fallback[0] != '\0' ? "[" : "", question->fallback, question->fallback[0] != '\0' ? "] " : "");
    (void)fflush(stdout);
    return read_line(self, line);
}

static bool save(const run_t *self)
{
    return setup_save(&self->setup, self->state) || complain(0, self->state, error_text(errno)) != 0;
}

/* @return whether it goes on */
static bool accept(run_t *self, const setup_question_t *question, const char *text)
{
    char error[SETUP_ERROR_MAX];
    if (!setup_accept(&self->setup, question, text, error)) {
        printf("%s", _("Not taken: "));
        setup_print("", error);
        return true;
    }
    if (!setup_session_load(&self->session, &self->setup)) {
        setup_print("", self->session.error);
    }
    return save(self);
}

static bool go_back(run_t *self)
{
    setup_session_stop(&self->session);
    if (!setup_back(&self->setup)) {
        printf("%s\n", _("This is the first question."));
    }
    (void)setup_session_load(&self->session, &self->setup);
    return save(self);
}

static bool do_act(run_t *self, const setup_question_t *question)
{
    char result[SETUP_ANSWER_MAX], line[LINE_MAX_BYTES];
    if (question->text[0] != '\0') {
        printf("\n");
        setup_print("", question->text);
    }
    if (setup_act(&self->session, &self->setup, question, self->file, result)) {
        return *self->is_interrupted == 0 && accept(self, question, result);
    }
    if (*self->is_interrupted != 0) {
        return false;
    }
    setup_print("! ", self->session.error);
    printf("%s\n> ", _("Enter tries again, \"back\" goes to the question before, \"quit\" leaves."));
    (void)fflush(stdout);
    const typed_t typed = read_line(self, line);
    return typed == TYPED_BACK ? go_back(self) : typed != TYPED_QUIT;
}

static bool step(run_t *self, const setup_question_t *question)
{
    char line[LINE_MAX_BYTES];
    if (question->kind == SETUP_DO) {
        return do_act(self, question);
    }
    if (strcmp(question->key, "start") == 0) {
        printf("\n");
        (void)presets_list(stdout);
    }
    switch (ask(self, question, line)) {
    case TYPED_QUIT:
        return false;
    case TYPED_BACK:
        return go_back(self);
    case TYPED_HELP:
        setup_print("  ", question->help != NULL ? question->help : _("There is nothing more to say about it."));
        return true;
    case TYPED_ANSWER:
        break;
    }
    return accept(self, question, line);
}

static int converse(run_t *self)
{
    static setup_question_t question;
    for (;;) {
        setup_next(&self->setup, &question);
        if (question.kind == SETUP_FINISHED) {
            printf(_("\nDone. `heaved --config %s --check` looks at it once more; `heavectl selftest` is the daily check.\n"
                     "Answers are kept in %s; remove it to begin anew.\n"),
                   self->file, self->state);
            return EXIT_DONE;
        }
        if (!step(self, &question)) {
            printf(_("\nLeft. `heavectl setup %s` goes on here.\n"), self->file);
            return EXIT_REFUSED;
        }
    }
}

/* Where the answers are to be kept. */
static int check_folder(const run_t *self)
{
    char folder[4096];
    (void)snprintf(folder, sizeof folder, "%s", self->state);
    char *slash = strrchr(folder, '/');
    if (slash != NULL) {
        slash[slash == folder] = '\0';
    }
    const char *name = slash != NULL ? folder : ".";
    return access(name, W_OK) == 0 ? EXIT_DONE : complain(EXIT_NO_OUTPUT, name, error_text(errno));
}

static int begin(run_t *self)
{
    const int code = check_folder(self);
    if (code != EXIT_DONE) {
        return code;
    }
    if (setup_load(&self->setup, self->state)) {
        if (setup_get(&self->setup, "written") == NULL && !setup_acts_may_write(self->file)) {
            return complain(EXIT_BAD_USAGE, self->file, _(setup_acts_foreign));
        }
        printf(_("Going on with %s: %u answers are there.\n"), self->state, self->setup.count);
    } else if (errno != ENOENT) {
        return complain(EXIT_BAD_DATA, self->state,
                        errno == EINVAL ? _("not a state of setup, or damaged; it has not been touched") : error_text(errno));
    } else if (access(self->file, F_OK) == 0) {
        return complain(EXIT_BAD_USAGE, self->file,
                        _("is there already, and setup does not change it; give another name, and begin from this file"));
    } else if (errno != ENOENT) {
        return complain(EXIT_NO_INPUT, self->file, error_text(errno));
    }
    setup_print("", _("Every answer is kept at once: setup can be left at any question, and goes on there.\n"
                      "\"help\" says more about a question, \"back\" goes to the one before, \"quit\" leaves."));
    return setup_session_load(&self->session, &self->setup)
               ? EXIT_DONE
               : complain(EXIT_NO_INPUT, _("the file it begins from"), self->session.error);
}

int setup_run(const char *file, const volatile sig_atomic_t *is_interrupted)
{
    static run_t run;
    run = (run_t){.file = file, .is_interrupted = is_interrupted};
    if (isatty(STDIN_FILENO) == 0) {
        return complain(EXIT_BAD_USAGE, _("standard input"),
                        _("setup takes a terminal: a person looks, measures and holds a key"));
    }
    if (snprintf(run.state, sizeof run.state, "%s.setup", file) >= (int)sizeof run.state - 32) {
        return complain(EXIT_BAD_USAGE, "FILE", _("its name is too long"));
    }
    if (!setup_session_open(&run.session, is_interrupted)) {
        return complain(EXIT_NO_OUTPUT, _("a folder for the time being"), run.session.error);
    }
    int code = begin(&run);
    code = code == EXIT_DONE ? converse(&run) : code;
    setup_session_close(&run.session);
    return code;
}
