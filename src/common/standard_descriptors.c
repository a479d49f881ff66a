/* SPDX-License-Identifier: MIT
 * standard_descriptors.c - descriptors 0 to 2; see standard_descriptors.h.
 */
#include "common/standard_descriptors.h"

#include <fcntl.h>
#include <unistd.h>

bool standard_descriptors_open(void)
{
    static const int k_flags[] = {[STDIN_FILENO] = O_WRONLY, [STDOUT_FILENO] = O_RDONLY, [STDERR_FILENO] = O_WRONLY};
    for (int fd = STDIN_FILENO; fd <= STDERR_FILENO; fd++) {
        if (fcntl(fd, F_GETFD) < 0 && open("/dev/null", k_flags[fd]) != fd) { /* the lowest one that is free */
            return false;
        }
    }
    return true;
}
