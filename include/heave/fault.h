/* SPDX-License-Identifier: MIT
 * fault.h - machine faults: how the platform reacts to each (fault.c), what it means and what to do (fault_help.c).
 * A fault latches: only an operator's reset, with the cause gone, ends it. The first one is kept, all are counted, the worst
 * reaction wins. docs/faults.md is made from both. Pure and constant.
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
    FAULT_OUTSIDE_STROKE, /**< a drive that is coming up says that its cylinder stands outside its stroke */
    FAULT_CODES
} fault_code_t;

/** What the platform does, the mildest first. */
typedef enum {
    FAULT_REACT_NONE,
    FAULT_REACT_STOP,       /**< controlled stop of all axes together, then disable */
    FAULT_REACT_QUICK_STOP, /**< every drive stops now by its own ramp, all in the same cycle, then disable */
    FAULT_REACT_SILENT      /**< nobody hears the gateway: it stops talking, so that the drives' own watchdogs stop them */
} fault_reaction_t;

/** The reaction to a code; that to FAULT_NONE outside the enum. */
fault_reaction_t fault_reaction(fault_code_t code);

/** What has happened, in English: constant text. */
const char *fault_text(fault_code_t code);

/** Whether a drive has found it, rather than heaved. */
bool fault_is_found_by_drive(fault_code_t code);

/** Whether it is of one axis: of a drive, or of what hangs on it. */
bool fault_is_of_axis(fault_code_t code);

/** "stop", "quick-stop", ...: constant text. */
const char *fault_reaction_name(fault_reaction_t reaction);

/** Languages of the help. */
typedef enum { FAULT_ENGLISH, FAULT_CHINESE, FAULT_LANGUAGES } fault_language_t;

/** More about a fault; texts are UTF-8. */
typedef struct {
    const char *name;                    /**< a word for programs */
    const char *text_zh;                 /**< fault_text() in Chinese */
    const char *cause[FAULT_LANGUAGES];  /**< what it usually comes from */
    const char *remedy[FAULT_LANGUAGES]; /**< what to do */
} fault_help_t;

/** That of a code; of FAULT_NONE outside the enum. */
const fault_help_t *fault_help(fault_code_t code);

#endif
