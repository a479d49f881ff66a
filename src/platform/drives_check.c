/* SPDX-License-Identifier: MIT
 * drives_check.c - what is checked of drives in the same way; see drives_check.h.
 */
#include "platform/drives_check.h"

#include "common/translate.h"

#include "config/value.h"

bool config_drives_is_given(config_source_t *self, const char *section, const char *name, const char *used_by, unsigned size)
{
    config_text_t allowed;
    if (size > 0 || !config_source_has(self, section, name)) {
        return size > 0;
    }
    config_text_clear(&allowed);
    config_value_allowed(&config_keys[config_key_find(section, name)], &allowed);
    config_source_key_error(self, section, name, "missing for %s; allowed: %s, but not none", used_by, allowed.data);
    return false;
}

bool config_drives_is_length(config_source_t *self, const char *section, const char *name, unsigned count, unsigned wanted)
{
    if (count == 1 || count == wanted) {
        return true;
    }
    config_source_key_error(self, section, name, "has %u values; allowed: one, or one for each of the %u drives", count, wanted);
    return false;
}

/* --- Positions --- */

/* A position in counts that a field has to carry. Returns false after an error. */
static bool is_carried(config_source_t *self, const config_drives_numbers_t *numbers, unsigned axis, q32_t at_q32,
                       const config_drives_field_t *field)
{
    const bool is_angle = axis >= (self->config->settings.geometry.kind == KIN_HEXAPOD ? 6u : 3u);
    const counts_scale_t scale = numbers->scale(self->config, axis);
    int64_t counts = 0;
    config_text_t at;
    const bool is_number = counts_from_units(&scale, at_q32, &counts) == HV_OK;
    if (field->name == NULL || (is_number && counts >= field->min && counts <= field->max)) {
        return true;
    }
    config_text_clear(&at);
    config_text_add_q16(&at, q16_from_q32(at_q32));
    config_source_key_error(self, numbers->section, is_angle ? "angle_counts_per_deg" : "counts_per_mm",
                            _("%s %s of drive %u are %lld counts, and {position} of %s carries %lld to %lld; allowed: a wider or "
                              "signed field, other zero counts, fewer counts"),
                            at.data, is_angle ? "deg" : "mm", axis + 1u, (long long)counts, field->name, (long long)field->min,
                            (long long)field->max);
    return false;
}

static bool is_reach_carried(config_source_t *self, const config_drives_numbers_t *numbers, unsigned axis, q32_t low_q32,
                             q32_t high_q32)
{
    bool is_fine = true;
    for (unsigned i = 0; is_fine && i < sizeof numbers->position / sizeof numbers->position[0]; i++) {
        is_fine = is_carried(self, numbers, axis, low_q32, &numbers->position[i]) &&
                  is_carried(self, numbers, axis, high_q32, &numbers->position[i]);
    }
    return is_fine;
}

void config_drives_check_scales(config_source_t *self, const config_drives_numbers_t *numbers, unsigned cylinders)
{
    const char *section = numbers->section;
    const settings_t *settings = &self->config->settings;
    const axis_settings_t *angle = &settings->axis[AXIS_ANGLE];
    const bool is_zero = config_drives_is_length(self, section, "zero_counts", numbers->zero_counts->count, cylinders);
    bool is_scale = config_drives_is_given(self, section, "counts_per_mm", numbers->used_by, numbers->counts_per_mm->count) &&
                    config_drives_is_length(self, section, "counts_per_mm", numbers->counts_per_mm->count, cylinders);
    for (unsigned i = 0; is_zero && is_scale && i < cylinders; i++) {
        is_scale = is_reach_carried(self, numbers, i, 0, q32_from_q16(settings->stroke_mm_q16[i]));
    }
    if (settings->has_angle &&
        config_drives_is_given(self, section, "angle_counts_per_deg", numbers->used_by, numbers->angle_counts_per_deg->count)) {
        (void)is_reach_carried(self, numbers, cylinders, q32_from_q16(angle->min_q16), q32_from_q16(angle->max_q16));
    }
}

/* --- Speeds --- */

/* The highest speed of an axis in its field. */
static void check_ratio(config_source_t *self, const config_drives_numbers_t *numbers, const char *name,
                        const config_ratios_t *ratios, q16_t speed_q16)
{
    const q32_t speed_q32 = q32_from_q16(speed_q16) / 8 * (q32_t)numbers->speed_eighths;
    for (unsigned i = 0; i < ratios->count; i++) {
        const counts_scale_t scale = {ratios->num[i], ratios->den[i], 0};
        int64_t counts = INT64_MAX;
        const bool is_number = counts_from_units(&scale, speed_q32, &counts) == HV_OK;
        if (!is_number || fx_abs(counts) > numbers->speed.max) {
            config_source_key_error(self, numbers->section, name,
                                    "the speed limit %s %lld counts, and {speed} carries up to %lld; allowed: a smaller ratio",
                                    numbers->speed_eighths == 9u ? _("and an eighth are") : "is", (long long)counts,
                                    (long long)numbers->speed.max);
            return;
        }
    }
}

void config_drives_check_speed(config_source_t *self, const config_drives_numbers_t *numbers, unsigned cylinders)
{
    const char *section = numbers->section;
    const unsigned ratios = numbers->speed_counts_per_mm_s->count;
    if (numbers->position[0].name == NULL) {
        return; /* no set-point: reported already */
    }
    if (numbers->speed.name == NULL) {
        if (ratios > 0 || numbers->speed_counts > 0) {
            config_source_key_error(self, section, ratios > 0 ? "speed_counts_per_mm_s" : "speed_counts",
                                    _("setpoint has no {speed}; allowed: only where it has"));
        }
        return;
    }
    if (ratios == 0 && numbers->speed_counts == 0) {
        config_source_key_error(self, section, "speed_counts",
                                "{speed} would always be 0; allowed: above 0, or speed_counts_per_mm_s");
    } else if (numbers->speed_counts > numbers->speed.max) {
        config_source_key_error(self, section, "speed_counts", "does not fit {speed}; allowed: up to %lld",
                                (long long)numbers->speed.max);
    }
    if (ratios > 0 && config_drives_is_length(self, section, "speed_counts_per_mm_s", ratios, cylinders)) {
        check_ratio(self, numbers, "speed_counts_per_mm_s", numbers->speed_counts_per_mm_s,
                    self->config->settings.cylinder_speed_mm_s_q16);
    }
    check_ratio(self, numbers, "angle_speed_counts_per_deg_s", numbers->angle_speed_counts_per_deg_s,
                self->config->settings.axis[AXIS_ANGLE].speed_q16);
}
