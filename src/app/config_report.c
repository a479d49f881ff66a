/* SPDX-License-Identifier: MIT
 * config_report.c - what follows from a configuration: where the platform can go, and how fast its cylinders would have to be.
 * Reach is found by walking each axis from neutral until a cylinder leaves its stroke; cylinder speeds from differences of the
 * inverse solution over a grid of poses within that reach. Figures for people: the limits themselves are kept elsewhere.
 */
#include <string.h>

#include "config_bus.h"
#include "config_keys.h"
#include "config_mechanism.h"
#include "config_text.h"
#include "heave/ramp.h"

#define WALK_STEPS    256 /* from neutral to a limit; finer than any fold of the workspace */
#define BISECT_STEPS  24
#define GRID_POINTS   5u             /* per axis: low, half, neutral, half, high */
#define SLOPE_STEP    (Q32_ONE / 64) /* of a pose axis, to each side */
#define SLOPE_INVERSE 32             /* 1 / (2 * step) */

/* How far an axis goes alone, and what ends it: a cylinder, or at_limit where it is the axis' own limit. */
typedef struct {
    q32_t low_q32, high_q32;
    unsigned low_end, high_end;
} reach_t;

/* A report in the making. */
typedef struct {
    const config_t *config;
    const settings_t *settings;
    FILE *out;
    kin_t kin;
    unsigned cylinders;
    pose_t neutral;
    reach_t reach[POSE_AXES];
    q32_t alone_mm_s_q32[POSE_AXES]; /* worst speed of a cylinder while one axis moves */
    q32_t all_mm_s_q32;              /* while all do */
    unsigned poses;                  /* of the grid, within the stroke */
    int warnings;
} report_t;

/* What rounds to 0.000 is 0: no "-0.000". */
static double number(q32_t value_q32)
{
    return fx_abs(value_q32) < Q32_ONE / 2048 ? 0.0 : (double)value_q32 / (double)Q32_ONE;
}

static double number_q16(q16_t value_q16)
{
    return (double)value_q16 / (double)Q16_ONE;
}

static void warn(report_t *self, const char *text)
{
    fprintf(self->out, "warning: %s\n", text);
    self->warnings++;
}

/* First cylinder that a pose takes out of its usable stroke; the number of cylinders where it takes none. */
static unsigned find_outside(const report_t *self, const pose_t *pose)
{
    q32_t extension_q32;
    return config_mechanism_find_outside(self->settings, &self->kin, pose, self->settings->margin_mm_q16, &extension_q32);
}

/* Halves the gap between a pose inside and one outside. */
static q32_t find_edge(const report_t *self, unsigned axis, q32_t inside_q32, q32_t outside_q32, unsigned *cylinder)
{
    pose_t pose = self->neutral;
    for (unsigned i = 0; i < BISECT_STEPS; i++) {
        pose.axis_q32[axis] = inside_q32 / 2 + outside_q32 / 2;
        const unsigned found = find_outside(self, &pose);
        if (found < self->cylinders) {
            outside_q32 = pose.axis_q32[axis];
            *cylinder = found;
        } else {
            inside_q32 = pose.axis_q32[axis];
        }
    }
    return inside_q32;
}

/* Walks one axis from neutral towards its limit. */
static q32_t walk(const report_t *self, unsigned axis, q16_t limit_q16, unsigned *end)
{
    const q32_t start_q32 = self->neutral.axis_q32[axis];
    const q32_t step_q32 = (q32_from_q16(limit_q16) - start_q32) / WALK_STEPS;
    pose_t pose = self->neutral;
    for (int i = 1; i <= WALK_STEPS; i++) {
        pose.axis_q32[axis] = i == WALK_STEPS ? q32_from_q16(limit_q16) : start_q32 + i * step_q32;
        *end = find_outside(self, &pose);
        if (*end < self->cylinders) {
            return find_edge(self, axis, start_q32 + (i - 1) * step_q32, pose.axis_q32[axis], end);
        }
    }
    return q32_from_q16(limit_q16);
}

static void find_reach(report_t *self)
{
    for (unsigned axis = 0; axis < POSE_AXES; axis++) {
        const axis_settings_t *limits = &self->settings->axis[axis];
        reach_t *reach = &self->reach[axis];
        if (!config_has_axis(self->config, axis)) {
            continue;
        }
        reach->low_q32 = walk(self, axis, limits->min_q16, &reach->low_end);
        reach->high_q32 = walk(self, axis, limits->max_q16, &reach->high_end);
    }
}

/* mm of each cylinder per unit of an axis, at a pose, as magnitudes. */
static bool find_slopes(const report_t *self, const pose_t *pose, unsigned axis, q32_t slope_q32[CYLINDERS_MAX])
{
    q32_t above_q32[CYLINDERS_MAX], below_q32[CYLINDERS_MAX];
    pose_t moved = *pose;
    moved.axis_q32[axis] = pose->axis_q32[axis] + SLOPE_STEP;
    if (kin_inverse(&self->kin, &moved, above_q32) != HV_OK) {
        return false;
    }
    moved.axis_q32[axis] = pose->axis_q32[axis] - SLOPE_STEP;
    if (kin_inverse(&self->kin, &moved, below_q32) != HV_OK) {
        return false;
    }
    for (unsigned i = 0; i < self->cylinders; i++) {
        slope_q32[i] = fx_abs(above_q32[i] - below_q32[i]) * SLOPE_INVERSE;
    }
    return true;
}

/* Takes a pose into the worst cases. */
static void take_speeds(report_t *self, const pose_t *pose)
{
    q32_t sum_q32[CYLINDERS_MAX] = {0};
    for (unsigned axis = 0; axis < POSE_AXES; axis++) {
        q32_t slope_q32[CYLINDERS_MAX];
        if (!config_has_axis(self->config, axis) || !find_slopes(self, pose, axis, slope_q32)) {
            continue;
        }
        for (unsigned i = 0; i < self->cylinders; i++) {
            const q32_t speed_q32 = fx_mul_shift(slope_q32[i], self->settings->axis[axis].speed_q16, 16);
            sum_q32[i] += speed_q32;
            self->alone_mm_s_q32[axis] = speed_q32 > self->alone_mm_s_q32[axis] ? speed_q32 : self->alone_mm_s_q32[axis];
            self->all_mm_s_q32 = sum_q32[i] > self->all_mm_s_q32 ? sum_q32[i] : self->all_mm_s_q32;
        }
    }
}

/* The value of an axis at a point of the grid. */
static q32_t grid_value(const report_t *self, unsigned axis, unsigned point)
{
    const q32_t neutral_q32 = self->neutral.axis_q32[axis];
    const reach_t *reach = &self->reach[axis];
    const q32_t values_q32[GRID_POINTS] = {reach->low_q32, (reach->low_q32 + neutral_q32) / 2, neutral_q32,
                                           (reach->high_q32 + neutral_q32) / 2, reach->high_q32};
    return values_q32[point];
}

static void find_speeds(report_t *self)
{
    unsigned count = 1;
    for (unsigned axis = 0; axis < POSE_AXES; axis++) {
        count *= config_has_axis(self->config, axis) ? GRID_POINTS : 1u;
    }
    for (unsigned index = 0; index < count; index++) {
        pose_t pose = self->neutral;
        unsigned rest = index;
        for (unsigned axis = 0; axis < POSE_AXES; axis++) {
            if (!config_has_axis(self->config, axis)) {
                continue;
            }
            pose.axis_q32[axis] = grid_value(self, axis, rest % GRID_POINTS);
            rest /= GRID_POINTS;
        }
        if (find_outside(self, &pose) < self->cylinders) {
            continue;
        }
        take_speeds(self, &pose);
        self->poses++;
    }
}

static void write_extensions(const report_t *self, const char *name, const pose_t *pose)
{
    q32_t extension_q32[CYLINDERS_MAX] = {0};
    fprintf(self->out, "%-24s", name);
    if (kin_inverse(&self->kin, pose, extension_q32) != HV_OK) {
        return;
    }
    for (unsigned i = 0; i < self->cylinders; i++) {
        fprintf(self->out, "  c%u %.3f", i + 1u, number(extension_q32[i]));
    }
    fprintf(self->out, " mm\n");
}

static void write_settled(const report_t *self)
{
    const pose_t guess = {{0}};
    pose_t pose;
    q32_t extension_q32[CYLINDERS_MAX] = {0};
    for (unsigned i = 0; i < self->cylinders; i++) {
        extension_q32[i] = q32_from_q16(self->settings->settled_extension_mm_q16);
    }
    fprintf(self->out, "%-24s  %.3f mm of all cylinders", "settled", number_q16(self->settings->settled_extension_mm_q16));
    if (kin_forward(&self->kin, extension_q32, &guess, &pose, NULL) == HV_OK) {
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
    if (bus.section == NULL) {
        fprintf(self->out, "%-24s  0 %% (simulated drives)\n", "bus load");
        return;
    }
    fprintf(self->out, "%-24s  %.1f %% at worst (%u us period, %u bit/s)\n", "bus load", config_bus_load_ppm(&bus) / 10000.0,
            (unsigned)bus.period_us, (unsigned)bus.bitrate_bps);
}

static void write_head(const report_t *self, size_t ram_bytes)
{
    fprintf(self->out, "%-24s  %s, %u cylinders%s\n", "platform", config_kind_name(self->settings->geometry.kind),
            self->cylinders, self->settings->has_angle ? ", rotation motor" : "");
    fprintf(self->out, "%-24s  %u us\n", "cycle", (unsigned)self->settings->cycle_us);
    fprintf(self->out, "%-24s  %zu bytes\n", "memory of the gateway", ram_bytes);
    write_bus(self);
    fprintf(self->out, "%-24s  %u\n", "relays", self->settings->relay_count);
    write_settled(self);
}

/* "cylinder 3", or "the axis limit". */
static const char *end_text(const report_t *self, unsigned end, config_text_t *text)
{
    config_text_clear(text);
    if (end < self->cylinders) {
        config_text_add(text, "cylinder %u", end + 1u);
    } else {
        config_text_add(text, "limit");
    }
    return text->data;
}

static void write_axis(const report_t *self, unsigned axis)
{
    const reach_t *reach = &self->reach[axis];
    config_text_t low, high;
    fprintf(self->out, "  %-6s %9.3f to %9.3f %-3s  ends at %s and %s; up to %.1f mm/s of a cylinder at full speed\n",
            config_axis_section[axis], number(reach->low_q32), number(reach->high_q32), config_axis_unit(axis),
            end_text(self, reach->low_end, &low), end_text(self, reach->high_end, &high), number(self->alone_mm_s_q32[axis]));
}

static void write_axes(const report_t *self)
{
    fprintf(self->out, "reach of each axis alone, the others at neutral\n");
    for (unsigned axis = 0; axis < POSE_AXES; axis++) {
        if (config_has_axis(self->config, axis)) {
            write_axis(self, axis);
        }
    }
    if (self->settings->has_angle) {
        fprintf(self->out, "  %-6s %9.3f to %9.3f deg  ends at limit and limit\n", config_axis_section[AXIS_ANGLE],
                number_q16(self->settings->axis[AXIS_ANGLE].min_q16), number_q16(self->settings->axis[AXIS_ANGLE].max_q16));
    }
    fprintf(self->out, "%-24s  %.1f mm/s with all axes at full speed at once (%u poses); limit %.1f mm/s\n",
            "worst cylinder speed", number(self->all_mm_s_q32), self->poses, number_q16(self->settings->cylinder_speed_mm_s_q16));
}

/* An axis whose limits lie where the cylinders cannot follow. */
static void warn_reach(report_t *self, unsigned axis)
{
    const reach_t *reach = &self->reach[axis];
    config_text_t text;
    if (reach->low_end >= self->cylinders && reach->high_end >= self->cylinders) {
        return;
    }
    config_text_clear(&text);
    config_text_add(&text, "[%s] limits %.3f to %.3f %s go beyond the reach: poses there are clamped", config_axis_section[axis],
                    number_q16(self->settings->axis[axis].min_q16), number_q16(self->settings->axis[axis].max_q16),
                    config_axis_unit(axis));
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
        &text, "[%s] the acceleration in force is %.1f of %.1f %s/s^2: speed, jerk and travel do not let it get higher", section,
        number_q16(axis->accel_q16) * (double)ramp_safe_acceleration(&limits) / (double)limits.acc_per_cycle2_q32,
        number_q16(axis->accel_q16), unit);
    warn(self, text.data);
}

static void warn_cylinders(report_t *self)
{
    const settings_t *settings = self->settings;
    for (unsigned i = 0; i < self->cylinders; i++) {
        const axis_settings_t cylinder = {.min_q16 = settings->margin_mm_q16,
                                          .max_q16 = settings->stroke_mm_q16[i] - settings->margin_mm_q16,
                                          .speed_q16 = settings->cylinder_speed_mm_s_q16,
                                          .accel_q16 = settings->cylinder_accel_mm_s2_q16,
                                          .jerk = settings->cylinder_jerk_mm_s3};
        if (i == 0 || settings->stroke_mm_q16[i] != settings->stroke_mm_q16[0]) {
            warn_acceleration(self, "cylinders", "mm", &cylinder);
        }
    }
    for (unsigned axis = 0; axis < POSE_AXES; axis++) {
        config_text_t text;
        if (!config_has_axis(self->config, axis) ||
            self->alone_mm_s_q32[axis] <= q32_from_q16(settings->cylinder_speed_mm_s_q16)) {
            continue;
        }
        config_text_clear(&text);
        config_text_add(&text, "[%s] its speed alone asks a cylinder for %.1f mm/s, above speed_mm_s of [cylinders]",
                        config_axis_section[axis], number(self->alone_mm_s_q32[axis]));
        warn(self, text.data);
    }
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
    config_text_clear(&text);
    config_text_add(
        &text, "[%s] period_us loads the bus by %.1f %% at worst: a repeated frame makes the next ones late; %u us give %u %%",
        bus.section, config_bus_load_ppm(&bus) / 10000.0,
        (unsigned)config_bus_fitting_us(&bus, CONFIG_BUS_WARNED_PPM, self->settings->cycle_us), CONFIG_BUS_WARNED_PPM / 10000u);
    warn(self, text.data);
}

static void write_warnings(report_t *self)
{
    for (unsigned axis = 0; axis < AXES_MAX; axis++) {
        if (!config_has_axis(self->config, axis)) {
            continue;
        }
        if (axis < POSE_AXES) {
            warn_reach(self, axis);
        }
        warn_acceleration(self, config_axis_section[axis], config_axis_unit(axis), &self->settings->axis[axis]);
    }
    warn_cylinders(self);
    warn_network(self);
    warn_bus(self);
}

int config_check_report(const config_t *config, size_t ram_bytes, FILE *out)
{
    const pose_t zero = {{0}};
    report_t self;
    memset(&self, 0, sizeof self);
    self.config = config;
    self.settings = &config->settings;
    self.out = out;
    if (kin_init(&self.kin, &config->settings.geometry) != HV_OK) {
        return 1; /* not a configuration that config_load() accepted */
    }
    self.cylinders = kin_cylinders(&self.kin);
    for (unsigned axis = 0; axis < POSE_AXES; axis++) {
        self.neutral.axis_q32[axis] = q32_from_q16(config->settings.neutral_q16[axis]);
    }
    find_reach(&self);
    find_speeds(&self);
    write_head(&self, ram_bytes);
    write_extensions(&self, "extension at pose zero", &zero);
    write_extensions(&self, "extension at neutral", &self.neutral);
    write_axes(&self);
    write_warnings(&self);
    return self.warnings;
}
