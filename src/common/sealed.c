/* SPDX-License-Identifier: MIT
 * sealed.c - see sealed.h.
 */
#include "common/sealed.h"

#include <errno.h>
#include <sys/mman.h>
#include <unistd.h>

int sealed_text(const char *name, const char *text, size_t length)
{
    const int fd = memfd_create(name, MFD_CLOEXEC | MFD_ALLOW_SEALING);
    if (fd >= 0 && pwrite(fd, text, length, 0) == (ssize_t)length && fcntl(fd, F_ADD_SEALS, SEALED_AGAINST | F_SEAL_SEAL) == 0) {
        return fd;
    }
    const int error = errno;
    if (fd >= 0) {
        (void)close(fd);
    }
    errno = error;
    return -1;
}
