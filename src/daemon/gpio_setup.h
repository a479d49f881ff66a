/* SPDX-License-Identifier: MIT
 * gpio_setup.h - GPIO lines of a configuration as the Linux backends want them, and a look at this machine's chips for --check.
 */
#ifndef HEAVE_DAEMON_GPIO_SETUP_H
#define HEAVE_DAEMON_GPIO_SETUP_H

#include "config/config.h"
#include "linux_gpio_inputs.h"
#include "linux_gpio_relays.h"

/** The relays; points into config. */
linux_gpio_relays_config_t gpio_setup_relays(const config_t *config);

/** The line of the healthy pulse, as a bank of one relay; points into config. */
linux_gpio_relays_config_t gpio_setup_healthy(const config_t *config);

/** The inputs; points into config. */
linux_gpio_inputs_config_t gpio_setup_inputs(const config_t *config);

/** Writes a warning for what is not there, or a note where nothing can be looked at; requests nothing.
 *  @return the number of warnings */
unsigned gpio_setup_check(const config_t *config, FILE *out);

#endif
