/* SPDX-License-Identifier: MIT
 * excitation.h - test signals for the identification of an axis: sine, steps, chirp and noise around a middle. A signal begins
 * and ends at rest in the middle, and is never wider than its amplitude. Where its frequency would take more speed, acceleration
 * or jerk than the limits allow, it is narrower. No clock: one step is one cycle.
 *
 * Source of the chirp with an exponential rise of the frequency: L. Ljung, System Identification (1999), section 13.3; there,
 * also, sums of sines in place of noise. Such a sum has bounds that are known beforehand.
 */
#ifndef HEAVE_EXCITATION_H
#define HEAVE_EXCITATION_H

#include "heave/profile.h"

typedef enum {
    EXCITATION_SINE,
    EXCITATION_STEP,  /**< S-curves to one side and back; each takes at least half a period */
    EXCITATION_CHIRP, /**< a sine whose frequency rises exponentially */
    EXCITATION_NOISE, /**< a sum of sines with fixed phases that look random; the same each time */
    EXCITATION_KINDS
} excitation_kind_t;

/** The requested signal. */
typedef struct {
    excitation_kind_t kind;
    q16_t amplitude_q16;  /**< mm or deg from the middle to one side, above 0 */
    uint32_t from_mhz;    /**< frequency in 1/1000 Hz: of a sine and of steps, the lowest of a chirp and of noise */
    uint32_t to_mhz;      /**< the highest of a chirp and of noise; else 0 */
    uint32_t duration_ms; /**< with ramping in and out */
} excitation_request_t;

#define EXCITATION_LEAST_MHZ    10u     /* 0.01 Hz */
#define EXCITATION_MOST_MHZ     50000u  /* and at least eight cycles per period */
#define EXCITATION_LEAST_MS     3000u   /* and at least six periods of the lowest frequency (steps: four; chirp: see below) */
#define EXCITATION_MOST_MS      600000u /* ten minutes */
#define EXCITATION_SINES        16u     /* in noise */
#define EXCITATION_RAMP_MS      1000u   /* and at least two periods */
#define EXCITATION_RAMP_PERIODS 2u

/** A signal in progress; members are private to src/motion. */
typedef struct {
    excitation_kind_t kind;
    path_limits_t limits; /**< of the share of the amplitude */
    int64_t cycles;
    int64_t ramp_in, ramp_out; /**< cycles of it */
    int64_t elapsed;
    uint64_t phase_q64;                    /**< chirp; in turns, wraps */
    int64_t turn_q64[EXCITATION_SINES];    /**< turns per cycle; chirp: [0] is the present value */
    uint64_t offset_q64[EXCITATION_SINES]; /**< noise: phases at the beginning, in turns */
    q62_t share_q62[EXCITATION_SINES];     /**< sine and noise: their amplitudes */
    int64_t growth_q62;                    /**< chirp: growth of the frequency per cycle */
    scurve_t way;                          /**< steps: the move between the middle and the side */
    bool is_out;                           /**< steps: at the side, or moving there */
    int64_t half;                          /**< steps: cycles of half a period */
} excitation_t;

/** True if the times and frequencies of a request are allowed with this cycle. Besides its ramps, a chirp needs 1.3 periods of
 * its lowest frequency for each octave. */
bool excitation_is_allowed(const excitation_request_t *request, uint32_t cycle_us);

/** Begins a signal.
 *  @param limits of the move from the middle to the amplitude, per cycle^k
 *  @return HV_OK; HV_ERR_RANGE: the times or frequencies are not allowed, or the limits allow no amplitude */
hv_status_t excitation_init(excitation_t *self, const excitation_request_t *request, const path_limits_t *limits,
                            uint32_t cycle_us) HV_MUST_CHECK;

/** The share of the amplitude in the next cycle, -1 to 1; 0 after the end. */
q62_t excitation_step(excitation_t *self);

static inline bool excitation_is_done(const excitation_t *self)
{
    return self->elapsed >= self->cycles && !self->is_out && scurve_is_done(&self->way);
}

#endif
