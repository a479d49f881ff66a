/* SPDX-License-Identifier: MIT
 * control_answers.h - answers from what the service thread has: the newest view, and the black box. Private to control*.c.
 */
#ifndef HEAVE_SERVICE_CONTROL_ANSWERS_H
#define HEAVE_SERVICE_CONTROL_ANSWERS_H

#include "service/control_client.h"

/** What a hand needs before and while it does anything; with the counts of the drives. */
void control_answer_tick(const control_t *self, control_client_t *client);
void control_answer_counts(const control_t *self, control_client_t *client);

/** The incidents that the black box has kept; who says that they have been seen gets the same list. */
void control_answer_incidents(control_t *self, control_client_t *client);
void control_answer_seen(control_t *self, control_client_t *client);

#endif
