/* SPDX-License-Identifier: MIT
 * config_gpio.h - GPIO lines of a configuration: what can be said of them without looking at a chip.
 */
#ifndef HEAVE_APP_CONFIG_GPIO_H
#define HEAVE_APP_CONFIG_GPIO_H

#include "config_source.h"

/** Refuses lines that no chip can be found by, and lines that are used twice; reports into self. */
void config_gpio_check(config_source_t *self);

#endif
