/* SPDX-License-Identifier: MIT
 * report_json.c - what a drive tells of itself as JSON; see report_json.h.
 */
#include "service/report_json.h"

#include <stdio.h>

void report_json_age(json_t *json, const char *key, uint64_t at_us, uint64_t now_us)
{
    if (at_us == 0 || at_us > now_us) {
        json_null(json, key);
    } else {
        json_ms(json, key, now_us - at_us);
    }
}

static void write_notes(json_t *json, uint32_t notes)
{
    json_open(json, "notes", '[');
    for (unsigned i = 0; i < DRIVE_NOTES; i++) {
        if ((notes >> i & 1u) != 0) {
            json_text(json, NULL, drive_note_text(i));
        }
    }
    json_close(json, ']');
}

/* The last error that a drive has told of; null where there was none. */
static void write_emergency(json_t *json, const drive_report_t *report, uint64_t now_us)
{
    const drive_emergency_t *emergency = &report->emergency;
    char maker[2 * sizeof emergency->maker + 1];
    if (report->error == NULL) {
        json_null(json, "emergency");
        return;
    }
    for (unsigned i = 0; i < sizeof emergency->maker; i++) {
        (void)snprintf(&maker[2u * i], 3, "%02X", emergency->maker[i]);
    }
    json_open(json, "emergency", '{');
    json_number(json, "code", emergency->code);
    json_text(json, "text", report->error);
    json_number(json, "register", emergency->error_register);
    json_text(json, "manufacturer", maker);
    json_bool(json, "over", emergency->is_over);
    json_number(json, "count", emergency->count);
    report_json_age(json, "age_ms", emergency->at_us, now_us);
    json_close(json, '}');
}

/* What it measures beside its position; null where it does not tell. */
static void write_telemetry(json_t *json, const drive_telemetry_t *telemetry, bool is_angle, uint64_t now_us)
{
    if (telemetry->has == 0) {
        json_null(json, "telemetry");
        return;
    }
    json_open(json, "telemetry", '{');
    if ((telemetry->has & DRIVE_HAS_TORQUE) != 0) {
        json_q32(json, "torque_percent", q32_from_int(telemetry->torque_permille) / 10);
    }
    if ((telemetry->has & DRIVE_HAS_LAG) != 0) {
        json_q32(json, is_angle ? "following_error_deg" : "following_error_mm", telemetry->lag_q32);
    }
    if ((telemetry->has & DRIVE_HAS_INPUTS) != 0) {
        json_number(json, "inputs", telemetry->inputs);
    }
    report_json_age(json, "age_ms", telemetry->at_us, now_us);
    json_close(json, '}');
}

/* What the drive is at, in words; null where its driver has none. */
void report_json(json_t *json, const drive_report_t *report, bool is_angle, uint64_t now_us)
{
    if (report->phase == NULL || report->phase[0] == '\0') {
        json_null(json, "report");
        return;
    }
    json_open(json, "report", '{');
    json_number(json, "node", report->address);
    if (report->channel != 0) {
        json_number(json, "channel", report->channel);
    }
    json_text(json, "phase", report->phase);
    json_text(json, "trouble", report->trouble);
    json_number(json, "code", report->code);
    json_number(json, "object", report->object >> 8);
    json_number(json, "sub_index", report->object & 0xFFu);
    if (report->is_modbus) {
        json_number(json, "unit", report->address);
        json_number(json, "register", report->object >> 8);
    }
    if (report->identifier != 0) {
        json_number(json, "identifier", report->identifier);
    }
    json_text(json, "detail", report->detail);
    json_number(json, "detail_code", report->detail_code);
    if (report->has_found) {
        json_number(json, "found", report->found);
        json_number(json, "wanted", report->wanted);
    } else {
        json_null(json, "found");
        json_null(json, "wanted");
    }
    json_ms(json, "age_ms", now_us >= report->since_us ? now_us - report->since_us : 0);
    write_notes(json, report->notes);
    write_emergency(json, report, now_us);
    write_telemetry(json, &report->telemetry, is_angle, now_us);
    json_close(json, '}');
}
