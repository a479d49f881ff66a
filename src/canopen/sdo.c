/* SPDX-License-Identifier: MIT
 * sdo.c - SDO client for one node; see sdo.h.
 * A segment with the toggle of the one before is a frame that the bus repeated, so it is dropped. If nothing better follows, the
 * server has its toggle wrong, and the transfer ends with the abort code for that. Some servers send only the bytes in use.
 */
#include "heave/sdo.h"

#define EXPEDITED_MAX   4u
#define SEGMENT_MAX     7u
#define REQUEST_ID      0x600u
#define COMMAND_ABORT   0x80u
#define ABORT_TOGGLE    0x05030000u
#define ABORT_TIMEOUT   0x05040000u
#define ABORT_COMMAND   0x05040001u
#define ABORT_LENGTH    0x06070010u
#define ABORT_TOO_LONG  0x06070012u
#define ABORT_GENERAL   0x08000000u
#define TOGGLE          0x10u
#define BYTES_OF_HEADER 4u

/* Command specifiers: the upper three bits. */
enum {
    REQUEST_WRITE_SEGMENT = 0 << 5,
    REQUEST_WRITE = 1 << 5,
    REQUEST_READ = 2 << 5,
    REQUEST_READ_SEGMENT = 3 << 5,
    ANSWER_READ_SEGMENT = 0 << 5,
    ANSWER_WRITE_SEGMENT = 1 << 5,
    ANSWER_READ = 2 << 5,
    ANSWER_WRITE = 3 << 5,
    SPECIFIER = 7 << 5
};

static uint32_t u32_of(const uint8_t bytes[4])
{
    return (uint32_t)bytes[0] | (uint32_t)bytes[1] << 8 | (uint32_t)bytes[2] << 16 | (uint32_t)bytes[3] << 24;
}

static void put_u32(uint8_t bytes[4], uint32_t value)
{
    for (unsigned i = 0; i < 4u; i++) {
        bytes[i] = (uint8_t)(value >> (8u * i));
    }
}

/* Starts a request: command, object, no data. */
static void compose(sdo_t *self, unsigned command)
{
    self->request[0] = (uint8_t)command;
    self->request[1] = (uint8_t)self->index;
    self->request[2] = (uint8_t)(self->index >> 8);
    self->request[3] = self->sub;
    put_u32(&self->request[4], 0);
    self->has_request = true;
}

static void compose_abort(sdo_t *self, uint32_t code)
{
    compose(self, COMMAND_ABORT);
    put_u32(&self->request[4], code);
}

static void compose_write(sdo_t *self)
{
    if (self->size > EXPEDITED_MAX) {
        compose(self, REQUEST_WRITE | 1u);
        put_u32(&self->request[4], self->size);
        return;
    }
    compose(self, REQUEST_WRITE | (EXPEDITED_MAX - self->size) << 2 | 3u);
    for (unsigned i = 0; i < self->size; i++) {
        self->request[BYTES_OF_HEADER + i] = self->value[i];
    }
}

static unsigned toggle_bit(const sdo_t *self)
{
    return self->is_toggled ? TOGGLE : 0;
}

static void compose_read_segment(sdo_t *self)
{
    for (unsigned i = 1; i < 8u; i++) {
        self->request[i] = 0;
    }
    self->request[0] = (uint8_t)(REQUEST_READ_SEGMENT | toggle_bit(self));
    self->has_request = true;
    self->odd_code = 0; /* it was the bus */
}

static void compose_write_segment(sdo_t *self)
{
    const unsigned left = (unsigned)self->size - self->at;
    const unsigned now = left < SEGMENT_MAX ? left : SEGMENT_MAX;
    self->request[0] = (uint8_t)(REQUEST_WRITE_SEGMENT | toggle_bit(self) | (SEGMENT_MAX - now) << 1 | (now == left ? 1u : 0u));
    for (unsigned i = 0; i < SEGMENT_MAX; i++) {
        const unsigned at = self->at + i;
        self->request[1u + i] = at < self->size ? self->value[at] : 0;
    }
    self->at = (uint8_t)(self->at + now);
    self->has_request = true;
    self->odd_code = 0;
}

static void compose_initiate(sdo_t *self)
{
    self->await = SDO_AWAIT_INITIATE;
    self->is_quiet = false;
    self->is_toggled = false;
    self->at = 0;
    if (self->is_read) {
        compose(self, REQUEST_READ);
    } else {
        compose_write(self);
    }
}

static void begin(sdo_t *self, uint16_t index, uint8_t sub, bool is_read, uint8_t tries)
{
    HV_ASSERT(tries > 0);
    self->state = SDO_BUSY;
    self->abort_code = 0;
    self->odd_code = 0;
    self->index = index;
    self->sub = sub;
    self->is_read = is_read;
    self->tries_left = (uint8_t)(tries - 1u);
    compose_initiate(self);
}

void sdo_init(sdo_t *self, uint8_t node, uint32_t timeout_us)
{
    *self = (sdo_t){.node = node, .timeout_us = timeout_us};
}

void sdo_read(sdo_t *self, uint16_t index, uint8_t sub, uint8_t tries)
{
    self->size = 0;
    begin(self, index, sub, true, tries);
}

void sdo_write(sdo_t *self, uint16_t index, uint8_t sub, const uint8_t *value, uint8_t size, uint8_t tries)
{
    HV_ASSERT(size > 0 && size <= SDO_BYTES_MAX);
    self->size = size;
    for (unsigned i = 0; i < size; i++) {
        self->value[i] = value[i];
    }
    begin(self, index, sub, false, tries);
}

void sdo_cancel(sdo_t *self)
{
    self->state = SDO_IDLE;
    self->has_request = false;
}

/* --- Answers --- */

static void fail(sdo_t *self, uint32_t code)
{
    self->state = SDO_ABORTED;
    self->abort_code = code;
}

/* The server sent what makes no sense: it is told so. */
static void reject(sdo_t *self, uint32_t code)
{
    fail(self, code);
    compose_abort(self, code);
}

static bool is_about_object(const sdo_t *self, const uint8_t *data)
{
    return data[1] == (uint8_t)self->index && data[2] == (uint8_t)(self->index >> 8) && data[3] == self->sub;
}

/* An answer that cannot be used, and what is wrong with it. */
static void note_odd(sdo_t *self, uint32_t code)
{
    self->odd_code = code;
}

/* Where the server does not say how many bytes there are, it is as many as it has sent, up to four. */
static void receive_expedited(sdo_t *self, const can_frame_t *frame)
{
    const uint8_t command = frame->data[0];
    const unsigned sent = frame->length - BYTES_OF_HEADER;
    const unsigned size = (command & 1u) != 0 ? EXPEDITED_MAX - (command >> 2 & 3u) : sent;
    if (size > sent || size == 0) {
        note_odd(self, ABORT_LENGTH);
        return;
    }
    for (unsigned i = 0; i < size; i++) {
        self->value[i] = frame->data[BYTES_OF_HEADER + i];
    }
    self->size = (uint8_t)size;
    self->state = SDO_DONE;
}

/* A late answer counts if it has all that was asked for. */
static void receive_read_initiate(sdo_t *self, const can_frame_t *frame)
{
    const uint8_t *data = frame->data;
    if ((data[0] & SPECIFIER) != ANSWER_READ) {
        note_odd(self, ABORT_COMMAND);
    } else if ((data[0] & 2u) != 0) {
        receive_expedited(self, frame);
    } else if (self->is_quiet) {
        return;
    } else if ((data[0] & 1u) != 0 && frame->length == 8u && u32_of(&data[4]) > SDO_BYTES_MAX) {
        reject(self, ABORT_TOO_LONG);
    } else {
        self->await = SDO_AWAIT_SEGMENT;
        compose_read_segment(self);
    }
}

static void receive_write_initiate(sdo_t *self, const can_frame_t *frame)
{
    if ((frame->data[0] & SPECIFIER) != ANSWER_WRITE) {
        note_odd(self, ABORT_COMMAND);
    } else if (self->size <= EXPEDITED_MAX) {
        self->state = SDO_DONE;
    } else if (!self->is_quiet) {
        self->await = SDO_AWAIT_SEGMENT;
        compose_write_segment(self);
    }
}

static void receive_read_segment(sdo_t *self, const can_frame_t *frame)
{
    const uint8_t *data = frame->data;
    const unsigned bytes = SEGMENT_MAX - (data[0] >> 1 & 7u);
    //@ split bytes;
    if (bytes >= frame->length) {
        note_odd(self, ABORT_LENGTH);
        return;
    }
    if (self->at + bytes > SDO_BYTES_MAX) {
        reject(self, ABORT_TOO_LONG);
        return;
    }
    for (unsigned i = 0; i < bytes; i++) {
        self->value[self->at + i] = data[1u + i];
    }
    self->at = (uint8_t)(self->at + bytes);
    self->is_toggled = !self->is_toggled;
    if ((data[0] & 1u) != 0) {
        self->size = self->at;
        self->state = SDO_DONE;
    } else {
        compose_read_segment(self);
    }
}

static void receive_write_segment(sdo_t *self)
{
    self->is_toggled = !self->is_toggled;
    if (self->at == self->size) {
        self->state = SDO_DONE;
    } else {
        compose_write_segment(self);
    }
}

static void receive_segment(sdo_t *self, const can_frame_t *frame)
{
    const unsigned expected = self->is_read ? ANSWER_READ_SEGMENT : ANSWER_WRITE_SEGMENT;
    if ((frame->data[0] & SPECIFIER) != expected) {
        return; /* late */
    }
    if ((frame->data[0] & TOGGLE) != toggle_bit(self)) {
        note_odd(self, ABORT_TOGGLE);
    } else if (self->is_read) {
        receive_read_segment(self, frame);
    } else {
        receive_write_segment(self);
    }
}

/* In segments an abort may name any object. */
static void receive_abort(sdo_t *self, const can_frame_t *frame)
{
    if (self->await == SDO_AWAIT_SEGMENT || is_about_object(self, frame->data)) {
        fail(self, frame->length == 8u ? u32_of(&frame->data[4]) : ABORT_GENERAL);
    }
}

static bool is_usable(const sdo_t *self, const can_frame_t *frame)
{
    const unsigned least = self->await == SDO_AWAIT_SEGMENT && frame->data[0] != COMMAND_ABORT ? 1u : BYTES_OF_HEADER;
    return !frame->is_rtr && frame->length >= least && frame->length <= 8u;
}

void sdo_receive(sdo_t *self, const can_frame_t *frame)
{
    const bool is_too_late = self->is_quiet && self->await == SDO_AWAIT_SEGMENT;
    if (self->state != SDO_BUSY || self->has_request || is_too_late || !is_usable(self, frame)) {
        return;
    }
    if (frame->data[0] == COMMAND_ABORT) {
        receive_abort(self, frame);
    } else if (self->await == SDO_AWAIT_SEGMENT) {
        receive_segment(self, frame);
    } else if (is_about_object(self, frame->data) && self->is_read) {
        receive_read_initiate(self, frame);
    } else if (is_about_object(self, frame->data)) {
        receive_write_initiate(self, frame);
    }
}

/* --- Time --- */

/* No answer: the server is told, left alone for a while, and asked again. */
static void retry_or_abort(sdo_t *self)
{
    if (!self->is_quiet) {
        self->is_quiet = true;
        compose_abort(self, ABORT_TIMEOUT);
    } else if (self->tries_left > 0) {
        self->tries_left--;
        compose_initiate(self);
    } else if (self->odd_code != 0) {
        fail(self, self->odd_code);
    } else {
        self->state = SDO_SILENT;
    }
}

bool sdo_step(sdo_t *self, uint64_t now_us, can_frame_t *out)
{
    if (self->state == SDO_BUSY && !self->has_request && now_us >= self->deadline_us) {
        retry_or_abort(self);
    }
    if (!self->has_request) {
        return false;
    }
    *out = (can_frame_t){.id = REQUEST_ID + self->node, .length = 8};
    for (unsigned i = 0; i < 8u; i++) {
        out->data[i] = self->request[i];
    }
    return true;
}

void sdo_sent(sdo_t *self, uint64_t now_us)
{
    self->has_request = false;
    self->deadline_us = now_us + self->timeout_us;
}

uint32_t sdo_value_u32(const sdo_t *self)
{
    uint32_t value = 0;
    for (unsigned i = 0; i < self->size && i < 4u; i++) {
        value |= (uint32_t)self->value[i] << (8u * i);
    }
    return value;
}
