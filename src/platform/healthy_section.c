/* SPDX-License-Identifier: MIT
 * healthy_section.c - the healthy pulse of a configuration; see healthy_section.h.
 */
#include "platform/healthy_section.h"

#include "platform/gpio.h"

#define SECTION        "healthy"
#define COIL_TOGGLE_MS 100u /* a transaction on a line takes some 20 ms: edges that are closer would be lost on their way */

static void check_line(config_source_t *self)
{
    const config_healthy_t *healthy = &self->config->healthy;
    config_gpio_check_chip(self, SECTION, &healthy->chip);
    if (healthy->line.text[0] == '\0') {
        config_source_key_error(self, SECTION, "line", "missing; allowed: the output line of the pulse");
        return;
    }
    config_gpio_check_line(self, SECTION, "line", &healthy->chip, &healthy->line);
    config_gpio_check_output(self, SECTION, "line", &healthy->chip, &healthy->line);
}

/* What else the relay would do, it would do to the watchdog. */
static void check_relay(config_source_t *self)
{
    const settings_t *settings = &self->config->settings;
    const unsigned relay = settings->healthy.relay;
    if (relay == 0 || relay > settings->relays.count) {
        config_source_key_error(self, SECTION, "relay", "%u is none of the %u in [relays] lines; allowed: the relay of the pulse",
                                relay, (unsigned)settings->relays.count);
    } else if ((settings->relay_safe_mask >> (relay - 1u) & 1u) != 0) {
        config_source_key_error(self, SECTION, "relay", "%u is closed by [relays] safe_mask; allowed: a relay that is not",
                                relay);
    } else if (self->config->relays.driver == CONFIG_RELAYS_MODBUS && settings->healthy.toggle_ms < COIL_TOGGLE_MS) {
        config_source_key_error(self, SECTION, "toggle_ms",
                                "%u ms is too quick for a coil of a Modbus board; allowed: %u to 1000 ms",
                                (unsigned)settings->healthy.toggle_ms, COIL_TOGGLE_MS);
    }
}

void config_healthy_check(config_source_t *self)
{
    const config_t *config = self->config;
    if (!config_source_has_all(self, SECTION) || !config_source_has_all(self, "relays")) {
        return;
    }
    if (config->healthy.driver == CONFIG_HEALTHY_RELAY) {
        check_relay(self);
    } else if (config->settings.healthy.relay != 0) {
        config_source_key_error(self, SECTION, "relay", "%u is for driver = relay; allowed here: 0",
                                (unsigned)config->settings.healthy.relay);
    }
    if (config->healthy.driver == CONFIG_HEALTHY_GPIO) {
        check_line(self);
    }
}
