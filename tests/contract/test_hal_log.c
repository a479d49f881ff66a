/* SPDX-License-Identifier: MIT
 * test_hal_log.c - the contract of hal/log.h on every backend (Linux into a pipe), and what the Linux ring promises beyond it.
 */
#include "contract.h"

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <pthread.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <termios.h>
#include <unistd.h>

#include "linux_log.h"
#include "sim_log.h"

/** A backend under test. */
typedef struct {
    const char *name;
    uint32_t lines; /**< lines that fit */
    hal_log_t (*open)(void);
    void (*close)(void);
    bool (*take)(int *level, char *text); /**< the other side takes a line, false: none */
} fixture_t;

static const fixture_t *fixture;
static hal_log_t hal;

static sim_log_t sim;

static hal_log_t open_sim(void)
{
    sim_log_init(&sim);
    return sim_log_hal(&sim);
}

static void close_sim(void) {}

static bool take_sim(int *level, char *text)
{
    const sim_log_line_t *line = sim_log_pop(&sim);
    if (line != NULL) {
        *level = (int)line->level;
        strcpy(text, line->text);
    }
    return line != NULL;
}

static linux_log_t lin;
static int ends[2]; /* of the pipe */
static char text_in[1 << 20];
static size_t text_length;
static size_t text_read;

static hal_log_t open_linux(void)
{
    if (pipe2(ends, O_NONBLOCK) != 0) {
        abort();
    }
    text_length = 0;
    text_read = 0;
    linux_log_init(&lin, ends[1]);
    return linux_log_hal(&lin);
}

static void close_linux(void)
{
    (void)close(ends[0]);
    (void)close(ends[1]);
}

/* Reads what the pipe holds. */
static void drain_pipe(void)
{
    ssize_t got;
    while ((got = read(ends[0], text_in + text_length, sizeof text_in - 1 - text_length)) > 0) {
        text_length += (size_t)got;
    }
    text_in[text_length] = '\0';
}

static bool next_line(int *level, char *text)
{
    char *end = memchr(text_in + text_read, '\n', text_length - text_read);
    if (end == NULL) {
        return false;
    }
    *end = '\0';
    TEST_ASSERT_EQUAL('<', text_in[text_read]);
    TEST_ASSERT_EQUAL('>', text_in[text_read + 2]);
    *level = text_in[text_read + 1] - '0';
    strcpy(text, text_in + text_read + 3);
    text_read = (size_t)(end - text_in) + 1;
    return true;
}

/* The printer's own line about lost ones is no line of the writer. */
static bool next_written_line(int *level, char *text)
{
    while (next_line(level, text)) {
        if (strstr(text, "log lines dropped") == NULL) {
            return true;
        }
    }
    return false;
}

static bool take_linux(int *level, char *text)
{
    hv_status_t status;
    if (next_written_line(level, text)) {
        return true;
    }
    do {
        status = linux_log_flush(&lin);
        drain_pipe();
    } while (status == HV_ERR_AGAIN);
    return next_written_line(level, text);
}

static const fixture_t k_fixtures[] = {{"sim", SIM_LOG_LINES, open_sim, close_sim, take_sim},
                                       {"linux", LINUX_LOG_LINES, open_linux, close_linux, take_linux}};

void setUp(void)
{
    hal = fixture->open();
}

void tearDown(void)
{
    fixture->close();
}

static void assert_taken(int expected_level, const char *expected)
{
    int level = -1;
    char text[512] = "";
    TEST_ASSERT_TRUE_MESSAGE(fixture->take(&level, text), expected);
    TEST_ASSERT_EQUAL_STRING(expected, text);
    TEST_ASSERT_EQUAL(expected_level, level);
}

static void assert_none(void)
{
    int level;
    char text[512];
    TEST_ASSERT_FALSE(fixture->take(&level, text));
}

static void write_numbered(unsigned number)
{
    char text[32];
    (void)snprintf(text, sizeof text, "line %u", number);
    hal_log_write(hal, HAL_LOG_INFO, text);
}

static void assert_numbered(unsigned number)
{
    char text[32];
    (void)snprintf(text, sizeof text, "line %u", number);
    assert_taken(HAL_LOG_INFO, text);
}

static void test_valid_complete_accepts(void)
{
    TEST_ASSERT_TRUE(hal_log_valid(hal));
}

static void test_valid_any_op_missing_refuses(void)
{
    hal_log_ops_t ops = *hal.ops;
    TEST_ASSERT_FALSE(hal_log_valid((hal_log_t){NULL, NULL}));
    ops.write = NULL;
    TEST_ASSERT_FALSE(hal_log_valid((hal_log_t){&ops, hal.ctx}));
    ops = *hal.ops;
    ops.dropped = NULL;
    TEST_ASSERT_FALSE(hal_log_valid((hal_log_t){&ops, hal.ctx}));
}

static void test_write_every_level_arrives_with_its_text(void)
{
    static const hal_log_level_t k_levels[] = {HAL_LOG_ERROR, HAL_LOG_WARNING, HAL_LOG_NOTICE, HAL_LOG_INFO, HAL_LOG_DEBUG};
    for (size_t i = 0; i < 5; i++) {
        hal_log_write(hal, k_levels[i], "axis 3: following error");
    }
    for (int level = 3; level <= 7; level++) {
        assert_taken(level, "axis 3: following error");
    }
    assert_none();
    TEST_ASSERT_EQUAL_UINT32(0, hal_log_dropped(hal));
}

static void test_write_empty_text_is_a_line(void)
{
    hal_log_write(hal, HAL_LOG_INFO, "");
    assert_taken(HAL_LOG_INFO, "");
}

static void test_write_text_is_copied(void)
{
    char text[] = "before";
    hal_log_write(hal, HAL_LOG_INFO, text);
    memset(text, 'x', sizeof text - 1);
    assert_taken(HAL_LOG_INFO, "before");
}

static void test_write_longest_text_is_whole_and_longer_is_cut(void)
{
    char text[600], expected[HAL_LOG_TEXT_MAX + 1];
    memset(text, 'a', sizeof text);
    text[sizeof text - 1] = '\0';
    memset(expected, 'a', HAL_LOG_TEXT_MAX);
    expected[HAL_LOG_TEXT_MAX] = '\0';
    hal_log_write(hal, HAL_LOG_INFO, expected);
    hal_log_write(hal, HAL_LOG_INFO, text);
    assert_taken(HAL_LOG_INFO, expected);
    assert_taken(HAL_LOG_INFO, expected);
}

/* A sender must not be able to forge lines or move a terminal's cursor. */
static void test_write_bytes_outside_printable_ascii_become_question_marks(void)
{
    for (int byte = 1; byte < 256; byte++) {
        char text[] = {'[', (char)byte, ']', '\0'};
        const char expected[] = {'[', byte >= ' ' && byte <= '~' ? (char)byte : '?', ']', '\0'};
        hal_log_write(hal, HAL_LOG_INFO, text);
        assert_taken(HAL_LOG_INFO, expected);
    }
}

static void test_write_full_drops_and_counts_the_new_ones_only(void)
{
    for (unsigned i = 0; i < fixture->lines + 7; i++) {
        write_numbered(i);
    }
    TEST_ASSERT_EQUAL_UINT32(7, hal_log_dropped(hal));
    for (unsigned i = 0; i < fixture->lines; i++) {
        assert_numbered(i);
    }
    assert_none();
    write_numbered(9999);
    assert_numbered(9999);
    TEST_ASSERT_EQUAL_UINT32(7, hal_log_dropped(hal));
}

static void test_write_many_times_round_keeps_order(void)
{
    unsigned next = 0;
    for (unsigned i = 0; i < 5 * fixture->lines; i++) {
        write_numbered(i);
        if (i % 3 == 0) {
            assert_numbered(next++);
        }
        if (i - next + 1 == fixture->lines) {
            while (next <= i) {
                assert_numbered(next++);
            }
        }
    }
    TEST_ASSERT_EQUAL_UINT32(0, hal_log_dropped(hal));
}

static void run_contract(void)
{
    RUN_TEST(test_valid_complete_accepts);
    RUN_TEST(test_valid_any_op_missing_refuses);
    RUN_TEST(test_write_every_level_arrives_with_its_text);
    RUN_TEST(test_write_empty_text_is_a_line);
    RUN_TEST(test_write_text_is_copied);
    RUN_TEST(test_write_longest_text_is_whole_and_longer_is_cut);
    RUN_TEST(test_write_bytes_outside_printable_ascii_become_question_marks);
    RUN_TEST(test_write_full_drops_and_counts_the_new_ones_only);
    RUN_TEST(test_write_many_times_round_keeps_order);
}

static void test_linux_flush_says_how_many_were_dropped_once(void)
{
    for (unsigned i = 0; i < LINUX_LOG_LINES + 3; i++) {
        write_numbered(i);
    }
    TEST_ASSERT_EQUAL(HV_OK, linux_log_flush(&lin));
    TEST_ASSERT_EQUAL(HV_OK, linux_log_flush(&lin));
    drain_pipe();
    const char *told = strstr(text_in, "<4>3 log lines dropped\n");
    TEST_ASSERT_NOT_NULL(told);
    TEST_ASSERT_NULL(strstr(strchr(told, '\n'), "dropped"));
}

/* A pipe that nobody reads takes only so much; every line comes out whole and once when it is read again. */
static void test_linux_flush_full_pipe_says_again_and_loses_nothing(void)
{
    char text[HAL_LOG_TEXT_MAX + 1], expected[HAL_LOG_TEXT_MAX + 1];
    unsigned written = 0;
    hv_status_t status = HV_OK;
    while (status == HV_OK) {
        (void)snprintf(text, sizeof text, "%0200u", written++);
        hal_log_write(hal, HAL_LOG_INFO, text);
        status = linux_log_flush(&lin);
    }
    TEST_ASSERT_EQUAL(HV_ERR_AGAIN, status);
    TEST_ASSERT_EQUAL(HV_ERR_AGAIN, linux_log_flush(&lin));
    drain_pipe();
    for (unsigned i = 0; i < written; i++) {
        (void)snprintf(expected, sizeof expected, "%0200u", i);
        assert_taken(HAL_LOG_INFO, expected);
    }
    assert_none();
    TEST_ASSERT_EQUAL_UINT32(0, hal_log_dropped(hal));
}

static void test_linux_flush_reader_gone_says_io(void)
{
    (void)signal(SIGPIPE, SIG_IGN);
    (void)close(ends[0]);
    write_numbered(1);
    TEST_ASSERT_EQUAL(HV_ERR_IO, linux_log_flush(&lin));
    TEST_ASSERT_EQUAL(EPIPE, errno);
    ends[0] = open("/dev/null", O_RDONLY);
    (void)signal(SIGPIPE, SIG_DFL);
}

static void test_linux_flush_terminal_gets_no_prefix(void)
{
    char text[32] = "";
    const int master = posix_openpt(O_RDWR | O_NOCTTY);
    if (master < 0 || grantpt(master) != 0 || unlockpt(master) != 0) {
        TEST_IGNORE_MESSAGE("no terminal to be had here");
    }
    const int slave = open(ptsname(master), O_RDWR | O_NOCTTY);
    linux_log_init(&lin, slave);
    write_numbered(5);
    TEST_ASSERT_EQUAL(HV_OK, linux_log_flush(&lin));
    TEST_ASSERT_TRUE(read(master, text, sizeof text - 1) > 0);
    TEST_ASSERT_EQUAL_STRING("line 5\r\n", text);
    (void)close(slave);
    (void)close(master);
}

/* A terminal takes parts of a line, unlike a pipe; what it did not take follows later. */
static void test_linux_flush_partly_taken_line_is_finished_later(void)
{
    struct termios raw;
    unsigned written = 0;
    hv_status_t status = HV_OK;
    const int master = posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK);
    if (master < 0 || grantpt(master) != 0 || unlockpt(master) != 0) {
        TEST_IGNORE_MESSAGE("no terminal to be had here");
    }
    const int slave = open(ptsname(master), O_RDWR | O_NOCTTY | O_NONBLOCK);
    TEST_ASSERT_EQUAL(0, tcgetattr(slave, &raw));
    cfmakeraw(&raw);
    TEST_ASSERT_EQUAL(0, tcsetattr(slave, TCSANOW, &raw));
    linux_log_init(&lin, slave);
    for (; written < 200; written++) {
        char text[HAL_LOG_TEXT_MAX + 1];
        (void)snprintf(text, sizeof text, "%0200u", written);
        hal_log_write(hal, HAL_LOG_INFO, text);
    }
    while (text_length < 200 * 201) {
        status = linux_log_flush(&lin);
        TEST_ASSERT_TRUE(status == HV_OK || status == HV_ERR_AGAIN);
        struct pollfd readable = {.fd = master, .events = POLLIN};
        TEST_ASSERT_EQUAL_MESSAGE(1, poll(&readable, 1, 60000), "bytes are missing");
        const ssize_t got = read(master, text_in + text_length, sizeof text_in - 1 - text_length);
        TEST_ASSERT_TRUE(got > 0);
        text_length += (size_t)got;
    }
    for (unsigned i = 0; i < written; i++) {
        char expected[HAL_LOG_TEXT_MAX + 1];
        (void)snprintf(expected, sizeof expected, "%0200u\n", i);
        TEST_ASSERT_EQUAL(0, strncmp(expected, text_in + 201 * i, 201));
    }
    (void)close(slave);
    (void)close(master);
}

static void test_linux_write_counters_wrap_without_loss(void)
{
    lin.written = UINT32_MAX - 100;
    lin.printed = UINT32_MAX - 100;
    for (unsigned i = 0; i < LINUX_LOG_LINES; i++) {
        write_numbered(i);
    }
    write_numbered(12345);
    TEST_ASSERT_EQUAL_UINT32(1, hal_log_dropped(hal));
    for (unsigned i = 0; i < LINUX_LOG_LINES; i++) {
        assert_numbered(i);
    }
}

#define THREAD_LINES 200000u

static void *write_from_thread(void *arg)
{
    (void)arg;
    for (unsigned i = 0; i < THREAD_LINES; i++) {
        write_numbered(i);
    }
    return NULL;
}

/* Writer and printer at the same time: every line is printed whole, in order, once, or counted as dropped. */
static void test_linux_write_beside_the_printer_accounts_for_every_line(void)
{
    static char chunk[1 << 16];
    pthread_t writer;
    unsigned received = 0, told = 0;
    long last = -1;
    bool is_done = false;
    linux_log_init(&lin, ends[1]);
    TEST_ASSERT_EQUAL(0, pthread_create(&writer, NULL, write_from_thread, NULL));
    size_t kept = 0;
    while (!is_done) {
        is_done = last == (long)THREAD_LINES - 1 || hal_log_dropped(hal) + received >= THREAD_LINES;
        (void)!linux_log_flush(&lin);
        const ssize_t got = read(ends[0], chunk + kept, sizeof chunk - 1 - kept);
        kept += got > 0 ? (size_t)got : 0;
        chunk[kept] = '\0';
        char *line = chunk;
        for (char *end; (end = strchr(line, '\n')) != NULL; line = end + 1) {
            unsigned number;
            *end = '\0';
            if (sscanf(line, "<4>%u log lines dropped", &number) == 1) {
                told += number;
                continue;
            }
            TEST_ASSERT_EQUAL_MESSAGE(1, sscanf(line, "<6>line %u", &number), line);
            TEST_ASSERT_TRUE((long)number > last);
            last = (long)number;
            received++;
        }
        kept = strlen(line);
        memmove(chunk, line, kept + 1);
        is_done = is_done && got <= 0;
    }
    TEST_ASSERT_EQUAL(0, pthread_join(writer, NULL));
    TEST_ASSERT_EQUAL_UINT32(THREAD_LINES, received + hal_log_dropped(hal));
    TEST_ASSERT_EQUAL_UINT32(hal_log_dropped(hal), told);
}

static void run_linux(void)
{
    RUN_TEST(test_linux_flush_says_how_many_were_dropped_once);
    RUN_TEST(test_linux_flush_full_pipe_says_again_and_loses_nothing);
    RUN_TEST(test_linux_flush_reader_gone_says_io);
    RUN_TEST(test_linux_flush_terminal_gets_no_prefix);
    RUN_TEST(test_linux_flush_partly_taken_line_is_finished_later);
    RUN_TEST(test_linux_write_counters_wrap_without_loss);
    RUN_TEST(test_linux_write_beside_the_printer_accounts_for_every_line);
}

int main(void)
{
    UNITY_BEGIN();
    for (size_t i = 0; i < sizeof k_fixtures / sizeof k_fixtures[0]; i++) {
        fixture = &k_fixtures[i];
        contract_backend = fixture->name;
        run_contract();
    }
    contract_backend = "linux";
    run_linux();
    return UNITY_END();
}
