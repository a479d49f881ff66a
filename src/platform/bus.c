/* SPDX-License-Identifier: MIT
 * bus.c - what a configuration puts on its CAN bus; see bus.h.
 */
#include "platform/bus.h"

#include "platform/canraw_section.h"
#include "platform/cia402_section.h"

#define SDO_EVERY_US 20000u /* service requests while drives move: next to none */

static void add(config_bus_t *bus, bool is_extended, uint8_t bytes, uint32_t frames, uint32_t periods)
{
    HV_ASSERT(bus->count < CONFIG_BUS_ENTRIES_MAX);
    bus->entry[bus->count++] =
        (canload_entry_t){.is_extended = is_extended, .bytes = bytes, .frames = frames, .periods = periods};
}

static uint8_t longer(const canraw_frame_t *a, const canraw_frame_t *b)
{
    return a->length > b->length ? a->length : b->length;
}

/* Different identifiers: drives may share one. */
static uint32_t count_ids(const config_can_raw_t *raw, uint32_t (*id_of)(const config_can_raw_t *raw, unsigned axis),
                          uint32_t axes)
{
    uint32_t count = 0;
    for (unsigned k = 0; k < axes; k++) {
        bool is_new = true;
        for (unsigned i = 0; i < k; i++) {
            is_new = is_new && id_of(raw, i) != id_of(raw, k);
        }
        count += is_new ? 1u : 0u;
    }
    return count;
}

/* Each drive gets a set-point per period and answers a query every query_every periods: that for the position, or that for
 * homing, whichever is longer. */
static void describe_can_raw(const config_t *config, config_bus_t *bus)
{
    const config_can_raw_t *raw = &config->can_raw;
    const bool is_extended = raw->id_bits == CONFIG_ID_29_BITS;
    const bool is_asked = raw->position_query.length + raw->homing_query.length > 0;
    const uint32_t axes = config_canraw_axes(config);
    bus->section = "can-raw";
    bus->period_us = raw->period_us;
    bus->bitrate_bps = config->can.bitrate_bps;
    add(bus, is_extended, raw->setpoint.length, count_ids(raw, config_canraw_setpoint_id, axes), 1);
    if (is_asked) {
        add(bus, is_extended, longer(&raw->position_query, &raw->homing_query), axes, raw->query_every);
    }
    add(bus, is_extended, longer(&raw->position_reply, &raw->homing_reply),
        is_asked ? axes : count_ids(raw, config_canraw_reply_id, axes), raw->query_every);
    if (raw->status_reply.length > 0) {
        add(bus, is_extended, raw->status_reply.length, count_ids(raw, config_canraw_status_id, axes), raw->status_every);
    }
}

static uint32_t periods_of(uint32_t time_us, uint32_t period_us)
{
    return time_us > period_us ? time_us / period_us : 1u;
}

/* So many drives send what they send at every so manyth SYNC in the same period: all of them unless they take turns. */
static uint32_t together(const cia402_config_t *drives, uint8_t every)
{
    const bool is_in_turn = cia402_sync_start(drives, 0, every) != 0;
    return is_in_turn ? (drives->axes + every - 1u) / every : drives->axes;
}

/* Those of one kind, of all drives: a PDO of a node is that of its first axis alone. */
static void describe_pdos(const cia402_config_t *drives, unsigned which, config_bus_t *bus)
{
    uint32_t frames = 0;
    cia402_pdo_t pdo = {.entries = 0};
    for (unsigned k = 0; k < drives->axes; k++) {
        const cia402_pdo_t own = cia402_pdo(drives, k, which);
        frames += own.entries > 0;
        pdo = own.entries > 0 ? own : pdo;
    }
    if (frames > 0) {
        add(bus, false, pdo.bytes, frames < drives->axes ? frames : together(drives, pdo.every), 1);
    }
}

static uint32_t count_nodes(const cia402_config_t *drives)
{
    uint32_t count = 0;
    for (unsigned k = 0; k < drives->axes; k++) {
        count += drives->axis[k].channel == 0;
    }
    return count;
}

/* SYNC, a command and an answer of each drive per period; heartbeats of all, and a service request with its answer now and then.
 */
static void describe_cia402(const config_t *config, config_bus_t *bus)
{
    const config_cia402_t *cia402 = &config->cia402;
    cia402_config_t drives;
    config_cia402(config, &drives);
    bus->section = "cia402";
    bus->period_us = cia402->period_us;
    bus->bitrate_bps = config->can.bitrate_bps;
    add(bus, false, cia402->sync_counter != 0 ? 1 : 0, 1, 1);
    for (unsigned which = 0; which < CIA402_PDOS; which++) {
        describe_pdos(&drives, which, bus);
    }
    if (drives.is_guarded) {
        add(bus, false, 0, count_nodes(&drives), periods_of(cia402->heartbeat_ms * 1000u, cia402->period_us));
    }
    add(bus, false, 1, count_nodes(&drives) + 1u, periods_of(cia402->heartbeat_ms * 1000u, cia402->period_us));
    add(bus, false, 8, 2, periods_of(SDO_EVERY_US, cia402->period_us));
}

void config_bus_describe(const config_t *config, config_bus_t *bus)
{
    *bus = (config_bus_t){.section = NULL};
    switch (config->drives) {
    case CONFIG_DRIVES_CAN_RAW:
        describe_can_raw(config, bus);
        break;
    case CONFIG_DRIVES_CIA402:
        describe_cia402(config, bus);
        break;
    case CONFIG_DRIVES_SIM:
    case CONFIG_DRIVES_MODBUS_TCP:
    case CONFIG_DRIVES_MODBUS_RTU:
        break;
    }
}

uint32_t config_bus_load_ppm(const config_bus_t *bus)
{
    return canload_ppm(bus->entry, bus->count, bus->period_us, bus->bitrate_bps);
}

uint32_t config_bus_fitting_us(const config_bus_t *bus, uint32_t limit_ppm, uint32_t cycle_us)
{
    const uint32_t fitting_us = canload_fitting_period_us(bus->entry, bus->count, bus->bitrate_bps, limit_ppm, cycle_us);
    const int64_t most_us = config_keys[config_key_find(bus->section, "period_us")].high_milli / 1000;
    return fitting_us <= most_us ? fitting_us : 0;
}

static void check_load(config_source_t *self, const config_bus_t *bus, uint32_t cycle_us)
{
    const uint32_t load_ppm = config_bus_load_ppm(bus);
    const uint32_t fitting_us = config_bus_fitting_us(bus, CONFIG_BUS_WARNED_PPM, cycle_us);
    if (load_ppm <= CONFIG_BUS_REFUSED_PPM) {
        return;
    }
    if (fitting_us == 0) {
        config_source_key_error(self, bus->section, "period_us",
                                "the bus would be loaded by %u %% at worst, and by too much with any period; allowed: with a "
                                "higher bitrate_bps, or fewer drives on this bus",
                                (unsigned)(load_ppm / 10000u));
        return;
    }
    config_source_key_error(self, bus->section, "period_us",
                            "the bus would be loaded by %u %% at worst; allowed: at most %u %%, better %u %%, which %u us give",
                            (unsigned)(load_ppm / 10000u), CONFIG_BUS_REFUSED_PPM / 10000u, CONFIG_BUS_WARNED_PPM / 10000u,
                            (unsigned)fitting_us);
}

/* Of the periods beside it only those that the bus can carry. */
static void reject_period(config_source_t *self, const config_bus_t *bus, uint32_t cycle_us)
{
    const uint32_t below_us = bus->period_us < cycle_us ? cycle_us : bus->period_us - bus->period_us % cycle_us;
    const uint32_t least_us = config_bus_fitting_us(bus, CONFIG_BUS_REFUSED_PPM, cycle_us);
    const uint32_t first_us = below_us > least_us ? below_us : least_us;
    if (config_bus_load_ppm(bus) > CONFIG_BUS_REFUSED_PPM) {
        config_source_key_error(
            self, bus->section, "period_us",
            "is no multiple of cycle_us, and would load the bus by %u %% at worst; allowed: for instance %u or %u us",
            (unsigned)(config_bus_load_ppm(bus) / 10000u), (unsigned)first_us, (unsigned)(first_us + cycle_us));
    } else {
        config_source_key_error(self, bus->section, "period_us", "is no multiple of cycle_us; allowed: for instance %u or %u us",
                                (unsigned)first_us, (unsigned)(first_us + cycle_us));
    }
}

void config_bus_check(config_source_t *self)
{
    const uint32_t cycle_us = self->config->settings.cycle_us;
    config_bus_t bus;
    config_bus_describe(self->config, &bus);
    if (bus.section == NULL || !config_source_has_all(self, bus.section) || !config_source_has_all(self, "can") ||
        !config_source_has(self, "platform", "cycle_us") || !config_source_has(self, "platform", "kind")) {
        return;
    }
    if (bus.period_us % cycle_us != 0) {
        reject_period(self, &bus, cycle_us);
        return;
    }
    check_load(self, &bus, cycle_us);
}
