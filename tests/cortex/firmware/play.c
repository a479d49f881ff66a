/* SPDX-License-Identifier: MIT
 * play.c - a table of configuration and frames in, the trace out: `heaved --play` on a microcontroller.
 * Command line: TABLE TRACE. Says how much of the stack was ever in use; ends badly on every trap and assertion.
 */
#include <string.h>

#include "heave/gateway.h"
#include "platform.h"
#include "port.h"
#include "record/player.h"
#include "semihost.h"
#include "sim_log.h"
#include "sim_relays.h"
#include "start.h"
#include "table.h"

#define TABLE_BYTES  262144u
#define LINES_MAX    4096u
#define OUT_BYTES    16384u
#define STACK_BYTES  65536u /* painted */
#define STACK_UNUSED 0xA5A5A5A5u

static union {
    uint64_t aligned;
    uint8_t byte[TABLE_BYTES];
} input;
static frames_line_t line[LINES_MAX];
static player_t player;
static sim_drives_t sim_drives;
static sim_relays_t sim_relays;
static sim_inputs_t sim_inputs;
static sim_log_t sim_log;
static char out[OUT_BYTES];
static size_t out_length;
static gateway_t template_gateway;
static cia402_t template_drives;

void start_fail(void)
{
    semihost_say("trap\n");
    semihost_exit(false);
}

void hv_assert_failed(const char *file, int line_number)
{
    (void)line_number;
    semihost_say(file);
    semihost_say(": assertion failed\n");
    semihost_exit(false);
}

static void require(bool is_good, const char *what)
{
    if (!is_good) {
        semihost_say(what);
        semihost_say("\n");
        semihost_exit(false);
    }
}

/* --- Stack --- */

static uint32_t *stack_low(void)
{
    return start_stack_end - STACK_BYTES / sizeof(uint32_t);
}

/* Everything below the stack pointer. */
static void paint_stack(void)
{
    uintptr_t pointer = 0;
    __asm__ volatile("mov %0, sp" : "=r"(pointer));
    for (volatile uint32_t *at = stack_low(); (uintptr_t)at < pointer; at++) {
        *at = STACK_UNUSED;
    }
}

static uint32_t stack_used(void)
{
    const uint32_t *at = stack_low();
    while (*at == STACK_UNUSED) {
        at++;
    }
    return (uint32_t)((uintptr_t)start_stack_end - (uintptr_t)at);
}

/* --- Input --- */

static const table_t *load(const char *path)
{
    const table_t *table = (const table_t *)(const void *)input.byte;
    const int file = semihost_open(path, false);
    require(file >= 0, "the table cannot be opened");
    const size_t bytes = semihost_read(file, input.byte, sizeof input.byte);
    require(bytes >= sizeof *table && bytes < sizeof input.byte, "the table is too short or too long");
    require(table->magic == TABLE_MAGIC && table->bytes == sizeof *table, "the table is laid out in another way");
    require(table->lines <= LINES_MAX, "the table has too many lines");
    return table;
}

static void read_lines(const table_t *table)
{
    const uint8_t *at = (const uint8_t *)&table[1];
    for (uint32_t i = 0; i < table->lines; i++) {
        const table_line_t *record = (const table_line_t *)(const void *)at;
        at += sizeof *record;
        line[i] = (frames_line_t){.t_us = record->t_us,
                                  .kind = (frames_kind_t)record->kind,
                                  .request = (event_t)record->request,
                                  .drive = (uint8_t)record->drive,
                                  .state = (drive_state_t)record->state,
                                  .number = record->number,
                                  .text = at,
                                  .length = record->length,
                                  .from = record->from};
        at += (record->length + 7u) / 8u * 8u;
    }
}

/* --- The run --- */

static void flush(int file)
{
    require(semihost_write(file, out, out_length), "the trace cannot be written");
    out_length = 0;
}

static void put_row(int file)
{
    if (out_length + TRACE_LINE_MAX > sizeof out) {
        flush(file);
    }
    out_length += trace_format(&player.row, &out[out_length]);
}

static void open_all(const table_t *table)
{
    sim_relays_init(&sim_relays, table->settings.relays.count);
    sim_inputs_init(&sim_inputs, INPUT_ESTOP);
    sim_log_init(&sim_log);
    require(sim_drives_init(&sim_drives, (uint8_t)table->axes, table->axis, NULL, 0) == HV_OK, "the drives are refused");
    const gateway_io_t io = {player_udp(&player),         sim_drives_hal(&sim_drives), sim_relays_hal(&sim_relays),
                             sim_inputs_hal(&sim_inputs), sim_log_hal(&sim_log),       {NULL, NULL}};
    player.line = line;
    player.lines = table->lines;
    player.drives = &sim_drives;
    player.inputs = &sim_inputs;
    require(session_init(&player.session, &table->settings, &io) == HV_OK, "the settings are refused");
    require(player_settle(&player, &table->settings), "the platform does not come up");
    player_begin(&player);
}

/* The tables and handles of hal/template are such that its program would start. */
static void check_template(void)
{
    const gateway_io_t io = {port_udp(), cia402_hal(&template_drives), port_relays(), port_inputs(), port_log(), {NULL, NULL}};
    require(cia402_init(&template_drives, &k_platform_drives, port_can()) == HV_OK, "the drives of hal/template are refused");
    require(gateway_init(&template_gateway, &k_platform, &io) == HV_OK, "the platform of hal/template is refused");
    for (uint64_t now_us = 1000; now_us < 20000; now_us += 1000) {
        gateway_cycle(&template_gateway, now_us);
    }
    require(gateway_snapshot(&template_gateway)->state == STATE_ESTOP,
            "inputs that cannot be read are no e-stop in hal/template");
}

static void run(int file)
{
    out_length = trace_header(out);
    put_row(file);
    while (!player_is_at_rest(&player)) {
        require(!player_is_endless(&player), "not at rest two hours after the last line");
        player_cycle(&player);
        put_row(file);
    }
    flush(file);
}

/* The argument after `at`, ended by a NUL. */
static char *next_argument(char **at)
{
    char *const start = *at;
    while (**at != ' ' && **at != '\0') {
        (*at)++;
    }
    if (**at == ' ') {
        *(*at)++ = '\0';
    }
    return start;
}

int main(void)
{
    static char arguments[1024];
    paint_stack();
    require(semihost_arguments(arguments, sizeof arguments), "no command line");
    char *at = arguments;
    (void)next_argument(&at);
    const char *table_path = next_argument(&at);
    const char *trace_path = next_argument(&at);
    check_template();
    const table_t *table = load(table_path);
    read_lines(table);
    const int file = semihost_open(trace_path, true);
    require(file >= 0, "the trace cannot be opened");
    open_all(table);
    run(file);
    semihost_say_number("stack", stack_used());
    semihost_exit(true);
    return 0;
}
