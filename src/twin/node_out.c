/* SPDX-License-Identifier: MIT
 * node_out.c - what a simulated drive sends, at once or later; see node_internal.h.
 */
#include <string.h>

#include "twin/node_internal.h"

node_t *node_head(node_t *self)
{
    return self->head != NULL ? self->head : self;
}

void node_put(node_t *self, uint32_t id, const uint8_t *data, uint8_t length)
{
    const node_t *head = node_head(self);
    can_frame_t frame = {.id = id, .length = length};
    if (head->is_mute || head->is_cut) {
        return;
    }
    if (length > 0) {
        memcpy(frame.data, data, length);
    }
    self->out.put(self->out.ctx, &frame);
}

void node_put_later(node_t *self, uint32_t delay_us, uint32_t id, const uint8_t *data, uint8_t length)
{
    if (delay_us == 0) {
        node_put(self, id, data, length);
    } else if (self->waits < NODE_WAITING_MAX) {
        node_waiting_t *item = &self->waiting[self->waits++];
        *item = (node_waiting_t){.due_us = self->now_us + delay_us, .frame = {.id = id, .length = length}};
        memcpy(item->frame.data, data, length);
    }
}

void node_put_due(node_t *self)
{
    uint32_t kept = 0;
    for (uint32_t i = 0; i < self->waits; i++) {
        const node_waiting_t item = self->waiting[i];
        if (item.due_us > self->now_us) {
            self->waiting[kept++] = item;
        } else {
            node_put(self, item.frame.id, item.frame.data, item.frame.length);
        }
    }
    self->waits = kept;
}

void node_emergency(node_t *self, uint16_t code, uint8_t error_register)
{
    const uint8_t data[8] = {(uint8_t)code, (uint8_t)(code >> 8), error_register};
    node_put(self, 0x80u + self->number, data, 8);
}
