/* SPDX-License-Identifier: MIT
 * number_model.h - what decimal text must give: an independent, slow and exact model for tests.
 */
#ifndef NUMBER_MODEL_H
#define NUMBER_MODEL_H

#include "heave/number.h"

/** As number_parse, over text ended by NUL. */
number_error_t model_q16(const char *text, q16_t *value);

/** As number_finish_natural after the whole text. */
number_error_t model_natural(const char *text, uint32_t *value);

#endif
