/* SPDX-License-Identifier: MIT
 * relays.h - contract of a bank of relays. Open contacts must be the safe state: the lines fall back when the process ends.
 * One thread calls the ops. Polarity (active low) is the backend's business: 1 = contact closed everywhere above it.
 */
#ifndef HEAVE_HAL_RELAYS_H
#define HEAVE_HAL_RELAYS_H

#include "heave/status.h"

/** Most relays a bank has: the bits of a frame's mask. */
#define HAL_RELAYS_MAX 12u

/** read_back is optional, the rest mandatory. */
typedef struct {
    hv_status_t (*write)(void *ctx, uint16_t mask);
    hv_status_t (*read_back)(void *ctx, uint16_t *mask); /* optional */
    uint8_t (*count)(void *ctx);
} hal_relays_ops_t;

/** Passed by value; ctx belongs to the backend and lives until its close. */
typedef struct {
    const hal_relays_ops_t *ops;
    void *ctx;
} hal_relays_t;

/** True if every mandatory op is set. If not, refuse to start. */
static inline bool hal_relays_valid(hal_relays_t relays)
{
    return relays.ops != NULL && relays.ops->write != NULL && relays.ops->count != NULL;
}

/** Relays in the bank, [0, HAL_RELAYS_MAX]; constant from the open on. */
static inline uint8_t hal_relays_count(hal_relays_t relays)
{
    return relays.ops->count(relays.ctx);
}

/** Sets all relays at once: bit n = relay n + 1, 1 = closed. <= 100 us. A slow bank accepts the mask and writes it later (the
 * newest wins); read_back shows when. Writing the same mask again is allowed and cheap.
 *  @return HV_OK; HV_ERR_RANGE: a bit above count is set, nothing was written; HV_ERR_IO: the relays are in an unknown
 *          state; write again in a later cycle. */
static inline HV_MUST_CHECK hv_status_t hal_relays_write(hal_relays_t relays, uint16_t mask)
{
    return relays.ops->write(relays.ctx, mask);
}

/** The mask that the hardware reports: of the lines, if it cannot see the contacts. <= 100 us.
 *  @param mask out: unchanged on error
 *  @return HV_OK; HV_ERR_AGAIN: not known yet; HV_ERR_IO: unknown; HV_ERR_NOSUP: the backend cannot know. */
static inline HV_MUST_CHECK hv_status_t hal_relays_read_back(hal_relays_t relays, uint16_t *mask)
{
    return relays.ops->read_back != NULL ? relays.ops->read_back(relays.ctx, mask) : HV_ERR_NOSUP;
}

#endif
