/* SPDX-License-Identifier: MIT
 * node_text.h - the texts of a simulated drive (1008h, 1009h, 100Ah): longer than what fits into an answer, so they are read in
 * segments, as those of real drives are. Numbers are, too, in drives that have nothing else.
 */
#ifndef HEAVE_TWIN_NODE_TEXT_H
#define HEAVE_TWIN_NODE_TEXT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/** A text that is being read; all 0: none. */
typedef struct {
    const uint8_t *at; /**< what is left of it; NULL = nothing */
    size_t left;
    uint8_t number[4];
    bool is_toggled;
    bool is_inverted; /**< sends its toggle bit so, which is wrong */
} node_text_t;

/** Takes a request to read: the beginning of a text, or its next segment.
 *  @param data the answer
 *  @return false: it is about no text, and none is read any more */
bool node_text_hear(node_text_t *self, const uint8_t request[8], uint8_t data[8]);

/** Begins to answer with a number.
 *  @param data the first answer */
void node_text_number(node_text_t *self, const uint8_t request[8], uint32_t value, uint8_t bytes, uint8_t data[8]);

#endif
