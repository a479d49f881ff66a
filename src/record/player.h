/* SPDX-License-Identifier: MIT
 * player.h - lines of a file of frames through a gateway, with simulated time: what an offline run is, without files.
 * Needs no operating system.
 */
#ifndef HEAVE_RECORD_PLAYER_H
#define HEAVE_RECORD_PLAYER_H

#include "record/frames_line.h"
#include "record/session.h"
#include "record/trace.h"
#include "sim_drives.h"
#include "sim_inputs.h"

/** A run. The caller sets what stands before session, zeroes the rest, and calls session_init. */
typedef struct {
    const frames_line_t *line; /**< times never decrease */
    size_t lines;
    sim_drives_t *drives;                                                    /**< where lines say what a drive did */
    sim_inputs_t *inputs;                                                    /**< where lines press the e-stop */
    void (*refused)(void *ctx, const frames_line_t *line, const char *what); /**< told of refused requests; NULL: nobody */
    void *ctx;

    session_t session;
    bool is_before_zero; /**< the run goes on from a state before time zero: lines' times are since the start */
    bool is_told;        /**< lines tell what the drives told; the simulated ones are not asked */
    drive_feedback_t told[DRIVES_MAX];
    size_t next_datagram; /**< line from which on to look for one */
    size_t next_request;  /**< the same for everything else */
    bool is_ended;        /**< a line has said so: the last cycle was the last one */
    uint64_t still_since_us;
    trace_row_t row; /**< of the last cycle */
} player_t;

/** The lines' datagrams, each once its time has come: for the io that session_init takes. */
hal_udp_t player_udp(player_t *self);

/** The drives: simulated, unless lines tell what they told. For the io that session_init or gateway_resume takes. */
drives_t player_drives(player_t *self);

/** Comes up to SETTLED as it does live: before time zero and without a row. What the auto policy does comes after it.
 *  @return false where the platform does not come up */
bool player_settle(player_t *self, const settings_t *settings);

/** The row of the last cycle before the first of player_cycle. */
void player_begin(player_t *self);

/** One cycle, with what is due before it, and its row. */
void player_cycle(player_t *self);

/** Nothing has moved for a while, and nothing more comes; or a line says that this is the end. */
bool player_is_at_rest(const player_t *self);

/** Two hours after the last line. */
bool player_is_endless(const player_t *self);

#endif
