/* SPDX-License-Identifier: MIT
 * node_text.c - see node_text.h.
 */
#include "twin/node_text.h"

#include <stddef.h>
#include <string.h>

#define READ         0x40u
#define READ_SEGMENT 0x60u
#define SPECIFIER    0xE0u
#define TOGGLE       0x10u
#define SEGMENT_MAX  7u

static const struct {
    uint16_t index;
    const char *text;
} k_texts[] = {{0x1008, "heave-twin"}, {0x1009, "none, it is simulated"}, {0x100A, HEAVE_VERSION}};

static const char *find(uint16_t index, uint8_t sub)
{
    for (size_t i = 0; i < sizeof k_texts / sizeof k_texts[0]; i++) {
        if (k_texts[i].index == index && sub == 0) {
            return k_texts[i].text;
        }
    }
    return NULL;
}

static void begin(node_text_t *self, const uint8_t *from, size_t size, const uint8_t request[8], uint8_t data[8])
{
    self->at = from;
    self->left = size;
    self->is_toggled = false;
    memcpy(data, request, 4);
    data[0] = 0x41;
    data[4] = (uint8_t)size;
}

static void go_on(node_text_t *self, uint8_t data[8])
{
    const size_t now = self->left < SEGMENT_MAX ? self->left : SEGMENT_MAX;
    const bool is_last = now == self->left;
    data[0] = (uint8_t)((self->is_toggled != self->is_inverted ? TOGGLE : 0u) | (SEGMENT_MAX - now) << 1 | (is_last ? 1u : 0u));
    memcpy(&data[1], self->at, now);
    self->is_toggled = !self->is_toggled;
    self->at = is_last ? NULL : self->at + now;
    self->left -= now;
}

bool node_text_hear(node_text_t *self, const uint8_t request[8], uint8_t data[8])
{
    const uint16_t index = (uint16_t)(request[1] | request[2] << 8);
    const bool is_begin = (request[0] & SPECIFIER) == READ;
    const char *text = is_begin ? find(index, request[3]) : NULL;
    const bool is_next =
        (request[0] & SPECIFIER) == READ_SEGMENT && self->at != NULL && ((request[0] & TOGGLE) != 0) == self->is_toggled;
    memset(data, 0, 8);
    if (text != NULL) {
        begin(self, (const uint8_t *)text, strlen(text), request, data);
    } else if (is_next) {
        go_on(self, data);
    } else {
        self->at = NULL;
    }
    return text != NULL || is_next;
}

void node_text_number(node_text_t *self, const uint8_t request[8], uint32_t value, uint8_t bytes, uint8_t data[8])
{
    for (unsigned i = 0; i < sizeof self->number; i++) {
        self->number[i] = (uint8_t)(value >> (8u * i));
    }
    memset(data, 0, 8);
    begin(self, self->number, bytes, request, data);
}
