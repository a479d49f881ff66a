/* SPDX-License-Identifier: MIT
 * test_machine_keys.c - the keys that described a machine when it was commissioned: what has changed since is named with both
 * values, and a file that is not of that machine names nothing.
 */
#include "service/machine_keys.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "platform/load.h"
#include "unity.h"

static machine_keys_t m_keys;
static config_t m_config;
static config_text_t m_text;
static char m_folder[64];
static char m_life[80];
static char m_ini[80];

/* The sample of CANopen drives with lines added to a section; unity where it is refused. */
static void load(const char *section, const char *lines)
{
    static char text[CONFIG_TEXT_BYTES];
    char head[64];
    (void)snprintf(head, sizeof head, "[%s]\n", section);
    FILE *file = fopen(HEAVE_CONFIG_DIR "/hexapod-cia402.ini", "r");
    TEST_ASSERT_NOT_NULL(file);
    text[fread(text, 1, sizeof text - 1, file)] = '\0';
    (void)fclose(file);
    char *at = strstr(text, head);
    TEST_ASSERT_NOT_NULL_MESSAGE(at, head);
    at += strlen(head);
    file = fopen(m_ini, "w");
    (void)fprintf(file, "%.*s%s%s", (int)(at - text), text, lines, at);
    (void)fclose(file);
    TEST_ASSERT_EQUAL(0, config_load(m_ini, &m_config, stderr));
}

/* As heaved does at its start. */
static void start(const char *machine_hash)
{
    memset(&m_keys, 0, sizeof m_keys);
    machine_keys_read(&m_keys, m_life, machine_hash);
}

static const char *change(void)
{
    machine_keys_compare(&m_keys, &m_config, &m_text);
    return m_text.data;
}

void setUp(void)
{
    (void)snprintf(m_folder, sizeof m_folder, "/tmp/heave-keys-XXXXXX");
    TEST_ASSERT_NOT_NULL(mkdtemp(m_folder));
    (void)snprintf(m_life, sizeof m_life, "%s/life", m_folder);
    (void)snprintf(m_ini, sizeof m_ini, "%s/own.ini", m_folder);
    load("cia402", "vendor_id = 0x1A\nserial_numbers = 1, 2, 3, 4, 5, 6\n");
    start("");
    TEST_ASSERT_EQUAL_STRING("", change()); /* nobody has commissioned it */
    TEST_ASSERT_TRUE(machine_keys_note(&m_keys, &m_config));
    TEST_ASSERT_EQUAL(0, machine_keys_write(&m_keys));
}

void tearDown(void)
{
    char command[128];
    (void)snprintf(command, sizeof command, "rm -rf %s", m_folder);
    TEST_ASSERT_EQUAL(0, system(command)); // NOLINT(cert-env33-c): a folder of this test's own
}

static void test_same_machine_has_no_change(void)
{
    char hash[CONFIG_HASH_MAX];
    strcpy(hash, m_config.machine_hash);
    TEST_ASSERT_EQUAL_STRING("", change());
    start(hash);
    TEST_ASSERT_GREATER_THAN_UINT(500, (unsigned)m_keys.length);
    TEST_ASSERT_EQUAL_STRING("", change());
}

static void test_changes_are_named_with_both_values(void)
{
    char hash[CONFIG_HASH_MAX];
    strcpy(hash, m_config.machine_hash);
    start(hash);
    load("cia402", "vendor_id = 0x1B\nserial_numbers = 1, 2, 3, 4, 5, 6\n");
    TEST_ASSERT_EQUAL_STRING("[cia402] vendor_id was 26 and is 27", change());
    load("cia402", "serial_numbers = 1, 2, 3, 4, 5, 7\n");
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(change(), "[cia402] vendor_id was 26 and is the default"), change());
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(change(), "[cia402] serial_numbers was "), change());
    load("cia402", "vendor_id = 0x1A\nserial_numbers = 1, 2, 3, 4, 5, 6\nproduct_code = 0x77\n");
    TEST_ASSERT_EQUAL_STRING("[cia402] product_code was the default and is 119", change());
    load("cia402", "vendor_id = 0x1B\nserial_numbers = 1, 2, 3, 4, 5, 7\nproduct_code = 0x77\nrevision_number = 0x78\n");
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(change(), "; and 2 more"), change());
    TEST_ASSERT_NULL_MESSAGE(strstr(change(), "revision_number"), change());
}

static void test_file_of_another_machine_names_nothing(void)
{
    start("0123456789abcdef");
    load("cia402", "");
    TEST_ASSERT_EQUAL_STRING("", change());
    start(""); /* never commissioned */
    TEST_ASSERT_EQUAL_STRING("", change());
}

static void test_damaged_file_names_nothing(void)
{
    char hash[CONFIG_HASH_MAX], path[120];
    strcpy(hash, m_config.machine_hash);
    (void)snprintf(path, sizeof path, "%s" MACHINE_KEYS_SUFFIX, m_life);
    FILE *file = fopen(path, "r+");
    TEST_ASSERT_NOT_NULL(file);
    (void)fseek(file, 40, SEEK_SET);
    (void)fputc('#', file);
    (void)fclose(file);
    start(hash);
    load("cia402", "");
    TEST_ASSERT_EQUAL_STRING("", change());
    TEST_ASSERT_EQUAL(0, unlink(path));
    start(hash);
    TEST_ASSERT_EQUAL_STRING("", change());
}

static void test_what_cannot_be_written_waits(void)
{
    (void)snprintf(m_life, sizeof m_life, "%s/none/life", m_folder);
    start("");
    TEST_ASSERT_TRUE(machine_keys_note(&m_keys, &m_config));
    TEST_ASSERT_EQUAL(ENOENT, machine_keys_write(&m_keys));
    TEST_ASSERT_FALSE(machine_keys_note(&m_keys, &m_config));
    *strrchr(m_life, '/') = '\0';
    TEST_ASSERT_EQUAL(0, mkdir(m_life, 0700));
    TEST_ASSERT_EQUAL(0, machine_keys_write(&m_keys));
    TEST_ASSERT_EQUAL(0, machine_keys_write(&m_keys)); /* nothing waits any more */
    TEST_ASSERT_TRUE(machine_keys_note(&m_keys, &m_config));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_same_machine_has_no_change);
    RUN_TEST(test_changes_are_named_with_both_values);
    RUN_TEST(test_file_of_another_machine_names_nothing);
    RUN_TEST(test_damaged_file_names_nothing);
    RUN_TEST(test_what_cannot_be_written_waits);
    return UNITY_END();
}
