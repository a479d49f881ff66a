/* SPDX-License-Identifier: MIT
 * test_hal_inputs.c - the contract of hal/inputs.h on every backend, and the fault plan of the simulated one.
 */
#include "contract.h"

#include "sim_inputs.h"

#define ALL_INPUTS (INPUT_ESTOP | INPUT_ENABLE | INPUT_RESET)

/** A backend under test. */
typedef struct {
    const char *name;
    hal_inputs_t (*open)(uint32_t present);
    void (*close)(void);
    void (*set)(uint32_t input, bool is_active); /**< someone moves a switch */
    void (*set_broken)(bool is_broken);          /**< the lines cannot be read; NULL: not to be had here */
} fixture_t;

static sim_inputs_t sim;
static const fixture_t *fixture;
static hal_inputs_t hal;

static hal_inputs_t open_sim(uint32_t present)
{
    sim_inputs_init(&sim, present);
    return sim_inputs_hal(&sim);
}

static void close_sim(void) {}

static void set_sim(uint32_t input, bool is_active)
{
    sim_inputs_set(&sim, input, is_active);
}

static void break_sim(bool is_broken)
{
    sim.is_broken = is_broken;
}

static const fixture_t k_fixtures[] = {{"sim", open_sim, close_sim, set_sim, break_sim}};

void setUp(void)
{
    hal = fixture->open(ALL_INPUTS);
}

void tearDown(void)
{
    fixture->close();
}

static void assert_levels(uint32_t expected)
{
    uint32_t levels = ~expected;
    TEST_ASSERT_EQUAL(HV_OK, hal_inputs_read(hal, &levels));
    TEST_ASSERT_EQUAL_HEX32(expected, levels);
}

static void set_all(uint32_t levels)
{
    for (uint32_t input = INPUT_ESTOP; input <= INPUT_RESET; input <<= 1) {
        fixture->set(input, (levels & input) != 0);
    }
}

static void test_valid_complete_accepts(void)
{
    TEST_ASSERT_TRUE(hal_inputs_valid(hal));
}

static void test_valid_any_op_missing_refuses(void)
{
    hal_inputs_ops_t ops = *hal.ops;
    TEST_ASSERT_FALSE(hal_inputs_valid((hal_inputs_t){NULL, NULL}));
    ops.read = NULL;
    TEST_ASSERT_FALSE(hal_inputs_valid((hal_inputs_t){&ops, hal.ctx}));
    ops = *hal.ops;
    ops.present = NULL;
    TEST_ASSERT_FALSE(hal_inputs_valid((hal_inputs_t){&ops, hal.ctx}));
}

static void test_read_every_combination_is_seen(void)
{
    for (uint32_t levels = 0; levels <= ALL_INPUTS; levels++) {
        set_all(levels);
        assert_levels(levels);
    }
}

static void test_read_absent_input_stays_inactive(void)
{
    for (uint32_t present = 0; present <= ALL_INPUTS; present++) {
        fixture->close();
        hal = fixture->open(present);
        TEST_ASSERT_EQUAL_HEX32(present, hal_inputs_present(hal));
        set_all(ALL_INPUTS);
        assert_levels(present);
        set_all(0);
        assert_levels(0);
    }
}

static void test_read_broken_says_io_and_keeps_outputs(void)
{
    uint32_t levels = 0xDEAD;
    if (fixture->set_broken == NULL) {
        TEST_IGNORE_MESSAGE("this backend's lines cannot be broken from here");
    }
    fixture->set_broken(true);
    TEST_ASSERT_EQUAL(HV_ERR_IO, hal_inputs_read(hal, &levels));
    TEST_ASSERT_EQUAL_HEX32(0xDEAD, levels);
    fixture->set_broken(false);
    set_all(INPUT_ENABLE);
    assert_levels(INPUT_ENABLE);
}

static void run_contract(void)
{
    RUN_TEST(test_valid_complete_accepts);
    RUN_TEST(test_valid_any_op_missing_refuses);
    RUN_TEST(test_read_every_combination_is_seen);
    RUN_TEST(test_read_absent_input_stays_inactive);
    RUN_TEST(test_read_broken_says_io_and_keeps_outputs);
}

static void test_sim_read_failing_at_every_step_recovers(void)
{
    for (uint32_t first = 1; first <= 8; first++) {
        for (uint32_t count = 1; count <= 3; count++) {
            hal = open_sim(ALL_INPUTS);
            sim.fail = (sim_fail_t){.first = first, .count = count};
            for (uint32_t n = 1; n <= 12; n++) {
                uint32_t levels = 0xDEAD;
                const bool fails = n >= first && n < first + count;
                set_all(n & ALL_INPUTS);
                TEST_ASSERT_EQUAL(fails ? HV_ERR_IO : HV_OK, hal_inputs_read(hal, &levels));
                TEST_ASSERT_EQUAL_HEX32(fails ? 0xDEAD : n & ALL_INPUTS, levels);
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
    RUN_TEST(test_sim_read_failing_at_every_step_recovers);
    return UNITY_END();
}
