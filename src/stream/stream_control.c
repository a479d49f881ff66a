/* SPDX-License-Identifier: MIT */
#include "stream_control.h"

#include "stream_curve.h"
#include "stream_points.h"

enum {
    MEAN_MAX = STREAM_CURVE_MEAN_MAX,
    LED_POINTS = 7,  /* points that lead a control point, in addition to its own point */
    COARSE_ACC = 4,  /* of the accelerations that coarse steps can make, half is to be left to the motion ... */
    COARSE_JERK = 6, /* ... and of the jerk most */
    COARSE_LED = 2   /* led control points overshoot this many times further */
};

#define MEAN_US        29000u         /* approximate length of a mean of points that belong to their arrivals */
#define LED_CHANGE_Q32 (Q32_ONE / 64) /* largest change of the lead in a period */
#define LED_FULL_US    15000u         /* from this period on, the lead is full; with shorter ones it gains little time ... */
#define LED_NONE_US    9000u          /* ... and costs much jerk; up to this period there is none */

/* The point of an index; for coarse values, a mean of the points up to it. If samples belong to their arrivals, the delays of
 * the network are noise on the points. The mean of two points has a third of the jerk of this noise. */
HV_WRAPS static q32_t mean_point(const stream_curve_t *self, unsigned axis, uint32_t index)
{
    const int32_t window = self->window;
    int64_t sum_q32 = 0;
    if (window == 1) {
        const q32_t here_q32 = self->point_q32[stream_points_place(index)][axis];
        if (self->mean_q32 == 0) {
            return here_q32;
        }
        for (uint32_t back = 1; back < self->mean_points; back++) {
            sum_q32 += self->point_q32[stream_points_place(index - back)][axis] - here_q32;
        }
        return here_q32 + fx_mul_shift(sum_q32 / (int64_t)self->mean_points, self->mean_q32, 32);
    }
    for (int32_t back = 0; back < 3 * window - 2; back++) {
        sum_q32 += self->weight[back] * self->point_q32[stream_points_place(index - (uint32_t)back)][axis];
    }
    return sum_q32 / (window * window * window);
}

/* A linear predictor of 0.68 periods: the weight of each earlier point, relative to the newest, in Q32. Found by least squares
 * over 0 to 6 Hz at 60 Hz, with the condition that the gain behind the cubic is at most 1.05 at every frequency. The short
 * predictor 1 + L D - L (1 - L) / 2 D^2 has a gain of 1.14 at 5 Hz and 1.27 at 10 Hz. It is not used if samples belong to their
 * arrivals or many are lost, because it would lead their noise, or the guesses for lost samples, as well. */
static const int64_t k_led_q32[LED_POINTS] = {-5397123704, 3086786968, -1806239287, 979893574, -563808519, 245446526, -100343650};

HV_WRAPS q32_t stream_control_point(const stream_curve_t *self, unsigned axis, uint32_t index)
{
    const q32_t here_q32 = mean_point(self, axis, index);
    int64_t ahead_q32 = 0;
    for (uint32_t back = 1; self->lead_q32 != 0 && self->led_q32 != 0 && back <= LED_POINTS; back++) {
        ahead_q32 += fx_mul_shift(mean_point(self, axis, index - back) - here_q32, k_led_q32[back - 1], 32);
    }
    return here_q32 + (self->led_q32 == Q32_ONE ? ahead_q32 : fx_mul_shift(ahead_q32, self->led_q32, 32));
}

HV_WRAPS void stream_control_at_head(const stream_curve_t *self, q32_t point_q32[3][AXES_MAX])
{
    for (uint32_t back = 0; back < 3; back++) {
        for (unsigned axis = 0; axis < self->axes; axis++) {
            point_q32[back][axis] = stream_control_point(self, axis, self->head - back);
        }
    }
}

/* How many points a control point is to be the mean of, thrice. Values in steps of q are off by up to q / 2. Of that a mean of m
 * points makes second differences of up to 2 q / m^2 and third ones of up to 4 q / m^3, to be held against what the axis can do.
 */
static int32_t window_of_axis(const stream_curve_t *self, unsigned axis)
{
    const governor_limits_t *stop = &self->limits[axis];
    const int64_t n_q16 = self->period_cycles_q16;
    const q32_t quantum_q32 = self->quantum[axis].quantum_q32;
    if (quantum_q32 == 0 || stop->jerk_per_cycle3_q32 <= 0) {
        return 1;
    }
    const q32_t acc_q32 = fx_mul_shift(fx_mul_shift(stop->acc_per_cycle2_q32, n_q16, 16), n_q16, 16);
    const q32_t jerk_q32 = fx_mul_shift(fx_mul_shift(fx_mul_shift(stop->jerk_per_cycle3_q32, n_q16, 16), n_q16, 16), n_q16, 16);
    const int64_t one_q16 = self->lead_q32 == 0 ? Q16_ONE : COARSE_LED * Q16_ONE;
    const int64_t by_acc_q16 = fx_mul_div(quantum_q32, COARSE_ACC * one_q16, acc_q32);
    const int64_t by_jerk_q16 = fx_mul_div(quantum_q32, COARSE_JERK * one_q16, jerk_q32);
    int64_t m = 1;
    while (m <= STREAM_WINDOW_MAX && (m * m * Q16_ONE < by_acc_q16 || m * m * m * Q16_ONE < by_jerk_q16)) {
        m++;
    }
    return m <= STREAM_WINDOW_MAX ? (int32_t)m : 1; /* half a mean is worse than none */
}

int32_t stream_control_window(const stream_curve_t *self)
{
    int32_t window = 1;
    for (unsigned axis = 0; axis < self->axes; axis++) {
        const int32_t of_axis = window_of_axis(self, axis);
        window = of_axis > window ? of_axis : window;
    }
    return window;
}

static int32_t pairs(int32_t n)
{
    return n > 1 ? n * (n - 1) / 2 : 0;
}

void stream_control_set_window(stream_curve_t *self, int32_t window)
{
    self->window = window;
    for (int32_t k = 0; k < 3 * window - 2; k++) { /* ways to write k as a sum of three numbers below the window */
        self->weight[k] = (uint8_t)(pairs(k + 2) - 3 * pairs(k + 2 - window) + 3 * pairs(k + 2 - 2 * window));
    }
}

/* The share of the lead that such a period has. */
static q32_t led_share(uint32_t period_us)
{
    const uint32_t over_us = period_us > LED_NONE_US ? period_us - LED_NONE_US : 0;
    return fx_clamp(Q32_ONE * (int64_t)over_us / (LED_FULL_US - LED_NONE_US), 0, Q32_ONE);
}

void stream_control_lead(stream_curve_t *self, q32_t arrived_q32, bool is_lossy, uint32_t period_us)
{
    const q32_t wished_q32 = is_lossy ? 0 : fx_mul_shift(Q32_ONE - arrived_q32, led_share(period_us), 32);
    self->mean_q32 = arrived_q32;
    self->led_q32 = fx_clamp(wished_q32, self->led_q32 - LED_CHANGE_Q32, self->led_q32 + LED_CHANGE_Q32);
}

void stream_control_set_mean(stream_curve_t *self, uint32_t period_us)
{
    const uint32_t now_us = self->mean_points > 0 ? (self->mean_points - 1) * period_us : 0;
    const uint32_t off_us = now_us > MEAN_US ? now_us - MEAN_US : MEAN_US - now_us;
    if (self->mean_points == 0 || off_us * 4 > period_us * 3) {
        self->mean_points = 1 + (uint32_t)fx_clamp((MEAN_US + period_us / 2) / period_us, 1, MEAN_MAX - 1);
    }
}
