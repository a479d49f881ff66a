/* SPDX-License-Identifier: MIT
 * status_word.c - the status of a drive; see status_word.h.
 */
#include "twin/status_word.h"

#define CONDITIONS 4u

static void list(const status_conditions_t *conditions, canraw_when_t out[CONDITIONS])
{
    out[0] = conditions->done;
    out[1] = conditions->failed;
    out[2] = conditions->enabled;
    out[3] = conditions->fault;
}

static bool holds(canraw_when_t when, uint32_t status)
{
    return when.mask != 0 && (status & when.mask) == when.value;
}

/* A word of which one condition does not hold any more, without touching the bits of `kept`. */
static uint32_t spoil(canraw_when_t when, uint32_t status, uint32_t kept)
{
    const uint32_t free = when.mask & ~kept;
    return holds(when, status) ? status ^ (free & (~free + 1u)) : status;
}

uint32_t status_word(const status_conditions_t *conditions, unsigned wanted)
{
    canraw_when_t when[CONDITIONS];
    uint32_t status = 0;
    uint32_t kept = 0;
    list(conditions, when);
    for (unsigned i = 0; i < CONDITIONS; i++) {
        if ((wanted >> i & 1u) != 0) {
            status = (status & ~when[i].mask) | when[i].value;
            kept |= when[i].mask;
        }
    }
    for (unsigned i = 0; i < CONDITIONS; i++) {
        status = (wanted >> i & 1u) != 0 ? status : spoil(when[i], status, kept);
    }
    return status;
}

static bool is_distinct(const status_conditions_t *conditions, unsigned wanted)
{
    canraw_when_t when[CONDITIONS];
    const uint32_t status = status_word(conditions, wanted);
    list(conditions, when);
    for (unsigned i = 0; i < CONDITIONS; i++) {
        if (when[i].mask != 0 && holds(when[i], status) != ((wanted >> i & 1u) != 0)) {
            return false;
        }
    }
    return true;
}

bool status_word_is_distinct(const status_conditions_t *conditions)
{
    static const unsigned k_states[] = {0, STATUS_DONE, STATUS_ENABLED | STATUS_DONE, STATUS_FAULT | STATUS_DONE, STATUS_FAULT};
    for (unsigned i = 0; i < sizeof k_states / sizeof k_states[0]; i++) {
        if (!is_distinct(conditions, k_states[i])) {
            return false;
        }
    }
    return true;
}
