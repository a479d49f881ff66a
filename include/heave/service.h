/* SPDX-License-Identifier: MIT
 * service.h - manual operation in SERVICE: torque of single drives, jogs, homing, relays. Everything that moves or switches
 * something is held: it continues only while a person holds a button (deadman.h), and only one thing is held at a time.
 * Requests are plain data, so that a recording can hold them.
 */
#ifndef HEAVE_SERVICE_H
#define HEAVE_SERVICE_H

#include "heave/axes.h"
#include "heave/deadman.h"
#include "heave/drives.h"
#include "heave/excitation.h"

/** Kind of a request. */
typedef enum {
    SERVICE_NOTHING,
    SERVICE_TORQUE_ON,
    SERVICE_TORQUE_OFF,
    SERVICE_JOG_AXIS, /**< held, as the five below: jogs a cylinder, or the rotation motor */
    SERVICE_JOG_POSE,
    SERVICE_HOME,
    SERVICE_RELAY,
    SERVICE_SIGNAL_AXIS, /**< a test signal on a cylinder, or on the rotation motor */
    SERVICE_SIGNAL_POSE,
    SERVICE_BEAT,   /**< the button is still held */
    SERVICE_RELEASE /**< the button was released */
} service_verb_t;

#define SERVICE_VERBS (SERVICE_RELEASE + 1u)

/** All drives together. */
#define SERVICE_ALL 0u

/** A request. Members that its verb does not need are 0. */
typedef struct {
    service_verb_t verb;
    uint8_t axis;    /**< from 1: a drive, an axis of the pose, or a relay; SERVICE_ALL is for torque and homing */
    q16_t speed_q16; /**< of a jog: mm/s or deg/s, the sign is the direction */
    q16_t way_q16;   /**< of a jog: distance in mm or deg; 0: to the end of the range */
    excitation_request_t signal;
    uint32_t series;  /**< of held requests, BEAT and RELEASE: see deadman.h */
    uint32_t counter; /**< of BEAT */
    uint64_t age_us;  /**< of held requests and BEAT: age of their tick, by gateway_tick_age() */
} service_request_t;

/** Result of a request. */
typedef enum {
    SERVICE_DONE,
    SERVICE_NOT_SERVING, /**< the platform is not in SERVICE */
    SERVICE_STALE,       /**< see deadman.h */
    SERVICE_OVER,        /**< likewise */
    SERVICE_KNOWN,       /**< likewise */
    SERVICE_BUSY,        /**< something is held, or has not come to rest yet */
    SERVICE_NO_SUCH,     /**< no such drive, axis or relay */
    SERVICE_NO_TORQUE,   /**< a drive that would have to move has none, or is not ready */
    SERVICE_NOT_HOMED,   /**< a jog of the pose needs all cylinders homed */
    SERVICE_AT_END,      /**< the axis is at its end in that direction, or the speed is too low */
    SERVICE_NO_POSE,     /**< no pose belongs to the present extensions */
    SERVICE_TOGETHER,    /**< this bus can do that only with all drives together */
    SERVICE_NOT_TAKEN,   /**< the drives do not accept the request now */
    SERVICE_PULSE,       /**< that relay carries the healthy pulse */
    SERVICE_TOO_WIDE,    /**< a test signal wider than settings allow */
    SERVICE_BAD_SIGNAL,  /**< excitation_is_allowed() is false */
    SERVICE_MOVING,      /**< objects of drives can be read only in OFF, SERVICE, FAULT and ESTOP */
    SERVICE_NO_OBJECTS,  /**< these drives have no dictionary that heaved knows */
    SERVICE_ABSENT,      /**< the drive does not answer, or heaved is talking to it */
    SERVICE_RELIED_ON,   /**< a write to an object that heaved itself relies on */
    SERVICE_ANSWERS
} service_answer_t;

/** The reason for people: constant text; "" for SERVICE_DONE, "?" outside the enum. */
const char *service_answer_text(service_answer_t answer);

/** The reason for programs, one word: "busy", "stale", ...; "" for SERVICE_DONE, "?" outside the enum. */
const char *service_answer_name(service_answer_t answer);

/** "jog", "beat", ...: the word of a request, constant text; "?" outside the enum. */
const char *service_verb_name(service_verb_t verb);

/** True for requests that are held: they continue only while a person holds a button. */
static inline bool service_is_held(service_verb_t verb)
{
    return verb >= SERVICE_JOG_AXIS && verb <= SERVICE_SIGNAL_POSE;
}

/** State of manual operation. Modules outside src/gateway may read members for display only. */
typedef struct {
    deadman_t hand;
    service_verb_t doing;             /**< what is held; else SERVICE_NOTHING */
    uint8_t axis;                     /**< axis of doing, as in the request */
    bool has_end;                     /**< doing ends by itself: a signal, homing, a jog over a distance */
    uint32_t wanted;                  /**< drives that were asked to have torque: bit i for drive i + 1 */
    uint32_t up;                      /**< drives of these that have torque */
    uint32_t homing;                  /**< drives that are homing */
    uint32_t off_due;                 /**< drives to switch off; the bus has not accepted this request yet */
    uint32_t stop_due;                /**< drives to stop homing; likewise */
    uint64_t deadline_us[DRIVES_MAX]; /**< by this time a drive must be enabled, or homed */
    uint32_t finished;                /**< newest series that came to its end by itself */
    uint64_t late_us;                 /**< time of the cycles skipped so far; it counts towards the age of a proof */
} service_t;

/** State of manual operation for display. */
typedef struct {
    uint64_t tick_us; /**< clients send it back as a proof */
    service_verb_t doing;
    uint8_t axis;
    bool is_held;
    uint32_t series;
    uint32_t finished; /**< newest series that came to its end by itself: a signal, homing */
    uint32_t torque;   /**< bit i: drive i + 1 has torque */
    uint32_t homing;
    uint32_t has_counts; /**< bit i: counts[i] is known */
    int64_t counts[DRIVES_MAX];
} service_view_t;

#endif
