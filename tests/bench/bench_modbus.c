/* SPDX-License-Identifier: MIT
 * bench_modbus.c - how many transactions Modbus lines do, and how old a set-point is when its drive has confirmed it: six drives,
 * each given a set-point every millisecond and asked for its status whenever the last answer is there, as the driver does.
 *
 * usage: bench_modbus tcp|serial|serial-write SECONDS
 *   tcp           a connection for each drive over this machine's loopback
 *   serial        one line at 115200 bit/s 8N1 over a pseudo terminal, whose server takes the time of every character; drives
 * that need no time of their own serial-write  the same, set-points only Prints: transactions, failures, fewest and most
 * set-points that a drive confirmed, then every age in us.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "linux_clock.h"
#include "linux_modbus.h"
#include "modbus_server.h"

#define DRIVES     6u
#define BPS        115200u
#define TIMEOUT_US 50000u
#define CYCLE_US   1000u
#define SETPOINT   10u /* two registers, as a position of 32 bits */
#define STATUS     20u /* three: status word and position */
#define AGES_MAX   4000000u

typedef struct {
    hal_modbus_t line;
    unsigned slot; /* of the set-point; the status has the next one */
    uint8_t unit;
    bool is_asked;
    uint32_t confirmed;
} drive_t;

static linux_modbus_t line[DRIVES];
static modbus_server_t server[DRIVES];
static drive_t drive[DRIVES];
static uint32_t age_us[AGES_MAX];
static uint32_t ages, failures;

static void fail(const char *what)
{
    (void)fprintf(stderr, "bench_modbus: %s\n", what);
    exit(1);
}

static void open_tcp(unsigned i)
{
    if (!modbus_server_start_tcp(&server[i])) {
        fail("no server");
    }
    const linux_modbus_config_t config = {.host = "127.0.0.1", .port = server[i].port, .timeout_us = TIMEOUT_US};
    if (linux_modbus_open(&line[i], &config) != HV_OK) {
        fail(linux_modbus_text(&line[i]));
    }
    drive[i] = (drive_t){.line = linux_modbus_hal(&line[i]), .unit = 1};
}

static void open_serial(void)
{
    if (!modbus_server_start_serial(&server[0], BPS)) {
        fail("no server");
    }
    const linux_modbus_config_t config = {
        .device = server[0].path, .baud_bps = BPS, .parity = 'N', .stop_bits = 1, .timeout_us = TIMEOUT_US};
    if (linux_modbus_open(&line[0], &config) != HV_OK) {
        fail(linux_modbus_text(&line[0]));
    }
    for (unsigned i = 0; i < DRIVES; i++) {
        drive[i] = (drive_t){.line = linux_modbus_hal(&line[0]), .slot = 2 * i, .unit = (uint8_t)(i + 1)};
    }
}

static void take_results(drive_t *self)
{
    modbus_result_t result;
    if (hal_modbus_poll(self->line, self->slot, &result) == HV_OK) {
        failures += result.status != HV_OK;
        self->confirmed += result.status == HV_OK;
        if (result.status == HV_OK && ages < AGES_MAX) {
            age_us[ages++] = (uint32_t)result.done_us - result.tag;
        }
    }
    if (hal_modbus_poll(self->line, self->slot + 1, &result) == HV_OK) {
        failures += result.status != HV_OK;
        self->is_asked = false;
    }
}

static void step(drive_t *self, uint32_t now_us, bool is_write_only)
{
    const modbus_request_t setpoint = {.function = MODBUS_WRITE_REGISTERS,
                                       .unit = self->unit,
                                       .address = SETPOINT,
                                       .count = 2,
                                       .tag = now_us,
                                       .value = {(uint16_t)(now_us >> 16), (uint16_t)now_us}};
    const modbus_request_t status = {.function = MODBUS_READ_HOLDING, .unit = self->unit, .address = STATUS, .count = 3};
    take_results(self);
    if (hal_modbus_submit(self->line, self->slot, &setpoint) != HV_OK) {
        fail("the line takes no set-point");
    }
    if (!self->is_asked && !is_write_only) {
        self->is_asked = hal_modbus_submit(self->line, self->slot + 1, &status) == HV_OK;
    }
}

static uint32_t transactions(unsigned lines)
{
    uint32_t sum = 0;
    for (unsigned i = 0; i < lines; i++) {
        linux_modbus_status_t status;
        linux_modbus_status(&line[i], &status);
        sum += status.count.transactions;
    }
    return sum;
}

static void report(unsigned lines)
{
    uint32_t least = UINT32_MAX, most = 0;
    for (unsigned i = 0; i < DRIVES; i++) {
        least = drive[i].confirmed < least ? drive[i].confirmed : least;
        most = drive[i].confirmed > most ? drive[i].confirmed : most;
    }
    printf("%u %u %u %u\n", (unsigned)transactions(lines), (unsigned)failures, (unsigned)least, (unsigned)most);
    for (uint32_t i = 0; i < ages; i++) {
        printf("%u\n", (unsigned)age_us[i]);
    }
}

int main(int argc, char **argv)
{
    if (argc != 3 || (strcmp(argv[1], "tcp") != 0 && strncmp(argv[1], "serial", 6) != 0)) {
        fail("usage: bench_modbus tcp|serial|serial-write SECONDS");
    }
    const bool is_tcp = strcmp(argv[1], "tcp") == 0, is_write_only = strcmp(argv[1], "serial-write") == 0;
    const unsigned lines = is_tcp ? DRIVES : 1;
    const uint64_t cycles = strtoul(argv[2], NULL, 10) * (1000000u / CYCLE_US);
    const hal_clock_t clock = linux_clock_hal();
    for (unsigned i = 0; is_tcp && i < DRIVES; i++) {
        open_tcp(i);
    }
    if (!is_tcp) {
        open_serial();
    }
    uint64_t deadline_us = hal_clock_now_us(clock);
    for (uint64_t cycle = 0; cycle < cycles; cycle++) {
        deadline_us += CYCLE_US;
        (void)!hal_clock_sleep_until_us(clock, deadline_us);
        for (unsigned i = 0; i < DRIVES; i++) {
            step(&drive[i], (uint32_t)hal_clock_now_us(clock), is_write_only);
        }
    }
    report(lines);
    for (unsigned i = 0; i < lines; i++) {
        linux_modbus_close(&line[i]);
        modbus_server_stop(&server[i]);
    }
    return 0;
}
