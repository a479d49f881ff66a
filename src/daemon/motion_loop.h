/* SPDX-License-Identifier: MIT
 * motion_loop.h - the motion thread. It wakes up once per cycle, runs the gateway, and hands everything slow over to other
 * threads. Nothing here allocates or waits for another thread. Cycles that are late are skipped and counted, never caught up.
 */
#ifndef HEAVE_DAEMON_MOTION_LOOP_H
#define HEAVE_DAEMON_MOTION_LOOP_H

#include <pthread.h>

#include "config/config.h"
#include "daemon/delayed_end.h"
#include "daemon/devices.h"
#include "heave/hal/clock.h"
#include "heave/switches.h"
#include "record/blackbox.h"
#include "record/session.h"
#include "record/udp_recorder.h"
#include "service/handover.h"
#include "service/samples_writer.h"

/** The thread and its hand-overs. Large: allocate it on the heap, at the start. */
typedef struct {
    session_t session;
    devices_t devices;
    gateway_io_t io;
    udp_recorder_t tap;
    switches_t switches; /**< between the inputs and the gateway */
    bool was_blind;      /**< the inputs could not be read */
    delayed_end_t end;
    hal_clock_t clock;
    uint32_t late_hold_cycles; /**< the platform is held if more cycles than this are late at once; 0 = never */
    bool is_recording;
    bool is_tracing;
    blackbox_feed_t *blackbox; /**< NULL: there is none */

    samples_writer_t samples; /**< opened by the owner */
    uint64_t work_us;         /**< duration of the newest cycle */

    handover_t handover;
    bool has_lost_clock; /**< valid after the end: the thread ended because the system could not wait for the next cycle */
    bool is_energized;   /**< valid after an end at once: a drive has not confirmed that its torque is off */
    pthread_t thread;

    motion_view_words_t current; /**< private to the motion thread */
    uint32_t rise_percent;       /**< as last asked of the gateway */
    bool was_estop;
    bool has_feedback; /**< a drive has reported its position; from then on the black box gets every cycle */
    bool has_first_faults;
    uint32_t first_faults; /**< page faults of the thread before counting began */
    drive_feedback_t was_drive[DRIVES_MAX];
    uint32_t object_id; /**< of the pending request for an object of a drive; 0 = none */
    drive_object_t object;
    hal_udp_networks_t allow; /**< networks that may send, as now in force */
} motion_loop_t;

/** Prepares everything; starts no thread.
 *  @param config kept
 *  @return HV_OK, or the error of devices_open() or gateway_init() */
hv_status_t motion_loop_init(motion_loop_t *self, const config_t *config, hal_udp_t udp, hal_log_t log,
                             hal_clock_t clock) HV_MUST_CHECK;

/** Starts the thread. It ends by itself when a shutdown has ended, or on motion_loop_quit().
 *  @return false: errno says why */
bool motion_loop_start(motion_loop_t *self);

/** Hands a changed configuration over to the motion thread. Only for the service thread.
 *  @return false: the hand-over is full, try again later */
bool motion_loop_reload(motion_loop_t *self, const config_t *config);

/** Tells the motion thread whether memory could be locked. It counts page faults from the next cycle on. Any thread. */
void motion_loop_memory(motion_loop_t *self, motion_memory_t memory);

/** Ends the thread after a quick stop of the drives, within a cycle. Any thread. */
void motion_loop_quit(motion_loop_t *self);

/** True once the thread has done its last cycle. Any thread. */
bool motion_loop_has_ended(const motion_loop_t *self);

#endif
