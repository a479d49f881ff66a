/* SPDX-License-Identifier: MIT
 * objects.c - the object dictionary of a simulated CiA 402 drive; see objects.h.
 */
#include "twin/objects.h"

#include <stddef.h>
#include <string.h>

#define INVALID  0x80000000u
#define NO_RTR   0x40000000u
#define COB_BITS 0x1FFFFFFFu
#define EVENT    255u
#define PDO_BITS 64u

/* clang-format off */ /* a row is a record */
#define RW(at, sub_, size, from)  {.index = (at), .sub = (sub_), .bytes = (size), .fallback = (from)}
#define RO(at, sub_, size, from)  {.index = (at), .sub = (sub_), .bytes = (size), .fallback = (from), .is_read_only = true}
#define IN(at, sub_, size, from)  {.index = (at), .sub = (sub_), .bytes = (size), .fallback = (from), .is_in_rpdo = true, .is_in_tpdo = true}
#define OUT(at, sub_, size, from) {.index = (at), .sub = (sub_), .bytes = (size), .fallback = (from), .is_read_only = true, .is_in_tpdo = true}

static const object_t k_rows[] = {
    RO(0x1000, 0, 4, 0x00020192), OUT(0x1001, 0, 1, 0), RW(0x1003, 0, 1, 0), RO(0x1003, 1, 4, 0), RO(0x1003, 2, 4, 0), RO(0x1003, 3, 4, 0), RO(0x1003, 4, 4, 0), RW(0x1005, 0, 4, 0x80), RW(0x1006, 0, 4, 0),
    RW(0x1007, 0, 4, 0), RW(0x100C, 0, 2, 0), RW(0x100D, 0, 1, 0), RO(0x1008, 0, 4, 0), RO(0x1009, 0, 4, 0), RO(0x100A, 0, 4, 0), /* texts: node_text.h */ RO(0x1016, 0, 1, 1), RW(0x1016, 1, 4, 0), RW(0x1017, 0, 2, 0),
    RO(0x1018, 0, 1, 4), RW(0x1019, 0, 1, 0), RO(0x1029, 0, 1, 1), RW(0x1029, 1, 1, 0),
    OUT(0x603F, 0, 2, 0), IN(0x6040, 0, 2, 0), OUT(0x6041, 0, 2, 0), RW(0x6007, 0, 2, 0), RW(0x605A, 0, 2, 0), RW(0x605B, 0, 2, 0),
    RW(0x605C, 0, 2, 0), RW(0x605D, 0, 2, 1), RW(0x605E, 0, 2, 0), IN(0x6060, 0, 1, 0), OUT(0x6061, 0, 1, 0), OUT(0x6062, 0, 4, 0),
    OUT(0x6064, 0, 4, 0), RW(0x6065, 0, 4, 0xFFFFFFFF), RW(0x6066, 0, 2, 0), OUT(0x606C, 0, 4, 0), IN(0x607A, 0, 4, 0),
    RW(0x607C, 0, 4, 0), RO(0x607D, 0, 1, 2), RW(0x607D, 1, 4, 0), RW(0x607D, 2, 4, 0), RW(0x6081, 0, 4, 10000), RW(0x6083, 0, 4, 100000),
    RW(0x6084, 0, 4, 100000), RW(0x6085, 0, 4, 1000000), RW(0x6098, 0, 1, 0), RO(0x6099, 0, 1, 2), RW(0x6099, 1, 4, 5000),
    RW(0x6099, 2, 4, 1000), RW(0x609A, 0, 4, 100000), RW(0x60C0, 0, 2, 0), RO(0x60C1, 0, 1, 1), IN(0x60C1, 1, 4, 0), RO(0x60C2, 0, 1, 2),
    RW(0x60C2, 1, 1, 1), RW(0x60C2, 2, 1, 0xFD), OUT(0x60F4, 0, 4, 0), OUT(0x60FD, 0, 4, 0), OUT(0x6077, 0, 2, 0), RO(0x6502, 0, 4, 0xE1),
};
/* clang-format on */

/* Of homing, most used first. */
static const uint8_t k_methods[] = {35, 37, 17, 18, 19, 20, 21, 22, 1, 2, 7, 11, 23, 27, 33, 34};

static unsigned place_of(uint16_t index, uint8_t sub)
{
    return (index * 37u + sub) % OBJECT_PLACES;
}

void objects_add(objects_t *self, object_t row)
{
    unsigned place = place_of(row.index, row.sub);
    if (self->count == OBJECTS_MAX) {
        return;
    }
    while (self->place[place] != 0) {
        place = (place + 1u) % OBJECT_PLACES;
    }
    row.value = row.fallback;
    self->row[self->count++] = row;
    self->place[place] = (uint16_t)self->count;
}

/* As many drives come: valid and event-driven, until somebody configures them. */
static void add_pdos(objects_t *self, uint8_t node, bool is_first)
{
    static const uint32_t k_received[2][2] = {{0x60400010, 0}, {0x60400010, 0x607A0020}};
    static const uint32_t k_sent[2][2] = {{0x60410010, 0}, {0x60410010, 0x60640020}};
    for (uint16_t n = 0; n < OBJECT_PDOS; n++) {
        const uint32_t off = n < 2 && is_first ? 0 : INVALID;
        const uint32_t step = 0x100u * n + node;
        objects_add(self, (object_t)RO((uint16_t)(0x1400 + n), 0, 1, 5));
        objects_add(self, (object_t)RW((uint16_t)(0x1400 + n), 1, 4, (0x200 + step) | off));
        objects_add(self, (object_t)RW((uint16_t)(0x1400 + n), 2, 1, EVENT));
        objects_add(self, (object_t)RW((uint16_t)(0x1400 + n), 5, 2, 0));
        objects_add(self, (object_t)RO((uint16_t)(0x1800 + n), 0, 1, 6));
        objects_add(self, (object_t)RW((uint16_t)(0x1800 + n), 1, 4, (0x180 + step) | off | NO_RTR));
        objects_add(self, (object_t)RW((uint16_t)(0x1800 + n), 2, 1, EVENT));
        objects_add(self, (object_t)RW((uint16_t)(0x1800 + n), 3, 2, 0));
        objects_add(self, (object_t)RW((uint16_t)(0x1800 + n), 5, 2, 0));
        objects_add(self, (object_t)RW((uint16_t)(0x1800 + n), 6, 1, 0));
        objects_add(self, (object_t)RW((uint16_t)(0x1600 + n), 0, 1, n < 2 ? n + 1u : 0u));
        objects_add(self, (object_t)RW((uint16_t)(0x1A00 + n), 0, 1, n < 2 ? n + 1u : 0u));
        for (uint8_t k = 0; k < 8; k++) {
            const bool is_mapped = n < 2 && k < 2;
            objects_add(self, (object_t)RW((uint16_t)(0x1600 + n), (uint8_t)(k + 1), 4, is_mapped ? k_received[n][k] : 0));
            objects_add(self, (object_t)RW((uint16_t)(0x1A00 + n), (uint8_t)(k + 1), 4, is_mapped ? k_sent[n][k] : 0));
        }
    }
}

void objects_start(objects_t *self, uint8_t node, const uint32_t identity[4], bool is_first)
{
    self->count = 0;
    memset(self->place, 0, sizeof self->place);
    for (uint32_t i = 0; i < sizeof k_rows / sizeof k_rows[0]; i++) {
        objects_add(self, k_rows[i]);
    }
    objects_add(self, (object_t)RO(0x60E3, 0, 1, sizeof k_methods));
    for (uint32_t i = 0; i < sizeof k_methods; i++) {
        objects_add(self, (object_t)RO(0x60E3, (uint8_t)(i + 1), 1, k_methods[i]));
    }
    objects_add(self, (object_t)RO(0x1014, 0, 4, 0x80u + node));
    for (uint8_t sub = 1; sub <= 4; sub++) {
        objects_add(self, (object_t)RO(0x1018, sub, 4, identity[sub - 1]));
    }
    add_pdos(self, node, is_first);
}

void objects_reset(objects_t *self)
{
    for (uint32_t i = 0; i < self->count; i++) {
        if (self->row[i].index < 0x2000) {
            self->row[i].value = self->row[i].fallback;
        }
    }
}

void objects_map(objects_t *self, uint16_t mapping, const uint32_t *entry, uint8_t entries, bool is_fixed)
{
    for (uint8_t sub = 0; sub <= 8; sub++) {
        object_t *row = objects_find(self, mapping, sub);
        const uint32_t mapped = sub == 0 ? entries : sub <= entries ? entry[sub - 1] : 0;
        if (row != NULL) {
            row->value = row->fallback = mapped;
            row->is_read_only = is_fixed;
        }
    }
}

static const object_t *find(const objects_t *self, uint16_t index, uint8_t sub)
{
    for (unsigned place = place_of(index, sub); self->place[place] != 0; place = (place + 1u) % OBJECT_PLACES) {
        const object_t *row = &self->row[self->place[place] - 1u];
        if (row->index == index && row->sub == sub) {
            return row;
        }
    }
    return NULL;
}

object_t *objects_find(objects_t *self, uint16_t index, uint8_t sub)
{
    const object_t *found = find(self, index, sub);
    return found == NULL ? NULL : &self->row[found - self->row];
}

uint32_t objects_get(const objects_t *self, uint16_t index, uint8_t sub)
{
    const object_t *found = find(self, index, sub);
    return found == NULL ? 0 : found->value;
}

void objects_put(objects_t *self, uint16_t index, uint8_t sub, uint32_t value)
{
    object_t *found = objects_find(self, index, sub);
    if (found != NULL) {
        *(found->is_forced ? &found->was_value : &found->value) = value;
    }
}

bool objects_is_pdo(const objects_t *self, uint16_t record)
{
    return (objects_get(self, record, 1) & INVALID) == 0;
}

uint8_t objects_mapped_bytes(const objects_t *self, uint16_t mapping)
{
    uint32_t bits = 0;
    for (uint32_t k = 1; k <= objects_get(self, mapping, 0); k++) {
        bits += objects_get(self, mapping, (uint8_t)k) & 0xFF;
    }
    return (uint8_t)(bits / 8);
}

uint32_t objects_read_refusal(objects_t *self, uint16_t index, uint8_t sub)
{
    const object_t *found = objects_find(self, index, sub);
    if (found != NULL && !found->is_missing) {
        return 0;
    }
    for (uint32_t i = 0; i < self->count; i++) {
        if (self->row[i].index == index && !self->row[i].is_missing) {
            return OBJECT_NO_SUB;
        }
    }
    return OBJECT_MISSING;
}

/* --- The rules of mapping --- */

#define AXIS_OBJECTS 0x6000u
#define AXIS_STEP    0x800u

object_t *objects_mapped(const objects_t *self, uint32_t entry)
{
    const uint32_t index = entry >> 16;
    const uint32_t axis = index < AXIS_OBJECTS ? 0 : (index - AXIS_OBJECTS) / AXIS_STEP;
    objects_t *of = axis < OBJECT_AXES ? self->axis[axis] : NULL;
    return of == NULL ? NULL : objects_find(of, (uint16_t)(index - axis * AXIS_STEP), (uint8_t)(entry >> 8 & 0xFF));
}

static bool is_mappable(const objects_t *self, bool is_received, uint32_t entry)
{
    const object_t *target = objects_mapped(self, entry);
    return target != NULL && !target->is_missing && (is_received ? target->is_in_rpdo : target->is_in_tpdo) &&
           (entry & 0xFF) == 8u * target->bytes;
}

/* No object in two valid RPDOs: which of them would count? */
static bool is_elsewhere(const objects_t *self, uint16_t mapping, uint32_t entry)
{
    for (uint16_t n = 0; n < OBJECT_PDOS; n++) {
        const uint16_t other = (uint16_t)(0x1600 + n);
        if (other == mapping || !objects_is_pdo(self, (uint16_t)(0x1400 + n))) {
            continue;
        }
        for (uint32_t k = 1; k <= objects_get(self, other, 0); k++) {
            if (objects_get(self, other, (uint8_t)k) == entry) {
                return true;
            }
        }
    }
    return false;
}

static uint32_t count_refusal(const objects_t *self, uint16_t mapping, uint32_t count)
{
    const bool is_received = mapping < 0x1800;
    uint32_t bits = 0;
    if (count > 8) {
        return OBJECT_PDO_LENGTH;
    }
    for (uint32_t k = 1; k <= count; k++) {
        const uint32_t entry = objects_get(self, mapping, (uint8_t)k);
        bits += entry & 0xFF;
        if (!is_mappable(self, is_received, entry)) {
            return OBJECT_NOT_MAPPABLE;
        }
        if (is_received && is_elsewhere(self, mapping, entry)) {
            return OBJECT_UNSUPPORTED;
        }
    }
    return bits > PDO_BITS ? OBJECT_PDO_LENGTH : 0;
}

static uint32_t mapping_refusal(const objects_t *self, uint16_t index, uint8_t sub, uint32_t value)
{
    if (objects_is_pdo(self, (uint16_t)(index - 0x200)) || (sub > 0 && objects_get(self, index, 0) != 0)) {
        return OBJECT_UNSUPPORTED;
    }
    if (sub == 0) {
        return count_refusal(self, index, value);
    }
    return is_mappable(self, index < 0x1800, value) ? 0 : OBJECT_NOT_MAPPABLE;
}

static uint32_t cob_refusal(const objects_t *self, uint16_t index, uint32_t value)
{
    const uint32_t change = value ^ objects_get(self, index, 1);
    const bool is_on = (value & INVALID) == 0;
    if (objects_is_pdo(self, index) && is_on && (change & COB_BITS) != 0) {
        return OBJECT_BAD_VALUE;
    }
    if (index >= 0x1800 && (change & NO_RTR) != 0) {
        return OBJECT_BAD_VALUE;
    }
    return is_on && objects_get(self, (uint16_t)(index + 0x200), 0) == 0 ? OBJECT_BAD_VALUE : 0;
}

static uint32_t pdo_refusal(const objects_t *self, uint16_t index, uint8_t sub, uint32_t value, bool is_operational)
{
    if (is_operational) {
        return OBJECT_WRONG_STATE;
    }
    if ((index & 0x0200) != 0) {
        return mapping_refusal(self, index, sub, value);
    }
    if (sub == 1) {
        return cob_refusal(self, index, value);
    }
    if (sub == 2) {
        return value > 240 && value < 254 ? OBJECT_BAD_VALUE : 0;
    }
    return (sub == 3 || sub == 6) && objects_is_pdo(self, index) ? OBJECT_UNSUPPORTED : 0;
}

/* Methods of the standard that it has; a maker's own are below 0. */
static bool is_method(uint32_t value)
{
    bool is_listed = value == 0 || value >= 0x80;
    for (uint32_t i = 0; i < sizeof k_methods; i++) {
        is_listed |= k_methods[i] == value;
    }
    return is_listed;
}

/* What single objects do not take. */
static uint32_t value_refusal(const objects_t *self, uint16_t index, uint8_t sub, uint32_t value)
{
    switch (index) {
    case 0x1003:
        return value != 0 ? OBJECT_BAD_VALUE : 0;
    case 0x1019:
        return objects_get(self, 0x1006, 0) != 0 ? OBJECT_WRONG_STATE : 0;
    case 0x6098:
        return is_method(value) ? 0 : OBJECT_BAD_VALUE;
    case 0x60C2:
        return (sub == 1 && (value < 1 || value > 250)) || (sub == 2 && value != 0xFD && value != 0xFC) ? OBJECT_BAD_VALUE : 0;
    default:
        return 0;
    }
}

uint32_t objects_write(objects_t *self, uint16_t index, uint8_t sub, uint32_t value, uint8_t bytes, bool is_operational)
{
    object_t *row = objects_find(self, index, sub);
    uint32_t refusal = objects_read_refusal(self, index, sub);
    if (refusal != 0 || row == NULL) {
        return refusal;
    }
    if (row->is_read_only) {
        return OBJECT_READ_ONLY;
    }
    if (row->refusal != 0) {
        return row->refusal;
    }
    if (bytes != row->bytes) {
        return bytes > row->bytes ? OBJECT_TOO_LONG : OBJECT_TOO_SHORT;
    }
    if (index >= 0x1400 && index < 0x1C00) {
        refusal = pdo_refusal(self, index, sub, value, is_operational);
    } else {
        refusal = value_refusal(self, index, sub, value);
    }
    if (refusal == 0) {
        row->value = value;
    }
    return refusal;
}
