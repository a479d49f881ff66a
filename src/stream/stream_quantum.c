/* SPDX-License-Identifier: MIT
 * stream_quantum.c - what the values of a sender are multiples of.
 * The quantum is the greatest common divisor of all steps since the watch began. An even ramp has one too, and a jump: values
 * count as coarse only where the step itself changes up and down in turn, as it does where a motion is rounded.
 */
#include "stream_quantum.h"

enum {
    WATCH = STREAM_QUANTUM_WATCH,
    TURNS = STREAM_QUANTUM_TURNS,
    SIGNIFICANT = 4 /* quanta in a step that is not the rounding of a slow motion */
};

#define NOTHING_Q32 (Q32_ONE / 1024) /* values are rounded to 2^-16, and maybe scaled: what is less says nothing */
#define FINEST_Q32  (Q32_ONE / 256)  /* finer quanta cannot be told */

/* By Euclid; to the nearest multiple, so that the remainder halves in every step: 28 for the longest. 0 = nothing yet. */
static q32_t common_divisor(q32_t a_q32, q32_t b_q32)
{
    while (b_q32 > NOTHING_Q32) {
        const q32_t over_q32 = a_q32 % b_q32;
        a_q32 = b_q32;
        b_q32 = over_q32 < b_q32 - over_q32 ? over_q32 : b_q32 - over_q32;
    }
    return a_q32;
}

/* A change of the step. */
static void watch_turn(stream_quantum_t *quantum, q32_t change_q32)
{
    const bool is_up = change_q32 > 0;
    if (fx_abs(change_q32) > NOTHING_Q32) {
        if (is_up != quantum->is_up && quantum->turns < TURNS) {
            quantum->turns++;
        }
        quantum->is_up = is_up;
    }
}

static void watch_step(stream_quantum_t *quantum, int32_t periods, q32_t step_q32)
{
    if (quantum->found_q32 == 0 || quantum->found_q32 >= FINEST_Q32) {
        quantum->found_q32 = common_divisor(quantum->found_q32, fx_abs(step_q32));
    }
    const q32_t of_period_q32 = periods > 1 ? step_q32 / periods : step_q32;
    watch_turn(quantum, of_period_q32 - quantum->step_q32);
    quantum->step_q32 = of_period_q32;
}

/* A finer step than the quantum refutes it at once; a coarser quantum has to last for a whole watch. */
static void judge(stream_quantum_t *quantum, bool is_over)
{
    const bool is_coarse = quantum->turns == TURNS;
    const bool is_finer = quantum->found_q32 > 0 && quantum->found_q32 < quantum->quantum_q32;
    if ((is_coarse && (is_over || quantum->quantum_q32 == 0)) || is_finer) {
        quantum->quantum_q32 = quantum->found_q32 < FINEST_Q32 ? 0 : quantum->found_q32;
    }
    if (is_over) {
        quantum->found_q32 = 0;
        quantum->turns = 0;
    }
}

void stream_quantum_watch(stream_curve_t *self, unsigned periods, const q32_t *sample_q32)
{
    self->watched = self->watched < WATCH ? self->watched + 1 : 0;
    for (unsigned axis = 0; axis < self->axes; axis++) {
        watch_step(&self->quantum[axis], (int32_t)periods, sample_q32[axis] - self->newest_q32[axis]);
        judge(&self->quantum[axis], self->watched == WATCH);
    }
}

bool stream_quantum_is_significant(const stream_curve_t *self, const q32_t *from_q32, const q32_t *to_q32)
{
    bool is_far = false;
    for (unsigned axis = 0; axis < self->axes; axis++) {
        const q32_t step_q32 = fx_abs(to_q32[axis] - from_q32[axis]);
        is_far |= self->quantum[axis].found_q32 > 0 && step_q32 >= SIGNIFICANT * self->quantum[axis].found_q32;
    }
    return is_far;
}
