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

/** The devices. Those that are not in use stay zero. Offline runs press the e-stop of sim_inputs. */
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
    bool is_can_local_open; /**< a bus between programs is open, in place of CAN */
    linux_can_local_t can_local;
    canraw_map_t canraw_map;
    canraw_t canraw;
    cia402_config_t cia402_config;
    cia402_t cia402;
    linux_modbus_t coil_line;
    coil_relays_t coil_relays;
    uint8_t modbus_lines; /**< number of open lines */
    linux_modbus_t modbus_line[DRIVES_MAX];
    modbus_drive_map_t modbus_map;
    modbus_drive_t modbus_drive;
} devices_t;

/** Opens the devices that the configuration names and puts their handles into io. Does not change udp and log of io.
 *  @return HV_OK, also if a bus is not usable yet: its drives are offline until it is; HV_ERR_RANGE: a device does not accept
 *          its values; HV_ERR_IO: a device does not exist. devices_trouble() then says what is wrong. */
hv_status_t devices_open(devices_t *self, const config_t *config, gateway_io_t *io) HV_MUST_CHECK;

/** What is wrong with an open device, or with the device that could not be opened. Only for the thread that runs the drives.
 *  @return "" if nothing is wrong */
const char *devices_trouble(devices_t *self);

/** Closes all devices; does nothing for a device that is not open. Drops what a bus has not accepted yet.
 *  @param safe_mask the last mask of the relays
 *  @return false: a device hangs, and its thread may still use self */
bool devices_close(devices_t *self, uint16_t safe_mask);

/** For offline runs: opens simulated devices, whatever the configuration names. The drives are enabled, homed, and at the
 * settled extension. */
hv_status_t devices_open_settled(devices_t *self, const config_t *config, gateway_io_t *io) HV_MUST_CHECK;

#endif
