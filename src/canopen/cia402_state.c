/* SPDX-License-Identifier: MIT
 * cia402_state.c - statusword and controlword; see cia402_state.h.
 */
#include "heave/cia402_state.h"

static const struct {
    uint16_t mask;
    uint16_t value;
    cia402_state_t state;
} k_states[] = {
    {0x4F, 0x00, CIA402_NOT_READY},          {0x4F, 0x40, CIA402_SWITCH_ON_DISABLED},
    {0x6F, 0x21, CIA402_READY_TO_SWITCH_ON}, {0x6F, 0x23, CIA402_SWITCHED_ON},
    {0x6F, 0x27, CIA402_OPERATION_ENABLED},  {0x6F, 0x07, CIA402_QUICK_STOP_ACTIVE},
    {0x4F, 0x0F, CIA402_FAULT_REACTION},     {0x4F, 0x08, CIA402_FAULT},
};

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

cia402_state_t cia402_state(uint16_t statusword)
{
    for (size_t i = 0; i < sizeof k_states / sizeof k_states[0]; i++) {
        if ((statusword & k_states[i].mask) == k_states[i].value) {
            return k_states[i].state;
        }
    }
    return CIA402_STRANGE;
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
