/* SPDX-License-Identifier: MIT
 * sane.h - checks of data that was loaded from a file. Anybody may have written the file, so no value of it may become an index,
 * a divisor or a bool without a check. Each module checks its own members; gateway_resume() calls all checks. Pure.
 */
#ifndef HEAVE_SANE_H
#define HEAVE_SANE_H

#include "heave/fx.h"

#define SANE_Q32_MAX  ((q32_t)1 << 53) /**< 2 km, 2,000,000 deg: more than any axis has, and small enough to add many of them */
#define SANE_TIME_MAX (UINT64_MAX >> 2)

/** True for a bool that holds 0 or 1; read as a byte, since any other value of a bool is undefined. */
static inline bool sane_bool(const bool *value)
{
    return *(const uint8_t *)value <= 1u;
}

static inline bool sane_q32(q32_t value_q32)
{
    return value_q32 >= -SANE_Q32_MAX && value_q32 <= SANE_Q32_MAX;
}

static inline bool sane_time(uint64_t time_us)
{
    return time_us <= SANE_TIME_MAX;
}

/** All of them are values that can be added. */
static inline bool sane_all_q32(const q32_t *value_q32, unsigned count)
{
    bool is_sane = true;
    for (unsigned i = 0; i < count; i++) {
        is_sane = is_sane && sane_q32(value_q32[i]);
    }
    return is_sane;
}

#endif
