/* SPDX-License-Identifier: MIT
 * socket_path.c - see socket_path.h.
 */
#include "common/socket_path.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static bool write_path(char path[SOCKET_PATH_MAX], const char *directory, size_t length)
{
    const int needed = snprintf(path, SOCKET_PATH_MAX, "%.*s/" SOCKET_NAME, (int)length, directory);
    if (needed < 0 || (size_t)needed >= SOCKET_PATH_MAX) {
        path[0] = '\0';
    }
    return path[0] != '\0';
}

const char *socket_path_of_daemon(char path[SOCKET_PATH_MAX], const char *configured)
{
    const char *given = getenv("RUNTIME_DIRECTORY");
    const bool is_default = strcmp(configured, SOCKET_DEFAULT) == 0;
    const bool is_given = given != NULL && given[0] == '/';
    return is_default && is_given && write_path(path, given, strcspn(given, ":")) ? path : configured;
}

bool socket_path_of_platform(char path[SOCKET_PATH_MAX], const char *directory, const char *platform)
{
    char own[SOCKET_PATH_MAX];
    const int needed = snprintf(own, sizeof own, "%s/%s", directory, platform);
    const bool is_name =
        platform[0] != '\0' && strcmp(platform, ".") != 0 && strcmp(platform, "..") != 0 && strchr(platform, '/') == NULL;
    path[0] = '\0';
    return is_name && needed > 0 && (size_t)needed < sizeof own && write_path(path, own, strlen(own));
}
