/* SPDX-License-Identifier: MIT
 * sizes.c - joints from radii, spreads and turns; see sizes.h.
 *
 * A hexapod has three pairs of joints on each circle, 120 degrees apart, numbered clockwise as seen from above (+Y is to the
 * right). The base's pairs are 1 2, 3 4 and 5 6, the first one in front. The plate's are 2 3, 4 5 and 6 1, between those of the
 * base, so that cylinders 1 and 2 part upwards. Three cylinders stand at 0, 120 and 240 degrees, on the base and on the plate.
 */
#include "platform/sizes.h"

#include "common/translate.h"

#include "heave/kin.h"

#define SECTION      "geometry"
#define THIRD_DEG    120
#define HALF_PLACE   60 /* the plate's pairs stand between those of the base */
#define HEIGHT_STEPS 32
#define HEIGHT_MM    8000 /* the range of zero_height_mm */
#define Q62_TO_Q16   62

/* The keys of one set of joints. */
typedef struct {
    const char *radius, *spread, *turn;
    const char *joint; /* of the first one */
    config_circle_t *circle;
    q16_t (*joints)[3];
    unsigned first; /* the pair that joint 1 belongs to begins so many joints before it */
    int turn_deg;
} set_t;

static unsigned cylinders_of(const config_source_t *self)
{
    return self->config->settings.geometry.kind == KIN_HEXAPOD ? 6u : 3u;
}

/* Key of a joint: "base", 2 gives base3_mm. */
static const char *joint_key(const set_t *set, unsigned i, config_text_t *text)
{
    config_text_clear(text);
    config_text_add(text, "%s%u_mm", set->joint, i + 1u);
    return text->data;
}

/* The angle of a joint, in Q32 degrees. */
static q32_t angle_of(const set_t *set, unsigned i, unsigned cylinders)
{
    const q32_t turn_q32 = q32_from_q16(set->circle->turn_deg_q16);
    if (cylinders == 3u) {
        return turn_q32 + q32_from_int((int32_t)i * THIRD_DEG);
    }
    const unsigned place = i + set->first; /* 0 and 1: the first pair */
    const q32_t half_q32 = q32_from_q16(set->circle->spread_deg_q16) / 2;
    const q32_t centre_q32 = turn_q32 + q32_from_int((int32_t)(place / 2u) * THIRD_DEG + set->turn_deg);
    return place % 2u == 0 ? centre_q32 - half_q32 : centre_q32 + half_q32;
}

static void place_joints(const set_t *set, unsigned cylinders)
{
    for (unsigned i = 0; i < cylinders; i++) {
        q62_t sin_q62 = 0, cos_q62 = 0;
        fx_sincos_deg(angle_of(set, i, cylinders), &sin_q62, &cos_q62);
        set->joints[i][0] = (q16_t)fx_mul_shift(cos_q62, set->circle->radius_mm_q16, Q62_TO_Q16);
        set->joints[i][1] = (q16_t)fx_mul_shift(sin_q62, set->circle->radius_mm_q16, Q62_TO_Q16);
        set->joints[i][2] = 0;
    }
}

/* --- What has to stand together, and what may not --- */

/* Returns false after an error. */
static bool is_alone(config_source_t *self, const set_t *set, unsigned cylinders)
{
    config_text_t key;
    for (unsigned i = 0; i < cylinders; i++) {
        const unsigned line = self->entry[config_key_find(SECTION, joint_key(set, i, &key))].line;
        if (line != 0) {
            config_source_key_error(self, SECTION, set->radius,
                                    "%s says where joints are, at line %u; allowed: joints or sizes, not both", key.data, line);
            return false;
        }
    }
    return true;
}

static bool is_spread_given(config_source_t *self, const set_t *set, unsigned cylinders)
{
    if (cylinders == 6u && set->circle->spread_deg_q16 == CONFIG_NONE) {
        config_source_key_error(self, SECTION, set->spread,
                                "missing beside %s; allowed: the angle between the two joints of a pair", set->radius);
        return false;
    }
    return true;
}

/* Without a radius the others mean nothing. */
static void reject_rest(config_source_t *self, const set_t *set)
{
    const bool is_spread = cylinders_of(self) == 6u && set->circle->spread_deg_q16 != CONFIG_NONE;
    if (is_spread || set->circle->turn_deg_q16 != 0) {
        config_source_key_error(self, SECTION, is_spread ? set->spread : set->turn,
                                _("means nothing without %s; allowed: with it"), set->radius);
    }
}

/* What was asked for has been said, be it right or wrong: nobody shall miss the joints beside it. */
static void mark_joints(config_source_t *self, const set_t *set, bool is_right)
{
    config_text_t key;
    for (unsigned i = 0; i < cylinders_of(self); i++) {
        config_entry_t *entry = &self->entry[config_key_find(SECTION, joint_key(set, i, &key))];
        entry->is_derived = true;
        entry->is_valid = is_right;
    }
}

static void resolve_set(config_source_t *self, const set_t *set)
{
    const unsigned cylinders = cylinders_of(self);
    if (!config_source_has(self, SECTION, set->radius) || !config_source_has(self, SECTION, set->spread) ||
        !config_source_has(self, SECTION, set->turn)) {
        mark_joints(self, set, false);
        return;
    }
    if (set->circle->radius_mm_q16 == CONFIG_NONE) {
        reject_rest(self, set);
    } else {
        const bool is_right = is_alone(self, set, cylinders) && is_spread_given(self, set, cylinders);
        mark_joints(self, set, is_right);
        if (is_right) {
            place_joints(set, cylinders);
        }
    }
    *set->circle = (config_circle_t){.radius_mm_q16 = CONFIG_NONE, .spread_deg_q16 = CONFIG_NONE};
}

void config_sizes_resolve(config_source_t *self)
{
    kin_geometry_t *geometry = &self->config->settings.geometry;
    const set_t base = {.radius = "base_radius_mm",
                        .spread = "base_spread_deg",
                        .turn = "base_turn_deg",
                        .joint = "base",
                        .circle = &self->config->base,
                        .joints = geometry->base_mm_q16};
    const set_t plate = {.radius = "plate_radius_mm",
                         .spread = "plate_spread_deg",
                         .turn = "plate_turn_deg",
                         .joint = "plate",
                         .circle = &self->config->plate,
                         .joints = geometry->plate_mm_q16,
                         .first = 1u,
                         .turn_deg = -HALF_PLACE};
    if (config_source_has(self, "platform", "kind")) {
        resolve_set(self, &base);
        resolve_set(self, &plate);
    }
}

/* --- The height --- */

/* What the extensions are too much, all together, at a height above pose zero. */
static q32_t excess(const kin_t *kin, const settings_t *settings, q32_t height_q32)
{
    pose_t pose = {{0}};
    q32_t extension_q32[CYLINDERS_MAX] = {0};
    q32_t sum_q32 = 0;
    pose.axis_q32[AXIS_Z] = height_q32;
    if (kin_inverse(kin, &pose, extension_q32) != HV_OK) {
        return 0;
    }
    for (unsigned i = 0; i < kin_cylinders(kin); i++) {
        sum_q32 += extension_q32[i] - q32_from_q16(settings->stroke_mm_q16[i]) / 2;
    }
    return sum_q32;
}

void config_sizes_resolve_height(config_source_t *self)
{
    settings_t *settings = &self->config->settings;
    q32_t low_q32 = 0;
    q32_t high_q32 = q32_from_int(HEIGHT_MM);
    kin_t kin;
    if (settings->geometry.zero_height_mm_q16 != CONFIG_NONE) {
        return;
    }
    settings->geometry.zero_height_mm_q16 = 0;
    if (kin_init(&kin, &settings->geometry) != HV_OK) {
        return; /* reported where the mechanism is looked at */
    }
    if (excess(&kin, settings, low_q32) >= 0 || excess(&kin, settings, high_q32) <= 0) {
        config_source_key_error(self, SECTION, "zero_height_mm",
                                "at no height are the cylinders half way out; allowed: joints and lengths that fit together");
        return;
    }
    for (unsigned i = 0; i < HEIGHT_STEPS; i++) {
        const q32_t middle_q32 = low_q32 + (high_q32 - low_q32) / 2;
        if (excess(&kin, settings, middle_q32) < 0) {
            low_q32 = middle_q32;
        } else {
            high_q32 = middle_q32;
        }
    }
    settings->geometry.zero_height_mm_q16 = q16_from_q32(high_q32);
}
