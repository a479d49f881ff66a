/* SPDX-License-Identifier: MIT
 * linux_modbus_doubt.h - which answers on a serial line can be trusted. RTU numbers nothing: an answer that comes too late looks
 * like that to the next question with the same function. So a function that a device has left unanswered stays in doubt until the
 * device answers another one (devices answer in order: then the old answer is not to come any more), or long enough has passed.
 * Plain data; one thread. Time is an argument.
 */
#ifndef LINUX_MODBUS_DOUBT_H
#define LINUX_MODBUS_DOUBT_H

#include "heave/hal/modbus.h"

/** How late an answer may come, us. Devices are quicker; this machine's own handling of serial input may not be, when it is
 * overloaded. */
#define LINUX_MODBUS_LATE_US 5000000u

/** Unit ids, and functions as bits. */
#define LINUX_MODBUS_UNITS     248u
#define LINUX_MODBUS_FUNCTIONS 17u

/** When each question was left unanswered; private. */
typedef struct {
    uint64_t unanswered_us[LINUX_MODBUS_UNITS][LINUX_MODBUS_FUNCTIONS]; /**< 0 = never */
} linux_modbus_doubt_t;

/** True where an answer of the unit to this function may be one to an earlier question. */
bool linux_modbus_is_doubtful(const linux_modbus_doubt_t *self, uint8_t unit, modbus_function_t function, uint64_t now_us);

/** A question ended without a good answer at now_us > 0. */
void linux_modbus_note_silence(linux_modbus_doubt_t *self, uint8_t unit, modbus_function_t function, uint64_t now_us);

/** A question was answered that was not in doubt when it was asked: whatever the unit owed is not to come any more. */
void linux_modbus_note_answer(linux_modbus_doubt_t *self, uint8_t unit);

/** A reading function to ask the unit for the sake of an answer.
 *  @return false: every one is in doubt, the unit has to be left alone */
bool linux_modbus_find_probe(const linux_modbus_doubt_t *self, uint8_t unit, uint64_t now_us, modbus_function_t *function);

#endif
