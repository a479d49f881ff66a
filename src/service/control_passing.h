/* SPDX-License-Identifier: MIT
 * control_passing.h - answers that a descriptor comes with (SCM_RIGHTS): the memory of the samples, folders. Private to
 * control*.c.
 */
#ifndef HEAVE_SERVICE_CONTROL_PASSING_H
#define HEAVE_SERVICE_CONTROL_PASSING_H

#include "service/control_client.h"

void control_pass_samples(const control_t *self, control_client_t *client);

void control_pass_incident_folder(const control_t *self, control_client_t *client);
void control_pass_operator_log(const control_t *self, control_client_t *client);

#endif
