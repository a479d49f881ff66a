/* SPDX-License-Identifier: MIT
 * twin_faults.h - what can be made to go wrong, by name: one line each, from the command line, a script or the socket.
 */
#ifndef HEAVE_TWIN_TWIN_FAULTS_H
#define HEAVE_TWIN_TWIN_FAULTS_H

#include "twin/twin.h"

#define FAULT_WHY_MAX 240u
#define FAULT_NUMBERS 2u

/** What a configuration has that can fail. */
typedef struct {
    twin_drives_t kind;
    bool has_board;       /**< of relays on Modbus */
    bool has_adapter;     /**< the bus is behind a serial CAN adapter */
    const lines_t *lines; /**< NULL = no GPIO lines */
} fault_machine_t;

/** A line that was understood. */
typedef struct {
    unsigned row;
    uint32_t drives; /**< bit k: drive k + 1 */
    uint32_t object; /**< index << 8 | sub */
    double number[FAULT_NUMBERS];
} fault_t;

/** What a name does to drive k. */
typedef void (*fault_act_t)(twin_t *twin, unsigned k, const fault_t *fault, uint64_t now_us);

/** Head of a function of this type; few need all. */
#define ACT(name)                                                                                                                \
    static void name(twin_t *twin, unsigned k, const fault_t *fault __attribute__((unused)),                                     \
                     uint64_t now_us __attribute__((unused)))

/** Reads a line.
 *  @param drives how many the configuration has
 *  @param why    what is wrong and what would be right, where false is returned */
bool fault_read(fault_t *self, const char *line, unsigned drives, char why[FAULT_WHY_MAX]);

/** Makes it so. Returns false where the system does not let it, and why. */
bool fault_do(const fault_t *self, twin_t *twin, uint64_t now_us, char why[FAULT_WHY_MAX]);

/** Why this configuration has no such fault.
 *  @return true where it has; else why says so */
bool fault_suits(const fault_t *self, const fault_machine_t *machine, char why[FAULT_WHY_MAX]);

/** Row i of the table of names, for a help text; false behind the last one. */
bool fault_describe(unsigned i, const char **name, const char **arguments, const char **help);

#endif
