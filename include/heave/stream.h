/* SPDX-License-Identifier: MIT
 * stream.h - reconstructs a sender's motion from the samples of its stream: estimates its time line from the arrivals,
 * interpolates the samples, and smooths the result if it exceeds the limits. Owns no clock. One owner; not re-entrant per
 * instance.
 *
 * Time line: a straight line through the arrivals. A sample belongs to its point on the line if the sender samples regularly and
 * the network or a timer delayed it. It belongs to its arrival if the sender samples when it sends, as games do. Or it belongs to
 * a time in between. The values decide, see stream_evidence.h. They also distinguish a late sample from a lost one.
 *
 * Delay: the curve reaches a sample 2 periods (smooth) or 1.32 periods (balanced) after its time, plus a margin. The margin is
 * the largest lateness in the last seconds, at least 0.5 ms, and limited so that the delay stays below stream_set_delay_max(). It
 * rises at once and falls slowly. The curve is played up to 10 % slower or faster until it has the desired delay.
 *
 * Limits: governor.h smooths what exceeds the limits of axes and cylinders, equally for all axes.
 *
 * Coarse values: if the rounding steps of the values exceed what the axes can do, they are smoothed by a mean of up to
 * STREAM_WINDOW_MAX points, applied three times. Each point after the first adds 1.5 periods of delay.
 *
 * Losses: if a point is missing when the curve needs it, the motion is extrapolated by a linear prediction of its steps (at most
 * twice the second largest of the last 12) and slows down like the quickest stop of the axis (a slow motion in 100 ms, over 50 ms
 * of travel). When samples return, or after 150 ms (or 3.5 periods) without any, the curve returns softly to the samples or to
 * the last one: position and velocity of the control points are continuous. So a stream that has ended comes to rest exactly on
 * its last sample, within 2 s, or within 24 periods of a slow stream. A known stream may pause for a second and continues. A new
 * rate gives a new grid, on which the curve continues.
 *
 * Frames that are no samples: repetitions of the newest values, values that freeze for up to three frames and then catch up, old
 * frames and frames that others have overtaken. See "What a sample is" in src/stream/DESIGN.md. A sender may send each value up
 * to 8 times, such as a loop beside a slower game. After about 12 values it is followed at the rate of its values.
 *
 * Hints: of a sender that states its period, late and lost samples are known from its second sample on. The margin of such a
 * stream, and of one below 25 Hz, is at least an eighth of the period, because extrapolation of a slow stream is poor.
 */
#ifndef HEAVE_STREAM_H
#define HEAVE_STREAM_H

#include "heave/governor.h"
#include "heave/kin.h"
#include "heave/profile.h"

/** How a stream is rendered: both by a cubic B-spline, with continuous acceleration. */
typedef enum {
    STREAM_SMOOTH,  /**< the samples are its control points: 2 periods + margin late */
    STREAM_BALANCED /**< control points are extrapolated by 0.68 periods: 1.32 periods + margin late */
} stream_style_t;

#define STREAM_PERIOD_MIN_US 4000u   /**< fastest stream: 250 Hz; of a faster one, every second, third, ... sample is used */
#define STREAM_PERIOD_MAX_US 550000u /**< slowest stream: 1.8 Hz; samples further apart are steps */
#define STREAM_QUIET_US      150000u /**< a faster sender that was silent for so long is quiet */
#define STREAM_HINT_MIN_US   50000u  /**< a shorter hint is ignored: timers of senders have steps of up to 16 ms */
#define STREAM_HINT_MAX_US   500000u /**< slowest with a hint: 2 Hz */

/** Phase of a stream. */
typedef enum {
    STREAM_EMPTY,  /**< no sample yet */
    STREAM_LONE,   /**< one sample: a step */
    STREAM_RUNNING /**< a curve */
} stream_phase_t;

typedef struct stream stream_t;

/** How a sender's samples arrive. */
typedef enum {
    STREAM_SENDER_UNKNOWN, /**< no stream runs */
    STREAM_SENDER_EVEN,    /**< its values are even in time; lateness comes from timers or the network */
    STREAM_SENDER_BURSTS,  /**< its values are even in time, and often two or more arrive at once */
    STREAM_SENDER_ARRIVALS /**< its values belong to the arrival times: the program samples when it sends */
} stream_sender_t;

/** Properties of the sender of a stream, and the parts of the delay, for display. */
typedef struct {
    stream_sender_t sender;
    uint32_t period_us;     /**< 0 while unknown */
    uint32_t jitter_us;     /**< how late the latest samples of the last seconds were */
    uint32_t lost_permille; /**< over the last 256 samples or so */
    uint32_t delay_us;      /**< total; parts of it: */
    uint32_t wait_us;       /**< waiting for late samples */
    uint32_t smoothing_us;  /**< smoothing because of the limits */
} stream_report_t;

/** Starts without any sample.
 *  @param cycle_us [500, 10000]   @param axes 1 to AXES_MAX */
void stream_init(stream_t *self, uint32_t cycle_us, unsigned axes, stream_style_t style);

/** Sets the limits of an axis. Where samples are missing, the motion continues no longer than the axis takes to stop, or 36 ms.
 * Samples that exceed the limits are smoothed, except on axes from POSE_AXES on. Kept by stream_reset(). */
void stream_set_limits(stream_t *self, unsigned axis, const governor_limits_t *limits);

/** Sets the limits of a cylinder [0, CYLINDERS_MAX); jerk 0: none. Kept by stream_reset(). */
void stream_set_cylinder_limits(stream_t *self, unsigned cylinder, const governor_limits_t *limits);

/** Sets the upper limit of the delay for late samples; 0 (default): half a period more than the curve's own delay. */
void stream_set_delay_max(stream_t *self, uint32_t delay_max_us);

/** Sets the factor by which the caller will multiply the references, [0, Q16_ONE]; Q16_ONE after stream_init(). */
void stream_set_scale(stream_t *self, int32_t scale_q16);

/** Allows a curve that begins to jump onto its samples, because it is not visible yet. */
void stream_hide_start(stream_t *self, bool is_hidden);

/** Sets the state of the axes, for a curve that begins while they move. */
void stream_place(stream_t *self, const history_t *now);

/** Forgets the stream; the next sample starts a new one. */
void stream_reset(stream_t *self);

/** Sets the period that the sender states with the next sample, at most STREAM_HINT_MAX_US; 0 = none (default). With a hint, the
 * second sample of a stream may be late. */
void stream_hint_period(stream_t *self, uint32_t period_us);

/** True if a sample at now_us would continue the present stream. A stream of 12 samples or more may pause for a second; a shorter
 * one for STREAM_QUIET_US or 3.5 periods. */
bool stream_goes_on(const stream_t *self, uint64_t now_us);

/** Before each target: true if a stream of 10 samples or more has been silent until its motion ended, and this target is
 * elsewhere: it comes in the first 100 ms of its return, and is further from the last sample before the silence than the axes can
 * go in that time and a period. Never true of slow streams, whose period is above STREAM_QUIET_US. */
bool stream_returns_elsewhere(stream_t *self, uint64_t now_us, const q32_t *sample_q32);

/** Accepts a sample. Bounded time.
 *  @param now_us     arrival, never decreasing
 *  @param kin        the mechanism, where the axes are those of poses; else NULL
 *  @param sample_q32 one value per axis, within +-2^48
 *  A sample within STREAM_PERIOD_MAX_US of the first or second one (or within STREAM_QUIET_US or 3.5 periods of the last one of a
 *  stream that runs) continues or begins a stream; any other, and one that follows a lone sample within 2 ms, is a lone sample.
 *  Repeated, frozen and old values are no samples. Two samples are steps; the third one makes a stream, or the second where the
 *  sender states its period. Where one of their intervals is longer than STREAM_QUIET_US, the fourth one makes a
 *  stream if they are alike and each step leads on along the one before it, and a sample far beside that is a lone one again. */
void stream_push(stream_t *self, uint64_t now_us, const kin_t *kin, const q32_t *sample_q32);

/** References for the cycle at now_us, one per axis, with consistent backward differences (vel[k] = pos[k]-pos[k-1] and so on,
 *  except in the first cycle after a start, where the differences are 0).
 *  @param kin the mechanism, where the axes are those of poses; else NULL
 *  A lone sample is a step: position of the sample, differences 0. The curve of a stream starts at rest on its first sample; when
 *  the stream ends, the references end at rest on its last. Equal samples give exactly equal references.
 *  @return false while no sample has come since reset (ref unchanged). */
bool stream_step(stream_t *self, uint64_t now_us, const kin_t *kin, ramp_ref_t *ref);

/** Phase of the stream. */
stream_phase_t stream_phase(const stream_t *self);

/** Resolution of the sender's values on an axis; 0: none, or too fine to matter. */
q32_t stream_quantum_q32(const stream_t *self, unsigned axis);

/** True while the samples ask for more acceleration, or more speed, than the limits allow, and are made smaller. */
bool stream_is_smoothed(const stream_t *self);
bool stream_is_slowed(const stream_t *self);

/** True while samples come regularly: period known, last arrival at most STREAM_QUIET_US or 3.5 periods ago. */
bool stream_is_live(const stream_t *self, uint64_t now_us);

/** Estimated period of the sender, 0 while unknown; and how late the samples are rendered, for display. us. */
uint32_t stream_period_us(const stream_t *self);

/** Mean interval of the sender's samples: the period, or less where it sends each value several times. 0 = no stream runs. */
uint32_t stream_frame_us(const stream_t *self);
uint32_t stream_delay_us(const stream_t *self);

/** What is known of the sender. */
stream_report_t stream_report(const stream_t *self);

/** Finds how far a stream has jumped, beside the motion that went on.
 *  @param newest_q32 the sample that comes next
 *  @param step_q32 how far the sender has gone since the sample that jumped first
 *  @param by_q32 out
 *  @return false: that is no jump, as it is not far larger than the steps around it */
bool stream_find_jump(const stream_t *self, const q32_t newest_q32[POSE_AXES], const q32_t step_q32[POSE_AXES],
                      q32_t by_q32[POSE_AXES]);

/** Moves all that a stream that runs remembers, as if its samples had always been there. Times, rates and steps stay.
 *  @param by_q32 how far, on each pose axis */
void stream_shift(stream_t *self, const kin_t *kin, const q32_t by_q32[POSE_AXES]);

#include "heave/stream_state.h" /* the definition of stream_t, so that the caller can own one */

#endif
