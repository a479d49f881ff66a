/* SPDX-License-Identifier: MIT
 * healthy.h - the healthy pulse: a signal that toggles at a fixed rate as long as no problem exists. An external watchdog removes
 * the drives' torque when the edges stop. The line rests low. A program that hangs, has crashed or skips cycles makes no edges.
 * Pure; the caller owns healthy_t; time is an argument.
 */
#ifndef HEAVE_HEALTHY_H
#define HEAVE_HEALTHY_H

#include <stdbool.h>
#include <stdint.h>

/** Settings of the pulse. */
typedef struct {
    uint8_t relay;        /**< [0, 12] relay that is used for the pulse only; 0: a line of its own, or none */
    uint32_t toggle_ms;   /**< [1, 1000] between two edges, rounded up to whole cycles */
    uint32_t off_ms;      /**< [0, 60000] shortest pause after a problem, so that no watchdog overlooks a short one */
    uint32_t late_cycles; /**< more late cycles than this are a problem */
} healthy_settings_t;

/** The pulse; private. All zero: the last problem was just before time zero. */
typedef struct {
    bool level;
    uint64_t ill_us;     /**< time of the last problem */
    uint64_t changed_us; /**< of the last edge */
} healthy_t;

/** Once per cycle.
 *  @param is_well no problem exists in this cycle
 *  @return the level of the line from now on */
bool healthy_step(healthy_t *self, const healthy_settings_t *settings, bool is_well, uint64_t now_us);

/** True if the pulse runs, as of the last step. */
bool healthy_is_running(const healthy_t *self, const healthy_settings_t *settings, uint64_t now_us);

#endif
