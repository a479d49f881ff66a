/* SPDX-License-Identifier: MIT
 * slcan.h - a CAN adapter on a serial line, as its user has it: the commands of LAWICEL adapters, in text, on a pseudo terminal.
 * Behind it is the bus of the drives. What it understands: S s O L C t T r R V N F X Z m M W; anything else gets BELL, as there.
 */
#ifndef HEAVE_TWIN_SLCAN_H
#define HEAVE_TWIN_SLCAN_H

#include "heave/hal/can.h"

#define SLCAN_LINE_MAX 64u
#define SLCAN_OUT_MAX  8192u

/** An adapter. */
typedef struct {
    const char *path;     /**< of the link to its terminal */
    uint32_t bitrate_bps; /**< of the bus */
    uint32_t set_bps;     /**< as its user has set it; 0 = not said, which is right */
    bool is_open;         /**< the channel */
    bool is_listening;    /**< open, and sends nothing */
    bool is_deaf;         /**< takes nothing from its line any more: nobody acknowledges its frames */
    int end;              /**< what to talk on; -1 = unplugged */
    int terminal;
    char line[SLCAN_LINE_MAX];
    unsigned length;
    char out[SLCAN_OUT_MAX]; /**< not taken by the line yet */
    unsigned waiting;
    uint32_t lost; /**< frames that its user was too slow for */
} slcan_t;

/** What is done with each frame that its user sends. */
typedef void (*slcan_heard_t)(void *ctx, const can_frame_t *frame);

/** Plugs it in. False: why says what is wrong and what to do. */
bool slcan_open(slcan_t *self, const char *path, uint32_t bitrate_bps, char *why, size_t size);

/** Pulls it out. */
void slcan_close(slcan_t *self);

/** A byte from its user. */
void slcan_receive(slcan_t *self, char byte, slcan_heard_t heard, void *ctx);

/** A frame of the bus, for its user. */
void slcan_put(slcan_t *self, const can_frame_t *frame);

/** Text for its user, such as a state of the controller. */
void slcan_say(slcan_t *self, const char *text);

/** Takes in what has come, and hands over what waits. */
void slcan_serve(slcan_t *self, slcan_heard_t heard, void *ctx);

/** Whether its user sees the bus. */
bool slcan_is_on_bus(const slcan_t *self);

#endif
