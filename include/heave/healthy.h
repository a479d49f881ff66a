/* SPDX-License-Identifier: MIT
 * healthy.h - the healthy pulse: a signal that changes at a steady pace as long as all is well, for a watchdog outside of this
 * program that takes the drives' torque away when it stays away. Rests low. Whoever hangs, dies or skips cycles makes no edges.
 * Pure; the caller owns healthy_t; time is an argument.
 */
#ifndef HEAVE_HEALTHY_H
#define HEAVE_HEALTHY_H

#include <stdbool.h>
#include <stdint.h>

/** How it is made. */
typedef struct {
    uint8_t relay;      /**< [0, 12] the relay that carries it and nothing else; 0: it has a line of its own, or there is none */
    uint32_t toggle_ms; /**< [1, 1000] between two edges, rounded up to whole cycles */
    uint32_t off_ms;    /**< [0, 60000] it stays away for so long at least: no watchdog overlooks a short trouble */
    uint32_t late_cycles; /**< a cycle that is late by more than so many is a trouble */
} healthy_settings_t;

/** The pulse; private. All zero: as if something had been wrong just before time zero. */
typedef struct {
    bool level;
    uint64_t ill_us;     /**< when something was wrong last */
    uint64_t changed_us; /**< of the last edge */
} healthy_t;

/** Once per cycle.
 *  @param is_well whether all is well in this cycle
 *  @return the level of the line from now on */
bool healthy_step(healthy_t *self, const healthy_settings_t *settings, bool is_well, uint64_t now_us);

/** True while it runs, as of the last step. */
bool healthy_is_running(const healthy_t *self, const healthy_settings_t *settings, uint64_t now_us);

#endif
