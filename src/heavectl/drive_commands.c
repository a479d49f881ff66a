/* SPDX-License-Identifier: MIT
 * drive_commands.c - see drive_commands.h.
 */
#include "heavectl/drive_commands.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/canopen_objects.h"
#include "common/message.h" // exit codes
#include "common/sentence.h"
#include "common/translate.h"

#define ERRORS 0x1003

static double number(const cJSON *object, const char *name)
{
    const cJSON *item = cJSON_GetObjectItemCaseSensitive(object, name);
    return cJSON_IsNumber(item) ? item->valuedouble : 0.0;
}

/* --- What heaved sees of it --- */

static void show_emergency(const cJSON *emergency)
{
    if (cJSON_IsObject(emergency)) {
        printf(_("  %s: 0x%04X (%s), register 0x%02X, manufacturer %s, %.1f s ago, %.0f since heaved began\n"),
               cJSON_IsTrue(cJSON_GetObjectItemCaseSensitive(emergency, "over")) ? _("last error, over") : _("error"),
               (unsigned)number(emergency, "code"), translate(drive_text(emergency, "text")),
               (unsigned)number(emergency, "register"), drive_text(emergency, "manufacturer"),
               number(emergency, "age_ms") / 1000.0, number(emergency, "count"));
    }
}

static void show_telemetry(const cJSON *telemetry)
{
    const cJSON *mm = cJSON_GetObjectItemCaseSensitive(telemetry, "following_error_mm");
    const cJSON *deg = cJSON_GetObjectItemCaseSensitive(telemetry, "following_error_deg");
    const cJSON *lag = mm != NULL ? mm : deg;
    if (cJSON_HasObjectItem(telemetry, "torque_percent")) {
        printf(_("  torque: %.1f %% of the rated one\n"), number(telemetry, "torque_percent"));
    }
    if (lag != NULL) {
        printf(_("  behind its set-points by: %.3f %s\n"), lag->valuedouble, mm != NULL ? "mm" : "deg");
    }
    if (cJSON_HasObjectItem(telemetry, "inputs")) {
        printf(_("  digital inputs: 0x%08X\n"), (unsigned)number(telemetry, "inputs"));
    }
}

static void show_report(const cJSON *report)
{
    const cJSON *note = NULL;
    if (!cJSON_IsObject(report)) {
        return;
    }
    printf(_("  at: %s\n"), translate(drive_text(report, "phase")));
    if (number(report, "code") > 0.0) {
        printf(_("  trouble: %s (0x%04X)%s%s\n"), translate(drive_text(report, "trouble")), (unsigned)number(report, "code"),
               drive_text(report, "detail")[0] != '\0' ? ": " : "", translate(drive_text(report, "detail")));
    }
    if (number(report, "object") > 0.0) {
        printf(_("  about object: %04X:%02X\n"), (unsigned)number(report, "object"), (unsigned)number(report, "sub_index"));
    }
    if (cJSON_IsNumber(cJSON_GetObjectItemCaseSensitive(report, "found"))) {
        printf(_("  found: 0x%X, wanted: 0x%X\n"), (unsigned)number(report, "found"), (unsigned)number(report, "wanted"));
    }
    cJSON_ArrayForEach(note, cJSON_GetObjectItemCaseSensitive(report, "notes"))
    {
        printf(_("  tells: %s\n"), cJSON_IsString(note) ? translate(note->valuestring) : "?");
    }
    show_emergency(cJSON_GetObjectItemCaseSensitive(report, "emergency"));
    show_telemetry(cJSON_GetObjectItemCaseSensitive(report, "telemetry"));
}

static void show_seen(unsigned drive, const cJSON *axis)
{
    const cJSON *report = cJSON_GetObjectItemCaseSensitive(axis, "report");
    const bool is_angle = cJSON_HasObjectItem(axis, "actual_deg");
    const cJSON *actual = cJSON_GetObjectItemCaseSensitive(axis, is_angle ? "actual_deg" : "actual_mm");
    printf(_("drive %u"), drive);
    if (cJSON_HasObjectItem(report, "identifier")) {
        printf(_(", identifier 0x%X"), (unsigned)number(report, "identifier"));
    } else if (cJSON_HasObjectItem(report, "unit") || cJSON_HasObjectItem(report, "node")) {
        const char *name = cJSON_HasObjectItem(report, "unit") ? "unit" : "node";
        printf(cJSON_HasObjectItem(report, "unit") ? _(", unit %.0f") : _(", node %.0f"), number(report, name));
    }
    if (cJSON_HasObjectItem(report, "channel")) {
        printf(".%.0f", number(report, "channel"));
    }
    const char *state = drive_text(axis, "drive");
    const bool is_off = strcmp(state, "disabled") == 0 || strcmp(state, "fault") == 0;
    const bool is_still_on = is_off && cJSON_IsTrue(cJSON_GetObjectItemCaseSensitive(axis, "torque"));
    printf(_(": %s%s, %s\n"), translate(state), is_still_on ? _(", torque still on") : "",
           cJSON_IsTrue(cJSON_GetObjectItemCaseSensitive(axis, "homed")) ? _("homed") : _("not homed"));
    if (cJSON_IsNumber(actual)) {
        printf(_("  position: %.3f %s\n"), actual->valuedouble, is_angle ? "deg" : "mm");
    }
    show_report(report);
}

/* The axis of a drive in a status; NULL: there is no such drive. */
static const cJSON *axis_of(const cJSON *status, unsigned drive)
{
    const cJSON *cylinders = cJSON_GetObjectItemCaseSensitive(status, "cylinders");
    const unsigned count = (unsigned)cJSON_GetArraySize(cylinders);
    const cJSON *rotation = cJSON_GetObjectItemCaseSensitive(status, "rotation");
    if (drive >= 1 && drive <= count) {
        return cJSON_GetArrayItem(cylinders, (int)drive - 1);
    }
    return drive == count + 1u && cJSON_IsObject(rotation) ? rotation : NULL;
}

static uint32_t node_of(const cJSON *axis)
{
    return (uint32_t)number(cJSON_GetObjectItemCaseSensitive(axis, "report"), "node");
}

/* Its place among the axes of its node, from 0; 0 where it has the node to itself. */
static unsigned channel_of(const cJSON *axis)
{
    const double channel = number(cJSON_GetObjectItemCaseSensitive(axis, "report"), "channel");
    return channel > 1.0 ? (unsigned)channel - 1u : 0;
}

/* --- What its dictionary says --- */

static void show_or_keep(const ctl_t *self, cJSON *objects, cJSON *answer)
{
    if (!self->is_json) {
        printf("  ");
        drive_show_object(answer);
    }
    (void)cJSON_AddItemToArray(objects, answer);
}

/* The objects of a use; false: not to be had at all, and why. */
static bool read_shown(ctl_t *self, unsigned drive, unsigned channel, cJSON *objects, char *why, size_t capacity, int *code)
{
    for (const canopen_object_t *row = canopen_objects; row->name != NULL; row++) {
        if ((row->use & CANOPEN_SHOWN) == 0) {
            continue;
        }
        cJSON *answer = drive_ask(self, drive, canopen_index_of_axis(row->index, channel), row->sub, code);
        if (answer == NULL) {
            return false;
        }
        if (drive_is_good(answer)) {
            show_or_keep(self, objects, answer);
            continue;
        }
        const bool is_over = !drive_is_missing(answer);
        (void)snprintf(why, capacity, "%s", drive_text(answer, "error"));
        cJSON_Delete(answer);
        if (is_over) {
            return false;
        }
    }
    why[0] = '\0';
    return true;
}

/* The errors that the drive has kept, newest first. */
static void read_errors(ctl_t *self, unsigned drive, cJSON *errors, int *code)
{
    cJSON *answer = drive_ask(self, drive, ERRORS, 0, code);
    const unsigned kept = answer != NULL && drive_is_good(answer) ? (unsigned)number(answer, "value") : 0;
    const bool is_there = answer != NULL && drive_is_good(answer);
    cJSON_Delete(answer);
    if (is_there && !self->is_json) {
        printf("%s\n", kept == 0 ? _("errors kept (1003): none") : _("errors kept (1003), newest first:"));
    }
    for (unsigned i = 1; i <= kept && *code == EXIT_DONE && ctl_is_interrupted == 0; i++) {
        answer = drive_ask(self, drive, ERRORS, (uint8_t)i, code);
        if (answer != NULL && drive_is_good(answer)) {
            const uint32_t found = (uint32_t)number(answer, "value");
            if (!self->is_json) {
                printf(_("  0x%04X (%s), additional information 0x%04X\n"), (unsigned)(found & 0xFFFFu),
                       translate(drive_text(answer, "meaning")), (unsigned)(found >> 16));
            }
            (void)cJSON_AddItemToArray(errors, answer);
        } else {
            cJSON_Delete(answer);
        }
    }
}

static int show(ctl_t *self, unsigned drive, const cJSON *axis)
{
    char why[400] = "", shown[SENTENCE_MAX];
    int code = EXIT_DONE;
    cJSON *all = cJSON_CreateObject();
    (void)cJSON_AddBoolToObject(all, "ok", true);
    (void)cJSON_AddNumberToObject(all, "drive", drive);
    (void)cJSON_AddItemToObject(all, "seen", cJSON_Duplicate(axis, true));
    cJSON *objects = cJSON_AddArrayToObject(all, "objects");
    cJSON *errors = cJSON_AddArrayToObject(all, "errors");
    if (!self->is_json) {
        show_seen(drive, axis);
        printf(_("its objects:\n"));
    }
    if (read_shown(self, drive, channel_of(axis), objects, why, sizeof why, &code)) {
        read_errors(self, drive, errors, &code);
    } else if (code == EXIT_DONE && !self->is_json) {
        printf("  %s\n", sentence(strncmp(why, "sdo: ", 5) == 0 ? why + 5 : why, shown, sizeof shown));
    }
    (void)cJSON_AddStringToObject(all, "why_none", why);
    if (self->is_json && code == EXIT_DONE) {
        char *text = cJSON_PrintUnformatted(all);
        printf("%s\n", text != NULL ? text : "{}");
        free(text);
    }
    cJSON_Delete(all);
    return code;
}

int drive_run(ctl_t *self)
{
    char *end = NULL;
    const unsigned long drive = strtoul(self->argument, &end, 10);
    int code = EXIT_DONE;
    if (*end != '\0' || drive < 1 || drive > 99) {
        return ctl_complain(EXIT_BAD_USAGE, "drive: the number of a drive is needed, from 1");
    }
    ctl_catch_signals();
    cJSON *status = drive_request(self, "status", &code);
    if (status == NULL) {
        return code;
    }
    const cJSON *axis = axis_of(status, (unsigned)drive);
    code = ctl_judge(status);
    if (code == EXIT_DONE && axis == NULL) {
        code = ctl_complain(EXIT_REFUSED, "drive: this platform has no drive %lu", drive);
    } else if (code == EXIT_DONE) {
        code = self->save != NULL      ? drive_save(self, (unsigned)drive, channel_of(axis))
               : self->compare != NULL ? drive_compare(self, (unsigned)drive, node_of(axis))
                                       : show(self, (unsigned)drive, axis);
    }
    cJSON_Delete(status);
    return code;
}
