/* SPDX-License-Identifier: MIT
 * lengths.c - see lengths.h. Levenberg's damping takes care of what distances leave open: place and turn of the whole.
 */
#include "setup/lengths.h"

#include <math.h>
#include <string.h>

#define UNKNOWNS    12u
#define STEPS       60u
#define DAMPING     1e-6
#define AT_REST_MM  1e-7
#define WRONG_MM    6.0 /* a tape is not that wrong: somebody was */
#define WRONG_TIMES 4.0 /* as far off as what is usual in this set */
#define USUAL_MM    0.5
#define NOBODY      LENGTHS_PAIRS
#define DEGREES     (180.0 / 3.14159265358979323846)

void lengths_pair(unsigned pair, unsigned *one, unsigned *other)
{
    *one = 0;
    while (pair >= LENGTHS_JOINTS - 1u - *one) {
        pair -= LENGTHS_JOINTS - 1u - *one;
        ++*one;
    }
    *other = *one + 1u + pair;
}

static double apart(const double joint[LENGTHS_JOINTS][2], unsigned pair)
{
    unsigned a = 0, b = 0;
    lengths_pair(pair, &a, &b);
    return hypot(joint[a][0] - joint[b][0], joint[a][1] - joint[b][1]);
}

/* --- Least squares --- */

/* Solves in place by Gauss; the matrix is positive definite. */
static void solve(double matrix[UNKNOWNS][UNKNOWNS], double right[UNKNOWNS])
{
    for (unsigned k = 0; k < UNKNOWNS; k++) {
        for (unsigned i = k + 1u; i < UNKNOWNS; i++) {
            const double factor = matrix[i][k] / matrix[k][k];
            for (unsigned j = k; j < UNKNOWNS; j++) {
                matrix[i][j] -= factor * matrix[k][j];
            }
            right[i] -= factor * right[k];
        }
    }
    for (unsigned k = UNKNOWNS; k-- > 0;) {
        for (unsigned j = k + 1u; j < UNKNOWNS; j++) {
            right[k] -= matrix[k][j] * right[j];
        }
        right[k] /= matrix[k][k];
    }
}

/* One step; without: a distance that does not count. Returns how far the farthest went. */
static double improve(double joint[LENGTHS_JOINTS][2], const double *distance_mm, unsigned without)
{
    double matrix[UNKNOWNS][UNKNOWNS] = {{0}}, right[UNKNOWNS] = {0};
    for (unsigned pair = 0; pair < LENGTHS_PAIRS; pair++) {
        unsigned a = 0, b = 0;
        lengths_pair(pair, &a, &b);
        const double now_mm = fmax(apart((const double(*)[2])joint, pair), 1e-9);
        const double x = (joint[a][0] - joint[b][0]) / now_mm, y = (joint[a][1] - joint[b][1]) / now_mm;
        const unsigned at[4] = {2u * a, 2u * a + 1u, 2u * b, 2u * b + 1u};
        const double slope[4] = {x, y, -x, -y};
        for (unsigned i = 0; i < 4u && pair != without; i++) {
            for (unsigned j = 0; j < 4u; j++) {
                matrix[at[i]][at[j]] += slope[i] * slope[j];
            }
            right[at[i]] += slope[i] * (distance_mm[pair] - now_mm);
        }
    }
    for (unsigned i = 0; i < UNKNOWNS; i++) {
        matrix[i][i] += DAMPING;
    }
    solve(matrix, right);
    double most_mm = 0;
    for (unsigned i = 0; i < UNKNOWNS; i++) {
        joint[i / 2u][i % 2u] += right[i];
        most_mm = fmax(most_mm, fabs(right[i]));
    }
    return most_mm;
}

/* Sum of squares of what is left. */
static double fit(double joint[LENGTHS_JOINTS][2], const double *distance_mm, unsigned without)
{
    double squares = 0;
    unsigned step = 0;
    while (improve(joint, distance_mm, without) > AT_REST_MM && step < STEPS) {
        step++;
    }
    for (unsigned pair = 0; pair < LENGTHS_PAIRS; pair++) {
        const double off_mm = pair != without ? apart((const double(*)[2])joint, pair) - distance_mm[pair] : 0;
        squares += off_mm * off_mm;
    }
    return squares;
}

/* --- Where to begin --- */

static double distance_of(const double *distance_mm, unsigned a, unsigned b)
{
    unsigned pair = 0, one = 0, other = 0;
    for (; pair < LENGTHS_PAIRS; pair++) {
        lengths_pair(pair, &one, &other);
        if ((one == a && other == b) || (one == b && other == a)) {
            break;
        }
    }
    return distance_mm[pair];
}

/* Joint 1 and 4, far apart, then the others from those two; 2 says on which side they are. */
static void begin(double joint[LENGTHS_JOINTS][2], const double *distance_mm)
{
    static const unsigned k_order[] = {1, 2, 4, 5};
    const double far_mm = distance_of(distance_mm, 0, 3);
    memset(joint, 0, LENGTHS_JOINTS * sizeof joint[0]);
    joint[3][0] = far_mm;
    for (unsigned i = 0; i < 4u; i++) {
        const unsigned k = k_order[i];
        const double to_1 = distance_of(distance_mm, 0, k), to_4 = distance_of(distance_mm, 3, k);
        const double x = (to_1 * to_1 - to_4 * to_4 + far_mm * far_mm) / (2 * far_mm);
        const double y = sqrt(fmax(to_1 * to_1 - x * x, 1.0));
        const double to_2 = distance_of(distance_mm, 1, k == 1 ? 0 : k);
        const double same = fabs(hypot(x - joint[1][0], y - joint[1][1]) - to_2);
        const double opposite = fabs(hypot(x - joint[1][0], -y - joint[1][1]) - to_2);
        joint[k][0] = x;
        joint[k][1] = k == 1 || same <= opposite ? y : -y;
    }
}

/* --- Where they stand in the frame --- */

static void place(double joint[LENGTHS_JOINTS][2], lengths_set_t set)
{
    double middle[2] = {0}, area = 0, sine = 0, cosine = 0;
    for (unsigned i = 0; i < LENGTHS_JOINTS; i++) {
        middle[0] += joint[i][0] / LENGTHS_JOINTS;
        middle[1] += joint[i][1] / LENGTHS_JOINTS;
    }
    for (unsigned i = 0; i < LENGTHS_JOINTS; i++) {
        joint[i][0] -= middle[0];
        joint[i][1] -= middle[1];
    }
    for (unsigned i = 0; i < LENGTHS_JOINTS; i++) {
        const unsigned next = (i + 1u) % LENGTHS_JOINTS;
        area += joint[i][0] * joint[next][1] - joint[next][0] * joint[i][1];
    }
    for (unsigned i = 0; i < LENGTHS_JOINTS; i++) {
        joint[i][1] *= area < 0 ? -1 : 1;
    }
    /* how far the three pairs are turned from 0, 120 and 240 degrees; those of the plate from 60, 180 and 300 */
    for (unsigned pair = 0; pair < 3u; pair++) {
        const unsigned a = set == LENGTHS_BASE ? 2u * pair : 2u * pair + 1u, b = (a + 1u) % LENGTHS_JOINTS;
        const double nominal = ((set == LENGTHS_BASE ? 0 : 60) + 120.0 * pair) / DEGREES;
        const double is = atan2(joint[a][1] + joint[b][1], joint[a][0] + joint[b][0]);
        sine += sin(nominal - is);
        cosine += cos(nominal - is);
    }
    const double turn = atan2(sine, cosine);
    for (unsigned i = 0; i < LENGTHS_JOINTS; i++) {
        const double x = joint[i][0], y = joint[i][1];
        joint[i][0] = x * cos(turn) - y * sin(turn);
        joint[i][1] = x * sin(turn) + y * cos(turn);
    }
}

/* The one without which the rest agrees best. */
static void find_suspect(const double *distance_mm, const double joint[LENGTHS_JOINTS][2], lengths_found_t *out)
{
    double least = INFINITY;
    for (unsigned pair = 0; pair < LENGTHS_PAIRS; pair++) {
        double other[LENGTHS_JOINTS][2];
        memcpy(other, joint, sizeof other);
        const double squares = fit(other, distance_mm, pair);
        const double usual_mm = fmax(sqrt(squares / (LENGTHS_PAIRS - 1u - (UNKNOWNS - 3u))), USUAL_MM);
        const double is_mm = apart((const double(*)[2])other, pair);
        if (squares < least) {
            least = squares;
            out->suspect = pair;
            const double off_mm = fabs(is_mm - distance_mm[pair]);
            out->suspect_mm = off_mm > WRONG_MM && off_mm > WRONG_TIMES * usual_mm ? is_mm : 0;
        }
    }
}

bool lengths_fit(lengths_set_t set, const double distance_mm[LENGTHS_PAIRS], lengths_found_t *out)
{
    begin(out->joint_mm, distance_mm);
    const double squares = fit(out->joint_mm, distance_mm, NOBODY);
    out->off_mm = sqrt(squares / LENGTHS_PAIRS);
    if (!isfinite(squares)) {
        return false;
    }
    find_suspect(distance_mm, (const double(*)[2])out->joint_mm, out);
    place(out->joint_mm, set);
    return true;
}

void lengths_circle(double near_mm, double far_mm, double *radius_mm, double *spread_deg)
{
    *radius_mm = sqrt((near_mm * near_mm + far_mm * far_mm + near_mm * far_mm) / 3);
    *spread_deg = 2 * asin(near_mm / (2 * *radius_mm)) * DEGREES;
}
