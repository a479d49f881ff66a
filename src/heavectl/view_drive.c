/* SPDX-License-Identifier: MIT
 * view_drive.c - the lines of a drive; see view_drive.h.
 */
#include "heavectl/view_drive.h"

#include <string.h>

#include "common/translate.h"

void view_drive_object(view_t *self, const cJSON *report)
{
    if (view_number(report, "register") > 0.0) {
        view_put_piece(self, ", register 0x%04X", (unsigned)view_number(report, "register"));
    } else if (view_number(report, "object") > 0.0) {
        view_put_piece(self, ", object %04X:%02X", (unsigned)view_number(report, "object"),
                       (unsigned)view_number(report, "sub_index"));
    }
}

void view_drive_detail(view_t *self, const cJSON *report)
{
    if (cJSON_IsNumber(view_member(report, "found"))) {
        view_put_piece(self, "; %s, found 0x%X, wanted 0x%X", view_text(report, "detail"), (unsigned)view_number(report, "found"),
                       (unsigned)view_number(report, "wanted"));
    } else if (view_word(report, "detail")[0] != '\0') {
        view_put_piece(self, "; %s (0x%04X)", view_text(report, "detail"), (unsigned)view_number(report, "detail_code"));
    }
}

/* A second line where the drive is not simply as it should be: what it is at, since when, and what is wrong. */
static void draw_report(view_t *self, const cJSON *report, const char *drive)
{
    const bool is_usual = strcmp(view_word(report, "phase"), drive) == 0 || strcmp(view_word(report, "phase"), "ready") == 0;
    if (!cJSON_IsObject(report) || (is_usual && view_number(report, "code") <= 0.0)) {
        return;
    }
    if (view_member(report, "identifier") != NULL) {
        view_put(self, "   identifier 0x%X: %s", (unsigned)view_number(report, "identifier"), view_text(report, "phase"));
    } else if (view_member(report, "unit") != NULL) {
        view_put(self, "   unit %.0f: %s", view_number(report, "unit"), view_text(report, "phase"));
    } else if (view_number(report, "channel") > 0.0) {
        view_put(self, "   node %.0f.%.0f: %s", view_number(report, "node"), view_number(report, "channel"),
                 view_text(report, "phase"));
    } else {
        view_put(self, "   node %.0f: %s", view_number(report, "node"), view_text(report, "phase"));
    }
    view_drive_object(self, report);
    if (view_number(report, "code") > 0.0) {
        view_put_piece(self, "; %s (0x%04X)", view_text(report, "trouble"), (unsigned)view_number(report, "code"));
    }
    view_drive_detail(self, report);
    view_put_piece(self, ", %.1f s", view_number(report, "age_ms") / 1000.0);
    view_end_line(self);
}

/* What a drive tells that goes on. */
static void draw_notes(view_t *self, const cJSON *report)
{
    const cJSON *note = NULL;
    bool is_any = false;
    cJSON_ArrayForEach(note, view_member(report, "notes"))
    {
        view_put_piece(self, is_any ? "; %s" : N_("   tells: %s"), cJSON_IsString(note) ? translate(note->valuestring) : "?");
        is_any = true;
    }
    if (is_any) {
        view_end_line(self);
    }
}

/* The last error that a drive has told of. */
static void draw_emergency(view_t *self, const cJSON *emergency)
{
    if (!cJSON_IsObject(emergency)) {
        return;
    }
    view_put(self, "   %s 0x%04X", cJSON_IsTrue(view_member(emergency, "over")) ? _("last error, over:") : _("error"),
             (unsigned)view_number(emergency, "code"));
    view_put_piece(self, " (%s), register 0x%02X, manufacturer %s", view_text(emergency, "text"),
                   (unsigned)view_number(emergency, "register"), view_word(emergency, "manufacturer"));
    view_put_piece(self, ", %.1f s ago, %.0f in all", view_number(emergency, "age_ms") / 1000.0, view_number(emergency, "count"));
    view_end_line(self);
}

/* What a drive measures beside its position. */
static void draw_telemetry(view_t *self, const cJSON *telemetry)
{
    const cJSON *mm = view_member(telemetry, "following_error_mm");
    const cJSON *deg = view_member(telemetry, "following_error_deg");
    const char *separator = "   ";
    if (!cJSON_IsObject(telemetry)) {
        return;
    }
    if (cJSON_IsNumber(view_member(telemetry, "torque_percent"))) {
        view_put_piece(self, "%storque %.1f %%", separator, view_number(telemetry, "torque_percent"));
        separator = ", ";
    }
    if (cJSON_IsNumber(mm) || cJSON_IsNumber(deg)) {
        view_put_piece(self, "%sbehind by %.3f %s", separator, cJSON_IsNumber(mm) ? mm->valuedouble : deg->valuedouble,
                       cJSON_IsNumber(mm) ? "mm" : "deg");
        separator = ", ";
    }
    if (cJSON_IsNumber(view_member(telemetry, "inputs"))) {
        view_put_piece(self, "%sinputs 0x%08X", separator, (unsigned)view_number(telemetry, "inputs"));
    }
    view_end_line(self);
}

/* A line for drives that share a slow bus: how often each is served. */
static void draw_service(view_t *self, const cJSON *axis)
{
    if (!cJSON_IsNumber(view_member(axis, "period_ms"))) {
        return;
    }
    view_put(self, "   %.1f Hz, newest set-point %.0f ms ago", 1000.0 / view_number(axis, "period_ms"),
             view_number(axis, "setpoint_age_ms"));
    view_put_piece(self, ", feedback %.0f ms ago", view_number(axis, "feedback_age_ms"));
    view_end_line(self);
}

void view_drive(view_t *self, const cJSON *axis)
{
    const char *drive = view_word(axis, "drive");
    view_put(self, " %s",
             strcmp(drive, "enabled") == 0 && !cJSON_IsTrue(view_member(axis, "homed")) ? _("no zero") : translate(drive));
    view_end_line(self);
    view_entry(self, VIEW_EXTRA);
    draw_service(self, axis);
    view_entry(self, VIEW_HELPS);
    draw_report(self, view_member(axis, "report"), drive);
    view_entry(self, VIEW_DETAIL);
    draw_notes(self, view_member(axis, "report"));
    draw_emergency(self, view_member(view_member(axis, "report"), "emergency"));
    view_entry(self, VIEW_EXTRA);
    draw_telemetry(self, view_member(view_member(axis, "report"), "telemetry"));
}
