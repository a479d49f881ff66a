/* SPDX-License-Identifier: MIT
 * canraw_drives.c - heave-twin's drives with frames of their own on a simulated CAN bus; see canraw_drives.h.
 */
#include "canraw_drives.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define SPEED 60000.0 /* counts/s */

static void require(bool is_so)
{
    if (!is_so) {
        abort();
    }
}

/* Bit by bit, highest first, as the standard draws it. */
uint8_t canraw_drives_crc(const uint8_t *data, unsigned length)
{
    unsigned remainder = 0;
    for (unsigned bit = 0; bit < 8 * length + 8; bit++) {
        const unsigned next = bit < 8 * length ? data[bit / 8] >> (7 - bit % 8) & 1u : 0;
        remainder = remainder << 1 | next;
        remainder = (remainder & 0x100u) != 0 ? remainder ^ 0x11Du : remainder;
    }
    return (uint8_t)remainder;
}

/* Length without counter and check byte, of which the latter has to be right. */
static uint8_t unsealed(const canraw_drives_t *self, const can_frame_t *frame)
{
    const bool is_sealed = self->map.is_extended && self->map.position_query.length > 1;
    require(!is_sealed ||
            (frame->length > 2 && canraw_drives_crc(frame->data, frame->length - 1u) == frame->data[frame->length - 1]));
    return (uint8_t)(frame->length - (is_sealed ? 2 : 0));
}

static int32_t number(const canraw_drives_t *self, const uint8_t *data)
{
    uint32_t bits = 0;
    for (unsigned i = 0; i < 4; i++) {
        bits = bits << 8 | data[self->map.is_extended ? i : 3 - i];
    }
    return (int32_t)bits;
}

static void put(void *ctx, const can_frame_t *frame)
{
    canraw_drives_t *self = ctx;
    can_frame_t out = *frame;
    const unsigned k = frame->id - (self->map.is_extended ? 0x18FF0200u : 0x581u);
    if (unsealed(self, frame) == 6) {
        require(number(self, frame->data + 2) == frame_drive_count(&self->twin[k]));
    } else if (self->now_us < self->sent[k].homing_us + self->homing_stale_us) {
        out.data[2] = 1;
    }
    (void)!hal_can_send(sim_can_hal(&self->node), &out); /* a full queue loses it, as with real ones */
}

void canraw_drives_open(canraw_drives_t *self, sim_can_bus_t *bus, canraw_map_t map)
{
    memset(self, 0, sizeof *self);
    self->map = map;
    if (!map.is_extended) { /* they say what they answer, and read what is negative */
        self->map.position_reply.constant = self->map.homing_reply.constant = 3;
        self->map.position_reply.data[1] = 0x15;
        self->map.homing_reply.data[1] = 0x12;
        self->map.setpoint.field[0].is_signed = true;
    }
    require(sim_can_open(&self->node, bus, NULL, 0) == HV_OK);
    for (unsigned k = 0; k < DRIVES_MAX; k++) {
        frame_drive_t *twin = &self->twin[k];
        frame_drive_init(twin, &self->map, k, (node_out_t){put, self});
        twin->motor = &self->motor[k];
        twin->home = map.is_extended ? CANRAW_DRIVES_RICH_ZERO : 0;
        twin->usual_speed = SPEED;
        twin->is_torque_kept = true;
        frame_drive_power(twin, true, 0);
        twin->boot_us = 0;
        twin->is_homed = true;
        self->sent[k].homing_takes_us = 30000;
    }
}

void canraw_drives_place(canraw_drives_t *self, unsigned k, int32_t counts)
{
    self->motor[k].actual = counts;
    motor_hold(&self->motor[k]);
    self->twin[k].origin = 0;
}

void canraw_drives_command(canraw_drives_t *self, unsigned k, canraw_command_t command)
{
    const canraw_frame_t *form = &self->map.command[command];
    can_frame_t frame = {.id = self->map.axis[k].command_id, .is_extended = self->map.is_extended, .length = form->length};
    require(canraw_pack(form, (const int64_t[CANRAW_VALUES]){0}, frame.data) == HV_OK);
    frame_drive_hear(&self->twin[k], &frame, self->now_us);
}

/* What a frame is; no other is of this dialect. */
typedef enum { SETPOINT, HOME, STOP, ANY } kind_t;

static kind_t kind_of_plain(const can_frame_t *frame)
{
    const uint8_t *data = frame->data;
    if (frame->length == 8 && data[0] == 1 && data[1] == 5) {
        return SETPOINT;
    }
    if (frame->length == 8 && memcmp(data, "\x01\x03\x01\0\0\0\0", 8) == 0) {
        return HOME;
    }
    require(frame->length == 2 && data[0] == 0 && (data[1] == 0x15 || data[1] == 0x12));
    return ANY;
}

static kind_t kind_of_rich(const can_frame_t *frame, uint8_t length)
{
    const uint8_t what = frame->data[0];
    if (what == 0x10 && length == 5) {
        return SETPOINT;
    }
    require(length == 1 && ((what >= 0x20 && what <= 0x24) || what == 0x30));
    return what == 0x22 ? STOP : what == 0x24 ? HOME : ANY;
}

/* Its way from where it is told to be, or is; a target left from before is a step when torque comes. */
static void hear(canraw_drives_t *self, unsigned k, const can_frame_t *frame, kind_t kind)
{
    frame_drive_t *twin = &self->twin[k];
    canraw_sent_t *sent = &self->sent[k];
    const bool is_led = sent->has_target && twin->state == FRAME_DRIVE_TORQUE;
    const int64_t from = is_led ? sent->target : frame_drive_count(twin);
    if (kind == SETPOINT) {
        sent->has_target = true;
        sent->target = number(self, frame->data + (self->map.is_extended ? 1 : 2));
        sent->speed = (uint16_t)(frame->data[6] | frame->data[7] << 8);
        sent->setpoints++;
    }
    frame_drive_hear(twin, frame, self->now_us);
    if (twin->state == FRAME_DRIVE_TORQUE && sent->has_target) {
        sent->largest_step = (int32_t)fx_clamp(llabs(sent->target - from), sent->largest_step, INT32_MAX);
    }
}

static void seek_home(canraw_drives_t *self, unsigned k)
{
    motor_t *motor = &self->motor[k];
    self->sent[k].has_target = false;
    self->sent[k].homing_us = self->now_us;
    motor_travel(motor, motor->goal, fabs(motor->goal - motor->demand) * 1e6 / fmax(self->sent[k].homing_takes_us, 1));
}

static void stop(canraw_drives_t *self, unsigned k)
{
    motor_t *motor = &self->motor[k];
    self->sent[k].stops++;
    if (!self->is_holding_on_stop) {
        canraw_drives_command(self, k, CANRAW_DISABLE);
    } else if (self->glide_takes_us > 0) {
        motor_travel(motor, motor->demand + SPEED * self->glide_takes_us / 1e6, SPEED);
    }
}

static void receive(canraw_drives_t *self, const can_frame_t *frame)
{
    const uint32_t base = self->map.is_extended ? 0x18FF0100u : 0x601u;
    const unsigned k = frame->id - base;
    if (self->logged < CANRAW_DRIVES_LOG) {
        self->log[self->logged++] = *frame;
    }
    require(!frame->is_error && frame->is_extended == self->map.is_extended && frame->id >= base && k < DRIVES_MAX);
    const kind_t kind = self->map.is_extended ? kind_of_rich(frame, unsealed(self, frame)) : kind_of_plain(frame);
    const uint8_t counter = frame->length < 2 ? 0 : frame->data[frame->length - 2];
    self->sent[k].gaps += self->sent[k].frames++ > 0 && counter != (uint8_t)(self->sent[k].counter_in + 1);
    self->sent[k].counter_in = counter;
    if (self->twin[k].is_cut) {
        return;
    }
    hear(self, k, frame, kind);
    if (kind == HOME && self->twin[k].state == FRAME_DRIVE_HOMING) {
        seek_home(self, k);
    } else if (kind == STOP) {
        stop(self, k);
    }
}

void canraw_drives_step(canraw_drives_t *self, uint64_t now_us)
{
    can_frame_t frame;
    uint64_t time_us;
    self->now_us = now_us;
    sim_can_bus_step(self->node.bus, now_us);
    while (hal_can_recv(sim_can_hal(&self->node), &frame, &time_us) == HV_OK) {
        receive(self, &frame);
    }
    for (unsigned k = 0; k < DRIVES_MAX; k++) {
        frame_drive_advance(&self->twin[k], now_us);
    }
    sim_can_bus_step(self->node.bus, now_us);
}
