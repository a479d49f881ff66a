/* SPDX-License-Identifier: MIT
 * sim_chip.h - a GPIO chip that the kernel simulates (gpio-sim), seen and pulled from the other side of its terminals: configfs
 * makes and plugs it, sysfs shows and pulls its lines. It takes root, and a kernel with gpio-sim.
 */
#ifndef HEAVE_TWIN_SIM_CHIP_H
#define HEAVE_TWIN_SIM_CHIP_H

#include <pthread.h>
#include <stdbool.h>
#include <stddef.h>

#define SIM_CHIP_LINES_MAX 1024u /* of the kernel */

/** A chip. */
typedef struct {
    char folder[96]; /**< in configfs */
    char sysfs[128]; /**< of its lines, while it is plugged */
    bool is_made, is_live;
    bool is_leaving; /**< a thread pulls it out */
    pthread_t thread;
} sim_chip_t;

/** Takes away what a program of that kind left behind that ended without doing so. */
void sim_chip_tidy(void);

/** Makes a chip without names; it is not plugged yet.
 *  @param number this program's first chip is 0
 *  @param why    what is wrong and what to do, where false is returned */
bool sim_chip_make(sim_chip_t *self, unsigned number, const char *label, unsigned lines, char *why, size_t size);

/** Names a line, before the chip is plugged. */
bool sim_chip_name(const sim_chip_t *self, unsigned line, const char *name, char *why, size_t size);

/** Plugs it, or pulls it out, whoever uses it. Does not wait for a chip to be out: the kernel takes some ticks of its clock for
 * that. Plugging it again does.
 *  @param why what is wrong, where false is returned */
bool sim_chip_plug(sim_chip_t *self, bool is_live, char *why, size_t size);

/** Pulls it out and forgets it. */
void sim_chip_drop(sim_chip_t *self);

/** What shows the level of a line of a plugged chip, for sim_chip_level; -1: nothing does. */
int sim_chip_open(const sim_chip_t *self, unsigned line);

/** The level, whoever makes it; -1 = unknown. */
int sim_chip_level(int fd);

/** Pulls a line of a plugged chip, until its user asks the chip for another resistor. */
void sim_chip_pull(const sim_chip_t *self, unsigned line, bool is_up);

#endif
