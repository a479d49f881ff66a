/* SPDX-License-Identifier: MIT
 * modbus_tap.h - between a driver and the simulated lines of its drives: replies are spoiled as they arrive, replies that nobody
 * waits for are slipped in, and what is asked and answered is shown.
 */
#ifndef MODBUS_TAP_H
#define MODBUS_TAP_H

#include "heave/drives.h"
#include "heave/hal/modbus.h"

/** What happens to the next reply of a slot. */
typedef enum {
    MODBUS_TAP_NOTHING,
    MODBUS_TAP_EXCEPTION, /**< with a code */
    MODBUS_TAP_TIMEOUT,
    MODBUS_TAP_DAMAGED,
    MODBUS_TAP_NO_LINK,
    MODBUS_TAP_COUNT, /**< another number of values */
    MODBUS_TAP_VALUE  /**< another value */
} modbus_tap_spoil_t;

#define MODBUS_TAP_SPOILS 7u

/** A spoiled reply. */
typedef struct {
    modbus_tap_spoil_t how;
    uint8_t at;       /**< MODBUS_TAP_VALUE: which; MODBUS_TAP_COUNT: how many; MODBUS_TAP_EXCEPTION: code */
    uint16_t value;   /**< MODBUS_TAP_VALUE */
    uint16_t replies; /**< in a row */
} modbus_tap_plan_t;

struct modbus_tap;

/** One line of a tap. */
typedef struct {
    struct modbus_tap *tap;
    hal_modbus_t inner;
    bool is_down;  /**< no link, whatever is asked */
    bool is_stuck; /**< no reply comes, until it is free again */
    modbus_tap_plan_t plan[HAL_MODBUS_SLOTS];
    modbus_result_t extra[HAL_MODBUS_SLOTS]; /**< given where nothing else waits */
    bool has_extra[HAL_MODBUS_SLOTS];
} modbus_tap_line_t;

/** A tap on all lines. */
typedef struct modbus_tap {
    modbus_tap_line_t line[DRIVES_MAX];
    void *watcher;
    void (*asked)(void *watcher, unsigned line, unsigned slot, const modbus_request_t *request);
    void (*answered)(void *watcher, unsigned line, unsigned slot, const modbus_result_t *result);
} modbus_tap_t;

/** The lines as the driver sees them; the watcher is told of what a line took, and of each reply that the driver gets. */
void modbus_tap_open(modbus_tap_t *self, const hal_modbus_t inner[DRIVES_MAX], hal_modbus_t outer[DRIVES_MAX]);

#endif
