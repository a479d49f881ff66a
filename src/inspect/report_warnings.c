/* SPDX-License-Identifier: MIT
 * report_warnings.c - where a configuration asks for what it cannot have, with what would be right; see report_parts.h.
 */
#include "inspect/report_parts.h"

#include <math.h>
#include <string.h>

#include "common/translate.h"
#include "config/config_text.h"
#include "config/hash.h"
#include "config/keys.h"
#include "heave/ramp.h"
#include "platform/bus.h"
#include "platform/cia402_section.h" // config_cia402_pp_lag_q32
#include "platform/layout.h"

#define EDGE_TOLERANCE 0.001 /* deg or mm: a limit on the edge itself is fine */

static void warn(report_t *self, const char *text)
{
    fprintf(self->out, _("warning: %s\n"), translate(text));
    self->warnings++;
}

/* An axis whose limits lie where the platform cannot or should not go. */
static void warn_reach(report_t *self, unsigned axis)
{
    const axis_settings_t *limits = &self->settings->axis[axis];
    const envelope_t *envelope = &self->envelope;
    const char *unit = config_axis_unit(axis);
    const bool is_low = report_number_q16(limits->min_q16) < envelope->low[axis].value - EDGE_TOLERANCE;
    const bool is_high = report_number_q16(limits->max_q16) > envelope->high[axis].value + EDGE_TOLERANCE;
    config_text_t text, cause;
    if (!is_low && !is_high) {
        return;
    }
    config_text_clear(&text);
    config_text_add(&text, _("[%s] limits %.3f to %.3f %s go beyond the reach:"), config_axis_section[axis],
                    report_number_q16(limits->min_q16), report_number_q16(limits->max_q16), unit);
    if (is_low) {
        config_text_add(&text, _(" %s ends it at %.3f, set min_%s = %.6g%s"),
                        report_cause_text(envelope->low[axis].cause, &cause), envelope->low[axis].value, unit,
                        envelope->suggested[axis].min, is_high ? ";" : "");
    }
    if (is_high) {
        config_text_add(&text, _(" %s ends it at %.3f, set max_%s = %.6g"), report_cause_text(envelope->high[axis].cause, &cause),
                        envelope->high[axis].value, unit, envelope->suggested[axis].max);
    }
    warn(self, text.data);
}

static void warn_singularity(report_t *self)
{
    const envelope_box_t *box = &self->envelope.limits;
    config_text_t text, pose;
    if (box->margin >= report_number(KIN_MARGIN_LEAST_Q32)) {
        return;
    }
    config_text_clear(&text);
    config_text_add(&text,
                    _("poses within the limits are near a singularity: a margin of %.3f at %s, below %.1f: make the limits of "
                      "these axes narrower"),
                    box->margin, report_pose_text(self, &box->margin_pose, &pose), report_number(KIN_MARGIN_LEAST_Q32));
    warn(self, text.data);
}

/* A ramp that lowers its acceleration, because speed, jerk or travel never let it be reached. */
static void warn_acceleration(report_t *self, const char *section, const char *unit, const axis_settings_t *axis)
{
    ramp_limits_t limits;
    config_text_t text;
    if (ramp_limits_from_units(axis->min_q16, axis->max_q16, axis->speed_q16, axis->accel_q16, axis->jerk,
                               self->settings->cycle_us, &limits) != HV_OK ||
        ramp_safe_acceleration(&limits) >= limits.acc_per_cycle2_q32) {
        return;
    }
    config_text_clear(&text);
    config_text_add(
        &text, _("[%s] the acceleration in force is %.1f of %.1f %s/s^2: speed, jerk and travel do not let it get higher"),
        section, report_number_q16(axis->accel_q16) * (double)ramp_safe_acceleration(&limits) / (double)limits.acc_per_cycle2_q32,
        report_number_q16(axis->accel_q16), unit);
    warn(self, text.data);
}

static void warn_cylinders(report_t *self)
{
    const settings_t *settings = self->settings;
    for (unsigned i = 0; i < self->envelope.cylinders; i++) {
        const axis_settings_t cylinder = {.min_q16 = settings->margin_mm_q16,
                                          .max_q16 = settings->stroke_mm_q16[i] - settings->margin_mm_q16,
                                          .speed_q16 = settings->cylinder_speed_mm_s_q16,
                                          .accel_q16 = settings->cylinder_accel_mm_s2_q16,
                                          .jerk = settings->cylinder_jerk_mm_s3};
        if (i == 0 || settings->stroke_mm_q16[i] != settings->stroke_mm_q16[0]) {
            warn_acceleration(self, "cylinders", "mm", &cylinder);
        }
    }
}

/* The acceleration that the ramp of an axis comes to. */
static double accel_in_force(const report_t *self, const axis_settings_t *axis)
{
    ramp_limits_t limits;
    const double accel = report_number_q16(axis->accel_q16);
    if (ramp_limits_from_units(axis->min_q16, axis->max_q16, axis->speed_q16, axis->accel_q16, axis->jerk,
                               self->settings->cycle_us, &limits) != HV_OK) {
        return accel;
    }
    return accel * fmin((double)ramp_safe_acceleration(&limits) / (double)limits.acc_per_cycle2_q32, 1);
}

static void add_demand(config_text_t *text, const char *what, double asked, double limit, const char *unit, const char *key)
{
    if (asked > limit) {
        config_text_add(text, _("%s its %s alone asks a cylinder for %.1f %s, above %s of [cylinders], %.1f"),
                        text->length > 0 ? ";" : "", what, asked, unit, key, limit);
    }
}

static void add_lower(config_text_t *text, size_t head, const char *key, const char *unit, const char *per, double now,
                      double lower)
{
    if (lower < now) {
        config_text_add(text, "%s %s_%s_%s = %.6g", text->length == head ? "" : ",", key, unit, per, lower);
    }
}

/* An axis whose limits its cylinders cannot serve even while it moves alone. */
static void warn_demand(report_t *self, unsigned axis)
{
    const settings_t *settings = self->settings;
    const axis_settings_t *asked = &settings->axis[axis];
    const envelope_rate_t *rate = &self->envelope.limits.rate[axis];
    const envelope_limits_t now = {report_number_q16(asked->min_q16), report_number_q16(asked->max_q16),
                                   report_number_q16(asked->speed_q16), accel_in_force(self, asked), asked->jerk};
    const envelope_demand_t demand = envelope_demand(rate, &now);
    envelope_limits_t lower = now;
    config_text_t text, whole;
    config_text_clear(&text);
    config_text_clear(&whole);
    add_demand(&text, _("speed"), demand.speed_mm_s, report_number_q16(settings->cylinder_speed_mm_s_q16), "mm/s", "speed_mm_s");
    add_demand(&text, _("acceleration"), demand.accel_mm_s2, report_number_q16(settings->cylinder_accel_mm_s2_q16), "mm/s^2",
               "accel_mm_s2");
    add_demand(&text, _("jerk"), demand.jerk_mm_s3, settings->cylinder_jerk_mm_s3, "mm/s^3", "jerk_mm_s3");
    if (text.length == 0) {
        return;
    }
    envelope_suggest(settings, rate, &lower);
    config_text_add(&whole, _("[%s]%s: set"), config_axis_section[axis], text.data);
    const size_t head = whole.length;
    add_lower(&whole, head, "speed", config_axis_unit(axis), "s", now.speed, lower.speed);
    add_lower(&whole, head, "accel", config_axis_unit(axis), "s2", now.accel, lower.accel);
    add_lower(&whole, head, "jerk", config_axis_unit(axis), "s3", now.jerk, lower.jerk);
    warn(self, whole.data);
}

static void note(const report_t *self, const char *text)
{
    fprintf(self->out, _("note: %s\n"), translate(text));
}

static bool is_local(const config_t *config)
{
    return strncmp(config->udp.bind, "127.", 4) == 0 || strcmp(config->udp.bind, "::1") == 0;
}

static void warn_watchdogs(report_t *self)
{
    const config_cia402_t *cia402 = &self->config->cia402;
    if (self->config->drives == CONFIG_DRIVES_CIA402 && cia402->is_no_watchdog_allowed) {
        warn(self,
             N_("[cia402] allow_no_watchdog = yes accepts drives without any watchdog, and nothing says which they lack: name "
                "those in accept_without"));
    }
}

/* What is meant here and forgotten there: nothing is wrong with it. */
/* Manuals number holding registers from 40001, and input registers from 30001. */
static bool is_of_manual(const config_t *config, unsigned address, bool is_read)
{
    const unsigned first = is_read && config->modbus.read == CONFIG_READ_INPUT ? 30001u : 40001u;
    return address >= first && address < first + 9999u;
}

static void warn_register(report_t *self, const char *key, unsigned address, bool is_read)
{
    config_text_t text;
    if (is_of_manual(self->config, address, is_read)) {
        config_text_clear(&text);
        config_text_add(&text,
                        _("[modbus] %s has register %u: if a manual calls it so, it is %u here; on the wire they count from 0"),
                        key, address, (address - 1u) % 10000u);
        warn(self, text.data);
    }
}

static void warn_registers(report_t *self)
{
    const config_modbus_t *modbus = &self->config->modbus;
    const struct {
        const char *key;
        const modbus_drive_blocks_t *blocks;
    } k_blocks[] = {{"setpoint", &modbus->setpoint}, {"feedback", &modbus->feedback}, {"enable", &modbus->enable},
                    {"disable", &modbus->disable},   {"stop", &modbus->stop},         {"reset", &modbus->reset},
                    {"home", &modbus->home}};
    const struct {
        const char *key;
        const config_items_t *items;
    } k_items[] = {{"startup", &modbus->startup}, {"drive_timeout", &modbus->drive_timeout}};
    if (self->config->drives != CONFIG_DRIVES_MODBUS_TCP && self->config->drives != CONFIG_DRIVES_MODBUS_RTU) {
        return;
    }
    for (unsigned i = 0; i < sizeof k_blocks / sizeof k_blocks[0]; i++) {
        for (unsigned n = 0; n < k_blocks[i].blocks->count; n++) {
            warn_register(self, k_blocks[i].key, k_blocks[i].blocks->block[n].address, k_blocks[i].blocks == &modbus->feedback);
        }
    }
    for (unsigned i = 0; i < sizeof k_items / sizeof k_items[0]; i++) {
        for (unsigned n = 0; n < k_items[i].items->count; n++) {
            warn_register(self, k_items[i].key, k_items[i].items->item[n].address, false);
        }
    }
}

static void write_notes(const report_t *self)
{
    const config_t *config = self->config;
    if (is_local(config)) {
        note(self,
             N_("[udp] bind: heaved hears senders on this machine only; for others give the address of this machine, and allow"));
    }
    if (config->drives != CONFIG_DRIVES_SIM && config->inputs.estop_line.text[0] == '\0') {
        note(self, N_("[inputs] estop: heaved reads no e-stop; its contacts have to take the power off the drives themselves"));
    }
}

/* Frames carry no password: an open port lets any machine of the network move the platform. */
static void warn_network(report_t *self)
{
    if (!is_local(self->config) && self->config->udp.allow.count == 0) {
        warn(self, "[udp] bind and allow let every machine of the network move the platform");
    }
}

static void warn_bus(report_t *self)
{
    config_bus_t bus;
    config_text_t text;
    config_bus_describe(self->config, &bus);
    if (bus.section == NULL || config_bus_load_ppm(&bus) <= CONFIG_BUS_WARNED_PPM) {
        return;
    }
    const uint32_t fitting_us = config_bus_fitting_us(&bus, CONFIG_BUS_WARNED_PPM, self->settings->cycle_us);
    config_text_clear(&text);
    config_text_add(&text, _("[%s] period_us loads the bus by %.1f %% at worst: a repeated frame makes the next ones late; "),
                    bus.section, config_bus_load_ppm(&bus) / 10000.0);
    if (fitting_us == 0) {
        config_text_add(&text, _("a higher bitrate_bps helps"));
    } else {
        config_text_add(&text, _("%u us give %u %%"), (unsigned)fitting_us, CONFIG_BUS_WARNED_PPM / 10000u);
    }
    warn(self, text.data);
}

static bool has_mode_pp(const config_t *config)
{
    for (unsigned i = 0; i < config->cia402.mode.count; i++) {
        if (config->cia402.mode.word[i] == CONFIG_MODE_PP) {
            return true;
        }
    }
    return false;
}

/* In profile position drives may do no more than follow poses that are rare and near. */
static void warn_profile_lag(report_t *self)
{
    const config_t *config = self->config;
    config_text_t text;
    if (config->drives != CONFIG_DRIVES_CIA402 || !has_mode_pp(config)) {
        return;
    }
    const q32_t lag_q32 = config_cia402_pp_lag_q32(config, config->settings.cylinder_speed_mm_s_q16);
    if (lag_q32 > q32_from_q16(config->cia402.following_error_mm_q16)) {
        config_text_clear(&text);
        config_text_add(
            &text,
            _("[cia402] mode = pp: at [cylinders] speed_mm_s a drive is %.1f mm behind, and following_error_mm stops it before; "
              "slower, or csp"),
            (double)lag_q32 / (double)Q32_ONE);
        warn(self, text.data);
    }
}

static void warn_layout(report_t *self)
{
    config_text_t text;
    for (unsigned at = 0; config_layout_next_oddity(self->config, &at, &text);) {
        warn(self, text.data);
    }
}

void report_write_warnings(report_t *self)
{
    warn_layout(self);
    for (unsigned axis = 0; axis < AXES_MAX; axis++) {
        if (!config_has_axis(self->config, axis)) {
            continue;
        }
        if (axis < POSE_AXES) {
            warn_reach(self, axis);
        }
        warn_acceleration(self, config_axis_section[axis], config_axis_unit(axis), &self->settings->axis[axis]);
        if (axis < POSE_AXES) {
            warn_demand(self, axis);
        }
    }
    warn_singularity(self);
    warn_cylinders(self);
    warn_network(self);
    warn_bus(self);
    if (config_is_unapproved(self->config)) {
        warn(self, "[platform] approved: another configuration was approved; nothing moves until `heavectl acknowledge`");
    }
    warn_profile_lag(self);
    warn_watchdogs(self);
    warn_registers(self);
    write_notes(self);
}
