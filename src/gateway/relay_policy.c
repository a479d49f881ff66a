/* SPDX-License-Identifier: MIT
 * relay_policy.c - longest time closed and shortest time between changes, relay by relay; see relay_policy.h.
 */
#include "heave/relay_policy.h"

static bool has_passed(const relay_policy_t *self, unsigned i, uint32_t time_ms, uint64_t now_us)
{
    return now_us - self->changed_us[i] >= (uint64_t)time_ms * 1000;
}

/* Opens a relay that has been closed for too long. Returns true where it does. */
static bool cut(relay_policy_t *self, unsigned i, uint32_t max_on_ms, uint64_t now_us)
{
    const uint16_t bit = (uint16_t)(1u << i);
    if (max_on_ms == 0 || (self->mask & bit) == 0 || !has_passed(self, i, max_on_ms, now_us)) {
        return false;
    }
    self->cut |= bit;
    self->cut_count++;
    return true;
}

/* True while the last change is too young for another one; counts a wait once. */
static bool is_delayed(relay_policy_t *self, unsigned i, uint32_t min_toggle_ms, uint64_t now_us)
{
    const uint16_t bit = (uint16_t)(1u << i);
    if (min_toggle_ms == 0 || (self->changed & bit) == 0 || has_passed(self, i, min_toggle_ms, now_us)) {
        return false;
    }
    self->delay_count += (self->delayed & bit) == 0;
    self->delayed |= bit;
    return true;
}

static void step(relay_policy_t *self, const relay_settings_t *settings, unsigned i, bool is_asked, bool is_safe, uint64_t now_us)
{
    const uint16_t bit = (uint16_t)(1u << i);
    if (!is_asked) {
        self->cut = (uint16_t)(self->cut & ~bit);
    }
    const bool is_cut_now = is_asked && cut(self, i, settings->max_on_ms[i], now_us);
    const bool is_wanted = is_asked && (self->cut & bit) == 0;
    if (is_wanted == ((self->mask & bit) != 0)) {
        self->delayed = (uint16_t)(self->delayed & ~bit);
        return;
    }
    if (!is_safe && !is_cut_now && is_delayed(self, i, settings->min_toggle_ms[i], now_us)) {
        return;
    }
    self->mask ^= bit;
    self->changed |= bit;
    self->delayed = (uint16_t)(self->delayed & ~bit);
    self->changed_us[i] = now_us;
}

uint16_t relay_policy_step(relay_policy_t *self, const relay_settings_t *settings, uint16_t asked, bool is_safe, uint64_t now_us)
{
    const unsigned busy = (unsigned)asked | self->mask | self->cut | self->delayed; /* the others are open, and are to be */
    for (unsigned i = 0; i < settings->count && busy >> i != 0; i++) {
        step(self, settings, i, (asked >> i & 1u) != 0, is_safe, now_us);
    }
    return self->mask;
}
