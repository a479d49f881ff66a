/* SPDX-License-Identifier: MIT
 * layout.c - the joints of a platform looked at as a whole; see layout.h.
 *
 * At pose zero the cylinders of a platform stand alike: their extensions agree, and each joint of the plate is over its own joint
 * of the base. Where that is not so, slips are tried one after the other: if one of them undone makes all extensions agree,
 * within what a tape measures, and within the stroke, it is named. Nobody builds that by chance.
 */
#include "platform/layout.h"

#include "common/translate.h"

#include <math.h>
#include <string.h>

#include "heave/number.h"

#define SECTION     "geometry"
#define METRES_MM   10.0           /* no platform is smaller than this; one of 10 m is larger than the range of the keys */
#define AGREE_MM    0.5            /* extensions that agree */
#define SUSPECT_MM  1.0            /* extensions that do not */
#define EVIDENCE    20.0           /* so many times better has a slip to make them */
#define SHORTER_MM  10.0           /* a joint over its own joint is nearer than over another one's */
#define TILTED      (Q16_ONE / 20) /* deg */
#define DEGREES     57.29577951308232
#define COORDINATES 3u

/* One joint of each cylinder. */
typedef struct {
    double at[CYLINDERS_MAX][COORDINATES];
} joints_t;

/* Joints in mm. */
typedef struct {
    unsigned count;
    joints_t base;
    joints_t plate;
    double retracted[CYLINDERS_MAX];
    double stroke[CYLINDERS_MAX];
    double height;
} layout_t;

/* How well cylinders agree at pose zero. */
typedef struct {
    double spread; /* from the least extension to the most */
    double mean;
    bool is_within; /* all of them within the stroke */
} fit_t;

/* The best explanation so far. */
typedef struct {
    fit_t fit;
    double disorder;      /* of numbers that explain it */
    config_text_t what;   /* empty: none */
    config_text_t remedy; /* "with them exchanged" */
    const char *key;
    char key_text[24];
} guess_t;

static double from_q16(q16_t value_q16)
{
    return (double)value_q16 / (double)Q16_ONE;
}

static layout_t layout_of(const settings_t *settings)
{
    const kin_geometry_t *geometry = &settings->geometry;
    layout_t layout = {.count = geometry->kind == KIN_HEXAPOD ? 6u : 3u, .height = from_q16(geometry->zero_height_mm_q16)};
    for (unsigned i = 0; i < layout.count; i++) {
        for (unsigned k = 0; k < COORDINATES; k++) {
            layout.base.at[i][k] = from_q16(geometry->base_mm_q16[i][k]);
            layout.plate.at[i][k] = from_q16(geometry->plate_mm_q16[i][k]);
        }
        layout.retracted[i] = from_q16(geometry->retracted_mm_q16[i]);
        layout.stroke[i] = from_q16(settings->stroke_mm_q16[i]);
    }
    return layout;
}

static fit_t fit_of(const layout_t *layout)
{
    double least = INFINITY;
    double most = -INFINITY;
    fit_t fit = {.is_within = true};
    for (unsigned i = 0; i < layout->count; i++) {
        const double x = layout->plate.at[i][0] - layout->base.at[i][0];
        const double y = layout->plate.at[i][1] - layout->base.at[i][1];
        const double z = layout->plate.at[i][2] - layout->base.at[i][2] + layout->height;
        const double extension = sqrt(x * x + y * y + z * z) - layout->retracted[i];
        least = fmin(least, extension);
        most = fmax(most, extension);
        fit.mean += extension / layout->count;
        fit.is_within = fit.is_within && extension >= 0 && extension <= layout->stroke[i];
    }
    fit.spread = most - least;
    return fit;
}

/* --- Slips --- */

/* Whether undoing a slip explains what is seen, and better than the best so far. */
static bool is_better(const fit_t *tried, const fit_t *seen, const guess_t *best)
{
    const bool is_shown_by_spread = seen->spread > SUSPECT_MM && tried->spread * EVIDENCE < seen->spread;
    const bool is_shown_by_length = tried->mean + SHORTER_MM < seen->mean;
    const bool is_first = best->what.length == 0;
    return tried->is_within && tried->spread < AGREE_MM && (is_shown_by_spread || is_shown_by_length) &&
           (is_first || tried->mean + AGREE_MM < best->fit.mean);
}

static void keep(guess_t *best, const fit_t *fit, const char *set, unsigned joint)
{
    best->fit = *fit;
    (void)snprintf(best->key_text, sizeof best->key_text, "%s%u_mm", set, joint + 1u);
    best->key = best->key_text;
    config_text_clear(&best->what);
    config_text_clear(&best->remedy);
}

/* The joints of a set go round the platform one after the other: +1 by increasing angle, -1 the other way, 0 in no order. */
static int order_of(const layout_t *layout, const joints_t *joints)
{
    double up = 0;
    double down = 0;
    for (unsigned i = 0; i < layout->count; i++) {
        const double *from = joints->at[i];
        const double *to = joints->at[(i + 1u) % layout->count];
        const double turn = atan2(from[0] * to[1] - from[1] * to[0], from[0] * to[0] + from[1] * to[1]) * DEGREES;
        up += turn > 0 ? turn : 0;
        down += turn < 0 ? -turn : 0;
    }
    if (down < 1 && fabs(up - 360) < 1) {
        return 1;
    }
    return up < 1 && fabs(down - 360) < 1 ? -1 : 0;
}

/* Whose numbers are out of order; the plate's where that cannot be told. */
static const char *disordered_set(const layout_t *layout)
{
    return order_of(layout, &layout->base) == 0 && order_of(layout, &layout->plate) != 0 ? "base" : "plate";
}

static void try_exchanges(const layout_t *seen, const fit_t *seen_fit, guess_t *best)
{
    for (unsigned i = 0; i < seen->count; i++) {
        for (unsigned k = i + 1u; k < seen->count; k++) {
            layout_t tried = *seen;
            memcpy(tried.plate.at[i], seen->plate.at[k], sizeof tried.plate.at[i]);
            memcpy(tried.plate.at[k], seen->plate.at[i], sizeof tried.plate.at[k]);
            const fit_t fit = fit_of(&tried);
            if (is_better(&fit, seen_fit, best)) {
                const char *set = disordered_set(seen);
                keep(best, &fit, set, i);
                config_text_add(&best->what, _("%s%u and %s%u look exchanged"), set, i + 1u, set, k + 1u);
                config_text_add(&best->remedy, _("with them exchanged"));
            }
        }
    }
}

/* Numbers that begin elsewhere, or run the other way round. */
static void try_numberings(const layout_t *seen, const fit_t *seen_fit, guess_t *best)
{
    for (unsigned turn = 0; turn < 2u * seen->count; turn++) {
        const unsigned places = turn % seen->count;
        const bool is_mirrored = turn >= seen->count;
        layout_t tried = *seen;
        for (unsigned i = 0; i < seen->count; i++) {
            const unsigned from = (is_mirrored ? 2u * seen->count - i + places : i + places) % seen->count;
            memcpy(tried.plate.at[i], seen->plate.at[from], sizeof tried.plate.at[i]);
        }
        const fit_t fit = fit_of(&tried);
        if (turn == 0 || !is_better(&fit, seen_fit, best)) {
            continue;
        }
        keep(best, &fit, "plate", 0);
        if (is_mirrored) {
            config_text_add(&best->what, _("the numbers of the plate's joints run the other way round than those of the base's"));
            config_text_add(&best->remedy, _("with plate%u as plate1, and on against that order"), places + 1u);
        } else {
            config_text_add(&best->what, _("the plate's joints look numbered from the wrong place"));
            config_text_add(&best->remedy, _("with plate%u as plate1, and on in that order"), places + 1u);
        }
    }
}

static double between(const layout_t *layout, unsigned i, unsigned k) /* joints: of the base, then of the plate */
{
    const double *a = i < layout->count ? layout->base.at[i] : layout->plate.at[i - layout->count];
    const double *b = k < layout->count ? layout->base.at[k] : layout->plate.at[k - layout->count];
    const double height = (i < layout->count ? 0 : layout->height) - (k < layout->count ? 0 : layout->height);
    return sqrt((a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]) + (a[2] - b[2] + height) * (a[2] - b[2] + height));
}

/* Joint i where the platform looks the same: turned by a third, or seen in a mirror that exchanges cylinder 1 and that one. */
static unsigned image_of(const layout_t *layout, unsigned i, unsigned mirror)
{
    const unsigned count = layout->count;
    const unsigned cylinder = mirror < count ? (count + mirror - i % count) % count : (i + count / 3u) % count;
    return i < count ? cylinder : count + cylinder;
}

/* How far the distances of all joints are from those of the image that is most like them, in mm. */
static double asymmetry(const layout_t *layout)
{
    double least = INFINITY;
    for (unsigned mirror = 0; mirror <= layout->count; mirror++) {
        double most = 0;
        for (unsigned i = 0; i < 2u * layout->count; i++) {
            for (unsigned k = 0; k < i; k++) {
                most = fmax(most, fabs(between(layout, i, k) -
                                       between(layout, image_of(layout, i, mirror), image_of(layout, k, mirror))));
            }
        }
        least = fmin(least, most);
    }
    return least;
}

/* Of numbers that explain the extensions, that one is likely which also puts both sets of joints in order, and alike. */
static double disorder(const layout_t *layout)
{
    const unsigned sets = (order_of(layout, &layout->base) == 0 ? 1u : 0u) + (order_of(layout, &layout->plate) == 0 ? 1u : 0u);
    return asymmetry(layout) + 1000.0 * sets;
}

/* One number of one joint, read as another one. */
static void try_number(const layout_t *seen, const fit_t *seen_fit, guess_t *best, unsigned at, double value, const char *slip)
{
    const bool is_base = at < CYLINDERS_MAX * COORDINATES;
    const unsigned joint = at / COORDINATES % CYLINDERS_MAX;
    layout_t tried = *seen;
    (is_base ? &tried.base : &tried.plate)->at[joint][at % COORDINATES] = value;
    const fit_t fit = fit_of(&tried);
    if (seen_fit->spread <= SUSPECT_MM || fit.spread * EVIDENCE >= seen_fit->spread || fit.spread >= AGREE_MM || !fit.is_within ||
        (best->what.length > 0 && fit.spread + disorder(&tried) >= best->disorder)) {
        return;
    }
    best->disorder = fit.spread + disorder(&tried);
    keep(best, &fit, is_base ? "base" : "plate", joint);
    config_text_add(&best->what, _("%c of %s%u looks %s"), "xyz"[at % COORDINATES], is_base ? "base" : "plate", joint + 1u, slip);
    config_text_add(&best->remedy, _("with %.6g"), value);
}

/* Two digits beside each other in the wrong order, as in 428.136 for 482.136. */
static void try_digits(const layout_t *seen, const fit_t *seen_fit, guess_t *best, unsigned at, q16_t value_q16)
{
    config_text_t text;
    config_text_clear(&text);
    config_text_add(&text, value_q16 < 0 ? "-0" : "0"); /* a 0 that went to the front is not there any more */
    config_text_add_q16(&text, value_q16 < 0 ? -value_q16 : value_q16);
    for (size_t i = 0; i + 1u < text.length; i++) {
        const size_t next = text.data[i + 1u] == '.' ? i + 2u : i + 1u;
        const char digit = text.data[i];
        q16_t other_q16 = 0;
        if (digit == '.' || digit == '-' || next >= text.length || digit == text.data[next]) {
            continue;
        }
        text.data[i] = text.data[next];
        text.data[next] = digit;
        if (number_parse(text.data, text.length, &other_q16) == NUMBER_OK) {
            try_number(seen, seen_fit, best, at, from_q16(other_q16), _("as if two of its digits were exchanged"));
        }
        text.data[next] = text.data[i];
        text.data[i] = digit;
    }
}

static void try_numbers(const kin_geometry_t *geometry, const layout_t *seen, const fit_t *seen_fit, guess_t *best)
{
    for (unsigned at = 0; at < 2u * CYLINDERS_MAX * COORDINATES; at++) {
        const unsigned joint = at / COORDINATES % CYLINDERS_MAX;
        if (joint >= seen->count) {
            continue;
        }
        const bool is_base = at < CYLINDERS_MAX * COORDINATES;
        const q16_t value_q16 = (is_base ? geometry->base_mm_q16 : geometry->plate_mm_q16)[joint][at % COORDINATES];
        const double value = from_q16(value_q16);
        try_digits(seen, seen_fit, best, at, value_q16);
        try_number(seen, seen_fit, best, at, -value, _("as if its sign were wrong"));
        try_number(seen, seen_fit, best, at, value * 10, _("as if its decimal point were one place off"));
        try_number(seen, seen_fit, best, at, value / 10, _("as if its decimal point were one place off"));
    }
}

/* The slip that explains the joints as they are. Returns false where none does, or where nothing has to be explained. */
static bool find_slip(const settings_t *settings, guess_t *best)
{
    const layout_t seen = layout_of(settings);
    const fit_t fit = fit_of(&seen);
    memset(best, 0, sizeof *best);
    try_exchanges(&seen, &fit, best);
    try_numberings(&seen, &fit, best);
    if (best->what.length == 0) { /* an order explains more than a digit can */
        try_numbers(&settings->geometry, &seen, &fit, best);
    }
    return best->what.length > 0;
}

static void add_slip(const settings_t *settings, const guess_t *slip, config_text_t *text)
{
    const layout_t seen = layout_of(settings);
    const fit_t fit = fit_of(&seen);
    config_text_add(text, _("%s: %s all %u extensions at pose zero agree within %.1f mm, at %.1f mm"), slip->what.data,
                    slip->remedy.data, seen.count, fmax(slip->fit.spread, 0.1), slip->fit.mean);
    if (fit.spread > SUSPECT_MM) {
        config_text_add(text, _("; as they are they differ by %.1f mm"), fit.spread);
    } else {
        config_text_add(text, _("; as they are the cylinders are %.0f mm longer"), fit.mean - slip->fit.mean);
    }
}

/* --- Metres --- */

static double farthest(const layout_t *layout, const joints_t *joints)
{
    double most = 0;
    for (unsigned i = 0; i < layout->count; i++) {
        for (unsigned k = 0; k < COORDINATES; k++) {
            most = fmax(most, fabs(joints->at[i][k]));
        }
    }
    return most;
}

/* Returns false after an error. */
static bool is_in_mm(config_source_t *self, const char *key, const char *what, double most)
{
    if (most >= METRES_MM) {
        return true;
    }
    config_source_key_error(self, SECTION, key, "%s not beyond %.4g mm look like metres; allowed: mm, or as_measured = yes", what,
                            most);
    return false;
}

void config_layout_check(config_source_t *self)
{
    const settings_t *settings = &self->config->settings;
    const layout_t layout = layout_of(settings);
    guess_t slip;
    config_text_t text;
    if (self->config->is_as_measured) {
        return;
    }
    const bool is_base = is_in_mm(self, "base1_mm", _("joints of the base"), farthest(&layout, &layout.base));
    const bool is_plate = is_in_mm(self, "plate1_mm", _("joints of the plate"), farthest(&layout, &layout.plate));
    const bool is_length = is_in_mm(self, "retracted_length_mm", "lengths", layout.retracted[0]);
    if (is_base && is_plate && is_length && find_slip(settings, &slip)) {
        config_text_clear(&text);
        add_slip(settings, &slip, &text);
        config_source_key_error(self, SECTION, slip.key,
                                "%s; allowed: joints in the order of their cylinders, or as_measured = yes", text.data);
    }
}

/* --- What may be meant --- */

/* From above, the part of one cylinder crosses that of another; ends that touch do not count. */
static double side(const double a[], const double b[], const double c[])
{
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
}

static bool is_crossing(const layout_t *layout, unsigned i, unsigned k)
{
    const double *a = layout->base.at[i], *b = layout->plate.at[i], *c = layout->base.at[k], *d = layout->plate.at[k];
    const double touch = 1.0; /* mm^2: joints that two cylinders share */
    return side(a, b, c) * side(a, b, d) < -touch && side(c, d, a) * side(c, d, b) < -touch;
}

static bool find_crossing(const layout_t *layout, config_text_t *text)
{
    for (unsigned i = 0; i < layout->count; i++) {
        for (unsigned k = i + 1u; k < layout->count; k++) {
            if (is_crossing(layout, i, k)) {
                config_text_add(
                    text,
                    _("[geometry] cylinders %u and %u cross each other, seen from above, at pose zero: look at the order "
                      "of the joints"),
                    i + 1u, k + 1u);
                return true;
            }
        }
    }
    return false;
}

/* +Y is to the right: what is numbered clockwise, seen from above, has increasing angles. Right-handed coordinates have not. */
static bool find_numbering(const layout_t *layout, config_text_t *text)
{
    const int base = order_of(layout, &layout->base);
    const int plate = order_of(layout, &layout->plate);
    if (base == 0 && plate == 0) {
        config_text_add(text,
                        _("[geometry] the cylinders are not numbered one after the other round the platform: right if their "
                          "drives are numbered so too"));
    } else if (base == -1 && plate == -1) {
        config_text_add(
            text, _("[geometry] the joints are numbered against the clock, seen from above: right if the cylinders are; but "
                    "where Y was measured to the left, turn the signs of all y"));
    }
    return text->length > 0;
}

static bool find_tilt(const settings_t *settings, config_text_t *text)
{
    if (fx_abs(settings->neutral_q16[AXIS_ROLL]) <= TILTED && fx_abs(settings->neutral_q16[AXIS_PITCH]) <= TILTED) {
        return false;
    }
    config_text_add(text, _("[pose] neutral is not level: roll %.3g deg, pitch %.3g deg"),
                    from_q16(settings->neutral_q16[AXIS_ROLL]), from_q16(settings->neutral_q16[AXIS_PITCH]));
    return true;
}

/* Most cylinders agree, and one or two do not. */
static bool find_odd_one(const layout_t *layout, config_text_t *text)
{
    for (unsigned odd = 0; odd < layout->count && layout->count > 3u; odd++) {
        layout_t others = *layout;
        others.count--;
        for (unsigned i = odd; i < others.count; i++) {
            memcpy(others.base.at[i], layout->base.at[i + 1u], sizeof others.base.at[i]);
            memcpy(others.plate.at[i], layout->plate.at[i + 1u], sizeof others.plate.at[i]);
            others.retracted[i] = layout->retracted[i + 1u];
        }
        const fit_t rest = fit_of(&others);
        const fit_t all = fit_of(layout);
        if (all.spread > SUSPECT_MM && rest.spread < AGREE_MM) {
            config_text_add(
                text,
                _("[geometry] cylinder %u is %.1f mm %s than the others at pose zero, which agree within %.1f mm: look at "
                  "its joints and its length"),
                odd + 1u, all.spread, all.mean > rest.mean ? _("further out") : _("further in"), fmax(rest.spread, 0.1));
            return true;
        }
    }
    return false;
}

bool config_layout_next_oddity(const config_t *config, unsigned *at, config_text_t *text)
{
    const layout_t layout = layout_of(&config->settings);
    guess_t slip;
    bool is_found = false;
    config_text_clear(text);
    while (!is_found && *at < 5u) {
        switch ((*at)++) {
        case 0:
            is_found = find_slip(&config->settings, &slip);
            if (is_found) {
                config_text_add(text, "[geometry] ");
                add_slip(&config->settings, &slip, text);
            }
            break;
        case 1:
            is_found = find_crossing(&layout, text);
            break;
        case 2:
            is_found = find_numbering(&layout, text);
            break;
        case 3:
            is_found = find_tilt(&config->settings, text);
            break;
        default:
            is_found = find_odd_one(&layout, text);
            break;
        }
    }
    return is_found;
}
