/* SPDX-License-Identifier: MIT
 * identify_plan.c - see identify_plan.h.
 */
#include "identify/identify_plan.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "common/translate.h"

#define USUAL_FROM_HZ   0.2
#define USUAL_TO_HZ     20.0
#define USUAL_MM        2.0
#define USUAL_DEG       1.0
#define CYCLES_A_PERIOD 8.0 /* see heave/excitation.h, as the next three */
#define RAMP_PERIODS    2.0
#define RAMP_S          1.0
#define PERIODS_PER_E   1.85 /* of the lowest frequency, for the frequency to rise to e times as much */
#define LEAST_S         20.0
#define MOST_S          600.0 /* heaved takes no more */
#define LEAST_HZ        0.01

bool identify_is_rotation(const char *axis)
{
    return strcmp(axis, "roll") == 0 || strcmp(axis, "pitch") == 0 || strcmp(axis, "yaw") == 0;
}

static double or_usual(double value, double usual)
{
    return value > 0 ? value : usual;
}

/* How long a chirp through the band takes at least. */
static double least_seconds(double from_hz, double to_hz)
{
    return fmax(RAMP_PERIODS / from_hz, RAMP_S) + fmax(RAMP_PERIODS / to_hz, RAMP_S) +
           PERIODS_PER_E * log(to_hz / from_hz) / from_hz;
}

bool identify_plan(identify_report_t *report, double cycle_s, char *why, size_t size)
{
    const double most_hz = floor(1000 / (CYCLES_A_PERIOD * cycle_s) + 1e-6) / 1000; /* heaved counts in mHz */
    report->amplitude = or_usual(report->amplitude, strcmp(report->unit, "mm") == 0 ? USUAL_MM : USUAL_DEG);
    report->from_hz = or_usual(report->from_hz, USUAL_FROM_HZ);
    report->to_hz = or_usual(report->to_hz, most_hz < USUAL_TO_HZ ? most_hz : USUAL_TO_HZ);
    const double least_s = ceil(least_seconds(report->from_hz, report->to_hz));
    report->seconds = or_usual(report->seconds, fmax(least_s, LEAST_S));
    if (report->to_hz > most_hz || report->to_hz <= report->from_hz) {
        (void)snprintf(why, size, N_("%g to %g Hz: allowed with this cycle: up to %g Hz"), report->from_hz, report->to_hz,
                       most_hz);
        return false;
    }
    if (report->from_hz < LEAST_HZ || report->seconds > MOST_S || least_s > MOST_S) {
        (void)snprintf(why, size, N_("%g to %g Hz in %g s: allowed: from %g Hz on, in %g s at most; this band needs %g s"),
                       report->from_hz, report->to_hz, report->seconds, LEAST_HZ, MOST_S, least_s);
        return false;
    }
    if (report->seconds < least_s) {
        (void)snprintf(why, size, N_("%g s is too short for %g to %g Hz: %g s at least, or a --band that begins higher"),
                       report->seconds, report->from_hz, report->to_hz, least_s);
        return false;
    }
    return true;
}

void identify_pose(double *const *sent, double *const *actual, unsigned channels, size_t count)
{
    double weight[IDENTIFY_CHANNELS_MAX] = {0}, squares = 0, of_pose = 0;
    for (size_t n = 0; n < count; n++) {
        const double way = sent[0][n] - sent[0][0];
        of_pose += way * way;
        for (unsigned i = 1; i < channels; i++) {
            weight[i] += way * (sent[i][n] - sent[i][0]);
        }
    }
    for (unsigned i = 1; i < channels; i++) {
        weight[i] = of_pose > 0 ? weight[i] / of_pose : 0;
        squares += weight[i] * weight[i];
    }
    for (size_t n = 0; n < count && squares > 0; n++) {
        double sum = 0;
        for (unsigned i = 1; i < channels; i++) {
            sum += weight[i] * (actual[i][n] - actual[i][0]);
        }
        actual[0][n] = sum / squares;
    }
}
