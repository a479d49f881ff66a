/* SPDX-License-Identifier: MIT
 * test_sha256.c - the examples of FIPS 180-4 (NIST's), and every length around the ends of blocks against a program of others.
 */
#include "common/sha256.h"

#include <stdio.h>
#include <string.h>

#include "unity.h"

void setUp(void) {}
void tearDown(void) {}

static void expect(const char *digest, const void *bytes, size_t length, size_t piece)
{
    char text[2 * SHA256_BYTES + 1];
    sha256_t hash;
    sha256_start(&hash);
    for (size_t at = 0; at < length; at += piece) {
        sha256_add(&hash, (const uint8_t *)bytes + at, length - at < piece ? length - at : piece);
    }
    sha256_end_digits(&hash, text, sizeof text);
    TEST_ASSERT_EQUAL_STRING(digest, text);
}

static void test_sha256_examples_of_the_standard(void)
{
    static char million[1000000];
    static const char k_two[] = "abcdbcdecdefdefgefghfghighijhijkijkljklmklmnlmnomnopnopq";
    static const char k_long[] =
        "abcdefghbcdefghicdefghijdefghijkefghijklfghijklmghijklmnhijklmnoijklmnopjklmnopqklmnopqrlmnopqrsmnopqrstnopqrstu";
    expect("e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855", "", 0, 1);
    expect("ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad", "abc", 3, 3);
    expect("248d6a61d20638b8e5c026930c3e6039a33ce45964ff2167f6ecedd419db06c1", k_two, strlen(k_two), 7);
    expect("cf5b16a778af8380036ce59e7b0492370b249b11e8f07a51afac45037afee9d1", k_long, strlen(k_long), 100);
    memset(million, 'a', sizeof million);
    expect("cdc76e5c9914fb9281a1c7e284d73e67f1809a48a497200e046d39ccc7112cd0", million, sizeof million, 997);
}

/* printf 'a%.0s' $(seq N) | sha256sum */
static void test_sha256_lengths_around_the_end_of_a_block(void)
{
    static const struct {
        size_t length;
        const char *digest;
    } k_rows[] = {
        {55, "9f4390f8d30c2dd92ec9f095b65e2b9ae9b0a925a5258e241c9f1e910f734318"},
        {56, "b35439a4ac6f0948b6d6f9e3c6af0f5f590ce20f1bde7090ef7970686ec6738a"},
        {63, "7d3e74a05d7db15bce4ad9ec0658ea98e3f06eeecf16b4c6fff2da457ddc2f34"},
        {64, "ffe054fe7ae0cb6dc65c3af9b61d5209f439851db43d0ba5997337df154668eb"},
        {65, "635361c48bb9eab14198e76ea8ab7f1a41685d6ad62aa9146d301d4f17eb0ae0"},
    };
    char text[65];
    memset(text, 'a', sizeof text);
    for (unsigned i = 0; i < sizeof k_rows / sizeof k_rows[0]; i++) {
        expect(k_rows[i].digest, text, k_rows[i].length, 64);
    }
}

static void test_as_many_digits_as_fit(void)
{
    char digits[2 * SHA256_BYTES + 9];
    sha256_digits("abc", 3, digits, 17);
    TEST_ASSERT_EQUAL_STRING("ba7816bf8f01cfea", digits);
    sha256_digits("abc", 3, digits, 16);
    TEST_ASSERT_EQUAL_STRING("ba7816bf8f01cf", digits);
    sha256_digits("abc", 3, digits, 1);
    TEST_ASSERT_EQUAL_STRING("", digits);
    sha256_digits("abc", 3, digits, sizeof digits);
    TEST_ASSERT_EQUAL_STRING("ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad", digits);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_sha256_examples_of_the_standard);
    RUN_TEST(test_sha256_lengths_around_the_end_of_a_block);
    RUN_TEST(test_as_many_digits_as_fit);
    return UNITY_END();
}
