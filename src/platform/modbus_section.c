/* SPDX-License-Identifier: MIT
 * modbus_section.c - the sections of Modbus drives as a map for the driver, and what their lines can carry; see modbus_section.h.
 */
#include "platform/modbus_section.h"

#include "common/columns.h"
#include "common/translate.h"

#include "platform/canraw_section.h"

#define STEP_FACTOR 2 /* a set-point may be so much further than its speed limit allows before it counts as a jump */

bool config_modbus_is_used(const config_t *config)
{
    return config->drives == CONFIG_DRIVES_MODBUS_TCP || config->drives == CONFIG_DRIVES_MODBUS_RTU;
}

static bool is_rtu(const config_t *config)
{
    return config->drives == CONFIG_DRIVES_MODBUS_RTU;
}

uint8_t config_modbus_lines(const config_t *config)
{
    return is_rtu(config) || config->modbus_tcp.hosts.count == 1 ? 1 : config_canraw_axes(config);
}

uint32_t config_modbus_unit(const config_t *config, unsigned axis)
{
    const config_ids_t *units = &config->modbus.units;
    const bool is_own_line = config_modbus_lines(config) > 1;
    return units->count == 1 ? units->id[0] + (is_own_line ? 0u : axis) : units->id[axis];
}

static bool is_angle(const config_t *config, unsigned axis)
{
    return axis >= (config->settings.geometry.kind == KIN_HEXAPOD ? 6u : 3u);
}

static counts_scale_t ratio_of(const config_ratios_t *ratios, unsigned i)
{
    const unsigned at = ratios->count == 1 ? 0 : i;
    return ratios->count == 0 ? (counts_scale_t){0, 1, 0} : (counts_scale_t){ratios->num[at], ratios->den[at], 0};
}

counts_scale_t config_modbus_scale(const config_t *config, unsigned axis)
{
    const config_modbus_t *modbus = &config->modbus;
    const bool is_motor = is_angle(config, axis);
    const config_wholes_t *zeros = is_motor ? &modbus->angle_zero_counts : &modbus->zero_counts;
    counts_scale_t scale = is_motor ? ratio_of(&modbus->angle_counts_per_deg, 0) : ratio_of(&modbus->counts_per_mm, axis);
    scale.zero = zeros->value[zeros->count == 1 ? 0 : axis];
    return scale;
}

modbus_drive_timing_t config_modbus_timing(const config_t *config)
{
    const config_modbus_rtu_t *rtu = &config->modbus_rtu;
    const unsigned parity = rtu->parity != CONFIG_PARITY_NONE ? 1u : 0u;
    return (modbus_drive_timing_t){.bitrate_bps = is_rtu(config) ? rtu->baud_bps : 0,
                                   .bits_per_char = (uint8_t)(9u + parity + rtu->stop_bits),
                                   .turnaround_us = config->modbus.turnaround_us};
}

static void describe_axis(const config_t *config, unsigned k, modbus_drive_axis_map_t *axis)
{
    const config_modbus_t *modbus = &config->modbus;
    const bool is_motor = is_angle(config, k);
    const q16_t speed_q16 = is_motor ? config->settings.axis[AXIS_ANGLE].speed_q16 : config->settings.cylinder_speed_mm_s_q16;
    *axis = (modbus_drive_axis_map_t){
        .line = (uint8_t)(config_modbus_lines(config) == 1 ? 0u : k),
        .unit = (uint8_t)config_modbus_unit(config, k),
        .scale = config_modbus_scale(config, k),
        .speed = is_motor ? ratio_of(&modbus->angle_speed_counts_per_deg_s, 0) : ratio_of(&modbus->speed_counts_per_mm_s, k),
        .step_max_q32 = fx_mul_div(q32_from_q16(speed_q16), STEP_FACTOR * (int64_t)config->settings.cycle_us, 1000000) + 1,
        .speed_max_q32 = q32_from_q16(speed_q16) * 9 / 8 + 1,
        .carry_q32 = q32_from_q16(is_motor ? modbus->angle_step_deg_q16 : modbus->step_mm_q16),
        .following_max_q32 = q32_from_q16(is_motor ? modbus->angle_following_error_deg_q16 : modbus->following_error_mm_q16),
    };
}

static void add_items(modbus_drive_map_t *map, const config_items_t *items)
{
    for (unsigned i = 0; i < items->count; i++) {
        map->item[map->items++] = items->item[i];
    }
}

void config_modbus_map(const config_t *config, modbus_drive_map_t *map)
{
    const config_modbus_t *modbus = &config->modbus;
    const modbus_drive_timing_t timing = config_modbus_timing(config);
    *map = (modbus_drive_map_t){
        .axes = config_canraw_axes(config),
        .is_input = modbus->read == CONFIG_READ_INPUT,
        .is_single = modbus->write == CONFIG_WRITE_SINGLE,
        .is_broadcast = modbus->is_broadcast,
        .is_target_last = modbus->is_target_last,
        .period_us = modbus->period_us,
        .feedback_timeout_us = modbus->feedback_timeout_ms * 1000u,
        .retries = modbus->retries,
        .speed_least = modbus->speed_counts,
        .setpoint = modbus->setpoint,
        .feedback = modbus->feedback,
        .command = {[MODBUS_DRIVE_STOP] = modbus->stop,
                    [MODBUS_DRIVE_DISABLE] = modbus->disable,
                    [MODBUS_DRIVE_RESET] = modbus->reset,
                    [MODBUS_DRIVE_ENABLE] = modbus->enable,
                    [MODBUS_DRIVE_HOME] = modbus->home},
        .enabled_when = modbus->enabled_when,
        .fault_when = modbus->fault_when,
        .homing_done = modbus->homing_done_when,
        .homing_failed = modbus->homing_failed_when,
    };
    add_items(map, &modbus->startup);
    add_items(map, &modbus->drive_timeout);
    map->expected_us = modbus_drive_round_us(map, &timing, map->axes / config_modbus_lines(config));
    for (unsigned k = 0; k < map->axes; k++) {
        describe_axis(config, k, &map->axis[k]);
    }
}

void config_modbus_report(const config_t *config, FILE *out)
{
    modbus_drive_map_t map;
    const double step_mm = (double)config->modbus.step_mm_q16 / (double)Q16_ONE;
    config_modbus_map(config, &map);
    const unsigned on_line = (unsigned)map.axes / config_modbus_lines(config);
    const double rate_hz = 1e6 / (double)map.expected_us;
    columns_put(out, _("set-points"), CONFIG_LABEL_COLUMNS);
    fprintf(out, _("%.1f Hz of each drive expected (%.1f ms: %u on a line, %u us turnaround"), rate_hz,
            (double)map.expected_us / 1000.0, on_line, (unsigned)config->modbus.turnaround_us);
    if (is_rtu(config)) {
        fprintf(out, _(", %u bit/s"), (unsigned)config->modbus_rtu.baud_bps);
    }
    fprintf(out, "%s\n", _(")"));
    if (config->modbus.step_mm_q16 != 0) {
        columns_put(out, _("the line carries"), CONFIG_LABEL_COLUMNS);
        fprintf(out, _("%.1f mm/s of a cylinder (step_mm %.3f)\n"), step_mm * rate_hz, step_mm);
    }
}
