/* SPDX-License-Identifier: MIT
 * blackbox_folders.c - which incidents there are, and which of them a person has seen; see blackbox_folders.h.
 */
#include "record/blackbox_folders.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include "common/message.h"
#include "heave/text.h"

#define PREFIX      "incident-"
#define DUMP        "-dump"
#define DIGITS      6u          /* of a number at least, so that names sort as numbers do */
#define DIGITS_MAX  10u         /* behind 999999, which only a folder of somebody else can lead to */
#define NUMBER_LAST 4000000000u /* a folder of a larger number is none of ours: there is always a next one */
#define SEEN        ".seen"

const char *const blackbox_file_name[BLACKBOX_FILES] = {"frames", "trace.csv", "feedback.csv", "platform.ini"};

const char *blackbox_path_of(blackbox_t *self, const char *folder, const char *file)
{
    text_t text = text_start(self->path, sizeof self->path);
    text_put(&text, self->directory);
    text_put(&text, "/");
    text_put(&text, folder);
    text_put(&text, file[0] != '\0' ? "/" : "");
    text_put(&text, file);
    return self->path;
}

static int by_name(const void *a, const void *b)
{
    const char *one = ((const blackbox_folder_t *)a)->name, *other = ((const blackbox_folder_t *)b)->name;
    const uint32_t number = blackbox_number(one), others = blackbox_number(other);
    return number != others ? (number > others ? 1 : -1) : strcmp(one, other);
}

/* Removes a folder and the files that are known to be in it. */
void blackbox_remove_folder(blackbox_t *self, const char *name)
{
    for (unsigned i = 0; i < BLACKBOX_FILES; i++) {
        (void)unlink(blackbox_path_of(self, name, blackbox_file_name[i]));
    }
    (void)rmdir(blackbox_path_of(self, name, ""));
}

uint32_t blackbox_number(const char *name)
{
    const size_t prefix = strlen(PREFIX);
    if (strncmp(name, PREFIX, prefix) != 0 || strlen(name) >= BLACKBOX_NAME_MAX) {
        return 0;
    }
    const size_t digits = strspn(&name[prefix], "0123456789");
    const unsigned long long number = digits < DIGITS || digits > DIGITS_MAX ? 0 : strtoull(&name[prefix], NULL, 10);
    return number <= NUMBER_LAST ? (uint32_t)number : 0;
}

bool blackbox_is_dump(const char *name)
{
    const size_t length = strlen(name);
    return length >= strlen(DUMP) && strcmp(&name[length - strlen(DUMP)], DUMP) == 0;
}

static void drop(blackbox_t *self, uint32_t index)
{
    blackbox_remove_folder(self, self->folder[index].name);
    (void)pthread_mutex_lock(&self->mutex);
    self->folders--;
    memmove(&self->folder[index], &self->folder[index + 1], (self->folders - index) * sizeof self->folder[0]);
    (void)pthread_mutex_unlock(&self->mutex);
}

/* Index of the first fault since a person last looked. Its folder stays, because later folders show only consequences. */
static uint32_t find_first_unseen(blackbox_t *self)
{
    (void)pthread_mutex_lock(&self->mutex);
    const uint32_t seen = self->seen;
    (void)pthread_mutex_unlock(&self->mutex);
    uint32_t index = 0;
    while (index < self->folders &&
           (blackbox_is_dump(self->folder[index].name) || blackbox_number(self->folder[index].name) <= seen)) {
        index++;
    }
    return index;
}

/* The first fault that nobody has seen stays, and does not count. */
void blackbox_drop_surplus(blackbox_t *self, bool is_dump)
{
    const uint32_t kept = find_first_unseen(self);
    uint32_t count = 0;
    for (uint32_t i = self->folders; i-- > 0;) {
        if (blackbox_is_dump(self->folder[i].name) == is_dump && i != kept && ++count > self->folders_max) {
            drop(self, i);
        }
    }
}

void blackbox_add_folder(blackbox_t *self, const char *name)
{
    if (self->folders == BLACKBOX_FOLDERS_MAX) {
        return;
    }
    (void)pthread_mutex_lock(&self->mutex);
    memcpy(self->folder[self->folders].name, name, strlen(name) + 1); /* blackbox_number() has looked at its length */
    self->folders++;
    (void)pthread_mutex_unlock(&self->mutex);
}

/* Synchronises to the disk, because the power may fail next. */
bool blackbox_close_file(blackbox_t *self)
{
    output_file_flush(&self->file);
    if (self->file.error == 0 && fsync(self->file.fd) != 0) {
        self->file.error = errno;
    }
    return output_file_close(&self->file);
}

/* Renames the folder that was written, and synchronises the directory. */
bool blackbox_name_folder(blackbox_t *self, const char *name)
{
    char part[sizeof self->path];
    (void)snprintf(part, sizeof part, "%s", blackbox_path_of(self, BLACKBOX_PART, ""));
    if (rename(part, blackbox_path_of(self, name, "")) != 0) {
        return false;
    }
    const int directory = open(self->directory, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (directory >= 0) {
        (void)fsync(directory);
        (void)close(directory);
    }
    return true;
}

void blackbox_make_name(blackbox_t *self, bool is_dump, char name[BLACKBOX_NAME_MAX])
{
    const time_t now = time(NULL);
    struct tm date;
    (void)gmtime_r(&now, &date);
    (void)snprintf(name, BLACKBOX_NAME_MAX, PREFIX "%06u-%04d%02d%02dT%02d%02d%02dZ%s", (unsigned)self->number,
                   date.tm_year + 1900, date.tm_mon + 1, date.tm_mday, date.tm_hour, date.tm_min, date.tm_sec,
                   is_dump ? DUMP : "");
}

/* --- What a person has seen --- */

static uint32_t read_seen(blackbox_t *self)
{
    char digits[DIGITS_MAX + 2] = "";
    const int fd = open(blackbox_path_of(self, SEEN, ""), O_RDONLY | O_CLOEXEC);
    if (fd < 0) {
        return 0;
    }
    const bool is_read = read(fd, digits, DIGITS_MAX) > 0;
    (void)close(fd);
    return is_read ? (uint32_t)strtoul(digits, NULL, 10) : 0;
}

/* Returns errno, 0 = it is on the disk. */
static int write_seen(blackbox_t *self, uint32_t seen)
{
    char part[sizeof self->path];
    char digits[DIGITS_MAX + 8];
    const int length = snprintf(digits, sizeof digits, "%06u\n", (unsigned)seen);
    (void)snprintf(part, sizeof part, "%s", blackbox_path_of(self, SEEN ".part", ""));
    (void)unlink(part); /* in a folder where others write, too, it may be a link of theirs */
    if (!output_file_open(&self->file, part, OUTPUT_FILE_IS_NEW)) {
        return self->file.error;
    }
    output_file_write(&self->file, digits, (size_t)length);
    if (!blackbox_close_file(self)) {
        return self->file.error;
    }
    return rename(part, blackbox_path_of(self, SEEN, "")) == 0 ? 0 : errno;
}

void blackbox_keep_seen(blackbox_t *self)
{
    (void)pthread_mutex_lock(&self->mutex);
    const uint32_t seen = self->seen;
    (void)pthread_mutex_unlock(&self->mutex);
    if (seen == self->seen_kept) {
        return;
    }
    const int error = write_seen(self, seen);
    if (error != 0 && error != self->seen_error) {
        (void)print_message(0, "black box: %s: %s; what has been seen is forgotten with the end of heaved", self->path,
                            strerror(error));
    }
    self->seen_error = error;
    self->seen_kept = error == 0 || seen < self->seen_kept ? seen : self->seen_kept;
}

const char *blackbox_find_folders(blackbox_t *self)
{
    static char text[BLACKBOX_TEXT_MAX];
    (void)mkdir(self->directory, 0750);
    DIR *directory = opendir(self->directory);
    for (const struct dirent *entry = NULL; directory != NULL && (entry = readdir(directory)) != NULL;) {
        const uint32_t number = blackbox_number(entry->d_name);
        if (number != 0) {
            blackbox_add_folder(self, entry->d_name);
            self->number = number > self->number ? number : self->number;
        }
    }
    const int error = errno;
    if (directory != NULL) {
        (void)closedir(directory);
    }
    qsort(self->folder, self->folders, sizeof self->folder[0], by_name);
    const time_t now = 0;
    struct tm date;
    (void)gmtime_r(&now, &date); /* its first call allocates; so call it here, at the start */
    if (directory != NULL && access(self->directory, W_OK | X_OK) == 0) {
        blackbox_remove_folder(self, BLACKBOX_PART);
        self->seen = self->seen_kept = read_seen(self);
        return NULL;
    }
    (void)snprintf(text, sizeof text, "black box: %s: %s; until that changes, no incident can be written", self->directory,
                   strerror(directory == NULL ? error : errno));
    return text;
}
