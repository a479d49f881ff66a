/* SPDX-License-Identifier: MIT
 * excitation.c - test signals; see heave/excitation.h.
 * The derivatives of a sine are its amplitude times powers of its frequency. Ramping adds to them: the shares below leave room
 * for what a ramp of two periods adds.
 */
#include "heave/excitation.h"

#define TWO_PI_Q60 7244019458077122842
#define LN2_Q62    3196577161300663915
#define MHZ_US     1000000000u /* 1 in 1/1000 Hz times us */
#define SUBSTEPS   256         /* of the growth from one sine of noise to the next */
#define NOISE_SEED 2463534242u

/* --- Frequencies --- */

static int64_t turn_of(uint32_t mhz, uint32_t cycle_us)
{
    return 4 * fx_mul_div((int64_t)mhz * cycle_us, Q62_ONE, MHZ_US);
}

static int64_t cycles_of(uint32_t duration_ms, uint32_t cycle_us)
{
    return (int64_t)duration_ms * 1000 / cycle_us;
}

static int64_t period_of(int64_t turn_q64)
{
    return fx_mul_div(Q62_ONE, 4, turn_q64);
}

/* log2 of a / b, by squaring what is left above a power of two. */
static int64_t log2_q32(uint32_t a, uint32_t b)
{
    uint64_t x_q31 = ((uint64_t)a << 31) / b;
    int64_t result_q32 = 0;
    while (x_q31 >= (uint64_t)1 << 32) {
        x_q31 >>= 1;
        result_q32 += Q32_ONE;
    }
    for (int64_t bit_q32 = Q32_ONE / 2; bit_q32 > 0; bit_q32 /= 2) {
        x_q31 = x_q31 * x_q31 >> 31;
        if (x_q31 >= (uint64_t)1 << 32) {
            x_q31 >>= 1;
            result_q32 += bit_q32;
        }
    }
    return result_q32;
}

/* By how much a frequency grows in each of so many steps from one to the other: the logarithm, for they are many. */
static int64_t growth_q62(uint32_t from_mhz, uint32_t to_mhz, int64_t steps)
{
    return fx_mul_div(log2_q32(to_mhz, from_mhz), LN2_Q62, steps * Q32_ONE);
}

static int64_t grow(int64_t turn_q64, int64_t growth)
{
    return turn_q64 + fx_mul_shift(turn_q64, growth, 62);
}

/* --- Amplitudes --- */

/* How far a sine of the whole amplitude is beyond a limit: 1 takes all that is allowed. */
static int64_t beyond_q40(int64_t power_q60, int64_t allowed_q62)
{
    return fx_clamp(fx_mul_div(power_q60, (int64_t)1 << 42, allowed_q62), 0, (int64_t)1 << 60);
}

/* The share of the amplitude that a sine may have: 1 / sqrt(1 + (w / vel)^2 + (w^2 / acc)^2 + (w^3 / jerk)^2). It is smooth, for
 * a chirp's sake, and below what each of them allows. */
static q62_t reach(const path_limits_t *limits, int64_t turn_q64)
{
    const int64_t w_q60 = fx_mul_shift(turn_q64, TWO_PI_Q60, 64);
    const int64_t w2_q60 = fx_mul_shift(w_q60, w_q60, 60);
    const int64_t w3_q60 = fx_mul_shift(w2_q60, w_q60, 60);
    const int64_t beyond[3] = {beyond_q40(w_q60, limits->vel_q62 / 6 * 5), beyond_q40(w2_q60, limits->acc_q62 / 7 * 5),
                               beyond_q40(w3_q60, limits->jerk_q62 / 17 * 10)};
    const int64_t all[3] = {(int64_t)1 << 40, (int64_t)fx_sqrt_u128(fx_square3(beyond)), 0};
    return fx_mul_div(Q62_ONE, (int64_t)1 << 40, (int64_t)fx_sqrt_u128(fx_square3(all)));
}

/* From 0 to 1, with no speed and no acceleration at both ends: 10 u^3 - 15 u^4 + 6 u^5. */
static q62_t ramp(int64_t at, int64_t of)
{
    const q62_t u_q62 = fx_mul_div(at, Q62_ONE, of);
    const q62_t u2_q62 = fx_mul_shift(u_q62, u_q62, 62);
    const q62_t u3_q62 = fx_mul_shift(u2_q62, u_q62, 62);
    const int64_t rest_q58 = 10 * ((int64_t)1 << 58) - 15 * (u_q62 / 16) + 6 * (u2_q62 / 16);
    return fx_mul_shift(u3_q62, rest_q58, 58);
}

static q62_t window(const excitation_t *self)
{
    const int64_t left = self->cycles - self->elapsed;
    return self->elapsed < self->ramp_in ? ramp(self->elapsed, self->ramp_in)
           : left < self->ramp_out       ? ramp(left, self->ramp_out)
                                         : Q62_ONE;
}

static q62_t sine(uint64_t phase_q64)
{
    q62_t sin_q62;
    q62_t cos_q62;
    fx_sincos_deg(fx_mul_shift((int64_t)(phase_q64 >> 1), 360, 31), &sin_q62, &cos_q62);
    return sin_q62;
}

/* --- Begin --- */

static bool has_band(excitation_kind_t kind)
{
    return kind == EXCITATION_CHIRP || kind == EXCITATION_NOISE;
}

static bool is_frequency(uint32_t mhz, uint32_t cycle_us)
{
    return mhz >= EXCITATION_LEAST_MHZ && mhz <= EXCITATION_MOST_MHZ && (uint64_t)mhz * cycle_us * 8u <= MHZ_US;
}

static int64_t ramp_cycles(int64_t turn_q64, uint32_t cycle_us)
{
    const int64_t periods = EXCITATION_RAMP_PERIODS * period_of(turn_q64);
    const int64_t least = cycles_of(EXCITATION_RAMP_MS, cycle_us);
    return periods > least ? periods : least;
}

/* Cycles between the ramps of a chirp. */
static int64_t sweep_cycles(const excitation_request_t *request, uint32_t cycle_us)
{
    return cycles_of(request->duration_ms, cycle_us) - ramp_cycles(turn_of(request->from_mhz, cycle_us), cycle_us) -
           ramp_cycles(turn_of(request->to_mhz, cycle_us), cycle_us);
}

/* The growth itself is ramped in and out, over an eighth of the sweep each: growing() adds up to the rest. */
static int64_t sweep_growth_q62(const excitation_request_t *request, uint32_t cycle_us)
{
    const int64_t sweep = sweep_cycles(request, cycle_us);
    return growth_q62(request->from_mhz, request->to_mhz, sweep - (sweep + 7) / 8);
}

/* Where it grew faster, what it grows by would count beside what it swings by. Six periods of the lowest frequency, of eight
 * cycles each at least, leave two of them between the ramps. */
static bool is_slow_enough(const excitation_request_t *request, uint32_t cycle_us)
{
    const int64_t w_q60 = fx_mul_shift(turn_of(request->from_mhz, cycle_us), TWO_PI_Q60, 64);
    return sweep_growth_q62(request, cycle_us) / 4 <= w_q60 / 10;
}

bool excitation_is_allowed(const excitation_request_t *request, uint32_t cycle_us)
{
    const uint64_t periods = request->kind == EXCITATION_STEP ? 4u : 6u;
    return request->kind < EXCITATION_KINDS && request->amplitude_q16 > 0 && is_frequency(request->from_mhz, cycle_us) &&
           (has_band(request->kind) ? is_frequency(request->to_mhz, cycle_us) && request->to_mhz > request->from_mhz
                                    : request->to_mhz == 0) &&
           request->duration_ms >= EXCITATION_LEAST_MS && request->duration_ms <= EXCITATION_MOST_MS &&
           (uint64_t)request->duration_ms * request->from_mhz >= periods * 1000000u &&
           (request->kind != EXCITATION_CHIRP || is_slow_enough(request, cycle_us));
}

HV_WRAPS static void begin_noise(excitation_t *self, const excitation_request_t *request)
{
    const int64_t growth = growth_q62(request->from_mhz, request->to_mhz, (EXCITATION_SINES - 1) * (int64_t)SUBSTEPS);
    uint32_t random = NOISE_SEED;
    for (unsigned i = 0; i < EXCITATION_SINES; i++) {
        if (i > 0) {
            self->turn_q64[i] = self->turn_q64[i - 1];
            for (unsigned k = 0; k < SUBSTEPS; k++) {
                self->turn_q64[i] = grow(self->turn_q64[i], growth);
            }
        }
        random ^= random << 13;
        random ^= random >> 17;
        random ^= random << 5;
        self->offset_q64[i] = (uint64_t)random << 32;
        self->share_q62[i] = reach(&self->limits, self->turn_q64[i]) / (int64_t)EXCITATION_SINES;
    }
}

static bool begin_steps(excitation_t *self)
{
    scurve_t way;
    scurve_plan(&way, &self->limits, 1);
    self->half = period_of(self->turn_q64[0]) / 2;
    if (scurve_cycles(&way) > self->half) {
        self->half = scurve_cycles(&way);
    }
    return 2 * self->half <= self->cycles;
}

hv_status_t excitation_init(excitation_t *self, const excitation_request_t *request, const path_limits_t *limits,
                            uint32_t cycle_us)
{
    *self = (excitation_t){.kind = request->kind, .limits = *limits};
    if (!excitation_is_allowed(request, cycle_us) || limits->vel_q62 <= 0 || limits->acc_q62 <= 0 || limits->jerk_q62 <= 0) {
        return HV_ERR_RANGE;
    }
    self->cycles = cycles_of(request->duration_ms, cycle_us);
    self->turn_q64[0] = turn_of(request->from_mhz, cycle_us);
    self->ramp_in = ramp_cycles(self->turn_q64[0], cycle_us);
    self->ramp_out = self->ramp_in;
    if (request->kind == EXCITATION_STEP) {
        return begin_steps(self) ? HV_OK : HV_ERR_RANGE;
    }
    self->share_q62[0] = reach(limits, self->turn_q64[0]);
    if (request->kind == EXCITATION_NOISE) {
        begin_noise(self, request);
    } else if (request->kind == EXCITATION_CHIRP) {
        self->ramp_out = ramp_cycles(turn_of(request->to_mhz, cycle_us), cycle_us);
        self->growth_q62 = sweep_growth_q62(request, cycle_us);
    }
    return HV_OK; /* a share is above 0, whatever the limits: beyond_q40() is bounded */
}

/* --- The cycle --- */

HV_WRAPS static q62_t step_sines(const excitation_t *self, unsigned count)
{
    q62_t sum_q62 = 0;
    for (unsigned i = 0; i < count; i++) {
        const uint64_t phase_q64 = (uint64_t)self->turn_q64[i] * (uint64_t)self->elapsed + self->offset_q64[i];
        sum_q62 += fx_mul_shift(sine(phase_q64), self->share_q62[i], 62);
    }
    return sum_q62;
}

/* How fast the frequency grows now, as a share of the most. */
static q62_t growing(const excitation_t *self)
{
    const int64_t sweep = self->cycles - self->ramp_in - self->ramp_out;
    const int64_t at = self->elapsed - self->ramp_in;
    const int64_t nearest = at < sweep - at ? at : sweep - at;
    return nearest <= 0 ? 0 : 8 * nearest < sweep ? ramp(nearest, (sweep + 7) / 8) : Q62_ONE;
}

/* What grows by shares of itself ends below what it would grow to at once: the frequency never exceeds the highest of its band.
 */
HV_WRAPS static q62_t step_chirp(excitation_t *self)
{
    self->phase_q64 += (uint64_t)self->turn_q64[0];
    const q62_t share_q62 = fx_mul_shift(sine(self->phase_q64), reach(&self->limits, self->turn_q64[0]), 62);
    self->turn_q64[0] = grow(self->turn_q64[0], fx_mul_shift(self->growth_q62, growing(self), 62));
    return share_q62;
}

/* Out where there is time to come back, too, as there is in the first cycle: begin_steps(). */
static q62_t step_steps(excitation_t *self)
{
    if ((self->elapsed - 1) % self->half == 0) {
        const bool is_next_out = !self->is_out && self->elapsed - 1 + 2 * self->half <= self->cycles;
        if (is_next_out || self->is_out) {
            scurve_plan(&self->way, &self->limits, 1);
        }
        self->is_out = is_next_out;
    }
    scurve_step(&self->way);
    return self->is_out ? scurve_between(&self->way, 0, Q62_ONE) : scurve_between(&self->way, Q62_ONE, 0);
}

q62_t excitation_step(excitation_t *self)
{
    if (self->elapsed >= self->cycles) {
        return 0;
    }
    self->elapsed++;
    switch (self->kind) {
    case EXCITATION_STEP:
        return step_steps(self);
    case EXCITATION_CHIRP:
        return fx_mul_shift(step_chirp(self), window(self), 62);
    case EXCITATION_NOISE:
        return fx_mul_shift(step_sines(self, EXCITATION_SINES), window(self), 62);
    case EXCITATION_SINE:
    case EXCITATION_KINDS:
        break;
    }
    return fx_mul_shift(step_sines(self, 1), window(self), 62);
}
