/* SPDX-License-Identifier: MIT
 * lifetime.h - what the axes of a machine have done over its life: kept in two files that are written in turn, each as a whole,
 * with a checksum, so that one of them is right whenever the power goes. A thread of its own writes them; the service thread
 * hands over and never waits. That thread asks the system whether its date can be right, too. Nothing is allocated after the
 * open.
 */
#ifndef HEAVE_SERVICE_LIFETIME_H
#define HEAVE_SERVICE_LIFETIME_H

#include "common/ring.h"
#include "common/worker.h"
#include "config/config.h"
#include "heave/telemetry.h"
#include "service/machine_keys.h"

#define LIFETIME_NAME       "life"    /* in the state directory, where no file is configured */
#define LIFETIME_PERIOD_US  60000000u /* between two writes: so much is lost at most when the power goes */
#define LIFETIME_RING_BYTES 8192u

/** One axis, over its life. */
typedef struct {
    uint64_t energized_ms;
    uint64_t travel_milli; /**< um, or thousandths of a degree */
    uint64_t turns;
} lifetime_axis_t;

/** The newest self-test. */
typedef struct {
    uint32_t day; /**< of the local calendar, as 20261123; 0 = there was none */
    bool is_passed;
    uint64_t boot;              /**< clock_boot() of the machine then; 0 = not known */
    char hash[CONFIG_HASH_MAX]; /**< of the configuration it was made with */
} lifetime_selftest_t;

/** When somebody has seen the platform rise as it should. */
typedef struct {
    uint32_t day;               /**< of the local calendar; 0 = never */
    char hash[CONFIG_HASH_MAX]; /**< machine_hash of the configuration then */
} lifetime_commissioned_t;

/** What is in a file. */
typedef struct {
    uint64_t sequence; /**< of the write */
    uint64_t rides;    /**< times that it was engaged */
    uint64_t faults;
    uint32_t axes;
    lifetime_axis_t axis[DRIVES_MAX];
    lifetime_selftest_t selftest;
    lifetime_commissioned_t commissioned;
} lifetime_totals_t;

/** The counters; private but for now. */
typedef struct {
    char path[CONFIG_PATH_MAX]; /**< "" = they are not kept; the second file is PATH.2 */
    lifetime_totals_t before;   /**< when heaved started */
    lifetime_totals_t now;
    state_t state; /**< of the last look */
    uint64_t next_us;
    machine_keys_t keys;       /**< of the machine that was commissioned */
    ring_t ring;               /**< lifetime_totals_t to the writer */
    int32_t error;             /**< atomic: errno of the newest write, 0 = it worked */
    int32_t logged_error;      /**< error that lifetime_trouble() has told of */
    uint64_t boot;             /**< clock_boot() */
    uint32_t is_clock_trusted; /**< atomic: clock_is_trusted(), and that it was so once since the start */
    bool has_own;              /**< the newest self-test was made since heaved started */
    unsigned steps;            /**< of the writer, until it asks */
    worker_t worker;
    uint8_t ring_bytes[LIFETIME_RING_BYTES];
} lifetime_t;

/** Reads what there is; without a path, configured or given by a service manager, nothing is kept.
 *  @param axes of this platform
 *  @return EXIT_DONE; EXIT_BAD_DATA: there are files, and none of them is right, or they are another machine's; EXIT_NO_OUTPUT:
 * they cannot be written. Both are said */
int lifetime_open(lifetime_t *self, const config_t *config, uint32_t axes);

/** Starts the writer thread. Does nothing and returns true if there is no file to write to. */
bool lifetime_start(lifetime_t *self);

/** Takes a view in, and hands over where it is time to. The service thread, often. */
void lifetime_serve(lifetime_t *self, const snapshot_t *snapshot, uint64_t now_us);

/** Keeps what has come of a self-test, on the disk as soon as it takes it; `boot` is filled in. */
void lifetime_note_selftest(lifetime_t *self, const lifetime_selftest_t *selftest);

/** Keeps that the machine was commissioned, likewise, with the keys that describe it.
 *  @return false: those before are being written; try again */
bool lifetime_note_commissioned(lifetime_t *self, uint32_t day, const config_t *config);

/** The day of the local calendar, as 20261123. */
uint32_t lifetime_today(void);

/** Whether a self-test has passed on that day, with that configuration. One of before the machine was started counts by its date,
 * so only where the date can be right. */
bool lifetime_has_passed(const lifetime_t *self, uint32_t day, const char *hash);

/** Whether writing has begun to fail, or works again, since the last call.
 *  @param error out: errno; 0 = it works again */
bool lifetime_trouble(lifetime_t *self, int *error);

/** Writes what has been handed over. What its thread does all the time; tests do it by themselves. */
void lifetime_step(lifetime_t *self);

/** Hands the last totals over, writes them and ends the thread, or leaves it alone where the disk takes longer than a second.
 *  @return false: it still runs, and self has to stay */
bool lifetime_close(lifetime_t *self);

#endif
