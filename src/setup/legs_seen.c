/* SPDX-License-Identifier: MIT
 * legs_seen.c - see legs_seen.h.
 */
#include "setup/legs_seen.h"

#include <string.h>

#include "setup/answers.h"

legs_status_t legs_seen(const setup_t *self, legs_found_t *found, char text[LEGS_TEXT_MAX])
{
    legs_seen_t seen[LEGS_MAX] = {{0}};
    const unsigned count = setup_cylinders(self);
    for (unsigned i = 0; i < count; i++) {
        const char *direction = answers_get_nth(self, "legs.direction", i + 1u);
        seen[i] = (legs_seen_t){.leg = (unsigned)answers_number(self, "legs.moved", i + 1u),
                                .is_shorter = direction != NULL && strcmp(direction, "s") == 0,
                                .asked_mm = answers_number(self, "legs.way", i + 1u),
                                .measured_mm = answers_number(self, "legs.measured", i + 1u)};
    }
    return legs_identify(seen, count, found, text);
}
