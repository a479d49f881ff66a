/* SPDX-License-Identifier: MIT
 * cia402_state.h - the state machine of CiA 402 drives: decodes a statusword, and selects the controlword that leads to a goal.
 * Pure.
 */
#ifndef HEAVE_CIA402_STATE_H
#define HEAVE_CIA402_STATE_H

#include "heave/status.h"

/** States of a drive; CIA402_STRANGE is no state of the standard. */
typedef enum {
    CIA402_NOT_READY,
    CIA402_SWITCH_ON_DISABLED,
    CIA402_READY_TO_SWITCH_ON,
    CIA402_SWITCHED_ON,
    CIA402_OPERATION_ENABLED,
    CIA402_QUICK_STOP_ACTIVE,
    CIA402_FAULT_REACTION,
    CIA402_FAULT,
    CIA402_STRANGE,
    CIA402_STATES
} cia402_state_t;

/** Target state of a drive. */
typedef enum {
    CIA402_GOAL_OFF,     /**< no voltage, by the drive's own ramps: one step down at a time */
    CIA402_GOAL_STOP,    /**< quick stop, then off */
    CIA402_GOAL_ON,      /**< switched on, no torque */
    CIA402_GOAL_OPERATE, /**< operation enabled */
    CIA402_GOALS
} cia402_goal_t;

/** Bits of the controlword whose meaning depends on the mode. */
#define CIA402_WORD_SWITCH_ON  0x0001u
#define CIA402_WORD_BIT4       0x0010u /**< IP: interpolate; HM: start; PP: new set-point */
#define CIA402_WORD_AT_ONCE    0x0020u /**< PP: do not wait for the end of the last one */
#define CIA402_WORD_RESET      0x0080u /**< fault reset, on the rising edge */
#define CIA402_WORD_QUICK_STOP 0x0002u

/** Bits of the statusword. */
#define CIA402_STATUS_REACHED 0x0400u
#define CIA402_STATUS_BIT12   0x1000u /**< CSP: follows; IP: interpolates; HM: attained; PP: set-point taken */
#define CIA402_STATUS_BIT13   0x2000u /**< CSP, PP: following error; HM: homing error */
#define CIA402_STATUS_REMOTE  0x0200u /**< listens to the bus */
#define CIA402_STATUS_VOLTAGE 0x0010u /**< at the power stage */
#define CIA402_STATUS_WARNING 0x0080u
#define CIA402_STATUS_LIMIT   0x0800u /**< a limit of its own is active */

/** Decodes a statusword. */
cia402_state_t cia402_state(uint16_t statusword);

/** Controlword for the next step from a state to a goal; never 000Fh in quick stop. */
uint16_t cia402_controlword(cia402_state_t state, cia402_goal_t goal);

/** True if the drive has torque, or is switching it off. */
bool cia402_has_torque(cia402_state_t state);

/** "switched on", ...: constant text. */
const char *cia402_state_name(cia402_state_t state);

#endif
