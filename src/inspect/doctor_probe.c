/* SPDX-License-Identifier: MIT
 * doctor_probe.c - the core's SDO client over a real bus; see doctor_probe.h.
 */
#include "inspect/doctor_probe.h"

#include <string.h>
#include <time.h>

#include "heave/sdo.h"
#include "linux_clock.h"

#define TRIES         2u
#define PAUSE_NS      200000
#define CALL_PAUSE_MS 2u    /* two frames of 125 kbit/s */
#define EXTRA_US      5000u /* after an answer: who else answers? */
#define SYNC_ID       0x80u
#define OBJECTS       0x6000u /* of the first axis of a node; */
#define CHANNEL       0x800u  /* those of the next one are so much further */
#define SDO_ID        0x580u
#define HEARTBEAT     0x700u

static uint64_t now_us(void)
{
    return hal_clock_now_us(linux_clock_hal());
}

static void pause_briefly(void)
{
    const struct timespec pause = {.tv_nsec = PAUSE_NS};
    (void)nanosleep(&pause, NULL);
}

bool doctor_probe_open(doctor_probe_t *self, const char *interface)
{
    const linux_can_config_t config = {.interface = interface};
    self->is_synced = false;
    self->wire = (doctor_wire_t){.is_heard = false};
    for (unsigned i = 0; i < DOCTOR_NODES; i++) {
        self->nmt[i] = -1;
        self->has_answered[i] = false;
    }
    self->is_local = linux_can_local_is(interface);
    const hv_status_t status =
        self->is_local ? linux_can_local_open(&self->local, interface) : linux_can_open(&self->can, &config);
    self->bus = self->is_local ? linux_can_local_hal(&self->local) : linux_can_hal(&self->can);
    if (status == HV_ERR_AGAIN) {
        doctor_probe_close(self);
    }
    return status == HV_OK;
}

void doctor_probe_close(doctor_probe_t *self)
{
    if (self->is_local) {
        linux_can_local_close(&self->local);
    } else {
        linux_can_close(&self->can);
    }
}

const char *doctor_probe_trouble(const doctor_probe_t *self)
{
    if (self->is_local) {
        return self->local.error_text[0] != '\0' ? self->local.error_text : NULL;
    }
    return self->can.trouble != LINUX_CAN_FINE ? self->can.error_text : NULL;
}

/* The next frame of a drive or master; notes what everybody says about himself. */
static bool hear(doctor_probe_t *self, can_frame_t *frame)
{
    uint64_t time_us;
    while (hal_can_recv(self->bus, frame, &time_us) == HV_OK) {
        if (frame->is_error) {
            self->wire.is_unacknowledged |= (frame->id & CAN_ERROR_NO_ACK) != 0;
            continue;
        }
        self->wire.is_heard = true;
        if (frame->is_rtr) {
            continue;
        }
        if (!frame->is_extended && frame->id > HEARTBEAT && frame->id < HEARTBEAT + DOCTOR_NODES && frame->length == 1) {
            self->nmt[frame->id - HEARTBEAT] = frame->data[0] & 0x7F;
        }
        if (!frame->is_extended && frame->id > SDO_ID && frame->id < SDO_ID + DOCTOR_NODES) {
            self->has_answered[frame->id - SDO_ID] = true;
        }
        self->is_synced |= !frame->is_extended && frame->id == SYNC_ID;
        return true;
    }
    return false;
}

const doctor_wire_t *doctor_probe_wire(doctor_probe_t *self)
{
    can_frame_t frame;
    while (hear(self, &frame)) {}
    (void)!hal_can_bus_state(self->bus, &self->wire.state);
    (void)!hal_can_unconfirmed(self->bus, &self->wire.unconfirmed);
    self->wire.tx_errors = self->is_local ? 0 : self->can.tx_errors;
    self->wire.rx_errors = self->is_local ? 0 : self->can.rx_errors;
    return &self->wire;
}

void doctor_probe_listen(doctor_probe_t *self, unsigned ms)
{
    const uint64_t end_us = now_us() + ms * 1000u;
    can_frame_t frame;
    while (now_us() < end_us) {
        while (hear(self, &frame)) {}
        pause_briefly();
    }
}

/* --- CANopen --- */

bool doctor_probe_is_there(const doctor_probe_t *self, unsigned node)
{
    return self->nmt[node] >= 0 || self->has_answered[node];
}

void doctor_probe_call(doctor_probe_t *self, unsigned ms)
{
    const doctor_address_t type = doctor_address[DOCTOR_TYPE];
    for (unsigned node = 1; node < DOCTOR_NODES; node++) {
        sdo_t sdo;
        can_frame_t frame;
        sdo_init(&sdo, (uint8_t)node, ms * 1000u);
        sdo_read(&sdo, type.index, type.sub, 1);
        if (sdo_step(&sdo, now_us(), &frame)) {
            (void)!hal_can_send(self->bus, &frame);
        }
        doctor_probe_listen(self, CALL_PAUSE_MS);
    }
    doctor_probe_listen(self, ms);
}

/* Frames of a node: the client takes what it waits for, the others are too many. */
static unsigned receive_answers(doctor_probe_t *self, sdo_t *sdo)
{
    can_frame_t frame;
    unsigned extra = 0;
    while (hear(self, &frame)) {
        if (!frame.is_extended && frame.id == SDO_ID + sdo->node) {
            extra += sdo->state == SDO_BUSY ? 0u : 1u;
            sdo_receive(sdo, &frame);
        }
    }
    return extra;
}

/* Until it is over. Tells how many answers there were too many. */
static unsigned transfer(doctor_probe_t *self, sdo_t *sdo)
{
    can_frame_t frame;
    unsigned extra = 0;
    while (sdo->state == SDO_BUSY) {
        extra += receive_answers(self, sdo);
        if (sdo_step(sdo, now_us(), &frame) && hal_can_send(self->bus, &frame) == HV_OK) {
            sdo_sent(sdo, now_us());
        } else if (doctor_probe_trouble(self) != NULL) {
            sdo_cancel(sdo);
        }
        pause_briefly();
    }
    return extra;
}

static void read_object(doctor_probe_t *self, sdo_t *sdo, doctor_object_t object, unsigned channel, doctor_node_t *out)
{
    const unsigned index = doctor_address[object].index;
    sdo_read(sdo, (uint16_t)(index >= OBJECTS ? index + channel * CHANNEL : index), doctor_address[object].sub, TRIES);
    const uint64_t begin_us = now_us();
    unsigned extra = transfer(self, sdo);
    const uint64_t end_us = now_us();
    const bool is_first_try = end_us - begin_us < sdo->timeout_us;
    while (now_us() < end_us + EXTRA_US) {
        extra += receive_answers(self, sdo);
        pause_briefly();
    }
    out->extra_answers += is_first_try ? extra : 0; /* after a second try the answer to the first may come late */
    out->answer[object] = sdo->state == SDO_DONE ? DOCTOR_READ : sdo->state == SDO_ABORTED ? DOCTOR_REFUSED : DOCTOR_NO_ANSWER;
    out->value[object] = sdo->state == SDO_DONE ? sdo_value_u32(sdo) : sdo->abort_code;
}

void doctor_probe_node(doctor_probe_t *self, const cia402_axis_config_t *axis, unsigned timeout_ms, doctor_node_t *out)
{
    sdo_t sdo;
    *out = (doctor_node_t){.nmt = -1};
    sdo_init(&sdo, axis->node, timeout_ms * 1000u);
    for (unsigned object = 0; object < DOCTOR_OBJECTS; object++) {
        read_object(self, &sdo, object, axis->channel, out);
        if (out->answer[object] == DOCTOR_NO_ANSWER) {
            break; /* the rest would only take time */
        }
    }
    for (unsigned name = 0; name < DOCTOR_NAMES && sdo.state != SDO_SILENT; name++) {
        sdo_read(&sdo, doctor_name_index[name], 0, 1);
        (void)transfer(self, &sdo);
        if (sdo.state == SDO_DONE) {
            doctor_copy_name(out->name[name], sdo.value, sdo.size);
        }
    }
    out->nmt = self->nmt[axis->node];
}

/* --- Drives with frames of their own --- */

static void send_query(doctor_probe_t *self, const canraw_map_t *map, unsigned axis)
{
    const int64_t value[CANRAW_VALUES] = {0};
    can_frame_t frame = {.id = map->axis[axis].command_id, .is_extended = map->is_extended, .length = map->position_query.length};
    if (canraw_pack(&map->position_query, value, frame.data) == HV_OK) {
        (void)!hal_can_send(self->bus, &frame);
    }
}

void doctor_probe_raw(doctor_probe_t *self, const canraw_map_t *map, unsigned ms, bool is_heard[DRIVES_MAX])
{
    can_frame_t frame;
    for (unsigned k = 0; k < map->axes; k++) {
        is_heard[k] = false;
        if (map->position_query.length > 0) {
            send_query(self, map, k);
        }
    }
    const uint64_t end_us = now_us() + ms * 1000u;
    while (now_us() < end_us) {
        while (hear(self, &frame)) {
            for (unsigned k = 0; k < map->axes; k++) {
                is_heard[k] |= frame.id == map->axis[k].reply_id && frame.is_extended == map->is_extended;
            }
        }
        pause_briefly();
    }
}
