/* SPDX-License-Identifier: MIT
 * steps_legs.c - which drive is on which cylinder, which way it goes and how far: each is moved alone, and a person says what
 * moved.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/sentence.h"
#include "common/translate.h"
#include "setup/answers.h"
#include "setup/legs_seen.h"
#include "setup/pictures.h"
#include "setup/steps.h"

#define MM_ROW .kind = SETUP_NUMBER, .unit = "mm"

static unsigned if_bus(const setup_t *self)
{
    return strcmp(setup_driver(self), "sim") != 0;
}
static unsigned each(const setup_t *self)
{
    return if_bus(self) ? setup_cylinders(self) : 0;
}
static bool has_moved(const setup_t *self, unsigned index)
{
    const char *moved = answers_get_nth(self, "legs.moved", index);
    return moved != NULL && strcmp(moved, "0") != 0;
}

/* How far a drive is moved. */
static double way_of(const setup_t *self)
{
    return answers_is(self, "legs.room", "n") ? 2 : answers_is(self, "legs.room", "l") ? 20 : 5;
}

static void say_way(const setup_t *self, setup_question_t *out)
{
    out->way_mm = way_of(self);
    (void)snprintf(out->text, sizeof out->text,
                   _("Drive %u: by %g mm, outwards. Look which cylinder moves, which way, and how far."), out->index,
                   out->way_mm);
}

static void say_moved(const setup_t *self, setup_question_t *out)
{
    size_t length = 0;
    if (out->index == 1u) {
        length = (size_t)snprintf(out->text, sizeof out->text, "%s\n \n", pictures_of(self));
    }
    (void)snprintf(&out->text[length], sizeof out->text - length, _("Which cylinder has moved, 1 to %u? 0: none."),
                   setup_cylinders(self));
    out->most = setup_cylinders(self);
}

static bool check_moved(const setup_t *self, unsigned index, const char *text, char error[SETUP_ERROR_MAX])
{
    (void)index;
    (void)snprintf(error, SETUP_ERROR_MAX, _("\"%s\": a number from 1 to %u, or 0"), text, setup_cylinders(self));
    return strlen(text) == 1u;
}

static void say_measured(const setup_t *self, setup_question_t *out)
{
    const char *moved = answers_get_nth(self, "legs.moved", out->index);
    (void)snprintf(out->text, sizeof out->text,
                   _("By how many mm has cylinder %s moved, as you see or measure it? (%.1f were asked.)"),
                   moved != NULL ? moved : "?", answers_number(self, "legs.way", out->index));
}

/* --- What follows --- */

/* Lines that were found, in the language of who reads them. */
static void show_lines(const char *text, setup_question_t *out)
{
    char line[LEGS_TEXT_MAX], shown[SENTENCE_MAX];
    size_t length = 0;
    while (*text != '\0' && length < sizeof out->text) {
        const size_t bytes = strcspn(text, "\n");
        (void)snprintf(line, sizeof line, "%.*s", (int)bytes, text);
        length += (size_t)snprintf(&out->text[length], sizeof out->text - length, "%s\n", sentence(line, shown, sizeof shown));
        text += bytes + (text[bytes] == '\n');
    }
}

static void say_verdict(const setup_t *self, setup_question_t *out)
{
    legs_found_t found;
    char text[LEGS_TEXT_MAX];
    const legs_status_t status = legs_seen(self, &found, text);
    show_lines(text, out);
    if (status == LEGS_FOUND && found.is_as_given) {
        (void)snprintf(out->text, sizeof out->text,
                       _("Every drive moves its own cylinder, outwards, and as far as it was asked."));
        out->choices = N_("y go on|n look at all of them again");
    } else if (status == LEGS_FOUND) {
        const size_t length = strlen(out->text);
        (void)snprintf(&out->text[length], sizeof out->text - length, "%s",
                       _("This can be set right in the configuration; cables and drives stay as they are."));
        out->choices = N_("y set it so|n look at all of them again");
    } else {
        out->choices = status == LEGS_TOO_ROUGH ? N_("n look at all of them again|l again, over 20 mm each")
                                                : N_("n look at all of them again");
    }
}

static void accept_verdict(setup_t *self, unsigned index, const char *text)
{
    legs_found_t found;
    char mistakes[LEGS_TEXT_MAX];
    (void)index;
    const bool is_found = legs_seen(self, &found, mistakes) == LEGS_FOUND;
    if (strcmp(text, "y") != 0) {
        answers_drop(self, "legs.");
        if (strcmp(text, "l") == 0) {
            (void)answers_set(self, "legs.ready", "y");
            (void)answers_set(self, "legs.room", "l");
        }
    } else if (is_found) {
        answers_note(self, mistakes);
    }
}

/* --- Once more, as it is set now --- */

/* Back to where it stood before: by as much as it moved then, which says whether that was understood. */
static void say_again(const setup_t *self, setup_question_t *out)
{
    legs_found_t found;
    char text[LEGS_TEXT_MAX];
    if (legs_seen(self, &found, text) == LEGS_FOUND) {
        const unsigned leg = out->index - 1u;
        const double went_mm = answers_number(self, "legs.way", found.drive[leg] + 1u) * found.times[leg] / found.parts[leg];
        out->way_mm = found.is_reversed[leg] ? went_mm : -went_mm;
    }
    (void)snprintf(out->text, sizeof out->text,
                   out->way_mm < 0 ? _("Cylinder %u: by %.1f mm, inwards, to where it stood before.")
                                   : _("Cylinder %u: by %.1f mm, outwards, to where it stood before."),
                   out->index, fabs(out->way_mm));
}

static void say_right(const setup_t *self, setup_question_t *out)
{
    const double way_mm = answers_number(self, "again.way", out->index);
    (void)snprintf(out->text, sizeof out->text,
                   way_mm < 0 ? _("Has cylinder %u, and no other, become shorter by %.1f mm?")
                              : _("Has cylinder %u, and no other, become longer by %.1f mm?"),
                   out->index, fabs(way_mm));
}

static void accept_right(setup_t *self, unsigned index, const char *text)
{
    char note[SETUP_ANSWER_MAX];
    if (strcmp(text, "n") == 0) {
        (void)snprintf(note, sizeof note, N_("Cylinder %u did not move as set; all drives were looked at again."), index);
        answers_note(self, note);
        answers_drop(self, "legs.");
        answers_drop(self, "again.");
    }
}

const step_t steps_legs[] = {
    {.key = "legs.ready",
     .kind = SETUP_CHOICE,
     .times = if_bus,
     .choices = N_("y it is so"),
     .text = N_("Now drives get torque, and cylinders move while you hold a key. Nobody is on the platform or within its reach, "
                "nothing lies on "
                "it, and the e-stop is in your other hand?"),
     .help =
         N_("Setup is no safety function. While it waits for an answer, drives hold their place with torque. When setup ends, "
            "however it ends, "
            "they lose it within a second: the brakes, or the screws themselves, have to hold the platform.")},
    {.key = "legs.room",
     .kind = SETUP_CHOICE,
     .times = if_bus,
     .choices = N_("y 10 mm or more: each is moved by 5 mm|n less: by 2 mm"),
     .text = N_("How far is each cylinder from both of its ends, as it stands?"),
     .help =
         N_("A drive that runs backwards goes in where it is sent out. If a cylinder stands at its end, turn it away from there "
            "by hand, or by "
            "the drive's own tool, where you can.")},
    {.key = "legs.way",
     .kind = SETUP_DO,
     .group = 1,
     .times = each,
     .is_repeated = true,
     .act = SETUP_ACT_JOG,
     .stage = SETUP_STAGE_BUS,
     .say = say_way},
    {.key = "legs.moved",
     .kind = SETUP_NUMBER,
     .group = 1,
     .times = each,
     .is_repeated = true,
     .say = say_moved,
     .check = check_moved,
     .help = PICTURES_HELP},
    {.key = "legs.direction",
     .kind = SETUP_CHOICE,
     .group = 1,
     .times = each,
     .is_repeated = true,
     .applies = has_moved,
     .text = N_("Has it become longer or shorter?"),
     .choices = N_("l longer|s shorter")},
    {.key = "legs.measured",
     MM_ROW,
     .group = 1,
     .times = each,
     .is_repeated = true,
     .applies = has_moved,
     .most = 2000,
     .say = say_measured},
    {.key = "legs.verdict", .kind = SETUP_CHOICE, .times = if_bus, .say = say_verdict, .took = accept_verdict},
    {.key = "again.way",
     .kind = SETUP_DO,
     .group = 2,
     .times = each,
     .is_repeated = true,
     .act = SETUP_ACT_JOG,
     .stage = SETUP_STAGE_LEGS,
     .say = say_again},
    {.key = "again.right",
     .kind = SETUP_CHOICE,
     .group = 2,
     .times = each,
     .is_repeated = true,
     .say = say_right,
     .took = accept_right,
     .choices = N_("y yes|n no")},
    {.key = NULL},
};
