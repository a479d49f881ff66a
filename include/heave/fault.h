/* SPDX-License-Identifier: MIT
 * fault.h - machine faults: the reaction to each (fault.c), its meaning and its remedy (fault_help.c).
 * A fault latches: only an operator's reset ends it, after the cause is gone. The first fault is shown, all are counted, and the
 * worst reaction wins. docs/faults.md is generated from both tables. Pure and constant.
 */
#ifndef HEAVE_FAULT_H
#define HEAVE_FAULT_H

#include "heave/status.h"

/** Codes; they keep their numbers. */
typedef enum {
    FAULT_NONE,
    FAULT_DRIVE,          /**< a drive reports a fault (device_code says which) */
    FAULT_DRIVE_OFFLINE,  /**< a drive does not answer */
    FAULT_DRIVE_DROPPED,  /**< a drive left the enabled state by itself */
    FAULT_DRIVE_TIMEOUT,  /**< enabling or homing took too long */
    FAULT_BUS,            /**< the drives' bus is gone or takes no set-points */
    FAULT_FOLLOWING,      /**< an axis is too far from its set-point for too long, or from one that was then not sent */
    FAULT_BUS_FAILING,    /**< the drives' bus still works, but may be lost at any moment */
    FAULT_SETPOINT_JUMP,  /**< a set-point jumped away from its drive, and was not sent */
    FAULT_ESTOP_CHANNELS, /**< the two channels of the e-stop disagree for too long */
    FAULT_POWER,          /**< the supply fails, and the platform was not settled in time */
    FAULT_OUTSIDE_STROKE, /**< a drive reports a position outside its stroke while it comes up */
    FAULT_CODES
} fault_code_t;

/** Reactions, the mildest first. */
typedef enum {
    FAULT_REACT_NONE,
    FAULT_REACT_STOP,       /**< controlled stop of all axes together, then disable */
    FAULT_REACT_QUICK_STOP, /**< every drive stops now by its own ramp, all in the same cycle, then disable */
    FAULT_REACT_SILENT      /**< no drive receives anything: the gateway stops sending, so that the drives' watchdogs stop them */
} fault_reaction_t;

/** The reaction to a code; outside the enum, that of FAULT_NONE. */
fault_reaction_t fault_reaction(fault_code_t code);

/** What has happened, in English: constant text. */
const char *fault_text(fault_code_t code);

/** True if a drive detects this fault, false if heaved does. */
bool fault_is_found_by_drive(fault_code_t code);

/** True if the fault concerns one axis: a drive or its mechanics. */
bool fault_is_of_axis(fault_code_t code);

/** "stop", "quick-stop", ...: constant text. */
const char *fault_reaction_name(fault_reaction_t reaction);

/** Languages of the help. */
typedef enum { FAULT_ENGLISH, FAULT_CHINESE, FAULT_LANGUAGES } fault_language_t;

/** More about a fault; texts are UTF-8. */
typedef struct {
    const char *name;                    /**< a word for programs */
    const char *text_zh;                 /**< fault_text() in Chinese */
    const char *cause[FAULT_LANGUAGES];  /**< usual cause */
    const char *remedy[FAULT_LANGUAGES]; /**< what to do */
} fault_help_t;

/** The help of a code; outside the enum, that of FAULT_NONE. */
const fault_help_t *fault_help(fault_code_t code);

#endif
