/* SPDX-License-Identifier: MIT
 * canraw_section.c - the section [can-raw] as a map for the driver; see canraw_section.h.
 */
#include "platform/canraw_section.h"

#include <string.h>

#define LISTEN_LEAST_MS 100
#define LISTEN_MOST_MS  1000
#define STEP_FACTOR     2 /* a set-point may be so much further than its speed limit allows before it counts as a jump */

static unsigned cylinders_of(const config_t *config)
{
    return config->settings.geometry.kind == KIN_HEXAPOD ? 6u : 3u;
}

uint8_t config_canraw_axes(const config_t *config)
{
    return (uint8_t)(cylinders_of(config) + (config->settings.has_angle ? 1u : 0u));
}

uint32_t config_canraw_id(const config_ids_t *ids, unsigned axis)
{
    return ids->count == 1 ? ids->id[0] + axis : ids->id[axis];
}

uint32_t config_canraw_shared_id(const config_ids_t *ids, unsigned axis, unsigned slots)
{
    return slots > 0 && ids->count == 1 ? ids->id[0] + axis / slots : config_canraw_id(ids, axis);
}

uint32_t config_canraw_setpoint_id(const config_can_raw_t *raw, unsigned axis)
{
    return raw->setpoint_id.count == 0 ? config_canraw_id(&raw->command_id, axis)
                                       : config_canraw_shared_id(&raw->setpoint_id, axis, canraw_slots(&raw->setpoint));
}

uint32_t config_canraw_reply_id(const config_can_raw_t *raw, unsigned axis)
{
    return config_canraw_shared_id(&raw->reply_id, axis, canraw_slots(&raw->position_reply));
}

/* On the identifier of positions it has their slots. */
uint32_t config_canraw_status_id(const config_can_raw_t *raw, unsigned axis)
{
    return raw->status_id.count == 0 ? config_canraw_reply_id(raw, axis)
                                     : config_canraw_shared_id(&raw->status_id, axis, canraw_slots(&raw->status_reply));
}

const canraw_frame_t *config_canraw_status_frame(const config_can_raw_t *raw, const char **name)
{
    const bool has_own = raw->status_reply.length > 0;
    *name = has_own ? "status_reply" : "position_reply";
    return has_own ? &raw->status_reply : &raw->position_reply;
}

bool config_canraw_has_commands(const config_can_raw_t *raw)
{
    return raw->enable.length + raw->disable.length + raw->stop.length + raw->reset.length + raw->home.length +
               raw->position_query.length + raw->homing_query.length + raw->startup[0].frame.length >
           0;
}

/* The slot of a drive: how many share its identifier up to it; 0 where the frame has no slots. */
static uint8_t slot_of(const config_can_raw_t *raw, uint32_t (*id_of)(const config_can_raw_t *raw, unsigned axis),
                       const canraw_frame_t *frame, unsigned axis)
{
    uint8_t slot = 0;
    for (unsigned i = 0; i <= axis && canraw_slots(frame) > 0; i++) {
        slot = (uint8_t)(slot + (id_of(raw, i) == id_of(raw, axis) ? 1u : 0u));
    }
    return slot;
}

/* The ratio of a drive; no counts where there is none. */
static counts_scale_t ratio_of(const config_ratios_t *ratios, unsigned i)
{
    const unsigned at = ratios->count == 1 ? 0 : i;
    return ratios->count == 0 ? (counts_scale_t){0, 1, 0} : (counts_scale_t){ratios->num[at], ratios->den[at], 0};
}

counts_scale_t config_canraw_scale(const config_t *config, unsigned axis)
{
    const config_can_raw_t *raw = &config->can_raw;
    const bool is_angle = axis >= cylinders_of(config);
    const config_wholes_t *zeros = is_angle ? &raw->angle_zero_counts : &raw->zero_counts;
    counts_scale_t scale = is_angle ? ratio_of(&raw->angle_counts_per_deg, 0) : ratio_of(&raw->counts_per_mm, axis);
    scale.zero = zeros->value[zeros->count == 1 ? 0 : axis];
    return scale;
}

static void describe_axis(const config_t *config, unsigned k, canraw_axis_map_t *axis)
{
    const config_can_raw_t *raw = &config->can_raw;
    const bool is_angle = k >= cylinders_of(config);
    const q16_t speed_q16 = is_angle ? config->settings.axis[AXIS_ANGLE].speed_q16 : config->settings.cylinder_speed_mm_s_q16;
    *axis = (canraw_axis_map_t){
        .command_id = raw->command_id.count > 0 ? config_canraw_id(&raw->command_id, k) : config_canraw_setpoint_id(raw, k),
        .setpoint_id = config_canraw_setpoint_id(raw, k),
        .reply_id = config_canraw_reply_id(raw, k),
        .setpoint_slot = slot_of(raw, config_canraw_setpoint_id, &raw->setpoint, k),
        .status_id = config_canraw_status_id(raw, k),
        .reply_slot = slot_of(raw, config_canraw_reply_id, &raw->position_reply, k),
        .status_slot = slot_of(raw, config_canraw_status_id, &raw->status_reply, k),
        .scale = config_canraw_scale(config, k),
        .speed = is_angle ? ratio_of(&raw->angle_speed_counts_per_deg_s, 0) : ratio_of(&raw->speed_counts_per_mm_s, k),
        .step_max_q32 = fx_mul_div(q32_from_q16(speed_q16), STEP_FACTOR * (int64_t)raw->period_us, 1000000) + 1,
        .following_max_q32 = q32_from_q16(is_angle ? raw->angle_following_error_deg_q16 : raw->following_error_mm_q16),
    };
}

void config_canraw_map(const config_t *config, canraw_map_t *map)
{
    const config_can_raw_t *raw = &config->can_raw;
    *map = (canraw_map_t){
        .axes = config_canraw_axes(config),
        .is_extended = raw->id_bits == CONFIG_ID_29_BITS,
        .is_on_change = raw->send == CONFIG_SEND_ON_CHANGE,
        .period_us = raw->period_us,
        .query_every = raw->query_every,
        .offline_periods = raw->offline_periods,
        .other_master = (canraw_master_t)raw->other_master,
        .listen_ms = (uint32_t)fx_clamp(raw->offline_periods * (int64_t)raw->period_us / 1000, LISTEN_LEAST_MS, LISTEN_MOST_MS),
        .passive_stop_ms = config->can.passive_stop_ms,
        .rated_torque = raw->rated_torque,
        .speed_least = raw->speed_counts,
        .setpoint = raw->setpoint,
        .command = {[CANRAW_STOP] = raw->stop,
                    [CANRAW_DISABLE] = raw->disable,
                    [CANRAW_RESET] = raw->reset,
                    [CANRAW_ENABLE] = raw->enable,
                    [CANRAW_HOME] = raw->home},
        .position_query = raw->position_query,
        .position_reply = raw->position_reply,
        .homing_query = raw->homing_query,
        .homing_reply = raw->homing_reply,
        .status_reply = raw->status_reply,
        .status_every = raw->status_every,
        .enabled_when = raw->enabled_when,
        .fault_when = raw->fault_when,
        .homing_done = raw->homing_done_when,
        .homing_failed = raw->homing_failed_when,
    };
    memcpy(map->step, raw->startup, sizeof map->step);
    for (unsigned k = 0; k < map->axes; k++) {
        describe_axis(config, k, &map->axis[k]);
    }
}
