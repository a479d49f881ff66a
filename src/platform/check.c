/* SPDX-License-Identifier: MIT
 * check.c - what the values of a configuration mean together: missing keys, keys that mean nothing here, pairs of limits
 * that contradict each other. Each error is reported at the key it concerns.
 */
#include "platform/check.h"

#include "common/translate.h"

#include <string.h>

#include "platform/bus.h"
#include "platform/canraw_section.h"
#include "platform/cia402_section.h"
#include "platform/coils.h"
#include "platform/gpio.h"
#include "platform/healthy_section.h"
#include "platform/limits.h"
#include "platform/mechanism.h"
#include "platform/modbus_section.h"
#include "platform/scaling.h"
#include "platform/sizes.h"
#include "config/source.h"
#include "config/value.h"
#include "heave/ramp.h"

static const settings_t *settings_of(const config_source_t *self)
{
    return &self->config->settings;
}

static unsigned cylinders_of(const config_source_t *self)
{
    return settings_of(self)->geometry.kind == KIN_HEXAPOD ? 6u : 3u;
}

/* Key of an axis: "min" gives min_deg or min_mm, "jerk" with its "_s3". */
static const char *axis_key(config_text_t *text, unsigned axis, const char *what, const char *per)
{
    config_text_clear(text);
    config_text_add(text, "%s_%s%s", what, config_axis_unit(axis), per);
    return text->data;
}

static const char *q16_text(config_text_t *text, q16_t value_q16)
{
    config_text_clear(text);
    config_text_add_q16(text, value_q16);
    return text->data;
}

/* --- Keys that are missing or mean nothing here --- */

/* Whether it is known what the platform has; where it is not, its own error says so. */
static bool is_decidable(const config_source_t *self, config_needs_t needs)
{
    switch (needs) {
    case CONFIG_NEEDS_NOTHING:
        return true;
    case CONFIG_NEEDS_HEXAPOD:
        return config_source_has(self, "platform", "kind");
    case CONFIG_NEEDS_ANGLE:
        return config_source_has(self, "angle", "present");
    }
    return true;
}

static void check_section(config_source_t *self, unsigned index)
{
    const config_section_t *section = &config_sections[index];
    if (self->section_line[index] == 0 || !is_decidable(self, section->needs) ||
        config_is_applicable(section->needs, self->config)) {
        return;
    }
    config_source_error(self, self->section_line[index],
                        "[%s]: a %s has no such axis or cylinder; allowed: with kind = hexapod only", section->name,
                        config_kind_name(settings_of(self)->geometry.kind));
}

static void check_presence(config_source_t *self, const config_key_t *key, const config_entry_t *entry)
{
    const config_needs_t section_needs = config_sections[config_section_find(key->section)].needs;
    config_text_t allowed;
    if (!is_decidable(self, key->needs) || !config_is_applicable(section_needs, self->config)) {
        return;
    }
    if (!config_is_applicable(key->needs, self->config)) {
        if (entry->line != 0) {
            config_source_key_error(self, key->section, key->name, "means nothing on this platform; allowed: with %s only",
                                    key->needs == CONFIG_NEEDS_ANGLE ? _("[angle] present = yes") : _("kind = hexapod"));
        }
        return;
    }
    if (entry->line != 0 || entry->is_derived || key->fallback != NULL) {
        return;
    }
    config_text_clear(&allowed);
    config_value_allowed(key, &allowed);
    config_source_key_error(self, key->section, key->name, "missing; allowed: %s", allowed.data);
}

static void check_keys(config_source_t *self)
{
    for (unsigned i = 0; i < config_section_count; i++) {
        check_section(self, i);
    }
    for (unsigned i = 0; i < config_key_count; i++) {
        check_presence(self, &config_keys[i], &self->entry[i]);
    }
}

/* --- Values against each other --- */

/* One value, or one per cylinder; cylinders that are not there get 0. */
static void check_per_cylinder(config_source_t *self, const char *name, q16_t values_q16[CYLINDERS_MAX])
{
    config_entry_t *entry = &self->entry[config_key_find("geometry", name)];
    const unsigned cylinders = cylinders_of(self);
    if (!entry->is_valid || !config_source_has(self, "platform", "kind")) {
        return;
    }
    for (unsigned i = cylinders; i < CYLINDERS_MAX; i++) {
        values_q16[i] = 0;
    }
    if (entry->count == 1u || entry->count == cylinders) {
        return;
    }
    entry->is_valid = false;
    config_source_key_error(self, "geometry", name, "has %u values; allowed: one, or one for each of the %u cylinders",
                            entry->count, cylinders);
}

static bool has_axis(const config_source_t *self, unsigned axis)
{
    const config_needs_t needs =
        axis == AXIS_ANGLE ? CONFIG_NEEDS_ANGLE : config_sections[config_section_find(config_axis_section[axis])].needs;
    return is_decidable(self, needs) && config_is_applicable(needs, self->config);
}

/* Both ends of an axis are known and in order. */
static bool has_bounds(const config_source_t *self, unsigned axis)
{
    config_text_t key;
    const char *section = config_axis_section[axis];
    return config_source_has(self, section, axis_key(&key, axis, "min", "")) &&
           config_source_has(self, section, axis_key(&key, axis, "max", "")) &&
           settings_of(self)->axis[axis].min_q16 != CONFIG_NONE && settings_of(self)->axis[axis].max_q16 != CONFIG_NONE &&
           settings_of(self)->axis[axis].min_q16 < settings_of(self)->axis[axis].max_q16;
}

static void check_bounds(config_source_t *self, unsigned axis)
{
    const char *section = config_axis_section[axis];
    config_text_t key, low;
    if (has_bounds(self, axis) || !config_source_has(self, section, axis_key(&key, axis, "min", "")) ||
        !config_source_has(self, section, axis_key(&key, axis, "max", "")) ||
        settings_of(self)->axis[axis].min_q16 == CONFIG_NONE || settings_of(self)->axis[axis].max_q16 == CONFIG_NONE) {
        return;
    }
    config_source_key_error(self, section, key.data, "not above min_%s; allowed: more than %s %s", config_axis_unit(axis),
                            q16_text(&low, settings_of(self)->axis[axis].min_q16), config_axis_unit(axis));
}

/* The limits of a ramp, with another jerk. */
static bool is_ramp(const axis_settings_t *axis, int32_t jerk, uint32_t cycle_us)
{
    ramp_limits_t limits;
    return ramp_limits_from_units(axis->min_q16, axis->max_q16, axis->speed_q16, axis->accel_q16, jerk, cycle_us, &limits) ==
           HV_OK;
}

/* Smallest jerk that a ramp takes, 0 where there is none. */
static int32_t least_jerk(const axis_settings_t *axis, uint32_t cycle_us)
{
    int32_t low = 0;
    int32_t high = INT32_MAX;
    if (!is_ramp(axis, high, cycle_us)) {
        return 0;
    }
    while (high - low > 1) {
        const int32_t middle = low + (high - low) / 2;
        if (is_ramp(axis, middle, cycle_us)) {
            high = middle;
        } else {
            low = middle;
        }
    }
    return high;
}

/* Reports limits that the ramp cannot keep. */
static void check_ramp(config_source_t *self, const char *section, const char *jerk_key, const axis_settings_t *axis)
{
    const uint32_t cycle_us = settings_of(self)->cycle_us;
    if (!config_source_has(self, "platform", "cycle_us") || is_ramp(axis, axis->jerk, cycle_us)) {
        return;
    }
    const int32_t least = least_jerk(axis, cycle_us);
    if (least > 0) {
        config_source_key_error(self, section, jerk_key, "too small for this speed and a cycle of %u us; allowed: at least %d",
                                (unsigned)cycle_us, (int)least);
    } else {
        config_source_key_error(self, section, jerk_key,
                                "speed, accel and jerk do not fit a cycle of %u us; allowed: larger ones", (unsigned)cycle_us);
    }
}

static void check_axis(config_source_t *self, unsigned axis)
{
    const char *section = config_axis_section[axis];
    config_text_t key;
    if (!has_axis(self, axis)) {
        return;
    }
    check_bounds(self, axis);
    if (!has_bounds(self, axis) || config_limits_is_open(&settings_of(self)->axis[axis]) ||
        !config_source_has(self, section, axis_key(&key, axis, "speed", "_s")) ||
        !config_source_has(self, section, axis_key(&key, axis, "accel", "_s2")) ||
        !config_source_has(self, section, axis_key(&key, axis, "jerk", "_s3"))) {
        return;
    }
    check_ramp(self, section, key.data, &settings_of(self)->axis[axis]);
}

static void check_neutral(config_source_t *self)
{
    config_text_t value, low, high;
    if (!config_source_has(self, "pose", "neutral") || !config_source_has(self, "platform", "kind")) {
        return;
    }
    for (unsigned axis = 0; axis < POSE_AXES; axis++) {
        const axis_settings_t *limits = &settings_of(self)->axis[axis];
        const q16_t neutral_q16 = settings_of(self)->neutral_q16[axis];
        if (!has_axis(self, axis) && neutral_q16 != 0) {
            config_source_key_error(self, "pose", "neutral", "%s of %s on a %s; allowed: 0", config_axis_section[axis],
                                    q16_text(&value, neutral_q16), config_kind_name(settings_of(self)->geometry.kind));
        }
        if (has_axis(self, axis) && has_bounds(self, axis) && (neutral_q16 < limits->min_q16 || neutral_q16 > limits->max_q16)) {
            config_source_key_error(self, "pose", "neutral", "%s of %s; allowed: %s to %s %s (min and max of [%s])",
                                    config_axis_section[axis], q16_text(&value, neutral_q16), q16_text(&low, limits->min_q16),
                                    q16_text(&high, limits->max_q16), config_axis_unit(axis), config_axis_section[axis]);
        }
    }
}

/* Shortest stroke of all cylinders. */
static q16_t shortest_stroke(const config_source_t *self)
{
    q16_t shortest_q16 = INT32_MAX;
    for (unsigned i = 0; i < cylinders_of(self); i++) {
        const q16_t stroke_q16 = settings_of(self)->stroke_mm_q16[i];
        shortest_q16 = stroke_q16 < shortest_q16 ? stroke_q16 : shortest_q16;
    }
    return shortest_q16;
}

static bool has_stroke(const config_source_t *self)
{
    return config_source_has(self, "geometry", "stroke_mm") && config_source_has(self, "cylinders", "margin_mm") &&
           config_source_has(self, "platform", "kind");
}

/* An extension that all cylinders shall have, against what margin and stroke leave. */
static void check_extension(config_source_t *self, const char *section, const char *name, q16_t extension_q16)
{
    const q16_t margin_q16 = settings_of(self)->margin_mm_q16;
    const q16_t highest_q16 = shortest_stroke(self) - margin_q16;
    config_text_t value, low, high;
    if (extension_q16 >= margin_q16 && extension_q16 <= highest_q16) {
        return;
    }
    config_source_key_error(self, section, name, "%s mm is outside the usable stroke; allowed: %s to %s mm (stroke less margins)",
                            q16_text(&value, extension_q16), q16_text(&low, margin_q16), q16_text(&high, highest_q16));
}

static void check_stroke(config_source_t *self)
{
    const settings_t *settings = settings_of(self);
    config_text_t half;
    if (!has_stroke(self)) {
        return;
    }
    if (2 * (int64_t)settings->margin_mm_q16 >= shortest_stroke(self)) {
        config_source_key_error(self, "cylinders", "margin_mm", "the margins leave nothing of the stroke; allowed: below %s mm",
                                q16_text(&half, shortest_stroke(self) / 2));
        return;
    }
    if (config_source_has(self, "pose", "settled_extension_mm")) {
        check_extension(self, "pose", "settled_extension_mm", settings->settled_extension_mm_q16);
    }
}

static void check_sim(config_source_t *self)
{
    const q16_t start_q16 = self->config->sim.start_extension_mm_q16;
    config_text_t value, stroke;
    if (!has_stroke(self) || start_q16 <= shortest_stroke(self)) {
        return;
    }
    config_source_key_error(self, "sim", "start_extension_mm", "%s mm is above the stroke; allowed: 0 to %s mm, or settled",
                            q16_text(&value, start_q16), q16_text(&stroke, shortest_stroke(self)));
}

static void check_cylinders(config_source_t *self)
{
    const settings_t *settings = settings_of(self);
    if (!has_stroke(self) || 2 * (int64_t)settings->margin_mm_q16 >= shortest_stroke(self) ||
        !config_source_has(self, "cylinders", "speed_mm_s") || !config_source_has(self, "cylinders", "accel_mm_s2") ||
        !config_source_has(self, "cylinders", "jerk_mm_s3")) {
        return;
    }
    const axis_settings_t cylinder = {.min_q16 = settings->margin_mm_q16,
                                      .max_q16 = shortest_stroke(self) - settings->margin_mm_q16,
                                      .speed_q16 = settings->cylinder_speed_mm_s_q16,
                                      .accel_q16 = settings->cylinder_accel_mm_s2_q16,
                                      .jerk = settings->cylinder_jerk_mm_s3};
    check_ramp(self, "cylinders", "jerk_mm_s3", &cylinder);
}

static void check_engage(config_source_t *self, const char *name, q16_t engage_q16, q16_t cylinder_q16)
{
    config_text_t value, highest;
    if (!config_source_has(self, "engage", name) || !config_source_has(self, "cylinders", name) || engage_q16 <= cylinder_q16) {
        return;
    }
    config_source_key_error(self, "engage", name, "%s is above %s of [cylinders]; allowed: at most %s",
                            q16_text(&value, engage_q16), name, q16_text(&highest, cylinder_q16));
}

/* A socket that is bound to one address hears nothing that is sent to another, be it a group's. */
static void check_group(config_source_t *self)
{
    const config_udp_t *udp = &self->config->udp;
    const bool is_ipv6 = strchr(udp->group, ':') != NULL;
    const bool is_any = strcmp(udp->bind, "::") == 0 || (!is_ipv6 && strcmp(udp->bind, "0.0.0.0") == 0);
    if (udp->group[0] != '\0' && !is_any) {
        config_source_key_error(self, "udp", "group", "is not heard where bind is %s; allowed: bind = %s", udp->bind,
                                is_ipv6 ? "::" : "0.0.0.0");
    }
}

/* Each silence that is not "never" comes after the ones before it. */
static void check_silence(config_source_t *self)
{
    const settings_t *settings = settings_of(self);
    static const char *const names[] = {"silence_hold_ms", "silence_neutral_ms", "silence_settle_ms"};
    const uint32_t silences_ms[] = {settings->silence_hold_ms, settings->silence_neutral_ms, settings->silence_settle_ms};
    for (unsigned later = 1; later < 3u; later++) {
        for (unsigned earlier = 0; earlier < later; earlier++) {
            if (silences_ms[later] != 0 && silences_ms[earlier] >= silences_ms[later]) {
                config_source_key_error(self, "udp", names[later], "not after %s; allowed: 0, or more than %u ms", names[earlier],
                                        (unsigned)silences_ms[earlier]);
            }
        }
    }
}

static void check_intensity(config_source_t *self)
{
    settings_t *settings = &self->config->settings;
    if (settings->intensity_start_percent == CONFIG_NONE) {
        settings->intensity_start_percent = (int32_t)settings->intensity_max_percent;
    }
    if (config_source_has(self, "intensity", "max_percent") && config_source_has(self, "intensity", "start_percent") &&
        settings->intensity_start_percent > (int32_t)settings->intensity_max_percent) {
        config_source_key_error(self, "intensity", "start_percent", "above max_percent; allowed: 0 to %u, or max",
                                (unsigned)settings->intensity_max_percent);
    }
}

static void check_per_relay(config_source_t *self, const char *name)
{
    const unsigned given = self->entry[config_key_find("relays", name)].count;
    const unsigned count = self->config->relays.lines.count;
    if (config_source_has(self, "relays", name) && given > 1u && given != count) {
        config_source_key_error(self, "relays", name, "has %u values; allowed: one, or one for each of the %u relays in lines",
                                given, count);
    }
}

/* What each relay may do has to leave it a way to do it. */
static void check_relay_times(config_source_t *self)
{
    const settings_t *settings = settings_of(self);
    if (!config_source_has_all(self, "relays")) {
        return;
    }
    for (unsigned i = 0; i < settings->relays.count; i++) {
        const unsigned on_ms = settings->relays.max_on_ms[i];
        const unsigned toggle_ms = settings->relays.min_toggle_ms[i];
        if (on_ms != 0 && (settings->relay_safe_mask >> i & 1u) != 0) {
            config_source_key_error(self, "relays", "max_on_ms", "relay %u is closed by safe_mask; allowed: 0 for it", i + 1u);
        } else if (on_ms != 0 && on_ms < toggle_ms) {
            config_source_key_error(self, "relays", "max_on_ms",
                                    "%u ms is below min_toggle_ms of relay %u; allowed: 0, or at least %u ms", on_ms, i + 1u,
                                    toggle_ms);
        }
    }
}

static void check_relays(config_source_t *self)
{
    settings_t *settings = &self->config->settings;
    const unsigned count = self->config->relays.lines.count;
    settings->relays.count = (uint8_t)count;
    for (unsigned i = count; i < CONFIG_RELAYS_MAX; i++) {
        settings->relays.max_on_ms[i] = 0;
        settings->relays.min_toggle_ms[i] = 0;
    }
    if (config_source_has(self, "relays", "lines")) {
        check_per_relay(self, "max_on_ms");
        check_per_relay(self, "min_toggle_ms");
        check_relay_times(self);
    }
    if (config_source_has(self, "relays", "lines") && (settings->relay_safe_mask >> count) != 0) {
        config_source_key_error(self, "relays", "safe_mask", "names relays above the %u in lines; allowed: 0 to %X", count,
                                (1u << count) - 1u);
    }
}

/* What is compared with a hash has to look like one, or nothing would ever move. */
static void check_approved(config_source_t *self)
{
    const char *approved = self->config->approved.text;
    if (!config_source_has(self, "platform", "approved") || approved[0] == '\0') {
        return;
    }
    if (strlen(approved) != CONFIG_HASH_MAX - 1u || strspn(approved, "0123456789abcdef") != CONFIG_HASH_MAX - 1u) {
        config_source_key_error(self, "platform", "approved", "%s is no hash; allowed: none, or the %u digits that --check shows",
                                approved, CONFIG_HASH_MAX - 1u);
    } else if (config_source_has(self, "platform", "engage") && self->config->settings.engage == ENGAGE_AUTO) {
        config_source_key_error(self, "platform", "approved",
                                "engage = auto waits for nobody to look at it; allowed: none, or engage = manual");
    }
}

static void check_selftest(config_source_t *self)
{
    if (self->config->selftest.when != CONFIG_SELFTEST_NONE && config_source_has(self, "platform", "engage") &&
        self->config->settings.engage == ENGAGE_AUTO) {
        config_source_key_error(self, "service", "selftest",
                                "engage = auto waits for nobody to make it; allowed: none, or engage = manual");
    }
}

/* Those that the file gives; those that it leaves out once they are filled in. */
static void check_limits(config_source_t *self)
{
    for (unsigned axis = 0; axis < AXES_MAX; axis++) {
        check_axis(self, axis);
    }
    check_neutral(self);
}

static void check_values(config_source_t *self)
{
    settings_t *settings = &self->config->settings;
    check_per_cylinder(self, "retracted_length_mm", settings->geometry.retracted_mm_q16);
    check_per_cylinder(self, "stroke_mm", settings->stroke_mm_q16);
    check_limits(self);
    check_stroke(self);
    check_sim(self);
    check_cylinders(self);
    check_engage(self, "speed_mm_s", settings->engage_speed_mm_s_q16, settings->cylinder_speed_mm_s_q16);
    check_engage(self, "accel_mm_s2", settings->engage_accel_mm_s2_q16, settings->cylinder_accel_mm_s2_q16);
    check_group(self);
    check_approved(self);
    check_selftest(self);
    check_silence(self);
    check_intensity(self);
    check_relays(self);
    config_coils_check(self);
    config_gpio_check(self);
    config_healthy_check(self);
    config_scaling_resolve(self);
    config_scaling_check(self);
    config_cia402_check(self);
    config_canraw_check(self);
    config_modbus_check(self);
    config_bus_check(self);
}

void config_check(config_source_t *self)
{
    config_sizes_resolve(self);
    check_keys(self);
    check_values(self);
    config_limits_clear_absent(self->config);
    if (self->error_count == 0) {
        config_sizes_resolve_height(self);
    }
    if (self->error_count == 0) {
        config_check_mechanism(self);
    }
    if (self->error_count == 0 && config_limits_fill(self->config)) {
        check_limits(self);
    }
}
