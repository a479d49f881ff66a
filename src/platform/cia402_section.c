/* SPDX-License-Identifier: MIT
 * cia402_section.c - the section [cia402] as the driver wants it; see cia402_section.h.
 */
#include "platform/cia402_section.h"

#include "platform/canraw_section.h" // config_canraw_axes, config_canraw_id
#include "platform/telemetry_section.h"

#define PP_PERIODS        8 /* from one set-point that a drive takes to the next, and its own lag */
#define LISTEN_HEARTBEATS 2
#define LISTEN_LEAST_MS   100
#define LISTEN_MOST_MS    1000
#define STEP_FACTOR       2 /* a set-point may be so much further than its speed limit allows before it counts as a jump */

static unsigned cylinders_of(const config_t *config)
{
    return config->settings.geometry.kind == KIN_HEXAPOD ? 6u : 3u;
}

static int32_t whole_of(const config_wholes_t *wholes, unsigned i)
{
    return wholes->value[wholes->count == 1 ? 0 : i];
}

counts_scale_t config_cia402_scale(const config_t *config, unsigned axis)
{
    const config_cia402_t *cia402 = &config->cia402;
    const bool is_angle = axis >= cylinders_of(config);
    const config_ratios_t *ratios = is_angle ? &cia402->angle_counts_per_deg : &cia402->counts_per_mm;
    const unsigned at = is_angle || ratios->count == 1 ? 0 : axis;
    return (counts_scale_t){.num = ratios->count == 0 ? 0 : ratios->num[at],
                            .den = ratios->count == 0 ? 1 : ratios->den[at],
                            .zero = is_angle ? cia402->angle_zero_counts.value[0] : whole_of(&cia402->zero_counts, axis)};
}

uint32_t config_cia402_node(const config_t *config, unsigned axis)
{
    return config_canraw_id(&config->cia402.nodes, axis) & CONFIG_NODE_MASK;
}

uint32_t config_cia402_channel(const config_t *config, unsigned axis)
{
    return config_canraw_id(&config->cia402.nodes, axis) >> CONFIG_CHANNEL_SHIFT;
}

/* A way, speed or acceleration in counts: never 0 where there is one, at the end of 32 bits where it does not fit. */
static uint32_t magnitude(const counts_scale_t *scale, q16_t units_q16)
{
    const counts_scale_t ratio = {scale->num, scale->den, 0};
    int64_t counts = 0;
    if (units_q16 == 0) {
        return 0;
    }
    if (counts_from_units(&ratio, q32_from_q16(units_q16), &counts) != HV_OK) {
        return UINT32_MAX;
    }
    return (uint32_t)fx_clamp(fx_abs(counts), 1, (int64_t)UINT32_MAX - 1); /* all ones: a window that is off */
}

/* A second line of defence in the drive, just outside of what heaved sends. Drives that run backwards have their least position
 * where the cylinder is out. */
static void describe_limits(const config_t *config, unsigned k, cia402_axis_config_t *axis)
{
    const q32_t beyond_q32 = q32_from_q16(config->cia402.software_limit_mm_q16);
    int64_t in = 0;
    int64_t out = 0;
    if (beyond_q32 == 0 || k >= cylinders_of(config) || counts_from_units(&axis->scale, -beyond_q32, &in) != HV_OK ||
        counts_from_units(&axis->scale, q32_from_q16(config->settings.stroke_mm_q16[k]) + beyond_q32, &out) != HV_OK) {
        return;
    }
    axis->has_limits = true;
    axis->limit_counts[0] = (int32_t)fx_clamp(in < out ? in : out, INT32_MIN, INT32_MAX);
    axis->limit_counts[1] = (int32_t)fx_clamp(in < out ? out : in, INT32_MIN, INT32_MAX);
}

cia402_mode_t config_cia402_mode(const config_t *config, unsigned axis)
{
    static const cia402_mode_t k_modes[] = {
        [CONFIG_MODE_CSP] = CIA402_MODE_CSP, [CONFIG_MODE_IP] = CIA402_MODE_IP, [CONFIG_MODE_PP] = CIA402_MODE_PP};
    const config_words_t *words = &config->cia402.mode;
    return k_modes[words->word[words->count == 1 ? 0 : axis]];
}

/* Its own list replaces lines of the family's. */
static bool has_object(const config_startup_t *list, const cia402_item_t *item)
{
    for (unsigned i = 0; list != NULL && i < list->count; i++) {
        if (list->item[i].index == item->index && list->item[i].sub == item->sub) {
            return true;
        }
    }
    return false;
}

static void add_list(cia402_axis_config_t *axis, const config_startup_t *list, const config_startup_t *own)
{
    for (unsigned i = 0; i < list->count; i++) {
        if (!has_object(own, &list->item[i])) {
            axis->item[axis->items++] = list->item[i];
        }
    }
}

static void describe_axis(const config_t *config, unsigned k, cia402_axis_config_t *axis)
{
    const config_cia402_t *cia402 = &config->cia402;
    const settings_t *settings = &config->settings;
    const bool is_angle = k >= cylinders_of(config);
    const config_homing_t *homing = is_angle ? &cia402->angle_homing : &cia402->homing;
    const counts_scale_t scale = config_cia402_scale(config, k);
    const q16_t speed_q16 = is_angle ? settings->axis[AXIS_ANGLE].speed_q16 : settings->cylinder_speed_mm_s_q16;
    const q16_t accel_q16 = is_angle ? settings->axis[AXIS_ANGLE].accel_q16 : settings->cylinder_accel_mm_s2_q16;
    const q16_t window_q16 = is_angle ? cia402->angle_following_error_deg_q16 : cia402->following_error_mm_q16;
    *axis = (cia402_axis_config_t){
        .node = (uint8_t)config_cia402_node(config, k),
        .channel = (uint8_t)config_cia402_channel(config, k),
        .mode = (uint8_t)config_cia402_mode(config, k),
        .scale = scale,
        .step_max_q32 = fx_mul_div(q32_from_q16(speed_q16), STEP_FACTOR * (int64_t)cia402->period_us, 1000000) + 1,
        .following_max_q32 = q32_from_q16(window_q16),
        .window_counts = magnitude(&scale, window_q16),
        .homing_method = (int8_t)whole_of(&homing->method, is_angle ? 0 : k),
        .homing_speed = {magnitude(&scale, homing->speed_q16), magnitude(&scale, homing->zero_speed_q16)},
        .homing_accel = magnitude(&scale, homing->accel_q16),
        .quick_stop_accel = magnitude(&scale, is_angle ? cia402->angle_quick_stop_deg_s2_q16 : cia402->quick_stop_mm_s2_q16),
        .profile_speed = magnitude(&scale, speed_q16),
        .profile_accel = magnitude(&scale, accel_q16),
        .identity = {cia402->vendor_id, cia402->product_code, cia402->revision_number,
                     cia402->serial_numbers.count == 0 ? 0 : cia402->serial_numbers.id[k]},
    };
    if (is_angle) {
        add_list(axis, &cia402->angle_startup, NULL);
    } else {
        add_list(axis, &cia402->startup, &cia402->drive_startup[k]);
        add_list(axis, &cia402->drive_startup[k], NULL);
    }
    describe_limits(config, k, axis);
}

q32_t config_cia402_pp_lag_q32(const config_t *config, q16_t speed_mm_s_q16)
{
    const q32_t speed_q32 = q32_from_q16(speed_mm_s_q16);
    const q16_t accel_q16 = config->settings.cylinder_accel_mm_s2_q16;
    const q32_t braking_q32 = fx_mul_div(speed_q32, speed_mm_s_q16, 2 * (int64_t)accel_q16);
    return fx_add_sat(braking_q32, fx_mul_div(speed_q32, PP_PERIODS * (int64_t)config->cia402.period_us, 1000000));
}

void config_cia402(const config_t *config, cia402_config_t *out)
{
    const config_cia402_t *cia402 = &config->cia402;
    *out = (cia402_config_t){
        .axes = config_canraw_axes(config),
        .master_node = cia402->gateway_node,
        .mode = config_cia402_mode(config, 0),
        .pdo_step = cia402->pdo_step,
        .are_maps_fixed = !cia402->is_map_written,
        .commands = cia402->command_map,
        .answers = cia402->answer_map,
        .period_us = cia402->period_us,
        .is_guarded = cia402->error_control == CONFIG_CONTROL_GUARDING,
        .heartbeat_ms = cia402->heartbeat_ms,
        .heartbeat_timeout_ms = cia402->heartbeat_timeout_ms,
        .sdo_timeout_ms = cia402->sdo_timeout_ms,
        .boot_timeout_ms = cia402->boot_timeout_ms,
        .power_timeout_ms = cia402->power_timeout_ms,
        .window_ms = cia402->following_error_ms,
        .listen_ms = (uint16_t)fx_clamp(LISTEN_HEARTBEATS * cia402->heartbeat_ms, LISTEN_LEAST_MS, LISTEN_MOST_MS),
        .passive_stop_ms = config->can.passive_stop_ms,
        .abort_option = (int16_t)((int)cia402->when_gateway_lost + 1),
        .sync_counter = cia402->sync_counter,
        .answer_every = cia402->answer_every,
        .csp_control_bits = (uint8_t)cia402->csp_control_bits,
        .telemetry = config_telemetry(config),
        .telemetry_every = cia402->telemetry_every,
        .is_sync_watched = cia402->is_sync_watched,
        .is_reset_wanted = cia402->is_reset_wanted,
        .accepted_without = cia402->is_no_watchdog_allowed ? CIA402_GUARDS_ALL : (uint8_t)cia402->accepted_without,
        .rpdo_deadline_ms = cia402->rpdo_deadline_ms,
        .is_support_checked = cia402->is_support_checked,
        .is_homing_in_turn = cia402->homing_order == CONFIG_HOMING_IN_TURN,
    };
    for (unsigned i = 0; i < CIA402_WATCHES; i++) {
        out->reaction[i] = (cia402_reaction_t)cia402->reaction[i];
    }
    for (unsigned k = 0; k < out->axes; k++) {
        describe_axis(config, k, &out->axis[k]);
    }
}
