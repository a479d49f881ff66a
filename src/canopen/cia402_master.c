/* SPDX-License-Identifier: MIT
 * cia402_master.c - see cia402_master.h.
 */
#include "cia402_master.h"

#include "cia402_axis.h"
#include "cia402_bus.h"
#include "cia402_loss.h"
#include "cia402_map.h"
#include "cia402_node.h"

#define NMT_PREOP 0x80u

/* --- What only a master sends --- */

/* To all nodes, or to one of ours: what it does with others is no concern of ours. */
static bool is_for_ours(const cia402_config_t *config, const can_frame_t *nmt)
{
    bool is_ours = nmt->length >= 2 && nmt->data[1] == 0;
    for (unsigned k = 0; k < config->axes; k++) {
        is_ours = is_ours || (nmt->length >= 2 && nmt->data[1] == config->axis[k].node);
    }
    return is_ours;
}

/* All that CiA 301 gives the node, of which ours are some: another master has its own map. */
static bool is_command(const cia402_t *self, uint32_t id)
{
    for (unsigned k = 0; k < self->config->axes; k++) {
        for (uint32_t i = 0; i < CIA402_COB_RPDOS; i++) {
            if (id == CIA402_COB_RPDO + i * CIA402_COB_NEXT + self->config->axis[k].node) {
                return true;
            }
        }
    }
    return false;
}

static cia402_trouble_t judge(const cia402_t *self, const can_frame_t *frame)
{
    if (frame->id == CIA402_COB_NMT) {
        return is_for_ours(self->config, frame) ? CIA402_OTHER_NMT : CIA402_TROUBLE_NONE;
    }
    if (frame->id == CIA402_COB_SYNC) {
        return CIA402_OTHER_SYNC;
    }
    if (frame->id == CIA402_COB_HEARTBEAT + self->config->master_node) {
        return CIA402_OTHER_HEARTBEAT;
    }
    return is_command(self, frame->id) ? CIA402_OTHER_COMMAND : CIA402_TROUBLE_NONE;
}

bool cia402_master_receive(cia402_t *self, const can_frame_t *frame)
{
    const cia402_trouble_t other = judge(self, frame);
    if (other == CIA402_TROUBLE_NONE) {
        return false;
    }
    canmaster_note(&self->master, other);
    for (unsigned k = 0; k < self->config->axes && other == CIA402_OTHER_SYNC; k++) {
        cia402_axis_note_foreign_sync(cia402_drive(self, k));
    }
    return true;
}

/* --- What comes of it --- */

static void note_master(cia402_t *self)
{
    for (unsigned k = 0; k < self->config->axes; k++) {
        self->axis[k].notes |= 1u << CIA402_WATCH_MASTER;
        self->axis[k].note_us[CIA402_WATCH_MASTER] = self->now_us;
    }
}

/* A drive that is known, or has torque, or may have it: it has to hear of its stop. */
static bool is_any_led(const cia402_t *self)
{
    for (unsigned k = 0; k < self->config->axes; k++) {
        if (cia402_axis_is_heard(&self->axis[k]) || cia402_axis_is_energized(&self->axis[k])) {
            return true;
        }
    }
    return false;
}

static void name(cia402_t *self)
{
    for (unsigned k = 0; k < self->config->axes; k++) {
        cia402_axis_note_trouble(cia402_drive(self, k), self->master.what);
    }
}

/* Those that are being set up cannot be used until a reset, either: all are stopped by it or none. */
static void stop(cia402_t *self)
{
    for (unsigned k = 0; k < self->config->axes; k++) {
        cia402_axis_t *axis = &self->axis[k];
        if (axis->phase == CIA402_UP && axis->own_fault == 0) {
            axis->surplus = 0; /* what the drives answered to it is no sign of a second drive */
            cia402_axis_fail(cia402_drive(self, k), self->master.what);
        } else if (axis->phase != CIA402_UP && axis->phase != CIA402_LEAVING && axis->phase != CIA402_REFUSED) {
            cia402_axis_reject(cia402_drive(self, k), (cia402_trouble_t)self->master.what);
        }
    }
}

static void stop_or_wait(cia402_t *self)
{
    if (is_any_led(self)) {
        stop(self);
    } else {
        cia402_master_begin(self);
        name(self);
    }
}

static void react(cia402_t *self)
{
    switch (self->config->reaction[CIA402_WATCH_MASTER]) {
    case CIA402_IGNORE:
        break;
    case CIA402_REPORT:
        note_master(self);
        break;
    case CIA402_STOP:
        stop_or_wait(self);
        break;
    }
}

void cia402_master_begin(cia402_t *self)
{
    const bool is_waited_for = self->config->reaction[CIA402_WATCH_MASTER] == CIA402_STOP;
    canmaster_listen(&self->master, is_waited_for ? self->config->listen_ms : 0, self->now_us);
}

/* As long as another one leads, we say nothing: a reset, or a set-point, would stop a machine that moves. */
static void wait_for(cia402_t *self)
{
    if (self->master.heard_us == self->now_us) {
        name(self);
    }
}

/* With nothing known: what drives did meanwhile was not ours. */
static void begin(cia402_t *self)
{
    self->due_us = self->now_us;
    self->is_preop_due = true;
    for (unsigned k = 0; k < self->config->axes; k++) {
        cia402_axis_init(cia402_drive(self, k));
    }
}

bool cia402_master_step(cia402_t *self)
{
    switch (canmaster_step(&self->master, self->now_us)) {
    case CANMASTER_QUIET:
        break;
    case CANMASTER_LISTENING:
        wait_for(self);
        break;
    case CANMASTER_BEGIN:
        begin(self);
        break;
    case CANMASTER_HEARD:
        react(self);
        break;
    }
    return self->master.is_listening;
}

/* --- What one has left behind --- */

static bool has_any_torque(const cia402_t *self)
{
    for (unsigned k = 0; k < self->config->axes; k++) {
        if (self->axis[k].phase == CIA402_UP && cia402_axis_is_energized(&self->axis[k])) {
            return true;
        }
    }
    return false;
}

void cia402_master_wake(cia402_t *self)
{
    if (self->is_gone || self->master.is_listening || has_any_torque(self)) {
        return;
    }
    for (unsigned k = 0; k < self->config->axes; k++) {
        if (self->axis[k].phase == CIA402_REFUSED) {
            cia402_axis_reset(cia402_drive(self, k)); /* one that was stopped after it was refused answers nothing, either */
        }
        if (self->axis[k].phase == CIA402_MISSING && self->config->axis[k].channel == 0) {
            self->axis[k].nmt_command = NMT_PREOP;
        }
    }
}
