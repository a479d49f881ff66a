/* SPDX-License-Identifier: MIT
 * legs.c - see legs.h.
 */
#include "setup/legs.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>

#include "common/translate.h"

#define ROUGH_MM 0.75 /* how well a way is measured beside a machine */
#define CLEAR_MM 0.55 /* so much better than the next ratio has the right one to fit: some read whole mm */
#define MOST     10u  /* screws and gears that were mixed up differ by small whole numbers */
#define PARTS    5u   /* and by such as 3/2, whose parts are smaller still */

/* Lines, in English: they are noted, and translated where they are shown. */
typedef struct {
    char *at;
    size_t length;
} lines_t;

static __attribute__((format(printf, 2, 3))) void say(lines_t *self, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    const int length = vsnprintf(&self->at[self->length], LEGS_TEXT_MAX - self->length, format, arguments);
    va_end(arguments);
    self->length += length > 0 ? (size_t)length : 0;
    self->length = self->length < LEGS_TEXT_MAX - 1u ? self->length : LEGS_TEXT_MAX - 2u;
    self->at[self->length++] = '\n';
    self->at[self->length] = '\0';
}

static bool is_simple(unsigned times, unsigned parts)
{
    for (unsigned n = 2; n <= parts; n++) {
        if (times % n == 0 && parts % n == 0) {
            return false;
        }
    }
    return times == 1 || parts == 1 || (times <= PARTS && parts <= PARTS);
}

/* The only simple ratio that explains a way. */
static bool find_ratio(const legs_seen_t *seen, unsigned *times, unsigned *parts)
{
    double nearest = INFINITY, second = INFINITY;
    if (fabs(seen->measured_mm - seen->asked_mm) <= ROUGH_MM) {
        *times = *parts = 1;
        return true;
    }
    for (unsigned t = 1; t <= MOST; t++) {
        for (unsigned p = 1; p <= MOST; p++) {
            const double off_mm = fabs(seen->measured_mm - seen->asked_mm * t / p);
            if (!is_simple(t, p) || t == p) {
                continue;
            }
            if (off_mm < nearest) {
                second = nearest;
                nearest = off_mm;
                *times = t;
                *parts = p;
            } else if (off_mm < second) {
                second = off_mm;
            }
        }
    }
    return nearest <= ROUGH_MM && second >= nearest + CLEAR_MM;
}

/* Each cylinder has one drive. */
static legs_status_t assign(const legs_seen_t *seen, unsigned count, legs_found_t *out, lines_t *lines)
{
    bool is_taken[LEGS_MAX] = {false};
    for (unsigned drive = 0; drive < count; drive++) {
        const unsigned leg = seen[drive].leg;
        if (leg > count) {
            say(lines, N_("Drive %u: there is no cylinder %u."), drive + 1u, leg);
            return LEGS_NO_SUCH;
        }
        if (leg == 0) {
            say(lines,
                N_("Drive %u moved no cylinder: its motor is not on its screw, a brake is closed, or another machine moved."),
                drive + 1u);
            return LEGS_NONE_MOVED;
        }
        if (is_taken[leg - 1u]) {
            say(lines, N_("Drives %u and %u are both said to move cylinder %u: one of the two was taken for another."),
                out->drive[leg - 1u] + 1u, drive + 1u, leg);
            return LEGS_TWICE;
        }
        is_taken[leg - 1u] = true;
        out->drive[leg - 1u] = drive;
    }
    return LEGS_FOUND;
}

static void name_exchanges(const legs_found_t *found, unsigned count, lines_t *lines)
{
    for (unsigned leg = 0; leg < count; leg++) {
        const unsigned drive = found->drive[leg];
        if (drive > leg && found->drive[drive] == leg) {
            say(lines, N_("Drives %u and %u have changed places: drive %u moves cylinder %u, drive %u moves cylinder %u."),
                leg + 1u, drive + 1u, leg + 1u, drive + 1u, drive + 1u, leg + 1u);
        } else if (drive != leg && found->drive[drive] != leg) {
            say(lines, N_("Drive %u moves cylinder %u."), drive + 1u, leg + 1u);
        }
    }
}

static void name_ratio(lines_t *lines, unsigned drive, unsigned leg, unsigned times, unsigned parts)
{
    if (parts == 1u) {
        say(lines, N_("Drive %u moves cylinder %u by %u times the asked way: its lead is not the one given."), drive, leg, times);
    } else {
        say(lines, N_("Drive %u moves cylinder %u by %u/%u of the asked way: its lead is not the one given."), drive, leg, times,
            parts);
    }
}

legs_status_t legs_identify(const legs_seen_t *seen, unsigned count, legs_found_t *out, char text[LEGS_TEXT_MAX])
{
    lines_t lines = {.at = text};
    legs_found_t found = {.is_as_given = true};
    text[0] = '\0';
    const legs_status_t status = assign(seen, count, &found, &lines);
    if (status != LEGS_FOUND) {
        return status;
    }
    name_exchanges(&found, count, &lines);
    for (unsigned leg = 0; leg < count; leg++) {
        const legs_seen_t *one = &seen[found.drive[leg]];
        found.is_reversed[leg] = one->is_shorter;
        if (!find_ratio(one, &found.times[leg], &found.parts[leg])) {
            lines.length = 0;
            say(&lines,
                N_("Drive %u moved its cylinder %.1f mm where %.1f mm were asked. No simple ratio fits, or several do: measure "
                   "once "
                   "more, over a longer way."),
                found.drive[leg] + 1u, one->measured_mm, one->asked_mm);
            return LEGS_TOO_ROUGH;
        }
        if (one->is_shorter) {
            say(&lines, N_("Drive %u runs backwards: cylinder %u went in where it was sent out."), found.drive[leg] + 1u,
                leg + 1u);
        }
        if (found.times[leg] != found.parts[leg]) {
            name_ratio(&lines, found.drive[leg] + 1u, leg + 1u, found.times[leg], found.parts[leg]);
        }
    }
    found.is_as_given = lines.length == 0;
    *out = found;
    return LEGS_FOUND;
}
