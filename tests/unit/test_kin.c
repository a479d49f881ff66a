/* SPDX-License-Identifier: MIT
 * test_kin.c - inverse and forward kinematics against 50-digit reference data for five mechanisms and against a floating-point
 * model of the same mechanisms that shares no formula with the code where it can be avoided. Prints the worst errors.
 * Data: tests/data/kin_geo_*.csv (joints), kin_ik_*.csv (poses, lengths to 12 decimals), kin_fk_*.csv (rounded lengths, the exact
 * pose for them; amp_* is the largest row sum of the inverse Jacobian).
 */
#include "heave/kin.h"
#include "unity.h"

#include <inttypes.h>
#include <float.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define COLUMNS_MAX 16
#define Q32_LSB     (1.0L / 4294967296.0L)
#define DEG         (acosl(-1.0L) / 180)

typedef struct {
    const char *name;
    kin_kind_t kind;
} mechanism_t;

static const mechanism_t k_mechanisms[] = {
    {"hex_small", KIN_HEXAPOD}, {"hex_large", KIN_HEXAPOD},   {"hex_asym", KIN_HEXAPOD},
    {"tri_post", KIN_TRIPOD},   {"tri_rps", KIN_TRIPOD_3RPS},
};
#define MECHANISM_COUNT (sizeof k_mechanisms / sizeof k_mechanisms[0])

static uint64_t s_random;
static kin_geometry_t s_geometry;
static kin_t s_kin;

void setUp(void)
{
    s_random = UINT64_C(0x9E3779B97F4A7C15);
    memset(&s_geometry, 0, sizeof s_geometry);
    memset(&s_kin, 0, sizeof s_kin);
}
void tearDown(void) {}

static uint64_t next_random(void)
{
    s_random ^= s_random >> 12;
    s_random ^= s_random << 25;
    s_random ^= s_random >> 27;
    return s_random * UINT64_C(2685821657736338717);
}

/* Q32, evenly from -limit to limit. */
static q32_t random_q32(int limit)
{
    return (q32_t)(next_random() % ((uint64_t)(2 * limit) << 32)) - q32_from_int(limit);
}

static q16_t random_q16(int limit)
{
    return q16_from_q32(random_q32(limit));
}

/* ---- data files ---- */

static FILE *open_data(const char *kind, const char *name)
{
    char path[256], header[512];
    snprintf(path, sizeof path, HEAVE_TEST_DATA "/kin_%s_%s.csv", kind, name);
    FILE *file = fopen(path, "r");
    TEST_ASSERT_NOT_NULL_MESSAGE(file, path);
    TEST_ASSERT_NOT_NULL(fgets(header, sizeof header, file));
    return file;
}

/* Reads one row of numbers; their count, 0 at the end. */
static unsigned read_row(FILE *file, long double value[COLUMNS_MAX])
{
    char line[512];
    if (fgets(line, sizeof line, file) == NULL) {
        return 0;
    }
    unsigned count = 0;
    for (char *text = line; count < COLUMNS_MAX; text++) {
        char *end;
        value[count++] = strtold(text, &end);
        text = end;
        if (*text != ',') {
            break;
        }
    }
    return count;
}

static void take_geometry_row(const char *line, kin_geometry_t *geometry)
{
    char item[16];
    unsigned leg;
    int32_t x, y, z;
    TEST_ASSERT_EQUAL_INT(5, sscanf(line, "%15[^,],%u,%" SCNd32 ",%" SCNd32 ",%" SCNd32, item, &leg, &x, &y, &z));
    if (strcmp(item, "z0") == 0) {
        geometry->zero_height_mm_q16 = z;
        return;
    }
    TEST_ASSERT_TRUE(leg >= 1 && leg <= CYLINDERS_MAX);
    if (strcmp(item, "retracted") == 0) {
        geometry->retracted_mm_q16[leg - 1] = x;
    } else if (strcmp(item, "stroke") != 0) {
        q16_t *point = strcmp(item, "base") == 0 ? geometry->base_mm_q16[leg - 1] : geometry->plate_mm_q16[leg - 1];
        point[0] = x;
        point[1] = y;
        point[2] = z;
    }
}

static void load_mechanism(const mechanism_t *mechanism)
{
    char line[128];
    FILE *file = open_data("geo", mechanism->name);
    memset(&s_geometry, 0, sizeof s_geometry);
    s_geometry.kind = mechanism->kind;
    while (fgets(line, sizeof line, file) != NULL) {
        take_geometry_row(line, &s_geometry);
    }
    fclose(file);
    TEST_ASSERT_EQUAL_INT(HV_OK, kin_init(&s_kin, &s_geometry));
}

/* A pose from the columns of a row: six axes, or roll, pitch and z; factor takes them to Q32. */
static pose_t pose_of(const long double *column, long double factor)
{
    pose_t pose = {{0}};
    if (s_kin.kind == KIN_HEXAPOD) {
        for (unsigned axis = 0; axis < POSE_AXES; axis++) {
            pose.axis_q32[axis] = llrintl(column[axis] * factor);
        }
    } else {
        pose.axis_q32[AXIS_ROLL] = llrintl(column[0] * factor);
        pose.axis_q32[AXIS_PITCH] = llrintl(column[1] * factor);
        pose.axis_q32[AXIS_Z] = llrintl(column[2] * factor);
    }
    return pose;
}

static unsigned pose_columns(void)
{
    return s_kin.kind == KIN_HEXAPOD ? 6 : 3;
}

/* ---- floating-point model ---- */

typedef struct {
    long double v[3];
} vec_t;

/* One axis rotation after the other, as the frames are defined. */
static vec_t turn(vec_t p, long double roll, long double pitch, long double yaw)
{
    const vec_t a = {{p.v[0], p.v[1] * cosl(roll) - p.v[2] * sinl(roll), p.v[1] * sinl(roll) + p.v[2] * cosl(roll)}};
    const vec_t b = {{a.v[0] * cosl(pitch) + a.v[2] * sinl(pitch), a.v[1], a.v[2] * cosl(pitch) - a.v[0] * sinl(pitch)}};
    return (vec_t){{b.v[0] * cosl(yaw) - b.v[1] * sinl(yaw), b.v[0] * sinl(yaw) + b.v[1] * cosl(yaw), b.v[2]}};
}

/* Where a pose (degrees, mm) puts plate joint i, in base coordinates. */
static vec_t model_joint(const kin_geometry_t *g, const long double pose[POSE_AXES], unsigned i)
{
    vec_t arm;
    for (unsigned k = 0; k < 3; k++) {
        arm.v[k] = ((long double)g->plate_mm_q16[i][k] - g->mrp_mm_q16[k]) / 65536;
    }
    vec_t joint = turn(arm, pose[AXIS_ROLL] * DEG, pose[AXIS_PITCH] * DEG, pose[AXIS_YAW] * DEG);
    for (unsigned k = 0; k < 3; k++) {
        joint.v[k] += pose[AXIS_X + k] + (long double)g->mrp_mm_q16[k] / 65536;
    }
    joint.v[2] += (long double)g->zero_height_mm_q16 / 65536;
    return joint;
}

static long double model_extension(const kin_geometry_t *g, const long double pose[POSE_AXES], unsigned i)
{
    const vec_t joint = model_joint(g, pose, i);
    long double sum = 0;
    for (unsigned k = 0; k < 3; k++) {
        const long double d = joint.v[k] - (long double)g->base_mm_q16[i][k] / 65536;
        sum += d * d;
    }
    return sqrtl(sum) - (long double)g->retracted_mm_q16[i] / 65536;
}

static void to_real(const pose_t *pose, long double real[POSE_AXES])
{
    for (unsigned axis = 0; axis < POSE_AXES; axis++) {
        real[axis] = (long double)pose->axis_q32[axis] * Q32_LSB;
    }
}

/* Largest difference, in LSB of Q32, between the inverse solution and the model. */
static long double inverse_error_lsb(const kin_t *kin, const kin_geometry_t *geometry, const pose_t *pose)
{
    q32_t extension[CYLINDERS_MAX];
    long double real[POSE_AXES], worst = 0;
    to_real(pose, real);
    TEST_ASSERT_EQUAL_INT(HV_OK, kin_inverse(kin, pose, extension));
    for (unsigned i = 0; i < kin_cylinders(kin); i++) {
        worst = fmaxl(worst, fabsl(model_extension(geometry, real, i) / Q32_LSB - extension[i]));
    }
    return worst;
}

/* A hexapod of any proportions, joints anywhere in a ring, all heights, a random motion reference point. */
static void random_hexapod(kin_geometry_t *geometry)
{
    memset(geometry, 0, sizeof *geometry);
    geometry->kind = KIN_HEXAPOD;
    for (unsigned i = 0; i < 6; i++) {
        for (unsigned k = 0; k < 3; k++) {
            geometry->base_mm_q16[i][k] = random_q16(4000);
            geometry->plate_mm_q16[i][k] = random_q16(4000);
        }
        geometry->retracted_mm_q16[i] = 1 + (q16_t)(next_random() % (8000u << 16));
    }
    geometry->zero_height_mm_q16 = (q16_t)(next_random() % (8000u << 16));
    for (unsigned k = 0; k < 3; k++) {
        geometry->mrp_mm_q16[k] = random_q16(4000);
    }
}

static pose_t random_pose(int angle_deg, int translation_mm)
{
    pose_t pose;
    for (unsigned axis = 0; axis < POSE_AXES; axis++) {
        pose.axis_q32[axis] = random_q32(axis < AXIS_X ? angle_deg : translation_mm);
    }
    return pose;
}

/* ---- inverse ---- */

static void test_inverse_reference_poses_give_reference_lengths(void)
{
    for (size_t m = 0; m < MECHANISM_COUNT; m++) {
        load_mechanism(&k_mechanisms[m]);
        FILE *file = open_data("ik", k_mechanisms[m].name);
        long double column[COLUMNS_MAX], worst = 0;
        unsigned rows = 0;
        while (read_row(file, column) != 0) {
            const pose_t pose = pose_of(column, 65536);
            q32_t extension[CYLINDERS_MAX];
            TEST_ASSERT_EQUAL_INT(HV_OK, kin_inverse(&s_kin, &pose, extension));
            for (unsigned i = 0; i < kin_cylinders(&s_kin); i++) {
                const long double length = (extension[i] + q32_from_q16(s_geometry.retracted_mm_q16[i])) * Q32_LSB;
                worst = fmaxl(worst, fabsl(length - column[pose_columns() + i]));
            }
            rows++;
        }
        fclose(file);
        printf("inverse %-9s: worst of %u poses %.3Lg mm = %.3Lf LSB\n", k_mechanisms[m].name, rows, worst, worst / Q32_LSB);
        TEST_ASSERT_GREATER_OR_EQUAL_UINT(1000, rows);
        TEST_ASSERT_TRUE(worst < 0.00002L);         /* the bar: 0.02 um */
        TEST_ASSERT_TRUE(worst < 0.515L * Q32_LSB); /* what the header states, and half the last decimal of the data */
    }
}

/* Half a unit and the model's own error, which is larger where a long double has the 53 bits of a double. */
static const long double k_model_bar_lsb = LDBL_MANT_DIG >= 64 ? 0.51L : 0.6L;

static void test_inverse_random_mechanisms_match_the_model(void)
{
    long double worst = 0;
    for (unsigned n = 0; n < 300; n++) {
        random_hexapod(&s_geometry);
        TEST_ASSERT_EQUAL_INT(HV_OK, kin_init(&s_kin, &s_geometry));
        for (unsigned i = 0; i < 20; i++) {
            const pose_t pose = random_pose(i < 10 ? 720 : 30, i < 10 ? 8000 : 500);
            worst = fmaxl(worst, inverse_error_lsb(&s_kin, &s_geometry, &pose));
        }
    }
    printf("inverse of random hexapods: worst difference from the model %.3Lf LSB of Q32\n", worst);
    TEST_ASSERT_TRUE(worst < k_model_bar_lsb);
}

static void test_inverse_largest_values_match_the_model(void)
{
    s_geometry.kind = KIN_HEXAPOD;
    for (unsigned i = 0; i < 6; i++) {
        for (unsigned k = 0; k < 3; k++) {
            s_geometry.base_mm_q16[i][k] = -4000 * Q16_ONE;
            s_geometry.plate_mm_q16[i][k] = 4000 * Q16_ONE;
        }
        s_geometry.retracted_mm_q16[i] = 8000 * Q16_ONE;
    }
    s_geometry.zero_height_mm_q16 = 8000 * Q16_ONE;
    s_geometry.mrp_mm_q16[0] = s_geometry.mrp_mm_q16[1] = s_geometry.mrp_mm_q16[2] = -4000 * Q16_ONE;
    TEST_ASSERT_EQUAL_INT(HV_OK, kin_init(&s_kin, &s_geometry));
    for (unsigned n = 0; n < 2000; n++) {
        pose_t pose = random_pose(180, 8000);
        for (unsigned axis = AXIS_X; axis < POSE_AXES; axis++) {
            pose.axis_q32[axis] = pose.axis_q32[axis] < 0 ? -8000 * Q32_ONE : 8000 * Q32_ONE;
        }
        TEST_ASSERT_TRUE(inverse_error_lsb(&s_kin, &s_geometry, &pose) < k_model_bar_lsb);
    }
}

static void test_inverse_joint_at_reference_point_stays_still_in_any_rotation(void)
{
    load_mechanism(&k_mechanisms[2]);
    memcpy(s_geometry.mrp_mm_q16, s_geometry.plate_mm_q16[4], sizeof s_geometry.mrp_mm_q16);
    TEST_ASSERT_EQUAL_INT(HV_OK, kin_init(&s_kin, &s_geometry));
    pose_t pose = {{0}};
    q32_t still[CYLINDERS_MAX], extension[CYLINDERS_MAX];
    TEST_ASSERT_EQUAL_INT(HV_OK, kin_inverse(&s_kin, &pose, still));
    for (int angle = -90; angle <= 90; angle++) {
        pose.axis_q32[AXIS_ROLL] = angle * Q32_ONE;
        TEST_ASSERT_EQUAL_INT(HV_OK, kin_inverse(&s_kin, &pose, extension));
        TEST_ASSERT_EQUAL_INT64(still[4], extension[4]);
        pose.axis_q32[AXIS_PITCH] = angle * Q32_ONE / 3;
        pose.axis_q32[AXIS_YAW] = -2 * angle * Q32_ONE;
        TEST_ASSERT_EQUAL_INT(HV_OK, kin_inverse(&s_kin, &pose, extension));
        TEST_ASSERT_EQUAL_INT64(still[4], extension[4]);
        TEST_ASSERT_TRUE(angle == 0 || extension[0] != still[0]);
        pose = (pose_t){{0}};
    }
}

static void test_inverse_reference_point_does_not_matter_to_pure_translation(void)
{
    load_mechanism(&k_mechanisms[1]);
    kin_t moved;
    s_geometry.mrp_mm_q16[0] = 123 * Q16_ONE;
    s_geometry.mrp_mm_q16[2] = 987 * Q16_ONE + 77;
    TEST_ASSERT_EQUAL_INT(HV_OK, kin_init(&moved, &s_geometry));
    for (unsigned n = 0; n < 100; n++) {
        const pose_t pose = random_pose(1, 200);
        pose_t level = pose;
        level.axis_q32[AXIS_ROLL] = level.axis_q32[AXIS_PITCH] = level.axis_q32[AXIS_YAW] = 0;
        q32_t expected[CYLINDERS_MAX], extension[CYLINDERS_MAX];
        TEST_ASSERT_EQUAL_INT(HV_OK, kin_inverse(&s_kin, &level, expected));
        TEST_ASSERT_EQUAL_INT(HV_OK, kin_inverse(&moved, &level, extension));
        TEST_ASSERT_EQUAL_INT64_ARRAY(expected, extension, 6);
    }
}

static void test_inverse_out_of_range_pose_is_refused_and_changes_nothing(void)
{
    const q32_t untouched = INT64_C(0x123456789ABCDEF);
    for (size_t m = 0; m < MECHANISM_COUNT; m++) {
        load_mechanism(&k_mechanisms[m]);
        for (unsigned axis = 0; axis < POSE_AXES; axis++) {
            const bool is_translation = axis >= AXIS_X;
            const bool is_refused = axis == AXIS_Z || (s_kin.kind == KIN_HEXAPOD && is_translation) ||
                                    (s_kin.kind == KIN_TRIPOD_3RPS && axis <= AXIS_PITCH);
            const q32_t limit = (is_translation ? 8000 : 90) * Q32_ONE;
            const q32_t values[] = {limit, limit + 1, -limit, -limit - 1, INT64_MAX, INT64_MIN};
            for (unsigned n = 0; n < 6; n++) {
                pose_t pose = {{0}};
                pose.axis_q32[axis] = values[n];
                q32_t extension[CYLINDERS_MAX] = {untouched, untouched, untouched, untouched, untouched, untouched};
                const bool is_beyond = values[n] > limit || values[n] < -limit;
                const hv_status_t expected = is_refused && is_beyond ? HV_ERR_RANGE : HV_OK;
                TEST_ASSERT_EQUAL_INT(expected, kin_inverse(&s_kin, &pose, extension));
                for (unsigned i = expected == HV_OK ? kin_cylinders(&s_kin) : 0; i < CYLINDERS_MAX; i++) {
                    TEST_ASSERT_EQUAL_INT64(untouched, extension[i]);
                }
            }
        }
    }
}

/* Third differences at 1 kHz of a slow motion, against the model on the ideal pose and on the pose as rounded to Q32. */
static void test_inverse_slow_motion_adds_no_more_than_rounding_to_third_differences(void)
{
    load_mechanism(&k_mechanisms[2]);
    long double ideal_difference[CYLINDERS_MAX][4] = {{0}}, rounded_difference[CYLINDERS_MAX][4] = {{0}};
    long double worst_ideal = 0, worst_rounded = 0;
    for (unsigned t = 0; t < 2000; t++) {
        long double ideal[POSE_AXES], rounded[POSE_AXES];
        pose_t pose;
        q32_t extension[CYLINDERS_MAX];
        for (unsigned axis = 0; axis < POSE_AXES; axis++) {
            ideal[axis] = (axis < AXIS_X ? 3 : 20) * sinl(2 * acosl(-1.0L) * 0.2L * t / 1000 + axis);
            pose.axis_q32[axis] = llrintl(ideal[axis] / Q32_LSB);
        }
        to_real(&pose, rounded);
        TEST_ASSERT_EQUAL_INT(HV_OK, kin_inverse(&s_kin, &pose, extension));
        for (unsigned i = 0; i < 6; i++) {
            long double *a = ideal_difference[i], *b = rounded_difference[i];
            memmove(a, a + 1, 3 * sizeof *a);
            memmove(b, b + 1, 3 * sizeof *b);
            a[3] = extension[i] - model_extension(&s_geometry, ideal, i) / Q32_LSB;
            b[3] = extension[i] - model_extension(&s_geometry, rounded, i) / Q32_LSB;
            if (t >= 3) {
                worst_ideal = fmaxl(worst_ideal, fabsl(a[3] - 3 * a[2] + 3 * a[1] - a[0]));
                worst_rounded = fmaxl(worst_rounded, fabsl(b[3] - 3 * b[2] + 3 * b[1] - b[0]));
            }
        }
    }
    printf("inverse noise: third differences off by %.2Lf LSB (%.2Lf with the rounding of the pose)\n", worst_rounded,
           worst_ideal);
    TEST_ASSERT_TRUE(worst_rounded < 8 * 0.51L);
    TEST_ASSERT_TRUE(worst_ideal < 100); /* an LSB of angle alone is 16 LSB of length at this radius of 900 mm */
}

/* ---- parasitic motion ---- */

static void test_constrain_hexapod_and_guided_tripod(void)
{
    load_mechanism(&k_mechanisms[0]);
    const pose_t start = random_pose(20, 50);
    pose_t pose = start;
    kin_constrain(&s_kin, &pose);
    TEST_ASSERT_EQUAL_INT64_ARRAY(start.axis_q32, pose.axis_q32, POSE_AXES);
    load_mechanism(&k_mechanisms[3]);
    kin_constrain(&s_kin, &pose);
    const q32_t expected[POSE_AXES] = {start.axis_q32[0], start.axis_q32[1], 0, 0, 0, start.axis_q32[5]};
    TEST_ASSERT_EQUAL_INT64_ARRAY(expected, pose.axis_q32, POSE_AXES);
}

static void test_constrain_3rps_reference_poses_give_reference_yaw_x_y(void)
{
    load_mechanism(&k_mechanisms[4]);
    FILE *file = open_data("ik", "tri_rps");
    long double column[COLUMNS_MAX], worst = 0;
    while (read_row(file, column) != 0) {
        pose_t pose = pose_of(column, 65536);
        kin_constrain(&s_kin, &pose);
        for (unsigned k = 0; k < 3; k++) {
            worst = fmaxl(worst, fabsl(pose.axis_q32[AXIS_YAW + k] * Q32_LSB - column[6 + k]));
        }
    }
    fclose(file);
    printf("3-RPS parasitic motion: worst error %.3Lf LSB of Q32\n", worst / Q32_LSB);
    TEST_ASSERT_TRUE(worst < 0.53L * Q32_LSB);
}

/* What defines the mechanism: each plate joint in the vertical plane of its hinge. Any motion reference point. */
static void test_constrain_3rps_any_reference_point_keeps_joints_in_hinge_planes(void)
{
    load_mechanism(&k_mechanisms[4]);
    for (unsigned i = 0; i < 3; i++) {
        s_geometry.plate_mm_q16[i][2] = -60 * Q16_ONE;
    }
    long double worst_beside = 0, worst_length = 0;
    for (unsigned n = 0; n < 400; n++) {
        for (unsigned k = 0; k < 3; k++) {
            s_geometry.mrp_mm_q16[k] = random_q16(1500);
        }
        TEST_ASSERT_EQUAL_INT(HV_OK, kin_init(&s_kin, &s_geometry));
        pose_t pose = random_pose(n < 300 ? 40 : 90, 200);
        long double real[POSE_AXES];
        kin_constrain(&s_kin, &pose);
        to_real(&pose, real);
        for (unsigned i = 0; i < 3; i++) {
            const vec_t joint = model_joint(&s_geometry, real, i);
            worst_beside = fmaxl(worst_beside, fabsl(joint.v[1] * cosl(120 * i * DEG) - joint.v[0] * sinl(120 * i * DEG)));
        }
        worst_length = fmaxl(worst_length, inverse_error_lsb(&s_kin, &s_geometry, &pose));
    }
    printf("3-RPS: joints beside their planes by %.3Lg mm at most, lengths off by %.2Lf LSB\n", worst_beside, worst_length);
    TEST_ASSERT_TRUE(worst_beside < 0.0001L); /* the joints of the data are rounded to Q16.16 */
    TEST_ASSERT_TRUE(worst_length < 25);      /* the model is given a rounded yaw: half an LSB is up to 20 LSB at 2300 mm */
}

static void test_constrain_3rps_extreme_angles_are_taken_as_90_degrees(void)
{
    load_mechanism(&k_mechanisms[4]);
    pose_t pose = {{INT64_MAX, INT64_MIN, 5, 5, 5, 5}};
    pose_t limit = {{90 * Q32_ONE, -90 * Q32_ONE, 0, 0, 0, 0}};
    kin_constrain(&s_kin, &pose);
    kin_constrain(&s_kin, &limit);
    TEST_ASSERT_EQUAL_INT64(INT64_MAX, pose.axis_q32[AXIS_ROLL]);
    TEST_ASSERT_EQUAL_INT64_ARRAY(&limit.axis_q32[AXIS_YAW], &pose.axis_q32[AXIS_YAW], 3);
    TEST_ASSERT_INT64_WITHIN(2, -90 * Q32_ONE, pose.axis_q32[AXIS_YAW]);
}

/* ---- forward ---- */

static void test_forward_of_inverse_in_stroke_poses_returns_the_pose(void)
{
    static const pose_t k_zero = {{0}};
    for (size_t m = 0; m < MECHANISM_COUNT; m++) {
        load_mechanism(&k_mechanisms[m]);
        FILE *file = open_data("ik", k_mechanisms[m].name);
        long double column[COLUMNS_MAX], worst_deg = 0, worst_mm = 0;
        unsigned count, rows = 0, sum = 0, most = 0;
        while ((count = read_row(file, column)) != 0) {
            if (column[count - 1] != 1) {
                continue;
            }
            pose_t pose = pose_of(column, 65536), found;
            q32_t extension[CYLINDERS_MAX];
            unsigned iterations;
            kin_constrain(&s_kin, &pose);
            TEST_ASSERT_EQUAL_INT(HV_OK, kin_inverse(&s_kin, &pose, extension));
            TEST_ASSERT_EQUAL_INT(HV_OK, kin_forward(&s_kin, extension, &k_zero, &found, &iterations));
            for (unsigned axis = 0; axis < POSE_AXES; axis++) {
                const long double error = fabsl((found.axis_q32[axis] - pose.axis_q32[axis]) * Q32_LSB);
                long double *worst = axis < AXIS_X ? &worst_deg : &worst_mm;
                *worst = fmaxl(*worst, error);
            }
            rows++;
            sum += iterations;
            most = iterations > most ? iterations : most;
        }
        fclose(file);
        printf("forward %-9s: %u poses from zero, worst %.2Lg mm %.2Lg deg, iterations mean %.2f max %u\n", k_mechanisms[m].name,
               rows, worst_mm, worst_deg, (double)sum / rows, most);
        TEST_ASSERT_GREATER_OR_EQUAL_UINT(300, rows);
        TEST_ASSERT_TRUE(worst_mm < 1e-8L && worst_deg < 1e-8L); /* bars: 0.001 mm, 0.0001 deg; 1e-7 mm for smooth motion */
        TEST_ASSERT_LESS_OR_EQUAL_UINT(5, most);
    }
}

static void test_forward_reference_lengths_give_reference_poses(void)
{
    static const pose_t k_zero = {{0}};
    for (size_t m = 0; m < MECHANISM_COUNT; m++) {
        load_mechanism(&k_mechanisms[m]);
        FILE *file = open_data("fk", k_mechanisms[m].name);
        const unsigned cylinders = kin_cylinders(&s_kin);
        long double column[COLUMNS_MAX], worst = 0;
        unsigned count, rows = 0;
        while ((count = read_row(file, column)) != 0) {
            q32_t extension[CYLINDERS_MAX];
            pose_t found;
            for (unsigned i = 0; i < cylinders; i++) {
                extension[i] = ((q32_t)column[i] - s_geometry.retracted_mm_q16[i]) * 65536;
            }
            TEST_ASSERT_EQUAL_INT(HV_OK, kin_forward(&s_kin, extension, &k_zero, &found, NULL));
            const pose_t expected = pose_of(column + cylinders, 4294967296.0L);
            const bool has_amplification = s_kin.kind == KIN_HEXAPOD;
            for (unsigned axis = 0; axis < POSE_AXES; axis++) {
                const long double amplification = !has_amplification ? 3 : column[count - (axis < AXIS_X ? 1 : 2)];
                const bool is_imposed = !has_amplification && axis >= AXIS_YAW && axis <= AXIS_Y;
                const long double error = fabsl((long double)(found.axis_q32[axis] - expected.axis_q32[axis]));
                worst = is_imposed ? worst : fmaxl(worst, error / (1 + amplification));
            }
            rows++;
        }
        fclose(file);
        printf("forward %-9s: worst of %u reference poses %.2Lf LSB over (1 + amplification)\n", k_mechanisms[m].name, rows,
               worst);
        TEST_ASSERT_EQUAL_UINT(500, rows);
        TEST_ASSERT_TRUE(worst < 2.5L);
    }
}

static void test_forward_warm_start_takes_two_steps_and_lands_where_a_cold_one_does(void)
{
    static const pose_t k_zero = {{0}};
    for (size_t m = 0; m < MECHANISM_COUNT; m++) {
        load_mechanism(&k_mechanisms[m]);
        for (unsigned n = 0; n < 300; n++) {
            pose_t pose = random_pose(4, 8), near, cold, warm;
            q32_t extension[CYLINDERS_MAX];
            unsigned iterations;
            kin_constrain(&s_kin, &pose);
            near = pose;
            for (unsigned axis = 0; axis < POSE_AXES; axis++) {
                near.axis_q32[axis] += random_q32(1) / (axis < AXIS_X ? 50 : 4);
            }
            TEST_ASSERT_EQUAL_INT(HV_OK, kin_inverse(&s_kin, &pose, extension));
            TEST_ASSERT_EQUAL_INT(HV_OK, kin_forward(&s_kin, extension, &k_zero, &cold, NULL));
            TEST_ASSERT_EQUAL_INT(HV_OK, kin_forward(&s_kin, extension, &near, &warm, &iterations));
            TEST_ASSERT_LESS_OR_EQUAL_UINT(3, iterations);
            for (unsigned axis = 0; axis < POSE_AXES; axis++) {
                TEST_ASSERT_INT64_WITHIN(12, cold.axis_q32[axis], warm.axis_q32[axis]);
            }
            TEST_ASSERT_EQUAL_INT(HV_OK, kin_forward(&s_kin, extension, &warm, &warm, &iterations));
            TEST_ASSERT_EQUAL_UINT(1, iterations);
        }
    }
}

static void test_forward_random_reference_points_return_the_pose(void)
{
    static const pose_t k_zero = {{0}};
    for (size_t m = 0; m < MECHANISM_COUNT; m++) {
        load_mechanism(&k_mechanisms[m]);
        for (unsigned n = 0; n < 100; n++) {
            for (unsigned k = 0; k < 3; k++) {
                s_geometry.mrp_mm_q16[k] = random_q16(s_kin.kind == KIN_TRIPOD ? 50 : 300);
            }
            TEST_ASSERT_EQUAL_INT(HV_OK, kin_init(&s_kin, &s_geometry));
            pose_t pose = random_pose(6, 15), found;
            q32_t extension[CYLINDERS_MAX];
            unsigned iterations;
            kin_constrain(&s_kin, &pose);
            TEST_ASSERT_EQUAL_INT(HV_OK, kin_inverse(&s_kin, &pose, extension));
            TEST_ASSERT_EQUAL_INT(HV_OK, kin_forward(&s_kin, extension, &k_zero, &found, &iterations));
            TEST_ASSERT_LESS_OR_EQUAL_UINT(5, iterations);
            for (unsigned axis = 0; axis < POSE_AXES; axis++) {
                TEST_ASSERT_INT64_WITHIN(100, pose.axis_q32[axis], found.axis_q32[axis]);
            }
        }
    }
}

static void check_forward_refuses(const q32_t extension[CYLINDERS_MAX], const pose_t *guess)
{
    const pose_t before = {{1, 2, 3, 4, 5, 6}};
    pose_t pose = before;
    unsigned iterations = 99;
    TEST_ASSERT_EQUAL_INT(HV_ERR_RANGE, kin_forward(&s_kin, extension, guess, &pose, &iterations));
    TEST_ASSERT_EQUAL_INT64_ARRAY(before.axis_q32, pose.axis_q32, POSE_AXES);
    TEST_ASSERT_LESS_OR_EQUAL_UINT(KIN_FORWARD_ITERATIONS_MAX, iterations);
}

static void test_forward_unreachable_lengths_are_refused_and_change_nothing(void)
{
    static const pose_t k_zero = {{0}};
    for (size_t m = 0; m < MECHANISM_COUNT; m++) {
        load_mechanism(&k_mechanisms[m]);
        const q32_t most = INT64_MAX, least = INT64_MIN, far = 20000 * Q32_ONE;
        const q32_t one_long[CYLINDERS_MAX] = {far, 0, 0, 0, 0, 0};
        const q32_t all_longest[CYLINDERS_MAX] = {most, most, most, most, most, most};
        const q32_t all_least[CYLINDERS_MAX] = {least, least, least, least, least, least};
        const q32_t mixed[CYLINDERS_MAX] = {most, least, 0, far, -far, 1};
        const q32_t negative[CYLINDERS_MAX] = {-far, -far, -far, -far, -far, -far};
        check_forward_refuses(one_long, &k_zero);
        check_forward_refuses(all_longest, &k_zero);
        check_forward_refuses(all_least, &k_zero);
        check_forward_refuses(mixed, &k_zero);
        check_forward_refuses(negative, &k_zero);
    }
}

static void test_forward_guess_out_of_range_is_refused(void)
{
    load_mechanism(&k_mechanisms[0]);
    const q32_t extension[CYLINDERS_MAX] = {0};
    const pose_t guess = {{0, 0, 0, INT64_MIN, 0, INT64_MAX}};
    check_forward_refuses(extension, &guess);
}

/* Similar regular hexagons hold no yaw in any pose: the textbook singular platform. */
static void test_forward_singular_mechanism_is_refused(void)
{
    static const pose_t k_zero = {{0}};
    s_geometry.kind = KIN_HEXAPOD;
    for (unsigned i = 0; i < 6; i++) {
        s_geometry.base_mm_q16[i][0] = (q16_t)lrint(1000 * 65536 * cos(i * acos(-1) / 3));
        s_geometry.base_mm_q16[i][1] = (q16_t)lrint(1000 * 65536 * sin(i * acos(-1) / 3));
        s_geometry.plate_mm_q16[i][0] = s_geometry.base_mm_q16[i][0];
        s_geometry.plate_mm_q16[i][1] = s_geometry.base_mm_q16[i][1];
        s_geometry.retracted_mm_q16[i] = 900 * Q16_ONE;
    }
    s_geometry.zero_height_mm_q16 = 1000 * Q16_ONE;
    TEST_ASSERT_EQUAL_INT(HV_OK, kin_init(&s_kin, &s_geometry));
    const q32_t extension[CYLINDERS_MAX] = {100 * Q32_ONE, 100 * Q32_ONE, 100 * Q32_ONE,
                                            100 * Q32_ONE, 100 * Q32_ONE, 100 * Q32_ONE};
    check_forward_refuses(extension, &k_zero);
}

/* Where a cylinder has no length it has no direction: Newton's method does not begin there. */
static void test_forward_guess_that_puts_a_joint_on_its_other_one_is_refused(void)
{
    for (size_t m = 0; m < MECHANISM_COUNT; m++) {
        load_mechanism(&k_mechanisms[m]);
        if (s_kin.kind != KIN_HEXAPOD) {
            continue;
        }
        pose_t guess = {{0}};
        for (unsigned k = 0; k < 2; k++) {
            guess.axis_q32[AXIS_X + k] = q32_from_q16(s_geometry.base_mm_q16[0][k] - s_geometry.plate_mm_q16[0][k]);
        }
        const q16_t height_q16 = s_geometry.base_mm_q16[0][2] - s_geometry.plate_mm_q16[0][2] - s_geometry.zero_height_mm_q16;
        guess.axis_q32[AXIS_Z] = q32_from_q16(height_q16);
        const q32_t extension[CYLINDERS_MAX] = {0};
        check_forward_refuses(extension, &guess);
    }
}

/* Whatever comes back as a solution gives the lengths asked for, and nothing makes it hang or overflow. */
static void test_forward_random_lengths_solve_or_fail_cleanly(void)
{
    unsigned solved = 0;
    for (size_t m = 0; m < MECHANISM_COUNT; m++) {
        load_mechanism(&k_mechanisms[m]);
        for (unsigned n = 0; n < 1000; n++) {
            q32_t extension[CYLINDERS_MAX], back[CYLINDERS_MAX];
            const pose_t guess = random_pose(n % 2 == 0 ? 60 : 10, n % 2 == 0 ? 800 : 50);
            pose_t pose;
            unsigned iterations;
            for (unsigned i = 0; i < CYLINDERS_MAX; i++) {
                extension[i] = random_q32(n % 3 == 0 ? 400 : n % 3 == 1 ? 50 : 60000);
            }
            if (kin_forward(&s_kin, extension, &guess, &pose, &iterations) != HV_OK ||
                kin_inverse(&s_kin, &pose, back) != HV_OK) {
                continue;
            }
            solved++;
            for (unsigned i = 0; i < kin_cylinders(&s_kin); i++) {
                TEST_ASSERT_INT64_WITHIN(Q32_ONE / 1000000, extension[i], back[i]);
            }
        }
    }
    TEST_ASSERT_GREATER_THAN_UINT(500, solved);
}

/* ---- preparation ---- */

static void check_init_refuses(const kin_geometry_t *geometry)
{
    kin_t kin, before;
    memset(&kin, 0x5A, sizeof kin);
    memset(&before, 0x5A, sizeof before);
    TEST_ASSERT_EQUAL_INT(HV_ERR_RANGE, kin_init(&kin, geometry));
    TEST_ASSERT_EQUAL_MEMORY(&before, &kin, sizeof kin);
}

/* One value at a time: accepted at its limit, refused one LSB beyond it. */
static void check_limit(q16_t *value, q16_t limit, q16_t outward)
{
    const q16_t before = *value;
    *value = limit;
    TEST_ASSERT_EQUAL_INT(HV_OK, kin_init(&s_kin, &s_geometry));
    *value = limit + outward;
    check_init_refuses(&s_geometry);
    *value = before;
}

static void test_init_values_beyond_their_limits_are_refused(void)
{
    load_mechanism(&k_mechanisms[2]);
    for (unsigned i = 0; i < 6; i++) {
        for (unsigned k = 0; k < 3; k++) {
            check_limit(&s_geometry.base_mm_q16[i][k], 4000 * Q16_ONE, 1);
            check_limit(&s_geometry.base_mm_q16[i][k], -4000 * Q16_ONE, -1);
            check_limit(&s_geometry.plate_mm_q16[i][k], 4000 * Q16_ONE, 1);
            check_limit(&s_geometry.plate_mm_q16[i][k], -4000 * Q16_ONE, -1);
            check_limit(&s_geometry.mrp_mm_q16[k], 4000 * Q16_ONE, 1);
            check_limit(&s_geometry.mrp_mm_q16[k], -4000 * Q16_ONE, -1);
        }
        check_limit(&s_geometry.retracted_mm_q16[i], 1, -1);
        check_limit(&s_geometry.retracted_mm_q16[i], 8000 * Q16_ONE, 1);
    }
    check_limit(&s_geometry.zero_height_mm_q16, 0, -1);
    check_limit(&s_geometry.zero_height_mm_q16, 8000 * Q16_ONE, 1);
    s_geometry.kind = (kin_kind_t)7;
    check_init_refuses(&s_geometry);
}

static void test_init_joints_beyond_those_of_a_tripod_are_ignored(void)
{
    load_mechanism(&k_mechanisms[3]);
    s_geometry.base_mm_q16[3][0] = INT32_MAX;
    s_geometry.retracted_mm_q16[5] = -1;
    TEST_ASSERT_EQUAL_INT(HV_OK, kin_init(&s_kin, &s_geometry));
    TEST_ASSERT_EQUAL_UINT(3, kin_cylinders(&s_kin));
}

static void test_init_3rps_joints_off_their_hinge_planes_are_refused(void)
{
    load_mechanism(&k_mechanisms[4]);
    for (unsigned i = 0; i < 3; i++) {
        for (unsigned k = 0; k < 3; k++) {
            q16_t *values[] = {&s_geometry.plate_mm_q16[i][k], &s_geometry.base_mm_q16[i][k]};
            for (unsigned n = 0; n < 2; n++) {
                const bool is_free = n == 1 && (k == 2 || (i == 0 && k == 0)); /* height; along the plane of cylinder 1 */
                const q16_t before = *values[n];
                *values[n] = before + Q16_ONE;
                if (!is_free) {
                    check_init_refuses(&s_geometry);
                }
                *values[n] = before + 600; /* 0.009 mm, as text with two decimals may be off */
                TEST_ASSERT_EQUAL_INT(HV_OK, kin_init(&s_kin, &s_geometry));
                *values[n] = before;
            }
        }
    }
    for (unsigned i = 0; i < 3; i++) { /* cylinders counted the other way round */
        s_geometry.base_mm_q16[i][1] = -s_geometry.base_mm_q16[i][1];
        s_geometry.plate_mm_q16[i][1] = -s_geometry.plate_mm_q16[i][1];
    }
    check_init_refuses(&s_geometry);
}

/* ---- the same bits everywhere ---- */

static uint64_t mix(uint64_t digest, const q32_t values[], unsigned count)
{
    for (unsigned i = 0; i < count; i++) {
        for (unsigned bit = 0; bit < 64; bit += 8) {
            digest = (digest ^ ((uint64_t)values[i] >> bit & 0xFF)) * UINT64_C(1099511628211);
        }
    }
    return digest;
}

/* Recorded once, anew only where a formula changes; any compiler, CPU or form of the wide product that gives other bits fails
 * here. */
static void test_solutions_have_the_same_bits_on_every_build(void)
{
    static const pose_t k_zero = {{0}};
    uint64_t digest = UINT64_C(14695981039346656037);
    for (size_t m = 0; m < MECHANISM_COUNT; m++) {
        load_mechanism(&k_mechanisms[m]);
        for (unsigned n = 0; n < 500; n++) {
            pose_t pose = random_pose(8, 20), found;
            q32_t extension[CYLINDERS_MAX];
            kin_constrain(&s_kin, &pose);
            TEST_ASSERT_EQUAL_INT(HV_OK, kin_inverse(&s_kin, &pose, extension));
            TEST_ASSERT_EQUAL_INT(HV_OK, kin_forward(&s_kin, extension, &k_zero, &found, NULL));
            digest = mix(mix(digest, extension, kin_cylinders(&s_kin)), found.axis_q32, POSE_AXES);
        }
    }
    TEST_ASSERT_EQUAL_HEX64(UINT64_C(0x28FE6207B8462961), digest);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_inverse_reference_poses_give_reference_lengths);
    RUN_TEST(test_inverse_random_mechanisms_match_the_model);
    RUN_TEST(test_inverse_largest_values_match_the_model);
    RUN_TEST(test_inverse_joint_at_reference_point_stays_still_in_any_rotation);
    RUN_TEST(test_inverse_reference_point_does_not_matter_to_pure_translation);
    RUN_TEST(test_inverse_out_of_range_pose_is_refused_and_changes_nothing);
    RUN_TEST(test_inverse_slow_motion_adds_no_more_than_rounding_to_third_differences);
    RUN_TEST(test_constrain_hexapod_and_guided_tripod);
    RUN_TEST(test_constrain_3rps_reference_poses_give_reference_yaw_x_y);
    RUN_TEST(test_constrain_3rps_any_reference_point_keeps_joints_in_hinge_planes);
    RUN_TEST(test_constrain_3rps_extreme_angles_are_taken_as_90_degrees);
    RUN_TEST(test_forward_of_inverse_in_stroke_poses_returns_the_pose);
    RUN_TEST(test_forward_reference_lengths_give_reference_poses);
    RUN_TEST(test_forward_warm_start_takes_two_steps_and_lands_where_a_cold_one_does);
    RUN_TEST(test_forward_random_reference_points_return_the_pose);
    RUN_TEST(test_forward_unreachable_lengths_are_refused_and_change_nothing);
    RUN_TEST(test_forward_guess_out_of_range_is_refused);
    RUN_TEST(test_forward_singular_mechanism_is_refused);
    RUN_TEST(test_forward_guess_that_puts_a_joint_on_its_other_one_is_refused);
    RUN_TEST(test_forward_random_lengths_solve_or_fail_cleanly);
    RUN_TEST(test_init_values_beyond_their_limits_are_refused);
    RUN_TEST(test_init_joints_beyond_those_of_a_tripod_are_ignored);
    RUN_TEST(test_init_3rps_joints_off_their_hinge_planes_are_refused);
    RUN_TEST(test_solutions_have_the_same_bits_on_every_build);
    return UNITY_END();
}
