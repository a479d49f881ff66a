/* SPDX-License-Identifier: MIT
 * modbus_line.c - a Modbus line of hal/linux on a string: does what lines on standard input say and answers each with one line.
 *
 *   modbus_line tcp HOST PORT TIMEOUT_US | serial DEVICE BPS TIMEOUT_US
 *   ask SLOT FUNCTION UNIT ADDRESS COUNT [VALUE...]   one transaction: STATUS EXCEPTION COUNT [VALUE...]
 *   flood SLOT UNIT ADDRESS FIRST LAST                writes each value in turn, one a millisecond, waiting for none: RESULTS
 * FAILURES status                                            TROUBLE TRANSACTIONS LINKS STRAYS PROBES REPLACED, then the text
 *   started                                           nothing may be allocated from now on (malloc_guard.c): started
 *
 * STATUS is ok, timeout, format, state or io. Ends with standard input.
 */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <time.h>

#include "linux_modbus.h"

#define PATIENCE_MS 60000u

static linux_modbus_t line;
static hal_modbus_t hal;

static void wait_a_millisecond(void)
{
    static const struct timespec k_pause = {.tv_nsec = 1000000};
    (void)nanosleep(&k_pause, NULL);
}

static const char *name_of(hv_status_t status)
{
    switch ((int)status) {
    case HV_OK:
        return "ok";
    case HV_ERR_TIMEOUT:
        return "timeout";
    case HV_ERR_FORMAT:
        return "format";
    case HV_ERR_STATE:
        return "state";
    case HV_ERR_IO:
        return "io";
    default:
        return "?";
    }
}

static bool wait_for(unsigned slot, modbus_result_t *result)
{
    for (unsigned ms = 0; ms < PATIENCE_MS; ms++) {
        if (hal_modbus_poll(hal, slot, result) == HV_OK) {
            return true;
        }
        wait_a_millisecond();
    }
    return false;
}

static unsigned next_number(char **at)
{
    return (unsigned)strtoul(*at, at, 0);
}

static void do_ask(char *at)
{
    static uint32_t tag = 1;
    modbus_request_t request = {.tag = tag++};
    modbus_result_t result;
    const unsigned slot = next_number(&at);
    request.function = (modbus_function_t)next_number(&at);
    request.unit = (uint8_t)next_number(&at);
    request.address = (uint16_t)next_number(&at);
    request.count = (uint8_t)next_number(&at);
    for (unsigned i = 0; i < HAL_MODBUS_VALUES_MAX; i++) {
        request.value[i] = (uint16_t)next_number(&at);
    }
    if (hal_modbus_submit(hal, slot, &request) != HV_OK) {
        puts("refused");
        return;
    }
    if (!wait_for(slot, &result)) {
        puts("stuck");
        return;
    }
    if (result.tag != request.tag) {
        puts("mixed up");
        return;
    }
    printf("%s %u %u", name_of(result.status), (unsigned)result.exception, (unsigned)result.count);
    for (unsigned i = 0; i < result.count; i++) {
        printf(" %u", (unsigned)result.value[i]);
    }
    puts("");
}

/* What the motion thread does: a set-point each cycle, whatever has become of the last one. */
static void do_flood(char *at)
{
    modbus_result_t result;
    linux_modbus_status_t status;
    unsigned results = 0, failures = 0, ms = 0;
    const unsigned slot = next_number(&at), unit = next_number(&at), address = next_number(&at), first = next_number(&at);
    const unsigned last = next_number(&at);
    for (unsigned value = first; value <= last; value++) {
        const modbus_request_t request = {.function = MODBUS_WRITE_REGISTERS,
                                          .unit = (uint8_t)unit,
                                          .address = (uint16_t)address,
                                          .count = 1,
                                          .value = {(uint16_t)value}};
        (void)!hal_modbus_submit(hal, slot, &request);
        wait_a_millisecond();
        if (hal_modbus_poll(hal, slot, &result) == HV_OK) {
            results++;
            failures += result.status != HV_OK;
        }
    }
    do {
        linux_modbus_status(&line, &status);
        wait_a_millisecond();
    } while (status.waiting != 0 && ++ms < PATIENCE_MS);
    if (hal_modbus_poll(hal, slot, &result) == HV_OK) {
        results++;
        failures += result.status != HV_OK;
    }
    printf("%u %u\n", results, failures);
}

static void do_status(void)
{
    linux_modbus_status_t status;
    linux_modbus_status(&line, &status);
    printf("%d %" PRIu32 " %" PRIu32 " %" PRIu32 " %" PRIu32 " %" PRIu32 " %s\n", (int)status.trouble, status.count.transactions,
           status.count.links, status.count.strays, status.count.probes, status.replaced, linux_modbus_text(&line));
}

static void obey(char *order)
{
    if (strncmp(order, "ask ", 4) == 0) {
        do_ask(order + 4);
    } else if (strncmp(order, "flood ", 6) == 0) {
        do_flood(order + 6);
    } else if (strncmp(order, "started", 7) == 0) {
        (void)mlockall(MCL_CURRENT); /* what malloc_guard.c waits for */
        printf("started\n");
    } else {
        do_status();
    }
    (void)fflush(stdout);
}

static hv_status_t open_line(char **argv)
{
    const bool is_tcp = strcmp(argv[1], "tcp") == 0;
    const unsigned number = (unsigned)strtoul(argv[3], NULL, 0);
    const linux_modbus_config_t config = {.host = is_tcp ? argv[2] : NULL,
                                          .port = (uint16_t)(is_tcp ? number : 0),
                                          .device = argv[2],
                                          .baud_bps = number,
                                          .parity = 'N',
                                          .stop_bits = 1,
                                          .timeout_us = (uint32_t)strtoul(argv[4], NULL, 0)};
    return linux_modbus_open(&line, &config);
}

int main(int argc, char **argv)
{
    char order[1024];
    if (argc != 5 || open_line(argv) != HV_OK) {
        (void)fprintf(stderr, "modbus_line: %s\n", linux_modbus_text(&line));
        return 1;
    }
    hal = linux_modbus_hal(&line);
    while (fgets(order, sizeof order, stdin) != NULL) {
        obey(order);
    }
    linux_modbus_close(&line);
    return 0;
}
