/* SPDX-License-Identifier: MIT
 * layout.h - what is odd about the joints of a platform, as a person would say it: metres, an order that is turned, mirrored or
 * has two joints exchanged, one digit typed wrong. Figures for people, from a symmetry that nearly every platform has; nothing
 * that moves depends on them.
 */
#ifndef HEAVE_PLATFORM_LAYOUT_H
#define HEAVE_PLATFORM_LAYOUT_H

#include "config/source.h"

/** Refuses joints that look like metres, and joints that one slip of a hand explains, unless [geometry] as_measured = yes. */
void config_layout_check(config_source_t *self);

/** What is odd and may be meant, one after the other.
 *  @param at   0 at first; counts up
 *  @param text out: a warning
 *  @return false where there is no more */
bool config_layout_next_oddity(const config_t *config, unsigned *at, config_text_t *text);

#endif
