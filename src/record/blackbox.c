/* SPDX-License-Identifier: MIT
 * blackbox.c - what the black box keeps, when it is written, and its thread; see blackbox.h.
 */
#include "record/blackbox.h"

#include <errno.h>
#include <fcntl.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "common/state_path.h"
#include "record/blackbox_files.h"
#include "record/blackbox_folders.h"
#include "record/blackbox_kept.h"

#define STATE_US         5000000u /* from one place where a replay can begin to the next */
#define FEED_BYTES       (1u << 20)
#define FEED_STATE_BYTES (1u << 16)
#define KEPT_MIN_BYTES   (1u << 20)
#define KEPT_MAX_BYTES   (1u << 30)
#define PAUSE_MS         10
#define END_WAIT_MS      5000

/* --- The motion thread --- */

void blackbox_note(blackbox_feed_t *feed, record_kind_t kind, uint64_t t_us, uint32_t value)
{
    record_push(&feed->records, kind, t_us, value);
}

static uint8_t known_of(const drive_feedback_t *drive)
{
    return (uint8_t)((drive->is_homed ? BLACKBOX_HOMED : 0) | (drive->has_actual ? BLACKBOX_HAS_ACTUAL : 0) |
                     (drive->is_energized ? BLACKBOX_ENERGIZED : 0));
}

static void push_row(blackbox_feed_t *feed, const session_t *session, const trace_row_t *row)
{
    const snapshot_t *snapshot = gateway_snapshot(&session->gateway);
    blackbox_row_t out = {.now_us = snapshot->now_us,
                          .row = *row,
                          .drives = (uint8_t)(snapshot->cylinders + (snapshot->has_angle ? 1u : 0u)),
                          .fault = (uint8_t)snapshot->fault.code,
                          .fault_axis = snapshot->fault.axis};
    for (unsigned i = 0; i < out.drives; i++) {
        out.actual_q32[i] = snapshot->drive[i].has_actual ? snapshot->drive[i].actual_mm_q32 : 0;
        out.code[i] = snapshot->drive[i].fault_code;
        out.drive[i] = (uint8_t)snapshot->drive[i].state;
        out.error[i] = snapshot->report[i].emergency.is_over ? 0 : snapshot->report[i].emergency.code;
        out.known[i] = known_of(&snapshot->drive[i]);
        out.age_us[i] = (uint32_t)(snapshot->now_us - snapshot->drive[i].actual_us);
    }
    (void)ring_push(&feed->rows, &out, sizeof out, NULL, 0);
}

/* Drives that are on their way to being enabled, or homed, have times of their own that a replay does not know. Before time
 * zero it is told of them, cycle by cycle. */
static bool is_replay_possible(const session_t *session)
{
    const snapshot_t *snapshot = gateway_snapshot(&session->gateway);
    if (!session->has_zero) {
        return true;
    }
    for (unsigned i = 0; i < DRIVES_MAX; i++) {
        if (snapshot->drive[i].state == DRIVE_ENABLING || snapshot->drive[i].state == DRIVE_HOMING) {
            return false;
        }
    }
    return true;
}

void blackbox_cycle(blackbox_feed_t *feed, const session_t *session, const trace_row_t *row)
{
    push_row(feed, session, row);
    if (session->now_us >= feed->next_state_us && is_replay_possible(session)) {
        session_t state;
        checkpoint_copy(session, &state);
        (void)ring_push(&feed->states, &state, sizeof state, NULL, 0);
        feed->next_state_us = session->now_us + STATE_US;
    }
}

/* --- When it is written --- */

static void answer(blackbox_t *self, uint32_t ticket, bool is_good, const char *text)
{
    (void)pthread_mutex_lock(&self->mutex);
    self->answered = ticket;
    self->is_answer_good = is_good;
    (void)snprintf(self->answer, sizeof self->answer, "%s", text);
    (void)pthread_mutex_unlock(&self->mutex);
}

static uint32_t newest_ticket(blackbox_t *self)
{
    (void)pthread_mutex_lock(&self->mutex);
    const uint32_t ticket = self->asked != self->answered ? self->asked : 0;
    (void)pthread_mutex_unlock(&self->mutex);
    return ticket;
}

/* In this thread, which may wait for a disk. */
static void open_place(blackbox_t *self)
{
    if (self->place < 0) {
        __atomic_store_n(&self->place, open(self->directory, O_PATH | O_DIRECTORY | O_CLOEXEC), __ATOMIC_RELEASE);
    }
}

int blackbox_folder(const blackbox_t *self)
{
    return self->memory != NULL ? __atomic_load_n(&self->place, __ATOMIC_ACQUIRE) : -1;
}

void blackbox_step(blackbox_t *self, bool is_end)
{
    char text[BLACKBOX_TEXT_MAX];
    blackbox_pop(self);
    if (self->due_us != 0 && (is_end || self->newest_us >= self->due_us)) {
        self->due_us = 0;
        (void)blackbox_write(self, &self->cause, text);
    }
    open_place(self);
    blackbox_keep_seen(self);
    const uint32_t ticket = newest_ticket(self);
    if (ticket != 0) {
        const bool is_good = blackbox_write(self, NULL, text);
        answer(self, ticket, is_good, text);
    }
}

uint32_t blackbox_list(blackbox_t *self, blackbox_folder_t *to, uint32_t *seen)
{
    (void)pthread_mutex_lock(&self->mutex);
    const uint32_t count = self->folders;
    memcpy(to, self->folder, count * sizeof *to);
    *seen = self->seen;
    (void)pthread_mutex_unlock(&self->mutex);
    return count;
}

void blackbox_see(blackbox_t *self)
{
    (void)pthread_mutex_lock(&self->mutex);
    if (self->folders > 0) {
        self->seen = blackbox_number(self->folder[self->folders - 1].name);
    }
    (void)pthread_mutex_unlock(&self->mutex);
}

uint32_t blackbox_ask(blackbox_t *self)
{
    if (self->memory == NULL) {
        return 0;
    }
    (void)pthread_mutex_lock(&self->mutex);
    self->asked += self->asked == UINT32_MAX ? 2 : 1;
    const uint32_t ticket = self->asked;
    (void)pthread_mutex_unlock(&self->mutex);
    if (self->has_no_thread) {
        answer(self, ticket, false, "its thread could not be started, see the log; restart heaved");
    }
    return ticket;
}

bool blackbox_answer(blackbox_t *self, uint32_t ticket, bool *is_good, char text[BLACKBOX_TEXT_MAX])
{
    (void)pthread_mutex_lock(&self->mutex);
    const bool is_there = (int32_t)(self->answered - ticket) >= 0;
    *is_good = self->is_answer_good;
    memcpy(text, self->answer, sizeof self->answer);
    (void)pthread_mutex_unlock(&self->mutex);
    return is_there;
}

/* --- Memory --- */

static uint32_t power_of_two_above(uint64_t bytes)
{
    uint32_t size = KEPT_MIN_BYTES;
    while (size < bytes && size < KEPT_MAX_BYTES) {
        size *= 2;
    }
    return size;
}

static void init_lane(blackbox_lane_t *lane, ring_t *from, size_t time_at, uint8_t *memory, uint32_t size)
{
    *lane = (blackbox_lane_t){.from = from, .time_at = time_at};
    ring_init(&lane->kept, memory, size);
}

static bool get_memory(blackbox_t *self, const config_t *config)
{
    const uint64_t cycles = (uint64_t)config->black_box.seconds * 1000000u / config->settings.cycle_us;
    const uint32_t rows = power_of_two_above(cycles * (sizeof(blackbox_row_t) + sizeof(uint32_t)));
    const uint32_t records = rows / 2 > KEPT_MIN_BYTES ? rows / 2 : KEPT_MIN_BYTES;
    const uint32_t states =
        power_of_two_above((config->black_box.seconds * 1000000ull / STATE_US + 2u) * (sizeof(session_t) + 4u));
    self->memory_bytes = 2u * (size_t)FEED_BYTES + FEED_STATE_BYTES + rows + records + states;
    self->memory = malloc(self->memory_bytes);
    if (self->memory == NULL) {
        return false;
    }
    memset(self->memory, 0, self->memory_bytes); /* the pages are there before the first cycle needs them */
    uint8_t *at = self->memory;
    ring_init(&self->feed.records, at, FEED_BYTES);
    ring_init(&self->feed.rows, at += FEED_BYTES, FEED_BYTES);
    ring_init(&self->feed.states, at += FEED_BYTES, FEED_STATE_BYTES);
    init_lane(&self->rows, &self->feed.rows, offsetof(blackbox_row_t, now_us), at += FEED_STATE_BYTES, rows);
    init_lane(&self->records, &self->feed.records, offsetof(record_t, head.t_us), at += rows, records);
    init_lane(&self->states, &self->feed.states, offsetof(session_t, now_us), at + records, states);
    return true;
}

static bool describe_platform(blackbox_t *self, const config_t *config)
{
    FILE *out = open_memstream(&self->platform, &self->platform_length);
    if (out == NULL) {
        return false;
    }
    config_dump(config, out);
    return fclose(out) == 0;
}

const char *blackbox_open(blackbox_t *self, const char *config_path, const config_t *config)
{
    self->file.fd = -1;
    self->place = -1;
    self->config_path = config_path;
    self->settings = &config->settings;
    memcpy(self->config_hash, config->hash, sizeof self->config_hash);
    self->folders_max = config->black_box.incidents;
    (void)pthread_mutex_init(&self->mutex, NULL);
    if (!state_path(self->directory, sizeof self->directory, config->black_box.directory, "")) {
        return "black box: the directory's path is too long";
    }
    if (self->directory[0] == '\0') {
        return NULL;
    }
    if (!get_memory(self, config) || !describe_platform(self, config)) {
        free(self->memory);
        free(self->platform);
        self->memory = NULL;
        self->platform = NULL;
        return "black box: no memory; fewer [black-box] seconds need less";
    }
    return blackbox_find_folders(self);
}

blackbox_feed_t *blackbox_feed(blackbox_t *self)
{
    return self->memory != NULL ? &self->feed : NULL;
}

/* --- The thread --- */

static void step(void *ctx, bool is_end)
{
    blackbox_step(ctx, is_end);
}

bool blackbox_start(blackbox_t *self)
{
    if (self->memory == NULL) {
        return true;
    }
    self->has_no_thread = !worker_start(&self->worker, step, self, PAUSE_MS);
    return !self->has_no_thread;
}

bool blackbox_close(blackbox_t *self)
{
    if (!worker_close(&self->worker, END_WAIT_MS)) {
        return false;
    }
    if (self->memory != NULL && self->place >= 0) {
        (void)close(self->place);
        self->place = -1;
    }
    free(self->memory);
    free(self->platform);
    self->memory = NULL;
    self->platform = NULL;
    return true;
}
