/* SPDX-License-Identifier: MIT
 * counts.h - converts between the counts of a drive and the mm (or deg) of an axis by exact ratios, rounded to the nearest.
 * Pure. The ratio itself is never rounded, so that no error accumulates over a stroke.
 */
#ifndef HEAVE_COUNTS_H
#define HEAVE_COUNTS_H

#include "heave/fx.h"

/** counts = zero + units * num / den; unit u is mm, deg, or one of these per second. */
typedef struct {
    int32_t num;  /**< not 0 if counts are converted to units; negative: the drive counts in the opposite direction */
    int32_t den;  /**< > 0 */
    int32_t zero; /**< counts at 0 u */
} counts_scale_t;

/** True if a scale can be used in both directions. */
static inline bool counts_is_valid(const counts_scale_t *self)
{
    return self->num != 0 && self->den > 0;
}

/** Nearest counts, halves away from zero.
 *  @param counts out, unchanged on errors
 *  @return HV_OK; HV_ERR_RANGE: outside +-2^62 */
hv_status_t counts_from_units(const counts_scale_t *self, q32_t units_q32, int64_t *counts) HV_MUST_CHECK;

/** Nearest Q32, halves away from zero. counts_from_units() gives the counts back wherever |num / den| < 2^31.
 *  @param units_q32 out, unchanged on errors
 *  @return HV_OK; HV_ERR_RANGE: outside +-2^30 u, or counts outside +-2^61 */
hv_status_t counts_to_units(const counts_scale_t *self, int64_t counts, q32_t *units_q32) HV_MUST_CHECK;

#endif
