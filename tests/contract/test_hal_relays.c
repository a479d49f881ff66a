/* SPDX-License-Identifier: MIT
 * test_hal_relays.c - the contract of hal/relays.h on every backend, and the fault plan of the simulated one.
 */
#include "contract.h"

#include "sim_relays.h"

/** A backend under test. */
typedef struct {
    const char *name;
    hal_relays_t (*open)(uint8_t count);
    void (*close)(void);
    void (*settle)(void);       /**< until a slow bank has carried the mask out */
    uint16_t (*contacts)(void); /**< what the other side sees: 1 = closed */
} fixture_t;

static sim_relays_t sim;
static const fixture_t *fixture;
static hal_relays_t hal;

static hal_relays_t open_sim(uint8_t count)
{
    sim_relays_init(&sim, count);
    return sim_relays_hal(&sim);
}

static void do_nothing(void) {}

static uint16_t sim_contacts(void)
{
    return sim.mask;
}

static const fixture_t k_fixtures[] = {{"sim", open_sim, do_nothing, do_nothing, sim_contacts}};

#define COUNT 8u

void setUp(void)
{
    hal = fixture->open(COUNT);
}

void tearDown(void)
{
    fixture->close();
}

static void assert_relays(uint16_t mask)
{
    uint16_t reported = (uint16_t)~mask;
    fixture->settle();
    TEST_ASSERT_EQUAL_HEX16(mask, fixture->contacts());
    const hv_status_t status = hal_relays_read_back(hal, &reported);
    if (status != HV_ERR_NOSUP) {
        TEST_ASSERT_EQUAL(HV_OK, status);
        TEST_ASSERT_EQUAL_HEX16(mask, reported);
    }
}

static void test_valid_complete_accepts(void)
{
    TEST_ASSERT_TRUE(hal_relays_valid(hal));
}

static void test_valid_mandatory_op_missing_refuses(void)
{
    hal_relays_ops_t ops = *hal.ops;
    TEST_ASSERT_FALSE(hal_relays_valid((hal_relays_t){NULL, NULL}));
    ops.write = NULL;
    TEST_ASSERT_FALSE(hal_relays_valid((hal_relays_t){&ops, hal.ctx}));
    ops = *hal.ops;
    ops.count = NULL;
    TEST_ASSERT_FALSE(hal_relays_valid((hal_relays_t){&ops, hal.ctx}));
}

static void test_read_back_absent_says_nosup(void)
{
    hal_relays_ops_t ops = *hal.ops;
    uint16_t mask = 0x5A;
    ops.read_back = NULL;
    const hal_relays_t blind = {&ops, hal.ctx};
    TEST_ASSERT_TRUE(hal_relays_valid(blind));
    TEST_ASSERT_EQUAL(HV_ERR_NOSUP, hal_relays_read_back(blind, &mask));
    TEST_ASSERT_EQUAL_HEX16(0x5A, mask);
}

static void test_open_fresh_all_relays_open(void)
{
    TEST_ASSERT_EQUAL_UINT8(COUNT, hal_relays_count(hal));
    assert_relays(0);
}

static void test_write_every_mask_reaches_the_contacts(void)
{
    for (unsigned mask = 0; mask < 1u << COUNT; mask++) {
        TEST_ASSERT_EQUAL(HV_OK, hal_relays_write(hal, (uint16_t)mask));
        assert_relays((uint16_t)mask);
    }
}

static void test_write_same_mask_again_changes_nothing(void)
{
    TEST_ASSERT_EQUAL(HV_OK, hal_relays_write(hal, 0xA5));
    TEST_ASSERT_EQUAL(HV_OK, hal_relays_write(hal, 0xA5));
    assert_relays(0xA5);
}

static void test_write_bit_above_count_is_refused_whole(void)
{
    TEST_ASSERT_EQUAL(HV_OK, hal_relays_write(hal, 0x81));
    for (unsigned bit = COUNT; bit < 16; bit++) {
        TEST_ASSERT_EQUAL(HV_ERR_RANGE, hal_relays_write(hal, (uint16_t)(1u << bit | 0x02u)));
        assert_relays(0x81);
    }
}

static void test_open_every_count_takes_exactly_its_bits(void)
{
    for (uint8_t count = 0; count <= HAL_RELAYS_MAX; count++) {
        fixture->close();
        hal = fixture->open(count);
        TEST_ASSERT_EQUAL_UINT8(count, hal_relays_count(hal));
        TEST_ASSERT_EQUAL(HV_OK, hal_relays_write(hal, (uint16_t)((1u << count) - 1u)));
        assert_relays((uint16_t)((1u << count) - 1u));
        TEST_ASSERT_EQUAL(HV_ERR_RANGE, hal_relays_write(hal, (uint16_t)(1u << count)));
    }
}

static void run_contract(void)
{
    RUN_TEST(test_valid_complete_accepts);
    RUN_TEST(test_valid_mandatory_op_missing_refuses);
    RUN_TEST(test_read_back_absent_says_nosup);
    RUN_TEST(test_open_fresh_all_relays_open);
    RUN_TEST(test_write_every_mask_reaches_the_contacts);
    RUN_TEST(test_write_same_mask_again_changes_nothing);
    RUN_TEST(test_write_bit_above_count_is_refused_whole);
    RUN_TEST(test_open_every_count_takes_exactly_its_bits);
}

/* A failed write leaves the contacts, the next one works: for every place and length of the failure. */
static void test_sim_write_failing_at_every_step_recovers(void)
{
    for (uint32_t first = 1; first <= 12; first++) {
        for (uint32_t count = 1; count <= 4; count++) {
            uint16_t expected = 0;
            hal = open_sim(COUNT);
            sim.fail = (sim_fail_t){.first = first, .count = count};
            for (uint32_t n = 1; n <= 16; n++) {
                const bool fails = n >= first && n < first + count;
                TEST_ASSERT_EQUAL(fails ? HV_ERR_IO : HV_OK, hal_relays_write(hal, (uint16_t)(n * 7u)));
                expected = fails ? expected : (uint16_t)(n * 7u);
                assert_relays(expected);
            }
        }
    }
}

int main(void)
{
    UNITY_BEGIN();
    for (size_t i = 0; i < sizeof k_fixtures / sizeof k_fixtures[0]; i++) {
        fixture = &k_fixtures[i];
        contract_backend = fixture->name;
        run_contract();
    }
    fixture = &k_fixtures[0];
    contract_backend = fixture->name;
    RUN_TEST(test_sim_write_failing_at_every_step_recovers);
    return UNITY_END();
}
