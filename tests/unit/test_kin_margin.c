/* SPDX-License-Identifier: MIT
 * test_kin_margin.c - the singularity margin against a floating-point model that takes velocities from differences of joint
 * positions, makes free motions orthonormal and finds eigenvalues by Jacobi's rotations; and against what is known of it: no
 * unit, no choice of reference point and no scale matters, and the textbook's singular platforms have none.
 */
#include "heave/kin.h"
#include "unity.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#define DEG  (acos(-1.0) / 180)
#define STEP 1e-5

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

static double chance(void)
{
    s_random ^= s_random >> 12;
    s_random ^= s_random << 25;
    s_random ^= s_random >> 27;
    return (double)((s_random * UINT64_C(2685821657736338717)) >> 11) / 9007199254740992.0;
}

static double between(double low, double high)
{
    return low + (high - low) * chance();
}

static q16_t to_q16(double value)
{
    return (q16_t)lrint(value * 65536);
}

/* ---- mechanisms ---- */

static void put_on_circle(q16_t joint[3], double radius, double angle_deg)
{
    joint[0] = to_q16(radius * cos(angle_deg * DEG));
    joint[1] = to_q16(radius * sin(angle_deg * DEG));
    joint[2] = 0;
}

/* Joints in pairs: half a gap to each side of 0, 120, 240 deg below, and of 60, 180, 300 deg above. */
static void make_hexapod(double base_mm, double base_gap_deg, double plate_mm, double plate_gap_deg, double height_mm)
{
    s_geometry.kind = KIN_HEXAPOD;
    for (unsigned i = 0; i < 6; i++) {
        const double side = i % 2 == 0 ? -0.5 : 0.5;
        put_on_circle(s_geometry.base_mm_q16[i], base_mm, 120.0 * (i / 2) + side * base_gap_deg);
        put_on_circle(s_geometry.plate_mm_q16[i], plate_mm, 120.0 * (i / 2) + side * (120.0 - plate_gap_deg));
        s_geometry.retracted_mm_q16[i] = 500 * Q16_ONE;
    }
    s_geometry.zero_height_mm_q16 = to_q16(height_mm);
    TEST_ASSERT_EQUAL_INT(HV_OK, kin_init(&s_kin, &s_geometry));
}

static void make_tripod(kin_kind_t kind, double base_mm, double plate_mm, double height_mm)
{
    s_geometry.kind = kind;
    for (unsigned i = 0; i < 3; i++) {
        put_on_circle(s_geometry.base_mm_q16[i], base_mm, 120.0 * i);
        put_on_circle(s_geometry.plate_mm_q16[i], plate_mm, 120.0 * i);
        s_geometry.retracted_mm_q16[i] = 500 * Q16_ONE;
    }
    s_geometry.zero_height_mm_q16 = to_q16(height_mm);
    TEST_ASSERT_EQUAL_INT(HV_OK, kin_init(&s_kin, &s_geometry));
}

static void make_any_hexapod(void)
{
    s_geometry.kind = KIN_HEXAPOD;
    for (unsigned i = 0; i < 6; i++) {
        for (unsigned k = 0; k < 3; k++) {
            s_geometry.base_mm_q16[i][k] = to_q16(between(-800, 800));
            s_geometry.plate_mm_q16[i][k] = to_q16(between(-600, 600));
        }
        s_geometry.retracted_mm_q16[i] = 500 * Q16_ONE;
    }
    s_geometry.zero_height_mm_q16 = to_q16(between(900, 2000));
    for (unsigned k = 0; k < 3; k++) {
        s_geometry.mrp_mm_q16[k] = to_q16(between(-1500, 1500));
    }
    TEST_ASSERT_EQUAL_INT(HV_OK, kin_init(&s_kin, &s_geometry));
}

static pose_t any_pose(double angle_deg, double way_mm)
{
    pose_t pose;
    for (unsigned axis = 0; axis < POSE_AXES; axis++) {
        const double most = axis < AXIS_X ? angle_deg : way_mm;
        pose.axis_q32[axis] = llrint(between(-most, most) * 4294967296.0);
    }
    return pose;
}

/* ---- the model ---- */

/* A point of the plate turned by a pose: one axis after the other, as the frames are defined. */
static void turn(const double pose[POSE_AXES], const double a[3], double turned[3])
{
    const double r = pose[AXIS_ROLL] * DEG, p = pose[AXIS_PITCH] * DEG, y = pose[AXIS_YAW] * DEG;
    const double b[3] = {a[0], a[1] * cos(r) - a[2] * sin(r), a[1] * sin(r) + a[2] * cos(r)};
    const double c[3] = {b[0] * cos(p) + b[2] * sin(p), b[1], b[2] * cos(p) - b[0] * sin(p)};
    turned[0] = c[0] * cos(y) - c[1] * sin(y);
    turned[1] = c[0] * sin(y) + c[1] * cos(y);
    turned[2] = c[2];
}

static void model_joint(const double pose[POSE_AXES], unsigned i, double joint[3])
{
    double arm[3];
    for (unsigned k = 0; k < 3; k++) {
        arm[k] = ((double)s_geometry.plate_mm_q16[i][k] - s_geometry.mrp_mm_q16[k]) / 65536;
    }
    turn(pose, arm, joint);
    for (unsigned k = 0; k < 3; k++) {
        joint[k] += pose[AXIS_X + k] + s_geometry.mrp_mm_q16[k] / 65536.0;
    }
    joint[2] += s_geometry.zero_height_mm_q16 / 65536.0;
}

/* Picks a reference point anywhere; moved is what a pose about the plate's origin becomes. */
static void move_reference_point(const pose_t *pose, pose_t *moved)
{
    double at[POSE_AXES], point[3], turned[3];
    *moved = *pose;
    for (unsigned k = 0; k < 3; k++) {
        s_geometry.mrp_mm_q16[k] = to_q16(between(-4000, 4000));
        point[k] = s_geometry.mrp_mm_q16[k] / 65536.0;
        at[k] = (double)pose->axis_q32[k] / 4294967296.0;
    }
    turn(at, point, turned);
    for (unsigned k = 0; k < 3; k++) {
        moved->axis_q32[AXIS_X + k] += llrint((turned[k] - point[k]) * 4294967296.0);
    }
}

/* All joints of a pose with what the mechanism imposes, one after the other. */
static void model_joints(const double pose[POSE_AXES], double joints[18])
{
    double complete[POSE_AXES];
    pose_t constrained;
    for (unsigned axis = 0; axis < POSE_AXES; axis++) {
        constrained.axis_q32[axis] = llrint(pose[axis] * 4294967296.0);
    }
    kin_constrain(&s_kin, &constrained);
    for (unsigned axis = 0; axis < POSE_AXES; axis++) {
        const bool is_free = s_geometry.kind == KIN_HEXAPOD || axis < AXIS_YAW || axis == AXIS_Z;
        complete[axis] = is_free ? pose[axis] : (double)constrained.axis_q32[axis] / 4294967296.0;
    }
    for (unsigned i = 0; i < kin_cylinders(&s_kin); i++) {
        model_joint(complete, i, &joints[3 * i]);
    }
}

static double dot(const double *a, const double *b, unsigned n)
{
    double sum = 0;
    for (unsigned i = 0; i < n; i++) {
        sum += a[i] * b[i];
    }
    return sum;
}

/* Gram-Schmidt, twice over. */
static void make_orthonormal(double vectors[6][18], unsigned count, unsigned n)
{
    for (unsigned i = 0; i < count; i++) {
        for (unsigned pass = 0; pass < 2; pass++) {
            for (unsigned j = 0; j < i; j++) {
                const double share = dot(vectors[i], vectors[j], n);
                for (unsigned k = 0; k < n; k++) {
                    vectors[i][k] -= share * vectors[j][k];
                }
            }
        }
        const double length = sqrt(dot(vectors[i], vectors[i], n));
        for (unsigned k = 0; k < n; k++) {
            vectors[i][k] /= length;
        }
    }
}

static double smallest_eigenvalue(double a[6][6], unsigned n)
{
    for (unsigned sweep = 0; sweep < 40; sweep++) {
        for (unsigned p = 0; p < n; p++) {
            for (unsigned q = p + 1; q < n; q++) {
                const double turn = 0.5 * atan2(2 * a[p][q], a[q][q] - a[p][p]);
                const double c = cos(turn), s = sin(turn);
                for (unsigned k = 0; k < n; k++) {
                    const double x = a[k][p], y = a[k][q];
                    a[k][p] = c * x - s * y;
                    a[k][q] = s * x + c * y;
                }
                for (unsigned k = 0; k < n; k++) {
                    const double x = a[p][k], y = a[q][k];
                    a[p][k] = c * x - s * y;
                    a[q][k] = s * x + c * y;
                }
            }
        }
    }
    double least = a[0][0];
    for (unsigned i = 1; i < n; i++) {
        least = fmin(least, a[i][i]);
    }
    return least;
}

static double model_margin(const pose_t *pose)
{
    static const unsigned k_three[] = {AXIS_ROLL, AXIS_PITCH, AXIS_Z};
    const unsigned n = kin_cylinders(&s_kin);
    double at[POSE_AXES], joints[18], above[18], below[18], motion[6][18] = {{0}}, gram[6][6] = {{0}};
    for (unsigned axis = 0; axis < POSE_AXES; axis++) {
        at[axis] = (double)pose->axis_q32[axis] / 4294967296.0;
    }
    model_joints(at, joints);
    for (unsigned i = 0; i < n; i++) {
        const unsigned axis = n == 6 ? i : k_three[i];
        const double before = at[axis];
        at[axis] = before + STEP;
        model_joints(at, above);
        at[axis] = before - STEP;
        model_joints(at, below);
        at[axis] = before;
        for (unsigned k = 0; k < 3 * n; k++) {
            motion[i][k] = (above[k] - below[k]) / (2 * STEP);
        }
    }
    make_orthonormal(motion, n, 3 * n);
    for (unsigned leg = 0; leg < n; leg++) {
        double way[3];
        for (unsigned k = 0; k < 3; k++) {
            way[k] = joints[3 * leg + k] - s_geometry.base_mm_q16[leg][k] / 65536.0;
        }
        const double length = sqrt(dot(way, way, 3));
        for (unsigned i = 0; i < n; i++) {
            for (unsigned j = 0; j < n; j++) {
                gram[i][j] += dot(way, &motion[i][3 * leg], 3) * dot(way, &motion[j][3 * leg], 3) / (length * length);
            }
        }
    }
    return sqrt(fmax(0, smallest_eigenvalue(gram, n)));
}

static double margin_of(const pose_t *pose)
{
    return (double)kin_margin(&s_kin, pose) / 4294967296.0;
}

/* The value and the comparison, at one pose; returns the error of the value. */
static double check_margin(const pose_t *pose)
{
    const double model = model_margin(pose);
    const double found = margin_of(pose);
    const q32_t lower = llrint((model - 2e-4) * 4294967296.0), higher = llrint((model + 2e-4) * 4294967296.0);
    TEST_ASSERT_TRUE(model < 2.1e-4 || kin_has_margin(&s_kin, pose, lower));
    TEST_ASSERT_FALSE(kin_has_margin(&s_kin, pose, higher));
    TEST_ASSERT_DOUBLE_WITHIN(1e-4, model, found);
    return fabs(model - found);
}

/* ---- tests ---- */

static void test_margin_any_hexapod_matches_the_model(void)
{
    double worst = 0;
    unsigned near_singular = 0;
    for (unsigned n = 0; n < 200; n++) {
        make_any_hexapod();
        for (unsigned i = 0; i < 5; i++) {
            const pose_t pose = any_pose(60, 300);
            near_singular += model_margin(&pose) < 0.1;
            worst = fmax(worst, check_margin(&pose));
        }
    }
    printf("margin of random hexapods: worst error %.2g, %u of 1000 below 0.1\n", worst, near_singular);
    TEST_ASSERT_TRUE(near_singular > 100);
}

static void test_margin_usual_hexapods_matches_the_model(void)
{
    for (unsigned n = 0; n < 100; n++) {
        const double plate = between(150, 900);
        make_hexapod(plate * between(1, 1.5), between(5, 40), plate, between(5, 40), plate * between(1, 2));
        for (unsigned i = 0; i < 5; i++) {
            const pose_t pose = any_pose(25, 100);
            check_margin(&pose);
        }
    }
}

static void test_margin_tripods_match_the_model(void)
{
    for (unsigned n = 0; n < 100; n++) {
        const double plate = between(200, 900);
        make_tripod(n % 2 == 0 ? KIN_TRIPOD : KIN_TRIPOD_3RPS, plate * between(0.5, 2), plate, plate * between(0.5, 2));
        for (unsigned i = 0; i < 5; i++) {
            const pose_t pose = any_pose(35, 100);
            check_margin(&pose);
        }
    }
}

static void test_margin_reference_point_far_away_does_not_matter(void)
{
    for (unsigned n = 0; n < 40; n++) {
        const kin_kind_t kind = n % 2 == 0 ? KIN_HEXAPOD : KIN_TRIPOD_3RPS;
        memset(&s_geometry, 0, sizeof s_geometry);
        if (kind == KIN_HEXAPOD) {
            make_hexapod(300, 20, 250, 25, 400);
        } else {
            make_tripod(kind, 300, 250, 400);
        }
        pose_t pose = any_pose(15, 0);
        kin_constrain(&s_kin, &pose);
        const double here = margin_of(&pose);
        pose_t moved; /* the same place of the plate, as a pose of another reference point */
        move_reference_point(&pose, &moved);
        TEST_ASSERT_EQUAL_INT(HV_OK, kin_init(&s_kin, &s_geometry));
        TEST_ASSERT_DOUBLE_WITHIN(1e-4, here, margin_of(&moved));
        check_margin(&moved);
    }
}

static void test_margin_scale_does_not_matter(void)
{
    make_hexapod(200, 20, 150, 30, 250);
    pose_t pose = any_pose(15, 30);
    const double small = margin_of(&pose);
    make_hexapod(2000, 20, 1500, 30, 2500);
    for (unsigned axis = AXIS_X; axis < POSE_AXES; axis++) {
        pose.axis_q32[axis] *= 10;
    }
    TEST_ASSERT_DOUBLE_WITHIN(2e-5, small, margin_of(&pose));
}

/* Three upper joints, two cylinders each: singular where the plate is turned by 90 deg (Fichter, 1986). */
static void test_margin_6_3_platform_turned_by_90_degrees_is_zero(void)
{
    make_hexapod(600, 10, 400, 0, 700);
    pose_t pose = {{0}};
    TEST_ASSERT_TRUE(margin_of(&pose) > 0.2);
    double last = margin_of(&pose);
    for (int yaw = 10; yaw <= 90; yaw += 10) {
        pose.axis_q32[AXIS_YAW] = yaw * Q32_ONE;
        TEST_ASSERT_TRUE(margin_of(&pose) < last);
        last = margin_of(&pose);
    }
    TEST_ASSERT_TRUE(last < 2e-3);
    TEST_ASSERT_FALSE(kin_has_margin(&s_kin, &pose, KIN_MARGIN_LEAST_Q32));
}

/* Similar hexagons one above the other hold no yaw in any pose. */
static void test_margin_similar_hexagons_is_zero_everywhere(void)
{
    make_hexapod(500, 60, 400, 60, 700);
    for (unsigned n = 0; n < 50; n++) {
        pose_t pose = any_pose(20, 100);
        pose.axis_q32[AXIS_YAW] = 0;
        pose.axis_q32[AXIS_ROLL] = 0;
        pose.axis_q32[AXIS_PITCH] = 0;
        TEST_ASSERT_TRUE(margin_of(&pose) < 2e-3);
        TEST_ASSERT_FALSE(kin_has_margin(&s_kin, &pose, KIN_MARGIN_LEAST_Q32));
    }
}

/* Cylinders that lie in the plane of the plate do not carry it; upright ones carry it as well as can be. */
static void test_margin_tripod_upright_is_one_and_flat_is_zero(void)
{
    make_tripod(KIN_TRIPOD, 400, 400, 700);
    const pose_t zero = {{0}};
    TEST_ASSERT_DOUBLE_WITHIN(1e-4, 1.0, margin_of(&zero));
    make_tripod(KIN_TRIPOD, 900, 300, 0);
    TEST_ASSERT_DOUBLE_WITHIN(1e-4, 0.0, margin_of(&zero));
    make_tripod(KIN_TRIPOD_3RPS, 900, 300, 0);
    TEST_ASSERT_DOUBLE_WITHIN(1e-4, 0.0, margin_of(&zero));
}

static void test_margin_poses_that_cannot_be_is_zero(void)
{
    make_hexapod(600, 10, 400, 20, 700);
    pose_t far = {{0}};
    far.axis_q32[AXIS_X] = INT64_MAX;
    TEST_ASSERT_EQUAL_INT64(0, kin_margin(&s_kin, &far));
    TEST_ASSERT_FALSE(kin_has_margin(&s_kin, &far, 0));
    memcpy(s_geometry.plate_mm_q16, s_geometry.base_mm_q16, sizeof s_geometry.plate_mm_q16); /* cylinders without length */
    s_geometry.zero_height_mm_q16 = 0;
    TEST_ASSERT_EQUAL_INT(HV_OK, kin_init(&s_kin, &s_geometry));
    const pose_t zero = {{0}};
    TEST_ASSERT_EQUAL_INT64(0, kin_margin(&s_kin, &zero));
    TEST_ASSERT_FALSE(kin_has_margin(&s_kin, &zero, 0));
}

/* Nothing overflows, whatever the proportions; sanitizers watch. */
static void test_margin_extreme_mechanisms_stays_within_0_and_1(void)
{
    for (unsigned n = 0; n < 300; n++) {
        s_geometry.kind = n % 3 == 0 ? KIN_HEXAPOD : KIN_TRIPOD;
        for (unsigned i = 0; i < 6; i++) {
            for (unsigned k = 0; k < 3; k++) {
                s_geometry.base_mm_q16[i][k] = to_q16(chance() < 0.5 ? -4000 : 4000);
                s_geometry.plate_mm_q16[i][k] = to_q16(chance() < 0.5 ? -4000 : between(-1, 1));
                s_geometry.mrp_mm_q16[k] = to_q16(chance() < 0.5 ? -4000 : 4000);
            }
            s_geometry.retracted_mm_q16[i] = Q16_ONE;
        }
        s_geometry.zero_height_mm_q16 = n % 2 == 0 ? 0 : 8000 * Q16_ONE;
        TEST_ASSERT_EQUAL_INT(HV_OK, kin_init(&s_kin, &s_geometry));
        const pose_t pose = any_pose(180, 8000);
        const q32_t margin = kin_margin(&s_kin, &pose);
        TEST_ASSERT_TRUE(margin >= 0 && margin <= Q32_ONE);
        TEST_ASSERT_TRUE(margin == 0 || kin_has_margin(&s_kin, &pose, margin));
    }
}

/* Recorded once, anew only where a formula changes. */
static void test_margin_has_the_same_bits_on_every_build(void)
{
    uint64_t digest = UINT64_C(14695981039346656037);
    for (unsigned n = 0; n < 300; n++) {
        s_geometry.kind = KIN_HEXAPOD;
        for (unsigned i = 0; i < 6; i++) {
            for (unsigned k = 0; k < 3; k++) {
                s_geometry.base_mm_q16[i][k] = to_q16(between(-800, 800));
                s_geometry.plate_mm_q16[i][k] = to_q16(between(-600, 600));
            }
            s_geometry.retracted_mm_q16[i] = 500 * Q16_ONE;
        }
        s_geometry.zero_height_mm_q16 = 1000 * Q16_ONE;
        TEST_ASSERT_EQUAL_INT(HV_OK, kin_init(&s_kin, &s_geometry));
        const pose_t pose = any_pose(30, 200);
        digest = (digest ^ (uint64_t)kin_margin(&s_kin, &pose)) * UINT64_C(1099511628211);
    }
    TEST_ASSERT_EQUAL_HEX64(UINT64_C(0x242C10A16AF04315), digest);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_margin_any_hexapod_matches_the_model);
    RUN_TEST(test_margin_usual_hexapods_matches_the_model);
    RUN_TEST(test_margin_tripods_match_the_model);
    RUN_TEST(test_margin_reference_point_far_away_does_not_matter);
    RUN_TEST(test_margin_scale_does_not_matter);
    RUN_TEST(test_margin_6_3_platform_turned_by_90_degrees_is_zero);
    RUN_TEST(test_margin_similar_hexagons_is_zero_everywhere);
    RUN_TEST(test_margin_tripod_upright_is_one_and_flat_is_zero);
    RUN_TEST(test_margin_poses_that_cannot_be_is_zero);
    RUN_TEST(test_margin_extreme_mechanisms_stays_within_0_and_1);
    RUN_TEST(test_margin_has_the_same_bits_on_every_build);
    return UNITY_END();
}
