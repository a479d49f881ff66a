/* SPDX-License-Identifier: MIT
 * lines.h - the GPIO lines of a configuration as the world on their other side: switches that are opened and closed, relays and a
 * healthy pulse that are looked at. The chips are the kernel's simulated ones. Time is an argument, us.
 */
#ifndef HEAVE_TWIN_LINES_H
#define HEAVE_TWIN_LINES_H

#include <stdio.h>

#include "config/config.h"
#include "twin/sim_chip.h"

/** Switches, by the keys of [inputs]. */
typedef enum { SWITCH_ESTOP, SWITCH_ENABLE, SWITCH_RESET, SWITCH_ESTOP2, SWITCH_POWER, SWITCHES } switch_t;

/** Who has lines. */
typedef enum { LINES_RELAYS, LINES_INPUTS, LINES_HEALTHY, LINES_SECTIONS } lines_section_t;

#define LINES_MAX     (CONFIG_RELAYS_MAX + (unsigned)SWITCHES + 1u)
#define LINES_WHY_MAX 480u

/** A line. */
typedef struct {
    lines_section_t section;
    unsigned number;  /**< relay, from 0, or switch_t */
    const char *name; /**< points into the configuration */
    bool is_named;    /**< else the name is its number */
    unsigned chip;    /**< index */
    unsigned offset;
    bool is_active_low;
    bool is_closed; /**< switches */
    int fd;         /**< shows its level; -1 = not now */
} line_t;

/** All of them. */
typedef struct {
    unsigned count;
    line_t line[LINES_MAX];
    unsigned chips;
    const char *label[LINES_SECTIONS];
    unsigned size[LINES_SECTIONS]; /**< lines of each chip */
    sim_chip_t chip[LINES_SECTIONS];
    int pulse;          /**< last level of the healthy pulse */
    uint64_t pulse_us;  /**< when it was last seen to change */
    uint64_t looked_us; /**< when lines were last looked at */
} lines_t;

/** Which lines a configuration has, and where on which chip they will be; touches nothing. A healthy machine: e-stop, supply and
 *  key closed, the button open. */
void lines_plan(lines_t *self, const config_t *config);

/** Whether it has that switch, lines of that section. */
bool lines_has_switch(const lines_t *self, switch_t which);
bool lines_has_section(const lines_t *self, lines_section_t section);

/** Makes the chips and plugs them. False where that cannot be, or this machine has the lines already: why says what to do. */
bool lines_open(lines_t *self, const config_t *config, uint64_t now_us, char why[LINES_WHY_MAX]);

/** Takes them away; harmless where there are none. */
void lines_close(lines_t *self);

/** Opens or closes a switch. */
void lines_switch(lines_t *self, switch_t which, bool is_closed);

/** The chip that has the lines of a section goes, or comes back. */
bool lines_plug(lines_t *self, lines_section_t section, bool is_live, char *why, size_t size);

/** Looks: a closed switch wins over the resistor that its reader asks for; the pulse is watched. */
void lines_advance(lines_t *self, uint64_t now_us);

/** When it wants to look next; UINT64_MAX: never. */
uint64_t lines_due_us(const lines_t *self);

/** Appends members of a JSON object: `, "switches": {...}, "relays": [...], "healthy": {...}`, of what there is.
 *  @return characters, as snprintf */
size_t lines_status(const lines_t *self, uint64_t now_us, char *out, size_t size);

/** Says which lines are on which chip. */
void lines_describe(const lines_t *self, FILE *out);

/** `estop`, `relays`, ... */
const char *lines_switch_name(switch_t which);
const char *lines_section_name(lines_section_t section);

#endif
