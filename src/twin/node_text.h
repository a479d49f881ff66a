/* SPDX-License-Identifier: MIT
 * node_text.h - the texts of a simulated drive (1008h, 1009h, 100Ah): longer than what fits into an answer, so they are read in
 * segments, as those of real drives are.
 */
#ifndef HEAVE_TWIN_NODE_TEXT_H
#define HEAVE_TWIN_NODE_TEXT_H

#include <stdbool.h>
#include <stdint.h>

/** A text that is being read; all 0: none. */
typedef struct {
    const char *text; /**< what is left of it */
    bool is_toggled;
} node_text_t;

/** Takes a request to read: the beginning of a text, or its next segment.
 *  @param data the answer
 *  @return false: it is about no text, and none is read any more */
bool node_text_hear(node_text_t *self, const uint8_t request[8], uint8_t data[8]);

#endif
