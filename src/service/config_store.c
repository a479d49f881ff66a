/* SPDX-License-Identifier: MIT
 * config_store.c - see config_store.h.
 */
#include "service/config_store.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "common/sealed.h"
#include "common/sha256.h"
#include "common/state_path.h"
#include "common/translate.h"

#define PAUSE_MS    20u
#define END_WAIT_MS 1000u

enum { PHASE_IDLE, PHASE_READ, PHASE_HAS_READ, PHASE_WRITE, PHASE_WRITTEN };

static const char k_foot[] = "; heaved: applied over ";
static const char *const k_size = N_("the text has no byte, or more than a configuration that is applied may have (130976)");

/* Offset of the last line, which holds the digest of the file's text; `length` if there is no such line. */
static size_t find_foot(const char *text, size_t length)
{
    const size_t foot = sizeof k_foot - 1u;
    size_t at = length > 0 && text[length - 1u] == '\n' ? length - 1u : length;
    while (at > 0 && text[at - 1u] != '\n') {
        at--;
    }
    return length - at >= foot + CONFIG_STORE_DIGEST_MAX - 1u && memcmp(&text[at], k_foot, foot) == 0 ? at : length;
}

/* Number of bytes read from a file; -1: it cannot be read, is too long, or is no regular file. */
static ssize_t read_file(const char *path, char text[CONFIG_TEXT_BYTES])
{
    struct stat about;
    if (stat(path, &about) != 0 || !S_ISREG(about.st_mode)) {
        return -1;
    }
    const ssize_t length = config_read(path, text);
    return length < 0 || length > (ssize_t)CONFIG_FILE_MAX ? -1 : length;
}

/* Chooses file or kept, and reads its text. Returns NULL: neither can be read. */
static const char *choose(const char *file, const char *kept, char file_digest[CONFIG_STORE_DIGEST_MAX],
                          char text[CONFIG_TEXT_BYTES], size_t *length)
{
    ssize_t bytes = read_file(file, text);
    file_digest[0] = '\0';
    if (bytes >= 0) {
        sha256_digits(text, (size_t)bytes, file_digest, CONFIG_STORE_DIGEST_MAX);
    }
    const bool is_overwritten = kept[0] != '\0' && bytes >= 0; /* also by one that is too long */
    const ssize_t applied = is_overwritten ? read_file(kept, text) : -1;
    const size_t foot = applied >= 0 ? find_foot(text, (size_t)applied) : 0;
    if (applied >= 0 && foot < (size_t)applied &&
        memcmp(&text[foot + sizeof k_foot - 1u], file_digest, CONFIG_STORE_DIGEST_MAX - 1u) == 0) {
        *length = foot;
        return kept;
    }
    bytes = is_overwritten ? read_file(file, text) : bytes;
    *length = bytes >= 0 ? (size_t)bytes : 0;
    return bytes >= 0 ? file : NULL;
}

const char *config_store_choose(const char *file, char kept[CONFIG_PATH_MAX])
{
    char digest[CONFIG_STORE_DIGEST_MAX];
    size_t length = 0;
    char *const text = malloc(CONFIG_TEXT_BYTES);
    if (!state_path(kept, CONFIG_PATH_MAX, "none", "/" CONFIG_STORE_NAME)) {
        kept[0] = '\0'; /* the path would be too long: nothing is kept */
    }
    const char *const path = text != NULL ? choose(file, kept, digest, text, &length) : NULL;
    free(text);
    return path != NULL ? path : file; /* the caller loads it, and gets the error */
}

/* --- The text in force --- */

static void forget(int *fd)
{
    if (*fd >= 0) {
        (void)close(*fd);
    }
    *fd = -1;
}

/* Only for its words a pipe, or what cannot be read, is tried once more. */
static void read_again(config_store_t *self)
{
    self->path = choose(self->file, self->kept, self->read_digest, self->text, &self->text_length);
    self->read_length = (ssize_t)self->text_length;
    if (self->path == NULL) {
        const ssize_t length = config_read(self->file, self->text);
        self->read_length = length < 0 ? -errno : length;
    }
}

void config_store_open(config_store_t *self, const char *file, const char *loaded)
{
    self->file = file;
    self->fd = -1;
    if (!state_path(self->kept, sizeof self->kept, "none", "/" CONFIG_STORE_NAME)) {
        self->kept[0] = '\0';
    }
    self->path = choose(self->file, self->kept, self->file_digest, self->text, &self->text_length);
    if (self->path != NULL && strcmp(self->path, loaded) == 0) {
        config_store_adopt(self, self->path);
    }
}

void config_store_read(config_store_t *self)
{
    __atomic_store_n(&self->phase, (uint32_t)PHASE_READ, __ATOMIC_RELEASE);
}

bool config_store_has_read(config_store_t *self, const char **path, const char **text, ssize_t *length)
{
    if (__atomic_load_n(&self->phase, __ATOMIC_ACQUIRE) != PHASE_HAS_READ) {
        return false;
    }
    *path = self->path;
    *text = self->text;
    *length = self->read_length;
    __atomic_store_n(&self->phase, (uint32_t)PHASE_IDLE, __ATOMIC_RELEASE);
    return true;
}

/* The number of the descriptor does not change, because an answer with it may not have been sent yet. */
static bool replace_sealed(config_store_t *self)
{
    int fd = sealed_text("heave-configuration", self->text, self->text_length);
    if (self->fd < 0) {
        self->fd = fd;
        return fd >= 0;
    }
    const bool is_done = fd >= 0 && dup3(fd, self->fd, O_CLOEXEC) >= 0;
    forget(&fd);
    return is_done;
}

void config_store_adopt(config_store_t *self, const char *path)
{
    self->put_back[0] = '\0';
    if (self->read_digest[0] != '\0') {
        memcpy(self->file_digest, self->read_digest, sizeof self->file_digest);
        self->read_digest[0] = '\0';
    }
    self->length = self->text_length;
    self->is_applied = path == self->kept;
    self->digest[0] = '\0';
    if (replace_sealed(self)) {
        sha256_digits(self->text, self->text_length, self->digest, CONFIG_STORE_DIGEST_MAX);
    }
}

/* --- One that is applied --- */

const char *config_store_accept(config_store_t *self, int fd, const char **text, size_t *length)
{
    struct stat about;
    const int seals = fd >= 0 ? fcntl(fd, F_GET_SEALS) : -1;
    if (seals < 0 || (seals & SEALED_AGAINST) != SEALED_AGAINST || fstat(fd, &about) != 0) {
        return N_("the text comes with the request: a memfd, sealed against writing, growing and shrinking");
    }
    if (about.st_size > (off_t)CONFIG_FILE_MAX || about.st_size == 0) {
        return k_size;
    }
    self->text_length = (size_t)about.st_size;
    if (pread(fd, self->text, self->text_length, 0) != (ssize_t)self->text_length) {
        return N_("the text cannot be read");
    }
    self->text_length = find_foot(self->text, self->text_length);
    if (self->text_length > CONFIG_STORE_TEXT_MAX || self->text_length == 0) {
        return k_size;
    }
    *text = self->text;
    *length = self->text_length;
    return NULL;
}

void config_store_write(config_store_t *self)
{
    self->read_digest[0] = '\0'; /* what was read and refused does not count */
    __atomic_store_n(&self->phase, (uint32_t)PHASE_WRITE, __ATOMIC_RELEASE);
}

bool config_store_is_busy(const config_store_t *self)
{
    return __atomic_load_n(&self->phase, __ATOMIC_ACQUIRE) != PHASE_IDLE;
}

bool config_store_done(config_store_t *self, int *error, const char **text, size_t *length)
{
    if (__atomic_load_n(&self->phase, __ATOMIC_ACQUIRE) != PHASE_WRITTEN) {
        return false;
    }
    *error = self->error;
    *text = self->text;
    *length = self->text_length;
    __atomic_store_n(&self->phase, (uint32_t)PHASE_IDLE, __ATOMIC_RELEASE);
    return true;
}

/* --- The thread --- */

static bool write_all(int fd, const char *text, size_t length)
{
    while (length > 0) {
        const ssize_t written = write(fd, text, length);
        if (written < 0 && errno != EINTR) {
            return false;
        }
        text += written > 0 ? written : 0;
        length -= written > 0 ? (size_t)written : 0;
    }
    return true;
}

static void name_older(const char *kept, unsigned number, char path[CONFIG_PATH_MAX + 8u])
{
    if (number == 0) {
        (void)snprintf(path, CONFIG_PATH_MAX + 8u, "%s", kept);
    } else {
        (void)snprintf(path, CONFIG_PATH_MAX + 8u, "%s.%u", kept, number);
    }
}

/* A second name, where there is such a file. */
static bool keep_as(const char *path, const char *name)
{
    return link(path, name) == 0 || errno == ENOENT;
}

/* The older ones move by one; the one in force stays in its place until the new one takes it. */
static bool keep_older(const config_store_t *self)
{
    char from[CONFIG_PATH_MAX + 8u], to[CONFIG_PATH_MAX + 8u];
    for (unsigned i = CONFIG_STORE_OLDER; i > 1; i--) { /* .1 to .2 is the last step */
        name_older(self->kept, i - 1u, from);
        name_older(self->kept, i, to);
        if (rename(from, to) != 0 && errno != ENOENT) {
            return false;
        }
    }
    name_older(self->kept, 1, to);
    return keep_as(self->kept, to);
}

static bool sync_folder(const char *path)
{
    char folder[CONFIG_PATH_MAX];
    (void)snprintf(folder, sizeof folder, "%.*s", (int)(strrchr(path, '/') - path), path);
    const int fd = open(folder, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    const bool is_done = fd >= 0 && fsync(fd) == 0;
    forget(&(int){fd});
    return is_done;
}

/* What is told of as not in force does not come into force at the next start either. */
static bool put_back(const char *kept)
{
    char before[CONFIG_PATH_MAX + 8u];
    name_older(kept, 1, before);
    return renameat(AT_FDCWD, before, AT_FDCWD, kept) == 0 || (errno == ENOENT && unlink(kept) == 0);
}

bool config_store_put_back(const char *kept)
{
    char failed[CONFIG_PATH_MAX + 8u];
    (void)snprintf(failed, sizeof failed, "%s.failed", kept);
    if (unlink(failed) != 0 && errno != ENOENT) {
        return false;
    }
    return keep_as(kept, failed) && put_back(kept) && sync_folder(kept); /* at each moment one of the two is there as a whole */
}

/* Somebody has edited the file, and would lose that. */
static bool has_file_changed(const config_store_t *self)
{
    static char text[CONFIG_TEXT_BYTES]; /* the thread's */
    char now[CONFIG_STORE_DIGEST_MAX];
    const ssize_t bytes = read_file(self->file, text);
    sha256_digits(text, bytes > 0 ? (size_t)bytes : 0, now, CONFIG_STORE_DIGEST_MAX);
    return bytes < 0 || strcmp(now, self->file_digest) != 0;
}

static int write_kept(const config_store_t *self)
{
    char path[CONFIG_PATH_MAX + 8u], foot[CONFIG_STORE_FOOT_MAX];
    const bool is_ended = self->text[self->text_length - 1u] == '\n';
    (void)snprintf(path, sizeof path, "%s.new", self->kept);
    (void)snprintf(foot, sizeof foot, "%s%s%s\n", is_ended ? "" : "\n", k_foot, self->file_digest);
    const int fd = open(path, O_WRONLY | O_CREAT | O_TRUNC | O_NOFOLLOW | O_CLOEXEC, 0640);
    const bool is_done = fd >= 0 && write_all(fd, self->text, self->text_length) && write_all(fd, foot, strlen(foot)) &&
                         fsync(fd) == 0 && keep_older(self) && rename(path, self->kept) == 0;
    const int error = is_done ? 0 : errno;
    forget(&(int){fd});
    if (is_done && !sync_folder(self->kept)) {
        const int unsure = errno;
        (void)put_back(self->kept);
        return unsure;
    }
    return error;
}

static void step(void *ctx, bool is_end)
{
    config_store_t *const self = ctx;
    (void)is_end;
    const uint32_t phase = __atomic_load_n(&self->phase, __ATOMIC_ACQUIRE);
    if (phase == PHASE_READ) {
        read_again(self);
        __atomic_store_n(&self->phase, (uint32_t)PHASE_HAS_READ, __ATOMIC_RELEASE);
    } else if (phase == PHASE_WRITE) {
        self->error = has_file_changed(self) ? ESTALE : write_kept(self);
        __atomic_store_n(&self->phase, (uint32_t)PHASE_WRITTEN, __ATOMIC_RELEASE);
    }
}

bool config_store_start(config_store_t *self)
{
    return worker_start(&self->worker, step, self, PAUSE_MS);
}

bool config_store_close(config_store_t *self)
{
    if (!worker_close(&self->worker, END_WAIT_MS)) {
        return false;
    }
    if (self->file != NULL) {
        forget(&self->fd);
    }
    return true;
}
