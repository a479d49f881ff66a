/* SPDX-License-Identifier: MIT
 * setup_dialog.h - heavectl setup: the steps of src/setup in a terminal. It needs no heaved: it starts one of its own.
 */
#ifndef HEAVE_HEAVECTL_SETUP_DIALOG_H
#define HEAVE_HEAVECTL_SETUP_DIALOG_H

#include <signal.h>

/** Asks until everything is known, or the person leaves.
 *  @param file the configuration that is written in the end; the answers are in FILE.setup until then
 *  @return exit code; what is wrong was said */
int setup_run(const char *file, const volatile sig_atomic_t *is_interrupted);

#endif
