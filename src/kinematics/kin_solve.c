/* SPDX-License-Identifier: MIT
 * kin_solve.c - a small linear system in fixed point: Gaussian elimination with partial pivoting.
 * Pivoting keeps every factor within +-1, so elements at most double per column: from 2 to 2^6 for six unknowns, from 2^3 to
 * 2^5 for three. The product of an element and a factor, both Q28, then stays below 2^63.
 */
#include "kin_internal.h"

/* Pivots below 2^-14 mean motion that the cylinders do not hold; solutions beyond 2^15 mm mean the same. */
#define PIVOT_MIN_Q28    (INT64_C(1) << 14)
#define SOLUTION_MAX_Q32 (INT64_C(1) << 47)

/* The row, from the diagonal down, with the largest element of a column. */
static unsigned find_pivot(unsigned size, unsigned column, int64_t matrix[][POSE_AXES])
{
    unsigned best = column;
    int64_t largest = fx_abs(matrix[column][column]);
    for (unsigned row = column + 1; row < size; row++) {
        const int64_t magnitude = fx_abs(matrix[row][column]);
        best = magnitude > largest ? row : best;
        largest = magnitude > largest ? magnitude : largest;
    }
    return best;
}

static void swap_rows(unsigned size, unsigned a, unsigned b, int64_t matrix[][POSE_AXES], q32_t rhs[])
{
    for (unsigned i = 0; i < size; i++) {
        const int64_t element = matrix[a][i];
        matrix[a][i] = matrix[b][i];
        matrix[b][i] = element;
    }
    const q32_t value = rhs[a];
    rhs[a] = rhs[b];
    rhs[b] = value;
}

/* Clears a column below the diagonal. */
static void eliminate(unsigned size, unsigned column, int64_t inverse_q28, int64_t matrix[][POSE_AXES], q32_t rhs[])
{
    for (unsigned row = column + 1; row < size; row++) {
        const int64_t factor_q28 = fx_shift_down(matrix[row][column] * inverse_q28, 28);
        for (unsigned i = column + 1; i < size; i++) {
            matrix[row][i] -= fx_shift_down(factor_q28 * matrix[column][i], 28);
        }
        rhs[row] -= fx_mul_shift_fit(factor_q28, rhs[column], 28);
    }
}

/* Finds the unknowns from the last to the first; false if one is out of all proportion. */
static bool substitute_back(unsigned size, const int64_t inverse_q28[], int64_t matrix_q28[][POSE_AXES], q32_t rhs_q32[])
{
    for (unsigned row = size; row > 0;) {
        row--;
        q32_t sum = rhs_q32[row];
        for (unsigned i = row + 1; i < size; i++) {
            sum -= fx_mul_shift_fit(matrix_q28[row][i], rhs_q32[i], 28);
        }
        rhs_q32[row] = fx_mul_shift(sum, inverse_q28[row], 28);
        if (fx_abs(rhs_q32[row]) > SOLUTION_MAX_Q32) {
            return false;
        }
    }
    return true;
}

bool kin_solve(unsigned size, int64_t matrix_q28[][POSE_AXES], q32_t rhs_q32[])
{
    int64_t inverse_q28[POSE_AXES] = {0};
    for (unsigned column = 0; column < size; column++) {
        const unsigned pivot = find_pivot(size, column, matrix_q28);
        if (fx_abs(matrix_q28[pivot][column]) < PIVOT_MIN_Q28) {
            return false;
        }
        if (pivot != column) {
            swap_rows(size, pivot, column, matrix_q28, rhs_q32);
        }
        inverse_q28[column] = (INT64_C(1) << 56) / matrix_q28[column][column];
        eliminate(size, column, inverse_q28[column], matrix_q28, rhs_q32);
    }
    return substitute_back(size, inverse_q28, matrix_q28, rhs_q32);
}
