/* SPDX-License-Identifier: MIT
 * spike_filter.h - spike filter: keeps single outliers out of a stream of poses.
 * Compares each sample with the extrapolation of the samples before it. A sample that would need more than `factor` times the
 * acceleration limit of an axis is withheld, as if the network had lost it. The next sample is always followed. If it is back on
 * the old course, the withheld one was a spike. If it is near the withheld one, that was a step, which is followed one sample
 * late. Owns no clock and no limits; one owner.
 */
#ifndef HEAVE_SPIKE_FILTER_H
#define HEAVE_SPIKE_FILTER_H

#include "heave/axes.h"
#include "heave/fx.h"

#define SPIKE_FILTER_FACTOR_MAX 1000u

enum { SPIKE_FILTER_HISTORY = 3 /**< samples for the extrapolation */ };

/** A sample that was not followed, for display. */
typedef struct {
    uint8_t axis;     /**< the axis that exceeded the limit most */
    q32_t value_q32;  /**< deg or mm */
    q32_t before_q32; /**< value of the previous sample */
} spike_t;

/** Gate of one stream; members are private to src/motion. */
typedef struct {
    uint32_t factor; /**< 0 = everything passes */
    q32_t accel_q32[POSE_AXES];
    q32_t quantum_q32[POSE_AXES];
    unsigned settled; /**< samples in a row since the start or a long gap, up to the number that a decision needs */
    uint32_t period_us;
    uint64_t last_us; /**< arrival of the newest sample that passed */
    q32_t past_q32[SPIKE_FILTER_HISTORY][POSE_AXES];
    bool is_withholding;
    bool is_step; /**< the newest sample has confirmed that the one before it was a step */
    uint64_t withheld_us;
    int64_t withheld_periods; /**< after the newest sample that passed */
    spike_t withheld;         /**< to be reported if the next sample is back on the course */
    q32_t withheld_q32[POSE_AXES];
    uint32_t spikes; /**< wraps */
    spike_t spike;
} spike_filter_t;

/** Starts without a stream.
 *  @param accel_q16 acceleration limit of each pose axis, u/s^2   @param factor [0, SPIKE_FILTER_FACTOR_MAX]; 0 = off
 *  @return HV_OK; HV_ERR_RANGE */
hv_status_t spike_filter_init(spike_filter_t *self, const q16_t accel_q16[POSE_AXES], uint32_t factor) HV_MUST_CHECK;

/** Sets the factor from the next sample on: [0, SPIKE_FILTER_FACTOR_MAX]. */
void spike_filter_set_factor(spike_filter_t *self, uint32_t factor);

/** Forgets the stream and a withheld sample. */
void spike_filter_reset(spike_filter_t *self);

/** Sets the resolution of an axis' values, 0 = none: a step of one resolution is not a spike. Kept by spike_filter_reset(). */
void spike_filter_set_quantum(spike_filter_t *self, unsigned axis, q32_t quantum_q32);

/** Judges a sample. Bounded time.
 *  @param now_us    arrival, never decreasing
 *  @param period_us of the sender; 0 where no stream is running: then everything passes
 *  @param value_q32 within +-2^54
 *  @return false if it is withheld; two different samples in a row are never both withheld */
bool spike_filter_passes(spike_filter_t *self, uint64_t now_us, uint32_t period_us, const q32_t value_q32[POSE_AXES]);

/** True if no sample has followed the withheld one for so long that it was the sender's last. The caller then calls
 * spike_filter_reset() and follows it. */
bool spike_filter_is_overdue(const spike_filter_t *self, uint64_t now_us);

/** Number of samples not followed since the start, and the newest of them. */
uint32_t spike_filter_spikes(const spike_filter_t *self);
const spike_t *spike_filter_last_spike(const spike_filter_t *self);

#endif
