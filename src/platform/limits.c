/* SPDX-License-Identifier: MIT
 * limits.c - limits that the file leaves out; see limits.h.
 */
#include "platform/limits.h"

#include <math.h>

#include "platform/envelope.h"

static q16_t to_q16(double value)
{
    return (q16_t)lround(value * (double)Q16_ONE);
}

bool config_limits_is_open(const axis_settings_t *axis)
{
    return axis->min_q16 == CONFIG_NONE || axis->max_q16 == CONFIG_NONE || axis->speed_q16 == CONFIG_NONE ||
           axis->accel_q16 == CONFIG_NONE || axis->jerk == CONFIG_NONE;
}

void config_limits_clear_absent(config_t *config)
{
    for (unsigned i = 0; i < POSE_AXES; i++) {
        axis_settings_t *axis = &config->settings.axis[i];
        if (!config_has_axis(config, i)) {
            *axis = (axis_settings_t){.sign = axis->sign, .scale_q16 = axis->scale_q16, .offset_q16 = axis->offset_q16};
        }
    }
}

static void fill_axis(axis_settings_t *axis, const envelope_limits_t *suggested, const axis_settings_t *given)
{
    axis->min_q16 = given->min_q16 == CONFIG_NONE ? to_q16(suggested->min) : given->min_q16;
    axis->max_q16 = given->max_q16 == CONFIG_NONE ? to_q16(suggested->max) : given->max_q16;
    axis->speed_q16 = given->speed_q16 == CONFIG_NONE ? to_q16(suggested->speed) : given->speed_q16;
    axis->accel_q16 = given->accel_q16 == CONFIG_NONE ? to_q16(suggested->accel) : given->accel_q16;
    axis->jerk = given->jerk == CONFIG_NONE ? (int32_t)suggested->jerk : given->jerk;
}

bool config_limits_fill(config_t *config)
{
    static envelope_t envelope;
    settings_t open = config->settings;
    bool is_any = false;
    for (unsigned i = 0; i < POSE_AXES; i++) {
        axis_settings_t *axis = &open.axis[i];
        is_any = is_any || config_limits_is_open(axis);
        axis->min_q16 = axis->min_q16 == CONFIG_NONE ? -INT32_MAX : axis->min_q16; /* as far as it reaches */
        axis->max_q16 = axis->max_q16 == CONFIG_NONE ? INT32_MAX : axis->max_q16;
    }
    if (!is_any || !envelope_find(&envelope, &open)) {
        return false;
    }
    for (unsigned i = 0; i < POSE_AXES; i++) {
        const axis_settings_t given = config->settings.axis[i];
        fill_axis(&config->settings.axis[i], &envelope.suggested[i], &given);
    }
    return true;
}
