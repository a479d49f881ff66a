/* SPDX-License-Identifier: MIT
 * control_questions.h - requests that the service thread answers by itself, without the motion thread.
 */
#ifndef HEAVE_SERVICE_CONTROL_QUESTIONS_H
#define HEAVE_SERVICE_CONTROL_QUESTIONS_H

#include "service/control.h"
#include "service/control_client.h"

/** Answers `geometry`, `configuration`, `times` and `samples`. Service thread; does not block.
 *  @return false: another request, which is not answered */
bool control_questions_answer(const control_t *self, control_client_t *client, const char *line);

#endif
