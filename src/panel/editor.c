/* SPDX-License-Identifier: MIT
 * editor.c - see editor.h.
 */
#include "panel/editor.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "common/sealed.h"
#include "common/sha256.h"

static bool is_stored(const char *path, const char *text, size_t length)
{
    char next[EDITOR_PATH_MAX + 8];
    (void)snprintf(next, sizeof next, "%s.new", path);
    const int fd = open(next, O_WRONLY | O_CREAT | O_TRUNC | O_NOFOLLOW | O_CLOEXEC, 0600);
    const bool is_written = fd >= 0 && write(fd, text, length) == (ssize_t)length;
    const int error = errno;
    if (fd >= 0) {
        (void)close(fd);
    }
    errno = error;
    return is_written && rename(next, path) == 0;
}

bool editor_stage(const char *state, const upstream_t *upstream, const char *text, size_t length, char path[EDITOR_PATH_MAX],
                  char digest[EDITOR_DIGEST_MAX], char *why, size_t size)
{
    const int needed = snprintf(path, EDITOR_PATH_MAX, "%s/staged-%s.ini", state, upstream->name);
    if (needed < 0 || (size_t)needed >= EDITOR_PATH_MAX || length == 0 || length > EDITOR_TEXT_MAX) {
        (void)snprintf(why, size, "a configuration has 1 to %u bytes", EDITOR_TEXT_MAX);
        return false;
    }
    sha256_digits(text, length, digest, EDITOR_DIGEST_MAX);
    if (!is_stored(path, text, length)) {
        (void)snprintf(why, size, "the panel's state directory (--state): %s", strerror(errno));
        return false;
    }
    return true;
}

int editor_open(const char *state, const upstream_t *upstream, const char *digest, char *why, size_t size)
{
    char path[EDITOR_PATH_MAX], now[EDITOR_DIGEST_MAX];
    (void)snprintf(path, sizeof path, "%s/staged-%s.ini", state, upstream->name);
    const int from = open(path, O_RDONLY | O_NOFOLLOW | O_CLOEXEC);
    char *const text = from >= 0 ? malloc(EDITOR_TEXT_MAX + 1u) : NULL;
    const ssize_t length = text != NULL ? read(from, text, EDITOR_TEXT_MAX + 1u) : -1;
    int fd = -1;
    if (from >= 0) {
        (void)close(from);
    }
    if (length > 0) {
        sha256_digits(text, (size_t)length, now, sizeof now);
        if (strcmp(now, digest) == 0) {
            fd = sealed_text("configuration", text, (size_t)length);
        }
    }
    free(text);
    if (fd < 0) {
        (void)snprintf(why, size, "this is not what was checked last: somebody else edits it too; check it again");
    }
    return fd;
}
