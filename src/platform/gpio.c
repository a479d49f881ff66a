/* SPDX-License-Identifier: MIT
 * gpio.c - GPIO lines of a configuration; see gpio.h.
 */
#include "platform/gpio.h"

#include <stdlib.h>
#include <string.h>

static bool is_number(const config_label_t *line)
{
    return line->text[0] != '\0' && strspn(line->text, "0123456789") == strlen(line->text);
}

/* The same line of the same chip, as far as the file tells; leading zeros do not count. */
static bool is_same_line(const config_label_t *a, const config_label_t *b)
{
    if (is_number(a) && is_number(b)) {
        return strtoul(a->text, NULL, 10) == strtoul(b->text, NULL, 10);
    }
    return a->text[0] != '\0' && strcmp(a->text, b->text) == 0;
}

/* Chips are counted anew at every start. */
void config_gpio_check_chip(config_source_t *self, const char *section, const config_label_t *chip)
{
    if (strncmp(chip->text, "gpiochip", 8) == 0 || strncmp(chip->text, "/dev/", 5) == 0) {
        config_source_key_error(self, section, "chip",
                                "%s is a number that changes; allowed: the chip's label (gpiodetect shows it)", chip->text);
    }
}

void config_gpio_check_line(config_source_t *self, const char *section, const char *key, const config_label_t *chip,
                            const config_label_t *line)
{
    if (chip->text[0] == '\0' && is_number(line)) {
        config_source_key_error(self, section, key, "%s alone is no line; allowed: the name of a line, or its number with chip",
                                line->text);
    }
}

static void check_relays(config_source_t *self)
{
    const config_relays_t *relays = &self->config->relays;
    const config_lines_t *lines = &relays->lines;
    if (relays->driver != CONFIG_RELAYS_GPIO || !config_source_has_all(self, "relays")) {
        return;
    }
    config_gpio_check_chip(self, "relays", &relays->chip);
    if (lines->count == 0) {
        config_source_key_error(self, "relays", "lines", "driver gpio switches none; allowed: the lines of 1 to %u relays",
                                CONFIG_RELAYS_MAX);
    }
    for (unsigned i = 0; i < lines->count; i++) {
        config_gpio_check_line(self, "relays", "lines", &relays->chip, &lines->line[i]);
        for (unsigned k = 0; k < i; k++) {
            if (is_same_line(&lines->line[i], &lines->line[k])) {
                config_source_key_error(self, "relays", "lines", "%s is relay %u already; allowed: a line of its own for each",
                                        lines->line[i].text, k + 1u);
            }
        }
    }
}

/* A number is a line of its own chip; a name may be on any where no chip is given. */
static bool is_same_chip(const config_label_t *a, const config_label_t *b)
{
    return a->text[0] == '\0' || b->text[0] == '\0' || strcmp(a->text, b->text) == 0;
}

static void check_against_relays(config_source_t *self, const char *section, const char *key, const config_label_t *chip,
                                 const config_label_t *line)
{
    const config_relays_t *relays = &self->config->relays;
    if (relays->driver != CONFIG_RELAYS_GPIO || !is_same_chip(&relays->chip, chip)) {
        return;
    }
    for (unsigned i = 0; i < relays->lines.count; i++) {
        if (is_same_line(&relays->lines.line[i], line)) {
            config_source_key_error(self, section, key, "line %s is relay %u already; allowed: a line of its own, or none",
                                    line->text, i + 1u);
        }
    }
}

/* --- Inputs --- */

#define INPUTS 5u

static const char *const k_input_keys[INPUTS] = {"estop", "enable", "reset", "estop2", "power"};

static void list_inputs(const config_inputs_t *inputs, const config_label_t *line[INPUTS])
{
    line[0] = &inputs->estop_line;
    line[1] = &inputs->enable_line;
    line[2] = &inputs->reset_line;
    line[3] = &inputs->estop2_line;
    line[4] = &inputs->power_line;
}

static void check_inputs_apart(config_source_t *self, const config_label_t *const line[INPUTS])
{
    for (unsigned later = 1; later < INPUTS; later++) {
        for (unsigned earlier = 0; earlier < later; earlier++) {
            if (is_same_line(line[later], line[earlier])) {
                config_source_key_error(self, "inputs", k_input_keys[later],
                                        "line %s is %s already; allowed: a line of its own, or none", line[later]->text,
                                        k_input_keys[earlier]);
            }
        }
    }
}

static void check_inputs(config_source_t *self)
{
    const config_inputs_t *inputs = &self->config->inputs;
    const config_label_t *line[INPUTS];
    unsigned count = 0;
    list_inputs(inputs, line);
    check_inputs_apart(self, line);
    if (inputs->driver != CONFIG_INPUTS_GPIO) {
        return;
    }
    config_gpio_check_chip(self, "inputs", &inputs->chip);
    for (unsigned i = 0; i < INPUTS; i++) {
        count += line[i]->text[0] != '\0';
        config_gpio_check_line(self, "inputs", k_input_keys[i], &inputs->chip, line[i]);
        check_against_relays(self, "inputs", k_input_keys[i], &inputs->chip, line[i]);
    }
    if (count == 0) {
        config_source_key_error(self, "inputs", "estop",
                                "driver gpio reads none; allowed: a line for estop, enable, reset or power");
    }
    if (inputs->enable_line.text[0] != '\0' && self->config->settings.engage == ENGAGE_AUTO) {
        config_source_key_error(self, "inputs", "enable",
                                "engage = auto does not wait for a key; allowed: none, or engage = manual");
    }
    if (inputs->power_line.text[0] != '\0' && self->config->settings.engage == ENGAGE_AUTO) {
        config_source_key_error(self, "inputs", "power",
                                "engage = auto does not wait for the supply; allowed: none, or engage = manual");
    }
    if (inputs->estop2_line.text[0] != '\0' && inputs->estop_line.text[0] == '\0') {
        config_source_key_error(self, "inputs", "estop2",
                                "there is no first channel; allowed: none, or a line for estop as well");
    }
}

void config_gpio_check_output(config_source_t *self, const char *section, const char *key, const config_label_t *chip,
                              const config_label_t *line)
{
    const config_inputs_t *inputs = &self->config->inputs;
    const config_label_t *input[INPUTS];
    check_against_relays(self, section, key, chip, line);
    list_inputs(inputs, input);
    for (unsigned i = 0; inputs->driver == CONFIG_INPUTS_GPIO && i < INPUTS; i++) {
        if (is_same_chip(&inputs->chip, chip) && is_same_line(input[i], line)) {
            config_source_key_error(self, section, key, "line %s is [inputs] %s already; allowed: a line of its own", line->text,
                                    k_input_keys[i]);
        }
    }
}

void config_gpio_check(config_source_t *self)
{
    check_relays(self);
    check_inputs(self);
}
