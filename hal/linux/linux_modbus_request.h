/* SPDX-License-Identifier: MIT
 * linux_modbus_request.h - a request as libmodbus takes it: the call that asks it, and the frame of a broadcast, for which
 * libmodbus would wait for an answer. For the worker thread of a line; allocates nothing.
 */
#ifndef LINUX_MODBUS_REQUEST_H
#define LINUX_MODBUS_REQUEST_H

#include <modbus.h>

#include "heave/hal/modbus.h"

#define LINUX_MODBUS_FRAME_MAX 256u /**< bytes of a frame on a serial line */

/** Asks, and waits for the answer. libmodbus checks that it is one to this question.
 *  @param value takes what is read
 *  @return 0, or an errno, also of those that libmodbus adds */
int linux_modbus_request_ask(modbus_t *modbus, const modbus_request_t *request, uint16_t *value);

/** Packs a request that writes: unit, function, address and what follows it, without check bytes.
 *  @param to takes up to LINUX_MODBUS_FRAME_MAX bytes
 *  @return bytes */
size_t linux_modbus_request_pack(uint8_t *to, const modbus_request_t *request);

#endif
