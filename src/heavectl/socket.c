/* SPDX-License-Identifier: MIT
 * socket.c - see socket.h.
 */
#include "heavectl/socket.h"

#include <glob.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

/* The folders of the sockets found, without what is before and behind. What does not fit ends in dots. */
static void list_platforms(const glob_t *found, size_t prefix, char *text, size_t bytes)
{
    size_t length = 0;
    for (size_t i = 0; i < found->gl_pathc && length < bytes; i++) {
        const char *name = &found->gl_pathv[i][prefix];
        length += (size_t)snprintf(&text[length], bytes - length, "%s%.*s", i == 0 ? "" : ", ", (int)strcspn(name, "/"), name);
    }
    if (length >= bytes) {
        (void)snprintf(&text[bytes - sizeof "..."], sizeof "...", "...");
    }
}

bool ctl_socket_find(char path[SOCKET_PATH_MAX], const char *directory, char *platforms, size_t platforms_bytes)
{
    char pattern[SOCKET_PATH_MAX];
    glob_t found = {0};
    platforms[0] = '\0';
    (void)snprintf(path, SOCKET_PATH_MAX, "%s/" SOCKET_NAME, directory);
    (void)snprintf(pattern, sizeof pattern, "%s/*/" SOCKET_NAME, directory);
    if (access(path, F_OK) == 0 || glob(pattern, 0, NULL, &found) != 0) {
        return true;
    }
    const bool is_clear = found.gl_pathc == 1;
    if (!is_clear) {
        path[0] = '\0';
        list_platforms(&found, strlen(directory) + 1, platforms, platforms_bytes);
    } else if (strlen(found.gl_pathv[0]) < SOCKET_PATH_MAX) {
        (void)snprintf(path, SOCKET_PATH_MAX, "%s", found.gl_pathv[0]);
    }
    globfree(&found);
    return is_clear;
}
