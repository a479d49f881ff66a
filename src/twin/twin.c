/* SPDX-License-Identifier: MIT
 * twin.c - the outside of a configuration; see twin.h.
 */
#include "twin/twin.h"

#include <math.h>
#include <string.h>

#include "platform/canraw_section.h"
#include "platform/cia402_section.h"
#include "platform/modbus_section.h"

#define OTHER_US             20000u /* from one frame of another master to the next */
#define CIA402_RPDO          0x200u
#define CIA402_COMMAND_BYTES 6u  /* controlword and target */
#define STOP_MM              3.0 /* end stops are so far beyond the stroke */
#define BOOT_US              300000u
#define SDO_US               1000u
#define SWITCH_ON_US         50000u
#define BRAKE_US             100000u
#define JUMP_U               20.0 /* a set-point so far away is a following error at once; mm or deg */
#define MISSED_MAX           3u
#define LAG_MS               2.0
#define VENDOR               0x2E5u
#define MODBUS_STEP_US       10000u /* drives on Modbus are looked at so often beside their questions */
#define ANGLE_RATED_U        360.0

void twin_settings_init(twin_settings_t *self, const config_t *config)
{
    memset(self, 0, sizeof *self);
    for (unsigned k = 0; k < DRIVES_MAX; k++) {
        self->leg_of[k] = (uint8_t)k;
        self->lead[k] = 1;
    }
    self->start_mm = config->settings.settled_extension_mm_q16 / (double)Q16_ONE;
    self->lag_ms = LAG_MS;
    self->ambient_c = MOTOR_AMBIENT_C;
}

static const char *refusal_of_registers(const config_t *config)
{
    modbus_drive_map_t map;
    config_modbus_map(config, &map);
    return register_drive_refusal(&map);
}

static const char *refusal_of_frames(const config_t *config)
{
    canraw_map_t map;
    config_canraw_map(config, &map);
    return frame_drive_refusal(&map);
}

twin_drives_t twin_kind(const config_t *config)
{
    return config_modbus_is_used(config)             ? TWIN_DRIVES_MODBUS
           : config->drives == CONFIG_DRIVES_CAN_RAW ? TWIN_DRIVES_FRAMES
           : config->drives == CONFIG_DRIVES_SIM     ? TWIN_DRIVES_NONE
                                                     : TWIN_DRIVES_CIA402;
}

const char *twin_refusal(const config_t *config, const lines_t *lines)
{
    switch (config->drives) {
    case CONFIG_DRIVES_CIA402:
        return NULL;
    case CONFIG_DRIVES_SIM:
        return lines->count > 0
                   ? NULL
                   : "[drives] driver = sim: heaved simulates these drives itself; heave-twin needs driver = cia402, "
                     "can-raw, modbus-tcp or modbus-rtu, or GPIO lines";
    case CONFIG_DRIVES_CAN_RAW:
        return refusal_of_frames(config);
    case CONFIG_DRIVES_MODBUS_TCP:
    case CONFIG_DRIVES_MODBUS_RTU:
        return refusal_of_registers(config);
    }
    return "[drives] driver is unknown to heave-twin";
}

/* What a drive moves: raw counts = zero + u * per_unit. */
static void couple(twin_t *self, const config_t *config, const twin_settings_t *settings, const counts_scale_t *scale, unsigned k)
{
    const double expected = (double)scale->num / scale->den;
    self->leg_of[k] = settings->leg_of[k];
    self->per_unit[k] = expected / settings->lead[k] * (settings->is_reversed[k] ? -1 : 1);
    self->zero[k] = scale->zero + settings->zero_counts[k];
    drive_t *drive = &self->node[k].drive;
    motor_t *motor = &drive->motor;
    const double counts = fabs(self->per_unit[k]);
    const bool is_cylinder = k < self->cylinders;
    motor->lag_us = settings->lag_ms * 1000;
    motor->ambient_c = settings->ambient_c;
    motor->friction = settings->friction_mm * counts;
    motor->load = is_cylinder ? settings->load_mm * self->per_unit[k] : 0;
    motor->rated_speed = counts * (is_cylinder ? config->settings.cylinder_speed_mm_s_q16 / (double)Q16_ONE : ANGLE_RATED_U);
    drive->jump_counts = (uint32_t)fmin(JUMP_U * fabs(expected), 2e9);
    drive->home = drive->home_other = self->zero[k];
    double start = 0;
    if (is_cylinder) {
        const double stroke = config->settings.stroke_mm_q16[self->leg_of[k]] / (double)Q16_ONE;
        const double in = self->zero[k] - STOP_MM * self->per_unit[k];
        const double out = self->zero[k] + (stroke + STOP_MM) * self->per_unit[k];
        motor->stop_low = fmin(in, out);
        motor->stop_high = fmax(in, out);
        /* it looks for its zero where the configuration has "in": backwards that is the other end */
        drive->home += settings->is_reversed[k] ? stroke * self->per_unit[k] : 0;
        drive->home_other = self->zero[k] + (settings->is_reversed[k] ? 0 : stroke * self->per_unit[k]);
        start = settings->start_mm;
    }
    motor_start(motor, self->zero[k] + start * self->per_unit[k], 0);
}

static void start_modbus(twin_t *self, const config_t *config, const twin_settings_t *settings, uint64_t now_us)
{
    self->drives = self->modbus.drives;
    for (unsigned k = 0; k < self->drives; k++) {
        register_drive_t *drive = &self->modbus.drive[k];
        couple(self, config, settings, &self->modbus.map.axis[k].scale, k);
        drive->motor = &self->node[k].drive.motor;
        drive->motor->now_us = now_us;
        drive->is_absolute = settings->is_homed;
        drive->home = self->node[k].drive.home;
        drive->usual_speed = drive->motor->rated_speed;
        register_drive_power(drive, true, now_us);
    }
}

static void start_frames(twin_t *self, const config_t *config, const twin_settings_t *settings, node_out_t out, uint64_t now_us)
{
    config_canraw_map(config, &self->frame_map);
    self->drives = self->frame_map.axes;
    for (unsigned k = 0; k < self->drives; k++) {
        frame_drive_t *drive = &self->frame[k];
        frame_drive_init(drive, &self->frame_map, k, out);
        couple(self, config, settings, &self->frame_map.axis[k].scale, k);
        drive->all = self->frame;
        drive->motor = &self->node[k].drive.motor;
        drive->motor->now_us = now_us;
        drive->is_absolute = settings->is_homed;
        drive->home = self->node[k].drive.home;
        drive->usual_speed = drive->motor->rated_speed;
        frame_drive_power(drive, true, now_us);
    }
}

/* The objects of a start-up list: such drives have them. One that is written holds something else before. */
static void add_objects(twin_t *self, unsigned k, const cia402_axis_config_t *axis)
{
    for (unsigned i = 0; i < axis->items; i++) {
        const cia402_item_t *item = &axis->item[i];
        self->own[k][i] = (object_t){.index = item->index,
                                     .sub = item->sub,
                                     .bytes = item->bytes,
                                     .fallback = item->is_written ? (item->value == 0 ? 1u : 0u) : item->value,
                                     .is_read_only = !item->is_written};
    }
    self->node[k].own = self->own[k];
    self->node[k].owns = axis->items;
}

/* Axes of one node, in the order that they have there. */
static void join_axes(twin_t *self, const cia402_config_t *drives)
{
    for (unsigned k = 0; k < drives->axes; k++) {
        node_t *axis[OBJECT_AXES] = {&self->node[k]};
        unsigned axes = 1;
        for (unsigned i = 0; i < drives->axes && drives->axis[k].channel == 0; i++) {
            if (drives->axis[i].node == drives->axis[k].node && drives->axis[i].channel > 0) {
                axis[drives->axis[i].channel] = &self->node[i];
                axes++;
            }
        }
        if (drives->axis[k].channel == 0) {
            node_join(axis, axes);
        }
    }
}

void twin_start(twin_t *self, const config_t *config, const twin_settings_t *settings, node_out_t out, uint64_t now_us)
{
    cia402_config_t drives;
    memset(self, 0, sizeof *self);
    self->out = out;
    self->has_pose = kin_init(&self->kin, &config->settings.geometry) == HV_OK;
    self->cylinders = kin_cylinders(&self->kin);
    self->kind = twin_kind(config);
    modbus_side_init(&self->modbus, config);
    if (self->kind == TWIN_DRIVES_MODBUS) {
        start_modbus(self, config, settings, now_us);
        return;
    }
    if (self->kind == TWIN_DRIVES_NONE) {
        return;
    }
    if (self->kind == TWIN_DRIVES_FRAMES) {
        start_frames(self, config, settings, out, now_us);
        return;
    }
    config_cia402(config, &drives);
    self->drives = drives.axes;
    for (unsigned k = 0; k < self->drives; k++) {
        const cia402_axis_config_t *axis = &drives.axis[k];
        const uint32_t identity[4] = {
            axis->identity[0] != 0 ? axis->identity[0] : VENDOR, axis->identity[1] != 0 ? axis->identity[1] : 1,
            axis->identity[2] != 0 ? axis->identity[2] : 1, axis->identity[3] != 0 ? axis->identity[3] : k + 1};
        node_t *node = &self->node[k];
        node->number = axis->node;
        memcpy(node->identity, identity, sizeof identity);
        node->boot_us = BOOT_US;
        node->sdo_us = SDO_US;
        node->out = out;
        node->drive.switch_on_us = SWITCH_ON_US;
        node->drive.brake_us = BRAKE_US;
        node->drive.missed_max = MISSED_MAX;
        node->drive.is_absolute = axis->homing_method == 0 || settings->is_homed;
        node->drive.home_method = (uint8_t)axis->homing_method;
        node->pdo_step = drives.pdo_step;
        node->commands = drives.commands;
        node->answers = drives.answers;
        node->are_maps_fixed = drives.are_maps_fixed;
        add_objects(self, k, axis);
        couple(self, config, settings, &axis->scale, k);
    }
    join_axes(self, &drives);
    for (unsigned k = 0; k < self->drives; k++) {
        node_power(&self->node[k], true, now_us);
    }
}

/* Has torque. Lives up to now. */
static bool advance_drive(twin_t *self, unsigned k, uint64_t now_us)
{
    if (self->kind == TWIN_DRIVES_FRAMES) {
        frame_drive_advance(&self->frame[k], now_us);
        return frame_drive_is_enabled(&self->frame[k]);
    }
    if (self->kind == TWIN_DRIVES_MODBUS) {
        register_drive_t *drive = &self->modbus.drive[k];
        register_drive_advance(drive, now_us);
        return drive->is_powered && drive->state == REGISTER_TORQUE;
    }
    node_advance(&self->node[k], now_us);
    return self->node[k].is_powered && drive_is_enabled(&self->node[k].drive);
}

void twin_hear(twin_t *self, const can_frame_t *frame, uint64_t now_us)
{
    for (unsigned k = 0; k < self->drives; k++) {
        if (self->kind == TWIN_DRIVES_FRAMES) {
            frame_drive_hear(&self->frame[k], frame, now_us);
        } else {
            node_hear(&self->node[k], frame, now_us);
        }
    }
}

/* The drives do not act on what it says: what heaved makes of it counts. */
static void advance_other(twin_t *self, uint64_t now_us)
{
    other_master_t *other = &self->other;
    const bool is_frames = self->kind == TWIN_DRIVES_FRAMES;
    can_frame_t frame = {.id = CIA402_RPDO + self->node[other->drive].number, .length = CIA402_COMMAND_BYTES};
    if (other->until_us == 0 || now_us < other->due_us) {
        return;
    }
    if (is_frames) {
        frame = (can_frame_t){.id = self->frame_map.axis[other->drive].command_id,
                              .is_extended = self->frame_map.is_extended,
                              .length = self->frame_map.setpoint.length};
    }
    self->out.put(self->out.ctx, &frame);
    other->due_us = now_us + OTHER_US;
    other->until_us = other->due_us <= other->until_us ? other->until_us : 0;
}

void twin_advance(twin_t *self, uint64_t now_us)
{
    unsigned enabled = 0;
    advance_other(self, now_us);
    if (self->lines != NULL) {
        lines_advance(self->lines, now_us);
    }
    for (unsigned k = 0; k < self->drives; k++) {
        enabled += advance_drive(self, k, now_us);
    }
    if (self->enabled_us == 0 && self->drives > 0 && enabled == self->drives) {
        self->enabled_us = now_us;
    }
}

uint64_t twin_due_us(const twin_t *self)
{
    uint64_t due_us = self->lines != NULL ? lines_due_us(self->lines) : DRIVE_NEVER;
    if (self->kind == TWIN_DRIVES_MODBUS) {
        const uint64_t step_us = self->node[0].drive.motor.now_us + MODBUS_STEP_US;
        return step_us < due_us ? step_us : due_us;
    }
    due_us = self->other.until_us != 0 && self->other.due_us < due_us ? self->other.due_us : due_us;
    for (unsigned k = 0; k < self->drives; k++) {
        const uint64_t node_us =
            self->kind == TWIN_DRIVES_FRAMES ? frame_drive_due_us(&self->frame[k]) : node_due_us(&self->node[k]);
        due_us = node_us < due_us ? node_us : due_us;
    }
    return due_us;
}

double twin_position(const twin_t *self, unsigned drive)
{
    return (self->node[drive].drive.motor.actual - self->zero[drive]) / self->per_unit[drive];
}

bool twin_find_pose(twin_t *self, pose_t *out)
{
    q32_t extension_mm_q32[CYLINDERS_MAX] = {0};
    for (unsigned k = 0; k < self->cylinders; k++) {
        extension_mm_q32[self->leg_of[k]] = (q32_t)(twin_position(self, k) * (double)Q32_ONE);
    }
    pose_t level;
    if (self->drives == 0) {
        return false;
    }
    memset(&level, 0, sizeof level);
    if (kin_forward(&self->kin, extension_mm_q32, &self->pose, out, NULL) != HV_OK &&
        kin_forward(&self->kin, extension_mm_q32, &level, out, NULL) != HV_OK) {
        return false;
    }
    self->pose = *out;
    return true;
}
