/* SPDX-License-Identifier: MIT
 * canopen_drives.c - see canopen_drives.h.
 */
#include "canopen_drives.h"

#include <stdlib.h>
#include <string.h>

#define BOOT_US     30000u
#define JUMP_COUNTS 20000u
#define HOME_COUNTS 500 /* away from where it stands */
#define MASTER_BEAT 0x77Fu
#define NO_VOLTAGE  0x82u /* with none of these bits in the controlword */

static const object_t k_own[] = {
    {.index = 0x2030, .sub = 1, .bytes = 2, .fallback = 7},
    {.index = 0x2031, .bytes = 4},
    {.index = 0x2032, .bytes = 1, .is_read_only = true, .fallback = 3},
};

object_t *canopen_drives_object(canopen_drives_t *self, unsigned drive, uint16_t index, uint8_t sub)
{
    return objects_find(&self->drive[drive].node.drive.od, index, sub);
}

void canopen_drives_force(canopen_drives_t *self, unsigned drive, uint16_t index, uint8_t sub, uint32_t value)
{
    object_t *object = canopen_drives_object(self, drive, index, sub);
    object->value = value;
    object->is_forced = true;
}

/* --- To the bus --- */

static void put(canopen_drives_t *self, const can_frame_t *frame)
{
    if (self->outs < sizeof self->out / sizeof self->out[0]) {
        self->out[self->outs++] = *frame;
    }
}

static void put_answer(canopen_drive_t *drive, const can_frame_t *frame)
{
    const can_frame_t late = drive->late;
    if (frame->data[0] == 0x60 && drive->logged < CANOPEN_DRIVES_LOG) {
        drive->log[drive->logged++] = (uint32_t)frame->data[2] << 16 | (uint32_t)frame->data[1] << 8 | frame->data[3];
    }
    if (!drive->is_answering_late) {
        put(drive->owner, frame);
        return;
    }
    drive->late = *frame;
    if (drive->has_late) {
        put(drive->owner, &late);
    }
    drive->has_late = true;
}

static void put_of_drive(void *ctx, const can_frame_t *frame)
{
    canopen_drive_t *drive = ctx;
    can_frame_t cut = *frame;
    if ((frame->id & 0x780) == 0x580) {
        put_answer(drive, frame);
        return;
    }
    cut.length = (uint8_t)(frame->length - ((frame->id & 0x780) == 0x180 ? drive->tpdo_cut : 0));
    put(drive->owner, &cut);
}

static void flush(canopen_drives_t *self)
{
    uint32_t sent = 0;
    const hal_can_t can = sim_can_hal(&self->node);
    while (sent < self->outs && hal_can_send(can, &self->out[sent]) == HV_OK) {
        sent++;
    }
    memmove(self->out, self->out + sent, (self->outs - sent) * sizeof self->out[0]);
    self->outs -= sent;
}

/* --- What is looked at --- */

/** A drive before something happens to it. */
typedef struct {
    twin_state_t state;
    uint32_t set_points, enabled;
    int32_t position;
    uint8_t nmt;
} before_t;

static before_t look(const canopen_drive_t *drive)
{
    const drive_t *model = &drive->node.drive;
    return (before_t){model->state, model->set_points, model->enabled, drive_count(model), drive->node.nmt};
}

static void note_target(canopen_drive_t *drive, int32_t position)
{
    const drive_t *model = &drive->node.drive;
    const bool is_ip = model->mode == 7;
    const int32_t target = (int32_t)objects_get(&model->od, is_ip ? 0x60C1 : 0x607A, is_ip ? 1 : 0);
    const int32_t from = drive->has_target ? drive->last_target : position;
    const int32_t step = abs((int32_t)((uint32_t)target - (uint32_t)from)); /* wraps round */
    drive->largest_step = step > drive->largest_step ? step : drive->largest_step;
    drive->last_target = target;
    drive->has_target = true;
    drive->setpoints++;
}

static void note(canopen_drive_t *drive, const before_t *before, uint64_t now_us)
{
    const drive_t *model = &drive->node.drive;
    drive->boots += before->nmt == 0 && drive->node.nmt != 0;
    drive->resets += before->state == TWIN_FAULT && model->state == TWIN_DISABLED;
    if (before->state != TWIN_QUICK_STOP && model->state == TWIN_QUICK_STOP) {
        drive->quick_stops++;
        drive->stop_us = now_us;
    }
    if (model->enabled != before->enabled) {
        drive->enabled_us = now_us;
        drive->has_target = false;
    }
    if (before->state == TWIN_ENABLED && model->state != TWIN_ENABLED) {
        drive->left_us = now_us;
    }
    if (model->set_points != before->set_points) {
        note_target(drive, before->position);
    }
}

/* --- What is spoiled --- */

static void hold(drive_t *model)
{
    model->next_state = model->state;
    model->state_due_us = model->stop_due_us = DRIVE_NEVER;
}

/* Once a step. */
static void glide(canopen_drive_t *drive)
{
    drive_t *model = &drive->node.drive;
    if (drive->glide_us != 0 && model->state == TWIN_QUICK_STOP && model->stop_due_us != DRIVE_NEVER) {
        model->motor.actual += drive->glide_counts;
        motor_hold(&model->motor);
        model->stop_due_us = drive->stop_us + drive->glide_us;
    }
}

static void fidget(canopen_drive_t *drive, uint64_t now_us)
{
    drive_t *model = &drive->node.drive;
    const bool is_between = model->state == TWIN_DISABLED || model->state == TWIN_READY;
    if (drive->is_restless && is_between && drive->node.nmt == 0x05 && (model->word & NO_VOLTAGE) == 0 &&
        model->next_state == model->state) {
        model->next_state = model->state == TWIN_READY ? TWIN_DISABLED : TWIN_READY;
        model->state_due_us = now_us + 1000u;
    }
}

/* --- Life --- */

static void let_live(canopen_drive_t *drive, const can_frame_t *frame, uint64_t now_us)
{
    const before_t before = look(drive);
    if (frame != NULL) {
        node_hear(&drive->node, frame, now_us);
    } else {
        node_advance(&drive->node, now_us);
        fidget(drive, now_us);
    }
    if (drive->is_stuck && drive->node.drive.state == drive->stuck_at) {
        hold(&drive->node.drive);
    }
    note(drive, &before, now_us);
}

static void hear(canopen_drives_t *self, const can_frame_t *frame)
{
    const bool is_sync = frame->id == 0x80;
    self->syncs += is_sync;
    self->sync_number = is_sync ? frame->data[0] : self->sync_number;
    self->heartbeats += frame->id == MASTER_BEAT;
    const uint32_t function = frame->id & 0x780, of = frame->id & 0x7F;
    for (unsigned k = 0; k < CANOPEN_DRIVES; k++) {
        if ((function != 0x200 && function != 0x600) || of == k + 1) { /* what is for one alone */
            let_live(&self->drive[k], frame, self->now_us);
        }
    }
}

void canopen_drives_step(canopen_drives_t *self, uint64_t now_us)
{
    can_frame_t frame;
    uint64_t at_us = 0;
    self->now_us = now_us;
    for (unsigned k = 0; k < CANOPEN_DRIVES; k++) {
        glide(&self->drive[k]);
    }
    bool was_heard = true;
    for (int round = 0; round < 3 && was_heard; round++) {
        was_heard = false;
        sim_can_bus_step(self->bus, now_us);
        while (hal_can_recv(sim_can_hal(&self->node), &frame, &at_us) == HV_OK) {
            was_heard = true;
            if (!frame.is_error) {
                hear(self, &frame);
            }
        }
        for (unsigned k = 0; k < CANOPEN_DRIVES; k++) {
            let_live(&self->drive[k], NULL, now_us);
        }
        flush(self);
    }
    sim_can_bus_step(self->bus, now_us);
}

void canopen_drives_power(canopen_drives_t *self, unsigned drive, bool is_on)
{
    canopen_drive_t *d = &self->drive[drive];
    const before_t before = look(d);
    node_power(&d->node, false, self->now_us);
    node_power(&d->node, is_on, self->now_us);
    note(d, &before, self->now_us);
}

void canopen_drives_fault(canopen_drives_t *self, unsigned drive, uint16_t code)
{
    canopen_drive_t *d = &self->drive[drive];
    const before_t before = look(d);
    drive_fault(&d->node.drive, code);
    node_advance(&d->node, self->now_us); /* which tells of it */
    note(d, &before, self->now_us);
}

void canopen_drives_drop(canopen_drives_t *self, unsigned drive)
{
    canopen_drive_t *d = &self->drive[drive];
    const before_t before = look(d);
    drive_drop(&d->node.drive);
    d->resets -= before.state == TWIN_FAULT; /* nobody has taken it back */
    note(d, &before, self->now_us);
}

int32_t canopen_drives_position(const canopen_drives_t *self, unsigned drive)
{
    return drive_count(&self->drive[drive].node.drive);
}

void canopen_drives_place(canopen_drives_t *self, unsigned drive, int32_t counts)
{
    drive_t *model = &self->drive[drive].node.drive;
    model->motor.actual = counts + model->origin;
    model->home = model->motor.actual - HOME_COUNTS;
    motor_hold(&model->motor);
}

void canopen_drives_open(canopen_drives_t *self, sim_can_bus_t *bus)
{
    memset(self, 0, sizeof *self);
    self->bus = bus;
    if (sim_can_open(&self->node, bus, NULL, 0) != HV_OK) {
        abort();
    }
    for (unsigned k = 0; k < CANOPEN_DRIVES; k++) {
        canopen_drive_t *d = &self->drive[k];
        node_t *node = &d->node;
        d->owner = self;
        *node = (node_t){.number = (uint8_t)(k + 1),
                         .identity = {0x2E5, 0x402, 1, 99},
                         .boot_us = BOOT_US,
                         .own = k_own,
                         .owns = sizeof k_own / sizeof k_own[0],
                         .out = {put_of_drive, d},
                         .drive = {.switch_on_us = 5000,
                                   .brake_us = 8000 + 1000 * k,
                                   .jump_counts = JUMP_COUNTS,
                                   .home_method = 17,
                                   .is_absolute = true}};
        node_join(&node, 1);
        canopen_drives_place(self, k, 0);
        node_power(node, true, 0);
    }
}
