/* SPDX-License-Identifier: MIT
 * handover.h - what the motion thread and the other threads hand over to each other, and nothing else: no pointer leads from one
 * into the other. The motion thread never waits for any of it; what does not fit is dropped and counted.
 */
#ifndef HEAVE_SERVICE_HANDOVER_H
#define HEAVE_SERVICE_HANDOVER_H

#include "common/histogram.h"
#include "common/ring.h"
#include "common/seqlock.h"
#include "config/config.h"
#include "heave/motion.h"
#include "heave/telemetry.h"

/** Longest text about the drives' bus, with its end. */
#define BUS_TROUBLE_SIZE 160u

/** What the service thread sees: the newest cycle and how punctual it was. */
typedef struct {
    snapshot_t snapshot;
    uint32_t udp_refused; /**< datagrams of senders that are not allowed */
    uint32_t udp_stale;   /**< datagrams that waited too long while heaved stood still */
    uint32_t udp_dropped; /**< datagrams the kernel lost because its queue was full, or dropped in a flood */
    bool is_realtime;     /**< scheduled before everything else */
    bool is_memory_locked;
    uint32_t page_faults; /**< of the motion thread, since it was known whether memory is locked */
    bool is_shutting_down;
    bool is_end_held;                        /**< a hold delays the end that a signal has asked for */
    uint64_t held_tick_us;                   /**< tick of the last hold: who has heard an earlier one did not know of it */
    uint32_t hold_late_cycles;               /**< of the last hold: so many cycles were late; 0: somebody has asked for it */
    uint32_t own_holds;                      /**< how often heaved has held by itself because it was late */
    char bus_trouble[BUS_TROUBLE_SIZE];      /**< what is wrong with the drives' bus now, "" = nothing */
    char bus_last_trouble[BUS_TROUBLE_SIZE]; /**< what was last, "" = nothing so far */
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

/** What can start or enlarge a motion is carried out within this time, or never. */
#define REQUEST_FRESH_US 1000000u

/** An operator's request on its way to the motion thread. */
typedef struct {
    uint32_t id;               /**< the asking side's */
    uint32_t event;            /**< event_t; OPERATOR_INTENSITY, OPERATOR_SERVICE, OPERATOR_OBJECT */
    uint32_t number;           /**< of OPERATOR_INTENSITY: percent */
    bool has_age;              /**< refused once it is older than REQUEST_FRESH_US, since heard_us or else since_us */
    bool is_voidable;          /**< refused where a hold came after it was asked */
    uint32_t own_holds;        /**< motion_view_t of the time it was handed over */
    bool has_heard;            /**< its client has said which tick it heard last: */
    uint64_t heard_us;         /**< that tick */
    uint64_t since_us;         /**< it has not come before this time of the clock */
    service_request_t service; /**< of OPERATOR_SERVICE; its age comes from: */
    uint64_t tick_us;
    drive_object_t object; /**< of OPERATOR_OBJECT; number is the drive, from 1 */
} motion_request_t;

/** What became of it, after the cycle that took it. */
typedef struct {
    uint32_t id;
    int32_t status; /**< hv_status_t */
    snapshot_t snapshot;
    bool is_shutting_down;
    uint32_t missing;        /**< refused for want of these permits: PERMIT_KEY | ... */
    uint32_t absent;         /**< refused for want of these drives: bit k for axis k */
    bool is_old;             /**< refused because of that: see motion_request_t */
    bool is_void;            /**< likewise */
    bool is_later;           /**< private to the motion thread: the answer comes in a later cycle */
    service_answer_t answer; /**< of OPERATOR_SERVICE, and whether OPERATOR_OBJECT was begun */
    drive_object_t object;   /**< of OPERATOR_OBJECT, once it was begun: what was read, */
    drive_object_state_t object_state;
    uint32_t object_code; /**< and why the drive has refused it */
} motion_result_t;

/** Whether it was refused, and not because of the state. */
static inline bool handover_is_barred(const motion_result_t *result)
{
    return result->is_old || result->is_void || result->missing != 0;
}

/** What a reload hands over. */
typedef struct {
    settings_t settings;
    hal_udp_networks_t allow;
    uint32_t late_hold_cycles;
} motion_reload_t;

/** Of engage speed, where nobody has said yet that this machine rises as it should. */
#define HANDOVER_SLOW_PERCENT 10u

#define HANDOVER_RELOAD_BYTES  8192u
#define HANDOVER_REQUEST_BYTES 4096u
#define HANDOVER_RESULT_BYTES  32768u
#define HANDOVER_RECORD_BYTES  (1u << 21)
#define HANDOVER_TRACE_BYTES   (1u << 21)

/** All hand-overs. Large. */
typedef struct {
    motion_times_t times; /**< the motion thread adds, others read */
    seqlock_t view;       /**< motion_view_t from the motion thread */
    ring_t requests;      /**< motion_request_t to it, from the service thread */
    ring_t reloads;       /**< motion_reload_t likewise */
    ring_t results;       /**< motion_result_t from it, to the service thread */
    ring_t record;        /**< record_t from it, to the thread that writes files */
    ring_t trace;         /**< trace_row_t likewise */
    uint32_t is_quit;     /**< atomic: the service thread wants an end at once */
    uint32_t is_end_due;  /**< atomic: a signal wants the platform settled, and an end; no request before it delays that */
    uint32_t withheld;    /**< atomic: what the service thread does not permit, PERMIT_APPROVAL | PERMIT_SELFTEST */
    uint32_t is_slow;     /**< atomic: the platform rises at HANDOVER_SLOW_PERCENT of engage speed */
    uint32_t is_ended;    /**< atomic: the motion thread has done its last cycle */
    uint32_t memory;      /**< atomic: motion_memory_t */
    uint64_t view_word[MOTION_VIEW_WORDS];
    uint8_t reload_bytes[HANDOVER_RELOAD_BYTES];
    uint8_t request_bytes[HANDOVER_REQUEST_BYTES];
    uint8_t result_bytes[HANDOVER_RESULT_BYTES];
    uint8_t record_bytes[HANDOVER_RECORD_BYTES];
    uint8_t trace_bytes[HANDOVER_TRACE_BYTES];
} handover_t;

/** Empties all of them; withheld, is_slow and is_quit stay as they are. Before there are threads. */
void handover_init(handover_t *self);

/** Withholds permits, or gives them again. Any thread.
 *  @return true: they were withheld before */
static inline bool handover_withhold(handover_t *self, uint32_t permits, bool is_withheld)
{
    const uint32_t before = is_withheld ? __atomic_fetch_or(&self->withheld, permits, __ATOMIC_ACQ_REL)
                                        : __atomic_fetch_and(&self->withheld, ~permits, __ATOMIC_ACQ_REL);
    return (before & permits) != 0;
}

/** Whether a permit is withheld. Any thread. */
static inline bool handover_is_withheld(const handover_t *self, uint32_t permits)
{
    return (__atomic_load_n(&self->withheld, __ATOMIC_ACQUIRE) & permits) != 0;
}

/** How fast the platform is to rise, in percent of engage speed. Any thread. */
static inline uint32_t handover_rise_percent(const handover_t *self)
{
    return __atomic_load_n(&self->is_slow, __ATOMIC_ACQUIRE) != 0 ? HANDOVER_SLOW_PERCENT : MOTION_RISE_PERCENT_MAX;
}

#endif
