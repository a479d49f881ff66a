/* SPDX-License-Identifier: MIT
 * canraw.h - driver for CAN drives with frames of their own (no CANopen). A map defines the bytes of each frame.
 * Each drive has one identifier for commands and one for replies. The caller owns canraw_t; only the motion thread calls it.
 *
 * Such drives report little about themselves. The driver derives their states:
 *
 * - OFFLINE: no position has been received for offline_periods of the bus.
 * - ENABLING: requested. It ends when a position newer than the request has been received and, if the map has enabled_when, that
 *   condition holds. If the map has enable or enabled_when, the driver already sends set-points in this state.
 * - ENABLED: the driver sends set-points. Without enabled_when this only means: requested, and a position was received since.
 * - HOMING: the homing frame was sent. It ends when homing_done holds, a new position was received and, if the map has
 *   enabled_when, that condition holds.
 * - DISABLED: every other case; the driver sends no set-points. Without disable and stop frames a drive holds its last set-point.
 * - FAULT: fault_when or homing_failed holds, or the driver found an error. These drives do not check set-points, so the driver
 *   does. It does not send a set-point further than step_max from the previous one (the first one: from the actual position), or
 *   further than following_max from the actual position.
 */
#ifndef HEAVE_CANRAW_H
#define HEAVE_CANRAW_H

#include "heave/canpassive.h"
#include "heave/counts.h"
#include "heave/drives.h"
#include "heave/hal/can.h"

#define CANRAW_BYTES_MAX  8u
#define CANRAW_FIELDS_MAX 5u

/** Fault codes of this driver. With fault_when, the code is the status as received (1 if that is 0). */
#define CANRAW_FAULT_FOLLOWING 0x8611u /**< following error, the number CANopen drives use */
#define CANRAW_FAULT_HOMING    0x8613u /**< the drive reports that homing failed */

/** What a field carries. */
typedef enum {
    CANRAW_POSITION, /**< counts: the set-point, or in replies actual */
    CANRAW_SPEED,    /**< set-points only */
    CANRAW_STATUS,   /**< replies only */
    CANRAW_COUNTER,  /**< alive counter: sent, one more with each frame of a drive; received, a reply with that of the last one is
                        old */
    CANRAW_FAULT,    /**< position replies only: what the drive calls its fault */
    CANRAW_SUM,      /**< check byte over all other bytes of the frame: their sum; */
    CANRAW_XOR,      /**< their exclusive or; */
    CANRAW_CRC8,     /**< a CRC-8 from 0, its polynomial in the frame's data at this byte; */
    CANRAW_CRC8_FF   /**< the same from FFh, inverted at the end */
} canraw_value_t;

#define CANRAW_VALUES 9u

/** A field of a frame. */
typedef struct {
    canraw_value_t value;
    uint8_t at;    /**< first byte */
    uint8_t bytes; /**< [1, 4]; of a check byte 1 */
    bool is_signed;
    bool is_big_endian;
} canraw_field_t;

/** A frame of the map: constant bytes and fields; replies may also have bytes that are ignored. */
typedef struct {
    uint8_t length;   /**< 0: the map has no such frame */
    uint8_t constant; /**< bit i: byte i is data[i] */
    uint8_t fields;
    uint8_t data[CANRAW_BYTES_MAX];
    canraw_field_t field[CANRAW_FIELDS_MAX];
} canraw_frame_t;

/** A condition: (status & mask) == value. A mask of 0 means that the map has no such condition. */
typedef struct {
    uint32_t value;
    uint32_t mask;
} canraw_when_t;

/** Commands other than set-points: frames without fields except counter and check byte, each optional. */
typedef enum { CANRAW_STOP, CANRAW_DISABLE, CANRAW_RESET, CANRAW_ENABLE, CANRAW_HOME } canraw_command_t;

#define CANRAW_COMMANDS 5u
#define CANRAW_NOTHING  CANRAW_COMMANDS

/** One drive. Unit u: mm, or deg of the rotation motor. */
typedef struct {
    uint32_t command_id; /**< all different, also from the reply_ids */
    uint32_t reply_id;
    counts_scale_t scale;    /**< counts per u, and the counts at 0 u */
    counts_scale_t speed;    /**< speed field per u/s */
    q32_t step_max_q32;      /**< largest step of set-points, u per bus period; > 0 */
    q32_t following_max_q32; /**< largest distance of a set-point from actual, u; 0 = not watched */
} canraw_axis_map_t;

/** The whole map. */
typedef struct {
    uint8_t axes; /**< [1, DRIVES_MAX] */
    bool is_extended;
    bool is_on_change;        /**< a set-point equal to the last one is not sent */
    uint32_t period_us;       /**< of the bus, a multiple of the motion cycle */
    uint32_t query_every;     /**< number of periods between two queries of a drive, [1, 1000] */
    uint32_t offline_periods; /**< > 2 * query_every */
    uint32_t passive_stop_ms; /**< the bus counts as failing after this time in error-passive; 0 = never */
    uint32_t speed_least;     /**< smallest value of a speed field; its only value if axis[].speed is 0 per u/s */
    canraw_frame_t setpoint;
    canraw_frame_t command[CANRAW_COMMANDS];
    canraw_frame_t position_query; /**< absent: the drive sends positions by itself */
    canraw_frame_t position_reply; /**< has a position, may have a status */
    canraw_frame_t homing_query;
    canraw_frame_t homing_reply; /**< has a status */
    canraw_when_t enabled_when;  /**< of the status of position_reply */
    canraw_when_t fault_when;    /**< of the same */
    canraw_when_t homing_done;   /**< of the status of homing_reply; of position_reply where there is no homing_query */
    canraw_when_t homing_failed; /**< of the same */
    canraw_axis_map_t axis[DRIVES_MAX];
} canraw_map_t;

/** Last query to a drive; private. */
typedef enum { CANRAW_ASKED_NOTHING, CANRAW_ASKED_POSITION, CANRAW_ASKED_HOMING } canraw_asked_t;

/** State of one drive; members are private. All times are the now_us of the last poll. */
typedef struct {
    drive_state_t state; /**< never DRIVE_OFFLINE */
    canraw_asked_t asked;
    uint8_t pending; /**< canraw_command_t to be sent, or CANRAW_NOTHING */
    bool is_online;
    bool is_begun; /**< a poll has processed the request that led to this state */
    bool is_homed;
    bool is_homing_seen; /**< the drive has reported that homing is in progress */
    bool is_homing_over; /**< the drive has reported that homing is done */
    bool is_homing_next; /**< the next query is the one for homing */
    bool is_energized;   /**< torque was requested, and the drive has not confirmed since that it is off */
    bool has_actual;
    bool has_sent;
    bool has_counter;    /**< of the last reply: */
    uint32_t counter_in; /**< it, */
    uint32_t counter;    /**< and that of the next frame to the drive */
    uint32_t status;
    uint32_t fault_code;
    drive_guard_t guard;
    uint64_t mark_us;        /**< time of the request or of the end of homing: actual has to be newer */
    uint64_t told_us;        /**< when the last command was sent */
    uint64_t reset_until_us; /**< end of the time in which a reset may end the fault; 0: no reset */
    uint64_t actual_us;
    int64_t counts; /**< of the last position, as the drive has them */
    int64_t sent_counts;
    q32_t sent_q32;
    q32_t actual_q32;
} canraw_axis_t;

/** The drives of a platform. Members are private, except the counters. */
typedef struct {
    const canraw_map_t *map;
    hal_can_t can;
    bool is_gone;    /**< the bus has failed */
    bool is_due;     /**< a period has passed, and the next set was not sent yet */
    bool is_free;    /**< all frames sent were seen on the wire */
    bool is_refused; /**< the queue was full for the last set */
    bool has_time;
    canpassive_t passive;
    uint64_t now_us;
    uint64_t set_us;     /**< when the last set was sent */
    uint64_t query_us;   /**< when the last queries were sent */
    uint64_t free_us;    /**< when is_free was last true */
    uint64_t restart_us; /**< last attempt to restart the bus */
    uint32_t round;      /**< of queries */
    uint32_t sets;       /**< sent */
    uint32_t refused;    /**< sets that had to wait for the bus */
    uint32_t strange;    /**< frames on a reply_id that match no reply, or without a query */
    uint32_t restarts;   /**< successful restarts of the bus */
    canraw_axis_t axis[DRIVES_MAX];
} canraw_t;

/** Starts; sends nothing yet. Drives are OFFLINE until they answer.
 *  @param map kept
 *  @return HV_OK; HV_ERR_ARG: no usable bus; HV_ERR_RANGE: the map contradicts itself or its ranges above. */
hv_status_t canraw_init(canraw_t *self, const canraw_map_t *map, hal_can_t can) HV_MUST_CHECK;

/** The implementation of drives.h. Sends one set of set-points per period, and the next one only after the previous one was seen
 * on the wire. After three periods without that the bus counts as lost: it is restarted, and the drives are OFFLINE until they
 *  answer again. */
drives_t canraw_hal(canraw_t *self);

/** Receive filters for the backend's open.
 *  @param filter out: map->axes entries
 *  @return how many */
uint32_t canraw_filters(const canraw_map_t *map, hal_can_filter_t filter[DRIVES_MAX]);

/** Range of a field's values. */
int64_t canraw_field_min(const canraw_field_t *field);
int64_t canraw_field_max(const canraw_field_t *field);

/** The first field of a frame that carries a value.
 *  @return NULL where there is none */
const canraw_field_t *canraw_find(const canraw_frame_t *frame, canraw_value_t value);

/** Writes a frame's bytes.
 *  @param value one for each canraw_value_t; of a counter its low bits count, check bytes follow from the rest
 *  @return HV_OK; HV_ERR_RANGE: a value does not fit its field, out is unchanged */
hv_status_t canraw_pack(const canraw_frame_t *frame, const int64_t value[CANRAW_VALUES],
                        uint8_t out[CANRAW_BYTES_MAX]) HV_MUST_CHECK;

/** True where a field is a check byte. */
bool canraw_is_check(canraw_value_t value);

/** True where received bytes are this frame: long enough, and constant bytes and check bytes as they should be. */
bool canraw_matches(const canraw_frame_t *frame, const uint8_t *data, uint8_t length);

/** Reads the value of a field from the bytes of a received frame that matches the map. */
int64_t canraw_extract(const canraw_field_t *field, const uint8_t *data);

/** True if some bytes would match both frames. Then only the last query tells which reply it is. */
bool canraw_is_ambiguous(const canraw_frame_t *a, const canraw_frame_t *b);

#endif
