/* SPDX-License-Identifier: MIT
 * counts.c - counts and units; see counts.h.
 */
#include "heave/counts.h"

#define COUNTS_MAX   (INT64_C(1) << 61) /* its double fits */
#define RESULT_MAX   (INT64_C(1) << 62)
#define Q32_PER_UNIT (INT64_C(1) << 32)

/* Half of a doubled quotient that was cut towards zero: the quotient itself, to the nearest, halves away from zero. */
static int64_t halve_to_nearest(int64_t doubled)
{
    return (doubled < 0 ? doubled - 1 : doubled + 1) / 2;
}

hv_status_t counts_from_units(const counts_scale_t *self, q32_t units_q32, int64_t *counts)
{
    const int64_t doubled = fx_mul_div(units_q32, 2 * (int64_t)self->num, self->den * Q32_PER_UNIT);
    if (doubled == INT64_MAX || doubled == INT64_MIN) {
        return HV_ERR_RANGE;
    }
    const int64_t sum = halve_to_nearest(doubled) + self->zero;
    if (fx_abs(sum) > RESULT_MAX) {
        return HV_ERR_RANGE;
    }
    *counts = sum;
    return HV_OK;
}

hv_status_t counts_to_units(const counts_scale_t *self, int64_t counts, q32_t *units_q32)
{
    if (counts < -COUNTS_MAX || counts > COUNTS_MAX) {
        return HV_ERR_RANGE;
    }
    const int64_t doubled = fx_mul_div(2 * (counts - self->zero), self->den * Q32_PER_UNIT, self->num);
    if (doubled == INT64_MAX || doubled == INT64_MIN) { /* half of anything else is within +-2^30 units */
        return HV_ERR_RANGE;
    }
    *units_q32 = halve_to_nearest(doubled);
    return HV_OK;
}
