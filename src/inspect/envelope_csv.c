/* SPDX-License-Identifier: MIT
 * envelope_csv.c - an envelope as CSV; see envelope_csv.h.
 */
#include "inspect/envelope_csv.h"

#include <math.h>

#include "config/keys.h"
#include "config/config_text.h"

/* What a row says. */
typedef struct {
    const char *quantity;
    unsigned axis, other; /* POSE_AXES: none */
    int direction_deg;    /* below 0: none */
    double value;
    const char *unit;   /* "u" and what follows it: of the axis */
    unsigned cause;     /* a cylinder, or what else ends a reach; ENVELOPE_OPEN: none */
    const pose_t *pose; /* NULL: none */
} row_t;

static const char *axis_name(unsigned axis)
{
    return axis < POSE_AXES ? config_axis_section[axis] : "";
}

/* The unit of a row: "mm/u" of a rotation is mm/deg. */
static void add_unit(config_text_t *text, const row_t *row)
{
    for (const char *c = row->unit; *c != '\0'; c++) {
        if (*c == 'u') {
            config_text_add(text, "%s", config_axis_unit(row->axis));
        } else {
            config_text_add(text, "%c", *c);
        }
    }
}

static void add_cause(config_text_t *text, unsigned cause)
{
    if (cause < CYLINDERS_MAX) {
        config_text_add(text, "cylinder %u", cause + 1u);
    } else if (cause == ENVELOPE_SINGULAR) {
        config_text_add(text, "singularity");
    } else if (cause == ENVELOPE_RANGE) {
        config_text_add(text, "range");
    }
}

/* What rounds to 0 is 0: no "-0.000000". */
static double plain(double value)
{
    return fabs(value) < 0.5e-6 ? 0.0 : value;
}

static void write_row(const envelope_t *self, FILE *out, row_t row)
{
    config_text_t text;
    config_text_clear(&text);
    config_text_add(&text, "%s,%s,%s,", row.quantity, axis_name(row.axis), axis_name(row.other));
    if (row.direction_deg >= 0) {
        config_text_add(&text, "%d", row.direction_deg);
    }
    config_text_add(&text, ",%.6f,", plain(row.value));
    add_unit(&text, &row);
    config_text_add(&text, ",");
    add_cause(&text, row.cause);
    pose_t pose = {{0}};
    if (row.pose != NULL) {
        pose = *row.pose;
        kin_constrain(&self->kin, &pose);
    }
    for (unsigned axis = 0; axis < POSE_AXES; axis++) {
        config_text_add(&text, ",");
        if (row.pose != NULL) {
            config_text_add(&text, "%.6f", plain((double)pose.axis_q32[axis] / (double)Q32_ONE));
        }
    }
    fprintf(out, "%s\n", text.data);
}

/* A figure of a single axis, without a place. */
static void write_figure(const envelope_t *self, FILE *out, const char *quantity, unsigned axis, double value, const char *unit)
{
    write_row(self, out, (row_t){quantity, axis, POSE_AXES, -1, value, unit, ENVELOPE_OPEN, NULL});
}

static void write_end(const envelope_t *self, FILE *out, const char *quantity, unsigned axis, envelope_end_t end)
{
    pose_t pose = self->neutral;
    pose.axis_q32[axis] = (q32_t)llround(end.value * (double)Q32_ONE);
    write_row(self, out, (row_t){quantity, axis, POSE_AXES, -1, end.value, "u", end.cause, &pose});
}

static void write_rate(const envelope_t *self, FILE *out, const char *quantity, unsigned axis, const envelope_rate_t *rate)
{
    write_row(self, out, (row_t){quantity, axis, POSE_AXES, -1, rate->slope, "mm/u", rate->cylinder, &rate->pose});
}

static void write_axis(const envelope_t *self, FILE *out, unsigned axis)
{
    const envelope_limits_t *suggested = &self->suggested[axis];
    write_end(self, out, "reach_min", axis, self->low[axis]);
    write_end(self, out, "reach_max", axis, self->high[axis]);
    write_rate(self, out, "cylinder_per_axis_neutral", axis, &self->at_neutral[axis]);
    write_rate(self, out, "cylinder_per_axis_worst_limits", axis, &self->limits.rate[axis]);
    write_rate(self, out, "cylinder_per_axis_worst_reach", axis, &self->reach.rate[axis]);
    write_figure(self, out, "suggested_min", axis, suggested->min, "u");
    write_figure(self, out, "suggested_max", axis, suggested->max, "u");
    write_figure(self, out, "suggested_speed", axis, suggested->speed, "u/s");
    write_figure(self, out, "suggested_accel", axis, suggested->accel, "u/s^2");
    write_figure(self, out, "suggested_jerk", axis, suggested->jerk, "u/s^3");
}

static void write_pair(const envelope_t *self, FILE *out, unsigned axis, unsigned other)
{
    for (unsigned direction = 0; direction < ENVELOPE_DIRECTIONS; direction++) {
        const envelope_pair_t pair = envelope_pair(self, axis, other, direction);
        const int direction_deg = (int)(direction * (360u / ENVELOPE_DIRECTIONS));
        write_row(self, out, (row_t){"reach_pair", axis, other, direction_deg, pair.share, "", pair.cause, &pair.pose});
    }
}

static void write_whole(const envelope_t *self, FILE *out, const char *quantity, double value, const char *unit,
                        const pose_t *pose)
{
    write_row(self, out, (row_t){quantity, POSE_AXES, POSE_AXES, -1, value, unit, ENVELOPE_OPEN, pose});
}

void envelope_csv_write(const envelope_t *envelope, FILE *out)
{
    fprintf(out, "quantity,axis,other_axis,direction_deg,value,unit,cause,roll_deg,pitch_deg,yaw_deg,x_mm,y_mm,z_mm\n");
    write_whole(envelope, out, "singularity_margin_neutral", envelope->margin_at_neutral, "", &envelope->neutral);
    write_whole(envelope, out, "singularity_margin_least_limits", envelope->limits.margin, "", &envelope->limits.margin_pose);
    write_whole(envelope, out, "singularity_margin_least_reach", envelope->reach.margin, "", &envelope->reach.margin_pose);
    write_whole(envelope, out, "cylinder_speed_all_axes_limits", envelope->limits.all_mm_s, "mm/s", &envelope->limits.all_pose);
    for (unsigned axis = 0; axis < POSE_AXES; axis++) {
        if (envelope->has_axis[axis]) {
            write_axis(envelope, out, axis);
        }
    }
    for (unsigned axis = 0; axis < POSE_AXES; axis++) {
        for (unsigned other = axis + 1; other < POSE_AXES; other++) {
            if (envelope->has_axis[axis] && envelope->has_axis[other]) {
                write_pair(envelope, out, axis, other);
            }
        }
    }
}
