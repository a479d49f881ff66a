/* SPDX-License-Identifier: MIT
 * pictures.h - how cylinders are numbered and where the frames of base and plate lie, drawn with characters.
 */
#ifndef HEAVE_SETUP_PICTURES_H
#define HEAVE_SETUP_PICTURES_H

#include "setup/setup.h"

/** In the table of steps: the help is the picture of the kind that was answered. */
#define PICTURES_HELP "picture"

/** @return the picture of the kind that was answered, in the reader's language, with what is to know about measuring */
const char *pictures_of(const setup_t *self);

#endif
