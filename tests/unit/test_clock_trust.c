/* SPDX-License-Identifier: MIT
 * test_clock_trust.c - which start of the machine it is, and whether its date can be right, by files of our own.
 */
#include "unity.h"

#include "common/clock_trust.h"

#include <stdio.h>
#include <stdlib.h>
#include <time.h>
#include <unistd.h>

static const clock_trust_files_t k_files = {"test_clock_trust.boot", "test_clock_trust.chip", "test_clock_trust.server"};

static void write_text(const char *path, const char *text)
{
    FILE *file = fopen(path, "w");
    TEST_ASSERT_NOT_NULL(file);
    TEST_ASSERT_TRUE(fputs(text, file) >= 0 && fclose(file) == 0);
}

void setUp(void)
{
    (void)unlink(k_files.boot_id);
    (void)unlink(k_files.clock_chip);
    (void)unlink(k_files.synchronised);
    (void)unsetenv("HEAVE_BOOT_ID");
}

void tearDown(void)
{
    setUp();
}

static void test_boot_is_the_first_64_bits_of_the_systems_id(void)
{
    TEST_ASSERT_EQUAL_HEX64(0, clock_boot(&k_files));
    write_text(k_files.boot_id, "0f1e2d3c-4b5a-6978-8796-a5b4c3d2e1f0\n");
    TEST_ASSERT_EQUAL_HEX64(0x0f1e2d3c4b5a6978, clock_boot(&k_files));
    TEST_ASSERT_EQUAL(0, setenv("HEAVE_BOOT_ID", "ffeeddccbbaa99887766554433221100", 1));
    TEST_ASSERT_EQUAL_HEX64(0xffeeddccbbaa9988, clock_boot(&k_files));
    static const char *const k_wrong[] = {"", "%b", "ffeeddccbbaa998", "ffeeddccbbaa99x8", "-"};
    for (size_t i = 0; i < sizeof k_wrong / sizeof k_wrong[0]; i++) {
        TEST_ASSERT_EQUAL(0, setenv("HEAVE_BOOT_ID", k_wrong[i], 1));
        TEST_ASSERT_EQUAL_HEX64(0, clock_boot(&k_files));
    }
}

static void test_date_is_trusted_by_a_time_server_or_a_chip_that_agrees(void)
{
    static const struct {
        long apart_s;
        bool is_trusted;
    } k_rows[] = {{0, true}, {-14 * 3600, true}, {14 * 3600, true}, {-16 * 3600, false}, {16 * 3600, false}, {-700000000, false}};
    TEST_ASSERT_FALSE(clock_is_trusted(&k_files));
    for (size_t i = 0; i < sizeof k_rows / sizeof k_rows[0]; i++) {
        char text[32];
        (void)snprintf(text, sizeof text, "%ld\n", (long)time(NULL) + k_rows[i].apart_s);
        write_text(k_files.clock_chip, text);
        TEST_ASSERT_EQUAL(k_rows[i].is_trusted, clock_is_trusted(&k_files));
    }
    write_text(k_files.clock_chip, "");
    TEST_ASSERT_FALSE(clock_is_trusted(&k_files));
    write_text(k_files.synchronised, "");
    TEST_ASSERT_TRUE(clock_is_trusted(&k_files));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_boot_is_the_first_64_bits_of_the_systems_id);
    RUN_TEST(test_date_is_trusted_by_a_time_server_or_a_chip_that_agrees);
    return UNITY_END();
}
