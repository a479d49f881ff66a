/* SPDX-License-Identifier: MIT
 * distances.c - see distances.h.
 */
#include "setup/distances.h"

#include <stdio.h>

#include "setup/answers.h"
#include "setup/lengths.h"

void distances_name(unsigned pair, char name[8])
{
    unsigned one = 0, other = 0;
    lengths_pair(pair, &one, &other);
    (void)snprintf(name, 8, "%u-%u", (one + 1u) % 10u, (other + 1u) % 10u);
}

bool distances_get(const setup_t *self, const char *set, double distance_mm[15])
{
    char key[SETUP_KEY_MAX];
    (void)snprintf(key, sizeof key, "%s.distance", set);
    for (unsigned pair = 0; pair < LENGTHS_PAIRS; pair++) {
        distance_mm[pair] = answers_number(self, key, pair + 1u);
        if (distance_mm[pair] <= 0) {
            return false;
        }
    }
    return true;
}
