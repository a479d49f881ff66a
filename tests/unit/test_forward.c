/* SPDX-License-Identifier: MIT
 * test_forward.c - the forward solution over the whole workspace of every platform there is: those of the reference data and
 * every file in config/. Poses within the stroke and on its edge, each found again from neutral, from a pose beside it and from
 * anywhere else in the workspace nearby, in bounded steps, to 0.001 mm and 0.0001 deg. Prints the worst.
 */
#include <dirent.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "config/config.h"
#include "platform/load.h"
#include "random.h"
#include "unity.h"

#define ERROR_MM_Q32  (Q32_ONE / 1000)
#define ERROR_DEG_Q32 (Q32_ONE / 10000)
#define POSES         1500u
#define HALVINGS      30
#define GRID          5u

/* A platform: its mechanism, its stroke and a box that is wider than its workspace. */
typedef struct {
    char name[280];
    kin_t kin;
    q32_t low_q32[CYLINDERS_MAX], high_q32[CYLINDERS_MAX]; /* extensions */
    pose_t neutral;
    double range[POSE_AXES]; /* to both sides of neutral */
} platform_t;

static platform_t m_platform;
static config_t m_config;
static unsigned m_most, m_count, m_near_most;
static q32_t m_worst_mm_q32, m_worst_deg_q32;

void setUp(void)
{
    random_begin(RANDOM_SEED);
}

void tearDown(void) {}

static bool is_free(unsigned axis)
{
    return m_platform.kin.kind == KIN_HEXAPOD || axis == AXIS_ROLL || axis == AXIS_PITCH || axis == AXIS_Z;
}

static pose_t pose_at(const double way[POSE_AXES], double share)
{
    pose_t pose = m_platform.neutral;
    for (unsigned axis = 0; axis < POSE_AXES; axis++) {
        pose.axis_q32[axis] += is_free(axis) ? (q32_t)llround(way[axis] * share * (double)Q32_ONE) : 0;
    }
    kin_constrain(&m_platform.kin, &pose);
    return pose;
}

static bool is_inside(const pose_t *pose)
{
    q32_t extension_q32[CYLINDERS_MAX];
    if (kin_inverse(&m_platform.kin, pose, extension_q32) != HV_OK) {
        return false;
    }
    for (unsigned i = 0; i < kin_cylinders(&m_platform.kin); i++) {
        if (extension_q32[i] < m_platform.low_q32[i] || extension_q32[i] > m_platform.high_q32[i]) {
            return false;
        }
    }
    return true;
}

/* The share of a way from neutral at which it first leaves the stroke; 1 where it does not. */
static double edge_of(const double way[POSE_AXES])
{
    double inside = 0, outside = 1;
    for (int i = 1; i <= 64; i++) {
        const pose_t pose = pose_at(way, i / 64.0);
        if (!is_inside(&pose)) {
            outside = i / 64.0;
            break;
        }
        inside = i / 64.0;
    }
    for (int i = 0; i < HALVINGS && inside < 1; i++) {
        const double middle = (inside + outside) / 2;
        const pose_t pose = pose_at(way, middle);
        *(is_inside(&pose) ? &inside : &outside) = middle;
    }
    return inside;
}

static void expect_found(const pose_t *pose, const pose_t *guess, const char *from, unsigned *most)
{
    static char text[800];
    q32_t extension_q32[CYLINDERS_MAX];
    pose_t found;
    unsigned steps = 0;
    TEST_ASSERT_EQUAL_INT(HV_OK, kin_inverse(&m_platform.kin, pose, extension_q32));
    const hv_status_t status = kin_forward(&m_platform.kin, extension_q32, guess, &found, &steps);
    snprintf(text, sizeof text, "%s from %s: %.3f %.3f %.3f deg %.2f %.2f %.2f mm, %u steps", m_platform.name, from,
             (double)pose->axis_q32[0] / Q32_ONE, (double)pose->axis_q32[1] / Q32_ONE, (double)pose->axis_q32[2] / Q32_ONE,
             (double)pose->axis_q32[3] / Q32_ONE, (double)pose->axis_q32[4] / Q32_ONE, (double)pose->axis_q32[5] / Q32_ONE,
             steps);
    TEST_ASSERT_EQUAL_INT_MESSAGE(HV_OK, status, text);
    TEST_ASSERT_TRUE_MESSAGE(steps <= KIN_FORWARD_ITERATIONS_MAX, text);
    for (unsigned axis = 0; axis < POSE_AXES; axis++) {
        const q32_t error_q32 = fx_abs(found.axis_q32[axis] - pose->axis_q32[axis]);
        q32_t *worst = axis < AXIS_X ? &m_worst_deg_q32 : &m_worst_mm_q32;
        *worst = error_q32 > *worst ? error_q32 : *worst;
        TEST_ASSERT_TRUE_MESSAGE(error_q32 <= (axis < AXIS_X ? ERROR_DEG_Q32 : ERROR_MM_Q32), text);
    }
    *most = steps > *most ? steps : *most;
    m_count++;
}

/* From neutral, and from beside it: as far as a platform at full speed goes in tens of ms. */
static void expect_all(const pose_t *pose)
{
    double beside[POSE_AXES];
    pose_t near = *pose;
    expect_found(pose, &m_platform.neutral, "neutral", &m_most);
    for (unsigned axis = 0; axis < POSE_AXES; axis++) {
        beside[axis] = random_between(-1, 1) * (axis < AXIS_X ? 3 : 20);
        near.axis_q32[axis] += is_free(axis) ? (q32_t)(beside[axis] * (double)Q32_ONE) : 0;
    }
    expect_found(pose, &near, "beside", &m_near_most);
}

/* A way in a random direction whose axes are all in play, or some of them only: the corners and the axes themselves. */
static void random_way(double way[POSE_AXES])
{
    for (unsigned axis = 0; axis < POSE_AXES; axis++) {
        const double part = random_between(-1, 1);
        way[axis] = random_between(-1, 1) < -0.3 ? 0 : part * m_platform.range[axis];
    }
}

static void check_grid(void)
{
    const unsigned points = m_platform.kin.kind == KIN_HEXAPOD ? GRID : 4 * GRID + 1;
    unsigned count = 1;
    for (unsigned axis = 0; axis < POSE_AXES; axis++) {
        count *= is_free(axis) ? points : 1;
    }
    for (unsigned index = 0; index < count; index++) {
        double way[POSE_AXES] = {0};
        unsigned rest = index;
        for (unsigned axis = 0; axis < POSE_AXES; axis++) {
            if (is_free(axis)) {
                way[axis] = (2.0 * (rest % points) / (points - 1) - 1) * m_platform.range[axis] / 2;
                rest /= points;
            }
        }
        const pose_t pose = pose_at(way, 1);
        if (is_inside(&pose)) {
            expect_found(&pose, &m_platform.neutral, "neutral", &m_most);
        }
    }
}

static void check_platform(void)
{
    m_most = m_near_most = m_count = 0;
    m_worst_mm_q32 = m_worst_deg_q32 = 0;
    TEST_ASSERT_TRUE_MESSAGE(is_inside(&m_platform.neutral), m_platform.name);
    check_grid();
    for (unsigned i = 0; i < POSES; i++) {
        double way[POSE_AXES];
        random_way(way);
        const double edge = edge_of(way);
        const pose_t at_edge = pose_at(way, edge), within = pose_at(way, edge * fabs(random_between(-1, 1)));
        expect_all(&at_edge);
        expect_all(&within);
        expect_found(&within, &at_edge, "the edge", &m_near_most);
    }
    printf("forward %-28s %6u solutions, worst %.1e mm %.1e deg, most steps %u from neutral, %u from elsewhere\n",
           m_platform.name, m_count, (double)m_worst_mm_q32 / Q32_ONE, (double)m_worst_deg_q32 / Q32_ONE, m_most, m_near_most);
    TEST_ASSERT_TRUE(m_count > 5 * POSES);
}

/* Angles as far as any platform here goes; translations by the stroke. */
static void set_range(double stroke_mm)
{
    static const double k_range[POSE_AXES] = {60, 60, 90, 2, 2, 1};
    for (unsigned axis = 0; axis < POSE_AXES; axis++) {
        m_platform.range[axis] = axis < AXIS_X ? k_range[axis] : k_range[axis] * stroke_mm;
    }
}

static void test_forward_over_the_workspace_of_every_ready_made_platform(void)
{
    DIR *folder = opendir(HEAVE_CONFIG_DIR);
    const struct dirent *entry;
    unsigned platforms = 0;
    TEST_ASSERT_NOT_NULL(folder);
    while ((entry = readdir(folder)) != NULL) {
        char path[600];
        if (strstr(entry->d_name, ".ini") == NULL) {
            continue;
        }
        snprintf(path, sizeof path, "%s/%s", HEAVE_CONFIG_DIR, entry->d_name);
        TEST_ASSERT_EQUAL_INT_MESSAGE(0, config_load(path, &m_config, stderr), path);
        const settings_t *settings = &m_config.settings;
        snprintf(m_platform.name, sizeof m_platform.name, "%s", entry->d_name);
        TEST_ASSERT_EQUAL_INT(HV_OK, kin_init(&m_platform.kin, &settings->geometry));
        for (unsigned i = 0; i < kin_cylinders(&m_platform.kin); i++) {
            m_platform.low_q32[i] = 0;
            m_platform.high_q32[i] = q32_from_q16(settings->stroke_mm_q16[i]);
        }
        for (unsigned axis = 0; axis < POSE_AXES; axis++) {
            m_platform.neutral.axis_q32[axis] = q32_from_q16(settings->neutral_q16[axis]);
        }
        kin_constrain(&m_platform.kin, &m_platform.neutral);
        set_range((double)settings->stroke_mm_q16[0] / Q16_ONE);
        check_platform();
        platforms++;
    }
    closedir(folder);
    TEST_ASSERT_GREATER_OR_EQUAL_UINT(7, platforms);
}

static void take_row(const char *line, kin_geometry_t *geometry)
{
    char item[16];
    unsigned leg;
    int32_t at[3];
    TEST_ASSERT_EQUAL_INT(5, sscanf(line, "%15[^,],%u,%" SCNd32 ",%" SCNd32 ",%" SCNd32, item, &leg, &at[0], &at[1], &at[2]));
    if (strcmp(item, "z0") == 0) {
        geometry->zero_height_mm_q16 = at[2];
    } else if (strcmp(item, "retracted") == 0) {
        geometry->retracted_mm_q16[leg - 1] = at[0];
    } else if (strcmp(item, "stroke") == 0) {
        m_platform.high_q32[leg - 1] = q32_from_q16(at[0]);
    } else {
        memcpy(strcmp(item, "base") == 0 ? geometry->base_mm_q16[leg - 1] : geometry->plate_mm_q16[leg - 1], at, sizeof at);
    }
}

static void test_forward_over_the_workspace_of_the_reference_platforms(void)
{
    static const struct {
        const char *name;
        kin_kind_t kind;
    } k_platforms[] = {{"hex_small", KIN_HEXAPOD},
                       {"hex_large", KIN_HEXAPOD},
                       {"hex_asym", KIN_HEXAPOD},
                       {"tri_post", KIN_TRIPOD},
                       {"tri_rps", KIN_TRIPOD_3RPS}};
    for (size_t p = 0; p < sizeof k_platforms / sizeof k_platforms[0]; p++) {
        char path[300], line[128];
        kin_geometry_t geometry;
        memset(&geometry, 0, sizeof geometry);
        memset(&m_platform, 0, sizeof m_platform);
        geometry.kind = k_platforms[p].kind;
        snprintf(m_platform.name, sizeof m_platform.name, "%s", k_platforms[p].name);
        snprintf(path, sizeof path, "%s/kin_geo_%s.csv", HEAVE_TEST_DATA, k_platforms[p].name);
        FILE *file = fopen(path, "r");
        TEST_ASSERT_NOT_NULL_MESSAGE(file, path);
        TEST_ASSERT_NOT_NULL(fgets(line, sizeof line, file));
        while (fgets(line, sizeof line, file) != NULL) {
            take_row(line, &geometry);
        }
        fclose(file);
        TEST_ASSERT_EQUAL_INT(HV_OK, kin_init(&m_platform.kin, &geometry));
        set_range((double)m_platform.high_q32[0] / (double)Q32_ONE);
        check_platform();
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_forward_over_the_workspace_of_every_ready_made_platform);
    RUN_TEST(test_forward_over_the_workspace_of_the_reference_platforms);
    return UNITY_END();
}
