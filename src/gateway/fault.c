/* SPDX-License-Identifier: MIT
 * fault.c - how the platform reacts to each machine fault; see fault.h. Their causes and remedies are in fault_help.c.
 */
#include "heave/fault.h"

typedef struct {
    fault_reaction_t reaction;
    const char *text;
} row_t;

static const row_t k_rows[FAULT_CODES] = {
    [FAULT_NONE] = {FAULT_REACT_NONE, "none"},
    [FAULT_DRIVE] = {FAULT_REACT_QUICK_STOP, "a drive reports a fault"},
    [FAULT_DRIVE_OFFLINE] = {FAULT_REACT_QUICK_STOP, "a drive does not answer"},
    [FAULT_DRIVE_DROPPED] = {FAULT_REACT_QUICK_STOP, "a drive left the enabled state by itself"},
    [FAULT_DRIVE_TIMEOUT] = {FAULT_REACT_QUICK_STOP, "the drives were not ready in time"},
    [FAULT_BUS] = {FAULT_REACT_SILENT, "the bus of the drives is lost"},
    [FAULT_FOLLOWING] = {FAULT_REACT_QUICK_STOP, "a cylinder does not follow its set-points"},
    [FAULT_BUS_FAILING] = {FAULT_REACT_STOP, "the bus of the drives is about to be lost"},
    [FAULT_SETPOINT_JUMP] = {FAULT_REACT_QUICK_STOP, "a set-point jumped away from its drive"},
    [FAULT_ESTOP_CHANNELS] = {FAULT_REACT_QUICK_STOP, "the channels of the e-stop disagree"},
    [FAULT_POWER] = {FAULT_REACT_STOP, "the supply is failing, and the platform was not settled in time"},
    [FAULT_OUTSIDE_STROKE] = {FAULT_REACT_QUICK_STOP, "a cylinder stands outside its stroke, says its drive"},
};

static const row_t *row_of(fault_code_t code)
{
    return &k_rows[(unsigned)code < FAULT_CODES ? code : FAULT_NONE];
}

fault_reaction_t fault_reaction(fault_code_t code)
{
    return row_of(code)->reaction;
}

const char *fault_text(fault_code_t code)
{
    return row_of(code)->text;
}

bool fault_is_found_by_drive(fault_code_t code)
{
    return code == FAULT_DRIVE;
}

bool fault_is_of_axis(fault_code_t code)
{
    return code == FAULT_DRIVE || code == FAULT_DRIVE_OFFLINE || code == FAULT_DRIVE_DROPPED || code == FAULT_FOLLOWING ||
           code == FAULT_SETPOINT_JUMP || code == FAULT_OUTSIDE_STROKE;
}

const char *fault_reaction_name(fault_reaction_t reaction)
{
    static const char *const k_names[] = {"none", "stop", "quick-stop", "silent"};
    return (unsigned)reaction <= FAULT_REACT_SILENT ? k_names[reaction] : "?";
}
