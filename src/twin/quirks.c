/* SPDX-License-Identifier: MIT
 * quirks.c - the names; see quirks.h.
 */
#include "twin/quirks.h"

bool quirk_describe(unsigned i, const char **name, quirk_t *bit)
{
    static const char *const k_names[] = {"hides-mode", "needs-bits", "no-bit-10",   "slow-reset",    "fault-blocks",
                                          "long-pdo",   "short-pdo",  "length-bit",  "sends-changes", "boots-twice",
                                          "short-sdo",  "segments",   "wrong-toggle"};
    if (i >= sizeof k_names / sizeof k_names[0]) {
        return false;
    }
    *name = k_names[i];
    *bit = (quirk_t)(1u << i);
    return true;
}
