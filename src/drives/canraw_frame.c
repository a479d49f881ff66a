/* SPDX-License-Identifier: MIT
 * canraw_frame.c - bytes of the frames of a raw CAN map: fields in, fields out, and whether received bytes are a frame.
 */
#include "heave/canraw.h"

static bool is_constant(const canraw_frame_t *frame, unsigned at)
{
    return at < frame->length && (frame->constant >> at & 1u) != 0;
}

int64_t canraw_field_min(const canraw_field_t *field)
{
    return field->is_signed ? -(INT64_C(1) << (8u * field->bytes - 1u)) : 0;
}

int64_t canraw_field_max(const canraw_field_t *field)
{
    return (INT64_C(1) << (8u * field->bytes - (field->is_signed ? 1u : 0u))) - 1;
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

/* Bits to shift byte i of a field by. */
static unsigned shift_of(const canraw_field_t *field, unsigned i)
{
    return 8u * (field->is_big_endian ? field->bytes - 1u - i : i);
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
    uint8_t check = field->value == CANRAW_CRC8_FF ? 0xFFu : 0;
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
    return field->value == CANRAW_CRC8_FF ? (uint8_t)~check : check;
}

/* True where a field has a range that its value has to be in. */
static bool is_bounded(const canraw_field_t *field)
{
    return !canraw_is_check(field->value) && field->value != CANRAW_COUNTER;
}

hv_status_t canraw_pack(const canraw_frame_t *frame, const int64_t value[CANRAW_VALUES], uint8_t out[CANRAW_BYTES_MAX])
{
    for (unsigned i = 0; i < frame->fields; i++) {
        const canraw_field_t *field = &frame->field[i];
        if (is_bounded(field) &&
            (value[field->value] < canraw_field_min(field) || value[field->value] > canraw_field_max(field))) {
            return HV_ERR_RANGE;
        }
    }
    for (unsigned at = 0; at < CANRAW_BYTES_MAX; at++) {
        out[at] = is_constant(frame, at) ? frame->data[at] : 0;
    }
    for (unsigned i = 0; i < frame->fields; i++) {
        const canraw_field_t *field = &frame->field[i];
        for (unsigned byte = 0; byte < field->bytes && !canraw_is_check(field->value); byte++) {
            out[field->at + byte] = (uint8_t)((uint64_t)value[field->value] >> shift_of(field, byte) & 0xFFu);
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

bool canraw_matches(const canraw_frame_t *frame, const uint8_t *data, uint8_t length)
{
    if (frame->length == 0 || length < frame->length) {
        return false;
    }
    for (unsigned at = 0; at < frame->length; at++) {
        if (is_constant(frame, at) && data[at] != frame->data[at]) {
            return false;
        }
    }
    for (unsigned i = 0; i < frame->fields; i++) {
        const canraw_field_t *field = &frame->field[i];
        if (canraw_is_check(field->value) && data[field->at] != check_of(frame, field, data)) {
            return false;
        }
    }
    return true;
}

int64_t canraw_extract(const canraw_field_t *field, const uint8_t *data)
{
    int64_t value = 0;
    for (unsigned byte = 0; byte < field->bytes; byte++) {
        value |= (int64_t)data[field->at + byte] << shift_of(field, byte);
    }
    return value > canraw_field_max(field) ? value - (INT64_C(1) << 8u * field->bytes) : value;
}

bool canraw_is_ambiguous(const canraw_frame_t *a, const canraw_frame_t *b)
{
    if (a->length == 0 || b->length == 0) {
        return false;
    }
    for (unsigned at = 0; at < CANRAW_BYTES_MAX; at++) {
        if (is_constant(a, at) && is_constant(b, at) && a->data[at] != b->data[at]) {
            return false;
        }
    }
    return true;
}
