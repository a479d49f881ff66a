/* SPDX-License-Identifier: MIT
 * gpio_sim.h - GPIO chips that the kernel simulates (gpio-sim): made and taken away through configfs, their lines seen and pulled
 * from outside through sysfs, as the world on the other side of the terminals would. Root, on a kernel of its own
 * (tests/lib/kernel.py).
 */
#ifndef GPIO_SIM_H
#define GPIO_SIM_H

#include <stdbool.h>

#define GPIO_SIM_LINES_MAX 16

/** A chip. */
typedef struct {
    char folder[64]; /**< in configfs */
    char sysfs[128]; /**< of its lines */
    unsigned lines;
    int value[GPIO_SIM_LINES_MAX]; /**< descriptors of their levels */
    bool is_live;
} gpio_sim_t;

/** Makes a chip; its line n is called PREFIXn.
 *  @param prefix NULL: its lines have no names
 *  @return false: this kernel cannot */
bool gpio_sim_make(gpio_sim_t *self, const char *name, const char *label, unsigned lines, const char *prefix);

/** Takes the chip away, whoever uses it; what it was made from stays. */
void gpio_sim_unplug(gpio_sim_t *self);

/** Unplugs and forgets it. */
void gpio_sim_drop(gpio_sim_t *self);

/** Level of a line now. */
bool gpio_sim_level(const gpio_sim_t *self, unsigned line);

/** Pulls a line from outside. */
void gpio_sim_pull(const gpio_sim_t *self, unsigned line, bool is_up);

#endif
