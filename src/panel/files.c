/* SPDX-License-Identifier: MIT
 * files.c - see files.h.
 */
#include "panel/files.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#define LOG_BYTES 262144u /* of each file: some 1000 lines */

static const char k_prefix[] = "incident-";

/* incident-NUMBER-DATE, with -dump behind it or not: nothing that leads out of the folder. */
static bool is_incident(const char *name)
{
    static const char k_letters[] = "0123456789TZ-dump";
    const size_t prefix = sizeof k_prefix - 1;
    const size_t length = strlen(name);
    return length < 64 && strncmp(name, k_prefix, prefix) == 0 && name[prefix] >= '0' && name[prefix] <= '9' &&
           strspn(&name[prefix], k_letters) == length - prefix;
}

static bool is_of_an_incident(const char *file)
{
    static const char *const k_files[] = {"frames", "trace.csv", "feedback.csv", "platform.ini"};
    for (unsigned i = 0; i < sizeof k_files / sizeof k_files[0]; i++) {
        if (strcmp(file, k_files[i]) == 0) {
            return true;
        }
    }
    return false;
}

/* A regular file, and no link. */
static opened_t open_at(int folder, const char *name)
{
    struct stat status;
    opened_t opened = {.fd = openat(folder, name, O_RDONLY | O_NOFOLLOW | O_CLOEXEC | O_NONBLOCK | O_NOCTTY)};
    if (opened.fd >= 0 && (fstat(opened.fd, &status) != 0 || !S_ISREG(status.st_mode))) {
        (void)close(opened.fd);
        opened.fd = -1;
        errno = EINVAL;
    }
    opened.length = opened.fd >= 0 ? (size_t)status.st_size : 0;
    return opened;
}

opened_t files_open_incident(const upstream_t *upstream, const char *name, const char *file, char *why, size_t size)
{
    opened_t opened = {.fd = -1};
    if (!is_incident(name) || !is_of_an_incident(file)) {
        (void)snprintf(why, size, "there is no such file of an incident");
        return opened;
    }
    if (upstream->incidents < 0) {
        (void)snprintf(why, size, "heaved is not there, or has no black box");
        return opened;
    }
    const int folder = openat(upstream->incidents, name, O_PATH | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC);
    if (folder >= 0) {
        opened = open_at(folder, file);
    }
    if (opened.fd < 0) {
        (void)snprintf(why, size, "%s/%s: %s", name, file, strerror(errno));
    }
    if (folder >= 0) {
        (void)close(folder);
    }
    return opened;
}

/* Whole lines of the end of a file, behind what is there already. */
static void append_tail(char *text, size_t *length, const opened_t *opened)
{
    const size_t wanted = opened->length < LOG_BYTES ? opened->length : LOG_BYTES;
    const ssize_t got = pread(opened->fd, text + *length, wanted, (off_t)(opened->length - wanted));
    if (got <= 0) {
        return;
    }
    size_t end = *length + (size_t)got;
    const char *const first = wanted < opened->length ? memchr(text + *length, '\n', (size_t)got) : NULL;
    if (first != NULL) { /* begins within a line */
        const size_t cut = (size_t)(first + 1 - (text + *length));
        memmove(text + *length, first + 1, (size_t)got - cut);
        end -= cut;
    }
    while (end > *length && text[end - 1] != '\n') { /* one that is just being written */
        end--;
    }
    *length = end;
}

char *files_read_log(const upstream_t *upstream, size_t *length, char *why, size_t size)
{
    char older[UPSTREAM_LOG_MAX + 4];
    *length = 0;
    if (upstream->log < 0 || upstream->log_name[0] == '\0' || strchr(upstream->log_name, '/') != NULL) {
        (void)snprintf(why, size, "heaved is not there, or has no operator log");
        return NULL;
    }
    (void)snprintf(older, sizeof older, "%s.1", upstream->log_name);
    const opened_t opened[2] = {open_at(upstream->log, older), open_at(upstream->log, upstream->log_name)};
    char *const text = opened[1].fd >= 0 ? malloc(2 * (size_t)LOG_BYTES) : NULL;
    if (text == NULL) {
        (void)snprintf(why, size, "%s: %s", upstream->log_name, strerror(errno));
    }
    for (unsigned i = 0; i < 2; i++) {
        if (text != NULL && opened[i].fd >= 0) {
            append_tail(text, length, &opened[i]);
        }
        if (opened[i].fd >= 0) {
            (void)close(opened[i].fd);
        }
    }
    return text;
}
