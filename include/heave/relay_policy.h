/* SPDX-License-Identifier: MIT
 * relay_policy.h - limits how long a relay may stay closed, and how soon it may change again.
 * Stands between the requested mask and the written one. Plain data, no clock, no I/O; one thread.
 */
#ifndef HEAVE_RELAY_POLICY_H
#define HEAVE_RELAY_POLICY_H

#include "heave/settings.h"

/** The relays of a platform; members are private to relay_policy.c. All zero is a valid start: every relay open. */
typedef struct {
    uint16_t mask;        /**< as last allowed */
    uint16_t changed;     /**< relays that have changed since the start; only their changed_us is valid */
    uint16_t cut;         /**< relays that were opened after max_on_ms and that the sender has not opened since */
    uint16_t delayed;     /**< relays that wait for min_toggle_ms */
    uint32_t cut_count;   /**< relays opened because of max_on_ms; wraps */
    uint32_t delay_count; /**< changes that waited for min_toggle_ms, or were withdrawn in that time; wraps */
    uint64_t changed_us[HAL_RELAYS_MAX];
} relay_policy_t;

/** The mask to write in this cycle.
 *  A relay that has been closed for max_on_ms opens, and stays open until the sender has requested open once. A relay that has
 *  changed keeps its state for min_toggle_ms and then takes the state requested at that time.
 *  @param settings  number of relays, and their limits
 *  @param asked     bit n = relay n + 1; bits without a relay are left out
 *  @param is_safe   asked is the safe mask, which is never delayed
 *  @return the mask */
uint16_t relay_policy_step(relay_policy_t *self, const relay_settings_t *settings, uint16_t asked, bool is_safe, uint64_t now_us);

#endif
