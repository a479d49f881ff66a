/* SPDX-License-Identifier: MIT
 * startup_denied.h - objects that no start-up list may write: they could give a drive torque before anybody has engaged, or
 * change the bus under heaved.
 */
#ifndef HEAVE_PLATFORM_STARTUP_DENIED_H
#define HEAVE_PLATFORM_STARTUP_DENIED_H

#include <stdint.h>

/** Why a list may not write this object (CiA 301, CiA 402; some makers' objects for node id and bit rate).
 *  @param vendor 1018h:01 of the drives, 0: not known
 *  @return the end of a sentence in the language of the program, such as "is the node id or the bit rate"; NULL: it may */
const char *config_startup_denied(uint16_t index, uint8_t sub, uint32_t value, uint32_t vendor);

#endif
