/* SPDX-License-Identifier: MIT
 * devices.c - the devices of a configuration; see devices.h.
 */
#include "daemon/devices.h"

#include <time.h>

#include "platform/canraw_section.h"
#include "platform/cia402_section.h"
#include "platform/coils.h"
#include "platform/modbus_section.h"
#include "daemon/gpio_setup.h"
#include "inspect/modbus_line.h"

#define LEAVE_NS      5000000          /* seven frames, even at 125 kbit/s */
#define LEAVE_POLL_NS 1000000          /* between looks whether drives have taken what stops them */
#define LEAVE_POLLS   6000u            /* more than a quick stop takes */
#define COIL_LOOK_US  1000000u         /* a board of relays is looked at so often */
#define RUN_DIR       "/run/heave-can" /* where heave-can-flush@.path looks */

#define ANGLE_TRAVEL_DEG 1000000 /* a rotation motor has no stops of its own */

static void describe_cylinder(sim_drive_config_t *self, const config_t *config, unsigned i)
{
    const q16_t asked_q16 = config->sim.start_extension_mm_q16;
    const q16_t start_q16 = asked_q16 == CONFIG_NONE ? config->settings.settled_extension_mm_q16 : asked_q16;
    *self = (sim_drive_config_t){
        .travel_max_q32 = q32_from_q16(config->settings.stroke_mm_q16[i]),
        .start_q32 = q32_from_q16(start_q16),
        .time_constant_us = config->sim.lag_ms * 1000,
        .enable_us = config->sim.enable_delay_ms * 1000,
        .homing_per_s_q32 = q32_from_q16(config->settings.engage_speed_mm_s_q16),
        .is_homed = config->sim.is_homed,
    };
    if (!self->is_homed) {
        self->unhomed_offset_q32 = -self->start_q32; /* it counts from where it was switched on */
    }
}

static void describe_angle(sim_drive_config_t *self, const config_t *config)
{
    *self = (sim_drive_config_t){
        .travel_min_q32 = q32_from_int(-ANGLE_TRAVEL_DEG),
        .travel_max_q32 = q32_from_int(ANGLE_TRAVEL_DEG),
        .time_constant_us = config->sim.lag_ms * 1000,
        .enable_us = config->sim.enable_delay_ms * 1000,
        .is_homed = config->sim.is_homed,
    };
}

/* Describes every axis and tells how many there are. */
static uint8_t describe(devices_t *self, const config_t *config)
{
    const uint8_t cylinders = config->settings.geometry.kind == KIN_HEXAPOD ? 6 : 3;
    for (unsigned i = 0; i < cylinders; i++) {
        describe_cylinder(&self->sim_axis[i], config, i);
    }
    describe_angle(&self->sim_axis[cylinders], config);
    return (uint8_t)(cylinders + (config->settings.has_angle ? 1 : 0));
}

static uint32_t inputs_present(const config_inputs_t *inputs)
{
    return (inputs->estop_line.text[0] != '\0' ? INPUT_ESTOP : 0u) | (inputs->enable_line.text[0] != '\0' ? INPUT_ENABLE : 0u) |
           (inputs->reset_line.text[0] != '\0' ? INPUT_RESET : 0u) | (inputs->estop2_line.text[0] != '\0' ? INPUT_ESTOP2 : 0u) |
           (inputs->power_line.text[0] != '\0' ? INPUT_POWER : 0u);
}

static hv_status_t open_sim(devices_t *self, const config_t *config, uint8_t axes, uint32_t inputs, gateway_io_t *io)
{
    sim_relays_init(&self->sim_relays, config->settings.relays.count);
    sim_inputs_init(&self->sim_inputs, inputs);
    io->drives = sim_drives_hal(&self->sim_drives);
    io->relays = sim_relays_hal(&self->sim_relays);
    io->inputs = sim_inputs_hal(&self->sim_inputs);
    return sim_drives_init(&self->sim_drives, axes, self->sim_axis, NULL, 0);
}

static hal_can_t can_hal(devices_t *self)
{
    return self->is_can_local_open ? linux_can_local_hal(&self->can_local) : linux_can_hal(&self->can);
}

/* The interface, for these identifiers and no others. One that is not usable yet is restarted by the driver. */
static hv_status_t open_can(devices_t *self, const char *interface, const hal_can_filter_t *filter, uint32_t filters,
                            const hal_can_filter_t *own, uint32_t owns)
{
    if (linux_can_local_is(interface)) {
        const hv_status_t status = linux_can_local_open(&self->can_local, interface);
        self->is_can_local_open = true;
        return status == HV_OK || status == HV_ERR_AGAIN ? HV_OK : HV_ERR_IO;
    }
    const linux_can_config_t can = {
        .interface = interface, .filter = filter, .filters = filters, .own = own, .owns = owns, .run_dir = RUN_DIR};
    const hv_status_t status = linux_can_open(&self->can, &can);
    self->is_can_open = true;
    return status == HV_OK || status == HV_ERR_AGAIN ? HV_OK : HV_ERR_IO;
}

static hv_status_t open_can_raw(devices_t *self, const config_t *config, gateway_io_t *io)
{
    hal_can_filter_t filter[CANRAW_FILTERS_MAX];
    hal_can_filter_t own[CANRAW_OWNS_MAX];
    config_canraw_map(config, &self->canraw_map);
    const uint32_t count = canraw_filters(&self->canraw_map, filter);
    const uint32_t owns = canraw_owns(&self->canraw_map, own);
    const hv_status_t status = open_can(self, config->can.interface, filter, count, own, owns);
    io->drives = canraw_hal(&self->canraw);
    return status == HV_OK ? canraw_init(&self->canraw, &self->canraw_map, can_hal(self)) : status;
}

static hv_status_t open_cia402(devices_t *self, const config_t *config, gateway_io_t *io)
{
    hal_can_filter_t filter[CIA402_FILTERS_MAX];
    hal_can_filter_t own[CIA402_OWNS_MAX];
    config_cia402(config, &self->cia402_config);
    const uint32_t filters = cia402_filters(&self->cia402_config, filter);
    const uint32_t owns = cia402_owns(&self->cia402_config, own);
    const hv_status_t status = open_can(self, config->can.interface, filter, filters, own, owns);
    io->drives = cia402_hal(&self->cia402);
    return status == HV_OK ? cia402_init(&self->cia402, &self->cia402_config, can_hal(self)) : status;
}

/* The board has a line of its own, so that it waits for no drive and no drive for it. */
static hv_status_t open_coils(devices_t *self, const config_t *config, gateway_io_t *io)
{
    const config_relays_modbus_t *board = &config->relays_modbus;
    const linux_modbus_config_t modbus = modbus_line_of_relays(board);
    const hv_status_t status = linux_modbus_open(&self->coil_line, &modbus);
    if (status != HV_OK) {
        return status == HV_ERR_ARG ? HV_ERR_RANGE : HV_ERR_IO;
    }
    const coil_relays_config_t relays = {.line = linux_modbus_hal(&self->coil_line),
                                         .unit = (uint8_t)board->unit,
                                         .first_coil = config_coils_first(config),
                                         .count = config->relays.lines.count,
                                         .is_active_low = config->relays.is_active_low,
                                         .start_mask = config->settings.relay_safe_mask,
                                         .look_calls = COIL_LOOK_US / config->settings.cycle_us};
    io->relays = coil_relays_hal(&self->coil_relays);
    return coil_relays_init(&self->coil_relays, &relays);
}

/* Relays first: from here on they are at the safe mask. */
static hv_status_t open_relays(devices_t *self, const config_t *config, gateway_io_t *io)
{
    if (config->relays.driver == CONFIG_RELAYS_SIM) {
        return HV_OK;
    }
    if (config->relays.driver == CONFIG_RELAYS_MODBUS) {
        return open_coils(self, config, io);
    }
    const linux_gpio_relays_config_t relays = gpio_setup_relays(config);
    io->relays = linux_gpio_relays_hal(&self->gpio_relays);
    return linux_gpio_relays_open(&self->gpio_relays, &relays);
}

static hv_status_t open_healthy(devices_t *self, const config_t *config, gateway_io_t *io)
{
    if (config->healthy.driver != CONFIG_HEALTHY_GPIO) {
        return HV_OK;
    }
    const linux_gpio_relays_config_t line = gpio_setup_healthy(config);
    io->healthy = linux_gpio_relays_hal(&self->gpio_healthy);
    return linux_gpio_relays_open(&self->gpio_healthy, &line);
}

static hv_status_t open_inputs(devices_t *self, const config_t *config, gateway_io_t *io)
{
    if (config->inputs.driver != CONFIG_INPUTS_GPIO) {
        return HV_OK;
    }
    const linux_gpio_inputs_config_t inputs = gpio_setup_inputs(config);
    io->inputs = linux_gpio_inputs_hal(&self->gpio_inputs);
    return linux_gpio_inputs_open(&self->gpio_inputs, &inputs);
}

/* A line of Modbus drives: the host of one drive, or of all; or the serial port. */
/* A line that cannot be opened stays last, so that it can say why. */
static hv_status_t open_modbus(devices_t *self, const config_t *config, gateway_io_t *io)
{
    hal_modbus_t line[DRIVES_MAX] = {{NULL, NULL}};
    config_modbus_map(config, &self->modbus_map);
    for (unsigned i = 0; i < config_modbus_lines(config); i++) {
        const linux_modbus_config_t modbus = modbus_line_of_drives(config, i);
        const hv_status_t status = linux_modbus_open(&self->modbus_line[i], &modbus);
        self->modbus_lines++;
        if (status != HV_OK) {
            return status == HV_ERR_ARG ? HV_ERR_RANGE : HV_ERR_IO;
        }
        line[i] = linux_modbus_hal(&self->modbus_line[i]);
    }
    io->drives = modbus_drive_hal(&self->modbus_drive);
    return modbus_drive_init(&self->modbus_drive, &self->modbus_map, line);
}

hv_status_t devices_open(devices_t *self, const config_t *config, gateway_io_t *io)
{
    const uint8_t axes = describe(self, config);
    hv_status_t status = open_sim(self, config, axes, inputs_present(&config->inputs), io);
    status = status == HV_OK ? open_relays(self, config, io) : status;
    status = status == HV_OK ? open_inputs(self, config, io) : status;
    status = status == HV_OK ? open_healthy(self, config, io) : status;
    if (status != HV_OK) {
        return status;
    }
    switch (config->drives) {
    case CONFIG_DRIVES_SIM:
        return HV_OK;
    case CONFIG_DRIVES_CIA402:
        return open_cia402(self, config, io);
    case CONFIG_DRIVES_CAN_RAW:
        return open_can_raw(self, config, io);
    case CONFIG_DRIVES_MODBUS_TCP:
    case CONFIG_DRIVES_MODBUS_RTU:
        return open_modbus(self, config, io);
    }
    return HV_ERR_RANGE;
}

const char *devices_trouble(devices_t *self)
{
    if (self->gpio_relays.error_text[0] != '\0') {
        return self->gpio_relays.error_text;
    }
    if (self->gpio_healthy.error_text[0] != '\0') {
        return self->gpio_healthy.error_text;
    }
    if (self->gpio_inputs.error_text[0] != '\0') {
        return self->gpio_inputs.error_text;
    }
    const char *text = self->is_can_open ? self->can.error_text : self->is_can_local_open ? self->can_local.error_text : "";
    for (unsigned i = 0; i < self->modbus_lines && text[0] == '\0'; i++) {
        text = linux_modbus_text(&self->modbus_line[i]);
    }
    return text[0] == '\0' && self->coil_line.is_open ? linux_modbus_text(&self->coil_line) : text;
}

/* What stops the drives may be several writes or frames: the driver goes on until all have taken it, or do not answer. */
static void leave(drives_t drives, uint64_t now_us)
{
    const struct timespec pause = {.tv_nsec = LEAVE_POLL_NS};
    drive_feedback_t feedback[DRIVES_MAX];
    for (unsigned i = 0; i < LEAVE_POLLS && drives_is_stopping(drives); i++) {
        (void)nanosleep(&pause, NULL);
        now_us += LEAVE_POLL_NS / 1000;
        (void)!drives_poll(drives, now_us, feedback);
    }
}

static void close_modbus(devices_t *self)
{
    if (self->modbus_drive.map != NULL) {
        leave(modbus_drive_hal(&self->modbus_drive), self->modbus_drive.now_us);
    }
    for (unsigned i = 0; i < self->modbus_lines; i++) {
        linux_modbus_close(&self->modbus_line[i]);
    }
    self->modbus_lines = 0;
}

/* The last frames get their time on the wire: closing drops what waits. */
static void leave_cia402(devices_t *self)
{
    const struct timespec pause = {.tv_nsec = LEAVE_NS};
    cia402_leave(&self->cia402);
    (void)nanosleep(&pause, NULL);
}

/* Closing the line serves what waits. */
static void close_coils(devices_t *self, uint16_t safe_mask)
{
    if (self->coil_relays.config.line.ops != NULL) {
        (void)!hal_relays_write(coil_relays_hal(&self->coil_relays), safe_mask);
    }
    linux_modbus_close(&self->coil_line);
}

bool devices_close(devices_t *self, uint16_t safe_mask)
{
    bool has_ended = linux_gpio_relays_close(&self->gpio_healthy, 0);
    has_ended = linux_gpio_relays_close(&self->gpio_relays, safe_mask) && has_ended;
    has_ended = linux_gpio_inputs_close(&self->gpio_inputs) && has_ended;
    close_coils(self, safe_mask);
    close_modbus(self);
    if (self->canraw.map != NULL) {
        leave(canraw_hal(&self->canraw), self->canraw.now_us);
    }
    if ((self->is_can_open || self->is_can_local_open) && self->cia402.config != NULL) {
        leave_cia402(self);
    }
    if (self->is_can_open) {
        linux_can_close(&self->can);
        self->is_can_open = false;
    }
    if (self->is_can_local_open) {
        linux_can_local_close(&self->can_local);
        self->is_can_local_open = false;
    }
    return has_ended;
}

hv_status_t devices_open_settled(devices_t *self, const config_t *config, gateway_io_t *io)
{
    const uint8_t axes = describe(self, config);
    for (unsigned i = 0; i < axes; i++) {
        sim_drive_config_t *axis = &self->sim_axis[i];
        const bool is_cylinder = i < (config->settings.geometry.kind == KIN_HEXAPOD ? 6u : 3u);
        axis->start_q32 = is_cylinder ? q32_from_q16(config->settings.settled_extension_mm_q16) : 0;
        axis->unhomed_offset_q32 = 0;
        axis->is_homed = true;
        axis->is_enabled = true;
    }
    return open_sim(self, config, axes, inputs_present(&config->inputs) | INPUT_ESTOP, io);
}
