/* SPDX-License-Identifier: MIT
 * test_canraw_frame.c - fields of raw CAN frames at every place, width, order and sign, against a packer that goes bit by bit.
 */
#include "heave/canraw.h"

#include <string.h>

#include "unity.h"

static uint32_t seed;

void setUp(void)
{
    seed = 2463534242u;
}

void tearDown(void) {}

void hv_assert_failed(const char *file, int line)
{
    (void)file;
    (void)line;
    TEST_FAIL_MESSAGE("assertion");
}

static uint32_t next_random(void)
{
    seed ^= seed << 13;
    seed ^= seed >> 17;
    seed ^= seed << 5;
    return seed;
}

/* Bit n of the value, from the least, goes to bit n % 8 of byte n / 8, counted from the end that is written first. */
static void model_put(uint8_t *data, unsigned at, unsigned bytes, bool is_big_endian, int64_t value)
{
    for (unsigned bit = 0; bit < 8 * bytes; bit++) {
        const unsigned from_low = bit / 8;
        uint8_t *byte = &data[at + (is_big_endian ? bytes - 1 - from_low : from_low)];
        const int64_t weight = (int64_t)1 << bit;
        const bool is_set = ((value % (2 * weight) + 2 * weight) % (2 * weight)) >= weight;
        *byte = (uint8_t)(*byte & ~(1u << bit % 8)) | (uint8_t)(is_set << bit % 8);
    }
}

static canraw_field_t field_at(unsigned at, unsigned bytes, unsigned kind)
{
    return (canraw_field_t){CANRAW_POSITION, at, bytes, (kind & 1) != 0, (kind & 2) != 0};
}

static void check_value(const canraw_frame_t *frame, int64_t number)
{
    const canraw_field_t *field = &frame->field[0];
    const int64_t value[CANRAW_VALUES] = {number};
    uint8_t expected[8], out[8];
    for (unsigned i = 0; i < 8; i++) {
        expected[i] = i < frame->length ? frame->data[i] : 0;
    }
    model_put(expected, field->at, field->bytes, field->is_big_endian, number);
    TEST_ASSERT_EQUAL(HV_OK, canraw_pack(frame, value, out));
    TEST_ASSERT_EQUAL_HEX8_ARRAY(expected, out, 8);
    TEST_ASSERT_EQUAL_INT64(number, canraw_extract(field, out));
    TEST_ASSERT_TRUE(canraw_matches(frame, out, frame->length));
}

static void test_pack_every_place_width_order_and_sign_matches_the_model(void)
{
    static const unsigned k_bytes[] = {1, 2, 3, 4};
    for (unsigned w = 0; w < 4; w++) {
        for (unsigned at = 0; at + k_bytes[w] <= 8; at++) {
            for (unsigned kind = 0; kind < 4; kind++) {
                canraw_frame_t frame = {.length = 8, .fields = 1, .field = {field_at(at, k_bytes[w], kind)}};
                const int64_t low = canraw_field_min(&frame.field[0]), high = canraw_field_max(&frame.field[0]);
                frame.constant = (uint8_t) ~(((1u << k_bytes[w]) - 1u) << at);
                for (unsigned i = 0; i < 8; i++) {
                    frame.data[i] = frame.constant >> i & 1 ? 0xA0 + i : 0;
                }
                check_value(&frame, low);
                check_value(&frame, high);
                check_value(&frame, 0);
                for (unsigned n = 0; n < 200; n++) {
                    check_value(&frame, low + (int64_t)(next_random() % (uint64_t)(high - low + 1)));
                }
            }
        }
    }
}

static void test_pack_value_that_does_not_fit_is_refused_and_changes_nothing(void)
{
    static const struct {
        unsigned bytes, kind;
        int64_t low, high;
    } k_cases[] = {{1, 0, 0, 255},        {1, 1, -128, 127},     {2, 0, 0, 65535},
                   {2, 3, -32768, 32767}, {4, 2, 0, 4294967295}, {4, 1, -2147483648, 2147483647}};
    for (size_t i = 0; i < sizeof k_cases / sizeof k_cases[0]; i++) {
        const canraw_frame_t frame = {.length = 8, .fields = 1, .field = {field_at(0, k_cases[i].bytes, k_cases[i].kind)}};
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
            frame[i].length = 1 + next_random() % 3;
            frame[i].constant = (uint8_t)(next_random() & ((1u << frame[i].length) - 1u));
            for (unsigned b = 0; b < 3; b++) {
                frame[i].data[b] = frame[i].constant >> b & 1 ? next_random() & 1 : 0;
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

/* By a CRC of other making, which over "123456789" gives the check values of the catalogues: SMBUS F4h, SAE-J1850 4Bh. */
static void test_check_bytes_are_those_of_the_catalogue(void)
{
    static const struct {
        canraw_value_t kind;
        uint8_t polynomial;
        uint8_t data[7];
        uint8_t check;
    } k_cases[] = {
        {CANRAW_SUM, 0, {0xFF, 2, 3, 4, 5, 6, 7}, 0x1A},
        {CANRAW_XOR, 0, {0x0F, 0xF0, 0x11, 0, 0, 0, 1}, 0xEF},
        {CANRAW_CRC8, 0x07, {'1', '2', '3', '4', '5', '6', '7'}, 0x78},
        {CANRAW_CRC8_FF, 0x1D, {'1', '2', '3', '4', '5', '6', '7'}, 0x4D},
    };
    for (unsigned i = 0; i < sizeof k_cases / sizeof k_cases[0]; i++) {
        canraw_frame_t frame = {.length = 8, .constant = 0x7F, .fields = 1};
        uint8_t out[8];
        memcpy(frame.data, k_cases[i].data, 7);
        frame.data[7] = k_cases[i].polynomial;
        frame.field[0] = (canraw_field_t){k_cases[i].kind, 7, 1, false, false};
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
    RUN_TEST(test_pack_value_that_does_not_fit_is_refused_and_changes_nothing);
    RUN_TEST(test_matches_constants_and_length_decide);
    RUN_TEST(test_is_ambiguous_means_that_some_bytes_match_both);
    RUN_TEST(test_is_ambiguous_with_a_frame_that_is_not_there_is_nothing);
    return UNITY_END();
}
