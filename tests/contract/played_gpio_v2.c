/* SPDX-License-Identifier: MIT
 * played_gpio_v2.c - what linux_gpio_v2.c uses of libgpiod 2.x; see played_gpio.h.
 */
#include <errno.h>
#include <gpiod.h>
#include <stddef.h>

#include "failing.h"
#include "played_gpio.h"

#define EDGES_MAX 48

struct gpiod_chip {
    played_chip_t *chip;
};

struct gpiod_chip_info {
    const played_chip_t *chip;
};

struct gpiod_line_info {
    const played_chip_t *chip;
    unsigned offset;
};

struct gpiod_line_settings {
    enum gpiod_line_direction direction;
    enum gpiod_line_edge edge;
    enum gpiod_line_value value;
};

struct gpiod_line_config {
    unsigned count;
    unsigned offset[PLAYED_LINES];
    struct gpiod_line_settings settings[PLAYED_LINES];
};

struct gpiod_request_config {
    const char *consumer;
};

struct gpiod_line_request {
    played_chip_t *chip;
    unsigned count;
    unsigned offset[PLAYED_LINES];
};

struct gpiod_edge_event {
    unsigned line;
    bool rose;
};

struct gpiod_edge_event_buffer {
    struct gpiod_edge_event event[EDGES_MAX];
};

/* One of each is enough: nobody has two at a time. */
static struct gpiod_chip chips[PLAYED_CHIPS_MAX];
static struct gpiod_chip_info chip_info;
static struct gpiod_line_info line_info;
static struct gpiod_line_settings line_settings;
static struct gpiod_line_config line_config;
static struct gpiod_request_config request_config;
static struct gpiod_line_request line_request;
static struct gpiod_edge_event_buffer event_buffer;

static void drop(const void *thing)
{
    played_gpio.things -= thing != NULL;
}

struct gpiod_chip *gpiod_chip_open(const char *path)
{
    FAILING("gpiod_chip_open", NULL);
    played_chip_t *chip = played_chip_at(path);
    if (chip == NULL) {
        return NULL;
    }
    struct gpiod_chip *self = &chips[chip - played_gpio.chip];
    self->chip = chip;
    played_gpio.things++;
    return self;
}

void gpiod_chip_close(struct gpiod_chip *self)
{
    drop(self);
}

struct gpiod_chip_info *gpiod_chip_get_info(struct gpiod_chip *self)
{
    FAILING("gpiod_chip_get_info", NULL);
    chip_info.chip = self->chip;
    played_gpio.things++;
    return &chip_info;
}

void gpiod_chip_info_free(struct gpiod_chip_info *self)
{
    drop(self);
}

const char *gpiod_chip_info_get_label(struct gpiod_chip_info *self)
{
    return self->chip->label;
}

size_t gpiod_chip_info_get_num_lines(struct gpiod_chip_info *self)
{
    (void)self;
    return PLAYED_LINES;
}

struct gpiod_line_info *gpiod_chip_get_line_info(struct gpiod_chip *self, unsigned offset)
{
    FAILING("gpiod_chip_get_line_info", NULL);
    line_info = (struct gpiod_line_info){self->chip, offset};
    played_gpio.things++;
    return &line_info;
}

void gpiod_line_info_free(struct gpiod_line_info *self)
{
    drop(self);
}

const char *gpiod_line_info_get_name(struct gpiod_line_info *self)
{
    return self->chip->line[self->offset];
}

const char *gpiod_line_info_get_consumer(struct gpiod_line_info *self)
{
    return self->chip->is_used[self->offset] ? self->chip->consumer : NULL;
}

bool gpiod_line_info_is_used(struct gpiod_line_info *self)
{
    return self->chip->is_used[self->offset];
}

struct gpiod_line_settings *gpiod_line_settings_new(void)
{
    FAILING("gpiod_line_settings_new", NULL);
    played_gpio.things++;
    return &line_settings;
}

void gpiod_line_settings_free(struct gpiod_line_settings *self)
{
    drop(self);
}

int gpiod_line_settings_set_direction(struct gpiod_line_settings *self, enum gpiod_line_direction direction)
{
    FAILING("gpiod_line_settings_set_direction", -1);
    self->direction = direction;
    return 0;
}

int gpiod_line_settings_set_edge_detection(struct gpiod_line_settings *self, enum gpiod_line_edge edge)
{
    FAILING("gpiod_line_settings_set_edge_detection", -1);
    self->edge = edge;
    return 0;
}

int gpiod_line_settings_set_bias(struct gpiod_line_settings *self, enum gpiod_line_bias bias)
{
    FAILING("gpiod_line_settings_set_bias", -1);
    (void)self;
    (void)bias;
    return 0;
}

void gpiod_line_settings_set_active_low(struct gpiod_line_settings *self, bool active_low)
{
    (void)self;
    (void)active_low;
}

int gpiod_line_settings_set_output_value(struct gpiod_line_settings *self, enum gpiod_line_value value)
{
    FAILING("gpiod_line_settings_set_output_value", -1);
    self->value = value;
    return 0;
}

struct gpiod_line_config *gpiod_line_config_new(void)
{
    FAILING("gpiod_line_config_new", NULL);
    line_config.count = 0;
    played_gpio.things++;
    return &line_config;
}

void gpiod_line_config_free(struct gpiod_line_config *self)
{
    drop(self);
}

int gpiod_line_config_add_line_settings(struct gpiod_line_config *self, const unsigned *offsets, size_t count,
                                        struct gpiod_line_settings *settings)
{
    FAILING("gpiod_line_config_add_line_settings", -1);
    for (size_t i = 0; i < count; i++) {
        self->offset[self->count] = offsets[i];
        self->settings[self->count++] = *settings;
    }
    return 0;
}

struct gpiod_request_config *gpiod_request_config_new(void)
{
    FAILING("gpiod_request_config_new", NULL);
    played_gpio.things++;
    return &request_config;
}

void gpiod_request_config_free(struct gpiod_request_config *self)
{
    drop(self);
}

void gpiod_request_config_set_consumer(struct gpiod_request_config *self, const char *consumer)
{
    self->consumer = consumer;
}

static void set_value(played_chip_t *chip, unsigned offset, enum gpiod_line_value value)
{
    const uint32_t bit = 1u << offset;
    if (value == GPIOD_LINE_VALUE_ACTIVE) {
        (void)__atomic_fetch_or(&chip->values, bit, __ATOMIC_ACQ_REL);
    } else {
        (void)__atomic_fetch_and(&chip->values, ~bit, __ATOMIC_ACQ_REL);
    }
}

struct gpiod_line_request *gpiod_chip_request_lines(struct gpiod_chip *self, struct gpiod_request_config *named,
                                                    struct gpiod_line_config *lines)
{
    FAILING("gpiod_chip_request_lines", NULL);
    (void)named;
    line_request = (struct gpiod_line_request){.chip = self->chip, .count = lines->count};
    for (unsigned i = 0; i < lines->count; i++) {
        errno = self->chip->is_used[lines->offset[i]] ? EBUSY : 0;
        errno = errno == 0 && self->chip->has_no_edges && lines->settings[i].edge == GPIOD_LINE_EDGE_BOTH ? ENXIO : errno;
        if (errno != 0) {
            return NULL;
        }
        line_request.offset[i] = lines->offset[i];
        if (lines->settings[i].direction == GPIOD_LINE_DIRECTION_OUTPUT) {
            set_value(self->chip, lines->offset[i], lines->settings[i].value);
        }
    }
    played_gpio.things++;
    return &line_request;
}

void gpiod_line_request_release(struct gpiod_line_request *self)
{
    drop(self);
}

int gpiod_line_request_get_values(struct gpiod_line_request *self, enum gpiod_line_value *values)
{
    FAILING("gpiod_line_request_get_values", -1);
    for (unsigned i = 0; i < self->count; i++) {
        const uint32_t all = __atomic_load_n(&self->chip->values, __ATOMIC_ACQUIRE);
        values[i] = (all >> self->offset[i] & 1u) != 0 ? GPIOD_LINE_VALUE_ACTIVE : GPIOD_LINE_VALUE_INACTIVE;
    }
    (void)__atomic_fetch_add(&played_gpio.gets, 1, __ATOMIC_ACQ_REL);
    return 0;
}

int gpiod_line_request_set_values(struct gpiod_line_request *self, const enum gpiod_line_value *values)
{
    FAILING("gpiod_line_request_set_values", -1);
    for (unsigned i = 0; i < self->count; i++) {
        set_value(self->chip, self->offset[i], values[i]);
    }
    return 0;
}

unsigned played_pipe_of(unsigned line)
{
    (void)line;
    return 0;
}

int gpiod_line_request_get_fd(struct gpiod_line_request *self)
{
    (void)self;
    return played_gpio.edge[0][0];
}

struct gpiod_edge_event_buffer *gpiod_edge_event_buffer_new(size_t capacity)
{
    FAILING("gpiod_edge_event_buffer_new", NULL);
    (void)capacity;
    played_gpio.things++;
    return &event_buffer;
}

void gpiod_edge_event_buffer_free(struct gpiod_edge_event_buffer *self)
{
    drop(self);
}

int gpiod_line_request_read_edge_events(struct gpiod_line_request *self, struct gpiod_edge_event_buffer *buffer, size_t most)
{
    unsigned line[EDGES_MAX];
    bool rose[EDGES_MAX];
    FAILING("gpiod_line_request_read_edge_events", -1);
    (void)self;
    const int count = played_take_edges(0, line, rose, most < EDGES_MAX ? (int)most : EDGES_MAX);
    for (int i = 0; i < count; i++) {
        buffer->event[i] = (struct gpiod_edge_event){line[i], rose[i]};
    }
    return count;
}

struct gpiod_edge_event *gpiod_edge_event_buffer_get_event(struct gpiod_edge_event_buffer *self, unsigned long index)
{
    return &self->event[index];
}

enum gpiod_edge_event_type gpiod_edge_event_get_event_type(struct gpiod_edge_event *self)
{
    return self->rose ? GPIOD_EDGE_EVENT_RISING_EDGE : GPIOD_EDGE_EVENT_FALLING_EDGE;
}

unsigned gpiod_edge_event_get_line_offset(struct gpiod_edge_event *self)
{
    return self->line;
}
