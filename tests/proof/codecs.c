/* SPDX-License-Identifier: MIT
 * codecs.c - the entry points of tools/proof into what reads and writes the frames of CAN buses and the registers of Modbus.
 */
#include "any.h"

#include "cia402_axis.h"
#include "cia402_map.h"
#include "cia402_node.h"
#include "cia402_pdo.h"
#include "heave/canraw.h"
#include "heave/modbus_drive.h"
#include "heave/sdo.h"

static uint8_t value[SDO_BYTES_MAX];

static can_frame_t any_frame(void)
{
    can_frame_t frame = {.id = ANY_U32(), .is_extended = ANY_BOOL(), .is_rtr = ANY_BOOL(), .length = (uint8_t)ANY_OF(0, 8)};
    ANY_BYTES(frame.data);
    return frame;
}

static void use_client(sdo_t *sdo)
{
    can_frame_t frame = any_frame();
    switch (ANY_OF(0, 6)) {
    case 0:
        sdo_read(sdo, ANY_U16(), ANY_U8(), (uint8_t)ANY_OF(1, UINT8_MAX));
        break;
    case 1:
        sdo_write(sdo, ANY_U16(), ANY_U8(), value, (uint8_t)ANY_OF(1, SDO_BYTES_MAX), (uint8_t)ANY_OF(1, UINT8_MAX));
        break;
    case 2:
        sdo_receive(sdo, &frame);
        break;
    case 3:
        (void)sdo_step(sdo, ANY_U64(), &frame);
        break;
    case 4:
        sdo_sent(sdo, ANY_U64());
        break;
    case 5:
        (void)sdo_value_u32(sdo);
        break;
    default:
        sdo_cancel(sdo);
        break;
    }
}

static sdo_t client;

/* Transfers and answers of any kind, in any order and for ever. */
void proof_sdo(void)
{
    ANY_BYTES(value);
    sdo_init(&client, (uint8_t)ANY_OF(1, 127), ANY_U32());
    /*@ loop widen_hints client.size, 64;
        loop widen_hints client.at, 64; */
    while (ANY_BOOL()) {
        use_client(&client);
    }
}

/* Any process data, for ever, from a drive in any phase. */
void proof_pdo(void)
{
    static cia402_t self;
    static cia402_config_t config;
    const cia402_pdo_t answer = {.entry = {CIA402_ENTRY_STATUSWORD, CIA402_ENTRY_ACTUAL, CIA402_ENTRY_MODE_SHOWN},
                                 .entries = 3,
                                 .bytes = 7,
                                 .every = 1,
                                 .id = 0x181};
    const cia402_pdo_t telemetry = {
        .entry = {CIA402_ENTRY_TORQUE, CIA402_ENTRY_LAG}, .entries = 2, .bytes = 6, .every = 1, .id = 0x281};
    config.axes = 1;
    config.axis[0].node = 1;
    config.axis[0].scale = (counts_scale_t){.num = ANY_I32(), .den = (int32_t)ANY_OF(1, INT32_MAX), .zero = ANY_I32()};
    self.config = &config;
    self.pdo[0][CIA402_ANSWER] = answer;
    self.pdo[0][CIA402_ANSWER + 1] = telemetry;
    while (ANY_BOOL()) {
        const can_frame_t frame = any_frame();
        self.now_us = ANY_U64();
        self.axis[0].phase = (cia402_phase_t)ANY_OF(0, CIA402_REFUSED);
        cia402_pdo_receive(&self, &frame);
        cia402_axis_receive_emergency(cia402_drive(&self, 0), &frame);
    }
}

/* Any values into any frame, any bytes out of any frame: field by field, as each is read and written for itself. */
void proof_canraw(void)
{
    uint8_t out[CANRAW_BYTES_MAX];
    const int64_t values[CANRAW_VALUES] = {ANY_I64(), ANY_I64(), ANY_I64()};
    canraw_frame_t frame = {.length = CANRAW_BYTES_MAX, .constant = ANY_U8(), .fields = 1};
    canraw_field_t *field = &frame.field[0];
    canraw_frame_t other = {.length = (uint8_t)ANY_OF(0, 8), .constant = ANY_U8()};
    field->value = (canraw_value_t)ANY_OF(0, CANRAW_VALUES - 1);
    field->bits = (uint8_t)ANY_OF(1, 32);
    field->skip = (uint8_t)ANY_OF(0, 7);
    field->is_signed = ANY_BOOL();
    field->is_big_endian = ANY_BOOL();
    field->divisor = ANY_BOOL() ? (uint32_t)ANY_OF(1, CANRAW_DIVISOR_MAX) : 0;
    //@ split field->bits;
    //@ split field->skip;
    field->at = (uint8_t)ANY_OF(0, (int64_t)CANRAW_BYTES_MAX - canraw_field_span(field));
    ANY_BYTES(frame.data);
    ANY_BYTES(other.data);
    ANY_BYTES(out);
    (void)canraw_matches(&other, out, (uint8_t)ANY_OF(0, 8));
    (void)canraw_is_ambiguous(&frame, &other);
    (void)canraw_find(&frame, (canraw_value_t)ANY_OF(0, CANRAW_VALUES - 1));
    (void)canraw_extract(field, out);
    (void)canraw_pack(&frame, values, out);
}

/* Any values into any block of registers, and any registers out of one. */
void proof_modbus(void)
{
    uint16_t out[MODBUS_DRIVE_REGISTERS_MAX];
    const int64_t values[MODBUS_DRIVE_VALUES] = {ANY_I64(), ANY_I64(), ANY_I64(), ANY_I64()};
    static modbus_drive_blocks_t blocks;
    modbus_drive_block_t *block = &blocks.block[0];
    modbus_drive_field_t *field = &block->field[0];
    unsigned found;
    blocks.count = (uint8_t)ANY_OF(0, 1);
    block->count = MODBUS_DRIVE_REGISTERS_MAX;
    block->fields = 1;
    field->value = (modbus_drive_value_t)ANY_OF(0, MODBUS_DRIVE_VALUES - 1);
    field->registers = (uint8_t)ANY_OF(1, 2);
    field->is_signed = ANY_BOOL();
    field->is_low_first = ANY_BOOL();
    //@ split field->registers;
    field->at = (uint8_t)ANY_OF(0, (int64_t)MODBUS_DRIVE_REGISTERS_MAX - field->registers);
    ANY_BYTES(block->data);
    ANY_BYTES(out);
    (void)modbus_drive_find(&blocks, (modbus_drive_value_t)ANY_OF(0, MODBUS_DRIVE_VALUES - 1), &found);
    (void)modbus_drive_extract(field, out);
    (void)modbus_drive_pack(block, values, out);
}
