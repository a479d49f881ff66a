/* SPDX-License-Identifier: MIT
 * reports.c - what the drives are at, in words; see reports.h.
 */
#include "reports.h"

#include "heave/text.h"

#define EMERGENCY_LOG_US 1000000u
#define REPORT_LOG_US    10000000u /* a line about a drive each, in the long run, */
#define REPORT_BURST     5u        /* and as many at once */

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

static void log_report(const gateway_t *self, unsigned axis, const drive_report_t *report, uint32_t left_out)
{
    char line[HAL_LOG_TEXT_MAX + 1];
    text_t text = text_start(line, sizeof line);
    text_put(&text, "axis ");
    text_put_u32(&text, axis + 1u);
    text_put(&text, report->is_modbus ? ", unit " : ", node ");
    text_put_u32(&text, report->address);
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
    hal_log_write(self->io.log, report->code != 0 ? HAL_LOG_WARNING : HAL_LOG_NOTICE, line);
}

static void log_notes(const gateway_t *self, unsigned axis, const drive_report_t *report)
{
    char line[HAL_LOG_TEXT_MAX + 1];
    text_t text = text_start(line, sizeof line);
    const char *before = " ";
    text_put(&text, "axis ");
    text_put_u32(&text, axis + 1u);
    text_put(&text, ", node ");
    text_put_u32(&text, report->address);
    text_put(&text, report->notes != 0 ? ":" : ": nothing to tell of any more");
    for (unsigned i = 0; i < DRIVE_NOTES; i++) {
        if ((report->notes >> i & 1u) != 0) {
            text_put(&text, before);
            text_put(&text, drive_note_text(i));
            before = "; ";
        }
    }
    hal_log_write(self->io.log, report->notes != 0 ? HAL_LOG_WARNING : HAL_LOG_NOTICE, line);
}

/* Some drives send errors and their end in pairs, many in a second: a line in a second, with how many there were. */
static void log_emergency(gateway_t *self, unsigned axis, const drive_report_t *report)
{
    const drive_emergency_t *emergency = &report->emergency;
    const uint32_t count = emergency->count - self->emergencies_logged[axis];
    const uint64_t now_us = self->snapshot.now_us;
    char line[HAL_LOG_TEXT_MAX + 1];
    text_t text = text_start(line, sizeof line);
    if (count == 0 || report->error == NULL ||
        (self->emergency_logged_us[axis] != 0 && now_us - self->emergency_logged_us[axis] < EMERGENCY_LOG_US)) {
        return;
    }
    text_put(&text, "axis ");
    text_put_u32(&text, axis + 1u);
    text_put(&text, ", node ");
    text_put_u32(&text, report->address);
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
    hal_log_write(self->io.log, HAL_LOG_WARNING, line);
    self->emergency_logged_us[axis] = now_us;
    self->emergencies_logged[axis] = emergency->count;
}

/* Worth a line: another trouble, the end of one, or a refusal with its reason. */
static bool is_news(uint32_t code, uint32_t detail_code, const drive_report_t *is)
{
    return is->address != 0 && (code != is->code || (is->code != 0 && detail_code != is->detail_code));
}

/* What comes and goes is told of less often; what is in the end is always told of. */
static void tell_report(gateway_t *self, unsigned axis, const drive_report_t *report)
{
    const drive_report_t *was = &self->snapshot.report[axis];
    gateway_told_t *told = &self->told_of[axis];
    const uint64_t now_us = self->snapshot.now_us;
    const bool is_free = now_us + (uint64_t)(REPORT_BURST - 1u) * REPORT_LOG_US >= told->next_us;
    if (is_news(told->code, told->detail_code, report) && is_free) {
        log_report(self, axis, report, told->left_out);
        *told = (gateway_told_t){.next_us = (told->next_us > now_us ? told->next_us : now_us) + REPORT_LOG_US,
                                 .code = report->code,
                                 .detail_code = report->detail_code};
    } else {
        told->left_out += is_news(was->code, was->detail_code, report);
    }
}

void reports_take(gateway_t *self)
{
    for (uint8_t i = 0; i < drives_count(self->io.drives); i++) {
        drive_report_t report;
        (void)drives_report(self->io.drives, i, &report);
        tell_report(self, i, &report);
        if (self->snapshot.report[i].notes != report.notes) {
            log_notes(self, i, &report);
        }
        log_emergency(self, i, &report);
        self->snapshot.report[i] = report;
    }
}
