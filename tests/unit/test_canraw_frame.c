/* SPDX-License-Identifier: MIT
 * test_canraw_frame.c - fields of raw CAN frames at every place, width, order and sign, against a packer that goes bit by bit.
 */
#include "heave/canraw.h"

#include <string.h>

#include "random.h"
#include "unity.h"

void setUp(void)
{
    random_begin(RANDOM_SEED);
}

void tearDown(void) {}

/* Bit n of the value, from the least, as a DBC counts: upwards through the bytes, of a big-endian field from the highest bit
 * downwards in each byte, one byte after the other. */
static void model_put(uint8_t *data, const canraw_field_t *field, int64_t value)
{
    for (unsigned bit = 0; bit < field->bits; bit++) {
        const unsigned at = 8u * field->at + field->skip + (field->is_big_endian ? field->bits - 1u - bit : bit);
        const uint8_t mask = (uint8_t)(field->is_big_endian ? 0x80u >> at % 8u : 1u << at % 8u);
        const int64_t weight = (int64_t)1 << bit;
        const bool is_set = ((value % (2 * weight) + 2 * weight) % (2 * weight)) >= weight;
        data[at / 8u] = (uint8_t)(is_set ? data[at / 8u] | mask : data[at / 8u] & ~mask);
    }
}

static canraw_field_t field_at(unsigned at, unsigned bits, unsigned kind)
{
    return (canraw_field_t){CANRAW_POSITION, at / 8u, bits, (kind & 1) != 0, (kind & 2) != 0, at % 8u, 0, 0};
}

static void check_value(const canraw_frame_t *frame, int64_t number)
{
    const canraw_field_t *field = &frame->field[0];
    const int64_t value[CANRAW_VALUES] = {number};
    uint8_t expected[8], out[8];
    for (unsigned i = 0; i < 8; i++) {
        expected[i] = i < frame->length ? frame->data[i] : 0;
    }
    model_put(expected, field, number);
    TEST_ASSERT_EQUAL(HV_OK, canraw_pack(frame, value, out));
    TEST_ASSERT_EQUAL_HEX8_ARRAY(expected, out, 8);
    TEST_ASSERT_EQUAL_INT64(number, canraw_extract(field, out));
    TEST_ASSERT_TRUE(canraw_matches(frame, out, frame->length));
}

static uint8_t constant_outside(const canraw_field_t *field)
{
    const bool is_whole = field->skip == 0 && field->bits % 8u == 0;
    return is_whole ? (uint8_t) ~(((1u << field->bits / 8u) - 1u) << field->at) : 0xFF;
}

static void test_pack_every_place_width_order_and_sign_matches_the_model(void)
{
    for (unsigned bits = 1; bits <= 32; bits++) {
        for (unsigned at = 0; at + bits <= 64; at++) {
            for (unsigned kind = 0; kind < 4; kind++) {
                canraw_frame_t frame = {.length = 8, .fields = 1, .field = {field_at(at, bits, kind)}};
                const int64_t low = canraw_field_min(&frame.field[0]), high = canraw_field_max(&frame.field[0]);
                frame.constant = constant_outside(&frame.field[0]);
                for (unsigned i = 0; i < 8; i++) {
                    frame.data[i] = frame.constant >> i & 1 ? 0xA7 + i : 0;
                }
                check_value(&frame, low);
                check_value(&frame, high);
                check_value(&frame, 0);
                for (unsigned n = 0; n < 20; n++) {
                    check_value(&frame, low + (int64_t)(random_bits() % (uint64_t)(high - low + 1)));
                }
            }
        }
    }
}

/* A bit of a field may be anything; each one beside it tells the frame. */
static void test_matches_constant_bits_beside_a_field_decide(void)
{
    const canraw_frame_t frame = {.length = 2, .constant = 0x03, .data = {0x50, 0x01}, .fields = 1, .field = {field_at(2, 9, 0)}};
    uint8_t field[8] = {0};
    (void)canraw_field_cover(&frame.field[0], field);
    TEST_ASSERT_EQUAL_HEX8(0xFC, field[0]);
    TEST_ASSERT_EQUAL_HEX8(0x07, field[1]);
    for (unsigned bit = 0; bit < 16; bit++) {
        uint8_t data[8] = {0x50, 0x01};
        data[bit / 8] ^= (uint8_t)(1u << bit % 8);
        TEST_ASSERT_EQUAL((field[bit / 8] >> bit % 8 & 1) != 0, canraw_matches(&frame, data, 2));
    }
}

static float float_of(uint32_t bits)
{
    float number;
    memcpy(&number, &bits, sizeof number);
    return number;
}

/* Against the floating point of this machine, whose quotient of two floats is rounded once. */
static void test_floats_are_those_of_the_machine_and_come_back_as_the_same_counts(void)
{
    static const uint32_t k_divisors[] = {1, 2, 3, 7, 1000, 4096, 65536, 999983, CANRAW_DIVISOR_MAX};
    for (unsigned d = 0; d < sizeof k_divisors / sizeof k_divisors[0]; d++) {
        canraw_frame_t frame = {.length = 4, .fields = 1, .field = {field_at(0, 32, 1)}};
        frame.field[0].divisor = k_divisors[d];
        TEST_ASSERT_EQUAL_INT64(CANRAW_FLOAT_MAX, canraw_field_max(&frame.field[0]));
        for (unsigned n = 0; n < 20000; n++) {
            const int64_t ends[] = {0, 1, -1, CANRAW_FLOAT_MAX, -CANRAW_FLOAT_MAX};
            const int64_t counts = n < 5 ? ends[n] : (int64_t)(random_bits() % (2u * CANRAW_FLOAT_MAX)) - CANRAW_FLOAT_MAX;
            uint8_t out[8];
            TEST_ASSERT_EQUAL(HV_OK, canraw_pack(&frame, (const int64_t[CANRAW_VALUES]){counts}, out));
            const uint32_t bits = out[0] | (uint32_t)out[1] << 8 | (uint32_t)out[2] << 16 | (uint32_t)out[3] << 24;
            TEST_ASSERT_TRUE(float_of(bits) == (float)counts / (float)k_divisors[d]);
            TEST_ASSERT_TRUE(canraw_matches(&frame, out, 4));
            TEST_ASSERT_EQUAL_INT64(counts, canraw_extract(&frame.field[0], out));
        }
    }
}

/* What the machine rounds: any float, and those that are none. */
static void test_floats_that_are_no_counts_are_no_frame(void)
{
    static const uint32_t k_factors[] = {1, 1000, 524288, 999983};
    canraw_frame_t frame = {.length = 4, .fields = 1, .field = {field_at(0, 32, 3)}};
    for (unsigned n = 0; n < 200000; n++) {
        const uint32_t bits =
            n & 1 ? random_below(UINT32_MAX) : (random_below(UINT32_MAX) & 0x8FFFFFFFu) | 0x40000000u; /* every second near 1 */
        const uint8_t data[8] = {bits >> 24, bits >> 16 & 0xFF, bits >> 8 & 0xFF, bits & 0xFF};
        const uint32_t divisor = k_factors[n / 2 % 4];
        const double number = (double)float_of(bits) * divisor;
        const bool is_counts = number == number && number > -CANRAW_FLOAT_MAX - 0.5 && number < CANRAW_FLOAT_MAX + 0.5;
        frame.field[0].divisor = divisor;
        TEST_ASSERT_EQUAL(is_counts, canraw_matches(&frame, data, 4));
        if (is_counts) {
            TEST_ASSERT_EQUAL_INT64((int64_t)(number < 0 ? number - 0.5 : number + 0.5), canraw_extract(&frame.field[0], data));
        }
    }
    static const uint32_t k_none[] = {0x7F800000u, 0xFF800000u, 0x7FC00000u, 0xFFFFFFFFu};
    for (unsigned i = 0; i < 4; i++) {
        const uint8_t data[8] = {k_none[i] >> 24, k_none[i] >> 16 & 0xFF, k_none[i] >> 8 & 0xFF, k_none[i] & 0xFF};
        TEST_ASSERT_FALSE(canraw_matches(&frame, data, 4));
    }
}

static void test_pack_value_that_does_not_fit_is_refused_and_changes_nothing(void)
{
    static const struct {
        unsigned bits, kind;
        int64_t low, high;
    } k_cases[] = {{8, 0, 0, 255},           {8, 1, -128, 127},      {16, 0, 0, 65535},      {1, 0, 0, 1},
                   {20, 1, -524288, 524287}, {16, 3, -32768, 32767}, {32, 2, 0, 4294967295}, {32, 1, -2147483648, 2147483647}};
    for (size_t i = 0; i < sizeof k_cases / sizeof k_cases[0]; i++) {
        const canraw_frame_t frame = {.length = 8, .fields = 1, .field = {field_at(0, k_cases[i].bits, k_cases[i].kind)}};
        const int64_t outside[2] = {k_cases[i].low - 1, k_cases[i].high + 1};
        TEST_ASSERT_EQUAL_INT64(k_cases[i].low, canraw_field_min(&frame.field[0]));
        TEST_ASSERT_EQUAL_INT64(k_cases[i].high, canraw_field_max(&frame.field[0]));
        for (unsigned n = 0; n < 2; n++) {
            uint8_t out[8] = {1, 2, 3, 4, 5, 6, 7, 8}, before[8];
            memcpy(before, out, 8);
            TEST_ASSERT_EQUAL(HV_ERR_RANGE, canraw_pack(&frame, (const int64_t[CANRAW_VALUES]){outside[n]}, out));
            TEST_ASSERT_EQUAL_HEX8_ARRAY(before, out, 8);
        }
    }
}

static void test_matches_constants_and_length_decide(void)
{
    const canraw_frame_t frame = {.length = 4, .constant = 0x05, .data = {0x10, 0, 0x20, 0}};
    TEST_ASSERT_TRUE(canraw_matches(&frame, (const uint8_t[8]){0x10, 0xFF, 0x20, 0xEE}, 4));
    TEST_ASSERT_TRUE(canraw_matches(&frame, (const uint8_t[8]){0x10, 0xFF, 0x20, 0xEE, 1}, 5));
    TEST_ASSERT_FALSE(canraw_matches(&frame, (const uint8_t[8]){0x10, 0xFF, 0x20, 0xEE}, 3));
    TEST_ASSERT_FALSE(canraw_matches(&frame, (const uint8_t[8]){0x11, 0xFF, 0x20, 0xEE}, 4));
    TEST_ASSERT_FALSE(canraw_matches(&frame, (const uint8_t[8]){0x10, 0xFF, 0x21, 0xEE}, 4));
    TEST_ASSERT_FALSE(canraw_matches(&(canraw_frame_t){0}, (const uint8_t[8]){0}, 8));
}

/* Against the definition: is there a message that matches both? Tried with messages over an alphabet of both frames' bytes. */
static void test_is_ambiguous_means_that_some_bytes_match_both(void)
{
    for (unsigned n = 0; n < 5000; n++) {
        canraw_frame_t frame[2];
        memset(frame, 0, sizeof frame);
        for (unsigned i = 0; i < 2; i++) {
            frame[i].length = 1 + random_below(3);
            frame[i].constant = (uint8_t)(random_below(UINT32_MAX) & ((1u << frame[i].length) - 1u));
            for (unsigned b = 0; b < 3; b++) {
                frame[i].data[b] = frame[i].constant >> b & 1 ? random_below(UINT32_MAX) & 1 : 0;
            }
        }
        bool is_found = false;
        for (unsigned bits = 0; bits < 8; bits++) {
            const uint8_t data[8] = {bits & 1, bits >> 1 & 1, bits >> 2 & 1};
            is_found |= canraw_matches(&frame[0], data, 8) && canraw_matches(&frame[1], data, 8);
        }
        TEST_ASSERT_EQUAL(is_found, canraw_is_ambiguous(&frame[0], &frame[1]));
    }
}

static void test_is_ambiguous_with_a_frame_that_is_not_there_is_nothing(void)
{
    const canraw_frame_t any = {.length = 2};
    TEST_ASSERT_TRUE(canraw_is_ambiguous(&any, &any));
    TEST_ASSERT_FALSE(canraw_is_ambiguous(&any, &(canraw_frame_t){0}));
    TEST_ASSERT_FALSE(canraw_is_ambiguous(&(canraw_frame_t){0}, &any));
}

/* By a CRC of other making, which over "123456789" gives the check values of the catalogues: SMBUS F4h, SAE-J1850 4Bh,
 * AUTOSAR DFh, CDMA2000 DAh, I-432-1 A1h. */
static void test_check_bytes_are_those_of_the_catalogue(void)
{
    static const struct {
        canraw_value_t kind;
        uint8_t polynomial;
        uint8_t data[7];
        uint8_t check;
        uint8_t initial, final;
    } k_cases[] = {
        {CANRAW_SUM, 0, {0xFF, 2, 3, 4, 5, 6, 7}, 0x1A, 0, 0},
        {CANRAW_XOR, 0, {0x0F, 0xF0, 0x11, 0, 0, 0, 1}, 0xEF, 0, 0},
        {CANRAW_CRC8, 0x07, {'1', '2', '3', '4', '5', '6', '7'}, 0x78, 0, 0},
        {CANRAW_CRC8, 0x1D, {'1', '2', '3', '4', '5', '6', '7'}, 0x4D, 0xFF, 0xFF},
        {CANRAW_CRC8, 0x2F, {'1', '2', '3', '4', '5', '6', '7'}, 0xCF, 0xFF, 0xFF}, /* AUTOSAR */
        {CANRAW_CRC8, 0x9B, {'1', '2', '3', '4', '5', '6', '7'}, 0xE8, 0xFF, 0x00}, /* CDMA2000 */
        {CANRAW_CRC8, 0x07, {'1', '2', '3', '4', '5', '6', '7'}, 0x2D, 0x00, 0x55}, /* I-432-1 */
    };
    for (unsigned i = 0; i < sizeof k_cases / sizeof k_cases[0]; i++) {
        canraw_frame_t frame = {.length = 8, .constant = 0x7F, .fields = 1};
        uint8_t out[8];
        memcpy(frame.data, k_cases[i].data, 7);
        frame.data[7] = k_cases[i].polynomial;
        frame.crc_initial = k_cases[i].initial;
        frame.crc_final = k_cases[i].final;
        frame.field[0] = (canraw_field_t){k_cases[i].kind, 7, 8, false, false, 0, 0, 0};
        TEST_ASSERT_EQUAL(HV_OK, canraw_pack(&frame, (const int64_t[CANRAW_VALUES]){0}, out));
        TEST_ASSERT_EQUAL_HEX8(k_cases[i].check, out[7]);
        TEST_ASSERT_TRUE(canraw_matches(&frame, out, 8));
        for (unsigned bit = 0; bit < 8; bit++) { /* any other byte is not it */
            out[7] ^= (uint8_t)(1u << bit);
            TEST_ASSERT_FALSE(canraw_matches(&frame, out, 8));
            out[7] ^= (uint8_t)(1u << bit);
        }
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_check_bytes_are_those_of_the_catalogue);
    RUN_TEST(test_pack_every_place_width_order_and_sign_matches_the_model);
    RUN_TEST(test_matches_constant_bits_beside_a_field_decide);
    RUN_TEST(test_floats_are_those_of_the_machine_and_come_back_as_the_same_counts);
    RUN_TEST(test_floats_that_are_no_counts_are_no_frame);
    RUN_TEST(test_pack_value_that_does_not_fit_is_refused_and_changes_nothing);
    RUN_TEST(test_matches_constants_and_length_decide);
    RUN_TEST(test_is_ambiguous_means_that_some_bytes_match_both);
    RUN_TEST(test_is_ambiguous_with_a_frame_that_is_not_there_is_nothing);
    return UNITY_END();
}
