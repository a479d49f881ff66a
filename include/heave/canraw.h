/* SPDX-License-Identifier: MIT
 * canraw.h - driver for CAN drives with frames of their own (no CANopen). A map defines the bytes of each frame.
 * Each drive has one identifier for commands and one for replies. Several may share a frame for set-points, and one for replies:
 * in it each has fields of its own (a slot). The caller owns canraw_t; only the motion thread calls it.
 *
 * Such drives report little about themselves. The driver derives their states:
 *
 * - OFFLINE: no position has been received for offline_periods of the bus, or the drive has not been started up: a drive gets
 *   the frames of step when the first frame comes from it, and meanwhile every second, since it may say nothing before.
 *   A drive that is lost under torque is stopped as by DRIVES_QUICK_STOP: it may hear what it does not answer.
 * - ENABLING: requested. It ends when a position newer than the request has been received and, if the map has enabled_when, that
 *   condition holds. If the map has enable or enabled_when, the driver already sends set-points in this state.
 * - ENABLED: the driver sends set-points. Without enabled_when this only means: requested, and a position was received since.
 * - HOMING: the homing frame was sent. It ends when homing_done holds, a new position was received and, if the map has
 *   enabled_when, that condition holds.
 * - DISABLED: every other case; the driver sends no set-points. Without disable and stop frames a drive holds its last set-point.
 *   After a quick stop of a map with both frames, disable follows stop once the drive stands still (quick_stop.h).
 * - FAULT: fault_when or homing_failed holds, or the driver found an error. These drives do not check set-points, so the driver
 *   does. It does not send a set-point further than step_max from the previous one (the first one: from the actual position), or
 *   further than following_max from the actual position.
 */
#ifndef HEAVE_CANRAW_H
#define HEAVE_CANRAW_H

#include "heave/canmaster.h"
#include "heave/canpassive.h"
#include "heave/counts.h"
#include "heave/drives.h"
#include "heave/hal/can.h"
#include "heave/quick_stop.h"

#define CANRAW_BYTES_MAX  8u
#define CANRAW_FIELDS_MAX 12u

/** Largest number of counts that a float field carries exactly, and its largest divisor. */
#define CANRAW_FLOAT_MAX   8388607
#define CANRAW_DIVISOR_MAX 1000000u

#define CANRAW_OWNS_MAX    (2u * DRIVES_MAX)
#define CANRAW_FILTERS_MAX (4u * DRIVES_MAX)

/** Fault codes of this driver. With fault_when, the code is the status as received (1 if that is 0). */
#define CANRAW_FAULT_FOLLOWING 0x8611u /**< following error, the number CANopen drives use */
#define CANRAW_FAULT_HOMING    0x8613u /**< the drive reports that homing failed */

/** What a field carries. */
typedef enum {
    CANRAW_POSITION, /**< counts: the set-point, or in replies actual */
    CANRAW_SPEED,    /**< set-points only */
    CANRAW_STATUS,   /**< replies only */
    CANRAW_COUNTER,  /**< alive counter. Sent: it increases by one with each frame to a drive. Received: a reply with the same
                        counter as the last one is old */
    CANRAW_FAULT,    /**< replies: fault code of the drive */
    CANRAW_TORQUE,   /**< replies: torque, in counts of the drive */
    CANRAW_SUM,      /**< check byte over all other bytes of the frame: their sum; */
    CANRAW_XOR,      /**< their exclusive or; */
    CANRAW_CRC8      /**< a CRC-8, highest bit first; its polynomial is in the frame's data at this byte */
} canraw_value_t;

#define CANRAW_VALUES 9u

/** A field of a frame: a whole number, or a float32 that carries counts / divisor. */
typedef struct {
    canraw_value_t value;
    uint8_t at;   /**< first byte that it touches */
    uint8_t bits; /**< [1, 32]; of a check byte 8, of a float 32 */
    bool is_signed;
    bool is_big_endian;
    uint8_t skip;     /**< [0, 7] bits of that byte before it: below its lowest bit, of a big-endian one above its highest; of a
                         check byte 0 */
    uint32_t divisor; /**< 0: no float; else up to CANRAW_DIVISOR_MAX, and the field is signed */
    uint8_t slot;     /**< 0: of all drives that share the frame; else of the one with this slot, [1, DRIVES_MAX] */
} canraw_field_t;

/** A frame of the map: constant bytes and fields; replies may also have bytes that are ignored. */
typedef struct {
    uint8_t length;   /**< 0: the map has no such frame */
    uint8_t constant; /**< bit i: byte i is data[i], but for the bits of fields */
    uint8_t fields;
    uint8_t data[CANRAW_BYTES_MAX];
    canraw_field_t field[CANRAW_FIELDS_MAX];
    uint8_t crc_initial; /**< of its CRC-8 */
    uint8_t crc_final;   /**< exclusive or with the end of it */
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

#define CANRAW_STEPS_MAX 8u

/** A step of starting a drive up. */
typedef struct {
    canraw_frame_t frame;  /**< to command_id, without fields except counter and check byte; length 0: the list ends before it */
    canraw_frame_t answer; /**< on reply_id, expected within half a second; length 0: none */
    uint32_t wait_us;      /**< before the next step */
} canraw_step_t;

/** Reaction to another master: to frames with our identifiers that we have not sent. */
typedef enum {
    CANRAW_MASTER_IGNORE,
    CANRAW_MASTER_REPORT, /**< reported only */
    CANRAW_MASTER_STOP    /**< nothing is sent at the start until none is heard; later all drives stop, in DRIVE_FAULT */
} canraw_master_t;

/** One drive. Unit u: mm, or deg of the rotation motor. */
typedef struct {
    uint32_t command_id;   /**< of commands and queries: all different, also from the reply_ids */
    uint32_t setpoint_id;  /**< of set-points: command_id, or one that drives with different setpoint_slots share */
    uint32_t reply_id;     /**< drives with different reply_slots may share it */
    uint32_t status_id;    /**< of status_reply: likewise; may be reply_id */
    uint8_t setpoint_slot; /**< 0: has no fields of its own */
    uint8_t reply_slot;
    uint8_t status_slot;
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
    canraw_master_t other_master;
    uint32_t listen_ms;       /**< for how long it is listened for at the start, with CANRAW_MASTER_STOP; 0 = not at all */
    uint32_t passive_stop_ms; /**< the bus counts as failing after this time in error-passive; 0 = never */
    uint32_t rated_torque;    /**< counts of a torque field at the rated torque; 0 = not known: torque is not reported */
    uint32_t speed_least;     /**< smallest value of a speed field; its only value if axis[].speed is 0 per u/s */
    canraw_frame_t setpoint;
    canraw_frame_t command[CANRAW_COMMANDS];
    canraw_frame_t position_query; /**< absent: the drive sends positions by itself */
    canraw_frame_t position_reply; /**< has a position, may have a status */
    canraw_frame_t homing_query;
    canraw_frame_t homing_reply;          /**< has a status */
    canraw_frame_t status_reply;          /**< absent: the status is in position_reply; else it comes unasked and has a status */
    uint32_t status_every;                /**< number of periods between two of them, [1, 1000]; without status_reply any */
    canraw_step_t step[CANRAW_STEPS_MAX]; /**< frames that a drive gets when it appears, before it counts as online */
    canraw_when_t enabled_when;           /**< condition on the status in status_reply if it exists, else in position_reply */
    canraw_when_t fault_when;             /**< on the same status */
    canraw_when_t homing_done;   /**< on the status in homing_reply; without homing_query, on the status of enabled_when */
    canraw_when_t homing_failed; /**< as homing_done */
    canraw_axis_map_t axis[DRIVES_MAX];
} canraw_map_t;

/** Result of comparing received bytes with a frame. Later values mean a closer match. */
typedef enum {
    CANRAW_MATCH,
    CANRAW_OTHER,      /**< length or constant bits are those of another frame */
    CANRAW_BAD_CHECK,  /**< length and constant bits match, but the check byte is wrong */
    CANRAW_BAD_NUMBER, /**< the check byte is right, but a float is not a number, or a position is out of range */
    CANRAW_REPEATED    /**< all is right, but the counter is that of the previous reply */
} canraw_verdict_t;

/** Codes for the problems that drive_report_t names in words. The driver has found them, not the drive. */
enum {
    CANRAW_SILENT = 0x10001,                       /**< nothing is received from the drive */
    CANRAW_NO_STATUS = 0x10002,                    /**< positions are received, but no status_reply */
    CANRAW_STRANGE = 0x10003,                      /**< plus (canraw_verdict_t - CANRAW_OTHER): received frames are rejected */
    CANRAW_NO_ANSWER = 0x10008,                    /**< no answer to a start-up step */
    CANRAW_OTHER_MASTER = DRIVE_CODE_MASTER_FIRST, /**< somebody else sends frames with the identifiers of ours */
    CANRAW_REPORTS_ERROR = 0x10010                 /**< the drive sends a fault code other than 0, but has no fault */
};

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
    bool has_counter[2];       /**< of the last reply with a position, and with a status: */
    uint32_t counter_in[2];    /**< it, */
    uint32_t counter;          /**< and that of the next frame to the drive, */
    uint32_t setpoint_counter; /**< and of the next set-points where they have an identifier of their own */
    uint32_t status;
    uint32_t fault_code;
    uint32_t reported_code; /**< the fault field of the last reply that has one */
    int64_t torque;
    bool has_torque;
    bool is_talking;     /**< something came since it was lost */
    bool is_step_sent;   /**< and its answer is awaited */
    uint8_t step;        /**< of starting up: the next one */
    uint8_t failed_step; /**< last step without an answer, from 1; 0 = none since the start-up */
    uint64_t step_us;    /**< when that was sent, or when the next one is due */
    bool is_placed;      /**< a position came since it was lost, */
    bool has_status;     /**< and status_reply */
    canraw_verdict_t trouble;
    uint64_t trouble_us; /**< when that came */
    uint64_t heard_us;   /**< last time that any frame came that may be from it */
    uint64_t status_us;
    uint64_t torque_us;
    uint64_t phase_us; /**< since when it is in its state */
    uint8_t phase;
    uint64_t reset_asked_us; /**< a reset waits for the end of a stop since then; 0: none does */
    quick_stop_t quick_stop; /**< `stop` was sent or will be; `disable` follows */
    drive_guard_t guard;
    uint64_t mark_us;        /**< time of the request or of the end of homing: actual has to be newer */
    uint64_t command_us;     /**< time of the last command */
    uint64_t reset_until_us; /**< end of the time in which a reset may end the fault; 0: no reset */
    uint64_t actual_us;
    int64_t counts; /**< of the last position, in counts of the drive */
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
    canmaster_t master;
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
 *  @param filter out
 *  @return number of filters */
uint32_t canraw_filters(const canraw_map_t *map, hal_can_filter_t filter[CANRAW_FILTERS_MAX]);

/** Identifiers that the driver sends, for backends that need them.
 *  @param own out
 *  @return number of entries */
uint32_t canraw_owns(const canraw_map_t *map, hal_can_filter_t own[CANRAW_OWNS_MAX]);

/** Range of a field's values. */
int64_t canraw_field_min(const canraw_field_t *field);
int64_t canraw_field_max(const canraw_field_t *field);

/** The first field of a frame that carries a value.
 *  @return NULL: there is none */
const canraw_field_t *canraw_find(const canraw_frame_t *frame, canraw_value_t value);

/** The field that carries a value for the drive with this slot, or for all drives.
 *  @return NULL: there is none */
const canraw_field_t *canraw_find_of(const canraw_frame_t *frame, canraw_value_t value, unsigned slot);

/** Number of drives that may share a frame: its highest slot; 0: the frame belongs to a single drive. */
unsigned canraw_slots(const canraw_frame_t *frame);

/** Index of a field's value in the array for canraw_pack(). */
unsigned canraw_value_at(canraw_value_t value, unsigned slot);

/** Bytes that a field touches. */
unsigned canraw_field_span(const canraw_field_t *field);

/** Sets the bits of a field.
 *  @return false: some of these bits were set before */
bool canraw_field_cover(const canraw_field_t *field, uint8_t bits[CANRAW_BYTES_MAX]);

/** Writes a frame's bytes.
 *  @param value at canraw_value_at(): one for each canraw_value_t, again for each slot of the frame. Only the low bits of a
 *               counter are used. Check bytes are calculated
 *  @return HV_OK; HV_ERR_RANGE: a value does not fit its field, out is unchanged */
hv_status_t canraw_pack(const canraw_frame_t *frame, const int64_t value[], uint8_t out[CANRAW_BYTES_MAX]) HV_MUST_CHECK;

/** True if the field is a check byte. */
bool canraw_is_check(canraw_value_t value);

/** Whether received bytes are this frame. */
canraw_verdict_t canraw_judge(const canraw_frame_t *frame, const uint8_t *data, uint8_t length);

/** True if the received bytes are this frame: they are long enough, constant bits and check bytes are right, and floats are
 * numbers in their range. */
bool canraw_matches(const canraw_frame_t *frame, const uint8_t *data, uint8_t length);

/** Reads the value of a field from the bytes of a received frame that matches the map. */
int64_t canraw_extract(const canraw_field_t *field, const uint8_t *data);

/** True if some bytes would match both frames. Then only the last query tells which reply it is. */
bool canraw_is_ambiguous(const canraw_frame_t *a, const canraw_frame_t *b);

/** True if some bytes would be both the answer to a step and this reply. */
bool canraw_startup_is_mixed(const canraw_step_t *step, const canraw_frame_t *reply);

#endif
