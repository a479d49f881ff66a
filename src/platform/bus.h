/* SPDX-License-Identifier: MIT
 * bus.h - what a configuration puts on its CAN bus.
 */
#ifndef HEAVE_PLATFORM_BUS_H
#define HEAVE_PLATFORM_BUS_H

#include "config/source.h"
#include "heave/canload.h"

/** Load that is refused, and load that is warned of, in millionths: above, a late frame makes the next ones late too. */
#define CONFIG_BUS_REFUSED_PPM 900000u
#define CONFIG_BUS_WARNED_PPM  600000u

#define CONFIG_BUS_ENTRIES_MAX 13u

/** The frames of a bus. */
typedef struct {
    const char *section; /**< whose key period_us is; NULL: there is no CAN bus, nothing else counts */
    uint32_t period_us;
    uint32_t bitrate_bps;
    size_t count;
    canload_entry_t entry[CONFIG_BUS_ENTRIES_MAX];
} config_bus_t;

/** The bus of the drives in use. */
void config_bus_describe(const config_t *config, config_bus_t *bus);

/** Worst case, in millionths of the bit rate. */
uint32_t config_bus_load_ppm(const config_bus_t *bus);

/** Shortest period, a multiple of the motion cycle, with no more than this load; 0 where there is none, or where its key takes
 * none so long. */
uint32_t config_bus_fitting_us(const config_bus_t *bus, uint32_t limit_ppm, uint32_t cycle_us);

/** Refuses a period that is no multiple of the cycle, and a load that the bus cannot carry; reports into self. */
void config_bus_check(config_source_t *self);

#endif
