/* SPDX-License-Identifier: MIT
 * line_faults.c - what faults mean on GPIO lines; see line_faults.h. Numbers of a fault: state or section, and the switch.
 */
#include "twin/line_faults.h"

#include <stdio.h>
#include <string.h>

bool line_fault_read_state(const char *word, double *out, char why[FAULT_WHY_MAX])
{
    const bool is_closed = strcmp(word, "closed") == 0;
    if (!is_closed && strcmp(word, "open") != 0) {
        (void)snprintf(why, FAULT_WHY_MAX, "%s is no state of a switch: open or closed", word);
        return false;
    }
    *out = is_closed ? 1 : 0;
    return true;
}

bool line_fault_read_section(const char *word, double *out, char why[FAULT_WHY_MAX])
{
    for (lines_section_t section = LINES_RELAYS; section < LINES_SECTIONS; section++) {
        if (strcmp(word, lines_section_name(section)) == 0) {
            *out = section;
            return true;
        }
    }
    (void)snprintf(why, FAULT_WHY_MAX, "%s is no section with GPIO lines: relays, inputs or healthy", word);
    return false;
}

bool line_fault_is(bus_fault_t kind)
{
    return kind == BUS_SWITCH || kind == BUS_CHIP_GONE || kind == BUS_CHIP_BACK;
}

bool line_fault_suits(const fault_t *fault, bus_fault_t kind, const lines_t *lines)
{
    return lines != NULL && (kind == BUS_SWITCH ? lines_has_switch(lines, (switch_t)fault->number[1])
                                                : lines_has_section(lines, (lines_section_t)fault->number[0]));
}

bool line_fault_do(const fault_t *fault, bus_fault_t kind, lines_t *lines, char why[FAULT_WHY_MAX])
{
    if (kind != BUS_SWITCH) {
        return lines_plug(lines, (lines_section_t)fault->number[0], kind == BUS_CHIP_BACK, why, FAULT_WHY_MAX);
    }
    lines_switch(lines, (switch_t)fault->number[1], fault->number[0] > 0);
    return true;
}
