/* SPDX-License-Identifier: MIT
 * motion_loop.h - the motion thread: wakes up once per cycle, runs the gateway, hands everything slow over to others.
 * Nothing here allocates or waits for another thread. Cycles that are late are skipped and counted, never caught up.
 */
#ifndef HEAVE_APP_MOTION_LOOP_H
#define HEAVE_APP_MOTION_LOOP_H

#include <pthread.h>

#include "blackbox.h"
#include "config.h"
#include "heave/hal/clock.h"
#include "heave/switches.h"
#include "histogram.h"
#include "rig.h"
#include "ring.h"
#include "seqlock.h"
#include "session.h"
#include "udp_tap.h"

/** What the service thread sees: the newest cycle and how punctual it was. */
typedef struct {
    snapshot_t snapshot;
    uint32_t udp_refused; /**< datagrams of senders that are not allowed */
    uint32_t udp_dropped; /**< datagrams the kernel lost because its queue was full, or dropped in a flood */
    bool is_realtime;     /**< scheduled before everything else */
    bool is_memory_locked;
    uint32_t page_faults; /**< of the motion thread, since it was known whether memory is locked */
    bool is_shutting_down;
    char bus_trouble[RIG_TROUBLE_SIZE];      /**< what is wrong with the drives' bus now, "" = nothing */
    char bus_last_trouble[RIG_TROUBLE_SIZE]; /**< what was last, "" = nothing so far */
} motion_view_t;

/** How punctual and how long the cycles were. */
typedef struct {
    histogram_t wake;  /**< from the time of a cycle to its beginning */
    histogram_t work;  /**< from its beginning to its end */
    histogram_t frame; /**< of cycles that follow a frame: from the arrival of the first datagram to the end of the set-points */
} motion_times_t;

#define MOTION_VIEW_WORDS ((sizeof(motion_view_t) + 7u) / 8u)

/** A view with the size that the hand-over wants. */
typedef union {
    motion_view_t view;
    uint64_t word[MOTION_VIEW_WORDS];
} motion_view_words_t;

/** What has become of locking memory. */
typedef enum { MOTION_MEMORY_UNKNOWN, MOTION_MEMORY_LOCKED, MOTION_MEMORY_UNLOCKED } motion_memory_t;

/** An operator's request on its way to the motion thread. */
typedef struct {
    uint32_t id;     /**< the asking side's */
    uint32_t event;  /**< event_t; OPERATOR_INTENSITY: how much of a sender's motion is made */
    uint32_t number; /**< of OPERATOR_INTENSITY: percent */
} motion_request_t;

/** What became of it, after the cycle that took it. */
typedef struct {
    uint32_t id;
    int32_t status; /**< hv_status_t */
    snapshot_t snapshot;
    bool is_shutting_down;
    bool is_key_off;       /**< refused because of that */
    bool is_unapproved;    /**< likewise */
    bool is_power_failing; /**< likewise */
} motion_result_t;

/** What a reload hands over. */
typedef struct {
    settings_t settings;
    hal_udp_networks_t allow;
    uint32_t late_hold_cycles;
} motion_reload_t;

#define MOTION_RELOAD_BYTES  8192u
#define MOTION_REQUEST_BYTES 1024u
#define MOTION_RESULT_BYTES  32768u
#define MOTION_RECORD_BYTES  (1u << 21)
#define MOTION_TRACE_BYTES   (1u << 21)

/** The thread and all it hands over. Large: from the heap, at the start. */
typedef struct {
    session_t session;
    rig_t rig;
    gateway_io_t io;
    udp_tap_t tap;
    switches_t switches; /**< between the inputs and the gateway */
    bool was_blind;      /**< the inputs could not be read */
    state_t before_hold; /**< newest state but HOLD */
    hal_clock_t clock;
    uint32_t late_hold_cycles; /**< a cycle later than that holds the platform; 0 = never */
    bool is_recording;
    bool is_tracing;
    blackbox_feed_t *blackbox; /**< NULL: there is none */

    motion_times_t times;   /**< the motion thread adds, others read */
    seqlock_t view;         /**< motion_view_t to the service thread */
    ring_t requests;        /**< motion_request_t from it */
    ring_t reloads;         /**< motion_reload_t from it */
    ring_t results;         /**< motion_result_t to it */
    ring_t record;          /**< record_t to it */
    ring_t trace;           /**< trace_row_t to it */
    uint32_t is_quit;       /**< atomic: the service thread wants an end at once */
    uint32_t is_unapproved; /**< atomic: nothing is brought up until it is over, as without the enable key */
    uint32_t is_ended;      /**< atomic: the thread has done its last cycle */
    bool has_lost_clock;    /**< once it has ended: because it could not wait for its next cycle */
    bool is_energized;      /**< once it has ended at once: a drive has not confirmed that its torque is off */
    uint32_t memory;        /**< atomic: motion_memory_t */
    pthread_t thread;

    motion_view_words_t current; /**< private to the motion thread */
    bool was_estop;
    bool has_feedback; /**< a drive has told where it is: from then on cycles are written down */
    bool has_first_faults;
    uint32_t first_faults; /**< page faults of the thread before they count */
    drive_feedback_t was_drive[DRIVES_MAX];
    uint64_t view_word[MOTION_VIEW_WORDS];
    hal_udp_networks_t allow; /**< who may send, now */
    uint8_t reload_bytes[MOTION_RELOAD_BYTES];
    uint8_t request_bytes[MOTION_REQUEST_BYTES];
    uint8_t result_bytes[MOTION_RESULT_BYTES];
    uint8_t record_bytes[MOTION_RECORD_BYTES];
    uint8_t trace_bytes[MOTION_TRACE_BYTES];
} motion_loop_t;

/** Prepares everything; starts no thread.
 *  @param config kept
 *  @return HV_OK; what rig_open or gateway_init return */
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
