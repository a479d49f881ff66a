/* SPDX-License-Identifier: MIT
 * control_socket.h - opens and closes a listening socket and its file. Private to control*.c.
 */
#ifndef HEAVE_SERVICE_CONTROL_SOCKET_H
#define HEAVE_SERVICE_CONTROL_SOCKET_H

#include "service/control.h"

/** Opens the socket, in place of one that a dead daemon left behind. Prints what is wrong.
 *  @return as control_open() */
int control_socket_open(control_socket_t *self, const char *path, mode_t mode);

/** Closes the socket. Removes its file if it is still the one that was made. */
void control_socket_close(control_socket_t *self);

#endif
