/* SPDX-License-Identifier: MIT
 * confirm.h - far jumps of a sender are followed only after a second frame has confirmed them.
 * A target that is further than a configured distance from the last one followed has to wait. If the next frame is near it, the
 * next frame is followed, with its own time. If the next frame is anywhere else, or none comes within CONFIRM_WAIT_US, the
 * waiting target is dropped. An identical frame within CONFIRM_APART_US may be a copy made by the network and confirms nothing.
 * spike_filter.h is different: it judges samples of a stream by the acceleration that they need. Owns no clock and no settings;
 * one owner.
 */
#ifndef HEAVE_CONFIRM_H
#define HEAVE_CONFIRM_H

#include "heave/motion.h"

#define CONFIRM_WAIT_US  1000000u
#define CONFIRM_APART_US 5000u

/** Distances beyond which a jump is far, on any axis. */
typedef struct {
    q32_t mm_q32;  /**< of translations and extensions; 0 = no limit */
    q32_t deg_q32; /**< of rotations and the rotation motor; 0 = no limit */
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
    motion_target_t last; /**< the last target followed, or the position of the platform when following began */
    bool is_waiting;
    motion_target_t waiting;
    uint64_t waiting_us; /**< time at which it began to wait */
    confirm_jump_t jump; /**< to be reported if nothing confirms it */
    uint32_t dropped;    /**< jumps that nothing confirmed; wraps */
    confirm_jump_t drop; /**< the last one of them */
} confirm_t;

/** Restarts: drops a waiting target. The next target is compared with the position of the platform at that time. */
void confirm_restart(confirm_t *self);

/** Judges a target before it is followed.
 *  @param here position of the platform, in the space of the target, with the angle of the rotation motor
 *  @return true: follow it, and call confirm_followed(); false: it waits, or is a copy of the waiting one */
bool confirm_passes(confirm_t *self, const confirm_distance_t *distance, const motion_target_t *here,
                    const motion_target_t *target, uint64_t now_us);

/** Reports that a target is followed. */
void confirm_followed(confirm_t *self, const motion_target_t *target);

/** Drops a target that has waited for too long. Call once per cycle. */
void confirm_cycle(confirm_t *self, uint64_t now_us);

#endif
