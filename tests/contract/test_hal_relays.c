/* SPDX-License-Identifier: MIT
 * test_hal_relays.c - the contract of hal/relays.h on every backend; the fault plan of the simulated one, and what there is to
 * GPIO lines and who has them.
 *
 *     test_contract_hal_relays          the simulated bank, coils of Modbus boards
 *     test_contract_hal_relays --gpio   GPIO lines, as root on a kernel of its own with gpio-sim (tests/lib/kernel.py)
 */
#include "contract.h"

#include <string.h>
#include <time.h>
#include <unistd.h>

#include "gpio_sim.h"
#include "heave/coil_relays.h"
#include "linux_gpio_relays.h"
#include "linux_modbus.h"
#include "modbus_server.h"
#include "sim_modbus.h"
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

/* Coils of a Modbus board: coil FIRST_COIL is relay 1. */
#define FIRST_COIL 16u
#define UNIT       3u
#define LOOK_CALLS 50u

static coil_relays_t coils;
static sim_modbus_t sim_line;
static sim_modbus_device_t board;
static uint64_t sim_now_us;
static linux_modbus_t line;
static modbus_server_t server;

static hal_relays_t open_coils_on(hal_modbus_t on, uint8_t count)
{
    const coil_relays_config_t config = {
        .line = on, .slot = 5, .unit = UNIT, .first_coil = FIRST_COIL, .count = count, .look_calls = LOOK_CALLS};
    TEST_ASSERT_EQUAL(HV_OK, coil_relays_init(&coils, &config));
    return coil_relays_hal(&coils);
}

static hal_relays_t open_coils(uint8_t count)
{
    board = (sim_modbus_device_t){.unit = UNIT};
    sim_now_us = 0;
    sim_modbus_init(&sim_line, &board, 1, 3000, 20000, NULL, 0);
    return open_coils_on(sim_modbus_hal(&sim_line), count);
}

/* A cycle of the gateway. */
static hv_status_t cycle(void)
{
    uint16_t mask;
    sim_now_us += 1000;
    sim_modbus_step(&sim_line, sim_now_us);
    return hal_relays_read_back(coil_relays_hal(&coils), &mask);
}

static void settle_coils(void)
{
    for (unsigned i = 0; i < 40; i++) {
        (void)cycle();
    }
}

static uint16_t coil_contacts(void)
{
    uint16_t mask = 0;
    for (unsigned i = 0; i < HAL_RELAYS_MAX; i++) {
        mask |= (uint16_t)(board.coil[FIRST_COIL + i] << i);
    }
    return mask;
}

static hal_relays_t open_linux_coils(uint8_t count)
{
    TEST_ASSERT_TRUE(modbus_server_start_tcp(&server));
    const linux_modbus_config_t config = {.host = "127.0.0.1", .port = server.port, .timeout_us = 5000000};
    TEST_ASSERT_EQUAL(HV_OK, linux_modbus_open(&line, &config));
    return open_coils_on(linux_modbus_hal(&line), count);
}

static void close_linux_coils(void)
{
    linux_modbus_close(&line);
    modbus_server_stop(&server);
}

static void settle_linux_coils(void)
{
    static const struct timespec k_pause = {.tv_nsec = 200000};
    const time_t limit = time(NULL) + 60;
    linux_modbus_status_t status;
    uint16_t mask;
    do {
        TEST_ASSERT_TRUE_MESSAGE(time(NULL) < limit, "the mask is not carried out");
        (void)nanosleep(&k_pause, NULL);
        linux_modbus_status(&line, &status);
    } while (hal_relays_read_back(coil_relays_hal(&coils), &mask) != HV_OK || status.waiting != 0);
}

static uint16_t linux_coil_contacts(void)
{
    uint16_t mask = 0;
    for (unsigned i = 0; i < HAL_RELAYS_MAX; i++) {
        mask |= (uint16_t)(modbus_server_get(&server, UNIT, MODBUS_SERVER_COIL, FIRST_COIL + i) << i);
    }
    return mask;
}

static const fixture_t k_fixtures[] = {
    {"sim", open_sim, do_nothing, do_nothing, sim_contacts},
    {"coils", open_coils, do_nothing, settle_coils, coil_contacts},
    {"coils linux", open_linux_coils, close_linux_coils, settle_linux_coils, linux_coil_contacts},
};

/* --- GPIO lines: line n + 2 is relay n + 1 --- */

#define CHIP_LINES 16u
#define FIRST_LINE 2u

static linux_gpio_relays_t gpio;
static gpio_sim_t chip;
static uint32_t levels_at_close; /**< of all lines, when they were given back */

static const char *const k_named[] = {"EFFECT2", "EFFECT3", "EFFECT4",  "EFFECT5",  "EFFECT6",  "EFFECT7",
                                      "EFFECT8", "EFFECT9", "EFFECT10", "EFFECT11", "EFFECT12", "EFFECT13"};
static const char *const k_numbered[] = {"2", "3", "4", "5", "6", "7", "8", "9", "10", "11", "12", "13"};

static uint32_t levels(void)
{
    uint32_t seen = 0;
    for (unsigned i = 0; i < CHIP_LINES; i++) {
        seen |= gpio_sim_level(&chip, i) ? 1u << i : 0u;
    }
    return seen;
}

void __real_linux_gpio_chip_close(linux_gpio_chip_t *self);
void __wrap_linux_gpio_chip_close(linux_gpio_chip_t *self);

void __wrap_linux_gpio_chip_close(linux_gpio_chip_t *self)
{
    levels_at_close = levels();
    __real_linux_gpio_chip_close(self);
}

static linux_gpio_relays_config_t bank(const char *label, const char *const lines[], unsigned count)
{
    linux_gpio_relays_config_t config = {.names = {.chip = label, .count = count}, .consumer = "heaved relays"};
    memcpy(config.names.line, lines, count * sizeof lines[0]);
    return config;
}

static hal_relays_t open_gpio(uint8_t count)
{
    const linux_gpio_relays_config_t config = bank(NULL, k_named, count);
    TEST_ASSERT_EQUAL_MESSAGE(HV_OK, linux_gpio_relays_open(&gpio, &config), gpio.error_text);
    return linux_gpio_relays_hal(&gpio);
}

static void close_gpio(void)
{
    (void)linux_gpio_relays_close(&gpio, 0);
}

static void pass(unsigned ms)
{
    const struct timespec time = {.tv_sec = ms / 1000, .tv_nsec = ms % 1000 * 1000000L};
    (void)nanosleep(&time, NULL);
}

static void settle_gpio(void)
{
    pass(2);
}

static uint16_t gpio_contacts(void)
{
    return (uint16_t)(levels() >> FIRST_LINE);
}

static const fixture_t k_gpio = {"gpio", open_gpio, close_gpio, settle_gpio, gpio_contacts};

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

/* --- Coils, what the contract does not say --- */

static hal_relays_t open_faulty(const sim_modbus_fault_t *plan, uint32_t planned, const coil_relays_config_t *changes)
{
    coil_relays_config_t config = *changes;
    board = (sim_modbus_device_t){.unit = UNIT};
    sim_now_us = 0;
    sim_modbus_init(&sim_line, &board, 1, 3000, 20000, plan, planned);
    config.line = sim_modbus_hal(&sim_line);
    config.unit = UNIT;
    config.first_coil = FIRST_COIL;
    config.count = COUNT;
    config.look_calls = LOOK_CALLS;
    TEST_ASSERT_EQUAL(HV_OK, coil_relays_init(&coils, &config));
    return coil_relays_hal(&coils);
}

static const coil_relays_config_t k_plain = {.slot = 0};

static void test_coils_start_at_the_start_mask(void)
{
    hal = open_faulty(NULL, 0, &(coil_relays_config_t){.start_mask = 0xF0A});
    assert_relays(0x00A);
}

static void test_coils_active_low_are_inverted(void)
{
    hal = open_faulty(NULL, 0, &(coil_relays_config_t){.is_active_low = true});
    settle_coils();
    TEST_ASSERT_EQUAL_HEX16(0xFF, coil_contacts());
    TEST_ASSERT_EQUAL(HV_OK, hal_relays_write(hal, 0x05));
    settle_coils();
    TEST_ASSERT_EQUAL_HEX16(0xFA, coil_contacts());
    uint16_t mask = 0;
    TEST_ASSERT_EQUAL(HV_OK, hal_relays_read_back(hal, &mask));
    TEST_ASSERT_EQUAL_HEX16(0x05, mask);
}

static void test_coils_not_yet_written_are_not_reported(void)
{
    uint16_t mask = 0x5A;
    hal = open_faulty(NULL, 0, &k_plain);
    TEST_ASSERT_EQUAL(HV_ERR_AGAIN, hal_relays_read_back(hal, &mask));
    settle_coils();
    TEST_ASSERT_EQUAL(HV_OK, hal_relays_write(hal, 0x01));
    TEST_ASSERT_EQUAL(HV_ERR_AGAIN, hal_relays_read_back(hal, &mask));
    TEST_ASSERT_EQUAL_HEX16(0x5A, mask);
}

static void test_coils_one_fault_at_every_step_is_made_good(void)
{
    static const sim_modbus_fault_kind_t k_kinds[] = {SIM_MODBUS_EXCEPTION, SIM_MODBUS_SILENT, SIM_MODBUS_LATE,
                                                      SIM_MODBUS_DAMAGED, SIM_MODBUS_NO_LINK};
    for (size_t kind = 0; kind < sizeof k_kinds / sizeof k_kinds[0]; kind++) {
        for (uint32_t at = 1; at <= 10; at++) {
            const sim_modbus_fault_t plan = {k_kinds[kind], at, 6};
            hal = open_faulty(&plan, 1, &k_plain);
            for (uint16_t mask = 1; mask <= 6; mask++) {
                TEST_ASSERT_EQUAL(HV_OK, hal_relays_write(hal, mask));
                settle_coils();
                assert_relays(mask);
            }
        }
    }
}

static void test_coils_three_failures_are_unknown_until_one_works(void)
{
    sim_modbus_fault_t plan[COIL_RELAYS_TRIES];
    for (uint32_t i = 0; i < COIL_RELAYS_TRIES; i++) {
        plan[i] = (sim_modbus_fault_t){SIM_MODBUS_SILENT, i + 2, 0};
    }
    hal = open_faulty(plan, COIL_RELAYS_TRIES, &k_plain);
    unsigned unknown = 0;
    settle_coils();
    TEST_ASSERT_EQUAL(HV_OK, hal_relays_write(hal, 0x3C));
    for (unsigned i = 0; i < 200; i++) {
        unknown += cycle() == HV_ERR_IO;
    }
    TEST_ASSERT_TRUE(unknown > 0 && unknown < 10);
    assert_relays(0x3C);
}

/* A board that is gone for good: nothing said of it is believed until it answers again. */
static void test_coils_a_dead_board_is_unknown_for_as_long_as_it_is(void)
{
    sim_modbus_fault_t plan[3 * COIL_RELAYS_TRIES];
    for (uint32_t i = 0; i < 3 * COIL_RELAYS_TRIES; i++) {
        plan[i] = (sim_modbus_fault_t){SIM_MODBUS_SILENT, i + 2, 0};
    }
    hal = open_faulty(plan, 3 * COIL_RELAYS_TRIES, &k_plain);
    settle_coils();
    TEST_ASSERT_EQUAL(HV_OK, hal_relays_write(hal, 0x3C));
    for (unsigned i = 0; i < 200 && cycle() != HV_ERR_IO; i++) {}
    TEST_ASSERT_EQUAL(HV_ERR_IO, hal_relays_write(hal, 0x3C));
    TEST_ASSERT_EQUAL(HV_ERR_IO, hal_relays_write(hal, 0x3D));
    for (unsigned i = 0; i < 60; i++) {
        TEST_ASSERT_EQUAL(HV_ERR_IO, cycle());
    }
    for (unsigned i = 0; i < 200 && cycle() != HV_OK; i++) {}
    assert_relays(0x3D);
}

/* The answer to a mask that was replaced while it was on the wire says nothing about the new one. */
static void test_coils_the_end_of_an_older_write_confirms_nothing(void)
{
    const sim_modbus_fault_t plan = {SIM_MODBUS_SILENT, 3, 0}; /* the new one, at first */
    hal = open_faulty(&plan, 1, &k_plain);
    settle_coils();
    TEST_ASSERT_EQUAL(HV_OK, hal_relays_write(hal, 0x11));
    (void)cycle();
    TEST_ASSERT_EQUAL(HV_OK, hal_relays_write(hal, 0x22));
    for (unsigned i = 0; i < 40; i++) {
        TEST_ASSERT_TRUE(cycle() == HV_ERR_AGAIN || coil_contacts() == 0x22);
    }
    settle_coils();
    assert_relays(0x22);
}

static void test_coils_the_same_mask_is_not_sent_again(void)
{
    hal = open_faulty(NULL, 0, &k_plain);
    TEST_ASSERT_EQUAL(HV_OK, hal_relays_write(hal, 0x11));
    settle_coils();
    const uint32_t before = sim_line.transactions;
    for (unsigned i = 0; i < LOOK_CALLS / 2; i++) {
        TEST_ASSERT_EQUAL(HV_OK, hal_relays_write(hal, 0x11));
        TEST_ASSERT_EQUAL(HV_OK, cycle());
    }
    TEST_ASSERT_TRUE(sim_line.transactions - before <= 1); /* a look */
}

static uint8_t answered;

/* A worker that hands over fewer or more coils than it was asked for. */
static hv_status_t poll_other_count(void *ctx, unsigned slot, modbus_result_t *result)
{
    const hv_status_t status = sim_modbus_hal(&sim_line).ops->poll(ctx, slot, result);
    if (status == HV_OK && result->count != 0) {
        result->count = answered;
    }
    return status;
}

static void test_coils_an_answer_of_another_length_is_a_failure(void)
{
    hal_modbus_ops_t odd = *sim_modbus_hal(&sim_line).ops;
    odd.poll = poll_other_count;
    for (answered = COUNT - 1; answered <= COUNT + 1; answered++) {
        hal = open_faulty(NULL, 0, &k_plain);
        coils.config.line.ops = &odd;
        TEST_ASSERT_EQUAL(HV_OK, hal_relays_write(hal, 0x11));
        unsigned unknown = 0;
        for (unsigned i = 0; i < 3 * LOOK_CALLS; i++) {
            unknown += cycle() == HV_ERR_IO;
        }
        TEST_ASSERT_EQUAL(answered != COUNT, unknown != 0);
    }
}

/* Its power came and went: every relay open, nobody told us. */
static void test_coils_a_board_that_forgot_is_told_again(void)
{
    hal = open_faulty(NULL, 0, &k_plain);
    settle_coils();
    TEST_ASSERT_EQUAL(HV_OK, hal_relays_write(hal, 0x81));
    settle_coils();
    board = (sim_modbus_device_t){.unit = UNIT};
    for (unsigned i = 0; i < 2 * LOOK_CALLS + 20; i++) {
        (void)cycle();
    }
    assert_relays(0x81);
}

static void test_coils_a_stuck_worker_makes_them_unknown(void)
{
    uint16_t mask;
    hal = open_faulty(NULL, 0, &k_plain);
    hv_status_t status = HV_ERR_AGAIN;
    for (unsigned i = 0; i <= LOOK_CALLS; i++) {
        status = hal_relays_read_back(hal, &mask); /* and the line does not move */
    }
    TEST_ASSERT_EQUAL(HV_ERR_IO, status);
    settle_coils();
    assert_relays(0);
}

static void test_coils_quiet_bank_asks_once_per_look(void)
{
    hal = open_faulty(NULL, 0, &k_plain);
    settle_coils();
    const uint32_t before = sim_line.transactions;
    for (unsigned i = 0; i < 10 * LOOK_CALLS; i++) {
        (void)cycle();
    }
    TEST_ASSERT_TRUE(sim_line.transactions - before <= 10 && sim_line.transactions - before >= 7);
}

static void test_coils_wrong_figures_are_refused(void)
{
    const coil_relays_config_t good = {.line = sim_modbus_hal(&sim_line), .unit = UNIT, .count = COUNT, .look_calls = 1};
    coil_relays_config_t config = good;
    config.count = HAL_RELAYS_MAX + 1;
    TEST_ASSERT_EQUAL(HV_ERR_RANGE, coil_relays_init(&coils, &config));
    config = good;
    config.look_calls = 0;
    TEST_ASSERT_EQUAL(HV_ERR_RANGE, coil_relays_init(&coils, &config));
    config = good;
    config.first_coil = 0xFFFF;
    TEST_ASSERT_EQUAL(HV_ERR_RANGE, coil_relays_init(&coils, &config));
    config = good;
    config.slot = HAL_MODBUS_SLOTS;
    TEST_ASSERT_EQUAL(HV_ERR_RANGE, coil_relays_init(&coils, &config));
    config = good;
    config.unit = 248;
    TEST_ASSERT_EQUAL(HV_ERR_RANGE, coil_relays_init(&coils, &config));
}

static void run_coils(void)
{
    RUN_TEST(test_coils_start_at_the_start_mask);
    RUN_TEST(test_coils_active_low_are_inverted);
    RUN_TEST(test_coils_not_yet_written_are_not_reported);
    RUN_TEST(test_coils_one_fault_at_every_step_is_made_good);
    RUN_TEST(test_coils_three_failures_are_unknown_until_one_works);
    RUN_TEST(test_coils_a_dead_board_is_unknown_for_as_long_as_it_is);
    RUN_TEST(test_coils_the_end_of_an_older_write_confirms_nothing);
    RUN_TEST(test_coils_the_same_mask_is_not_sent_again);
    RUN_TEST(test_coils_an_answer_of_another_length_is_a_failure);
    RUN_TEST(test_coils_a_board_that_forgot_is_told_again);
    RUN_TEST(test_coils_a_stuck_worker_makes_them_unknown);
    RUN_TEST(test_coils_quiet_bank_asks_once_per_look);
    RUN_TEST(test_coils_wrong_figures_are_refused);
}

/* --- What only GPIO lines have --- */

static void reopen(const linux_gpio_relays_config_t *config)
{
    close_gpio();
    TEST_ASSERT_EQUAL_MESSAGE(HV_OK, linux_gpio_relays_open(&gpio, config), gpio.error_text);
    hal = linux_gpio_relays_hal(&gpio);
}

static void assert_refused(const linux_gpio_relays_config_t *config, const char *text)
{
    static linux_gpio_relays_t other;
    TEST_ASSERT_EQUAL(HV_ERR_IO, linux_gpio_relays_open(&other, config));
    TEST_ASSERT_EQUAL_STRING(text, other.error_text);
    (void)linux_gpio_relays_close(&other, 0);
}

/* Writes a mask and looks at all lines of the chip, those of nobody included. */
static void assert_mask_on_lines(unsigned mask, bool is_active_low)
{
    TEST_ASSERT_EQUAL(HV_OK, hal_relays_write(hal, (uint16_t)mask));
    settle_gpio();
    TEST_ASSERT_EQUAL_HEX32((is_active_low ? ~mask & 0xFFFu : mask) << FIRST_LINE, levels());
}

static void test_gpio_masks_reach_exactly_their_lines(void)
{
    static const uint16_t k_document[] = {0x0F, 0xF0, 0x01, 0x0100, 0x00, 0x02, 0x04, 0x0A}; /* the vendor's document */
    for (unsigned low = 0; low < 2; low++) {
        linux_gpio_relays_config_t config = bank("effects", k_numbered, 12);
        config.is_active_low = low != 0;
        reopen(&config);
        for (unsigned i = 0; i < sizeof k_document / sizeof k_document[0]; i++) {
            assert_mask_on_lines(k_document[i], low != 0);
        }
        for (unsigned i = 0; i < 12; i++) {
            assert_mask_on_lines(1u << i, low != 0);
            assert_mask_on_lines(~(1u << i) & 0xFFFu, low != 0);
        }
        for (unsigned mask = 0; mask < 0x1000; mask += 37) {
            assert_mask_on_lines(mask, low != 0);
        }
    }
}

static void test_gpio_lines_stand_at_the_safe_mask_from_the_start_to_the_end(void)
{
    linux_gpio_relays_config_t config = bank(NULL, k_named, 12);
    uint16_t mask = 0;
    config.safe_mask = 0x801;
    config.is_active_low = true;
    reopen(&config);
    TEST_ASSERT_EQUAL_HEX32((~0x801u & 0xFFFu) << FIRST_LINE, levels()); /* no worker has run yet */
    TEST_ASSERT_EQUAL(HV_OK, hal_relays_read_back(hal, &mask));
    TEST_ASSERT_EQUAL_HEX16(0x801, mask);
    TEST_ASSERT_EQUAL(HV_OK, hal_relays_write(hal, 0x0F0));
    settle_gpio();
    TEST_ASSERT_EQUAL_HEX32((~0x0F0u & 0xFFFu) << FIRST_LINE, levels());
    (void)linux_gpio_relays_close(&gpio, 0x402);
    TEST_ASSERT_EQUAL_HEX32((~0x402u & 0xFFFu) << FIRST_LINE, levels_at_close);
}

static void test_gpio_mask_written_just_before_the_end_does_not_stay(void)
{
    TEST_ASSERT_EQUAL(HV_OK, hal_relays_write(hal, 0xFF));
    (void)linux_gpio_relays_close(&gpio, 0);
    TEST_ASSERT_EQUAL_HEX32(0, levels_at_close);
}

static void test_gpio_newest_of_many_masks_wins(void)
{
    for (unsigned i = 0; i <= 5000; i++) {
        TEST_ASSERT_EQUAL(HV_OK, hal_relays_write(hal, (uint16_t)(i & 0xFF)));
    }
    assert_relays(5000 & 0xFF);
}

static void test_gpio_names_that_lead_nowhere_say_why(void)
{
    static const char *const k_missing[] = {"EFFECT2", "EFECT3"};
    static const char *const k_beyond[] = {"2", "16"};
    linux_gpio_relays_config_t config = bank(NULL, k_missing, 2);
    close_gpio();
    assert_refused(&config, "gpio: no chip has a line EFECT3 (gpioinfo lists what there is)");
    config = bank("effects", k_missing, 2);
    assert_refused(&config, "gpio: chip effects has no line EFECT3 (gpioinfo lists what there is)");
    config = bank("effects", k_beyond, 2);
    assert_refused(&config, "gpio: chip effects has no line 16 (gpioinfo lists what there is)");
    config = bank("efects", k_named, 2);
    assert_refused(&config, "gpio: no chip has the label efects; there are: effects");
    config = bank(NULL, k_numbered, 2);
    assert_refused(&config, "gpio: 2 alone is no line: it takes the label of its chip");
    config = bank("gpiochip0", k_numbered, 2);
    assert_refused(&config, "gpio: no chip has the label gpiochip0; there are: effects");
}

static void test_gpio_lines_of_two_chips_are_told_apart_or_refused(void)
{
    static const char *const k_mixed[] = {"EFFECT2", "SPARE3"};
    gpio_sim_t second, third;
    close_gpio();
    TEST_ASSERT_TRUE(gpio_sim_make(&second, "second", "second", 16, "EFFECT"));
    TEST_ASSERT_TRUE(gpio_sim_make(&third, "third", "third", 8, "SPARE"));
    linux_gpio_relays_config_t config = bank(NULL, k_named, 2);
    assert_refused(&config, "gpio: 2 chips have these lines: say which one by its label");
    config = bank(NULL, k_mixed, 2);
    assert_refused(&config, "gpio: the lines are not all on one chip, as they have to be");
    config = bank("second", k_named, 12);
    TEST_ASSERT_EQUAL_MESSAGE(HV_OK, linux_gpio_relays_open(&gpio, &config), gpio.error_text);
    TEST_ASSERT_EQUAL(HV_OK, hal_relays_write(linux_gpio_relays_hal(&gpio), 0x101));
    settle_gpio();
    TEST_ASSERT_EQUAL_HEX32(0, levels());
    TEST_ASSERT_TRUE(gpio_sim_level(&second, 2) && !gpio_sim_level(&second, 3) && gpio_sim_level(&second, 10));
    close_gpio();
    gpio_sim_drop(&second);
    gpio_sim_drop(&third);
}

static void test_gpio_line_in_use_names_who_has_it(void)
{
    linux_gpio_chip_t other;
    linux_gpio_request_t request = {.consumer = "fountain", .count = 1, .offset = {5}, .is_output = true};
    const linux_gpio_names_t names = {.chip = "effects", .count = 1, .line = {"5"}};
    const linux_gpio_relays_config_t config = bank(NULL, k_named, 12);
    char text[LINUX_GPIO_TEXT_SIZE];
    close_gpio();
    TEST_ASSERT_EQUAL(HV_OK, linux_gpio_request(&other, &names, &request, text));
    assert_refused(&config, "gpio: line EFFECT5 of chip effects is in use by \"fountain\"");
    linux_gpio_chip_close(&other);
    TEST_ASSERT_EQUAL(HV_OK, linux_gpio_relays_open(&gpio, &config));
    assert_refused(&config, "gpio: line EFFECT2 of chip effects is in use by \"heaved relays\"");
}

static void test_gpio_without_permission_says_so(void)
{
    const linux_gpio_relays_config_t config = bank(NULL, k_named, 2);
    close_gpio();
    TEST_ASSERT_EQUAL_INT(0, seteuid(65534));
    assert_refused(&config, "gpio: not allowed to open /dev/gpiochip*: this user has to be in their group (see docs/gpio.md)");
    TEST_ASSERT_EQUAL_INT(0, seteuid(0));
}

static void test_gpio_chip_that_goes_is_noticed_and_the_end_is_orderly(void)
{
    uint16_t mask = 0x5A;
    TEST_ASSERT_EQUAL(HV_OK, hal_relays_write(hal, 0x11));
    settle_gpio();
    gpio_sim_unplug(&chip);
    pass(250); /* nobody writes: the worker looks by itself */
    TEST_ASSERT_EQUAL(HV_ERR_IO, hal_relays_read_back(hal, &mask));
    TEST_ASSERT_EQUAL_HEX16(0x5A, mask);
    TEST_ASSERT_EQUAL(HV_ERR_IO, hal_relays_write(hal, 0x12));
    close_gpio();
    gpio_sim_drop(&chip);
    const linux_gpio_relays_config_t config = bank(NULL, k_named, 2);
    assert_refused(&config, "gpio: this machine has no GPIO chip (/dev/gpiochip*)");
    TEST_ASSERT_TRUE(gpio_sim_make(&chip, "effects", "effects", CHIP_LINES, "EFFECT"));
}

static void run_contract_on(const fixture_t *on)
{
    fixture = on;
    contract_backend = fixture->name;
    run_contract();
}

static void run_gpio(void)
{
    RUN_TEST(test_gpio_masks_reach_exactly_their_lines);
    RUN_TEST(test_gpio_lines_stand_at_the_safe_mask_from_the_start_to_the_end);
    RUN_TEST(test_gpio_mask_written_just_before_the_end_does_not_stay);
    RUN_TEST(test_gpio_newest_of_many_masks_wins);
    RUN_TEST(test_gpio_names_that_lead_nowhere_say_why);
    RUN_TEST(test_gpio_lines_of_two_chips_are_told_apart_or_refused);
    RUN_TEST(test_gpio_line_in_use_names_who_has_it);
    RUN_TEST(test_gpio_without_permission_says_so);
    RUN_TEST(test_gpio_chip_that_goes_is_noticed_and_the_end_is_orderly);
}

/* All that runs on the machine's own kernel. */
static void run_portable(void)
{
    for (size_t i = 0; i < sizeof k_fixtures / sizeof k_fixtures[0]; i++) {
        run_contract_on(&k_fixtures[i]);
    }
    fixture = &k_fixtures[0];
    contract_backend = fixture->name;
    RUN_TEST(test_sim_write_failing_at_every_step_recovers);
    fixture = &k_fixtures[1];
    contract_backend = fixture->name;
    run_coils();
}

int main(int argc, char **argv)
{
    const bool is_gpio = argc > 1 && strcmp(argv[1], "--gpio") == 0;
    if (is_gpio && !gpio_sim_make(&chip, "effects", "effects", CHIP_LINES, "EFFECT")) {
        printf("1..0 # SKIP this kernel has no gpio-sim\n");
        return 0;
    }
    UNITY_BEGIN();
    if (is_gpio) {
        run_contract_on(&k_gpio);
        run_gpio();
        gpio_sim_drop(&chip);
    } else {
        run_portable();
    }
    return UNITY_END();
}
