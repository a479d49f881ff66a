/* SPDX-License-Identifier: MIT
 * shutdown.h - the end of a shutdown: waits until the drives have confirmed that their torque is off. Private to src/gateway.
 */
#ifndef GATEWAY_SHUTDOWN_H
#define GATEWAY_SHUTDOWN_H

#include "heave/gateway.h"

/** Once per cycle. The wait is bounded; then a line of the log names the drives that have not confirmed. */
void shutdown_watch(gateway_t *self, uint64_t now_us);

/** As gateway_energized().
 *  @param is_answering only drives that answer */
uint32_t shutdown_energized(const gateway_t *self, bool is_answering);

#endif
