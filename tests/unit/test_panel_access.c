/* SPDX-License-Identifier: MIT
 * test_panel_access.c - who may do what at the panel: passwords, sessions, names, tries.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "heave/status.h"
#include "panel/access.h"
#include "unity.h"

static access_t m_access;
static char m_folder[64];
static char m_why[256];

void hv_assert_failed(const char *file, int line)
{
    (void)fprintf(stderr, "%s:%d\n", file, line);
    abort();
}

void setUp(void)
{
    memset(&m_access, 0, sizeof m_access);
    (void)snprintf(m_folder, sizeof m_folder, "/tmp/heave-access-XXXXXX");
    TEST_ASSERT_NOT_NULL(mkdtemp(m_folder));
}

static const char *file(void)
{
    static char path[96];
    (void)snprintf(path, sizeof path, "%s/passwords", m_folder);
    return path;
}

void tearDown(void)
{
    (void)unlink(file());
    (void)rmdir(m_folder);
}

static void set(level_t role, const char *password)
{
    TEST_ASSERT_TRUE_MESSAGE(access_set_password(m_folder, role, password, m_why, sizeof m_why), m_why);
    TEST_ASSERT_TRUE_MESSAGE(access_load(&m_access, m_folder, m_why, sizeof m_why), m_why);
}

typedef enum { ACCESS_IN, ACCESS_WRONG, ACCESS_TOO_OFTEN } login_t;

/* As http.c, in one process. */
static login_t log_in(level_t role, const char *password, const char *address, int64_t now_s, char token[ACCESS_TOKEN_MAX])
{
    if (!access_begin(&m_access, address, now_s)) {
        return ACCESS_TOO_OFTEN;
    }
    const bool is_in = access_is_right(&m_access, role, password) && access_enter(&m_access, role, address, now_s, token);
    return is_in ? ACCESS_IN : ACCESS_WRONG;
}

static void test_without_a_file_nobody_has_a_password(void)
{
    TEST_ASSERT_TRUE(access_load(&m_access, m_folder, m_why, sizeof m_why));
    TEST_ASSERT_FALSE(m_access.has_password);
}

static void test_each_role_has_a_password_of_its_own(void)
{
    char token[ACCESS_TOKEN_MAX];
    struct stat status;
    set(LEVEL_LOOK, "look, a long one");
    set(LEVEL_SERVICE, "service, a long one");
    TEST_ASSERT_EQUAL(0, stat(file(), &status));
    TEST_ASSERT_EQUAL_HEX32(0600, status.st_mode & 0777);
    TEST_ASSERT_EQUAL(ACCESS_WRONG, log_in(LEVEL_SERVICE, "look, a long one", "a", 100, token));
    TEST_ASSERT_EQUAL(ACCESS_WRONG, log_in(LEVEL_OPERATE, "", "a", 100, token)); /* it has none */
    TEST_ASSERT_EQUAL(ACCESS_IN, log_in(LEVEL_SERVICE, "service, a long one", "a", 100, token));
    TEST_ASSERT_EQUAL(64, strlen(token));
    TEST_ASSERT_EQUAL(LEVEL_SERVICE, access_find(&m_access, token, 100));
    TEST_ASSERT_EQUAL(ACCESS_IN, log_in(LEVEL_LOOK, "look, a long one", "a", 100, token));
    TEST_ASSERT_EQUAL(LEVEL_LOOK, access_find(&m_access, token, 100));
}

static void test_sessions_end(void)
{
    char token[ACCESS_TOKEN_MAX];
    set(LEVEL_LOOK, "look, a long one");
    TEST_ASSERT_EQUAL(ACCESS_IN, log_in(LEVEL_LOOK, "look, a long one", "a", 100, token));
    TEST_ASSERT_EQUAL(LEVEL_LOOK, access_find(&m_access, token, 100 + 12 * 3600));
    TEST_ASSERT_EQUAL(ACCESS_NOBODY, access_find(&m_access, token, 100 + 24 * 3600 + 1));
    TEST_ASSERT_EQUAL(ACCESS_NOBODY, access_find(&m_access, token, 100));
    TEST_ASSERT_EQUAL(ACCESS_IN, log_in(LEVEL_LOOK, "look, a long one", "a", 100, token));
    int64_t now_s = 100;
    for (; access_find(&m_access, token, now_s) == LEVEL_LOOK && now_s < 10000000; now_s += 3600) {}
    TEST_ASSERT_INT64_WITHIN(3600, 100 + 7 * 24 * 3600, now_s);
    TEST_ASSERT_EQUAL(ACCESS_IN, log_in(LEVEL_LOOK, "look, a long one", "a", 100, token));
    access_logout(&m_access, token);
    TEST_ASSERT_EQUAL(ACCESS_NOBODY, access_find(&m_access, token, 100));
    TEST_ASSERT_EQUAL(ACCESS_NOBODY, access_find(&m_access, "", 100));
    TEST_ASSERT_EQUAL(ACCESS_NOBODY, access_find(&m_access, "0000", 100));
}

static void test_more_sessions_than_places_end_the_oldest(void)
{
    char first[ACCESS_TOKEN_MAX], token[ACCESS_TOKEN_MAX];
    set(LEVEL_LOOK, "look, a long one");
    TEST_ASSERT_EQUAL(ACCESS_IN, log_in(LEVEL_LOOK, "look, a long one", "a", 100, first));
    for (int i = 0; i < (int)ACCESS_SESSIONS_MAX; i++) {
        TEST_ASSERT_EQUAL(ACCESS_IN, log_in(LEVEL_LOOK, "look, a long one", "a", 200 + 20 * i, token));
    }
    TEST_ASSERT_EQUAL(ACCESS_NOBODY, access_find(&m_access, first, 2000));
    TEST_ASSERT_EQUAL(LEVEL_LOOK, access_find(&m_access, token, 2000));
}

static void test_who_guesses_waits(void)
{
    char token[ACCESS_TOKEN_MAX];
    set(LEVEL_LOOK, "look, a long one");
    for (unsigned i = 0; i < 5; i++) {
        TEST_ASSERT_EQUAL(ACCESS_WRONG, log_in(LEVEL_LOOK, "guess", "a", 100, token));
    }
    TEST_ASSERT_EQUAL(ACCESS_TOO_OFTEN, log_in(LEVEL_LOOK, "look, a long one", "a", 104, token));
    TEST_ASSERT_EQUAL(ACCESS_IN, log_in(LEVEL_LOOK, "look, a long one", "b", 104, token)); /* somebody else */
    TEST_ASSERT_EQUAL(ACCESS_IN, log_in(LEVEL_LOOK, "look, a long one", "a", 105, token));
    char name[8];
    for (unsigned i = 0; i < 13; i++) { /* many addresses */
        (void)snprintf(name, sizeof name, "c%u", i);
        TEST_ASSERT_EQUAL(ACCESS_WRONG, log_in(LEVEL_LOOK, "guess", name, 105, token));
    }
    TEST_ASSERT_EQUAL(ACCESS_TOO_OFTEN, log_in(LEVEL_LOOK, "look, a long one", "d", 106, token));
    TEST_ASSERT_EQUAL(ACCESS_IN, log_in(LEVEL_LOOK, "look, a long one", "d", 110, token));
}

static void test_who_guesses_much_at_once_waits_too(void)
{
    char token[ACCESS_TOKEN_MAX];
    set(LEVEL_LOOK, "look, a long one");
    for (unsigned i = 0; i < 5; i++) { /* none of them is known to be wrong yet */
        TEST_ASSERT_TRUE(access_begin(&m_access, "a", 100));
    }
    TEST_ASSERT_FALSE(access_begin(&m_access, "a", 100));
    TEST_ASSERT_TRUE(access_enter(&m_access, LEVEL_LOOK, "a", 100, token)); /* one of them was right */
    TEST_ASSERT_TRUE(access_begin(&m_access, "a", 100));
}

static void test_bad_files_and_passwords_are_named(void)
{
    TEST_ASSERT_FALSE(access_set_password(m_folder, LEVEL_LOOK, "short", m_why, sizeof m_why));
    TEST_ASSERT_NOT_NULL(strstr(m_why, "at least 8"));
    FILE *const out = fopen(file(), "w");
    fputs("look:$y$abc\n\nboss:$y$abc\n", out);
    (void)fclose(out);
    TEST_ASSERT_FALSE(access_load(&m_access, m_folder, m_why, sizeof m_why));
    TEST_ASSERT_NOT_NULL(strstr(m_why, "passwords:3:"));
    TEST_ASSERT_FALSE(access_set_password(m_folder, LEVEL_LOOK, "a long one", m_why, sizeof m_why)); /* nothing is lost */
}

static void test_names_of_the_panel(void)
{
    TEST_ASSERT_TRUE(access_allow_host(&m_access, "localhost"));
    TEST_ASSERT_TRUE(access_allow_host(&m_access, "[::1]"));
    TEST_ASSERT_TRUE(access_is_host(&m_access, "localhost:9801"));
    TEST_ASSERT_TRUE(access_is_host(&m_access, "LOCALHOST"));
    TEST_ASSERT_TRUE(access_is_host(&m_access, "[::1]:9801"));
    TEST_ASSERT_FALSE(access_is_host(&m_access, "localhost.evil:9801"));
    TEST_ASSERT_FALSE(access_is_host(&m_access, "evil:9801"));
    TEST_ASSERT_FALSE(access_is_host(&m_access, ""));
    TEST_ASSERT_TRUE(access_is_own_origin("http://localhost:9801", "localhost:9801", false));
    TEST_ASSERT_TRUE(access_is_own_origin("https://localhost:9801", "localhost:9801", false));
    TEST_ASSERT_FALSE(access_is_own_origin("http://localhost:9802", "localhost:9801", false));
    TEST_ASSERT_FALSE(access_is_own_origin("null", "localhost:9801", false));
    TEST_ASSERT_TRUE(access_is_own_origin("https://localhost:9801", "localhost:9801", true));
    TEST_ASSERT_FALSE(access_is_own_origin("http://localhost:9801", "localhost:9801", true));
    TEST_ASSERT_FALSE(access_is_own_origin("file://localhost:9801", "localhost:9801", false));
    TEST_ASSERT_FALSE(access_is_own_origin("", "", false));
}

/* Many addresses use up what strangers may try, and nothing of who was in before. */
static void test_strangers_do_not_lock_out_who_was_in_before(void)
{
    char token[ACCESS_TOKEN_MAX];
    char address[ACCESS_ADDRESS_MAX];
    set(LEVEL_OPERATE, "a long enough one");
    TEST_ASSERT_EQUAL(ACCESS_IN, log_in(LEVEL_OPERATE, "a long enough one", "192.168.7.5", 100, token));
    unsigned refused = 0;
    for (unsigned i = 0; i < 200; i++) {
        (void)snprintf(address, sizeof address, "192.0.2.%u", i);
        refused += !access_begin(&m_access, address, 200);
    }
    TEST_ASSERT_EQUAL_UINT(180, refused);
    TEST_ASSERT_EQUAL(ACCESS_TOO_OFTEN, log_in(LEVEL_OPERATE, "a long enough one", "192.168.7.6", 200, token));
    TEST_ASSERT_EQUAL(ACCESS_IN, log_in(LEVEL_OPERATE, "a long enough one", "192.168.7.5", 200, token));
    for (unsigned i = 0; i < 200; i++) {
        (void)access_begin(&m_access, "192.168.7.5", 205); /* it has no more than others have together */
    }
    TEST_ASSERT_EQUAL_UINT(20, m_access.tries[0]);
    TEST_ASSERT_LESS_OR_EQUAL_UINT(20, m_access.tries[1]);
    TEST_ASSERT_EQUAL(ACCESS_IN, log_in(LEVEL_OPERATE, "a long enough one", "192.168.7.6", 211, token));
}

/* The service has less rights than root, who sets them; and what lies in its directory does not lead root elsewhere. */
static void test_the_file_is_whose_the_directory_is(void)
{
    char next[128], other[96];
    struct stat status;
    (void)snprintf(next, sizeof next, "%s.new", file());
    (void)snprintf(other, sizeof other, "%s/other", m_folder);
    FILE *const made = fopen(other, "w");
    TEST_ASSERT_NOT_NULL(made);
    (void)fclose(made);
    TEST_ASSERT_EQUAL_INT(0, symlink(other, next));
    const uid_t owner = geteuid() == 0 ? 12345 : geteuid();
    TEST_ASSERT_EQUAL_INT(0, chown(m_folder, owner, (gid_t)-1));
    set(LEVEL_SERVICE, "a long enough one");
    TEST_ASSERT_EQUAL_INT(0, lstat(file(), &status));
    TEST_ASSERT_TRUE(S_ISREG(status.st_mode));
    TEST_ASSERT_EQUAL_UINT(owner, status.st_uid);
    TEST_ASSERT_EQUAL_UINT(0600, status.st_mode & 0777);
    TEST_ASSERT_EQUAL_INT(0, stat(other, &status));
    TEST_ASSERT_EQUAL_INT(0, status.st_size);
    TEST_ASSERT_EQUAL_INT(0, unlink(other));
}

/* The proxy has added the last address; a browser can have written what stands before it. */
static void test_a_proxy_names_the_browser(void)
{
    static const char *const k_rows[][2] = {{"10.0.0.1", "10.0.0.1"},
                                            {"1.1.1.1, 10.0.0.1", "10.0.0.1"},
                                            {"1.1.1.1,\t 2.2.2.2 ,10.0.0.1", "10.0.0.1"},
                                            {", 2001:DB8:0::7", "2001:db8::7"},
                                            {"10.0.0.1, unknown", "before"},
                                            {"10.0.0.1:80", "10.0.0.1"},
                                            {"x, [2001:db8::7]:443", "2001:db8::7"},
                                            {"[2001:db8::7]", "2001:db8::7"},
                                            {"10.0.0.1:80x", "before"},
                                            {"[2001:db8::7]x", "before"},
                                            {"[2001:db8::7", "before"},
                                            {"[]", "before"},
                                            {":80", "before"},
                                            {"10.0.0.1,", "before"},
                                            {"10.0.0.1 x", "before"},
                                            {"10.0.1", "before"},
                                            {"", "before"}};
    for (unsigned i = 0; i < sizeof k_rows / sizeof k_rows[0]; i++) {
        char address[ACCESS_ADDRESS_MAX] = "before";
        TEST_ASSERT_EQUAL(strcmp(k_rows[i][1], "before") != 0, access_forwarded(k_rows[i][0], address));
        TEST_ASSERT_EQUAL_STRING(k_rows[i][1], address);
    }
}

static void test_the_directory_is_made(void)
{
    struct stat status;
    TEST_ASSERT_EQUAL_INT(0, rmdir(m_folder));
    set(LEVEL_SERVICE, "a long enough one");
    TEST_ASSERT_EQUAL_INT(0, stat(m_folder, &status));
    TEST_ASSERT_EQUAL_UINT(0700, status.st_mode & 0777);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_without_a_file_nobody_has_a_password);
    RUN_TEST(test_each_role_has_a_password_of_its_own);
    RUN_TEST(test_sessions_end);
    RUN_TEST(test_more_sessions_than_places_end_the_oldest);
    RUN_TEST(test_who_guesses_waits);
    RUN_TEST(test_who_guesses_much_at_once_waits_too);
    RUN_TEST(test_bad_files_and_passwords_are_named);
    RUN_TEST(test_names_of_the_panel);
    RUN_TEST(test_strangers_do_not_lock_out_who_was_in_before);
    RUN_TEST(test_the_file_is_whose_the_directory_is);
    RUN_TEST(test_the_directory_is_made);
    RUN_TEST(test_a_proxy_names_the_browser);
    return UNITY_END();
}
