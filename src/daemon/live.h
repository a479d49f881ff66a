/* SPDX-License-Identifier: MIT
 * live.h - heaved at work: opens everything, starts the motion thread, and does in this thread all that may be slow.
 */
#ifndef HEAVE_DAEMON_LIVE_H
#define HEAVE_DAEMON_LIVE_H

#include "config/config.h"
#include "daemon/options.h"

#define LIVE_RESTART (-1) /**< no exit code: heaved has ended to start anew, with another configuration */

/** Runs until a shutdown has ended.
 *  @param is_ready out: it was up; false: it could not be started
 *  @return the program's exit code, or LIVE_RESTART */
int live_run(const config_t *config, const options_t *options, bool *is_ready);

#endif
