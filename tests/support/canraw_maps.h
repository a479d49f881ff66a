/* SPDX-License-Identifier: MIT
 * canraw_maps.h - maps of the two dialects of canraw_drives.h, as data.
 */
#ifndef CANRAW_MAPS_H
#define CANRAW_MAPS_H

#include "heave/canraw.h"

/** Plain drives: 2000 counts per mm, the speed field always 3000. */
static inline canraw_map_t canraw_maps_plain(void)
{
    canraw_map_t map = {
        .axes = DRIVES_MAX,
        .period_us = 2000,
        .query_every = 1,
        .offline_periods = 5,
        .speed_least = 3000,
        .setpoint = {8,
                     0x03,
                     2,
                     {0x01, 0x05},
                     {{CANRAW_POSITION, 2, 32, false, false, 0, 0, 0}, {CANRAW_SPEED, 6, 16, false, false, 0, 0, 0}},
                     0,
                     0},
        .command[CANRAW_HOME] = {8, 0xFF, 0, {0x01, 0x03, 0x01}, {{0}}, 0, 0},
        .position_query = {2, 0x03, 0, {0x00, 0x15}, {{0}}, 0, 0},
        .position_reply = {6, 0x00, 1, {0}, {{CANRAW_POSITION, 2, 32, true, false, 0, 0, 0}}, 0, 0},
        .homing_query = {2, 0x03, 0, {0x00, 0x12}, {{0}}, 0, 0},
        .homing_reply = {3, 0x00, 1, {0}, {{CANRAW_STATUS, 2, 8, false, false, 0, 0, 0}}, 0, 0},
        .homing_done = {0x01, 0xFF},
    };
    for (unsigned k = 0; k < DRIVES_MAX; k++) {
        map.axis[k] = (canraw_axis_map_t){.command_id = 0x601 + k,
                                          .setpoint_id = 0x601 + k,
                                          .reply_id = 0x581 + k,
                                          .scale = {20000, 10, 0},
                                          .speed = {0, 1, 0},
                                          .step_max_q32 = Q32_ONE,
                                          .following_max_q32 = q32_from_int(10)};
    }
    return map;
}

/** Rich drives: 10000/3 counts per mm, counting backwards from 4000000. */
static inline canraw_map_t canraw_maps_rich(void)
{
    canraw_map_t map = {
        .axes = DRIVES_MAX,
        .is_extended = true,
        .period_us = 2000,
        .query_every = 1,
        .offline_periods = 5,
        .setpoint = {5, 0x01, 1, {0x10}, {{CANRAW_POSITION, 1, 32, true, true, 0, 0, 0}}, 0, 0},
        .command = {[CANRAW_STOP] = {1, 0x01, 0, {0x22}, {{0}}, 0, 0},
                    [CANRAW_DISABLE] = {1, 0x01, 0, {0x21}, {{0}}, 0, 0},
                    [CANRAW_RESET] = {1, 0x01, 0, {0x23}, {{0}}, 0, 0},
                    [CANRAW_ENABLE] = {1, 0x01, 0, {0x20}, {{0}}, 0, 0},
                    [CANRAW_HOME] = {1, 0x01, 0, {0x24}, {{0}}, 0, 0}},
        .position_query = {1, 0x01, 0, {0x30}, {{0}}, 0, 0},
        .position_reply = {6,
                           0x01,
                           2,
                           {0x30},
                           {{CANRAW_STATUS, 1, 8, false, false, 0, 0, 0}, {CANRAW_POSITION, 2, 32, true, true, 0, 0, 0}},
                           0,
                           0},
        .enabled_when = {0x01, 0x01},
        .fault_when = {0x02, 0x02},
        .homing_done = {0x04, 0x04},
    };
    for (unsigned k = 0; k < DRIVES_MAX; k++) {
        map.axis[k] = (canraw_axis_map_t){.command_id = 0x18FF0100 + k,
                                          .setpoint_id = 0x18FF0100 + k,
                                          .reply_id = 0x18FF0200 + k,
                                          .scale = {-10000, 3, 4000000},
                                          .speed = {0, 1, 0},
                                          .step_max_q32 = Q32_ONE,
                                          .following_max_q32 = q32_from_int(10)};
    }
    return map;
}

/* Behind what there is: a counter, then a CRC-8. */
static inline void canraw_maps_seal(canraw_frame_t *frame)
{
    frame->field[frame->fields++] = (canraw_field_t){CANRAW_COUNTER, frame->length, 8, false, false, 0, 0, 0};
    frame->data[frame->length + 1u] = 0x1D;
    frame->field[frame->fields++] = (canraw_field_t){CANRAW_CRC8, (uint8_t)(frame->length + 1u), 8, false, false, 0, 0, 0};
    frame->length = (uint8_t)(frame->length + 2u);
}

/** Rich drives that seal their frames and want them sealed. */
static inline canraw_map_t canraw_maps_sealed(void)
{
    canraw_map_t map = canraw_maps_rich();
    canraw_maps_seal(&map.setpoint);
    for (unsigned i = 0; i < CANRAW_COMMANDS; i++) {
        canraw_maps_seal(&map.command[i]);
    }
    canraw_maps_seal(&map.position_query);
    canraw_maps_seal(&map.position_reply);
    return map;
}

#endif
