/* SPDX-License-Identifier: MIT
 * drives.h - contract of the drive layer: what the gateway talks to, whatever bus or simulation is behind it.
 * Values in mm (deg for the rotation motor), one entry per axis: the cylinders, then the rotation motor where there is one.
 * The motion thread alone calls the ops; none blocks. Scaling, signs and bus protocol stay below this line, limits stay above it.
 */
#ifndef HEAVE_DRIVES_H
#define HEAVE_DRIVES_H

#include "heave/axes.h"

/** Most axes: the cylinders and the rotation motor. */
#define DRIVES_MAX (CYLINDERS_MAX + 1u)

/** State of one drive. */
typedef enum {
    DRIVE_OFFLINE,  /**< does not answer (any more), or is not configured yet; nothing else in its feedback is current */
    DRIVE_DISABLED, /**< answers, no torque */
    DRIVE_ENABLING, /**< on the way to DRIVE_ENABLED; may hold the position already */
    DRIVE_ENABLED,  /**< follows the set-points */
    DRIVE_HOMING,   /**< moves by itself to find its zero; set-points are ignored */
    DRIVE_FAULT /**< stopped itself, or was stopped by what guard tells; fault_code says why. Left only by DRIVES_RESET_FAULT */
} drive_state_t;

/** What heaved itself found between a drive's set-points and its position; such a set-point has not been sent. All 0: nothing. */
typedef struct {
    q32_t jump_q32;    /**< so far from the set-point before [mm, deg], which is too far; else 0 */
    q32_t lag_q32;     /**< so far from actual, which is too far; else 0 */
    q32_t allowed_q32; /**< so far it may be */
} drive_guard_t;

/** Whether anything was found. */
static inline bool drive_guard_is_found(const drive_guard_t *guard)
{
    return guard->jump_q32 != 0 || guard->lag_q32 != 0;
}

/** What one drive reports. */
typedef struct {
    drive_state_t state;
    bool is_homed;       /**< actual counts from the true zero */
    bool has_actual;     /**< actual_mm_q32 and actual_us are valid (since the drive first reported) */
    bool is_energized;   /**< its torque is on, as far as is known: it says so, or has not confirmed yet that it is off, which
                            one without a status does by taking what it is told. While OFFLINE: as it was heard last */
    q32_t actual_mm_q32; /**< extension [mm], or angle [deg] of the rotation motor; jumps when homing ends */
    uint64_t actual_us;  /**< when actual was measured or received; an old value means stale feedback */
    uint32_t fault_code; /**< the device's own code (16 bits), or the driver's (more), 0 = none; in DRIVE_FAULT, DRIVE_OFFLINE */
    drive_guard_t guard; /**< why DRIVE_FAULT, where the drive itself has not found it */
} drive_feedback_t;

/** What a drive that goes on tells: bits of drive_report_t.notes. */
#define DRIVE_NOTES 6u
static inline const char *drive_note_text(unsigned note)
{
    static const char *const k_texts[DRIVE_NOTES] = {
        "has left its mode of operation",    "ignores its set-points",   "is under local control and may ignore a quick stop",
        "has no voltage at its power stage", "is at a limit of its own", "warns",
    };
    return note < DRIVE_NOTES ? k_texts[note] : "";
}

/** The last error that a drive told of by itself (EMCY), whatever came of it. All 0: none yet. */
typedef struct {
    uint64_t at_us;
    uint32_t count; /**< since the start */
    uint16_t code;
    uint8_t error_register;
    uint8_t maker[5]; /**< what the manufacturer makes of these bytes */
    bool is_over;     /**< it has taken it back since, or started again */
} drive_emergency_t;

/** What one drive is at, in words for people. Constant texts, "" where there is nothing to say; never NULL. */
typedef struct {
    bool is_modbus;      /**< address is a unit, object a register << 8 */
    uint8_t address;     /**< on the bus; 0 = has none */
    const char *phase;   /**< "missing", "configuring", "ready", "enabled", "fault", or what it waits for */
    const char *trouble; /**< what is or was wrong with it */
    const char *detail;  /**< more about that */
    const char *error;   /**< what emergency.code means; NULL where there was none */
    drive_emergency_t emergency;
    uint32_t code;        /**< number of trouble, 0 = none */
    uint32_t object;      /**< of the device, index << 8 | sub-index: what is being set, or what the trouble is about; 0 = none */
    uint32_t detail_code; /**< of the protocol, or the value found; 0 = none */
    bool has_found;       /**< object holds found instead of wanted */
    uint32_t found;
    uint32_t wanted;
    uint32_t notes;       /**< what it tells beside that, or told in the last seconds: bit N for drive_note_text(N) */
    uint64_t since_us;    /**< of the trouble, else of the phase */
    uint32_t period_us;   /**< measured, from one set-point that the drive took to the next; 0 = unknown */
    uint64_t setpoint_us; /**< when it took the newest one; 0 = none, or not known */
} drive_report_t;

/** Requests to all axes together: all or none, because one leg that stops alone racks the platform. */
typedef enum {
    DRIVES_ENABLE,     /**< DISABLED -> ENABLING -> ENABLED; the set-points sent must equal actual until every axis is ENABLED */
    DRIVES_DISABLE,    /**< any -> DISABLED (torque off by the drives' own ramps and brakes: is_energized tells when it is);
                          FAULT and OFFLINE stay */
    DRIVES_HOME,       /**< ENABLED -> HOMING -> ENABLED and is_homed. Afterwards the set-points must start at actual again */
    DRIVES_QUICK_STOP, /**< stop now by the drives' own ramps, then DISABLED; also ends ENABLING and HOMING */
    DRIVES_RESET_FAULT /**< FAULT -> DISABLED where the cause is gone, else FAULT stays */
} drives_request_t;

/** True where an axis may be in a state when a request comes: a backend refuses a request unless that is so of all its axes. */
static inline bool drives_allow(drives_request_t request, drive_state_t state)
{
    if (request == DRIVES_ENABLE) {
        return state == DRIVE_DISABLED || state == DRIVE_ENABLING || state == DRIVE_ENABLED;
    }
    return request != DRIVES_HOME || state == DRIVE_ENABLED;
}

/** Every op is mandatory but report and is_failing. */
typedef struct {
    hv_status_t (*poll)(void *ctx, uint64_t now_us, drive_feedback_t feedback[DRIVES_MAX]);
    hv_status_t (*send)(void *ctx, uint64_t now_us, const q32_t setpoint_q32[DRIVES_MAX]);
    hv_status_t (*request)(void *ctx, drives_request_t request);
    uint8_t (*count)(void *ctx);
    void (*report)(void *ctx, uint8_t axis, drive_report_t *out); /* optional */
    bool (*is_failing)(void *ctx);                                /* optional: never */
} drives_ops_t;

/** Passed by value; ctx belongs to the backend and lives until its close. */
typedef struct {
    const drives_ops_t *ops;
    void *ctx;
} drives_t;

/** True where every mandatory op is there; refuse to start otherwise. */
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

/** Takes in what has arrived and tells the state of each axis. Once per cycle, before send. Never blocks (<= 200 us).
 *  @param now_us   never decreasing
 *  @param feedback out: the first drives_count() entries, always written (also on errors); the others unchanged
 *  @return HV_OK; HV_ERR_IO: the bus is gone, every axis is DRIVE_OFFLINE; go on polling, it may return (then
 *          DRIVE_DISABLED). */
static inline HV_MUST_CHECK hv_status_t drives_poll(drives_t drives, uint64_t now_us, drive_feedback_t feedback[DRIVES_MAX])
{
    return drives.ops->poll(drives.ctx, now_us, feedback);
}

/** Sends one coherent set of set-points, all axes or none. Once per cycle, also while axes are not enabled: they ignore it,
 *  and buses that watch for silence stay content. Never blocks (<= 200 us). A drive takes a set-point in ENABLED only. At
 *  the moment it becomes ENABLED the set-point must equal actual; an axis that is asked to jump faults (following error).
 *  @param setpoint_q32 the caller's, read before the return
 *  @return HV_OK; HV_ERR_AGAIN: the bus has not taken the last set yet, this one is dropped whole: let the motion wait and
 *          offer the same set again next cycle, so that drives see no larger step. A backend that gets nothing through for
 *          three of its bus periods reports the bus as gone in poll; HV_ERR_IO: the bus is gone. */
static inline HV_MUST_CHECK hv_status_t drives_send(drives_t drives, uint64_t now_us, const q32_t setpoint_q32[DRIVES_MAX])
{
    return drives.ops->send(drives.ctx, now_us, setpoint_q32);
}

/** Asks all axes for a change; asynchronous. A newer request replaces an unfinished one. Never blocks (<= 50 us). The next
 *  poll already shows that ENABLE or HOME has begun (ENABLING, HOMING), so that the state before it cannot be taken for its
 *  end; the end is seen in later polls. Axes for which the request means nothing in their state stay as they are.
 *  @return HV_OK: taken; HV_ERR_AGAIN: not taken, ask again next cycle; HV_ERR_STATE: not every axis is in a state that the
 *          request needs (ENABLE: DISABLED, ENABLING or ENABLED; HOME: ENABLED), nothing changes; HV_ERR_IO: the bus is
 *          gone, nobody hears it. */
static inline HV_MUST_CHECK hv_status_t drives_request(drives_t drives, drives_request_t request)
{
    return drives.ops->request(drives.ctx, request);
}

/** What a drive is at, for people. Never blocks.
 *  @param axis [0, drives_count())
 *  @return false where the backend has nothing to say; out is then all "" and 0 */
static inline bool drives_report(drives_t drives, uint8_t axis, drive_report_t *out)
{
    *out = (drive_report_t){.phase = "", .trouble = "", .detail = ""};
    if (drives.ops->report == NULL) {
        return false;
    }
    drives.ops->report(drives.ctx, axis, out);
    return true;
}

/** True while the bus still works but is likely to be lost soon (a CAN controller that stays error-passive): there is time for a
 *  controlled stop. As of the last poll; never blocks. */
static inline bool drives_is_failing(drives_t drives)
{
    return drives.ops->is_failing != NULL && drives.ops->is_failing(drives.ctx);
}

#endif
