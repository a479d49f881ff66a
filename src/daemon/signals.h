/* SPDX-License-Identifier: MIT
 * signals.h - the signals that heaved acts on, as a descriptor; all others leave the motion alone.
 */
#ifndef HEAVE_DAEMON_SIGNALS_H
#define HEAVE_DAEMON_SIGNALS_H

/** Makes SIGTERM, SIGINT, SIGQUIT and SIGHUP readable (signalfd), and ignores every other signal that would end the process, or
 * stop it, in motion. Those that say that the program is broken (SIGSEGV, SIGABRT and the like) keep their effect. Call it
 * before other threads start: they inherit the mask.
 *  @return a descriptor that does not block; -1: errno says why */
int signals_open(void);

/** "SIGHUP" and so on, of those that are readable. */
const char *signals_name(int number);

#endif
