/* SPDX-License-Identifier: MIT
 * test_fx.c - fixed-point arithmetic against 128-bit integers, exact inequalities and 80-digit reference sines.
 * Both forms of the wide product are compared on hostile and on random input, so that a CPU without 128-bit integers is covered.
 */
#include "heave/fx.h"
#include "unity.h"

#include <float.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

static uint64_t s_random;

void setUp(void)
{
    s_random = UINT64_C(0x9E3779B97F4A7C15);
}
void tearDown(void) {}

/* xorshift64*: the same sequence everywhere. */
static uint64_t next_random(void)
{
    s_random ^= s_random >> 12;
    s_random ^= s_random << 25;
    s_random ^= s_random >> 27;
    return s_random * UINT64_C(2685821657736338717);
}

/* A random value of random width, so that small ones are as likely as large ones. */
static int64_t next_spread(void)
{
    const unsigned width = (unsigned)(next_random() % 64);
    return (int64_t)next_random() >> width;
}

static const int64_t k_hostile[] = {0,
                                    1,
                                    -1,
                                    2,
                                    -2,
                                    3,
                                    -3,
                                    32767,
                                    65535,
                                    65536,
                                    -65536,
                                    INT32_MAX,
                                    INT32_MIN,
                                    (int64_t)UINT32_MAX,
                                    Q32_ONE,
                                    -Q32_ONE,
                                    Q32_ONE + 1,
                                    Q62_ONE,
                                    -Q62_ONE,
                                    Q62_ONE - 1,
                                    Q62_ONE + 1,
                                    -Q62_ONE - 1,
                                    INT64_MAX,
                                    INT64_MAX - 1,
                                    INT64_MIN,
                                    INT64_MIN + 1,
                                    INT64_C(0x5555555555555555),
                                    INT64_C(-0x5555555555555555)};
#define HOSTILE_COUNT (sizeof k_hostile / sizeof k_hostile[0])

static void test_mul_shift_known_products_round_half_up(void)
{
    TEST_ASSERT_EQUAL_INT64(2, fx_mul_shift(3, 1, 1));   /* 1.5 */
    TEST_ASSERT_EQUAL_INT64(-1, fx_mul_shift(-3, 1, 1)); /* -1.5 */
    TEST_ASSERT_EQUAL_INT64(-2, fx_mul_shift(-7, 1, 2)); /* -1.75 */
    TEST_ASSERT_EQUAL_INT64(Q62_ONE, fx_mul_shift(Q62_ONE, Q62_ONE, 62));
    TEST_ASSERT_EQUAL_INT64(INT64_MAX, fx_mul_shift(INT64_MAX, 4, 1));
    TEST_ASSERT_EQUAL_INT64(INT64_MIN, fx_mul_shift(INT64_MAX, -4, 1));
    TEST_ASSERT_EQUAL_INT64(INT64_MAX, fx_mul_shift(INT64_MIN, INT64_MIN, 1));
    TEST_ASSERT_EQUAL_INT64(1, fx_mul_shift(INT64_MIN, INT64_MIN, 126));
    TEST_ASSERT_EQUAL_INT64(INT64_MIN, fx_mul_shift(INT64_MIN, 2, 1));
    TEST_ASSERT_EQUAL_INT64(INT64_MAX, fx_mul_shift(INT64_MIN, -2, 1));
}

/* The portable form against an independent statement of the contract: floor((a * b + half) / 2^shift), by long multiplication
 * of halves in a wider-than-needed sum of 32-bit digits. */
static int64_t mul_shift_by_digits(int64_t a, int64_t b, unsigned shift)
{
    const int negative = (a < 0) != (b < 0);
    const uint64_t p = a < 0 ? 0 - (uint64_t)a : (uint64_t)a, q = b < 0 ? 0 - (uint64_t)b : (uint64_t)b;
    uint8_t bit[130] = {0};
    for (unsigned i = 0; i < 64; i++) {
        unsigned carry = 0;
        for (unsigned j = 0; ((q >> i) & 1) != 0 && i + j < 130; j++) {
            const unsigned sum = bit[i + j] + (j < 64 ? (unsigned)(p >> j) & 1 : 0) + carry;
            bit[i + j] = sum & 1;
            carry = sum >> 1;
        }
    }
    unsigned below = 0; /* is there anything under the half bit */
    for (unsigned i = 0; i + 1 < shift; i++) {
        below |= bit[i];
    }
    uint64_t whole = 0;
    unsigned above = 0;
    for (unsigned i = shift; i < 130; i++) {
        if (i - shift < 64) {
            whole |= (uint64_t)bit[i] << (i - shift);
        } else {
            above |= bit[i];
        }
    }
    const unsigned rounds_up = negative ? bit[shift - 1] && below : bit[shift - 1];
    if (above != 0 || whole > (uint64_t)INT64_MAX) {
        const int is_exact_minimum = negative && above == 0 && whole == (uint64_t)1 << 63 && rounds_up == 0;
        return is_exact_minimum || negative ? INT64_MIN : INT64_MAX;
    }
    whole += rounds_up;
    if (negative) {
        return whole > (uint64_t)INT64_MAX ? INT64_MIN : -(int64_t)whole;
    }
    return whole > (uint64_t)INT64_MAX ? INT64_MAX : (int64_t)whole;
}

static void check_mul_shift(int64_t a, int64_t b, unsigned shift, int64_t expected)
{
    char message[120];
    snprintf(message, sizeof message, "%" PRId64 " * %" PRId64 " >> %u", a, b, shift);
    TEST_ASSERT_EQUAL_INT64_MESSAGE(expected, fx_mul_shift(a, b, shift), message);
    TEST_ASSERT_EQUAL_INT64_MESSAGE(expected, fx_wide_mul_shift_portable(a, b, shift), message);
#if defined(__SIZEOF_INT128__)
    TEST_ASSERT_EQUAL_INT64_MESSAGE(expected, fx_wide_mul_shift_native(a, b, shift), message);
#endif
}

static void test_mul_shift_hostile_values_match_bit_by_bit_product(void)
{
    for (size_t i = 0; i < HOSTILE_COUNT; i++) {
        for (size_t j = 0; j < HOSTILE_COUNT; j++) {
            for (unsigned shift = 1; shift <= 126; shift += shift > 58 && shift < 67 ? 1 : 5) {
                check_mul_shift(k_hostile[i], k_hostile[j], shift, mul_shift_by_digits(k_hostile[i], k_hostile[j], shift));
            }
        }
    }
}

static void test_mul_shift_random_values_match_bit_by_bit_product(void)
{
    for (int i = 0; i < 5000; i++) {
        const int64_t a = next_spread(), b = next_spread();
        const unsigned shift = 1 + (unsigned)(next_random() % 126);
        check_mul_shift(a, b, shift, mul_shift_by_digits(a, b, shift));
    }
}

static int64_t below_high_limit(int64_t value)
{
    return value < FX_HIGH_LIMIT ? value : FX_HIGH_LIMIT - 1;
}

/* A whole multiple of 2^32 from -2^61 to 2^61. */
static int64_t coarse_factor(int64_t value)
{
    const int64_t coarse = (int64_t)((uint64_t)value & ~(uint64_t)UINT32_MAX);
    return coarse > Q62_ONE / 2 ? Q62_ONE / 2 : coarse < -Q62_ONE / 2 ? -Q62_ONE / 2 : coarse;
}

/* floor(a * b / 2^64), from a * b / 2^64 rounded half up. */
static int64_t mul_high_by_digits(int64_t a, int64_t b)
{
    const int64_t nearest = mul_shift_by_digits(a, b, 64);
    return nearest - (int64_t)(((uint64_t)a * (uint64_t)b) >> 63);
}

static void test_mul_high_hostile_values_match_bit_by_bit_product(void)
{
    for (size_t i = 0; i < HOSTILE_COUNT; i++) {
        for (size_t j = 0; j < HOSTILE_COUNT; j++) {
            const int64_t a[2] = {below_high_limit(k_hostile[i]), below_high_limit(k_hostile[j])};
            const int64_t expected = mul_high_by_digits(a[0], a[1]);
            TEST_ASSERT_EQUAL_INT64(expected, fx_mul_high(a[0], a[1]));
            TEST_ASSERT_EQUAL_INT64(expected, fx_mul_high_here(a[0], a[1]));
            TEST_ASSERT_EQUAL_INT64(expected, fx_wide_mul_high_portable(a[0], a[1]));
            const int64_t b[2] = {coarse_factor(k_hostile[j]), coarse_factor(k_hostile[i])};
            const int64_t dot = mul_high_by_digits(a[0], b[0]) + mul_high_by_digits(a[1], b[1]);
            TEST_ASSERT_EQUAL_INT64(dot, fx_dot2_high(a, b));
            TEST_ASSERT_EQUAL_INT64(dot, fx_wide_dot2_high_portable(a, b));
        }
    }
}

#if defined(__SIZEOF_INT128__)
static void test_wide_forms_random_values_give_the_same_bits(void)
{
    unsigned differences = 0;
    for (int i = 0; i < 1000000; i++) {
        const int64_t a = next_spread(), b = next_spread();
        const unsigned shift = 1 + (unsigned)(next_random() % 126);
        differences += fx_wide_mul_shift_native(a, b, shift) != fx_wide_mul_shift_portable(a, b, shift);
        const int64_t factor[2] = {below_high_limit(a), below_high_limit(b)};
        differences += fx_wide_mul_high_native(factor[0], factor[1]) != fx_wide_mul_high_portable(factor[0], factor[1]);
        const int64_t coarse[2] = {coarse_factor(a ^ b), coarse_factor(fx_sub_sat(a, b / 2))};
        differences += fx_wide_dot2_high_native(factor, coarse) != fx_wide_dot2_high_portable(factor, coarse);
        const int64_t v[3] = {a >> 2, b >> 2, (a ^ b) >> 2};
        const fx_u128_t sum = fx_wide_square3_native(v), other_sum = fx_wide_square3_portable(v);
        differences += sum.hi != other_sum.hi || sum.lo != other_sum.lo;
        const fx_u128_t p = fx_wide_product_native((uint64_t)a, (uint64_t)b);
        const fx_u128_t q = fx_wide_product_portable((uint64_t)a, (uint64_t)b);
        differences += p.hi != q.hi || p.lo != q.lo;
    }
    TEST_ASSERT_EQUAL_UINT(0, differences);
}

/* fx_mul_div by the compiler's 128-bit division. */
static int64_t mul_div_reference(int64_t a, int64_t b, int64_t divisor)
{
    const fx_wide_int_t product = (fx_wide_int_t)a * b;
    const fx_wide_int_t quotient = product / divisor;
    return quotient > INT64_MAX ? INT64_MAX : quotient < INT64_MIN ? INT64_MIN : (int64_t)quotient;
}

static void test_mul_div_hostile_and_random_values_match_128_bit_division(void)
{
    unsigned differences = 0;
    for (size_t i = 0; i < HOSTILE_COUNT; i++) {
        for (size_t j = 0; j < HOSTILE_COUNT; j++) {
            for (size_t k = 0; k < HOSTILE_COUNT; k++) {
                const int64_t a = k_hostile[i], b = k_hostile[j], divisor = k_hostile[k];
                differences += divisor != 0 && fx_mul_div(a, b, divisor) != mul_div_reference(a, b, divisor);
            }
        }
    }
    for (int i = 0; i < 500000; i++) {
        const int64_t a = next_spread(), b = next_spread(), divisor = next_spread() | 1;
        differences += fx_mul_div(a, b, divisor) != mul_div_reference(a, b, divisor);
    }
    TEST_ASSERT_EQUAL_UINT(0, differences);
}
#endif

static void test_mul_div_known_values_truncate_and_saturate(void)
{
    TEST_ASSERT_EQUAL_INT64(3, fx_mul_div(7, 1, 2));
    TEST_ASSERT_EQUAL_INT64(-3, fx_mul_div(-7, 1, 2));
    TEST_ASSERT_EQUAL_INT64(-3, fx_mul_div(7, 1, -2));
    TEST_ASSERT_EQUAL_INT64(INT64_MAX, fx_mul_div(INT64_MAX, INT64_MAX, INT64_MAX));
    TEST_ASSERT_EQUAL_INT64(INT64_MIN, fx_mul_div(INT64_MIN, INT64_MAX, INT64_MAX));
    TEST_ASSERT_EQUAL_INT64(INT64_MAX, fx_mul_div(INT64_MIN, INT64_MIN, 1));
    TEST_ASSERT_EQUAL_INT64(INT64_MIN, fx_mul_div(INT64_MIN, 1, 1));
    TEST_ASSERT_EQUAL_INT64(INT64_MAX, fx_mul_div(INT64_MIN, 1, -1));
    TEST_ASSERT_EQUAL_INT64(INT64_MAX, fx_mul_div(1, 1, 0));
    TEST_ASSERT_EQUAL_INT64(INT64_MIN, fx_mul_div(-1, 1, 0));
}

static void test_add_sub_sat_ends_of_range_saturate(void)
{
    TEST_ASSERT_EQUAL_INT64(INT64_MAX, fx_add_sat(INT64_MAX, 1));
    TEST_ASSERT_EQUAL_INT64(INT64_MIN, fx_add_sat(INT64_MIN, -1));
    TEST_ASSERT_EQUAL_INT64(-1, fx_add_sat(INT64_MAX, INT64_MIN));
    TEST_ASSERT_EQUAL_INT64(INT64_MAX, fx_sub_sat(0, INT64_MIN));
    TEST_ASSERT_EQUAL_INT64(INT64_MAX, fx_sub_sat(-1, INT64_MIN));
    TEST_ASSERT_EQUAL_INT64(INT64_MIN, fx_sub_sat(-2, INT64_MAX));
    TEST_ASSERT_EQUAL_INT64(INT64_MIN, fx_sub_sat(-1, INT64_MAX));
}

static void test_q16_from_q32_ties_go_to_even_and_ends_saturate(void)
{
    TEST_ASSERT_EQUAL_INT32(0, q16_from_q32(0x8000));
    TEST_ASSERT_EQUAL_INT32(1, q16_from_q32(0x8001));
    TEST_ASSERT_EQUAL_INT32(2, q16_from_q32(0x18000));
    TEST_ASSERT_EQUAL_INT32(0, q16_from_q32(-0x8000));
    TEST_ASSERT_EQUAL_INT32(-1, q16_from_q32(-0x8001));
    TEST_ASSERT_EQUAL_INT32(-2, q16_from_q32(-0x18000));
    TEST_ASSERT_EQUAL_INT32(INT32_MAX, q16_from_q32(INT64_MAX));
    TEST_ASSERT_EQUAL_INT32(INT32_MIN, q16_from_q32(INT64_MIN));
    TEST_ASSERT_EQUAL_INT32(INT32_MIN, q16_from_q32(q32_from_q16(INT32_MIN)));
    TEST_ASSERT_EQUAL_INT32(INT32_MAX, q16_from_q32(q32_from_q16(INT32_MAX) + 0x8000));
}

static void test_mul_shift_fit_results_that_fit_equal_mul_shift(void)
{
    unsigned compared = 0, differences = 0;
    for (int i = 0; i < 200000; i++) {
        const int64_t a = next_spread(), b = next_spread();
        const unsigned shift = 1 + (unsigned)(next_random() % 126);
        const int64_t expected = fx_mul_shift(a, b, shift);
        if (expected != INT64_MIN && expected != INT64_MAX) {
            compared++;
            differences += fx_mul_shift_fit(a, b, shift) != expected;
        }
    }
    TEST_ASSERT_GREATER_THAN_UINT(100000, compared);
    TEST_ASSERT_EQUAL_UINT(0, differences);
}

static void test_mul_high_known_products_round_down(void)
{
    TEST_ASSERT_EQUAL_INT64(Q62_ONE / 4, fx_mul_high(Q62_ONE, Q62_ONE));
    TEST_ASSERT_EQUAL_INT64(0, fx_mul_high(FX_HIGH_LIMIT - 1, 1));
    TEST_ASSERT_EQUAL_INT64(-1, fx_mul_high(-1, 1));
    TEST_ASSERT_EQUAL_INT64(Q62_ONE, fx_mul_high(INT64_MIN, INT64_MIN));
    TEST_ASSERT_EQUAL_INT64(-Q62_ONE + Q32_ONE / 2, fx_mul_high(INT64_MIN, FX_HIGH_LIMIT - Q32_ONE / 2));
}

static void test_square3_sums_are_exact(void)
{
    const int64_t v[3] = {3, -4, 12};
    TEST_ASSERT_EQUAL_UINT64(169, fx_square3(v).lo);
    const int64_t wide[3] = {-Q62_ONE / 2, Q62_ONE / 2, Q62_ONE / 2 - 1}; /* 3 * 2^122 - 2^62 + 1 */
    TEST_ASSERT_EQUAL_HEX64((UINT64_C(3) << 58) - 1, fx_square3(wide).hi);
    TEST_ASSERT_EQUAL_HEX64((UINT64_C(3) << 62) + 1, fx_square3(wide).lo);
}

static void test_shift_down_rounds_to_minus_infinity(void)
{
    TEST_ASSERT_EQUAL_INT64(1, fx_shift_down(7, 2));
    TEST_ASSERT_EQUAL_INT64(-2, fx_shift_down(-5, 2));
    TEST_ASSERT_EQUAL_INT64(-1, fx_shift_down(INT64_MIN, 63));
}

static void test_shift_round_ties_go_up(void)
{
    TEST_ASSERT_EQUAL_INT64(2, fx_shift_round(6, 2));
    TEST_ASSERT_EQUAL_INT64(-1, fx_shift_round(-6, 2));
    TEST_ASSERT_EQUAL_INT64(-2, fx_shift_round(-7, 2));
    TEST_ASSERT_EQUAL_INT64(Q62_ONE, fx_shift_round(INT64_MAX, 1));
    TEST_ASSERT_EQUAL_INT64(-Q62_ONE, fx_shift_round(INT64_MIN, 1));
}

static void test_leading_zeros_every_width_is_counted(void)
{
    for (unsigned i = 0; i < 64; i++) {
        TEST_ASSERT_EQUAL_UINT(i, fx_leading_zeros(UINT64_MAX >> i));
    }
}

/* root^2 <= value < (root + 1)^2 */
static int is_floor_root(uint64_t value, uint64_t root)
{
    const fx_u128_t next = fx_wide_product_portable(root + 1, root + 1);
    return root * root <= value && (next.hi != 0 || next.lo > value);
}

static void test_sqrt_u64_every_kind_of_value_is_the_exact_floor(void)
{
    unsigned wrong = 0;
    for (uint64_t value = 0; value < 100000; value++) {
        wrong += !is_floor_root(value, fx_sqrt_u64(value));
    }
    for (int i = 0; i < 1000000; i++) {
        const uint64_t value = next_random() >> (next_random() % 64);
        wrong += !is_floor_root(value, fx_sqrt_u64(value));
        const uint64_t root = next_random() >> (32 + next_random() % 32);
        wrong += !is_floor_root(root * root, fx_sqrt_u64(root * root));
        wrong += root != 0 && !is_floor_root(root * root - 1, fx_sqrt_u64(root * root - 1));
        wrong += !is_floor_root(root * root + 2 * root, fx_sqrt_u64(root * root + 2 * root));
    }
    for (uint64_t i = 0; i < 1000; i++) {
        wrong += !is_floor_root(UINT64_MAX - i, fx_sqrt_u64(UINT64_MAX - i));
        wrong += !is_floor_root((UINT64_C(1) << 62) - 500 + i, fx_sqrt_u64((UINT64_C(1) << 62) - 500 + i));
    }
    TEST_ASSERT_EQUAL_UINT(0, wrong);
}

static int is_below(fx_u128_t a, fx_u128_t b)
{
    return a.hi != b.hi ? a.hi < b.hi : a.lo < b.lo;
}

/* Nearest: r^2 - r < value <= r^2 + r, that is (r - 1/2)^2 < value < (r + 1/2)^2 for integers. */
static int is_nearest_root(fx_u128_t value, uint64_t root)
{
    const fx_u128_t square = fx_wide_product_portable(root, root);
    const fx_u128_t upper = fx_add_u128(square, (fx_u128_t){0, root});
    const fx_u128_t above_lower = fx_add_u128(value, (fx_u128_t){0, root});
    return !is_below(upper, value) && (root == 0 || is_below(square, above_lower));
}

static void test_sqrt_u128_every_kind_of_value_is_the_nearest(void)
{
    unsigned wrong = 0;
    for (int i = 0; i < 500000; i++) {
        const unsigned width = (unsigned)(next_random() % 124); /* values below 2^(width + 1) */
        fx_u128_t value = {next_random() >> 4, next_random()};
        value = width < 64 ? (fx_u128_t){0, value.lo >> (63 - width)} : (fx_u128_t){value.hi >> (123 - width), value.lo};
        wrong += !is_nearest_root(value, fx_sqrt_u128(value));
        const uint64_t root = next_random() >> (3 + next_random() % 61);
        const fx_u128_t square = fx_square_u64(root);
        const fx_u128_t before = {square.hi - (square.lo == 0), square.lo - 1};
        const fx_u128_t tie = fx_add_u128(square, (fx_u128_t){0, root});
        wrong += (root >> 61) == 0 && !is_nearest_root(square, fx_sqrt_u128(square));
        wrong += root != 0 && !is_nearest_root(before, fx_sqrt_u128(before));
        wrong += !is_nearest_root(tie, fx_sqrt_u128(tie));
        wrong += fx_sqrt_u128(fx_add_u128(tie, (fx_u128_t){0, 1})) != root + 1;
    }
    TEST_ASSERT_EQUAL_UINT(0, wrong);
    TEST_ASSERT_EQUAL_UINT64(0, fx_sqrt_u128((fx_u128_t){0, 0}));
    TEST_ASSERT_EQUAL_UINT64(UINT64_C(1) << 62, fx_sqrt_u128((fx_u128_t){(UINT64_C(1) << 60) - 1, UINT64_MAX}));
}

/* Whether the root in Q32 is that in Q44, which the test above has judged, rounded half up. */
static int is_rounded_root(fx_u128_t square)
{
    return fx_root_q32(square) == (q32_t)((fx_sqrt_u128(square) + 2048) >> 12);
}

static void test_root_q32_every_kind_of_value_is_the_root_rounded_twice(void)
{
    unsigned wrong = 0;
    for (int i = 0; i < 500000; i++) {
        const unsigned width = (unsigned)(next_random() % 124);
        fx_u128_t value = {next_random() >> 4, next_random()};
        value = width < 64 ? (fx_u128_t){0, value.lo >> (63 - width)} : (fx_u128_t){value.hi >> (123 - width), value.lo};
        wrong += !is_rounded_root(value);
        /* Q32 changes where Q44 does from 2047 to 2048 parts, at a root of 2047.5: the squares right there and one below and
         * above. */
        const uint64_t root = ((next_random() >> (3 + next_random() % 49)) & ~UINT64_C(4095)) | 2047;
        const fx_u128_t tie = fx_add_u128(fx_square_u64(root), (fx_u128_t){0, root});
        wrong += fx_root_q32(tie) != (q32_t)(root >> 12);
        wrong += fx_root_q32(fx_add_u128(tie, (fx_u128_t){0, 1})) != (q32_t)(root >> 12) + 1;
        const fx_u128_t near = fx_add_u128(tie, (fx_u128_t){0, next_random() % (2 * root)});
        const fx_u128_t below = {tie.hi - (tie.lo < root), tie.lo - root};
        wrong += !is_rounded_root(near) || !is_rounded_root(below);
    }
    TEST_ASSERT_EQUAL_UINT(0, wrong);
    TEST_ASSERT_EQUAL_INT64(0, fx_root_q32((fx_u128_t){0, 0}));
    TEST_ASSERT_EQUAL_INT64(1, fx_root_q32((fx_u128_t){0, UINT64_C(1) << 24}));
    TEST_ASSERT_EQUAL_INT64(Q32_ONE << 14, fx_root_q32((fx_u128_t){UINT64_C(1) << 52, 0}));
    TEST_ASSERT_EQUAL_INT64(Q32_ONE << 14, fx_root_q32((fx_u128_t){(UINT64_C(1) << 52) - 1, UINT64_MAX}));
}

static int64_t distance(int64_t a, int64_t b)
{
    return a > b ? a - b : b - a;
}

static void test_sincos_reference_angles_are_within_the_stated_error(void)
{
    FILE *file = fopen(HEAVE_TEST_DATA "/fx_sincos.csv", "r");
    TEST_ASSERT_NOT_NULL(file);
    char line[128];
    int64_t worst = 0;
    unsigned rows = 0;
    TEST_ASSERT_NOT_NULL(fgets(line, sizeof line, file));
    while (fgets(line, sizeof line, file) != NULL) {
        int64_t angle, sine, cosine, sin_q62, cos_q62;
        TEST_ASSERT_EQUAL_INT(3, sscanf(line, "%" SCNd64 ",%" SCNd64 ",%" SCNd64, &angle, &sine, &cosine));
        fx_sincos_deg(angle, &sin_q62, &cos_q62);
        worst = distance(sin_q62, sine) > worst ? distance(sin_q62, sine) : worst;
        worst = distance(cos_q62, cosine) > worst ? distance(cos_q62, cosine) : worst;
        rows++;
    }
    fclose(file);
    printf("sincos: worst error %d LSB of Q62 in %u reference angles\n", (int)worst, rows);
    TEST_ASSERT_GREATER_THAN_UINT(500, rows);
    TEST_ASSERT_LESS_OR_EQUAL_INT64(FX_SINCOS_MAX_ERROR_Q62, worst);
}

/* Error against the C library; angle within a turn. Its own error, and ours of forming radians, stay below 1 LSB of Q62. */
static long double library_error(q32_t angle)
{
    q62_t sin_q62, cos_q62;
    fx_sincos_deg(angle, &sin_q62, &cos_q62);
    const q32_t quadrants = (angle + 45 * Q32_ONE * (angle < 0 ? -1 : 1)) / (90 * Q32_ONE);
    const long double rest = (long double)(angle - quadrants * 90 * Q32_ONE) * (acosl(-1.0L) / 180) / 4294967296.0L;
    const long double s = sinl(rest), c = cosl(rest);
    const unsigned quadrant = (unsigned)quadrants & 3u;
    const long double sine = quadrant == 0 ? s : quadrant == 1 ? c : quadrant == 2 ? -s : -c;
    const long double cosine = quadrant == 0 ? c : quadrant == 1 ? -s : quadrant == 2 ? -c : s;
    const long double sine_error = fabsl((long double)sin_q62 - ldexpl(sine, 62));
    const long double cosine_error = fabsl((long double)cos_q62 - ldexpl(cosine, 62));
    return fmaxl(sine_error, cosine_error);
}

static void test_sincos_dense_sweep_is_within_the_stated_error(void)
{
    /* A long double of 53 bits can judge no finer than its own 2^-53. */
    const long double judge = LDBL_MANT_DIG >= 64 ? 1.0L : 1024.0L;
    long double worst = 0;
    for (q32_t angle = -360 * Q32_ONE; angle <= 360 * Q32_ONE; angle += INT64_C(12345677)) {
        worst = fmaxl(worst, library_error(angle));
    }
    for (q32_t boundary = -360; boundary <= 360; boundary += 45) {
        for (q32_t offset = -200; offset <= 200; offset++) {
            worst = fmaxl(worst, library_error(boundary * Q32_ONE + offset));
        }
    }
    for (int64_t step = -768; step <= 768; step++) { /* where the nearest step changes */
        for (q32_t offset = -2; offset <= 2; offset++) {
            worst = fmaxl(worst, library_error((2 * step + 1) * (45 * Q32_ONE / 64) + offset));
        }
    }
    printf("sincos: worst difference from the C library %.2Lf LSB of Q62\n", worst);
    TEST_ASSERT_TRUE(worst <= FX_SINCOS_MAX_ERROR_Q62 + judge);
}

static void test_sincos_multiples_of_90_degrees_are_exact(void)
{
    static const q62_t k_sine[4] = {0, Q62_ONE, 0, -Q62_ONE};
    for (int64_t quarter = -23860929; quarter <= 23860929; quarter += quarter > -100 && quarter < 100 ? 1 : 1009) {
        q62_t sin_q62, cos_q62;
        fx_sincos_deg(quarter * 90 * Q32_ONE, &sin_q62, &cos_q62);
        TEST_ASSERT_EQUAL_INT64(k_sine[(uint64_t)quarter & 3], sin_q62);
        TEST_ASSERT_EQUAL_INT64(k_sine[(uint64_t)(quarter + 1) & 3], cos_q62);
    }
}

static void test_sincos_whole_turns_change_no_bit(void)
{
    for (int i = 0; i < 100000; i++) {
        const q32_t angle = (q32_t)(next_random() % (uint64_t)(360 * Q32_ONE));
        const q32_t turns = (q32_t)(next_random() % 5000000) * 360 * Q32_ONE;
        q62_t sine, cosine, other_sine, other_cosine;
        fx_sincos_deg(angle, &sine, &cosine);
        fx_sincos_deg(angle + turns, &other_sine, &other_cosine);
        TEST_ASSERT_EQUAL_INT64(sine, other_sine);
        fx_sincos_deg(angle - 360 * Q32_ONE - turns, &other_sine, &other_cosine);
        TEST_ASSERT_EQUAL_INT64(cosine, other_cosine);
    }
}

static void add_to_digest(uint64_t *digest, q32_t angle)
{
    q62_t sine, cosine;
    fx_sincos_deg(angle, &sine, &cosine);
    *digest = (*digest ^ (uint64_t)sine) * UINT64_C(0x100000001B3);
    *digest = (*digest ^ (uint64_t)cosine) * UINT64_C(0x100000001B3);
}

/* Recorded motion replays to the same bytes in every version, so that not even the last bit may change: half way between steps of
 * the table either of them would be within the stated error. */
static void test_sincos_every_bit_is_as_it_has_always_been(void)
{
    uint64_t digest = UINT64_C(0xCBF29CE484222325);
    for (q32_t half_step = -2048; half_step <= 2048; half_step++) {
        for (q32_t offset = -2; offset <= 2; offset++) {
            add_to_digest(&digest, half_step * 45 * (INT64_C(1) << 26) + offset);
        }
    }
    for (int i = 0; i < 100000; i++) {
        add_to_digest(&digest, next_spread());
    }
    add_to_digest(&digest, INT64_MAX);
    add_to_digest(&digest, INT64_MIN);
    TEST_ASSERT_EQUAL_HEX64(UINT64_C(0x060F65AB7E493F8B), digest);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_mul_shift_known_products_round_half_up);
    RUN_TEST(test_mul_shift_hostile_values_match_bit_by_bit_product);
    RUN_TEST(test_mul_shift_random_values_match_bit_by_bit_product);
    RUN_TEST(test_mul_high_hostile_values_match_bit_by_bit_product);
#if defined(__SIZEOF_INT128__)
    RUN_TEST(test_wide_forms_random_values_give_the_same_bits);
    RUN_TEST(test_mul_div_hostile_and_random_values_match_128_bit_division);
#endif
    RUN_TEST(test_mul_div_known_values_truncate_and_saturate);
    RUN_TEST(test_add_sub_sat_ends_of_range_saturate);
    RUN_TEST(test_q16_from_q32_ties_go_to_even_and_ends_saturate);
    RUN_TEST(test_mul_shift_fit_results_that_fit_equal_mul_shift);
    RUN_TEST(test_mul_high_known_products_round_down);
    RUN_TEST(test_square3_sums_are_exact);
    RUN_TEST(test_shift_down_rounds_to_minus_infinity);
    RUN_TEST(test_shift_round_ties_go_up);
    RUN_TEST(test_leading_zeros_every_width_is_counted);
    RUN_TEST(test_sqrt_u64_every_kind_of_value_is_the_exact_floor);
    RUN_TEST(test_sqrt_u128_every_kind_of_value_is_the_nearest);
    RUN_TEST(test_root_q32_every_kind_of_value_is_the_root_rounded_twice);
    RUN_TEST(test_sincos_reference_angles_are_within_the_stated_error);
    RUN_TEST(test_sincos_dense_sweep_is_within_the_stated_error);
    RUN_TEST(test_sincos_multiples_of_90_degrees_are_exact);
    RUN_TEST(test_sincos_whole_turns_change_no_bit);
    RUN_TEST(test_sincos_every_bit_is_as_it_has_always_been);
    return UNITY_END();
}
