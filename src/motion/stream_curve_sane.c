/* SPDX-License-Identifier: MIT
 * stream_curve_sane.c - whether a stream's curve that was loaded may go on; see stream_sane.h.
 */
#include "heave/sane.h"
#include "stream_curve.h"
#include "stream_quantum.h"
#include "stream_sane.h"

#define POINT_Q32    STREAM_SANE_POINT_Q32
#define CONTROL_Q32  (4 * STREAM_SANE_POINT_Q32) /* points are led ahead, and the curve may be off them */
#define WAY_Q36      (32 * CONTROL_Q32)
#define CYCLES_MIN   (Q16_ONE / 4)
#define CYCLES_MAX   ((int64_t)8192 * Q16_ONE)
#define REACH_MAX    (64 * Q16_ONE)
#define GUESSES_MAX  ((int32_t)1 << 20)
#define PATIENCE_MAX 128
#define GRIP_MAX_Q32 (Q32_ONE / 2)
#define SOFT_MIN_Q32 (Q32_ONE / 32)

/* Where samples are ahead, the newest is one: the curve looks for it. */
static bool are_points_sane(const stream_curve_t *curve)
{
    bool is_sane = stream_sane_within(curve->ahead, -GUESSES_MAX, STREAM_CURVE_AHEAD_MAX);
    for (unsigned i = 0; i < STREAM_POINTS; i++) {
        is_sane = is_sane && stream_sane_all(curve->point_q32[i], AXES_MAX, POINT_Q32) && sane_bool(&curve->is_sample[i]);
    }
    return is_sane && (curve->ahead <= 0 || curve->is_sample[(curve->head + (uint32_t)curve->ahead) % STREAM_POINTS]);
}

static bool is_quantum_sane(const stream_quantum_t *grain)
{
    return stream_sane_within(grain->quantum_q32, 0, POINT_Q32) && stream_sane_within(grain->found_q32, 0, POINT_Q32) &&
           stream_sane_within(grain->step_q32, -POINT_Q32, POINT_Q32) && sane_bool(&grain->is_up) &&
           grain->turns <= STREAM_QUANTUM_TURNS;
}

static bool is_lead_sane(const stream_lead_t *lead)
{
    return stream_sane_within(lead->step_q32, -8 * POINT_Q32, 8 * POINT_Q32) &&
           stream_sane_within(lead->before_q32, -8 * POINT_Q32, 8 * POINT_Q32) &&
           stream_sane_within(lead->most_q32, 0, 8 * POINT_Q32) &&
           stream_sane_within(lead->first_q32, -lead->most_q32, lead->most_q32) && lead->rise_q32 <= Q32_ONE / 2 &&
           stream_sane_within(lead->reach_q16, 0, REACH_MAX) && stream_sane_within(lead->full_q16, 0, lead->reach_q16);
}

static bool is_predictor_sane(const stream_predictor_t *predictor)
{
    return stream_sane_within(predictor->by_newest_q32, -Q32_ONE, 2 * Q32_ONE) &&
           stream_sane_within(predictor->by_before_q32, -Q32_ONE, Q32_ONE);
}

/* The weights of a mean of coarse values are so many in sum. */
static bool is_mean_sane(const stream_curve_t *curve, bool is_running)
{
    const int32_t window = curve->window;
    int32_t sum = 0;
    if (!stream_sane_within(window, is_running ? 1 : 0, STREAM_WINDOW_MAX) || !stream_sane_within(curve->mean_q32, 0, Q32_ONE) ||
        !stream_sane_within(curve->led_q32, 0, Q32_ONE) ||
        !stream_sane_within(curve->mean_points, is_running ? 1 : 0, STREAM_CURVE_MEAN_MAX)) {
        return false;
    }
    for (int32_t i = 0; i < 3 * window - 2; i++) {
        sum += curve->weight[i];
    }
    return window <= 1 || sum == window * window * window;
}

static bool is_pace_sane(const stream_curve_t *curve, stream_style_t style, bool is_running)
{
    if (!is_running && curve->period_cycles_q16 == 0) {
        return curve->lead_q32 == 0 && curve->reach_min_q16 == 0 && curve->reach_max_q16 == 0 && curve->softest_q32 == 0 &&
               curve->patience == 0;
    }
    return stream_sane_within(curve->period_cycles_q16, CYCLES_MIN, CYCLES_MAX) &&
           curve->lead_q32 == (style == STREAM_BALANCED ? STREAM_CURVE_LED_Q32 : 0) &&
           stream_sane_within(curve->reach_min_q16, 0, REACH_MAX) && stream_sane_within(curve->reach_max_q16, 0, REACH_MAX) &&
           stream_sane_within(curve->softest_q32, SOFT_MIN_Q32, GRIP_MAX_Q32) &&
           stream_sane_within(curve->patience, 1, PATIENCE_MAX);
}

static bool are_axes_sane(const stream_curve_t *curve)
{
    bool is_sane =
        stream_sane_all(curve->control_q32, AXES_MAX, CONTROL_Q32) && stream_sane_all(curve->low_q32, AXES_MAX, CONTROL_Q32) &&
        stream_sane_all(curve->high_q32, AXES_MAX, CONTROL_Q32) && stream_sane_all(curve->newest_q32, AXES_MAX, POINT_Q32) &&
        stream_sane_all(curve->last_q32, AXES_MAX, POINT_Q32);
    for (unsigned i = 0; i < 3; i++) {
        is_sane = is_sane && stream_sane_all(curve->way_q36[i], AXES_MAX, WAY_Q36) &&
                  stream_sane_all(curve->was_q32[i], AXES_MAX, CONTROL_Q32);
    }
    for (unsigned axis = 0; axis < AXES_MAX; axis++) {
        is_sane = is_sane && stream_sane_all(curve->off_q32[axis], 3, CONTROL_Q32) && is_lead_sane(&curve->lead[axis]) &&
                  is_quantum_sane(&curve->grain[axis]);
    }
    return is_sane;
}

bool stream_curve_is_sane(const stream_curve_t *saved, const stream_curve_t *prepared, stream_style_t style, bool is_running)
{
    return saved->axes == prepared->axes && are_points_sane(saved) && are_axes_sane(saved) && is_mean_sane(saved, is_running) &&
           is_pace_sane(saved, style, is_running) && is_predictor_sane(&saved->predictor) &&
           saved->watched <= STREAM_QUANTUM_WATCH && stream_sane_within(saved->change, 0, GUESSES_MAX) &&
           sane_bool(&saved->is_off) && stream_sane_within(saved->grip_q32, 0, GRIP_MAX_Q32) &&
           stream_sane_within(saved->age, 0, STREAM_CURVE_AGE_MAX) && stream_sane_within(saved->scale_q16, 0, 2 * Q16_ONE);
}
