/* SPDX-License-Identifier: MIT
 * linux_gpio_chip.h - the little of libgpiod that Heave needs, the same for both of its generations, which share nothing but the
 * name: linux_gpio_v1.c is for 1.x, linux_gpio_v2.c for 2.x, and the build takes the one that fits the library it finds.
 * Values are logical: 1 is the active level. Every function returns 0, or an error number of errno.h. One thread; calls go to the
 * kernel, and where a chip hangs on a slow bus they take as long as that. Nothing is allocated but in open and request.
 */
#ifndef LINUX_GPIO_CHIP_H
#define LINUX_GPIO_CHIP_H

#include <stdbool.h>
#include <stdint.h>

#define LINUX_GPIO_LINES_MAX 12u
#define LINUX_GPIO_NAME_SIZE 32u /**< the kernel's GPIO_MAX_NAME_SIZE */

/** What the kernel tells of a chip. */
typedef struct {
    char label[LINUX_GPIO_NAME_SIZE];
    unsigned lines;
} linux_gpio_chip_info_t;

/** What the kernel tells of a line. */
typedef struct {
    char name[LINUX_GPIO_NAME_SIZE];     /**< "" where it has none */
    char consumer[LINUX_GPIO_NAME_SIZE]; /**< who has it, "" where nobody says so */
    bool is_used;
} linux_gpio_line_info_t;

/** How lines are to be requested: all of them alike. */
typedef struct {
    const char *consumer;
    unsigned count; /**< [1, LINUX_GPIO_LINES_MAX] */
    unsigned offset[LINUX_GPIO_LINES_MAX];
    bool is_output;
    bool is_active_low;
    bool has_edges;  /**< inputs: tells of edges */
    uint32_t values; /**< outputs: bit n is line n from the first moment on; inputs are pulled to the inactive level, where the
                          chip can do that */
} linux_gpio_request_t;

/** A chip, and the lines of it that are requested; private. */
typedef struct {
    void *chip;
    void *request;                    /**< 2.x */
    void *events;                     /**< 2.x */
    void *line[LINUX_GPIO_LINES_MAX]; /**< 1.x */
    unsigned count;
    unsigned offset[LINUX_GPIO_LINES_MAX];
    bool has_edges;
} linux_gpio_chip_t;

/** Opens /dev/gpiochipN. */
int linux_gpio_chip_open(linux_gpio_chip_t *self, const char *path, linux_gpio_chip_info_t *info);

/** Gives everything back; harmless on one that is not open. */
void linux_gpio_chip_close(linux_gpio_chip_t *self);

/** Looks at a line, requested or not. */
int linux_gpio_chip_line(linux_gpio_chip_t *self, unsigned offset, linux_gpio_line_info_t *info);

/** Requests lines, all in one; once for a chip that is open.
 *  @return EBUSY: one of them is in use */
int linux_gpio_chip_request(linux_gpio_chip_t *self, const linux_gpio_request_t *request);

/** Sets all requested lines in one call of the kernel. */
int linux_gpio_chip_set(linux_gpio_chip_t *self, uint32_t values);

/** Reads all requested lines. */
int linux_gpio_chip_get(linux_gpio_chip_t *self, uint32_t *values);

/** Descriptors that become readable with an edge.
 *  @return how many; 0 without edges */
unsigned linux_gpio_chip_fds(const linux_gpio_chip_t *self, int fd[LINUX_GPIO_LINES_MAX]);

/** Takes the edges that wait behind a descriptor that is readable.
 *  @param index   of the descriptor
 *  @param rose    |= bits of lines that have become active
 *  @param fell    |= bits of lines that have become inactive */
int linux_gpio_chip_edges(linux_gpio_chip_t *self, unsigned index, uint32_t *rose, uint32_t *fell);

#endif
