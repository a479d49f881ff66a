/* SPDX-License-Identifier: MIT
 * mutate_control.c - custom mutator for the control socket: lines that are requests or nearly, answers of the motion thread and
 * changes of state are put in between; the rest libFuzzer does.
 */
#include "mutate.h"

#include <string.h>

static const char *const k_lines[] = {
    "status\n",
    "engage\n",
    "hold\n",
    "resume\n",
    "park\n",
    "reset\n",
    "shutdown\n",
    "dump\n",
    "watch\n",
    "watch 1\n",
    "watch 50\n",
    "watch 51\n",
    "watch 0\n",
    "watch  5\n",
    "watchdog\n",
    "service\n",
    "service-off\n",
    "tick\n",
    "counts\n",
    "torque 3 on\n",
    "torque all off\n",
    "jog 3 -2.5 1\n",
    "jog pitch 1e9 18446744073709551615\n",
    "home all 1\n",
    "relay 255 1\n",
    "beat 1 1 1\n",
    "release 4294967295\n",
    "intensity 50\n",
    "intensity 101\n",
    "intensity 1000\n",
    "intensity -1\n",
    "intensity\n",
    "Engage\n",
    "engage \n",
    "engage\r\n",
    "\n",
    "engage\nhold\n",
    "statu",
    "s\n",
    "\r\n",
    "0123456789012345678901234567890123456789012345678901234567890123",
};

size_t LLVMFuzzerCustomMutator(uint8_t *data, size_t size, size_t max_size, unsigned seed)
{
    mutate_t random = mutate_start(seed);
    uint8_t record[128] = {0};
    size_t at = 0;
    if (mutate_below(&random, 4) == 0) {
        return LLVMFuzzerMutate(data, size, max_size);
    }
    for (size_t skip = mutate_below(&random, 24); skip > 0 && at + 3 <= size; skip--) { /* behind some whole records */
        at += 3 + (data[at] % 4 < 2 ? data[at + 2] : 0u);
    }
    at = at < size ? at : size;
    record[0] = (uint8_t)mutate_below(&random, 256);
    record[1] = (uint8_t)mutate_below(&random, 256);
    record[2] = (uint8_t)mutate_below(&random, 256);
    size_t length = 0;
    if (mutate_below(&random, 2) == 0) {
        const char *line = k_lines[mutate_below(&random, sizeof k_lines / sizeof k_lines[0])];
        length = strlen(line);
        record[0] &= 0x80;
        record[2] = (uint8_t)length;
        memcpy(record + 3, line, length);
    } else {
        record[0] = (uint8_t)((record[0] & 0x80) | 2u | (record[0] & 1u));
    }
    return mutate_insert(data, size, max_size, at, record, 3 + length);
}
