/* SPDX-License-Identifier: MIT
 * dbc.c - the frames of [can-raw] as a DBC file; see dbc.h.
 */
#include "inspect/dbc.h"

#include <stdlib.h>
#include <string.h>

#include "platform/canraw_section.h"

#define FRAMES_MAX   (8u + CANRAW_STEPS_MAX)
#define PREFIX_MAX   4u
#define MESSAGES_MAX (4u * DRIVES_MAX)
#define EXTENDED_BIT 0x80000000u /* marks an identifier of 29 bits */

/* The frames that share an identifier. */
typedef struct {
    const char *name;   /* "command" or "reply" */
    const char *sender; /* of the drive's two: NULL is the drive itself */
    unsigned count;
    unsigned prefix; /* bytes that tell them apart; 0: the first frame alone */
    const char *kind[FRAMES_MAX];
    const canraw_frame_t *frame[FRAMES_MAX];
} group_t;

/* One identifier, of one drive or several. */
typedef struct {
    const group_t *group;
    uint32_t id;
    unsigned drive; /* the first that has it */
    uint32_t (*id_of)(const config_can_raw_t *raw, unsigned axis);
} message_t;

/* How a field is read: value = raw * factor + offset. */
typedef struct {
    double factor, offset, low, high;
    const char *unit;
} reading_t;

static void add(group_t *self, const char *kind, const canraw_frame_t *frame)
{
    if (frame->length > 0) {
        self->kind[self->count] = kind;
        self->frame[self->count++] = frame;
    }
}

static bool has_prefix(const canraw_frame_t *frame, unsigned bytes)
{
    const unsigned wanted = (1u << bytes) - 1u;
    uint8_t used[CANRAW_BYTES_MAX] = {0};
    for (unsigned i = 0; i < frame->fields; i++) {
        (void)canraw_field_cover(&frame->field[i], used);
    }
    for (unsigned at = 0; at < bytes; at++) {
        if (used[at] != 0) {
            return false;
        }
    }
    return (frame->constant & wanted) == wanted;
}

/* Whether so many bytes at the beginning tell all frames apart. */
static bool is_significant(const group_t *self, unsigned bytes)
{
    for (unsigned i = 0; i < self->count; i++) {
        if (!has_prefix(self->frame[i], bytes)) {
            return false;
        }
        for (unsigned other = 0; other < i; other++) {
            if (memcmp(self->frame[i]->data, self->frame[other]->data, bytes) == 0) {
                return false;
            }
        }
    }
    return true;
}

static void find_prefix(group_t *self)
{
    self->prefix = 0;
    for (unsigned bytes = 1; bytes <= PREFIX_MAX && self->count > 1 && self->prefix == 0; bytes++) {
        self->prefix = is_significant(self, bytes) ? bytes : 0;
    }
    self->count = self->prefix == 0 && self->count > 1 ? 1 : self->count;
}

/* The group with the frames of starting up, where it can be told apart then; else without them. */
static group_t with_startup(const group_t *group, const config_can_raw_t *raw, bool is_answer)
{
    static const char *const k_names[2][CANRAW_STEPS_MAX] = {
        {"startup1", "startup2", "startup3", "startup4", "startup5", "startup6", "startup7", "startup8"},
        {"answer1", "answer2", "answer3", "answer4", "answer5", "answer6", "answer7", "answer8"}};
    group_t all = *group;
    group_t plain = *group;
    for (unsigned i = 0; i < CANRAW_STEPS_MAX; i++) {
        add(&all, k_names[is_answer][i], is_answer ? &raw->startup[i].answer : &raw->startup[i].frame);
    }
    find_prefix(&all);
    find_prefix(&plain);
    return all.prefix > 0 || plain.count == 0 ? all : plain;
}

static group_t setpoints_of(const config_can_raw_t *raw)
{
    group_t group = {.name = "setpoint", .sender = "heaved"};
    add(&group, "setpoint", &raw->setpoint);
    return group;
}

static group_t statuses_of(const config_can_raw_t *raw)
{
    group_t group = {.name = "status"};
    add(&group, "status_reply", &raw->status_reply);
    return group;
}

/* Set-points may have an identifier of their own. */
static group_t commands_of(const config_can_raw_t *raw)
{
    group_t group = {.name = "command", .sender = "heaved"};
    if (raw->setpoint_id.count == 0) {
        add(&group, "setpoint", &raw->setpoint);
    }
    add(&group, "enable", &raw->enable);
    add(&group, "disable", &raw->disable);
    add(&group, "stop", &raw->stop);
    add(&group, "reset", &raw->reset);
    add(&group, "home", &raw->home);
    add(&group, "position_query", &raw->position_query);
    add(&group, "homing_query", &raw->homing_query);
    return with_startup(&group, raw, false);
}

static group_t replies_of(const config_can_raw_t *raw)
{
    group_t group = {.name = "reply"};
    add(&group, "position_reply", &raw->position_reply);
    add(&group, "homing_reply", &raw->homing_reply);
    if (raw->status_id.count == 0) {
        add(&group, "status_reply", &raw->status_reply);
    }
    return with_startup(&group, raw, true);
}

static unsigned cylinders_of(const config_t *config)
{
    return config->settings.geometry.kind == KIN_HEXAPOD ? 6u : 3u;
}

/* Counts that are 1 in a field. */
static double counts_of(const canraw_field_t *field)
{
    return field->divisor != 0 ? field->divisor : 1.0;
}

static reading_t read_position(const config_t *config, unsigned drive, const canraw_field_t *field)
{
    const counts_scale_t scale = config_canraw_scale(config, drive);
    const bool is_angle = drive >= cylinders_of(config);
    const axis_settings_t *angle = &config->settings.axis[AXIS_ANGLE];
    const double factor = (double)scale.den / scale.num;
    return (reading_t){.factor = factor * counts_of(field),
                       .offset = scale.zero == 0 ? 0.0 : -scale.zero * factor,
                       .low = is_angle ? (double)angle->min_q16 / Q16_ONE : 0.0,
                       .high = (double)(is_angle ? angle->max_q16 : config->settings.stroke_mm_q16[drive]) / Q16_ONE,
                       .unit = is_angle ? "deg" : "mm"};
}

static reading_t read_plain(const canraw_field_t *field)
{
    return (reading_t){counts_of(field), 0.0, (double)canraw_field_min(field), (double)canraw_field_max(field), ""};
}

static reading_t read_field(const config_t *config, unsigned drive, const canraw_field_t *field)
{
    const bool is_angle = drive >= cylinders_of(config);
    const config_ratios_t *speeds =
        is_angle ? &config->can_raw.angle_speed_counts_per_deg_s : &config->can_raw.speed_counts_per_mm_s;
    const unsigned at = speeds->count == 1 ? 0 : drive;
    reading_t reading = read_plain(field);
    if (field->value == CANRAW_POSITION) {
        return read_position(config, drive, field);
    }
    if (field->value == CANRAW_SPEED && speeds->count > 0) {
        const double factor = (double)speeds->den[at] / speeds->num[at];
        reading.factor *= factor;
        reading.low *= factor;
        reading.high *= factor;
        reading.unit = is_angle ? "deg/s" : "mm/s";
    }
    return reading;
}

const char *dbc_decimal(double value, char text[32])
{
    for (int digits = 15; digits <= 17; digits++) {
        (void)snprintf(text, 32, "%.*g", digits, value);
        if (strtod(text, NULL) == value) {
            break;
        }
    }
    return text;
}

/* First bytes of a frame as the number that the multiplexor carries. */
static unsigned long prefix_of(const group_t *group, unsigned i)
{
    unsigned long value = 0;
    for (unsigned byte = group->prefix; byte > 0; byte--) {
        value = value << 8 | group->frame[i]->data[byte - 1u];
    }
    return value;
}

/* Of one whole byte the order says nothing. */
static bool is_big_endian(const canraw_field_t *field)
{
    return field->is_big_endian && (field->bits != 8u || field->skip != 0);
}

/* DBC counts a big-endian field from its highest bit. */
static unsigned start_bit(const canraw_field_t *field)
{
    return 8u * field->at + (is_big_endian(field) ? 7u - field->skip : field->skip);
}

/* The drive that has a field of a message: that of its slot; the first one where it is of all. DRIVES_MAX: the slot is free. */
static unsigned drive_of(const config_t *config, const message_t *message, const canraw_field_t *field)
{
    unsigned slot = 0;
    for (unsigned k = 0; k < config_canraw_axes(config); k++) {
        slot += message->id_of(&config->can_raw, k) == message->id ? 1u : 0u;
        if (slot > 0 && slot >= field->slot) {
            return k;
        }
    }
    return DRIVES_MAX;
}

static void write_name(const message_t *message, unsigned i, const canraw_field_t *field, unsigned drive, FILE *out)
{
    static const char *const k_names[CANRAW_VALUES] = {"position", "speed",    "status",   "counter", "fault",
                                                       "torque",   "checksum", "checksum", "checksum"};
    const bool is_homing = strcmp(message->group->kind[i], "homing_reply") == 0;
    if (field->slot != 0) {
        fprintf(out, "drive%u_", drive + 1u);
    }
    fprintf(out, "%s%s", is_homing ? "homing_" : "", k_names[field->value]);
}

static void write_signal(const config_t *config, const message_t *message, unsigned i, const canraw_field_t *field, FILE *out)
{
    const group_t *group = message->group;
    const unsigned drive = drive_of(config, message, field);
    char number[4][32];
    char only[32] = "";
    if (drive == DRIVES_MAX) {
        return;
    }
    if (group->prefix > 0) {
        (void)snprintf(only, sizeof only, " m%lu", prefix_of(group, i));
    }
    const reading_t reading = read_field(config, drive, field);
    fprintf(out, " SG_ ");
    write_name(message, i, field, drive, out);
    fprintf(out, "%s : %u|%u@%d%c (%s,%s) [%s|%s] \"%s\" ", only, start_bit(field), (unsigned)field->bits,
            is_big_endian(field) ? 0 : 1, field->is_signed ? '-' : '+', dbc_decimal(reading.factor, number[0]),
            dbc_decimal(reading.offset, number[1]),
            dbc_decimal(reading.low < reading.high ? reading.low : reading.high, number[2]),
            dbc_decimal(reading.low < reading.high ? reading.high : reading.low, number[3]), reading.unit);
    fprintf(out, group->sender != NULL ? "drive%u\n" : "heaved\n", drive + 1u);
}

static uint32_t mark_of(const config_t *config)
{
    return config->can_raw.id_bits == CONFIG_ID_29_BITS ? EXTENDED_BIT : 0;
}

static void write_message(const config_t *config, const message_t *message, FILE *out)
{
    const group_t *group = message->group;
    unsigned length = 0;
    for (unsigned i = 0; i < group->count; i++) {
        length = group->frame[i]->length > length ? group->frame[i]->length : length;
    }
    fprintf(out, "\nBO_ %lu drive%u_%s: %u ", (unsigned long)(message->id | mark_of(config)), message->drive + 1u, group->name,
            length);
    fprintf(out, group->sender != NULL ? "heaved\n" : "drive%u\n", message->drive + 1u);
    if (group->prefix > 0) {
        fprintf(out, " SG_ kind M : 0|%u@1+ (1,0) [0|%lu] \"\" Vector__XXX\n", 8u * group->prefix,
                (1ul << 8u * (group->prefix - 1u)) * 256ul - 1ul);
    }
    for (unsigned i = 0; i < group->count; i++) {
        for (unsigned f = 0; f < group->frame[i]->fields; f++) {
            write_signal(config, message, i, &group->frame[i]->field[f], out);
        }
    }
}

static void write_kinds(const config_t *config, const message_t *message, FILE *out)
{
    const group_t *group = message->group;
    if (group->prefix == 0) {
        return;
    }
    fprintf(out, "VAL_ %lu kind", (unsigned long)(message->id | mark_of(config)));
    for (unsigned i = 0; i < group->count; i++) {
        fprintf(out, " %lu \"%s\"", prefix_of(group, i), group->kind[i]);
    }
    fprintf(out, " ;\n");
}

/* Which numbers are floats. */
static void write_types(const config_t *config, const message_t *message, FILE *out)
{
    for (unsigned i = 0; i < message->group->count; i++) {
        for (unsigned f = 0; f < message->group->frame[i]->fields; f++) {
            const canraw_field_t *field = &message->group->frame[i]->field[f];
            const unsigned drive = drive_of(config, message, field);
            if (field->divisor != 0 && drive < DRIVES_MAX) {
                fprintf(out, "SIG_VALTYPE_ %lu ", (unsigned long)(message->id | mark_of(config)));
                write_name(message, i, field, drive, out);
                fprintf(out, " : 1;\n");
            }
        }
    }
}

/* A message of each identifier that the drives have. */
static unsigned list(const config_t *config, const group_t *group, uint32_t (*id_of)(const config_can_raw_t *raw, unsigned axis),
                     message_t *message)
{
    unsigned count = 0;
    for (unsigned k = 0; k < config_canraw_axes(config) && group->count > 0; k++) {
        const uint32_t id = id_of(&config->can_raw, k);
        bool is_new = true;
        for (unsigned i = 0; i < count; i++) {
            is_new = is_new && message[i].id != id;
        }
        if (is_new) {
            message[count++] = (message_t){.group = group, .id = id, .drive = k, .id_of = id_of};
        }
    }
    return count;
}

static uint32_t command_id_of(const config_can_raw_t *raw, unsigned axis)
{
    return config_canraw_id(&raw->command_id, axis);
}

void dbc_write(const config_t *config, FILE *out)
{
    const config_can_raw_t *raw = &config->can_raw;
    const group_t commands = commands_of(raw);
    const group_t setpoints = setpoints_of(raw);
    const group_t replies = replies_of(raw);
    const group_t statuses = statuses_of(raw);
    message_t message[MESSAGES_MAX];
    unsigned count = list(config, &commands, command_id_of, message);
    count += raw->setpoint_id.count > 0 ? list(config, &setpoints, config_canraw_setpoint_id, message + count) : 0;
    count += list(config, &replies, config_canraw_reply_id, message + count);
    count += raw->status_id.count > 0 ? list(config, &statuses, config_canraw_status_id, message + count) : 0;
    fprintf(out, "VERSION \"\"\n\nNS_ :\n\nBS_:\n\nBU_: heaved");
    for (unsigned drive = 0; drive < config_canraw_axes(config); drive++) {
        fprintf(out, " drive%u", drive + 1u);
    }
    fprintf(out, "\n");
    for (unsigned i = 0; i < count; i++) {
        write_message(config, &message[i], out);
    }
    fprintf(out, "\nCM_ \"Written by heaved --dump-dbc. Positions are extensions, 0 is fully in.\";\n\n");
    for (unsigned i = 0; i < count; i++) {
        write_kinds(config, &message[i], out);
    }
    for (unsigned i = 0; i < count; i++) {
        write_types(config, &message[i], out);
    }
}
