/* SPDX-License-Identifier: MIT
 * modbus.h - contract of one Modbus line (TCP or RTU) with a worker: submit a transaction, poll its result later.
 * One thread (the motion thread) calls the ops and never waits; the worker belongs to the backend.
 * The line has slots. Each holds the newest transaction of one purpose (set-point of axis 3, status of axis 3, relays).
 */
#ifndef HEAVE_HAL_MODBUS_H
#define HEAVE_HAL_MODBUS_H

#include "heave/status.h"

/** Independent transactions a line keeps, numbered from 0. */
#define HAL_MODBUS_SLOTS 32u

/** Most registers or coils of one transaction. */
#define HAL_MODBUS_VALUES_MAX 64u

/** Unit id of a broadcast. Broadcasts are writes; no unit answers them. */
#define HAL_MODBUS_BROADCAST 0u

/** Function codes. */
typedef enum {
    MODBUS_READ_COILS = 1,
    MODBUS_READ_DISCRETE_INPUTS = 2,
    MODBUS_READ_HOLDING = 3,
    MODBUS_READ_INPUT = 4,
    MODBUS_WRITE_COIL = 5,
    MODBUS_WRITE_REGISTER = 6,
    MODBUS_WRITE_COILS = 15,
    MODBUS_WRITE_REGISTERS = 16
} modbus_function_t;

/** A transaction. */
typedef struct {
    modbus_function_t function;
    uint8_t unit;                          /**< [1, 247], 255 on TCP, or HAL_MODBUS_BROADCAST for a write */
    uint16_t address;                      /**< of the first register or coil, from 0 */
    uint8_t count;                         /**< registers or coils, [1, HAL_MODBUS_VALUES_MAX]; 1 for the single writes */
    uint32_t tag;                          /**< the caller's; comes back in the result */
    uint16_t value[HAL_MODBUS_VALUES_MAX]; /**< writes: registers, or coils as 0 / 1 */
} modbus_request_t;

/** True for the functions that write. */
static inline bool modbus_is_write(modbus_function_t function)
{
    return function == MODBUS_WRITE_COIL || function == MODBUS_WRITE_REGISTER || function == MODBUS_WRITE_COILS ||
           function == MODBUS_WRITE_REGISTERS;
}

/** True for a valid request, as submit requires it. Unit 255 is valid on TCP only, which this does not check. */
static inline bool modbus_is_valid(const modbus_request_t *request)
{
    const bool is_write = modbus_is_write(request->function);
    const bool is_read = request->function >= MODBUS_READ_COILS && request->function <= MODBUS_READ_INPUT;
    const bool is_single = request->function == MODBUS_WRITE_COIL || request->function == MODBUS_WRITE_REGISTER;
    return (is_read || is_write) && request->count >= 1 && request->count <= (is_single ? 1u : HAL_MODBUS_VALUES_MAX) &&
           (request->unit <= 247 || request->unit == 255) && (request->unit != HAL_MODBUS_BROADCAST || is_write);
}

/** Result of a transaction. */
typedef struct {
    hv_status_t
        status; /**< HV_OK; HV_ERR_TIMEOUT: no answer in time (a write may have acted); HV_ERR_FORMAT: the answer was damaged or
                   not to this question; HV_ERR_STATE: the device answered with an exception; HV_ERR_IO: no link */
    uint8_t exception;                     /**< the device's exception code with HV_ERR_STATE, else 0 */
    uint8_t count;                         /**< values read, 0 for writes and errors */
    uint32_t tag;                          /**< of the request */
    uint64_t done_us;                      /**< when it ended, on the time line of hal_clock_now_us() */
    uint16_t value[HAL_MODBUS_VALUES_MAX]; /**< registers, or coils as 0 / 1: what was read, or what was written, with HV_OK */
} modbus_result_t;

/** Every op is mandatory. */
typedef struct {
    hv_status_t (*submit)(void *ctx, unsigned slot, const modbus_request_t *request);
    hv_status_t (*poll)(void *ctx, unsigned slot, modbus_result_t *result);
} hal_modbus_ops_t;

/** Passed by value; ctx belongs to the backend and lives until its close. */
typedef struct {
    const hal_modbus_ops_t *ops;
    void *ctx;
} hal_modbus_t;

/** True if every mandatory op is set. If not, refuse to start. */
static inline bool hal_modbus_valid(hal_modbus_t modbus)
{
    return modbus.ops != NULL && modbus.ops->submit != NULL && modbus.ops->poll != NULL;
}

/** Puts a transaction into a slot. The newest wins: it replaces one that still waits, which then gets no result. A transaction
 * that is already on the wire ends first and gets its result. Waiting slots are served in turn, so that none starves. Never
 * blocks
 *  (<= 20 us).
 *  @param request the caller's, copied
 *  @return HV_OK; HV_ERR_ARG: slot, function, unit or count out of range, nothing changes. */
static inline HV_MUST_CHECK hv_status_t hal_modbus_submit(hal_modbus_t modbus, unsigned slot, const modbus_request_t *request)
{
    return modbus.ops->submit(modbus.ctx, slot, request);
}

/** Returns the newest result of a slot, once; an older one that was not polled is lost. A transaction ends with the backend's
 *  timeout at the latest; no result for much longer means that the worker is stuck. The backend restores the link by itself. It
 *  never repeats a transaction by itself, and never accepts a late answer for a later transaction. Never blocks (<= 20 us).
 *  @param result out: unchanged on error
 *  @return HV_OK; HV_ERR_AGAIN: nothing new; HV_ERR_ARG: slot out of range. */
static inline HV_MUST_CHECK hv_status_t hal_modbus_poll(hal_modbus_t modbus, unsigned slot, modbus_result_t *result)
{
    return modbus.ops->poll(modbus.ctx, slot, result);
}

#endif
