/* SPDX-License-Identifier: MIT
 * blackbox.h - the black box: the last minutes of a live run in memory, written to a folder after every fault and e-stop, and on
 * request. A folder holds frames (as --record writes them; --play repeats the incident), trace.csv (as --trace), feedback.csv
 * and platform.ini.
 * The motion thread feeds it through rings and never waits. Everything else is a thread of its own, so that a disk that does not
 * answer holds up nobody. Nothing is allocated after the open.
 */
#ifndef HEAVE_RECORD_BLACKBOX_H
#define HEAVE_RECORD_BLACKBOX_H

#include <pthread.h>

#include "common/output_file.h"
#include "common/ring.h"
#include "common/worker.h"
#include "config/config.h"
#include "record/checkpoint.h"
#include "record/record.h"
#include "record/session.h"

#define BLACKBOX_PATH_MAX (CONFIG_PATH_MAX + 112u)
#define BLACKBOX_TEXT_MAX (BLACKBOX_PATH_MAX + 128u)

/** What else is known of a drive. */
enum { BLACKBOX_HOMED = 1, BLACKBOX_HAS_ACTUAL = 2, BLACKBOX_ENERGIZED = 4 };

/** What is kept of a cycle. */
typedef struct {
    uint64_t now_us; /**< since the start of the program */
    trace_row_t row;
    q32_t actual_q32[DRIVES_MAX]; /**< mm, deg of the rotation motor */
    uint32_t code[DRIVES_MAX];    /**< the drive's own */
    uint8_t drive[DRIVES_MAX];    /**< drive_state_t */
    uint8_t known[DRIVES_MAX];    /**< BLACKBOX_HOMED ... */
    uint32_t age_us[DRIVES_MAX];  /**< of actual */
    uint16_t error[DRIVES_MAX];   /**< code of the last EMCY that has not been taken back */
    uint8_t drives;
    uint8_t fault; /**< fault_code_t */
    uint8_t fault_axis;
} blackbox_row_t;

/** From the motion thread to the black box. */
typedef struct {
    ring_t records; /**< record_t */
    ring_t rows;    /**< blackbox_row_t */
    ring_t states;  /**< session_t */
    uint64_t next_state_us;
} blackbox_feed_t;

/** An item of any of them. */
typedef union {
    record_t record;
    blackbox_row_t row;
    session_t state;
} blackbox_item_t;

/** What is kept of one feed; private to blackbox.c. */
typedef struct {
    ring_t *from;
    size_t time_at; /**< where in an item its time is */
    ring_t kept;
    ring_t reader;          /**< while an incident is written: what of it is still needed */
    uint64_t lost_until_us; /**< nothing is missing after that */
    uint32_t dropped;       /**< by `from`, as last seen */
    bool is_reading;
    bool is_gap; /**< something was dropped, it is not known until when */
} blackbox_lane_t;

#define BLACKBOX_INCIDENTS_MAX 100u
#define BLACKBOX_FOLDERS_MAX   (2u * BLACKBOX_INCIDENTS_MAX + 2u) /**< incidents, dumps, the one kept, the one just written */
#define BLACKBOX_NAME_MAX      96u

/** Name of a folder: `incident-NUMBER-DATE` of a fault or an e-stop, with `-dump` behind it where somebody asked for it. */
typedef struct {
    char name[BLACKBOX_NAME_MAX];
} blackbox_folder_t;

/** The black box; large: from the heap, at the start. Members are private to blackbox.c. */
typedef struct {
    blackbox_feed_t feed;
    blackbox_lane_t records;
    blackbox_lane_t rows;
    blackbox_lane_t states;
    uint8_t *memory; /**< of all rings; NULL = there is no black box */
    size_t memory_bytes;
    const char *config_path;
    const settings_t *settings;
    char config_hash[CONFIG_HASH_MAX]; /**< as at the start */
    char *platform;                    /**< the configuration as text */
    size_t platform_length;
    char directory[CONFIG_PATH_MAX];
    uint32_t number;      /**< of the next incident */
    uint32_t folders_max; /**< of each sort */
    uint32_t seen_kept;   /**< as the directory has it */
    int seen_error;       /**< errno of the last try to keep it, 0 = none; each new one is said once */
    uint64_t newest_us;   /**< time of the newest row */
    uint64_t zero_us;     /**< 0 = not yet */
    uint64_t reloaded_us; /**< the configuration was last read again then; 0 = never */
    uint64_t until_us;    /**< newest row of the incident being written */
    uint64_t due_us;      /**< an incident is written then; 0 = none */
    uint8_t last_state;   /**< of the newest row */
    blackbox_row_t cause; /**< the row in which the incident began */
    output_file_t file;
    char path[BLACKBOX_PATH_MAX + 32u];
    blackbox_item_t item;
    blackbox_item_t oldest; /**< that makes way */
    blackbox_item_t read;
    blackbox_row_t told[2]; /**< rows that a replay is told: the last one, and this one */
    char line[CHECKPOINT_LINE_MAX];

    pthread_mutex_t mutex;                          /**< guards what follows; the list is changed by its thread alone */
    blackbox_folder_t folder[BLACKBOX_FOLDERS_MAX]; /**< what there is, oldest first */
    uint32_t folders;
    uint32_t seen; /**< number of the newest one that a person has seen */
    uint32_t asked;
    uint32_t answered;
    bool is_answer_good;
    char answer[BLACKBOX_TEXT_MAX];

    worker_t worker;
    bool has_no_thread; /**< it could not be started: nobody writes anything */
} blackbox_t;

/** Prepares it. Without a directory, configured or given by a service manager, there is none, which is no error.
 *  @param config_path kept, for the files
 *  @param config      its settings are kept
 *  @return NULL; or what is wrong: there is no black box then */
const char *blackbox_open(blackbox_t *self, const char *config_path, const config_t *config);

/** Where the motion thread feeds it; NULL where there is none. */
blackbox_feed_t *blackbox_feed(blackbox_t *self);

/** Starts its thread; does nothing where there is none. */
bool blackbox_start(blackbox_t *self);

/** Takes over what was fed, writes what is due. What its thread does all the time; tests do it by themselves.
 *  @param is_end what is due later is due now */
void blackbox_step(blackbox_t *self, bool is_end);

/** Asks for an incident. Any thread.
 *  @return its ticket; 0: there is no black box */
uint32_t blackbox_ask(blackbox_t *self);

/** Whether that has been written.
 *  @param text where to, or why not */
bool blackbox_answer(blackbox_t *self, uint32_t ticket, bool *is_good, char text[BLACKBOX_TEXT_MAX]);

/** What is in the directory. Any thread.
 *  @param to   BLACKBOX_FOLDERS_MAX, oldest first
 *  @param seen out: number of the newest one that a person has seen
 *  @return how many */
uint32_t blackbox_list(blackbox_t *self, blackbox_folder_t *to, uint32_t *seen);

/** A person has seen all that is in the directory now: the first one after it will not make way. Any thread. */
void blackbox_see(blackbox_t *self);

/** A folder's number, and whether it was asked for. */
uint32_t blackbox_number(const char *name);
bool blackbox_is_dump(const char *name);

/** Writes the incidents that are due and ends the thread. If the disk takes too long, the thread is left running.
 *  @return false: it still runs, and self has to stay */
bool blackbox_close(blackbox_t *self);

/* --- The motion thread --- */

/** What happened, but for datagrams; these go to feed->records by record_push_datagram(). */
void blackbox_note(blackbox_feed_t *feed, record_kind_t kind, uint64_t t_us, uint32_t value);

/** After every cycle from the first feedback on, with its row. */
void blackbox_cycle(blackbox_feed_t *feed, const session_t *session, const trace_row_t *row);

#endif
