/* SPDX-License-Identifier: MIT
 * gpio.h - GPIO lines of a configuration: what can be said of them without looking at a chip.
 */
#ifndef HEAVE_PLATFORM_GPIO_H
#define HEAVE_PLATFORM_GPIO_H

#include "config/source.h"

/** Refuses lines that no chip can be found by, and lines that are used twice; reports into self. */
void config_gpio_check(config_source_t *self);

/** The same of one line in another section: a chip's number as its name; a number without a chip; an output that is a relay or an
 *  input already. */
void config_gpio_check_chip(config_source_t *self, const char *section, const config_label_t *chip);
void config_gpio_check_line(config_source_t *self, const char *section, const char *key, const config_label_t *chip,
                            const config_label_t *line);
void config_gpio_check_output(config_source_t *self, const char *section, const char *key, const config_label_t *chip,
                              const config_label_t *line);

#endif
