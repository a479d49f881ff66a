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

static bool check_length(const setup_t *self, unsigned index, const char *text, char error[SETUP_ERROR_MAX])
{
    const double length_mm = strtod(text, NULL), least_mm = configure_retracted(self, index),
                 stroke_mm = configure_stroke(self, index);
    if (length_mm >= least_mm - 5 && length_mm <= least_mm + stroke_mm + 5) {
        return true;
    }
    (void)snprintf(error, SETUP_ERROR_MAX,
                   _("%g mm: cylinder %u is %g mm long when it is fully in, and %g mm fully out. From joint to joint?"),
                   length_mm, index, least_mm, least_mm + stroke_mm);
    return false;
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
    if (strcmp(text, "n") == 0) {
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
     .is_repeated = true,
     .say = say_length,
     .check = check_length,
     .least = 10,
     .most = 12000,
     .help = N_("From the centre of the lower joint to the centre of the upper one.")},
    {.key = "zero.same", .kind = SETUP_DO, .times = if_bus, .act = SETUP_ACT_SAME, .say = say_counts, .took = accept_same},
    {.key = "zero.pose", .kind = SETUP_DO, .times = if_bus, .act = SETUP_ACT_POSE, .stage = SETUP_STAGE_FULL},
    {.key = "zero.right",
     .kind = SETUP_CHOICE,
     .times = if_bus,
     .say = say_pose,
     .took = accept_pose,
     .choices = N_("y yes|n no: measure the cylinders again"),
     .help =
         N_("If the lengths are right and the plate stands otherwise, the joints are wrong: \"back\" as far as their chapter.")},
    {.key = NULL},
};
