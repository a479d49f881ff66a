/* SPDX-License-Identifier: MIT
 * nearest.c - see nearest.h.
 */
#include "common/nearest.h"

#include <string.h>

#define LETTERS_MAX 31u

static unsigned least(unsigned a, unsigned b)
{
    return a < b ? a : b;
}

unsigned nearest_slips(const char *one, const char *other)
{
    unsigned row[3][LETTERS_MAX + 1u];
    const size_t lines = strlen(one), columns = strlen(other);
    if (lines > LETTERS_MAX || columns > LETTERS_MAX) {
        return LETTERS_MAX;
    }
    for (unsigned k = 0; k <= columns; k++) {
        row[0][k] = k;
    }
    for (unsigned i = 1; i <= lines; i++) {
        unsigned *now = row[i % 3u];
        const unsigned *before = row[(i + 2u) % 3u], *earlier = row[(i + 1u) % 3u];
        now[0] = i;
        for (unsigned k = 1; k <= columns; k++) {
            const unsigned typed = before[k - 1u] + (one[i - 1u] != other[k - 1u]);
            now[k] = least(typed, least(before[k], now[k - 1u]) + 1u);
            if (i > 1u && k > 1u && one[i - 1u] == other[k - 2u] && one[i - 2u] == other[k - 1u]) {
                now[k] = least(now[k], earlier[k - 2u] + 1u);
            }
        }
    }
    return row[lines % 3u][columns];
}

bool nearest_is_likely(unsigned slips, const char *word)
{
    return slips <= 2u && slips * 3u <= strlen(word);
}
