/* SPDX-License-Identifier: MIT
 * gate.h - spike filter: keeps single outliers out of a stream of poses.
 * Compares each sample with the extrapolation of the samples before it. A sample that would need more than `factor` times the
 * acceleration limit of an axis is withheld, as if the network had lost it. The next sample is always followed. If it is back on
 * the old course, the withheld one was a spike. If it is near the withheld one, that was a step, which is followed one sample
 * late. Owns no clock and no limits; one owner.
 */
#ifndef HEAVE_GATE_H
#define HEAVE_GATE_H

#include "heave/axes.h"
#include "heave/fx.h"

#define GATE_FACTOR_MAX 1000u

enum { GATE_PAST = 3 /**< samples for the extrapolation */ };

/** A sample that was not followed, for display. */
typedef struct {
    uint8_t axis;     /**< the axis that exceeded the limit most */
    q32_t value_q32;  /**< deg or mm */
    q32_t before_q32; /**< value of the previous sample */
} gate_spike_t;

/** Gate of one stream; members are private to src/motion. */
typedef struct {
    uint32_t factor; /**< 0 = everything passes */
    q32_t accel_q32[POSE_AXES];
    q32_t grain_q32[POSE_AXES];
    unsigned settled; /**< samples in a row since the start or a long gap, up to the number that a decision needs */
    uint32_t period_us;
    uint64_t last_us; /**< arrival of the newest sample that passed */
    q32_t past_q32[GATE_PAST][POSE_AXES];
    bool is_withholding;
    uint64_t withheld_us;
    int64_t withheld_periods; /**< after the newest sample that passed */
    gate_spike_t withheld;    /**< to be reported if the next sample is back on the course */
    q32_t withheld_q32[POSE_AXES];
    uint32_t spikes; /**< wraps */
    gate_spike_t spike;
} gate_t;

/** Starts without a stream.
 *  @param accel_q16 acceleration limit of each pose axis, u/s^2   @param factor [0, GATE_FACTOR_MAX]; 0 = off
 *  @return HV_OK; HV_ERR_RANGE */
hv_status_t gate_init(gate_t *self, const q16_t accel_q16[POSE_AXES], uint32_t factor) HV_MUST_CHECK;

/** Sets the factor from the next sample on: [0, GATE_FACTOR_MAX]. */
void gate_set_factor(gate_t *self, uint32_t factor);

/** Forgets the stream and a withheld sample. */
void gate_reset(gate_t *self);

/** Sets the resolution of an axis' values, 0 = none: a step of one resolution is not a spike. Kept by gate_reset(). */
void gate_set_grain(gate_t *self, unsigned axis, q32_t grain_q32);

/** Judges a sample. Bounded time.
 *  @param now_us    arrival, never decreasing
 *  @param period_us of the sender; 0 where no stream is running: then everything passes
 *  @param value_q32 within +-2^54
 *  @return false if it is withheld; two different samples in a row are never both withheld */
bool gate_passes(gate_t *self, uint64_t now_us, uint32_t period_us, const q32_t value_q32[POSE_AXES]);

/** True if no sample has followed the withheld one for so long that it was the sender's last. The caller then calls gate_reset()
 *  and follows it. */
bool gate_is_overdue(const gate_t *self, uint64_t now_us);

/** Number of samples not followed since the start, and the newest of them. */
uint32_t gate_spikes(const gate_t *self);
const gate_spike_t *gate_last_spike(const gate_t *self);

#endif
