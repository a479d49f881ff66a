/* SPDX-License-Identifier: MIT
 * linux_gpio_v2.c - linux_gpio_chip.h with libgpiod 2.x (Debian 13).
 */
#include <errno.h>
#include <gpiod.h>
#include <stdio.h>
#include <string.h>

#include "linux_gpio_chip.h"

#define EVENTS_AT_ONCE 48u

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
    self->chip = gpiod_chip_open(path);
    struct gpiod_chip_info *found = self->chip != NULL ? gpiod_chip_get_info(self->chip) : NULL;
    if (found == NULL) {
        const int error = error_now();
        linux_gpio_chip_close(self);
        return error;
    }
    copy_name(info->label, gpiod_chip_info_get_label(found));
    info->lines = (unsigned)gpiod_chip_info_get_num_lines(found);
    gpiod_chip_info_free(found);
    return 0;
}

void linux_gpio_chip_close(linux_gpio_chip_t *self)
{
    if (self->request != NULL) {
        gpiod_line_request_release(self->request);
    }
    if (self->events != NULL) {
        gpiod_edge_event_buffer_free(self->events);
    }
    if (self->chip != NULL) {
        gpiod_chip_close(self->chip);
    }
    memset(self, 0, sizeof *self);
}

int linux_gpio_chip_line(linux_gpio_chip_t *self, unsigned offset, linux_gpio_line_info_t *info)
{
    errno = 0;
    struct gpiod_line_info *found = gpiod_chip_get_line_info(self->chip, offset);
    if (found == NULL) {
        return error_now();
    }
    copy_name(info->name, gpiod_line_info_get_name(found));
    copy_name(info->consumer, gpiod_line_info_get_consumer(found));
    info->is_used = gpiod_line_info_is_used(found);
    gpiod_line_info_free(found);
    return 0;
}

/* Settings of line i: the same for all but the value of an output. */
static bool describe(struct gpiod_line_settings *settings, const linux_gpio_request_t *request, unsigned i)
{
    const bool is_active = (request->values >> i & 1u) != 0;
    gpiod_line_settings_set_active_low(settings, request->is_active_low);
    if (request->is_output) {
        return gpiod_line_settings_set_direction(settings, GPIOD_LINE_DIRECTION_OUTPUT) == 0 &&
               gpiod_line_settings_set_output_value(settings, is_active ? GPIOD_LINE_VALUE_ACTIVE : GPIOD_LINE_VALUE_INACTIVE) ==
                   0;
    }
    return gpiod_line_settings_set_direction(settings, GPIOD_LINE_DIRECTION_INPUT) == 0 &&
           gpiod_line_settings_set_bias(settings, request->is_active_low ? GPIOD_LINE_BIAS_PULL_UP : GPIOD_LINE_BIAS_PULL_DOWN) ==
               0 &&
           gpiod_line_settings_set_edge_detection(settings, request->has_edges ? GPIOD_LINE_EDGE_BOTH : GPIOD_LINE_EDGE_NONE) ==
               0;
}

static bool add_lines(struct gpiod_line_config *config, struct gpiod_line_settings *settings, const linux_gpio_request_t *request)
{
    for (unsigned i = 0; i < request->count; i++) {
        if (!describe(settings, request, i) ||
            gpiod_line_config_add_line_settings(config, &request->offset[i], 1, settings) != 0) {
            return false;
        }
    }
    return true;
}

int linux_gpio_chip_request(linux_gpio_chip_t *self, const linux_gpio_request_t *request)
{
    errno = 0;
    struct gpiod_line_settings *settings = gpiod_line_settings_new();
    struct gpiod_line_config *config = gpiod_line_config_new();
    struct gpiod_request_config *name = gpiod_request_config_new();
    self->events = self->events != NULL ? self->events : gpiod_edge_event_buffer_new(EVENTS_AT_ONCE);
    const bool is_ready = settings != NULL && config != NULL && name != NULL && self->events != NULL;
    if (is_ready && add_lines(config, settings, request)) {
        gpiod_request_config_set_consumer(name, request->consumer);
        self->request = gpiod_chip_request_lines(self->chip, name, config);
    }
    const int error = self->request != NULL ? 0 : error_now();
    gpiod_request_config_free(name);
    gpiod_line_config_free(config);
    gpiod_line_settings_free(settings);
    if (error == 0) {
        self->count = request->count;
        self->has_edges = request->has_edges;
        memcpy(self->offset, request->offset, sizeof self->offset);
    }
    return error;
}

int linux_gpio_chip_set(linux_gpio_chip_t *self, uint32_t values)
{
    enum gpiod_line_value value[LINUX_GPIO_LINES_MAX];
    for (unsigned i = 0; i < LINUX_GPIO_LINES_MAX; i++) {
        value[i] = (values >> i & 1u) != 0 ? GPIOD_LINE_VALUE_ACTIVE : GPIOD_LINE_VALUE_INACTIVE;
    }
    errno = 0;
    return gpiod_line_request_set_values(self->request, value) == 0 ? 0 : error_now();
}

int linux_gpio_chip_get(linux_gpio_chip_t *self, uint32_t *values)
{
    enum gpiod_line_value value[LINUX_GPIO_LINES_MAX];
    errno = 0;
    if (gpiod_line_request_get_values(self->request, value) != 0) {
        return error_now();
    }
    *values = 0;
    for (unsigned i = 0; i < self->count; i++) {
        *values |= value[i] == GPIOD_LINE_VALUE_ACTIVE ? 1u << i : 0u;
    }
    return 0;
}

unsigned linux_gpio_chip_fds(const linux_gpio_chip_t *self, int fd[LINUX_GPIO_LINES_MAX])
{
    if (!self->has_edges) {
        return 0;
    }
    fd[0] = gpiod_line_request_get_fd(self->request);
    return 1;
}

/* Which of the requested lines an offset is: a bit, 0 for none. */
static uint32_t bit_of(const linux_gpio_chip_t *self, unsigned offset)
{
    for (unsigned i = 0; i < self->count; i++) {
        if (self->offset[i] == offset) {
            return 1u << i;
        }
    }
    return 0;
}

int linux_gpio_chip_edges(linux_gpio_chip_t *self, unsigned index, uint32_t *rose, uint32_t *fell)
{
    (void)index;
    errno = 0;
    const int count = gpiod_line_request_read_edge_events(self->request, self->events, EVENTS_AT_ONCE);
    if (count < 0) {
        return error_now();
    }
    for (int i = 0; i < count; i++) {
        struct gpiod_edge_event *event = gpiod_edge_event_buffer_get_event(self->events, (unsigned long)i);
        uint32_t *seen = gpiod_edge_event_get_event_type(event) == GPIOD_EDGE_EVENT_RISING_EDGE ? rose : fell;
        *seen |= bit_of(self, gpiod_edge_event_get_line_offset(event));
    }
    return 0;
}
