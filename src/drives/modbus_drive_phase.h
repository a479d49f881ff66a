/* SPDX-License-Identifier: MIT
 * modbus_drive_phase.h - how one drive on Modbus changes its phase: what each change does to what is written next and to what is
 * known of the drive. Private to src/drives. Sends nothing: modbus_drive_axis.c says what goes out.
 */
#ifndef MODBUS_DRIVE_PHASE_H
#define MODBUS_DRIVE_PHASE_H

#include "heave/modbus_drive.h"

static inline bool modbus_drive_phase_has(const modbus_drive_map_t *map, modbus_drive_command_t command)
{
    return map->command[command].count != 0;
}

static inline bool modbus_drive_phase_is_when(canraw_when_t when, uint32_t status)
{
    return when.mask != 0 && (status & when.mask) == when.value;
}

/** Whether the drive answers, and has been started up. */
bool modbus_drive_phase_is_up(const modbus_drive_axis_t *self);

/** Whether the drive itself reports a fault. */
bool modbus_drive_phase_is_faulty(const modbus_drive_axis_t *self, const modbus_drive_map_t *map);

/** Whether a command that stops the drive has not been written yet, or its torque is still to be taken after that. Nothing may
 *  replace it. */
bool modbus_drive_phase_is_stopping(const modbus_drive_axis_t *self);

/** What is written now, where that is a set-point or a command. */
const modbus_drive_blocks_t *modbus_drive_phase_blocks_of(const modbus_drive_axis_t *self, const modbus_drive_map_t *map);

void modbus_drive_phase_enter(modbus_drive_axis_t *self, modbus_drive_phase_t phase, uint64_t now_us);

/** Answers to what a slot has sent up to now count for nothing. */
void modbus_drive_phase_forget(modbus_drive_slot_t *slot);

/** The next thing to be written. It replaces what waits in the slot as soon as it is handed over. */
void modbus_drive_phase_start_job(modbus_drive_axis_t *self, modbus_drive_job_t job);

/** Writes a command; nothing where the map has no such command. */
void modbus_drive_phase_command(modbus_drive_axis_t *self, const modbus_drive_map_t *map, modbus_drive_command_t command);

/** Writes what stops the drive: `stop`, or `disable` where the map has no `stop`. Where it has both, `disable` follows at rest.
 */
void modbus_drive_phase_command_stop(modbus_drive_axis_t *self, const modbus_drive_map_t *map, uint64_t now_us);

/** Why the drive is not usable, and since when. object: the register concerned, or 0 */
void modbus_drive_phase_note_trouble(modbus_drive_axis_t *self, uint32_t trouble, uint16_t object, uint64_t now_us);

/** The drive does not answer: it is looked for from now on. */
void modbus_drive_phase_lose(modbus_drive_axis_t *self, const modbus_drive_map_t *map, uint32_t trouble, uint64_t now_us);

/** The driver found a fault: the drive is stopped. */
void modbus_drive_phase_fail(modbus_drive_axis_t *self, const modbus_drive_map_t *map, uint32_t code, uint64_t now_us);

/** What follows from what the drive reports: it has a fault now, or its fault is gone after a reset. */
void modbus_drive_phase_enter_fault(modbus_drive_axis_t *self, const modbus_drive_map_t *map, uint64_t now_us);

/** The target of the drive is set to where it is: before torque or right after it, and once more after homing. */
void modbus_drive_phase_place(modbus_drive_axis_t *self, uint64_t now_us);

/** Takes the torque off, then writes the start-up registers. */
void modbus_drive_phase_begin_startup(modbus_drive_axis_t *self, const modbus_drive_map_t *map, uint64_t now_us);

void modbus_drive_phase_begin_enabling(modbus_drive_axis_t *self, const modbus_drive_map_t *map, uint64_t now_us);

/** A command was written whole. */
void modbus_drive_phase_end_command(modbus_drive_axis_t *self, const modbus_drive_map_t *map, uint64_t now_us);

#endif
