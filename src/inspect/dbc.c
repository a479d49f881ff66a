/* SPDX-License-Identifier: MIT
 * dbc.c - the frames of [can-raw] as a DBC file; see dbc.h.
 */
#include "inspect/dbc.h"

#include <stdlib.h>
#include <string.h>

#include "config/canraw.h"

#define FRAMES_MAX   8u
#define PREFIX_MAX   4u
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
    return (frame->constant & wanted) == wanted;
}

/* Whether so many bytes at the beginning tell all frames apart. */
static bool is_telling(const group_t *self, unsigned bytes)
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
        self->prefix = is_telling(self, bytes) ? bytes : 0;
    }
    self->count = self->prefix == 0 ? 1 : self->count;
}

static group_t commands_of(const config_can_raw_t *raw)
{
    group_t group = {.name = "command", .sender = "heaved"};
    add(&group, "setpoint", &raw->setpoint);
    add(&group, "enable", &raw->enable);
    add(&group, "disable", &raw->disable);
    add(&group, "stop", &raw->stop);
    add(&group, "reset", &raw->reset);
    add(&group, "home", &raw->home);
    add(&group, "position_query", &raw->position_query);
    add(&group, "homing_query", &raw->homing_query);
    find_prefix(&group);
    return group;
}

static group_t replies_of(const config_can_raw_t *raw)
{
    group_t group = {.name = "reply"};
    add(&group, "position_reply", &raw->position_reply);
    add(&group, "homing_reply", &raw->homing_reply);
    find_prefix(&group);
    return group;
}

static unsigned cylinders_of(const config_t *config)
{
    return config->settings.geometry.kind == KIN_HEXAPOD ? 6u : 3u;
}

static reading_t read_position(const config_t *config, unsigned drive)
{
    const counts_scale_t scale = config_canraw_scale(config, drive);
    const bool is_angle = drive >= cylinders_of(config);
    const axis_settings_t *angle = &config->settings.axis[AXIS_ANGLE];
    const double factor = (double)scale.den / scale.num;
    return (reading_t){.factor = factor,
                       .offset = scale.zero == 0 ? 0.0 : -scale.zero * factor,
                       .low = is_angle ? (double)angle->min_q16 / Q16_ONE : 0.0,
                       .high = (double)(is_angle ? angle->max_q16 : config->settings.stroke_mm_q16[drive]) / Q16_ONE,
                       .unit = is_angle ? "deg" : "mm"};
}

static reading_t read_plain(const canraw_field_t *field)
{
    return (reading_t){1.0, 0.0, (double)canraw_field_min(field), (double)canraw_field_max(field), ""};
}

static reading_t read_field(const config_t *config, unsigned drive, const canraw_field_t *field)
{
    const bool is_angle = drive >= cylinders_of(config);
    const config_ratios_t *speeds =
        is_angle ? &config->can_raw.angle_speed_counts_per_deg_s : &config->can_raw.speed_counts_per_mm_s;
    const unsigned at = speeds->count == 1 ? 0 : drive;
    reading_t reading = read_plain(field);
    if (field->value == CANRAW_POSITION) {
        return read_position(config, drive);
    }
    if (field->value == CANRAW_SPEED && speeds->count > 0) {
        reading.factor = (double)speeds->den[at] / speeds->num[at];
        reading.low *= reading.factor;
        reading.high *= reading.factor;
        reading.unit = is_angle ? "deg/s" : "mm/s";
    }
    return reading;
}

/* The shortest decimal that is this number. */
static const char *decimal(double value, char text[32])
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

/* DBC counts a big-endian field from its highest bit. */
static unsigned start_bit(const canraw_field_t *field)
{
    return 8u * field->at + (field->is_big_endian && field->bytes > 1 ? 7u : 0u);
}

static void write_signal(const config_t *config, unsigned drive, const group_t *group, unsigned i, const canraw_field_t *field,
                         FILE *out)
{
    static const char *const k_names[CANRAW_VALUES] = {"position", "speed",    "status",   "counter", "fault",
                                                       "checksum", "checksum", "checksum", "checksum"};
    const reading_t reading = read_field(config, drive, field);
    const bool is_big_endian = field->is_big_endian && field->bytes > 1;
    const bool is_homing = strcmp(group->kind[i], "homing_reply") == 0;
    char number[4][32];
    char only[32] = "";
    if (group->prefix > 0) {
        (void)snprintf(only, sizeof only, " m%lu", prefix_of(group, i));
    }
    fprintf(out, " SG_ %s%s%s : %u|%u@%d%c (%s,%s) [%s|%s] \"%s\" ", is_homing ? "homing_" : "", k_names[field->value], only,
            start_bit(field), 8u * field->bytes, is_big_endian ? 0 : 1, field->is_signed ? '-' : '+',
            decimal(reading.factor, number[0]), decimal(reading.offset, number[1]),
            decimal(reading.low < reading.high ? reading.low : reading.high, number[2]),
            decimal(reading.low < reading.high ? reading.high : reading.low, number[3]), reading.unit);
    fprintf(out, group->sender != NULL ? "drive%u\n" : "heaved\n", drive + 1u);
}

static void write_message(const config_t *config, unsigned drive, const group_t *group, uint32_t id, FILE *out)
{
    unsigned length = 0;
    for (unsigned i = 0; i < group->count; i++) {
        length = group->frame[i]->length > length ? group->frame[i]->length : length;
    }
    fprintf(out, "\nBO_ %lu drive%u_%s: %u ", (unsigned long)id, drive + 1u, group->name, length);
    fprintf(out, group->sender != NULL ? "heaved\n" : "drive%u\n", drive + 1u);
    if (group->prefix > 0) {
        fprintf(out, " SG_ kind M : 0|%u@1+ (1,0) [0|%lu] \"\" Vector__XXX\n", 8u * group->prefix,
                (1ul << 8u * (group->prefix - 1u)) * 256ul - 1ul);
    }
    for (unsigned i = 0; i < group->count; i++) {
        for (unsigned f = 0; f < group->frame[i]->fields; f++) {
            write_signal(config, drive, group, i, &group->frame[i]->field[f], out);
        }
    }
}

static void write_kinds(const group_t *group, uint32_t id, FILE *out)
{
    if (group->prefix == 0) {
        return;
    }
    fprintf(out, "VAL_ %lu kind", (unsigned long)id);
    for (unsigned i = 0; i < group->count; i++) {
        fprintf(out, " %lu \"%s\"", prefix_of(group, i), group->kind[i]);
    }
    fprintf(out, " ;\n");
}

void dbc_write(const config_t *config, FILE *out)
{
    const config_can_raw_t *raw = &config->can_raw;
    const uint32_t mark = raw->id_bits == CONFIG_ID_29_BITS ? EXTENDED_BIT : 0;
    const unsigned drives = config_canraw_axes(config);
    const group_t commands = commands_of(raw);
    const group_t replies = replies_of(raw);
    fprintf(out, "VERSION \"\"\n\nNS_ :\n\nBS_:\n\nBU_: heaved");
    for (unsigned drive = 0; drive < drives; drive++) {
        fprintf(out, " drive%u", drive + 1u);
    }
    fprintf(out, "\n");
    for (unsigned drive = 0; drive < drives; drive++) {
        write_message(config, drive, &commands, config_canraw_id(&raw->command_id, drive) | mark, out);
        write_message(config, drive, &replies, config_canraw_id(&raw->reply_id, drive) | mark, out);
    }
    fprintf(out, "\nCM_ \"Written by heaved --dump-dbc. Positions are extensions, 0 is fully in.\";\n\n");
    for (unsigned drive = 0; drive < drives; drive++) {
        write_kinds(&commands, config_canraw_id(&raw->command_id, drive) | mark, out);
        write_kinds(&replies, config_canraw_id(&raw->reply_id, drive) | mark, out);
    }
}
