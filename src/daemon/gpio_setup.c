/* SPDX-License-Identifier: MIT
 * gpio_setup.c - GPIO lines of a configuration as the Linux backends want them; see gpio_setup.h.
 */
#include "daemon/gpio_setup.h"

#include <string.h>

#include "common/columns.h"
#include "common/sentence.h"
#include "common/translate.h"
#include "config/config_text.h"

linux_gpio_relays_config_t gpio_setup_relays(const config_t *config)
{
    const config_relays_t *relays = &config->relays;
    linux_gpio_relays_config_t out = {.names = {.chip = relays->chip.text, .count = relays->lines.count},
                                      .consumer = "heaved relays",
                                      .is_active_low = relays->is_active_low,
                                      .safe_mask = config->settings.relay_safe_mask};
    for (unsigned i = 0; i < relays->lines.count; i++) {
        out.names.line[i] = relays->lines.line[i].text;
    }
    return out;
}

linux_gpio_relays_config_t gpio_setup_healthy(const config_t *config)
{
    const config_healthy_t *healthy = &config->healthy;
    return (linux_gpio_relays_config_t){.names = {.chip = healthy->chip.text, .count = 1, .line = {healthy->line.text}},
                                        .consumer = "heaved healthy",
                                        .is_active_low = healthy->is_active_low};
}

linux_gpio_inputs_config_t gpio_setup_inputs(const config_t *config)
{
    const config_inputs_t *inputs = &config->inputs;
    const config_label_t *const line[] = {&inputs->estop_line, &inputs->enable_line, &inputs->reset_line, &inputs->estop2_line,
                                          &inputs->power_line};
    static const uint32_t k_input[] = {INPUT_ESTOP, INPUT_ENABLE, INPUT_RESET, INPUT_ESTOP2, INPUT_POWER};
    linux_gpio_inputs_config_t out = {.names = {.chip = inputs->chip.text}, .is_active_low = inputs->is_active_low};
    for (unsigned i = 0; i < LINUX_GPIO_INPUTS_MAX; i++) {
        if (line[i]->text[0] != '\0') {
            out.names.line[out.names.count] = line[i]->text;
            out.input[out.names.count++] = k_input[i];
        }
    }
    return out;
}

/* Finds lines and says what is wrong with them. Returns the number of warnings. */
static unsigned look(const linux_gpio_names_t *names, const char *section, linux_gpio_place_t *place, FILE *out)
{
    char text[LINUX_GPIO_TEXT_SIZE], shown[SENTENCE_MAX];
    const hv_status_t status = linux_gpio_find(names, place, text);
    if (status == HV_ERR_NOSUP) {
        columns_put(out, translate(section), CONFIG_LABEL_COLUMNS);
        fprintf(out, _("not looked at: %s\n"), sentence(text, shown, sizeof shown));
    } else if (status != HV_OK) {
        fprintf(out, _("warning: [%s] %s\n"), section, sentence(text, shown, sizeof shown));
    } else {
        columns_put(out, translate(section), CONFIG_LABEL_COLUMNS);
        fprintf(out, translate_count("%u line on chip %s\n", "%u lines on chip %s\n", place->count), place->count, place->label);
    }
    return status != HV_OK && status != HV_ERR_NOSUP;
}

/* A name and a number may be one line: only the chip knows. Returns the number of warnings. */
static unsigned compare(const config_t *config, const linux_gpio_place_t *relays, const linux_gpio_place_t *inputs, FILE *out)
{
    const linux_gpio_inputs_config_t setup = gpio_setup_inputs(config);
    unsigned warnings = 0;
    if (strcmp(relays->path, inputs->path) != 0) {
        return 0;
    }
    for (unsigned i = 0; i < inputs->count; i++) {
        for (unsigned k = 0; k < relays->count; k++) {
            if (inputs->offset[i] == relays->offset[k]) {
                fprintf(out, _("warning: [inputs] gpio: line %s is relay %u already\n"), setup.names.line[i], k + 1u);
                warnings++;
            }
        }
    }
    return warnings;
}

unsigned gpio_setup_check(const config_t *config, FILE *out)
{
    linux_gpio_place_t relays = {.count = 0};
    linux_gpio_place_t inputs = {.count = 0};
    unsigned warnings = 0;
    if (config->relays.driver == CONFIG_RELAYS_GPIO) {
        const linux_gpio_relays_config_t setup = gpio_setup_relays(config);
        warnings += look(&setup.names, N_("relays"), &relays, out);
    }
    if (config->healthy.driver == CONFIG_HEALTHY_GPIO) {
        linux_gpio_place_t healthy = {.count = 0};
        const linux_gpio_relays_config_t setup = gpio_setup_healthy(config);
        warnings += look(&setup.names, N_("healthy"), &healthy, out);
    }
    if (config->inputs.driver == CONFIG_INPUTS_GPIO) {
        const linux_gpio_inputs_config_t setup = gpio_setup_inputs(config);
        warnings += look(&setup.names, N_("inputs"), &inputs, out) + compare(config, &relays, &inputs, out);
    }
    return warnings;
}
