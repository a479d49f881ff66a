/* SPDX-License-Identifier: MIT
 * target_sane.c - whether a sender's target that was loaded may be used; see motion_sane.h.
 */
#include "heave/motion_sane.h"
#include "heave/sane.h"

bool motion_target_is_sane(const motion_target_t *target)
{
    return sane_all_q32(target->value_q32, POSE_AXES) && sane_q32(target->angle_deg_q32) &&
           (unsigned)target->space <= MOTION_CYLINDERS && target->time_ms <= FRAME_TIME_MAX_MS && sane_bool(&target->has_angle) &&
           sane_bool(&target->is_timed);
}
