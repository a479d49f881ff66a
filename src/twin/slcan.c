/* SPDX-License-Identifier: MIT
 * slcan.c - a CAN adapter on a serial line; see slcan.h.
 */
#include "twin/slcan.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "twin/pty.h"

#define DONE       "\r"
#define BELL       "\a"
#define STANDARD   3u /* digits of an identifier */
#define EXTENDED   8u
#define FRAME_TEXT 32u
#define CHUNK      512u

static const uint32_t k_bps[] = {10000, 20000, 50000, 100000, 125000, 250000, 500000, 800000, 1000000};

#define RATES (sizeof k_bps / sizeof k_bps[0])

bool slcan_open(slcan_t *self, const char *path, uint32_t bitrate_bps, char *why, size_t size)
{
    memset(self, 0, sizeof *self);
    self->bitrate_bps = bitrate_bps;
    const bool is_open = pty_open(path, &self->end, &self->terminal, why, size);
    self->path = is_open ? path : NULL;
    if (!is_open) {
        slcan_close(self);
    }
    return is_open;
}

void slcan_close(slcan_t *self)
{
    if (self->end >= 0) {
        (void)close(self->end);
    }
    if (self->terminal >= 0) {
        (void)close(self->terminal);
    }
    if (self->path != NULL) {
        (void)unlink(self->path);
    }
    self->end = self->terminal = -1;
    self->is_open = false;
    self->length = self->waiting = 0;
    self->path = NULL;
}

bool slcan_is_on_bus(const slcan_t *self)
{
    return self->is_open && (self->set_bps == 0 || self->set_bps == self->bitrate_bps);
}

/* --- To its user --- */

void slcan_say(slcan_t *self, const char *text)
{
    const unsigned length = (unsigned)strlen(text);
    if (self->waiting + length > SLCAN_OUT_MAX) { /* all or nothing: half a line would spoil the next */
        self->lost++;
        return;
    }
    memcpy(self->out + self->waiting, text, length);
    self->waiting += length;
}

void slcan_put(slcan_t *self, const can_frame_t *frame)
{
    char text[FRAME_TEXT];
    static const char k_kinds[] = "tTrR";
    const char kind = k_kinds[(frame->is_rtr ? 2u : 0u) + (frame->is_extended ? 1u : 0u)];
    if (!slcan_is_on_bus(self)) {
        return;
    }
    int at = snprintf(text, sizeof text, "%c%0*X%u", kind, (int)(frame->is_extended ? EXTENDED : STANDARD), (unsigned)frame->id,
                      (unsigned)frame->length);
    for (unsigned i = 0; i < frame->length && !frame->is_rtr; i++) {
        at += snprintf(text + at, sizeof text - (size_t)at, "%02X", (unsigned)frame->data[i]);
    }
    (void)snprintf(text + at, sizeof text - (size_t)at, DONE);
    slcan_say(self, text);
}

static void hand_over(slcan_t *self)
{
    const ssize_t taken = self->waiting > 0 ? write(self->end, self->out, self->waiting) : 0;
    if (taken > 0) {
        self->waiting -= (unsigned)taken;
        memmove(self->out, self->out + taken, self->waiting);
    }
}

/* --- From its user --- */

/* Hexadecimal digits of a line; false where one is none. */
static bool read_hex(const char *text, unsigned digits, uint32_t *out)
{
    *out = 0;
    for (unsigned i = 0; i < digits; i++) {
        const char digit = text[i];
        const bool is_letter = (digit >= 'A' && digit <= 'F') || (digit >= 'a' && digit <= 'f');
        if (!is_letter && (digit < '0' || digit > '9')) {
            return false;
        }
        const unsigned value = is_letter ? (unsigned)((digit | 0x20) - 'a') + 10u : (unsigned)(digit - '0');
        *out = *out << 4 | value;
    }
    return true;
}

/* `tiiildd...`, `Tiiiiiiiildd...`, `riiil`, `Riiiiiiiil`; text ends with 0, which is no digit. */
static bool read_frame(const char *text, can_frame_t *out)
{
    uint32_t value = 0;
    const bool is_extended = text[0] == 'T' || text[0] == 'R';
    const unsigned digits = is_extended ? EXTENDED : STANDARD;
    *out = (can_frame_t){.is_extended = is_extended, .is_rtr = text[0] == 'r' || text[0] == 'R'};
    if (!read_hex(text + 1, digits, &out->id) || out->id > (is_extended ? CAN_ID_EXTENDED_MAX : CAN_ID_MAX) ||
        !read_hex(text + 1 + digits, 1, &value) || value > sizeof out->data) {
        return false;
    }
    out->length = (uint8_t)value;
    const char *at = text + 2 + digits;
    for (unsigned i = 0; i < out->length && !out->is_rtr; i++, at += 2) {
        if (!read_hex(at, 2, &value)) {
            return false;
        }
        out->data[i] = (uint8_t)value;
    }
    return *at == '\0';
}

static const char *send_frame(slcan_t *self, slcan_heard_t heard, void *ctx)
{
    can_frame_t frame;
    if (!slcan_is_on_bus(self) || self->is_listening || !read_frame(self->line, &frame)) {
        return BELL;
    }
    heard(ctx, &frame);
    return frame.is_extended ? "Z" DONE : "z" DONE;
}

static const char *set_rate(slcan_t *self)
{
    const unsigned code = (unsigned)(self->line[1] - '0');
    if (self->is_open || self->length != 2 || code >= RATES) {
        return BELL;
    }
    self->set_bps = k_bps[code];
    if (self->set_bps != self->bitrate_bps) {
        fprintf(stderr, "heave-twin: %s: S%u is %u bit/s, the drives have %u ([can] bitrate_bps): nothing passes\n", self->path,
                code, (unsigned)self->set_bps, (unsigned)self->bitrate_bps);
    }
    return DONE;
}

static const char *open_channel(slcan_t *self)
{
    if (self->is_open || self->length != 1) {
        return BELL;
    }
    self->is_open = true;
    self->is_listening = self->line[0] == 'L';
    return DONE;
}

static const char *answer(slcan_t *self, slcan_heard_t heard, void *ctx)
{
    switch (self->line[0]) {
    case 't':
    case 'T':
    case 'r':
    case 'R':
        return send_frame(self, heard, ctx);
    case 'S':
        return set_rate(self);
    case 'O':
    case 'L':
        return open_channel(self);
    case 'C':
        self->is_open = false;
        return self->length == 1 ? DONE : BELL;
    case 's': /* registers of a controller: whoever writes them knows what they mean */
        self->set_bps = self->is_open ? self->set_bps : 0;
        return self->is_open ? BELL : DONE;
    case 'V':
        return "V1013" DONE;
    case 'N':
        return "NTWIN" DONE;
    case 'F':
        return self->is_open ? "F00" DONE : BELL;
    case 'Z': /* time stamps: it has none */
        return self->line[1] == '0' ? DONE : BELL;
    case 'X':
    case 'm':
    case 'M':
    case 'W':
        return DONE;
    default:
        return BELL;
    }
}

void slcan_receive(slcan_t *self, char byte, slcan_heard_t heard, void *ctx)
{
    if (byte != '\r') {
        self->length += self->length < SLCAN_LINE_MAX ? 1u : 0u; /* a line that is too long stays too long */
        self->line[self->length - 1] = byte;
        return;
    }
    const bool is_whole = self->length < SLCAN_LINE_MAX;
    self->line[is_whole ? self->length : 0] = '\0';
    if (self->length > 0) { /* users begin with empty lines, to end what was there */
        slcan_say(self, is_whole ? answer(self, heard, ctx) : BELL);
    }
    self->length = 0;
}

void slcan_serve(slcan_t *self, slcan_heard_t heard, void *ctx)
{
    char bytes[CHUNK];
    ssize_t length = 0;
    while (self->end >= 0 && !self->is_deaf && (length = read(self->end, bytes, sizeof bytes)) > 0) {
        for (ssize_t i = 0; i < length; i++) {
            slcan_receive(self, bytes[i], heard, ctx);
        }
    }
    if (self->end >= 0) {
        hand_over(self);
    }
}
