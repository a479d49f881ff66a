/* SPDX-License-Identifier: MIT
 * rig.h - the devices of a configuration: drives, relays and inputs, opened and ready for a gateway.
 * The only place that chooses backends. The caller owns rig_t, which must not move once opened.
 */
#ifndef HEAVE_APP_RIG_H
#define HEAVE_APP_RIG_H

#include "config.h"
#include "heave/gateway.h"
#include "sim_drives.h"
#include "sim_inputs.h"
#include "sim_relays.h"

/** The devices; sim_inputs is for offline runs, which press its e-stop. */
typedef struct {
    sim_drive_config_t sim_axis[DRIVES_MAX];
    sim_drives_t sim_drives;
    sim_relays_t sim_relays;
    sim_inputs_t sim_inputs;
} rig_t;

/** Opens what the configuration names and puts the handles into io (its udp and log are left alone).
 *  @return HV_OK; HV_ERR_RANGE where a simulated device does not take its figures. */
hv_status_t rig_open(rig_t *self, const config_t *config, gateway_io_t *io) HV_MUST_CHECK;

/** For offline runs: simulated devices whatever the configuration names, drives enabled, homed, at the settled extension. */
hv_status_t rig_open_settled(rig_t *self, const config_t *config, gateway_io_t *io) HV_MUST_CHECK;

#endif
