/* SPDX-License-Identifier: MIT
 * blackbox_kept.h - what the black box keeps in memory: the newest items of each lane. Private to blackbox*.c; its thread.
 */
#ifndef HEAVE_RECORD_BLACKBOX_KEPT_H
#define HEAVE_RECORD_BLACKBOX_KEPT_H

#include "record/blackbox.h"

/** Takes over what was fed meanwhile, and notices where an incident begins. */
void blackbox_pop(blackbox_t *self);

#endif
