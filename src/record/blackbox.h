/* SPDX-License-Identifier: MIT
 * blackbox.h - the black box: the last minutes of a live run in memory, written to a folder after every fault and e-stop, and on
 * request. A folder holds frames (as --record writes them; --play repeats the incident), trace.csv (as --trace), feedback.csv
 * and platform.ini.
 * The motion thread feeds it through rings and never waits. A thread of its own does everything else, so a disk that does not
 * answer delays nobody. Nothing is allocated after blackbox_open().
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

/** Further properties of a drive: bits of `known`. */
enum { BLACKBOX_HOMED = 1, BLACKBOX_HAS_ACTUAL = 2, BLACKBOX_ENERGIZED = 4 };

/** The data that is kept of a cycle. */
typedef struct {
    uint64_t now_us; /**< since the start of the program */
    trace_row_t row;
    q32_t actual_q32[DRIVES_MAX]; /**< mm, deg of the rotation motor */
    uint32_t code[DRIVES_MAX];    /**< fault code of the drive itself */
    uint8_t drive[DRIVES_MAX];    /**< drive_state_t */
    uint8_t known[DRIVES_MAX];    /**< BLACKBOX_HOMED ... */
    uint32_t age_us[DRIVES_MAX];  /**< of actual */
    uint16_t error[DRIVES_MAX];   /**< code of the last EMCY that the drive has not cleared */
    uint8_t drives;
    uint8_t fault; /**< fault_code_t */
    uint8_t fault_axis;
} blackbox_row_t;

/** The rings from the motion thread to the black box. */
typedef struct {
    ring_t records; /**< record_t */
    ring_t rows;    /**< blackbox_row_t */
    ring_t states;  /**< session_t */
    uint64_t next_state_us;
} blackbox_feed_t;

/** An item of any of these rings. */
typedef union {
    record_t record;
    blackbox_row_t row;
    session_t state;
} blackbox_item_t;

/** What is kept of one feed; private to blackbox.c. */
typedef struct {
    ring_t *from;
    size_t time_at; /**< offset of the time in an item */
    ring_t kept;
    ring_t reader;          /**< while an incident is written: the items that are still needed */
    uint64_t lost_until_us; /**< after this time nothing is missing */
    uint32_t dropped;       /**< items that `from` had dropped when last looked at */
    bool is_reading;
    bool is_gap; /**< items were dropped, and the end of the gap is not known yet */
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
    int place;            /**< atomic: descriptor of that directory (O_PATH); -1 = none yet */
    uint32_t number;      /**< of the next incident */
    uint32_t folders_max; /**< of each sort */
    uint32_t seen_kept;   /**< `seen` as the directory has it */
    int seen_error;       /**< errno of the last try to write `seen` to the directory, 0 = none; a new error is logged once */
    uint64_t newest_us;   /**< time of the newest row */
    uint64_t zero_us;     /**< 0 = not yet */
    uint64_t reloaded_us; /**< time of the last reload of the configuration; 0 = never */
    uint64_t until_us;    /**< time of the newest row of the incident being written */
    uint64_t due_us;      /**< time at which an incident will be written; 0 = none */
    uint8_t last_state;   /**< of the newest row */
    blackbox_row_t cause; /**< the row in which the incident began */
    output_file_t file;
    char path[BLACKBOX_PATH_MAX + 32u];
    blackbox_item_t item;
    blackbox_item_t oldest; /**< the item that is overwritten */
    blackbox_item_t read;
    blackbox_row_t written[2]; /**< rows whose feedback a replay uses: the previous and the present one */
    char line[CHECKPOINT_LINE_MAX];

    pthread_mutex_t mutex; /**< guards the members below; only the thread of the black box changes the list */
    blackbox_folder_t folder[BLACKBOX_FOLDERS_MAX]; /**< folders in the directory, oldest first */
    uint32_t folders;
    uint32_t seen; /**< number of the newest one that a person has seen */
    uint32_t asked;
    uint32_t answered;
    bool is_answer_good;
    char answer[BLACKBOX_TEXT_MAX];

    worker_t worker;
    bool has_no_thread; /**< the thread could not be started: nothing is written */
} blackbox_t;

/** Prepares the black box. Without a directory, configured or given by a service manager, there is none; that is no error.
 *  @param config_path has to stay valid
 *  @param config      its settings have to stay valid
 *  @return NULL; or a text that says what is wrong: there is then no black box */
const char *blackbox_open(blackbox_t *self, const char *config_path, const config_t *config);

/** The rings that the motion thread feeds; NULL if there is no black box. */
blackbox_feed_t *blackbox_feed(blackbox_t *self);

/** Starts the thread; does nothing if there is no black box. */
bool blackbox_start(blackbox_t *self);

/** Takes items from the rings and writes incidents that are due. The thread calls it again and again; tests call it themselves.
 *  @param is_end incidents that are due later are written now */
void blackbox_step(blackbox_t *self, bool is_end);

/** Asks for an incident. Any thread.
 *  @return ticket for blackbox_answer(); 0: there is no black box */
uint32_t blackbox_ask(blackbox_t *self);

/** True once the incident of this ticket has been written, or has failed.
 *  @param text the folder, or the reason */
bool blackbox_answer(blackbox_t *self, uint32_t ticket, bool *is_good, char text[BLACKBOX_TEXT_MAX]);

/** Lists the folders in the directory. Any thread.
 *  @param to   BLACKBOX_FOLDERS_MAX, oldest first
 *  @param seen out: number of the newest one that a person has seen
 *  @return number of folders */
uint32_t blackbox_list(blackbox_t *self, blackbox_folder_t *to, uint32_t *seen);

/** Descriptor of the directory (O_PATH), to open files in it; -1 = none, or it cannot be opened yet. Any thread. */
int blackbox_folder(const blackbox_t *self);

/** Notes that a person has seen all folders that exist now. The first fault after them will not be removed. Any thread. */
void blackbox_see(blackbox_t *self);

/** Number of a folder, and whether a person requested it (dump). */
uint32_t blackbox_number(const char *name);
bool blackbox_is_dump(const char *name);

/** Writes the incidents that are due and ends the thread. If the disk takes too long, the thread is left running.
 *  @return false: it still runs, and self has to stay */
bool blackbox_close(blackbox_t *self);

/* --- The motion thread --- */

/** Records an event that is not a datagram. Datagrams go to feed->records by record_push_datagram(). */
void blackbox_note(blackbox_feed_t *feed, record_kind_t kind, uint64_t t_us, uint32_t value);

/** Takes the row of a cycle. Call it after every cycle, from the first feedback on. */
void blackbox_cycle(blackbox_feed_t *feed, const session_t *session, const trace_row_t *row);

#endif
