/* SPDX-License-Identifier: MIT
 * cia402_check.c - what the keys of [cia402] mean together: nodes, counts at full stroke, periods, times. Each error is
 * reported at the key it concerns.
 */
#include "platform/canraw_section.h" // config_canraw_axes

#include "common/translate.h"
#include "platform/cia402_section.h"
#include "platform/check.h"
#include "config/value.h"

#define SECTION           "cia402"
#define NODE_MAX          127u
#define DEADLINE_PERIODS  4u
#define WINDOW_PERIODS    3u /* a drive lags by its own lag and by one or two periods */
#define HOMING_METHOD_MAX 127

static unsigned cylinders_of(const config_source_t *self)
{
    return self->config->settings.geometry.kind == KIN_HEXAPOD ? 6u : 3u;
}

static bool is_length(config_source_t *self, const char *name, unsigned count, unsigned wanted, const char *of)
{
    if (count == 1 || count == wanted) {
        return true;
    }
    config_source_key_error(self, SECTION, name, "has %u values; allowed: one, or one for each of the %u %s", count, wanted, of);
    return false;
}

/* --- Nodes --- */

/* A node that another drive has, or the gateway.
 * Returns false after an error. */
static bool is_node_free(config_source_t *self, unsigned axis)
{
    const uint32_t node = config_cia402_node(self->config, axis);
    const uint32_t channel = config_cia402_channel(self->config, axis);
    if (node < 1u || node > NODE_MAX) {
        config_source_key_error(self, SECTION, "nodes", "%u of drive %u is no node id; allowed: 1 to %u", (unsigned)node,
                                axis + 1u, NODE_MAX);
        return false;
    }
    if (node == self->config->cia402.gateway_node) {
        config_source_key_error(self, SECTION, "nodes",
                                "%u of drive %u is gateway_node; allowed: a different one for each, and for the gateway",
                                (unsigned)node, axis + 1u);
        return false;
    }
    for (unsigned i = 0; i < axis; i++) {
        if (config_cia402_node(self->config, i) == node && config_cia402_channel(self->config, i) == channel) {
            config_source_key_error(self, SECTION, "nodes",
                                    "%u of drive %u is that of drive %u already; allowed: a different one for each, or axes of a "
                                    "node such as %u.1 and %u.2",
                                    (unsigned)node, axis + 1u, i + 1u, (unsigned)node, (unsigned)node);
            return false;
        }
    }
    return true;
}

/* The axes of a node begin at 1: what belongs to the node is done with its first one. */
static bool has_axis_below(config_source_t *self, unsigned axis, unsigned axes)
{
    const uint32_t node = config_cia402_node(self->config, axis);
    const uint32_t channel = config_cia402_channel(self->config, axis);
    for (unsigned i = 0; i < axes; i++) {
        if (config_cia402_node(self->config, i) == node && config_cia402_channel(self->config, i) + 1u == channel) {
            return true;
        }
    }
    if (channel > 0) {
        config_source_key_error(self, SECTION, "nodes",
                                "%u.%u of drive %u is there without %u.%u; allowed: axes from 1, without gaps", (unsigned)node,
                                (unsigned)channel + 1u, axis + 1u, (unsigned)node, (unsigned)channel);
    }
    return channel == 0;
}

static void check_nodes(config_source_t *self, unsigned axes)
{
    const config_ids_t *nodes = &self->config->cia402.nodes;
    bool is_fine = true;
    if (nodes->count == 0) {
        config_source_key_error(self, SECTION, "nodes", "missing for driver = cia402; allowed: node ids from 1 to %u", NODE_MAX);
        return;
    }
    is_fine = is_length(self, "nodes", nodes->count, axes, "drives");
    for (unsigned k = 0; is_fine && k < axes; k++) {
        is_fine = is_node_free(self, k);
    }
    for (unsigned k = 0; is_fine && k < axes; k++) {
        is_fine = has_axis_below(self, k, axes);
    }
}

/* The key that a PDO which does not fit is of: of two that are both as usual, the nodes are too full. */
static void check_maps(config_source_t *self)
{
    const config_cia402_t *cia402 = &self->config->cia402;
    const char *why = NULL;
    cia402_config_t drives;
    config_cia402(self->config, &drives);
    if (!cia402_pdos_fit(&drives, &why)) {
        config_source_key_error(self, SECTION,
                                cia402->command_map.count != 0  ? "command_map"
                                : cia402->answer_map.count != 0 ? "answer_map"
                                                                : "nodes",
                                "the PDOs do not fit: %s; allowed: other maps, or less telemetry (tell_torque, ...)",
                                translate(why));
    }
}

static bool has_mode(const config_t *config, cia402_mode_t mode)
{
    for (unsigned k = 0; k < config_canraw_axes(config); k++) {
        if (config_cia402_mode(config, k) == mode) {
            return true;
        }
    }
    return false;
}

static void check_serials(config_source_t *self, unsigned axes)
{
    const unsigned count = self->config->cia402.serial_numbers.count;
    if (count != 0 && count != axes) {
        config_source_key_error(self, SECTION, "serial_numbers", "has %u values; allowed: none, or one for each of the %u drives",
                                count, axes);
    }
}

/* --- Counts --- */

/* A position as the 32 bits of 607Ah and 6064h have it.
 * Returns false after an error. */
static bool is_carried(config_source_t *self, unsigned axis, q32_t at_q32)
{
    const bool is_angle = axis >= cylinders_of(self);
    const counts_scale_t scale = config_cia402_scale(self->config, axis);
    int64_t counts = INT64_MAX;
    config_text_t at;
    const bool is_number = counts_from_units(&scale, at_q32, &counts) == HV_OK;
    if (is_number && counts >= INT32_MIN && counts <= INT32_MAX) {
        return true;
    }
    config_text_clear(&at);
    config_text_add_q16(&at, q16_from_q32(at_q32));
    config_source_key_error(
        self, SECTION, is_angle ? "angle_counts_per_deg" : "counts_per_mm",
        _("%s %s of drive %u are %lld counts, and 607Ah carries %d to %d; allowed: fewer counts, other zero counts"), at.data,
        is_angle ? "deg" : "mm", axis + 1u, (long long)counts, (int)INT32_MIN, (int)INT32_MAX);
    return false;
}

static bool is_given(config_source_t *self, const char *name, unsigned count)
{
    config_text_t allowed;
    if (count > 0) {
        return true;
    }
    config_text_clear(&allowed);
    config_value_allowed(&config_keys[config_key_find(SECTION, name)], &allowed);
    config_source_key_error(self, SECTION, name, "missing for driver = cia402; allowed: %s, but not none", allowed.data);
    return false;
}

static void check_scales(config_source_t *self, unsigned cylinders)
{
    const config_cia402_t *cia402 = &self->config->cia402;
    const settings_t *settings = &self->config->settings;
    const axis_settings_t *angle = &settings->axis[AXIS_ANGLE];
    const bool is_zero = is_length(self, "zero_counts", cia402->zero_counts.count, cylinders, "cylinders");
    bool is_fine = is_given(self, "counts_per_mm", cia402->counts_per_mm.count) &&
                   is_length(self, "counts_per_mm", cia402->counts_per_mm.count, cylinders, "cylinders") && is_zero;
    for (unsigned i = 0; is_fine && i < cylinders; i++) {
        is_fine = is_carried(self, i, 0) && is_carried(self, i, q32_from_q16(settings->stroke_mm_q16[i]));
    }
    if (settings->has_angle && is_given(self, "angle_counts_per_deg", cia402->angle_counts_per_deg.count)) {
        (void)(is_carried(self, cylinders, q32_from_q16(angle->min_q16)) &&
               is_carried(self, cylinders, q32_from_q16(angle->max_q16)));
    }
}

/* --- Homing --- */

static void check_methods(config_source_t *self, const char *name, const config_wholes_t *methods, unsigned wanted)
{
    if (!is_length(self, name, methods->count, wanted, "cylinders")) {
        return;
    }
    for (unsigned i = 0; i < methods->count; i++) {
        if (methods->value[i] < -HOMING_METHOD_MAX - 1 || methods->value[i] > HOMING_METHOD_MAX) {
            config_source_key_error(self, SECTION, name, "%d is no method; allowed: -128 to 127, 0 = nothing to find",
                                    (int)methods->value[i]);
            return;
        }
    }
}

/* --- Times --- */

static void check_period(config_source_t *self)
{
    const uint32_t period_us = self->config->cia402.period_us;
    if (!cia402_is_period(period_us)) {
        config_source_key_error(self, SECTION, "period_us",
                                "60C2h cannot hold it; allowed: whole ms (%u us), or multiples of 100 us up to 25500",
                                (unsigned)((period_us + 500u) / 1000u * 1000u));
    }
}

static void check_times(config_source_t *self)
{
    const config_cia402_t *cia402 = &self->config->cia402;
    if (cia402->heartbeat_timeout_ms < 2u * cia402->heartbeat_ms) {
        config_source_key_error(self, SECTION, "heartbeat_timeout_ms",
                                "less than two heartbeats: one late one would stop the platform; allowed: at least %u ms",
                                2u * cia402->heartbeat_ms);
    }
    if (has_mode(self->config, CIA402_MODE_PP) && cia402->answer_every > 1) {
        config_source_key_error(self, SECTION, "answer_every",
                                "mode = pp needs the answer to every SYNC; allowed: 1, or another mode");
    }
    if (cia402->rpdo_deadline_ms != 0 &&
        cia402->rpdo_deadline_ms * UINT64_C(1000) < DEADLINE_PERIODS * (uint64_t)cia402->period_us) {
        config_source_key_error(self, SECTION, "rpdo_deadline_ms",
                                "less than four periods: one late command would stop a drive; allowed: 0, or at least %u ms",
                                (DEADLINE_PERIODS * cia402->period_us + 999u) / 1000u);
    }
    if ((cia402->csp_control_bits & ~CIA402_CSP_CONTROL_BITS) != 0) {
        config_source_key_error(
            self, SECTION, "csp_control_bits",
            "the other bits of 6040h lead the drive through its states; allowed: 0, 10, 20, 40 and their sums");
    }
    if (cia402->sync_counter == 1) {
        config_source_key_error(self, SECTION, "sync_counter", "a counter cannot end at 1; allowed: 0, or 2 to 240");
    }
}

/* A drive that lacks a watchdog may go on moving when heaved has failed. Only trying it shows what it does. */
static void check_watchdogs(config_source_t *self)
{
    const config_cia402_t *cia402 = &self->config->cia402;
    if (cia402->accepted_without != 0 && !cia402->is_stop_confirmed) {
        config_source_key_error(self, SECTION, "accept_without",
                                "heaved cannot see what such a drive does when heaved fails; allowed: none, or with "
                                "stop_confirmed = yes where somebody has tried it");
    }
}

/* At full speed a drive is behind by some periods without any fault. */
static void check_window(config_source_t *self, const char *name, q16_t window_q16, q16_t speed_q16, const char *unit)
{
    const unsigned periods = WINDOW_PERIODS + self->config->cia402.answer_every - 1u;
    const q32_t travel_q32 = fx_mul_div(q32_from_q16(speed_q16), periods * (int64_t)self->config->cia402.period_us, 1000000);
    if (q32_from_q16(window_q16) < travel_q32) {
        config_source_key_error(self, SECTION, name,
                                "less than a drive at full speed moves in %u periods; allowed: at least %.3f %s", periods,
                                (double)travel_q32 / (double)Q32_ONE + 0.0005, unit);
    }
}

/* Rising and settling, at least, have to be possible. */
static void check_profile_lag(config_source_t *self)
{
    const config_t *config = self->config;
    const q32_t lag_q32 = config_cia402_pp_lag_q32(config, config->settings.engage_speed_mm_s_q16);
    if (has_mode(config, CIA402_MODE_PP) && config_source_has_all(self, "engage") && config_source_has_all(self, "cylinders") &&
        q32_from_q16(config->cia402.following_error_mm_q16) < lag_q32) {
        config_source_key_error(
            self, SECTION, "following_error_mm",
            "less than a drive in mode pp is behind at [engage] speed_mm_s; allowed: at least %.3f mm, or slower",
            (double)lag_q32 / (double)Q32_ONE + 0.0005);
    }
}

void config_cia402_check(config_source_t *self)
{
    const config_cia402_t *cia402 = &self->config->cia402;
    const settings_t *settings = &self->config->settings;
    if (self->config->drives != CONFIG_DRIVES_CIA402 || !config_source_has(self, "platform", "kind") ||
        !config_source_has_all(self, SECTION)) {
        return;
    }
    if (!is_length(self, "mode", cia402->mode.count, config_canraw_axes(self->config), "drives")) {
        return;
    }
    check_nodes(self, config_canraw_axes(self->config));
    check_serials(self, config_canraw_axes(self->config));
    check_scales(self, cylinders_of(self));
    check_methods(self, "homing_method", &cia402->homing.method, cylinders_of(self));
    check_period(self);
    check_times(self);
    check_watchdogs(self);
    check_profile_lag(self);
    check_window(self, "following_error_mm", cia402->following_error_mm_q16, settings->cylinder_speed_mm_s_q16, "mm");
    if (settings->has_angle) {
        check_methods(self, "angle_homing_method", &cia402->angle_homing.method, 1);
        check_window(self, "angle_following_error_deg", cia402->angle_following_error_deg_q16,
                     settings->axis[AXIS_ANGLE].speed_q16, "deg");
    }
    if (self->error_count == 0) {
        check_maps(self);
        config_startup_check(self);
    }
}
