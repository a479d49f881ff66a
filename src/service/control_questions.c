/* SPDX-License-Identifier: MIT
 * control_questions.c - requests that the service thread answers by itself; see control_questions.h.
 */
#include "service/control_questions.h"

#include <string.h>

#include "service/control_configuration.h"
#include "service/control_geometry.h"
#include "service/control_passing.h"
#include "service/control_times.h"

static const struct {
    const char *word;
    void (*answer)(const control_t *self, control_client_t *client);
} k_questions[] = {{"geometry", control_geometry_answer},
                   {"configuration", control_configuration_answer},
                   {"times", control_times_answer},
                   {"samples", control_pass_samples}};

bool control_questions_answer(const control_t *self, control_client_t *client, const char *line)
{
    for (size_t i = 0; i < sizeof k_questions / sizeof k_questions[0]; i++) {
        if (strcmp(line, k_questions[i].word) == 0) {
            k_questions[i].answer(self, client);
            return true;
        }
    }
    return false;
}
