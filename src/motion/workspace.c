/* SPDX-License-Identifier: MIT
 * workspace.c - the workspace: the largest share of the way from neutral to a pose that keeps every cylinder in its stroke.
 */
#include "workspace.h"

#include "root.h"

#define SEARCH_STEPS 14
#define FAR_OUT_Q32  q32_from_int(8000) /* a room that leads the search on: with one without end it would stay at neutral */

/* Room of the tightest cylinder (negative outside), and which it is; far out where the pose is beyond all solving. */
static q32_t tightest_room(const platform_t *platform, const pose_t *pose, q32_t extension_mm_q32[CYLINDERS_MAX],
                           unsigned *cylinder)
{
    if (kin_inverse(&platform->kin, pose, extension_mm_q32) != HV_OK) {
        *cylinder = 1;
        return -FAR_OUT_Q32;
    }
    q32_t room_q32 = INT64_MAX;
    for (unsigned i = 0; i < platform->cylinders; i++) {
        const ramp_limits_t *limits = &platform->cylinder[i].limits;
        const q32_t below_q32 = extension_mm_q32[i] - limits->pos_min_q32;
        const q32_t above_q32 = limits->pos_max_q32 - extension_mm_q32[i];
        const q32_t least_q32 = below_q32 < above_q32 ? below_q32 : above_q32;
        if (least_q32 < room_q32) {
            room_q32 = least_q32;
            *cylinder = i + 1;
        }
    }
    return room_q32;
}

static pose_t between(const pose_t *from, const pose_t *to, q62_t share_q62)
{
    pose_t result;
    for (unsigned i = 0; i < POSE_AXES; i++) {
        result.axis_q32[i] = from->axis_q32[i] + fx_mul_shift(to->axis_q32[i] - from->axis_q32[i], share_q62, 62);
    }
    return result;
}

/* The share that can be kept, below 1. */
static q62_t find_share(const platform_t *platform, const pose_t *asked, bracket_t share, q32_t extension_mm_q32[CYLINDERS_MAX])
{
    unsigned ignored = 0;
    share.at_low = tightest_room(platform, &platform->neutral, extension_mm_q32, &ignored);
    for (int step = 0; step < SEARCH_STEPS && share.high - share.low > 1; step++) {
        const q62_t at_q62 = bracket_chord(&share);
        const pose_t tried = between(&platform->neutral, asked, at_q62);
        bracket_narrow(&share, at_q62, tightest_room(platform, &tried, extension_mm_q32, &ignored));
    }
    return share.low;
}

unsigned workspace_pull_in(const platform_t *platform, pose_t *pose, q32_t extension_mm_q32[CYLINDERS_MAX], q62_t *share_q62)
{
    unsigned cylinder = 0;
    bracket_t share = {.low = 0, .high = Q62_ONE};
    share.at_high = tightest_room(platform, pose, extension_mm_q32, &cylinder);
    const bool is_kept = share.at_high >= 0;
    const q62_t kept_q62 = is_kept ? Q62_ONE : find_share(platform, pose, share, extension_mm_q32);
    if (share_q62 != NULL) {
        *share_q62 = kept_q62;
    }
    if (is_kept) {
        return 0;
    }
    *pose = between(&platform->neutral, pose, kept_q62);
    (void)tightest_room(platform, pose, extension_mm_q32, &cylinder);
    return cylinder;
}
