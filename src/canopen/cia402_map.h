/* SPDX-License-Identifier: MIT
 * cia402_map.h - which PDOs the drives have, and what is in them: behind cia402_pdo() of cia402.h, for the driver itself.
 */
#ifndef CIA402_MAP_H
#define CIA402_MAP_H

#include "heave/cia402.h"

#define CIA402_COB_TPDO  0x180u /* of the first; the next ones are CIA402_COB_NEXT further */
#define CIA402_COB_RPDO  0x200u
#define CIA402_COB_NEXT  0x100u
#define CIA402_COB_RPDOS 4u /* of each node, as CiA 301 numbers them */

/* What is mapped: index << 16 | sub-index << 8 | bits. */
#define CIA402_PDO_BYTES         8u
#define CIA402_ENTRY_CONTROLWORD 0x60400010u
#define CIA402_ENTRY_MODE        0x60600008u
#define CIA402_ENTRY_TARGET      0x607A0020u
#define CIA402_ENTRY_TARGET_IP   0x60C10120u
#define CIA402_ENTRY_STATUSWORD  0x60410010u
#define CIA402_ENTRY_ACTUAL      0x60640020u
#define CIA402_ENTRY_MODE_SHOWN  0x60610008u
#define CIA402_ENTRY_TORQUE      0x60770010u
#define CIA402_ENTRY_LAG         0x60F40020u
#define CIA402_ENTRY_INPUTS      0x60FD0020u
#define CIA402_BITS_OF(entry)    ((entry)&0xFFu)
#define CIA402_BYTES_OF(entry)   ((uint8_t)(CIA402_BITS_OF(entry) / 8u))

/* Objects of the channels. */
#define CIA402_OBJECTS     0x6000u
#define CIA402_OBJECTS_END 0x8000u
#define CIA402_CHANNEL     0x800u

/** Channel of an entry; 0 where it is of none. */
static inline unsigned cia402_map_channel(uint32_t entry)
{
    const uint32_t index = entry >> 16;
    return index >= CIA402_OBJECTS && index < CIA402_OBJECTS_END ? (index - CIA402_OBJECTS) / CIA402_CHANNEL : 0;
}

/** An entry as channel 0 has it. */
static inline uint32_t cia402_map_plain(uint32_t entry)
{
    return entry - (cia402_map_channel(entry) * CIA402_CHANNEL << 16);
}

/** True where the PDOs are of the whole node: they have objects of several channels. */
bool cia402_map_is_shared(const cia402_maps_t *maps);

/** PDOs of a direction that each channel (node) has. */
unsigned cia402_map_count(const cia402_maps_t *maps);

/** True where the answers tell the mode of operation. */
bool cia402_map_has_mode(const cia402_config_t *config);

#endif
