/* SPDX-License-Identifier: MIT
 * cia402_watch.h - what a drive's answers say beyond its state and position: that it has left its mode, ignores its set-points,
 * is under local control, has no voltage, is at a limit of its own, warns. Each in two answers in a row, so that no single one
 * counts.
 */
#ifndef CIA402_WATCH_H
#define CIA402_WATCH_H

#include "cia402_axis.h"

/** Forgets everything: the drive is set up anew. */
void cia402_watch_restart(cia402_axis_t *self);

/** Once per poll, behind what was received. */
void cia402_watch_step(cia402_drive_t drive);

/** What the configuration wants the platform stopped for.
 *  @param is_following set-points are sent, which a drive may ignore or be too weak for
 *  @return cia402_trouble_t, CIA402_TROUBLE_NONE where all is well */
cia402_trouble_t cia402_watch_find(cia402_drive_t drive, bool is_following);

#endif
