/* SPDX-License-Identifier: MIT
 * ref_history.h - a reference as the last four positions, and back: what is to be scaled or blended is its positions, and the
 * differences follow. Private to src/motion.
 */
#ifndef REF_HISTORY_H
#define REF_HISTORY_H

#include "heave/ramp.h"

/** Positions that a reference consists of. */
#define REF_HISTORY 4u

/** The positions of a reference, the newest first. */
static inline void ref_history_of(const ramp_ref_t *ref, q32_t at_q32[REF_HISTORY])
{
    const q32_t vel_q32 = ref->vel_per_cycle_q32;
    const q32_t acc_q32 = ref->acc_per_cycle2_q32;
    at_q32[0] = ref->pos_q32;
    at_q32[1] = ref->pos_q32 - vel_q32;
    at_q32[2] = ref->pos_q32 - 2 * vel_q32 + acc_q32;
    at_q32[3] = ref->pos_q32 - 3 * vel_q32 + 3 * acc_q32 - ref->jerk_per_cycle3_q32;
}

/** The reference of the cycle before. */
static inline ramp_state_t ref_history_state(const ramp_ref_t *ref)
{
    return (ramp_state_t){ref->pos_q32 - ref->vel_per_cycle_q32, ref->vel_per_cycle_q32 - ref->acc_per_cycle2_q32,
                          ref->acc_per_cycle2_q32 - ref->jerk_per_cycle3_q32};
}

/** The reference of such positions. */
static inline ramp_ref_t ref_history_ref(const q32_t at_q32[REF_HISTORY])
{
    const q32_t v0 = at_q32[0] - at_q32[1];
    const q32_t v1 = at_q32[1] - at_q32[2];
    const q32_t v2 = at_q32[2] - at_q32[3];
    return (ramp_ref_t){at_q32[0], v0, v0 - v1, v0 - 2 * v1 + v2};
}

/** A reference of which only a share counts from a position on.
 *  @param share of this cycle and those before it, 2^shift is all */
ramp_ref_t ref_history_scaled(const ramp_ref_t *ref, q32_t from_q32, const int64_t share[REF_HISTORY], unsigned shift);

#endif
