/* SPDX-License-Identifier: MIT
 * mask_guard.h - whether the last value of a frame is a relay mask.
 * Masks may be missing, and a decimal comma looks like one: `@A3:0,0,13,37#` is z = 13 with relay mask 37 hex, or z = 13.37
 * without a mask. One frame cannot tell, but its sender can: most senders send a mask in every frame, or in none. After
 * MASK_GUARD_FRAMES frames in a row of one form the other form is refused, until the sender has been silent for
 * MASK_GUARD_GAP_US; refused frames are no silence. Masks that change more than twice a second between many, and are decimal
 * digits all of them, 8 or 9 among them, are the digits of a value: no relay follows these, until a mask has a letter, or the
 * sender is silent. Masks of frames that are MASK_GUARD_QUICK_US apart or more do not count, nor do patterns that go round, with
 * equally many relays in each.
 * T frames have no mask; they count as no frame of either form. Owns no clock and no settings; one owner.
 */
#ifndef HEAVE_MASK_GUARD_H
#define HEAVE_MASK_GUARD_H

#include "heave/settings.h"

#define MASK_GUARD_FRAMES   10u
#define MASK_GUARD_GAP_US   1000000u
#define MASK_GUARD_QUICK_US 120000u
#define MASK_GUARD_RECENT   8u

/** Of a sender: whether its frames have a mask. */
typedef enum {
    MASK_UNKNOWN, /**< not known yet, or MASK_ANY */
    MASK_SENT,    /**< in each frame */
    MASK_NONE,    /**< in none */
    MASK_DIGITS   /**< what looks like one changes like the digits of a value: the relays are at the safe mask */
} mask_habit_t;

/** Zeroed: nothing is known yet. Members are private to src/gateway. */
typedef struct {
    uint64_t last_us;                   /**< the last frame, refused ones too */
    uint64_t leaked_us;                 /**< the score was right then */
    uint16_t recent[MASK_GUARD_RECENT]; /**< masks, each other than the next one; the last one first */
    uint8_t recents;                    /**< so many of them are valid */
    uint8_t score;                      /**< changes as of digits, less what has leaked away */
    uint8_t in_row;                     /**< such changes in a row, up to those that wait */
    uint8_t frames;                     /**< in a row of one form, up to MASK_GUARD_FRAMES */
    uint8_t policy;                     /**< mask_policy_t of the last frame: with another one all starts anew */
    bool has_mask;                      /**< that form */
    bool is_quick;                      /**< the last frame came soon after the one before it */
    bool is_digits;
} mask_guard_t;

/** Starts anew: another sender. */
void mask_guard_restart(mask_guard_t *self);

/** Whether the policy allows the form of a frame, whoever sent it. */
bool mask_guard_allows(mask_policy_t policy, const frame_t *frame);

/** Judges an allowed frame of the sender that drives, in the order in which they came.
 *  @return false: refuse it, its form is not that of its sender */
bool mask_guard_passes(mask_guard_t *self, mask_policy_t policy, const frame_t *frame, uint64_t now_us);

/** Takes the mask of a frame that passed.
 *  @return true: the relays may follow it; false: they keep what they follow, or go to the safe mask if the habit is MASK_DIGITS
 */
bool mask_guard_follows(mask_guard_t *self, mask_policy_t policy, uint16_t mask);

/** What is known of the sender, or set. */
mask_habit_t mask_guard_habit(const mask_guard_t *self, mask_policy_t policy);

#endif
