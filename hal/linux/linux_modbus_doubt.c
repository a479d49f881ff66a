/* SPDX-License-Identifier: MIT
 * linux_modbus_doubt.c - which answers on a serial line can be trusted; see linux_modbus_doubt.h.
 */
#include "linux_modbus_doubt.h"

#include <string.h>

bool linux_modbus_is_doubtful(const linux_modbus_doubt_t *self, uint8_t unit, modbus_function_t function, uint64_t now_us)
{
    const uint64_t since_us = self->unanswered_us[unit][function];
    return since_us != 0 && now_us - since_us < LINUX_MODBUS_LATE_US;
}

void linux_modbus_note_silence(linux_modbus_doubt_t *self, uint8_t unit, modbus_function_t function, uint64_t now_us)
{
    self->unanswered_us[unit][function] = now_us;
}

void linux_modbus_note_answer(linux_modbus_doubt_t *self, uint8_t unit)
{
    memset(self->unanswered_us[unit], 0, sizeof self->unanswered_us[unit]);
}

bool linux_modbus_find_probe(const linux_modbus_doubt_t *self, uint8_t unit, uint64_t now_us, modbus_function_t *function)
{
    static const modbus_function_t k_probes[] = {MODBUS_READ_HOLDING, MODBUS_READ_INPUT, MODBUS_READ_COILS,
                                                 MODBUS_READ_DISCRETE_INPUTS};
    for (size_t i = 0; i < sizeof k_probes / sizeof k_probes[0]; i++) {
        if (!linux_modbus_is_doubtful(self, unit, k_probes[i], now_us)) {
            *function = k_probes[i];
            return true;
        }
    }
    return false;
}
