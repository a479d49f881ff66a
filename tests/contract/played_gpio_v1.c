/* SPDX-License-Identifier: MIT
 * played_gpio_v1.c - what linux_gpio_v1.c uses of libgpiod 1.x; see played_gpio.h.
 */
#include <errno.h>
#include <gpiod.h>
#include <stddef.h>

#include "failing.h"
#include "played_gpio.h"

#define EDGES_MAX 16

struct gpiod_line {
    played_chip_t *chip;
    unsigned offset;
};

struct gpiod_chip {
    played_chip_t *chip;
    struct gpiod_line line[PLAYED_LINES];
    bool is_requested;
};

static struct gpiod_chip chips[PLAYED_CHIPS_MAX];

struct gpiod_chip *gpiod_chip_open(const char *path)
{
    FAILING("gpiod_chip_open", NULL);
    played_chip_t *chip = played_chip_at(path);
    if (chip == NULL) {
        return NULL;
    }
    struct gpiod_chip *self = &chips[chip - played_gpio.chip];
    *self = (struct gpiod_chip){.chip = chip};
    for (unsigned i = 0; i < PLAYED_LINES; i++) {
        self->line[i] = (struct gpiod_line){chip, i};
    }
    played_gpio.things++;
    return self;
}

void gpiod_chip_close(struct gpiod_chip *self)
{
    played_gpio.things -= self->is_requested ? 2 : 1;
}

const char *gpiod_chip_label(struct gpiod_chip *self)
{
    return self->chip->label;
}

unsigned gpiod_chip_num_lines(struct gpiod_chip *self)
{
    (void)self;
    return PLAYED_LINES;
}

struct gpiod_line *gpiod_chip_get_line(struct gpiod_chip *self, unsigned offset)
{
    FAILING("gpiod_chip_get_line", NULL);
    return &self->line[offset];
}

const char *gpiod_line_name(struct gpiod_line *self)
{
    return self->chip->line[self->offset];
}

const char *gpiod_line_consumer(struct gpiod_line *self)
{
    return self->chip->is_used[self->offset] ? self->chip->consumer : NULL;
}

bool gpiod_line_is_used(struct gpiod_line *self)
{
    return self->chip->is_used[self->offset];
}

static void set_values(const struct gpiod_line_bulk *bulk, const int *values)
{
    played_chip_t *chip = bulk->lines[0]->chip;
    uint32_t all = __atomic_load_n(&chip->values, __ATOMIC_ACQUIRE);
    for (unsigned i = 0; i < bulk->num_lines; i++) {
        const uint32_t bit = 1u << bulk->lines[i]->offset;
        all = values[i] != 0 ? all | bit : all & ~bit;
    }
    __atomic_store_n(&chip->values, all, __ATOMIC_RELEASE);
}

int gpiod_line_request_bulk(struct gpiod_line_bulk *bulk, const struct gpiod_line_request_config *config, const int *values)
{
    FAILING("gpiod_line_request_bulk", -1);
    const bool has_edges = config->request_type == GPIOD_LINE_REQUEST_EVENT_BOTH_EDGES;
    played_chip_t *chip = bulk->lines[0]->chip;
    if (has_edges && chip->has_no_edges) {
        errno = ENXIO;
        return -1;
    }
    for (unsigned i = 0; i < bulk->num_lines; i++) {
        if (chip->is_used[bulk->lines[i]->offset]) {
            errno = EBUSY;
            return -1;
        }
    }
    chips[chip - played_gpio.chip].is_requested = true;
    played_gpio.things++;
    if (config->request_type == GPIOD_LINE_REQUEST_DIRECTION_OUTPUT) {
        set_values(bulk, values);
    }
    return 0;
}

int gpiod_line_set_value_bulk(struct gpiod_line_bulk *bulk, const int *values)
{
    FAILING("gpiod_line_set_value_bulk", -1);
    set_values(bulk, values);
    return 0;
}

int gpiod_line_get_value_bulk(struct gpiod_line_bulk *bulk, int *values)
{
    FAILING("gpiod_line_get_value_bulk", -1);
    for (unsigned i = 0; i < bulk->num_lines; i++) {
        values[i] = (int)(__atomic_load_n(&bulk->lines[i]->chip->values, __ATOMIC_ACQUIRE) >> bulk->lines[i]->offset & 1u);
    }
    (void)__atomic_fetch_add(&played_gpio.gets, 1, __ATOMIC_ACQ_REL);
    return 0;
}

unsigned played_pipe_of(unsigned line)
{
    return line;
}

int gpiod_line_event_get_fd(struct gpiod_line *self)
{
    FAILING("gpiod_line_event_get_fd", -1);
    return played_gpio.edge[self->offset][0];
}

int gpiod_line_event_read_multiple(struct gpiod_line *self, struct gpiod_line_event *events, unsigned most)
{
    unsigned line[EDGES_MAX];
    bool rose[EDGES_MAX];
    FAILING("gpiod_line_event_read_multiple", -1);
    const int count = played_take_edges(self->offset, line, rose, most < EDGES_MAX ? (int)most : EDGES_MAX);
    for (int i = 0; i < count; i++) {
        events[i].event_type = rose[i] ? GPIOD_LINE_EVENT_RISING_EDGE : GPIOD_LINE_EVENT_FALLING_EDGE;
    }
    return count;
}
