/* SPDX-License-Identifier: MIT
 * control.h - the local socket through which heavectl reaches heaved: requests are lines, answers are JSON objects, one per line.
 * Requests: status, watch [HZ], intensity PERCENT, engage, hold, resume, park, reset, shutdown, dump, incidents, seen,
 * acknowledge, commissioned, configuration, configure, by NAME. The service thread owns it; nothing blocks, nothing allocates
 * after the open, and a client that does not read is dropped. An operator can always connect: if all places are taken, heaved
 * closes the connection of the least important client, with an error that says so.
 */
#ifndef HEAVE_SERVICE_CONTROL_H
#define HEAVE_SERVICE_CONTROL_H

#include <poll.h>
#include <sys/stat.h>

#include "record/blackbox.h"
#include "service/access_levels.h"
#include "service/config_store.h"
#include "service/handover.h"
#include "service/operator_log.h"
#include "service/status_json.h"
#include "platform/load.h"

#define CONTROL_CLIENTS      8u
#define CONTROL_SOCKETS      2u
#define CONTROL_FDS          (CONTROL_CLIENTS + CONTROL_SOCKETS)
#define CONTROL_LOOKERS      3u /* most clients of the second socket: those of the first always find a place */
#define CONTROL_REQUEST_MAX  96u
#define CONTROL_ANSWER_MAX   16384u
#define CONTROL_OUT_BYTES    (4u * CONTROL_ANSWER_MAX)
#define CONTROL_WATCH_HZ     20u /* where the client does not say */
#define CONTROL_WATCH_MAX_HZ 50u
#define CONTROL_IDLE_US      2000000u /* has asked nothing for so long: the first to give way */
#define CONTROL_GRACE_US     100000u  /* after it came: time to ask something before it has to give way */

/** One client; private to control*.c. */
typedef struct {
    int fd;         /**< -1: free */
    bool is_looker; /**< came by the second socket */
    level_peer_t peer;
    const struct control *control;
    bool is_logged; /**< its request is, once it is answered */
    operator_entry_t entry;
    char in[CONTROL_REQUEST_MAX];
    size_t in_length;
    bool is_gone;       /**< nobody reads answers any more */
    size_t void_bytes;  /**< so many of the next ones came before a hold */
    uint64_t looked_us; /**< last time at which nothing had come from it */
    uint64_t since_us;  /**< no byte of in has come before; */
    bool is_moving;     /**< the request that is being taken has an age; */
    bool is_voidable;   /**< a hold voids it; */
    bool has_heard;     /**< it tells a tick: */
    uint64_t heard_us;  /**< the last that its client has heard */
    char out[CONTROL_OUT_BYTES];
    size_t out_length;
    int received;              /**< a descriptor that came with its bytes; -1 = none */
    bool is_configuring;       /**< waits until the disk has its configuration */
    int passing;               /**< a descriptor of its owner's that goes out with the next bytes; -1 = none */
    bool is_closing;           /**< nothing more is read; closed once everything is answered and sent */
    uint32_t request_id;       /**< waits for the motion thread; 0 = none */
    event_t request;           /**< or OPERATOR_INTENSITY */
    uint32_t number;           /**< of that */
    service_request_t service; /**< of OPERATOR_SERVICE */
    uint8_t object_drive;      /**< of OPERATOR_OBJECT, from 1 */
    uint8_t object_type;       /**< likewise: canopen_type_t; another number: not known */
    char object_error[192];    /**< what is wrong with the last one */
    bool is_accepted;          /**< by the motion thread; a reset then still has to take effect */
    uint64_t answer_by_us;     /**< latest time of the answer */
    uint32_t dump_ticket;      /**< waits for the black box; 0 = does not */
    uint64_t watch_period_us;  /**< 0 = does not watch */
    uint64_t watch_next_us;
    uint64_t came_us;
    uint64_t asked_us; /**< its last request, else when it came */
} control_client_t;

/** What has come of a self-test, in the words of who made it. */
typedef struct {
    bool is_news;
    bool is_passed;
    level_peer_t peer;
} control_selftest_t;

/** A listening socket; private to control*.c. */
typedef struct {
    int fd;               /**< -1: closed, or not there */
    int newcomer;         /**< has come, and nobody can give way yet; -1: nobody */
    bool is_shut;         /**< the system has no descriptor for a newcomer: not waited for until it is tried again */
    uint64_t looked_us;   /**< last time at which nobody had come; 0: not looked yet */
    uint64_t newcomer_us; /**< that time, when the newcomer came */
    char path[CONFIG_PATH_MAX];
    struct stat made; /**< identity of the socket file, so that only ours is removed */
} control_socket_t;

/** The sockets and their clients; private to control*.c. */
typedef struct control {
    control_socket_t socket[CONTROL_SOCKETS]; /**< the second one is [control] look_socket */
    levels_t levels;
    operator_log_t *log;
    handover_t *handover;
    const config_t *config;
    blackbox_t *blackbox;
    blackbox_folder_t folder[BLACKBOX_FOLDERS_MAX]; /**< as last listed */
    int samples_fd;                                 /**< given to who asks for samples; -1: there are none. The owner sets it */
    status_lost_t lost;                             /**< the owner keeps it up to date */
    config_text_t changed;                          /**< since the machine was commissioned */
    config_store_t *store;                          /**< the owner's; NULL: none */
    config_changes_t changes;                       /**< of what is being applied */
    uint32_t end_id;                                /**< of the last such request */
    bool is_end_wanted;                             /**< a client has asked for shutdown */
    FILE *mistakes_stream;                          /**< into: */
    char mistakes[1024];
    motion_view_words_t view;
    uint64_t polled_us; /**< before the last poll */
    uint64_t held_us;   /**< when the last hold came */
    uint32_t own_holds; /**< of the motion thread, as far as they are known */
    level_peer_t
        acknowledged_by; /**< who has just acknowledged the configuration; the owner says it and sets it back; pid 0: nobody */
    level_peer_t commissioned_by; /**< who has just said that it rises as it should; likewise */
    control_selftest_t selftest;  /**< what somebody has just said of a self-test; likewise */
    uint32_t last_id;
    uint32_t last_series; /**< given out: of what somebody has begun to hold */
    control_client_t client[CONTROL_CLIENTS];
} control_t;

/** Opens the socket, in place of one that a dead daemon left behind. Says what is wrong.
 *  @param config, handover, blackbox, log kept
 *  @return EXIT_DONE; EXIT_UNAVAILABLE: a running heaved has it, or a group is not there; EXIT_NO_OUTPUT: it cannot be created */
int control_open(control_t *self, const char *path, const config_t *config, handover_t *handover, blackbox_t *blackbox,
                 operator_log_t *log);

/** Before the open: what closes it is harmless from then on. */
void control_init(control_t *self);

/** State that the newest view shows. */
state_t control_state(const control_t *self);

/** Fills CONTROL_FDS entries for poll, which follows.
 *  @param now_us what poll does not find has not come before this time */
void control_fill(control_t *self, struct pollfd fds[CONTROL_FDS], uint64_t now_us);

/** How long poll may wait, in ms, not more than the given time. */
int control_timeout_ms(const control_t *self, uint64_t now_us, int at_most_ms);

/** Serves what poll found, and what time has made due. What poll only supposes does no harm. */
void control_serve(control_t *self, const struct pollfd fds[CONTROL_FDS], uint64_t now_us);

/** Sends what waits, closes, and removes the socket file; harmless on a closed one. */
void control_close(control_t *self);

#endif
