/* SPDX-License-Identifier: MIT
 * table.h - a configuration and a file of frames as plain bytes: written on the machine that builds, read by the firmware.
 * Both are little-endian and lay plain data out alike where enumerations are as wide as int; sizes are compared all the same.
 */
#ifndef CORTEX_TABLE_H
#define CORTEX_TABLE_H

#include "heave/settings.h"
#include "record/frames_line.h"
#include "sim_drives.h"

#define TABLE_MAGIC 0x56414548u /* "HEAV" */

/** The file begins with it; lines, each followed by the bytes of its text, come after it. */
typedef struct {
    uint32_t magic;
    uint32_t bytes; /**< of this struct */
    settings_t settings;
    sim_drive_config_t axis[DRIVES_MAX];
    uint32_t axes;
    uint32_t lines;
} table_t;

/** A line; see frames_line_t. */
typedef struct {
    uint64_t t_us;
    uint32_t kind;
    uint32_t request;
    uint32_t drive;
    uint32_t state;
    uint32_t number;
    uint32_t length; /**< of the text that follows, which is filled up to a multiple of 8 bytes */
    hal_udp_peer_t from;
} table_line_t;

#endif
