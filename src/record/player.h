/* SPDX-License-Identifier: MIT
 * player.h - plays the lines of a frames file through a gateway, in simulated time. This is an offline run without its files.
 * Needs no operating system.
 */
#ifndef HEAVE_RECORD_PLAYER_H
#define HEAVE_RECORD_PLAYER_H

#include "record/frames_line.h"
#include "record/session.h"
#include "record/trace.h"
#include "sim_drives.h"
#include "sim_inputs.h"

/** A run. The caller sets the members before session, zeroes the others, and calls session_init(). */
typedef struct {
    const frames_line_t *line; /**< times never decrease */
    size_t lines;
    sim_drives_t *drives;                                                    /**< lines inject events of drives here */
    sim_inputs_t *inputs;                                                    /**< lines press the e-stop here */
    void (*refused)(void *ctx, const frames_line_t *line, const char *what); /**< gets each refused request; may be NULL */
    void *ctx;

    session_t session;
    bool is_before_zero; /**< the run continues from a state before time zero: times of lines count from the start of heaved */
    bool is_recorded;    /**< lines contain the feedback of the drives; that of the simulated drives is not used */
    drive_feedback_t recorded_drive[DRIVES_MAX];
    size_t next_datagram; /**< line at which the search for the next datagram begins */
    size_t next_request;  /**< the same for everything else */
    bool is_ended;        /**< a line has ended the run: no further cycle */
    uint64_t still_since_us;
    trace_row_t row; /**< of the last cycle */
} player_t;

/** The source of datagrams for the io of session_init(). It delivers the datagram of each line when its time has come. */
hal_udp_t player_udp(player_t *self);

/** The drives for the io of session_init(): simulated ones, unless lines contain the feedback. */
drives_t player_drives(player_t *self);

/** Brings the platform up to SETTLED as in live operation: before time zero and without rows. The auto policy acts only
 * afterwards.
 *  @return false: the platform does not come up */
bool player_settle(player_t *self, const settings_t *settings);

/** Goes on from a saved session, the drives included. In a cage (common/cage.h) where the bytes came from a file.
 *  @param saved of the same configuration; is believed */
void player_resume(player_t *self, const session_t *saved);

/** Fills `row` from the session as it is now. Call it before the first player_cycle(). */
void player_begin(player_t *self);

/** Carries out the lines that are due, runs one cycle, and fills `row`. */
void player_cycle(player_t *self);

/** True if no set-point has changed for a while and no lines are left, or if a line has ended the run. */
bool player_is_at_rest(const player_t *self);

/** True two hours after the last line. */
bool player_is_endless(const player_t *self);

/** The longest time that a run simulates from its first line on. There has to be one. */
uint64_t player_span_us(const player_t *self);

#endif
