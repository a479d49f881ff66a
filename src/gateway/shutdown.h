/* SPDX-License-Identifier: MIT
 * shutdown.h - the end of a shutdown: waits until the drives have confirmed that their torque is off. Private to src/gateway.
 */
#ifndef GATEWAY_SHUTDOWN_H
#define GATEWAY_SHUTDOWN_H

#include "heave/gateway.h"
#include "feedback.h"

/** Of this cycle. */
typedef struct {
    feedback_t feedback;
    bool is_down;        /**< the state is OFF, FAULT or ESTOP */
    bool is_disable_due; /**< the drives have not been told yet */
    bool is_bus_lost;    /**< a lost bus tells drives nothing: their own watch has to */
} shutdown_in_t;

/** Once per cycle. The wait is bounded; then a line of the log names the drives that have not confirmed. */
void shutdown_step(shutdown_t *self, const shutdown_in_t *in, hal_log_t log, uint64_t now_us);

/** True when it has ended: see gateway_is_finished(). */
bool shutdown_is_finished(const shutdown_t *self, feedback_t feedback);

#endif
