/* SPDX-License-Identifier: MIT */
#include "heavectl/socket.h"

#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "unity.h"

static char m_directory[64];
static char m_path[SOCKET_PATH_MAX];
static char m_platforms[64];

static void shell(const char *command)
{
    char text[256];
    (void)snprintf(text, sizeof text, "cd %s && %s", m_directory, command);
    TEST_ASSERT_EQUAL(0, system(text));
}

void setUp(void)
{
    (void)snprintf(m_directory, sizeof m_directory, "%s/heave-XXXXXX", getenv("TMPDIR") != NULL ? getenv("TMPDIR") : "/tmp");
    TEST_ASSERT_NOT_NULL(mkdtemp(m_directory));
    memset(m_path, 'x', sizeof m_path - 1);
    memset(m_platforms, 'x', sizeof m_platforms - 1);
    TEST_ASSERT_EQUAL(0, unsetenv("RUNTIME_DIRECTORY"));
}

void tearDown(void)
{
    shell("rm -r \"$PWD\"");
}

static void expect(const char *path)
{
    char whole[256];
    (void)snprintf(whole, sizeof whole, "%s/%s", m_directory, path);
    TEST_ASSERT_EQUAL_STRING(whole, m_path);
}

static bool find(void)
{
    return ctl_socket_find(m_path, m_directory, m_platforms, sizeof m_platforms);
}

static void test_nothing_is_there_the_default_is_named(void)
{
    TEST_ASSERT_TRUE(find());
    expect("heaved.sock");
    TEST_ASSERT_EQUAL_STRING("", m_platforms);
    shell("mkdir idle && touch idle/heave.prom"); /* no socket in it */
    TEST_ASSERT_TRUE(find());
    expect("heaved.sock");
}

static void test_the_only_service_is_found(void)
{
    shell("mkdir ride idle && touch ride/heaved.sock");
    TEST_ASSERT_TRUE(find());
    expect("ride/heaved.sock");
    TEST_ASSERT_EQUAL_STRING("", m_platforms);
}

static void test_one_started_by_hand_comes_before_services(void)
{
    shell("mkdir ride demo && touch ride/heaved.sock demo/heaved.sock heaved.sock");
    TEST_ASSERT_TRUE(find());
    expect("heaved.sock");
}

static void test_several_services_are_listed(void)
{
    shell("mkdir ride demo && touch ride/heaved.sock demo/heaved.sock");
    TEST_ASSERT_FALSE(find());
    TEST_ASSERT_EQUAL_STRING("", m_path);
    TEST_ASSERT_EQUAL_STRING("demo, ride", m_platforms);
}

static void test_a_list_that_is_too_long_ends_in_dots(void)
{
    char little[12];
    shell("mkdir ride demo third && touch ride/heaved.sock demo/heaved.sock third/heaved.sock");
    TEST_ASSERT_FALSE(ctl_socket_find(m_path, m_directory, little, sizeof little));
    TEST_ASSERT_EQUAL_STRING("demo, ri...", little);
}

static void test_a_platform_has_a_directory_of_its_own(void)
{
    TEST_ASSERT_TRUE(socket_path_of_platform(m_path, SOCKET_DIRECTORY, "ride"));
    TEST_ASSERT_EQUAL_STRING("/run/heave/ride/heaved.sock", m_path);
}

static void test_names_that_are_none_are_refused(void)
{
    char name[120];
    static const char *const k_wrong[] = {"", ".", "..", "/", "a/b", "../ride", "/ride"};
    for (size_t i = 0; i < sizeof k_wrong / sizeof k_wrong[0]; i++) {
        TEST_ASSERT_FALSE_MESSAGE(socket_path_of_platform(m_path, SOCKET_DIRECTORY, k_wrong[i]), k_wrong[i]);
        TEST_ASSERT_EQUAL_STRING("", m_path);
    }
    for (size_t length = 1; length < sizeof name; length++) { /* the longest one has 107 characters of path */
        memset(name, 'n', length);
        name[length] = '\0';
        const bool is_short = strlen(SOCKET_DIRECTORY "/"
                                                      "/heaved.sock") +
                                  length <
                              SOCKET_PATH_MAX;
        TEST_ASSERT_EQUAL(is_short, socket_path_of_platform(m_path, SOCKET_DIRECTORY, name));
        TEST_ASSERT_EQUAL(is_short ? length + 23 : 0, strlen(m_path));
    }
}

static void test_the_default_goes_into_the_directory_of_a_service(void)
{
    TEST_ASSERT_EQUAL_STRING("/run/heave/heaved.sock", socket_path_of_daemon(m_path, SOCKET_DEFAULT));
    TEST_ASSERT_EQUAL(0, setenv("RUNTIME_DIRECTORY", "/run/heave/ride", 1));
    TEST_ASSERT_EQUAL_STRING("/run/heave/ride/heaved.sock", socket_path_of_daemon(m_path, SOCKET_DEFAULT));
    TEST_ASSERT_EQUAL_STRING("/tmp/h.sock", socket_path_of_daemon(m_path, "/tmp/h.sock"));
    TEST_ASSERT_EQUAL(0, setenv("RUNTIME_DIRECTORY", "/run/heave/ride:/run/other", 1));
    TEST_ASSERT_EQUAL_STRING("/run/heave/ride/heaved.sock", socket_path_of_daemon(m_path, SOCKET_DEFAULT));
    TEST_ASSERT_EQUAL(0, setenv("RUNTIME_DIRECTORY", "", 1));
    TEST_ASSERT_EQUAL_STRING("/run/heave/heaved.sock", socket_path_of_daemon(m_path, SOCKET_DEFAULT));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_nothing_is_there_the_default_is_named);
    RUN_TEST(test_the_only_service_is_found);
    RUN_TEST(test_one_started_by_hand_comes_before_services);
    RUN_TEST(test_several_services_are_listed);
    RUN_TEST(test_a_list_that_is_too_long_ends_in_dots);
    RUN_TEST(test_a_platform_has_a_directory_of_its_own);
    RUN_TEST(test_names_that_are_none_are_refused);
    RUN_TEST(test_the_default_goes_into_the_directory_of_a_service);
    return UNITY_END();
}
