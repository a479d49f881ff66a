/* SPDX-License-Identifier: MIT
 * operator_log.c - the operator log and its writer; see operator_log.h.
 */
#include "service/operator_log.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "common/json.h"
#include "common/message.h"
#include "common/state_path.h"

#define LINE_MAX_BYTES 2048u /* every character of every text escaped */
#define PATH_BYTES     (CONFIG_PATH_MAX + 16u)
#define PAUSE_MS       100u
#define END_WAIT_MS    1000u
#define KB             1024u

/* --- A line --- */

/* Date of a day since 1970-01-01, in the proleptic Gregorian calendar; years counted from March. gmtime_r() may allocate. */
static void date_of(int64_t days, int *year, int *month, int *day)
{
    const int64_t shifted = days + 719468;
    const int64_t era = shifted / 146097;
    const int64_t of_era = shifted - era * 146097;
    const int64_t year_of_era = (of_era - of_era / 1460 + of_era / 36524 - of_era / 146096) / 365;
    const int64_t of_year = of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    const int64_t from_march = (5 * of_year + 2) / 153;
    *day = (int)(of_year - (153 * from_march + 2) / 5 + 1);
    *month = (int)(from_march < 10 ? from_march + 3 : from_march - 9);
    *year = (int)(year_of_era + era * 400 + (*month <= 2));
}

/* RFC 3339, UTC, with milliseconds. */
static void put_time(const struct timespec *at, char text[40])
{
    int year, month, day;
    const int64_t seconds = at->tv_sec > 0 ? at->tv_sec : 0;
    const int of_day = (int)(seconds % 86400);
    date_of(seconds / 86400, &year, &month, &day);
    (void)snprintf(text, 40, "%04d-%02d-%02dT%02d:%02d:%02d.%03dZ", year, month, day, of_day / 3600, of_day / 60 % 60,
                   of_day % 60, (int)(at->tv_nsec / 1000000));
}

static size_t put_line(const operator_entry_t *entry, char line[LINE_MAX_BYTES])
{
    char time[40];
    json_t json;
    put_time(&entry->at, time);
    json_start(&json, line, LINE_MAX_BYTES);
    json_open(&json, NULL, '{');
    json_text(&json, "time", time);
    json_number(&json, "uid", entry->uid);
    json_number(&json, "gid", entry->gid);
    json_number(&json, "pid", (uint64_t)(entry->pid > 0 ? entry->pid : 0));
    json_text(&json, "level", level_name(entry->level));
    json_text(&json, "by", entry->by);
    json_text(&json, "request", entry->request);
    json_bool(&json, "ok", entry->answer[0] == '\0');
    json_text(&json, "answer", entry->answer);
    json_text(&json, "before", state_name(entry->before));
    json_text(&json, "after", state_name(entry->after));
    json_number(&json, "repeats_before", entry->repeats);
    json_number(&json, "left_out_before", entry->left_out);
    json_close(&json, '}');
    json_newline(&json);
    return json.is_cut ? 0 : json.length;
}

/* --- The file --- */

/* Only ever appended to. A pipe or a device is refused: it would block, and keep nothing. */
static int open_file(operator_log_t *self)
{
    struct stat found;
    self->fd = open(self->path, O_WRONLY | O_APPEND | O_CREAT | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK | O_NOCTTY, 0640);
    if (self->fd < 0) {
        return errno;
    }
    if (fstat(self->fd, &found) != 0 || !S_ISREG(found.st_mode)) {
        (void)close(self->fd);
        self->fd = -1;
        return EINVAL;
    }
    self->bytes = (uint64_t)found.st_size;
    memset(self->minor_bytes, 0, sizeof self->minor_bytes);
    return 0;
}

static void name_of(const operator_log_t *self, uint32_t number, char path[PATH_BYTES])
{
    (void)snprintf(path, PATH_BYTES, number == 0 ? "%s" : "%s.%u", self->path, (unsigned)number);
}

/* FILE becomes FILE.1, that FILE.2, and so on; the last one goes. A line is never in two of them. */
static void rotate(operator_log_t *self)
{
    char from[PATH_BYTES], to[PATH_BYTES];
    for (uint32_t number = self->files; number > 0; number--) {
        name_of(self, number - 1, from);
        name_of(self, number, to);
        (void)rename(from, to); /* where it fails the file just goes on */
    }
    (void)close(self->fd);
    self->fd = -1;
}

/* A line that went in by half, on a disk that is full, is ended before the next one. */
static int write_line(operator_log_t *self, const char *line, size_t length)
{
    const ssize_t written = write(self->fd, line, length);
    if (written == (ssize_t)length) {
        self->bytes += length;
        return 0;
    }
    const int error = written < 0 ? errno : ENOSPC;
    if (written > 0) {
        (void)!ftruncate(self->fd, (off_t)self->bytes);
    }
    return error;
}

static bool is_minor(const operator_entry_t *entry)
{
    return entry->is_refused || (entry->level == LEVEL_LOOK && entry->before == entry->after);
}

static bool has_room_for_minor(const operator_log_t *self, level_t level, size_t length)
{
    return self->minor_bytes[level] + length <= self->bytes_max / OPERATOR_LOG_MINOR_OF &&
           self->bytes + length <= self->bytes_max;
}

static int put_entry(operator_log_t *self, operator_entry_t *entry)
{
    char line[LINE_MAX_BYTES];
    entry->left_out += self->minor_left_out;
    const size_t length = put_line(entry, line);
    if (is_minor(entry) && !has_room_for_minor(self, entry->level, length)) {
        self->minor_left_out = entry->left_out + entry->repeats + 1u;
        return 0;
    }
    if (self->fd >= 0 && self->bytes + length > self->bytes_max && self->bytes > 0) {
        rotate(self);
    }
    int error = self->fd < 0 ? open_file(self) : 0;
    error = error != 0 ? error : write_line(self, line, length);
    self->minor_left_out = error != 0 ? entry->left_out + entry->repeats : 0;
    self->minor_bytes[entry->level] += error == 0 && is_minor(entry) ? length : 0;
    return error;
}

void operator_log_step(operator_log_t *self)
{
    operator_entry_t entry;
    bool is_new = false;
    int error = 0;
    while (ring_pop(&self->ring, &entry, sizeof entry) > 0) {
        error = put_entry(self, &entry);
        (void)__atomic_fetch_add(&self->failed, error != 0, __ATOMIC_RELAXED);
        is_new = true;
    }
    if (is_new && error == 0 && fdatasync(self->fd) != 0) {
        error = errno;
    }
    if (is_new) {
        __atomic_store_n(&self->error, error, __ATOMIC_RELEASE);
    }
}

/* --- The service thread's side --- */

static bool is_repeat(const operator_entry_t *last, const operator_entry_t *entry)
{
    return last->request[0] != '\0' && last->uid == entry->uid && last->before == entry->before && last->after == entry->after &&
           strcmp(last->request, entry->request) == 0 && strcmp(last->answer, entry->answer) == 0 &&
           strcmp(last->by, entry->by) == 0 && entry->at.tv_sec - last->at.tv_sec < OPERATOR_LOG_REPEATS_S &&
           entry->at.tv_sec >= last->at.tv_sec;
}

/* That of the user at the level, else that which was used longest ago. */
static operator_share_t *share_of(operator_log_t *self, const operator_entry_t *entry)
{
    operator_share_t *oldest = &self->share[0];
    for (unsigned i = 0; i < OPERATOR_LOG_SHARES; i++) {
        operator_share_t *const share = &self->share[i];
        if (share->at_s != 0 && share->uid == entry->uid && share->level == entry->level) {
            return share;
        }
        oldest = share->at_s < oldest->at_s ? share : oldest;
    }
    *oldest = (operator_share_t){.uid = entry->uid, .level = entry->level, .lines = OPERATOR_LOG_BURST, .at_s = entry->at.tv_sec};
    return oldest;
}

static bool uses_share(operator_log_t *self, const operator_entry_t *entry)
{
    operator_share_t *const share = share_of(self, entry);
    const int64_t pauses = (entry->at.tv_sec - share->at_s) / OPERATOR_LOG_PAUSE_S;
    if (pauses < 0) { /* somebody has set the clock */
        share->at_s = entry->at.tv_sec;
    } else if (pauses >= OPERATOR_LOG_BURST) {
        share->lines = OPERATOR_LOG_BURST;
        share->at_s = entry->at.tv_sec;
    } else {
        share->lines = share->lines + pauses < OPERATOR_LOG_BURST ? share->lines + (uint32_t)pauses : OPERATOR_LOG_BURST;
        share->at_s += pauses * OPERATOR_LOG_PAUSE_S;
    }
    if (share->lines == 0) {
        return false;
    }
    share->lines--;
    return true;
}

/* Somebody who asks the same a thousand times a second does not rotate away what others did. */
void operator_log_add(operator_log_t *self, const operator_entry_t *entry)
{
    if (self->path[0] == '\0') {
        return;
    }
    if (is_repeat(&self->last, entry)) {
        self->repeats++;
        self->repeated_at = entry->at;
        return;
    }
    if (is_minor(entry) && !uses_share(self, entry)) {
        self->left_out += self->left_out < UINT32_MAX;
        return;
    }
    self->last = *entry;
    self->last.repeats = self->repeats;
    self->last.left_out = self->left_out;
    self->repeats = self->left_out = 0;
    (void)ring_push(&self->ring, &self->last, sizeof self->last, NULL, 0);
}

const char *operator_log_name(const operator_log_t *self)
{
    const char *const slash = strrchr(self->path, '/');
    return slash != NULL ? slash + 1 : self->path;
}

int operator_log_folder(const operator_log_t *self)
{
    return self->path[0] != '\0' ? self->folder : -1;
}

/* Where the file is: at the start, as nobody who looks on may make heaved wait for a disk later. */
static void open_folder(operator_log_t *self)
{
    char path[PATH_BYTES];
    const size_t length = (size_t)(operator_log_name(self) - self->path);
    (void)snprintf(path, sizeof path, "%.*s", length > 0 ? (int)length : 1, length > 0 ? self->path : ".");
    self->folder = open(path, O_PATH | O_DIRECTORY | O_CLOEXEC);
}

uint32_t operator_log_lost(const operator_log_t *self)
{
    return ring_dropped(&self->ring) + __atomic_load_n(&self->failed, __ATOMIC_RELAXED);
}

bool operator_log_trouble(operator_log_t *self, int *error)
{
    *error = __atomic_load_n(&self->error, __ATOMIC_ACQUIRE);
    const bool is_news = (*error != 0) != (self->logged_error != 0);
    self->logged_error = *error;
    return is_news;
}

/* --- Start and end --- */

int operator_log_open(operator_log_t *self, const config_t *config)
{
    ring_init(&self->ring, self->ring_bytes, sizeof self->ring_bytes);
    self->fd = -1;
    self->folder = -1;
    self->bytes_max = (uint64_t)config->operator_log_kb * KB;
    self->files = config->operator_log_files;
    if (!state_path(self->path, sizeof self->path, config->operator_log, "/" OPERATOR_LOG_NAME)) {
        return print_message(EXIT_NO_OUTPUT, "operator log: the path of the state directory is too long");
    }
    const int error = self->path[0] != '\0' ? open_file(self) : 0;
    if (error == 0) {
        open_folder(self);
        return EXIT_DONE;
    }
    const int code = print_message(EXIT_NO_OUTPUT, "operator log %s: %s", self->path,
                                   error == EINVAL ? "not a file; [control] operator_log has to be one" : strerror(error));
    self->path[0] = '\0';
    return code;
}

static void step(void *ctx, bool is_end)
{
    (void)is_end;
    operator_log_step(ctx);
}

bool operator_log_start(operator_log_t *self)
{
    return self->path[0] == '\0' || worker_start(&self->worker, step, self, PAUSE_MS);
}

/* The newest of the entries that were only counted, as a line. */
static void end_repeats(operator_log_t *self)
{
    if (self->repeats > 0) {
        self->last.at = self->repeated_at;
        self->last.repeats = self->repeats - 1;
        self->last.left_out = self->left_out;
        self->repeats = self->left_out = 0;
        (void)ring_push(&self->ring, &self->last, sizeof self->last, NULL, 0);
    }
}

bool operator_log_close(operator_log_t *self)
{
    end_repeats(self);
    if (!worker_close(&self->worker, END_WAIT_MS)) {
        return false;
    }
    if (self->path[0] != '\0') {
        operator_log_step(self);
    }
    if (self->fd >= 0) {
        (void)close(self->fd);
        self->fd = -1;
    }
    if (self->folder >= 0) {
        (void)close(self->folder);
        self->folder = -1;
    }
    return true;
}
