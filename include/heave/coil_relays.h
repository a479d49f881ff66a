/* SPDX-License-Identifier: MIT
 * coil_relays.h - a bank of relays on the coils of a Modbus device, such as the common boards with 8 or 16 relays. Writes all
 * relays in one transaction (write multiple coils), reads them back, and writes them again if the board has lost them. Such a
 * board keeps its relays when this program or the line fails, unless it has a watchdog: do not connect anything that must not
 * stay closed. The caller owns coil_relays_t; one thread. Time is counted in calls of read_back, one per cycle.
 */
#ifndef HEAVE_COIL_RELAYS_H
#define HEAVE_COIL_RELAYS_H

#include "heave/hal/modbus.h"
#include "heave/hal/relays.h"

/** Transactions in a row that may fail before the relays count as unknown. */
#define COIL_RELAYS_TRIES 3u

/** A bank. */
typedef struct {
    hal_modbus_t line;
    unsigned slot;       /**< of the line; nobody else uses it */
    uint8_t unit;        /**< of the board, see modbus_request_t */
    uint16_t first_coil; /**< coil of relay 1, from 0; the others follow */
    uint8_t count;       /**< [0, HAL_RELAYS_MAX] */
    bool is_active_low;  /**< a coil that is off closes its relay */
    uint16_t start_mask; /**< written at the start; bits above count are ignored */
    uint32_t look_calls; /**< calls of read_back without a write after which the board is read; also the limit for one
                            transaction; > 0 */
} coil_relays_config_t;

/** An open bank; private. */
typedef struct {
    coil_relays_config_t config;
    uint16_t wanted;
    uint16_t reported; /**< what the board said or confirmed last */
    bool is_reported;
    bool is_asking;    /**< the newest transaction has not ended */
    bool is_written;   /**< wanted has been confirmed */
    uint32_t tag;      /**< of the newest transaction */
    uint32_t failures; /**< in a row */
    uint32_t calls;    /**< of read_back since the last transaction began or ended */
} coil_relays_t;

/** Starts, and submits a write of start_mask.
 *  @param config copied
 *  @return HV_OK; HV_ERR_RANGE: a value of the configuration is out of range, or the line refuses the request */
hv_status_t coil_relays_init(coil_relays_t *self, const coil_relays_config_t *config) HV_MUST_CHECK;

/** The implementation of hal/relays.h. write submits the request to the line at once. read_back completes it and repeats what
 *  failed; call it every cycle. */
hal_relays_t coil_relays_hal(coil_relays_t *self);

#endif
