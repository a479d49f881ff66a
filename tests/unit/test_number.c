/* SPDX-License-Identifier: MIT
 * test_number.c - decimal text to Q16.16 against reference rows and against the schoolbook model of number_model.c.
 */
#include "heave/number.h"
#include "number_model.h"
#include "unity.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define VALUE_UNTOUCHED 0x5A5A5A5A

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
    return s_random * UINT64_C(2685821657736338717) >> 11;
}

static unsigned below(unsigned end)
{
    return (unsigned)(next_random() % end);
}

static const char *error_text(number_error_t error)
{
    return (const char *[]){"OK", "EMPTY", "SYNTAX", "OVERFLOW"}[error];
}

static void check(const char *text, size_t length, number_error_t error, q16_t value)
{
    q16_t parsed = VALUE_UNTOUCHED;
    const number_error_t answer = number_parse(text, length, &parsed);
    TEST_ASSERT_EQUAL_STRING_MESSAGE(error_text(error), error_text(answer), text);
    TEST_ASSERT_EQUAL_INT32_MESSAGE(error == NUMBER_OK ? value : VALUE_UNTOUCHED, parsed, text);
}

static void check_against_model(const char *text)
{
    q16_t value = 0;
    const number_error_t error = model_q16(text, &value);
    check(text, strlen(text), error, value);
}

static number_error_t natural(const char *text, uint32_t *value)
{
    number_t number;
    number_init(&number);
    for (; *text != '\0'; text++) {
        if (number_feed(&number, (uint8_t)*text) != NUMBER_OK) {
            return NUMBER_SYNTAX;
        }
    }
    return number_finish_natural(&number, value);
}

static void check_natural(const char *text, number_error_t error, uint32_t value)
{
    uint32_t answer = VALUE_UNTOUCHED;
    TEST_ASSERT_EQUAL_STRING_MESSAGE(error_text(error), error_text(natural(text, &answer)), text);
    TEST_ASSERT_EQUAL_UINT32_MESSAGE(error == NUMBER_OK ? value : VALUE_UNTOUCHED, answer, text);
}

/* ---- the reference rows ---- */

/* Undoes the C escapes and quotes of a text column; returns where the next column starts. */
static const char *unescape(const char *at, char *text, size_t *length)
{
    const bool is_quoted = *at == '"';
    *length = 0;
    for (at += is_quoted; is_quoted ? *at != '"' : *at != ','; at++) {
        if (at[0] == '\\' && at[1] == 'x') {
            text[(*length)++] = (char)strtol((char[]){at[2], at[3], '\0'}, NULL, 16);
            at += 3;
        } else if (at[0] == '\\') {
            text[(*length)++] = at[1] == 't' ? '\t' : at[1] == 'n' ? '\n' : at[1] == 'r' ? '\r' : '\\';
            at++;
        } else {
            text[(*length)++] = *at;
        }
    }
    text[*length] = '\0';
    return at + is_quoted + 1;
}

/* One row: id,text,status,q16_even,... */
static void check_row(const char *line)
{
    char text[256], status[32];
    size_t length = 0;
    const char *rest = unescape(strchr(line, ',') + 1, text, &length);
    const size_t status_length = strcspn(rest, ",");
    TEST_ASSERT_LESS_THAN_UINT(sizeof status, status_length);
    memcpy(status, rest, status_length);
    status[status_length] = '\0';
    const bool is_value = strcmp(status, "OK") == 0 || strcmp(status, "OVERFLOW_IF_AWAY") == 0;
    const number_error_t error = is_value                        ? NUMBER_OK
                                 : strcmp(status, "EMPTY") == 0  ? NUMBER_EMPTY
                                 : strcmp(status, "SYNTAX") == 0 ? NUMBER_SYNTAX
                                                                 : NUMBER_OVERFLOW;
    check(text, length, error, is_value ? (q16_t)strtoll(rest + status_length + 1, NULL, 10) : 0);
}

static void test_parse_reference_rows_give_the_stated_result(void)
{
    FILE *file = fopen(HEAVE_TEST_DATA "/numbers.csv", "r");
    TEST_ASSERT_NOT_NULL(file);
    char line[512];
    unsigned rows = 0;
    TEST_ASSERT_NOT_NULL(fgets(line, sizeof line, file));
    while (fgets(line, sizeof line, file) != NULL) {
        check_row(line);
        rows++;
    }
    fclose(file);
    TEST_ASSERT_EQUAL_UINT(901, rows);
}

/* ---- single cases ---- */

static void test_parse_forms_of_real_senders_are_read(void)
{
    static const struct {
        const char *text;
        q16_t value;
    } k_rows[] = {{"5", 327680},
                  {"5.5", 360448},
                  {".5", 32768},
                  {"5.", 327680},
                  {"-.5", -32768},
                  {"1E-05", 1},
                  {"-4.371139E-08", 0},
                  {"1e+2", 6553600},
                  {" \t5.5\t ", 360448},
                  {"+1.5", 98304},
                  {"-0", 0},
                  {"0e99999999999999", 0},
                  {"1.e1", 655360},
                  {".1e1", 65536},
                  {"00000000000000000000001", 65536},
                  {"-32768", INT32_MIN},
                  {"32767.99999", INT32_MAX}};
    for (size_t i = 0; i < sizeof k_rows / sizeof k_rows[0]; i++) {
        check(k_rows[i].text, strlen(k_rows[i].text), NUMBER_OK, k_rows[i].value);
    }
}

static void test_parse_what_is_no_number_is_refused(void)
{
    static const char *const k_texts[] = {"nan",
                                          "NaN",
                                          "inf",
                                          "-inf",
                                          "infinity",
                                          "0x10",
                                          "0x1p3",
                                          "1 2",
                                          "2 .5",
                                          "- 5",
                                          "+-5",
                                          "--5",
                                          "1e",
                                          "1e+",
                                          "1e 5",
                                          "1 e5",
                                          ".",
                                          "-.",
                                          ".e1",
                                          "e1",
                                          "1,5",
                                          "1.5f",
                                          "5d",
                                          "1_000",
                                          "1'000",
                                          "1\n1",
                                          "\v1",
                                          "5%",
                                          "\xEF\xBC\x91",
                                          ("\xE2\x88\x92"
                                           "1"),
                                          "1e1.5",
                                          "1..2",
                                          "1e--5"};
    for (size_t i = 0; i < sizeof k_texts / sizeof k_texts[0]; i++) {
        check(k_texts[i], strlen(k_texts[i]), NUMBER_SYNTAX, 0);
    }
    check("1\0", 2, NUMBER_SYNTAX, 0);
    check("", 0, NUMBER_EMPTY, 0);
    check(" \t ", 3, NUMBER_EMPTY, 0);
}

static void test_parse_magnitude_beyond_q16_overflows_only_after_rounding(void)
{
    check_against_model("32767.99999237060546875");
    check("32767.99999237060546875", 23, NUMBER_OVERFLOW, 0);
    check("32767.999992370605468749999999999999999", 39, NUMBER_OK, INT32_MAX);
    check("-32768.00000762939453125", 24, NUMBER_OK, INT32_MIN);
    check("-32768.000007629394531250000000000000001", 40, NUMBER_OVERFLOW, 0);
    check("1e99999999999999999999999999", 28, NUMBER_OVERFLOW, 0);
    check("32768", 5, NUMBER_OVERFLOW, 0);
}

static void test_parse_thousand_digits_still_decide_the_last_bit(void)
{
    char text[1100] = "0.00000762939453125"; /* half an LSB: to even, 0 */
    const size_t tie = strlen(text);
    memset(text + tie, '0', 1000);
    text[tie + 1000] = '\0';
    check(text, tie + 1000, NUMBER_OK, 0);
    text[tie + 999] = '1';
    check(text, tie + 1000, NUMBER_OK, 1);
}

static void test_parse_zeros_and_exponent_that_cancel_are_exact(void)
{
    char text[1100] = "0.";
    memset(text + 2, '0', 1000);
    strcpy(text + 1002, "15e1001"); /* 0.<1000 zeros>15e1001 */
    check(text, strlen(text), NUMBER_OK, 98304);
    memset(text, '0', 1000);
    text[0] = '1';
    strcpy(text + 1000, "e-999");
    check(text, strlen(text), NUMBER_OK, 65536);
    strcpy(text + 1000, "e-1000000000000000000000");
    check(text, strlen(text), NUMBER_OK, 0);
}

static void test_feed_after_a_refused_byte_stays_refused(void)
{
    number_t number;
    q16_t value = VALUE_UNTOUCHED;
    number_init(&number);
    TEST_ASSERT_EQUAL_INT(NUMBER_OK, number_feed(&number, '1'));
    TEST_ASSERT_EQUAL_INT(NUMBER_SYNTAX, number_feed(&number, 'x'));
    for (unsigned byte = 0; byte < 256; byte++) {
        TEST_ASSERT_EQUAL_INT(NUMBER_SYNTAX, number_feed(&number, (uint8_t)byte));
    }
    TEST_ASSERT_EQUAL_INT(NUMBER_SYNTAX, number_finish(&number, &value));
    TEST_ASSERT_EQUAL_INT32(VALUE_UNTOUCHED, value);
}

static void test_feed_refuses_at_the_first_byte_that_cannot_continue(void)
{
    static const struct {
        const char *text;
        unsigned at;
    } k_rows[] = {{"nan", 0},  {"1x", 1},  {"1 2", 2},  {"--", 1}, {"1e5.", 3},
                  {"1.5.", 3}, {"- 1", 1}, {"1e 1", 2}, {". ", 1}, {"0x1", 1}};
    for (size_t i = 0; i < sizeof k_rows / sizeof k_rows[0]; i++) {
        number_t number;
        number_init(&number);
        for (unsigned at = 0; at <= k_rows[i].at; at++) {
            const number_error_t error = at == k_rows[i].at ? NUMBER_SYNTAX : NUMBER_OK;
            TEST_ASSERT_EQUAL_INT_MESSAGE(error, number_feed(&number, (uint8_t)k_rows[i].text[at]), k_rows[i].text);
        }
    }
}

/* Nobody waits for so many digits, so they are put there. */
static void test_feed_counts_more_digits_than_any_text_has(void)
{
    static const char *const k_texts[] = {"1", "0.0"};
    static const int64_t k_points[] = {INT64_C(1000000000000000000), INT64_C(-1000000000000000000)};
    static const char k_next[] = {'1', '0'};
    static const number_error_t k_errors[] = {NUMBER_OVERFLOW, NUMBER_OK};
    for (unsigned i = 0; i < 2; i++) {
        q16_t value = VALUE_UNTOUCHED;
        number_t number;
        number_init(&number);
        for (const char *at = k_texts[i]; *at != '\0'; at++) {
            TEST_ASSERT_EQUAL_INT(NUMBER_OK, number_feed(&number, (uint8_t)*at));
        }
        number.point = k_points[i];
        TEST_ASSERT_EQUAL_INT(NUMBER_OK, number_feed(&number, (uint8_t)k_next[i]));
        TEST_ASSERT_EQUAL_INT64(k_points[i], number.point);
        TEST_ASSERT_EQUAL_INT(k_errors[i], number_finish(&number, &value));
        TEST_ASSERT_EQUAL_INT32(k_errors[i] == NUMBER_OK ? 0 : VALUE_UNTOUCHED, value);
    }
}

static void test_finish_natural_rounds_to_even_and_refuses_what_is_below_zero(void)
{
    check_natural("0", NUMBER_OK, 0);
    check_natural("-0", NUMBER_OK, 0);
    check_natural("-0.000", NUMBER_OK, 0);
    check_natural(" 3000 ", NUMBER_OK, 3000);
    check_natural("3e3", NUMBER_OK, 3000);
    check_natural("0.5", NUMBER_OK, 0);
    check_natural("1.5", NUMBER_OK, 2);
    check_natural("2.5", NUMBER_OK, 2);
    check_natural("2.5000000000000000000000000000001", NUMBER_OK, 3);
    check_natural("0.05", NUMBER_OK, 0);
    check_natural("1e-30", NUMBER_OK, 0);
    check_natural("1.00000000000000000000000000001e-30", NUMBER_OK, 0);
    check_natural("3600000.49999999999999999999999", NUMBER_OK, 3600000);
    check_natural("999999999", NUMBER_OK, 999999999);
    check_natural("999999999.5", NUMBER_OVERFLOW, 0);
    check_natural("1e9", NUMBER_OVERFLOW, 0);
    check_natural("1e999", NUMBER_OVERFLOW, 0);
    check_natural("-0.1", NUMBER_OVERFLOW, 0);
    check_natural("-1e-99", NUMBER_OVERFLOW, 0);
    check_natural("", NUMBER_EMPTY, 0);
    check_natural("1e", NUMBER_SYNTAX, 0);
}

/* ---- properties ---- */

/* A text of the grammar: up to 30 digits, point anywhere, exponent at times. */
static void random_number(char *text)
{
    static const char *const k_signs[] = {"", "-", "+"};
    const unsigned count = 1 + below(below(2) ? 30 : 9);
    const unsigned point = below(count + 1);
    size_t at = (size_t)sprintf(text, "%s", k_signs[below(3)]);
    for (unsigned i = 0; i < count; i++) {
        at += (size_t)sprintf(text + at, "%s%u", i == point ? "." : "", below(3) == 0 ? 0 : below(10));
    }
    if (below(2) == 0) {
        const int exponent = (int)below(2 * count) - (int)count + 5 - (int)point;
        sprintf(text + at, "%c%s%d", below(2) ? 'e' : 'E', exponent >= 0 && below(2) ? "+" : "", exponent);
    }
}

static void test_parse_random_numbers_match_the_model(void)
{
    char text[80];
    unsigned values = 0;
    for (unsigned round = 0; round < 100000; round++) {
        q16_t ignored;
        random_number(text);
        check_against_model(text);
        values += model_q16(text, &ignored) == NUMBER_OK;
    }
    TEST_ASSERT_GREATER_THAN_UINT(40000, values);
}

/* Exact ties and their neighbours in the 22nd digit and far beyond, printed from integers, with the point moved by exponents. */
static void test_parse_ties_and_their_neighbours_match_the_model(void)
{
    static const char *const k_tails[] = {"", "0000", "00000000000000000000000000001", "1"};
    for (unsigned round = 0; round < 20000; round++) {
        const uint64_t halves = 2 * (next_random() >> (21 + below(32)) & 0xFFFFFFFFu) + 1; /* odd: value = halves / 2^17 */
        const uint64_t decimals = halves % 131072 * UINT64_C(762939453125);                /* 17 of them, exact */
        char text[160], moved[160];
        const int length = sprintf(text, "%s%u.%017llu%s", below(2) ? "-" : "", (unsigned)(halves / 131072),
                                   (unsigned long long)decimals, k_tails[below(4)]);
        check_against_model(text);
        sprintf(moved, "%.*s49999999999e0", length - 1, text); /* one digit less and then nines: just below or above */
        check_against_model(moved);
        char *point = strchr(text, '.');
        memmove(point, point + 1, strlen(point));
        sprintf(moved, "%s.e-%d", text, (int)strlen(point));
        check_against_model(moved);
        sprintf(moved, "%s.%se%d", text[0] == '-' ? "-" : "", text + (text[0] == '-'), (int)(point - text - (text[0] == '-')));
        check_against_model(moved);
    }
}

static void test_parse_every_q16_value_printed_exactly_comes_back(void)
{
    for (unsigned round = 0; round < 50000; round++) {
        const int64_t value = round < 4 ? (int64_t[]){INT32_MIN, INT32_MAX, -1, 0}[round] : (int32_t)(uint32_t)next_random();
        const uint64_t magnitude = (uint64_t)(value < 0 ? -value : value);
        char text[64];
        sprintf(text, "%s%u.%016llu", value < 0 ? "-" : "", (unsigned)(magnitude / 65536),
                (unsigned long long)(magnitude % 65536 * UINT64_C(152587890625)));
        check(text, strlen(text), NUMBER_OK, (q16_t)value);
    }
}

static void test_parse_random_bytes_match_the_model(void)
{
    static const char k_bytes[] = "0123456789..eE+- \tx";
    char text[16];
    for (unsigned round = 0; round < 200000; round++) {
        const unsigned length = below(12);
        for (unsigned i = 0; i < length; i++) {
            text[i] = k_bytes[below(sizeof k_bytes - 1)];
        }
        text[length] = '\0';
        check_against_model(text);
    }
}

static void test_finish_natural_random_numbers_match_the_model(void)
{
    char text[80];
    for (unsigned round = 0; round < 50000; round++) {
        uint32_t value = 0;
        random_number(text);
        const number_error_t error = model_natural(text, &value);
        check_natural(text, error, value);
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_parse_reference_rows_give_the_stated_result);
    RUN_TEST(test_parse_forms_of_real_senders_are_read);
    RUN_TEST(test_parse_what_is_no_number_is_refused);
    RUN_TEST(test_parse_magnitude_beyond_q16_overflows_only_after_rounding);
    RUN_TEST(test_parse_thousand_digits_still_decide_the_last_bit);
    RUN_TEST(test_parse_zeros_and_exponent_that_cancel_are_exact);
    RUN_TEST(test_feed_after_a_refused_byte_stays_refused);
    RUN_TEST(test_feed_refuses_at_the_first_byte_that_cannot_continue);
    RUN_TEST(test_feed_counts_more_digits_than_any_text_has);
    RUN_TEST(test_finish_natural_rounds_to_even_and_refuses_what_is_below_zero);
    RUN_TEST(test_parse_random_numbers_match_the_model);
    RUN_TEST(test_parse_ties_and_their_neighbours_match_the_model);
    RUN_TEST(test_parse_every_q16_value_printed_exactly_comes_back);
    RUN_TEST(test_parse_random_bytes_match_the_model);
    RUN_TEST(test_finish_natural_random_numbers_match_the_model);
    return UNITY_END();
}
