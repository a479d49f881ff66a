/* SPDX-License-Identifier: MIT
 * cia402_state.c - statusword and controlword; see cia402_state.h.
 */
#include "heave/cia402_state.h"

/* Towards off a drive is led down by its ramps (605Ch, then 605Bh) before the voltage goes. Where a quick stop ends by itself
 * (605Ah 1 to 4) it is left alone. */
static const uint16_t k_words[CIA402_STATES][CIA402_GOALS] = {
    /*                              off     stop    on      operate */
    [CIA402_NOT_READY] = {0x0000, 0x0000, 0x0000, 0x0000},
    [CIA402_SWITCH_ON_DISABLED] = {0x0000, 0x0000, 0x0006, 0x0006},
    [CIA402_READY_TO_SWITCH_ON] = {0x0000, 0x0000, 0x0007, 0x0007},
    [CIA402_SWITCHED_ON] = {0x0006, 0x0002, 0x0007, 0x000F},
    [CIA402_OPERATION_ENABLED] = {0x0007, 0x0002, 0x0007, 0x000F},
    [CIA402_QUICK_STOP_ACTIVE] = {0x0002, 0x0002, 0x0002, 0x0002},
    [CIA402_FAULT_REACTION] = {0x0000, 0x0000, 0x0000, 0x0000},
    [CIA402_FAULT] = {0x0000, 0x0000, 0x0000, 0x0000},
    [CIA402_STRANGE] = {0x0000, 0x0002, 0x0000, 0x0000},
};

/* Bits 0 to 3, 5 and 6 tell. The mask of the standard leaves bit 5 out where both of its values are listed. */
cia402_state_t cia402_state(uint16_t statusword)
{
    switch (statusword & 0x6Fu) {
    case 0x00u:
    case 0x20u:
        return CIA402_NOT_READY;
    case 0x40u:
    case 0x60u:
        return CIA402_SWITCH_ON_DISABLED;
    case 0x21u:
        return CIA402_READY_TO_SWITCH_ON;
    case 0x23u:
        return CIA402_SWITCHED_ON;
    case 0x27u:
        return CIA402_OPERATION_ENABLED;
    case 0x07u:
        return CIA402_QUICK_STOP_ACTIVE;
    case 0x0Fu:
    case 0x2Fu:
        return CIA402_FAULT_REACTION;
    case 0x08u:
    case 0x28u:
        return CIA402_FAULT;
    default:
        return CIA402_STRANGE;
    }
}

uint16_t cia402_controlword(cia402_state_t state, cia402_goal_t goal)
{
    return k_words[state][goal];
}

bool cia402_has_torque(cia402_state_t state)
{
    return state == CIA402_OPERATION_ENABLED || state == CIA402_QUICK_STOP_ACTIVE || state == CIA402_FAULT_REACTION ||
           state == CIA402_STRANGE;
}

const char *cia402_state_name(cia402_state_t state)
{
    static const char *const k_names[CIA402_STATES] = {
        "not ready to switch on", "switch on disabled", "ready to switch on", "switched on",
        "operation enabled",      "quick stop",         "fault reaction",     "fault",
        "in no known state",
    };
    return k_names[state];
}
