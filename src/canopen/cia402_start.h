/* SPDX-License-Identifier: MIT
 * cia402_start.h - one drive from missing to up: found, reset, set up, started.
 */
#ifndef CIA402_START_H
#define CIA402_START_H

#include "cia402_axis.h"

/** Once per poll in the phases MISSING, RESETTING, CONFIGURING and STARTING. */
void cia402_start_missing(cia402_drive_t drive);
void cia402_start_resetting(cia402_drive_t drive);
void cia402_start_configuring(cia402_drive_t drive);
void cia402_start_starting(cia402_drive_t drive);

/** The drive fell silent when it was asked for an object. */
void cia402_start_lose_at_object(cia402_drive_t drive);

/** The mode has been set: where the answers do not tell it, it is the one that 6061h held. */
void cia402_start_show_mode(cia402_drive_t drive);

#endif
