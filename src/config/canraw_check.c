/* SPDX-License-Identifier: MIT
 * canraw_check.c - what the keys of [can-raw] mean together: frames that lack their field, numbers that do not fit their
 * field at full stroke, identifiers used twice. Each error is reported at the key it concerns.
 */
#include "config/canraw.h"
#include "config/drives_check.h"

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

static bool is_id_in_range(config_source_t *self, const char *name, const config_ids_t *ids, unsigned axes)
{
    const bool is_extended = self->config->can_raw.id_bits == CONFIG_ID_29_BITS;
    const uint32_t highest = is_extended ? CAN_ID_EXTENDED_MAX : CAN_ID_MAX;
    for (unsigned k = 0; k < axes; k++) {
        if (config_canraw_id(ids, k) > highest) {
            config_source_key_error(self, SECTION, name, "0x%X of drive %u has more than %s bits; allowed: up to 0x%X%s",
                                    (unsigned)config_canraw_id(ids, k), k + 1u, is_extended ? "29" : "11", (unsigned)highest,
                                    is_extended ? "" : ", or id_bits = 29");
            return false;
        }
    }
    return true;
}

static void check_twice(config_source_t *self, unsigned axes)
{
    const config_can_raw_t *raw = &self->config->can_raw;
    for (unsigned k = 0; k < 2u * axes; k++) {
        const char *name = k < axes ? "command_id" : "reply_id";
        const uint32_t id = config_canraw_id(k < axes ? &raw->command_id : &raw->reply_id, k % axes);
        for (unsigned i = 0; i < k; i++) {
            if (config_canraw_id(i < axes ? &raw->command_id : &raw->reply_id, i % axes) == id) {
                config_source_key_error(self, SECTION, name,
                                        "0x%X of drive %u is %s of drive %u already; allowed: a different one for each",
                                        (unsigned)id, k % axes + 1u, i < axes ? "command_id" : "reply_id", i % axes + 1u);
                return;
            }
        }
    }
}

static void check_ids(config_source_t *self, unsigned axes)
{
    const config_can_raw_t *raw = &self->config->can_raw;
    const bool has_command = is_given(self, "command_id", raw->command_id.count) &&
                             is_length(self, "command_id", raw->command_id.count, axes) &&
                             is_id_in_range(self, "command_id", &raw->command_id, axes);
    const bool has_reply = is_given(self, "reply_id", raw->reply_id.count) &&
                           is_length(self, "reply_id", raw->reply_id.count, axes) &&
                           is_id_in_range(self, "reply_id", &raw->reply_id, axes);
    if (has_command && has_reply) {
        check_twice(self, axes);
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
    } else if (field->bytes < 4 && when.mask >> 8u * field->bytes != 0) {
        config_source_key_error(self, SECTION, name, "the mask has bits that {status} of %s does not have; allowed: up to 0x%X",
                                frame_name, (1u << 8u * field->bytes) - 1u);
    }
}

static void check_homing(config_source_t *self)
{
    const config_can_raw_t *raw = &self->config->can_raw;
    const bool is_asked = raw->homing_query.length > 0;
    const canraw_frame_t *reply = is_asked ? &raw->homing_reply : &raw->position_reply;
    const char *reply_name = is_asked ? "homing_reply" : "position_reply";
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

static void check_frames(config_source_t *self)
{
    const config_can_raw_t *raw = &self->config->can_raw;
    check_has_field(self, "setpoint", &raw->setpoint, CANRAW_POSITION, "position");
    check_has_field(self, "position_reply", &raw->position_reply, CANRAW_POSITION, "position");
    check_when(self, "enabled_when", raw->enabled_when, &raw->position_reply, "position_reply");
    check_when(self, "fault_when", raw->fault_when, &raw->position_reply, "position_reply");
    if (raw->fault_when.mask == 0 && canraw_find(&raw->position_reply, CANRAW_FAULT) != NULL) { /* nothing would read it */
        config_source_key_error(self, SECTION, "position_reply",
                                "{fault} is shown only where fault_when holds, which is missing; allowed: with fault_when = "
                                "value/mask of {status} such as 0x08/0x08, or without {fault}");
    }
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
