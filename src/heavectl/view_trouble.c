/* SPDX-License-Identifier: MIT
 * view_trouble.c - what is wrong, in the table of a status; see view_trouble.h.
 */
#include "heavectl/view_trouble.h"

#include <stdio.h>

#include "common/sentence.h"
#include "common/translate.h"
#include "heavectl/view_drive.h"

#define LABEL_COLUMNS 9

/* What heaved itself has found an axis to be off. */
static void draw_distance(view_t *self, const cJSON *fault, const char *unit)
{
    char off[16], allowed[16];
    (void)snprintf(off, sizeof off, "off_%s", unit);
    (void)snprintf(allowed, sizeof allowed, "allowed_%s", unit);
    if (!cJSON_IsNumber(view_member(fault, off))) {
        return;
    }
    view_put(self, "  found  by heaved: %.2f %s off, allowed %.2f %s", view_number(fault, off), unit, view_number(fault, allowed),
             unit);
    view_end_line(self);
}

/* What the drive of a fault was at when it began. */
static void draw_device(view_t *self, const cJSON *fault)
{
    const cJSON *report = view_member(fault, "report");
    if (view_word(fault, "device_text")[0] != '\0') {
        view_put_piece(self, " (%s)", view_text(fault, "device_text"));
    }
    if (view_number(report, "code") > 0.0) {
        view_drive_object(self, report);
        view_drive_detail(self, report);
    }
}

void view_fault(view_t *self, const cJSON *status)
{
    const cJSON *fault = view_member(status, "fault");
    const bool is_faulty = view_number(fault, "code") > 0.0;
    view_entry(self, VIEW_NEEDED);
    view_put_colour(self, is_faulty ? VIEW_RED : "");
    view_put_label(self, _("fault"));
    view_put_words(self, fault, "text");
    if (view_number(fault, "axis") > 0.0) {
        view_put(self, ", axis %.0f", view_number(fault, "axis"));
    }
    if (view_number(fault, "device_code") > 0.0) {
        view_put(self, ", device code 0x%04X", (unsigned)view_number(fault, "device_code"));
    }
    draw_device(self, fault);
    view_put_colour(self, is_faulty ? VIEW_PLAIN : "");
    view_end_line(self);
    if (is_faulty) {
        view_entry(self, VIEW_HELPS);
        draw_distance(self, fault, "mm");
        draw_distance(self, fault, "deg");
        view_put_padded(self, _("  cause"), LABEL_COLUMNS);
        view_put_words(self, fault, "cause");
        view_end_line(self);
        view_entry(self, VIEW_NEEDED);
        view_put_padded(self, _("  remedy"), LABEL_COLUMNS);
        view_put_words(self, fault, "remedy");
        view_end_line(self);
    }
}

/* Which keys are others than those that were commissioned. */
static void put_changed(view_t *self, const cJSON *changed)
{
    char shown[SENTENCE_MAX];
    if (cJSON_IsString(changed) && changed->valuestring[0] != '\0') {
        view_put_prose(self, ": ");
        view_put_prose(self, sentence(changed->valuestring, shown, sizeof shown));
    }
}

/* What the machine was never seen to do, and why the configuration that was applied last is not in force. */
void view_configuration(view_t *self, const cJSON *status)
{
    const cJSON *configuration = view_member(status, "configuration"), *why = view_member(configuration, "put_back");
    if (cJSON_IsTrue(view_member(configuration, "slow_rise"))) {
        view_entry(self, VIEW_HELPS);
        view_put_colour(self, VIEW_YELLOW);
        view_put_label(self, _("config"));
        view_put_prose(self, _("not commissioned as it is now: rises at a tenth of engage speed; heavectl commissioned"));
        put_changed(self, view_member(configuration, "changed"));
        view_put_colour(self, VIEW_PLAIN);
        view_end_line(self);
    }
    char shown[SENTENCE_MAX];
    if (!cJSON_IsString(why) || why->valuestring[0] == '\0') {
        return;
    }
    view_entry(self, VIEW_HELPS);
    view_put_colour(self, VIEW_YELLOW);
    view_put_label(self, _("config"));
    view_put_prose(self, _("what was applied could not be started; the one before it is in force again: "));
    view_put_prose(self, sentence(why->valuestring, shown, sizeof shown));
    view_put_colour(self, VIEW_PLAIN);
    view_end_line(self);
}
