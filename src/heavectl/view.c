/* SPDX-License-Identifier: MIT
 * view.c - the status as text; see view.h. Whatever an answer lacks is shown as 0 or "?": a view never fails.
 */
#include "heavectl/view.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#define BAR_COLUMNS_MIN  8u
#define BAR_COLUMNS_MAX  60u
#define BAR_BESIDE       34u /* columns of a cylinder's line beside its bar */
#define LINE_COLUMNS_MAX 512u
#define LABEL_COLUMNS    9
#define BOLD             "\x1b[1m"
#define RED              "\x1b[1;31m"
#define GREEN            "\x1b[1;32m"
#define YELLOW           "\x1b[1;33m"
#define PLAIN            "\x1b[0m"

/** A text being drawn, line by line. */
typedef struct {
    char *text;
    size_t length;
    const ctl_view_style_t *style;
    char line[LINE_COLUMNS_MAX * 4];
    size_t at;        /* bytes of the line */
    unsigned columns; /* of the line, used */
    unsigned rows;
} view_t;

static const cJSON *member(const cJSON *object, const char *name)
{
    return cJSON_GetObjectItemCaseSensitive(object, name);
}

/* What would be shown as -0.000 is 0. */
static double number(const cJSON *object, const char *name)
{
    const cJSON *item = member(object, name);
    const double value = cJSON_IsNumber(item) ? item->valuedouble : 0.0;
    return value < 0.0 && value > -0.0005 ? 0.0 : value;
}

static const char *word(const cJSON *object, const char *name)
{
    const cJSON *item = member(object, name);
    return cJSON_IsString(item) ? item->valuestring : "?";
}

/* --- Lines --- */

/* Adds a character of one column, as far as the line is wide. */
static void put_column(view_t *self, const char *bytes)
{
    const size_t length = strlen(bytes);
    if (self->columns < self->style->columns && self->at + length < sizeof self->line) {
        memcpy(&self->line[self->at], bytes, length);
        self->at += length;
        self->columns++;
    }
}

static __attribute__((format(printf, 2, 3))) void put(view_t *self, const char *format, ...)
{
    char piece[LINE_COLUMNS_MAX];
    va_list arguments;
    va_start(arguments, format);
    (void)vsnprintf(piece, sizeof piece, format, arguments);
    va_end(arguments);
    for (const char *c = piece; *c != '\0'; c++) {
        const char column[2] = {*c, '\0'};
        put_column(self, column);
    }
}

/* A colour takes no column. */
static void put_colour(view_t *self, const char *sequence)
{
    const size_t length = strlen(sequence);
    if (self->style->is_coloured && self->at + length < sizeof self->line) {
        memcpy(&self->line[self->at], sequence, length);
        self->at += length;
    }
}

static void end_line(view_t *self)
{
    const bool is_seen = self->style->rows == 0 || self->rows < self->style->rows;
    const bool is_last = self->rows + 1u == self->style->rows; /* what ended it would scroll the first one away */
    const char *line_end = is_last ? "" : self->style->line_end;
    const size_t end = strlen(line_end);
    self->rows++;
    if (is_seen && self->length + self->at + end < CTL_VIEW_BYTES) {
        memcpy(&self->text[self->length], self->line, self->at);
        memcpy(&self->text[self->length + self->at], line_end, end + 1);
        self->length += self->at + end;
    }
    self->at = 0;
    self->columns = 0;
}

/* Goes on in the next line, under what stands behind a label. */
static void wrap(view_t *self)
{
    end_line(self);
    put(self, "%*s", LABEL_COLUMNS, "");
}

/* True where the word that begins here fits into a line of its own, but not into what is left of this one. */
static bool is_word_too_long(const view_t *self, const char *text)
{
    size_t length = 0;
    while (text[length] > ' ' && (unsigned char)text[length] < 0x80u) {
        length++;
    }
    return self->columns + length > self->style->columns && length + LABEL_COLUMNS <= self->style->columns;
}

/* Adds words; what a line does not hold goes on in the next one. */
static void put_text(view_t *self, const char *text)
{
    bool is_start = true; /* of a word */
    while (*text != '\0') {
        char glyph[5] = {0};
        size_t length = 0;
        if (is_start && *text != ' ' && is_word_too_long(self, text)) {
            wrap(self);
        }
        is_start = *text == ' ';
        do {
            glyph[length++] = *text++;
        } while (length < 4 && ((unsigned char)*text & 0xC0u) == 0x80u);
        if (self->columns + (length > 2 ? 2u : 1u) > self->style->columns) {
            wrap(self);
        }
        put_column(self, glyph);
        self->columns += length > 2 ? 1u : 0u; /* Chinese characters are two columns wide */
    }
}

/* Adds a member's words in the language of the view. */
static void put_words(view_t *self, const cJSON *object, const char *name)
{
    char chinese[32];
    (void)snprintf(chinese, sizeof chinese, "%s_zh", name);
    put_text(self, word(object, self->style->is_chinese && self->style->is_utf8 ? chinese : name));
}

/* Adds what belongs together, in the next line where this one does not hold it. */
static __attribute__((format(printf, 2, 3))) void put_piece(view_t *self, const char *format, ...)
{
    char piece[LINE_COLUMNS_MAX];
    va_list arguments;
    va_start(arguments, format);
    (void)vsnprintf(piece, sizeof piece, format, arguments);
    va_end(arguments);
    if (self->columns + strlen(piece) > self->style->columns) {
        wrap(self);
    }
    put_text(self, piece);
}

/* --- Parts of the table --- */

static const char *state_colour(const char *state)
{
    if (strcmp(state, "FAULT") == 0 || strcmp(state, "ESTOP") == 0) {
        return RED;
    }
    if (strcmp(state, "HOLD") == 0) {
        return YELLOW;
    }
    return strcmp(state, "ENGAGED") == 0 ? GREEN : BOLD;
}

static void draw_head(view_t *self, const cJSON *status)
{
    const double up_s = number(status, "uptime_ms") / 1000.0;
    put_colour(self, state_colour(word(status, "state")));
    put(self, "%-9s", word(status, "state"));
    put_colour(self, PLAIN);
    const bool is_waiting = cJSON_IsTrue(member(status, "waiting_for_sender"));
    const bool is_silent = cJSON_IsTrue(member(status, "held_by_silence"));
    put(self, " goal %-9s%s%s%s%s", word(status, "goal"),
        is_waiting  ? " waiting for a sender"
        : is_silent ? " SENDER SILENT"
                    : "",
        cJSON_IsTrue(member(status, "estop_active")) ? " E-STOP" : "",
        cJSON_IsTrue(member(status, "power_failing")) ? " POWER" : "",
        cJSON_IsTrue(member(status, "shutting_down")) ? " SHUTTING DOWN" : "");
    put_piece(self, "  cycle %.0f us  up %.0f s  late %.0f", number(status, "cycle_us"), up_s, number(status, "late_cycles"));
    end_line(self);
}

/* A row of six axes; per is what the keys have behind the unit. */
static void draw_pose(view_t *self, const cJSON *status, const char *label, const char *name, const char *per)
{
    static const char *const k_axes[] = {"roll_deg", "pitch_deg", "yaw_deg", "x_mm", "y_mm", "z_mm"};
    const cJSON *pose = member(status, name);
    put(self, "%-7s", label);
    for (unsigned i = 0; i < sizeof k_axes / sizeof k_axes[0]; i++) {
        if (cJSON_IsObject(pose)) {
            char key[16];
            (void)snprintf(key, sizeof key, "%s%s", k_axes[i], per);
            put(self, " %10.3f", number(pose, key));
        } else {
            put(self, " %10s", "-");
        }
    }
    end_line(self);
}

static void draw_poses(view_t *self, const cJSON *status)
{
    put(self, "%-7s %10s %10s %10s %10s %10s %10s", "pose", "roll deg", "pitch deg", "yaw deg", "x mm", "y mm", "z mm");
    end_line(self);
    if (cJSON_IsObject(member(status, "pose_received"))) {
        draw_pose(self, status, "frame", "pose_received", "");
    }
    draw_pose(self, status, "asked", "pose_asked", "");
    draw_pose(self, status, "sent", "pose_sent", "");
    draw_pose(self, status, "actual", "pose_actual", "");
    draw_pose(self, status, " per s", "speed_actual", "_s");
    draw_pose(self, status, " per s2", "accel_actual", "_s2");
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
            put_column(self, self->style->is_utf8 ? "\u2503" : "|");
        } else if (i < filled) {
            put_column(self, self->style->is_utf8 ? "\u2588" : "#");
        } else {
            put_column(self, self->style->is_utf8 ? "\u2591" : ".");
        }
    }
}

static void draw_object(view_t *self, const cJSON *report)
{
    if (number(report, "register") > 0.0) {
        put_piece(self, ", register 0x%04X", (unsigned)number(report, "register"));
    } else if (number(report, "object") > 0.0) {
        put_piece(self, ", object %04X:%02X", (unsigned)number(report, "object"), (unsigned)number(report, "sub_index"));
    }
}

static void draw_detail(view_t *self, const cJSON *report)
{
    if (cJSON_IsNumber(member(report, "found"))) {
        put_piece(self, "; %s, found 0x%X, wanted 0x%X", word(report, "detail"), (unsigned)number(report, "found"),
                  (unsigned)number(report, "wanted"));
    } else if (word(report, "detail")[0] != '\0') {
        put_piece(self, "; %s (0x%04X)", word(report, "detail"), (unsigned)number(report, "detail_code"));
    }
}

/* A second line where the drive is not simply as it should be: what it is at, since when, and what is wrong. */
static void draw_report(view_t *self, const cJSON *report, const char *drive)
{
    const bool is_usual = strcmp(word(report, "phase"), drive) == 0 || strcmp(word(report, "phase"), "ready") == 0;
    if (!cJSON_IsObject(report) || (is_usual && number(report, "code") <= 0.0)) {
        return;
    }
    if (member(report, "unit") != NULL) {
        put(self, "   unit %.0f: %s", number(report, "unit"), word(report, "phase"));
    } else {
        put(self, "   node %.0f: %s", number(report, "node"), word(report, "phase"));
    }
    draw_object(self, report);
    if (number(report, "code") > 0.0) {
        put_piece(self, "; %s (0x%04X)", word(report, "trouble"), (unsigned)number(report, "code"));
    }
    draw_detail(self, report);
    put_piece(self, ", %.1f s", number(report, "age_ms") / 1000.0);
    end_line(self);
}

/* What a drive tells that goes on. */
static void draw_notes(view_t *self, const cJSON *report)
{
    const cJSON *note = NULL;
    bool is_any = false;
    cJSON_ArrayForEach(note, member(report, "notes"))
    {
        put_piece(self, is_any ? "; %s" : "   tells: %s", cJSON_IsString(note) ? note->valuestring : "?");
        is_any = true;
    }
    if (is_any) {
        end_line(self);
    }
}

/* The last error that a drive has told of. */
static void draw_emergency(view_t *self, const cJSON *emergency)
{
    if (!cJSON_IsObject(emergency)) {
        return;
    }
    put(self, "   %s 0x%04X", cJSON_IsTrue(member(emergency, "over")) ? "last error, over:" : "error",
        (unsigned)number(emergency, "code"));
    put_piece(self, " (%s), register 0x%02X, manufacturer %s", word(emergency, "text"), (unsigned)number(emergency, "register"),
              word(emergency, "manufacturer"));
    put_piece(self, ", %.1f s ago, %.0f in all", number(emergency, "age_ms") / 1000.0, number(emergency, "count"));
    end_line(self);
}

/* A line for drives that share a slow bus: how often each is served. */
static void draw_service(view_t *self, const cJSON *axis)
{
    if (!cJSON_IsNumber(member(axis, "period_ms"))) {
        return;
    }
    put(self, "   %.1f Hz, newest set-point %.0f ms ago", 1000.0 / number(axis, "period_ms"), number(axis, "setpoint_age_ms"));
    put_piece(self, ", feedback %.0f ms ago", number(axis, "feedback_age_ms"));
    end_line(self);
}

static void draw_drive(view_t *self, const cJSON *axis)
{
    const char *drive = word(axis, "drive");
    put(self, " %s", strcmp(drive, "enabled") == 0 && !cJSON_IsTrue(member(axis, "homed")) ? "no zero" : drive);
    end_line(self);
    draw_service(self, axis);
    draw_report(self, member(axis, "report"), drive);
    draw_notes(self, member(axis, "report"));
    draw_emergency(self, member(member(axis, "report"), "emergency"));
}

/* A drive that has told no position is nowhere, not at 0. */
static void draw_actual(view_t *self, const cJSON *axis, const char *name)
{
    if (cJSON_IsNumber(member(axis, name))) {
        put(self, " %9.3f", number(axis, name));
    } else {
        put(self, " %9s", "-");
    }
}

static void draw_cylinders(view_t *self, const cJSON *status)
{
    const cJSON *cylinder = NULL;
    put(self, "cylinder, sent (bar) and actual, mm");
    end_line(self);
    cJSON_ArrayForEach(cylinder, member(status, "cylinders"))
    {
        const double sent = number(cylinder, "sent_mm");
        const double actual = cJSON_IsNumber(member(cylinder, "actual_mm")) ? number(cylinder, "actual_mm") : sent;
        put(self, " %.0f ", number(cylinder, "number"));
        draw_bar(self, sent, actual, number(cylinder, "stroke_mm"));
        put(self, " %9.3f", sent);
        draw_actual(self, cylinder, "actual_mm");
        draw_drive(self, cylinder);
    }
    const cJSON *rotation = member(status, "rotation");
    if (cJSON_IsObject(rotation)) {
        put(self, "rotation motor %.3f deg, actual", number(rotation, "sent_deg"));
        draw_actual(self, rotation, "actual_deg");
        draw_drive(self, rotation);
    }
}

/* What keeps the bus from working, or did last. */
static void draw_bus(view_t *self, const cJSON *bus)
{
    const char *now = word(bus, "trouble");
    const char *before = word(bus, "last_trouble");
    if (!cJSON_IsObject(bus)) {
        return;
    }
    put(self, "bus      ");
    put_piece(self, "%s", now[0] != '\0' ? now : "works");
    if (now[0] == '\0' && before[0] != '\0') {
        put_piece(self, "; last trouble: %s", before);
    }
    end_line(self);
}

static bool is_on(const cJSON *relays, unsigned relay)
{
    const cJSON *item = NULL;
    cJSON_ArrayForEach(item, member(relays, "on"))
    {
        if (item->valuedouble == (double)relay) {
            return true;
        }
    }
    return false;
}

static void draw_relays(view_t *self, const cJSON *status)
{
    const cJSON *relays = member(status, "relays");
    const unsigned count = (unsigned)number(relays, "count");
    put(self, "relays   ");
    for (unsigned i = 1; i <= count; i++) {
        put(self, "%u", i);
        if (self->style->is_utf8) {
            put_column(self, is_on(relays, i) ? "\u25cf" : "\u25cb");
        } else {
            put_column(self, is_on(relays, i) ? "*" : "-");
        }
        put(self, " ");
    }
    put(self, count > 0 ? " %s" : "none", word(relays, "mask"));
    put(self, "%s", cJSON_IsFalse(member(relays, "known")) ? ", not known" : "");
    end_line(self);
}

/* Counters that are not 0, by name. */
static void draw_counts(view_t *self, const char *label, const cJSON *counts)
{
    const cJSON *item = NULL;
    bool is_any = false;
    put(self, "%-9s", label);
    cJSON_ArrayForEach(item, counts)
    {
        if (cJSON_IsNumber(item) && item->valuedouble != 0.0) {
            put_piece(self, "%s%s %.0f", is_any ? ", " : "", item->string, item->valuedouble);
            is_any = true;
        }
    }
    put(self, "%s", is_any ? "" : "none");
    end_line(self);
}

/* What was asked for, and where a change has come to. */
static void draw_intensity(view_t *self, const cJSON *intensity)
{
    const double percent = number(intensity, "percent");
    const double now = number(intensity, "now_percent");
    put(self, "intensity %.0f %% of the sender's motion", percent);
    if (now != percent) {
        put(self, ", now %.1f %%", now);
    }
    end_line(self);
}

/* Who drives, and who else would like to. */
static void draw_senders(view_t *self, const cJSON *status)
{
    const cJSON *sender = member(status, "sender");
    const cJSON *other = member(status, "other_sender");
    put(self, "sender   %s", cJSON_IsObject(sender) ? word(sender, "address") : "none yet");
    if (cJSON_IsObject(other)) {
        put_piece(self, "; not followed: %s, %.1f s ago", word(other, "address"), number(other, "age_ms") / 1000.0);
    }
    end_line(self);
}

/* What kind of sender it is, in words. */
static const char *sender_words(const char *sender)
{
    static const struct {
        const char *sender, *words;
    } k_words[] = {
        {"even", "evenly timed"},
        {"bursts", "evenly timed, sent in bursts"},
        {"arrivals", "each pose is of the moment when it was sent"},
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
    const char *words = sender_words(word(stream, "sender"));
    if (words[0] == '\0') {
        put(self, "stream   none");
        return;
    }
    put(self, "stream   every %.1f ms, %s; up to %.1f ms late, %.1f %% lost", number(stream, "period_ms"), words,
        number(stream, "jitter_ms"), number(stream, "lost_permille") / 10.0);
    end_line(self);
    put(self, "         followed %.1f ms later: %.1f of these for late frames, %.1f as limits bind", number(stream, "delay_ms"),
        number(stream, "wait_ms"), number(stream, "smoothing_ms"));
}

static void draw_frames(view_t *self, const cJSON *status)
{
    const cJSON *counters = member(status, "counters");
    const cJSON *stream = member(status, "stream");
    draw_counts(self, "accepted", member(counters, "accepted"));
    draw_counts(self, "rejected", member(counters, "rejected"));
    draw_counts(self, "other", counters);
    draw_stream(self, stream);
    if (cJSON_IsNumber(member(stream, "last_frame_age_ms"))) {
        put_piece(self, ", last frame %.1f s ago", number(stream, "last_frame_age_ms") / 1000.0);
    }
    end_line(self);
}

/* A flag in words; the flag itself where it is not known. */
static const char *flag_words(const char *flag)
{
    static const struct {
        const char *flag, *words;
    } k_words[] = {
        {"clamped", "beyond the limits, pulled in"}, {"speed", "speed limited"},
        {"accel", "acceleration limited"},           {"stretched", "timed move takes longer than asked"},
        {"takeover", "going to the first pose"},     {"cylinders", "moving cylinder by cylinder"},
        {"off-path", "cylinders catching up"},       {"no-pose", "extensions without a pose"},
    };
    for (size_t i = 0; i < sizeof k_words / sizeof k_words[0]; i++) {
        if (strcmp(flag, k_words[i].flag) == 0) {
            return k_words[i].words;
        }
    }
    return flag;
}

/* What heaved itself has found an axis to be off. */
static void draw_distance(view_t *self, const cJSON *fault, const char *unit)
{
    char off[16], allowed[16];
    (void)snprintf(off, sizeof off, "off_%s", unit);
    (void)snprintf(allowed, sizeof allowed, "allowed_%s", unit);
    if (!cJSON_IsNumber(member(fault, off))) {
        return;
    }
    const bool is_chinese = self->style->is_chinese && self->style->is_utf8;
    put(self, is_chinese ? "  由 heaved 发现：偏差 %.2f %s，允许 %.2f %s" : "  found  by heaved: %.2f %s off, allowed %.2f %s",
        number(fault, off), unit, number(fault, allowed), unit);
    end_line(self);
}

/* What the drive of a fault was at when it began. */
static void draw_device(view_t *self, const cJSON *fault)
{
    const cJSON *report = member(fault, "report");
    if (word(fault, "device_text")[0] != '\0') {
        put_piece(self, " (%s)", word(fault, "device_text"));
    }
    if (number(report, "code") > 0.0) {
        draw_object(self, report);
        draw_detail(self, report);
    }
}

static void draw_flags(view_t *self, const cJSON *status)
{
    const cJSON *flag = NULL;
    bool is_any = false;
    put(self, "flags    ");
    cJSON_ArrayForEach(flag, member(status, "flags"))
    {
        put_piece(self, "%s%s", is_any ? "; " : "", cJSON_IsString(flag) ? flag_words(flag->valuestring) : "?");
        is_any = true;
    }
    end_line(self);
}

static void draw_fault(view_t *self, const cJSON *status)
{
    const cJSON *fault = member(status, "fault");
    const bool is_faulty = number(fault, "code") > 0.0;
    put_colour(self, is_faulty ? RED : "");
    put(self, "fault    ");
    put_words(self, fault, "text");
    if (number(fault, "axis") > 0.0) {
        put(self, ", axis %.0f", number(fault, "axis"));
    }
    if (number(fault, "device_code") > 0.0) {
        put(self, ", device code 0x%04X", (unsigned)number(fault, "device_code"));
    }
    draw_device(self, fault);
    put_colour(self, is_faulty ? PLAIN : "");
    end_line(self);
    if (is_faulty) {
        draw_distance(self, fault, "mm");
        draw_distance(self, fault, "deg");
        put(self, "  cause  ");
        put_words(self, fault, "cause");
        end_line(self);
        put(self, "  remedy ");
        put_words(self, fault, "remedy");
        end_line(self);
    }
}

size_t ctl_view_table(const cJSON *status, const ctl_view_style_t *style, char text[CTL_VIEW_BYTES])
{
    view_t view = {.style = style};
    view.text = text;
    text[0] = '\0';
    const bool is_faulty = number(member(status, "fault"), "code") > 0.0;
    draw_head(&view, status);
    if (is_faulty) { /* at once below the state: of a table that is too long, the end is not seen */
        draw_fault(&view, status);
    }
    draw_poses(&view, status);
    draw_cylinders(&view, status);
    draw_bus(&view, member(status, "bus"));
    draw_relays(&view, status);
    draw_intensity(&view, member(status, "intensity"));
    draw_senders(&view, status);
    draw_frames(&view, status);
    draw_flags(&view, status);
    if (!is_faulty) {
        draw_fault(&view, status);
    }
    return view.length;
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
    const cJSON *pose = member(status, "pose_sent");
    const cJSON *counters = member(status, "counters");
    const cJSON *cylinder = NULL;
    view_t view = {.style = &k_style};
    view.text = text;
    put(&view, "%s goal %s pose %.3f %.3f %.3f deg %.3f %.3f %.3f mm cylinders", word(status, "state"), word(status, "goal"),
        number(pose, "roll_deg"), number(pose, "pitch_deg"), number(pose, "yaw_deg"), number(pose, "x_mm"), number(pose, "y_mm"),
        number(pose, "z_mm"));
    cJSON_ArrayForEach(cylinder, member(status, "cylinders"))
    {
        put(&view, " %.3f", number(cylinder, "sent_mm"));
    }
    put(&view, " intensity %.0f", number(member(status, "intensity"), "percent"));
    put(&view, " relays %s accepted %.0f rejected %.0f fault %s", word(member(status, "relays"), "mask"),
        total(member(counters, "accepted")), total(member(counters, "rejected")), word(member(status, "fault"), "name"));
    end_line(&view);
    return view.length;
}
