/* SPDX-License-Identifier: MIT
 * platform.c - config/hexapod-cia402.ini as constant tables. gateway_init() and cia402_init() refuse what is out of range.
 */
#include "platform.h"

#define Q16(n) ((q16_t)((n)*Q16_ONE))                  /* whole mm, deg */
#define UM(um) ((q16_t)((int64_t)(um)*Q16_ONE / 1000)) /* thousandths */
#define JOINT(x_um, y_um)                                                                                                        \
    {                                                                                                                            \
        UM(x_um), UM(y_um), 0                                                                                                    \
    }

#define TURNING(limit_mdeg)                                                                                                      \
    {                                                                                                                            \
        .sign = 1, .scale_q16 = Q16_ONE, .min_q16 = -UM(limit_mdeg), .max_q16 = UM(limit_mdeg), .speed_q16 = Q16(30),            \
        .accel_q16 = Q16(250), .jerk = 3000                                                                                      \
    }
#define SHIFTING(limit_mm)                                                                                                       \
    {                                                                                                                            \
        .sign = 1, .scale_q16 = Q16_ONE, .min_q16 = -Q16(limit_mm), .max_q16 = Q16(limit_mm), .speed_q16 = Q16(400),             \
        .accel_q16 = Q16(3000), .jerk = 40000                                                                                    \
    }

const settings_t k_platform = {
    .cycle_us = 1000,
    .engage = ENGAGE_MANUAL,
    .geometry =
        {
            .kind = KIN_HEXAPOD,
            .base_mm_q16 = {JOINT(1089300, -153090), JOINT(1089300, 153090), JOINT(-412067, 1019900), JOINT(-677228, 866812),
                            JOINT(-677228, -866812), JOINT(-412067, -1019900)},
            .plate_mm_q16 = {JOINT(566388, -699431), JOINT(566388, 699431), JOINT(322531, 840222), JOINT(-888920, 140791),
                             JOINT(-888920, -140791), JOINT(322531, -840222)},
            .retracted_mm_q16 = {Q16(1300), Q16(1300), Q16(1300), Q16(1300), Q16(1300), Q16(1300)},
            .zero_height_mm_q16 = UM(1295400),
        },
    .stroke_mm_q16 = {Q16(400), Q16(400), Q16(400), Q16(400), Q16(400), Q16(400)},
    .settled_extension_mm_q16 = Q16(10),
    .axis = {TURNING(14500), TURNING(14500), TURNING(22000), SHIFTING(300), SHIFTING(300), SHIFTING(220), TURNING(22000)},
    .spike_gate = 10,
    .cylinder_speed_mm_s_q16 = Q16(500),
    .cylinder_accel_mm_s2_q16 = Q16(4000),
    .cylinder_jerk_mm_s3 = 60000,
    .following_error_mm_q16 = Q16(10),
    .margin_mm_q16 = Q16(5),
    .engage_speed_mm_s_q16 = Q16(40),
    .engage_accel_mm_s2_q16 = Q16(100),
    .intensity_start_percent = 100,
    .intensity_max_percent = 100,
    .intensity_ramp_ms = 2000,
    .takeover_ms = 2500,
    .silence_hold_ms = 500,
    .silence_neutral_ms = 5000,
    .silence_settle_ms = 60000,
    .relays.count = 8,
    .relay_safe_after_ms = 1000,
};

/* 131072 counts per turn of 10 mm; a step of 4 mm per period is twice what the speed limit allows. */
#define DRIVE(id)                                                                                                                \
    {                                                                                                                            \
        .node = (id), .scale = {131072, 10, 0}, .step_max_q32 = 4 * Q32_ONE, .following_max_q32 = 10 * Q32_ONE,                  \
        .window_counts = 131072, .quick_stop_accel = 52428800                                                                    \
    }

const cia402_config_t k_platform_drives = {
    .axes = 6,
    .master_node = 127,
    .mode = CIA402_MODE_CSP,
    .period_us = 4000,
    .heartbeat_ms = 50,
    .heartbeat_timeout_ms = 200,
    .sdo_timeout_ms = 100,
    .boot_timeout_ms = 5000,
    .power_timeout_ms = 5000,
    .window_ms = 20,
    .abort_option = 1,
    .axis = {DRIVE(1), DRIVE(2), DRIVE(3), DRIVE(4), DRIVE(5), DRIVE(6)},
};
