/* SPDX-License-Identifier: MIT
 * canraw_map.c - starts a raw CAN driver: a map that contradicts itself is refused before anything is sent.
 */
#include "heave/canraw.h"

#include "canraw_axis.h"

#define QUERY_EVERY_MAX  1000u
#define STATUS_EVERY_MAX 1000u

static bool is_measured(canraw_value_t value)
{
    return value == CANRAW_POSITION || value == CANRAW_SPEED || value == CANRAW_TORQUE;
}

static bool is_field_sound(const canraw_frame_t *frame, const canraw_field_t *field)
{
    const bool is_check = canraw_is_check(field->value);
    const bool is_width = is_check ? field->bits == 8u && field->skip == 0 : field->bits >= 1u && field->bits <= 32u;
    const bool is_float = field->divisor == 0 || (field->bits == 32u && field->is_signed && is_measured(field->value));
    return is_width && is_float && field->skip < 8u && field->divisor <= CANRAW_DIVISOR_MAX && field->value < CANRAW_VALUES &&
           field->slot <= (is_check || field->value == CANRAW_COUNTER ? 0 : DRIVES_MAX) &&
           field->at + canraw_field_span(field) <= frame->length;
}

/* Every bit is constant, or in one field at most. */
static bool is_frame_sound(const canraw_frame_t *frame)
{
    uint8_t used[CANRAW_BYTES_MAX] = {0};
    unsigned checks = 0;
    if (frame->length > CANRAW_BYTES_MAX || frame->fields > CANRAW_FIELDS_MAX || frame->constant >> frame->length != 0) {
        return false;
    }
    for (unsigned i = 0; i < frame->fields; i++) {
        if (!is_field_sound(frame, &frame->field[i]) || !canraw_field_cover(&frame->field[i], used)) {
            return false;
        }
        checks += canraw_is_check(frame->field[i].value) ? 1u : 0u;
    }
    return checks <= 1;
}

/* What is sent leaves no bit open. */
static bool is_complete(const canraw_frame_t *frame)
{
    uint8_t used[CANRAW_BYTES_MAX] = {0};
    for (unsigned i = 0; i < frame->fields; i++) {
        (void)canraw_field_cover(&frame->field[i], used);
    }
    for (unsigned at = 0; at < frame->length; at++) {
        if ((frame->constant >> at & 1u) == 0 && used[at] != 0xFFu) {
            return false;
        }
    }
    return true;
}

static bool is_command_sound(const canraw_frame_t *frame)
{
    for (unsigned i = 0; i < frame->fields && i < CANRAW_FIELDS_MAX; i++) {
        if (frame->field[i].value != CANRAW_COUNTER && !canraw_is_check(frame->field[i].value)) {
            return false;
        }
    }
    return is_frame_sound(frame) && is_complete(frame);
}

static bool are_steps_sound(const canraw_map_t *map)
{
    for (unsigned i = 0; i < CANRAW_STEPS_MAX; i++) {
        const canraw_step_t *step = &map->step[i];
        if (!is_command_sound(&step->frame) || !is_frame_sound(&step->answer)) {
            return false;
        }
        const bool is_confused = canraw_startup_is_mixed(step, &map->position_reply) ||
                                 canraw_startup_is_mixed(step, &map->homing_reply) ||
                                 canraw_startup_is_mixed(step, &map->status_reply);
        if (is_confused || (step->frame.length == 0 && step->answer.length != 0)) {
            return false;
        }
    }
    return true;
}

static bool are_frames_sound(const canraw_map_t *map)
{
    for (unsigned i = 0; i < CANRAW_COMMANDS; i++) {
        if (!is_command_sound(&map->command[i])) {
            return false;
        }
    }
    return is_frame_sound(&map->setpoint) && is_complete(&map->setpoint) && is_command_sound(&map->position_query) &&
           is_command_sound(&map->homing_query) && is_frame_sound(&map->position_reply) && is_frame_sound(&map->homing_reply) &&
           is_frame_sound(&map->status_reply);
}

/* Each judgement has the field it judges by. */
static bool are_judgements_sound(const canraw_map_t *map)
{
    const bool has_own = map->status_reply.length != 0;
    const bool has_status = canraw_find(has_own ? &map->status_reply : &map->position_reply, CANRAW_STATUS) != NULL;
    const bool has_homing_status = canraw_find(&map->homing_reply, CANRAW_STATUS) != NULL;
    const bool is_homing_judged = map->homing_query.length != 0 ? has_homing_status : has_status;
    const bool is_ambiguous = canraw_is_ambiguous(&map->position_reply, &map->homing_reply);
    if (((map->enabled_when.mask | map->fault_when.mask) != 0 || has_own) && !has_status) {
        return false;
    }
    if (map->command[CANRAW_HOME].length != 0 && (map->homing_done.mask == 0 || !is_homing_judged)) {
        return false;
    }
    return (map->homing_reply.length == 0 || has_homing_status) && (!is_ambiguous || map->position_query.length != 0);
}

static bool has_commands(const canraw_map_t *map)
{
    unsigned length = map->position_query.length + (unsigned)map->homing_query.length + map->step[0].frame.length;
    for (unsigned i = 0; i < CANRAW_COMMANDS; i++) {
        length += map->command[i].length;
    }
    return length != 0;
}

/* Two drives are told apart, by identifiers or slots. */
static bool is_apart(const canraw_map_t *map, const canraw_axis_map_t *axis, const canraw_axis_map_t *other)
{
    const bool is_setpoint = axis->setpoint_id != other->setpoint_id || (axis->setpoint_slot != 0 && other->setpoint_slot != 0 &&
                                                                         axis->setpoint_slot != other->setpoint_slot);
    const bool is_reply = axis->reply_id != other->reply_id ||
                          (axis->reply_slot != 0 && other->reply_slot != 0 && axis->reply_slot != other->reply_slot);
    const bool is_command = axis->command_id != other->command_id && axis->command_id != other->setpoint_id;
    const bool is_status = axis->status_id != other->status_id || axis->status_slot == 0 || /* it is that of all */
                           axis->status_slot != other->status_slot;
    return is_setpoint && is_reply && is_status && (is_command || !has_commands(map));
}

/* It has its fields: each number but the status, which may be that of all. */
static bool has_fields(const canraw_map_t *map, const canraw_axis_map_t *axis)
{
    return canraw_find_of(&map->setpoint, CANRAW_POSITION, axis->setpoint_slot) != NULL &&
           canraw_find_of(&map->position_reply, CANRAW_POSITION, axis->reply_slot) != NULL &&
           (map->status_reply.length == 0 || canraw_find_of(&map->status_reply, CANRAW_STATUS, axis->status_slot) != NULL) &&
           axis->setpoint_slot <= canraw_slots(&map->setpoint) && axis->reply_slot <= canraw_slots(&map->position_reply) &&
           axis->status_slot <= canraw_slots(&map->status_reply);
}

/* What is received there is told from all that is sent. */
static bool is_heard_apart(const canraw_map_t *map, const canraw_axis_map_t *axis, const canraw_axis_map_t *other)
{
    const bool is_status = map->status_reply.length != 0;
    const bool is_mixed = canraw_is_ambiguous(&map->status_reply, &map->position_reply) ||
                          canraw_is_ambiguous(&map->status_reply, &map->homing_reply);
    return axis->command_id != other->reply_id && axis->setpoint_id != other->reply_id &&
           (!is_status || (axis->command_id != other->status_id && axis->setpoint_id != other->status_id &&
                           (axis->status_id != other->reply_id || !is_mixed)));
}

static bool is_axis_sound(const canraw_map_t *map, unsigned k)
{
    const uint32_t id_max = map->is_extended ? CAN_ID_EXTENDED_MAX : CAN_ID_MAX;
    const canraw_axis_map_t *axis = &map->axis[k];
    for (unsigned i = 0; i < map->axes; i++) {
        const canraw_axis_map_t *other = &map->axis[i];
        if (!is_heard_apart(map, axis, other) || (i != k && !is_apart(map, axis, other))) {
            return false;
        }
    }
    return axis->command_id <= id_max && axis->setpoint_id <= id_max && axis->reply_id <= id_max && axis->status_id <= id_max &&
           has_fields(map, axis) && counts_is_valid(&axis->scale) && axis->speed.den > 0 && axis->step_max_q32 > 0 &&
           axis->following_max_q32 >= 0;
}

static bool is_sound(const canraw_map_t *map)
{
    if (map->axes < 1 || map->axes > DRIVES_MAX || map->period_us == 0 || map->query_every < 1 ||
        map->query_every > QUERY_EVERY_MAX || map->offline_periods <= 2 * map->query_every) {
        return false;
    }
    if (map->status_reply.length != 0 && (map->status_every < 1 || map->status_every > STATUS_EVERY_MAX)) {
        return false;
    }
    if (!are_frames_sound(map) || !are_steps_sound(map)) { /* first: the fields of a frame are counted by what follows */
        return false;
    }
    for (unsigned k = 0; k < map->axes; k++) {
        if (!is_axis_sound(map, k)) {
            return false;
        }
    }
    return are_judgements_sound(map);
}

hv_status_t canraw_init(canraw_t *self, const canraw_map_t *map, hal_can_t can)
{
    if (!hal_can_valid(can)) {
        return HV_ERR_ARG;
    }
    if (!is_sound(map)) {
        return HV_ERR_RANGE;
    }
    *self = (canraw_t){.map = map, .can = can};
    for (unsigned k = 0; k < map->axes; k++) {
        self->axis[k].pending = CANRAW_NOTHING;
        canraw_axis_lose(&self->axis[k], map, 0);
    }
    return HV_OK;
}

/* Adds an identifier that is not there yet. */
static uint32_t add_filter(const canraw_map_t *map, hal_can_filter_t *filter, uint32_t count, uint32_t id)
{
    for (uint32_t i = 0; i < count; i++) {
        if (filter[i].id == id) {
            return count;
        }
    }
    filter[count] = (hal_can_filter_t){
        .id = id, .mask = map->is_extended ? CAN_ID_EXTENDED_MAX : CAN_ID_MAX, .is_extended = map->is_extended};
    return count + 1u;
}

uint32_t canraw_filters(const canraw_map_t *map, hal_can_filter_t filter[CANRAW_FILTERS_MAX])
{
    uint32_t count = 0;
    for (unsigned k = 0; k < map->axes; k++) {
        count = add_filter(map, filter, count, map->axis[k].reply_id);
        count = map->status_reply.length != 0 ? add_filter(map, filter, count, map->axis[k].status_id) : count;
        count = add_filter(map, filter, count, map->axis[k].command_id); /* another master's: ours are never received */
        count = add_filter(map, filter, count, map->axis[k].setpoint_id);
    }
    return count;
}

uint32_t canraw_owns(const canraw_map_t *map, hal_can_filter_t own[CANRAW_OWNS_MAX])
{
    uint32_t count = 0;
    for (unsigned k = 0; k < map->axes; k++) {
        count = add_filter(map, own, count, map->axis[k].command_id);
        count = add_filter(map, own, count, map->axis[k].setpoint_id);
    }
    return count;
}
