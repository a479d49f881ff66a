/* SPDX-License-Identifier: MIT
 * test_panel_connections.c - connections that are no page: few, and the address that has most of them gives way. And addresses to
 * listen on.
 */
#include "panel/connections.h"

#include <string.h>

#include "panel/listener.h"
#include "unity.h"

static connections_t all;
static char handles[4 * CONNECTIONS_MAX];

void setUp(void)
{
    memset(&all, 0, sizeof all);
}

void tearDown(void) {}

/* As the server does. @return who has given way; NULL: nobody */
static void *come(unsigned i, const char *address)
{
    void *const way = connections_give_way(&all);
    connections_remove(&all, way);
    connections_add(&all, &handles[i], connections_network(address));
    TEST_ASSERT_LESS_OR_EQUAL_UINT(CONNECTIONS_MAX, all.count);
    return way;
}

static void test_nobody_gives_way_while_there_is_room(void)
{
    for (unsigned i = 0; i < CONNECTIONS_MAX; i++) {
        TEST_ASSERT_NULL(come(i, "192.0.2.1"));
    }
    TEST_ASSERT_EQUAL_UINT(CONNECTIONS_MAX, all.count);
    connections_remove(&all, &handles[7]);
    connections_remove(&all, &handles[7]);
    connections_remove(&all, NULL);
    TEST_ASSERT_EQUAL_UINT(CONNECTIONS_MAX - 1, all.count);
    TEST_ASSERT_NULL(come(CONNECTIONS_MAX, "192.0.2.1"));
}

static void test_the_oldest_of_the_address_with_most_gives_way(void)
{
    TEST_ASSERT_NULL(come(0, "192.0.2.2"));
    for (unsigned i = 1; i < CONNECTIONS_MAX; i++) {
        TEST_ASSERT_NULL(come(i, "192.0.2.1"));
    }
    for (unsigned i = CONNECTIONS_MAX; i < 3 * CONNECTIONS_MAX; i++) {
        TEST_ASSERT_EQUAL_PTR(&handles[i - CONNECTIONS_MAX + 1], come(i, "192.0.2.1"));
    }
    TEST_ASSERT_EQUAL_PTR(&handles[2 * CONNECTIONS_MAX + 1], come(3 * CONNECTIONS_MAX, "192.0.2.3"));
    TEST_ASSERT_EQUAL_PTR(&handles[2 * CONNECTIONS_MAX + 2], come(3 * CONNECTIONS_MAX + 1, "192.0.2.3"));
}

static void test_a_network_of_ipv6_is_one_address(void)
{
    TEST_ASSERT_EQUAL_UINT64(connections_network("2001:db8::1"), connections_network("2001:db8::ffff:1:2:3"));
    TEST_ASSERT_TRUE(connections_network("2001:db8::1") != connections_network("2001:db8:0:1::1"));
    TEST_ASSERT_TRUE(connections_network("192.0.2.1") != connections_network("192.0.2.2"));
    TEST_ASSERT_TRUE(connections_network("192.0.2.1") != connections_network("::1"));
}

static void test_what_listens_is_an_address_and_nothing_else(void)
{
    static const struct {
        const char *text, *host;
        int port;
        bool is_right, is_this_machine;
    } k_rows[] = {{"127.0.0.1:9801", "127.0.0.1", 9801, true, true},
                  {"127.255.0.1:1", "127.255.0.1", 1, true, true},
                  {"192.168.7.2:65535", "192.168.7.2", 65535, true, false},
                  {"0.0.0.0:9801", "0.0.0.0", 9801, true, false},
                  {"[::1]:9801", "[::1]", 9801, true, true},
                  {"[::]:80", "[::]", 80, true, false},
                  {"[fd00::2]:80", "[fd00::2]", 80, true, false},
                  {.text = "[::ffff:127.0.0.1]:80"},
                  {.text = "[127.0.0.1]:80"},
                  {.text = "::1:80"},
                  {.text = "[::1]"},
                  {.text = "[]:80"},
                  {.text = "localhost:80"},
                  {.text = "lo:80"},
                  {.text = "127.1:80"},
                  {.text = "127.0.0.1"},
                  {.text = "127.0.0.1:"},
                  {.text = "127.0.0.1:0"},
                  {.text = "127.0.0.1:65536"},
                  {.text = "127.0.0.1:99999999999999999999"},
                  {.text = "127.0.0.1:+1"},
                  {.text = "127.0.0.1: 1"},
                  {.text = "127.0.0.1:1x"},
                  {.text = " 127.0.0.1:1"},
                  {.text = ":1"},
                  {.text = ""}};
    for (size_t i = 0; i < sizeof k_rows / sizeof k_rows[0]; i++) {
        listener_address_t where;
        TEST_ASSERT_EQUAL_MESSAGE(k_rows[i].is_right, listener_read(&where, k_rows[i].text), k_rows[i].text);
        if (k_rows[i].is_right) {
            TEST_ASSERT_EQUAL_STRING(k_rows[i].host, where.host);
            TEST_ASSERT_EQUAL_INT(k_rows[i].port, where.port);
            TEST_ASSERT_EQUAL_MESSAGE(k_rows[i].is_this_machine, listener_is_this_machine(&where), k_rows[i].text);
        }
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_nobody_gives_way_while_there_is_room);
    RUN_TEST(test_the_oldest_of_the_address_with_most_gives_way);
    RUN_TEST(test_a_network_of_ipv6_is_one_address);
    RUN_TEST(test_what_listens_is_an_address_and_nothing_else);
    return UNITY_END();
}
