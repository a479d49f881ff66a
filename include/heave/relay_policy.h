/* SPDX-License-Identifier: MIT
 * relay_policy.h - what relays bear: how long one may stay closed, and how soon one may change again.
 * Between what is asked of the relays and what is written to them. Plain data, no clock, no I/O; one thread.
 */
#ifndef HEAVE_RELAY_POLICY_H
#define HEAVE_RELAY_POLICY_H

#include "heave/settings.h"

/** The relays of a platform; members are private to relay_policy.c. All zero is a valid start: every relay open. */
typedef struct {
    uint16_t mask;        /**< as last allowed */
    uint16_t changed;     /**< bits whose changed_us is valid */
    uint16_t cut;         /**< bits that were closed for too long, and whose sender has not asked for open since */
    uint16_t delayed;     /**< bits that wait for min_toggle_ms */
    uint32_t cut_count;   /**< times that a relay was opened because of max_on_ms; wraps */
    uint32_t delay_count; /**< changes that had to wait for min_toggle_ms, or came to nothing in that time; wraps */
    uint64_t changed_us[HAL_RELAYS_MAX];
} relay_policy_t;

/** What may be written in this cycle.
 *  A relay that has been closed for max_on_ms opens, and stays open until it has been asked to be open. One that has
 *  changed stays so for min_toggle_ms; what is asked for at the end of that time is what it does then.
 *  @param settings  which there are, and what they bear
 *  @param asked     bit n = relay n + 1; bits without a relay are left out
 *  @param is_safe   asked is the safe mask: nothing delays it
 *  @return the mask */
uint16_t relay_policy_step(relay_policy_t *self, const relay_settings_t *settings, uint16_t asked, bool is_safe, uint64_t now_us);

/** True for one that may be used, whatever file it comes from; see sane.h. */
bool relay_policy_is_sane(const relay_policy_t *self);

#endif
