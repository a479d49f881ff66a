/* SPDX-License-Identifier: MIT
 * mechanism.c - whether the mechanism of a configuration can do what is asked of it. Looked at only where all else is
 * right: its errors would only repeat the others.
 */
#include "platform/mechanism.h"

#include "common/translate.h"

#include "platform/layout.h"

#define HEIGHT_SEARCH_MM 8000 /* the range of zero_height_mm */

static const settings_t *settings_of(const config_source_t *self)
{
    return &self->config->settings;
}

static const char *q32_text(config_text_t *text, q32_t value_q32)
{
    config_text_clear(text);
    config_text_add_milli(text, fx_mul_shift(value_q32, 1000, 32));
    return text->data;
}

unsigned config_mechanism_find_outside(const settings_t *settings, const kin_t *kin, const pose_t *pose, q16_t margin_mm_q16,
                                       q32_t *extension_mm_q32)
{
    q32_t extensions_q32[CYLINDERS_MAX];
    const q32_t margin_q32 = q32_from_q16(margin_mm_q16);
    if (kin_inverse(kin, pose, extensions_q32) != HV_OK) {
        return 0;
    }
    for (unsigned i = 0; i < kin_cylinders(kin); i++) {
        *extension_mm_q32 = extensions_q32[i];
        if (extensions_q32[i] < margin_q32 || extensions_q32[i] > q32_from_q16(settings->stroke_mm_q16[i]) - margin_q32) {
            return i;
        }
    }
    return kin_cylinders(kin);
}

/* Lowest and highest zero height whose pose zero lies within the stroke, to 1 mm.
 * Returns false where there is none. */
static bool find_heights(const config_source_t *self, const kin_t *kin, int32_t *lowest_mm, int32_t *highest_mm)
{
    bool is_found = false;
    for (int32_t height_mm = 0; height_mm <= HEIGHT_SEARCH_MM; height_mm++) {
        pose_t pose = {{0}};
        q32_t extension_q32 = 0;
        pose.axis_q32[AXIS_Z] = q32_from_int(height_mm) - q32_from_q16(settings_of(self)->geometry.zero_height_mm_q16);
        if (config_mechanism_find_outside(settings_of(self), kin, &pose, 0, &extension_q32) < kin_cylinders(kin)) {
            continue;
        }
        *lowest_mm = is_found ? *lowest_mm : height_mm;
        *highest_mm = height_mm;
        is_found = true;
    }
    return is_found;
}

/* Returns whether pose zero is within the stroke. */
static bool check_zero_height(config_source_t *self, const kin_t *kin)
{
    const pose_t zero = {{0}};
    q32_t extension_q32 = 0;
    int32_t lowest_mm = 0, highest_mm = 0;
    config_text_t extension;
    const unsigned cylinder = config_mechanism_find_outside(settings_of(self), kin, &zero, 0, &extension_q32);
    if (cylinder >= kin_cylinders(kin)) {
        return true;
    }
    if (find_heights(self, kin, &lowest_mm, &highest_mm)) {
        config_source_key_error(self, "geometry", "zero_height_mm",
                                "pose zero needs an extension of %s mm of cylinder %u; allowed: about %d to %d mm",
                                q32_text(&extension, extension_q32), cylinder + 1u, (int)lowest_mm, (int)highest_mm);
    } else {
        config_source_key_error(
            self, "geometry", "zero_height_mm",
            "no height holds all cylinders within their stroke; allowed: joints and lengths that fit together");
    }
    return false;
}

static void check_neutral_reach(config_source_t *self, const kin_t *kin)
{
    pose_t neutral;
    q32_t extension_q32 = 0;
    config_text_t extension;
    for (unsigned axis = 0; axis < POSE_AXES; axis++) {
        neutral.axis_q32[axis] = q32_from_q16(settings_of(self)->neutral_q16[axis]);
    }
    const unsigned cylinder =
        config_mechanism_find_outside(settings_of(self), kin, &neutral, settings_of(self)->margin_mm_q16, &extension_q32);
    if (cylinder < kin_cylinders(kin)) {
        config_source_key_error(self, "pose", "neutral",
                                "needs an extension of %s mm of cylinder %u; allowed: within stroke and margin",
                                q32_text(&extension, extension_q32), cylinder + 1u);
    }
}

static void check_settled(config_source_t *self, const kin_t *kin)
{
    const pose_t guess = {{0}};
    pose_t settled;
    q32_t extension_q32[CYLINDERS_MAX] = {0};
    for (unsigned i = 0; i < kin_cylinders(kin); i++) {
        extension_q32[i] = q32_from_q16(settings_of(self)->settled_extension_mm_q16);
    }
    if (kin_forward(kin, extension_q32, &guess, &settled, NULL) != HV_OK) {
        config_source_key_error(self, "pose", "settled_extension_mm",
                                "no pose of the plate has this extension; allowed: joints and lengths that fit together");
    }
}

void config_check_mechanism(config_source_t *self)
{
    kin_t kin;
    if (kin_init(&kin, &settings_of(self)->geometry) != HV_OK) {
        config_source_key_error(self, "platform", "kind", "these joints do not make a %s; allowed: %s",
                                config_kind_name(settings_of(self)->geometry.kind),
                                settings_of(self)->geometry.kind == KIN_TRIPOD_3RPS
                                    ? _("joints at 0, 120 and 240 deg from +X, plate joints on one level circle")
                                    : _("joints and lengths in their ranges"));
        return;
    }
    const int before = self->error_count;
    config_layout_check(self);
    if (self->error_count > before) {
        return;
    }
    if (check_zero_height(self, &kin)) {
        check_neutral_reach(self, &kin);
    }
    check_settled(self, &kin);
}
