/* SPDX-License-Identifier: MIT
 * flood_filter.h - what the kernel drops in a flood: datagrams that cannot be frames, and senders that are not allowed.
 */
#ifndef HEAVE_DAEMON_FLOOD_FILTER_H
#define HEAVE_DAEMON_FLOOD_FILTER_H

#include "config/config.h"
#include "heave/owner.h"
#include "linux_udp_filter.h"

#define FLOOD_OTHERS_ONE_OF 32u

/** Frames of the sender that drives come through, and of the others one in FLOOD_OTHERS_ONE_OF: what looks like a frame may be
 *  a flood as well. Where nobody drives: those of all.
 *  Lets through every datagram that begins as a frame of the configured dialect does, as far as its command. Blanks and ends of
 *  lines in front of it are let through too, as the scanner passes over them.
 *  @return it points into constant tables */
linux_udp_filter_t flood_filter_of(const config_t *config, const owner_t *owner);

/** Whether the filter is another one for this sender. */
bool flood_filter_is_old(const owner_t *before, const owner_t *owner);

#endif
