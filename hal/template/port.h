/* SPDX-License-Identifier: MIT
 * port.h - everything a port supplies: four devices, a log, requests, and the beginning of each cycle.
 * Each handle is a contract of include/heave/hal/; port.c holds the smallest backend of each that is correct. Drives need none
 * where they are on a CAN bus: src/canopen and src/drives drive them through hal_can_t. Drives of another kind implement
 * heave/drives.h. tests/contract holds the tests that every backend has to pass.
 */
#ifndef PORT_H
#define PORT_H

#include "heave/hal/can.h"
#include "heave/hal/inputs.h"
#include "heave/hal/log.h"
#include "heave/hal/relays.h"
#include "heave/hal/udp.h"
#include "heave/supervisor.h"

/** Frames of the sender: UDP, or whatever else brings them (a serial line that ends each datagram by a newline, say). */
hal_udp_t port_udp(void);

/** The bus of the drives. */
hal_can_t port_can(void);

/** Relays. */
hal_relays_t port_relays(void);

/** E-stop monitor, enable key, reset button. */
hal_inputs_t port_inputs(void);

/** Lines of text for whoever is there to read them. */
hal_log_t port_log(void);

/** What the operator asks for: EVENT_ENGAGE, EVENT_HOLD, EVENT_RESUME, EVENT_PARK, EVENT_RESET or EVENT_SHUTDOWN, once for each
 *  push of a button (the reset button of port_inputs() is heard without this).
 *  @param request out, unchanged where there is none */
bool port_request(event_t *request);

/** Waits for the next cycle: a hardware timer, every cycle_us, absolute (a late cycle does not move the following ones). A
 *  watchdog is fed here and nowhere else.
 *  @return cycles that were missed since the last call, to be told to gateway_note_late() */
uint32_t port_wait(uint32_t cycle_us);

#endif
