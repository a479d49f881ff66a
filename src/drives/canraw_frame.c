/* SPDX-License-Identifier: MIT
 * canraw_frame.c - bytes of the frames of a raw CAN map: fields in, fields out, and whether received bytes are a frame.
 */
#include "heave/canraw.h"

#include "canraw_float.h"

static bool is_constant(const canraw_frame_t *frame, unsigned at)
{
    return at < frame->length && (frame->constant >> at & 1u) != 0;
}

int64_t canraw_field_min(const canraw_field_t *field)
{
    if (field->divisor != 0) {
        return -CANRAW_FLOAT_MAX;
    }
    return field->is_signed ? -(INT64_C(1) << (field->bits - 1u)) : 0;
}

int64_t canraw_field_max(const canraw_field_t *field)
{
    return field->divisor != 0 ? CANRAW_FLOAT_MAX : (INT64_C(1) << (field->bits - (field->is_signed ? 1u : 0u))) - 1;
}

const canraw_field_t *canraw_find(const canraw_frame_t *frame, canraw_value_t value)
{
    for (unsigned i = 0; i < frame->fields; i++) {
        if (frame->field[i].value == value) {
            return &frame->field[i];
        }
    }
    return NULL;
}

const canraw_field_t *canraw_find_of(const canraw_frame_t *frame, canraw_value_t value, unsigned slot)
{
    for (unsigned i = 0; i < frame->fields; i++) {
        const canraw_field_t *field = &frame->field[i];
        if (field->value == value && (field->slot == 0 || field->slot == slot)) {
            return field;
        }
    }
    return NULL;
}

unsigned canraw_slots(const canraw_frame_t *frame)
{
    unsigned slots = 0;
    for (unsigned i = 0; i < frame->fields; i++) {
        slots = frame->field[i].slot > slots ? frame->field[i].slot : slots;
    }
    return slots;
}

unsigned canraw_value_at(canraw_value_t value, unsigned slot)
{
    return (slot == 0 ? 0 : slot - 1u) * CANRAW_VALUES + (unsigned)value;
}

unsigned canraw_field_span(const canraw_field_t *field)
{
    return (field->skip + field->bits + 7u) / 8u;
}

/* The bits of a field in a row lie so far above the lowest bit of all bytes that it touches. */
static unsigned shift_of(const canraw_field_t *field)
{
    return field->is_big_endian ? 8u * canraw_field_span(field) - field->skip - field->bits : field->skip;
}

/* Where byte i of these bytes is, counted from the lowest. */
static unsigned place_of(const canraw_field_t *field, unsigned i)
{
    return field->at + (field->is_big_endian ? canraw_field_span(field) - 1u - i : i);
}

static uint64_t ones_of(const canraw_field_t *field)
{
    return ((UINT64_C(1) << field->bits) - 1u) << shift_of(field);
}

static void put(const canraw_field_t *field, uint64_t value, uint8_t *data)
{
    const uint64_t ones = ones_of(field);
    const uint64_t bits = value << shift_of(field) & ones;
    for (unsigned i = 0; i < canraw_field_span(field); i++) {
        uint8_t *byte = &data[place_of(field, i)];
        *byte = (uint8_t)((*byte & ~(ones >> 8u * i)) | (bits >> 8u * i & 0xFFu));
    }
}

bool canraw_field_cover(const canraw_field_t *field, uint8_t bits[CANRAW_BYTES_MAX])
{
    bool is_free = true;
    for (unsigned i = 0; i < canraw_field_span(field); i++) {
        const uint8_t ones = (uint8_t)(ones_of(field) >> 8u * i & 0xFFu);
        uint8_t *byte = &bits[place_of(field, i)];
        is_free = is_free && (*byte & ones) == 0;
        *byte |= ones;
    }
    return is_free;
}

bool canraw_is_check(canraw_value_t value)
{
    return value >= CANRAW_SUM;
}

static uint8_t crc8_step(uint8_t crc, uint8_t byte, uint8_t polynomial)
{
    crc ^= byte;
    for (unsigned bit = 0; bit < 8u; bit++) {
        crc = (uint8_t)((crc & 0x80u) != 0 ? (unsigned)crc << 1 ^ polynomial : (unsigned)crc << 1);
    }
    return crc;
}

/* The check byte of a frame over its other bytes. */
static uint8_t check_of(const canraw_frame_t *frame, const canraw_field_t *field, const uint8_t *data)
{
    const bool is_crc = field->value == CANRAW_CRC8;
    uint8_t check = is_crc ? frame->crc_initial : 0;
    for (unsigned at = 0; at < frame->length; at++) {
        if (at == field->at) {
            continue;
        }
        if (field->value == CANRAW_SUM) {
            check = (uint8_t)(check + data[at]);
        } else if (field->value == CANRAW_XOR) {
            check ^= data[at];
        } else {
            check = crc8_step(check, data[at], frame->data[field->at]);
        }
    }
    return is_crc ? check ^ frame->crc_final : check;
}

/* True where a field has a range that its value has to be in. */
static bool is_bounded(const canraw_field_t *field)
{
    return !canraw_is_check(field->value) && field->value != CANRAW_COUNTER;
}

hv_status_t canraw_pack(const canraw_frame_t *frame, const int64_t value[], uint8_t out[CANRAW_BYTES_MAX])
{
    for (unsigned i = 0; i < frame->fields; i++) {
        const canraw_field_t *field = &frame->field[i];
        const int64_t number = value[canraw_value_at(field->value, field->slot)];
        if (is_bounded(field) && (number < canraw_field_min(field) || number > canraw_field_max(field))) {
            return HV_ERR_RANGE;
        }
    }
    for (unsigned at = 0; at < CANRAW_BYTES_MAX; at++) {
        out[at] = is_constant(frame, at) ? frame->data[at] : 0;
    }
    for (unsigned i = 0; i < frame->fields; i++) {
        const canraw_field_t *field = &frame->field[i];
        if (!canraw_is_check(field->value)) {
            const int64_t number = value[canraw_value_at(field->value, field->slot)];
            put(field, field->divisor != 0 ? canraw_float_from(number, field->divisor) : (uint64_t)number, out);
        }
    }
    for (unsigned i = 0; i < frame->fields; i++) { /* there is one at most */
        const canraw_field_t *field = &frame->field[i];
        if (canraw_is_check(field->value)) {
            out[field->at] = check_of(frame, field, out);
        }
    }
    return HV_OK;
}

/* The bits that tell a frame. */
static void find_fixed(const canraw_frame_t *frame, uint8_t fixed[CANRAW_BYTES_MAX])
{
    uint8_t open[CANRAW_BYTES_MAX] = {0};
    for (unsigned i = 0; i < frame->fields; i++) {
        (void)canraw_field_cover(&frame->field[i], open);
    }
    for (unsigned at = 0; at < CANRAW_BYTES_MAX; at++) {
        fixed[at] = is_constant(frame, at) ? (uint8_t)~open[at] : 0;
    }
}

static uint64_t read(const canraw_field_t *field, const uint8_t *data)
{
    uint64_t bits = 0;
    for (unsigned i = 0; i < canraw_field_span(field); i++) {
        bits |= (uint64_t)data[place_of(field, i)] << 8u * i;
    }
    return (bits & ones_of(field)) >> shift_of(field);
}

canraw_verdict_t canraw_judge(const canraw_frame_t *frame, const uint8_t *data, uint8_t length)
{
    uint8_t fixed[CANRAW_BYTES_MAX];
    if (frame->length == 0 || length < frame->length) {
        return CANRAW_OTHER;
    }
    find_fixed(frame, fixed);
    for (unsigned at = 0; at < frame->length; at++) {
        if (((data[at] ^ frame->data[at]) & fixed[at]) != 0) {
            return CANRAW_OTHER;
        }
    }
    for (unsigned i = 0; i < frame->fields; i++) {
        const canraw_field_t *field = &frame->field[i];
        int64_t number = 0;
        if (canraw_is_check(field->value) && data[field->at] != check_of(frame, field, data)) {
            return CANRAW_BAD_CHECK;
        }
        if (field->divisor != 0 && !canraw_float_to((uint32_t)read(field, data), field->divisor, &number)) {
            return CANRAW_BAD_NUMBER;
        }
    }
    return CANRAW_MATCH;
}

bool canraw_matches(const canraw_frame_t *frame, const uint8_t *data, uint8_t length)
{
    return canraw_judge(frame, data, length) == CANRAW_MATCH;
}

int64_t canraw_extract(const canraw_field_t *field, const uint8_t *data)
{
    int64_t value = (int64_t)read(field, data);
    if (field->divisor != 0) {
        const uint32_t bits = (uint32_t)value;
        value = 0;
        (void)canraw_float_to(bits, field->divisor, &value);
        return value;
    }
    return value > canraw_field_max(field) ? value - (INT64_C(1) << field->bits) : value;
}

bool canraw_is_ambiguous(const canraw_frame_t *a, const canraw_frame_t *b)
{
    uint8_t fixed_a[CANRAW_BYTES_MAX];
    uint8_t fixed_b[CANRAW_BYTES_MAX];
    if (a->length == 0 || b->length == 0) {
        return false;
    }
    find_fixed(a, fixed_a);
    find_fixed(b, fixed_b);
    for (unsigned at = 0; at < CANRAW_BYTES_MAX; at++) {
        if (((a->data[at] ^ b->data[at]) & fixed_a[at] & fixed_b[at]) != 0) {
            return false;
        }
    }
    return true;
}
