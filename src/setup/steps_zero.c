/* SPDX-License-Identifier: MIT
 * steps_zero.c - where each cylinder is: homing or an absolute encoder, a tape, and whether the pose that follows is the real
 * one.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/translate.h"
#include "setup/answers.h"
#include "setup/configure.h"
#include "setup/steps.h"

static unsigned if_bus(const setup_t *self)
{
    return strcmp(setup_driver(self), "sim") != 0;
}
static unsigned if_homing(const setup_t *self)
{
    return if_bus(self) && answers_is(self, "zero.kind", "h");
}
static unsigned if_method(const setup_t *self)
{
    return if_homing(self) && strcmp(setup_driver(self), "cia402") == 0;
}
static unsigned each(const setup_t *self)
{
    return if_bus(self) ? setup_cylinders(self) : 0;
}

static bool check_method(const setup_t *self, unsigned index, const char *text, char error[SETUP_ERROR_MAX])
{
    const double method = strtod(text, NULL);
    (void)self;
    (void)index;
    (void)snprintf(error, SETUP_ERROR_MAX, _("%g: a whole number as in the drive's manual, not 0"), method);
    return fabs(method - round(method)) < 1e-9 && fabs(method) > 0.5;
}

/* Drives that home are asked where they have homed, the others where they were identified. */
static void say_counts(const setup_t *self, setup_question_t *out)
{
    out->stage = if_homing(self) ? SETUP_STAGE_ZERO : SETUP_STAGE_LEGS;
}

static void say_length(const setup_t *self, setup_question_t *out)
{
    (void)snprintf(out->text, sizeof out->text, _("How long is cylinder %u now, from joint to joint?"), out->index);
    (void)self;
}

/* How far a length may be beyond what was said of the cylinder: joints have play, and tapes. */
#define BEYOND_MM 5.0

static bool is_beyond(const setup_t *self, unsigned index)
{
    const char *text = answers_get_nth(self, "zero.length", index);
    const double in_mm = strtod(text != NULL ? text : "", NULL) - configure_retracted(self, index);
    return in_mm < -BEYOND_MM || in_mm > configure_stroke(self, index) + BEYOND_MM;
}
static void say_beyond(const setup_t *self, setup_question_t *out)
{
    const double least_mm = configure_retracted(self, out->index);
    (void)snprintf(out->text, sizeof out->text,
                   _("Cylinder %u was measured as %s mm long. It is %g mm long fully in, and %g mm fully out, as it was said. "
                     "What is wrong?"),
                   out->index, answers_get_nth(self, "zero.length", out->index), least_mm,
                   least_mm + configure_stroke(self, out->index));
}
static void accept_beyond(setup_t *self, unsigned index, const char *text)
{
    char key[SETUP_ANSWER_MAX];
    if (strcmp(text, "s") == 0) {
        answers_note(self,
                     N_("A cylinder was longer or shorter than its stroke lets it be: stroke and length were given again."));
        steps_ask_lengths(self);
        return;
    }
    (void)snprintf(key, sizeof key, "zero.length.%u", index);
    answers_drop(self, key);
    answers_drop(self, "zero.beyond.");
}

void steps_ask_lengths(setup_t *self)
{
    answers_drop(self, "stroke");
    answers_drop(self, "retracted");
    answers_drop(self, "geometry.check");
    answers_drop(self, "limits");
    answers_drop(self, "zero.beyond.");
    answers_drop(self, "ends.");
    (void)answers_set(self, "lengths.again", "y");
}

static void accept_same(setup_t *self, unsigned index, const char *text)
{
    (void)index;
    if (strcmp(text, "moved") == 0) {
        answers_drop(self, "zero.counts");
        answers_drop(self, "zero.length.");
        answers_drop(self, "zero.same");
    }
}

static void say_pose(const setup_t *self, setup_question_t *out)
{
    double pose[6] = {0};
    (void)answers_list(setup_get(self, "zero.pose"), pose, 6);
    (void)snprintf(
        out->text, sizeof out->text,
        _("By these lengths the plate stands like this: middle of its joints %.1f mm above the middle of the lower joints,\n"
          "%.1f mm forward, %.1f mm to the right; roll %.2f, pitch %.2f, yaw %.2f degrees. Is it so, within some mm?"),
        pose[5], pose[3], pose[4], pose[0], pose[1], pose[2]);
}

static void accept_pose(setup_t *self, unsigned index, const char *text)
{
    (void)index;
    if (strcmp(text, "l") == 0) {
        answers_note(self, N_("The plate did not stand as the lengths say, though they were right: see what the tilts showed."));
    } else if (strcmp(text, "n") == 0) {
        answers_note(self, N_("The plate did not stand as the measured lengths said; they were measured again."));
        answers_drop(self, "zero.counts");
        answers_drop(self, "zero.length.");
        answers_drop(self, "zero.same");
        answers_drop(self, "zero.pose");
        answers_drop(self, "zero.right");
    }
}

const step_t steps_zero[] = {
    {.key = "zero.kind",
     .kind = SETUP_CHOICE,
     .times = if_bus,
     .text = N_("How do the drives know where they are?"),
     .choices = N_("a absolute encoders: they always know|h they home after each start")},
    {.key = "zero.method",
     .kind = SETUP_NUMBER,
     .times = if_method,
     .check = check_method,
     .least = -128,
     .most = 127,
     .text = N_("Homing method (6098h), as it is for a drive that is not reversed?"),
     .help =
         N_("17: to the negative limit switch, 18: to the positive one; -1 and below: of the manufacturer. For drives that run "
            "backwards setup "
            "takes the method of the other direction.")},
    {.key = "zero.home",
     .kind = SETUP_DO,
     .times = if_homing,
     .act = SETUP_ACT_HOME,
     .stage = SETUP_STAGE_ZERO,
     .text = N_("All drives find their zero.")},
    {.key = "zero.counts", .kind = SETUP_DO, .times = if_bus, .act = SETUP_ACT_COUNTS, .say = say_counts},
    {.key = "zero.length",
     .kind = SETUP_NUMBER,
     .unit = "mm",
     .times = each,
     .group = 7,
     .is_repeated = true,
     .say = say_length,
     .least = 10,
     .most = 12000,
     .help = N_("From the centre of the lower joint to the centre of the upper one.")},
    {.key = "zero.beyond",
     .kind = SETUP_CHOICE,
     .group = 7,
     .times = each,
     .is_repeated = true,
     .applies = is_beyond,
     .say = say_beyond,
     .took = accept_beyond,
     .choices = N_("l this length: measure the cylinder again|s the others: give the stroke and the length again")},
    {.key = "zero.same", .kind = SETUP_DO, .times = if_bus, .act = SETUP_ACT_SAME, .say = say_counts, .took = accept_same},
    {.key = "zero.pose", .kind = SETUP_DO, .times = if_bus, .act = SETUP_ACT_POSE, .stage = SETUP_STAGE_FULL},
    {.key = "zero.right",
     .kind = SETUP_CHOICE,
     .times = if_bus,
     .say = say_pose,
     .took = accept_pose,
     .choices =
         N_("y yes|n no: measure the cylinders again|l no, but the lengths are right: go on, tilts show how they are numbered"),
     .help =
         N_("If the lengths are right and the plate stands otherwise, the joints are wrong: \"back\" as far as their chapter.")},
    {.key = NULL},
};
