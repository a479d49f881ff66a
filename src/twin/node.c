/* SPDX-License-Identifier: MIT
 * node.c - a simulated drive on CANopen; see node.h.
 */
#include "twin/node.h"

#include <string.h>

#define PRE_OPERATIONAL 0x7Fu
#define OPERATIONAL     0x05u
#define STOPPED         0x04u

#define HEARTBEAT_LOST 0x8130u
#define SYNC_LATE      0x8100u
#define PDO_SHORT      0x8210u
#define SYNC_LENGTH    0x8240u

#define SYNCHRONOUS_MAX 240u
#define BAD_COMMAND     0x05040001u
#define RESET_SHARE     4u   /* a reset of the communication takes so much less than a boot */
#define EVENT_US        1000 /* PDOs that tell of changes leave a gap */
#define LOOK_US         1000 /* an axis with power is looked at so often */

/* --- Out --- */

static void put(node_t *self, uint32_t id, const uint8_t *data, uint8_t length)
{
    can_frame_t frame = {.id = id, .length = length};
    if (self->is_mute || self->is_cut) {
        return;
    }
    if (length > 0) {
        memcpy(frame.data, data, length);
    }
    self->out.put(self->out.ctx, &frame);
}

static void put_later(node_t *self, uint32_t delay_us, uint32_t id, const uint8_t *data, uint8_t length)
{
    if (delay_us == 0) {
        put(self, id, data, length);
    } else if (self->waits < NODE_WAITING_MAX) {
        node_waiting_t *item = &self->waiting[self->waits++];
        *item = (node_waiting_t){.due_us = self->now_us + delay_us, .frame = {.id = id, .length = length}};
        memcpy(item->frame.data, data, length);
    }
}

static void put_due(node_t *self)
{
    uint32_t kept = 0;
    for (uint32_t i = 0; i < self->waits; i++) {
        const node_waiting_t item = self->waiting[i];
        if (item.due_us > self->now_us) {
            self->waiting[kept++] = item;
        } else {
            put(self, item.frame.id, item.frame.data, item.frame.length);
        }
    }
    self->waits = kept;
}

void node_emergency(node_t *self, uint16_t code, uint8_t error_register)
{
    const uint8_t data[8] = {(uint8_t)code, (uint8_t)(code >> 8), error_register};
    put(self, 0x80u + self->number, data, 8);
}

static void tell_emergency(node_t *self)
{
    drive_t *drive = &self->drive;
    if (drive->emergency != 0 && self->nmt != 0 && self->nmt != STOPPED) {
        node_emergency(self, drive->emergency, drive->emergency_register);
        drive->emergency = 0;
    }
    if (drive->is_emergency_over) {
        drive->is_emergency_over = false;
        node_emergency(self, 0, 0);
    }
}

/* --- PDOs --- */

static uint8_t pack(const node_t *self, uint16_t mapping, uint8_t data[8])
{
    const objects_t *od = &self->drive.od;
    uint8_t length = 0;
    for (uint32_t k = 1; k <= objects_get(od, mapping, 0); k++) {
        const uint32_t entry = objects_get(od, mapping, (uint8_t)k);
        const uint32_t value = objects_get(od, (uint16_t)(entry >> 16), (uint8_t)(entry >> 8 & 0xFF));
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
    put_later(self, self->tpdo_us, objects_get(&self->drive.od, (uint16_t)(0x1800 + n), 1) & CAN_ID_MAX, data, length);
}

static void put_synchronous(node_t *self)
{
    for (uint16_t n = 0; n < OBJECT_PDOS; n++) {
        const uint32_t rate = objects_get(&self->drive.od, (uint16_t)(0x1800 + n), 2);
        if (!objects_is_pdo(&self->drive.od, (uint16_t)(0x1800 + n)) || rate > SYNCHRONOUS_MAX) {
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
static uint64_t event_due_us(const node_t *self, uint16_t n)
{
    const uint32_t timer_ms = objects_get(&self->drive.od, (uint16_t)(0x1800 + n), 5);
    if (self->nmt != OPERATIONAL || !is_event_pdo(self, n)) {
        return DRIVE_NEVER;
    }
    return self->event_us[n] == 0 ? self->now_us : timer_ms == 0 ? DRIVE_NEVER : self->event_us[n] + timer_ms * 1000u;
}

static void put_events(node_t *self)
{
    for (uint16_t n = 0; n < OBJECT_PDOS && self->nmt == OPERATIONAL; n++) {
        uint8_t data[8] = {0};
        if (!is_event_pdo(self, n) || self->now_us < self->event_us[n] + EVENT_US) {
            continue;
        }
        (void)pack(self, (uint16_t)(0x1A00 + n), data);
        if (self->now_us >= event_due_us(self, n) || memcmp(data, self->event_data[n], 8) != 0) {
            memcpy(self->event_data[n], data, 8);
            self->event_us[n] = self->now_us;
            put_tpdo(self, n);
        }
    }
}

/* --- NMT --- */

void node_enter(node_t *self, uint8_t nmt)
{
    const uint8_t was = self->nmt;
    self->nmt = nmt;
    if (was == OPERATIONAL && nmt != OPERATIONAL) {
        drive_connection_lost(&self->drive);
    }
    if (was != OPERATIONAL && nmt == OPERATIONAL) {
        memset(self->event_us, 0, sizeof self->event_us);
    }
}

/* Deaf until the boot-up message. */
static void boot(node_t *self, uint32_t delay_us)
{
    self->nmt = 0;
    self->boot_due_us = self->now_us + delay_us;
    self->beat_due_us = self->master_due_us = self->sync_due_us = DRIVE_NEVER;
    self->pending = 0;
    self->waits = 0;
    memset(self->rate_count, 0, sizeof self->rate_count);
}

/* What is wrong with single objects stays wrong when the drive starts again. */
static void keep_defects(objects_t *self, const objects_t *before)
{
    for (uint32_t i = 0; i < before->count; i++) {
        self->row[i].is_missing = before->row[i].is_missing;
        self->row[i].is_silent = before->row[i].is_silent;
        self->row[i].refusal = before->row[i].refusal;
    }
}

static void start(node_t *self)
{
    const objects_t before = self->drive.od;
    objects_start(&self->drive.od, self->number, self->identity);
    keep_defects(&self->drive.od, &before);
    drive_start(&self->drive, self->now_us);
    boot(self, self->boot_us);
}

void node_power(node_t *self, bool is_on, uint64_t now_us)
{
    if (is_on == self->is_powered) {
        return;
    }
    self->now_us = now_us;
    self->is_powered = is_on;
    self->nmt = 0;
    self->waits = 0;
    if (is_on) {
        start(self);
    } else {
        drive_drop(&self->drive);
    }
}

void node_reboot(node_t *self, uint64_t now_us)
{
    node_power(self, false, now_us);
    node_power(self, true, now_us);
}

static void reset(node_t *self, bool is_all)
{
    node_enter(self, PRE_OPERATIONAL);
    if (is_all) {
        start(self);
    } else {
        objects_reset(&self->drive.od);
        boot(self, self->boot_us / RESET_SHARE);
    }
}

/* With SYNC supervised, it becomes operational only while SYNC is there. */
static bool may_start(const node_t *self)
{
    return objects_get(&self->drive.od, 0x1006, 0) == 0 || self->sync_due_us != DRIVE_NEVER;
}

static void hear_nmt(node_t *self, const can_frame_t *frame)
{
    if (frame->length != 2 || (frame->data[1] != 0 && frame->data[1] != self->number)) {
        return;
    }
    switch (frame->data[0]) {
    case 0x01:
        if (may_start(self)) {
            node_enter(self, OPERATIONAL);
        }
        break;
    case 0x02:
        node_enter(self, STOPPED);
        break;
    case 0x80:
        node_enter(self, PRE_OPERATIONAL);
        break;
    case 0x81:
    case 0x82:
        reset(self, frame->data[0] == 0x81);
        break;
    default:
        break;
    }
}

/* --- Heartbeats --- */

static void beat(node_t *self)
{
    const uint32_t period_ms = objects_get(&self->drive.od, 0x1017, 0);
    if (!self->has_no_heartbeat) {
        put(self, 0x700u + self->number, &self->nmt, 1);
    }
    self->beat_due_us = period_ms == 0 ? DRIVE_NEVER : self->now_us + period_ms * 1000u;
}

static void hear_heartbeat(node_t *self, uint32_t producer)
{
    const uint32_t watch = objects_get(&self->drive.od, 0x1016, 1);
    if ((watch >> 16 & 0x7F) == producer && (watch & 0xFFFF) != 0) {
        self->master_due_us = self->now_us + (watch & 0xFFFF) * 1000u;
    }
}

static void master_lost(node_t *self)
{
    self->master_due_us = DRIVE_NEVER;
    objects_put(&self->drive.od, 0x603F, 0, HEARTBEAT_LOST);
    node_emergency(self, HEARTBEAT_LOST, 0x11);
    if (self->nmt == OPERATIONAL && objects_get(&self->drive.od, 0x1029, 1) != 1) {
        node_enter(self, objects_get(&self->drive.od, 0x1029, 1) == 2 ? STOPPED : PRE_OPERATIONAL);
    }
    self->drive.emergency = 0; /* an error is told once */
}

/* --- SYNC and RPDOs --- */

static void apply(node_t *self, uint16_t n, const uint8_t *data)
{
    objects_t *od = &self->drive.od;
    unsigned at = 0;
    uint32_t control = UINT32_MAX;
    for (uint32_t k = 1; k <= objects_get(od, (uint16_t)(0x1600 + n), 0); k++) {
        const uint32_t entry = objects_get(od, (uint16_t)(0x1600 + n), (uint8_t)k);
        const uint16_t index = (uint16_t)(entry >> 16);
        uint32_t value = 0;
        for (unsigned i = 0; i < (entry & 0xFF) / 8; i++) {
            value |= (uint32_t)data[at++] << (8 * i);
        }
        objects_put(od, index, (uint8_t)(entry >> 8 & 0xFF), value);
        self->drive.has_set_point |= index == 0x607A || index == 0x60C1;
        control = index == 0x6040 ? value : control;
        if (index == 0x6060 && (int8_t)value != self->drive.mode) {
            (void)drive_choose_mode(&self->drive, (int8_t)value);
        }
    }
    if (control != UINT32_MAX) {
        drive_control(&self->drive, (uint16_t)control);
    }
}

static void hear_rpdo(node_t *self, uint16_t n, const can_frame_t *frame)
{
    if (frame->length < objects_mapped_bytes(&self->drive.od, (uint16_t)(0x1600 + n))) {
        node_emergency(self, PDO_SHORT, 0x11);
    } else if (objects_get(&self->drive.od, (uint16_t)(0x1400 + n), 2) > SYNCHRONOUS_MAX) {
        apply(self, n, frame->data);
    } else {
        memcpy(self->received[n], frame->data, 8);
        self->pending |= 1u << n;
    }
}

static void hear_sync(node_t *self, const can_frame_t *frame)
{
    const uint32_t counter = objects_get(&self->drive.od, 0x1019, 0);
    const uint32_t watch_us = objects_get(&self->drive.od, 0x1006, 0);
    if (frame->length != (counter >= 2 && counter <= SYNCHRONOUS_MAX ? 1 : 0)) {
        node_emergency(self, SYNC_LENGTH, 0x11);
        return;
    }
    if (self->nmt == STOPPED) {
        return;
    }
    self->sync_due_us = watch_us == 0 ? DRIVE_NEVER : self->now_us + watch_us + watch_us / 2;
    if (self->nmt != OPERATIONAL) {
        return;
    }
    put_synchronous(self);
    for (uint16_t n = 0; n < OBJECT_PDOS; n++) {
        if ((self->pending >> n & 1u) != 0) {
            apply(self, n, self->received[n]);
        }
    }
    self->pending = 0;
    drive_sync(&self->drive, self->now_us);
}

static void sync_late(node_t *self)
{
    self->sync_due_us = DRIVE_NEVER;
    if (self->nmt == OPERATIONAL) {
        node_emergency(self, SYNC_LATE, 0x11);
        node_enter(self, PRE_OPERATIONAL);
    }
}

static void hear_pdo(node_t *self, const can_frame_t *frame)
{
    for (uint16_t n = 0; n < OBJECT_PDOS; n++) {
        const uint16_t record = (uint16_t)(0x1400 + n);
        if (objects_is_pdo(&self->drive.od, record) && (objects_get(&self->drive.od, record, 1) & CAN_ID_MAX) == frame->id) {
            hear_rpdo(self, n, frame);
        }
    }
}

/* --- SDO: expedited, which is all that these objects need --- */

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
    put_later(self, self->sdo_us, 0x580u + self->number, data, 8);
}

/* What a write means beyond its value. Returns an abort code. */
static uint32_t written(node_t *self, uint16_t index, uint32_t value)
{
    switch (index) {
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

static void take_write(node_t *self, const uint8_t *request, uint16_t index)
{
    const uint8_t bytes = (request[0] & 1) != 0 ? (uint8_t)(4 - (request[0] >> 2 & 3)) : 4;
    uint32_t value = 0;
    for (unsigned i = 0; i < bytes; i++) {
        value |= (uint32_t)request[4 + i] << (8 * i);
    }
    uint32_t refusal = objects_write(&self->drive.od, index, request[3], value, bytes, self->nmt == OPERATIONAL);
    refusal = refusal != 0 ? refusal : written(self, index, value);
    answer(self, refusal != 0 ? 0x80 : 0x60, request, refusal);
}

static void hear_sdo(node_t *self, const can_frame_t *frame)
{
    const uint8_t *request = frame->data;
    const uint16_t index = (uint16_t)(request[1] | request[2] << 8);
    const object_t *row = objects_find(&self->drive.od, index, request[3]);
    const uint32_t refusal = objects_read_refusal(&self->drive.od, index, request[3]);
    if (self->nmt == STOPPED || frame->length != 8 || self->is_sdo_silent || request[0] == 0x80 ||
        (row != NULL && row->is_silent)) {
        return;
    }
    if ((request[0] & 0xE2) == 0x22) {
        take_write(self, request, index);
    } else if ((request[0] & 0xE0) != 0x40) {
        answer(self, 0x80, request, BAD_COMMAND);
    } else if (refusal != 0 || row == NULL) {
        answer(self, 0x80, request, refusal);
    } else {
        answer(self, (uint8_t)(0x43 | (4 - row->bytes) << 2), request, row->value);
    }
}

/* --- Life --- */

void node_hear(node_t *self, const can_frame_t *frame, uint64_t now_us)
{
    if (!self->is_powered || self->nmt == 0 || self->is_cut || frame->is_rtr || frame->is_extended || frame->is_error) {
        return;
    }
    self->now_us = now_us;
    drive_advance(&self->drive, now_us);
    if (frame->id == 0) {
        hear_nmt(self, frame);
    } else if (frame->id == (objects_get(&self->drive.od, 0x1005, 0) & CAN_ID_MAX)) {
        hear_sync(self, frame);
    } else if (frame->id == 0x600u + self->number) {
        hear_sdo(self, frame);
    } else if ((frame->id & 0x780u) == 0x700u) {
        hear_heartbeat(self, frame->id & 0x7F);
    } else if (self->nmt == OPERATIONAL) {
        hear_pdo(self, frame);
    }
    drive_advance(&self->drive, now_us);
    put_events(self);
    tell_emergency(self);
}

void node_advance(node_t *self, uint64_t now_us)
{
    self->now_us = now_us;
    if (!self->is_powered) {
        motor_advance(&self->drive.motor, now_us);
        return;
    }
    drive_advance(&self->drive, now_us);
    if (now_us >= self->boot_due_us) {
        const uint8_t nothing = 0;
        self->boot_due_us = DRIVE_NEVER;
        put(self, 0x700u + self->number, &nothing, 1);
        self->nmt = PRE_OPERATIONAL;
    }
    if (now_us >= self->beat_due_us) {
        beat(self);
    }
    if (now_us >= self->master_due_us) {
        master_lost(self);
    }
    if (now_us >= self->sync_due_us) {
        sync_late(self);
    }
    tell_emergency(self);
    put_events(self);
    put_due(self);
}

static uint64_t least(uint64_t a, uint64_t b)
{
    return a < b ? a : b;
}

uint64_t node_due_us(const node_t *self)
{
    uint64_t due_us = drive_due_us(&self->drive);
    if (!self->is_powered) {
        return DRIVE_NEVER;
    }
    due_us = least(due_us, least(self->boot_due_us, self->beat_due_us));
    due_us = least(due_us, least(self->master_due_us, self->sync_due_us));
    for (uint32_t i = 0; i < self->waits; i++) {
        due_us = least(due_us, self->waiting[i].due_us);
    }
    for (uint16_t n = 0; n < OBJECT_PDOS; n++) {
        due_us = least(due_us, event_due_us(self, n));
    }
    const bool is_busy = self->drive.motor.has_torque || self->drive.motor.slip > 0;
    return is_busy && self->nmt != 0 ? least(due_us, self->now_us + LOOK_US) : due_us;
}
