/* SPDX-License-Identifier: MIT
 * motion_loop.h - the motion thread: wakes up once per cycle, runs the gateway, hands everything slow over to others.
 * Nothing here allocates or waits for another thread. Cycles that are late are skipped and counted, never caught up.
 */
#ifndef HEAVE_DAEMON_MOTION_LOOP_H
#define HEAVE_DAEMON_MOTION_LOOP_H

#include <pthread.h>

#include "config/config.h"
#include "daemon/devices.h"
#include "heave/hal/clock.h"
#include "heave/switches.h"
#include "record/blackbox.h"
#include "record/session.h"
#include "record/udp_recorder.h"
#include "service/handover.h"
#include "service/samples_writer.h"

/** The thread and all it hands over. Large: from the heap, at the start. */
typedef struct {
    session_t session;
    devices_t devices;
    gateway_io_t io;
    udp_recorder_t tap;
    switches_t switches; /**< between the inputs and the gateway */
    bool was_blind;      /**< the inputs could not be read */
    state_t before_hold; /**< newest state but HOLD */
    hal_clock_t clock;
    uint32_t late_hold_cycles; /**< a cycle later than that holds the platform; 0 = never */
    bool is_recording;
    bool is_tracing;
    blackbox_feed_t *blackbox; /**< NULL: there is none */

    samples_writer_t samples; /**< opened by the owner */

    handover_t handover;
    bool has_lost_clock; /**< once it has ended: because it could not wait for its next cycle */
    bool is_energized;   /**< once it has ended at once: a drive has not confirmed that its torque is off */
    pthread_t thread;

    motion_view_words_t current; /**< private to the motion thread */
    bool was_estop;
    bool has_feedback; /**< a drive has told where it is: from then on cycles are written down */
    bool has_first_faults;
    uint32_t first_faults; /**< page faults of the thread before they count */
    drive_feedback_t was_drive[DRIVES_MAX];
    hal_udp_networks_t allow; /**< who may send, now */
} motion_loop_t;

/** Prepares everything; starts no thread.
 *  @param config kept
 *  @return HV_OK; what devices_open or gateway_init return */
hv_status_t motion_loop_init(motion_loop_t *self, const config_t *config, hal_udp_t udp, hal_log_t log,
                             hal_clock_t clock) HV_MUST_CHECK;

/** Starts the thread. It ends by itself when a shutdown has ended, or on motion_loop_quit().
 *  @return false: errno says why */
bool motion_loop_start(motion_loop_t *self);

/** Hands what has changed in the configuration over. The service thread.
 *  @return false: too many at once, try later */
bool motion_loop_reload(motion_loop_t *self, const config_t *config);

/** Tells whether memory could be locked: from the next cycle on page faults count. Any thread. */
void motion_loop_memory(motion_loop_t *self, motion_memory_t memory);

/** Ends the thread after a quick stop of the drives, within a cycle. Any thread. */
void motion_loop_quit(motion_loop_t *self);

/** True once the thread has done its last cycle. Any thread. */
bool motion_loop_has_ended(const motion_loop_t *self);

#endif
