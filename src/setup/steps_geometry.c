/* SPDX-License-Identifier: MIT
 * steps_geometry.c - what the machine is: joints, lengths, strokes.
 */
#include <ctype.h>
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "common/presets.h"
#include "common/translate.h"
#include "setup/answers.h"
#include "setup/distances.h"
#include "setup/lengths.h"
#include "setup/pictures.h"
#include "setup/steps.h"

#define NONE "none"

/* --- When a step applies --- */

static unsigned if_blank(const setup_t *self)
{
    return answers_is(self, "start", NONE);
}
static unsigned if_not_kept(const setup_t *self)
{
    return !answers_is(self, "geometry", "k");
}
/* Of a file that is kept only where the cylinders came to their ends elsewhere. */
static unsigned if_lengths(const setup_t *self)
{
    return if_not_kept(self) || setup_get(self, "lengths.again") != NULL;
}
static unsigned if_sizes_6(const setup_t *self)
{
    return answers_is(self, "geometry", "s") && setup_cylinders(self) == 6u;
}
static unsigned if_sizes_3(const setup_t *self)
{
    return answers_is(self, "geometry", "s") && setup_cylinders(self) == 3u;
}
static unsigned if_sizes(const setup_t *self)
{
    return answers_is(self, "geometry", "s");
}
static unsigned if_distances(const setup_t *self)
{
    return answers_is(self, "geometry", "t") ? LENGTHS_PAIRS : 0;
}
static unsigned if_fit(const setup_t *self)
{
    return answers_is(self, "geometry", "t");
}
static unsigned if_joints(const setup_t *self)
{
    return answers_is(self, "geometry", "j") ? setup_cylinders(self) : 0;
}
static bool is_refused(const setup_t *self, unsigned index)
{
    (void)index;
    return !answers_is(self, "geometry.check", "right");
}

/* --- Where it begins --- */

static bool check_start(const setup_t *self, unsigned index, const char *text, char error[SETUP_ERROR_MAX])
{
    char path[4096];
    (void)self;
    (void)index;
    if (strcmp(text, NONE) == 0 || (strchr(text, '/') != NULL && access(text, R_OK) == 0)) {
        return true;
    }
    if (strchr(text, '/') == NULL && presets_path(text, path, sizeof path) && access(path, R_OK) == 0) {
        return true;
    }
    (void)snprintf(error, SETUP_ERROR_MAX, "\"%s\": %s", text,
                   strchr(text, '/') != NULL ? error_text(errno)
                                             : _("no such platform; a file is named with its folder, as in ./my.ini"));
    return false;
}

/* "hexapod cia402", or "none". */
static void accept_start(setup_t *self, unsigned index, const char *text)
{
    char kind[SETUP_ANSWER_MAX], driver[SETUP_ANSWER_MAX];
    (void)index;
    if (strcmp(text, NONE) != 0 && sscanf(text, "%255s %255s", kind, driver) == 2) {
        (void)answers_set(self, "kind", kind);
        (void)answers_set(self, "driver", driver);
    }
}

static void accept_cylinders(setup_t *self, unsigned index, const char *text)
{
    (void)index;
    (void)answers_set(self, "kind", strcmp(text, "6") == 0 ? "hexapod" : "tripod");
}

static void say_geometry(const setup_t *self, setup_question_t *out)
{
    const bool has_file = !answers_is(self, "start", NONE), is_hexapod = setup_cylinders(self) == 6u;
    (void)snprintf(out->text, sizeof out->text, "%s\n \n%s", pictures_of(self),
                   _("How do you want to tell where the joints are?"));
    out->choices = has_file && is_hexapod
                       ? N_("k keep those of the file|s sizes: distances between neighbours, for a regular platform|"
                            "t every distance between the joints, for any platform|j joints from a drawing")
                   : has_file   ? N_("k keep those of the file|s sizes: the side of each triangle|j joints from a drawing")
                   : is_hexapod ? N_("s sizes: distances between neighbours, for a regular platform|"
                                     "t every distance between the joints, for any platform|j joints from a drawing")
                                : N_("s sizes: the side of each triangle|j joints from a drawing");
}

/* --- Sizes --- */

/* The two of a pair are nearer to each other than neighbours of different pairs. */
static bool check_far(const setup_t *self, const char *near, const char *text, char error[SETUP_ERROR_MAX])
{
    const double near_mm = answers_number(self, near, 0), far_mm = strtod(text, NULL);
    if (far_mm < near_mm) {
        (void)snprintf(
            error, SETUP_ERROR_MAX,
            _("%g mm is less than the %g mm between the two of a pair: the two look exchanged. \"back\" goes to the other one"),
            far_mm, near_mm);
        return false;
    }
    return true;
}
static bool check_base_far(const setup_t *self, unsigned index, const char *text, char error[SETUP_ERROR_MAX])
{
    (void)index;
    return check_far(self, "base.near", text, error);
}
static bool check_plate_far(const setup_t *self, unsigned index, const char *text, char error[SETUP_ERROR_MAX])
{
    (void)index;
    return check_far(self, "plate.near", text, error);
}

static void say_sizes(const setup_t *self, setup_question_t *out)
{
    double base[2] = {0}, plate[2] = {0};
    if (setup_cylinders(self) == 3u) {
        (void)snprintf(out->text, sizeof out->text,
                       _("The lower joints are on a circle of %.1f mm, the upper ones on one of %.1f mm. Right?"),
                       answers_number(self, "base.side", 0) / sqrt(3), answers_number(self, "plate.side", 0) / sqrt(3));
        return;
    }
    lengths_circle(answers_number(self, "base.near", 0), answers_number(self, "base.far", 0), &base[0], &base[1]);
    lengths_circle(answers_number(self, "plate.near", 0), answers_number(self, "plate.far", 0), &plate[0], &plate[1]);
    (void)snprintf(out->text, sizeof out->text,
                   _("The lower joints are on a circle of %.1f mm radius, the two of a pair %.1f degrees apart.\n"
                     "The upper joints are on a circle of %.1f mm radius, the two of a pair %.1f degrees apart.\nRight?"),
                   base[0], base[1], plate[0], plate[1]);
}

static void accept_sizes(setup_t *self, unsigned index, const char *text)
{
    (void)index;
    if (strcmp(text, "n") == 0) {
        answers_drop(self, "base.");
        answers_drop(self, "plate.");
        answers_drop(self, "sizes.");
    }
}

/* --- Every distance --- */

static void say_distance(setup_question_t *out, const char *which)
{
    char name[8];
    distances_name(out->index - 1u, name);
    (void)snprintf(out->text, sizeof out->text, _("Distance of the %s joints %s?"), _(which), name);
}
static void say_base_distance(const setup_t *self, setup_question_t *out)
{
    (void)self;
    say_distance(out, N_("lower"));
}
static void say_plate_distance(const setup_t *self, setup_question_t *out)
{
    (void)self;
    say_distance(out, N_("upper"));
}

/* What goes with what; the wrong one by its name. */
static void say_fit(const setup_t *self, setup_question_t *out, const char *set, const char *which)
{
    double distance_mm[LENGTHS_PAIRS];
    lengths_found_t found;
    char name[8];
    out->choices = N_("m measure all of them again");
    if (!distances_get(self, set, distance_mm) ||
        !lengths_fit(strcmp(set, "base") == 0 ? LENGTHS_BASE : LENGTHS_PLATE, distance_mm, &found)) {
        (void)snprintf(out->text, sizeof out->text, _("No six joints have these distances."));
    } else if (found.suspect_mm > 0) {
        distances_name(found.suspect, name);
        (void)snprintf(
            out->text, sizeof out->text,
            _("The distance %s of the %s joints does not go with the others: %.1f mm was measured, the others say %.1f mm."),
            name, which, distance_mm[found.suspect], found.suspect_mm);
        out->choices =
            N_("t take what the others say|o measure this one again|m measure all of them again|k it is right as it is");
    } else {
        (void)snprintf(out->text, sizeof out->text,
                       _("The distances of the %s joints go together, within %.1f mm on the average."), which, found.off_mm);
        out->choices = N_("y go on|m measure all of them again");
        (void)snprintf(out->fallback, sizeof out->fallback, "y");
    }
}
static void say_base_fit(const setup_t *self, setup_question_t *out)
{
    say_fit(self, out, "base", N_("lower"));
}
static void say_plate_fit(const setup_t *self, setup_question_t *out)
{
    say_fit(self, out, "plate", N_("upper"));
}

static void accept_fit(setup_t *self, const char *set, const char *text)
{
    double distance_mm[LENGTHS_PAIRS];
    lengths_found_t found = {.suspect = 0};
    char key[SETUP_KEY_MAX], value[SETUP_ANSWER_MAX], name[8];
    const bool is_all = strcmp(text, "m") == 0, is_one = strcmp(text, "o") == 0, is_taken = strcmp(text, "t") == 0;
    if (!is_all && !is_one && !is_taken) {
        return;
    }
    (void)snprintf(key, sizeof key, "%s.fit", set);
    answers_drop(self, key);
    (void)snprintf(key, sizeof key, "%s.distance.", set);
    if (is_all || !distances_get(self, set, distance_mm) ||
        !lengths_fit(strcmp(set, "base") == 0 ? LENGTHS_BASE : LENGTHS_PLATE, distance_mm, &found)) {
        answers_drop(self, key);
        return;
    }
    (void)snprintf(key, sizeof key, "%s.distance.%u", set, found.suspect + 1u);
    if (is_one) { /* .1 is not .10 */
        for (unsigned i = 0; i < self->count; i++) {
            if (strcmp(self->answer[i].key, key) == 0) {
                memmove(&self->answer[i], &self->answer[i + 1u], (self->count - i - 1u) * sizeof self->answer[0]);
                self->count--;
            }
        }
        return;
    }
    distances_name(found.suspect, name);
    (void)snprintf(value, sizeof value, N_("The distance %s of the %s joints was measured wrong: %.1f mm in place of %.1f mm."),
                   name, strcmp(set, "base") == 0 ? N_("lower") : N_("upper"), distance_mm[found.suspect], found.suspect_mm);
    answers_note(self, value);
    (void)snprintf(value, sizeof value, "%.2f", found.suspect_mm);
    (void)answers_set(self, key, value);
}
static void accept_base_fit(setup_t *self, unsigned index, const char *text)
{
    (void)index;
    accept_fit(self, "base", text);
}
static void accept_plate_fit(setup_t *self, unsigned index, const char *text)
{
    (void)index;
    accept_fit(self, "plate", text);
}

/* --- Joints --- */

static bool check_joint(const setup_t *self, unsigned index, const char *text, char error[SETUP_ERROR_MAX])
{
    double number[4];
    (void)self;
    (void)index;
    const unsigned count = answers_list(text, number, 4);
    if ((count == 2u || count == 3u) && strspn(text, "0123456789.,-+ ") == strlen(text)) {
        if (fabs(number[0]) < 10 && fabs(number[1]) < 10) {
            (void)snprintf(error, SETUP_ERROR_MAX, _("\"%s\": less than 10 mm from the middle; in mm, not in metres"), text);
            return false;
        }
        return true;
    }
    (void)snprintf(error, SETUP_ERROR_MAX, _("\"%s\": allowed are two or three numbers in mm, as in 1089.3, -153.1"), text);
    return false;
}

/* --- What heaved says of it --- */

static void say_mend(const setup_t *self, setup_question_t *out)
{
    char one[SETUP_KEY_MAX], other[SETUP_KEY_MAX];
    const char *found = setup_get(self, "geometry.check");
    const bool is_kept = answers_is(self, "geometry", "k");
    if (found != NULL && sscanf(found, "exchanged %31s %31s", one, other) == 2) {
        (void)snprintf(out->text, sizeof out->text, _("%s and %s look exchanged (see above)."), one, other);
        out->choices = is_kept ? N_("n tell the joints anew|k they are right, it is built so")
                               : N_("x exchange them|n tell the joints anew|k they are right, it is built so");
    } else {
        (void)snprintf(out->text, sizeof out->text, _("heaved refuses this mechanism, for the reason above."));
        out->choices = N_("n tell the joints anew|k they are right, it is built so");
    }
}

static void exchange_answers(setup_t *self, const char *one, const char *other)
{
    char kept[SETUP_ANSWER_MAX];
    const char *text = setup_get(self, one), *second = setup_get(self, other);
    if (text != NULL && second != NULL) {
        (void)snprintf(kept, sizeof kept, "%s", text);
        (void)answers_set(self, one, second);
        (void)answers_set(self, other, kept);
    }
}

static unsigned pair_of(unsigned a, unsigned b)
{
    unsigned pair = 0, one = 0, other = 0;
    for (; pair < LENGTHS_PAIRS; pair++) {
        lengths_pair(pair, &one, &other);
        if ((one == a && other == b) || (one == b && other == a)) {
            break;
        }
    }
    return pair + 1u;
}

/* Joints a and b, from 0: by their places, or by all distances that lead to them. */
static void exchange(setup_t *self, const char *set, unsigned a, unsigned b)
{
    char one[SETUP_KEY_MAX], other[SETUP_KEY_MAX];
    (void)snprintf(one, sizeof one, "%.7s.joint.%u", set, a + 1u);
    (void)snprintf(other, sizeof other, "%.7s.joint.%u", set, b + 1u);
    exchange_answers(self, one, other);
    for (unsigned k = 0; k < LENGTHS_JOINTS; k++) {
        if (k != a && k != b) {
            (void)snprintf(one, sizeof one, "%.7s.distance.%u", set, pair_of(a, k));
            (void)snprintf(other, sizeof other, "%.7s.distance.%u", set, pair_of(b, k));
            exchange_answers(self, one, other);
        }
    }
}

/* "exchanged plate1 plate2": which set, and which of its joints, from 1. */
static bool read_exchanged(const char *found, char set[8], unsigned *a, unsigned *b)
{
    char one[2], other[2];
    const bool is_read = sscanf(found, "exchanged %5[a-z]%1[1-6] %*5[a-z]%1[1-6]", set, one, other) == 3;
    *a = is_read ? (unsigned)(one[0] - '0') : 0;
    *b = is_read ? (unsigned)(other[0] - '0') : 0;
    return is_read;
}

static void accept_mend(setup_t *self, unsigned index, const char *text)
{
    char set[8], note[SETUP_ANSWER_MAX];
    unsigned a = 0, b = 0;
    const char *found = setup_get(self, "geometry.check");
    (void)index;
    if (strcmp(text, "k") == 0) {
        answers_note(self, N_("The mechanism is as measured, though heaved takes it for odd (as_measured = yes)."));
        return;
    }
    if (strcmp(text, "x") == 0 && found != NULL && read_exchanged(found, set, &a, &b)) {
        exchange(self, set, a - 1u, b - 1u);
        (void)snprintf(note, sizeof note, N_("Joints %s%u and %s%u were exchanged."), set, a, set, b);
        answers_note(self, note);
    } else {
        answers_drop(self, "base.");
        answers_drop(self, "plate.");
        answers_drop(self, "sizes.");
        answers_drop(self, "retracted");
        answers_drop(self, "stroke");
        for (unsigned i = 0; i < self->count; i++) { /* "geometry" alone: the others begin likewise */
            if (strcmp(self->answer[i].key, "geometry") == 0) {
                answers_drop(self, "geometry");
            }
        }
    }
    answers_drop(self, "geometry.");
}

#define MM_ROW .kind = SETUP_NUMBER, .unit = "mm"

const step_t steps_geometry[] = {
    {.key = "start",
     .kind = SETUP_TEXT,
     .check = check_start,
     .fallback = NONE,
     .text =
         N_("From what do you want to begin: the name of a ready-made platform (see above), the path of a configuration file, "
            "or none?"),
     .help = N_("A file gives every value that is not asked for here. It is read, never changed. Drives on Modbus or with CAN "
                "frames of their own "
                "need a file that has their registers or frames: those in /usr/share/doc/heave/config.")},
    {.key = "start.found", .kind = SETUP_DO, .act = SETUP_ACT_START, .took = accept_start},
    {.key = "cylinders",
     .kind = SETUP_CHOICE,
     .times = if_blank,
     .took = accept_cylinders,
     .fallback = "6",
     .text = N_("How many cylinders has the platform?"),
     .choices = N_("6 a hexapod|3 round a central guide")},
    {.key = "geometry", .kind = SETUP_CHOICE, .say = say_geometry, .help = PICTURES_HELP},
    {.key = "base.near",
     MM_ROW,
     .times = if_sizes_6,
     .least = 10,
     .most = 4000,
     .help = PICTURES_HELP,
     .text = N_("Lower joints: distance between the two of a pair, 1 and 2?")},
    {.key = "base.far",
     MM_ROW,
     .times = if_sizes_6,
     .least = 10,
     .most = 8000,
     .help = PICTURES_HELP,
     .check = check_base_far,
     .text = N_("Lower joints: distance between neighbours of different pairs, 2 and 3?")},
    {.key = "plate.near",
     MM_ROW,
     .times = if_sizes_6,
     .least = 10,
     .most = 4000,
     .help = PICTURES_HELP,
     .text = N_("Upper joints: distance between the two of a pair, 2 and 3?")},
    {.key = "plate.far",
     MM_ROW,
     .times = if_sizes_6,
     .least = 10,
     .most = 8000,
     .help = PICTURES_HELP,
     .check = check_plate_far,
     .text = N_("Upper joints: distance between neighbours of different pairs, 1 and 2?")},
    {.key = "base.side",
     MM_ROW,
     .times = if_sizes_3,
     .least = 10,
     .most = 6900,
     .text = N_("Distance between two lower joints?")},
    {.key = "plate.side",
     MM_ROW,
     .times = if_sizes_3,
     .least = 10,
     .most = 6900,
     .text = N_("Distance between two upper joints?")},
    {.key = "sizes.ok",
     .kind = SETUP_CHOICE,
     .times = if_sizes,
     .say = say_sizes,
     .took = accept_sizes,
     .choices = N_("y yes|n measure again")},
    {.key = "base.distance",
     MM_ROW,
     .times = if_distances,
     .is_repeated = true,
     .least = 10,
     .most = 8000,
     .say = say_base_distance,
     .help = PICTURES_HELP},
    {.key = "base.fit", .kind = SETUP_CHOICE, .times = if_fit, .say = say_base_fit, .took = accept_base_fit},
    {.key = "plate.distance",
     MM_ROW,
     .times = if_distances,
     .is_repeated = true,
     .least = 10,
     .most = 8000,
     .say = say_plate_distance,
     .help = PICTURES_HELP},
    {.key = "plate.fit", .kind = SETUP_CHOICE, .times = if_fit, .say = say_plate_fit, .took = accept_plate_fit},
    {.key = "base.joint",
     .kind = SETUP_TEXT,
     .times = if_joints,
     .is_repeated = true,
     .check = check_joint,
     .text = N_("Lower joint %u: x, y in mm (x forward, y to the right; z behind them where it is not 0)?"),
     .help = PICTURES_HELP},
    {.key = "plate.joint",
     .kind = SETUP_TEXT,
     .times = if_joints,
     .is_repeated = true,
     .check = check_joint,
     .text = N_("Upper joint %u: x, y in mm, in the plate's own frame?"),
     .help = PICTURES_HELP},
    {.key = "retracted",
     MM_ROW,
     .times = if_lengths,
     .least = 50,
     .most = 8000,
     .text = N_("Length of a cylinder that is fully in, from joint to joint?")},
    {.key = "stroke",
     MM_ROW,
     .times = if_lengths,
     .least = 10,
     .most = 4000,
     .text = N_("Stroke of a cylinder, from end to end?")},
    {.key = "geometry.check", .kind = SETUP_DO, .act = SETUP_ACT_CHECK, .stage = SETUP_STAGE_GEOMETRY},
    {.key = "geometry.mend", .kind = SETUP_CHOICE, .applies = is_refused, .say = say_mend, .took = accept_mend},
    {.key = NULL},
};
