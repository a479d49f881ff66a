/* SPDX-License-Identifier: MIT
 * cia402_pdo.c - commands and answers as frames; see cia402_pdo.h.
 */
#include "cia402_pdo.h"

#include "cia402_map.h"
#include "cia402_node.h"

void cia402_pdo_init(cia402_t *self)
{
    for (unsigned k = 0; k < self->config->axes; k++) {
        for (unsigned which = 0; which < CIA402_PDOS; which++) {
            self->pdo[k][which] = cia402_pdo(self->config, k, which);
        }
    }
}

/* Axis of an entry of a PDO of an axis: mostly the same. */
static unsigned axis_of(const cia402_config_t *config, unsigned axis, uint32_t entry)
{
    const cia402_axis_config_t *own = &config->axis[axis];
    return cia402_map_channel(entry) == own->channel ? axis : cia402_axis_of(config, own->node, entry);
}

/* Of the lowest bits, of which a value has no more than 32. */
static uint32_t mask_of(uint32_t entry)
{
    const unsigned bits = CIA402_BITS_OF(entry);
    return bits < 32u ? (1u << bits) - 1u : UINT32_MAX;
}

/* --- Commands --- */

static uint32_t commanded(const cia402_config_t *config, const cia402_t *self, unsigned axis, uint32_t entry)
{
    if (axis >= config->axes) {
        return 0;
    }
    switch (cia402_map_plain(entry)) {
    case CIA402_ENTRY_CONTROLWORD:
        return self->axis[axis].word;
    case CIA402_ENTRY_TARGET:
    case CIA402_ENTRY_TARGET_IP:
        return (uint32_t)self->axis[axis].target_counts;
    case CIA402_ENTRY_MODE:
        return self->axis[axis].setup.mode;
    default: /* what a fixed map has beside */
        return 0;
    }
}

bool cia402_pdo_command(const cia402_t *self, unsigned axis, unsigned which, can_frame_t *out)
{
    const cia402_pdo_t *pdo = &self->pdo[axis][CIA402_COMMAND + which];
    if (pdo->entries == 0) {
        return false;
    }
    *out = (can_frame_t){.id = pdo->id, .length = pdo->bytes};
    uint64_t data = 0;
    unsigned at = 0;
    for (unsigned i = 0; i < pdo->entries && at < 8u * CIA402_PDO_BYTES; i++) {
        const unsigned of = axis_of(self->config, axis, pdo->entry[i]);
        data |= (uint64_t)(commanded(self->config, self, of, pdo->entry[i]) & mask_of(pdo->entry[i])) << at;
        at += CIA402_BITS_OF(pdo->entry[i]);
    }
    for (unsigned byte = 0; byte < CIA402_PDO_BYTES; byte++) {
        out->data[byte] = (uint8_t)(data >> (8u * byte));
    }
    return true;
}

/* --- Answers --- */

static int32_t signed_of(uint32_t bits, uint8_t bytes)
{
    const uint32_t sign = 1u << (8u * bytes - 1u);
    return bits < sign ? (int32_t)bits : (int32_t)(bits - sign) - (int32_t)(sign - 1u) - 1;
}

/* In the direction of the extension, whichever way the drive counts. */
static void apply_telemetry(const cia402_drive_t *drive, uint32_t entry, uint32_t bits)
{
    drive_telemetry_t *out = &drive->axis->telemetry;
    const counts_scale_t *scale = &drive->own->scale;
    const counts_scale_t ratio = {scale->num, scale->den, 0};
    const int32_t value = signed_of(bits, CIA402_BYTES_OF(entry));
    out->at_us = drive->now_us;
    switch (entry) {
    case CIA402_ENTRY_TORQUE:
        out->torque_permille = scale->num < 0 ? -value : value;
        out->has |= DRIVE_HAS_TORQUE;
        break;
    case CIA402_ENTRY_LAG:
        if (counts_to_units(&ratio, value, &out->lag_q32) == HV_OK) {
            out->has |= DRIVE_HAS_LAG;
        }
        break;
    default: /* CIA402_ENTRY_INPUTS */
        out->inputs = bits;
        out->has |= DRIVE_HAS_INPUTS;
        break;
    }
}

static void apply_value(const cia402_drive_t *drive, uint32_t entry, uint32_t bits)
{
    switch (entry) {
    case CIA402_ENTRY_STATUSWORD:
        drive->axis->statusword = (uint16_t)bits;
        break;
    case CIA402_ENTRY_ACTUAL:
        cia402_axis_receive_position(*drive, bits);
        break;
    case CIA402_ENTRY_MODE_SHOWN:
        drive->axis->mode_shown = (int8_t)signed_of(bits, 1);
        break;
    case CIA402_ENTRY_TORQUE:
    case CIA402_ENTRY_LAG:
    case CIA402_ENTRY_INPUTS:
        if (drive->axis->phase == CIA402_UP) {
            apply_telemetry(drive, entry, bits);
        }
        break;
    default: /* what a fixed map has beside */
        break;
    }
}

static uint64_t data_of(const can_frame_t *frame)
{
    uint64_t data = 0;
    for (unsigned byte = 0; byte < CIA402_PDO_BYTES; byte++) {
        data |= (uint64_t)frame->data[byte] << (8u * byte);
    }
    return data;
}

static void apply_entries(cia402_t *self, unsigned axis, cia402_drive_t drive, const cia402_pdo_t *pdo, const can_frame_t *frame)
{
    const uint64_t data = data_of(frame);
    unsigned at = 0;
    for (unsigned i = 0; i < pdo->entries && at < 8u * CIA402_PDO_BYTES; i++) {
        const unsigned k = axis_of(self->config, axis, pdo->entry[i]);
        if (k < self->config->axes && cia402_axis_is_commanded(&self->axis[k])) {
            if (k != axis) {
                axis = k;
                drive = cia402_drive(self, k);
            }
            apply_value(&drive, cia402_map_plain(pdo->entry[i]), (uint32_t)(data >> at) & mask_of(pdo->entry[i]));
        }
        at += CIA402_BITS_OF(pdo->entry[i]);
    }
}

static bool is_mate(const cia402_t *self, unsigned axis, unsigned k)
{
    return k != axis && self->config->axis[k].node == self->config->axis[axis].node;
}

/* Of an axis, or of all of its node. */
static void receive_answer(cia402_t *self, unsigned axis, unsigned n, const cia402_pdo_t *pdo, const can_frame_t *frame)
{
    const uint8_t all = (uint8_t)((1u << cia402_map_count(&self->config->answers)) - 1u);
    const unsigned mates = cia402_map_is_shared(&self->config->answers) ? self->config->axes : 0;
    const cia402_drive_t drive = cia402_drive(self, axis);
    cia402_axis_note_answer(drive, n, all);
    for (unsigned k = 0; k < mates; k++) {
        if (is_mate(self, axis, k)) {
            cia402_axis_note_answer(cia402_drive(self, k), n, all);
        }
    }
    apply_entries(self, axis, drive, pdo, frame);
    if (n > 0) {
        return;
    }
    cia402_axis_count_answer(drive);
    for (unsigned k = 0; k < mates; k++) {
        if (is_mate(self, axis, k)) {
            cia402_axis_count_answer(cia402_drive(self, k));
        }
    }
}

static void receive_pdo(cia402_t *self, unsigned axis, unsigned which, const can_frame_t *frame)
{
    const cia402_pdo_t *pdo = &self->pdo[axis][which];
    if (frame->length < pdo->bytes) { /* CiA 301: of a longer one the first bytes count */
        self->axis[axis].has_short_answer |= which < CIA402_TELEMETRY;
        return;
    }
    if (which < CIA402_TELEMETRY) {
        receive_answer(self, axis, which - CIA402_ANSWER, pdo, frame);
    } else if (self->axis[axis].phase == CIA402_UP) {
        apply_entries(self, axis, cia402_drive(self, axis), pdo, frame);
    }
}

/* An identifier is of one PDO; those that are not in use have none. */
void cia402_pdo_receive(cia402_t *self, const can_frame_t *frame)
{
    for (unsigned k = 0; k < self->config->axes; k++) {
        if (self->config->axis[k].node != (frame->id & CIA402_NODE_MAX)) {
            continue;
        }
        for (unsigned which = CIA402_ANSWER; which < CIA402_PDOS; which++) {
            if (self->pdo[k][which].id == frame->id) {
                receive_pdo(self, k, which, frame);
                return;
            }
        }
    }
}
