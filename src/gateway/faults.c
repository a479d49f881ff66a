/* SPDX-License-Identifier: MIT
 * faults.c - see faults.h.
 */
#include "faults.h"

#include "heave/text.h"

/* Who found it is told where it might be either: what a drive says of itself, and what heaved sees of the same thing. */
static void log_fault(hal_log_t log, const fault_t *fault, const drive_report_t *report, unsigned cylinders)
{
    char line[HAL_LOG_TEXT_MAX + 1];
    text_t text = text_start(line, sizeof line);
    const char *unit = fault->axis > cylinders ? " deg" : " mm";
    text_put(&text, fault_text(fault->code));
    if (fault->axis != 0) {
        text_put(&text, ", axis ");
        text_put_u32(&text, fault->axis);
    }
    if (fault->device_code != 0) {
        text_put(&text, ", device code 0x");
        text_put_hex(&text, fault->device_code, 4);
    }
    if (fault->device_code != 0 && fault->device_code == report->code) {
        text_put(&text, " (");
        text_put(&text, report->trouble);
        text_put(&text, ")");
    }
    if (fault->allowed_q32 != 0) {
        text_put(&text, ": found by heaved, ");
        text_put_q32(&text, fault->off_q32, 2);
        text_put(&text, unit);
        text_put(&text, " off, allowed ");
        text_put_q32(&text, fault->allowed_q32, 2);
        text_put(&text, unit);
    }
    hal_log_write(log, HAL_LOG_ERROR, line);
}

drive_report_t faults_report_of(drives_t drives, const fault_t *fault)
{
    drive_report_t report = {.phase = "", .trouble = "", .detail = ""};
    if (fault->axis != 0) {
        (void)drives_report(drives, (uint8_t)(fault->axis - 1u), &report);
    }
    return report;
}

void faults_init(faults_t *self)
{
    *self = (faults_t){.first = {.code = FAULT_NONE}};
    faults_clear(self);
}

bool faults_note(faults_t *self, const fault_t *fault, drives_t drives, unsigned cylinders, hal_log_t log)
{
    const fault_code_t code = fault->code;
    const fault_reaction_t reaction = fault_reaction(code);
    const drive_report_t report = faults_report_of(drives, fault);
    self->begun[fault->axis] |= 1u << (unsigned)code;
    self->total++;
    self->count[code]++;
    self->last_us[code] = fault->at_us;
    log_fault(log, fault, &report, cylinders);
    if (self->first.code == FAULT_NONE) {
        self->first = *fault;
        self->report = report;
    }
    const bool is_worse = reaction > self->reaction;
    self->reaction = is_worse ? reaction : self->reaction;
    return is_worse;
}

void faults_clear(faults_t *self)
{
    self->first = (fault_t){.code = FAULT_NONE};
    self->report = (drive_report_t){.phase = "", .trouble = "", .detail = ""};
    self->reaction = FAULT_REACT_NONE;
}
