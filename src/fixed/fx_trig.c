/* SPDX-License-Identifier: MIT
 * fx_trig.c - sine and cosine in Q62.
 * The angle is an exact number of steps of 1.40625 degrees (64 to a quadrant) plus a rest of at most half a step. A table gives
 * the step, short series the rest, the addition theorem joins them. Small terms are carried in formats finer than Q62, so what
 * remains is half an LSB of the table, half of the last rounding, and little else: below 2 LSB. The noise of kinematics is
 * differentiated three times at the cycle rate, which is why this is far finer than any pose needs.
 */
#include "heave/fx.h"

#define STEPS_PER_QUADRANT 64u
#define TURN_Q32           (360 * Q32_ONE)
#define STEP_Q32           ((uint64_t)TURN_Q32 / (4 * STEPS_PER_QUADRANT)) /* 1.40625 degrees: exact */
#define INVERSE_45_Q64     INT64_C(409927646082434481)
#define RAD_PER_DEG_Q68    INT64_C(5151302725743731799)

/* sin(i * 90 / 64 degrees) in Q62. */
static const q62_t k_sine_q62[STEPS_PER_QUADRANT + 1] = {
    INT64_C(0),
    INT64_C(113176440454146016),
    INT64_C(226284707652502141),
    INT64_C(339256669404298611),
    INT64_C(452024275624069880),
    INT64_C(564519599322481549),
    INT64_C(676674877523008785),
    INT64_C(788422552079819562),
    INT64_C(899695310372275547),
    INT64_C(1010426125851537790),
    INT64_C(1120548298414853464),
    INT64_C(1229995494583203681),
    INT64_C(1338701787458110889),
    INT64_C(1446601696433537347),
    INT64_C(1553630226638953726),
    INT64_C(1659722908089818799),
    INT64_C(1764815834521887442),
    INT64_C(1868845701885954606),
    INT64_C(1971749846479847467),
    INT64_C(2073466282694696471),
    INT64_C(2173933740352748318),
    INT64_C(2273091701614230011),
    INT64_C(2370880437431032621),
    INT64_C(2467241043525256456),
    INT64_C(2562115475870945497),
    INT64_C(2655446585657638225),
    INT64_C(2747178153714674114),
    INT64_C(2837254924375519865),
    INT64_C(2925622638761716784),
    INT64_C(3012228067466400296),
    INT64_C(3097019042617704261),
    INT64_C(3179944489302736311),
    INT64_C(3260954456333195553),
    INT64_C(3340000146334100615),
    INT64_C(3417033945137503676),
    INT64_C(3492009450463484836),
    INT64_C(3564881499871150442),
    INT64_C(3635606197962798751),
    INT64_C(3704140942824866152),
    INT64_C(3770444451689726907),
    INT64_C(3834476785802888710),
    INT64_C(3896199374480604983),
    INT64_C(3955575038343412514),
    INT64_C(4012568011711599423),
    INT64_C(4067143964149113252),
    INT64_C(4119270021142931949),
    INT64_C(4168914783905441250),
    INT64_C(4216048348287890265),
    INT64_C(4260642322793532497),
    INT64_C(4302669845679601858),
    INT64_C(4342105601137822079),
    INT64_C(4378925834543703005),
    INT64_C(4413108366765438139),
    INT64_C(4444632607523784314),
    INT64_C(4473479567794875989),
    INT64_C(4499631871248503178),
    INT64_C(4523073764714963030),
    INT64_C(4543791127674180203),
    INT64_C(4561771480761380163),
    INT64_C(4577003993284191887),
    INT64_C(4589479489746651964),
    INT64_C(4599190455376180266),
    INT64_C(4606131040650197959),
    INT64_C(4610297064819661174),
    INT64_C(4611686018427387904),
};

/* The step nearest to an angle, and whole turns of them. STEP_Q32 is 45 * 2^27; 2^37 steps, which make the quotient positive, are
 * a multiple of 2^64 in Q32, so that step * STEP_Q32 does without them. */
static uint64_t nearest_step(q32_t angle_deg_q32)
{
    const int64_t halves = fx_shift_down(angle_deg_q32, 26) + 45;
    return (uint64_t)fx_mul_high_here(fx_shift_down(halves, 1) + 45 * (INT64_C(1) << 37), INVERSE_45_Q64);
}

/* -1 where a bit of a number is set, else 0. */
HV_WRAPS static int64_t mask_of_bit(uint64_t number, unsigned bit)
{
    return fx_shift_down((int64_t)(number << (63 - bit)), 63);
}

/* value, or -value if the mask is -1. */
static q62_t negate_if(int64_t mask, q62_t value)
{
    return (value ^ mask) - mask;
}

/* x - sin(x) for |x| <= 0.0123, in Q67: the next term, x^9 / 9!, is below 2^-75. */
static int64_t sine_deficit_q67(int64_t x_q67, int64_t square_q70)
{
    const int64_t inner_q56 = (INT64_C(1) << 56) / 120 - fx_mul_high(square_q70, (INT64_C(1) << 50) / 5040);
    const int64_t outer_q62 = Q62_ONE / 6 - fx_mul_high_here(square_q70, inner_q56);
    return fx_shift_down(fx_mul_high_here(x_q67, fx_mul_high_here(square_q70, outer_q62)), 4);
}

/* 1 - cos(x) for |x| <= 0.0123, in Q68: the next term, x^8 / 8!, is below 0.06 LSB of Q62. */
static int64_t cosine_deficit_q68(int64_t square_q70)
{
    const int64_t inner_q56 = (INT64_C(1) << 56) / 24 - fx_mul_high(square_q70, (INT64_C(1) << 50) / 720);
    const int64_t outer_q62 = Q62_ONE / 2 - fx_mul_high_here(square_q70, inner_q56);
    return fx_mul_high_here(square_q70, outer_q62);
}

HV_WRAPS HV_INNER_LOOP void fx_sincos_deg(q32_t angle_deg_q32, q62_t *sin_q62, q62_t *cos_q62)
{
    const uint64_t step = nearest_step(angle_deg_q32);
    const q32_t rest_deg_q32 = (q32_t)((uint64_t)angle_deg_q32 - step * STEP_Q32);
    //@ assert nearest: -STEP_Q32 / 2 <= rest_deg_q32 <= STEP_Q32 / 2;

    const int64_t rest_q67 = fx_mul_high_here(rest_deg_q32 * (INT64_C(1) << 31), RAD_PER_DEG_Q68); /* from Q63 degrees */
    const int64_t square_q70 = fx_mul_high_here(rest_q67, rest_q67);
    const int64_t rest_sin_q67 = rest_q67 - sine_deficit_q67(rest_q67, square_q70);
    const int64_t deficit_q68 = cosine_deficit_q68(square_q70);

    /* Masks instead of branches: signs of small angles are as good as random. */
    const int64_t falling = mask_of_bit(step, 6);
    //@ split falling;
    const int64_t index = ((int64_t)(step % STEPS_PER_QUADRANT) ^ falling) + (falling & (int64_t)(STEPS_PER_QUADRANT + 1));
    const q62_t sine = negate_if(mask_of_bit(step, 7), k_sine_q62[index]);
    const q62_t cosine = negate_if(mask_of_bit(step + STEPS_PER_QUADRANT, 7), k_sine_q62[(int64_t)STEPS_PER_QUADRANT - index]);
    const int64_t sine_change_q66 = 2 * fx_mul_high_here(cosine, rest_sin_q67) - fx_mul_high_here(sine, deficit_q68);
    const int64_t cosine_change_q66 = 2 * fx_mul_high_here(sine, rest_sin_q67) + fx_mul_high_here(cosine, deficit_q68);
    *sin_q62 = sine + ((sine_change_q66 + 8) >> 4);
    *cos_q62 = cosine - ((cosine_change_q66 + 8) >> 4);
}
