/* SPDX-License-Identifier: MIT
 * jog_limits.c - how fast and how gentle a jog may be; see jog_limits.h.
 */
#include "jog_limits.h"

hv_status_t jog_limits_init(jog_limits_t *self, const settings_t *settings)
{
    *self = (jog_limits_t){.deg_per_cycle_q32 = 0};
    if (settings->jog_mm_s_q16 == 0) {
        return HV_OK; /* no limiter can be made of it: nothing is led */
    }
    const q16_t own_q16 = settings->cylinder_speed_mm_s_q16;
    const q16_t speed_q16 = settings->jog_mm_s_q16 < own_q16 ? settings->jog_mm_s_q16 : own_q16;
    self->deg_per_cycle_q32 = fx_mul_div(q32_from_q16(settings->jog_deg_s_q16), settings->cycle_us, 1000000);
    self->signal_mm_q32 = q32_from_q16(settings->signal_mm_q16);
    self->signal_deg_q32 = q32_from_q16(settings->signal_deg_q16);
    self->signal_mm_per_cycle_q32 = fx_mul_div(q32_from_q16(settings->signal_mm_s_q16), settings->cycle_us, 1000000);
    return ramp_limits_from_units(0, settings->stroke_mm_q16[0], speed_q16, settings->engage_accel_mm_s2_q16,
                                  settings->cylinder_jerk_mm_s3, settings->cycle_us, &self->cylinder);
}

const ramp_t *jog_limiter(const motion_t *self, unsigned axis)
{
    const ramp_t *own = axis == AXIS_ANGLE ? &self->axis[AXIS_ANGLE] : &self->cylinder[axis];
    return self->jog.is_serving && (self->jog.led >> axis & 1u) != 0 ? &self->jog.ramp[axis] : own;
}
