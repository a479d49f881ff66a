/* SPDX-License-Identifier: MIT
 * telemetry.c - the words of what a snapshot tells.
 */
#include "heave/telemetry.h"

static const char *const k_fault_names[FAULT_CODES] = {
    [FAULT_NONE] = "none",
    [FAULT_DRIVE] = "drive fault",
    [FAULT_DRIVE_OFFLINE] = "drive does not answer",
    [FAULT_DRIVE_DROPPED] = "drive left the enabled state",
    [FAULT_DRIVE_TIMEOUT] = "drives were not ready in time",
    [FAULT_BUS] = "drive bus lost",
};

const char *fault_name(fault_code_t code)
{
    return code < FAULT_CODES ? k_fault_names[code] : "?";
}
