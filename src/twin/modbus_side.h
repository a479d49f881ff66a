/* SPDX-License-Identifier: MIT
 * modbus_side.h - all that answers on Modbus: the drives of a configuration and its board of relays, and what they answer to the
 * bytes of a question. Knows no sockets.
 */
#ifndef HEAVE_TWIN_MODBUS_SIDE_H
#define HEAVE_TWIN_MODBUS_SIDE_H

#include "config/config.h"
#include "twin/register_drive.h"

#define MODBUS_BOARD_LINE DRIVES_MAX /* the board has a line to itself, behind those of the drives */
#define MODBUS_LINES_MAX  (DRIVES_MAX + 1u)
#define MODBUS_COILS_MAX  256u
#define MODBUS_PDU_MAX    253u

/** A board of relays. */
typedef struct {
    bool is_there; /**< the configuration has one */
    bool is_silent;
    uint8_t unit;
    bool coil[MODBUS_COILS_MAX];
} modbus_board_t;

/** Who answers on Modbus. */
typedef struct {
    unsigned drives; /**< 0: they are on another bus */
    uint8_t lines;   /**< of drives */
    modbus_drive_map_t map;
    register_drive_t drive[DRIVES_MAX];
    modbus_board_t board;
    bool is_cable_out; /**< nothing passes, on any line */
    bool is_unplugged; /**< adapters and hosts are gone */
} modbus_side_t;

/** What is done to an answer on its way. */
typedef struct {
    uint64_t late_us;
    bool is_half, is_damaged;
} modbus_way_t;

/** Takes what the configuration has; the drives get their motors from the caller. */
void modbus_side_init(modbus_side_t *self, const config_t *config);

/** A question to a unit of a line; 0 is all of them.
 *  @param answer at least MODBUS_PDU_MAX bytes
 *  @return bytes of the answer; 0: nobody answers */
unsigned modbus_side_ask(modbus_side_t *self, unsigned line, uint8_t unit, const uint8_t *question, unsigned length,
                         uint64_t now_us, uint8_t *answer, modbus_way_t *way);

#endif
