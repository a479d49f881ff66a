/* SPDX-License-Identifier: MIT
 * steps_moves.c - the first moves of the whole platform: up, to its sides and to its ends; and the file.
 *
 * What one cylinder alone cannot show is seen here: a front that is elsewhere, cylinders numbered the other way round, a stroke
 * or a length that is not so.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/translate.h"
#include "setup/answers.h"
#include "setup/configure.h"
#include "setup/steps.h"

#define RISE_MM  20.0
#define TILT_DEG 1.0 /* which has room after the rise */
#define HOURS    12

static unsigned if_rising(const setup_t *self)
{
    return answers_is(self, "rise.ready", "y");
}

/* What was moved or measured with another configuration counts no more. */
static void move_anew(setup_t *self)
{
    answers_drop(self, "rise.");
    answers_drop(self, "supply.");
    answers_drop(self, "tilt.");
    answers_drop(self, "ends.");
}

static void measure_anew(setup_t *self)
{
    answers_drop(self, "zero.counts");
    answers_drop(self, "zero.length.");
    answers_drop(self, "zero.same");
    answers_drop(self, "zero.pose");
    answers_drop(self, "zero.right");
    move_anew(self);
}

/* --- Up --- */

static void say_rise(const setup_t *self, setup_question_t *out)
{
    (void)self;
    out->way_mm = RISE_MM;
    (void)snprintf(out->text, sizeof out->text, _("The platform rises by %g mm, or sinks where there is no room above it."),
                   RISE_MM);
}
static void say_risen(const setup_t *self, setup_question_t *out)
{
    const double way_mm = answers_number(self, "rise.way", 0);
    (void)snprintf(out->text, sizeof out->text,
                   way_mm < 0 ? _("Has it sunk by %.1f mm, straight down?") : _("Has it risen by %.1f mm, straight up?"),
                   fabs(way_mm));
}
static void accept_risen(setup_t *self, unsigned index, const char *text)
{
    (void)index;
    if (strcmp(text, "n") == 0) {
        answers_note(self, N_("The platform did not rise level: the cylinders were measured again."));
        measure_anew(self);
    } else if (strcmp(text, "l") == 0) {
        answers_note(self, N_("The platform did not rise as far as it was led: all drives were looked at again."));
        answers_drop(self, "legs.");
        answers_drop(self, "again.");
        measure_anew(self);
        (void)answers_set(self, "legs.ready", "y");
        (void)answers_set(self, "legs.room", "l");
    }
}

/* --- Absolute encoders --- */

/* Away from where the drives were switched on: there an encoder that begins anew counts the same. */
static unsigned if_absolute(const setup_t *self)
{
    return if_rising(self) && answers_is(self, "zero.kind", "a");
}
static bool was_off(const setup_t *self, unsigned index)
{
    (void)index;
    return answers_is(self, "supply.off", "y");
}
static bool is_lost(const setup_t *self, unsigned index)
{
    (void)index;
    return answers_is(self, "supply.same", "moved");
}
static void accept_supply(setup_t *self, unsigned index, const char *text)
{
    (void)index;
    if (strcmp(text, "s") == 0) {
        answers_note(self, N_("Whether the encoders keep their counts without supply was not tried."));
    }
}
static void accept_lost(setup_t *self, unsigned index, const char *text)
{
    (void)index;
    if (strcmp(text, "h") == 0) {
        answers_note(self, N_("The encoders lose their counts with the supply: the drives home after each start."));
        (void)answers_set(self, "zero.kind", "h");
        measure_anew(self);
    } else {
        answers_note(self, N_("The platform sank while the supply was off: nothing holds it then."));
    }
}

/* --- To its front and its right --- */

/** Tilts in turn: to the front, back, to the right, back. By pitch and roll, which every platform has. */
enum { TILT_FRONT = 1u, TILT_RIGHT = 3u, TILTS = 4u };

static unsigned tilts(const setup_t *self)
{
    return if_rising(self) ? TILTS : 0;
}
static bool is_tilted(const setup_t *self, unsigned index)
{
    (void)self;
    return index == TILT_FRONT || index == TILT_RIGHT;
}

/* R = Rz Ry Rx in the left-handed frame: positive pitch lowers the front, positive roll the left. */
static void say_tilt(const setup_t *self, setup_question_t *out)
{
    const bool is_out = is_tilted(self, out->index);
    /* back by what it was: where there is little room, it was less than asked */
    out->way_mm = !is_out ? -answers_number(self, "tilt.way", out->index - 1u) : out->index == TILT_FRONT ? TILT_DEG : -TILT_DEG;
    (void)snprintf(out->text, sizeof out->text, is_out ? _("The plate tilts by %g degrees.") : _("The plate goes back, level."),
                   TILT_DEG);
}

/* By how many hours it leaned elsewhere than it was led, -5 to 6. */
static int off_by(const setup_t *self, unsigned index)
{
    const int seen = (int)answers_number(self, "tilt.low", index), led = index == TILT_FRONT ? HOURS : HOURS / 4;
    return (seen - led + 5 + HOURS) % HOURS - 5;
}

/** What follows from where it leaned. Cylinders come in pairs (or alone) at 12, 4 and 8 o'clock. */
typedef struct {
    bool is_right, is_known; /**< known: other numbers set it right */
    bool is_mirrored;        /**< cylinders are numbered the other way round */
    int thirds;              /**< of a turn, clockwise, by which the numbers are off */
} front_t;

static front_t find_front(const setup_t *self)
{
    const int front = off_by(self, TILT_FRONT), right = off_by(self, TILT_RIGHT);
    const int apart = (front - right + HOURS) % HOURS;
    const int thirds = (int)lround(front / 4.0);
    front_t found = {.is_mirrored = abs(apart - HOURS / 2) <= 1, .thirds = (thirds + 3) % 3};
    const bool is_turned = apart <= 1 || apart == HOURS - 1;
    found.is_known = (is_turned || found.is_mirrored) && abs(front - 4 * thirds) <= 1;
    found.is_right = found.is_known && !found.is_mirrored && found.thirds == 0;
    return found;
}

/* The number that a cylinder should have had. */
static unsigned renumbered(const setup_t *self, const front_t *found, unsigned cylinder)
{
    const int count = (int)setup_cylinders(self), step = count / 3, from = (int)cylinder - 1;
    const int mirrored = found->is_mirrored ? step - 1 - from : from;
    return (unsigned)((mirrored + step * found->thirds + 2 * count) % count) + 1u;
}

static void say_front(const setup_t *self, setup_question_t *out)
{
    const front_t found = find_front(self);
    size_t length = 0;
    if (found.is_right) {
        (void)snprintf(out->text, sizeof out->text, "%s", _("It leans to the front and to the right, as it is led."));
        out->choices = N_("y go on");
        (void)snprintf(out->fallback, sizeof out->fallback, "y");
        return;
    }
    length = (size_t)snprintf(out->text, sizeof out->text,
                              _("Led to the front (12) it leaned to %s o'clock, led to the right (3) to %s. "),
                              answers_get_nth(self, "tilt.low", TILT_FRONT), answers_get_nth(self, "tilt.low", TILT_RIGHT));
    if (!found.is_known) {
        (void)snprintf(&out->text[length], sizeof out->text - length, "%s",
                       _("No other numbers of the cylinders explain that: look again, or the joints or lengths are wrong."));
        out->choices = N_("a tilt it again|m measure the cylinders again");
        return;
    }
    length += (size_t)snprintf(&out->text[length], sizeof out->text - length, "%s",
                               found.is_mirrored ? _("The cylinders were numbered the other way round:")
                                                 : _("The cylinders were numbered from another side than the front:"));
    for (unsigned i = 1; i <= setup_cylinders(self); i++) {
        length += (size_t)snprintf(&out->text[length], sizeof out->text - length, _("%s what was called %u is %u"),
                                   i > 1 ? _(",") : "", i, renumbered(self, &found, i));
    }
    (void)snprintf(&out->text[length], sizeof out->text - length, "%s",
                   _(". With these numbers all cylinders are looked at once more, and measured again."));
    out->choices = N_("r number them so|a tilt it again");
}

static void accept_front(setup_t *self, unsigned index, const char *text)
{
    const front_t found = find_front(self);
    (void)index;
    if (strcmp(text, "r") == 0) {
        for (unsigned i = 1; i <= setup_cylinders(self); i++) {
            char key[SETUP_KEY_MAX], number[8];
            (void)snprintf(key, sizeof key, "legs.moved.%u", i);
            (void)snprintf(number, sizeof number, "%u", renumbered(self, &found, (unsigned)answers_number(self, key, 0)));
            (void)answers_set(self, key, number);
        }
        answers_note(self, found.is_mirrored
                               ? N_("The cylinders had been numbered the other way round; they have other numbers now.")
                               : N_("The front was elsewhere; the cylinders have other numbers now."));
        answers_drop(self, "again.");
        measure_anew(self);
    } else if (strcmp(text, "m") == 0) {
        answers_note(self, N_("The plate did not lean as it was led; the cylinders were measured again."));
        measure_anew(self);
    } else if (strcmp(text, "a") == 0) {
        answers_drop(self, "tilt.");
    }
}

/* --- To its ends --- */

/** In, and out. */
enum { END_IN = 1u, END_OUT = 2u, ENDS = 2u };

static unsigned ends(const setup_t *self)
{
    return if_rising(self) ? ENDS : 0;
}
static void say_end(const setup_t *self, setup_question_t *out)
{
    (void)self;
    out->way_mm = out->index == END_IN ? -1 : 1;
    (void)snprintf(
        out->text, sizeof out->text, "%s",
        out->index == END_IN
            ? _("All cylinders go in as far as the configuration lets them, slowly. Let go if one of them comes to its end, "
                "or anything touches.")
            : _("All cylinders go out as far as the configuration lets them, slowly. Let go if one of them comes to its "
                "end, or anything touches."));
}

/* "there", or "stopped 3 401.7": that cylinder, at that extension. */
static bool is_stopped(const setup_t *self, unsigned index)
{
    const char *end = answers_get_nth(self, "ends.way", index);
    return end != NULL && strncmp(end, "stopped", 7) == 0;
}
static void say_stopped(const setup_t *self, setup_question_t *out)
{
    const char *end = answers_get_nth(self, "ends.way", out->index);
    char *rest = NULL;
    const unsigned cylinder = (unsigned)strtoul(end != NULL ? end + strcspn(end, " ") : "", &rest, 10);
    const double at_mm = strtod(rest, NULL);
    (void)snprintf(
        out->text, sizeof out->text,
        out->index == END_IN
            ? _("Cylinder %u went no further in than to %.1f mm of its %g mm. Its length when it is fully in, its stroke, or "
                "a length that was measured is wrong.")
            : _("Cylinder %u went no further out than to %.1f mm of its %g mm. Its stroke, its length when it is fully in, or "
                "a length that was measured is wrong."),
        cylinder, at_mm, configure_stroke(self, cylinder));
    out->choices = N_("a try again|s give the stroke and the length again|m measure the cylinders again");
}
static void accept_stopped(setup_t *self, unsigned index, const char *text)
{
    char note[SETUP_ANSWER_MAX];
    (void)snprintf(note, sizeof note,
                   index == END_IN ? N_("The cylinders did not go in as far as the configuration says: %s.")
                                   : N_("The cylinders did not go out as far as the configuration says: %s."),
                   answers_get_nth(self, "ends.way", index));
    answers_note(self, note);
    if (strcmp(text, "s") == 0) {
        steps_ask_lengths(self);
    } else if (strcmp(text, "m") == 0) {
        measure_anew(self);
    } else if (strcmp(text, "a") == 0) {
        answers_drop(self, "ends.");
    }
}

static void accept_write(setup_t *self, unsigned index, const char *text)
{
    (void)index;
    if (strcmp(text, "y") != 0) {
        answers_drop(self, "write");
    }
}

const step_t steps_moves[] = {
    {.key = "rise.ready",
     .kind = SETUP_CHOICE,
     .text =
         N_("Now the first moves of the whole platform, while you hold a key: up by 20 mm, a tilt to the front and one to the "
            "right, and slowly to both ends of the cylinders. Nobody is on the platform or near it, nothing is in its way, and "
            "the e-stop is in your other hand?"),
     .choices = N_("y yes|s leave it out")},
    {.key = "rise.way", .kind = SETUP_DO, .times = if_rising, .act = SETUP_ACT_RISE, .stage = SETUP_STAGE_FULL, .say = say_rise},
    {.key = "rise.right",
     .kind = SETUP_CHOICE,
     .times = if_rising,
     .say = say_risen,
     .took = accept_risen,
     .choices = N_("y yes|n no, not level: measure the cylinders again|l no, but level: look at each drive again, over 20 mm")},
    {.key = "supply.counts", .kind = SETUP_DO, .times = if_absolute, .act = SETUP_ACT_COUNTS, .stage = SETUP_STAGE_FULL},
    {.key = "supply.off",
     .kind = SETUP_CHOICE,
     .times = if_absolute,
     .took = accept_supply,
     .text =
         N_("Now switch the supply of the drives off, wait until they are dark, and switch it on again: absolute encoders still "
            "count the same then. Without brakes the platform sinks to where it stood. Done?"),
     .choices = N_("y it was off, and the drives are up again|s leave it out"),
     .help = N_("Encoders that lose their counts are often taken for absolute ones. Then the platform takes itself for somewhere "
                "else after each night.")},
    {.key = "supply.same",
     .kind = SETUP_DO,
     .times = if_absolute,
     .applies = was_off,
     .act = SETUP_ACT_SAME,
     .stage = SETUP_STAGE_FULL},
    {.key = "supply.lost",
     .kind = SETUP_CHOICE,
     .times = if_absolute,
     .applies = is_lost,
     .took = accept_lost,
     .text = N_("The drives do not count what they did before the supply was off. Have the cylinders really moved?"),
     .choices = N_("h no: the encoders lose their counts, and the drives home after each start|m yes: the platform sank")},
    {.key = "tilt.way",
     .kind = SETUP_DO,
     .group = 5,
     .times = tilts,
     .is_repeated = true,
     .act = SETUP_ACT_TILT,
     .stage = SETUP_STAGE_FULL,
     .say = say_tilt},
    {.key = "tilt.low",
     .kind = SETUP_NUMBER,
     .group = 5,
     .times = tilts,
     .is_repeated = true,
     .applies = is_tilted,
     .least = 1,
     .most = 12,
     .text = N_("Seen from above, with 12 o'clock at the front and 3 at the right: at which hour is the plate lowest now?")},
    {.key = "tilt.verdict", .kind = SETUP_CHOICE, .times = if_rising, .say = say_front, .took = accept_front},
    {.key = "ends.way",
     .kind = SETUP_DO,
     .group = 6,
     .times = ends,
     .is_repeated = true,
     .act = SETUP_ACT_ENDS,
     .stage = SETUP_STAGE_FULL,
     .say = say_end},
    {.key = "ends.wrong",
     .kind = SETUP_CHOICE,
     .group = 6,
     .times = ends,
     .is_repeated = true,
     .applies = is_stopped,
     .say = say_stopped,
     .took = accept_stopped},
    {.key = "write",
     .kind = SETUP_CHOICE,
     .text = N_("That is all. Write the configuration, and the report beside it?"),
     .choices = N_("y yes"),
     .took = accept_write,
     .help = N_("\"quit\" leaves without writing; all answers stay, and setup goes on here.")},
    {.key = "written", .kind = SETUP_DO, .act = SETUP_ACT_WRITE, .stage = SETUP_STAGE_FULL},
    {.key = NULL},
};
