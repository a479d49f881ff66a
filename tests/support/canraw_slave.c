/* SPDX-License-Identifier: MIT
 * canraw_slave.c - simulated drives with frames of their own; see canraw_slave.h.
 */
#include "canraw_slave.h"

#include <stdlib.h>
#include <string.h>

#define PLAIN_ID       0x601u
#define PLAIN_REPLY_ID 0x581u
#define RICH_ID        0x18FF0100u
#define RICH_REPLY_ID  0x18FF0200u

void canraw_slave_open(canraw_slave_t *self, sim_can_bus_t *bus, bool is_rich)
{
    memset(self, 0, sizeof *self);
    self->is_rich = is_rich;
    self->homing_takes_us = 30000;
    if (sim_can_open(&self->node, bus, NULL, 0) != HV_OK) {
        abort();
    }
    for (unsigned k = 0; k < CANRAW_SLAVES; k++) {
        self->drive[k].is_on = true;
        self->drive[k].is_homed = true;
    }
}

/* Bit by bit, highest first, as the standard draws it: shares nothing with the driver. */
uint8_t canraw_slave_crc(const uint8_t *data, unsigned length)
{
    unsigned remainder = 0;
    for (unsigned bit = 0; bit < 8 * length + 8; bit++) {
        const unsigned next = bit < 8 * length ? data[bit / 8] >> (7 - bit % 8) & 1u : 0;
        remainder = remainder << 1 | next;
        remainder = (remainder & 0x100u) != 0 ? remainder ^ 0x11Du : remainder;
    }
    return (uint8_t)remainder;
}

static void answer(canraw_slave_t *self, unsigned k, const uint8_t *data, uint8_t length)
{
    can_frame_t frame = {
        .id = (self->is_rich ? RICH_REPLY_ID : PLAIN_REPLY_ID) + k, .is_extended = self->is_rich, .length = length};
    memcpy(frame.data, data, length);
    if (self->is_sealed) {
        self->drive[k].counter_out = (uint8_t)(self->drive[k].counter_out + !self->drive[k].is_stuck);
        frame.data[length] = self->drive[k].counter_out;
        frame.data[length + 1] = canraw_slave_crc(frame.data, length + 1u);
        frame.length = (uint8_t)(length + 2);
    }
    if (!self->drive[k].is_dumb) {
        (void)!hal_can_send(sim_can_hal(&self->node), &frame); /* a full queue loses it, as with real ones */
    }
}

static bool is_following(const canraw_slave_t *self, const canraw_slave_drive_t *drive)
{
    return !drive->is_homing && !drive->is_faulty && (drive->is_enabled || !self->is_rich);
}

/* A way of any length. */
static int32_t step_between(int32_t from, int32_t to)
{
    const int64_t way = llabs((int64_t)to - from);
    return way < INT32_MAX ? (int32_t)way : INT32_MAX;
}

static void take_target(canraw_slave_t *self, canraw_slave_drive_t *drive, int32_t target)
{
    const int32_t from = drive->setpoints == 0 ? drive->position : drive->target;
    drive->setpoints++;
    if (drive->is_homing) {
        return;
    }
    const int32_t step = step_between(from, target);
    if (is_following(self, drive) && step > drive->largest_step) {
        drive->largest_step = step;
    }
    drive->target = target;
}

static void begin_homing(canraw_slave_t *self, canraw_slave_drive_t *drive)
{
    drive->is_homing = true;
    drive->is_homed = self->homing_stale_us > 0;
    drive->stale_until_us = self->now_us + self->homing_stale_us;
    drive->homing_us = self->now_us + self->homing_takes_us;
}

static int32_t le32(const uint8_t *data)
{
    return (int32_t)((uint32_t)data[0] | (uint32_t)data[1] << 8 | (uint32_t)data[2] << 16 | (uint32_t)data[3] << 24);
}

static int32_t be32(const uint8_t *data)
{
    return (int32_t)((uint32_t)data[3] | (uint32_t)data[2] << 8 | (uint32_t)data[1] << 16 | (uint32_t)data[0] << 24);
}

static void take_plain(canraw_slave_t *self, unsigned k, const can_frame_t *frame)
{
    static const uint8_t k_home[8] = {1, 3, 1};
    canraw_slave_drive_t *drive = &self->drive[k];
    const uint8_t *data = frame->data;
    const uint32_t position = (uint32_t)drive->position;
    if (frame->length == 8 && memcmp(data, k_home, 8) == 0) {
        begin_homing(self, drive);
    } else if (frame->length == 8 && data[0] == 1 && data[1] == 5) {
        take_target(self, drive, le32(data + 2));
        drive->speed = (uint16_t)(data[6] | data[7] << 8);
    } else if (frame->length == 2 && data[0] == 0 && data[1] == 0x15) {
        answer(self, k,
               (const uint8_t[]){0, 0x15, (uint8_t)position, (uint8_t)(position >> 8), (uint8_t)(position >> 16),
                                 (uint8_t)(position >> 24)},
               6);
    } else if (frame->length == 2 && data[0] == 0 && data[1] == 0x12) {
        answer(self, k, (const uint8_t[]){0, 0x12, drive->is_homed}, 3);
    } else {
        abort(); /* no frame of this dialect */
    }
}

static void answer_rich(canraw_slave_t *self, unsigned k)
{
    const canraw_slave_drive_t *drive = &self->drive[k];
    const uint32_t position = (uint32_t)drive->position;
    const uint8_t status = (uint8_t)(drive->is_enabled | drive->is_faulty << 1 | drive->is_homed << 2);
    answer(self, k,
           (const uint8_t[]){0x30, status, (uint8_t)(position >> 24), (uint8_t)(position >> 16), (uint8_t)(position >> 8),
                             (uint8_t)position},
           6);
}

/* A target left from before is a step now. */
static void enable(canraw_slave_drive_t *drive)
{
    const int32_t step = drive->setpoints > 0 ? step_between(drive->position, drive->target) : 0;
    if (drive->is_faulty || drive->is_enabled) {
        return;
    }
    drive->is_enabled = true;
    drive->is_stopped = false;
    drive->largest_step = step > drive->largest_step ? step : drive->largest_step;
}

static void take_rich(canraw_slave_t *self, unsigned k, const can_frame_t *frame)
{
    canraw_slave_drive_t *drive = &self->drive[k];
    switch (frame->data[0]) {
    case 0x10:
        take_target(self, drive, be32(frame->data + 1));
        if (drive->is_enabled_by_target) {
            enable(drive);
        }
        break;
    case 0x20:
        enable(drive);
        break;
    case 0x21:
        drive->is_enabled = false;
        break;
    case 0x22:
        drive->is_stopped = self->is_holding_on_stop && drive->is_enabled;
        drive->glide_us = self->now_us + self->glide_takes_us;
        drive->is_enabled = drive->is_stopped;
        drive->is_homing = false;
        drive->stops++;
        break;
    case 0x23:
        drive->is_faulty = false;
        break;
    case 0x24:
        begin_homing(self, drive);
        break;
    case 0x30:
        answer_rich(self, k);
        break;
    default:
        abort();
    }
}

static void take_frame(canraw_slave_t *self, const can_frame_t *frame)
{
    const uint32_t base = self->is_rich ? RICH_ID : PLAIN_ID;
    if (self->logged < CANRAW_SLAVE_LOG) {
        self->log[self->logged++] = *frame;
    }
    if (frame->is_error || frame->is_extended != self->is_rich || frame->id < base || frame->id >= base + CANRAW_SLAVES) {
        abort();
    }
    const unsigned k = frame->id - base;
    if (self->is_sealed) {
        canraw_slave_drive_t *drive = &self->drive[k];
        const uint8_t counter = frame->data[frame->length - 2];
        if (frame->length < 3 || canraw_slave_crc(frame->data, frame->length - 1u) != frame->data[frame->length - 1]) {
            abort();
        }
        drive->gaps += drive->frames++ > 0 && counter != (uint8_t)(drive->counter_in + 1);
        drive->counter_in = counter;
    }
    if (!self->drive[k].is_on) {
        return;
    }
    if (self->is_rich) {
        take_rich(self, k, frame);
    } else {
        take_plain(self, k, frame);
    }
}

static void move(canraw_slave_t *self, canraw_slave_drive_t *drive)
{
    if (drive->is_homing && self->now_us >= drive->stale_until_us) {
        drive->is_homed = false;
    }
    if (drive->is_homing && self->now_us >= drive->homing_us && !drive->is_failing) {
        drive->is_homing = false;
        drive->is_homed = true;
        drive->position = self->is_rich ? CANRAW_SLAVE_RICH_ZERO : 0;
        drive->setpoints = 0;
    } else if (drive->is_enabled && drive->is_stopped) {
        drive->position += self->now_us < drive->glide_us ? self->glide_counts : 0;
    } else if (is_following(self, drive) && drive->setpoints > 0) {
        const int64_t left = (int64_t)drive->target - drive->position;
        drive->position += (int32_t)(llabs(left) < 4 ? left : left / 2);
    }
}

void canraw_slave_step(canraw_slave_t *self, uint64_t now_us)
{
    can_frame_t frame;
    uint64_t time_us;
    self->now_us = now_us;
    sim_can_bus_step(self->node.bus, now_us);
    while (hal_can_recv(sim_can_hal(&self->node), &frame, &time_us) == HV_OK) {
        take_frame(self, &frame);
    }
    for (unsigned k = 0; k < CANRAW_SLAVES; k++) {
        if (self->drive[k].is_on) {
            move(self, &self->drive[k]);
        }
    }
    sim_can_bus_step(self->node.bus, now_us);
}
