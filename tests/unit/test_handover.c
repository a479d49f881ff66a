/* SPDX-License-Identifier: MIT
 * test_handover.c - the hand-overs between two threads: a ring of records and the newest value of a struct.
 */
#include <pthread.h>
#include <stdlib.h>
#include <sched.h>
#include <string.h>

#include "common/ring.h"
#include "common/seqlock.h"
#include "unity.h"

#define RING_BYTES 256u

static ring_t m_ring;
static uint8_t m_memory[RING_BYTES];

void setUp(void)
{
    ring_init(&m_ring, m_memory, sizeof m_memory);
}

void tearDown(void) {}

static void test_ring_pop_empty_gives_nothing(void)
{
    uint8_t out[8];
    TEST_ASSERT_EQUAL_UINT(0, ring_pop(&m_ring, out, sizeof out));
    TEST_ASSERT_TRUE(ring_is_empty(&m_ring));
}

static void test_ring_push_two_pieces_come_out_as_one(void)
{
    char out[16] = {0};
    TEST_ASSERT_TRUE(ring_push(&m_ring, "head", 4, "tail", 4));
    TEST_ASSERT_FALSE(ring_is_empty(&m_ring));
    TEST_ASSERT_EQUAL_UINT(8, ring_pop(&m_ring, out, sizeof out));
    TEST_ASSERT_EQUAL_STRING("headtail", out);
    TEST_ASSERT_TRUE(ring_is_empty(&m_ring));
}

/* Every length at every place of the memory, so that each piece wraps everywhere. */
static void test_ring_records_survive_every_wrap(void)
{
    uint8_t in[100], out[100];
    for (unsigned length = 1; length <= sizeof in; length++) {
        for (unsigned round = 0; round < 2 * RING_BYTES; round++) {
            for (unsigned i = 0; i < length; i++) {
                in[i] = (uint8_t)(i * 31 + round);
            }
            const unsigned head = 1 + round % length;
            TEST_ASSERT_TRUE(ring_push(&m_ring, in, head, &in[head], length - head));
            TEST_ASSERT_EQUAL_UINT(length, ring_pop(&m_ring, out, sizeof out));
            TEST_ASSERT_EQUAL_MEMORY(in, out, length);
        }
    }
}

static void test_ring_push_full_drops_the_new_record_and_counts(void)
{
    uint8_t record[60] = {0};
    uint8_t out[60];
    for (unsigned i = 0; i < 4; i++) { /* 4 * (60 + 4) = 256: exactly full */
        record[0] = (uint8_t)i;
        TEST_ASSERT_TRUE(ring_push(&m_ring, record, sizeof record, NULL, 0));
    }
    TEST_ASSERT_FALSE(ring_push(&m_ring, record, 1, NULL, 0));
    TEST_ASSERT_FALSE(ring_push(&m_ring, record, sizeof record, record, sizeof record));
    TEST_ASSERT_EQUAL_UINT32(2, ring_dropped(&m_ring));
    for (unsigned i = 0; i < 4; i++) {
        TEST_ASSERT_EQUAL_UINT(sizeof record, ring_pop(&m_ring, out, sizeof out));
        TEST_ASSERT_EQUAL_UINT8(i, out[0]);
    }
    TEST_ASSERT_TRUE(ring_push(&m_ring, record, 1, NULL, 0));
}

/* The counts wrap at 2^32: start shortly before. */
static void test_ring_counts_wrap(void)
{
    uint8_t in[50], out[50];
    m_ring.written = UINT32_MAX - 100;
    m_ring.taken = UINT32_MAX - 100;
    for (unsigned round = 0; round < 20; round++) {
        memset(in, (int)round, sizeof in);
        TEST_ASSERT_TRUE(ring_push(&m_ring, in, sizeof in, NULL, 0));
        TEST_ASSERT_EQUAL_UINT(sizeof in, ring_pop(&m_ring, out, sizeof out));
        TEST_ASSERT_EQUAL_MEMORY(in, out, sizeof in);
    }
    TEST_ASSERT_EQUAL_UINT32(0, ring_dropped(&m_ring));
}

/* --- Two threads --- */

static uint32_t m_messages = 20000; /* HEAVE_HANDOVER_MESSAGES: beside other work each of them may cost a turn of the processor */

typedef struct {
    uint32_t number;
    uint32_t copy[12];
} message_t;

/* Pushes numbered messages of changing length until all are through. */
static void *push_messages(void *unused)
{
    (void)unused;
    for (uint32_t i = 1; i <= m_messages;) {
        message_t message = {.number = i};
        const size_t words = i % 12 + 1;
        for (size_t k = 0; k < words; k++) {
            message.copy[k] = i;
        }
        if (ring_push(&m_ring, &message, sizeof(uint32_t) * (1 + words), NULL, 0)) {
            i++;
        } else {
            sched_yield();
        }
    }
    return NULL;
}

static void test_ring_two_threads_keep_every_record_whole_and_in_order(void)
{
    pthread_t thread;
    uint32_t bad = 0;
    const char *const wanted = getenv("HEAVE_HANDOVER_MESSAGES");
    m_messages = wanted != NULL ? (uint32_t)strtoul(wanted, NULL, 10) : m_messages;
    TEST_ASSERT_EQUAL_INT(0, pthread_create(&thread, NULL, push_messages, NULL));
    for (uint32_t expected = 1; expected <= m_messages;) {
        message_t message;
        const size_t length = ring_pop(&m_ring, &message, sizeof message);
        if (length == 0) {
            sched_yield();
            continue;
        }
        bad += message.number != expected || length != sizeof(uint32_t) * (2 + expected % 12);
        for (size_t k = 0; k + 1 < length / sizeof(uint32_t); k++) {
            bad += message.copy[k] != expected;
        }
        expected++;
    }
    TEST_ASSERT_EQUAL_INT(0, pthread_join(thread, NULL));
    TEST_ASSERT_EQUAL_UINT32(0, bad);
    TEST_ASSERT_TRUE(ring_is_empty(&m_ring));
}

#define WORDS  80u
#define VALUES 100000u

static seqlock_t m_lock;
static uint64_t m_words[WORDS];
static uint32_t m_is_written;

static void *write_values(void *unused)
{
    (void)unused;
    uint64_t value[WORDS];
    for (uint64_t i = 1; i <= VALUES; i++) {
        for (unsigned k = 0; k < WORDS; k++) {
            value[k] = i;
        }
        seqlock_write(&m_lock, value);
        if (i % 64 == 0) {
            sched_yield();
        }
    }
    __atomic_store_n(&m_is_written, 1, __ATOMIC_RELEASE);
    return NULL;
}

static void test_seqlock_read_before_the_first_value_says_so(void)
{
    uint64_t out[WORDS];
    seqlock_init(&m_lock, m_words, WORDS);
    TEST_ASSERT_FALSE(seqlock_read(&m_lock, out));
}

static void test_seqlock_two_threads_every_value_read_is_whole(void)
{
    pthread_t thread;
    uint64_t out[WORDS];
    uint64_t newest = 0;
    uint32_t torn = 0, backwards = 0;
    m_is_written = 0;
    seqlock_init(&m_lock, m_words, WORDS);
    TEST_ASSERT_EQUAL_INT(0, pthread_create(&thread, NULL, write_values, NULL));
    while (__atomic_load_n(&m_is_written, __ATOMIC_ACQUIRE) == 0) {
        if (seqlock_read(&m_lock, out)) {
            for (unsigned k = 1; k < WORDS; k++) {
                torn += out[k] != out[0];
            }
            backwards += out[0] < newest;
            newest = out[0];
        }
    }
    TEST_ASSERT_EQUAL_INT(0, pthread_join(thread, NULL));
    TEST_ASSERT_EQUAL_UINT32(0, torn);
    TEST_ASSERT_EQUAL_UINT32(0, backwards);
    TEST_ASSERT_TRUE(seqlock_read(&m_lock, out));
    TEST_ASSERT_EQUAL_UINT64(VALUES, out[0]);
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_ring_pop_empty_gives_nothing);
    RUN_TEST(test_ring_push_two_pieces_come_out_as_one);
    RUN_TEST(test_ring_records_survive_every_wrap);
    RUN_TEST(test_ring_push_full_drops_the_new_record_and_counts);
    RUN_TEST(test_ring_counts_wrap);
    RUN_TEST(test_ring_two_threads_keep_every_record_whole_and_in_order);
    RUN_TEST(test_seqlock_read_before_the_first_value_says_so);
    RUN_TEST(test_seqlock_two_threads_every_value_read_is_whole);
    return UNITY_END();
}
