/* SPDX-License-Identifier: MIT
 * modbus_check.c - what the keys of the Modbus sections mean together: blocks that lack their field, registers that are
 * written twice, numbers that do not fit at full stroke, units used twice, times and speeds the line cannot keep. Each error is
 * reported at the key it concerns.
 */
#include <string.h>

#include "platform/canraw_section.h"

#include "common/translate.h"
#include "platform/drives_check.h"
#include "platform/modbus_section.h"

#define SECTION     "modbus"
#define USED_BY     "drives on Modbus"
#define LAG_PERIODS 3 /* turn of the set-point, its mean, the age of the feedback */

static const config_modbus_t *modbus_of(const config_source_t *self)
{
    return &self->config->modbus;
}

static bool is_given(config_source_t *self, const char *section, const char *name, unsigned size)
{
    return config_drives_is_given(self, section, name, USED_BY, size);
}

/* --- Lines and units --- */

static bool is_unit(config_source_t *self, unsigned k)
{
    const uint32_t unit = config_modbus_unit(self->config, k);
    const bool is_tcp = self->config->drives == CONFIG_DRIVES_MODBUS_TCP;
    if ((unit >= 1 && unit <= 247) || (is_tcp && unit == 255)) {
        return true;
    }
    config_source_key_error(self, SECTION, "units", "%u of drive %u is no unit id; allowed: 1 to 247%s", (unsigned)unit, k + 1u,
                            is_tcp ? ", or 255" : "");
    return false;
}

static bool is_unit_free(config_source_t *self, unsigned k)
{
    for (unsigned i = 0; i < k && config_modbus_lines(self->config) == 1; i++) {
        if (config_modbus_unit(self->config, i) == config_modbus_unit(self->config, k)) {
            config_source_key_error(self, SECTION, "units",
                                    "%u is of drive %u and of drive %u, on one line; allowed: different ones",
                                    (unsigned)config_modbus_unit(self->config, k), i + 1u, k + 1u);
            return false;
        }
    }
    return true;
}

static bool is_host_free(config_source_t *self, unsigned k)
{
    const config_hosts_t *hosts = &self->config->modbus_tcp.hosts;
    for (unsigned i = 0; i < k; i++) {
        if (strcmp(hosts->host[i].address, hosts->host[k].address) == 0 && hosts->host[i].port == hosts->host[k].port) {
            config_source_key_error(self, "modbus-tcp", "hosts",
                                    "%s is of drive %u and of drive %u; allowed: different ones, or one for all with units",
                                    hosts->host[k].address, i + 1u, k + 1u);
            return false;
        }
    }
    return true;
}

static void check_lines(config_source_t *self, unsigned axes)
{
    const config_hosts_t *hosts = &self->config->modbus_tcp.hosts;
    const bool is_tcp = self->config->drives == CONFIG_DRIVES_MODBUS_TCP;
    bool is_right = !is_tcp || (is_given(self, "modbus-tcp", "hosts", hosts->count) &&
                                config_drives_is_length(self, "modbus-tcp", "hosts", hosts->count, axes));
    for (unsigned k = 0; is_right && is_tcp && k < hosts->count; k++) {
        is_right = is_host_free(self, k);
    }
    is_right = is_right && is_given(self, SECTION, "units", modbus_of(self)->units.count) &&
               config_drives_is_length(self, SECTION, "units", modbus_of(self)->units.count, axes);
    for (unsigned k = 0; is_right && k < axes; k++) {
        is_right = is_unit(self, k) && is_unit_free(self, k);
    }
    if (is_right && modbus_of(self)->is_broadcast && config_modbus_lines(self->config) > 1) {
        config_source_key_error(self, SECTION, "broadcast", "every drive has a line of its own; allowed: no");
    }
}

/* --- Numbers in their fields --- */

static config_drives_field_t field_of(const modbus_drive_blocks_t *blocks, modbus_drive_value_t value, const char *name)
{
    const modbus_drive_field_t *field = modbus_drive_find(blocks, value, NULL);
    return field != NULL ? (config_drives_field_t){name, modbus_drive_field_min(field), modbus_drive_field_max(field)}
                         : (config_drives_field_t){NULL, 0, 0};
}

static void check_numbers(config_source_t *self, unsigned cylinders)
{
    const config_modbus_t *modbus = modbus_of(self);
    const config_drives_numbers_t numbers = {
        .section = SECTION,
        .used_by = USED_BY,
        .counts_per_mm = &modbus->counts_per_mm,
        .angle_counts_per_deg = &modbus->angle_counts_per_deg,
        .zero_counts = &modbus->zero_counts,
        .scale = config_modbus_scale,
        .position = {field_of(&modbus->setpoint, MODBUS_DRIVE_POSITION, "setpoint"),
                     field_of(&modbus->feedback, MODBUS_DRIVE_POSITION, "feedback")},
        .speed = field_of(&modbus->setpoint, MODBUS_DRIVE_SPEED, "setpoint"),
        .speed_eighths = 9, /* what the driver asks for at most */
        .speed_counts = modbus->speed_counts,
        .speed_counts_per_mm_s = &modbus->speed_counts_per_mm_s,
        .angle_speed_counts_per_deg_s = &modbus->angle_speed_counts_per_deg_s,
    };
    config_drives_check_scales(self, &numbers, cylinders);
    config_drives_check_speed(self, &numbers, cylinders);
}

/* --- Registers --- */

static void check_has_position(config_source_t *self, const char *name, const modbus_drive_blocks_t *blocks)
{
    if (is_given(self, SECTION, name, blocks->count) && modbus_drive_find(blocks, MODBUS_DRIVE_POSITION, NULL) == NULL) {
        config_source_key_error(self, SECTION, name, "has no {position}; allowed: with one such as {position:i32hl}");
    }
}

/* A condition needs the field it judges, and fits into it. */
static void check_when(config_source_t *self, const char *name, canraw_when_t when)
{
    const modbus_drive_field_t *field = modbus_drive_find(&modbus_of(self)->feedback, MODBUS_DRIVE_STATUS, NULL);
    if (when.mask == 0) {
        return;
    }
    if (field == NULL) {
        config_source_key_error(self, SECTION, name, "feedback has no {status}; allowed: only where it has");
    } else if (field->registers == 1 && when.mask > 0xFFFFu) {
        config_source_key_error(self, SECTION, name, "the mask has bits that {status} does not have; allowed: up to 0xFFFF");
    }
}

static bool is_in(const modbus_drive_block_t *block, uint32_t address)
{
    return address >= block->address && address < (uint32_t)block->address + block->count;
}

/* The first register of a block that others have too; 65536 where there is none. */
static uint32_t common_register(const modbus_drive_block_t *block, const modbus_drive_blocks_t *others, unsigned count)
{
    for (uint32_t at = block->address; at < (uint32_t)block->address + block->count; at++) {
        for (unsigned i = 0; i < count; i++) {
            if (is_in(&others->block[i], at)) {
                return at;
            }
        }
    }
    return 65536;
}

static void check_setpoint_overlap(config_source_t *self, const char *name, const modbus_drive_blocks_t *blocks, bool is_itself)
{
    for (unsigned b = 0; b < blocks->count; b++) {
        const modbus_drive_blocks_t *setpoint = &modbus_of(self)->setpoint;
        const uint32_t at = common_register(&blocks->block[b], setpoint, is_itself ? b : setpoint->count);
        if (at <= 65535) {
            config_source_key_error(self, SECTION, name, "register 0x%04X is %s; allowed: each register once", (unsigned)at,
                                    is_itself ? _("in two blocks") : _("one of setpoint, too"));
            return;
        }
    }
}

/* What gives torque or moves is not for a list that is written at every start of a drive. */
static bool is_of_command(const config_modbus_t *modbus, const modbus_drive_block_t *own)
{
    return common_register(own, &modbus->enable, modbus->enable.count) <= 65535 ||
           common_register(own, &modbus->home, modbus->home.count) <= 65535;
}

static void check_item_overlap(config_source_t *self, const char *name, const config_items_t *items)
{
    for (unsigned i = 0; i < items->count; i++) {
        const modbus_drive_block_t own = {.address = items->item[i].address, .count = 1};
        if (items->item[i].is_written && is_of_command(modbus_of(self), &own)) {
            config_source_key_error(self, SECTION, name,
                                    "register 0x%04X is one of enable or home: it could give a drive torque before anybody has "
                                    "engaged; allowed: other registers",
                                    (unsigned)own.address);
            return;
        }
        const modbus_drive_blocks_t *setpoint = &modbus_of(self)->setpoint;
        bool is_twice = items->item[i].is_written && common_register(&own, setpoint, setpoint->count) <= 65535;
        for (unsigned n = 0; items != &modbus_of(self)->startup && n < modbus_of(self)->startup.count; n++) {
            is_twice |= modbus_of(self)->startup.item[n].address == own.address;
        }
        if (is_twice) {
            config_source_key_error(self, SECTION, name, "register 0x%04X is written by %s, too; allowed: each register once",
                                    (unsigned)own.address,
                                    items == &modbus_of(self)->startup ? "setpoint" : _("startup or setpoint"));
            return;
        }
    }
}

static void check_registers(config_source_t *self)
{
    const config_modbus_t *modbus = modbus_of(self);
    check_has_position(self, "setpoint", &modbus->setpoint);
    check_has_position(self, "feedback", &modbus->feedback);
    check_when(self, "enabled_when", modbus->enabled_when);
    check_when(self, "fault_when", modbus->fault_when);
    check_when(self, "homing_done_when", modbus->homing_done_when);
    check_when(self, "homing_failed_when", modbus->homing_failed_when);
    if (modbus->home.count > 0 && modbus->homing_done_when.mask == 0) {
        config_source_key_error(self, SECTION, "homing_done_when",
                                "missing where there is home; allowed: value/mask of {status} when homing is done");
    }
    check_setpoint_overlap(self, "setpoint", &modbus->setpoint, true);
    check_setpoint_overlap(self, "enable", &modbus->enable, false);
    check_setpoint_overlap(self, "disable", &modbus->disable, false);
    check_setpoint_overlap(self, "reset", &modbus->reset, false);
    check_setpoint_overlap(self, "home", &modbus->home, false);
    check_item_overlap(self, "startup", &modbus->startup);
    check_item_overlap(self, "drive_timeout", &modbus->drive_timeout);
}

/* Without its own watch a drive goes on to its last set-point, and holds it, whatever has become of heaved. */
static void check_drive_timeout(config_source_t *self)
{
    const config_items_t *items = &modbus_of(self)->drive_timeout;
    if (items->count == 0 && !modbus_of(self)->is_drive_timeout_confirmed) {
        config_source_key_error(
            self, SECTION, "drive_timeout",
            "missing, so that nothing stops a drive when this gateway falls silent; allowed: the drive's own watch, "
            "or drive_timeout_confirmed = yes where it is set in the drives already");
    }
    for (unsigned i = 0; i < items->count; i++) {
        if (!items->item[i].is_checked) {
            config_source_key_error(self, SECTION, "drive_timeout",
                                    "register 0x%04X is not read back; allowed: items without unchecked",
                                    (unsigned)items->item[i].address);
            return;
        }
    }
}

/* --- Times --- */

static double mm_of(q32_t value_q32)
{
    return (double)value_q32 / (double)Q32_ONE;
}

/* At full speed the set-points of a line are so far apart. */
static void check_step(config_source_t *self, uint32_t period_us)
{
    const q32_t speed_q32 = q32_from_q16(self->config->settings.cylinder_speed_mm_s_q16);
    const q32_t step_q32 = q32_from_q16(modbus_of(self)->step_mm_q16);
    const q32_t travel_q32 = fx_mul_div(speed_q32, period_us, 1000000);
    if (step_q32 != 0 && travel_q32 > step_q32) {
        config_source_key_error(
            self, SECTION, "step_mm",
            "at speed_mm_s of [cylinders] the set-points are %.3f mm apart: this line gives each drive one every %.1f "
            "ms; allowed: at least %.3f mm, or a speed of at most %.1f mm/s, or a quicker line",
            mm_of(travel_q32), (double)period_us / 1000.0, mm_of(travel_q32) + 0.0005,
            mm_of(step_q32) * 1e6 / (double)period_us - 0.05);
    }
}

static void check_window(config_source_t *self, const char *section, q16_t window_q16, uint32_t period_us)
{
    const q32_t speed_q32 = q32_from_q16(self->config->settings.cylinder_speed_mm_s_q16);
    const q32_t travel_q32 = fx_mul_div(speed_q32, LAG_PERIODS * (int64_t)period_us, 1000000);
    if (window_q16 != 0 && q32_from_q16(window_q16) < travel_q32) {
        config_source_key_error(
            self, section, "following_error_mm",
            "less than a cylinder moves at full speed in the %u periods of %.1f ms until its position is heard; "
            "allowed: at least %.3f mm",
            LAG_PERIODS, (double)period_us / 1000.0, mm_of(travel_q32) + 0.0005);
    }
}

static void check_times(config_source_t *self)
{
    modbus_drive_map_t map;
    const config_modbus_t *modbus = modbus_of(self);
    config_modbus_map(self->config, &map);
    const uint32_t patience_ms = (modbus->retries + 1u) * modbus->timeout_ms + LAG_PERIODS * map.expected_us / 1000u;
    if (modbus->feedback_timeout_ms < patience_ms) {
        config_source_key_error(self, SECTION, "feedback_timeout_ms",
                                "shorter than the retries and three rounds of the line take; allowed: at least %u ms",
                                (unsigned)patience_ms);
    }
    if (config_source_has(self, "cylinders", "speed_mm_s")) {
        check_step(self, map.expected_us);
        check_window(self, SECTION, modbus->following_error_mm_q16, map.expected_us);
        check_window(self, "cylinders", self->config->settings.following_error_mm_q16, map.expected_us);
    }
}

void config_modbus_check(config_source_t *self)
{
    const char *line = self->config->drives == CONFIG_DRIVES_MODBUS_TCP ? "modbus-tcp" : "modbus-rtu";
    if (!config_modbus_is_used(self->config) || !config_source_has(self, "platform", "kind") ||
        !config_source_has_all(self, SECTION) || !config_source_has_all(self, line)) {
        return;
    }
    const int errors = self->error_count;
    const unsigned cylinders = self->config->settings.geometry.kind == KIN_HEXAPOD ? 6u : 3u;
    check_lines(self, config_canraw_axes(self->config));
    check_registers(self);
    check_drive_timeout(self);
    check_numbers(self, cylinders);
    if (self->error_count == errors) {
        check_times(self);
    }
}
