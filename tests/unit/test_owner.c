/* SPDX-License-Identifier: MIT
 * test_owner.c - who drives, against a model that keeps the whole history.
 */
#include <string.h>

#include "unity.h"

#include "heave/owner.h"

#define SILENCE_US 2500000u

static owner_t m_owner;
static hal_udp_networks_t m_priority;

void setUp(void)
{
    m_owner = (owner_t){.is_taken = false};
    m_priority = (hal_udp_networks_t){.count = 0};
}

void tearDown(void) {}

static hal_udp_peer_t host(uint8_t last)
{
    return (hal_udp_peer_t){.address = {10, 0, 0, last}, .port = (uint16_t)(1000 + last)};
}

static owner_verdict_t frame_from(uint8_t last, uint64_t now_us)
{
    const hal_udp_peer_t peer = host(last);
    return owner_judge(&m_owner, &peer, SILENCE_US, &m_priority, 0, now_us);
}

static void test_owner_judge_first_sender_drives(void)
{
    TEST_ASSERT_EQUAL(OWNER_DRIVES, frame_from(1, 0));
    TEST_ASSERT_EQUAL(OWNER_OTHER, frame_from(2, 1));
    TEST_ASSERT_EQUAL_UINT8(1, m_owner.peer.address[3]);
}

static void test_owner_judge_same_host_with_another_port_still_drives(void)
{
    hal_udp_peer_t peer = host(1);
    (void)frame_from(1, 0);
    peer.port = 65000;
    TEST_ASSERT_EQUAL(OWNER_DRIVES, owner_judge(&m_owner, &peer, SILENCE_US, &m_priority, 0, 5));
    TEST_ASSERT_EQUAL_UINT16(65000, m_owner.peer.port);
}

static void test_owner_judge_silence_to_the_microsecond_lets_another_take_over(void)
{
    (void)frame_from(1, 1000);
    TEST_ASSERT_EQUAL(OWNER_OTHER, frame_from(2, 1000 + SILENCE_US - 1));
    TEST_ASSERT_EQUAL(OWNER_NEW, frame_from(2, 1000 + SILENCE_US));
    TEST_ASSERT_EQUAL(OWNER_OTHER, frame_from(1, 1001 + SILENCE_US));
    TEST_ASSERT_EQUAL(OWNER_DRIVES, frame_from(2, 1002 + SILENCE_US));
}

static void test_owner_judge_others_do_not_lengthen_their_own_wait(void)
{
    (void)frame_from(1, 0);
    for (uint64_t t = 1; t < SILENCE_US; t += 9973) {
        TEST_ASSERT_EQUAL(OWNER_OTHER, frame_from(2, t));
    }
    TEST_ASSERT_EQUAL(OWNER_NEW, frame_from(2, SILENCE_US));
}

static void test_owner_judge_running_timed_move_is_not_silence(void)
{
    const hal_udp_peer_t other = host(2);
    const uint64_t end_us = 10000000;
    (void)frame_from(1, 0);
    TEST_ASSERT_EQUAL(OWNER_OTHER, owner_judge(&m_owner, &other, SILENCE_US, &m_priority, end_us, end_us + SILENCE_US - 1));
    TEST_ASSERT_EQUAL(OWNER_NEW, owner_judge(&m_owner, &other, SILENCE_US, &m_priority, end_us, end_us + SILENCE_US));
}

static void test_owner_judge_without_silence_every_sender_is_followed(void)
{
    for (uint8_t i = 0; i < 9; i++) {
        const hal_udp_peer_t peer = host(i);
        TEST_ASSERT_EQUAL(OWNER_DRIVES, owner_judge(&m_owner, &peer, 0, &m_priority, 0, i));
    }
}

static void test_owner_judge_priority_takes_over_at_once_and_never_backwards(void)
{
    m_priority = (hal_udp_networks_t){
        .count = 2, .network = {{.prefix = 32, .address = {10, 0, 0, 3}}, {.prefix = 31, .address = {10, 0, 0, 4}}}};
    TEST_ASSERT_EQUAL(OWNER_DRIVES, frame_from(1, 0));
    TEST_ASSERT_EQUAL(OWNER_NEW, frame_from(5, 1));   /* in the network of the second row */
    TEST_ASSERT_EQUAL(OWNER_OTHER, frame_from(4, 2)); /* of the same rank */
    TEST_ASSERT_EQUAL(OWNER_OTHER, frame_from(1, 3));
    TEST_ASSERT_EQUAL(OWNER_NEW, frame_from(3, 4));
    TEST_ASSERT_EQUAL(OWNER_OTHER, frame_from(5, 5));
    TEST_ASSERT_EQUAL(OWNER_NEW, frame_from(1, 4 + SILENCE_US)); /* silence beats rank */
}

/* Random senders and times: whoever drives has always either been first, outranked, or waited for silence. */
static void test_owner_judge_random_senders_agree_with_the_history(void)
{
    uint32_t random = 7;
    uint64_t now_us = 0;
    uint64_t last_us[4] = {0};
    int driver = -1;
    for (unsigned i = 0; i < 200000; i++) {
        random = random * 1664525u + 1013904223u;
        const unsigned who = random >> 30;
        now_us += (random >> 8) % 4000 == 0 ? SILENCE_US + (random >> 5) % 7 - 3 : (random >> 12) % 5000;
        const bool was_silent = driver >= 0 && now_us - last_us[driver] >= SILENCE_US;
        const owner_verdict_t expected = driver < 0 || driver == (int)who ? OWNER_DRIVES : was_silent ? OWNER_NEW : OWNER_OTHER;
        TEST_ASSERT_EQUAL(expected, frame_from((uint8_t)who, now_us));
        driver = expected == OWNER_OTHER ? driver : (int)who;
        last_us[who] = now_us;
    }
}

/* --- Programs of one address --- */

static owner_verdict_t from_port(uint16_t port, uint64_t now_us)
{
    hal_udp_peer_t peer = host(1);
    peer.port = port;
    return owner_judge(&m_owner, &peer, SILENCE_US, &m_priority, 0, now_us);
}

/* Of so many programs at any paces, at most two frames of each but the first are taken before one drives. */
static void test_owner_judge_ports_that_take_turns_are_several_programs(void)
{
    for (unsigned programs = 2; programs <= OWNER_PORTS; programs++) {
        for (unsigned pace = 1; pace <= 5; pace++) {
            setUp();
            unsigned taken = 0;
            for (uint64_t t = 0; t < 100; t++) {
                TEST_ASSERT_EQUAL(OWNER_DRIVES, from_port(4000, t * 10000));
                for (unsigned k = 1; k < programs && t % pace == 0; k++) {
                    taken += from_port((uint16_t)(4000 + k), t * 10000 + k) != OWNER_OTHER;
                }
            }
            TEST_ASSERT_TRUE(m_owner.is_port_fixed);
            TEST_ASSERT_EQUAL_UINT16(4000, m_owner.peer.port);
            TEST_ASSERT_LESS_OR_EQUAL_UINT(2 * (programs - 1), taken);
        }
    }
}

/* A program that has been started again before the second one came: its old port is nobody's. */
static void test_owner_judge_the_first_of_several_is_one_that_is_there(void)
{
    for (unsigned starts = 1; starts < 4; starts++) {
        setUp();
        uint64_t t = 0;
        for (unsigned start = 0; start <= starts; start++) {
            for (unsigned frame = 0; frame < 5; frame++) {
                TEST_ASSERT_EQUAL(OWNER_DRIVES, from_port((uint16_t)(4000 + start), t += 16000));
            }
        }
        for (unsigned i = 0; i < 20; i++) {
            (void)from_port(5000, t += 8000);
            TEST_ASSERT_EQUAL(OWNER_DRIVES, from_port((uint16_t)(4000 + starts), t += 8000));
        }
        TEST_ASSERT_TRUE(m_owner.is_port_fixed);
        TEST_ASSERT_EQUAL_UINT16(4000 + starts, m_owner.peer.port);
    }
}

/* A program with two sockets of its own, one after the other, for as long as it likes. */
static void test_owner_judge_two_sockets_at_leisure_are_one_sender(void)
{
    uint64_t t = 0;
    for (unsigned i = 0; i < 100; i++) {
        for (unsigned frame = 0; frame < 400; frame++) {
            TEST_ASSERT_EQUAL(OWNER_DRIVES, from_port((uint16_t)(4000 + i % 2), t += 16000));
        }
    }
    TEST_ASSERT_FALSE(m_owner.is_port_fixed);
}

static void test_owner_judge_the_other_program_takes_over_after_silence(void)
{
    for (uint64_t t = 0; t < 10; t++) {
        (void)from_port(t % 2 == 0 ? 4000 : 4001, t);
    }
    TEST_ASSERT_EQUAL(OWNER_OTHER, from_port(4001, 8 + SILENCE_US - 1));
    TEST_ASSERT_EQUAL(OWNER_OTHER, from_port(9, 8 + SILENCE_US - 1)); /* a new port is another program, too */
    TEST_ASSERT_EQUAL(OWNER_NEW, from_port(4001, 8 + SILENCE_US));
    TEST_ASSERT_FALSE(m_owner.is_port_fixed);
    TEST_ASSERT_EQUAL(OWNER_DRIVES, from_port(4002, 9 + SILENCE_US)); /* and is learnt anew */
}

static void test_owner_judge_a_new_port_in_each_frame_is_one_sender(void)
{
    uint32_t random = 1;
    for (uint64_t t = 0; t < 100000; t++) {
        random = random * 1664525u + 1013904223u;
        TEST_ASSERT_EQUAL(OWNER_DRIVES, from_port((uint16_t)(32768 + (random >> 8) % 28232), t * 16000));
    }
}

/* As with a program that is started again and again, with a late frame of the one before. */
static void test_owner_judge_a_program_that_starts_again_is_one_sender(void)
{
    uint64_t t = 0;
    for (uint16_t start = 0; start < 1000; start++) {
        for (unsigned frame = 0; frame < 5; frame++) {
            const bool is_late = frame == 3 && start > 0 && start % 3 == 0;
            TEST_ASSERT_EQUAL(OWNER_DRIVES, from_port((uint16_t)(40000 + start - is_late), t++));
        }
    }
    TEST_ASSERT_FALSE(m_owner.is_port_fixed);
}

static void test_owner_judge_where_all_are_followed_ports_do_not_matter(void)
{
    for (uint64_t t = 0; t < 100; t++) {
        hal_udp_peer_t peer = host(1);
        peer.port = (uint16_t)(4000 + t % 3);
        TEST_ASSERT_EQUAL(OWNER_DRIVES, owner_judge(&m_owner, &peer, 0, &m_priority, 0, t));
    }
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_owner_judge_first_sender_drives);
    RUN_TEST(test_owner_judge_same_host_with_another_port_still_drives);
    RUN_TEST(test_owner_judge_silence_to_the_microsecond_lets_another_take_over);
    RUN_TEST(test_owner_judge_others_do_not_lengthen_their_own_wait);
    RUN_TEST(test_owner_judge_running_timed_move_is_not_silence);
    RUN_TEST(test_owner_judge_without_silence_every_sender_is_followed);
    RUN_TEST(test_owner_judge_priority_takes_over_at_once_and_never_backwards);
    RUN_TEST(test_owner_judge_random_senders_agree_with_the_history);
    RUN_TEST(test_owner_judge_ports_that_take_turns_are_several_programs);
    RUN_TEST(test_owner_judge_the_first_of_several_is_one_that_is_there);
    RUN_TEST(test_owner_judge_two_sockets_at_leisure_are_one_sender);
    RUN_TEST(test_owner_judge_the_other_program_takes_over_after_silence);
    RUN_TEST(test_owner_judge_a_new_port_in_each_frame_is_one_sender);
    RUN_TEST(test_owner_judge_a_program_that_starts_again_is_one_sender);
    RUN_TEST(test_owner_judge_where_all_are_followed_ports_do_not_matter);
    return UNITY_END();
}
