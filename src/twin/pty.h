/* SPDX-License-Identifier: MIT
 * pty.h - a pseudo terminal that stands for a serial adapter, and a link to it under the adapter's name.
 */
#ifndef HEAVE_TWIN_PTY_H
#define HEAVE_TWIN_PTY_H

#include <stdbool.h>
#include <stddef.h>

/** Makes both; the terminal is raw.
 *  @param end      what to talk on, which never blocks
 *  @param terminal the other end, kept open so that users may come and go
 *  @return false: why says what is wrong and what to do; the descriptors that are not -1 are the caller's to close */
bool pty_open(const char *link, int *end, int *terminal, char *why, size_t size);

#endif
