/* SPDX-License-Identifier: MIT
 * relay_output.h - writes the relays and the healthy pulse once per cycle. Private to src/gateway.
 */
#ifndef GATEWAY_RELAY_OUTPUT_H
#define GATEWAY_RELAY_OUTPUT_H

#include "heave/gateway.h"

/** Of this cycle. */
typedef struct {
    uint16_t wanted_mask;
    bool is_safe;     /**< wanted_mask is the safe mask, and no sender commands the relays */
    bool is_well;     /**< the healthy pulse may go on */
    bool was_unknown; /**< as relay_output_out_t.is_unknown of the last cycle */
} relay_output_in_t;

typedef struct {
    bool is_healthy; /**< the healthy pulse runs */
    bool is_unknown; /**< the relays cannot be written or read back */
    bool is_refused; /**< the bank did not take this cycle's mask */
} relay_output_out_t;

/** Applies the limits of time to the wanted mask, adds the healthy pulse and writes the relays if something has changed.
 *  Logs when the relays or the line of the pulse can no longer be written, and when they can again. */
relay_output_out_t relay_output_step(relay_output_t *self, const settings_t *settings, const gateway_io_t *io,
                                     const relay_output_in_t *in, uint64_t now_us);

#endif
