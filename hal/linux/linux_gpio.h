/* SPDX-License-Identifier: MIT
 * linux_gpio.h - GPIO lines of Linux by name: finds the chip that has them, looks at them, and requests them, saying in words
 * what is wrong. Lines that belong together have to be on one chip, since only then they can be requested and set in one. Numbers
 * of chips (gpiochip0) are no names: they change from kernel to kernel and with every USB device. Before the loop starts.
 */
#ifndef LINUX_GPIO_H
#define LINUX_GPIO_H

#include <stddef.h>

#include "heave/status.h"
#include "linux_gpio_chip.h"

/** Lines as a user names them. */
typedef struct {
    const char *chip;                       /**< label of the chip; NULL or "": whichever has them all */
    unsigned count;                         /**< [1, LINUX_GPIO_LINES_MAX] */
    const char *line[LINUX_GPIO_LINES_MAX]; /**< name of a line; digits alone are its number, which takes a chip */
} linux_gpio_names_t;

/** Where they are. */
typedef struct {
    char path[LINUX_GPIO_NAME_SIZE]; /**< /dev/gpiochipN, until the chips change */
    char label[LINUX_GPIO_NAME_SIZE];
    unsigned count;
    unsigned offset[LINUX_GPIO_LINES_MAX];
} linux_gpio_place_t;

#define LINUX_GPIO_TEXT_SIZE 256u

/** Looks for lines on the chips of this machine. Changes nothing.
 *  @param text  out: what is wrong and what helps, "" with HV_OK
 *  @return HV_OK; HV_ERR_NOSUP: there is no chip that may be looked at; HV_ERR_RANGE: the lines or the chip are not there, are
 * not on one chip, or are on more than one */
hv_status_t linux_gpio_find(const linux_gpio_names_t *names, linux_gpio_place_t *place,
                            char text[LINUX_GPIO_TEXT_SIZE]) HV_MUST_CHECK;

/** Finds the lines and requests them.
 *  @param request  its count and offset are filled in here. Where has_edges is asked for and cannot be had, it is taken back.
 *  @param text     out: as above; which line is in use, and by whom
 *  @return HV_OK; HV_ERR_IO */
hv_status_t linux_gpio_request(linux_gpio_chip_t *chip, const linux_gpio_names_t *names, linux_gpio_request_t *request,
                               char text[LINUX_GPIO_TEXT_SIZE]) HV_MUST_CHECK;

#endif
