/* SPDX-License-Identifier: MIT
 * main.c - uses kinematics and ramps of Heave's core without heaved: calculates the cylinder extensions of a pose, and moves the
 * cylinders there from pose zero. Prints one CSV row every 50 ms until every cylinder is at rest.
 */
#include <stdio.h>
#include <stdlib.h>

#include <heave/kin.h>
#include <heave/ramp.h>

#define MM(value)   ((q16_t)((value)*65536.0 + ((value) < 0 ? -0.5 : 0.5))) /* mm to Q16.16, for constants */
#define CYCLE_US    1000u
#define PRINT_EVERY 50
#define CYCLES_MAX  10000

/* The geometry of config/demo-hexapod.ini. */
static const kin_geometry_t k_geometry = {
    .kind = KIN_HEXAPOD,
    .base_mm_q16 = {{MM(415.913), MM(-58.453), 0},
                    {MM(415.913), MM(58.453), 0},
                    {MM(-157.335), MM(389.417), 0},
                    {MM(-258.578), MM(330.965), 0},
                    {MM(-258.578), MM(-330.965), 0},
                    {MM(-157.335), MM(-389.417), 0}},
    .plate_mm_q16 = {{MM(192.836), MM(-229.813), 0},
                     {MM(192.836), MM(229.813), 0},
                     {MM(102.606), MM(281.908), 0},
                     {MM(-295.442), MM(52.094), 0},
                     {MM(-295.442), MM(-52.094), 0},
                     {MM(102.606), MM(-281.908), 0}},
    .retracted_mm_q16 = {MM(520), MM(520), MM(520), MM(520), MM(520), MM(520)},
    .zero_height_mm_q16 = MM(540),
};

/* The core calls this if a caller breaks a contract. */
void hv_assert_failed(const char *file, int line)
{
    fprintf(stderr, "%s:%d: assertion failed\n", file, line);
    abort();
}

static void must(hv_status_t status, const char *what)
{
    if (status != HV_OK) {
        fprintf(stderr, "%s: error %d\n", what, (int)status);
        exit(EXIT_FAILURE);
    }
}

static double to_mm(q32_t value_q32)
{
    return (double)value_q32 / (double)Q32_ONE;
}

/* Moves each ramp by one cycle. Returns whether all are at rest on their targets. */
static bool step(ramp_t ramp[CYLINDERS_MAX], const q32_t target_q32[CYLINDERS_MAX])
{
    bool is_done = true;
    for (unsigned i = 0; i < CYLINDERS_MAX; i++) {
        const ramp_ref_t ref = {.pos_q32 = target_q32[i]};
        is_done = ramp_step(&ramp[i], &ref, RAMP_FIRM) == target_q32[i] && ramp_is_at_rest(&ramp[i]) && is_done;
    }
    return is_done;
}

static void print(double t_ms, const ramp_t ramp[CYLINDERS_MAX])
{
    printf("%.0f", t_ms);
    for (unsigned i = 0; i < CYLINDERS_MAX; i++) {
        printf(",%.3f", to_mm(ramp[i].state.pos_q32));
    }
    printf("\n");
}

int main(void)
{
    const pose_t zero = {{0}};
    const pose_t target = {.axis_q32 = {[AXIS_ROLL] = 5 * Q32_ONE, [AXIS_PITCH] = 6 * Q32_ONE, [AXIS_Z] = 20 * Q32_ONE}};
    q32_t start_mm_q32[CYLINDERS_MAX];
    q32_t end_mm_q32[CYLINDERS_MAX];
    ramp_limits_t limits;
    ramp_t ramp[CYLINDERS_MAX];
    kin_t kin;

    must(kin_init(&kin, &k_geometry), "geometry");
    must(kin_inverse(&kin, &zero, start_mm_q32), "pose zero");
    must(kin_inverse(&kin, &target, end_mm_q32), "target");
    /* stroke 0 to 200 mm, 300 mm/s, 3000 mm/s^2, 50000 mm/s^3 */
    must(ramp_limits_from_units(0, MM(200), MM(300), MM(3000), 50000, CYCLE_US, &limits), "limits");
    for (unsigned i = 0; i < CYLINDERS_MAX; i++) {
        must(ramp_init(&ramp[i], &limits, start_mm_q32[i]), "ramp");
    }

    printf("t_ms,c1_mm,c2_mm,c3_mm,c4_mm,c5_mm,c6_mm\n");
    print(0, ramp);
    for (int cycle = 1; cycle <= CYCLES_MAX; cycle++) {
        const bool is_done = step(ramp, end_mm_q32);
        if (is_done || cycle % PRINT_EVERY == 0) {
            print(cycle * (CYCLE_US / 1000.0), ramp);
        }
        if (is_done) {
            return EXIT_SUCCESS;
        }
    }
    fprintf(stderr, "not at rest after %d cycles\n", CYCLES_MAX);
    return EXIT_FAILURE;
}
