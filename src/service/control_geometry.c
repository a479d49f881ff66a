/* SPDX-License-Identifier: MIT
 * control_geometry.c - see control_geometry.h.
 */
#include "service/control_geometry.h"

#include "service/control_client.h"

#define POINT 3u

/* A list of numbers of the configuration. */
static void put_list(json_t *json, const char *name, const q16_t *value_q16, unsigned count)
{
    json_open(json, name, '[');
    for (unsigned i = 0; i < count; i++) {
        json_q32(json, NULL, q32_from_q16(value_q16[i]));
    }
    json_close(json, ']');
}

static void put_points(json_t *json, const char *name, const q16_t point_q16[][POINT], unsigned count)
{
    json_open(json, name, '[');
    for (unsigned i = 0; i < count; i++) {
        put_list(json, NULL, point_q16[i], POINT);
    }
    json_close(json, ']');
}

static void put_limits(json_t *json, const settings_t *settings)
{
    static const char *const k_names[POSE_AXES] = {"roll_deg", "pitch_deg", "yaw_deg", "x_mm", "y_mm", "z_mm"};
    json_open(json, "limits", '{');
    for (unsigned i = 0; i < POSE_AXES; i++) {
        const q16_t range_q16[2] = {settings->axis[i].min_q16, settings->axis[i].max_q16};
        put_list(json, k_names[i], range_q16, 2);
    }
    json_close(json, '}');
}

void control_geometry_put(json_t *json, const settings_t *settings)
{
    const kin_geometry_t *geometry = &settings->geometry;
    const unsigned cylinders = geometry->kind == KIN_HEXAPOD ? 6 : 3;
    json_text(json, "kind", geometry->kind == KIN_HEXAPOD ? "hexapod" : "tripod");
    put_points(json, "base_mm", geometry->base_mm_q16, cylinders);
    put_points(json, "plate_mm", geometry->plate_mm_q16, cylinders);
    put_list(json, "retracted_length_mm", geometry->retracted_mm_q16, cylinders);
    put_list(json, "stroke_mm", settings->stroke_mm_q16, cylinders);
    json_q32(json, "margin_mm", q32_from_q16(settings->margin_mm_q16));
    json_q32(json, "zero_height_mm", q32_from_q16(geometry->zero_height_mm_q16));
    put_list(json, "mrp_mm", geometry->mrp_mm_q16, POINT);
    put_list(json, "neutral", settings->neutral_q16, POSE_AXES);
    put_limits(json, settings);
    json_bool(json, "rotation", settings->has_angle);
    json_open(json, "cylinder_limits", '{');
    json_q32(json, "speed_mm_s", q32_from_q16(settings->cylinder_speed_mm_s_q16));
    json_q32(json, "accel_mm_s2", q32_from_q16(settings->cylinder_accel_mm_s2_q16));
    json_number(json, "jerk_mm_s3", (uint64_t)settings->cylinder_jerk_mm_s3);
    json_q32(json, "following_error_mm", q32_from_q16(settings->following_error_mm_q16));
    json_close(json, '}');
    json_q32(json, "jog_mm_s", q32_from_q16(settings->jog_mm_s_q16));
}

void control_geometry_answer(const control_t *self, control_client_t *client)
{
    json_t json = control_client_start_answer(client);
    json_open(&json, NULL, '{');
    json_bool(&json, "ok", true);
    control_geometry_put(&json, &self->config->settings);
    json_close(&json, '}');
    control_client_answer(client, &json);
}
