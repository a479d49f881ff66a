/* SPDX-License-Identifier: MIT
 * test_config_store.c - the configuration that was applied over the file that heaved was started with: which of the two counts,
 * what is kept, what is taken.
 */
#include "service/config_store.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include "unity.h"

#define SEALS (F_SEAL_WRITE | F_SEAL_SHRINK | F_SEAL_GROW)

static config_store_t m_store;
static char m_folder[64];
static char m_file[96];
static char m_kept[CONFIG_PATH_MAX];

static void write_file(const char *path, const char *text)
{
    FILE *const file = fopen(path, "w");
    TEST_ASSERT_NOT_NULL(file);
    (void)fputs(text, file);
    (void)fclose(file);
}

void setUp(void)
{
    (void)snprintf(m_folder, sizeof m_folder, "/tmp/heave-store-XXXXXX");
    TEST_ASSERT_NOT_NULL(mkdtemp(m_folder));
    (void)snprintf(m_file, sizeof m_file, "%s/own.ini", m_folder);
    (void)setenv("STATE_DIRECTORY", m_folder, 1); // NOLINT(concurrency-mt-unsafe): no thread reads it
    write_file(m_file, "; own\n");
    memset(&m_store, 0, sizeof m_store);
    config_store_open(&m_store, m_file, m_file);
}

void tearDown(void)
{
    char command[128];
    TEST_ASSERT_TRUE(config_store_close(&m_store));
    (void)snprintf(command, sizeof command, "rm -rf %s", m_folder);
    TEST_ASSERT_EQUAL(0, system(command)); // NOLINT(cert-env33-c): a folder of this test's own
    (void)unsetenv("STATE_DIRECTORY");     // NOLINT(concurrency-mt-unsafe)
}

static int memory(const char *text, int seals)
{
    const int fd = memfd_create("test", MFD_CLOEXEC | MFD_ALLOW_SEALING);
    TEST_ASSERT_EQUAL((ssize_t)strlen(text), write(fd, text, strlen(text)));
    TEST_ASSERT_EQUAL(0, fcntl(fd, F_ADD_SEALS, seals));
    return fd;
}

static const char *take(const char *text, int seals)
{
    const char *got = NULL;
    size_t length = 0;
    const int fd = memory(text, seals);
    const char *const why = config_store_accept(&m_store, fd, &got, &length);
    (void)close(fd);
    return why;
}

static int write_now(void)
{
    const char *text = NULL;
    size_t length = 0;
    int error = -1;
    config_store_write(&m_store);
    TEST_ASSERT_TRUE(config_store_is_busy(&m_store));
    TEST_ASSERT_TRUE(config_store_start(&m_store));
    for (unsigned i = 0; i < 1000 && !config_store_done(&m_store, &error, &text, &length); i++) {
        (void)usleep(5000);
    }
    TEST_ASSERT_FALSE(config_store_is_busy(&m_store));
    TEST_ASSERT_TRUE(worker_close(&m_store.worker, 1000));
    return error;
}

static const char *m_read; /* path of what was read */
static const char *m_text;
static ssize_t m_length;

static const char *read_now(void)
{
    bool is_read = false;
    config_store_read(&m_store);
    TEST_ASSERT_TRUE(config_store_is_busy(&m_store));
    TEST_ASSERT_TRUE(config_store_start(&m_store));
    for (unsigned i = 0; i < 1000 && !is_read; i++) {
        (void)usleep(5000);
        is_read = config_store_has_read(&m_store, &m_read, &m_text, &m_length);
    }
    TEST_ASSERT_TRUE(is_read);
    TEST_ASSERT_FALSE(config_store_is_busy(&m_store));
    TEST_ASSERT_TRUE(worker_close(&m_store.worker, 1000));
    return m_read;
}

/* What can be read and never adopted: a pipe; and what cannot be read. */
static void test_a_file_that_cannot_be_read_again_says_why(void)
{
    TEST_ASSERT_EQUAL(0, unlink(m_file));
    TEST_ASSERT_NULL(read_now());
    TEST_ASSERT_EQUAL(-ENOENT, m_length);
    TEST_ASSERT_EQUAL(0, mkdir(m_file, 0700));
    TEST_ASSERT_NULL(read_now());
    TEST_ASSERT_EQUAL(-EISDIR, m_length);
    TEST_ASSERT_EQUAL(0, rmdir(m_file));
    TEST_ASSERT_EQUAL(0, mkfifo(m_file, 0600));
    const int pipe = open(m_file, O_RDWR | O_CLOEXEC);
    TEST_ASSERT_NULL(read_now());
    TEST_ASSERT_EQUAL(-ETIMEDOUT, m_length);
    (void)close(pipe);
    TEST_ASSERT_EQUAL(0, unlink(m_file));
    write_file(m_file, "; own again\n");
    TEST_ASSERT_EQUAL_STRING(m_file, read_now());
    TEST_ASSERT_EQUAL(12, m_length);
    TEST_ASSERT_EQUAL_STRING_LEN("; own again\n", m_text, 12);
}

static void apply(const char *text)
{
    TEST_ASSERT_NULL(take(text, SEALS));
    TEST_ASSERT_EQUAL(0, write_now());
    config_store_adopt(&m_store, m_store.kept);
}

static const char *in_force(void)
{
    static char text[256];
    const ssize_t length = pread(m_store.fd, text, sizeof text - 1, 0);
    text[length > 0 ? length : 0] = '\0';
    return text;
}

/* Somebody has edited the file, and made a mistake: that edit is not written over by what a client has made from the one before.
 */
static void test_a_file_that_was_read_and_refused_has_changed(void)
{
    write_file(m_file, "; own, with a mistake\n");
    TEST_ASSERT_EQUAL_STRING(m_file, read_now()); /* and nothing is adopted */
    TEST_ASSERT_NULL(take("; mine\n", SEALS));
    TEST_ASSERT_EQUAL(ESTALE, write_now());
    TEST_ASSERT_EQUAL_STRING(m_file, config_store_choose(m_file, m_kept));
    TEST_ASSERT_EQUAL_STRING(m_file, read_now());
    config_store_adopt(&m_store, m_read);
    apply("; mine\n");
    TEST_ASSERT_EQUAL_STRING(m_kept, config_store_choose(m_file, m_kept));
}

static void test_the_file_counts_until_another_is_applied(void)
{
    TEST_ASSERT_EQUAL_STRING(m_file, config_store_choose(m_file, m_kept));
    TEST_ASSERT_EQUAL_STRING("; own\n", in_force());
    TEST_ASSERT_FALSE(m_store.is_applied);
    apply("; mine");
    TEST_ASSERT_EQUAL_STRING(m_kept, config_store_choose(m_file, m_kept));
    TEST_ASSERT_EQUAL_STRING("; mine", in_force());
    TEST_ASSERT_TRUE(m_store.is_applied);
}

static void test_what_is_written_is_in_force_once_it_is_adopted(void)
{
    const int fd = m_store.fd;
    TEST_ASSERT_NULL(take("; mine\n", SEALS));
    TEST_ASSERT_EQUAL(0, write_now());
    TEST_ASSERT_EQUAL_STRING("; own\n", in_force());
    TEST_ASSERT_FALSE(m_store.is_applied);
    config_store_adopt(&m_store, m_store.kept);
    TEST_ASSERT_EQUAL_STRING("; mine\n", in_force());
    TEST_ASSERT_EQUAL_MESSAGE(fd, m_store.fd, "an answer may still be on its way with it");
}

static void test_a_changed_file_counts_again(void)
{
    apply("; mine\n");
    write_file(m_file, "; own, changed\n");
    TEST_ASSERT_EQUAL_STRING(m_file, config_store_choose(m_file, m_kept));
    TEST_ASSERT_NULL(take("; again\n", SEALS));
    TEST_ASSERT_EQUAL_MESSAGE(ESTALE, write_now(), "what somebody has edited would be lost");
    TEST_ASSERT_EQUAL_STRING(m_file, config_store_choose(m_file, m_kept));
    TEST_ASSERT_EQUAL_STRING(m_file, read_now());
    config_store_adopt(&m_store, m_read);
    TEST_ASSERT_EQUAL_STRING("; own, changed\n", in_force());
    apply("; again\n");
    TEST_ASSERT_EQUAL_STRING(m_kept, config_store_choose(m_file, m_kept));
}

static void test_the_last_line_is_no_part_of_the_text(void)
{
    apply("; mine\n");
    config_store_t *const other = calloc(1, sizeof *other);
    config_store_open(other, m_file, m_store.kept);
    TEST_ASSERT_EQUAL_STRING(m_store.digest, other->digest);
    TEST_ASSERT_EQUAL(7, other->length);
    TEST_ASSERT_TRUE(config_store_close(other));
    free(other);
    TEST_ASSERT_NULL(take("; mine\n; heaved: applied over 0123456789abcdef\n", SEALS)); /* comes back from who copied the file */
    TEST_ASSERT_EQUAL(7, m_store.text_length);
}

static void test_older_ones_are_kept(void)
{
    char path[CONFIG_PATH_MAX + 8];
    char text[16];
    for (int i = 0; i < 8; i++) {
        (void)snprintf(text, sizeof text, "; number %d\n", i);
        apply(text);
    }
    for (int i = 1; i <= 5; i++) {
        (void)snprintf(path, sizeof path, "%s.%d", m_store.kept, i);
        FILE *const file = fopen(path, "r");
        TEST_ASSERT_NOT_NULL_MESSAGE(file, path);
        TEST_ASSERT_NOT_NULL(fgets(text, sizeof text, file));
        (void)fclose(file);
        TEST_ASSERT_EQUAL('0' + 7 - i, text[9]);
    }
    (void)snprintf(path, sizeof path, "%s.6", m_store.kept);
    TEST_ASSERT_NOT_EQUAL(0, access(path, F_OK));
}

static void test_only_what_can_change_no_more_is_taken(void)
{
    const char *text = NULL;
    size_t length = 0;
    TEST_ASSERT_NOT_NULL(take("; mine\n", F_SEAL_GROW));
    TEST_ASSERT_NOT_NULL(take("; mine\n", F_SEAL_WRITE | F_SEAL_SHRINK));
    TEST_ASSERT_NOT_NULL(take("", SEALS));
    TEST_ASSERT_NOT_NULL(config_store_accept(&m_store, -1, &text, &length));
    TEST_ASSERT_NOT_NULL(config_store_accept(&m_store, STDIN_FILENO, &text, &length));
}

/* As the next start reads it. */
static void open_again(void)
{
    TEST_ASSERT_TRUE(config_store_close(&m_store));
    memset(&m_store, 0, sizeof m_store);
    config_store_open(&m_store, m_file, config_store_choose(m_file, m_kept));
}

/* Bytes of a comment. */
static char *long_text(size_t length)
{
    char *const text = malloc(length + 1u);
    TEST_ASSERT_NOT_NULL(text);
    memset(text, ';', length);
    text[length] = '\0';
    return text;
}

static void test_the_longest_text_that_is_taken_can_be_read_back(void)
{
    char *const text = long_text(CONFIG_STORE_TEXT_MAX + 1u);
    TEST_ASSERT_NOT_NULL(strstr(take(text, SEALS), "130976"));
    text[CONFIG_STORE_TEXT_MAX] = '\0';
    apply(text);
    open_again();
    TEST_ASSERT_TRUE(m_store.is_applied);
    TEST_ASSERT_EQUAL(CONFIG_STORE_TEXT_MAX + 1u, m_store.length);                  /* with the line feed that it lacked */
    TEST_ASSERT_NOT_NULL(take("; heaved: applied over 0123456789abcdef\n", SEALS)); /* and nothing before it */
    free(text);
}

static void test_a_kept_one_that_is_too_long_leaves_the_text_of_the_file(void)
{
    char *const text = long_text(CONFIG_FILE_MAX + 1u);
    write_file(m_store.kept, text);
    open_again();
    TEST_ASSERT_FALSE(m_store.is_applied);
    TEST_ASSERT_EQUAL_STRING("; own\n", in_force());
    free(text);
}

static void test_a_disk_that_refuses_changes_nothing(void)
{
    char path[CONFIG_PATH_MAX + 8];
    apply("; first\n");
    (void)snprintf(path, sizeof path, "%s.new", m_store.kept);
    TEST_ASSERT_EQUAL(0, symlink("/dev/null", path)); /* nobody's link is followed */
    TEST_ASSERT_NULL(take("; second\n", SEALS));
    TEST_ASSERT_NOT_EQUAL(0, write_now());
    TEST_ASSERT_EQUAL_STRING("; first\n", in_force());
    TEST_ASSERT_EQUAL(0, unlink(path));
    apply("; third\n");
}

static void test_what_cannot_be_started_makes_way_for_the_one_before(void)
{
    char failed[CONFIG_PATH_MAX + 8];
    (void)snprintf(failed, sizeof failed, "%s.failed", m_store.kept);
    TEST_ASSERT_FALSE(config_store_put_back(m_store.kept)); /* nothing was applied */
    apply("; first\n");
    apply("; second\n");
    TEST_ASSERT_EQUAL(0, mkdir(failed, 0700)); /* it cannot be kept beside it: it stays where it is */
    TEST_ASSERT_FALSE(config_store_put_back(m_store.kept));
    open_again();
    TEST_ASSERT_EQUAL_STRING("; second\n", in_force());
    TEST_ASSERT_EQUAL(0, rmdir(failed));
    (void)snprintf(m_store.put_back, sizeof m_store.put_back, "told");
    TEST_ASSERT_TRUE(config_store_put_back(m_store.kept));
    TEST_ASSERT_EQUAL(0, access(failed, R_OK));
    open_again();
    TEST_ASSERT_EQUAL_STRING("; first\n", in_force());
    TEST_ASSERT_EQUAL_STRING("", m_store.put_back);
    TEST_ASSERT_TRUE(config_store_put_back(m_store.kept)); /* none before it: the file counts */
    open_again();
    TEST_ASSERT_EQUAL_STRING("; own\n", in_force());
    TEST_ASSERT_FALSE(m_store.is_applied);
    TEST_ASSERT_NOT_EQUAL(0, access(m_store.kept, F_OK));
}

static void test_a_text_in_force_ends_what_is_told_of_an_older_one(void)
{
    (void)snprintf(m_store.put_back, sizeof m_store.put_back, "told");
    apply("; mine\n");
    TEST_ASSERT_EQUAL_STRING("", m_store.put_back);
}

static void test_without_a_state_directory_nothing_is_kept(void)
{
    (void)unsetenv("STATE_DIRECTORY"); // NOLINT(concurrency-mt-unsafe)
    TEST_ASSERT_EQUAL_STRING(m_file, config_store_choose(m_file, m_kept));
    TEST_ASSERT_EQUAL_STRING("", m_kept);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_the_file_counts_until_another_is_applied);
    RUN_TEST(test_what_is_written_is_in_force_once_it_is_adopted);
    RUN_TEST(test_a_changed_file_counts_again);
    RUN_TEST(test_a_file_that_was_read_and_refused_has_changed);
    RUN_TEST(test_a_file_that_cannot_be_read_again_says_why);
    RUN_TEST(test_the_last_line_is_no_part_of_the_text);
    RUN_TEST(test_older_ones_are_kept);
    RUN_TEST(test_only_what_can_change_no_more_is_taken);
    RUN_TEST(test_the_longest_text_that_is_taken_can_be_read_back);
    RUN_TEST(test_a_kept_one_that_is_too_long_leaves_the_text_of_the_file);
    RUN_TEST(test_a_disk_that_refuses_changes_nothing);
    RUN_TEST(test_what_cannot_be_started_makes_way_for_the_one_before);
    RUN_TEST(test_a_text_in_force_ends_what_is_told_of_an_older_one);
    RUN_TEST(test_without_a_state_directory_nothing_is_kept);
    return UNITY_END();
}
