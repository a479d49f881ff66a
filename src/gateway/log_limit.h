/* SPDX-License-Identifier: MIT
 * log_limit.h - lines of the log about the same thing, at most one a second: the first at once, a later one counts what had none.
 * Private to src/gateway.
 */
#ifndef GATEWAY_LOG_LIMIT_H
#define GATEWAY_LOG_LIMIT_H

#include "heave/gateway.h"
#include "heave/text.h"

/** Of things that somebody counts: a line is due for what no line has counted yet.
 *  @param total things so far; may wrap
 *  @return things that a line written now is about; 0: none is to be written */
uint32_t log_limit_due(log_limit_t *self, uint32_t total, uint64_t now_us);

/** Of a thing that nobody else counts, and that has just happened. */
uint32_t log_limit_event(log_limit_t *self, uint64_t now_us);

/** Appends how many others a line stands for.
 *  @param count as returned above; 1: nothing is appended */
void log_limit_put(text_t *text, uint32_t count);

#endif
