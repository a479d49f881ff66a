/* SPDX-License-Identifier: MIT
 * sim_modbus.h - a Modbus line in memory: the worker, devices with registers and coils, and a fault plan.
 * Transactions move in sim_modbus_step() only. The caller owns line and devices; one thread.
 */
#ifndef SIM_MODBUS_H
#define SIM_MODBUS_H

#include "heave/hal/modbus.h"

/** Registers and coils of a device, addresses 0 to SIM_MODBUS_VALUES - 1; above: exception 2. */
#define SIM_MODBUS_VALUES 128u

/** A device; a test reads and writes it as it likes. */
typedef struct sim_modbus_device {
    /** Answers in the place of the values below; NULL: they do. A result that it leaves as it is is a timeout. */
    void (*answer)(void *ctx, const struct sim_modbus_device *device, const modbus_request_t *request, modbus_result_t *result);
    void *ctx;
    uint8_t unit; /**< [1, 247] or 255 */
    uint16_t holding[SIM_MODBUS_VALUES];
    uint16_t input[SIM_MODBUS_VALUES];
    bool coil[SIM_MODBUS_VALUES];
    bool discrete[SIM_MODBUS_VALUES];
} sim_modbus_device_t;

/** What goes wrong with a transaction. */
typedef enum {
    SIM_MODBUS_EXCEPTION, /**< the device answers with exception `code` and does nothing */
    SIM_MODBUS_SILENT,    /**< the device does nothing and does not answer */
    SIM_MODBUS_LATE,      /**< the device acts, its answer comes after the timeout */
    SIM_MODBUS_DAMAGED,   /**< the device acts, its answer is damaged on the way */
    SIM_MODBUS_NO_LINK    /**< there is no link */
} sim_modbus_fault_kind_t;

/** One entry of a plan. */
typedef struct {
    sim_modbus_fault_kind_t kind;
    uint32_t at;  /**< number of the transaction on this line, from 1 */
    uint8_t code; /**< SIM_MODBUS_EXCEPTION only */
} sim_modbus_fault_t;

/** One slot; private. */
typedef struct {
    modbus_request_t request;
    modbus_result_t result;
    bool is_waiting;
    bool has_result;
} sim_modbus_slot_t;

/** A line; private but for the counters. */
typedef struct {
    sim_modbus_device_t *device;
    uint32_t devices;
    const sim_modbus_fault_t *plan;
    uint32_t planned;
    uint32_t transaction_us;
    uint32_t timeout_us;
    sim_modbus_slot_t slot[HAL_MODBUS_SLOTS];
    modbus_result_t result; /**< of the transaction on the wire, from done_us on */
    unsigned on_wire;       /**< its slot */
    bool is_busy;
    uint64_t now_us;
    uint64_t done_us;
    uint32_t transactions; /**< started so far */
    uint32_t replaced;     /**< requests that a newer one replaced before they started */
} sim_modbus_t;

/** Starts idle.
 *  @param device         kept; the devices on the line
 *  @param transaction_us how long a good transaction takes; 0 = no time
 *  @param timeout_us     how long the worker waits for an answer, at least transaction_us
 *  @param plan           kept; NULL where planned is 0 */
void sim_modbus_init(sim_modbus_t *self, sim_modbus_device_t *device, uint32_t devices, uint32_t transaction_us,
                     uint32_t timeout_us, const sim_modbus_fault_t *plan, uint32_t planned);

/** Lets the worker work until now_us. */
void sim_modbus_step(sim_modbus_t *self, uint64_t now_us);

/** The line as hal/modbus.h wants it. */
hal_modbus_t sim_modbus_hal(sim_modbus_t *self);

#endif
