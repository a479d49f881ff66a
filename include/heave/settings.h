/* SPDX-License-Identifier: MIT
 * settings.h - all settings of one platform that the core needs: plain data, filled once before the start.
 * Ranges are checked where the values are entered (configuration file, or a port's own table) and again by each module's init.
 */
#ifndef HEAVE_SETTINGS_H
#define HEAVE_SETTINGS_H

#include "heave/axes.h"
#include "heave/frame.h"
#include "heave/hal/relays.h"
#include "heave/hal/udp.h"
#include "heave/healthy.h"
#include "heave/kin.h"
#include "heave/stream.h"

/** Who brings the platform up. */
typedef enum {
    ENGAGE_MANUAL, /**< an operator's request */
    ENGAGE_AUTO    /**< by itself, once after the start */
} engage_policy_t;

/** How an angle is interpreted. */
typedef enum {
    ANGLE_AS_SENT, /**< the number as it is; of the rotation motor, several turns allowed */
    ANGLE_SHORTEST /**< modulo one turn, the shorter way round */
} angle_wrap_t;

/** Whether frames have a relay mask; see mask_guard.h. T frames never have one. */
typedef enum {
    MASK_LEARNT, /**< as the sender's first frames had it */
    MASK_ALWAYS, /**< a frame without one is refused */
    MASK_NEVER,  /**< a frame with one is refused */
    MASK_ANY     /**< each frame as it comes */
} mask_policy_t;

/** One pose axis or the rotation motor. Unit u is deg or mm. Asked value = sign * scale * sent value + offset, then min..max. */
typedef struct {
    int8_t sign;      /**< 1 or -1 */
    q16_t scale_q16;  /**< [0, 100] */
    q16_t offset_q16; /**< u */
    angle_wrap_t
        wrap;      /**< of rotations. A turn is 360 deg as sent (scale times 360 of the axis), of the motor 360 deg of its own */
    q16_t min_q16; /**< u */
    q16_t max_q16; /**< u, above min */
    q16_t speed_q16; /**< u/s, above 0 */
    q16_t accel_q16; /**< u/s^2, above 0 */
    int32_t jerk;    /**< u/s^3, whole units, above 0 */
} axis_settings_t;

/** Number and limits of the relays: see relay_policy.h. */
typedef struct {
    uint8_t count;                          /**< [0, 12] */
    uint32_t max_on_ms[HAL_RELAYS_MAX];     /**< 0 = none */
    uint32_t min_toggle_ms[HAL_RELAYS_MAX]; /**< 0 = none */
} relay_settings_t;

/** A platform. */
typedef struct {
    uint32_t cycle_us; /**< [500, 10000] */
    engage_policy_t engage;
    uint32_t auto_frames; /**< [0, 100] valid frames within a second that ENGAGE_AUTO waits for; 0 = none */

    kin_geometry_t geometry;
    q16_t stroke_mm_q16[CYLINDERS_MAX];
    q16_t neutral_q16[POSE_AXES]; /**< deg, deg, deg, mm, mm, mm: the pose the platform rises to */
    q16_t settled_extension_mm_q16;

    axis_settings_t axis[AXES_MAX]; /**< the last one is the rotation motor */
    bool has_angle;
    stream_style_t stream_style;
    uint32_t delay_max_ms; /**< [0, 1000]: upper limit of a stream's delay when its samples come late */
    uint32_t spike_gate;   /**< [0, SPIKE_FILTER_FACTOR_MAX] times accel_q16 of an axis; 0 = off */

    q16_t cylinder_speed_mm_s_q16;
    q16_t cylinder_accel_mm_s2_q16;
    int32_t cylinder_jerk_mm_s3;
    q16_t following_error_mm_q16; /**< fault if a cylinder is further from its set-point for 20 ms; 0 = off */
    q16_t margin_mm_q16;          /**< kept free at both ends of the stroke */

    q16_t engage_speed_mm_s_q16;
    q16_t engage_accel_mm_s2_q16;
    q16_t jog_mm_s_q16;                  /**< no cylinder is faster while it is moved by hand; 0: none can be moved */
    q16_t jog_deg_s_q16;                 /**< nor a rotation */
    q16_t signal_mm_q16, signal_deg_q16; /**< no test signal is wider, from its middle to one side */
    q16_t signal_mm_s_q16;               /**< no cylinder is faster in one */
    uint32_t blend_ms;                   /**< [250, 20000]: shortest time for blending a sender in */

    int32_t intensity_start_percent; /**< [0, max] of a sender's motion about neutral */
    uint32_t intensity_max_percent;  /**< [1, 100] */
    uint32_t intensity_ramp_ms;      /**< [500, 10000]: from 0 to 100 % */

    frame_dialect_t dialect;
    mask_policy_t mask_policy;
    q16_t confirm_jump_mm_q16;  /**< targets further than this from the last one wait for a second frame; 0 = off */
    q16_t confirm_jump_deg_q16; /**< the same of rotations and the rotation motor */
    uint32_t takeover_ms; /**< silence of the driving sender after which another one may take over; 0: all senders are followed */
    hal_udp_networks_t priority; /**< senders that take over at once, the highest priority first */
    uint32_t
        silence_hold_ms; /**< counted from the last valid frame or the end of its timed move; 0 = never, also of the next two */
    uint32_t silence_neutral_ms;
    uint32_t silence_settle_ms;

    relay_settings_t relays;
    uint16_t relay_safe_mask;
    uint32_t relay_safe_after_ms; /**< in a hold that interrupted a ride; in every other state the mask applies at once */

    healthy_settings_t healthy;
    uint32_t power_settle_ms; /**< fault if not settled within this time after the supply began to fail; 0 = never */
} settings_t;

#endif
