/* SPDX-License-Identifier: MIT
 * cia402_map.c - the PDOs and their contents; see cia402_map.h.
 * The axes of a node share its four identifiers in each direction: first the commands (answers) of every channel, then the
 * telemetry of each. The PDO records of a channel follow those of the channel before at a fixed distance (pdo_step).
 */
#include "cia402_map.h"

#define IDENTIFIERS  4u /* of a node, in each direction */
#define RECORDS_RPDO 0x1400u
#define RECORDS_TPDO 0x1800u
#define STEP         64u

static const struct {
    uint32_t entry;
    uint8_t bit; /* of cia402_config_t.telemetry */
} k_values[] = {
    {CIA402_ENTRY_TORQUE, DRIVE_HAS_TORQUE},
    {CIA402_ENTRY_LAG, DRIVE_HAS_LAG},
    {CIA402_ENTRY_INPUTS, DRIVE_HAS_INPUTS},
};

/* --- Nodes and channels --- */

cia402_mode_t cia402_mode(const cia402_config_t *config, unsigned axis)
{
    const uint8_t own = config->axis[axis].mode;
    return own != 0 ? (cia402_mode_t)own : config->mode;
}

uint16_t cia402_plain_index(uint16_t index)
{
    return (uint16_t)(cia402_map_plain((uint32_t)index << 16) >> 16);
}

static unsigned axis_at(const cia402_config_t *config, uint8_t node, unsigned channel)
{
    for (unsigned k = 0; k < config->axes; k++) {
        if (config->axis[k].node == node && config->axis[k].channel == channel) {
            return k;
        }
    }
    return config->axes;
}

unsigned cia402_axis_of(const cia402_config_t *config, uint8_t node, uint32_t entry)
{
    return axis_at(config, node, cia402_map_channel(entry));
}

static unsigned channels_of(const cia402_config_t *config, uint8_t node)
{
    unsigned count = 0;
    for (unsigned k = 0; k < config->axes; k++) {
        count += config->axis[k].node == node;
    }
    return count;
}

static unsigned step_of(const cia402_config_t *config)
{
    return config->pdo_step != 0 ? config->pdo_step : STEP;
}

/* --- Which PDOs there are --- */

/* PDOs of the whole node have objects of several channels. */
bool cia402_map_is_shared(const cia402_maps_t *maps)
{
    for (unsigned i = 0; i < maps->count; i++) {
        for (unsigned n = 0; n < maps->map[i].entries; n++) {
            if (cia402_map_channel(maps->map[i].entry[n]) > 0) {
                return true;
            }
        }
    }
    return false;
}

static cia402_map_t usual_map(const cia402_config_t *config, unsigned axis, bool is_answer)
{
    const uint32_t target = cia402_mode(config, axis) == CIA402_MODE_IP ? CIA402_ENTRY_TARGET_IP : CIA402_ENTRY_TARGET;
    if (is_answer) {
        return (cia402_map_t){
            .number = 1, .entry = {CIA402_ENTRY_STATUSWORD, CIA402_ENTRY_ACTUAL, CIA402_ENTRY_MODE_SHOWN}, .entries = 3};
    }
    return (cia402_map_t){.number = 1, .entry = {CIA402_ENTRY_CONTROLWORD, target}, .entries = 2};
}

/* So many PDOs of a direction has each channel. */
unsigned cia402_map_count(const cia402_maps_t *maps)
{
    return maps->count != 0 ? maps->count : 1u;
}

/* What fits into the n-th TPDO of telemetry. */
static cia402_map_t telemetry_map(const cia402_config_t *config, unsigned pdo)
{
    cia402_map_t out = {.entries = 0};
    unsigned at = 0;
    unsigned bytes = 0;
    for (unsigned i = 0; i < sizeof k_values / sizeof k_values[0]; i++) {
        if ((config->telemetry & k_values[i].bit) == 0) {
            continue;
        }
        if (bytes + CIA402_BYTES_OF(k_values[i].entry) > CIA402_PDO_BYTES) {
            if (at == pdo) {
                return out;
            }
            at++;
            bytes = 0;
            out = (cia402_map_t){.entries = 0};
        }
        out.entry[out.entries++] = k_values[i].entry;
        bytes += CIA402_BYTES_OF(k_values[i].entry);
    }
    return at == pdo ? out : (cia402_map_t){.entries = 0};
}

static unsigned telemetries_of(const cia402_config_t *config)
{
    unsigned count = 0;
    for (unsigned i = 0; i < CIA402_TELEMETRY_PDOS; i++) {
        count += telemetry_map(config, i).entries > 0;
    }
    return count;
}

/* The n-th TPDO that no answer has. */
static uint16_t free_number(const cia402_maps_t *answers, unsigned n)
{
    uint16_t number = 0;
    for (unsigned found = 0; found <= n;) {
        number++;
        bool is_free = answers->count != 0 || number != 1u;
        for (unsigned i = 0; i < answers->count; i++) {
            is_free = is_free && answers->map[i].number != number;
        }
        found += is_free;
    }
    return number;
}

uint8_t cia402_answer_every(const cia402_config_t *config)
{
    return config->answer_every > 1u ? config->answer_every : 1u;
}

uint8_t cia402_sync_start(const cia402_config_t *config, unsigned axis, uint8_t every)
{
    const bool is_even = every > 1u && config->sync_counter != 0 && config->sync_counter % every == 0;
    return is_even ? (uint8_t)(axis % every + 1u) : 0;
}

static cia402_pdo_t describe(const cia402_config_t *config, unsigned axis, const cia402_map_t *map, unsigned slot, bool is_answer)
{
    const cia402_axis_config_t *own = &config->axis[axis];
    const uint32_t first = is_answer ? CIA402_COB_TPDO : CIA402_COB_RPDO;
    cia402_pdo_t out = {
        .entries = map->entries,
        .every = 1,
        .record = (uint16_t)((is_answer ? RECORDS_TPDO : RECORDS_RPDO) + map->number - 1u + own->channel * step_of(config)),
        .id = (uint16_t)(first + CIA402_COB_NEXT * slot + own->node)};
    for (unsigned i = 0; i < map->entries; i++) {
        const bool is_object = map->entry[i] >> 16 >= CIA402_OBJECTS;
        out.entry[i] = map->entry[i] + (is_object ? own->channel * CIA402_CHANNEL << 16 : 0);
        out.bytes = (uint8_t)(out.bytes + CIA402_BYTES_OF(map->entry[i]));
    }
    return out;
}

/* A command or an answer. */
static cia402_pdo_t listed(const cia402_config_t *config, unsigned axis, unsigned n, bool is_answer)
{
    const cia402_maps_t *maps = is_answer ? &config->answers : &config->commands;
    const uint8_t channel = config->axis[axis].channel;
    const bool is_of_node = cia402_map_is_shared(maps);
    if (n >= cia402_map_count(maps) || (is_of_node && channel > 0)) {
        return (cia402_pdo_t){.entries = 0};
    }
    const cia402_map_t map = maps->count != 0 ? maps->map[n] : usual_map(config, axis, is_answer);
    cia402_pdo_t out = describe(config, axis, &map, channel * cia402_map_count(maps) + n, is_answer);
    out.is_fixed = maps->count != 0 && config->are_maps_fixed;
    out.deadline_ms = is_answer ? 0 : config->rpdo_deadline_ms;
    return out;
}

/* Where the answers are of the whole node, so are the TPDOs of telemetry: the other axes may have no PDOs. */
static cia402_pdo_t telemetry(const cia402_config_t *config, unsigned axis, unsigned n)
{
    const cia402_axis_config_t *own = &config->axis[axis];
    const bool is_of_node = cia402_map_is_shared(&config->answers);
    cia402_map_t map = telemetry_map(config, n);
    if (map.entries == 0) {
        return (cia402_pdo_t){.entries = 0};
    }
    const unsigned answering = is_of_node ? 1u : channels_of(config, own->node);
    const unsigned place = own->channel * telemetries_of(config) + n;
    map.number = free_number(&config->answers, is_of_node ? place : n);
    cia402_pdo_t out = describe(config, axis, &map, answering * cia402_map_count(&config->answers) + place, true);
    out.record = (uint16_t)(is_of_node ? RECORDS_TPDO + map.number - 1u : out.record);
    out.every = config->telemetry_every;
    out.start = cia402_sync_start(config, axis, out.every);
    return out;
}

cia402_pdo_t cia402_pdo(const cia402_config_t *config, unsigned axis, unsigned which)
{
    if (which >= CIA402_TELEMETRY) {
        return telemetry(config, axis, which - CIA402_TELEMETRY);
    }
    if (which < CIA402_ANSWER) {
        return listed(config, axis, which, false);
    }
    cia402_pdo_t out = listed(config, axis, which - CIA402_ANSWER, true);
    out.every = cia402_answer_every(config);
    out.start = cia402_sync_start(config, axis, out.every);
    return out;
}

/* --- Whether they fit --- */

/* How often an entry is in the PDOs of a direction, of any channel. */
static unsigned count_entry(const cia402_config_t *config, unsigned axis, bool is_answer, uint32_t entry)
{
    const cia402_maps_t *maps = is_answer ? &config->answers : &config->commands;
    const unsigned channel = cia402_map_is_shared(maps) ? config->axis[axis].channel : 0;
    unsigned count = 0;
    for (unsigned i = 0; i < maps->count; i++) {
        for (unsigned n = 0; n < maps->map[i].entries; n++) {
            const uint32_t mapped = maps->map[i].entry[n];
            count += cia402_map_channel(mapped) == channel && cia402_map_plain(mapped) == entry;
        }
    }
    return maps->count != 0 ? count : 1u;
}

/* Nothing behind the end of a list is looked at, and the fields of a PDO are counted by what follows. */
static bool are_counted(const cia402_maps_t *maps)
{
    if (maps->count > CIA402_MAPS_MAX) {
        return false;
    }
    for (unsigned i = 0; i < maps->count; i++) {
        if (maps->map[i].entries > CIA402_PDO_ENTRIES) {
            return false;
        }
    }
    return true;
}

static bool are_whole(const cia402_maps_t *maps)
{
    if (!are_counted(maps)) {
        return false;
    }
    for (unsigned i = 0; i < maps->count; i++) {
        unsigned bits = 0;
        for (unsigned n = 0; n < maps->map[i].entries; n++) {
            bits += CIA402_BITS_OF(maps->map[i].entry[n]);
            if (CIA402_BITS_OF(maps->map[i].entry[n]) == 0 || CIA402_BITS_OF(maps->map[i].entry[n]) % 8u != 0) {
                return false;
            }
        }
        if (bits == 0 || bits > 8u * CIA402_PDO_BYTES || maps->map[i].number < 1u ||
            maps->map[i].number > CIA402_PDO_NUMBER_MAX) {
            return false;
        }
    }
    return true;
}

/* Numbers that differ, within the records of a channel where there are several. */
static bool are_numbers_fine(const cia402_config_t *config, const cia402_maps_t *maps, unsigned most, unsigned telemetries)
{
    for (unsigned i = 0; i < maps->count; i++) {
        for (unsigned n = 0; n < i; n++) {
            if (maps->map[i].number == maps->map[n].number) {
                return false;
            }
        }
        if (maps->map[i].number > most) {
            return false;
        }
    }
    return telemetries == 0 || free_number(&config->answers, telemetries - 1u) <= most;
}

static const char *misfit_of(const cia402_config_t *config, unsigned axis)
{
    const bool is_ip = cia402_mode(config, axis) == CIA402_MODE_IP;
    const unsigned channels = channels_of(config, config->axis[axis].node);
    const unsigned commands = (cia402_map_is_shared(&config->commands) ? 1u : channels) * cia402_map_count(&config->commands);
    const unsigned answers = (cia402_map_is_shared(&config->answers) ? 1u : channels) * cia402_map_count(&config->answers);
    const unsigned most = channels > 1u ? step_of(config) : CIA402_PDO_NUMBER_MAX;
    const unsigned telemetry_pdos = (cia402_map_is_shared(&config->answers) ? channels : 1u) * telemetries_of(config);
    if (count_entry(config, axis, false, CIA402_ENTRY_CONTROLWORD) != 1u ||
        count_entry(config, axis, false, is_ip ? CIA402_ENTRY_TARGET_IP : CIA402_ENTRY_TARGET) != 1u) {
        return "the commands of each axis need 6040h with 16 bits and 607Ah (mode ip: 60C1h:01) with 32, each once";
    }
    if (count_entry(config, axis, true, CIA402_ENTRY_STATUSWORD) == 0 ||
        count_entry(config, axis, true, CIA402_ENTRY_ACTUAL) != 1u) {
        return "the answers of each axis need 6041h with 16 bits, and 6064h with 32, once";
    }
    if (commands > IDENTIFIERS || answers + channels * telemetries_of(config) > IDENTIFIERS) {
        return "a node has four identifiers for commands, and four for answers and telemetry";
    }
    return are_numbers_fine(config, &config->commands, most, telemetry_pdos) &&
                   are_numbers_fine(config, &config->answers, most, telemetry_pdos)
               ? NULL
               : "PDOs of a node need different numbers, and those of a channel are below pdo_step of the next";
}

bool cia402_pdos_fit(const cia402_config_t *config, const char **why)
{
    *why = are_whole(&config->commands) && are_whole(&config->answers) ? NULL : "a PDO has 1 to 8 whole bytes";
    for (unsigned k = 0; k < config->axes && *why == NULL; k++) {
        *why = misfit_of(config, k);
    }
    return *why == NULL;
}

bool cia402_map_has_mode(const cia402_config_t *config)
{
    for (unsigned k = 0; k < config->axes; k++) {
        if (count_entry(config, k, true, CIA402_ENTRY_MODE_SHOWN) == 0) {
            return false;
        }
    }
    return true;
}
