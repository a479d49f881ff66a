/* SPDX-License-Identifier: MIT
 * steps.h - the table of steps, in their order.
 */
#ifndef HEAVE_SETUP_STEPS_H
#define HEAVE_SETUP_STEPS_H

#include "setup/setup.h"

/** A row. Rows of one group that follow each other are asked together for each index: all of drive 1, then all of drive 2. */
typedef struct {
    const char *key;
    setup_kind_t kind;
    unsigned group;                                          /**< 0: none */
    unsigned (*times)(const setup_t *self);                  /**< how often; 0: not at all, NULL: once */
    bool (*applies)(const setup_t *self, unsigned index);    /**< NULL: always */
    const char *text;                                        /**< %u: the index; NULL: by `say` */
    void (*say)(const setup_t *self, setup_question_t *out); /**< makes the text, and what else there is; NULL */
    const char *help, *choices, *fallback, *unit;
    double least, most;
    bool is_repeated; /**< it has an index, from 1, behind its key */
    setup_act_t act;
    setup_stage_t stage;
    bool (*check)(const setup_t *self, unsigned index, const char *text, char error[SETUP_ERROR_MAX]); /**< NULL: none */
    void (*took)(setup_t *self, unsigned index, const char *text); /**< what follows; NULL: nothing */
} step_t;

/** One chapter after the other; each ends with a row without a key. */
extern const step_t steps_geometry[], steps_drives[], steps_legs[], steps_zero[], steps_end[], steps_moves[];

/** Stroke and length of the cylinders are asked for once more, and what follows from them. */
void steps_ask_lengths(setup_t *self);

#endif
