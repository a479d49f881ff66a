/* SPDX-License-Identifier: MIT
 * test_hal_inputs.c - the contract of hal/inputs.h on every backend; the fault plan of the simulated one, and what there is to
 * contacts on GPIO lines.
 *
 *     test_contract_hal_inputs          the simulated switches
 *     test_contract_hal_inputs --gpio   GPIO lines, as root on a kernel of its own with gpio-sim (tests/lib/kernel.py)
 */
#include "contract.h"

#include <string.h>
#include <time.h>
#include <unistd.h>

#include "gpio_sim.h"
#include "linux_gpio_inputs.h"
#include "sim_inputs.h"

#define OPENED     (INPUT_ESTOP | INPUT_ESTOP2 | INPUT_POWER) /* active while their contacts are open */
#define ALL_INPUTS (OPENED | INPUT_ENABLE | INPUT_RESET)

/** A backend under test. */
typedef struct {
    const char *name;
    hal_inputs_t (*open)(uint32_t present);
    void (*close)(void);
    void (*set)(uint32_t input, bool is_active); /**< someone moves a switch */
    void (*settle)(void);                        /**< until a slow backend has seen it */
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

static void do_nothing(void) {}

static const fixture_t k_sim = {"sim", open_sim, close_sim, set_sim, do_nothing, break_sim};

/* --- Contacts on GPIO lines: DESK1 is the e-stop, DESK2 the key, DESK3 the button, DESK4 the e-stop's second
 * channel, DESK5 the supply --- */

#define CHIP_LINES 6u

static linux_gpio_inputs_t gpio;
static gpio_sim_t chip;
static bool is_active_low = true;
static bool is_without_edges; /* as from a chip without interrupts */

static linux_gpio_inputs_config_t desk(uint32_t present)
{
    static const char *const k_line[] = {"DESK1", "DESK2", "DESK3", "DESK4", "DESK5"};
    linux_gpio_inputs_config_t config = {.is_active_low = is_active_low};
    for (unsigned i = 0; i < LINUX_GPIO_INPUTS_MAX; i++) {
        if ((present >> i & 1u) != 0) {
            config.names.line[config.names.count] = k_line[i];
            config.input[config.names.count++] = 1u << i;
        }
    }
    return config;
}

static void pass(unsigned ms)
{
    const struct timespec time = {.tv_sec = ms / 1000, .tv_nsec = ms % 1000 * 1000000L};
    (void)nanosleep(&time, NULL);
}

/* A contact: between its line and ground, or supply. Open, the line is where its pull has it. */
static void set_contact(unsigned line, bool is_closed)
{
    gpio_sim_pull(&chip, line, is_closed != is_active_low);
}

/* Key and button close when active, the others open. */
static void set_gpio(uint32_t input, bool is_active)
{
    unsigned line = 1;
    while (1u << (line - 1) != input) {
        line++;
    }
    set_contact(line, is_active != ((input & OPENED) != 0));
}

/* The worker looks, and what was pressed before is told of. */
static void settle_gpio(void)
{
    uint32_t levels;
    pass(12);
    (void)!hal_inputs_read(hal, &levels);
}

/* Every wire is broken: the lines are where the request has pulled them. */
static hal_inputs_t open_gpio_broken(uint32_t present)
{
    const linux_gpio_inputs_config_t config = desk(present);
    TEST_ASSERT_EQUAL_MESSAGE(HV_OK, linux_gpio_inputs_open(&gpio, &config), gpio.error_text);
    return linux_gpio_inputs_hal(&gpio);
}

static hal_inputs_t open_gpio(uint32_t present)
{
    hal = open_gpio_broken(present);
    set_gpio(INPUT_ESTOP, false);
    set_gpio(INPUT_ESTOP2, false);
    set_gpio(INPUT_POWER, false);
    settle_gpio();
    return hal;
}

static void close_gpio(void)
{
    (void)linux_gpio_inputs_close(&gpio);
}

static const fixture_t k_gpio = {"gpio", open_gpio, close_gpio, set_gpio, settle_gpio, NULL};

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
    for (uint32_t input = INPUT_ESTOP; input <= INPUT_POWER; input <<= 1) {
        fixture->set(input, (levels & input) != 0);
    }
    fixture->settle();
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

/* --- What only contacts have --- */

static uint32_t read_now(void)
{
    uint32_t levels = 0xDEAD;
    TEST_ASSERT_EQUAL(HV_OK, hal_inputs_read(hal, &levels));
    return levels;
}

static void test_gpio_broken_wires_are_an_estop_and_a_failing_supply_and_nothing_else(void)
{
    close_gpio();
    hal = open_gpio_broken(ALL_INPUTS);
    TEST_ASSERT_EQUAL_HEX32(OPENED, read_now()); /* from the first read on */
    pass(30);
    TEST_ASSERT_EQUAL_HEX32(OPENED, read_now());
}

/* Closed again before anybody looks. Simulated edges come with the next tick of the kernel's clock, at the latest after 10 ms. */
static void test_gpio_short_opening_is_told_of_by_the_kernel(void)
{
    const struct timespec half_ms = {.tv_nsec = 500000L};
    if (!gpio.has_edges) {
        TEST_IGNORE_MESSAGE("this kernel's simulated lines tell of no edges");
    }
    for (unsigned i = 0; i < 20; i++) {
        pass(i % 10);
        TEST_ASSERT_EQUAL_HEX32(0, read_now());
        const bool is_second = i % 2 != 0;
        set_contact(is_second ? 4 : 1, false);
        (void)nanosleep(&half_ms, NULL);
        set_contact(is_second ? 4 : 1, true);
        pass(25);
        TEST_ASSERT_EQUAL_HEX32(is_second ? INPUT_ESTOP2 : INPUT_ESTOP, read_now());
        pass(25);
    }
}

static void test_gpio_without_edges_is_seen_within_a_millisecond(void)
{
    close_gpio();
    is_without_edges = true;
    hal = open_gpio(ALL_INPUTS);
    is_without_edges = false;
    for (unsigned i = 0; i < 20; i++) {
        pass(i % 10);
        TEST_ASSERT_EQUAL_HEX32(0, read_now());
        set_contact(1, false);
        pass(1);
        TEST_ASSERT_EQUAL_HEX32(INPUT_ESTOP, read_now());
        set_contact(1, true);
        settle_gpio();
    }
}

static void test_gpio_chip_that_goes_is_an_error_and_stays_one(void)
{
    uint32_t levels = 0xDEAD;
    gpio_sim_unplug(&chip);
    pass(15);
    for (unsigned i = 0; i < 3; i++) {
        TEST_ASSERT_EQUAL(HV_ERR_IO, hal_inputs_read(hal, &levels));
        TEST_ASSERT_EQUAL_HEX32(0xDEAD, levels);
        pass(300);
    }
    close_gpio();
    gpio_sim_drop(&chip);
    TEST_ASSERT_TRUE(gpio_sim_make(&chip, "desk", "desk", CHIP_LINES, "DESK"));
}

static void test_gpio_lines_in_use_or_missing_are_named(void)
{
    static linux_gpio_inputs_t other;
    linux_gpio_inputs_config_t config = desk(INPUT_ESTOP | INPUT_RESET);
    TEST_ASSERT_EQUAL(HV_ERR_IO, linux_gpio_inputs_open(&other, &config));
    TEST_ASSERT_EQUAL_STRING("gpio: line DESK1 of chip desk is in use by \"heaved inputs\"", other.error_text);
    config.names.line[1] = "DESK9";
    TEST_ASSERT_EQUAL(HV_ERR_IO, linux_gpio_inputs_open(&other, &config));
    TEST_ASSERT_EQUAL_STRING("gpio: no chip has a line DESK9 (gpioinfo lists what there is)", other.error_text);
    (void)linux_gpio_inputs_close(&other);
}

static void run_gpio(void)
{
    RUN_TEST(test_gpio_broken_wires_are_an_estop_and_a_failing_supply_and_nothing_else);
    RUN_TEST(test_gpio_short_opening_is_told_of_by_the_kernel);
    RUN_TEST(test_gpio_without_edges_is_seen_within_a_millisecond);
    RUN_TEST(test_gpio_lines_in_use_or_missing_are_named);
    RUN_TEST(test_gpio_chip_that_goes_is_an_error_and_stays_one);
}

/* --- Edges of every kind, at any moment: from a pipe --- */

enum { ROSE = 0x80 };

static struct {
    bool is_used;
    int pipe[2];
    uint32_t closed; /**< contacts */
    int error;       /**< of reading them */
} m_fake;

hv_status_t __real_linux_gpio_request(linux_gpio_chip_t *self, const linux_gpio_names_t *names, linux_gpio_request_t *request,
                                      char text[LINUX_GPIO_TEXT_SIZE]);
hv_status_t __wrap_linux_gpio_request(linux_gpio_chip_t *self, const linux_gpio_names_t *names, linux_gpio_request_t *request,
                                      char text[LINUX_GPIO_TEXT_SIZE]);
int __real_linux_gpio_chip_get(linux_gpio_chip_t *self, uint32_t *values);
int __wrap_linux_gpio_chip_get(linux_gpio_chip_t *self, uint32_t *values);
unsigned __real_linux_gpio_chip_fds(const linux_gpio_chip_t *self, int fd[LINUX_GPIO_LINES_MAX]);
unsigned __wrap_linux_gpio_chip_fds(const linux_gpio_chip_t *self, int fd[LINUX_GPIO_LINES_MAX]);
int __real_linux_gpio_chip_edges(linux_gpio_chip_t *self, unsigned index, uint32_t *rose, uint32_t *fell);
int __wrap_linux_gpio_chip_edges(linux_gpio_chip_t *self, unsigned index, uint32_t *rose, uint32_t *fell);

hv_status_t __wrap_linux_gpio_request(linux_gpio_chip_t *self, const linux_gpio_names_t *names, linux_gpio_request_t *request,
                                      char text[LINUX_GPIO_TEXT_SIZE])
{
    if (!m_fake.is_used) {
        request->has_edges = request->has_edges && !is_without_edges;
        return __real_linux_gpio_request(self, names, request, text);
    }
    memset(self, 0, sizeof *self);
    return HV_OK;
}

int __wrap_linux_gpio_chip_get(linux_gpio_chip_t *self, uint32_t *values)
{
    if (!m_fake.is_used) {
        return __real_linux_gpio_chip_get(self, values);
    }
    *values = __atomic_load_n(&m_fake.closed, __ATOMIC_ACQUIRE);
    return __atomic_load_n(&m_fake.error, __ATOMIC_ACQUIRE);
}

unsigned __wrap_linux_gpio_chip_fds(const linux_gpio_chip_t *self, int fd[LINUX_GPIO_LINES_MAX])
{
    fd[0] = m_fake.pipe[0];
    return m_fake.is_used ? 1 : __real_linux_gpio_chip_fds(self, fd);
}

int __wrap_linux_gpio_chip_edges(linux_gpio_chip_t *self, unsigned index, uint32_t *rose, uint32_t *fell)
{
    uint8_t edge = 0;
    if (!m_fake.is_used) {
        return __real_linux_gpio_chip_edges(self, index, rose, fell);
    }
    TEST_ASSERT_EQUAL_INT(1, (int)read(m_fake.pipe[0], &edge, 1));
    *((edge & ROSE) != 0 ? rose : fell) |= edge & 7u;
    return 0;
}

static void start_fake(void)
{
    const linux_gpio_inputs_config_t config = desk(INPUT_ESTOP | INPUT_ENABLE | INPUT_RESET);
    (void)linux_gpio_inputs_close(&gpio);
    m_fake.is_used = true;
    m_fake.closed = INPUT_ESTOP;
    m_fake.error = 0;
    TEST_ASSERT_EQUAL_INT(0, pipe(m_fake.pipe));
    TEST_ASSERT_EQUAL(HV_OK, linux_gpio_inputs_open(&gpio, &config));
    hal = linux_gpio_inputs_hal(&gpio);
}

static void end_fake(void)
{
    (void)linux_gpio_inputs_close(&gpio);
    (void)close(m_fake.pipe[0]);
    m_fake.is_used = false;
}

static void tell_edge(uint8_t edge)
{
    TEST_ASSERT_EQUAL_INT(1, (int)write(m_fake.pipe[1], &edge, 1));
}

/* Reads until it says so: the worker comes when it comes. A worker that was not let run for long is an error of its own. */
static void await(hv_status_t status, uint32_t expected)
{
    const time_t limit = time(NULL) + 60;
    uint32_t levels;
    for (;;) {
        levels = 0xDEAD;
        const hv_status_t now = hal_inputs_read(hal, &levels);
        if (now == status && (status != HV_OK || levels == expected)) {
            return;
        }
        TEST_ASSERT_TRUE_MESSAGE(time(NULL) < limit, "never");
        pass(1);
    }
}

/* The contact is closed whenever anybody looks: only the edge tells. */
static void test_edges_short_opening_is_told_of(void)
{
    static const uint8_t k_edges[] = {INPUT_ESTOP, INPUT_ESTOP | ROSE};
    start_fake();
    await(HV_OK, 0);
    for (unsigned i = 0; i < 20; i++) {
        tell_edge(k_edges[i % 2]);
        await(HV_OK, INPUT_ESTOP);
        await(HV_OK, 0);
    }
    (void)close(m_fake.pipe[1]);
    end_fake();
}

static void test_edges_that_break_are_replaced_by_looking(void)
{
    start_fake();
    (void)close(m_fake.pipe[1]); /* ready for ever, with nothing to read */
    await(HV_OK, 0);
    __atomic_store_n(&m_fake.closed, INPUT_ESTOP | INPUT_RESET, __ATOMIC_RELEASE);
    await(HV_OK, INPUT_RESET);
    __atomic_store_n(&m_fake.closed, 0, __ATOMIC_RELEASE);
    await(HV_OK, INPUT_ESTOP);
    end_fake();
}

static void test_edges_lines_that_cannot_be_read_for_a_while(void)
{
    start_fake();
    __atomic_store_n(&m_fake.error, 5, __ATOMIC_RELEASE);
    await(HV_ERR_IO, 0);
    __atomic_store_n(&m_fake.error, 0, __ATOMIC_RELEASE);
    await(HV_OK, 0);
    (void)close(m_fake.pipe[1]);
    end_fake();
}

static void run_contract_on(const fixture_t *on, const char *name)
{
    fixture = on;
    contract_backend = name;
    run_contract();
}

int main(int argc, char **argv)
{
    const bool is_gpio = argc > 1 && strcmp(argv[1], "--gpio") == 0;
    if (is_gpio && !gpio_sim_make(&chip, "desk", "desk", CHIP_LINES, "DESK")) {
        printf("1..0 # SKIP this kernel has no gpio-sim\n");
        return 0;
    }
    UNITY_BEGIN();
    if (!is_gpio) {
        run_contract_on(&k_sim, "sim");
        RUN_TEST(test_sim_read_failing_at_every_step_recovers);
        contract_backend = "gpio";
        RUN_TEST(test_edges_short_opening_is_told_of);
        RUN_TEST(test_edges_that_break_are_replaced_by_looking);
        RUN_TEST(test_edges_lines_that_cannot_be_read_for_a_while);
        return UNITY_END();
    }
    run_contract_on(&k_gpio, "gpio, contacts to ground");
    run_gpio();
    is_active_low = false;
    run_contract_on(&k_gpio, "gpio, contacts to supply");
    run_gpio();
    gpio_sim_drop(&chip);
    return UNITY_END();
}
