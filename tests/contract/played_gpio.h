/* SPDX-License-Identifier: MIT
 * played_gpio.h - GPIO chips that are played: what stands behind libgpiod's functions in test_gpio_failures.c, where
 * played_gpio_v1.c has those of 1.x and played_gpio_v2.c those of 2.x in the place of the library's own.
 */
#ifndef PLAYED_GPIO_H
#define PLAYED_GPIO_H

#include <stdbool.h>
#include <stdint.h>

#define PLAYED_CHIPS_MAX 3
#define PLAYED_LINES     4u

/** A chip, /dev/gpiochipN. Fields that two threads use are read and written atomically. */
typedef struct {
    const char *label;
    const char *line[PLAYED_LINES]; /**< names, NULL = none */
    bool is_used[PLAYED_LINES];     /**< by somebody else, whom consumer names */
    const char *consumer;
    bool has_no_edges;
    int refusal;     /**< error of opening it, 0 = none */
    int opens_left;  /**< so often it can be opened before it is gone; -1 = ever */
    uint32_t values; /**< of its lines as they stand: logical */
} played_chip_t;

typedef struct {
    played_chip_t chip[PLAYED_CHIPS_MAX];
    unsigned chips;
    unsigned things;           /**< chips, requests, lists and so on that are open */
    unsigned gets;             /**< how often values were read; atomic */
    int edge[PLAYED_LINES][2]; /**< pipes */
} played_gpio_t;

extern played_gpio_t played_gpio;

/** The chip of a path, NULL with errno where there is none. */
played_chip_t *played_chip_at(const char *path);

/** The library's side of a pipe: takes edges that wait, at most so many, and tells of which lines and whether they rose. */
int played_take_edges(unsigned pipe, unsigned *line, bool *rose, int most);

/** The pipe by which edges of a line come: 1.x has one for each line, 2.x one for all. */
unsigned played_pipe_of(unsigned line);

#endif
