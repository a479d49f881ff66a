/* SPDX-License-Identifier: MIT
 * play.h - offline runs: a file of frames through the same gateway, with simulated time and devices, as fast as the CPU goes.
 */
#ifndef HEAVE_DAEMON_PLAY_H
#define HEAVE_DAEMON_PLAY_H

#include "config/config.h"

/** Plays a file of frames. Prints a summary to standard error.
 *  @param trace_path where the rows go; "-": standard output; NULL: nowhere
 *  @return the program's exit code */
int play_run(const config_t *config, const char *frames_path, const char *trace_path);

#endif
