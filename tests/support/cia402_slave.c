/* SPDX-License-Identifier: MIT
 * cia402_slave.c - simulated CiA 402 drives; see cia402_slave.h.
 */
#include "cia402_slave.h"

#include <stdlib.h>
#include <string.h>

#define PREOP       0x7F
#define OPERATIONAL 0x05
#define STOPPED     0x04

#define ST_NOT_READY 0x00
#define ST_DISABLED  0x40
#define ST_READY     0x21
#define ST_ON        0x23
#define ST_ENABLED   0x27
#define ST_QUICK     0x07
#define ST_FAULT     0x08

#define READ_ONLY   0x06010002u
#define UNSUPPORTED 0x06010000u
#define NO_OBJECT   0x06020000u
#define TOO_LONG    0x06070012u
#define BAD_VALUE   0x06090030u
#define WRONG_STATE 0x08000022u

#define BOOT_US     30000u
#define JUMP_COUNTS 20000

static const cia402_slave_row_t k_rows[] = {
    {.index = 0x1000, .sub = 0, .bytes = 4, .is_read_only = true, .value = 0x00020192},
    {.index = 0x1001, .sub = 0, .bytes = 1, .is_read_only = true},
    {.index = 0x1006, .sub = 0, .bytes = 4},
    {.index = 0x1016, .sub = 1, .bytes = 4},
    {.index = 0x1017, .sub = 0, .bytes = 2},
    {.index = 0x1018, .sub = 1, .bytes = 4, .is_read_only = true, .value = 0x2E5},
    {.index = 0x1018, .sub = 2, .bytes = 4, .is_read_only = true, .value = 0x402},
    {.index = 0x1018, .sub = 3, .bytes = 4, .is_read_only = true, .value = 1},
    {.index = 0x1018, .sub = 4, .bytes = 4, .is_read_only = true, .value = 99},
    {.index = 0x1019, .sub = 0, .bytes = 1},
    {.index = 0x1029, .sub = 1, .bytes = 1},
    {.index = 0x1400, .sub = 1, .bytes = 4, .value = 0x200},
    {.index = 0x1400, .sub = 2, .bytes = 1, .value = 255},
    {.index = 0x1401, .sub = 1, .bytes = 4, .value = 0x300},
    {.index = 0x1401, .sub = 2, .bytes = 1, .value = 255},
    {.index = 0x1600, .sub = 0, .bytes = 1, .value = 1},
    {.index = 0x1600, .sub = 1, .bytes = 4, .value = 0x60400010},
    {.index = 0x1600, .sub = 2, .bytes = 4},
    {.index = 0x1601, .sub = 0, .bytes = 1, .value = 2},
    {.index = 0x1601, .sub = 1, .bytes = 4, .value = 0x60400010},
    {.index = 0x1601, .sub = 2, .bytes = 4, .value = 0x607A0020},
    {.index = 0x1800, .sub = 1, .bytes = 4, .value = 0x40000180},
    {.index = 0x1800, .sub = 2, .bytes = 1, .value = 255},
    {.index = 0x1800, .sub = 3, .bytes = 2},
    {.index = 0x1800, .sub = 5, .bytes = 2, .value = 10},
    {.index = 0x1800, .sub = 6, .bytes = 1},
    {.index = 0x1801, .sub = 1, .bytes = 4, .value = 0x40000280},
    {.index = 0x1801, .sub = 2, .bytes = 1, .value = 255},
    {.index = 0x1A00, .sub = 0, .bytes = 1, .value = 1},
    {.index = 0x1A00, .sub = 1, .bytes = 4, .value = 0x60410010},
    {.index = 0x1A00, .sub = 2, .bytes = 4},
    {.index = 0x1A00, .sub = 3, .bytes = 4},
    {.index = 0x1801, .sub = 3, .bytes = 2},
    {.index = 0x1802, .sub = 1, .bytes = 4, .value = 0xC0000380},
    {.index = 0x1802, .sub = 2, .bytes = 1, .value = 255},
    {.index = 0x1A01, .sub = 0, .bytes = 1},
    {.index = 0x1A01, .sub = 1, .bytes = 4},
    {.index = 0x1A01, .sub = 2, .bytes = 4},
    {.index = 0x1A02, .sub = 0, .bytes = 1},
    {.index = 0x1A02, .sub = 1, .bytes = 4},
    {.index = 0x2030, .sub = 1, .bytes = 2, .value = 7},
    {.index = 0x2031, .sub = 0, .bytes = 4},
    {.index = 0x2032, .sub = 0, .bytes = 1, .is_read_only = true, .value = 3},
    {.index = 0x603F, .sub = 0, .bytes = 2, .is_read_only = true},
    {.index = 0x6007, .sub = 0, .bytes = 2},
    {.index = 0x605A, .sub = 0, .bytes = 2},
    {.index = 0x605B, .sub = 0, .bytes = 2},
    {.index = 0x605C, .sub = 0, .bytes = 2},
    {.index = 0x605E, .sub = 0, .bytes = 2},
    {.index = 0x6060, .sub = 0, .bytes = 1},
    {.index = 0x6061, .sub = 0, .bytes = 1, .is_read_only = true},
    {.index = 0x6065, .sub = 0, .bytes = 4, .value = 0xFFFFFFFF},
    {.index = 0x6066, .sub = 0, .bytes = 2},
    {.index = 0x607D, .sub = 1, .bytes = 4},
    {.index = 0x607D, .sub = 2, .bytes = 4},
    {.index = 0x6085, .sub = 0, .bytes = 4, .value = 1000},
    {.index = 0x60C0, .sub = 0, .bytes = 2},
    {.index = 0x60C1, .sub = 1, .bytes = 4},
    {.index = 0x60C2, .sub = 1, .bytes = 1, .value = 1},
    {.index = 0x60C2, .sub = 2, .bytes = 1, .value = 0xFD},
    {.index = 0x6081, .sub = 0, .bytes = 4},
    {.index = 0x6083, .sub = 0, .bytes = 4},
    {.index = 0x6084, .sub = 0, .bytes = 4},
    {.index = 0x6098, .sub = 0, .bytes = 1},
    {.index = 0x6099, .sub = 1, .bytes = 4},
    {.index = 0x6099, .sub = 2, .bytes = 4},
    {.index = 0x609A, .sub = 0, .bytes = 4},
    {.index = 0x607C, .sub = 0, .bytes = 4},
    {.index = 0x60E3, .sub = 0, .bytes = 1, .is_read_only = true, .value = 3},
    {.index = 0x60E3, .sub = 1, .bytes = 1, .is_read_only = true, .value = 35},
    {.index = 0x60E3, .sub = 2, .bytes = 2, .is_read_only = true, .value = 17},
    {.index = 0x60E3, .sub = 3, .bytes = 1, .is_read_only = true, .value = 37},
    {.index = 0x6502, .sub = 0, .bytes = 4, .is_read_only = true, .value = 0xE1},
};

static cia402_slave_row_t *find(cia402_slave_drive_t *d, uint16_t index, uint8_t sub)
{
    for (uint32_t i = 0; i < d->rows; i++) {
        if (d->row[i].index == index && d->row[i].sub == sub) {
            return &d->row[i];
        }
    }
    return NULL;
}

static uint32_t *value(cia402_slave_drive_t *d, uint16_t index, uint8_t sub)
{
    return &find(d, index, sub)->value;
}

cia402_slave_row_t *cia402_slave_row(cia402_slave_t *self, unsigned drive, uint16_t index, uint8_t sub)
{
    return find(&self->drive[drive], index, sub);
}

/* --- Out --- */

static void out(cia402_slave_t *self, const cia402_slave_drive_t *d, uint32_t id, uint8_t length, const uint8_t *data)
{
    can_frame_t frame = {.id = id, .length = length};
    if (d->is_mute || self->outs == 128) {
        return;
    }
    memcpy(frame.data, data, length);
    self->out[self->outs++] = frame;
}

static void flush(cia402_slave_t *self)
{
    uint32_t sent = 0;
    const hal_can_t can = sim_can_hal(&self->node);
    while (sent < self->outs && hal_can_send(can, &self->out[sent]) == HV_OK) {
        sent++;
    }
    memmove(self->out, self->out + sent, (self->outs - sent) * sizeof self->out[0]);
    self->outs -= sent;
}

static void emergency(cia402_slave_t *self, cia402_slave_drive_t *d, uint16_t code)
{
    *value(d, 0x603F, 0) = code;
    out(self, d, 0x80u + d->node, 8, (const uint8_t[8]){(uint8_t)code, (uint8_t)(code >> 8), 0x21});
}

/* --- States --- */

static void enter(cia402_slave_t *self, cia402_slave_drive_t *d, uint16_t status)
{
    d->target_state = status;
    if (status == d->status) {
        return;
    }
    if (d->status == ST_ENABLED) {
        d->left_us = self->now_us;
        d->is_homing = d->is_homing_begun = false;
    }
    if (status == ST_ENABLED) {
        d->enabled++;
        d->enabled_us = self->now_us;
        d->has_target = false;
        d->is_pp_taken = false;
    }
    d->status = status;
}

static void go(cia402_slave_t *self, cia402_slave_drive_t *d, uint16_t status, uint32_t delay_us)
{
    if (d->target_state != status && !(d->is_stuck && d->status == d->stuck_at)) {
        d->target_state = status;
        d->due_us = self->now_us + delay_us;
    }
}

void cia402_slave_fault(cia402_slave_t *self, unsigned drive, uint16_t code)
{
    cia402_slave_drive_t *d = &self->drive[drive];
    if (d->status != ST_FAULT) {
        enter(self, d, ST_FAULT);
        emergency(self, d, code);
    }
}

void cia402_slave_drop(cia402_slave_t *self, unsigned drive)
{
    enter(self, &self->drive[drive], ST_DISABLED);
}

/* An error is told once, whatever the drive makes of it (CiA 301). */
static void connection_lost(cia402_slave_t *self, cia402_slave_drive_t *d, bool is_always_told)
{
    const bool is_fault = d->status == ST_ENABLED && *value(d, 0x6007, 0) != 0;
    if (is_fault) {
        enter(self, d, ST_FAULT);
    }
    if (is_fault || is_always_told) {
        emergency(self, d, 0x8130);
    }
}

static void command(cia402_slave_t *self, cia402_slave_drive_t *d, uint16_t word)
{
    const uint16_t rising = word & (uint16_t)~d->word;
    d->word = word;
    if (d->status == ST_FAULT) {
        if ((rising & 0x80) != 0) {
            d->resets++;
            *value(d, 0x603F, 0) = 0;
            enter(self, d, ST_DISABLED);
        }
        return;
    }
    const unsigned bits = word & 0x8F;
    const bool is_down = (bits & 0x82) == 0;     /* disable voltage */
    const bool is_quick = (bits & 0x86) == 0x02; /* quick stop */
    const bool is_shutdown = (bits & 0x87) == 0x06;
    const bool is_on = (bits & 0x8F) == 0x07;
    const bool is_enable = (bits & 0x8F) == 0x0F;
    switch (d->status) {
    case ST_DISABLED:
        if (is_shutdown) {
            go(self, d, ST_READY, 0);
        }
        break;
    case ST_READY:
        if (is_down || is_quick) {
            go(self, d, ST_DISABLED, 0);
        } else if (is_on || is_enable) {
            go(self, d, ST_ON, d->power_us);
        }
        break;
    case ST_ON:
        if (is_down || is_quick) {
            go(self, d, ST_DISABLED, 0);
        } else if (is_shutdown) {
            go(self, d, ST_READY, 0);
        } else if (is_enable) {
            go(self, d, ST_ENABLED, d->brake_us);
        }
        break;
    case ST_ENABLED:
        if (is_down) {
            go(self, d, ST_DISABLED, 0);
        } else if (is_quick) {
            d->quick_stops++;
            enter(self, d, ST_QUICK);
            go(self, d, ST_DISABLED, d->quick_us);
        } else if (is_shutdown) {
            go(self, d, ST_READY, 0);
        } else if (is_on) {
            go(self, d, ST_ON, 0);
        }
        break;
    case ST_QUICK:
        if (is_down) {
            enter(self, d, ST_DISABLED);
        }
        break;
    default:
        break;
    }
}

static void advance(cia402_slave_t *self, cia402_slave_drive_t *d)
{
    if (d->target_state != d->status && self->now_us >= d->due_us) {
        enter(self, d, d->target_state);
    }
    if (d->status == ST_NOT_READY) {
        go(self, d, ST_DISABLED, 1000);
    }
    d->position += d->status == ST_QUICK ? d->quick_counts : 0;
    if (d->is_restless && d->nmt == OPERATIONAL && (d->word & 0x82) == 0 && d->target_state == d->status) {
        if (d->status == ST_DISABLED) {
            go(self, d, ST_READY, 1000);
        } else if (d->status == ST_READY) {
            go(self, d, ST_DISABLED, 1000);
        }
    }
    if (d->is_homing && d->is_homing_begun && !d->is_homing_done && !d->is_homing_failing && self->now_us >= d->homing_end_us) {
        d->is_homing_done = true;
        d->position = (int32_t)*value(d, 0x607C, 0);
    }
}

/* --- Set-points --- */

static void take_target(cia402_slave_t *self, cia402_slave_drive_t *d, int32_t target)
{
    const int32_t from = d->has_target ? d->last_target : d->position;
    const int32_t step = abs((int32_t)((uint32_t)target - (uint32_t)from)); /* wraps round */
    d->largest_step = step > d->largest_step ? step : d->largest_step;
    d->has_target = true;
    d->last_target = target;
    d->setpoints++;
    if (abs((int32_t)((uint32_t)target - (uint32_t)d->position)) > d->jump_counts) {
        cia402_slave_fault(self, (unsigned)(d - self->drive), 0x8611);
        return;
    }
    d->position = target;
}

static void operate(cia402_slave_t *self, cia402_slave_drive_t *d, int32_t target)
{
    const bool bit4 = (d->word & 0x10) != 0;
    if (d->mode == 8 || (d->mode == 7 && bit4)) {
        take_target(self, d, target);
    } else if (d->mode == 1) {
        if (bit4 && !d->is_pp_taken) {
            take_target(self, d, target);
        }
        d->is_pp_taken = bit4;
    } else if (d->mode == 6) {
        if (bit4 && !d->is_homing_begun) {
            d->is_homing = d->is_homing_begun = true;
            d->is_homing_done = false;
            d->homing_end_us = self->now_us + d->homing_us;
        }
        d->is_homing_begun = bit4;
    }
}

static uint16_t status_of(const cia402_slave_drive_t *d)
{
    uint16_t status = (uint16_t)(d->status | 0x0200 | (d->status == ST_DISABLED ? 0 : 0x10));
    if (d->status != ST_ENABLED) {
        return status;
    }
    switch (d->mode) {
    case 8:
        return status | 0x1000;
    case 7:
        return (d->word & 0x10) != 0 ? status | 0x1000 : status;
    case 1:
        return d->is_pp_taken ? status | 0x1000 : status;
    case 6:
        if (d->is_homing_failing && d->is_homing) {
            return status | 0x2000;
        }
        return d->is_homing_done ? status | 0x1400 : d->is_homing ? status : status | 0x0400;
    default:
        return status;
    }
}

static uint32_t mapped_value(cia402_slave_drive_t *d, uint32_t entry)
{
    switch (entry >> 8) {
    case 0x604100:
        return (uint16_t)((status_of(d) | d->status_set) & ~d->status_clear);
    case 0x606400:
        return (uint32_t)d->position;
    case 0x606100:
        return (uint8_t)d->mode;
    case 0x607700:
        return (uint16_t)d->torque;
    case 0x60F400:
        return (uint32_t)d->lag;
    case 0x60FD00:
        return d->inputs;
    default:
        return 0;
    }
}

/* At every so manyth SYNC. */
static void send_tpdo(cia402_slave_t *self, cia402_slave_drive_t *d, uint16_t n)
{
    uint8_t data[8] = {0};
    uint8_t at = 0;
    const uint16_t mapping = (uint16_t)(0x1A00 + n);
    const uint32_t cob = *value(d, (uint16_t)(0x1800 + n), 1);
    const uint32_t rate = *value(d, (uint16_t)(0x1800 + n), 2);
    if ((cob & 0x80000000u) != 0 || rate > 240) {
        return;
    }
    if (n == 0 && *value(d, 0x1800, 6) != 0 && !d->is_counting) {
        d->is_counting = self->sync_number == *value(d, 0x1800, 6);
        d->sync_count[0] = (uint8_t)(rate - 1u);
        if (!d->is_counting) {
            return;
        }
    }
    d->sync_count[n]++;
    if (d->sync_count[n] < rate) {
        return;
    }
    d->sync_count[n] = 0;
    if (n == 0 && d->tpdo_drop > 0) {
        d->tpdo_drop--;
        return;
    }
    for (uint8_t k = 1; k <= *value(d, mapping, 0); k++) {
        const uint32_t entry = *value(d, mapping, k);
        const uint32_t now = mapped_value(d, entry);
        for (unsigned i = 0; i < (entry & 0xFF) / 8; i++) {
            data[at++] = (uint8_t)(now >> (8 * i));
        }
    }
    out(self, d, cob & 0x7FF, (uint8_t)(at - (n == 0 ? d->tpdo_cut : 0)), data);
}

static void take_sync(cia402_slave_t *self, cia402_slave_drive_t *d, const can_frame_t *sync)
{
    const uint8_t length = sync->length;
    self->sync_number = sync->data[0];
    if (d->nmt != OPERATIONAL) {
        return;
    }
    if (length != (*value(d, 0x1019, 0) >= 2 ? 1 : 0)) {
        emergency(self, d, 0x8240);
        return;
    }
    for (uint16_t n = 0; n < CIA402_SLAVE_TPDOS; n++) {
        send_tpdo(self, d, n);
    }
    if (!d->has_rpdo) {
        return;
    }
    d->has_rpdo = false;
    command(self, d, (uint16_t)(d->rpdo[0] | d->rpdo[1] << 8));
    if (d->status == ST_ENABLED) {
        const uint32_t bits = d->rpdo[2] | (uint32_t)d->rpdo[3] << 8 | (uint32_t)d->rpdo[4] << 16 | (uint32_t)d->rpdo[5] << 24;
        operate(self, d, (int32_t)bits);
    }
}

static void take_rpdo(cia402_slave_drive_t *d, const can_frame_t *frame)
{
    const bool is_valid = (*value(d, 0x1400, 1) & 0x80000000u) == 0 && *value(d, 0x1400, 2) <= 240;
    if (d->nmt == OPERATIONAL && is_valid && frame->length >= 6) {
        memcpy(d->rpdo, frame->data, 8);
        d->has_rpdo = true;
    }
}

/* --- SDO --- */

static bool is_pdo_valid(cia402_slave_drive_t *d, uint16_t record)
{
    return (*value(d, record, 1) & 0x80000000u) == 0;
}

/* The rules of mapping. */
static uint32_t pdo_refusal(cia402_slave_drive_t *d, uint16_t index, uint8_t sub, uint32_t asked)
{
    if (index < 0x1400 || index > 0x1BFF) {
        return 0;
    }
    if (d->nmt == OPERATIONAL) {
        return WRONG_STATE;
    }
    if ((index & 0x200) != 0) {
        const uint16_t record = index - 0x200;
        const bool is_counted = sub > 0 && *value(d, index, 0) != 0;
        if (is_pdo_valid(d, record) || is_counted) {
            return UNSUPPORTED;
        }
        return 0;
    }
    if (sub == 1) {
        const uint32_t now = *value(d, index, 1);
        if ((now & 0x80000000u) == 0 && (asked & 0x80000000u) == 0 && ((now ^ asked) & 0x1FFFFFFF) != 0) {
            return BAD_VALUE;
        }
        if (index >= 0x1800 && ((now ^ asked) & 0x40000000u) != 0) {
            return BAD_VALUE;
        }
        return (asked & 0x80000000u) == 0 && *value(d, index + 0x200, 0) == 0 ? BAD_VALUE : 0;
    }
    return sub == 3 && is_pdo_valid(d, index) ? UNSUPPORTED : 0;
}

static uint32_t mode_refusal(cia402_slave_drive_t *d, uint32_t asked)
{
    const bool is_known = asked == 0 || asked == 1 || asked == 6 || asked == 7 || asked == 8;
    return !is_known ? BAD_VALUE : d->status == ST_ENABLED ? WRONG_STATE : 0;
}

static uint32_t write(cia402_slave_t *self, cia402_slave_drive_t *d, cia402_slave_row_t *row, uint32_t asked, uint8_t bytes)
{
    uint32_t refusal = row->refusal;
    if (row->is_read_only) {
        return READ_ONLY;
    }
    if (bytes != row->bytes) {
        return TOO_LONG;
    }
    refusal = refusal != 0 ? refusal : pdo_refusal(d, row->index, row->sub, asked);
    refusal = refusal != 0 || row->index != 0x6060 ? refusal : mode_refusal(d, asked);
    if (refusal != 0) {
        return refusal;
    }
    row->value = asked;
    if (d->logged < CIA402_SLAVE_LOG) {
        d->log[d->logged++] = (uint32_t)row->index << 8 | row->sub;
    }
    if (row->index == 0x6060) {
        d->mode = (int8_t)asked;
        *value(d, 0x6061, 0) = asked;
    }
    if (row->index == 0x1017) {
        d->beat_us = self->now_us;
    }
    return 0;
}

static void answer(cia402_slave_t *self, cia402_slave_drive_t *d, const uint8_t data[8])
{
    can_frame_t frame = {.id = 0x580u + d->node, .length = 8};
    memcpy(frame.data, data, 8);
    if (!d->is_answering_late) {
        out(self, d, frame.id, 8, data);
        return;
    }
    if (d->has_late) {
        out(self, d, d->late.id, 8, d->late.data);
    }
    d->late = frame;
    d->has_late = true;
}

static void refuse(cia402_slave_t *self, cia402_slave_drive_t *d, const uint8_t *request, uint32_t code)
{
    d->aborts++;
    answer(self, d,
           (const uint8_t[8]){0x80, request[1], request[2], request[3], (uint8_t)code, (uint8_t)(code >> 8),
                              (uint8_t)(code >> 16), (uint8_t)(code >> 24)});
}

static void take_sdo(cia402_slave_t *self, cia402_slave_drive_t *d, const can_frame_t *frame)
{
    const uint8_t *q = frame->data;
    const uint16_t index = (uint16_t)(q[1] | q[2] << 8);
    if (frame->length != 8 || d->is_deaf_sdo || d->nmt == 0 || d->nmt == STOPPED || q[0] == 0x80) {
        return;
    }
    cia402_slave_row_t *row = find(d, index, q[3]);
    if (row != NULL && row->is_silent) {
        return;
    }
    if (row == NULL || row->is_missing) {
        refuse(self, d, q, NO_OBJECT);
    } else if (q[0] == 0x40) {
        const uint32_t v = row->value;
        answer(self, d,
               (const uint8_t[8]){(uint8_t)(0x43 | (4 - row->bytes) << 2), q[1], q[2], q[3], (uint8_t)v, (uint8_t)(v >> 8),
                                  (uint8_t)(v >> 16), (uint8_t)(v >> 24)});
    } else {
        const uint8_t bytes = (uint8_t)(4 - (q[0] >> 2 & 3));
        uint32_t asked = 0;
        for (unsigned i = 0; i < bytes; i++) {
            asked |= (uint32_t)q[4 + i] << (8 * i);
        }
        const uint32_t refusal = (q[0] & 0xE3) == 0x23 ? write(self, d, row, asked, bytes) : 0x05040001u;
        if (refusal != 0) {
            refuse(self, d, q, refusal);
        } else {
            answer(self, d, (const uint8_t[8]){0x60, q[1], q[2], q[3]});
        }
    }
}

/* --- NMT --- */

static void boot(cia402_slave_t *self, cia402_slave_drive_t *d, uint32_t delay_us)
{
    d->nmt = 0;
    d->boot_us = self->now_us + delay_us;
    d->is_master_watched = false;
    d->has_rpdo = false;
    for (uint32_t i = 0; i < d->rows; i++) {
        if (d->row[i].index < 0x2000) {
            d->row[i].value = d->row[i].initial;
        }
    }
}

void cia402_slave_power(cia402_slave_t *self, unsigned drive, bool is_on)
{
    cia402_slave_drive_t *d = &self->drive[drive];
    d->is_on = is_on;
    if (d->status == ST_ENABLED) {
        d->left_us = self->now_us;
    }
    d->status = d->target_state = ST_NOT_READY;
    d->mode = 0;
    boot(self, d, BOOT_US);
}

static void set_nmt(cia402_slave_t *self, cia402_slave_drive_t *d, uint8_t state)
{
    const uint8_t was = d->nmt;
    d->nmt = state;
    d->is_counting = false;
    memset(d->sync_count, 0, sizeof d->sync_count);
    if (was == OPERATIONAL && state != OPERATIONAL) {
        connection_lost(self, d, false);
    }
}

static void take_nmt(cia402_slave_t *self, cia402_slave_drive_t *d, const uint8_t *data)
{
    if ((data[1] != 0 && data[1] != d->node) || d->nmt == 0) {
        return;
    }
    switch (data[0]) {
    case 0x01:
        set_nmt(self, d, OPERATIONAL);
        break;
    case 0x02:
        set_nmt(self, d, STOPPED);
        break;
    case 0x80:
        set_nmt(self, d, PREOP);
        break;
    case 0x82:
        set_nmt(self, d, PREOP);
        boot(self, d, BOOT_US / 3);
        break;
    default:
        break;
    }
}

static void live(cia402_slave_t *self, cia402_slave_drive_t *d)
{
    if (d->nmt == 0 && self->now_us >= d->boot_us) {
        d->nmt = PREOP;
        d->boots++;
        out(self, d, 0x700u + d->node, 1, (const uint8_t[1]){0});
    }
    const uint32_t beat_ms = *value(d, 0x1017, 0);
    if (d->nmt != 0 && beat_ms != 0 && self->now_us - d->beat_us >= beat_ms * 1000u) {
        d->beat_us = self->now_us;
        if (!d->has_no_beat) {
            out(self, d, 0x700u + d->node, 1, &d->nmt);
        }
    }
    const uint32_t watch_ms = *value(d, 0x1016, 1) & 0xFFFF;
    if (d->is_master_watched && watch_ms != 0 && self->now_us - d->master_us > watch_ms * 1000u) {
        d->is_master_watched = false;
        connection_lost(self, d, true);
    }
    advance(self, d);
}

static void hear(cia402_slave_t *self, cia402_slave_drive_t *d, const can_frame_t *frame)
{
    if (frame->id == 0) {
        take_nmt(self, d, frame->data);
    } else if (frame->id == 0x80) {
        take_sync(self, d, frame);
    } else if (frame->id == (*value(d, 0x1400, 1) & 0x7FF)) {
        take_rpdo(d, frame);
    } else if (frame->id == 0x600u + d->node) {
        take_sdo(self, d, frame);
    } else if (frame->id == 0x700u + (*value(d, 0x1016, 1) >> 16 & 0x7F)) {
        d->master_us = self->now_us;
        d->is_master_watched = true;
    }
}

void cia402_slave_step(cia402_slave_t *self, uint64_t now_us)
{
    can_frame_t frame;
    uint64_t at_us = 0;
    self->now_us = now_us;
    for (int round = 0; round < 3; round++) {
        sim_can_bus_step(self->bus, now_us);
        while (hal_can_recv(sim_can_hal(&self->node), &frame, &at_us) == HV_OK) {
            self->syncs += frame.id == 0x80 && !frame.is_error;
            self->heartbeats += frame.id == 0x77F && !frame.is_error;
            for (unsigned k = 0; k < CIA402_SLAVES && !frame.is_error; k++) {
                if (self->drive[k].is_on) {
                    hear(self, &self->drive[k], &frame);
                }
            }
        }
        for (unsigned k = 0; k < CIA402_SLAVES; k++) {
            if (self->drive[k].is_on) {
                live(self, &self->drive[k]);
            }
        }
        flush(self);
    }
    sim_can_bus_step(self->bus, now_us);
}

void cia402_slave_open(cia402_slave_t *self, sim_can_bus_t *bus)
{
    memset(self, 0, sizeof *self);
    self->bus = bus;
    if (sim_can_open(&self->node, bus, NULL, 0) != HV_OK) {
        abort();
    }
    for (unsigned k = 0; k < CIA402_SLAVES; k++) {
        cia402_slave_drive_t *d = &self->drive[k];
        d->node = (uint8_t)(k + 1);
        d->power_us = 5000;
        d->quick_us = 3000;
        d->brake_us = 8000 + 1000 * k;
        d->homing_us = 50000;
        d->jump_counts = JUMP_COUNTS;
        d->rows = sizeof k_rows / sizeof k_rows[0];
        memcpy(d->row, k_rows, sizeof k_rows);
        for (uint32_t i = 0; i < d->rows; i++) {
            const bool is_cob = (d->row[i].index & 0xFF00) != 0x1600 && d->row[i].index >= 0x1400 && d->row[i].index < 0x1A00 &&
                                d->row[i].sub == 1;
            d->row[i].value += is_cob ? d->node : 0;
            d->row[i].initial = d->row[i].value;
        }
        cia402_slave_power(self, k, true);
    }
}
