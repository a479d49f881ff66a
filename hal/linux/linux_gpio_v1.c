/* SPDX-License-Identifier: MIT
 * linux_gpio_v1.c - linux_gpio_chip.h with libgpiod 1.x (Debian 12, Ubuntu 22.04 and 24.04).
 */
#include <errno.h>
#include <gpiod.h>
#include <stdio.h>
#include <string.h>

#include "linux_gpio_chip.h"

#define EVENTS_AT_ONCE 16u /* as many as the kernel keeps for a line */

static void copy_name(char to[LINUX_GPIO_NAME_SIZE], const char *from)
{
    (void)snprintf(to, LINUX_GPIO_NAME_SIZE, "%s", from != NULL ? from : "");
}

static int error_now(void)
{
    return errno != 0 ? errno : EIO;
}

int linux_gpio_chip_open(linux_gpio_chip_t *self, const char *path, linux_gpio_chip_info_t *info)
{
    memset(self, 0, sizeof *self);
    errno = 0;
    struct gpiod_chip *chip = gpiod_chip_open(path);
    if (chip == NULL) {
        return error_now();
    }
    self->chip = chip;
    copy_name(info->label, gpiod_chip_label(chip));
    info->lines = gpiod_chip_num_lines(chip);
    return 0;
}

void linux_gpio_chip_close(linux_gpio_chip_t *self)
{
    if (self->chip != NULL) {
        gpiod_chip_close(self->chip); /* with the lines of it */
    }
    memset(self, 0, sizeof *self);
}

int linux_gpio_chip_line(linux_gpio_chip_t *self, unsigned offset, linux_gpio_line_info_t *info)
{
    errno = 0;
    struct gpiod_line *line = gpiod_chip_get_line(self->chip, offset);
    if (line == NULL) {
        return error_now();
    }
    copy_name(info->name, gpiod_line_name(line));
    copy_name(info->consumer, gpiod_line_consumer(line));
    info->is_used = gpiod_line_is_used(line);
    return 0;
}

/* The requested lines as the library's functions want them. */
static struct gpiod_line_bulk bulk_of(const linux_gpio_chip_t *self)
{
    struct gpiod_line_bulk bulk;
    gpiod_line_bulk_init(&bulk);
    for (unsigned i = 0; i < self->count; i++) {
        gpiod_line_bulk_add(&bulk, self->line[i]);
    }
    return bulk;
}

static int flags_of(const linux_gpio_request_t *request)
{
    const int polarity = request->is_active_low ? GPIOD_LINE_REQUEST_FLAG_ACTIVE_LOW : 0;
    if (request->is_output) {
        return polarity;
    }
    return polarity | (request->is_active_low ? GPIOD_LINE_REQUEST_FLAG_BIAS_PULL_UP : GPIOD_LINE_REQUEST_FLAG_BIAS_PULL_DOWN);
}

int linux_gpio_chip_request(linux_gpio_chip_t *self, const linux_gpio_request_t *request)
{
    int value[LINUX_GPIO_LINES_MAX] = {0};
    struct gpiod_line_request_config config = {.consumer = request->consumer, .flags = flags_of(request)};
    if (request->is_output) {
        config.request_type = GPIOD_LINE_REQUEST_DIRECTION_OUTPUT;
    } else {
        config.request_type = request->has_edges ? GPIOD_LINE_REQUEST_EVENT_BOTH_EDGES : GPIOD_LINE_REQUEST_DIRECTION_INPUT;
    }
    errno = 0;
    for (unsigned i = 0; i < request->count; i++) {
        self->line[i] = gpiod_chip_get_line(self->chip, request->offset[i]);
        if (self->line[i] == NULL) {
            return error_now();
        }
        value[i] = (int)(request->values >> i & 1u);
    }
    self->count = request->count;
    struct gpiod_line_bulk bulk = bulk_of(self);
    if (gpiod_line_request_bulk(&bulk, &config, value) != 0) {
        self->count = 0;
        return error_now();
    }
    self->has_edges = request->has_edges;
    return 0;
}

int linux_gpio_chip_set(linux_gpio_chip_t *self, uint32_t values)
{
    int value[LINUX_GPIO_LINES_MAX] = {0};
    struct gpiod_line_bulk bulk = bulk_of(self);
    for (unsigned i = 0; i < self->count; i++) {
        value[i] = (int)(values >> i & 1u);
    }
    errno = 0;
    return gpiod_line_set_value_bulk(&bulk, value) == 0 ? 0 : error_now();
}

int linux_gpio_chip_get(linux_gpio_chip_t *self, uint32_t *values)
{
    int value[LINUX_GPIO_LINES_MAX] = {0};
    struct gpiod_line_bulk bulk = bulk_of(self);
    errno = 0;
    if (gpiod_line_get_value_bulk(&bulk, value) != 0) {
        return error_now();
    }
    *values = 0;
    for (unsigned i = 0; i < self->count; i++) {
        *values |= value[i] != 0 ? 1u << i : 0u;
    }
    return 0;
}

unsigned linux_gpio_chip_fds(const linux_gpio_chip_t *self, int fd[LINUX_GPIO_LINES_MAX])
{
    const unsigned count = self->has_edges ? self->count : 0;
    for (unsigned i = 0; i < count; i++) {
        fd[i] = gpiod_line_event_get_fd(self->line[i]);
        if (fd[i] < 0) {
            return 0; /* then it takes looking */
        }
    }
    return count;
}

int linux_gpio_chip_edges(linux_gpio_chip_t *self, unsigned index, uint32_t *rose, uint32_t *fell)
{
    struct gpiod_line_event event[EVENTS_AT_ONCE];
    errno = 0;
    const int count = gpiod_line_event_read_multiple(self->line[index], event, EVENTS_AT_ONCE);
    if (count < 0) {
        return error_now();
    }
    for (int i = 0; i < count; i++) {
        uint32_t *seen = event[i].event_type == GPIOD_LINE_EVENT_RISING_EDGE ? rose : fell;
        *seen |= 1u << index;
    }
    return 0;
}
