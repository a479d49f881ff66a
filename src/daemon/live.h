/* SPDX-License-Identifier: MIT
 * live.h - heaved at work: opens everything, starts the motion thread, and does in this thread all that may be slow.
 */
#ifndef HEAVE_DAEMON_LIVE_H
#define HEAVE_DAEMON_LIVE_H

#include "config/config.h"
#include "daemon/options.h"

/** Runs until a shutdown has ended.
 *  @return the program's exit code */
int live_run(const config_t *config, const options_t *options);

#endif
