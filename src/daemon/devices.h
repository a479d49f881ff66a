/* SPDX-License-Identifier: MIT
 * devices.h - the devices of a configuration: drives, relays and inputs, opened and ready for a gateway.
 * The only place that chooses backends. The caller owns devices_t, which must not move once opened.
 */
#ifndef HEAVE_DAEMON_DEVICES_H
#define HEAVE_DAEMON_DEVICES_H

#include "config/config.h"
#include "heave/cia402.h"
#include "heave/coil_relays.h"
#include "heave/gateway.h"
#include "heave/modbus_drive.h"
#include "linux_can.h"
#include "linux_can_local.h"
#include "linux_gpio_inputs.h"
#include "linux_gpio_relays.h"
#include "linux_modbus.h"
#include "service/handover.h"
#include "sim_drives.h"
#include "sim_inputs.h"
#include "sim_relays.h"

/** The devices. What is not in use stays zero. sim_inputs is for offline runs, which press its e-stop. */
typedef struct {
    sim_drive_config_t sim_axis[DRIVES_MAX];
    sim_drives_t sim_drives;
    sim_relays_t sim_relays;
    sim_inputs_t sim_inputs;
    linux_gpio_relays_t gpio_relays;
    linux_gpio_relays_t gpio_healthy; /**< a bank of one */
    linux_gpio_inputs_t gpio_inputs;
    bool is_can_open;
    linux_can_t can;
    bool is_can_local_open; /**< instead of it: a bus between programs */
    linux_can_local_t can_local;
    canraw_map_t canraw_map;
    canraw_t canraw;
    cia402_config_t cia402_config;
    cia402_t cia402;
    linux_modbus_t coil_line;
    coil_relays_t coil_relays;
    uint8_t modbus_lines; /**< open */
    linux_modbus_t modbus_line[DRIVES_MAX];
    modbus_drive_map_t modbus_map;
    modbus_drive_t modbus_drive;
} devices_t;

/** Opens what the configuration names and puts the handles into io (its udp and log are left alone).
 *  @return HV_OK, also where a bus is not usable yet (drives are then offline until it is); HV_ERR_RANGE where a device does not
 *          take its figures; HV_ERR_IO where one is not there at all. devices_trouble() says what is wrong. */
hv_status_t devices_open(devices_t *self, const config_t *config, gateway_io_t *io) HV_MUST_CHECK;

/** What is wrong with a device of open ones, or with the one that could not be opened. The thread that runs the drives.
 *  @return "" where nothing is */
const char *devices_trouble(devices_t *self);

/** Closes; harmless on one that is not open. What a bus has not taken by now is dropped.
 *  @param safe_mask where the relays end
 *  @return false: a device hangs, and may still use self */
bool devices_close(devices_t *self, uint16_t safe_mask);

/** For offline runs: simulated devices whatever the configuration names, drives enabled, homed, at the settled extension. */
hv_status_t devices_open_settled(devices_t *self, const config_t *config, gateway_io_t *io) HV_MUST_CHECK;

#endif
