/* SPDX-License-Identifier: MIT
 * steps_end.c - limits, relays and switches.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/translate.h"
#include "setup/answers.h"
#include "setup/configure.h"
#include "setup/steps.h"

static bool has_file(const setup_t *self)
{
    return !answers_is(self, "start", "none");
}

static void say_limits(const setup_t *self, setup_question_t *out)
{
    const bool is_kept = has_file(self) && answers_is(self, "geometry", "k");
    (void)snprintf(out->text, sizeof out->text,
                   _("Limits of the axes: take these? They follow the geometry, and the file can have others later."));
    out->choices = is_kept ? N_("y take these|k keep those of the file") : N_("y take these");
    (void)snprintf(out->fallback, sizeof out->fallback, is_kept ? "k" : "y");
}

/* --- Relays --- */

static unsigned if_relay_lines(const setup_t *self)
{
    return answers_is(self, "relays.kind", "g");
}
static bool is_tried(const setup_t *self, unsigned index)
{
    const char *tried = answers_get_nth(self, "relay.try", index);
    return tried != NULL && strcmp(tried, "y") == 0;
}

static void say_lines(const setup_t *self, setup_question_t *out, const char *what)
{
    (void)snprintf(out->text, sizeof out->text, "%s", what);
    out->choices = has_file(self) ? N_("n none|g on GPIO lines|k as in the file") : N_("n none|g on GPIO lines");
    (void)snprintf(out->fallback, sizeof out->fallback, has_file(self) ? "k" : "n");
}
static void say_relays(const setup_t *self, setup_question_t *out)
{
    say_lines(self, out, _("Relays for effects?"));
}
static void say_switches(const setup_t *self, setup_question_t *out)
{
    say_lines(self, out, _("Switches of the operator: e-stop contact, enable key, reset button, contact of the supply?"));
}

static bool check_lines(const setup_t *self, unsigned index, const char *text, char error[SETUP_ERROR_MAX])
{
    (void)self;
    (void)index;
    (void)snprintf(error, SETUP_ERROR_MAX, _("\"%s\": names of lines as `gpioinfo` shows them"), text);
    return strpbrk(text, ";=[]\"") == NULL;
}

static void accept_relay(setup_t *self, unsigned index, const char *text)
{
    char note[SETUP_ANSWER_MAX];
    if (strcmp(text, "n") == 0) {
        (void)snprintf(note, sizeof note, N_("Relay %u did not switch."), index);
        answers_note(self, note);
    } else if (strcmp(text, "a") == 0) {
        (void)snprintf(note, sizeof note, "relay.do.%u", index);
        answers_drop(self, note);
        (void)snprintf(note, sizeof note, "relay.right.%u", index);
        answers_drop(self, note);
    }
}

/* --- Switches --- */

static unsigned if_switch_lines(const setup_t *self)
{
    return answers_is(self, "switches.kind", "g");
}

static const char *const k_switch[] = {"estop", "enable", "reset", "power"};
static const char *const k_work[] = {N_("Press the e-stop, then release it."), N_("Turn the enable key off, then on."), "",
                                     N_("Let the supply's contact open, then close.")};

static unsigned switches(const setup_t *self)
{
    (void)self;
    return 4u;
}
static bool is_connected(const setup_t *self, unsigned index)
{
    return index != 3u && configure_has_switch(self, k_switch[index - 1u]); /* the reset button is pressed after the e-stop */
}
static void say_switch(const setup_t *self, setup_question_t *out)
{
    (void)self;
    (void)snprintf(out->text, sizeof out->text, "%s", _(k_work[out->index - 1u]));
}
static bool is_unseen(const setup_t *self, unsigned index)
{
    const char *seen = answers_get_nth(self, "switch", index);
    return is_connected(self, index) && seen != NULL && strcmp(seen, "seen") != 0;
}
static void say_unseen(const setup_t *self, setup_question_t *out)
{
    (void)snprintf(out->text, sizeof out->text,
                   _("heaved has not seen the switch %s. Its line may be another one, its wire broken or loose, or its contact "
                     "of the other kind."),
                   k_switch[out->index - 1u]);
    out->choices = if_switch_lines(self) ? N_("a try again|l name the lines again|n note it, and go on without it")
                                         : N_("a try again|n note it, and go on without it");
}
static void accept_unseen(setup_t *self, unsigned index, const char *text)
{
    char note[SETUP_ANSWER_MAX];
    (void)snprintf(note, sizeof note, N_("heaved did not see the switch %s."), k_switch[index - 1u]);
    answers_note(self, note);
    if (strcmp(text, "l") == 0) {
        answers_drop(self, "switches.");
        (void)answers_set(self, "switches.kind", "g");
        answers_drop(self, "switch.");
    } else if (strcmp(text, "a") == 0) {
        (void)snprintf(note, sizeof note, "switch.%u", index);
        answers_drop(self, note);
        (void)snprintf(note, sizeof note, "switch.wrong.%u", index);
        answers_drop(self, note);
    }
}

/* Drives that move, and nothing that tells heaved of the e-stop. */
static unsigned if_bare(const setup_t *self)
{
    return strcmp(setup_driver(self), "sim") != 0 && !configure_has_switch(self, k_switch[0]);
}
static void accept_bare(setup_t *self, unsigned index, const char *text)
{
    (void)index;
    if (strcmp(text, "n") == 0) {
        answers_drop(self, "switches.");
    } else {
        answers_note(self, N_("heaved is not told of the e-stop."));
    }
}

#define LINE_ROW .kind = SETUP_TEXT, .times = if_switch_lines, .fallback = "none", .check = check_lines

const step_t steps_end[] = {
    {.key = "limits", .kind = SETUP_DO, .act = SETUP_ACT_LIMITS, .stage = SETUP_STAGE_FULL},
    {.key = "limits.take", .kind = SETUP_CHOICE, .say = say_limits},
    {.key = "relays.kind", .kind = SETUP_CHOICE, .say = say_relays},
    {.key = "relays.lines",
     .kind = SETUP_TEXT,
     .times = if_relay_lines,
     .check = check_lines,
     .text = N_("Lines of relay 1, relay 2, ..., separated by commas?"),
     .help = N_("`gpioinfo` shows the names of lines; docs/gpio.md.")},
    {.key = "switches.kind", .kind = SETUP_CHOICE, .say = say_switches},
    {.key = "switches.estop",
     LINE_ROW,
     .text = N_("Line of the e-stop, a contact that opens when it is pressed? none: there is none.")},
    {.key = "switches.enable", LINE_ROW, .text = N_("Line of the enable key?")},
    {.key = "switches.reset", LINE_ROW, .text = N_("Line of the reset button?")},
    {.key = "switches.power", LINE_ROW, .text = N_("Line of the contact that is closed while the supply is good?")},
    {.key = "relay.try",
     .kind = SETUP_CHOICE,
     .group = 3,
     .times = configure_relays,
     .is_repeated = true,
     .text = N_("Relay %u: try it?"),
     .choices = N_("y yes|n no: nothing is connected")},
    {.key = "relay.do",
     .kind = SETUP_DO,
     .group = 3,
     .times = configure_relays,
     .is_repeated = true,
     .applies = is_tried,
     .act = SETUP_ACT_RELAY,
     .stage = SETUP_STAGE_FULL,
     .text = N_("Relay %u switches while a key is held.")},
    {.key = "relay.right",
     .kind = SETUP_CHOICE,
     .group = 3,
     .times = configure_relays,
     .is_repeated = true,
     .applies = is_tried,
     .text = N_("Has relay %u, and no other, switched and gone back?"),
     .took = accept_relay,
     .choices = N_("y yes|n no: note it, and go on|a try again")},
    {.key = "switches.bare",
     .kind = SETUP_CHOICE,
     .times = if_bare,
     .took = accept_bare,
     .text =
         N_("Nothing tells heaved of the e-stop. The e-stop still has to take the power from the drives by itself; but when it "
            "is released, heaved does not know that it was pressed, and an operator's engage is all that is needed to move. Is "
            "it meant so?"),
     .choices = N_("n no: name its line|y yes: note it")},
    {.key = "switch",
     .kind = SETUP_DO,
     .group = 4,
     .times = switches,
     .is_repeated = true,
     .applies = is_connected,
     .act = SETUP_ACT_SWITCH,
     .stage = SETUP_STAGE_FULL,
     .say = say_switch},
    {.key = "switch.wrong",
     .kind = SETUP_CHOICE,
     .group = 4,
     .times = switches,
     .is_repeated = true,
     .applies = is_unseen,
     .say = say_unseen,
     .took = accept_unseen},
    {.key = NULL},
};
