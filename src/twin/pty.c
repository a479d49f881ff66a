/* SPDX-License-Identifier: MIT
 * pty.c - a pseudo terminal that stands for a serial adapter; see pty.h.
 */
#include "twin/pty.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <termios.h>
#include <unistd.h>

/* A link of an earlier run that leads nowhere is replaced; a real adapter, or a file, never is. */
static bool make_link(const char *link, const char *terminal, char *why, size_t size)
{
    struct stat there;
    struct stat target;
    if (lstat(link, &there) == 0 && (!S_ISLNK(there.st_mode) || stat(link, &target) == 0)) {
        (void)snprintf(why, size, "%s is there already: heave-twin makes its own; name a path that is free, as /tmp/heave-line",
                       link);
        return false;
    }
    (void)unlink(link);
    const bool is_made = symlink(terminal, link) == 0;
    if (!is_made) {
        (void)snprintf(why, size, "%s: %s; name a path where you may write, as /tmp/heave-line", link, strerror(errno));
    }
    return is_made;
}

bool pty_open(const char *link, int *end, int *terminal, char *why, size_t size)
{
    struct termios raw;
    char name[64];
    *end = posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC | O_NONBLOCK);
    const bool is_ours = *end >= 0 && grantpt(*end) == 0 && unlockpt(*end) == 0 && ptsname_r(*end, name, sizeof name) == 0;
    *terminal = is_ours ? open(name, O_RDWR | O_NOCTTY | O_CLOEXEC) : -1;
    if (*terminal < 0 || tcgetattr(*terminal, &raw) != 0) {
        (void)snprintf(why, size, "a pseudo terminal: %s", strerror(errno));
        return false;
    }
    cfmakeraw(&raw);
    (void)tcsetattr(*terminal, TCSANOW, &raw);
    return make_link(link, name, why, size);
}
