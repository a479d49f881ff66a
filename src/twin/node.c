/* SPDX-License-Identifier: MIT
 * node.c - a simulated drive on CANopen; see node.h.
 */
#include "twin/node.h"

#include "twin/node_internal.h"

#include <string.h>

#define PRE_OPERATIONAL 0x7Fu
#define STOPPED         0x04u

#define HEARTBEAT_LOST 0x8130u
#define SYNC_LATE      0x8100u
#define SYNC_LENGTH    0x8240u
#define RPDO_LATE      0x8250u

#define RESET_SHARE 4u   /* a reset of the communication takes so much less than a boot */
#define LOOK_US     1000 /* an axis with power is looked at so often */

void node_join(node_t *const axis[], unsigned axes)
{
    for (unsigned i = 0; i < axes; i++) {
        axis[0]->axis[i] = axis[i];
        axis[i]->head = i == 0 ? NULL : axis[0];
        for (unsigned n = 0; n < axes; n++) {
            axis[i]->drive.od.axis[n] = &axis[n]->drive.od;
        }
    }
}

static void send_emergency(node_t *self)
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

/* --- NMT --- */

static void enter(node_t *self, uint8_t nmt)
{
    const uint8_t was = self->nmt;
    self->nmt = nmt;
    if (was == NODE_OPERATIONAL && nmt != NODE_OPERATIONAL) {
        self->rpdo_due_us = DRIVE_NEVER;
        drive_connection_lost(&self->drive);
    }
    if (was != NODE_OPERATIONAL && nmt == NODE_OPERATIONAL) {
        memset(self->rate_count, 0, sizeof self->rate_count);
        memset(self->is_counting, 0, sizeof self->is_counting);
        memset(self->event_us, 0, sizeof self->event_us);
    }
}

void node_enter(node_t *self, uint8_t nmt)
{
    enter(self, nmt);
    for (unsigned i = 1; i < OBJECT_AXES && self->axis[i] != NULL; i++) {
        enter(self->axis[i], nmt);
    }
}

/* Deaf until the boot-up message. */
static void boot(node_t *self, uint32_t delay_us)
{
    self->nmt = 0;
    self->boot_due_us = self->now_us + delay_us;
    self->beat_due_us = self->master_due_us = self->sync_due_us = self->rpdo_due_us = DRIVE_NEVER;
    self->pending = 0;
    self->waits = 0;
    self->guard_toggle = 0;
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

static void put_maps(node_t *self, uint16_t mappings, const cia402_maps_t *maps)
{
    for (unsigned i = 0; i < maps->count; i++) {
        const cia402_map_t *map = &maps->map[i];
        objects_map(&self->drive.od, (uint16_t)(mappings + node_pdo_place(maps, map->number) - 1), map->entry, map->entries,
                    self->are_maps_fixed);
    }
}

/* An object of the maker, or what one of the usual ones holds from the factory. */
static void add_own(objects_t *od, const object_t *own)
{
    object_t *usual = objects_find(od, own->index, own->sub);
    if (usual == NULL) {
        objects_add(od, *own);
    } else if (own->is_read_only) {
        usual->value = usual->fallback = own->fallback;
    }
}

static void start_axis(node_t *self, uint64_t now_us)
{
    const objects_t before = self->drive.od;
    self->now_us = now_us;
    objects_start(&self->drive.od, self->number, self->identity, self->head == NULL);
    for (unsigned i = 0; i < self->owns; i++) {
        add_own(&self->drive.od, &self->own[i]);
    }
    put_maps(self, 0x1600, &self->commands);
    put_maps(self, 0x1A00, &self->answers);
    keep_defects(&self->drive.od, &before);
    drive_start(&self->drive, now_us);
}

static void start(node_t *self)
{
    start_axis(self, self->now_us);
    boot(self, self->boot_us);
    for (unsigned i = 1; i < OBJECT_AXES && self->axis[i] != NULL; i++) {
        start_axis(self->axis[i], self->now_us);
        boot(self->axis[i], 0);
        self->axis[i]->boot_due_us = DRIVE_NEVER; /* with the first one */
    }
}

/* One axis of it. */
static void cut_power(node_t *self, bool is_on, uint64_t now_us)
{
    self->now_us = now_us;
    self->is_powered = is_on;
    self->nmt = 0;
    self->waits = 0;
    if (!is_on) {
        drive_drop(&self->drive);
    }
}

void node_power(node_t *self, bool is_on, uint64_t now_us)
{
    node_t *head = node_head(self);
    if (is_on == head->is_powered) {
        return;
    }
    cut_power(head, is_on, now_us);
    for (unsigned i = 1; i < OBJECT_AXES && head->axis[i] != NULL; i++) {
        cut_power(head->axis[i], is_on, now_us);
    }
    if (is_on) {
        start(head);
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
        return;
    }
    objects_reset(&self->drive.od);
    boot(self, self->boot_us / RESET_SHARE);
    for (unsigned i = 1; i < OBJECT_AXES && self->axis[i] != NULL; i++) {
        objects_reset(&self->axis[i]->drive.od);
        boot(self->axis[i], 0);
        self->axis[i]->boot_due_us = DRIVE_NEVER;
    }
}

/* With SYNC supervised, it becomes operational only while SYNC is there. */
static bool may_start(const node_t *self)
{
    if (quirk_is(self->drive.quirks, QUIRK_FAULT_BLOCKS) && self->drive.state == TWIN_FAULT) {
        return false;
    }
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
            node_enter(self, NODE_OPERATIONAL);
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
        node_put(self, 0x700u + self->number, &self->nmt, 1);
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

/* Node guarding: its state, with a bit that changes from answer to answer. Who guards it is watched, too. */
static void hear_guarding(node_t *self)
{
    const uint32_t life_ms = objects_get(&self->drive.od, 0x100C, 0) * objects_get(&self->drive.od, 0x100D, 0);
    const uint8_t data = self->nmt | self->guard_toggle;
    if (objects_get(&self->drive.od, 0x1017, 0) != 0) {
        return;
    }
    if (life_ms != 0) {
        self->master_due_us = self->now_us + life_ms * 1000u;
    }
    if (!self->has_no_heartbeat) {
        self->guard_toggle ^= 0x80;
        node_put(self, 0x700u + self->number, &data, 1);
    }
}

static void master_lost(node_t *self)
{
    self->master_due_us = DRIVE_NEVER;
    objects_put(&self->drive.od, 0x603F, 0, HEARTBEAT_LOST);
    node_emergency(self, HEARTBEAT_LOST, 0x11);
    if (self->nmt == NODE_OPERATIONAL && objects_get(&self->drive.od, 0x1029, 1) != 1) {
        node_enter(self, objects_get(&self->drive.od, 0x1029, 1) == 2 ? STOPPED : PRE_OPERATIONAL);
    }
    self->drive.emergency = 0; /* an error is told once */
}

/* --- SYNC and RPDOs --- */

/* By the first axis for all of them: an RPDO may be for several. */
static void hear_sync(node_t *self, const can_frame_t *frame)
{
    const uint32_t counter = objects_get(&self->drive.od, 0x1019, 0);
    const uint32_t watch_us = objects_get(&self->drive.od, 0x1006, 0);
    if (frame->length != (counter >= 2 && counter <= NODE_SYNCHRONOUS_MAX ? 1 : 0)) {
        node_emergency(self, SYNC_LENGTH, 0x11);
        return;
    }
    if (self->nmt == STOPPED) {
        return;
    }
    self->sync_due_us = watch_us == 0 ? DRIVE_NEVER : self->now_us + watch_us + watch_us / 2;
    if (self->nmt != NODE_OPERATIONAL) {
        return;
    }
    for (unsigned i = 0; i < OBJECT_AXES && self->axis[i] != NULL; i++) {
        node_sync_pdos(self->axis[i], frame, self->now_us);
    }
    for (unsigned i = 0; i < OBJECT_AXES && self->axis[i] != NULL; i++) {
        drive_sync(&self->axis[i]->drive, self->now_us);
    }
}

static void sync_late(node_t *self)
{
    self->sync_due_us = DRIVE_NEVER;
    if (self->nmt == NODE_OPERATIONAL) {
        node_emergency(self, SYNC_LATE, 0x11);
        node_enter(self, PRE_OPERATIONAL);
    }
}

/* --- Life --- */

static void hear_data(node_t *self, const can_frame_t *frame)
{
    const bool is_first = self->head == NULL; /* what concerns the node is heard by its first axis */
    if (is_first && frame->id == 0) {
        hear_nmt(self, frame);
    } else if (is_first && frame->id == (objects_get(&self->drive.od, 0x1005, 0) & CAN_ID_MAX)) {
        hear_sync(self, frame);
    } else if (is_first && frame->id == 0x600u + self->number) {
        node_hear_sdo(self, frame);
    } else if (is_first && (frame->id & 0x780u) == 0x700u) {
        hear_heartbeat(self, frame->id & 0x7F);
    } else if (!is_first || self->nmt == NODE_OPERATIONAL) {
        node_hear_pdo(self, frame);
    }
}

void node_hear(node_t *self, const can_frame_t *frame, uint64_t now_us)
{
    if (!self->is_powered || self->nmt == 0 || node_head(self)->is_cut || frame->is_extended || frame->is_error) {
        return;
    }
    self->now_us = now_us;
    if (frame->is_rtr) {
        if (self->head == NULL && frame->id == 0x700u + self->number) {
            hear_guarding(self);
        }
        return;
    }
    drive_advance(&self->drive, now_us);
    hear_data(self, frame);
    drive_advance(&self->drive, now_us);
    node_put_events(self);
    send_emergency(self);
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
        for (unsigned i = 0; i < (quirk_is(self->drive.quirks, QUIRK_BOOTS_TWICE) ? 2u : 1u); i++) {
            node_put(self, 0x700u + self->number, &nothing, 1);
        }
        node_enter(self, PRE_OPERATIONAL);
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
    if (now_us >= self->rpdo_due_us) {
        self->rpdo_due_us = DRIVE_NEVER;
        node_emergency(self, RPDO_LATE, 0x11);
        drive_connection_lost(&self->drive);
    }
    send_emergency(self);
    node_put_events(self);
    node_put_due(self);
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
    due_us = least(due_us, least(self->rpdo_due_us, least(self->master_due_us, self->sync_due_us)));
    for (uint32_t i = 0; i < self->waits; i++) {
        due_us = least(due_us, self->waiting[i].due_us);
    }
    for (uint16_t n = 0; n < OBJECT_PDOS; n++) {
        due_us = least(due_us, node_event_due_us(self, n));
    }
    const bool is_busy = self->drive.motor.has_torque || self->drive.motor.slip > 0;
    return is_busy && self->nmt != 0 ? least(due_us, self->now_us + LOOK_US) : due_us;
}
