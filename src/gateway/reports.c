/* SPDX-License-Identifier: MIT
 * reports.c - what the drives are at, in words; see reports.h.
 */
#include "reports.h"

#include "heave/text.h"
#include "log_limit.h"

#define REPORT_LOG_US 10000000u /* a line about a drive each, in the long run, */
#define REPORT_BURST  5u        /* and as many at once */

static void put_object(text_t *text, bool is_register, uint32_t object)
{
    if (is_register) {
        text_put(text, ", register 0x");
        text_put_hex(text, object >> 8, 4);
        return;
    }
    text_put(text, ", object ");
    text_put_hex(text, object >> 8, 4);
    text_put(text, ":");
    text_put_hex(text, object & 0xFFu, 2);
}

static void put_address(text_t *text, const drive_report_t *report)
{
    if (report->identifier != 0) {
        text_put(text, ", identifier 0x");
        text_put_hex(text, report->identifier, 1);
        return;
    }
    text_put(text, report->is_modbus ? ", unit " : ", node ");
    text_put_u32(text, report->address);
    if (report->channel != 0) {
        text_put(text, ".");
        text_put_u32(text, report->channel);
    }
}

static void put_detail(text_t *text, const drive_report_t *report)
{
    if (report->detail[0] != '\0') {
        text_put(text, ": ");
        text_put(text, report->detail);
    }
    if (report->has_found) {
        text_put(text, ", found 0x");
        text_put_hex(text, report->found, 1);
        text_put(text, ", wanted 0x");
        text_put_hex(text, report->wanted, 1);
    } else if (report->detail_code != 0) {
        text_put(text, " (0x");
        text_put_hex(text, report->detail_code, 4);
        text_put(text, ")");
    }
}

static void log_report(hal_log_t log, unsigned axis, const drive_report_t *report, uint32_t left_out)
{
    char line[HAL_LOG_TEXT_MAX + 1];
    text_t text = text_start(line, sizeof line);
    text_put(&text, "axis ");
    text_put_u32(&text, axis + 1u);
    put_address(&text, report);
    text_put(&text, ", ");
    text_put(&text, report->phase);
    if (report->trouble[0] != '\0') {
        text_put(&text, ": ");
        text_put(&text, report->trouble);
        text_put(&text, " (0x");
        text_put_hex(&text, report->code, 4);
        text_put(&text, ")");
    }
    if (report->object != 0) {
        put_object(&text, report->is_modbus, report->object);
    }
    put_detail(&text, report);
    if (left_out > 0) {
        text_put(&text, "; ");
        text_put_u32(&text, left_out);
        text_put(&text, " changes before this were left out");
    }
    hal_log_write(log, report->code != 0 ? HAL_LOG_WARNING : HAL_LOG_NOTICE, line);
}

static void log_notes(hal_log_t log, unsigned axis, const drive_report_t *report)
{
    char line[HAL_LOG_TEXT_MAX + 1];
    text_t text = text_start(line, sizeof line);
    const char *before = " ";
    text_put(&text, "axis ");
    text_put_u32(&text, axis + 1u);
    put_address(&text, report);
    text_put(&text, report->notes != 0 ? ":" : ": nothing to tell of any more");
    for (unsigned i = 0; i < DRIVE_NOTES; i++) {
        if ((report->notes >> i & 1u) != 0) {
            text_put(&text, before);
            text_put(&text, drive_note_text(i));
            before = "; ";
        }
    }
    hal_log_write(log, report->notes != 0 ? HAL_LOG_WARNING : HAL_LOG_NOTICE, line);
}

/* Some drives send errors and their end in pairs, many in a second: a line in a second, with how many there were. */
static void log_emergency(reports_t *self, hal_log_t log, unsigned axis, const drive_report_t *report, uint64_t now_us)
{
    const drive_emergency_t *emergency = &report->emergency;
    const uint32_t count = report->error != NULL ? log_limit_due(&self->emergency_log[axis], emergency->count, now_us) : 0;
    char line[HAL_LOG_TEXT_MAX + 1];
    text_t text = text_start(line, sizeof line);
    if (count == 0) {
        return;
    }
    text_put(&text, "axis ");
    text_put_u32(&text, axis + 1u);
    put_address(&text, report);
    text_put(&text, ": error 0x");
    text_put_hex(&text, emergency->code, 4);
    text_put(&text, ", ");
    text_put(&text, report->error);
    text_put(&text, "; register 0x");
    text_put_hex(&text, emergency->error_register, 2);
    text_put(&text, ", manufacturer");
    for (unsigned i = 0; i < sizeof emergency->maker; i++) {
        text_put(&text, " ");
        text_put_hex(&text, emergency->maker[i], 2);
    }
    if (count > 1u) {
        text_put(&text, "; the last of ");
        text_put_u32(&text, count);
    }
    hal_log_write(log, HAL_LOG_WARNING, line);
}

/* Worth a line: another trouble, the end of one, or a refusal with its reason. */
static bool is_news(uint32_t code, uint32_t detail_code, const drive_report_t *is)
{
    return is->address != 0 && (code != is->code || (is->code != 0 && detail_code != is->detail_code));
}

/* A trouble that comes and goes is logged less often; the last one is always logged. */
static void log_change(reports_t *self, hal_log_t log, unsigned axis, const drive_report_t *was, const drive_report_t *report,
                       uint64_t now_us)
{
    report_log_t *line = &self->change_log[axis];
    const bool is_free = now_us + (uint64_t)(REPORT_BURST - 1u) * REPORT_LOG_US >= line->next_us;
    if (is_news(line->code, line->detail_code, report) && is_free) {
        log_report(log, axis, report, line->left_out);
        *line = (report_log_t){.next_us = (line->next_us > now_us ? line->next_us : now_us) + REPORT_LOG_US,
                               .code = report->code,
                               .detail_code = report->detail_code};
    } else {
        line->left_out += is_news(was->code, was->detail_code, report);
    }
}

void reports_step(reports_t *self, drives_t drives, hal_log_t log, uint64_t now_us, drive_report_t shown[DRIVES_MAX])
{
    for (uint8_t i = 0; i < drives_count(drives); i++) {
        drive_report_t report;
        (void)drives_report(drives, i, &report);
        log_change(self, log, i, &shown[i], &report, now_us);
        if (shown[i].notes != report.notes) {
            log_notes(log, i, &report);
        }
        log_emergency(self, log, i, &report, now_us);
        shown[i] = report;
    }
}
