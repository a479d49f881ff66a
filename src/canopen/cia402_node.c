/* SPDX-License-Identifier: MIT
 * cia402_node.c - axes that are channels of one node; see cia402_node.h.
 */
#include "cia402_node.h"

cia402_axis_t *cia402_node_first(cia402_drive_t drive)
{
    for (unsigned k = 0; k < drive.config->axes; k++) {
        if (drive.config->axis[k].node == drive.own->node && drive.config->axis[k].channel == 0) {
            return &drive.all[k];
        }
    }
    return drive.axis;
}

bool cia402_node_has_mates(cia402_drive_t drive)
{
    for (unsigned k = 0; k < drive.config->axes; k++) {
        if (drive.config->axis[k].node == drive.own->node && drive.config->axis[k].channel != drive.own->channel) {
            return true;
        }
    }
    return false;
}

/* Whether something is true of each axis of the node. */
static bool are(cia402_drive_t drive, bool (*is_such)(cia402_drive_t drive, cia402_drive_t other))
{
    for (unsigned k = 0; k < drive.config->axes; k++) {
        if (drive.config->axis[k].node == drive.own->node && !is_such(drive, cia402_node_drive(drive, k))) {
            return false;
        }
    }
    return true;
}

bool cia402_node_are_all(cia402_drive_t drive, cia402_phase_t phase)
{
    for (unsigned k = 0; k < drive.config->axes; k++) {
        if (drive.config->axis[k].node == drive.own->node && drive.all[k].phase != phase) {
            return false;
        }
    }
    return true;
}

static bool is_there(cia402_drive_t drive, cia402_drive_t other)
{
    (void)drive;
    return other.axis->phase >= CIA402_STARTING && other.axis->phase <= CIA402_UP;
}

bool cia402_node_is_short(cia402_drive_t drive)
{
    return !are(drive, is_there);
}

static bool is_taken(cia402_drive_t drive, cia402_drive_t other)
{
    (void)drive;
    return other.axis->phase != CIA402_REFUSED;
}

bool cia402_node_is_refused(cia402_drive_t drive)
{
    return !are(drive, is_taken);
}

static bool has_answered(cia402_drive_t drive, cia402_drive_t other)
{
    (void)drive;
    return other.axis->has_actual && other.axis->has_answered;
}

bool cia402_node_is_answering(cia402_drive_t drive)
{
    return are(drive, has_answered);
}

static bool is_quiet(cia402_drive_t drive, cia402_drive_t other)
{
    return other.axis == drive.axis || !other.axis->is_asking;
}

bool cia402_node_may_ask(cia402_drive_t drive)
{
    return are(drive, is_quiet);
}

static bool is_off(cia402_drive_t drive, cia402_drive_t other)
{
    (void)drive;
    return other.axis->phase == CIA402_UP && !cia402_has_torque(cia402_state(other.axis->statusword));
}

bool cia402_node_is_off(cia402_drive_t drive)
{
    return are(drive, is_off);
}
