/* SPDX-License-Identifier: MIT
 * governor_speed.c - keeps a stream within the speed limits; see governor_speed.h.
 * Smoothing is no cure for a speed: a low-pass that makes a slow motion slower is late by hundreds of milliseconds, while the
 * motion exceeds the limit for a part of that time only.
 */
#include "governor_speed.h"

#define SPEED_TOP   (Q16_ONE * 92 / 100) /* of the speed limits: the largest speed, ... */
#define SPEED_KNEE  (Q16_ONE / 10)       /* ... which speeds from so much below to so much above it bend to */
#define NOTHING_Q32 (Q32_ONE / 2000)     /* what is left behind is caught up until it is no more than this: 0.5 um, ... */
#define CATCH_UP    4                    /* ... as the low-pass of 100 ms does it */

/* A share of the speed limits, bent so that it comes to SPEED_TOP and no further. */
static int32_t bent(int32_t need_q16)
{
    const int64_t over_q16 = need_q16 - (SPEED_TOP - SPEED_KNEE);
    if (over_q16 <= 0) {
        return need_q16;
    }
    return over_q16 >= 2 * SPEED_KNEE ? SPEED_TOP : (int32_t)(need_q16 - over_q16 * over_q16 / (4 * SPEED_KNEE));
}

void governor_limit_speed(governor_t *self, const q32_t *asked_q32, int32_t scale_q16, q32_t *kept_q32)
{
    q32_t way_q32[GOVERNOR_CHANNELS];
    int32_t need_q16 = 0;
    for (unsigned i = 0; i < self->channels; i++) {
        way_q32[i] = asked_q32[i] - self->asked_q32[i] + fx_mul_shift(self->behind_q32[i], self->share_q32[CATCH_UP], 32);
        need_q16 = governor_larger(need_q16, governor_share_of(way_q32[i] * (int64_t)self->each, self->per_limit_q62[i][0]));
    }
    need_q16 = (int32_t)fx_mul_shift(need_q16, scale_q16, 16);
    const int32_t kept_q16 = bent(need_q16);
    self->is_slowed = need_q16 > Q16_ONE;
    for (unsigned i = 0; i < self->channels; i++) {
        const q32_t step_q32 = kept_q16 == need_q16 ? way_q32[i] : fx_mul_div(way_q32[i], kept_q16, need_q16);
        const q32_t behind_q32 = self->behind_q32[i] + asked_q32[i] - self->asked_q32[i] - step_q32;
        self->behind_q32[i] = fx_abs(behind_q32) < NOTHING_Q32 ? 0 : behind_q32;
        self->asked_q32[i] = asked_q32[i];
        kept_q32[i] = asked_q32[i] - self->behind_q32[i];
    }
}
