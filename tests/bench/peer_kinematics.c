/* SPDX-License-Identifier: MIT
 * peer_kinematics.c - a hexapod in double precision as a textbook has it: R = Rz(yaw) Ry(pitch) Rx(roll), the leg is
 * (0, 0, height) + m + (x, y, z) + R (P - m) - B.
 */
#include "peers.h"

#include <math.h>

#define DEG            (3.14159265358979323846 / 180)
#define STEPS_MAX      20
#define LAST_STEP_MM   0.0005
#define SINGULAR_LEAST 1e-9

typedef struct {
    double r[3][3];
    double sin_yaw, cos_yaw;
    double centre[3]; /* of the motion reference point, base frame */
} placed_t;

static void place(const peer_hexapod_t *h, const double pose[6], placed_t *at)
{
    const double roll = pose[0] * DEG, pitch = pose[1] * DEG, yaw = pose[2] * DEG;
    const double sr = sin(roll), cr = cos(roll), sp = sin(pitch), cp = cos(pitch), sy = sin(yaw), cy = cos(yaw);
    at->r[0][0] = cy * cp;
    at->r[0][1] = cy * sp * sr - sy * cr;
    at->r[0][2] = cy * sp * cr + sy * sr;
    at->r[1][0] = sy * cp;
    at->r[1][1] = sy * sp * sr + cy * cr;
    at->r[1][2] = sy * sp * cr - cy * sr;
    at->r[2][0] = -sp;
    at->r[2][1] = cp * sr;
    at->r[2][2] = cp * cr;
    at->sin_yaw = sy;
    at->cos_yaw = cy;
    for (unsigned i = 0; i < 3; i++) {
        at->centre[i] = h->mrp[i] + pose[3 + i] + (i == 2 ? h->zero_height : 0);
    }
}

/* Turned arm and leg of one cylinder; returns the leg's length. */
static double leg_of(const peer_hexapod_t *h, const placed_t *at, unsigned cylinder, double arm[3], double leg[3])
{
    const double p[3] = {h->plate[cylinder][0] - h->mrp[0], h->plate[cylinder][1] - h->mrp[1], h->plate[cylinder][2] - h->mrp[2]};
    for (unsigned i = 0; i < 3; i++) {
        arm[i] = at->r[i][0] * p[0] + at->r[i][1] * p[1] + at->r[i][2] * p[2];
        leg[i] = at->centre[i] + arm[i] - h->base[cylinder][i];
    }
    return sqrt(leg[0] * leg[0] + leg[1] * leg[1] + leg[2] * leg[2]);
}

void peer_inverse(const peer_hexapod_t *hexapod, const double pose[6], double extension[6])
{
    placed_t at;
    place(hexapod, pose, &at);
    for (unsigned i = 0; i < 6; i++) {
        double arm[3], leg[3];
        extension[i] = leg_of(hexapod, &at, i, arm, leg) - hexapod->retracted[i];
    }
}

/* Rates of a leg's length with each axis, angles in degrees. */
static void set_row(const placed_t *at, const double arm[3], const double leg[3], double length, double row[6])
{
    const double u[3] = {leg[0] / length, leg[1] / length, leg[2] / length};
    const double moment[3] = {arm[1] * u[2] - arm[2] * u[1], arm[2] * u[0] - arm[0] * u[2], arm[0] * u[1] - arm[1] * u[0]};
    row[0] = (at->r[0][0] * moment[0] + at->r[1][0] * moment[1] + at->r[2][0] * moment[2]) * DEG;
    row[1] = (-at->sin_yaw * moment[0] + at->cos_yaw * moment[1]) * DEG;
    row[2] = moment[2] * DEG;
    row[3] = u[0];
    row[4] = u[1];
    row[5] = u[2];
}

static bool solve(double matrix[6][6], double rhs[6])
{
    for (unsigned column = 0; column < 6; column++) {
        unsigned pivot = column;
        for (unsigned row = column + 1; row < 6; row++) {
            pivot = fabs(matrix[row][column]) > fabs(matrix[pivot][column]) ? row : pivot;
        }
        if (fabs(matrix[pivot][column]) < SINGULAR_LEAST) {
            return false;
        }
        for (unsigned i = 0; i < 6 && pivot != column; i++) {
            const double element = matrix[column][i];
            matrix[column][i] = matrix[pivot][i];
            matrix[pivot][i] = element;
        }
        const double value = rhs[column];
        rhs[column] = rhs[pivot];
        rhs[pivot] = value;
        for (unsigned row = column + 1; row < 6; row++) {
            const double factor = matrix[row][column] / matrix[column][column];
            for (unsigned i = column + 1; i < 6; i++) {
                matrix[row][i] -= factor * matrix[column][i];
            }
            rhs[row] -= factor * rhs[column];
        }
    }
    for (unsigned row = 6; row-- > 0;) {
        for (unsigned i = row + 1; i < 6; i++) {
            rhs[row] -= matrix[row][i] * rhs[i];
        }
        rhs[row] /= matrix[row][row];
    }
    return true;
}

bool peer_forward(const peer_hexapod_t *hexapod, const double extension[6], const double guess[6], double pose[6])
{
    for (unsigned i = 0; i < 6; i++) {
        pose[i] = guess[i];
    }
    for (unsigned step = 0; step < STEPS_MAX; step++) {
        placed_t at;
        double matrix[6][6], error[6], largest = 0;
        place(hexapod, pose, &at);
        for (unsigned i = 0; i < 6; i++) {
            double arm[3], leg[3];
            const double length = leg_of(hexapod, &at, i, arm, leg);
            error[i] = extension[i] + hexapod->retracted[i] - length;
            largest = fabs(error[i]) > largest ? fabs(error[i]) : largest;
            set_row(&at, arm, leg, length, matrix[i]);
        }
        if (!solve(matrix, error)) {
            return false;
        }
        for (unsigned i = 0; i < 6; i++) {
            pose[i] += error[i];
        }
        if (largest < LAST_STEP_MM) {
            return true;
        }
    }
    return false;
}
