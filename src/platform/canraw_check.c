/* SPDX-License-Identifier: MIT
 * canraw_check.c - what the keys of [can-raw] mean together: frames that lack their field, numbers that do not fit their
 * field at full stroke, identifiers used twice. Each error is reported at the key it concerns.
 */
#include "platform/canraw_section.h"

#include "common/translate.h"
#include "platform/drives_check.h"

#define SECTION "can-raw"
#define USED_BY "driver = can-raw"

static bool is_given(config_source_t *self, const char *name, unsigned size)
{
    return config_drives_is_given(self, SECTION, name, USED_BY, size);
}

static bool is_length(config_source_t *self, const char *name, unsigned count, unsigned wanted)
{
    return config_drives_is_length(self, SECTION, name, count, wanted);
}

/* --- Identifiers --- */

/* Identifiers of a key, and of how many drives its frame has fields; 0: of one, or of all alike. */
typedef struct {
    const char *name;
    const char *frame;
    const config_ids_t *ids;
    unsigned slots;
    unsigned most; /* drives with the same */
} list_t;

#define LISTS 4u

static uint32_t id_of(const list_t *list, unsigned axis)
{
    return config_canraw_shared_id(list->ids, axis, list->slots);
}

static bool is_id_in_range(config_source_t *self, const list_t *list, unsigned axes)
{
    const bool is_extended = self->config->can_raw.id_bits == CONFIG_ID_29_BITS;
    const uint32_t highest = is_extended ? CAN_ID_EXTENDED_MAX : CAN_ID_MAX;
    for (unsigned k = 0; k < axes; k++) {
        if (id_of(list, k) > highest) {
            config_source_key_error(self, SECTION, list->name, "0x%X of drive %u has more than %s bits; allowed: up to 0x%X%s",
                                    (unsigned)id_of(list, k), k + 1u, is_extended ? "29" : "11", (unsigned)highest,
                                    is_extended ? "" : _(", or id_bits = 29"));
            return false;
        }
    }
    return true;
}

/* How many drives up to this one have its identifier. */
static unsigned sharers_of(const list_t *list, unsigned axis)
{
    unsigned sharers = 0;
    for (unsigned i = 0; i <= axis; i++) {
        sharers += id_of(list, i) == id_of(list, axis) ? 1u : 0u;
    }
    return sharers;
}

/* Another key with the identifier of this drive. Returns false after an error. */
static bool is_in_no_other(config_source_t *self, const list_t *list, const list_t *others, unsigned axes, unsigned axis)
{
    for (const list_t *other = others; other < list; other++) {
        for (unsigned i = 0; i < axes && other->ids->count > 0; i++) {
            if (id_of(other, i) == id_of(list, axis)) {
                config_source_key_error(self, SECTION, list->name,
                                        "0x%X of drive %u is %s of drive %u already; allowed: a different one for each",
                                        (unsigned)id_of(list, axis), axis + 1u, other->name, i + 1u);
                return false;
            }
        }
    }
    return true;
}

static bool is_shared_by_few(config_source_t *self, const list_t *list, unsigned axis)
{
    const unsigned sharers = sharers_of(list, axis);
    unsigned first = 0;
    if (sharers <= list->most) {
        return true;
    }
    while (id_of(list, first) != id_of(list, axis)) {
        first++;
    }
    if (list->slots > 0) {
        config_source_key_error(self, SECTION, list->name,
                                "0x%X is that of %u drives, and %s has fields for %u; allowed: up to %u drives with the same",
                                (unsigned)id_of(list, axis), sharers, list->frame, list->slots, list->slots);
    } else {
        config_source_key_error(
            self, SECTION, list->name, "0x%X of drive %u is %s of drive %u already; allowed: a different one for each%s%s",
            (unsigned)id_of(list, axis), axis + 1u, list->name, first + 1u,
            list->frame != NULL ? _(", or fields such as {position.2:i16le} in ") : "", list->frame != NULL ? list->frame : "");
    }
    return false;
}

static void check_twice(config_source_t *self, const list_t lists[LISTS], unsigned axes)
{
    for (unsigned l = 0; l < LISTS; l++) {
        for (unsigned k = 0; k < axes && lists[l].ids->count > 0; k++) {
            if (!is_shared_by_few(self, &lists[l], k) || !is_in_no_other(self, &lists[l], lists, axes, k)) {
                return;
            }
        }
    }
}

static bool is_list(config_source_t *self, const list_t *list, bool is_needed, unsigned axes)
{
    if (list->ids->count == 0) {
        return !is_needed || is_given(self, list->name, 0);
    }
    return is_length(self, list->name, list->ids->count, axes) && is_id_in_range(self, list, axes);
}

static void check_ids(config_source_t *self, unsigned axes)
{
    const config_can_raw_t *raw = &self->config->can_raw;
    const unsigned slots = canraw_slots(&raw->setpoint);
    const unsigned replies = canraw_slots(&raw->position_reply);
    const unsigned statuses = canraw_slots(&raw->status_reply);
    const bool is_command_needed = raw->setpoint_id.count == 0 || config_canraw_has_commands(raw);
    const list_t lists[LISTS] = {{"command_id", NULL, &raw->command_id, 0, 1},
                                 {"setpoint_id", "setpoint", &raw->setpoint_id, slots, slots > 0 ? slots : 1u},
                                 {"reply_id", "position_reply", &raw->reply_id, replies, replies > 0 ? replies : 1u},
                                 {"status_id", "status_reply", &raw->status_id, statuses, statuses > 0 ? statuses : DRIVES_MAX}};
    const bool has_command = is_list(self, &lists[0], is_command_needed, axes);
    const bool has_setpoint = is_list(self, &lists[1], false, axes);
    const bool has_reply = is_list(self, &lists[2], true, axes) && is_list(self, &lists[3], false, axes);
    if (raw->status_id.count > 0 && raw->status_reply.length == 0) {
        config_source_key_error(self, SECTION, "status_id", "there is no status_reply; allowed: only with it");
    } else if (slots > 0 && raw->setpoint_id.count == 0) {
        config_source_key_error(self, SECTION, "setpoint_id",
                                "missing where setpoint has fields of several drives; allowed: the identifier of setpoint, which "
                                "drives share, such as 0x200");
    } else if (has_command && has_setpoint && has_reply) {
        check_twice(self, lists, axes);
    }
}

/* --- Numbers in their fields --- */

static config_drives_field_t field_of(const canraw_frame_t *frame, canraw_value_t value, const char *name)
{
    const canraw_field_t *field = canraw_find(frame, value);
    return field != NULL ? (config_drives_field_t){name, canraw_field_min(field), canraw_field_max(field)}
                         : (config_drives_field_t){NULL, 0, 0};
}

static void check_numbers(config_source_t *self, unsigned cylinders)
{
    const config_can_raw_t *raw = &self->config->can_raw;
    const config_drives_numbers_t numbers = {
        .section = SECTION,
        .used_by = USED_BY,
        .counts_per_mm = &raw->counts_per_mm,
        .angle_counts_per_deg = &raw->angle_counts_per_deg,
        .zero_counts = &raw->zero_counts,
        .scale = config_canraw_scale,
        .position = {field_of(&raw->setpoint, CANRAW_POSITION, "setpoint"),
                     field_of(&raw->position_reply, CANRAW_POSITION, "position_reply")},
        .speed = field_of(&raw->setpoint, CANRAW_SPEED, "setpoint"),
        .speed_eighths = 8,
        .speed_counts = raw->speed_counts,
        .speed_counts_per_mm_s = &raw->speed_counts_per_mm_s,
        .angle_speed_counts_per_deg_s = &raw->angle_speed_counts_per_deg_s,
    };
    config_drives_check_scales(self, &numbers, cylinders);
    config_drives_check_speed(self, &numbers, cylinders);
}

/* --- Frames --- */

static void check_has_field(config_source_t *self, const char *name, const canraw_frame_t *frame, canraw_value_t value,
                            const char *field)
{
    if (is_given(self, name, frame->length) && canraw_find(frame, value) == NULL) {
        config_source_key_error(self, SECTION, name, "has no {%s}; allowed: with one such as {%s:%s}", field, field,
                                value == CANRAW_STATUS ? "u8" : "u32le");
    }
}

static const char *const k_of_drive[] = {"position", "speed", "status"};

/* Fields of drives that share a frame: one for each, all alike. Returns false after an error. */
static bool is_for_each(config_source_t *self, const char *name, const canraw_frame_t *frame, canraw_value_t value)
{
    const char *field = k_of_drive[value];
    const canraw_field_t *first = canraw_find(frame, value);
    const unsigned slots = canraw_slots(frame);
    if (first == NULL || slots == 0 || (first->slot == 0 && value == CANRAW_STATUS)) {
        return true;
    }
    if (first->slot == 0) {
        config_source_key_error(self, SECTION, name,
                                "{%s} is of one drive, and others share the frame; allowed: {%s.1} to {%s.%u}", field, field,
                                field, slots);
        return false;
    }
    for (unsigned slot = 1; slot <= slots; slot++) {
        const canraw_field_t *own = canraw_find_of(frame, value, slot);
        if (own == NULL || own->bits != first->bits || own->is_signed != first->is_signed || own->divisor != first->divisor) {
            config_source_key_error(self, SECTION, name, "{%s.%u} %s; allowed: {%s.1} to {%s.%u}, of the same type", field, slot,
                                    own == NULL ? _("is missing") : _("is of another type"), field, field, slots);
            return false;
        }
    }
    return true;
}

/* A condition needs the field it judges, and fits into it. */
static void check_when(config_source_t *self, const char *name, canraw_when_t when, const canraw_frame_t *frame,
                       const char *frame_name)
{
    const canraw_field_t *field = canraw_find(frame, CANRAW_STATUS);
    if (when.mask == 0) {
        return;
    }
    if (field == NULL) {
        config_source_key_error(self, SECTION, name, "%s has no {status}; allowed: only where it has", frame_name);
    } else if (when.mask > (UINT32_MAX >> (32u - field->bits))) {
        config_source_key_error(self, SECTION, name, "the mask has bits that {status} of %s does not have; allowed: up to 0x%X",
                                frame_name, (unsigned)(UINT32_MAX >> (32u - field->bits)));
    }
}

static void check_homing(config_source_t *self)
{
    const config_can_raw_t *raw = &self->config->can_raw;
    const bool is_asked = raw->homing_query.length > 0;
    const char *reply_name = NULL;
    const canraw_frame_t *reply = config_canraw_status_frame(raw, &reply_name);
    reply = is_asked ? &raw->homing_reply : reply;
    reply_name = is_asked ? "homing_reply" : reply_name;
    if (is_asked) {
        check_has_field(self, "homing_reply", &raw->homing_reply, CANRAW_STATUS, "status");
    } else if (raw->homing_reply.length > 0) {
        config_source_key_error(self, SECTION, "homing_reply", "nobody asks for it; allowed: with homing_query only");
    }
    if (raw->home.length > 0 && raw->homing_done_when.mask == 0) {
        config_source_key_error(self, SECTION, "homing_done_when",
                                "missing where there is home; allowed: value/mask of {status} when homing is done");
    }
    if (!is_asked || canraw_find(reply, CANRAW_STATUS) != NULL) {
        check_when(self, "homing_done_when", raw->homing_done_when, reply, reply_name);
        check_when(self, "homing_failed_when", raw->homing_failed_when, reply, reply_name);
    }
    if (raw->position_query.length == 0 && is_asked && canraw_is_ambiguous(&raw->position_reply, &raw->homing_reply)) {
        config_source_key_error(self, SECTION, "homing_reply",
                                "cannot be told from position_reply, which comes unasked; allowed: with a byte that differs");
    }
}

/* Nothing would stop for it. */
static void check_fault(config_source_t *self, const char *name, const canraw_frame_t *frame)
{
    if (self->config->can_raw.fault_when.mask == 0 && canraw_find(frame, CANRAW_FAULT) != NULL) {
        config_source_key_error(self, SECTION, name,
                                "{fault} is shown only where fault_when holds, which is missing; allowed: with fault_when = "
                                "value/mask of {status} such as 0x08/0x08, or without {fault}");
    }
}

/* A status of its own frame. */
static void check_status(config_source_t *self)
{
    const config_can_raw_t *raw = &self->config->can_raw;
    const bool is_mixed = raw->status_id.count == 0 && (canraw_is_ambiguous(&raw->status_reply, &raw->position_reply) ||
                                                        canraw_is_ambiguous(&raw->status_reply, &raw->homing_reply));
    if (raw->status_reply.length == 0) {
        return;
    }
    if (canraw_find(&raw->status_reply, CANRAW_STATUS) == NULL) {
        config_source_key_error(self, SECTION, "status_reply", "has no {status}; allowed: with one such as {status:u8}");
    } else if (canraw_find(&raw->position_reply, CANRAW_STATUS) != NULL) {
        config_source_key_error(self, SECTION, "status_reply",
                                "position_reply has a {status} already; allowed: a {status} in one of them");
    } else if (is_mixed) {
        config_source_key_error(self, SECTION, "status_reply",
                                "cannot be told from position_reply or homing_reply; allowed: with a byte that differs, or with "
                                "status_id");
    } else if (raw->status_id.count == 0 && canraw_slots(&raw->status_reply) > 0 &&
               canraw_slots(&raw->status_reply) != canraw_slots(&raw->position_reply)) {
        config_source_key_error(
            self, SECTION, "status_reply",
            "is of %u drives, and position_reply with the same identifier of %u; allowed: of as many, or with "
            "status_id",
            canraw_slots(&raw->status_reply), canraw_slots(&raw->position_reply));
    } else {
        (void)is_for_each(self, "status_reply", &raw->status_reply, CANRAW_STATUS);
    }
}

/* Some bytes are both frames. Those of one length: a drive tells frames apart by their bytes or by that. */
static bool is_alike(const canraw_frame_t *step, const canraw_frame_t *command)
{
    return command->length == step->length && canraw_is_ambiguous(step, command);
}

static bool is_like_motion(const config_can_raw_t *raw, const canraw_frame_t *step)
{
    return is_alike(step, &raw->enable) || is_alike(step, &raw->home) ||
           (raw->setpoint_id.count == 0 && is_alike(step, &raw->setpoint));
}

/* One after the other, answers are told from what comes anyway, and none gives a drive torque. */
static void check_startup(config_source_t *self)
{
    const config_can_raw_t *raw = &self->config->can_raw;
    for (unsigned i = 0; i < CANRAW_STEPS_MAX; i++) {
        const canraw_step_t *step = &raw->startup[i];
        char name[] = "startup0";
        name[sizeof name - 2] = (char)('1' + i);
        if (step->frame.length > 0 && i > 0 && raw->startup[i - 1u].frame.length == 0) {
            config_source_key_error(self, SECTION, name, "there is no startup%u; allowed: one after the other from startup1", i);
            return;
        }
        if (canraw_startup_is_mixed(step, &raw->position_reply) || canraw_startup_is_mixed(step, &raw->homing_reply) ||
            canraw_startup_is_mixed(step, &raw->status_reply)) {
            config_source_key_error(
                self, SECTION, name,
                "its answer cannot be told from position_reply, homing_reply or status_reply; allowed: with a "
                "byte that differs, shorter, or without an answer");
            return;
        }
        if (step->frame.length > 0 && is_like_motion(raw, &step->frame)) {
            config_source_key_error(
                self, SECTION, name,
                "a drive could take it for enable, home or setpoint, and have torque or move before anybody has "
                "engaged; allowed: a frame with a byte that differs");
            return;
        }
        if (step->answer.length > 0 && canraw_slots(&raw->position_reply) > 0) {
            config_source_key_error(self, SECTION, name,
                                    "drives that share reply_id cannot be told apart by an answer; allowed: without an answer");
            return;
        }
    }
}

static void check_frames(config_source_t *self)
{
    const config_can_raw_t *raw = &self->config->can_raw;
    const char *status_name = NULL;
    const canraw_frame_t *status = config_canraw_status_frame(raw, &status_name);
    check_has_field(self, "setpoint", &raw->setpoint, CANRAW_POSITION, "position");
    check_has_field(self, "position_reply", &raw->position_reply, CANRAW_POSITION, "position");
    (void)(is_for_each(self, "setpoint", &raw->setpoint, CANRAW_POSITION) &&
           is_for_each(self, "setpoint", &raw->setpoint, CANRAW_SPEED));
    (void)(is_for_each(self, "position_reply", &raw->position_reply, CANRAW_POSITION) &&
           is_for_each(self, "position_reply", &raw->position_reply, CANRAW_STATUS));
    check_when(self, "enabled_when", raw->enabled_when, status, status_name);
    check_when(self, "fault_when", raw->fault_when, status, status_name);
    check_fault(self, "position_reply", &raw->position_reply);
    check_fault(self, "status_reply", &raw->status_reply);
    check_status(self);
    check_startup(self);
    check_homing(self);
}

/* --- Times --- */

static void check_times(config_source_t *self)
{
    const config_can_raw_t *raw = &self->config->can_raw;
    const settings_t *settings = &self->config->settings;
    if (raw->offline_periods <= 2u * raw->query_every) {
        config_source_key_error(self, SECTION, "offline_periods", "too few for query_every = %u; allowed: at least %u",
                                (unsigned)raw->query_every, 2u * (unsigned)raw->query_every + 1u);
    }
    /* at full speed, while the newest position is as old as it can be and the drive one period behind */
    const q32_t travel_q32 =
        fx_mul_div(q32_from_q16(settings->cylinder_speed_mm_s_q16), (int64_t)(raw->query_every + 2u) * raw->period_us, 1000000);
    const q32_t window_q32 = q32_from_q16(raw->following_error_mm_q16);
    if (window_q32 != 0 && window_q32 < travel_q32) {
        config_source_key_error(self, SECTION, "following_error_mm",
                                "less than a cylinder moves at full speed until its position is heard; allowed: at least %.3f mm",
                                (double)travel_q32 / (double)Q32_ONE + 0.0005);
    }
}

void config_canraw_check(config_source_t *self)
{
    if (self->config->drives != CONFIG_DRIVES_CAN_RAW || !config_source_has(self, "platform", "kind") ||
        !config_source_has_all(self, SECTION)) {
        return;
    }
    const unsigned cylinders = self->config->settings.geometry.kind == KIN_HEXAPOD ? 6u : 3u;
    check_ids(self, config_canraw_axes(self->config));
    check_frames(self);
    check_numbers(self, cylinders);
    check_times(self);
}
