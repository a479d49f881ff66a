/* SPDX-License-Identifier: MIT
 * count.c - instructions that the kinematics take on a microcontroller, beside the textbook's in double precision by the
 * compiler's own arithmetic: `tools/bench cortex` runs it in an emulator whose time is instructions (-icount shift=0). Before
 * counting, the results are compared. Says one line each: a name, and how many for POSES runs.
 */
#include "../../bench/peers.h"
#include "heave/kin.h"
#include "platform.h"
#include "semihost.h"
#include "start.h"

#define POSES           64u
#define CALIBRATION     1000000u
#define SYSTICK_CONTROL (*(volatile uint32_t *)0xE000E010u)
#define SYSTICK_RELOAD  (*(volatile uint32_t *)0xE000E014u)
#define SYSTICK_VALUE   (*(volatile uint32_t *)0xE000E018u)
#define SYSTICK_MASK    0xFFFFFFu
#define SYSTICK_RUNNING 5u            /* without interrupts, by the processor's clock */
#define FAR_Q32         ((q32_t)4295) /* 1e-6 of mm and degrees */
#define Q32_PER_UNIT    4294967296.0

static kin_t kin;
static peer_hexapod_t hexapod;
static pose_t pose[POSES], guess[POSES], solved;
static double peer_pose[POSES][POSE_AXES], peer_guess[POSES][POSE_AXES], peer_solved[POSE_AXES],
    peer_extension[POSES][CYLINDERS_MAX];
static q32_t extension_mm_q32[POSES][CYLINDERS_MAX];

void start_fail(void)
{
    semihost_say("trap\n");
    semihost_exit(false);
}

void hv_assert_failed(const char *file, int line_number)
{
    (void)file, (void)line_number;
    start_fail();
}

static void require(bool is_good, const char *what)
{
    if (!is_good) {
        semihost_say(what);
        semihost_say("\n");
        semihost_exit(false);
    }
}

static q32_t between(uint32_t *random, q32_t size_q32)
{
    *random ^= *random << 13;
    *random ^= *random >> 17;
    *random ^= *random << 5;
    return fx_mul_shift((q32_t)*random - (q32_t)(UINT32_C(1) << 31), size_q32, 31);
}

static void set_hexapod(const kin_geometry_t *geometry)
{
    hexapod.zero_height = geometry->zero_height_mm_q16 / 65536.0;
    for (unsigned axis = 0; axis < 3; axis++) {
        hexapod.mrp[axis] = geometry->mrp_mm_q16[axis] / 65536.0;
        for (unsigned i = 0; i < CYLINDERS_MAX; i++) {
            hexapod.base[i][axis] = geometry->base_mm_q16[i][axis] / 65536.0;
            hexapod.plate[i][axis] = geometry->plate_mm_q16[i][axis] / 65536.0;
            hexapod.retracted[i] = geometry->retracted_mm_q16[i] / 65536.0;
        }
    }
}

/* Poses all over the workspace, and guesses 0.5 mm and 0.05 degrees beside. */
static void set_poses(void)
{
    static const int32_t k_size[POSE_AXES] = {6, 6, 8, 30, 30, 40};
    uint32_t random = 2463534242u;
    for (unsigned n = 0; n < POSES; n++) {
        for (unsigned i = 0; i < POSE_AXES; i++) {
            pose[n].axis_q32[i] = between(&random, q32_from_int(k_size[i]));
            guess[n].axis_q32[i] = pose[n].axis_q32[i] + between(&random, i < AXIS_X ? Q32_ONE / 20 : Q32_ONE / 2);
            peer_pose[n][i] = (double)pose[n].axis_q32[i] / Q32_PER_UNIT;
            peer_guess[n][i] = (double)guess[n].axis_q32[i] / Q32_PER_UNIT;
        }
    }
}

static bool is_near(q32_t ours_q32, double theirs)
{
    return fx_abs(ours_q32 - (q32_t)(theirs * Q32_PER_UNIT)) < FAR_Q32;
}

static void run_inverse(unsigned n)
{
    require(kin_inverse(&kin, &pose[n], extension_mm_q32[n]) == HV_OK, "kin_inverse");
}

static void run_inverse_double(unsigned n)
{
    peer_inverse(&hexapod, peer_pose[n], peer_extension[n]);
}

static void run_forward(unsigned n)
{
    require(kin_forward(&kin, extension_mm_q32[n], &guess[n], &solved, NULL) == HV_OK, "kin_forward");
}

static void run_forward_double(unsigned n)
{
    require(peer_forward(&hexapod, peer_extension[n], peer_guess[n], peer_solved), "peer_forward");
}

static void run_nothing(unsigned n)
{
    (void)n;
}

static void compare(void)
{
    for (unsigned n = 0; n < POSES; n++) {
        run_inverse(n);
        run_inverse_double(n);
        run_forward(n);
        run_forward_double(n);
        for (unsigned i = 0; i < POSE_AXES; i++) {
            require(is_near(extension_mm_q32[n][i], peer_extension[n][i]), "extensions differ");
            require(is_near(solved.axis_q32[i], peer_solved[i]), "poses differ");
        }
    }
}

/* Ticks since a reading; fewer than 2^24, which are 2^29 instructions. */
static uint32_t ticks_since(uint32_t start)
{
    return (start - SYSTICK_VALUE) & SYSTICK_MASK;
}

static uint32_t ticks_of(void (*run)(unsigned n))
{
    const uint32_t start = SYSTICK_VALUE;
    for (unsigned n = 0; n < POSES; n++) {
        run(n);
    }
    return ticks_since(start);
}

/* Ticks of a million instructions: what a tick is, is not taken for granted. */
static uint32_t ticks_of_calibration(void)
{
    uint32_t left = CALIBRATION / 2;
    const uint32_t start = SYSTICK_VALUE;
    __asm__ volatile(".syntax unified\n1: subs %0, %0, #1\n bne 1b" : "+l"(left) : : "cc");
    return ticks_since(start);
}

int main(void)
{
    set_hexapod(&k_platform.geometry);
    require(kin_init(&kin, &k_platform.geometry) == HV_OK, "kin_init");
    set_poses();
    compare();
    SYSTICK_RELOAD = SYSTICK_MASK;
    SYSTICK_VALUE = 0;
    SYSTICK_CONTROL = SYSTICK_RUNNING;
    semihost_say_number("runs", POSES);
    semihost_say_number("calibration", ticks_of_calibration());
    semihost_say_number("nothing", ticks_of(run_nothing));
    semihost_say_number("inverse-heave", ticks_of(run_inverse));
    semihost_say_number("inverse-double", ticks_of(run_inverse_double));
    semihost_say_number("forward-heave", ticks_of(run_forward));
    semihost_say_number("forward-double", ticks_of(run_forward_double));
    semihost_exit(true);
    return 0;
}
