/* SPDX-License-Identifier: MIT
 * setup_acts.h - what setup does, beside asking: checks, scans, moves while a key is held, writes.
 */
#ifndef HEAVE_HEAVECTL_SETUP_ACTS_H
#define HEAVE_HEAVECTL_SETUP_ACTS_H

#include "heavectl/setup_session.h"
#include "setup/setup.h"

/** Does what a step asks for.
 *  @param file the configuration to be written
 *  @param result out: the step's answer
 *  @return false: session->error says why not */
bool setup_act(setup_session_t *session, const setup_t *setup, const setup_question_t *question, const char *file,
               char result[SETUP_ANSWER_MAX]);

/** Why setup does not write over a file, to be translated. */
extern const char *const setup_acts_foreign;

/** Whether there is no such file, or setup wrote it. */
bool setup_acts_may_write(const char *file);

/** Prints words in 80 columns, line feeds as they are. */
void setup_print(const char *indent, const char *text);

#endif
