/* SPDX-License-Identifier: MIT
 * test_operator_log.c - the file of the operator log: what is in a line, that lines are added and never lost in a rotation, and
 * that a disk that takes nothing is told of and counted.
 */
#include "service/operator_log.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <signal.h>
#include <unistd.h>

#include "common/message.h"
#include "unity.h"

static operator_log_t m_log;
static config_t m_config;
static char m_folder[64];
static char m_path[96];
static char m_text[1u << 20];

static void open_log(void)
{
    memset(&m_log, 0, sizeof m_log);
    TEST_ASSERT_EQUAL(EXIT_DONE, operator_log_open(&m_log, &m_config));
}

void setUp(void)
{
    (void)unsetenv("STATE_DIRECTORY");
    (void)snprintf(m_folder, sizeof m_folder, "/tmp/heave-operators-XXXXXX");
    TEST_ASSERT_NOT_NULL(mkdtemp(m_folder));
    (void)snprintf(m_path, sizeof m_path, "%s/operators", m_folder);
    (void)snprintf(m_config.operator_log, sizeof m_config.operator_log, "%s", m_path);
    m_config.operator_log_kb = 16;
    m_config.operator_log_files = 3;
}

void tearDown(void)
{
    char command[128];
    (void)operator_log_close(&m_log);
    (void)snprintf(command, sizeof command, "rm -rf %s", m_folder);
    TEST_ASSERT_EQUAL(0, system(command));
}

/* Bytes of a file, whose text is then in m_text. */
static size_t read_file(const char *path)
{
    FILE *file = fopen(path, "rb");
    size_t length = 0;
    if (file != NULL) {
        length = fread(m_text, 1, sizeof m_text - 1, file);
        (void)fclose(file);
    }
    m_text[length] = '\0';
    return length;
}

static unsigned lines(void)
{
    unsigned count = 0;
    for (const char *at = m_text; (at = strchr(at, '\n')) != NULL; at++) {
        count++;
    }
    return count;
}

static operator_entry_t entry_of(const char *request, int64_t at_s)
{
    operator_entry_t entry = {.at = {at_s, 7999999},
                              .uid = 1000,
                              .gid = 100,
                              .pid = 4711,
                              .level = LEVEL_OPERATE,
                              .before = STATE_SETTLED,
                              .after = STATE_RISING};
    (void)snprintf(entry.request, sizeof entry.request, "%s", request);
    return entry;
}

static void add(const char *request, int64_t at_s)
{
    const operator_entry_t entry = entry_of(request, at_s);
    operator_log_add(&m_log, &entry);
}

static void test_log_line_says_all(void)
{
    open_log();
    operator_entry_t entry = entry_of("engage", 1709210096); /* date -u -d @1709210096 */
    (void)snprintf(entry.by, sizeof entry.by, "a\"b\n");
    operator_log_add(&m_log, &entry);
    entry = entry_of("reset", 4107542399);
    (void)snprintf(entry.answer, sizeof entry.answer, "reset: there is nothing to reset");
    entry.after = STATE_SETTLED;
    operator_log_add(&m_log, &entry);
    add("hold", 951782400);
    operator_log_step(&m_log);
    (void)read_file(m_path);
    TEST_ASSERT_EQUAL_STRING(
        "{\"time\":\"2024-02-29T12:34:56.007Z\",\"uid\":1000,\"gid\":100,\"pid\":4711,\"level\":\"operate\",\"by\":"
        "\"a\\\"b\\u000A\",\"request\":"
        "\"engage\",\"ok\":true,"
        "\"answer\":\"\",\"before\":\"SETTLED\",\"after\":\"RISING\",\"repeats_before\":0,\"left_out_before\":0}\n"
        "{\"time\":\"2100-02-28T23:59:59.007Z\",\"uid\":1000,\"gid\":100,\"pid\":4711,\"level\":\"operate\",\"by\":\"\","
        "\"request\":\"reset\",\"ok\":"
        "false,"
        "\"answer\":\"reset: there is nothing to "
        "reset\",\"before\":\"SETTLED\",\"after\":\"SETTLED\",\"repeats_before\":0,\"left_out_before\":0}\n"
        "{\"time\":\"2000-02-29T00:00:00.007Z\",\"uid\":1000,\"gid\":100,\"pid\":4711,\"level\":\"operate\",\"by\":\"\","
        "\"request\":\"hold\",\"ok\":"
        "true,"
        "\"answer\":\"\",\"before\":\"SETTLED\",\"after\":\"RISING\",\"repeats_before\":0,\"left_out_before\":0}\n",
        m_text);
}

static void test_log_goes_on_where_it_ended(void)
{
    open_log();
    add("engage", 1);
    TEST_ASSERT_TRUE(operator_log_close(&m_log));
    open_log();
    add("park", 2);
    TEST_ASSERT_TRUE(operator_log_close(&m_log));
    (void)read_file(m_path);
    TEST_ASSERT_EQUAL_UINT(2, lines());
    struct stat found;
    TEST_ASSERT_EQUAL(0, stat(m_path, &found));
    TEST_ASSERT_EQUAL_HEX(0640, found.st_mode & 0777 & ~022); /* less what the umask takes */
}

static void test_log_rotation_keeps_so_many_files_and_every_newer_line(void)
{
    char request[32], path[128];
    unsigned seen = 0, newest = 0;
    open_log();
    for (unsigned i = 0; i < 1000; i++) {
        (void)snprintf(request, sizeof request, "request %u.", i);
        add(request, 100);
        operator_log_step(&m_log);
    }
    TEST_ASSERT_EQUAL_UINT32(0, operator_log_lost(&m_log));
    for (unsigned number = 4; number-- > 0;) { /* the oldest first: no gap between them */
        (void)snprintf(path, sizeof path, number == 0 ? "%s" : "%s.%u", m_path, number);
        const size_t bytes = read_file(path);
        TEST_ASSERT_TRUE(bytes > 0 && bytes <= 16 * 1024);
        for (const char *at = m_text; (at = strstr(at, "request ")) != NULL; at++) {
            const unsigned is = (unsigned)atoi(at + 8);
            TEST_ASSERT_TRUE(seen == 0 || is == newest + 1);
            newest = is;
            seen++;
        }
    }
    TEST_ASSERT_EQUAL_UINT(999, newest);
    TEST_ASSERT_GREATER_THAN_UINT(200, seen);
    (void)snprintf(path, sizeof path, "%s.4", m_path);
    TEST_ASSERT_EQUAL(0, read_file(path));
}

/* Something stands in the way of the older one: no line is lost, the file grows. */
static void test_log_that_cannot_be_rotated_goes_on(void)
{
    char request[32], path[128];
    (void)snprintf(path, sizeof path, "%s.1", m_path);
    TEST_ASSERT_EQUAL(0, mkdir(path, 0700));
    (void)snprintf(path, sizeof path, "%s.3", m_path);
    TEST_ASSERT_EQUAL(0, mkdir(path, 0700));
    (void)snprintf(path, sizeof path, "%s.2", m_path);
    FILE *file = fopen(path, "w"); /* no folder goes in its place, and it in that of none */
    TEST_ASSERT_NOT_NULL(file);
    (void)fclose(file);
    open_log();
    for (unsigned i = 0; i < 300; i++) {
        (void)snprintf(request, sizeof request, "request %u.", i);
        add(request, 100);
        operator_log_step(&m_log);
    }
    TEST_ASSERT_EQUAL_UINT32(0, operator_log_lost(&m_log));
    (void)read_file(m_path);
    TEST_ASSERT_EQUAL_UINT(300, lines());
}

static void test_log_the_same_again_and_again_is_a_number(void)
{
    open_log();
    for (unsigned i = 0; i < 100000; i++) {
        add("hold", 100);
    }
    add("hold", 100 + OPERATOR_LOG_REPEATS_S);
    add("engage", 100 + OPERATOR_LOG_REPEATS_S);
    add("engage", 101 + OPERATOR_LOG_REPEATS_S);
    add("engage", 102 + OPERATOR_LOG_REPEATS_S);
    TEST_ASSERT_TRUE(operator_log_close(&m_log));
    (void)read_file(m_path);
    TEST_ASSERT_EQUAL_UINT(4, lines()); /* the end says the rest */
    TEST_ASSERT_NOT_NULL(strstr(m_text, "00:01:52.007Z"));
    TEST_ASSERT_NOT_NULL(strstr(m_text, "\"repeats_before\":1,"));
    TEST_ASSERT_NOT_NULL(strstr(m_text, "\"repeats_before\":99999,"));
    TEST_ASSERT_EQUAL_UINT32(0, operator_log_lost(&m_log));
}

/* Who may only look, or is refused, asks by turns for ever: a day of it leaves what operators did. */
static void test_log_what_is_refused_pushes_nothing_out(void)
{
    uint64_t told = 0;
    unsigned asked = 0;
    open_log();
    add("engage", 1000);
    for (int64_t at_s = 1000; at_s < 1000 + 86400; at_s += 2) {
        for (unsigned i = 0; i < 4; i++) {
            operator_entry_t entry = entry_of(i % 2 == 0 ? "engage" : "park", at_s);
            entry.uid = 2000 + (i / 2);
            entry.level = LEVEL_LOOK;
            (void)snprintf(entry.answer, sizeof entry.answer, "%s: takes the level operate", entry.request);
            entry.is_refused = true;
            operator_log_add(&m_log, &entry);
            entry.level = LEVEL_OPERATE; /* holds: done, and refused to an operator */
            operator_log_add(&m_log, &entry);
            (void)snprintf(entry.by, sizeof entry.by, "%u", asked);
            entry.level = LEVEL_LOOK;
            entry.answer[0] = '\0';
            entry.is_refused = false;
            entry.after = entry.before;
            operator_log_add(&m_log, &entry);
            asked += 3;
        }
        operator_log_step(&m_log);
    }
    operator_entry_t held = entry_of("hold", 1000 + 86400); /* who has stopped a ride is told, whoever it was */
    held.level = LEVEL_LOOK;
    held.uid = 2000;
    operator_log_add(&m_log, &held);
    held = entry_of("engage", 1000 + 86400); /* carried out, though its client has gone */
    (void)snprintf(held.answer, sizeof held.answer, "under way");
    operator_log_add(&m_log, &held);
    add("park", 1000 + 86400);
    operator_log_step(&m_log);
    char path[128];
    (void)snprintf(path, sizeof path, "%s.1", m_path);
    TEST_ASSERT_EQUAL_MESSAGE(0, read_file(path), "what is minor alone begins no other file");
    const size_t bytes = read_file(m_path);
    TEST_ASSERT_LESS_THAN(2 * 16 * 1024 / OPERATOR_LOG_MINOR_OF + 1600, bytes);
    TEST_ASSERT_NOT_NULL(strstr(m_text, "\"level\":\"look\",\"by\":\"\",\"request\":\"hold\",\"ok\":true"));
    TEST_ASSERT_NOT_NULL(strstr(m_text, "\"answer\":\"under way\""));
    TEST_ASSERT_NOT_NULL(strstr(m_text, "\"request\":\"engage\",\"ok\":true"));
    for (const char *at = m_text; (at = strstr(at, "_before\":")) != NULL; at++) {
        told += strtoul(at + 9, NULL, 10);
    }
    TEST_ASSERT_EQUAL_UINT64_MESSAGE(asked + 4, told + lines(), "each is a line or counted");
    TEST_ASSERT_EQUAL_UINT32(0, operator_log_lost(&m_log));
}

/* A busy operator is in the log as ever: what is refused now and then, and all that is done. */
static void test_log_of_operators_has_each_request(void)
{
    open_log();
    for (unsigned i = 0; i < 8; i++) {
        operator_entry_t entry = entry_of(i % 2 == 0 ? "engage" : "reset", 1000 + i);
        (void)snprintf(entry.answer, sizeof entry.answer, "not possible");
        entry.is_refused = true;
        operator_log_add(&m_log, &entry);
    }
    for (unsigned i = 0; i < 20; i++) {
        add(i % 2 == 0 ? "hold" : "resume", 1010);
    }
    operator_log_step(&m_log);
    (void)read_file(m_path);
    TEST_ASSERT_EQUAL_UINT(28, lines());
}

static void test_log_more_than_there_is_room_for_is_counted(void)
{
    char request[32];
    open_log();
    for (unsigned i = 0; i < 1000; i++) {
        (void)snprintf(request, sizeof request, "%u", i);
        add(request, 100);
    }
    const uint32_t lost = operator_log_lost(&m_log);
    TEST_ASSERT_TRUE(lost > 0 && lost < 1000);
    operator_log_step(&m_log);
    (void)read_file(m_path);
    TEST_ASSERT_TRUE(lines() <= 1000 - lost && lines() > 0); /* older ones were rotated */
}

static void test_log_full_disk_is_told_counted_and_written_again(void)
{
    struct rlimit before;
    int error = 0;
    open_log();
    add("engage", 1);
    operator_log_step(&m_log);
    const size_t bytes = read_file(m_path);
    TEST_ASSERT_FALSE(operator_log_trouble(&m_log, &error));
    (void)signal(SIGXFSZ, SIG_IGN);
    TEST_ASSERT_EQUAL(0, getrlimit(RLIMIT_FSIZE, &before));
    const struct rlimit tight = {bytes + 10, before.rlim_max}; /* a part of the line goes in */
    TEST_ASSERT_EQUAL(0, setrlimit(RLIMIT_FSIZE, &tight));
    add("park", 2);
    operator_log_step(&m_log);
    TEST_ASSERT_TRUE(operator_log_trouble(&m_log, &error));
    TEST_ASSERT_NOT_EQUAL(0, error);
    TEST_ASSERT_FALSE(operator_log_trouble(&m_log, &error));
    TEST_ASSERT_EQUAL_UINT32(1, operator_log_lost(&m_log));
    TEST_ASSERT_EQUAL(0, setrlimit(RLIMIT_FSIZE, &before));
    TEST_ASSERT_EQUAL(bytes, read_file(m_path)); /* no half line */
    add("hold", 3);
    operator_log_step(&m_log);
    TEST_ASSERT_TRUE(operator_log_trouble(&m_log, &error));
    TEST_ASSERT_EQUAL(0, error);
    (void)read_file(m_path);
    TEST_ASSERT_EQUAL_UINT(2, lines());
}

static void test_log_that_cannot_be_is_refused_at_the_start(void)
{
    static const char *const k_paths[] = {"/nowhere/at/all", "/dev/null", "/tmp"};
    for (unsigned i = 0; i < 3; i++) {
        (void)snprintf(m_config.operator_log, sizeof m_config.operator_log, "%s", k_paths[i]);
        memset(&m_log, 0, sizeof m_log);
        TEST_ASSERT_EQUAL_MESSAGE(EXIT_NO_OUTPUT, operator_log_open(&m_log, &m_config), k_paths[i]);
    }
    char fifo[CONFIG_PATH_MAX];
    (void)snprintf(fifo, sizeof fifo, "%s/fifo", m_folder);
    TEST_ASSERT_EQUAL(0, mkfifo(fifo, 0600));
    (void)snprintf(m_config.operator_log, sizeof m_config.operator_log, "%s", fifo);
    memset(&m_log, 0, sizeof m_log);
    TEST_ASSERT_EQUAL(EXIT_NO_OUTPUT, operator_log_open(&m_log, &m_config)); /* nor does it wait for a reader */
}

static void test_log_is_in_the_state_directory_where_none_is_named(void)
{
    char path[128];
    (void)snprintf(m_config.operator_log, sizeof m_config.operator_log, "none");
    open_log();
    add("hold", 1);
    TEST_ASSERT_TRUE(operator_log_close(&m_log));
    (void)setenv("STATE_DIRECTORY", m_folder, 1);
    open_log();
    add("hold", 1);
    TEST_ASSERT_TRUE(operator_log_close(&m_log));
    (void)snprintf(path, sizeof path, "%s/operator.log", m_folder);
    (void)read_file(path);
    TEST_ASSERT_EQUAL_UINT(1, lines());
}

static void test_log_thread_writes_by_itself_and_ends(void)
{
    const struct timespec pause = {.tv_nsec = 10000000};
    open_log();
    TEST_ASSERT_TRUE(operator_log_start(&m_log));
    add("hold", 1);
    for (unsigned i = 0; i < 1000 && read_file(m_path) == 0; i++) {
        (void)nanosleep(&pause, NULL);
    }
    TEST_ASSERT_EQUAL_UINT(1, lines());
    add("park", 1);
    TEST_ASSERT_TRUE(operator_log_close(&m_log));
    (void)read_file(m_path);
    TEST_ASSERT_EQUAL_UINT(2, lines());
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_log_line_says_all);
    RUN_TEST(test_log_goes_on_where_it_ended);
    RUN_TEST(test_log_rotation_keeps_so_many_files_and_every_newer_line);
    RUN_TEST(test_log_that_cannot_be_rotated_goes_on);
    RUN_TEST(test_log_the_same_again_and_again_is_a_number);
    RUN_TEST(test_log_what_is_refused_pushes_nothing_out);
    RUN_TEST(test_log_of_operators_has_each_request);
    RUN_TEST(test_log_more_than_there_is_room_for_is_counted);
    RUN_TEST(test_log_full_disk_is_told_counted_and_written_again);
    RUN_TEST(test_log_that_cannot_be_is_refused_at_the_start);
    RUN_TEST(test_log_is_in_the_state_directory_where_none_is_named);
    RUN_TEST(test_log_thread_writes_by_itself_and_ends);
    return UNITY_END();
}
