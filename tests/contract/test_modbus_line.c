/* SPDX-License-Identifier: MIT
 * test_modbus_line.c - Modbus lines of Linux, what the contract does not say: configurations, named troubles, the end of a line,
 * and which answers are trusted.
 */
#include "unity.h"

#include <string.h>
#include <time.h>

#include "linux_modbus.h"
#include "modbus_server.h"

#define LIMIT_S 60

static linux_modbus_t line;
static modbus_server_t server;

void setUp(void) {}

void tearDown(void)
{
    linux_modbus_close(&line);
}

static void wait_a_little(time_t limit)
{
    static const struct timespec k_pause = {.tv_nsec = 1000000};
    TEST_ASSERT_TRUE_MESSAGE(time(NULL) < limit, "it never happens");
    (void)nanosleep(&k_pause, NULL);
}

static void wait_for_trouble(linux_modbus_trouble_t trouble)
{
    const time_t limit = time(NULL) + LIMIT_S;
    linux_modbus_status_t status;
    do {
        wait_a_little(limit);
        linux_modbus_status(&line, &status);
    } while (status.trouble != trouble);
}

static modbus_result_t take(unsigned slot)
{
    const time_t limit = time(NULL) + LIMIT_S;
    modbus_result_t result;
    while (hal_modbus_poll(linux_modbus_hal(&line), slot, &result) != HV_OK) {
        wait_a_little(limit);
    }
    return result;
}

static const linux_modbus_config_t k_tcp = {.host = "127.0.0.1", .port = 502, .timeout_us = 50000};
static const linux_modbus_config_t k_serial = {
    .device = "/dev/serial/by-id/usb-none", .baud_bps = 115200, .parity = 'N', .stop_bits = 1, .timeout_us = 50000};

static void assert_refused(const linux_modbus_config_t *config, const char *what)
{
    TEST_ASSERT_EQUAL(HV_ERR_ARG, linux_modbus_open(&line, config));
    TEST_ASSERT_NOT_NULL_MESSAGE(strstr(linux_modbus_text(&line), what), linux_modbus_text(&line));
}

static void test_open_wrong_tcp_figures_are_named(void)
{
    linux_modbus_config_t config = k_tcp;
    config.host = "drive-1.local";
    assert_refused(&config, "IPv4 address");
    config = k_tcp;
    config.port = 0;
    assert_refused(&config, "port");
    config = k_tcp;
    config.timeout_us = 999;
    assert_refused(&config, "timeout");
    config.timeout_us = 10000001;
    assert_refused(&config, "timeout");
    config = k_tcp;
    config.broadcast_pause_us = 1000000;
    assert_refused(&config, "broadcast");
}

static void test_open_wrong_serial_figures_are_named(void)
{
    linux_modbus_config_t config = k_serial;
    config.device = "";
    assert_refused(&config, "device");
    config.device = NULL;
    assert_refused(&config, "device");
    config = k_serial;
    config.baud_bps = 115201; /* libmodbus would take it for 9600 */
    assert_refused(&config, "bit rate");
    config = k_serial;
    config.parity = 'n';
    assert_refused(&config, "parity");
    config = k_serial;
    config.stop_bits = 3;
    assert_refused(&config, "stop bits");
    config = k_serial;
    config.direction_delay_us = 10001;
    assert_refused(&config, "direction");
}

static void test_close_without_open_is_harmless(void)
{
    linux_modbus_close(&line);
    linux_modbus_close(&line);
}

static void test_open_absent_device_is_named_and_requests_fail_at_once(void)
{
    const modbus_request_t request = {.function = MODBUS_READ_HOLDING, .unit = 1, .count = 1};
    TEST_ASSERT_EQUAL(HV_OK, linux_modbus_open(&line, &k_serial));
    wait_for_trouble(LINUX_MODBUS_NO_DEVICE);
    TEST_ASSERT_NOT_NULL(strstr(linux_modbus_text(&line), "/dev/serial/by-id"));
    TEST_ASSERT_EQUAL(HV_OK, hal_modbus_submit(linux_modbus_hal(&line), 3, &request));
    TEST_ASSERT_EQUAL(HV_ERR_IO, take(3).status);
}

static void test_open_other_file_is_named(void)
{
    linux_modbus_config_t config = k_serial;
    config.device = "/dev/null";
    TEST_ASSERT_EQUAL(HV_OK, linux_modbus_open(&line, &config));
    wait_for_trouble(LINUX_MODBUS_NOT_SERIAL);
}

static void test_submit_unit_255_is_for_tcp_only(void)
{
    const modbus_request_t request = {.function = MODBUS_READ_HOLDING, .unit = 255, .count = 1};
    TEST_ASSERT_EQUAL(HV_OK, linux_modbus_open(&line, &k_serial));
    TEST_ASSERT_EQUAL(HV_ERR_ARG, hal_modbus_submit(linux_modbus_hal(&line), 0, &request));
    linux_modbus_close(&line);
    TEST_ASSERT_EQUAL(HV_OK, linux_modbus_open(&line, &k_tcp));
    TEST_ASSERT_EQUAL(HV_OK, hal_modbus_submit(linux_modbus_hal(&line), 0, &request));
}

static void open_served(linux_modbus_direction_t direction, uint32_t timeout_us)
{
    linux_modbus_config_t config = k_serial;
    TEST_ASSERT_TRUE(modbus_server_start_serial(&server, 0));
    config.device = server.path;
    config.direction = direction;
    config.timeout_us = timeout_us;
    TEST_ASSERT_EQUAL(HV_OK, linux_modbus_open(&line, &config));
}

/* A pseudo terminal has no driver that could. */
static void test_direction_by_the_kernel_where_it_cannot_is_named(void)
{
    open_served(LINUX_MODBUS_KERNEL, 50000);
    wait_for_trouble(LINUX_MODBUS_NO_RS485);
    linux_modbus_close(&line);
    modbus_server_stop(&server);
}

static void test_direction_by_rts_passes_transactions(void)
{
    const modbus_request_t request = {.function = MODBUS_WRITE_REGISTER, .unit = 2, .address = 5, .count = 1, .value = {77}};
    open_served(LINUX_MODBUS_RTS_LOW, 5000000);
    wait_for_trouble(LINUX_MODBUS_FINE);
    TEST_ASSERT_EQUAL(HV_OK, hal_modbus_submit(linux_modbus_hal(&line), 0, &request));
    TEST_ASSERT_EQUAL(HV_OK, take(0).status);
    TEST_ASSERT_EQUAL_UINT16(77, modbus_server_get(&server, 2, MODBUS_SERVER_HOLDING, 5));
    linux_modbus_close(&line);
    modbus_server_stop(&server);
}

static void test_close_serves_what_waits(void)
{
    open_served(LINUX_MODBUS_AUTOMATIC, 5000000);
    wait_for_trouble(LINUX_MODBUS_FINE);
    for (unsigned slot = 0; slot < HAL_MODBUS_SLOTS; slot++) {
        const modbus_request_t request = {
            .function = MODBUS_WRITE_REGISTER, .unit = 1, .address = (uint16_t)slot, .count = 1, .value = {(uint16_t)(slot + 1)}};
        TEST_ASSERT_EQUAL(HV_OK, hal_modbus_submit(linux_modbus_hal(&line), slot, &request));
    }
    linux_modbus_close(&line);
    for (unsigned slot = 0; slot < HAL_MODBUS_SLOTS; slot++) {
        TEST_ASSERT_EQUAL_UINT16(slot + 1, modbus_server_get(&server, 1, MODBUS_SERVER_HOLDING, slot));
    }
    modbus_server_stop(&server);
}

/* The worker waits for a unit that is not there; this side goes on, and nothing queues. */
static void test_submit_while_the_worker_waits_replaces(void)
{
    linux_modbus_status_t status;
    open_served(LINUX_MODBUS_AUTOMATIC, 900000);
    wait_for_trouble(LINUX_MODBUS_FINE);
    modbus_request_t request = {.function = MODBUS_WRITE_REGISTER, .unit = 99, .count = 1};
    for (uint32_t i = 1; i <= 100000; i++) {
        request.tag = i;
        TEST_ASSERT_EQUAL(HV_OK, hal_modbus_submit(linux_modbus_hal(&line), 7, &request));
    }
    linux_modbus_status(&line, &status);
    TEST_ASSERT_TRUE(status.waiting <= 2);
    TEST_ASSERT_TRUE(status.replaced >= 100000 - status.count.transactions - 2);
    linux_modbus_close(&line);
    modbus_server_stop(&server);
}

/* --- Which answers are trusted --- */

static linux_modbus_doubt_t doubt;

static bool is_doubtful(uint8_t unit, modbus_function_t function, uint64_t now_us)
{
    return linux_modbus_is_doubtful(&doubt, unit, function, now_us);
}

static void test_doubt_is_of_that_unit_and_function_for_a_while(void)
{
    memset(&doubt, 0, sizeof doubt);
    TEST_ASSERT_FALSE(is_doubtful(5, MODBUS_READ_HOLDING, 100));
    linux_modbus_note_silence(&doubt, 5, MODBUS_READ_HOLDING, 100);
    TEST_ASSERT_TRUE(is_doubtful(5, MODBUS_READ_HOLDING, 100));
    TEST_ASSERT_TRUE(is_doubtful(5, MODBUS_READ_HOLDING, 99 + LINUX_MODBUS_LATE_US));
    TEST_ASSERT_FALSE(is_doubtful(5, MODBUS_READ_HOLDING, 100 + LINUX_MODBUS_LATE_US));
    TEST_ASSERT_FALSE(is_doubtful(5, MODBUS_READ_INPUT, 200));
    TEST_ASSERT_FALSE(is_doubtful(4, MODBUS_READ_HOLDING, 200));
    linux_modbus_note_silence(&doubt, 247, MODBUS_WRITE_REGISTERS, 300);
    TEST_ASSERT_TRUE(is_doubtful(247, MODBUS_WRITE_REGISTERS, 301));
}

static void test_doubt_ends_with_an_answer(void)
{
    memset(&doubt, 0, sizeof doubt);
    linux_modbus_note_silence(&doubt, 5, MODBUS_READ_HOLDING, 100);
    linux_modbus_note_silence(&doubt, 5, MODBUS_WRITE_REGISTERS, 200);
    linux_modbus_note_answer(&doubt, 4);
    TEST_ASSERT_TRUE(is_doubtful(5, MODBUS_READ_HOLDING, 300));
    linux_modbus_note_answer(&doubt, 5);
    TEST_ASSERT_FALSE(is_doubtful(5, MODBUS_READ_HOLDING, 300));
    TEST_ASSERT_FALSE(is_doubtful(5, MODBUS_WRITE_REGISTERS, 300));
}

static void test_probe_is_a_read_that_is_not_in_doubt(void)
{
    modbus_function_t probe = MODBUS_WRITE_COIL;
    memset(&doubt, 0, sizeof doubt);
    for (unsigned i = 0; i < 4; i++) {
        TEST_ASSERT_TRUE(linux_modbus_find_probe(&doubt, 9, 1000, &probe));
        TEST_ASSERT_FALSE(modbus_is_write(probe));
        TEST_ASSERT_FALSE(is_doubtful(9, probe, 1000));
        linux_modbus_note_silence(&doubt, 9, probe, 1000);
    }
    TEST_ASSERT_FALSE(linux_modbus_find_probe(&doubt, 9, 1000, &probe));
    TEST_ASSERT_TRUE(linux_modbus_find_probe(&doubt, 9, 1000 + LINUX_MODBUS_LATE_US, &probe));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(test_open_wrong_tcp_figures_are_named);
    RUN_TEST(test_open_wrong_serial_figures_are_named);
    RUN_TEST(test_close_without_open_is_harmless);
    RUN_TEST(test_open_absent_device_is_named_and_requests_fail_at_once);
    RUN_TEST(test_open_other_file_is_named);
    RUN_TEST(test_submit_unit_255_is_for_tcp_only);
    RUN_TEST(test_direction_by_the_kernel_where_it_cannot_is_named);
    RUN_TEST(test_direction_by_rts_passes_transactions);
    RUN_TEST(test_close_serves_what_waits);
    RUN_TEST(test_submit_while_the_worker_waits_replaces);
    RUN_TEST(test_doubt_is_of_that_unit_and_function_for_a_while);
    RUN_TEST(test_doubt_ends_with_an_answer);
    RUN_TEST(test_probe_is_a_read_that_is_not_in_doubt);
    return UNITY_END();
}
