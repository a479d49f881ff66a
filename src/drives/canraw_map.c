/* SPDX-License-Identifier: MIT
 * canraw_map.c - starts a raw CAN driver: a map that contradicts itself is refused before anything is sent.
 */
#include "heave/canraw.h"

#include "canraw_axis.h"

#define QUERY_EVERY_MAX 1000u

/* Every byte is constant, or in one field at most. */
static bool is_frame_sound(const canraw_frame_t *frame)
{
    unsigned used = frame->constant;
    unsigned checks = 0;
    if (frame->length > CANRAW_BYTES_MAX || frame->fields > CANRAW_FIELDS_MAX || frame->constant >> frame->length != 0) {
        return false;
    }
    for (unsigned i = 0; i < frame->fields; i++) {
        const canraw_field_t *field = &frame->field[i];
        const bool is_check = canraw_is_check(field->value);
        const bool is_width = field->bytes >= 1 && field->bytes <= (is_check ? 1u : 4u);
        checks += is_check;
        if (!is_width || field->value >= CANRAW_VALUES || field->at + field->bytes > frame->length) {
            return false;
        }
        const unsigned bytes = ((1u << field->bytes) - 1u) << field->at;
        if ((used & bytes) != 0) {
            return false;
        }
        used |= bytes;
    }
    return checks <= 1;
}

/* What is sent leaves no byte open. */
static bool is_complete(const canraw_frame_t *frame)
{
    unsigned used = frame->constant;
    for (unsigned i = 0; i < frame->fields; i++) {
        used |= ((1u << frame->field[i].bytes) - 1u) << frame->field[i].at;
    }
    return used == (1u << frame->length) - 1u;
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

static bool are_frames_sound(const canraw_map_t *map)
{
    for (unsigned i = 0; i < CANRAW_COMMANDS; i++) {
        if (!is_command_sound(&map->command[i])) {
            return false;
        }
    }
    return is_frame_sound(&map->setpoint) && is_complete(&map->setpoint) && is_command_sound(&map->position_query) &&
           is_command_sound(&map->homing_query) && is_frame_sound(&map->position_reply) && is_frame_sound(&map->homing_reply);
}

/* Each judgement has the field it judges by. */
static bool are_judgements_sound(const canraw_map_t *map)
{
    const bool has_status = canraw_find(&map->position_reply, CANRAW_STATUS) != NULL;
    const bool has_homing_status = canraw_find(&map->homing_reply, CANRAW_STATUS) != NULL;
    const bool is_homing_judged = map->homing_query.length != 0 ? has_homing_status : has_status;
    const bool is_ambiguous = canraw_is_ambiguous(&map->position_reply, &map->homing_reply);
    if (canraw_find(&map->setpoint, CANRAW_POSITION) == NULL || canraw_find(&map->position_reply, CANRAW_POSITION) == NULL) {
        return false;
    }
    if ((map->enabled_when.mask | map->fault_when.mask) != 0 && !has_status) {
        return false;
    }
    if (map->command[CANRAW_HOME].length != 0 && (map->homing_done.mask == 0 || !is_homing_judged)) {
        return false;
    }
    return (map->homing_reply.length == 0 || has_homing_status) && (!is_ambiguous || map->position_query.length != 0);
}

static bool is_axis_sound(const canraw_map_t *map, unsigned k)
{
    const uint32_t id_max = map->is_extended ? CAN_ID_EXTENDED_MAX : CAN_ID_MAX;
    const canraw_axis_map_t *axis = &map->axis[k];
    for (unsigned i = 0; i < map->axes; i++) {
        const canraw_axis_map_t *other = &map->axis[i];
        if (axis->command_id == other->reply_id ||
            (i != k && (axis->command_id == other->command_id || axis->reply_id == other->reply_id))) {
            return false;
        }
    }
    return axis->command_id <= id_max && axis->reply_id <= id_max && counts_is_valid(&axis->scale) && axis->speed.den > 0 &&
           axis->step_max_q32 > 0 && axis->following_max_q32 >= 0;
}

static bool is_sound(const canraw_map_t *map)
{
    if (map->axes < 1 || map->axes > DRIVES_MAX || map->period_us == 0 || map->query_every < 1 ||
        map->query_every > QUERY_EVERY_MAX || map->offline_periods <= 2 * map->query_every) {
        return false;
    }
    for (unsigned k = 0; k < map->axes; k++) {
        if (!is_axis_sound(map, k)) {
            return false;
        }
    }
    return are_frames_sound(map) && are_judgements_sound(map);
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
        canraw_axis_lose(&self->axis[k], map);
    }
    return HV_OK;
}

uint32_t canraw_filters(const canraw_map_t *map, hal_can_filter_t filter[DRIVES_MAX])
{
    for (unsigned k = 0; k < map->axes; k++) {
        filter[k] = (hal_can_filter_t){.id = map->axis[k].reply_id,
                                       .mask = map->is_extended ? CAN_ID_EXTENDED_MAX : CAN_ID_MAX,
                                       .is_extended = map->is_extended};
    }
    return map->axes;
}
