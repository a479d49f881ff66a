/* SPDX-License-Identifier: MIT
 * modbus_drive_phase.c - how one drive on Modbus changes its phase; see modbus_drive_phase.h.
 */
#include "modbus_drive_phase.h"

#define PROBE_US 500000u /* a drive that does not answer costs its line a timeout each time */

void modbus_drive_phase_enter(modbus_drive_axis_t *self, modbus_drive_phase_t phase, uint64_t now_us)
{
    self->since_us = phase != self->phase ? now_us : self->since_us;
    self->phase = phase;
}

void modbus_drive_phase_forget(modbus_drive_slot_t *slot)
{
    slot->first = slot->tag + 1u;
    slot->is_out = false;
}

void modbus_drive_phase_start_job(modbus_drive_axis_t *self, modbus_drive_job_t job)
{
    modbus_drive_phase_forget(&self->write);
    self->job = job;
    self->step = 0;
    self->is_checking = false;
    self->is_broadcast = false;
}

void modbus_drive_phase_command(modbus_drive_axis_t *self, const modbus_drive_map_t *map, modbus_drive_command_t command)
{
    modbus_drive_phase_start_job(self, modbus_drive_phase_has(map, command) ? MODBUS_DRIVE_JOB_COMMAND : MODBUS_DRIVE_NO_JOB);
    self->command = command;
}

void modbus_drive_phase_command_stop(modbus_drive_axis_t *self, const modbus_drive_map_t *map, uint64_t now_us)
{
    if (!modbus_drive_phase_has(map, MODBUS_DRIVE_STOP)) {
        modbus_drive_phase_command(self, map, MODBUS_DRIVE_DISABLE);
        return;
    }
    modbus_drive_phase_command(self, map, MODBUS_DRIVE_STOP);
    if (modbus_drive_phase_has(map, MODBUS_DRIVE_DISABLE)) {
        quick_stop_begin(&self->quick_stop, now_us);
    }
}

void modbus_drive_phase_note_trouble(modbus_drive_axis_t *self, uint32_t trouble, uint16_t object, uint64_t now_us)
{
    self->trouble_us = trouble != self->trouble ? now_us : self->trouble_us;
    self->trouble = trouble;
    self->object = object;
}

void modbus_drive_phase_lose(modbus_drive_axis_t *self, const modbus_drive_map_t *map, uint32_t trouble, uint64_t now_us)
{
    modbus_drive_phase_enter(self, MODBUS_DRIVE_WAITING, now_us);
    modbus_drive_phase_note_trouble(self, trouble, self->object, now_us);
    modbus_drive_phase_start_job(self, MODBUS_DRIVE_NO_JOB);
    modbus_drive_phase_forget(&self->read);
    self->read_step = 0;
    self->read.failures = 0;
    self->write.failures = 0;
    self->is_homed = !modbus_drive_phase_has(map, MODBUS_DRIVE_HOME);
    self->period_us = map->expected_us;
    self->setpoint_us = 0;
    self->reset_until_us = 0;
    self->reset_asked_us = 0;
    self->quick_stop = (quick_stop_t){.until_us = 0}; /* the start-up begins with `disable` */
    self->next_read_us = now_us + PROBE_US;
}

void modbus_drive_phase_fail(modbus_drive_axis_t *self, const modbus_drive_map_t *map, uint32_t code, uint64_t now_us)
{
    modbus_drive_phase_enter(self, MODBUS_DRIVE_FAULT, now_us);
    modbus_drive_phase_note_trouble(self, code, 0, now_us);
    self->guard = (drive_guard_t){.jump_q32 = 0};
    self->reset_until_us = 0;
    self->reset_asked_us = 0;
    modbus_drive_phase_command_stop(self, map, now_us);
}

bool modbus_drive_phase_is_up(const modbus_drive_axis_t *self)
{
    return self->phase != MODBUS_DRIVE_WAITING && self->phase != MODBUS_DRIVE_STARTING && self->phase != MODBUS_DRIVE_REFUSED;
}

bool modbus_drive_phase_is_faulty(const modbus_drive_axis_t *self, const modbus_drive_map_t *map)
{
    return map->fault_when.mask != 0 ? modbus_drive_phase_is_when(map->fault_when, self->status) : self->alarm != 0;
}

static bool is_command(const modbus_drive_axis_t *self, modbus_drive_command_t command)
{
    return self->job == MODBUS_DRIVE_JOB_COMMAND && self->command == command;
}

bool modbus_drive_phase_is_stopping(const modbus_drive_axis_t *self)
{
    return is_command(self, MODBUS_DRIVE_STOP) || is_command(self, MODBUS_DRIVE_DISABLE) ||
           quick_stop_is_active(&self->quick_stop);
}

void modbus_drive_phase_place(modbus_drive_axis_t *self, uint64_t now_us)
{
    modbus_drive_phase_enter(self, MODBUS_DRIVE_PLACING, now_us);
    self->mark_us = now_us;
    if (self->job != MODBUS_DRIVE_JOB_COMMAND) { /* a stop ends first */
        modbus_drive_phase_start_job(self, MODBUS_DRIVE_NO_JOB);
    }
}

void modbus_drive_phase_begin_startup(modbus_drive_axis_t *self, const modbus_drive_map_t *map, uint64_t now_us)
{
    modbus_drive_phase_enter(self, MODBUS_DRIVE_STARTING, now_us);
    modbus_drive_phase_command(self, map, MODBUS_DRIVE_DISABLE);
    if (self->job == MODBUS_DRIVE_NO_JOB) {
        modbus_drive_phase_start_job(self, MODBUS_DRIVE_JOB_STARTUP);
    }
}

void modbus_drive_phase_begin_enabling(modbus_drive_axis_t *self, const modbus_drive_map_t *map, uint64_t now_us)
{
    modbus_drive_phase_enter(self, MODBUS_DRIVE_ENABLING, now_us);
    modbus_drive_phase_command(self, map, MODBUS_DRIVE_ENABLE);
    self->is_energized = modbus_drive_phase_has(map, MODBUS_DRIVE_DISABLE);
    if (self->job == MODBUS_DRIVE_NO_JOB) {
        modbus_drive_phase_end_command(self, map, now_us);
    }
}

void modbus_drive_phase_end_command(modbus_drive_axis_t *self, const modbus_drive_map_t *map, uint64_t now_us)
{
    self->is_energized = self->is_energized && !(is_command(self, MODBUS_DRIVE_DISABLE) && map->enabled_when.mask == 0);
    modbus_drive_phase_start_job(self, self->phase == MODBUS_DRIVE_STARTING ? MODBUS_DRIVE_JOB_STARTUP : MODBUS_DRIVE_NO_JOB);
    self->mark_us = now_us;
    if (self->phase == MODBUS_DRIVE_ENABLING) {
        modbus_drive_phase_enter(self, MODBUS_DRIVE_CONFIRMING, now_us);
    }
}

const modbus_drive_blocks_t *modbus_drive_phase_blocks_of(const modbus_drive_axis_t *self, const modbus_drive_map_t *map)
{
    return self->job == MODBUS_DRIVE_JOB_SETPOINT ? &map->setpoint : &map->command[self->command];
}

/* What the drive says of its fault; never 0. */
static uint32_t own_code(const modbus_drive_axis_t *self)
{
    const uint32_t code = self->alarm != 0 ? self->alarm : self->status;
    return code != 0 ? code : 1u;
}

void modbus_drive_phase_enter_fault(modbus_drive_axis_t *self, const modbus_drive_map_t *map, uint64_t now_us)
{
    if (modbus_drive_phase_is_faulty(self, map)) {
        if (self->phase != MODBUS_DRIVE_FAULT) {
            modbus_drive_phase_enter(self, MODBUS_DRIVE_FAULT, now_us);
            modbus_drive_phase_note_trouble(self, own_code(self), 0, now_us);
            self->reset_until_us = 0;
            self->reset_asked_us = 0;
            if (!modbus_drive_phase_is_stopping(self)) {
                modbus_drive_phase_start_job(self, MODBUS_DRIVE_NO_JOB);
            }
        }
    } else if (self->phase == MODBUS_DRIVE_FAULT && self->reset_until_us != 0 && self->job == MODBUS_DRIVE_NO_JOB &&
               self->read_us >= self->mark_us) {
        modbus_drive_phase_enter(self, MODBUS_DRIVE_READY, now_us);
        modbus_drive_phase_note_trouble(self, MODBUS_DRIVE_NO_TROUBLE, 0, now_us);
        self->reset_until_us = 0;
        self->reset_asked_us = 0;
    }
}
