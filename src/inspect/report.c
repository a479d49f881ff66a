/* SPDX-License-Identifier: MIT
 * report.c - what follows from a configuration: where the platform can go, how fast its cylinders would have to be, what
 * limits would suit it, and warnings where it asks for what it cannot have. Figures for people: the limits themselves are kept
 * elsewhere.
 */
#include "inspect/report.h"

#include <math.h>
#include <string.h>

#include "common/columns.h"
#include "common/translate.h"
#include "platform/bus.h"
#include "platform/cia402_section.h" // config_cia402_pp_lag_q32
#include "config/hash.h"
#include "config/keys.h"
#include "platform/layout.h"
#include "platform/modbus_section.h"
#include "platform/scaling.h"
#include "config/config_text.h"
#include "heave/ramp.h"
#include "platform/envelope.h"

#define EDGE_TOLERANCE 0.001 /* deg or mm: a limit on the edge itself is fine */
#define DIAGONALS      4u    /* of a pair: both axes as far as each other, in every combination of senses */

/* A report in the making. */
typedef struct {
    const config_t *config;
    const settings_t *settings;
    FILE *out;
    envelope_t envelope;
    int warnings;
} report_t;

/* What rounds to 0.000 is 0: no "-0.000". */
static double zero_free(double value)
{
    return fabs(value) < 0.0005 ? 0.0 : value;
}

static double number(q32_t value_q32)
{
    return zero_free((double)value_q32 / (double)Q32_ONE);
}

static double number_q16(q16_t value_q16)
{
    return (double)value_q16 / (double)Q16_ONE;
}

static void warn(report_t *self, const char *text)
{
    fprintf(self->out, _("warning: %s\n"), translate(text));
    self->warnings++;
}

static void write_extensions(const report_t *self, const char *name, const pose_t *pose)
{
    q32_t extension_q32[CYLINDERS_MAX] = {0};
    columns_put(self->out, name, CONFIG_LABEL_COLUMNS - 2u);
    if (kin_inverse(&self->envelope.kin, pose, extension_q32) != HV_OK) {
        return;
    }
    for (unsigned i = 0; i < self->envelope.cylinders; i++) {
        fprintf(self->out, "  c%u %.3f", i + 1u, number(extension_q32[i]));
    }
    fprintf(self->out, " mm\n");
}

static void write_settled(const report_t *self)
{
    const pose_t guess = {{0}};
    pose_t pose;
    q32_t extension_q32[CYLINDERS_MAX] = {0};
    for (unsigned i = 0; i < self->envelope.cylinders; i++) {
        extension_q32[i] = q32_from_q16(self->settings->settled_extension_mm_q16);
    }
    columns_put(self->out, _("settled"), CONFIG_LABEL_COLUMNS);
    fprintf(self->out, _("%.3f mm of all cylinders"), number_q16(self->settings->settled_extension_mm_q16));
    if (kin_forward(&self->envelope.kin, extension_q32, &guess, &pose, NULL) == HV_OK) {
        fprintf(self->out, ":");
        for (unsigned axis = 0; axis < POSE_AXES; axis++) {
            fprintf(self->out, " %s %.3f", config_axis_section[axis], number(pose.axis_q32[axis]));
        }
    }
    fprintf(self->out, "\n");
}

/* The worst case, which no real traffic reaches. */
static void write_bus(const report_t *self)
{
    config_bus_t bus;
    config_bus_describe(self->config, &bus);
    if (config_modbus_is_used(self->config)) {
        config_modbus_report(self->config, self->out);
        return;
    }
    if (bus.section == NULL) {
        columns_put(self->out, _("bus load"), CONFIG_LABEL_COLUMNS);
        fprintf(self->out, "%s\n", _("0 % (simulated drives)"));
        return;
    }
    columns_put(self->out, _("bus load"), CONFIG_LABEL_COLUMNS);
    fprintf(self->out, _("%.1f %% at worst (%u us period, %u bit/s)\n"), config_bus_load_ppm(&bus) / 10000.0,
            (unsigned)bus.period_us, (unsigned)bus.bitrate_bps);
}

static void write_head(const report_t *self, size_t ram_bytes)
{
    columns_put(self->out, _("platform"), CONFIG_LABEL_COLUMNS);
    fprintf(self->out, _("%s, %u cylinders%s\n"), config_kind_name(self->settings->geometry.kind), self->envelope.cylinders,
            self->settings->has_angle ? _(", rotation motor") : "");
    columns_put(self->out, _("configuration"), CONFIG_LABEL_COLUMNS);
    fprintf(self->out, "%s%s%s\n", self->config->hash,
            self->config->approved.text[0] == '\0' ? "" : ", [platform] approved = ", self->config->approved.text);
    columns_put(self->out, _("cycle"), CONFIG_LABEL_COLUMNS);
    fprintf(self->out, "%u us\n", (unsigned)self->settings->cycle_us);
    columns_put(self->out, _("memory of the gateway"), CONFIG_LABEL_COLUMNS);
    fprintf(self->out, _("%zu bytes\n"), ram_bytes);
    write_bus(self);
    config_scaling_report(self->config, self->out);
    columns_put(self->out, _("relays"), CONFIG_LABEL_COLUMNS);
    fprintf(self->out, "%u\n", self->settings->relays.count);
    write_settled(self);
}

/* "cylinder 3", or what else ends a reach. */
static const char *cause_text(unsigned cause, config_text_t *text)
{
    config_text_clear(text);
    if (cause < CYLINDERS_MAX) {
        config_text_add(text, _("cylinder %u"), cause + 1u);
    } else {
        config_text_add(text, "%s", cause == ENVELOPE_SINGULAR ? _("singularity") : _("range"));
    }
    return text->data;
}

static void write_axis(const report_t *self, unsigned axis)
{
    const envelope_t *envelope = &self->envelope;
    const double slope = envelope->limits.rate[axis].slope;
    config_text_t low, high;
    fprintf(self->out,
            _("  %-6s %9.3f to %9.3f %-3s  ends at %s and %s; %.3f mm of a cylinder per %s, %.1f mm/s at full speed\n"),
            config_axis_section[axis], zero_free(envelope->low[axis].value), zero_free(envelope->high[axis].value),
            config_axis_unit(axis), cause_text(envelope->low[axis].cause, &low), cause_text(envelope->high[axis].cause, &high),
            slope, config_axis_unit(axis), slope * number_q16(self->settings->axis[axis].speed_q16));
}

static void write_axes(const report_t *self)
{
    fprintf(self->out, _("reach of each axis alone from neutral, its limits aside\n"));
    for (unsigned axis = 0; axis < POSE_AXES; axis++) {
        if (self->envelope.has_axis[axis]) {
            write_axis(self, axis);
        }
    }
    if (self->settings->has_angle) {
        fprintf(self->out, _("  %-6s %9.3f to %9.3f deg  ends at limit and limit\n"), config_axis_section[AXIS_ANGLE],
                number_q16(self->settings->axis[AXIS_ANGLE].min_q16), number_q16(self->settings->axis[AXIS_ANGLE].max_q16));
    }
}

/* How much of what two axes reach alone they reach both at once, in the worst combination of senses. */
static double pair_share(const report_t *self, unsigned axis, unsigned other)
{
    double least = 1;
    for (unsigned i = 0; i < DIAGONALS; i++) {
        const unsigned direction = (2 * i + 1) * ENVELOPE_DIRECTIONS / (2 * DIAGONALS);
        least = fmin(least, envelope_pair(&self->envelope, axis, other, direction).share * sqrt(0.5));
    }
    return least;
}

static void write_pairs(const report_t *self)
{
    fprintf(self->out,
            _("reach of two axes at once: so much of the reach of each, in the worst combination of senses\n        "));
    for (unsigned axis = AXIS_PITCH; axis < POSE_AXES; axis++) {
        if (self->envelope.has_axis[axis]) {
            fprintf(self->out, "%8s", config_axis_section[axis]);
        }
    }
    fprintf(self->out, "\n");
    for (unsigned axis = 0; axis < POSE_AXES - 1; axis++) {
        if (!self->envelope.has_axis[axis]) {
            continue;
        }
        fprintf(self->out, "  %-6s", config_axis_section[axis]);
        for (unsigned other = AXIS_PITCH; other < POSE_AXES; other++) {
            if (self->envelope.has_axis[other] && other > axis) {
                fprintf(self->out, "%6.0f %%", 100 * pair_share(self, axis, other));
            } else if (self->envelope.has_axis[other]) {
                fprintf(self->out, "%8s", "");
            }
        }
        fprintf(self->out, "\n");
    }
}

static const char *pose_text(const report_t *self, const pose_t *pose, config_text_t *text)
{
    config_text_clear(text);
    for (unsigned axis = 0; axis < POSE_AXES; axis++) {
        if (self->envelope.has_axis[axis]) {
            config_text_add(text, "%s%s %.1f", text->length > 0 ? " " : "", config_axis_section[axis],
                            fabs(number(pose->axis_q32[axis])) < 0.05 ? 0.0 : number(pose->axis_q32[axis]));
        }
    }
    return text->data;
}

static void write_worst(const report_t *self)
{
    const envelope_box_t *box = &self->envelope.limits;
    config_text_t pose;
    columns_put(self->out, _("worst cylinder speed"), CONFIG_LABEL_COLUMNS);
    fprintf(self->out, _("%.1f mm/s with all axes at full speed at once (%u poses); limit %.1f mm/s\n"), box->all_mm_s,
            box->poses, number_q16(self->settings->cylinder_speed_mm_s_q16));
    columns_put(self->out, _("singularity margin"), CONFIG_LABEL_COLUMNS);
    fprintf(self->out, _("%.3f at neutral; %.3f at least within the limits, at %s; %.1f is too little\n"),
            self->envelope.margin_at_neutral, box->margin, pose_text(self, &box->margin_pose, &pose),
            number(KIN_MARGIN_LEAST_Q32));
}

static void write_suggestions(const report_t *self)
{
    fprintf(self->out, _("limits that each axis alone can have with these cylinders (%.5g mm/s, %.5g mm/s^2, %d mm/s^3)\n"),
            number_q16(self->settings->cylinder_speed_mm_s_q16), number_q16(self->settings->cylinder_accel_mm_s2_q16),
            (int)self->settings->cylinder_jerk_mm_s3);
    for (unsigned axis = 0; axis < POSE_AXES; axis++) {
        const envelope_limits_t *limits = &self->envelope.suggested[axis];
        const char *unit = config_axis_unit(axis);
        if (self->envelope.has_axis[axis]) {
            fprintf(self->out, "  %-6s min_%s %.6g  max_%s %.6g  speed_%s_s %.6g  accel_%s_s2 %.6g  jerk_%s_s3 %.0f\n",
                    config_axis_section[axis], unit, limits->min, unit, limits->max, unit, limits->speed, unit, limits->accel,
                    unit, limits->jerk);
        }
    }
}

/* An axis whose limits lie where the platform cannot or should not go. */
static void warn_reach(report_t *self, unsigned axis)
{
    const axis_settings_t *limits = &self->settings->axis[axis];
    const envelope_t *envelope = &self->envelope;
    const char *unit = config_axis_unit(axis);
    const bool is_low = number_q16(limits->min_q16) < envelope->low[axis].value - EDGE_TOLERANCE;
    const bool is_high = number_q16(limits->max_q16) > envelope->high[axis].value + EDGE_TOLERANCE;
    config_text_t text, cause;
    if (!is_low && !is_high) {
        return;
    }
    config_text_clear(&text);
    config_text_add(&text, _("[%s] limits %.3f to %.3f %s go beyond the reach:"), config_axis_section[axis],
                    number_q16(limits->min_q16), number_q16(limits->max_q16), unit);
    if (is_low) {
        config_text_add(&text, _(" %s ends it at %.3f, set min_%s = %.6g%s"), cause_text(envelope->low[axis].cause, &cause),
                        envelope->low[axis].value, unit, envelope->suggested[axis].min, is_high ? ";" : "");
    }
    if (is_high) {
        config_text_add(&text, _(" %s ends it at %.3f, set max_%s = %.6g"), cause_text(envelope->high[axis].cause, &cause),
                        envelope->high[axis].value, unit, envelope->suggested[axis].max);
    }
    warn(self, text.data);
}

static void warn_singularity(report_t *self)
{
    const envelope_box_t *box = &self->envelope.limits;
    config_text_t text, pose;
    if (box->margin >= number(KIN_MARGIN_LEAST_Q32)) {
        return;
    }
    config_text_clear(&text);
    config_text_add(&text,
                    _("poses within the limits are near a singularity: a margin of %.3f at %s, below %.1f: make the limits of "
                      "these axes narrower"),
                    box->margin, pose_text(self, &box->margin_pose, &pose), number(KIN_MARGIN_LEAST_Q32));
    warn(self, text.data);
}

/* A ramp that lowers its acceleration, because speed, jerk or travel never let it be reached. */
static void warn_acceleration(report_t *self, const char *section, const char *unit, const axis_settings_t *axis)
{
    ramp_limits_t limits;
    config_text_t text;
    if (ramp_limits_from_units(axis->min_q16, axis->max_q16, axis->speed_q16, axis->accel_q16, axis->jerk,
                               self->settings->cycle_us, &limits) != HV_OK ||
        ramp_safe_acceleration(&limits) >= limits.acc_per_cycle2_q32) {
        return;
    }
    config_text_clear(&text);
    config_text_add(
        &text, _("[%s] the acceleration in force is %.1f of %.1f %s/s^2: speed, jerk and travel do not let it get higher"),
        section, number_q16(axis->accel_q16) * (double)ramp_safe_acceleration(&limits) / (double)limits.acc_per_cycle2_q32,
        number_q16(axis->accel_q16), unit);
    warn(self, text.data);
}

static void warn_cylinders(report_t *self)
{
    const settings_t *settings = self->settings;
    for (unsigned i = 0; i < self->envelope.cylinders; i++) {
        const axis_settings_t cylinder = {.min_q16 = settings->margin_mm_q16,
                                          .max_q16 = settings->stroke_mm_q16[i] - settings->margin_mm_q16,
                                          .speed_q16 = settings->cylinder_speed_mm_s_q16,
                                          .accel_q16 = settings->cylinder_accel_mm_s2_q16,
                                          .jerk = settings->cylinder_jerk_mm_s3};
        if (i == 0 || settings->stroke_mm_q16[i] != settings->stroke_mm_q16[0]) {
            warn_acceleration(self, "cylinders", "mm", &cylinder);
        }
    }
}

/* The acceleration that the ramp of an axis comes to. */
static double accel_in_force(const report_t *self, const axis_settings_t *axis)
{
    ramp_limits_t limits;
    const double accel = number_q16(axis->accel_q16);
    if (ramp_limits_from_units(axis->min_q16, axis->max_q16, axis->speed_q16, axis->accel_q16, axis->jerk,
                               self->settings->cycle_us, &limits) != HV_OK) {
        return accel;
    }
    return accel * fmin((double)ramp_safe_acceleration(&limits) / (double)limits.acc_per_cycle2_q32, 1);
}

static void add_demand(config_text_t *text, const char *what, double asked, double limit, const char *unit, const char *key)
{
    if (asked > limit) {
        config_text_add(text, _("%s its %s alone asks a cylinder for %.1f %s, above %s of [cylinders], %.1f"),
                        text->length > 0 ? ";" : "", what, asked, unit, key, limit);
    }
}

static void add_lower(config_text_t *text, size_t head, const char *key, const char *unit, const char *per, double now,
                      double lower)
{
    if (lower < now) {
        config_text_add(text, "%s %s_%s_%s = %.6g", text->length == head ? "" : ",", key, unit, per, lower);
    }
}

/* An axis whose limits its cylinders cannot serve even while it moves alone. */
static void warn_demand(report_t *self, unsigned axis)
{
    const settings_t *settings = self->settings;
    const axis_settings_t *asked = &settings->axis[axis];
    const envelope_rate_t *rate = &self->envelope.limits.rate[axis];
    const envelope_limits_t now = {number_q16(asked->min_q16), number_q16(asked->max_q16), number_q16(asked->speed_q16),
                                   accel_in_force(self, asked), asked->jerk};
    const envelope_demand_t demand = envelope_demand(rate, &now);
    envelope_limits_t lower = now;
    config_text_t text, whole;
    config_text_clear(&text);
    config_text_clear(&whole);
    add_demand(&text, _("speed"), demand.speed_mm_s, number_q16(settings->cylinder_speed_mm_s_q16), "mm/s", "speed_mm_s");
    add_demand(&text, _("acceleration"), demand.accel_mm_s2, number_q16(settings->cylinder_accel_mm_s2_q16), "mm/s^2",
               "accel_mm_s2");
    add_demand(&text, _("jerk"), demand.jerk_mm_s3, settings->cylinder_jerk_mm_s3, "mm/s^3", "jerk_mm_s3");
    if (text.length == 0) {
        return;
    }
    envelope_suggest(settings, rate, &lower);
    config_text_add(&whole, _("[%s]%s: set"), config_axis_section[axis], text.data);
    const size_t head = whole.length;
    add_lower(&whole, head, "speed", config_axis_unit(axis), "s", now.speed, lower.speed);
    add_lower(&whole, head, "accel", config_axis_unit(axis), "s2", now.accel, lower.accel);
    add_lower(&whole, head, "jerk", config_axis_unit(axis), "s3", now.jerk, lower.jerk);
    warn(self, whole.data);
}

/* Frames carry no password: an open port lets any machine of the network move the platform. */
static void warn_network(report_t *self)
{
    const char *bind = self->config->udp.bind;
    const bool is_local = strncmp(bind, "127.", 4) == 0 || strcmp(bind, "::1") == 0;
    if (!is_local && self->config->udp.allow.count == 0) {
        warn(self, "[udp] bind and allow let every machine of the network move the platform");
    }
}

static void warn_bus(report_t *self)
{
    config_bus_t bus;
    config_text_t text;
    config_bus_describe(self->config, &bus);
    if (bus.section == NULL || config_bus_load_ppm(&bus) <= CONFIG_BUS_WARNED_PPM) {
        return;
    }
    const uint32_t fitting_us = config_bus_fitting_us(&bus, CONFIG_BUS_WARNED_PPM, self->settings->cycle_us);
    config_text_clear(&text);
    config_text_add(&text, _("[%s] period_us loads the bus by %.1f %% at worst: a repeated frame makes the next ones late; "),
                    bus.section, config_bus_load_ppm(&bus) / 10000.0);
    if (fitting_us == 0) {
        config_text_add(&text, _("a higher bitrate_bps helps"));
    } else {
        config_text_add(&text, _("%u us give %u %%"), (unsigned)fitting_us, CONFIG_BUS_WARNED_PPM / 10000u);
    }
    warn(self, text.data);
}

static bool has_mode_pp(const config_t *config)
{
    for (unsigned i = 0; i < config->cia402.mode.count; i++) {
        if (config->cia402.mode.word[i] == CONFIG_MODE_PP) {
            return true;
        }
    }
    return false;
}

/* In profile position drives may do no more than follow poses that are rare and near. */
static void warn_profile_lag(report_t *self)
{
    const config_t *config = self->config;
    config_text_t text;
    if (config->drives != CONFIG_DRIVES_CIA402 || !has_mode_pp(config)) {
        return;
    }
    const q32_t lag_q32 = config_cia402_pp_lag_q32(config, config->settings.cylinder_speed_mm_s_q16);
    if (lag_q32 > q32_from_q16(config->cia402.following_error_mm_q16)) {
        config_text_clear(&text);
        config_text_add(
            &text,
            _("[cia402] mode = pp: at [cylinders] speed_mm_s a drive is %.1f mm behind, and following_error_mm stops it before; "
              "slower, or csp"),
            (double)lag_q32 / (double)Q32_ONE);
        warn(self, text.data);
    }
}

static void warn_layout(report_t *self)
{
    config_text_t text;
    for (unsigned at = 0; config_layout_next_oddity(self->config, &at, &text);) {
        warn(self, text.data);
    }
}

static void write_warnings(report_t *self)
{
    warn_layout(self);
    for (unsigned axis = 0; axis < AXES_MAX; axis++) {
        if (!config_has_axis(self->config, axis)) {
            continue;
        }
        if (axis < POSE_AXES) {
            warn_reach(self, axis);
        }
        warn_acceleration(self, config_axis_section[axis], config_axis_unit(axis), &self->settings->axis[axis]);
        if (axis < POSE_AXES) {
            warn_demand(self, axis);
        }
    }
    warn_singularity(self);
    warn_cylinders(self);
    warn_network(self);
    warn_bus(self);
    if (config_is_unapproved(self->config)) {
        warn(self, "[platform] approved: another configuration was approved; nothing moves until `heavectl acknowledge`");
    }
    warn_profile_lag(self);
}

int report_write(const config_t *config, size_t ram_bytes, FILE *out)
{
    const pose_t zero = {{0}};
    report_t self;
    memset(&self, 0, sizeof self);
    self.config = config;
    self.settings = &config->settings;
    self.out = out;
    if (!envelope_find(&self.envelope, self.settings)) {
        return 1; /* not a configuration that config_load() accepted */
    }
    write_head(&self, ram_bytes);
    write_extensions(&self, _("extension at pose zero"), &zero);
    write_extensions(&self, _("extension at neutral"), &self.envelope.neutral);
    write_axes(&self);
    write_pairs(&self);
    write_worst(&self);
    write_suggestions(&self);
    write_warnings(&self);
    return self.warnings;
}
