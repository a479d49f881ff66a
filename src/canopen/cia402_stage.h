/* SPDX-License-Identifier: MIT
 * cia402_stage.h - what the drives do together, step by step: enabling, homing, following, and back.
 */
#ifndef CIA402_STAGE_H
#define CIA402_STAGE_H

#include "cia402_axis.h"

/** Begins to enable all drives, or to home those that have to be. Every drive must be up and without fault. */
void cia402_stage_begin(cia402_t *self, bool is_homing);

/** Ends it: every drive is led to the goal (off, or stop). */
void cia402_stage_end(cia402_t *self, cia402_goal_t goal);

/** Once per poll, behind the drives' own steps. */
void cia402_stage_step(cia402_t *self);

/** Bits of the controlword that the mode asks for while operation is enabled. */
uint16_t cia402_stage_mode_bits(const cia402_t *self, unsigned k);

#endif
