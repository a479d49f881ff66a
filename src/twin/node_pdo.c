/* SPDX-License-Identifier: MIT
 * node_pdo.c - PDOs of a simulated drive: what it sends at SYNC or when something changes, what it does with what it receives;
 * see node.h.
 */
#include <string.h>

#include "twin/node_internal.h"

#define PDO_SHORT 0x8210u
#define EVENT_US  1000 /* PDOs that tell of changes leave a gap */

/* --- Which it has --- */

static bool has_number(const cia402_maps_t *maps, unsigned number)
{
    for (unsigned i = 0; i < maps->count; i++) {
        if (maps->map[i].number == number) {
            return true;
        }
    }
    return false;
}

/* The drive has as many PDOs as others. Those whose numbers are higher take the places of its last ones that are not in use.
 * Returns the place of a PDO, from 1; 0: the drive has no such PDO. */
unsigned node_pdo_place(const cia402_maps_t *maps, unsigned number)
{
    unsigned place = OBJECT_PDOS;
    for (unsigned i = 0; i < maps->count; i++) {
        if (maps->map[i].number <= OBJECT_PDOS) {
            continue;
        }
        while (has_number(maps, place)) {
            place--;
        }
        if (maps->map[i].number == number || place == number) {
            return maps->map[i].number == number ? place : 0;
        }
        place--;
    }
    return number <= OBJECT_PDOS ? number : 0;
}

/* --- What it sends --- */

static uint8_t pack(const node_t *self, uint16_t mapping, uint8_t data[8])
{
    const objects_t *od = &self->drive.od;
    uint8_t length = 0;
    for (uint32_t k = 1; k <= objects_get(od, mapping, 0); k++) {
        const uint32_t entry = objects_get(od, mapping, (uint8_t)k);
        const object_t *row = objects_mapped(od, entry);
        const uint32_t value = row == NULL ? 0 : row->value;
        for (unsigned i = 0; i < (entry & 0xFF) / 8 && length < 8; i++) {
            data[length++] = (uint8_t)(value >> (8 * i));
        }
    }
    return length;
}

static void put_tpdo(node_t *self, uint16_t n)
{
    uint8_t data[8] = {0};
    const uint8_t length = pack(self, (uint16_t)(0x1A00 + n), data);
    if (self->tpdo_drop > 0) {
        self->tpdo_drop--;
        return;
    }
    const uint8_t sent = quirk_is(self->drive.quirks, QUIRK_LONG_PDO)    ? 8u
                         : quirk_is(self->drive.quirks, QUIRK_SHORT_PDO) ? (uint8_t)(length - 1u)
                                                                         : length;
    node_put_later(self, self->tpdo_us, objects_get(&self->drive.od, (uint16_t)(0x1800 + n), 1) & CAN_ID_MAX, data, sent);
}

/* 1800h:06: the first SYNC that counts is the one with that number; it is answered. */
static bool is_counting(node_t *self, uint16_t n, const can_frame_t *sync, uint32_t rate)
{
    const uint32_t start = objects_get(&self->drive.od, (uint16_t)(0x1800 + n), 6);
    if (start == 0 || sync->length == 0) {
        return true;
    }
    if (!self->is_counting[n] && sync->data[0] == start) {
        self->is_counting[n] = true;
        self->rate_count[n] = (uint8_t)(rate > 0 ? rate - 1 : 0);
    }
    return self->is_counting[n];
}

static void put_synchronous(node_t *self, const can_frame_t *sync)
{
    for (uint16_t n = 0; n < OBJECT_PDOS; n++) {
        const uint32_t rate = objects_get(&self->drive.od, (uint16_t)(0x1800 + n), 2);
        if (!objects_is_pdo(&self->drive.od, (uint16_t)(0x1800 + n)) || rate > NODE_SYNCHRONOUS_MAX ||
            !is_counting(self, n, sync, rate)) {
            continue;
        }
        self->rate_count[n]++;
        if (self->rate_count[n] >= rate) {
            self->rate_count[n] = 0;
            put_tpdo(self, n);
        }
    }
}

static bool is_event_pdo(const node_t *self, uint16_t n)
{
    return objects_is_pdo(&self->drive.od, (uint16_t)(0x1800 + n)) &&
           objects_get(&self->drive.od, (uint16_t)(0x1800 + n), 2) >= 254;
}

/* When a TPDO is sent whether its values have changed or not. */
uint64_t node_event_due_us(const node_t *self, uint16_t n)
{
    const uint32_t timer_ms = objects_get(&self->drive.od, (uint16_t)(0x1800 + n), 5);
    if (self->nmt != NODE_OPERATIONAL || !is_event_pdo(self, n)) {
        return DRIVE_NEVER;
    }
    return self->event_us[n] == 0 ? self->now_us : timer_ms == 0 ? DRIVE_NEVER : self->event_us[n] + timer_ms * 1000u;
}

/* Of synchronous TPDOs, beside those that SYNC is answered with. */
static void put_changes(node_t *self)
{
    const uint16_t word = (uint16_t)objects_get(&self->drive.od, 0x6041, 0);
    const bool is_change = self->nmt == NODE_OPERATIONAL && word != self->shown_word;
    self->shown_word = word;
    for (uint16_t n = 0; n < OBJECT_PDOS && is_change; n++) {
        if (objects_is_pdo(&self->drive.od, (uint16_t)(0x1800 + n)) && !is_event_pdo(self, n)) {
            put_tpdo(self, n);
        }
    }
}

void node_put_events(node_t *self)
{
    if (quirk_is(self->drive.quirks, QUIRK_SENDS_CHANGES)) {
        put_changes(self);
    }
    for (uint16_t n = 0; n < OBJECT_PDOS && self->nmt == NODE_OPERATIONAL; n++) {
        uint8_t data[8] = {0};
        if (!is_event_pdo(self, n) || self->now_us < self->event_us[n] + EVENT_US) {
            continue;
        }
        (void)pack(self, (uint16_t)(0x1A00 + n), data);
        if (self->now_us >= node_event_due_us(self, n) || memcmp(data, self->event_data[n], 8) != 0) {
            memcpy(self->event_data[n], data, 8);
            self->event_us[n] = self->now_us;
            put_tpdo(self, n);
        }
    }
}

/* --- What it receives --- */

static node_t *axis_of(node_t *self, uint32_t index)
{
    node_t *head = node_head(self);
    const uint32_t axis = index < 0x6000 ? 0 : (index - 0x6000) / 0x800;
    return axis == 0 ? head : axis < OBJECT_AXES ? head->axis[axis] : NULL;
}

/* A value of an RPDO. Returns the axis that it controls where it is a controlword, else NULL. */
static node_t *apply_entry(node_t *self, uint32_t entry, uint32_t value)
{
    node_t *of = axis_of(self, entry >> 16);
    object_t *row = objects_mapped(&self->drive.od, entry);
    if (row == NULL || of == NULL) {
        return NULL;
    }
    row->value = row->is_forced ? row->value : value;
    of->drive.has_set_point |= row->index == 0x607A || row->index == 0x60C1;
    if (row->index == 0x6060 && (int8_t)value != of->drive.mode) {
        (void)drive_choose_mode(&of->drive, (int8_t)value);
    }
    return row->index == 0x6040 ? of : NULL;
}

/* Controlwords act when everything else of the frame is there. */
static void apply(node_t *self, uint16_t n, const uint8_t *data)
{
    objects_t *od = &self->drive.od;
    node_t *controlled[8] = {NULL};
    unsigned at = 0;
    for (uint32_t k = 1; k <= objects_get(od, (uint16_t)(0x1600 + n), 0) && k <= 8; k++) {
        const uint32_t entry = objects_get(od, (uint16_t)(0x1600 + n), (uint8_t)k);
        uint32_t value = 0;
        for (unsigned i = 0; i < (entry & 0xFF) / 8 && at < 8; i++) {
            value |= (uint32_t)data[at++] << (8 * i);
        }
        controlled[k - 1] = apply_entry(self, entry, value);
    }
    for (unsigned k = 0; k < 8; k++) {
        if (controlled[k] != NULL) {
            drive_control(&controlled[k]->drive, (uint16_t)objects_get(&controlled[k]->drive.od, 0x6040, 0));
        }
    }
}

/* 1400h:05, watched from the first one on. */
static void start_deadline(node_t *self, uint16_t n)
{
    const uint32_t deadline_ms = objects_get(&self->drive.od, (uint16_t)(0x1400 + n), 5);
    self->rpdo_due_us = deadline_ms == 0 ? self->rpdo_due_us : self->now_us + deadline_ms * 1000u;
}

static void hear_rpdo(node_t *self, uint16_t n, const can_frame_t *frame)
{
    start_deadline(self, n);
    if (frame->length < objects_mapped_bytes(&self->drive.od, (uint16_t)(0x1600 + n))) {
        node_emergency(self, PDO_SHORT, 0x11);
    } else if (objects_get(&self->drive.od, (uint16_t)(0x1400 + n), 2) > NODE_SYNCHRONOUS_MAX) {
        apply(self, n, frame->data);
    } else {
        memcpy(self->received[n], frame->data, 8);
        self->pending |= 1u << n;
    }
}

void node_sync_pdos(node_t *self, const can_frame_t *sync, uint64_t now_us)
{
    self->now_us = now_us;
    drive_advance(&self->drive, now_us);
    put_synchronous(self, sync);
    for (uint16_t n = 0; n < OBJECT_PDOS; n++) {
        if ((self->pending >> n & 1u) != 0) {
            apply(self, n, self->received[n]);
        }
    }
    self->pending = 0;
}

void node_hear_pdo(node_t *self, const can_frame_t *frame)
{
    for (uint16_t n = 0; n < OBJECT_PDOS && self->nmt == NODE_OPERATIONAL; n++) {
        const uint16_t record = (uint16_t)(0x1400 + n);
        if (objects_is_pdo(&self->drive.od, record) && (objects_get(&self->drive.od, record, 1) & CAN_ID_MAX) == frame->id) {
            hear_rpdo(self, n, frame);
        }
    }
}
