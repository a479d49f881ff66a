/* SPDX-License-Identifier: MIT
 * control_configuration.h - `configuration` and `configure`: the text in force, and another one in its place. Private to
 * control*.c, but for the end of it, which its owner tells.
 */
#ifndef HEAVE_SERVICE_CONTROL_CONFIGURATION_H
#define HEAVE_SERVICE_CONTROL_CONFIGURATION_H

#include "service/control.h"

/** The text in force, as a descriptor. */
void control_configuration_answer(const control_t *self, control_client_t *client);

/** Judges a text, and has it written if it may come into force; the answer follows.
 *  @param digest of the one that it was made from */
void control_configuration_accept(control_t *self, control_client_t *client, const char *digest, uint64_t now_us);

/** Nobody waits for the disk for ever. */
void control_configuration_watch(control_client_t *client, uint64_t now_us);

/** For the owner: what came of it. @param error why it is not in force; NULL: it is */
void control_configuration_end(control_t *self, const char *error, bool is_restarting);

/** In which states another configuration may come into force: nobody rides.
 *  @param is_restart it takes a restart */
bool control_configuration_fits(state_t state, bool is_restart);

#endif
