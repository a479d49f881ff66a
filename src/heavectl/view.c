/* SPDX-License-Identifier: MIT
 * view.c - the status as text; see view.h. Whatever an answer lacks is shown as 0 or "?": a view never fails.
 */
#include "heavectl/view.h"

#include <stdio.h>
#include <string.h>

#include "common/sentence.h"
#include "common/translate.h"
#include "heavectl/view_drive.h"
#include "heavectl/view_lines.h"
#include "heavectl/view_trouble.h"

#define BAR_COLUMNS_MIN    8u
#define BAR_COLUMNS_MAX    60u
#define BAR_BESIDE         34u /* columns of a cylinder's line beside its bar */
#define LABEL_COLUMNS      9
#define POSE_LABEL_COLUMNS 7u
#define POSE_COLUMNS       11u

/* --- Parts of the table --- */

static const char *state_colour(const char *state)
{
    if (strcmp(state, "FAULT") == 0 || strcmp(state, "ESTOP") == 0) {
        return VIEW_RED;
    }
    if (strcmp(state, "HOLD") == 0) {
        return VIEW_YELLOW;
    }
    return strcmp(state, "ENGAGED") == 0 ? VIEW_GREEN : VIEW_BOLD;
}

static void draw_head(view_t *self, const cJSON *status)
{
    const double up_s = view_number(status, "uptime_ms") / 1000.0;
    view_put_colour(self, state_colour(view_word(status, "state")));
    view_put_padded(self, view_text(status, "state"), LABEL_COLUMNS);
    view_put_colour(self, VIEW_PLAIN);
    const bool is_waiting = cJSON_IsTrue(view_member(status, "waiting_for_sender"));
    const bool is_silent = cJSON_IsTrue(view_member(status, "held_by_silence"));
    view_put(self, " goal ");
    view_put_padded(self, view_text(status, "goal"), LABEL_COLUMNS);
    view_put(self, "%s%s%s%s",
             is_waiting  ? _(" waiting for a sender")
             : is_silent ? _(" SENDER SILENT")
                         : "",
             cJSON_IsTrue(view_member(status, "estop_active")) ? _(" E-STOP") : "",
             cJSON_IsTrue(view_member(status, "power_failing")) ? _(" POWER") : "",
             cJSON_IsTrue(view_member(status, "shutting_down")) ? _(" SHUTTING DOWN") : "");
    view_put_piece(self, "  cycle %.0f us  up %.0f s  late %.0f", view_number(status, "cycle_us"), up_s,
                   view_number(status, "late_cycles"));
    view_end_line(self);
    if (strcmp(view_word(status, "state"), "HOLD") == 0 && !is_silent) {
        char shown[SENTENCE_MAX];
        view_put_padded(self, _("on hold"), LABEL_COLUMNS);
        view_put(self, " %s", sentence(view_word(status, "hold_reason"), shown, sizeof shown));
        view_end_line(self);
    }
}

/* A row of six axes; per is what the keys have behind the unit. */
static void draw_pose(view_t *self, const cJSON *status, const char *label, const char *name, const char *per)
{
    static const char *const k_axes[] = {"roll_deg", "pitch_deg", "yaw_deg", "x_mm", "y_mm", "z_mm"};
    const cJSON *pose = view_member(status, name);
    if (per[0] != '\0') { /* the others go with their head */
        view_entry(self, VIEW_EXTRA);
    }
    view_put_padded(self, translate(label), POSE_LABEL_COLUMNS);
    for (unsigned i = 0; i < sizeof k_axes / sizeof k_axes[0]; i++) {
        if (cJSON_IsObject(pose)) {
            char key[16];
            (void)snprintf(key, sizeof key, "%s%s", k_axes[i], per);
            view_put(self, "%*.3f", (int)POSE_COLUMNS, view_number(pose, key));
        } else {
            view_put(self, "%*s", (int)POSE_COLUMNS, "-");
        }
    }
    view_end_line(self);
}

static void draw_poses(view_t *self, const cJSON *status)
{
    static const char *const k_heads[] = {N_("roll deg"), N_("pitch deg"), N_("yaw deg"), N_("x mm"), N_("y mm"), N_("z mm")};
    view_entry(self, VIEW_ASKED);
    view_put_padded(self, _("pose"), POSE_LABEL_COLUMNS);
    for (unsigned i = 0; i < sizeof k_heads / sizeof k_heads[0]; i++) {
        view_put_right(self, translate(k_heads[i]), POSE_COLUMNS);
    }
    view_end_line(self);
    if (cJSON_IsObject(view_member(status, "pose_received"))) {
        draw_pose(self, status, N_("frame"), "pose_received", "");
    }
    draw_pose(self, status, N_("asked"), "pose_asked", "");
    draw_pose(self, status, N_("sent"), "pose_sent", "");
    draw_pose(self, status, N_("actual"), "pose_actual", "");
    draw_pose(self, status, N_(" per s"), "speed_actual", "_s");
    draw_pose(self, status, N_(" per s2"), "accel_actual", "_s2");
}

static double part(double value, double whole)
{
    const double share = whole > 0.0 ? value / whole : 0.0;
    return share < 0.0 ? 0.0 : share > 1.0 ? 1.0 : share;
}

/* A bar as far as sent, with a mark at actual where it is somewhere else. */
static void draw_bar(view_t *self, double sent, double actual, double whole)
{
    const unsigned wide = self->style->columns > BAR_BESIDE ? self->style->columns - BAR_BESIDE : 0;
    const unsigned columns = wide < BAR_COLUMNS_MIN ? BAR_COLUMNS_MIN : wide > BAR_COLUMNS_MAX ? BAR_COLUMNS_MAX : wide;
    const unsigned filled = (unsigned)(part(sent, whole) * columns + 0.5);
    const unsigned mark = (unsigned)(part(actual, whole) * columns + 0.5);
    const bool is_marked = mark != filled;
    for (unsigned i = 0; i < columns; i++) {
        if (is_marked && i + 1 == (mark == 0 ? 1 : mark)) {
            view_put_column(self, self->style->is_utf8 ? "\u2503" : "|");
        } else if (i < filled) {
            view_put_column(self, self->style->is_utf8 ? "\u2588" : "#");
        } else {
            view_put_column(self, self->style->is_utf8 ? "\u2591" : ".");
        }
    }
}

/* A drive that has told no position is nowhere, not at 0. */
static void draw_actual(view_t *self, const cJSON *axis, const char *name)
{
    if (cJSON_IsNumber(view_member(axis, name))) {
        view_put(self, " %9.3f", view_number(axis, name));
    } else {
        view_put(self, " %9s", "-");
    }
}

static void draw_cylinders(view_t *self, const cJSON *status)
{
    const cJSON *cylinder = NULL;
    view_entry(self, VIEW_NEEDED);
    view_put(self, "cylinder, sent (bar) and actual, mm");
    view_end_line(self);
    cJSON_ArrayForEach(cylinder, view_member(status, "cylinders"))
    {
        const double sent = view_number(cylinder, "sent_mm");
        const double actual = cJSON_IsNumber(view_member(cylinder, "actual_mm")) ? view_number(cylinder, "actual_mm") : sent;
        view_entry(self, VIEW_NEEDED);
        view_put(self, " %.0f ", view_number(cylinder, "number"));
        draw_bar(self, sent, actual, view_number(cylinder, "stroke_mm"));
        view_put(self, " %9.3f", sent);
        draw_actual(self, cylinder, "actual_mm");
        view_drive(self, cylinder);
    }
    const cJSON *rotation = view_member(status, "rotation");
    if (cJSON_IsObject(rotation)) {
        view_entry(self, VIEW_NEEDED);
        view_put(self, "rotation motor %.3f deg, actual", view_number(rotation, "sent_deg"));
        draw_actual(self, rotation, "actual_deg");
        view_drive(self, rotation);
    }
}

/* What keeps the bus from working, or did last. */
static void draw_bus(view_t *self, const cJSON *bus)
{
    const char *now = view_word(bus, "trouble");
    const char *before = view_word(bus, "last_trouble");
    char shown[SENTENCE_MAX];
    if (!cJSON_IsObject(bus)) {
        return;
    }
    view_entry(self, VIEW_NEEDED);
    view_put_label(self, _("bus"));
    view_put_piece(self, "%s", now[0] != '\0' ? sentence(now, shown, sizeof shown) : _("works"));
    if (now[0] == '\0' && before[0] != '\0') {
        view_put_piece(self, "; last trouble: %s", sentence(before, shown, sizeof shown));
    }
    view_end_line(self);
}

static bool is_on(const cJSON *relays, unsigned relay)
{
    const cJSON *item = NULL;
    cJSON_ArrayForEach(item, view_member(relays, "on"))
    {
        if (item->valuedouble == (double)relay) {
            return true;
        }
    }
    return false;
}

static void draw_relays(view_t *self, const cJSON *status)
{
    const cJSON *relays = view_member(status, "relays");
    const unsigned count = (unsigned)view_number(relays, "count");
    view_entry(self, VIEW_ASKED);
    view_put_label(self, _("relays"));
    for (unsigned i = 1; i <= count; i++) {
        view_put(self, "%u", i);
        if (self->style->is_utf8) {
            view_put_column(self, is_on(relays, i) ? "\u25cf" : "\u25cb");
        } else {
            view_put_column(self, is_on(relays, i) ? "*" : "-");
        }
        view_put(self, " ");
    }
    view_put(self, "%s", count > 0 ? " " : _("none"));
    view_put(self, "%s", count > 0 ? view_word(relays, "mask") : "");
    view_put(self, "%s", cJSON_IsFalse(view_member(relays, "known")) ? _(", not known") : "");
    view_end_line(self);
}

/* Counters that are not 0, by name. */
static void draw_counts(view_t *self, const char *label, const cJSON *counts)
{
    const cJSON *item = NULL;
    bool is_any = false;
    view_entry(self, VIEW_EXTRA);
    view_put_label(self, label);
    cJSON_ArrayForEach(item, counts)
    {
        if (cJSON_IsNumber(item) && item->valuedouble != 0.0) {
            view_put_piece(self, "%s%s %.0f", is_any ? ", " : "", translate(item->string), item->valuedouble);
            is_any = true;
        }
    }
    view_put(self, "%s", is_any ? "" : _("none"));
    view_end_line(self);
}

/* What was asked for, and where a change has come to. */
static void draw_intensity(view_t *self, const cJSON *intensity)
{
    const double percent = view_number(intensity, "percent");
    const double now = view_number(intensity, "now_percent");
    view_entry(self, VIEW_EXTRA);
    view_put(self, "intensity %.0f %% of the sender's motion", percent);
    if (now != percent) {
        view_put(self, ", now %.1f %%", now);
    }
    view_end_line(self);
}

/* Who drives, and who else would like to. */
static void draw_senders(view_t *self, const cJSON *status)
{
    const cJSON *sender = view_member(status, "sender");
    const cJSON *other = view_member(status, "other_sender");
    view_entry(self, VIEW_NEEDED);
    view_put_label(self, _("sender"));
    view_put(self, "%s", cJSON_IsObject(sender) ? view_word(sender, "address") : _("none yet"));
    if (strcmp(view_word(sender, "mask"), "digits") == 0) {
        view_put_piece(self, "; its relay masks change like digits, relays stay at safe_mask: decimal commas?");
    }
    if (cJSON_IsObject(other)) {
        view_put_piece(self, "; not followed: %s, %.1f s ago", view_word(other, "address"),
                       view_number(other, "age_ms") / 1000.0);
    }
    view_end_line(self);
}

/* What kind of sender it is, in words. */
static const char *sender_words(const char *sender)
{
    static const struct {
        const char *sender, *words;
    } k_words[] = {
        {"even", N_("evenly timed")},
        {"bursts", N_("evenly timed, sent in bursts")},
        {"arrivals", N_("each pose is of the moment when it was sent")},
    };
    for (size_t i = 0; i < sizeof k_words / sizeof k_words[0]; i++) {
        if (strcmp(k_words[i].sender, sender) == 0) {
            return k_words[i].words;
        }
    }
    return "";
}

static void draw_stream(view_t *self, const cJSON *stream)
{
    const char *words = sender_words(view_word(stream, "sender"));
    view_entry(self, VIEW_ASKED);
    if (words[0] == '\0') {
        view_put_label(self, _("stream"));
        view_put(self, "%s", _("none"));
        return;
    }
    view_put_label(self, _("stream"));
    view_put_piece(self, "every %.1f ms, %s; up to %.1f ms late, %.1f %% lost", view_number(stream, "period_ms"),
                   translate(words), view_number(stream, "jitter_ms"), view_number(stream, "lost_permille") / 10.0);
    view_end_line(self);
    view_put_label(self, "");
    view_put_piece(self, "followed %.1f ms later: %.1f of these for late frames, %.1f as limits bind",
                   view_number(stream, "delay_ms"), view_number(stream, "wait_ms"), view_number(stream, "smoothing_ms"));
}

static void draw_frames(view_t *self, const cJSON *status)
{
    const cJSON *counters = view_member(status, "counters");
    const cJSON *stream = view_member(status, "stream");
    draw_counts(self, _("accepted"), view_member(counters, "accepted"));
    draw_counts(self, _("rejected"), view_member(counters, "rejected"));
    draw_counts(self, _("other"), counters);
    draw_stream(self, stream);
    if (cJSON_IsNumber(view_member(stream, "last_frame_age_ms"))) {
        view_put_piece(self, ", last frame %.1f s ago", view_number(stream, "last_frame_age_ms") / 1000.0);
    }
    view_end_line(self);
}

/* A flag in words; the flag itself where it is not known. */
static const char *flag_words(const char *flag)
{
    static const struct {
        const char *flag, *words;
    } k_words[] = {
        {"clamped", N_("beyond the limits, pulled in")}, {"speed", N_("speed limited")},
        {"accel", N_("acceleration limited")},           {"stretched", N_("timed move takes longer than asked")},
        {"takeover", N_("going to the first pose")},     {"cylinders", N_("moving cylinder by cylinder")},
        {"off-path", N_("cylinders catching up")},       {"no-pose", N_("extensions without a pose")},
    };
    for (size_t i = 0; i < sizeof k_words / sizeof k_words[0]; i++) {
        if (strcmp(flag, k_words[i].flag) == 0) {
            return k_words[i].words;
        }
    }
    return flag;
}

static void draw_flags(view_t *self, const cJSON *status)
{
    const cJSON *flag = NULL;
    bool is_any = false;
    view_entry(self, VIEW_ASKED);
    view_put_label(self, _("flags"));
    cJSON_ArrayForEach(flag, view_member(status, "flags"))
    {
        view_put_piece(self, "%s%s", is_any ? "; " : "", cJSON_IsString(flag) ? translate(flag_words(flag->valuestring)) : "?");
        is_any = true;
    }
    view_end_line(self);
}

size_t ctl_view_table(const cJSON *status, const ctl_view_style_t *style, char text[CTL_VIEW_BYTES])
{
    view_t view;
    view_start(&view, style);
    const bool is_faulty = view_number(view_member(status, "fault"), "code") > 0.0;
    draw_head(&view, status);
    if (is_faulty) { /* at once below the state: of a table that is too long, the end is not seen */
        view_fault(&view, status);
    }
    view_configuration(&view, status);
    draw_poses(&view, status);
    draw_cylinders(&view, status);
    draw_bus(&view, view_member(status, "bus"));
    draw_relays(&view, status);
    draw_intensity(&view, view_member(status, "intensity"));
    draw_senders(&view, status);
    draw_frames(&view, status);
    draw_flags(&view, status);
    if (!is_faulty) {
        view_fault(&view, status);
    }
    return view_end(&view, text);
}

static double total(const cJSON *counts)
{
    const cJSON *item = NULL;
    double sum = 0.0;
    cJSON_ArrayForEach(item, counts)
    {
        sum += cJSON_IsNumber(item) ? item->valuedouble : 0.0;
    }
    return sum;
}

size_t ctl_view_line(const cJSON *status, char text[CTL_VIEW_BYTES])
{
    static const ctl_view_style_t k_style = {.columns = LINE_COLUMNS_MAX, .line_end = ""};
    const cJSON *pose = view_member(status, "pose_sent");
    const cJSON *counters = view_member(status, "counters");
    const cJSON *cylinder = NULL;
    view_t view;
    view_start(&view, &k_style);
    view_put(&view, "%s goal %s pose %.3f %.3f %.3f deg %.3f %.3f %.3f mm cylinders", view_text(status, "state"),
             view_text(status, "goal"), view_number(pose, "roll_deg"), view_number(pose, "pitch_deg"),
             view_number(pose, "yaw_deg"), view_number(pose, "x_mm"), view_number(pose, "y_mm"), view_number(pose, "z_mm"));
    cJSON_ArrayForEach(cylinder, view_member(status, "cylinders"))
    {
        view_put(&view, " %.3f", view_number(cylinder, "sent_mm"));
    }
    view_put(&view, " intensity %.0f", view_number(view_member(status, "intensity"), "percent"));
    view_put(&view, " relays %s accepted %.0f rejected %.0f fault %s", view_word(view_member(status, "relays"), "mask"),
             total(view_member(counters, "accepted")), total(view_member(counters, "rejected")),
             view_word(view_member(status, "fault"), "name"));
    view_end_line(&view);
    return view_end(&view, text);
}
