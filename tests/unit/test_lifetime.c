/* SPDX-License-Identifier: MIT
 * test_lifetime.c - the life of a machine in two files: it goes on after every start, survives a file that is cut off, damaged,
 * lost or not renamed, and says so where none is right.
 */
#include "service/lifetime.h"

#include <errno.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <unistd.h>

#include "common/message.h"
#include "unity.h"

static lifetime_t m_life;
static config_t m_config;
static snapshot_t m_seen;
static char m_folder[64];
static char m_path[80];
static char m_second[96];

void setUp(void)
{
    (void)unsetenv("STATE_DIRECTORY");
    (void)snprintf(m_folder, sizeof m_folder, "/tmp/heave-life-XXXXXX");
    TEST_ASSERT_NOT_NULL(mkdtemp(m_folder));
    (void)snprintf(m_path, sizeof m_path, "%s/life", m_folder);
    (void)snprintf(m_second, sizeof m_second, "%s.2", m_path);
    (void)snprintf(m_config.life_file, sizeof m_config.life_file, "%s", m_path);
    memset(&m_seen, 0, sizeof m_seen);
}

void tearDown(void)
{
    char command[128];
    (void)lifetime_close(&m_life);
    (void)snprintf(command, sizeof command, "rm -rf %s", m_folder);
    TEST_ASSERT_EQUAL(0, system(command));
}

static int start(void)
{
    memset(&m_life, 0, sizeof m_life);
    memset(&m_seen, 0, sizeof m_seen);
    return lifetime_open(&m_life, &m_config, 7);
}

/* A day: each axis has gone so far. */
static void work(uint64_t mm)
{
    m_seen.rides++;
    for (unsigned i = 0; i < 7; i++) {
        m_seen.wear[i].travel_milli += mm * 1000 + i;
        m_seen.wear[i].turns += 2;
        m_seen.wear[i].energized_us += 3600000000u;
    }
    lifetime_serve(&m_life, &m_seen, 1);
}

static void expect(uint64_t rides, uint64_t mm)
{
    TEST_ASSERT_EQUAL_UINT64(rides, m_life.now.rides);
    for (unsigned i = 0; i < 7; i++) {
        TEST_ASSERT_EQUAL_UINT64(mm * 1000 + rides * i, m_life.now.axis[i].travel_milli);
        TEST_ASSERT_EQUAL_UINT64(2 * rides, m_life.now.axis[i].turns);
        TEST_ASSERT_EQUAL_UINT64(rides * 3600000, m_life.now.axis[i].energized_ms);
    }
}

static void test_life_goes_on_after_every_start(void)
{
    for (uint64_t day = 0; day < 20; day++) {
        TEST_ASSERT_EQUAL(EXIT_DONE, start());
        expect(day, day * 100);
        work(60);
        m_seen.rides--;
        for (unsigned i = 0; i < 7; i++) { /* the rest of the day is the same ride */
            m_seen.wear[i].turns -= 2;
            m_seen.wear[i].energized_us -= 3600000000u;
            m_seen.wear[i].travel_milli -= i;
        }
        work(40);
        TEST_ASSERT_TRUE(lifetime_close(&m_life));
    }
}

static void test_life_is_written_once_a_minute_and_when_it_goes_off(void)
{
    lifetime_totals_t totals;
    TEST_ASSERT_EQUAL(EXIT_DONE, start());
    lifetime_serve(&m_life, &m_seen, 1000);
    TEST_ASSERT_TRUE(ring_pop(&m_life.ring, &totals, sizeof totals) > 0);
    for (uint64_t now_us = 2000; now_us < LIFETIME_PERIOD_US; now_us += 10000) {
        m_seen.state = STATE_ENGAGED;
        lifetime_serve(&m_life, &m_seen, now_us);
    }
    TEST_ASSERT_TRUE(ring_is_empty(&m_life.ring));
    m_seen.state = STATE_OFF;
    lifetime_serve(&m_life, &m_seen, LIFETIME_PERIOD_US);
    lifetime_serve(&m_life, &m_seen, LIFETIME_PERIOD_US + 1);
    TEST_ASSERT_TRUE(ring_pop(&m_life.ring, &totals, sizeof totals) > 0);
    TEST_ASSERT_TRUE(ring_is_empty(&m_life.ring));
    lifetime_serve(&m_life, &m_seen, 2 * LIFETIME_PERIOD_US);
    TEST_ASSERT_TRUE(ring_pop(&m_life.ring, &totals, sizeof totals) > 0);
}

/* Kept over a start; of another day, another configuration, or failed, it does not count. */
static void test_selftest_counts_for_its_day_and_configuration(void)
{
    lifetime_selftest_t selftest = {.day = 20261123, .is_passed = true, .hash = "0123456789abcdef"};
    TEST_ASSERT_EQUAL(EXIT_DONE, start());
    TEST_ASSERT_NOT_EQUAL(0, m_life.boot);
    TEST_ASSERT_FALSE(lifetime_has_passed(&m_life, 20261123, "0123456789abcdef"));
    TEST_ASSERT_FALSE(lifetime_has_passed(&m_life, 0, ""));
    lifetime_note_selftest(&m_life, &selftest);
    TEST_ASSERT_TRUE(lifetime_close(&m_life));
    TEST_ASSERT_EQUAL(EXIT_DONE, start());
    TEST_ASSERT_TRUE(lifetime_has_passed(&m_life, 20261123, "0123456789abcdef"));
    TEST_ASSERT_FALSE(lifetime_has_passed(&m_life, 20261124, "0123456789abcdef"));
    TEST_ASSERT_FALSE(lifetime_has_passed(&m_life, 20261122, "0123456789abcdef"));
    TEST_ASSERT_FALSE(lifetime_has_passed(&m_life, 20261123, "0123456789abcdee"));
    selftest.is_passed = false;
    lifetime_note_selftest(&m_life, &selftest);
    TEST_ASSERT_TRUE(lifetime_close(&m_life));
    TEST_ASSERT_EQUAL(EXIT_DONE, start());
    TEST_ASSERT_EQUAL_UINT32(20261123, m_life.now.selftest.day);
    TEST_ASSERT_FALSE(lifetime_has_passed(&m_life, 20261123, "0123456789abcdef"));
}

/* Kept over a start, with and without a self-test; the file says both in words. */
static void test_commissioned_is_kept_with_its_machine(void)
{
    const lifetime_selftest_t selftest = {.day = 20261124, .is_passed = true, .hash = "0123456789abcdef"};
    TEST_ASSERT_EQUAL(EXIT_DONE, start());
    TEST_ASSERT_EQUAL_UINT32(0, m_life.now.commissioned.day);
    strcpy(m_config.machine_hash, "fedcba9876543210");
    TEST_ASSERT_TRUE(lifetime_note_commissioned(&m_life, 20261123, &m_config));
    TEST_ASSERT_FALSE(lifetime_note_commissioned(&m_life, 20261124, &m_config)); /* not written yet */
    for (unsigned i = 0; i < 2; i++) {
        TEST_ASSERT_TRUE(lifetime_close(&m_life));
        TEST_ASSERT_EQUAL(EXIT_DONE, start());
        TEST_ASSERT_EQUAL_UINT32(20261123, m_life.now.commissioned.day);
        TEST_ASSERT_EQUAL_STRING("fedcba9876543210", m_life.now.commissioned.hash);
        TEST_ASSERT_EQUAL(i == 1, lifetime_has_passed(&m_life, 20261124, "0123456789abcdef"));
        lifetime_note_selftest(&m_life, &selftest);
    }
}

/* With the start of the machine where that is known: an older heaved reads a file without it. */
static void test_selftest_keeps_the_start_of_the_machine(void)
{
    for (unsigned known = 0; known <= 1; known++) {
        const lifetime_selftest_t selftest = {.day = 20261123, .is_passed = true, .hash = "0123456789abcdef"};
        const uint64_t boot = known ? UINT64_MAX - 7 : 0;
        TEST_ASSERT_EQUAL(EXIT_DONE, start());
        m_life.boot = boot;
        lifetime_note_selftest(&m_life, &selftest);
        TEST_ASSERT_TRUE(lifetime_close(&m_life));
        TEST_ASSERT_EQUAL(EXIT_DONE, start());
        TEST_ASSERT_EQUAL_UINT64(boot, m_life.now.selftest.boot);
        TEST_ASSERT_TRUE(lifetime_close(&m_life));
    }
}

/* A box without a clock chip starts with the date of yesterday: there a pass of before counts once a time server has been heard.
 */
static void test_selftest_of_an_older_start_counts_by_a_date_that_can_be_right(void)
{
    const lifetime_selftest_t selftest = {.day = 20261123, .is_passed = true, .hash = "0123456789abcdef"};
    static const struct {
        uint64_t then, now;
        bool is_date_right, counts;
    } k_rows[] = {{5, 5, false, true},  {5, 6, false, false}, {5, 0, false, false}, {0, 5, false, false},
                  {0, 0, false, false}, {5, 5, true, true},   {5, 6, true, true},   {0, 0, true, true}};
    TEST_ASSERT_EQUAL(EXIT_DONE, start());
    for (unsigned i = 0; i < sizeof k_rows / sizeof k_rows[0]; i++) {
        m_life.boot = k_rows[i].then;
        lifetime_note_selftest(&m_life, &selftest);
        TEST_ASSERT_TRUE(lifetime_has_passed(&m_life, 20261123, "0123456789abcdef")); /* it has just been made */
        m_life.has_own = false;
        m_life.boot = k_rows[i].now;
        m_life.is_clock_trusted = k_rows[i].is_date_right;
        TEST_ASSERT_EQUAL(k_rows[i].counts, lifetime_has_passed(&m_life, 20261123, "0123456789abcdef"));
        TEST_ASSERT_FALSE(lifetime_has_passed(&m_life, 20261124, "0123456789abcdef"));
    }
}

/* So many writes: each one more than the last, in turn to both. */
static void live(unsigned writes)
{
    TEST_ASSERT_EQUAL(EXIT_DONE, start());
    for (unsigned i = 0; i < writes; i++) {
        m_life.next_us = 0;
        work(100);
        lifetime_step(&m_life);
    }
}

static size_t read_text(const char *path, char *text, size_t capacity)
{
    FILE *file = fopen(path, "rb");
    TEST_ASSERT_NOT_NULL(file);
    const size_t length = fread(text, 1, capacity, file);
    (void)fclose(file);
    return length;
}

static void write_text(const char *path, const char *text, size_t length)
{
    FILE *file = fopen(path, "wb");
    TEST_ASSERT_NOT_NULL(file);
    TEST_ASSERT_EQUAL(length, fwrite(text, 1, length, file));
    (void)fclose(file);
}

/* Whatever becomes of the newest one: cut off anywhere, a bit turned anywhere. The other one is the write before. */
static void test_life_survives_any_damage_of_one_file(void)
{
    char text[2048], other[2048];
    live(4);
    const char *newest = m_life.now.sequence % 2 == 0 ? m_path : m_second;
    const char *older = m_life.now.sequence % 2 == 0 ? m_second : m_path;
    const size_t length = read_text(newest, text, sizeof text);
    const size_t other_length = read_text(older, other, sizeof other);
    for (size_t at = 0; at < length; at++) {
        write_text(newest, text, at);
        write_text(older, other, other_length);
        TEST_ASSERT_EQUAL(EXIT_DONE, start());
        expect(3, 300);
        text[at] ^= 1;
        write_text(newest, text, length);
        write_text(older, other, other_length);
        TEST_ASSERT_EQUAL(EXIT_DONE, start());
        expect(3, 300);
        text[at] ^= 1;
    }
    TEST_ASSERT_EQUAL(0, unlink(newest));
    write_text(older, other, other_length);
    TEST_ASSERT_EQUAL(EXIT_DONE, start());
    expect(3, 300);
}

static void test_life_without_a_file_that_is_right_does_not_begin_at_zero(void)
{
    live(4);
    write_text(m_path, "", 0);
    write_text(m_second, "heave life 1\n", 13);
    TEST_ASSERT_EQUAL(EXIT_BAD_DATA, start());
    TEST_ASSERT_EQUAL(0, unlink(m_second));
    TEST_ASSERT_EQUAL(EXIT_BAD_DATA, start());
    TEST_ASSERT_EQUAL(0, unlink(m_path));
    TEST_ASSERT_EQUAL(EXIT_DONE, start());
    expect(0, 0);
}

static void test_life_of_another_machine_is_refused(void)
{
    live(1);
    memset(&m_life, 0, sizeof m_life);
    TEST_ASSERT_EQUAL(EXIT_BAD_DATA, lifetime_open(&m_life, &m_config, 3));
    m_life.path[0] = '\0';
    (void)snprintf(m_config.life_file, sizeof m_config.life_file, "%s/not/there", m_folder);
    TEST_ASSERT_EQUAL(EXIT_NO_OUTPUT, start());
    m_life.path[0] = '\0';
}

static void test_life_full_disk_is_told_and_the_old_file_stays(void)
{
    struct rlimit before;
    int error = 0;
    live(4);
    (void)signal(SIGXFSZ, SIG_IGN);
    TEST_ASSERT_EQUAL(0, getrlimit(RLIMIT_FSIZE, &before));
    const struct rlimit tight = {100, before.rlim_max};
    TEST_ASSERT_EQUAL(0, setrlimit(RLIMIT_FSIZE, &tight));
    for (unsigned i = 0; i < 3; i++) {
        m_life.next_us = 0;
        work(100);
        lifetime_step(&m_life);
        TEST_ASSERT_EQUAL(i == 0, lifetime_trouble(&m_life, &error));
        TEST_ASSERT_NOT_EQUAL(0, error);
    }
    TEST_ASSERT_EQUAL(0, setrlimit(RLIMIT_FSIZE, &before));
    const lifetime_t kept = m_life;
    TEST_ASSERT_EQUAL(EXIT_DONE, start());
    expect(4, 400);
    m_life = kept;
    ring_init(&m_life.ring, m_life.ring_bytes, sizeof m_life.ring_bytes);
    m_seen.rides = 6;
    m_life.next_us = 0;
    lifetime_serve(&m_life, &m_seen, 1);
    lifetime_step(&m_life);
    TEST_ASSERT_TRUE(lifetime_trouble(&m_life, &error));
    TEST_ASSERT_EQUAL(0, error);
}

static void test_life_is_in_the_state_directory_or_nowhere(void)
{
    (void)snprintf(m_config.life_file, sizeof m_config.life_file, "none");
    TEST_ASSERT_EQUAL(EXIT_DONE, start());
    work(100);
    expect(1, 100); /* shown all the same */
    TEST_ASSERT_TRUE(lifetime_close(&m_life));
    TEST_ASSERT_NOT_EQUAL(0, access(m_path, F_OK));
    (void)setenv("STATE_DIRECTORY", m_folder, 1);
    TEST_ASSERT_EQUAL(EXIT_DONE, start());
    TEST_ASSERT_TRUE(lifetime_start(&m_life));
    work(100);
    TEST_ASSERT_TRUE(lifetime_close(&m_life));
    TEST_ASSERT_EQUAL(EXIT_DONE, start());
    expect(1, 100);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_life_goes_on_after_every_start);
    RUN_TEST(test_life_is_written_once_a_minute_and_when_it_goes_off);
    RUN_TEST(test_selftest_counts_for_its_day_and_configuration);
    RUN_TEST(test_commissioned_is_kept_with_its_machine);
    RUN_TEST(test_selftest_keeps_the_start_of_the_machine);
    RUN_TEST(test_selftest_of_an_older_start_counts_by_a_date_that_can_be_right);
    RUN_TEST(test_life_survives_any_damage_of_one_file);
    RUN_TEST(test_life_without_a_file_that_is_right_does_not_begin_at_zero);
    RUN_TEST(test_life_of_another_machine_is_refused);
    RUN_TEST(test_life_full_disk_is_told_and_the_old_file_stays);
    RUN_TEST(test_life_is_in_the_state_directory_or_nowhere);
    return UNITY_END();
}
