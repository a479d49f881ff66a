/* SPDX-License-Identifier: MIT
 * lifetime.c - the life of a machine in two files; see lifetime.h.
 */
#include "service/lifetime.h"

#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "common/clock_trust.h"
#include "common/message.h"
#include "common/sha256.h"
#include "common/state_file.h"
#include "common/state_path.h"

#define COPIES      2u
#define TEXT_MAX    1024u
#define PATH_BYTES  (CONFIG_PATH_MAX + 8u)
#define DIGITS      16u /* of the checksum */
#define PAUSE_MS    100u
#define END_WAIT_MS 1000u
#define ASK_STEPS   100u /* 10 s */

/* --- The text of a file: lines that a person can read, then a checksum of them --- */

static size_t format(const lifetime_totals_t *totals, char text[TEXT_MAX])
{
    char digits[DIGITS + 1u];
    const lifetime_selftest_t *selftest = &totals->selftest;
    const lifetime_commissioned_t *commissioned = &totals->commissioned;
    /* an older heaved can read what it knows */
    const unsigned version = commissioned->day != 0 ? 4 : selftest->day == 0 ? 1 : selftest->boot == 0 ? 2 : 3;
    size_t length =
        (size_t)snprintf(text, TEXT_MAX, "heave life %u\nsequence %" PRIu64 "\nrides %" PRIu64 "\nfaults %" PRIu64 "\naxes %u\n",
                         version, totals->sequence, totals->rides, totals->faults, (unsigned)totals->axes);
    for (unsigned i = 0; i < totals->axes; i++) {
        const lifetime_axis_t *axis = &totals->axis[i];
        length += (size_t)snprintf(&text[length], TEXT_MAX - length,
                                   "axis %u energized_ms %" PRIu64 " travel_milli %" PRIu64 " turns %" PRIu64 "\n", i + 1u,
                                   axis->energized_ms, axis->travel_milli, axis->turns);
    }
    if (version > 1) {
        length += (size_t)snprintf(&text[length], TEXT_MAX - length, "selftest %u passed %u", selftest->day,
                                   selftest->is_passed ? 1u : 0u);
        length += version == 2 ? 0 : (size_t)snprintf(&text[length], TEXT_MAX - length, " boot %" PRIu64, selftest->boot);
        length += (size_t)snprintf(&text[length], TEXT_MAX - length, " configuration %s\n", selftest->hash);
    }
    if (version > 3) {
        length += (size_t)snprintf(&text[length], TEXT_MAX - length, "commissioned %u machine %s\n", commissioned->day,
                                   commissioned->hash);
    }
    sha256_digits(text, length, digits, sizeof digits);
    return length + (size_t)snprintf(&text[length], TEXT_MAX - length, "sum %s\n", digits);
}

/* A word and the number behind it. What is not quite a number is found when it is written again. */
static bool read_number(const char **at, const char *word, uint64_t *number)
{
    const size_t length = strlen(word);
    if (strncmp(*at, word, length) != 0) {
        return false;
    }
    char *end = NULL;
    *number = strtoull(*at + length, &end, 10);
    *at = end;
    return true;
}

static bool read_axis(const char **at, lifetime_axis_t *axis)
{
    uint64_t number = 0;
    return read_number(at, "\naxis ", &number) && read_number(at, " energized_ms ", &axis->energized_ms) &&
           read_number(at, " travel_milli ", &axis->travel_milli) && read_number(at, " turns ", &axis->turns);
}

/* A word and the hash behind it, which ends the line. */
static bool read_hash(const char **at, const char *word, char hash[CONFIG_HASH_MAX])
{
    const size_t before = strlen(word);
    if (strncmp(*at, word, before) != 0) {
        return false;
    }
    const size_t length = strcspn(*at + before, "\n");
    if (length >= CONFIG_HASH_MAX) {
        return false;
    }
    memcpy(hash, *at + before, length);
    *at += before + length;
    return true;
}

static bool read_selftest(const char **at, bool has_boot, lifetime_selftest_t *selftest)
{
    uint64_t day = 0, passed = 0;
    if (!read_number(at, "\nselftest ", &day) || !read_number(at, " passed ", &passed) ||
        (has_boot && !read_number(at, " boot ", &selftest->boot)) || !read_hash(at, " configuration ", selftest->hash)) {
        return false;
    }
    selftest->day = (uint32_t)day;
    selftest->is_passed = passed != 0;
    return true;
}

static bool read_commissioned(const char **at, lifetime_commissioned_t *commissioned)
{
    uint64_t day = 0;
    const bool is_read = read_number(at, "\ncommissioned ", &day) && read_hash(at, " machine ", commissioned->hash);
    commissioned->day = (uint32_t)day;
    return is_read;
}

/* What was written by format(), and nothing else: it is written again and compared. */
static bool parse(const char *text, size_t length, lifetime_totals_t *totals)
{
    const char *const whole = text;
    char again[TEXT_MAX];
    uint64_t version = 0, axes = 0;
    memset(totals, 0, sizeof *totals);
    if (!read_number(&text, "heave life ", &version) || !read_number(&text, "\nsequence ", &totals->sequence) ||
        !read_number(&text, "\nrides ", &totals->rides) || !read_number(&text, "\nfaults ", &totals->faults) ||
        !read_number(&text, "\naxes ", &axes) || axes > DRIVES_MAX) {
        return false;
    }
    for (totals->axes = 0; totals->axes < axes; totals->axes++) {
        if (!read_axis(&text, &totals->axis[totals->axes])) {
            return false;
        }
    }
    if (version > 1 && !read_selftest(&text, version > 2, &totals->selftest)) {
        return false;
    }
    if (version > 3 && !read_commissioned(&text, &totals->commissioned)) {
        return false;
    }
    return format(totals, again) == length && memcmp(again, whole, length) == 0;
}

/* --- The files --- */

static void name_of(const lifetime_t *self, unsigned copy, char path[PATH_BYTES])
{
    (void)snprintf(path, PATH_BYTES, "%s%s", self->path, copy == 0 ? "" : ".2");
}

/* Returns 0, ENOENT, or what is wrong; EBADMSG: its text is not right. */
static int read_copy(const lifetime_t *self, unsigned copy, lifetime_totals_t *totals)
{
    char path[PATH_BYTES];
    char text[TEXT_MAX];
    size_t length = 0;
    name_of(self, copy, path);
    const int error = state_file_read(path, text, sizeof text, &length);
    return error != 0 ? error : parse(text, length, totals) ? 0 : EBADMSG;
}

static int write_copy(const lifetime_t *self, const lifetime_totals_t *totals)
{
    char path[PATH_BYTES], text[TEXT_MAX];
    name_of(self, (unsigned)(totals->sequence % COPIES), path);
    return state_file_write(path, text, format(totals, text));
}

void lifetime_step(lifetime_t *self)
{
    lifetime_totals_t totals;
    bool is_new = false;
    while (ring_pop(&self->ring, &totals, sizeof totals) > 0) {
        is_new = true; /* the newest one has all that the others have */
    }
    if (is_new) {
        const int error = write_copy(self, &totals);
        __atomic_store_n(&self->error, error != 0 ? error : machine_keys_write(&self->keys), __ATOMIC_RELEASE);
    }
}

/* --- The service thread's side --- */

static void hand_over(lifetime_t *self)
{
    self->now.sequence++;
    (void)ring_push(&self->ring, &self->now, sizeof self->now, NULL,
                    0); /* no room: the disk hangs, and the next one has it all */
}

static void add_wear(lifetime_t *self, const snapshot_t *snapshot)
{
    for (unsigned i = 0; i < self->now.axes; i++) {
        const wear_t *wear = &snapshot->wear[i];
        const lifetime_axis_t *before = &self->before.axis[i];
        self->now.axis[i] = (lifetime_axis_t){before->energized_ms + wear->energized_us / 1000,
                                              before->travel_milli + wear->travel_milli, before->turns + wear->turns};
    }
    self->now.faults = self->before.faults + snapshot->counters.faults;
    self->now.rides = self->before.rides + snapshot->rides;
}

void lifetime_serve(lifetime_t *self, const snapshot_t *snapshot, uint64_t now_us)
{
    add_wear(self, snapshot);
    const bool is_down =
        snapshot->state == STATE_OFF && self->state != STATE_OFF; /* a good moment: who has parked it may switch it off */
    self->state = snapshot->state;
    if (self->path[0] != '\0' && (is_down || now_us >= self->next_us)) {
        self->next_us = now_us + LIFETIME_PERIOD_US;
        hand_over(self);
    }
}

void lifetime_note_selftest(lifetime_t *self, const lifetime_selftest_t *selftest)
{
    self->now.selftest = *selftest;
    self->now.selftest.boot = self->boot;
    self->has_own = true;
    if (self->path[0] != '\0') {
        hand_over(self);
    }
}

bool lifetime_note_commissioned(lifetime_t *self, uint32_t day, const config_t *config)
{
    if (!machine_keys_note(&self->keys, config)) {
        return false;
    }
    self->now.commissioned.day = day;
    (void)snprintf(self->now.commissioned.hash, sizeof self->now.commissioned.hash, "%s", config->machine_hash);
    if (self->path[0] != '\0') {
        hand_over(self);
    }
    return true;
}

uint32_t lifetime_today(void)
{
    struct timespec now = {0};
    struct tm date = {0};
    (void)clock_gettime(CLOCK_REALTIME, &now);
    (void)localtime_r(&now.tv_sec, &date);
    return (uint32_t)((date.tm_year + 1900) * 10000 + (date.tm_mon + 1) * 100 + date.tm_mday);
}

bool lifetime_has_passed(const lifetime_t *self, uint32_t day, const char *hash)
{
    const lifetime_selftest_t *selftest = &self->now.selftest;
    const bool is_date_right = __atomic_load_n(&self->is_clock_trusted, __ATOMIC_ACQUIRE) != 0;
    return selftest->is_passed && selftest->day == day && strcmp(selftest->hash, hash) == 0 &&
           (self->has_own || is_date_right || (self->boot != 0 && selftest->boot == self->boot));
}

bool lifetime_trouble(lifetime_t *self, int *error)
{
    *error = __atomic_load_n(&self->error, __ATOMIC_ACQUIRE);
    const bool is_news = (*error != 0) != (self->logged_error != 0);
    self->logged_error = *error;
    return is_news;
}

/* --- Start and end --- */

/* The newest copy that is right. Copies that are not there are no error, as long as not one of them is damaged. */
static int read_newest(lifetime_t *self)
{
    int error = ENOENT;
    for (unsigned copy = 0; copy < COPIES; copy++) {
        lifetime_totals_t totals;
        const int its = read_copy(self, copy, &totals);
        if (its == 0 && totals.sequence >= self->before.sequence) {
            self->before = totals;
        }
        error = its == 0 || error == 0 ? 0 : its != ENOENT ? its : error;
    }
    return error == ENOENT ? 0 : error;
}

int lifetime_open(lifetime_t *self, const config_t *config, uint32_t axes)
{
    ring_init(&self->ring, self->ring_bytes, sizeof self->ring_bytes);
    self->boot = clock_boot(&clock_trust_files);
    self->is_clock_trusted = clock_is_trusted(&clock_trust_files);
    if (!state_path(self->path, sizeof self->path, config->life_file, "/" LIFETIME_NAME)) {
        return print_message(EXIT_NO_OUTPUT, "life of the machine: the path of the state directory is too long");
    }
    const int error = self->path[0] != '\0' ? read_newest(self) : 0;
    if (error != 0) {
        return print_message(EXIT_BAD_DATA,
                             "life of the machine: %s and its copy %s.2: %s; mend them, or move them away to begin at zero",
                             self->path, self->path, error == EBADMSG ? "neither is right" : strerror(error));
    }
    if (self->before.sequence != 0 && self->before.axes != axes) {
        return print_message(
            EXIT_BAD_DATA,
            "life of the machine: %s is of a machine with %u axes, this one has %u; name another [platform] life_file",
            self->path, (unsigned)self->before.axes, (unsigned)axes);
    }
    self->before.axes = axes;
    self->now = self->before;
    if (self->path[0] == '\0') {
        return EXIT_DONE;
    }
    machine_keys_read(&self->keys, self->path, self->now.commissioned.hash);
    self->now.sequence++;
    const int unwritten = write_copy(self, &self->now);
    return unwritten == 0
               ? EXIT_DONE
               : print_message(EXIT_NO_OUTPUT, "life of the machine %s: %s; [platform] life_file says where it is kept",
                               self->path, strerror(unwritten));
}

/* A clock chip on a slow bus, and a file of a time server, may take their time. A date that was once right is right until the
 * machine starts anew. */
static void ask_clock(lifetime_t *self)
{
    if (!self->is_clock_trusted && ++self->steps >= ASK_STEPS) {
        self->steps = 0;
        __atomic_store_n(&self->is_clock_trusted, clock_is_trusted(&clock_trust_files), __ATOMIC_RELEASE);
    }
}

static void step(void *ctx, bool is_end)
{
    lifetime_step(ctx);
    if (!is_end) {
        ask_clock(ctx);
    }
}

bool lifetime_start(lifetime_t *self)
{
    return self->path[0] == '\0' || worker_start(&self->worker, step, self, PAUSE_MS);
}

bool lifetime_close(lifetime_t *self)
{
    if (self->path[0] == '\0') {
        return true;
    }
    hand_over(self);
    if (!worker_close(&self->worker, END_WAIT_MS)) {
        return false;
    }
    lifetime_step(self);
    self->path[0] = '\0';
    return true;
}
