/* SPDX-License-Identifier: MIT
 * stream_shift.c - a stream that jumps, and one at another place; see heave/stream.h.
 */
#include "heave/stream.h"

#include "stream_evidence.h"

#define LARGER 4 /* times as large as three steps around it is a jump */

/* Half of the motion between the sample before the jump and the one that jumped went as before, half as since then. */
bool stream_find_jump(const stream_t *self, const q32_t newest_q32[POSE_AXES], const q32_t step_q32[POSE_AXES],
                      q32_t by_q32[POSE_AXES])
{
    const stream_evidence_t *seen = &self->evidence;
    const governor_t *scale = &self->curve.governor;
    q32_t size_q32 = 0;
    q32_t around_q32 = 0;
    if (seen->count < 3) {
        return false;
    }
    for (unsigned i = 0; i < POSE_AXES; i++) {
        const q32_t after_q32 = seen->value_q32[0][i] - seen->value_q32[1][i];
        const q32_t before_q32 = seen->value_q32[1][i] - seen->value_q32[2][i];
        by_q32[i] = newest_q32[i] - seen->value_q32[0][i] - step_q32[i] - (after_q32 + step_q32[i]) / 2;
        size_q32 += stream_evidence_in_speed_limits(scale, i, by_q32[i]);
        around_q32 += stream_evidence_in_speed_limits(scale, i, fx_abs(after_q32) + fx_abs(before_q32) + fx_abs(step_q32[i]));
    }
    return size_q32 > around_q32 * LARGER;
}

static void shift_curve(stream_curve_t *curve, unsigned axis, q32_t by_q32)
{
    for (unsigned i = 0; i < STREAM_POINTS; i++) {
        curve->point_q32[i][axis] += by_q32;
    }
    for (unsigned i = 0; i < 3; i++) {
        curve->was_q32[i][axis] += by_q32;
    }
    curve->control_q32[axis] += by_q32;
    curve->low_q32[axis] += by_q32;
    curve->high_q32[axis] += by_q32;
    curve->newest_q32[axis] += by_q32;
    curve->last_q32[axis] += by_q32;
}

/* Cylinders as far as the pose that was asked for last takes them: of its smoothed copies, which are near, that is close enough.
 */
static void shift_governor(governor_t *governor, const kin_t *kin, const q32_t by_q32[POSE_AXES])
{
    pose_t pose;
    q32_t extension_mm_q32[CYLINDERS_MAX];
    for (unsigned i = 0; i < POSE_AXES; i++) {
        pose.axis_q32[i] = governor->asked_q32[i] + by_q32[i];
        governor_shift(governor, i, pose.axis_q32[i]);
    }
    if (kin_inverse(kin, &pose, extension_mm_q32) == HV_OK) {
        for (unsigned i = POSE_AXES; i < governor->channels; i++) {
            governor_shift(governor, i, extension_mm_q32[i - POSE_AXES]);
        }
    }
}

void stream_shift(stream_t *self, const kin_t *kin, const q32_t by_q32[POSE_AXES])
{
    for (unsigned axis = 0; axis < POSE_AXES; axis++) {
        shift_curve(&self->curve, axis, by_q32[axis]);
        for (unsigned i = 0; i < STREAM_EVIDENCE; i++) {
            self->evidence.value_q32[i][axis] += by_q32[axis];
        }
        self->previous[axis].pos_q32 += by_q32[axis];
        self->left_q32[axis] += by_q32[axis];
    }
    shift_governor(&self->curve.governor, kin, by_q32);
    self->curve.governor.single_us = GOVERNOR_BEGIN_US; /* what exceeds the limits next is no longer a single jump */
}
