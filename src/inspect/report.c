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
#include "config/keys.h"
#include "inspect/report_parts.h"
#include "platform/bus.h"
#include "platform/modbus_section.h"
#include "platform/scaling.h"

#define AT_DEG    5.0 /* a cylinder stands at a side, not beside it */
#define SIDES     4u
#define DEGREES   57.29577951308232
#define DIAGONALS 4u /* of a pair: both axes as far as each other, in every combination of senses */

static void write_extensions(const report_t *self, const char *name, const pose_t *pose)
{
    q32_t extension_q32[CYLINDERS_MAX] = {0};
    columns_put(self->out, name, CONFIG_LABEL_COLUMNS - 2u);
    if (kin_inverse(&self->envelope.kin, pose, extension_q32) != HV_OK) {
        return;
    }
    for (unsigned i = 0; i < self->envelope.cylinders; i++) {
        fprintf(self->out, "  c%u %.3f", i + 1u, report_number(extension_q32[i]));
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
    fprintf(self->out, _("%.3f mm of all cylinders"), report_number_q16(self->settings->settled_extension_mm_q16));
    if (kin_forward(&self->envelope.kin, extension_q32, &guess, &pose, NULL) == HV_OK) {
        fprintf(self->out, ":");
        for (unsigned axis = 0; axis < POSE_AXES; axis++) {
            fprintf(self->out, " %s %.3f", config_axis_section[axis], report_number(pose.axis_q32[axis]));
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

/* Which cylinders somebody sees who stands at a side, which is at this angle from +X towards +Y. */
static void add_side(const report_t *self, config_text_t *text, const char *name, double side_deg)
{
    const kin_geometry_t *geometry = &self->settings->geometry;
    double before_deg = -INFINITY;
    double after_deg = INFINITY;
    unsigned before = 0;
    unsigned after = 0;
    for (unsigned i = 0; i < self->envelope.cylinders; i++) {
        const double x = report_number_q16(geometry->base_mm_q16[i][0]) + report_number_q16(geometry->plate_mm_q16[i][0]);
        const double y = report_number_q16(geometry->base_mm_q16[i][1]) + report_number_q16(geometry->plate_mm_q16[i][1]);
        const double away_deg = remainder(atan2(y, x) * DEGREES - side_deg, 360);
        const double behind_deg = away_deg > 0 ? away_deg - 360 : away_deg;
        if (behind_deg > before_deg) {
            before_deg = behind_deg;
            before = i + 1u;
        }
        if (behind_deg + 360 < after_deg) {
            after_deg = behind_deg + 360;
            after = i + 1u;
        }
    }
    config_text_add(text, text->length > 0 ? ", " : "");
    if (fmin(-before_deg, after_deg) < AT_DEG) {
        config_text_add(text, _("%s at cylinder %u"), name, -before_deg < after_deg ? before : after);
    } else {
        config_text_add(text, _("%s between %u and %u"), name, before < after ? before : after, before < after ? after : before);
    }
}

static void write_sides(const report_t *self)
{
    const char *const name[SIDES] = {_("front"), _("right"), _("rear"), _("left")};
    config_text_t text;
    config_text_clear(&text);
    for (unsigned i = 0; i < SIDES; i++) {
        add_side(self, &text, name[i], 90.0 * i);
    }
    columns_put(self->out, _("cylinders seen from"), CONFIG_LABEL_COLUMNS);
    fprintf(self->out, "%s\n", text.data);
}

static void write_head(const report_t *self, size_t ram_bytes)
{
    columns_put(self->out, _("platform"), CONFIG_LABEL_COLUMNS);
    fprintf(self->out, _("%s, %u cylinders%s\n"), config_kind_name(self->settings->geometry.kind), self->envelope.cylinders,
            self->settings->has_angle ? _(", rotation motor") : "");
    write_sides(self);
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

static void write_axis(const report_t *self, unsigned axis)
{
    const envelope_t *envelope = &self->envelope;
    const double slope = envelope->limits.rate[axis].slope;
    config_text_t low, high;
    fprintf(self->out,
            _("  %-6s %9.3f to %9.3f %-3s  ends at %s and %s; %.3f mm of a cylinder per %s, %.1f mm/s at full speed\n"),
            config_axis_section[axis], report_zero_free(envelope->low[axis].value), report_zero_free(envelope->high[axis].value),
            config_axis_unit(axis), report_cause_text(envelope->low[axis].cause, &low),
            report_cause_text(envelope->high[axis].cause, &high), slope, config_axis_unit(axis),
            slope * report_number_q16(self->settings->axis[axis].speed_q16));
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
                report_number_q16(self->settings->axis[AXIS_ANGLE].min_q16),
                report_number_q16(self->settings->axis[AXIS_ANGLE].max_q16));
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

static void write_worst(const report_t *self)
{
    const envelope_box_t *box = &self->envelope.limits;
    config_text_t pose;
    columns_put(self->out, _("worst cylinder speed"), CONFIG_LABEL_COLUMNS);
    fprintf(self->out, _("%.1f mm/s with all axes at full speed at once (%u poses); limit %.1f mm/s\n"), box->all_mm_s,
            box->poses, report_number_q16(self->settings->cylinder_speed_mm_s_q16));
    columns_put(self->out, _("singularity margin"), CONFIG_LABEL_COLUMNS);
    fprintf(self->out, _("%.3f at neutral; %.3f at least within the limits, at %s; %.1f is too little\n"),
            self->envelope.margin_at_neutral, box->margin, report_pose_text(self, &box->margin_pose, &pose),
            report_number(KIN_MARGIN_LEAST_Q32));
}

static void write_suggestions(const report_t *self)
{
    fprintf(self->out, _("limits that each axis alone can have with these cylinders (%.5g mm/s, %.5g mm/s^2, %d mm/s^3)\n"),
            report_number_q16(self->settings->cylinder_speed_mm_s_q16),
            report_number_q16(self->settings->cylinder_accel_mm_s2_q16), (int)self->settings->cylinder_jerk_mm_s3);
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
    report_write_warnings(&self);
    return self.warnings;
}
