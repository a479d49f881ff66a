/* SPDX-License-Identifier: MIT
 * slip.h - what a refused value most likely is: a number as another country writes it, a unit behind it, a comment that is none.
 */
#ifndef HEAVE_CONFIG_SLIP_H
#define HEAVE_CONFIG_SLIP_H

#include "config/keys.h"
#include "config/config_text.h"

/** Looks at a value that its key does not take.
 *  @param why takes the value and what is odd about it, up to "; allowed: "
 *  @return false where nothing is known; why is unchanged */
bool config_slip_find(const config_key_t *key, const char *text, config_text_t *why);

#endif
