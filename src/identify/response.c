/* SPDX-License-Identifier: MIT
 * response.c - see response.h.
 */
#include "identify/response.h"

#include <math.h>
#include <string.h>

#define PI          3.14159265358979323846
#define LOW_POINTS  (RESPONSE_POINTS / 3u)
#define NEIGHBOURS  2    /* on either side of a frequency */
#define LOW_SHARE   0.3  /* of the record: where a chirp is slow */
#define FAST_SHARE  0.5  /* of the highest speed there: backlash is passed by then */
#define UNKNOWNS    5u   /* offset, lag, acceleration, jerk, hysteresis */
#define LEAST_MOVED 1e-6 /* mm, deg */

typedef struct {
    double re, im;
} complex_t;

/* --- In the frequency domain --- */

/* Transforms of both at one frequency, about where they began. */
static void transform(const double *sent, const double *actual, size_t count, double radians, complex_t *x, complex_t *y)
{
    const double step_re = cos(radians), step_im = -sin(radians);
    double re = 1, im = 0;
    *x = *y = (complex_t){0, 0};
    for (size_t n = 0; n < count; n++) {
        const double a = sent[n] - sent[0], b = actual[n] - actual[0];
        x->re += a * re;
        x->im += a * im;
        y->re += b * re;
        y->im += b * im;
        const double turned = re * step_re - im * step_im;
        im = re * step_im + im * step_re;
        re = turned;
    }
}

static response_point_t point_at(const double *sent, const double *actual, size_t count, double cycle_s, double hz)
{
    const double apart_hz = 1.0 / ((double)count * cycle_s);
    complex_t cross = {0, 0}, x, y;
    double of_sent = 0, of_actual = 0;
    for (int k = -NEIGHBOURS; k <= NEIGHBOURS; k++) {
        transform(sent, actual, count, 2 * PI * fmax(hz + k * apart_hz, 0.5 * apart_hz) * cycle_s, &x, &y);
        cross.re += y.re * x.re + y.im * x.im;
        cross.im += y.im * x.re - y.re * x.im;
        of_sent += x.re * x.re + x.im * x.im;
        of_actual += y.re * y.re + y.im * y.im;
    }
    const double square = cross.re * cross.re + cross.im * cross.im;
    return (response_point_t){.hz = hz,
                              .gain = sqrt(square) / of_sent,
                              .phase_deg = atan2(cross.im, cross.re) * 180 / PI,
                              .coherence = square / (of_sent * of_actual)};
}

static void unwrap(response_t *self)
{
    for (unsigned i = 1; i < RESPONSE_POINTS; i++) {
        const double apart_deg = self->point[i].phase_deg - self->point[i - 1].phase_deg;
        self->point[i].phase_deg -= 360 * round(apart_deg / 360);
    }
}

/* Where a value falls below a bound first, between two points by the logarithm of the frequency. */
static double falls_hz(const response_t *self, bool is_gain, double bound)
{
    for (unsigned i = 1; i < RESPONSE_POINTS; i++) {
        const response_point_t *a = &self->point[i - 1], *b = &self->point[i];
        const double before = is_gain ? a->gain : a->phase_deg, after = is_gain ? b->gain : b->phase_deg;
        if (before >= bound && after < bound) {
            return a->hz * pow(b->hz / a->hz, (before - bound) / (before - after));
        }
    }
    return 0;
}

/* What a value of the lowest third comes to at no frequency at all: both lag and gain fall with its square at first.
 * @param values with their weights */
static double at_zero_hz(const response_t *self, const double *value, const double *weight)
{
    double sum = 0, of_x = 0, of_y = 0, of_xx = 0, of_xy = 0;
    for (unsigned i = 0; i < LOW_POINTS; i++) {
        const double x = self->point[i].hz * self->point[i].hz;
        sum += weight[i];
        of_x += weight[i] * x;
        of_y += weight[i] * value[i];
        of_xx += weight[i] * x * x;
        of_xy += weight[i] * x * value[i];
    }
    return (of_y * of_xx - of_x * of_xy) / (sum * of_xx - of_x * of_x);
}

static void find_lag(response_t *self)
{
    double lag[LOW_POINTS], gain[LOW_POINTS], of_lag[LOW_POINTS], of_gain[LOW_POINTS];
    for (unsigned i = 0; i < LOW_POINTS; i++) {
        const response_point_t *at = &self->point[i];
        lag[i] = -at->phase_deg / 360 / at->hz * 1000;
        gain[i] = at->gain;
        of_gain[i] = at->coherence;
        of_lag[i] = at->coherence * at->hz * at->hz; /* the same error of phase is a smaller one of time */
    }
    self->lag_ms = at_zero_hz(self, lag, of_lag);
    self->gain = at_zero_hz(self, gain, of_gain);
}

/* --- In time --- */

/* Solves A x = b in place; false: there is no single answer. */
static bool solve(double a[UNKNOWNS][UNKNOWNS], double b[UNKNOWNS])
{
    for (unsigned i = 0; i < UNKNOWNS; i++) {
        unsigned best = i;
        for (unsigned k = i + 1; k < UNKNOWNS; k++) {
            best = fabs(a[k][i]) > fabs(a[best][i]) ? k : best;
        }
        if (fabs(a[best][i]) < 1e-12) {
            return false;
        }
        for (unsigned k = 0; k < UNKNOWNS && best != i; k++) {
            const double other = a[i][k];
            a[i][k] = a[best][k];
            a[best][k] = other;
        }
        const double other = b[i];
        b[i] = b[best];
        b[best] = other;
        for (unsigned k = 0; k < UNKNOWNS; k++) {
            const double share = k == i ? 0 : a[k][i] / a[i][i];
            for (unsigned m = i; m < UNKNOWNS && k != i; m++) {
                a[k][m] -= share * a[i][m];
            }
            b[k] -= share * b[i];
        }
    }
    for (unsigned i = 0; i < UNKNOWNS; i++) {
        b[i] /= a[i][i];
    }
    return true;
}

static double acceleration(const double *sent, size_t n)
{
    return sent[n + 1] - 2 * sent[n] + sent[n - 1];
}

static double jerk(const double *sent, size_t n)
{
    return sent[n + 2] - 2 * sent[n + 1] + 2 * sent[n - 1] - sent[n - 2];
}

/* Following error = offset + lag * speed + c * acceleration + d * jerk + half the hysteresis * direction, in the slow part of the
 * record, where it moves fast enough that backlash has been passed. All in shares of their largest, so that the equations are
 * solved well. */
static void find_hysteresis(response_t *self, const double *sent, const double *actual, size_t count)
{
    const size_t slow = (size_t)(LOW_SHARE * (double)count);
    double fastest = 0, hardest = 0, sharpest = 0;
    double a[UNKNOWNS][UNKNOWNS] = {{0}}, b[UNKNOWNS] = {0};
    for (size_t n = 2; n + 2 < slow; n++) {
        fastest = fmax(fastest, fabs(sent[n + 1] - sent[n - 1]));
        hardest = fmax(hardest, fabs(acceleration(sent, n)));
        sharpest = fmax(sharpest, fabs(jerk(sent, n)));
    }
    for (size_t n = 2; n + 2 < slow; n++) {
        const double speed = (sent[n + 1] - sent[n - 1]) / fastest;
        const double row[UNKNOWNS] = {1, speed, acceleration(sent, n) / hardest, jerk(sent, n) / sharpest, speed > 0 ? 1 : -1};
        for (unsigned i = 0; i < UNKNOWNS && fabs(speed) > FAST_SHARE; i++) {
            b[i] += row[i] * (sent[n] - actual[n]);
            for (unsigned k = 0; k < UNKNOWNS; k++) {
                a[i][k] += row[i] * row[k];
            }
        }
    }
    self->hysteresis = fastest > 0 && hardest > 0 && sharpest > 0 && solve(a, b) ? fmax(2 * b[4], 0) : 0;
}

static void find_following(response_t *self, const double *sent, const double *actual, size_t count)
{
    double squares = 0;
    for (size_t n = 0; n < count; n++) {
        const double error = (sent[n] - sent[0]) - (actual[n] - actual[0]);
        self->following_most = fmax(self->following_most, fabs(error));
        squares += error * error;
    }
    self->following_rms = sqrt(squares / (double)count);
}

static bool is_moved(const double *value, size_t count)
{
    double most = 0;
    for (size_t n = 0; n < count; n++) {
        most = fmax(most, fabs(value[n] - value[0]));
    }
    return most > LEAST_MOVED;
}

void response_find(response_t *self, const double *sent, const double *actual, size_t count, double cycle_s, double from_hz,
                   double to_hz)
{
    memset(self, 0, sizeof *self);
    self->is_moved = count > RESPONSE_POINTS && is_moved(sent, count) && is_moved(actual, count);
    if (!self->is_moved) {
        return;
    }
    for (unsigned i = 0; i < RESPONSE_POINTS; i++) {
        const double hz = from_hz * pow(to_hz / from_hz, (double)i / (double)(RESPONSE_POINTS - 1u));
        self->point[i] = point_at(sent, actual, count, cycle_s, hz);
    }
    unwrap(self);
    find_lag(self);
    self->gain_3db_hz = falls_hz(self, true, sqrt(0.5));
    self->phase_90_hz = falls_hz(self, false, -90);
    find_following(self, sent, actual, count);
    find_hysteresis(self, sent, actual, count);
}
