/* SPDX-License-Identifier: MIT
 * node_sdo.c - the SDO server of a simulated drive, expedited but for texts; see node_internal.h.
 */
#include <string.h>

#include "twin/node_internal.h"

#define BAD_COMMAND 0x05040001u
#define STOPPED     0x04u

/* Bytes in use of an answer of one frame. */
static uint8_t used_of(const uint8_t data[8])
{
    switch (data[0] & 0xE0u) {
    case 0x40:
        return (data[0] & 2u) != 0 ? (uint8_t)(8u - (data[0] >> 2 & 3u)) : 8u;
    case 0x60:
        return 4;
    default:
        return 8;
    }
}

static void put_answer(node_t *self, const uint8_t data[8])
{
    const uint8_t length = quirk_is(self->drive.quirks, QUIRK_SHORT_SDO) ? used_of(data) : 8u;
    node_put_later(self, self->sdo_us, 0x580u + self->number, data, length);
}

static void answer(node_t *self, uint8_t command, const uint8_t *request, uint32_t value)
{
    const uint8_t data[8] = {command,
                             request[1],
                             request[2],
                             request[3],
                             (uint8_t)value,
                             (uint8_t)(value >> 8),
                             (uint8_t)(value >> 16),
                             (uint8_t)(value >> 24)};
    put_answer(self, data);
}

/* A value, and what the drive makes of lengths in its maps. */
static void answer_value(node_t *self, const object_t *row, const uint8_t *request)
{
    const bool is_mapping = row->index >= 0x1400 && row->index < 0x1C00 && (row->index & 0x200) != 0 && row->sub > 0;
    const uint32_t value = row->value | (is_mapping && quirk_is(self->drive.quirks, QUIRK_LENGTH_BIT) ? 0x80u : 0u);
    if (quirk_is(self->drive.quirks, QUIRK_SEGMENTS) || quirk_is(self->drive.quirks, QUIRK_WRONG_TOGGLE)) {
        uint8_t data[8];
        self->text.is_inverted = quirk_is(self->drive.quirks, QUIRK_WRONG_TOGGLE);
        node_text_number(&self->text, request, value, row->bytes, data);
        put_answer(self, data);
    } else {
        answer(self, (uint8_t)(0x43 | (4 - row->bytes) << 2), request, value);
    }
}

/* What a write means beyond its value. Returns an abort code. */
static uint32_t written(node_t *self, uint16_t index, uint32_t value)
{
    switch (index) {
    case 0x100C:
    case 0x100D:
    case 0x1016:
        self->master_due_us = DRIVE_NEVER;
        return 0;
    case 0x1017:
        self->beat_due_us = value == 0 ? DRIVE_NEVER : self->now_us + value * 1000u;
        return 0;
    case 0x6040:
        drive_control(&self->drive, (uint16_t)value);
        return 0;
    case 0x6060:
        return drive_choose_mode(&self->drive, (int8_t)value);
    default:
        return 0;
    }
}

static void accept_write(node_t *self, node_t *owner, const uint8_t *request, uint16_t index)
{
    const uint8_t bytes = (request[0] & 1) != 0 ? (uint8_t)(4 - (request[0] >> 2 & 3)) : 4;
    uint32_t value = 0;
    for (unsigned i = 0; i < bytes; i++) {
        value |= (uint32_t)request[4 + i] << (8 * i);
    }
    uint32_t refusal = objects_write(&owner->drive.od, index, request[3], value, bytes, self->nmt == NODE_OPERATIONAL);
    refusal = refusal != 0 ? refusal : written(owner, index, value);
    answer(self, refusal != 0 ? 0x80 : 0x60, request, refusal);
}

/* The axis that has an object, which it knows as the first one would. */
static node_t *owner_of(node_t *self, uint16_t *index)
{
    const unsigned record = *index & 0x1FFu;
    const unsigned step = self->pdo_step != 0 ? self->pdo_step : 64u;
    const bool is_pdo = *index >= 0x1400 && *index < 0x1C00;
    const unsigned channel = is_pdo ? record / step : *index >= 0x6000 ? (*index - 0x6000u) / 0x800u : 0;
    const unsigned axis = channel < OBJECT_AXES && self->axis[channel] != NULL ? channel : 0;
    node_t *owner = axis == 0 ? self : self->axis[axis];
    *index = (uint16_t)(*index - (is_pdo ? axis * step : axis * 0x800u));
    if (is_pdo) {
        const unsigned number = (*index & 0x1FFu) + 1u;
        const unsigned place = node_pdo_place(*index < 0x1800 ? &owner->commands : &owner->answers, number);
        *index = (uint16_t)(place == 0 ? 0 : *index - number + place);
    }
    return owner;
}

void node_hear_sdo(node_t *self, const can_frame_t *frame)
{
    const uint8_t *request = frame->data;
    uint16_t index = (uint16_t)(request[1] | request[2] << 8);
    node_t *owner = owner_of(self, &index);
    const object_t *row = objects_find(&owner->drive.od, index, request[3]);
    const uint32_t refusal = objects_read_refusal(&owner->drive.od, index, request[3]);
    if (self->nmt == STOPPED || frame->length != 8 || self->is_sdo_silent || request[0] == 0x80 ||
        (row != NULL && row->is_silent)) {
        return;
    }
    uint8_t text[8];
    if ((refusal == 0 || (request[0] & 0xE0) == 0x60) && node_text_hear(&self->text, request, text)) {
        put_answer(self, text);
    } else if ((request[0] & 0xE2) == 0x22) {
        accept_write(self, owner, request, index);
    } else if ((request[0] & 0xE0) != 0x40) {
        answer(self, 0x80, request, BAD_COMMAND);
    } else if (refusal != 0 || row == NULL) {
        answer(self, 0x80, request, refusal);
    } else {
        answer_value(self, row, request);
    }
}
