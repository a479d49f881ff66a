/* SPDX-License-Identifier: MIT
 * service.h - what a person may do by hand in SERVICE: torque of single drives, jogs, homing, relays. All that moves or switches
 * something is held: it goes on while the hand is there (deadman.h), one thing at a time. Requests are plain data, so that a
 * recording holds them.
 */
#ifndef HEAVE_SERVICE_H
#define HEAVE_SERVICE_H

#include "heave/axes.h"
#include "heave/deadman.h"
#include "heave/drives.h"

/** What is asked for. */
typedef enum {
    SERVICE_NOTHING,
    SERVICE_TORQUE_ON,
    SERVICE_TORQUE_OFF,
    SERVICE_JOG_AXIS, /**< held, as the three below: a cylinder, or the rotation motor */
    SERVICE_JOG_POSE,
    SERVICE_HOME,
    SERVICE_RELAY,
    SERVICE_BEAT,   /**< the hand is still there */
    SERVICE_RELEASE /**< it lets go */
} service_verb_t;

#define SERVICE_VERBS (SERVICE_RELEASE + 1u)

/** Drives, all together. */
#define SERVICE_ALL 0u

/** A request; what a verb does not need is 0. */
typedef struct {
    service_verb_t verb;
    uint8_t axis;     /**< from 1: a drive, an axis of the pose, a relay; SERVICE_ALL of torque and homing */
    q16_t speed_q16;  /**< of a jog: mm/s or deg/s, the sign says where to */
    uint32_t series;  /**< of what is held, BEAT and RELEASE: see deadman.h */
    uint32_t counter; /**< of BEAT */
    uint64_t age_us;  /**< of the tick that came with what is held, and with BEAT; gateway_tick_age() */
} service_request_t;

/** What became of it. */
typedef enum {
    SERVICE_DONE,
    SERVICE_NOT_SERVING, /**< the platform is not in SERVICE */
    SERVICE_STALE,       /**< see deadman.h */
    SERVICE_OVER,        /**< likewise */
    SERVICE_KNOWN,       /**< likewise */
    SERVICE_BUSY,        /**< something is held, or has not come to rest yet */
    SERVICE_NO_SUCH,     /**< no such drive, axis or relay */
    SERVICE_NO_TORQUE,   /**< a drive that would have to move has none, or is not ready */
    SERVICE_NOT_HOMED,   /**< poses take cylinders that have found their zero */
    SERVICE_AT_END,      /**< there is no way left in that direction, or the speed is too low to count */
    SERVICE_NO_POSE,     /**< no pose belongs to where the cylinders are */
    SERVICE_TOGETHER,    /**< this bus does that to all drives together only */
    SERVICE_NOT_TAKEN,   /**< the drives do not take the request now */
    SERVICE_PULSE,       /**< that relay carries the healthy pulse */
    SERVICE_ANSWERS
} service_answer_t;

/** Why, for people: constant text; "" where it was done, "?" outside the enum. */
const char *service_answer_text(service_answer_t answer);

/** The same in a word, for programs: "busy", "stale", ...; "" where it was done, "?" outside the enum. */
const char *service_answer_name(service_answer_t answer);

/** "jog", "beat", ...: the word of a request, constant text; "?" outside the enum. */
const char *service_verb_name(service_verb_t verb);

/** True for what goes on only while the hand is there. */
static inline bool service_is_held(service_verb_t verb)
{
    return verb >= SERVICE_JOG_AXIS && verb <= SERVICE_RELAY;
}

/** The state of it; members are private to src/gateway but for display. */
typedef struct {
    deadman_t hand;
    service_verb_t doing;             /**< what the hand holds; SERVICE_NOTHING */
    uint8_t axis;                     /**< of that, as in the request */
    uint32_t wanted;                  /**< torque: bit i for drive i + 1 */
    uint32_t up;                      /**< of those, which have it */
    uint32_t homing;                  /**< which look for their zero */
    uint32_t off_due;                 /**< of which the bus has not taken yet that they go off */
    uint32_t stop_due;                /**< or that they stop looking */
    uint64_t deadline_us[DRIVES_MAX]; /**< to come up, or to be homed */
    uint64_t late_us;                 /**< cycles that were skipped so far: a hand's time goes on in them */
} service_t;

/** What of it there is to see. */
typedef struct {
    uint64_t tick_us; /**< to be echoed */
    service_verb_t doing;
    uint8_t axis;
    bool is_held;
    uint32_t series;
    uint32_t torque; /**< bit i: drive i + 1 has it */
    uint32_t homing;
    uint32_t has_counts; /**< bit i: counts[i] is known */
    int64_t counts[DRIVES_MAX];
} service_view_t;

#endif
