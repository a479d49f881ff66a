/* SPDX-License-Identifier: MIT
 * modbus_maps.h - maps of the two dialects of modbus_drives.h, as data.
 */
#ifndef MODBUS_MAPS_H
#define MODBUS_MAPS_H

#include "heave/modbus_drive.h"

#define MODBUS_MAPS_ONE(at, value)                                                                                               \
    {                                                                                                                            \
        1,                                                                                                                       \
        {                                                                                                                        \
            {                                                                                                                    \
                (at), 1, 0, 0, {(value)},                                                                                        \
                {                                                                                                                \
                    {                                                                                                            \
                        0                                                                                                        \
                    }                                                                                                            \
                }                                                                                                                \
            }                                                                                                                    \
        }                                                                                                                        \
    }

static inline void modbus_maps_axes(modbus_drive_map_t *map, bool is_shared, counts_scale_t scale, counts_scale_t speed)
{
    map->axes = DRIVES_MAX;
    map->retries = 2;
    map->period_us = 2000;
    map->expected_us = 10000;
    map->feedback_timeout_us = 200000;
    for (unsigned k = 0; k < DRIVES_MAX; k++) {
        map->axis[k] = (modbus_drive_axis_map_t){.line = (uint8_t)(is_shared ? 0 : k),
                                                 .unit = (uint8_t)(is_shared ? k + 1u : 1u),
                                                 .scale = scale,
                                                 .speed = speed,
                                                 .step_max_q32 = Q32_ONE,
                                                 .speed_max_q32 = q32_from_int(1000),
                                                 .carry_q32 = q32_from_int(4),
                                                 .following_max_q32 = q32_from_int(10)};
    }
}

/** Wide: 10000/3 counts per mm, counting backwards from 4000000; start-up of a watchdog and a kind. */
static inline modbus_drive_map_t modbus_maps_wide(bool is_shared)
{
    modbus_drive_map_t map = {
        .setpoint =
            {1, {{10, 3, 2, 0, {0}, {{MODBUS_DRIVE_POSITION, 0, 2, true, false}, {MODBUS_DRIVE_SPEED, 2, 1, false, false}}}}},
        .feedback = {1,
                     {{1,
                       4,
                       3,
                       0,
                       {0},
                       {{MODBUS_DRIVE_STATUS, 0, 1, false, false},
                        {MODBUS_DRIVE_POSITION, 1, 2, true, false},
                        {MODBUS_DRIVE_ALARM, 3, 1, false, false}}}}},
        .command = {[MODBUS_DRIVE_STOP] = MODBUS_MAPS_ONE(0, 2),
                    [MODBUS_DRIVE_DISABLE] = MODBUS_MAPS_ONE(0, 0),
                    [MODBUS_DRIVE_RESET] = MODBUS_MAPS_ONE(0, 8),
                    [MODBUS_DRIVE_ENABLE] = MODBUS_MAPS_ONE(0, 1),
                    [MODBUS_DRIVE_HOME] = MODBUS_MAPS_ONE(0, 4)},
        .enabled_when = {1, 1},
        .fault_when = {2, 2},
        .homing_done = {4, 4},
        .items = 2,
        .item = {{21, 0x0203, false, true}, {20, 50, true, true}},
    };
    modbus_maps_axes(&map, is_shared, (counts_scale_t){-10000, 3, 4000000}, (counts_scale_t){10, 1, 0});
    return map;
}

/** Small: 100 counts per mm, in two transactions of function 6 and one read of input registers. */
static inline modbus_drive_map_t modbus_maps_small(bool is_shared)
{
    modbus_drive_map_t map = {
        .is_input = true,
        .is_single = true,
        .setpoint = {1, {{100, 1, 1, 0, {0}, {{MODBUS_DRIVE_POSITION, 0, 1, true, false}}}}},
        .feedback =
            {1, {{110, 2, 2, 0, {0}, {{MODBUS_DRIVE_POSITION, 0, 1, true, false}, {MODBUS_DRIVE_STATUS, 1, 1, false, false}}}}},
        .command = {[MODBUS_DRIVE_STOP] = MODBUS_MAPS_ONE(102, 1),
                    [MODBUS_DRIVE_DISABLE] = MODBUS_MAPS_ONE(101, 0),
                    [MODBUS_DRIVE_RESET] = MODBUS_MAPS_ONE(103, 1),
                    [MODBUS_DRIVE_ENABLE] = MODBUS_MAPS_ONE(101, 1)},
        .enabled_when = {8, 8},
        .fault_when = {128, 128},
    };
    modbus_maps_axes(&map, is_shared, (counts_scale_t){100, 1, 0}, (counts_scale_t){0, 1, 0});
    return map;
}

#endif
