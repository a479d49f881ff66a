/* SPDX-License-Identifier: MIT
 * cia402_config.c - what a configuration of CANopen drives must keep, and the frames that it hears and sends; see cia402.h.
 */
#include "heave/cia402.h"

#include "cia402_bus.h"
#include "cia402_map.h"
#include "cia402_pdo.h"

/* Its own channel, and one below it, unless it is the first. */
static bool is_node_free(const cia402_config_t *config, unsigned k)
{
    const cia402_axis_config_t *own = &config->axis[k];
    bool has_below = own->channel == 0;
    for (unsigned i = 0; i < config->axes; i++) {
        const bool is_same = i != k && config->axis[i].node == own->node;
        if (is_same && config->axis[i].channel == own->channel) {
            return false;
        }
        has_below |= is_same && config->axis[i].channel + 1u == own->channel;
    }
    return has_below && own->channel < CIA402_CHANNELS_MAX && own->node >= 1 && own->node <= CIA402_NODE_MAX &&
           own->node != config->master_node;
}

static bool is_mode(cia402_mode_t mode)
{
    return mode == CIA402_MODE_CSP || mode == CIA402_MODE_IP || mode == CIA402_MODE_PP;
}

static bool are_modes_valid(const cia402_config_t *config)
{
    for (unsigned k = 0; k < config->axes; k++) {
        const cia402_mode_t mode = cia402_mode(config, k);
        if (!is_mode(mode) || (mode == CIA402_MODE_PP && config->answer_every > 1u)) {
            return false;
        }
    }
    return true;
}

static bool are_times_valid(const cia402_config_t *config)
{
    return cia402_is_period(config->period_us) && config->heartbeat_ms != 0 &&
           config->heartbeat_timeout_ms > config->heartbeat_ms && config->sdo_timeout_ms != 0;
}

static bool are_rates_valid(const cia402_config_t *config)
{
    const bool is_counter = config->sync_counter == 0 || (config->sync_counter >= 2 && config->sync_counter <= 240);
    const bool is_telemetry = config->telemetry == 0 || (config->telemetry_every >= 1 && config->telemetry_every <= 240);
    return is_counter && is_telemetry && config->answer_every <= CIA402_ANSWER_EVERY_MAX;
}

static bool is_axis_valid(const cia402_config_t *config, unsigned k)
{
    const cia402_axis_config_t *axis = &config->axis[k];
    return is_node_free(config, k) && counts_is_valid(&axis->scale) && axis->step_max_q32 > 0 && axis->following_max_q32 >= 0 &&
           axis->items <= CIA402_ITEMS_MAX;
}

static bool is_config_valid(const cia402_config_t *config)
{
    const char *why = NULL;
    if (config->axes < 1 || config->axes > DRIVES_MAX || config->master_node < 1 || config->master_node > CIA402_NODE_MAX) {
        return false;
    }
    if (!are_times_valid(config) || !are_rates_valid(config) || !are_modes_valid(config) || config->pdo_step > 64u ||
        (config->csp_control_bits & ~CIA402_CSP_CONTROL_BITS) != 0) {
        return false;
    }
    for (unsigned k = 0; k < config->axes; k++) {
        if (!is_axis_valid(config, k)) {
            return false;
        }
    }
    return cia402_pdos_fit(config, &why);
}

hv_status_t cia402_init(cia402_t *self, const cia402_config_t *config, hal_can_t can)
{
    if (!hal_can_valid(can)) {
        return HV_ERR_ARG;
    }
    if (!is_config_valid(config)) {
        return HV_ERR_RANGE;
    }
    *self = (cia402_t){.config = config, .can = can, .sync_count = CIA402_SYNC_FIRST};
    cia402_pdo_init(self);
    return HV_OK;
}

static uint32_t put_filter(hal_can_filter_t *filter, uint32_t id)
{
    *filter = (hal_can_filter_t){.id = id, .mask = CAN_ID_MAX};
    return 1;
}

/* What only a master sends: our own is never received, so it is another one's. */
static uint32_t put_masters(const cia402_config_t *config, hal_can_filter_t *filter)
{
    uint32_t count = 0;
    count += put_filter(&filter[count], CIA402_COB_NMT);
    count += put_filter(&filter[count], CIA402_COB_SYNC);
    count += put_filter(&filter[count], CIA402_COB_HEARTBEAT + config->master_node);
    for (unsigned k = 0; k < config->axes; k++) {
        for (unsigned i = CIA402_COMMAND; i < CIA402_ANSWER; i++) {
            const cia402_pdo_t pdo = cia402_pdo(config, k, i);
            count += pdo.entries > 0 ? put_filter(&filter[count], pdo.id) : 0;
        }
    }
    return count;
}

uint32_t cia402_filters(const cia402_config_t *config, hal_can_filter_t filter[CIA402_FILTERS_MAX])
{
    static const uint32_t k_functions[] = {CIA402_COB_SYNC, CIA402_COB_SDO_ANSWER, CIA402_COB_HEARTBEAT};
    uint32_t count = put_masters(config, filter);
    for (unsigned k = 0; k < config->axes; k++) {
        for (size_t i = 0; i < sizeof k_functions / sizeof k_functions[0] && config->axis[k].channel == 0; i++) {
            count += put_filter(&filter[count], k_functions[i] + config->axis[k].node);
        }
        for (uint32_t i = 0; i < CIA402_COB_RPDOS && config->axis[k].channel == 0; i++) { /* of another master */
            count += put_filter(&filter[count], CIA402_COB_RPDO + i * CIA402_COB_NEXT + config->axis[k].node);
        }
        for (unsigned i = CIA402_ANSWER; i < CIA402_PDOS; i++) {
            const cia402_pdo_t pdo = cia402_pdo(config, k, i);
            count += pdo.entries > 0 ? put_filter(&filter[count], pdo.id) : 0;
        }
    }
    return count;
}

uint32_t cia402_owns(const cia402_config_t *config, hal_can_filter_t filter[CIA402_OWNS_MAX])
{
    uint32_t count = put_masters(config, filter);
    for (unsigned k = 0; k < config->axes; k++) {
        if (config->axis[k].channel == 0) {
            count += put_filter(&filter[count], CIA402_COB_SDO_REQUEST + config->axis[k].node);
            count += config->is_guarded ? put_filter(&filter[count], CIA402_COB_HEARTBEAT + config->axis[k].node) : 0;
        }
    }
    return count;
}
