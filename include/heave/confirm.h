/* SPDX-License-Identifier: MIT
 * confirm.h - far jumps of a sender are followed only once a second frame confirms them.
 * A target further from the last one followed than a set distance waits. The next frame tells what it was: near the one that
 * waits, and it is followed itself, with its own time; anywhere else, and the one that waited is dropped. So is one that nothing
 * confirms for CONFIRM_WAIT_US. The same frame again within CONFIRM_APART_US is what a network makes of one and confirms nothing.
 * To be told from gate.h, which judges samples of a stream by the accelerations they ask for. Owns no clock and no settings; one
 * owner.
 */
#ifndef HEAVE_CONFIRM_H
#define HEAVE_CONFIRM_H

#include "heave/motion.h"

#define CONFIRM_WAIT_US  1000000u
#define CONFIRM_APART_US 5000u

/** What is far: more than that, on any axis. */
typedef struct {
    q32_t mm_q32;  /**< of shifts, and of extensions; 0 = nothing is */
    q32_t deg_q32; /**< of rotations and the rotation motor; 0 = nothing is */
} confirm_distance_t;

/** A jump that was not followed, for display. */
typedef struct {
    motion_space_t space;
    uint8_t axis;    /**< an axis of the pose, an index of a cylinder, or AXIS_ANGLE */
    q32_t value_q32; /**< deg or mm */
    q32_t from_q32;
} confirm_jump_t;

/** Zeroed: nothing was followed yet. Members are private to src/gateway. */
typedef struct {
    bool has_last;
    motion_target_t last; /**< followed, or where the platform was when following began */
    bool is_waiting;
    motion_target_t waiting;
    uint64_t waiting_us; /**< since when */
    confirm_jump_t jump; /**< what it will be if nothing confirms it */
    uint32_t dropped;    /**< jumps that nothing confirmed; wraps */
    confirm_jump_t drop; /**< the last one of them */
} confirm_t;

/** Following begins anew: nothing waits, and the next target is measured from where the platform is then. */
void confirm_restart(confirm_t *self);

/** Judges a target before it is followed.
 *  @param here where the platform is, in the space of the target, and with the angle of its rotation motor
 *  @return true: to be followed, then tell confirm_followed(); false: it waits, or is one that waits already */
bool confirm_passes(confirm_t *self, const confirm_distance_t *distance, const motion_target_t *here,
                    const motion_target_t *target, uint64_t now_us);

/** The target is followed. */
void confirm_followed(confirm_t *self, const motion_target_t *target);

/** Once per cycle: drops what has waited for too long. */
void confirm_cycle(confirm_t *self, uint64_t now_us);

/** True for one that may be used, whatever file it comes from; see sane.h. */
bool confirm_is_sane(const confirm_t *self);

#endif
