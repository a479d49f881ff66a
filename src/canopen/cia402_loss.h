/* SPDX-License-Identifier: MIT
 * cia402_loss.h - one drive is lost, or refused, and with it what becomes of the others of its node.
 */
#ifndef CIA402_LOSS_H
#define CIA402_LOSS_H

#include "cia402_axis.h"

/** Begins a phase. */
void cia402_axis_enter(cia402_drive_t drive, cia402_phase_t phase);

/** Keeps why the drive was lost or is refused. */
void cia402_axis_note_trouble(cia402_drive_t drive, cia402_trouble_t why);

/** The drive cannot be used until it boots or the operator resets. */
void cia402_axis_reject(cia402_drive_t drive, cia402_trouble_t why);

/** As cia402_axis_lose(), without the others of its node. */
void cia402_axis_lose_alone(cia402_drive_t drive, cia402_trouble_t why);

/** Waits for an answer to 1000h, the first thing every drive knows; of a channel beyond the first, for that one. */
void cia402_axis_look_for(cia402_drive_t drive);

/** The drive is lost, and with it the others of its node; they are set up again, after a while in which it is told to stop where
 * it may still hear. */
void cia402_axis_lose(cia402_drive_t drive, cia402_trouble_t why);

#endif
