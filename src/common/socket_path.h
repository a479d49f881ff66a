/* SPDX-License-Identifier: MIT
 * socket_path.h - where heaved listens and heavectl looks for it. A heaved started by hand has /run/heave/heaved.sock; as the
 * service heave@NAME it has a directory of its own, /run/heave/NAME, so that one box can have several platforms.
 */
#ifndef HEAVE_COMMON_SOCKET_PATH_H
#define HEAVE_COMMON_SOCKET_PATH_H

#include <stdbool.h>
#include <stddef.h>

#define SOCKET_DIRECTORY "/run/heave"
#define SOCKET_NAME      "heaved.sock"
#define SOCKET_DEFAULT   SOCKET_DIRECTORY "/" SOCKET_NAME
#define SOCKET_PATH_MAX  108u /**< with the NUL: what an address of the kernel holds */

/** Where heaved listens: as configured; where that is the default and a service manager gives a directory (RUNTIME_DIRECTORY, the
 *  first of a list), in that directory.
 *  @param path is written where it is needed
 *  @return configured or path */
const char *socket_path_of_daemon(char path[SOCKET_PATH_MAX], const char *configured);

/** The socket of the service heave@PLATFORM.
 *  @return false, and path empty: no name of a platform (empty, `.` or `..`, with a `/`, or too long) */
bool socket_path_of_platform(char path[SOCKET_PATH_MAX], const char *directory, const char *platform);

#endif
