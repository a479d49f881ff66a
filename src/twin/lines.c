/* SPDX-License-Identifier: MIT
 * lines.c - the GPIO lines of a configuration as the world on their other side; see lines.h.
 */
#include "twin/lines.h"

#include <inttypes.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "linux_gpio.h"

#define LABEL   "heave-twin" /* of the chip with the lines whose chip the configuration does not name */
#define LOOK_US 7300u        /* no multiple of a millisecond: a pulse in step with the looks would seem to stand still */

const char *lines_switch_name(switch_t which)
{
    static const char *const k_names[] = {"estop", "enable", "reset", "estop2", "power"};
    return k_names[which];
}

const char *lines_section_name(lines_section_t section)
{
    static const char *const k_names[] = {"relays", "inputs", "healthy"};
    return k_names[section];
}

/* --- Which lines there are, and where --- */

static unsigned chip_of(lines_t *self, const config_label_t *label)
{
    const char *wanted = label->text[0] != '\0' ? label->text : LABEL;
    for (unsigned i = 0; i < self->chips; i++) {
        if (strcmp(self->label[i], wanted) == 0) {
            return i;
        }
    }
    self->label[self->chips] = wanted;
    return self->chips++;
}

static void add(lines_t *self, lines_section_t section, unsigned number, const config_label_t *chip, const config_label_t *line,
                bool is_active_low)
{
    const bool is_named = strspn(line->text, "0123456789") != strlen(line->text);
    self->line[self->count++] = (line_t){.section = section,
                                         .number = number,
                                         .name = line->text,
                                         .is_named = is_named,
                                         .chip = chip_of(self, chip),
                                         .offset = is_named ? SIM_CHIP_LINES_MAX : (unsigned)strtoul(line->text, NULL, 10),
                                         .is_active_low = is_active_low,
                                         .is_closed = section == LINES_INPUTS && number != SWITCH_RESET,
                                         .fd = -1};
}

static bool is_taken(const lines_t *self, unsigned chip, unsigned offset)
{
    for (unsigned i = 0; i < self->count; i++) {
        if (self->line[i].chip == chip && self->line[i].offset == offset) {
            return true;
        }
    }
    return false;
}

/* Named lines are where no number is. */
static void place(lines_t *self)
{
    for (unsigned i = 0; i < self->count; i++) {
        line_t *line = &self->line[i];
        for (unsigned offset = 0; line->offset == SIM_CHIP_LINES_MAX && line->is_named; offset++) {
            line->offset = is_taken(self, line->chip, offset) ? SIM_CHIP_LINES_MAX : offset;
        }
        self->size[line->chip] = self->size[line->chip] > line->offset ? self->size[line->chip] : line->offset + 1;
    }
}

void lines_plan(lines_t *self, const config_t *config)
{
    const config_inputs_t *inputs = &config->inputs;
    const config_label_t *const input[SWITCHES] = {[SWITCH_ESTOP] = &inputs->estop_line,
                                                   [SWITCH_ENABLE] = &inputs->enable_line,
                                                   [SWITCH_RESET] = &inputs->reset_line,
                                                   [SWITCH_ESTOP2] = &inputs->estop2_line,
                                                   [SWITCH_POWER] = &inputs->power_line};
    memset(self, 0, sizeof *self);
    for (unsigned i = 0; config->relays.driver == CONFIG_RELAYS_GPIO && i < config->relays.lines.count; i++) {
        add(self, LINES_RELAYS, i, &config->relays.chip, &config->relays.lines.line[i], config->relays.is_active_low);
    }
    for (unsigned i = 0; inputs->driver == CONFIG_INPUTS_GPIO && i < SWITCHES; i++) {
        if (input[i]->text[0] != '\0') {
            add(self, LINES_INPUTS, i, &inputs->chip, input[i], inputs->is_active_low);
        }
    }
    if (config->healthy.driver == CONFIG_HEALTHY_GPIO) {
        add(self, LINES_HEALTHY, 0, &config->healthy.chip, &config->healthy.line, config->healthy.is_active_low);
    }
    place(self);
}

static line_t *find(const lines_t *self, lines_section_t section, unsigned number)
{
    for (unsigned i = 0; i < self->count; i++) {
        if (self->line[i].section == section && self->line[i].number == number) {
            return (line_t *)&self->line[i];
        }
    }
    return NULL;
}

bool lines_has_switch(const lines_t *self, switch_t which)
{
    return find(self, LINES_INPUTS, which) != NULL;
}

bool lines_has_section(const lines_t *self, lines_section_t section)
{
    for (unsigned i = 0; i < self->count; i++) {
        if (self->line[i].section == section) {
            return true;
        }
    }
    return false;
}

/* --- Chips --- */

/* Lines of real chips have real things behind them. */
static bool are_free(const lines_t *self, const config_t *config, lines_section_t section, char why[LINES_WHY_MAX])
{
    const config_label_t *const chip[] = {&config->relays.chip, &config->inputs.chip, &config->healthy.chip};
    char text[LINUX_GPIO_TEXT_SIZE];
    linux_gpio_names_t names = {.chip = chip[section]->text};
    linux_gpio_place_t there;
    for (unsigned i = 0; i < self->count; i++) {
        if (self->line[i].section == section) {
            names.line[names.count++] = self->line[i].name;
        }
    }
    if (names.count == 0 || linux_gpio_find(&names, &there, text) != HV_OK) {
        return true;
    }
    (void)snprintf(
        why, LINES_WHY_MAX,
        "[%s]: chip %s of this machine has these lines already, and heave-twin would be in their place. Give --no-gpio "
        "to leave all lines to it, or end the other heave-twin",
        lines_section_name(section), there.label);
    return false;
}

/* What a line is without its user: a switch as it stands, a relay open, a pulse that rests. */
static bool resting_level(const line_t *line)
{
    return line->is_closed != line->is_active_low;
}

static void open_lines(lines_t *self, unsigned chip)
{
    for (unsigned i = 0; i < self->count; i++) {
        line_t *line = &self->line[i];
        if (line->chip == chip) {
            sim_chip_pull(&self->chip[chip], line->offset, resting_level(line));
            line->fd = sim_chip_open(&self->chip[chip], line->offset);
        }
    }
}

static void close_lines(lines_t *self, unsigned chip)
{
    for (unsigned i = 0; i < self->count; i++) {
        line_t *line = &self->line[i];
        if (line->chip == chip && line->fd >= 0) {
            (void)close(line->fd);
            line->fd = -1;
        }
    }
}

static bool make(lines_t *self, unsigned chip, char why[LINES_WHY_MAX])
{
    if (self->size[chip] > SIM_CHIP_LINES_MAX) {
        (void)snprintf(why, LINES_WHY_MAX, "chip %s: a simulated chip has at most %u lines", self->label[chip],
                       SIM_CHIP_LINES_MAX);
        return false;
    }
    if (!sim_chip_make(&self->chip[chip], chip, self->label[chip], self->size[chip], why, LINES_WHY_MAX)) {
        return false;
    }
    for (unsigned i = 0; i < self->count; i++) {
        const line_t *line = &self->line[i];
        if (line->chip == chip && line->is_named &&
            !sim_chip_name(&self->chip[chip], line->offset, line->name, why, LINES_WHY_MAX)) {
            return false;
        }
    }
    return sim_chip_plug(&self->chip[chip], true, why, LINES_WHY_MAX);
}

bool lines_open(lines_t *self, const config_t *config, uint64_t now_us, char why[LINES_WHY_MAX])
{
    if (self->count == 0) {
        return true;
    }
    sim_chip_tidy();
    for (lines_section_t section = LINES_RELAYS; section < LINES_SECTIONS; section++) {
        if (!are_free(self, config, section, why)) {
            return false;
        }
    }
    for (unsigned i = 0; i < self->chips; i++) {
        if (!make(self, i, why)) {
            return false;
        }
        open_lines(self, i);
    }
    self->pulse_us = self->looked_us = now_us;
    return true;
}

void lines_close(lines_t *self)
{
    for (unsigned i = 0; i < self->chips; i++) {
        close_lines(self, i);
        sim_chip_drop(&self->chip[i]);
    }
}

bool lines_plug(lines_t *self, lines_section_t section, bool is_live, char *why, size_t size)
{
    for (unsigned i = 0; i < self->count; i++) {
        const unsigned chip = self->line[i].chip;
        if (self->line[i].section != section || self->chip[chip].is_live == is_live) {
            continue;
        }
        close_lines(self, chip);
        if (!sim_chip_plug(&self->chip[chip], is_live, why, size)) {
            return false;
        }
        if (is_live) {
            open_lines(self, chip);
        }
    }
    return true;
}

/* --- While it runs --- */

static void hold(const lines_t *self, const line_t *line)
{
    const int level = sim_chip_level(line->fd);
    if (level >= 0 && (level != 0) != resting_level(line)) {
        sim_chip_pull(&self->chip[line->chip], line->offset, resting_level(line));
    }
}

void lines_switch(lines_t *self, switch_t which, bool is_closed)
{
    line_t *line = find(self, LINES_INPUTS, which);
    if (line != NULL) {
        line->is_closed = is_closed;
        hold(self, line);
    }
}

void lines_advance(lines_t *self, uint64_t now_us)
{
    if (now_us < lines_due_us(self)) {
        return;
    }
    self->looked_us = now_us;
    for (unsigned i = 0; i < self->count; i++) {
        const line_t *line = &self->line[i];
        if (line->section == LINES_INPUTS) {
            hold(self, line);
        } else if (line->section == LINES_HEALTHY) {
            const int level = sim_chip_level(line->fd);
            self->pulse_us = level != self->pulse ? now_us : self->pulse_us;
            self->pulse = level;
        }
    }
}

uint64_t lines_due_us(const lines_t *self)
{
    const bool is_watching = lines_has_section(self, LINES_INPUTS) || lines_has_section(self, LINES_HEALTHY);
    return is_watching ? self->looked_us + LOOK_US : UINT64_MAX;
}

/* --- What it says --- */

static bool is_active(const line_t *line)
{
    const int level = sim_chip_level(line->fd);
    return level >= 0 && (level != 0) != line->is_active_low;
}

/* The opening of a section where this line is its first one. */
static const char *opening(lines_section_t section, bool is_first, bool is_known)
{
    static const char *const k_known[] = {", \"relays\": [", ", \"switches\": {", ", \"healthy\": {"};
    static const char *const k_gone[] = {", \"relays\": null", ", \"switches\": {", ", \"healthy\": null"};
    return !is_first ? "" : is_known || section == LINES_INPUTS ? k_known[section] : k_gone[section];
}

static size_t line_status(const lines_t *self, const line_t *line, const char *comma, uint64_t now_us, char *out, size_t size)
{
    switch (line->section) {
    case LINES_RELAYS:
        return is_active(line) ? (size_t)snprintf(out, size, "%s%u", comma, line->number + 1) : 0;
    case LINES_INPUTS:
        return (size_t)snprintf(out, size, "%s\"%s\": \"%s\"", comma, lines_switch_name((switch_t)line->number),
                                line->is_closed ? "closed" : "open");
    case LINES_HEALTHY:
        return (size_t)snprintf(out, size, "\"is_high\": %s, \"still_ms\": %" PRIu64,
                                sim_chip_level(line->fd) == 1 ? "true" : "false", (now_us - self->pulse_us) / 1000u);
    case LINES_SECTIONS:
        break;
    }
    return 0;
}

size_t lines_status(const lines_t *self, uint64_t now_us, char *out, size_t size)
{
    static const char k_ends[] = {']', '}', '}'};
    size_t at = 0;
    for (unsigned i = 0; i < self->count && at < size; i++) {
        const line_t *line = &self->line[i];
        const bool is_first = i == 0 || self->line[i - 1].section != line->section;
        const bool is_last = i + 1 == self->count || self->line[i + 1].section != line->section;
        const bool is_known = line->section == LINES_INPUTS || self->chip[line->chip].is_live;
        at += (size_t)snprintf(out + at, size - at, "%s", opening(line->section, is_first, is_known));
        if (is_known && at < size) {
            const bool is_opened = out[at - 1] == '[' || out[at - 1] == '{';
            at += line_status(self, line, is_opened ? "" : ", ", now_us, out + at, size - at);
        }
        if (is_known && is_last && at < size) {
            at += (size_t)snprintf(out + at, size - at, "%c", k_ends[line->section]);
        }
    }
    return at;
}

void lines_describe(const lines_t *self, FILE *out)
{
    for (unsigned i = 0; i < self->count; i++) {
        const line_t *line = &self->line[i];
        const bool is_first = i == 0 || self->line[i - 1].section != line->section;
        const bool is_last = i + 1 == self->count || self->line[i + 1].section != line->section;
        if (is_first) {
            fprintf(out, "heave-twin: [%s] on the simulated chip %s:", lines_section_name(line->section),
                    self->label[line->chip]);
        }
        if (line->section == LINES_INPUTS) {
            fprintf(out, " %s", lines_switch_name((switch_t)line->number));
        }
        fprintf(out, " %s%s", line->name, is_last ? "\n" : ",");
    }
}
