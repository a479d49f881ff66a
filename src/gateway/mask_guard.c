/* SPDX-License-Identifier: MIT
 * mask_guard.c - whether the last value of a frame is a relay mask; see mask_guard.h.
 */
#include "heave/mask_guard.h"

#define EIGHTS  0x888u
#define LEAK_US 500000u /* each takes one change off the score */

enum {
    SCORE_DIGITS = 10, /* so many changes as of digits, faster than they leak away */
    ROW_HELD = 3,      /* so many of them in a row wait */
    MASKS = 5,         /* different ones, with */
    SUMS = 3           /* so many different numbers of closed relays: patterns that go round have one */
};

/* True where the mask in hexadecimal has decimal digits only. */
static bool is_decimal(uint16_t mask)
{
    bool is_decimal = true;
    for (unsigned rest = mask; rest != 0; rest >>= 4) {
        is_decimal = is_decimal && (rest & 15u) <= 9;
    }
    return is_decimal;
}

static unsigned count_bits(unsigned bits)
{
    unsigned count = 0;
    for (; bits != 0; bits &= bits - 1) {
        count++;
    }
    return count;
}

static void keep(mask_guard_t *self, uint16_t mask)
{
    for (unsigned i = MASK_GUARD_RECENT - 1; i > 0; i--) {
        self->recent[i] = self->recent[i - 1];
    }
    self->recent[0] = mask;
    self->recents = (uint8_t)(self->recents + (self->recents < MASK_GUARD_RECENT));
}

/* Whether the recent masks are as many different ones as digits are. Where relays of all four bits of a digit are switched, there
 * are letters, too: an 8 or 9 and no letter says decimal. */
static bool are_digit_like(const mask_guard_t *self)
{
    unsigned masks = 0, sums = 0, bits = 0;
    for (unsigned i = 0; i < self->recents; i++) {
        bool is_known = false;
        for (unsigned k = i + 1; k < self->recents; k++) {
            is_known = is_known || self->recent[k] == self->recent[i];
        }
        masks += !is_known;
        sums |= 1u << count_bits(self->recent[i]);
        bits |= self->recent[i];
    }
    return masks >= MASKS && count_bits(sums) >= SUMS && (bits & EIGHTS) != 0;
}

static void leak(mask_guard_t *self)
{
    while (self->score > 0 && self->last_us - self->leaked_us >= LEAK_US) {
        self->score--;
        self->leaked_us += LEAK_US;
    }
    self->leaked_us = self->score > 0 ? self->leaked_us : self->last_us;
}

static void forget_masks(mask_guard_t *self)
{
    self->recents = 0;
    self->score = 0;
    self->in_row = 0;
    self->is_digits = false;
}

void mask_guard_restart(mask_guard_t *self)
{
    self->frames = 0;
    forget_masks(self);
}

static bool passes_learnt(mask_guard_t *self, bool has_mask)
{
    const bool is_same = self->has_mask == has_mask;
    if (!is_same && self->frames >= MASK_GUARD_FRAMES) {
        return false;
    }
    self->frames = (uint8_t)(is_same ? self->frames + (self->frames < MASK_GUARD_FRAMES) : 1);
    self->has_mask = has_mask;
    return true;
}

bool mask_guard_allows(mask_policy_t policy, const frame_t *frame)
{
    return frame->is_timed || !(policy == MASK_ALWAYS ? !frame->has_mask : policy == MASK_NEVER && frame->has_mask);
}

bool mask_guard_passes(mask_guard_t *self, mask_policy_t policy, const frame_t *frame, uint64_t now_us)
{
    if (now_us - self->last_us >= MASK_GUARD_GAP_US || self->policy != (uint8_t)policy) {
        mask_guard_restart(self);
    }
    self->policy = (uint8_t)policy;
    self->is_quick = now_us - self->last_us < MASK_GUARD_QUICK_US;
    self->last_us = now_us;
    return policy != MASK_LEARNT || frame->is_timed || passes_learnt(self, frame->has_mask);
}

/* A mask that stays for a frame is taken, also in a row of changes. What have once been digits are digits until a mask has a
 * letter, or the sender is another one or silent. */
bool mask_guard_follows(mask_guard_t *self, mask_policy_t policy, uint16_t mask)
{
    if (policy != MASK_LEARNT || !is_decimal(mask)) {
        forget_masks(self);
        return true;
    }
    leak(self);
    const bool is_other = self->recents == 0 || mask != self->recent[0];
    if (is_other) {
        keep(self, mask);
    }
    const bool is_change = is_other && self->is_quick && are_digit_like(self);
    self->score = (uint8_t)(self->score + (is_change && self->score < SCORE_DIGITS));
    self->in_row = (uint8_t)(!is_change ? 0 : self->in_row + (self->in_row < ROW_HELD));
    self->is_digits = self->is_digits || self->score == SCORE_DIGITS;
    return !self->is_digits && self->in_row < ROW_HELD;
}

mask_habit_t mask_guard_habit(const mask_guard_t *self, mask_policy_t policy)
{
    if (policy != MASK_LEARNT) {
        return policy == MASK_ALWAYS ? MASK_SENT : policy == MASK_NEVER ? MASK_NONE : MASK_UNKNOWN;
    }
    if (self->policy != (uint8_t)policy) {
        return MASK_UNKNOWN;
    }
    if (self->is_digits) {
        return MASK_DIGITS;
    }
    return self->frames < MASK_GUARD_FRAMES ? MASK_UNKNOWN : self->has_mask ? MASK_SENT : MASK_NONE;
}
