/* SPDX-License-Identifier: MIT
 * config_gpio.c - GPIO lines of a configuration; see config_gpio.h.
 */
#include "config_gpio.h"

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
static void check_chip(config_source_t *self, const char *section, const config_label_t *chip)
{
    if (strncmp(chip->text, "gpiochip", 8) == 0 || strncmp(chip->text, "/dev/", 5) == 0) {
        config_source_key_error(self, section, "chip",
                                "%s is a number that changes; allowed: the chip's label (gpiodetect shows it)", chip->text);
    }
}

static void check_line(config_source_t *self, const char *section, const char *key, const config_label_t *chip,
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
    check_chip(self, "relays", &relays->chip);
    if (lines->count == 0) {
        config_source_key_error(self, "relays", "lines", "driver gpio switches none; allowed: the lines of 1 to %u relays",
                                CONFIG_RELAYS_MAX);
    }
    for (unsigned i = 0; i < lines->count; i++) {
        check_line(self, "relays", "lines", &relays->chip, &lines->line[i]);
        for (unsigned k = 0; k < i; k++) {
            if (is_same_line(&lines->line[i], &lines->line[k])) {
                config_source_key_error(self, "relays", "lines", "%s is relay %u already; allowed: a line of its own for each",
                                        lines->line[i].text, k + 1u);
            }
        }
    }
}

void config_gpio_check(config_source_t *self)
{
    check_relays(self);
}
