/* SPDX-License-Identifier: MIT
 * control_passing.c - see control_passing.h.
 */
#include "service/control_passing.h"

#include "common/translate.h"

/* The memory of the samples comes with the answer (SCM_RIGHTS). */
void control_pass_samples(const control_t *self, control_client_t *client)
{
    if (self->samples_fd < 0) {
        control_client_answer_error(client, "samples: there are none; [samples] seconds says how long they are kept", NULL);
        return;
    }
    client->passing = self->samples_fd;
    json_t json = control_client_start_answer(client);
    json_open(&json, NULL, '{');
    json_bool(&json, "ok", true);
    json_number(&json, "seconds", self->config->samples_seconds);
    json_close(&json, '}');
    control_client_answer(client, &json);
}

/* A folder as a place (O_PATH): what may be opened from there the kernel says, by the rights of the files. heaved itself touches
 * no disk for somebody who looks on. */
static void pass_folder(const control_t *self, control_client_t *client, bool is_log)
{
    const int fd = is_log ? operator_log_folder(self->log) : blackbox_folder(self->blackbox);
    if (fd < 0) {
        control_client_answer_error(
            client,
            is_log ? "operator-log: there is none; [control] operator_log says where it is written"
                   : N_("incident-folder: there is none; [black-box] directory says where incidents are written"),
            NULL);
        return;
    }
    client->passing = fd;
    json_t json = control_client_start_answer(client);
    json_open(&json, NULL, '{');
    json_bool(&json, "ok", true);
    if (is_log) {
        json_text(&json, "file", operator_log_name(self->log));
    }
    json_close(&json, '}');
    control_client_answer(client, &json);
}

void control_pass_incident_folder(const control_t *self, control_client_t *client)
{
    pass_folder(self, client, false);
}

void control_pass_operator_log(const control_t *self, control_client_t *client)
{
    pass_folder(self, client, true);
}
