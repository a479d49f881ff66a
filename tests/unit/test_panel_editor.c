/* SPDX-License-Identifier: MIT
 * test_panel_editor.c - configurations that pages edit: what was checked is what heaved gets, and nothing else.
 */
#include "panel/editor.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "common/sealed.h"
#include "heave/status.h"
#include "unity.h"

static upstream_t m_upstream = {.name = "ride"};
static char m_folder[64], m_path[EDITOR_PATH_MAX], m_digest[EDITOR_DIGEST_MAX], m_why[256];

void hv_assert_failed(const char *file, int line)
{
    (void)fprintf(stderr, "%s:%d\n", file, line);
    abort();
}

void setUp(void)
{
    (void)snprintf(m_folder, sizeof m_folder, "/tmp/heave-editor-XXXXXX");
    TEST_ASSERT_NOT_NULL(mkdtemp(m_folder));
    m_why[0] = m_path[0] = '\0';
}

static const char *in_folder(const char *name)
{
    static char path[128];
    (void)snprintf(path, sizeof path, "%s/%s", m_folder, name);
    return path;
}

void tearDown(void)
{
    (void)unlink(in_folder("staged-ride.ini"));
    (void)unlink(in_folder("staged-ride.ini.new"));
    (void)unlink(in_folder("other"));
    (void)rmdir(m_folder);
}

static bool stage(const char *text, size_t length)
{
    return editor_stage(m_folder, &m_upstream, text, length, m_path, m_digest, m_why, sizeof m_why);
}

static int open_staged(const char *digest)
{
    m_why[0] = '\0';
    return editor_open(m_folder, &m_upstream, digest, m_why, sizeof m_why);
}

static void test_what_was_checked_is_what_heaved_gets(void)
{
    char text[32] = "";
    struct stat about;
    TEST_ASSERT_TRUE_MESSAGE(stage("; mine\n", 7), m_why);
    TEST_ASSERT_EQUAL_STRING(in_folder("staged-ride.ini"), m_path);
    TEST_ASSERT_EQUAL_UINT(16, strlen(m_digest));
    TEST_ASSERT_EQUAL_INT(0, stat(m_path, &about));
    TEST_ASSERT_EQUAL_INT(0600, about.st_mode & 0777);
    const int fd = open_staged(m_digest);
    TEST_ASSERT_GREATER_OR_EQUAL_INT(0, fd);
    TEST_ASSERT_EQUAL_INT(7, pread(fd, text, sizeof text, 0));
    TEST_ASSERT_EQUAL_STRING("; mine\n", text);
    TEST_ASSERT_EQUAL_INT(SEALED_AGAINST, fcntl(fd, F_GET_SEALS) & SEALED_AGAINST);
    TEST_ASSERT_EQUAL_INT(-1, pwrite(fd, "x", 1, 0));
    TEST_ASSERT_EQUAL_INT(-1, ftruncate(fd, 0));
    (void)close(fd);
}

static void test_another_text_is_refused(void)
{
    char first[EDITOR_DIGEST_MAX];
    TEST_ASSERT_EQUAL_INT(-1, open_staged("0123456789abcdef")); /* nothing is staged */
    TEST_ASSERT_NOT_NULL(strstr(m_why, "not what was checked last"));
    TEST_ASSERT_TRUE(stage("; first\n", 8));
    (void)snprintf(first, sizeof first, "%s", m_digest);
    TEST_ASSERT_TRUE(stage("; second\n", 9));
    TEST_ASSERT_EQUAL_INT(-1, open_staged(first));
    TEST_ASSERT_NOT_NULL(strstr(m_why, "not what was checked last"));
    TEST_ASSERT_EQUAL_INT(-1, open_staged(""));
    FILE *const file = fopen(m_path, "w"); /* somebody else has written over it */
    TEST_ASSERT_NOT_NULL(file);
    (void)fputs("; other\n", file);
    (void)fclose(file);
    TEST_ASSERT_EQUAL_INT(-1, open_staged(m_digest));
}

static void test_its_length_has_bounds(void)
{
    char *const text = malloc(EDITOR_TEXT_MAX + 1u);
    TEST_ASSERT_NOT_NULL(text);
    memset(text, ';', EDITOR_TEXT_MAX + 1u);
    TEST_ASSERT_FALSE(stage(text, 0));
    TEST_ASSERT_FALSE(stage(text, EDITOR_TEXT_MAX + 1u));
    TEST_ASSERT_EQUAL_STRING("a configuration has 1 to 131072 bytes", m_why);
    TEST_ASSERT_NOT_EQUAL(0, access(in_folder("staged-ride.ini"), F_OK));
    TEST_ASSERT_TRUE(stage(text, EDITOR_TEXT_MAX));
    const int fd = open_staged(m_digest);
    TEST_ASSERT_EQUAL_INT(EDITOR_TEXT_MAX, lseek(fd, 0, SEEK_END));
    (void)close(fd);
    free(text);
}

static void test_a_folder_that_refuses_is_told(void)
{
    TEST_ASSERT_FALSE(editor_stage("/nonexistent", &m_upstream, "; x\n", 4, m_path, m_digest, m_why, sizeof m_why));
    TEST_ASSERT_NOT_NULL(strstr(m_why, "No such file or directory"));
    TEST_ASSERT_EQUAL_INT(0, mkdir(in_folder("staged-ride.ini"), 0700)); /* in the way of the rename */
    TEST_ASSERT_FALSE(stage("; x\n", 4));
    TEST_ASSERT_EQUAL_INT(0, rmdir(in_folder("staged-ride.ini")));
}

static void test_no_link_is_followed(void)
{
    struct stat about;
    char other[128];
    (void)snprintf(other, sizeof other, "%s", in_folder("other"));
    FILE *const file = fopen(other, "w");
    TEST_ASSERT_NOT_NULL(file);
    (void)fclose(file);
    TEST_ASSERT_EQUAL_INT(0, symlink(other, in_folder("staged-ride.ini.new")));
    TEST_ASSERT_FALSE(stage("; x\n", 4));
    TEST_ASSERT_EQUAL_INT(0, stat(other, &about));
    TEST_ASSERT_EQUAL_INT(0, about.st_size);
    TEST_ASSERT_EQUAL_INT(0, unlink(in_folder("staged-ride.ini.new")));
    TEST_ASSERT_TRUE(stage("; x\n", 4));
    TEST_ASSERT_EQUAL_INT(0, rename(m_path, other));
    TEST_ASSERT_EQUAL_INT(0, symlink(other, in_folder("staged-ride.ini")));
    TEST_ASSERT_EQUAL_INT(-1, open_staged(m_digest));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_what_was_checked_is_what_heaved_gets);
    RUN_TEST(test_another_text_is_refused);
    RUN_TEST(test_its_length_has_bounds);
    RUN_TEST(test_a_folder_that_refuses_is_told);
    RUN_TEST(test_no_link_is_followed);
    return UNITY_END();
}
