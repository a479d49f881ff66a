/* SPDX-License-Identifier: MIT
 * legs_seen.h - what the person's answers about the legs come to.
 */
#ifndef HEAVE_SETUP_LEGS_SEEN_H
#define HEAVE_SETUP_LEGS_SEEN_H

#include "setup/legs.h"
#include "setup/setup.h"

/** As legs_identify(), from the answers. */
legs_status_t legs_seen(const setup_t *self, legs_found_t *found, char text[LEGS_TEXT_MAX]);

#endif
