/* SPDX-License-Identifier: MIT
 * linux_modbus.h - one Modbus line of Linux, TCP or serial, served by a thread of its own. Between it and the motion thread is a
 * bounded hand-over without locks: each slot holds its newest request and its newest result, and nothing queues behind them.
 * The link is made and made again in the background; requests end with HV_ERR_IO while there is none. On serial lines an answer
 * is only trusted where it can be no late one to an earlier question: after a question left unanswered, the unit is asked
 * something else first (a read of one register or coil), and a write is sent but reported as unanswered. The caller owns
 * linux_modbus_t, which must not move while open; nothing is allocated after open.
 */
#ifndef LINUX_MODBUS_H
#define LINUX_MODBUS_H

#include <pthread.h>

#include "linux_modbus_link.h"
#include "newest.h"

/** A request on its way to the worker and a result on its way back; private. */
typedef struct {
    newest_t asked;
    newest_t answered;
    modbus_request_t request[NEWEST_BUFFERS];
    modbus_result_t result[NEWEST_BUFFERS];
} linux_modbus_slot_t;

/** An open line; private. */
typedef struct {
    linux_modbus_slot_t slot[HAL_MODBUS_SLOTS];
    unsigned last;     /**< slot that was served last */
    uint32_t asked;    /**< requests taken, by the motion thread */
    uint32_t replaced; /**< of these, replaced before they were served */
    uint32_t served;   /**< by the worker */
    bool is_serial;
    bool is_open;
    uint8_t is_ending;
    int wake; /**< eventfd */
    pthread_t thread;
    linux_modbus_link_t link;
    char name[LINUX_MODBUS_NAME_SIZE];
    char text[LINUX_MODBUS_NAME_SIZE + 160];
} linux_modbus_t;

/** What a line has done and how it is. */
typedef struct {
    linux_modbus_trouble_t trouble;
    linux_modbus_counts_t count;
    uint32_t replaced; /**< requests that a newer one replaced before they were served */
    uint32_t waiting;  /**< requests that have not ended yet, at most one on the wire and one for each slot */
} linux_modbus_status_t;

/** Starts the worker, which makes the link. Before the loop starts: allocates.
 *  @param config copied
 *  @return HV_OK, also where there is no link yet; HV_ERR_ARG: the configuration, linux_modbus_text() says which figure;
 * HV_ERR_IO: the system refuses memory or a thread. */
hv_status_t linux_modbus_open(linux_modbus_t *self, const linux_modbus_config_t *config) HV_MUST_CHECK;

/** Lets the worker serve what waits, once each, and ends it. Takes up to a timeout for each slot that waits. Harmless on one that
 * is not open. */
void linux_modbus_close(linux_modbus_t *self);

/** How the line is. The thread that calls the ops. Never blocks. */
void linux_modbus_status(const linux_modbus_t *self, linux_modbus_status_t *out);

/** What is wrong and what helps, in the text of self; one thread at a time.
 *  @return "" where nothing is */
const char *linux_modbus_text(linux_modbus_t *self);

/** The line as hal/modbus.h wants it. */
hal_modbus_t linux_modbus_hal(linux_modbus_t *self);

#endif
