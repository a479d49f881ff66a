/* SPDX-License-Identifier: MIT
 * ref_history.c - see ref_history.h.
 */
#include "ref_history.h"

ramp_ref_t ref_history_scaled(const ramp_ref_t *ref, q32_t from_q32, const int64_t share[REF_HISTORY], unsigned shift)
{
    q32_t at_q32[REF_HISTORY];
    ref_history_of(ref, at_q32);
    for (unsigned age = 0; age < REF_HISTORY; age++) {
        at_q32[age] = from_q32 + fx_mul_shift(at_q32[age] - from_q32, share[age], shift);
    }
    return ref_history_ref(at_q32);
}
