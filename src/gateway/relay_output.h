/* SPDX-License-Identifier: MIT
 * relay_output.h - writes the relays and the healthy pulse once per cycle. Private to src/gateway.
 */
#ifndef GATEWAY_RELAY_OUTPUT_H
#define GATEWAY_RELAY_OUTPUT_H

#include "heave/gateway.h"

/** Of this cycle. */
typedef struct {
    uint16_t wanted_mask;
    bool is_safe; /**< wanted_mask is the safe mask, and no sender commands the relays */
    bool is_well; /**< the healthy pulse may go on */
} relay_output_in_t;

/** Applies the limits of time to the wanted mask, adds the healthy pulse and writes the relays if something has changed.
 *  Logs when the relays or the line of the pulse can no longer be written, and when they can again.
 *  @return false: the bank did not take this cycle's mask */
bool relay_output_step(relay_output_t *self, const settings_t *settings, const gateway_io_t *io, const relay_output_in_t *in,
                       uint64_t now_us);

#endif
