/* SPDX-License-Identifier: MIT
 * test_access_levels.c - who may ask for what.
 */
#include "service/access_levels.h"

#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "common/message.h"
#include "unity.h"

void setUp(void) {}
void tearDown(void) {}

#define OPERATORS 50
#define MECHANICS 60
#define OTHERS    70

static level_t level(bool has_operate, bool has_service, uid_t uid, gid_t first, gid_t second)
{
    const levels_t levels = {has_operate, has_service, OPERATORS, MECHANICS};
    const gid_t gid[] = {first, second};
    return levels_of(&levels, uid, gid, 2);
}

static void test_levels_of_groups(void)
{
    TEST_ASSERT_EQUAL(LEVEL_SERVICE, level(false, false, 1000, OTHERS, OTHERS)); /* as without levels */
    TEST_ASSERT_EQUAL(LEVEL_LOOK, level(true, false, 1000, OTHERS, OTHERS));
    TEST_ASSERT_EQUAL(LEVEL_SERVICE, level(true, false, 1000, OTHERS, OPERATORS));
    TEST_ASSERT_EQUAL(LEVEL_OPERATE, level(false, true, 1000, OTHERS, OPERATORS));
    TEST_ASSERT_EQUAL(LEVEL_SERVICE, level(false, true, 1000, MECHANICS, OTHERS));
    TEST_ASSERT_EQUAL(LEVEL_LOOK, level(true, true, 1000, OTHERS, OTHERS));
    TEST_ASSERT_EQUAL(LEVEL_OPERATE, level(true, true, 1000, OPERATORS, OTHERS));
    TEST_ASSERT_EQUAL(LEVEL_SERVICE, level(true, true, 1000, OTHERS, MECHANICS));
    TEST_ASSERT_EQUAL(LEVEL_SERVICE, level(true, true, 0, OTHERS, OTHERS)); /* root */
}

static void test_levels_open_finds_groups_and_refuses_those_that_are_not_there(void)
{
    static config_t config;
    levels_t levels;
    TEST_ASSERT_EQUAL(EXIT_DONE, levels_open(&levels, &config));
    TEST_ASSERT_FALSE(levels.has_operate_group || levels.has_service_group);
    (void)snprintf(config.service_group.text, sizeof config.service_group.text, "root");
    TEST_ASSERT_EQUAL(EXIT_DONE, levels_open(&levels, &config));
    TEST_ASSERT_TRUE(levels.has_service_group && levels.service_gid == 0);
    (void)snprintf(config.operate_group.text, sizeof config.operate_group.text, "nobody-calls-it-so");
    TEST_ASSERT_EQUAL(EXIT_UNAVAILABLE, levels_open(&levels, &config));
}

static void test_levels_peer_is_who_the_kernel_says(void)
{
    const levels_t levels = {.has_operate_group = true, .operate_gid = getgid()};
    int ends[2];
    TEST_ASSERT_EQUAL(0, socketpair(AF_UNIX, SOCK_STREAM, 0, ends));
    const level_peer_t peer = levels_peer(&levels, ends[0]);
    TEST_ASSERT_EQUAL(getpid(), peer.pid);
    TEST_ASSERT_EQUAL(getuid(), peer.uid);
    TEST_ASSERT_EQUAL(getgid(), peer.gid);
    TEST_ASSERT_EQUAL(LEVEL_SERVICE, peer.level);
    (void)close(ends[0]);
    (void)close(ends[1]);
    TEST_ASSERT_EQUAL(LEVEL_LOOK, levels_peer(&levels, ends[0]).level);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_levels_of_groups);
    RUN_TEST(test_levels_open_finds_groups_and_refuses_those_that_are_not_there);
    RUN_TEST(test_levels_peer_is_who_the_kernel_says);
    return UNITY_END();
}
