/* SPDX-License-Identifier: MIT
 * main.c - a gateway without an operating system: the whole program of a port.
 */
#include "heave/gateway.h"
#include "platform.h"
#include "port.h"
#include "start.h"

static gateway_t gateway;
static cia402_t drives;

/* Yours: outputs to their safe state first. The watchdog is not fed any more and resets the chip, or nothing moves again. Drives
 * notice the silence and stop by themselves. */
void start_fail(void)
{
    for (;;) {}
}

void hv_assert_failed(const char *file, int line)
{
    (void)file, (void)line; /* yours: into memory that survives the reset */
    start_fail();
}

/* Not in main(), whose variables take room on the stack for ever. */
HV_OWN_FRAME static void prepare(void)
{
    const gateway_io_t io = {port_udp(), cia402_hal(&drives), port_relays(), port_inputs(), port_log(), {NULL, NULL}};
    if (cia402_init(&drives, &k_platform_drives, port_can()) != HV_OK || gateway_init(&gateway, &k_platform, &io) != HV_OK) {
        start_fail(); /* the tables are wrong */
    }
}

int main(void)
{
    event_t request;
    uint64_t now_us = k_platform.cycle_us; /* 0 means "never" */
    prepare();
    for (;;) {
        const uint32_t late = port_wait(k_platform.cycle_us);
        if (late > 0) {
            gateway_note_late(&gateway, late);
        }
        if (port_request(&request)) {
            (void)!gateway_request(&gateway, request, now_us); /* refused where the state does not allow it */
        }
        gateway_cycle(&gateway, now_us);
        now_us += k_platform.cycle_us;
    }
}
