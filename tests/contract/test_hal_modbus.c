/* SPDX-License-Identifier: MIT
 * test_hal_modbus.c - the contract of hal/modbus.h on every backend, and the fault plan of the simulated line.
 */
#include "contract.h"

#include <string.h>
#include <time.h>

#include "linux_modbus.h"
#include "modbus_server.h"
#include "sim_modbus.h"

/** Kinds of values a device has. */
typedef enum { HOLDING, INPUT, COIL, DISCRETE } bank_t;

/** A backend under test, with devices 1 and 7 on its line, each with values 0-127 of every kind, all 0 at first, exception 2
 * above. */
typedef struct {
    const char *name;
    hal_modbus_t (*open)(void);
    void (*close)(void);
    void (*settle)(void); /**< until the worker has nothing left to do */
    void (*set)(uint8_t unit, bank_t bank, uint16_t address, uint16_t value);
    uint16_t (*get)(uint8_t unit, bank_t bank, uint16_t address);
} fixture_t;

static const fixture_t *fixture;
static hal_modbus_t hal;

static sim_modbus_t sim;
static sim_modbus_device_t devices[2];
static uint64_t sim_now_us;

static void open_line(const sim_modbus_fault_t *plan, uint32_t planned)
{
    memset(devices, 0, sizeof devices);
    devices[0].unit = 1;
    devices[1].unit = 7;
    sim_now_us = 0;
    sim_modbus_init(&sim, devices, 2, 3000, 20000, plan, planned);
    hal = sim_modbus_hal(&sim);
}

static hal_modbus_t open_sim(void)
{
    open_line(NULL, 0);
    return hal;
}

static void close_sim(void) {}

static void settle_sim(void)
{
    sim_now_us += 10000000;
    sim_modbus_step(&sim, sim_now_us);
}

static sim_modbus_device_t *device_of(uint8_t unit)
{
    return unit == 1 ? &devices[0] : &devices[1];
}

static void set_sim(uint8_t unit, bank_t bank, uint16_t address, uint16_t value)
{
    sim_modbus_device_t *device = device_of(unit);
    switch (bank) {
    case HOLDING:
        device->holding[address] = value;
        break;
    case INPUT:
        device->input[address] = value;
        break;
    case COIL:
        device->coil[address] = value != 0;
        break;
    case DISCRETE:
        device->discrete[address] = value != 0;
        break;
    }
}

static uint16_t get_sim(uint8_t unit, bank_t bank, uint16_t address)
{
    const sim_modbus_device_t *device = device_of(unit);
    const uint16_t values[] = {device->holding[address], device->input[address], device->coil[address],
                               device->discrete[address]};
    return values[bank];
}

/* The backend of Linux, against a server made from libmodbus' other side. Generous times, since on a busy machine a pseudo
 * terminal may hold bytes back for seconds. */
#define TIMEOUT_US 5000000u
#define LIMIT_S    60

static linux_modbus_t line;
static modbus_server_t server;

static hal_modbus_t open_linux(const linux_modbus_config_t *config)
{
    if (linux_modbus_open(&line, config) != HV_OK) {
        TEST_FAIL_MESSAGE(linux_modbus_text(&line));
    }
    return linux_modbus_hal(&line);
}

static void settle_linux(void)
{
    linux_modbus_status_t status;
    const time_t limit = time(NULL) + LIMIT_S;
    do {
        static const struct timespec k_pause = {.tv_nsec = 200000};
        (void)nanosleep(&k_pause, NULL);
        linux_modbus_status(&line, &status);
        TEST_ASSERT_TRUE_MESSAGE(time(NULL) < limit, "the worker does not come to an end");
    } while (status.waiting != 0 || status.count.transactions != modbus_server_frames(&server));
}

static void close_linux(void)
{
    linux_modbus_close(&line);
    modbus_server_stop(&server);
}

static hal_modbus_t open_tcp(void)
{
    TEST_ASSERT_TRUE(modbus_server_start_tcp(&server));
    return open_linux(&(linux_modbus_config_t){.host = "127.0.0.1", .port = server.port, .timeout_us = TIMEOUT_US});
}

static hal_modbus_t open_serial(void)
{
    TEST_ASSERT_TRUE(modbus_server_start_serial(&server, 0));
    return open_linux(&(linux_modbus_config_t){
        .device = server.path, .baud_bps = 115200, .parity = 'N', .stop_bits = 1, .timeout_us = TIMEOUT_US});
}

static void set_server(uint8_t unit, bank_t bank, uint16_t address, uint16_t value)
{
    modbus_server_set(&server, unit, (modbus_server_bank_t)bank, address, value);
}

static uint16_t get_server(uint8_t unit, bank_t bank, uint16_t address)
{
    return modbus_server_get(&server, unit, (modbus_server_bank_t)bank, address);
}

static const fixture_t k_fixtures[] = {
    {"sim", open_sim, close_sim, settle_sim, set_sim, get_sim},
    {"linux tcp", open_tcp, close_linux, settle_linux, set_server, get_server},
    {"linux serial", open_serial, close_linux, settle_linux, set_server, get_server},
};

void setUp(void)
{
    hal = fixture->open();
}

void tearDown(void)
{
    fixture->close();
}

static modbus_request_t ask(modbus_function_t function, uint8_t unit, uint16_t address, uint8_t count)
{
    return (modbus_request_t){.function = function, .unit = unit, .address = address, .count = count, .tag = 0xC0FFEE};
}

static void submit(unsigned slot, const modbus_request_t *request)
{
    TEST_ASSERT_EQUAL(HV_OK, hal_modbus_submit(hal, slot, request));
}

static modbus_result_t take(unsigned slot)
{
    modbus_result_t result;
    memset(&result, 0xEE, sizeof result);
    TEST_ASSERT_EQUAL(HV_OK, hal_modbus_poll(hal, slot, &result));
    return result;
}

static void assert_nothing(unsigned slot)
{
    modbus_result_t result = {.tag = 4711};
    TEST_ASSERT_EQUAL(HV_ERR_AGAIN, hal_modbus_poll(hal, slot, &result));
    TEST_ASSERT_EQUAL_UINT32(4711, result.tag);
}

static modbus_result_t run_request(const modbus_request_t *request)
{
    submit(0, request);
    fixture->settle();
    const modbus_result_t result = take(0);
    TEST_ASSERT_EQUAL_UINT32(request->tag, result.tag);
    return result;
}

static void assert_failed(const modbus_result_t *result, hv_status_t status, uint8_t exception)
{
    TEST_ASSERT_EQUAL(status, result->status);
    TEST_ASSERT_EQUAL_UINT8(exception, result->exception);
    TEST_ASSERT_EQUAL_UINT8(0, result->count);
}

static void test_valid_complete_accepts(void)
{
    TEST_ASSERT_TRUE(hal_modbus_valid(hal));
}

static void test_valid_any_op_missing_refuses(void)
{
    hal_modbus_ops_t ops = *hal.ops;
    TEST_ASSERT_FALSE(hal_modbus_valid((hal_modbus_t){NULL, NULL}));
    ops.submit = NULL;
    TEST_ASSERT_FALSE(hal_modbus_valid((hal_modbus_t){&ops, hal.ctx}));
    ops = *hal.ops;
    ops.poll = NULL;
    TEST_ASSERT_FALSE(hal_modbus_valid((hal_modbus_t){&ops, hal.ctx}));
}

static void test_poll_nothing_submitted_says_again(void)
{
    for (unsigned slot = 0; slot < HAL_MODBUS_SLOTS; slot++) {
        assert_nothing(slot);
    }
}

static void test_poll_slot_out_of_range_is_refused(void)
{
    modbus_result_t result;
    TEST_ASSERT_EQUAL(HV_ERR_ARG, hal_modbus_poll(hal, HAL_MODBUS_SLOTS, &result));
}

static void test_read_every_function_brings_the_values(void)
{
    static const struct {
        modbus_function_t function;
        bank_t bank;
        uint16_t mask;
    } k_rows[] = {{MODBUS_READ_HOLDING, HOLDING, 0xFFFF},
                  {MODBUS_READ_INPUT, INPUT, 0xFFFF},
                  {MODBUS_READ_COILS, COIL, 1},
                  {MODBUS_READ_DISCRETE_INPUTS, DISCRETE, 1}};
    for (size_t row = 0; row < 4; row++) {
        for (uint8_t count = 1; count <= HAL_MODBUS_VALUES_MAX; count += 9) {
            for (uint8_t i = 0; i < count; i++) {
                fixture->set(7, k_rows[row].bank, 20 + i, (uint16_t)((i * 40503u >> 3) & k_rows[row].mask));
            }
            const modbus_request_t request = ask(k_rows[row].function, 7, 20, count);
            const modbus_result_t result = run_request(&request);
            TEST_ASSERT_EQUAL(HV_OK, result.status);
            TEST_ASSERT_EQUAL_UINT8(0, result.exception);
            TEST_ASSERT_EQUAL_UINT8(count, result.count);
            for (uint8_t i = 0; i < count; i++) {
                TEST_ASSERT_EQUAL_HEX16((uint16_t)((i * 40503u >> 3) & k_rows[row].mask), result.value[i]);
            }
        }
    }
}

static void test_write_every_function_reaches_that_device_only(void)
{
    static const struct {
        modbus_function_t function;
        bank_t bank;
        uint8_t count;
        uint16_t mask;
    } k_rows[] = {{MODBUS_WRITE_REGISTER, HOLDING, 1, 0xFFFF},
                  {MODBUS_WRITE_REGISTERS, HOLDING, HAL_MODBUS_VALUES_MAX, 0xFFFF},
                  {MODBUS_WRITE_COIL, COIL, 1, 1},
                  {MODBUS_WRITE_COILS, COIL, HAL_MODBUS_VALUES_MAX, 1}};
    for (size_t row = 0; row < 4; row++) {
        modbus_request_t request = ask(k_rows[row].function, 1, 30, k_rows[row].count);
        for (uint8_t i = 0; i < request.count; i++) {
            request.value[i] = (uint16_t)((i * 9973u + row + 1) & k_rows[row].mask);
        }
        const modbus_result_t result = run_request(&request);
        TEST_ASSERT_EQUAL(HV_OK, result.status);
        TEST_ASSERT_EQUAL_UINT8(0, result.count);
        for (uint8_t i = 0; i < request.count; i++) {
            TEST_ASSERT_EQUAL_HEX16(request.value[i], fixture->get(1, k_rows[row].bank, 30 + i));
            TEST_ASSERT_EQUAL_HEX16(request.value[i], result.value[i]);
            TEST_ASSERT_EQUAL_HEX16(0, fixture->get(7, k_rows[row].bank, 30 + i));
        }
        TEST_ASSERT_EQUAL_HEX16(0, fixture->get(1, k_rows[row].bank, 29));
        TEST_ASSERT_EQUAL_HEX16(0, fixture->get(1, k_rows[row].bank, 30 + request.count));
    }
}

static void test_write_broadcast_reaches_every_device_and_completes(void)
{
    modbus_request_t request = ask(MODBUS_WRITE_REGISTERS, HAL_MODBUS_BROADCAST, 5, 2);
    request.value[0] = 0x1234;
    request.value[1] = 0x5678;
    const modbus_result_t result = run_request(&request);
    TEST_ASSERT_EQUAL(HV_OK, result.status);
    TEST_ASSERT_EQUAL_HEX16(0x5678, fixture->get(1, HOLDING, 6));
    TEST_ASSERT_EQUAL_HEX16(0x5678, fixture->get(7, HOLDING, 6));
}

static void test_read_device_exception_is_told_apart(void)
{
    const modbus_request_t request = ask(MODBUS_READ_HOLDING, 1, 127, 2);
    const modbus_result_t result = run_request(&request);
    assert_failed(&result, HV_ERR_STATE, 2);
}

static void test_read_absent_unit_times_out_and_the_line_lives_on(void)
{
    const modbus_request_t absent = ask(MODBUS_READ_HOLDING, 33, 0, 1), present = ask(MODBUS_READ_HOLDING, 1, 0, 1);
    const modbus_result_t result = run_request(&absent);
    assert_failed(&result, HV_ERR_TIMEOUT, 0);
    TEST_ASSERT_EQUAL(HV_OK, run_request(&present).status);
}

static void test_submit_invalid_request_is_refused_and_nothing_runs(void)
{
    const modbus_request_t good = ask(MODBUS_WRITE_REGISTER, 1, 0, 1);
    const modbus_request_t wrong[] = {
        ask((modbus_function_t)0, 1, 0, 1),
        ask((modbus_function_t)23, 1, 0, 1),
        ask(MODBUS_READ_HOLDING, 1, 0, 0),
        ask(MODBUS_READ_HOLDING, 1, 0, HAL_MODBUS_VALUES_MAX + 1),
        ask(MODBUS_WRITE_REGISTER, 1, 0, 2),
        ask(MODBUS_WRITE_COIL, 1, 0, 2),
        ask(MODBUS_READ_HOLDING, HAL_MODBUS_BROADCAST, 0, 1),
        ask(MODBUS_READ_HOLDING, 248, 0, 1),
    };
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        TEST_ASSERT_EQUAL(HV_ERR_ARG, hal_modbus_submit(hal, 0, &wrong[i]));
    }
    TEST_ASSERT_EQUAL(HV_ERR_ARG, hal_modbus_submit(hal, HAL_MODBUS_SLOTS, &good));
    fixture->settle();
    assert_nothing(0);
}

static void test_poll_result_comes_once(void)
{
    const modbus_request_t request = ask(MODBUS_READ_HOLDING, 1, 0, 1);
    (void)run_request(&request);
    assert_nothing(0);
}

static void test_submit_many_before_the_worker_runs_newest_wins(void)
{
    modbus_request_t request = ask(MODBUS_WRITE_REGISTER, 1, 3, 1);
    for (uint32_t i = 1; i <= 100; i++) {
        request.value[0] = (uint16_t)i;
        request.tag = i;
        submit(4, &request);
    }
    request.value[0] = 0xFFFF; /* the backend has its own copy */
    fixture->settle();
    const modbus_result_t result = take(4);
    TEST_ASSERT_EQUAL_UINT32(100, result.tag);
    TEST_ASSERT_EQUAL_UINT16(100, fixture->get(1, HOLDING, 3));
    assert_nothing(4);
}

static void test_submit_every_slot_gets_its_own_result(void)
{
    for (unsigned slot = 0; slot < HAL_MODBUS_SLOTS; slot++) {
        modbus_request_t request =
            ask(slot % 2 ? MODBUS_WRITE_REGISTER : MODBUS_READ_HOLDING, slot % 3 ? 1 : 7, (uint16_t)slot, 1);
        request.tag = 1000 + slot;
        request.value[0] = (uint16_t)(slot + 1);
        submit(slot, &request);
    }
    fixture->settle();
    uint64_t first_us = UINT64_MAX, last_us = 0;
    for (unsigned slot = 0; slot < HAL_MODBUS_SLOTS; slot++) {
        const modbus_result_t result = take(slot);
        TEST_ASSERT_EQUAL(HV_OK, result.status);
        TEST_ASSERT_EQUAL_UINT32(1000 + slot, result.tag);
        first_us = result.done_us < first_us ? result.done_us : first_us;
        last_us = result.done_us > last_us ? result.done_us : last_us;
    }
    TEST_ASSERT_TRUE(last_us >= first_us);
}

static void run_contract(void)
{
    RUN_TEST(test_valid_complete_accepts);
    RUN_TEST(test_valid_any_op_missing_refuses);
    RUN_TEST(test_poll_nothing_submitted_says_again);
    RUN_TEST(test_poll_slot_out_of_range_is_refused);
    RUN_TEST(test_read_every_function_brings_the_values);
    RUN_TEST(test_write_every_function_reaches_that_device_only);
    RUN_TEST(test_write_broadcast_reaches_every_device_and_completes);
    RUN_TEST(test_read_device_exception_is_told_apart);
    RUN_TEST(test_read_absent_unit_times_out_and_the_line_lives_on);
    RUN_TEST(test_submit_invalid_request_is_refused_and_nothing_runs);
    RUN_TEST(test_poll_result_comes_once);
    RUN_TEST(test_submit_many_before_the_worker_runs_newest_wins);
    RUN_TEST(test_submit_every_slot_gets_its_own_result);
}

/* The simulated line. */

static void test_sim_transaction_takes_its_time_and_is_invisible_before(void)
{
    const modbus_request_t request = ask(MODBUS_READ_HOLDING, 1, 0, 1);
    sim_modbus_step(&sim, 500);
    submit(0, &request);
    submit(1, &request);
    for (uint64_t now_us = 500; now_us < 3500; now_us += 100) {
        sim_modbus_step(&sim, now_us);
        assert_nothing(0);
    }
    sim_modbus_step(&sim, 3500);
    TEST_ASSERT_EQUAL_UINT64(3500, take(0).done_us);
    assert_nothing(1);
    sim_modbus_step(&sim, 6500);
    TEST_ASSERT_EQUAL_UINT64(6500, take(1).done_us);
}

static void test_sim_one_long_step_serves_one_after_the_other(void)
{
    const modbus_request_t request = ask(MODBUS_READ_HOLDING, 1, 0, 1);
    for (unsigned slot = 0; slot < 5; slot++) {
        submit(slot, &request);
    }
    sim_modbus_step(&sim, 14999);
    for (unsigned slot = 0; slot < 4; slot++) {
        TEST_ASSERT_EQUAL_UINT64(3000 * (slot + 1), take(slot).done_us);
    }
    assert_nothing(4);
}

/* A newer request while one is on the wire: both end, each with its own result. */
static void test_sim_submit_while_on_the_wire_waits_its_turn(void)
{
    modbus_request_t request = ask(MODBUS_WRITE_REGISTER, 1, 0, 1);
    for (uint32_t tag = 1; tag <= 4; tag++) {
        request.tag = tag;
        submit(0, &request);
        sim_modbus_step(&sim, 1000 * tag);
    }
    TEST_ASSERT_EQUAL_UINT32(1, take(0).tag); /* started at 0, done at 3000 */
    sim_modbus_step(&sim, 6000);
    TEST_ASSERT_EQUAL_UINT32(3, take(0).tag);
    sim_modbus_step(&sim, 100000);
    TEST_ASSERT_EQUAL_UINT32(4, take(0).tag);
    assert_nothing(0);
    TEST_ASSERT_EQUAL_UINT32(1, sim.replaced); /* 2 was replaced by 3 in the queue, 3 started at 3000 */
}

/* A slot that always has work must not keep the others from theirs. */
static void test_sim_busy_slot_starves_nobody(void)
{
    const modbus_request_t request = ask(MODBUS_READ_HOLDING, 1, 0, 1);
    for (unsigned slot = 0; slot < HAL_MODBUS_SLOTS; slot++) {
        submit(slot, &request);
    }
    for (uint64_t now_us = 0; now_us <= 3000 * HAL_MODBUS_SLOTS; now_us += 1000) {
        submit(0, &request);
        sim_modbus_step(&sim, now_us);
    }
    for (unsigned slot = 0; slot < HAL_MODBUS_SLOTS; slot++) {
        (void)take(slot);
    }
}

#define SWEEP 10u

/** What a fault does to its transaction. */
typedef struct {
    sim_modbus_fault_kind_t kind;
    hv_status_t status;
    uint8_t exception;
    bool acts; /**< the device did what it was told */
} fault_row_t;

static const fault_row_t k_faults[] = {
    {SIM_MODBUS_EXCEPTION, HV_ERR_STATE, 6, false}, {SIM_MODBUS_SILENT, HV_ERR_TIMEOUT, 0, false},
    {SIM_MODBUS_LATE, HV_ERR_TIMEOUT, 0, true},     {SIM_MODBUS_DAMAGED, HV_ERR_FORMAT, 0, true},
    {SIM_MODBUS_NO_LINK, HV_ERR_IO, 0, false},
};

static void sweep(const fault_row_t *row, uint32_t at)
{
    const sim_modbus_fault_t plan = {row->kind, at, 6};
    open_line(&plan, 1);
    for (uint32_t n = 1; n <= SWEEP; n++) {
        modbus_request_t request = ask(MODBUS_WRITE_REGISTER, 1, (uint16_t)n, 1);
        request.tag = n;
        request.value[0] = (uint16_t)(100 + n);
        const modbus_result_t result = run_request(&request);
        if (n == at) {
            assert_failed(&result, row->status, row->exception);
        } else {
            TEST_ASSERT_EQUAL(HV_OK, result.status);
        }
        TEST_ASSERT_EQUAL_UINT16(n != at || row->acts ? 100 + n : 0, devices[0].holding[n]);
    }
}

/* Every kind of fault at every transaction hits that one alone; late answers never show up as the next one's. */
static void test_sim_one_fault_at_every_step_hits_that_transaction_only(void)
{
    for (size_t row = 0; row < sizeof k_faults / sizeof k_faults[0]; row++) {
        for (uint32_t at = 1; at <= SWEEP; at++) {
            sweep(&k_faults[row], at);
        }
    }
}

/* A read that failed shows no values. */
static void test_sim_late_read_shows_no_values(void)
{
    static const sim_modbus_fault_t k_plan = {SIM_MODBUS_LATE, 1, 0};
    const modbus_request_t request = ask(MODBUS_READ_HOLDING, 1, 0, 1);
    open_line(&k_plan, 1);
    devices[0].holding[0] = 0xBEEF;
    const modbus_result_t result = run_request(&request);
    assert_failed(&result, HV_ERR_TIMEOUT, 0);
    TEST_ASSERT_EQUAL_HEX16(0, result.value[0]);
    TEST_ASSERT_EQUAL_UINT64(20000, result.done_us);
}

static void run_sim(void)
{
    RUN_TEST(test_sim_transaction_takes_its_time_and_is_invisible_before);
    RUN_TEST(test_sim_one_long_step_serves_one_after_the_other);
    RUN_TEST(test_sim_submit_while_on_the_wire_waits_its_turn);
    RUN_TEST(test_sim_busy_slot_starves_nobody);
    RUN_TEST(test_sim_one_fault_at_every_step_hits_that_transaction_only);
    RUN_TEST(test_sim_late_read_shows_no_values);
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
    run_sim();
    return UNITY_END();
}
