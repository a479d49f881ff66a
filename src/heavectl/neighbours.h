/* SPDX-License-Identifier: MIT
 * neighbours.h - other heaved on this machine, and whether they have a bus already.
 */
#ifndef HEAVE_HEAVECTL_NEIGHBOURS_H
#define HEAVE_HEAVECTL_NEIGHBOURS_H

#include <stdbool.h>
#include <stddef.h>
#include <sys/types.h>

/** Looks through the processes of this machine.
 *  @param driver, bus as [drives] driver, and the interface, device or hosts of the drives
 *  @param text out: a sentence about the one that has it
 *  @return true: one has that bus, or its configuration cannot be read */
bool neighbours_have(const char *driver, const char *bus, char *text, size_t size);

#endif
