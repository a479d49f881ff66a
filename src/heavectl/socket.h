/* SPDX-License-Identifier: MIT
 * socket.h - which heaved heavectl talks to where it is not told.
 */
#ifndef HEAVE_HEAVECTL_SOCKET_H
#define HEAVE_HEAVECTL_SOCKET_H

#include "common/socket_path.h"

/** Finds the socket to use where none is named. The first of these that exists: that of a heaved started by hand, that of the
 * only service. If nothing runs, it is the path of the first one.
 *  @param directory SOCKET_DIRECTORY, another short one in tests
 *  @param platforms gets the names of all services where there are several, separated by `, `; else empty
 *  @return false where there are several: path is empty */
bool ctl_socket_find(char path[SOCKET_PATH_MAX], const char *directory, char *platforms, size_t platforms_bytes);

#endif
