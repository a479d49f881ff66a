/* SPDX-License-Identifier: MIT
 * cia402.h - master of CANopen drives with the profile CiA 402, behind drives.h.
 * Produces SYNC and a heartbeat, configures every drive by SDO (all nodes in parallel), reads the important objects back, and
 * then sends one set of set-points per bus period. All drives are switched on together and enabled together, with the target on
 * the actual position. A drive with any problem is not enabled. The caller owns cia402_t; only the motion thread calls it.
 *
 * Order in a bus period: poll sends SYNC when the period begins, and send sends the RPDOs in the same cycle; they act at the next
 * SYNC. Heartbeat, NMT and SDO are sent in cycles in which no period begins, if there are any. Nothing of a new period is sent
 * before all frames of the last one were seen on the wire. After three periods without that the bus counts as lost. The driver
 * then sends nothing until the drives have noticed the missing heartbeat, restarts the bus and configures all drives again.
 *
 * A drive is OFFLINE until it is configured and its first TPDO was received. It becomes OFFLINE again if no TPDO is received for
 * three times its turn, no heartbeat for heartbeat_timeout_ms, an NMT state other than operational, or a boot-up message. The
 * driver then configures it from the beginning. It must be homed again unless its position is absolute.
 */
#ifndef HEAVE_CIA402_H
#define HEAVE_CIA402_H

#include "heave/canmaster.h"
#include "heave/canpassive.h"
#include "heave/cia402_state.h"
#include "heave/counts.h"
#include "heave/drives.h"
#include "heave/hal/can.h"
#include "heave/sdo.h"

/** Modes of operation (6060h) that set-points are sent in, and homing. */
typedef enum { CIA402_MODE_PP = 1, CIA402_MODE_HOMING = 6, CIA402_MODE_IP = 7, CIA402_MODE_CSP = 8 } cia402_mode_t;

/** Why a drive is offline, or why this driver stopped it: values of feedback.fault_code above 16 bits. The drives' own codes have
 *  16 bits. */
typedef enum {
    CIA402_TROUBLE_NONE,
    CIA402_SILENT = 0x10001,    /**< does not answer */
    CIA402_LOST_TPDO = 0x10002, /**< no TPDO, three times in a row */
    CIA402_LOST_HEARTBEAT = 0x10003,
    CIA402_LEFT_OPERATIONAL = 0x10004,
    CIA402_REBOOTED = 0x10005, /**< boot-up without a request */
    CIA402_LOST_BUS = 0x10006,
    CIA402_NOT_402 = 0x10007, /**< 1000h names another profile */
    CIA402_WRONG_IDENTITY = 0x10008,
    CIA402_NOT_TAKEN = 0x10009,      /**< an object was refused, or does not hold what was written */
    CIA402_UNGUARDED = 0x1000A,      /**< a watchdog of the drive is off: it would not stop by itself */
    CIA402_NO_HEARTBEAT = 0x1000B,   /**< never sends one */
    CIA402_NO_MODE = 0x1000C,        /**< 6061h does not show the mode */
    CIA402_NO_START = 0x1000D,       /**< does not become operational, or sends no TPDO */
    CIA402_NO_POWER = 0x1000E,       /**< does not switch on in time */
    CIA402_NO_TORQUE = 0x1000F,      /**< does not enable operation, or does not follow, in time */
    CIA402_REMOTE_OFF = 0x10010,     /**< under local control (bit 9 of 6041h) */
    CIA402_FELL_OUT = 0x10011,       /**< left operation enabled by itself */
    CIA402_LEFT_MODE = 0x10012,      /**< 6061h shows another mode than it was set to */
    CIA402_NOT_FOLLOWING = 0x10013,  /**< ignores its set-points (bit 12) */
    CIA402_NO_VOLTAGE = 0x10014,     /**< bit 4 */
    CIA402_LIMITED = 0x10015,        /**< bit 11 */
    CIA402_WARNING = 0x10016,        /**< bit 7 */
    CIA402_NO_ANSWER = 0x10017,      /**< answers, but not to the request for one object */
    CIA402_TWICE = 0x10018,          /**< two drives have its node id */
    CIA402_NO_SUCH_MODE = 0x10019,   /**< 6502h does not list the mode, or homing */
    CIA402_NO_SUCH_HOMING = 0x1001A, /**< 60E3h does not list the homing method */
    CIA402_LOST_NODE = 0x1001B,      /**< another axis of its node was lost, and the node is set up again */
    CIA402_GUARDED_LATE = 0x1001C,   /**< its watchdog of the gateway is on, with more than twice the time that it has to have */
    CIA402_SHORT_TPDO = 0x10021,     /**< its TPDO has less bytes than were mapped */
    CIA402_HOMING_LATE = 0x10022,    /**< homing does not end in time */
    CIA402_OTHER_SYNC = DRIVE_CODE_MASTER_FIRST,    /**< another master is on the bus: SYNC, */
    CIA402_OTHER_NMT = 0x1001E,                     /**< NMT to our drives, */
    CIA402_OTHER_COMMAND = 0x1001F,                 /**< an RPDO of our drives, */
    CIA402_OTHER_HEARTBEAT = DRIVE_CODE_MASTER_LAST /**< or the heartbeat that they watch us by */
} cia402_trouble_t;

/** Conditions that are checked in every answer beside state and position: bits of drive_report_t.notes. */
typedef enum {
    CIA402_WATCH_MODE,
    CIA402_WATCH_FOLLOWING,
    CIA402_WATCH_LOCAL,
    CIA402_WATCH_VOLTAGE,
    CIA402_WATCH_LIMIT,
    CIA402_WATCH_WARNING,
    CIA402_WATCH_MASTER, /**< another master, in no answer */
    CIA402_WATCHES
} cia402_watch_t;

/** Reaction to such a condition. */
typedef enum {
    CIA402_IGNORE,
    CIA402_REPORT, /**< reported only */
    CIA402_STOP    /**< a fault of the drive: all drives stop, and this one is not enabled */
} cia402_reaction_t;

/** Watchdogs that heaved switches on in a drive, so that it stops by itself. */
typedef enum {
    CIA402_GUARD_CONSUMER,   /**< 1016h: of the gateway's heartbeat */
    CIA402_GUARD_PRODUCER,   /**< 1017h: the drive's heartbeat */
    CIA402_GUARD_TIME,       /**< 100Ch: node guarding */
    CIA402_GUARD_LIFE,       /**< 100Dh */
    CIA402_GUARD_CONNECTION, /**< 6007h: what the drive does when the gateway is gone */
    CIA402_GUARD_QUICK_STOP, /**< 605Ah */
    CIA402_GUARD_FAULT,      /**< 605Eh: what it does with a fault */
    CIA402_GUARD_WINDOW,     /**< 6065h: following error */
    CIA402_GUARDS
} cia402_guard_t;

#define CIA402_GUARDS_ALL ((uint8_t)((1u << CIA402_GUARDS) - 1u))

/** An object of a start-up list: a setting that a family of drives needs in addition to the settings of all drives. */
typedef struct {
    uint32_t value; /**< the low bytes count */
    uint16_t index;
    uint8_t sub;
    uint8_t bytes;    /**< 1, 2 or 4 */
    bool is_written;  /**< else only read and compared */
    bool is_checked;  /**< read back after it was written */
    bool is_optional; /**< the drive may lack this object */
    bool is_last;     /**< written after all other objects, else before them */
} cia402_item_t;

#define CIA402_ITEMS_MAX 64u /**< of a drive */

#define CIA402_CHANNELS_MAX 4u /**< axes of a node: it has four TPDOs with identifiers of their own */
#define CIA402_MAPS_MAX     3u /**< PDOs of a list of maps */
#define CIA402_PDO_ENTRIES  8u

/** A PDO that is described, in place of the usual one. */
typedef struct {
    uint16_t number;                    /**< [1, CIA402_PDO_NUMBER_MAX]: RPDO 1 has the records 1400h and 1600h */
    uint8_t entries;                    /**< > 0 */
    uint32_t entry[CIA402_PDO_ENTRIES]; /**< in their order, as in 1600h: index << 16 | sub-index << 8 | bits, whole bytes. An
                                             index of another channel makes the PDO one of the whole node */
} cia402_map_t;

#define CIA402_PDO_NUMBER_MAX 256u

/** PDOs of a direction. */
typedef struct {
    cia402_map_t map[CIA402_MAPS_MAX];
    uint8_t count; /**< 0: the usual PDO */
} cia402_maps_t;

/** One drive. Counts are those of the drive (6064h). Unit u: mm, or deg of the rotation motor. */
typedef struct {
    uint8_t node;             /**< [1, 127], not the master's; axes of one node have different channels */
    uint8_t channel;          /**< its axis in the node, [0, CIA402_CHANNELS_MAX): its objects 6000h to 67FFh are at + channel *
                                   800h. A node's channels begin at 0 and have no gaps */
    uint8_t mode;             /**< cia402_mode_t of its set-points; 0 = that of the platform */
    counts_scale_t scale;     /**< counts per u, and the counts at 0 u */
    q32_t step_max_q32;       /**< largest step of set-points, u per bus period; > 0 */
    q32_t following_max_q32;  /**< largest distance of a set-point from actual, u; 0 = not watched here */
    uint32_t window_counts;   /**< 6065h */
    int8_t homing_method;     /**< 6098h; 0: no homing, the position is absolute */
    uint32_t homing_speed[2]; /**< 6099h, counts/s: towards the switch, and to the zero */
    uint32_t homing_accel;    /**< 609Ah, counts/s^2 */
    int32_t homing_offset_counts;         /**< 607Ch */
    uint32_t quick_stop_accel;            /**< 6085h, counts/s^2; 0 = as it is */
    uint32_t profile_speed;               /**< 6081h, mode PP only */
    uint32_t profile_accel;               /**< 6083h, 6084h, mode PP only */
    bool has_limits;                      /**< 607Dh is written */
    int32_t limit_counts[2];              /**< 607Dh: least and greatest position */
    uint32_t identity[4];                 /**< 1018h sub 1 to 4: vendor, product, revision, serial number; 0 = any */
    cia402_item_t item[CIA402_ITEMS_MAX]; /**< start-up list */
    uint8_t items;                        /**< [0, CIA402_ITEMS_MAX] */
} cia402_axis_config_t;

/** The drives of a platform. */
typedef struct {
    uint8_t axes;                  /**< [1, DRIVES_MAX] */
    uint8_t master_node;           /**< [1, 127]: the drives monitor the heartbeat of this node */
    cia402_mode_t mode;            /**< CSP, IP or PP; of drives that have none of their own */
    uint32_t period_us;            /**< of the bus: cia402_is_period() */
    uint16_t heartbeat_ms;         /**< of both sides; > 0 */
    uint16_t heartbeat_timeout_ms; /**< of both sides; > heartbeat_ms */
    uint16_t sdo_timeout_ms;       /**< > 0 */
    uint16_t boot_timeout_ms;      /**< after reset communication */
    uint16_t power_timeout_ms;     /**< to switch on, and to enable operation */
    uint16_t window_ms;            /**< 6066h */
    uint16_t listen_ms; /**< nothing is sent for so long at the start, and until no other master is heard for as long; 0 = not
                             at all. Only where reaction[CIA402_WATCH_MASTER] is CIA402_STOP */
    uint32_t passive_stop_ms;  /**< the bus counts as failing after this time in error-passive; 0 = never */
    int16_t abort_option;      /**< 6007h: 1 fault, 2 disable voltage, 3 quick stop */
    uint8_t sync_counter;      /**< 1019h: 0 = none, or [2, 240] */
    uint8_t pdo_step;          /**< PDO records from those of a channel to those of the next, [1, 64]; 0 = 64, as in CiA 301 */
    bool are_maps_fixed;       /**< the drives' maps are compared, not written */
    cia402_maps_t commands;    /**< RPDOs: with 6040h, and 607Ah or 60C1h:01; of channel 0, others are at their distance */
    cia402_maps_t answers;     /**< TPDOs: with 6041h and 6064h */
    uint8_t answer_every;      /**< SYNCs between two answers of a drive, [0, CIA402_ANSWER_EVERY_MAX]; 0 as 1. Not in PP */
    uint8_t csp_control_bits;  /**< of 6040h, set while a drive follows set-points in CSP: any of CIA402_CSP_CONTROL_BITS */
    uint8_t telemetry;         /**< additional values that drives send: bits DRIVE_TELLS_... */
    uint8_t telemetry_every;   /**< SYNCs between two telemetry PDOs, [1, 240] if there is telemetry */
    bool is_guarded;           /**< node guarding in place of heartbeats, of both sides: for drives that have none */
    bool is_sync_watched;      /**< 1006h holds the period: drives may stop if SYNC is late */
    bool is_reset_wanted;      /**< reset communication before setting up */
    uint16_t rpdo_deadline_ms; /**< 1400h:05; 0 = left as it is */
    uint8_t accepted_without;  /**< watchdogs that drives may lack, or have off: bit N for cia402_guard_t N */
    bool is_homing_in_turn;    /**< one drive after the other */
    bool is_support_checked;   /**< drives whose 6502h or 60E3h do not list the configured mode or homing method are refused */
    cia402_reaction_t reaction[CIA402_WATCHES];
    cia402_axis_config_t axis[DRIVES_MAX];
} cia402_config_t;

#define CIA402_ANSWER_EVERY_MAX 10u
#define CIA402_CSP_CONTROL_BITS 0x70u /**< 4 to 6, of which CiA 402 leaves the meaning to each mode, and CSP has none */

/** Phase of a drive's start-up; private. */
typedef enum {
    CIA402_MISSING,
    CIA402_RESETTING,
    CIA402_CONFIGURING,
    CIA402_CONFIGURED, /**< waits for the other axes of its node */
    CIA402_STARTING,
    CIA402_UP,
    CIA402_LEAVING, /**< lost; stop commands are sent for a while */
    CIA402_REFUSED  /**< cannot be used; until it boots or the operator resets */
} cia402_phase_t;

/** Which job walks through the table of objects; private. */
typedef enum { CIA402_JOB_NONE, CIA402_JOB_SETUP, CIA402_JOB_MODE, CIA402_JOB_ERROR, CIA402_JOB_RESET } cia402_job_t;

/** A walk through some rows of the table of objects; private. */
typedef struct {
    cia402_job_t job;
    uint8_t row;
    uint8_t step;
    uint8_t tries;
    bool is_asked;     /* an SDO of this step is under way */
    uint8_t mode;      /* of CIA402_JOB_MODE and at the end of CIA402_JOB_SETUP */
    uint8_t item;      /* of the start-up list, or of a PDO, in its row */
    uint8_t entry;     /* of a list in the drive, while it is searched */
    uint32_t value;    /* read in an earlier step */
    uint32_t refusal;  /* SDO abort code of the last write that was left to a check, */
    uint16_t refused;  /* and the index of its object; 0 = none */
    uint16_t guard_ms; /* what 100Ch holds; 0 = not read */
    uint64_t since_us; /* of the row */
    uint64_t pause_us; /* nothing is done before */
} cia402_setup_t;

/** How homing stands; private. */
typedef enum {
    CIA402_HOMING_NO,
    CIA402_HOMING_WAITING,
    CIA402_HOMING_STARTED,
    CIA402_HOMING_RUNNING,
    CIA402_HOMING_DONE
} cia402_homing_t;

#define CIA402_TELEMETRY_PDOS 2u /**< the second one where one is too short */
#define CIA402_PDOS           (2u * CIA402_MAPS_MAX + CIA402_TELEMETRY_PDOS)

/** The PDOs of an axis, in the order of setting up: commands, answers, telemetry. */
#define CIA402_COMMAND   0u
#define CIA402_ANSWER    CIA402_MAPS_MAX
#define CIA402_TELEMETRY (2u * CIA402_MAPS_MAX)

/** What is in a PDO. */
typedef struct {
    uint32_t entry[CIA402_PDO_ENTRIES]; /**< as cia402_map_t has them, with the indices of their channels */
    uint8_t entries;                    /**< 0 = not in use */
    uint8_t bytes;
    uint8_t every;        /**< SYNCs from one to the next */
    uint8_t start;        /**< 1800h:06, see cia402_sync_start() */
    uint16_t deadline_ms; /**< 1400h:05; 0 = left as it is, and of TPDOs */
    uint16_t record;      /**< 1400h or 1800h and so on; the map is 200h further */
    uint16_t id;          /**< CAN identifier */
    bool is_fixed;        /**< the map is not written */
} cia402_pdo_t;

/** State of one drive; private. Ordered so that there is no padding. */
typedef struct {
    cia402_phase_t phase;
    uint32_t trouble; /* cia402_trouble_t: reason of the last loss or refusal */
    uint64_t phase_us;
    uint64_t trouble_us;
    uint32_t trouble_object; /* index << 8 | sub */
    uint32_t trouble_code;   /* SDO abort code, or a code of the drive */
    uint32_t trouble_found;  /* if has_found: value of the object, */
    uint32_t trouble_wanted; /* and the required value */
    uint32_t mute_object;    /* object without an answer; 0 = none */
    uint32_t warned_object;  /* a watchdog that is off and was accepted */
    uint8_t nmt;             /* last received */
    uint8_t nmt_command;     /* command to be sent, 0 = none */
    uint8_t starts;          /* attempts to become operational */
    uint8_t mutes;           /* attempts that ended at an object without answer */
    uint8_t awaited;         /* SYNCs that no TPDO has answered yet, saturates */
    uint8_t surplus;         /* TPDOs without a request, saturates */
    uint8_t plain_syncs;     /* SYNCs since the last of these, saturates */
    uint8_t changes;         /* consecutive answers with an additional one that showed a change before them, saturates */
    bool has_extra;          /* an additional answer came since the last awaited one, and showed another statusword */
    bool has_short_answer;   /* a TPDO since the last whole answer was too short */
    bool hides_mode;         /* shows no mode in 6061h without torque */
    uint16_t plain_word;     /* statusword of the last awaited answer */
    bool is_reset_done;
    bool has_found;
    bool is_asking; /* uses the SDO server of its node */
    bool has_mates; /* its node has other axes */
    sdo_t sdo;
    cia402_setup_t setup;
    uint64_t heartbeat_us;
    uint64_t guard_us; /* when it was asked for its state last */
    uint64_t boot_us;  /* of the last boot-up message, 0 = none */

    int64_t position_counts; /* without the wrap-around of 32 bits */
    q32_t actual_q32;
    uint64_t actual_us;
    drive_emergency_t emergency;
    drive_telemetry_t telemetry;
    uint64_t note_us[CIA402_WATCHES]; /* when each was seen last */
    uint32_t notes;                   /* reported: bit N for cia402_watch_t N */
    int32_t actual_counts;
    uint32_t silent_syncs;
    uint8_t answered;                      /* bit N: answer N has come since the last whole set */
    bool has_answered;                     /* a whole set came since it was set up last */
    uint8_t watch_answers[CIA402_WATCHES]; /* consecutive answers with the condition, saturates */
    bool has_followed;                     /* bit 12 was set since operation was enabled */
    bool had_voltage;                      /* bit 4 was set since operation was enabled */
    bool has_shown_mode;                   /* 6061h was the mode since operation was enabled */
    bool has_answer;                       /* a TPDO came since the last poll */
    uint16_t statusword;
    int8_t mode_shown;
    bool has_heartbeat;
    uint8_t guard_toggle; /* of the last answer to guarding */
    bool has_actual;      /* since it was set up last */
    bool was_heard;       /* has_actual at any time */
    bool is_answering;    /* answers, whether up or not */

    bool is_in;        /* takes part in the common stage */
    bool has_operated; /* operation was enabled since its stage began */
    cia402_goal_t goal;
    uint16_t word;
    uint8_t word_syncs;      /* since it changed, saturates */
    uint8_t reset_syncs;     /* SYNCs since a fault reset began, saturates; 0 = none */
    uint64_t reset_asked_us; /* of a drive that does not start: when the operator reset it last; 0 = not since it started */
    uint64_t reset_until_us; /* a request is valid until then; while it is carried out, bit 7 is set until then at most */
    uint64_t operating_us;   /* operation enabled since, 0 = not */
    uint64_t stopping_us;    /* quick stop since, 0 = not */
    uint32_t own_fault;      /* error found by this driver: cia402_trouble_t or a code of the standard; 0 = none */
    drive_guard_t guard;     /* distances, if own_fault is about set-points */
    uint16_t error_code;     /* the drive's own */
    bool is_error_read;
    q32_t sent_q32;
    int32_t target_counts;
    cia402_homing_t homing;
    int32_t stand_counts; /* homing: where it has been for the time since */
    uint64_t stand_us;
    bool was_without_zero; /* bit 12 was not set since homing was started */
    bool is_homed;
    bool has_sent;
    bool was_faulty;
    uint8_t live_answers; /* in which the last controlword that leads to power or torque may not show yet */
} cia402_axis_t;

/** Common stage of all drives; private. */
typedef enum {
    CIA402_STAGE_OFF,
    CIA402_STAGE_WITHDRAW, /**< no torque, for a change of mode */
    CIA402_STAGE_MODE,
    CIA402_STAGE_SWITCH_ON,
    CIA402_STAGE_OPERATE,
    CIA402_STAGE_HOMING,
    CIA402_STAGE_FOLLOW
} cia402_stage_t;

/** The drives of a platform. Members are private, except the counters. */
typedef struct {
    const cia402_config_t *config;
    hal_can_t can;
    cia402_stage_t stage;
    uint64_t stage_us;
    uint32_t stage_syncs;
    bool is_begun;  /* a poll has processed the request that led here */
    bool is_homing; /* the goal is homing, else enabled */
    bool is_homing_asked;
    bool is_gone;    /* the bus does not work */
    bool is_due;     /* a period has begun, its SYNC has not gone out */
    bool is_open;    /* SYNC has gone out, the set-points have not */
    bool is_free;    /* all frames sent were seen on the wire */
    bool is_refused; /* the bus did not accept the last SYNC, or some of the last set-points: its queue was full */
    bool has_time;
    bool is_preop_due; /* NMT pre-operational has to be sent to all nodes */
    canpassive_t passive;
    canmaster_t master;
    uint8_t pp_step; /* of the handshake in PP */
    uint8_t sync_count;
    uint64_t now_us;
    uint64_t due_us; /* the next SYNC */
    uint64_t free_us;
    uint64_t gone_us;
    uint64_t restart_us;
    uint64_t heartbeat_us;
    uint32_t syncs;
    uint32_t sets;     /**< sent */
    uint32_t refused;  /**< sets that had to wait for the bus */
    uint32_t restarts; /**< successful restarts of the bus */
    uint32_t emergencies;
    sdo_t visitor; /* client for a person, beside the clients of the driver */
    drive_object_state_t visit;
    uint8_t visited; /* axis, while visit is BUSY */
    cia402_axis_t axis[DRIVES_MAX];
    cia402_pdo_t pdo[DRIVES_MAX][CIA402_PDOS]; /* cia402_pdo() of each, which takes long to find in every period */
} cia402_t;

/** Starts; sends nothing yet.
 *  @param config kept
 *  @return HV_OK; HV_ERR_ARG: no usable bus; HV_ERR_RANGE: the configuration contradicts itself or the ranges above. */
hv_status_t cia402_init(cia402_t *self, const cia402_config_t *config, hal_can_t can) HV_MUST_CHECK;

/** The implementation of drives.h. */
drives_t cia402_hal(cia402_t *self);

/** Call at the orderly end of the program: resets the communication of the drives without torque, so that they do not report a
 *  lost master and are not in fault at the next start. Drives with torque are left to their watchdogs. */
void cia402_leave(cia402_t *self);

/** Consequence if a drive lacks an object, or refuses it. */
typedef enum {
    CIA402_WISH_NEEDED,  /**< the drive is refused */
    CIA402_WISH_GUARD,   /**< refused unless drives without guards are allowed */
    CIA402_WISH_IF_THERE /**< nothing */
} cia402_wish_need_t;

/** True if drives may lack the watchdog with this index; the axes of a node have theirs at further indices. */
bool cia402_accepts_without(const cia402_config_t *config, uint16_t index);

/** An object of the configuration of a drive. Set all members to 0 before the first call. */
typedef struct {
    uint32_t value; /**< value that it has to hold, except for COB-IDs that are switched off */
    uint16_t index;
    uint8_t sub;
    uint8_t bytes;
    bool is_written;
    bool is_compared; /**< it has to hold the value at the end of the configuration */
    bool is_own;      /**< set by heaved itself, not by a start-up list */
    cia402_wish_need_t need;
    uint8_t row;  /**< private */
    uint8_t item; /**< private */
} cia402_wish_t;

/** Goes to the next object of a drive, in the order of configuration.
 *  @return false after the last one */
bool cia402_next_wish(const cia402_config_t *config, unsigned axis, cia402_wish_t *wish);

/** True if heaved itself writes this object with some configuration. */
bool cia402_is_own_object(uint16_t index, uint8_t sub);

/** True if it does with every configuration. */
bool cia402_is_always_own(uint16_t index, uint8_t sub);

/** True for objects that a person must not write: those that the driver sets itself with this configuration, those that the
 * motion uses, and those that scale a count. */
bool cia402_is_relied_on(const cia402_config_t *config, unsigned axis, uint16_t index, uint8_t sub);

/** True if 60C2h can hold this period: whole ms up to 255, or up to 255 of 100 us. */
bool cia402_is_period(uint32_t period_us);

/** Mode of the set-points of a drive. */
cia402_mode_t cia402_mode(const cia402_config_t *config, unsigned axis);

/** A PDO of an axis. A PDO of the whole node counts as PDO of channel 0.
 *  @param which CIA402_COMMAND, CIA402_ANSWER or CIA402_TELEMETRY, and on; < CIA402_PDOS */
cia402_pdo_t cia402_pdo(const cia402_config_t *config, unsigned axis, unsigned which);

/** The axis to which the object of a mapped entry belongs, by node and channel.
 *  @return config->axes: there is none */
unsigned cia402_axis_of(const cia402_config_t *config, uint8_t node, uint32_t entry);

/** The index that an object has in channel 0. */
uint16_t cia402_plain_index(uint16_t index);

/** True if the PDOs are valid: every node has at most four in each direction, and they contain all required objects, each of
 * them completely.
 *  @param why out: constant text, if they are not valid */
bool cia402_pdos_fit(const cia402_config_t *config, const char **why);

/** SYNCs between two answers of a drive, from 1. */
uint8_t cia402_answer_every(const cia402_config_t *config);

/** Value of the SYNC counter at which a drive begins to count SYNCs for a TPDO (1800h:06): drives that send it at every n-th
 *  SYNC take turns. 0 = none: there is no counter, or its range is not a multiple of n. */
uint8_t cia402_sync_start(const cia402_config_t *config, unsigned axis, uint8_t every);

#define CIA402_FILTERS_MAX (3u + 14u * DRIVES_MAX) /* three, four TPDOs, four RPDOs, and those of the map */
#define CIA402_OWNS_MAX    (3u + 6u * DRIVES_MAX)

/** Identifiers that are received, and those that are sent, for the backend's open.
 *  @param filter out
 *  @return how many */
uint32_t cia402_filters(const cia402_config_t *config, hal_can_filter_t filter[CIA402_FILTERS_MAX]);
uint32_t cia402_owns(const cia402_config_t *config, hal_can_filter_t filter[CIA402_OWNS_MAX]);

#endif
