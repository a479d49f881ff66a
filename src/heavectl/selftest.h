/* SPDX-License-Identifier: MIT
 * selftest.h - heavectl selftest: the daily check of a platform in SERVICE. A person presses, looks and answers; what moves,
 * moves while a key is held; heaved is told what came of it.
 */
#ifndef HEAVE_HEAVECTL_SELFTEST_H
#define HEAVE_HEAVECTL_SELFTEST_H

#include <signal.h>

/** Goes through the switches, the relays, the ends and the brakes, in the terminal of standard input. Blocks.
 *  @param path of the control socket
 *  @param file gets the report as JSON, whole or not at all; NULL: none is written
 *  @param is_interrupted set by a signal that ends the program
 *  @return EXIT_DONE: passed; EXIT_REFUSED: something has failed or was left out; other exit codes: it could not be made. All
 * said */
int selftest_run(const char *path, const char *file, const volatile sig_atomic_t *is_interrupted);

#endif
