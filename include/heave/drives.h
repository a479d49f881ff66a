/* SPDX-License-Identifier: MIT
 * drives.h - contract of the drive layer between the gateway and a bus or a simulation.
 * Values in mm (deg for the rotation motor), one entry per axis: the cylinders, then the rotation motor if there is one.
 * Only the motion thread calls the ops; none blocks. Scaling, signs and bus protocol belong to the backend, limits to the caller.
 */
#ifndef HEAVE_DRIVES_H
#define HEAVE_DRIVES_H

#include "heave/axes.h"

/** Most axes: the cylinders and the rotation motor. */
#define DRIVES_MAX (CYLINDERS_MAX + 1u)

/** State of one drive. */
typedef enum {
    DRIVE_OFFLINE,  /**< does not answer, or is not configured yet; nothing else in its feedback is current */
    DRIVE_DISABLED, /**< answers, no torque */
    DRIVE_ENABLING, /**< on the way to DRIVE_ENABLED; may hold the position already */
    DRIVE_ENABLED,  /**< follows the set-points */
    DRIVE_HOMING,   /**< moves by itself to find its zero; set-points are ignored */
    DRIVE_FAULT     /**< stopped by itself, or because of guard; fault_code has the reason. Only DRIVES_RESET_FAULT ends it */
} drive_state_t;

/** An error that heaved found between a drive's set-points and its position; the set-point was not sent. All 0: none. */
typedef struct {
    q32_t jump_q32;    /**< distance from the previous set-point [mm, deg] if that is too far; else 0 */
    q32_t lag_q32;     /**< distance from the actual position if that is too far; else 0 */
    q32_t allowed_q32; /**< the allowed distance */
} drive_guard_t;

/** True if an error was found. */
static inline bool drive_guard_is_found(const drive_guard_t *guard)
{
    return guard->jump_q32 != 0 || guard->lag_q32 != 0;
}

/** Codes of the drivers for another master on the bus. */
#define DRIVE_CODE_MASTER_FIRST 0x1001Du
#define DRIVE_CODE_MASTER_LAST  0x10020u

/** What one drive reports. */
typedef struct {
    drive_state_t state;
    bool is_homed;       /**< actual counts from the true zero */
    bool has_actual;     /**< actual_mm_q32 and actual_us are valid (since the drive first reported) */
    bool is_energized;   /**< its torque is on as far as is known: the drive reports it, or has not confirmed yet that it is off.
                            A drive without a status confirms by accepting the command. While OFFLINE: the last known state */
    q32_t actual_mm_q32; /**< extension [mm], or angle [deg] of the rotation motor; jumps when homing ends */
    uint64_t actual_us;  /**< when actual was measured or received; an old value means stale feedback */
    uint32_t fault_code; /**< the device's own code (16 bits), or the driver's (more), 0 = none; in DRIVE_FAULT, DRIVE_OFFLINE */
    drive_guard_t guard; /**< reason of DRIVE_FAULT if heaved found it */
} drive_feedback_t;

/** True if a drive has torque as far as is known, also one that no command takes it from. For display. */
static inline bool drive_has_torque(const drive_feedback_t *drive)
{
    return drive->is_energized || drive->state == DRIVE_ENABLED || drive->state == DRIVE_HOMING;
}

/** True if another master is why a drive is DRIVE_OFFLINE (the driver waits and sends nothing) or in DRIVE_FAULT. */
static inline bool drive_has_other_master(const drive_feedback_t *drive)
{
    return (drive->state == DRIVE_OFFLINE || drive->state == DRIVE_FAULT) && drive->fault_code >= DRIVE_CODE_MASTER_FIRST &&
           drive->fault_code <= DRIVE_CODE_MASTER_LAST;
}

/** Conditions of a drive that do not stop it: bits of drive_report_t.notes. */
#define DRIVE_NOTES       7u
#define DRIVE_NOTE_MASTER 6u /**< another master commands it, too */
static inline const char *drive_note_text(unsigned note)
{
    static const char *const k_texts[DRIVE_NOTES] = {
        "has left its mode of operation",     "ignores its set-points",   "is under local control and may ignore a quick stop",
        "has no voltage at its power stage",  "is at a limit of its own", "warns",
        "is commanded by another master too",
    };
    return note < DRIVE_NOTES ? k_texts[note] : "";
}

/** The last error message of a drive (EMCY), with or without consequences. All 0: none yet. */
typedef struct {
    uint64_t at_us;
    uint32_t count; /**< since the start */
    uint16_t code;
    uint8_t error_register;
    uint8_t maker[5]; /**< manufacturer-specific bytes */
    bool is_over;     /**< the drive has cleared it since, or has restarted */
} drive_emergency_t;

/** Values that a drive measures in addition to its position: bits of drive_telemetry_t.has. */
enum { DRIVE_HAS_TORQUE = 1, DRIVE_HAS_LAG = 2, DRIVE_HAS_INPUTS = 4 };

/** The newest of these values. All 0: none yet. */
typedef struct {
    uint64_t at_us;
    q32_t lag_q32;           /**< following error as the drive calculates it: demanded minus actual position [mm, deg] */
    int32_t torque_permille; /**< of the rated torque; positive pushes out */
    uint32_t inputs;         /**< digital inputs, as 60FDh has them: bit 0 negative limit, 1 positive limit, 2 home */
    uint8_t has;             /**< values that the drive sends */
} drive_telemetry_t;

/** Status of one drive in words. Constant texts, "" if there is nothing to report; never NULL. */
typedef struct {
    bool is_modbus;      /**< address is a unit, object a register << 8 */
    uint8_t address;     /**< on the bus; 0 = none; with an identifier: number of the drive */
    uint8_t channel;     /**< its axis at this address, from 1; 0 = there is no other */
    uint32_t identifier; /**< CAN identifier of its replies, for drives with frames of their own; 0 = another bus */
    const char *phase;   /**< "missing", "configuring", "ready", "enabled", "fault", or the reason for waiting */
    const char *trouble; /**< present or last problem */
    const char *detail;  /**< details of the problem */
    const char *error;   /**< meaning of emergency.code; NULL if there was none */
    drive_emergency_t emergency;
    drive_telemetry_t telemetry;
    uint32_t code;        /**< number of trouble, 0 = none */
    uint32_t object;      /**< object being written, or object of the trouble: index << 8 | sub-index; 0 = none */
    uint32_t detail_code; /**< of the protocol, or the value found; 0 = none */
    bool has_found;       /**< object holds found instead of wanted */
    uint32_t found;
    uint32_t wanted;
    uint32_t notes;       /**< conditions, now or in the last seconds: bit N for drive_note_text(N) */
    uint64_t since_us;    /**< of the trouble, else of the phase */
    uint32_t period_us;   /**< measured time between two set-points accepted by the drive; 0 = unknown */
    uint64_t setpoint_us; /**< when it accepted the newest one; 0 = none, or not known */
} drive_report_t;

/** Requests to all axes together. All or none, because a single leg that stops racks the platform. */
typedef enum {
    DRIVES_ENABLE,     /**< DISABLED -> ENABLING -> ENABLED; the set-points sent must equal actual until every axis is ENABLED */
    DRIVES_DISABLE,    /**< any -> DISABLED (torque off by the drives' own ramps and brakes: is_energized tells when it is);
                          FAULT and OFFLINE stay */
    DRIVES_HOME,       /**< ENABLED -> HOMING -> ENABLED and is_homed. Afterwards the set-points must start at actual again */
    DRIVES_QUICK_STOP, /**< stop now by the drives' own ramps; DISABLED from then on. Also ends ENABLING and HOMING. The torque
                          goes off as soon as a drive stands still, after five seconds at the latest: see is_energized. DISABLE
                          and RESET_FAULT do not cut it short */
    DRIVES_RESET_FAULT /**< FAULT -> DISABLED where the cause is gone, else FAULT stays */
} drives_request_t;

/** True if a request is allowed in this state of an axis. A backend refuses a request unless all its axes allow it. */
static inline bool drives_allow(drives_request_t request, drive_state_t state)
{
    if (request == DRIVES_ENABLE) {
        return state == DRIVE_DISABLED || state == DRIVE_ENABLING || state == DRIVE_ENABLED;
    }
    return request != DRIVES_HOME || state == DRIVE_ENABLED;
}

#define DRIVE_OBJECT_BYTES 64u

/** An entry of the object dictionary of a drive, for a person who reads or sets it. The motion does not use this. */
typedef struct {
    uint16_t index;
    uint8_t sub;
    bool is_write;
    uint8_t size; /**< number of bytes in value: [1, DRIVE_OBJECT_BYTES] for a write; after a read, those received */
    uint8_t value[DRIVE_OBJECT_BYTES]; /**< least significant byte first */
} drive_object_t;

/** Progress of an access to such an entry. */
typedef enum {
    DRIVE_OBJECT_NONE, /**< there was none */
    DRIVE_OBJECT_BUSY,
    DRIVE_OBJECT_DONE,
    DRIVE_OBJECT_REFUSED, /**< by the drive, with a code of its protocol */
    DRIVE_OBJECT_SILENT,  /**< no answer in time */
    DRIVE_OBJECT_LEFT     /**< cancelled: the driver itself needed the drive, or has lost it */
} drive_object_state_t;

/** All ops are mandatory, except those marked as optional. */
typedef struct {
    hv_status_t (*poll)(void *ctx, uint64_t now_us, drive_feedback_t feedback[DRIVES_MAX]);
    hv_status_t (*send)(void *ctx, uint64_t now_us, const q32_t setpoint_q32[DRIVES_MAX]);
    hv_status_t (*request)(void *ctx, drives_request_t request);
    uint8_t (*count)(void *ctx);
    void (*report)(void *ctx, uint8_t axis, drive_report_t *out);                       /* optional */
    bool (*is_failing)(void *ctx);                                                      /* optional: never */
    hv_status_t (*request_one)(void *ctx, uint8_t axis, drives_request_t request);      /* optional: all or none */
    bool (*counts)(void *ctx, uint8_t axis, int64_t *out);                              /* optional: not known */
    hv_status_t (*object_begin)(void *ctx, uint8_t axis, const drive_object_t *object); /* optional, with the next */
    drive_object_state_t (*object_end)(void *ctx, drive_object_t *out, uint32_t *code);
    bool (*is_stopping)(void *ctx); /* optional: never */
} drives_ops_t;

/** Passed by value; ctx belongs to the backend and lives until its close. */
typedef struct {
    const drives_ops_t *ops;
    void *ctx;
} drives_t;

/** True if every mandatory op is set. If not, refuse to start. */
static inline bool drives_valid(drives_t drives)
{
    return drives.ops != NULL && drives.ops->poll != NULL && drives.ops->send != NULL && drives.ops->request != NULL &&
           drives.ops->count != NULL;
}

/** Axes, [1, DRIVES_MAX]; constant from the open on. */
static inline uint8_t drives_count(drives_t drives)
{
    return drives.ops->count(drives.ctx);
}

/** Processes received data and returns the state of each axis. Call once per cycle, before send. Never blocks (<= 200 us).
 *  @param now_us   never decreasing
 *  @param feedback out: the first drives_count() entries, always written (also on errors); the others unchanged
 *  @return HV_OK; HV_ERR_IO: the bus is gone, every axis is DRIVE_OFFLINE; go on polling, it may return (then
 *          DRIVE_DISABLED). */
static inline HV_MUST_CHECK hv_status_t drives_poll(drives_t drives, uint64_t now_us, drive_feedback_t feedback[DRIVES_MAX])
{
    return drives.ops->poll(drives.ctx, now_us, feedback);
}

/** Sends one coherent set of set-points, all axes or none. Call once per cycle, also while axes are not enabled: they ignore it,
 *  and watchdogs of the bus do not trip. Never blocks (<= 200 us). A drive follows set-points in ENABLED only. When it becomes
 *  ENABLED the set-point must equal the actual position; an axis whose set-point jumps faults (following error).
 *  @param setpoint_q32 the caller's, read before the return
 *  @return HV_OK; HV_ERR_AGAIN: the bus has not taken the last set yet, and all of this one is dropped. The motion has to wait
 * and offer the same set in the next cycle, so that drives see no larger step. After three bus periods without a sent set, poll
 * reports the bus as gone; HV_ERR_IO: the bus is gone. */
static inline HV_MUST_CHECK hv_status_t drives_send(drives_t drives, uint64_t now_us, const q32_t setpoint_q32[DRIVES_MAX])
{
    return drives.ops->send(drives.ctx, now_us, setpoint_q32);
}

/** Requests a change of all axes; asynchronous. A newer request replaces an unfinished one. Never blocks (<= 50 us). The next
 *  poll already returns ENABLING or HOMING for ENABLE or HOME, so that the previous state cannot be mistaken for the end of the
 *  request; later polls show the end. Axes in other states do not change.
 *  @return HV_OK: taken; HV_ERR_AGAIN: not taken, repeat it in the next cycle (ENABLE: perhaps a quick stop has not ended yet);
 * HV_ERR_STATE: not every axis is in a state that
 * the request needs (ENABLE: DISABLED, ENABLING or ENABLED; HOME: ENABLED), nothing changes; HV_ERR_IO: the bus is gone, no drive
 * receives it. */
static inline HV_MUST_CHECK hv_status_t drives_request(drives_t drives, drives_request_t request)
{
    return drives.ops->request(drives.ctx, request);
}

/** The same for a single axis, for SERVICE: the other axes and their set-points do not change. Requests to all axes override
 * it. ENABLE and HOME need the state of this axis only.
 *  @param axis [0, drives_count())
 *  @return as drives_request(); HV_ERR_NOSUP: this bus can only enable all drives together */
static inline HV_MUST_CHECK hv_status_t drives_request_one(drives_t drives, uint8_t axis, drives_request_t request)
{
    return drives.ops->request_one != NULL ? drives.ops->request_one(drives.ctx, axis, request) : HV_ERR_NOSUP;
}

/** Raw count of the drive's position, before scale, sign and zero, for people. As of the last poll; never blocks.
 *  @param axis [0, drives_count())
 *  @param out unchanged if the function returns false
 *  @return false: the drive has not sent it yet, or this backend has no counts */
static inline bool drives_counts(drives_t drives, uint8_t axis, int64_t *out)
{
    return drives.ops->counts != NULL && drives.ops->counts(drives.ctx, axis, out);
}

/** Begins to read or to write an entry of a drive's dictionary. It does not affect the motion. One access at a time is possible
 * on the whole bus, and the following polls carry it out. Never blocks (<= 50 us).
 *  @param axis   [0, drives_count())
 *  @param object copied
 *  @return HV_OK: begun; HV_ERR_AGAIN: another access is in progress; HV_ERR_STATE: the drive does not answer, or the driver is
 * talking to it; HV_ERR_ARG: a write to an entry that the driver itself relies on; HV_ERR_RANGE: no such size; HV_ERR_NOSUP:
 * these drives have no such dictionary */
static inline HV_MUST_CHECK hv_status_t drives_object_begin(drives_t drives, uint8_t axis, const drive_object_t *object)
{
    return drives.ops->object_begin != NULL ? drives.ops->object_begin(drives.ctx, axis, object) : HV_ERR_NOSUP;
}

/** State of the last access, as of the last poll.
 *  @param out  in DONE after a read: size and value; else unchanged
 *  @param code in REFUSED: the drive's reason; else unchanged */
static inline drive_object_state_t drives_object_end(drives_t drives, drive_object_t *out, uint32_t *code)
{
    return drives.ops->object_end != NULL ? drives.ops->object_end(drives.ctx, out, code) : DRIVE_OBJECT_NONE;
}

/** Status of a drive, for display. Never blocks.
 *  @param axis [0, drives_count())
 *  @return false if the backend has no report; out is then all "" and 0 */
static inline bool drives_report(drives_t drives, uint8_t axis, drive_report_t *out)
{
    *out = (drive_report_t){.phase = "", .trouble = "", .detail = ""};
    if (drives.ops->report == NULL) {
        return false;
    }
    drives.ops->report(drives.ctx, axis, out);
    return true;
}

/** True while the driver has to tell drives something at the end of a quick stop, or has not told them yet to stop. At the end of
 * the program, poll until then. As of the last poll; never blocks. */
static inline bool drives_is_stopping(drives_t drives)
{
    return drives.ops->is_stopping != NULL && drives.ops->is_stopping(drives.ctx);
}

/** True while the bus still works but is likely to be lost soon (a CAN controller that stays error-passive): there is time for a
 *  controlled stop. As of the last poll; never blocks. */
static inline bool drives_is_failing(drives_t drives)
{
    return drives.ops->is_failing != NULL && drives.ops->is_failing(drives.ctx);
}

#endif
