/* SPDX-License-Identifier: MIT
 * value_frame.h - frames of CAN drives: text to value and back. Called by value_can.c for the types CONFIG_FRAME
 * and CONFIG_STEP.
 */
#ifndef HEAVE_CONFIG_VALUE_FRAME_H
#define HEAVE_CONFIG_VALUE_FRAME_H

#include "config/keys.h"
#include "config/text.h"

/** As config_value_parse(), into the frame itself. */
bool config_value_frame_parse(const config_key_t *key, const char *text, canraw_frame_t *frame, config_text_t *why);

/** As config_value_format(), from the frame itself. */
void config_value_frame_format(const canraw_frame_t *frame, config_text_t *text);

/** The same for a frame with its answer and the wait behind it. */
bool config_value_step_parse(const config_key_t *key, const char *text, canraw_step_t *step, config_text_t *why);
void config_value_step_format(const canraw_step_t *step, config_text_t *text);

/** As config_value_allowed(), of both. */
void config_value_frame_allowed(const config_key_t *key, config_text_t *text);

#endif
