/* SPDX-License-Identifier: MIT
 * control_selftest.c - see control_selftest.h.
 */
#include "service/control_selftest.h"

#include <stdio.h>
#include <string.h>

#include "service/control_client.h"
#include "service/service_json.h"

static void put_switch(json_t *json, const char *name, const config_label_t *line)
{
    json_bool(json, name, line->text[0] != '\0');
}

void control_selftest_answer(control_t *self, control_client_t *client)
{
    const config_t *config = self->config;
    const config_inputs_t *inputs = &config->inputs;
    json_t json = control_client_start_answer(client);
    json_open(&json, NULL, '{');
    json_bool(&json, "ok", true);
    json_text(&json, "state", state_name(control_snapshot(self)->state));
    service_json_selftest(&json, &self->lost, config);
    json_q32(&json, "following_mm", q32_from_q16(config->selftest.following_mm_q16));
    json_q32(&json, "drift_mm", q32_from_q16(config->selftest.drift_mm_q16));
    json_q32(&json, "jog_mm_s", q32_from_q16(config->settings.jog_mm_s_q16));
    json_number(&json, "relays", control_snapshot(self)->relay_count);
    json_open(&json, "switches", '{');
    put_switch(&json, "estop", &inputs->estop_line);
    put_switch(&json, "estop2", &inputs->estop2_line);
    put_switch(&json, "enable", &inputs->enable_line);
    put_switch(&json, "power", &inputs->power_line);
    json_close(&json, '}');
    json_bool(&json, "healthy_pulse", config->healthy.driver != CONFIG_HEALTHY_NONE);
    json_text(&json, "configuration", config->hash);
    json_close(&json, '}');
    control_client_answer(client, &json);
}

static void note_result(control_t *self, control_client_t *client, bool is_passed)
{
    self->selftest = (control_selftest_t){.is_news = true, .is_passed = is_passed, .peer = client->peer};
    client->request = EVENT_TICK; /* none that the motion thread has to answer */
    control_client_answer_done(client, control_snapshot(self));
}

void control_selftest_pass(control_t *self, control_client_t *client)
{
    note_result(self, client, true);
}

void control_selftest_fail(control_t *self, control_client_t *client)
{
    note_result(self, client, false);
}

bool control_selftest_watch(control_t *self, lifetime_t *life, const config_t *config, char said[128])
{
    const uint32_t day = lifetime_today();
    const bool is_news = self->selftest.is_news;
    if (is_news) {
        lifetime_selftest_t selftest = {.day = day, .is_passed = self->selftest.is_passed};
        memcpy(selftest.hash, config->hash, sizeof selftest.hash);
        lifetime_note_selftest(life, &selftest);
        (void)snprintf(said, 128, "self-test %s, by user %u, process %d, configuration %s",
                       selftest.is_passed ? "passed" : "failed", (unsigned)self->selftest.peer.uid, (int)self->selftest.peer.pid,
                       config->hash);
        self->selftest.is_news = false;
    }
    self->lost.is_untested = config->selftest.when == CONFIG_SELFTEST_DAILY && !lifetime_has_passed(life, day, config->hash);
    (void)handover_withhold(self->handover, PERMIT_SELFTEST, self->lost.is_untested);
    return is_news;
}
