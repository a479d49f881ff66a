/* SPDX-License-Identifier: MIT
 * linux_modbus_request.c - a request as libmodbus takes it; see linux_modbus_request.h.
 */
#include "linux_modbus_request.h"

#include <errno.h>
#include <string.h>

static int read_bits(modbus_t *modbus, const modbus_request_t *request, uint16_t *value)
{
    uint8_t bit[HAL_MODBUS_VALUES_MAX];
    const int got = request->function == MODBUS_READ_COILS
                        ? modbus_read_bits(modbus, request->address, request->count, bit)
                        : modbus_read_input_bits(modbus, request->address, request->count, bit);
    for (unsigned i = 0; got >= 0 && i < request->count; i++) {
        value[i] = bit[i];
    }
    return got;
}

static int write_bits(modbus_t *modbus, const modbus_request_t *request)
{
    uint8_t bit[HAL_MODBUS_VALUES_MAX];
    for (unsigned i = 0; i < request->count; i++) {
        bit[i] = request->value[i] != 0;
    }
    return modbus_write_bits(modbus, request->address, request->count, bit);
}

int linux_modbus_request_ask(modbus_t *modbus, const modbus_request_t *request, uint16_t *value)
{
    int got = -1;
    errno = EINVAL; /* of a function that there is not */
    switch (request->function) {
    case MODBUS_READ_COILS:
    case MODBUS_READ_DISCRETE_INPUTS:
        got = read_bits(modbus, request, value);
        break;
    case MODBUS_READ_HOLDING:
        got = modbus_read_registers(modbus, request->address, request->count, value);
        break;
    case MODBUS_READ_INPUT:
        got = modbus_read_input_registers(modbus, request->address, request->count, value);
        break;
    case MODBUS_WRITE_COIL:
        got = modbus_write_bit(modbus, request->address, request->value[0] != 0);
        break;
    case MODBUS_WRITE_REGISTER:
        got = modbus_write_register(modbus, request->address, request->value[0]);
        break;
    case MODBUS_WRITE_COILS:
        got = write_bits(modbus, request);
        break;
    case MODBUS_WRITE_REGISTERS:
        got = modbus_write_registers(modbus, request->address, request->count, request->value);
        break;
    }
    return got < 0 ? errno : 0;
}

static size_t pack_bits(uint8_t *to, const modbus_request_t *request)
{
    const size_t bytes = (request->count + 7u) / 8u;
    memset(to, 0, bytes);
    for (unsigned i = 0; i < request->count; i++) {
        to[i / 8] = (uint8_t)(to[i / 8] | (request->value[i] != 0) << i % 8);
    }
    return bytes;
}

static size_t pack_registers(uint8_t *to, const modbus_request_t *request)
{
    for (unsigned i = 0; i < request->count; i++) {
        to[2 * i] = (uint8_t)(request->value[i] >> 8);
        to[2 * i + 1] = (uint8_t)request->value[i];
    }
    return 2u * request->count;
}

size_t linux_modbus_request_pack(uint8_t *to, const modbus_request_t *request)
{
    const bool is_coil = request->function == MODBUS_WRITE_COIL;
    const uint8_t head[] = {request->unit, (uint8_t)request->function, (uint8_t)(request->address >> 8),
                            (uint8_t)request->address};
    memcpy(to, head, sizeof head);
    to += sizeof head;
    if (is_coil || request->function == MODBUS_WRITE_REGISTER) {
        const unsigned value = !is_coil ? request->value[0] : request->value[0] != 0 ? 0xFF00u : 0u;
        to[0] = (uint8_t)(value >> 8);
        to[1] = (uint8_t)value;
        return sizeof head + 2;
    }
    const size_t bytes = request->function == MODBUS_WRITE_COILS ? pack_bits(to + 3, request) : pack_registers(to + 3, request);
    to[0] = 0;
    to[1] = request->count;
    to[2] = (uint8_t)bytes;
    return sizeof head + 3 + bytes;
}
